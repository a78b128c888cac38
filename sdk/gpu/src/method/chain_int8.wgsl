// The number format of an int8 chain, bit-identical to the int8 module of `phasefront-kernels`. The header from
// chain.rs defines the constants in capitals and `weights`. chain.wgsl follows.
//
// A word holds four activations minus 128, so that they are signed like the weights. The biases compensate for this.
// The sums are followed by one multiplication, an addition and roundings. The products of the roundings come from
// tables, so that no driver can fuse two operations and change the result.

alias Value = u32;
// A tap's weights for eight filters, four channels in each word.
const WORDS: u32 = 1u;
// The words before a layer's weights: its biases, then the bits of its multipliers.
const HEADER: u32 = 2u * BLOCKS;
const SIGN: u32 = 0x80808080u;

struct Work { a0: vec4i, a1: vec4i, a2: vec4i, a3: vec4i, b0: vec4i, b1: vec4i, b2: vec4i, b3: vec4i }
// For each u8 value: the skip's share, the rounded ReLU's share, and the value as the next layer reads it.
struct Tables { skip: array<f32, 256>, relu: array<f32, 256>, next: array<u32, 256> }

@group(0) @binding(8) var<storage, read> tables: Tables;
@group(0) @binding(9) var<storage, read> image: array<vec4f>;

fn zero() -> Value { return ZERO; }

fn dots(low: vec4u, v: u32) -> vec4i {
    return vec4i(
        dot4I8Packed(low.x, v), dot4I8Packed(low.y, v), dot4I8Packed(low.z, v), dot4I8Packed(low.w, v),
    );
}

fn tap(s: ptr<function, Work>, at: u32, v0: u32, v1: u32, v2: u32, v3: u32) {
    let w = weights[at];
    (*s).a0 += dots(w.low, v0);
    (*s).a1 += dots(w.low, v1);
    (*s).a2 += dots(w.low, v2);
    (*s).a3 += dots(w.low, v3);
    (*s).b0 += dots(w.high, v0);
    (*s).b1 += dots(w.high, v1);
    (*s).b2 += dots(w.high, v2);
    (*s).b3 += dots(w.high, v3);
}

fn begun(at: u32) -> Work {
    let bias = weights[at];
    let a = bitcast<vec4i>(bias.low);
    let b = bitcast<vec4i>(bias.high);
    return Work(a, a, a, a, b, b, b, b);
}

fn column_done(s: ptr<function, Work>) {}

fn ended(s: Work, at: u32) -> Totals {
    let factor = weights[at + BLOCKS];
    let a = bitcast<vec4f>(factor.low);
    let b = bitcast<vec4f>(factor.high);
    return Totals(
        vec4f(s.a0) * a, vec4f(s.a1) * a, vec4f(s.a2) * a, vec4f(s.a3) * a,
        vec4f(s.b0) * b, vec4f(s.b1) * b, vec4f(s.b2) * b, vec4f(s.b3) * b,
    );
}

fn byte(word: u32, k: u32) -> u32 { return (word >> (8u * k)) & 255u; }

fn packed(q: vec4u) -> u32 { return (q.x | (q.y << 8u) | (q.z << 16u) | (q.w << 24u)) ^ SIGN; }

fn saturated(v: vec4f) -> vec4u { return vec4u(round(clamp(v, vec4f(0), vec4f(255)))); }

// Convert a layer's scaled sums to the next layer's input, without a skip and with one.
fn activation(v: vec4f) -> Value { return packed(saturated(v)); }

fn residual(v: vec4f, skip: Value) -> Value {
    let s = skip ^ SIGN;
    var a = max(v, vec4f(0));
    if (ROUNDED_RELU) {
        let r = saturated(v);
        a = vec4f(tables.relu[r.x], tables.relu[r.y], tables.relu[r.z], tables.relu[r.w]);
    }
    let share = vec4f(
        tables.skip[byte(s, 0u)], tables.skip[byte(s, 1u)], tables.skip[byte(s, 2u)], tables.skip[byte(s, 3u)],
    );
    return packed(saturated(a + share));
}

// Applies the second rounding before the concatenation.
fn following(v: Value) -> Value {
    if (!NEXT) { return v; }
    let q = v ^ SIGN;
    return packed(vec4u(
        tables.next[byte(q, 0u)], tables.next[byte(q, 1u)], tables.next[byte(q, 2u)], tables.next[byte(q, 3u)],
    ));
}

// Returns the network's input, to which its correction is added.
fn base(at: u32) -> vec4f { return image[at]; }
