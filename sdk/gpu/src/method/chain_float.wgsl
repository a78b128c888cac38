// The number format of a floating-point chain. The header from chain.rs defines `Real`, `Real4`, HALF, the other
// constants in capitals and `weights`. chain.wgsl follows.
//
// In f16 the products of one column of taps are summed in f16 and the columns in f32. In f32 there is one sum.

alias Value = Real4;
// A tap's weights for eight filters, one word for each channel.
const WORDS: u32 = 4u;
// The words before a layer's weights: its biases.
const HEADER: u32 = BLOCKS;

// The sums of eight filters (a: 0 to 3, b: 4 to 7) for four pixels, and in f16 the totals that they are added to.
struct Work {
    a0: Real4, a1: Real4, a2: Real4, a3: Real4, b0: Real4, b1: Real4, b2: Real4, b3: Real4, total: Totals,
}

fn zero() -> Value { return Real4(0); }

// Adds one tap of four channels: pixel p of the column reads v(p).
fn tap(s: ptr<function, Work>, at: u32, v0: Real4, v1: Real4, v2: Real4, v3: Real4) {
    let x = weights[at];
    (*s).a0 = fma(x.low, Real4(v0.x), (*s).a0);
    (*s).a1 = fma(x.low, Real4(v1.x), (*s).a1);
    (*s).a2 = fma(x.low, Real4(v2.x), (*s).a2);
    (*s).a3 = fma(x.low, Real4(v3.x), (*s).a3);
    (*s).b0 = fma(x.high, Real4(v0.x), (*s).b0);
    (*s).b1 = fma(x.high, Real4(v1.x), (*s).b1);
    (*s).b2 = fma(x.high, Real4(v2.x), (*s).b2);
    (*s).b3 = fma(x.high, Real4(v3.x), (*s).b3);
    let y = weights[at + 1u];
    (*s).a0 = fma(y.low, Real4(v0.y), (*s).a0);
    (*s).a1 = fma(y.low, Real4(v1.y), (*s).a1);
    (*s).a2 = fma(y.low, Real4(v2.y), (*s).a2);
    (*s).a3 = fma(y.low, Real4(v3.y), (*s).a3);
    (*s).b0 = fma(y.high, Real4(v0.y), (*s).b0);
    (*s).b1 = fma(y.high, Real4(v1.y), (*s).b1);
    (*s).b2 = fma(y.high, Real4(v2.y), (*s).b2);
    (*s).b3 = fma(y.high, Real4(v3.y), (*s).b3);
    let z = weights[at + 2u];
    (*s).a0 = fma(z.low, Real4(v0.z), (*s).a0);
    (*s).a1 = fma(z.low, Real4(v1.z), (*s).a1);
    (*s).a2 = fma(z.low, Real4(v2.z), (*s).a2);
    (*s).a3 = fma(z.low, Real4(v3.z), (*s).a3);
    (*s).b0 = fma(z.high, Real4(v0.z), (*s).b0);
    (*s).b1 = fma(z.high, Real4(v1.z), (*s).b1);
    (*s).b2 = fma(z.high, Real4(v2.z), (*s).b2);
    (*s).b3 = fma(z.high, Real4(v3.z), (*s).b3);
    let w = weights[at + 3u];
    (*s).a0 = fma(w.low, Real4(v0.w), (*s).a0);
    (*s).a1 = fma(w.low, Real4(v1.w), (*s).a1);
    (*s).a2 = fma(w.low, Real4(v2.w), (*s).a2);
    (*s).a3 = fma(w.low, Real4(v3.w), (*s).a3);
    (*s).b0 = fma(w.high, Real4(v0.w), (*s).b0);
    (*s).b1 = fma(w.high, Real4(v1.w), (*s).b1);
    (*s).b2 = fma(w.high, Real4(v2.w), (*s).b2);
    (*s).b3 = fma(w.high, Real4(v3.w), (*s).b3);
}

fn begun(at: u32) -> Work {
    let bias = weights[at];
    let a = bias.low;
    let b = bias.high;
    if (HALF) {
        let z = Real4(0);
        let x = vec4f(a);
        let y = vec4f(b);
        return Work(z, z, z, z, z, z, z, z, Totals(x, x, x, x, y, y, y, y));
    }
    let none = vec4f(0);
    return Work(a, a, a, a, b, b, b, b, Totals(none, none, none, none, none, none, none, none));
}

fn column_done(w: ptr<function, Work>) {
    if (HALF) {
        let t = (*w).total;
        let total = Totals(
            t.a0 + vec4f((*w).a0), t.a1 + vec4f((*w).a1), t.a2 + vec4f((*w).a2), t.a3 + vec4f((*w).a3),
            t.b0 + vec4f((*w).b0), t.b1 + vec4f((*w).b1), t.b2 + vec4f((*w).b2), t.b3 + vec4f((*w).b3),
        );
        let z = Real4(0);
        *w = Work(z, z, z, z, z, z, z, z, total);
    }
}

fn ended(w: Work, at: u32) -> Totals {
    if (HALF) { return w.total; }
    return Totals(
        vec4f(w.a0), vec4f(w.a1), vec4f(w.a2), vec4f(w.a3), vec4f(w.b0), vec4f(w.b1), vec4f(w.b2), vec4f(w.b3),
    );
}

// Convert a layer's sums to the next layer's input, without a skip and with one.
fn activation(v: vec4f) -> Value { return Real4(max(v, vec4f(0))); }
fn residual(v: vec4f, skip: Value) -> Value { return Real4(max(v, vec4f(0)) + vec4f(skip)); }
fn following(v: Value) -> Value { return v; }

// Returns the network's input, to which its correction is added.
fn base(at: u32) -> vec4f { return vec4f(beside[at]); }
