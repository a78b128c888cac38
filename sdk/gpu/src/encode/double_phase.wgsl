// Converts the field at the modulator to levels: dark threshold, blur, light, double phase, response. `peak` finds the
// largest amplitude, by which `encode` scales. The header from double_phase.rs defines the constants in capitals.

struct Frame { width: i32, height: i32, plane: u32, unused: u32 }
// The centre tap of the blur and the taps on one side, and the fixed scale.
struct Settings { taps: vec3f, scale: f32 }

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> settings: Settings;
@group(0) @binding(2) var<storage, read> field: array<vec2f>;
@group(0) @binding(3) var<storage, read> turn: array<vec2f>;
// The bits of the largest squared amplitude. The bits of nonnegative floats have the order of their values.
@group(0) @binding(4) var<storage, read_write> largest: atomic<u32>;
@group(0) @binding(5) var<storage, read> found: array<u32>;
@group(0) @binding(6) var<storage, read_write> levels: array<u32>;
@group(0) @binding(7) var shown: texture_storage_2d<rgba8unorm, write>;
// With TABLE the level of each step. With PIXELS the curves of the nodes, K + 1 knots each, then their turns. Otherwise
// unused. See response.rs and response/per_pixel.rs.
@group(0) @binding(8) var<storage, read> response: array<u32>;

// The inverse amplitude of the laser light at the nodes, three planes. See illumination.rs.
@group(0) @binding(9) var<storage, read> gains: array<f32>;

const PI: f32 = 3.14159265358979;
const TAU: f32 = 6.28318530717959;

var<workgroup> most: array<f32, 64>;

// `before` returns the node before pixel n of `count`. `beyond` returns the fraction of the way to the next node.
fn before(n: u32, count: u32, nodes: u32) -> u32 { return min(n * (nodes - 1u) / max(count - 1u, 1u), nodes - 2u); }

fn beyond(n: u32, count: u32, nodes: u32) -> f32 {
    let steps = max(count - 1u, 1u);
    return f32(n * (nodes - 1u) - before(n, count, nodes) * steps) / f32(steps);
}

// Returns the factor that compensates a pixel's illumination. The frame is in the middle of the modulator.
fn gain(colour: u32, x: u32, y: u32) -> f32 {
    let height = max(ALL_HEIGHT, u32(frame.height));
    let width = max(ALL_WIDTH, u32(frame.width));
    let row = y + (height - u32(frame.height)) / 2u;
    let column = x + (width - u32(frame.width)) / 2u;
    let fx = beyond(column, width, LIGHT_COLUMNS);
    let fy = beyond(row, height, LIGHT_ROWS);
    let at = (colour * LIGHT_ROWS + before(row, height, LIGHT_ROWS)) * LIGHT_COLUMNS
        + before(column, width, LIGHT_COLUMNS);
    let left = gains[at] + (gains[at + LIGHT_COLUMNS] - gains[at]) * fy;
    let right = gains[at + 1u] + (gains[at + LIGHT_COLUMNS + 1u] - gains[at + 1u]) * fy;
    return left + (right - left) * fx;
}

fn turned(colour: u32, u: vec2f) -> vec2f {
    let v = turn[colour];
    return vec2f(u.x * v.x - u.y * v.y, u.x * v.y + u.y * v.x);
}

// Returns the amplitude of full brightness.
fn full_light() -> f32 {
    if (FIXED) { return settings.scale; }
    return sqrt(bitcast<f32>(found[0]));
}

// Returns 1 over an amplitude, or 0 for amplitude 0.
fn over(amplitude: f32) -> f32 { return select(0.0, 1.0 / amplitude, amplitude > 0.0); }

// Returns 1 over the amplitude below which values are pulled to the real axis, or 0 without a dark threshold.
fn per_dark(scale: f32) -> f32 { return over(DARK * scale); }

// Returns the field at a pixel, pulled to the real axis if it is dark. See encode/dark_threshold.rs.
fn source(colour: u32, x: i32, y: i32, per_dark: f32) -> vec2f {
    var u = field[colour * frame.plane + u32(y * frame.width + x)];
    if (per_dark > 0.0) {
        if (TURN) { u = turned(colour, u); }
        let amplitude = sqrt(dot(u, u));
        let weight = min(amplitude * per_dark, 1.0);
        u = vec2f(weight * u.x + (1.0 - weight) * amplitude, weight * u.y);
    }
    return u;
}

// Returns a colour's value at a pixel: blurred, turned if that was not done before, and divided by the light.
fn value(colour: u32, x: i32, y: i32, per_dark: f32) -> vec2f {
    var sum = vec2f(0);
    if (HALF == 0) {
        sum = source(colour, x, y, per_dark);
    } else {
        for (var dy = -HALF; dy <= HALF; dy++) {
            let j = clamp(y + dy, 0, frame.height - 1);
            for (var dx = -HALF; dx <= HALF; dx++) {
                let i = clamp(x + dx, 0, frame.width - 1);
                let weight = settings.taps[abs(dx)] * settings.taps[abs(dy)];
                sum += weight * source(colour, i, j, per_dark);
            }
        }
    }
    if (TURN && per_dark == 0.0) { sum = turned(colour, sum); }
    if (LIT) { sum *= gain(colour, u32(x), u32(y)); }
    return sum;
}

// Computes the arc cosine for numbers in [0, 1] to 1e-6. See double_phase.rs. Drivers guarantee only 5e-4.
fn arc_cosine(a: f32) -> f32 {
    var p = -0.0012624911;
    p = p * a + 0.00667009;
    p = p * a - 0.017088126;
    p = p * a + 0.03089188;
    p = p * a - 0.050174305;
    p = p * a + 0.08897899;
    p = p * a - 0.2145988;
    p = p * a + PI / 2.0;
    return sqrt(max(1.0 - a, 0.0)) * p;
}

fn angle(v: vec2f) -> f32 {
    let a = abs(v);
    let slope = min(a.x, a.y) / max(max(a.x, a.y), 1.17549435e-38);
    let q = slope * slope;
    var p = 0.0028662257;
    p = p * q - 0.016165737;
    p = p * q + 0.042909614;
    p = p * q - 0.07528964;
    p = p * q + 0.10656264;
    p = p * q - 0.142089;
    p = p * q + 0.1999355;
    p = p * q - 0.33333145;
    p = p * q + 1.0;
    let octant = slope * p;
    let quadrant = select(octant, PI / 2.0 - octant, a.y > a.x);
    let half = select(quadrant, PI - quadrant, v.x < 0.0);
    return select(half, -half, v.y < 0.0);
}

fn node(colour: u32, i: u32, j: u32) -> u32 {
    return (colour * ROWS + min(i, ROWS - 1u)) * COLUMNS + min(j, COLUMNS - 1u);
}

// Interpolates the nodes' values at `first` + node·stride between the four nodes around a pixel: in y, then in x.
fn between(colour: u32, x: u32, y: u32, first: u32, stride: u32) -> f32 {
    let i = y / SPACING;
    let j = x / SPACING;
    let fx = f32(x % SPACING) / f32(SPACING);
    let fy = f32(y % SPACING) / f32(SPACING);
    let a = bitcast<f32>(response[first + node(colour, i, j) * stride]);
    let b = bitcast<f32>(response[first + node(colour, i + 1u, j) * stride]);
    let c = bitcast<f32>(response[first + node(colour, i, j + 1u) * stride]);
    let d = bitcast<f32>(response[first + node(colour, i + 1u, j + 1u) * stride]);
    let left = a + (b - a) * fy;
    let right = c + (d - c) * fy;
    return left + (right - left) * fx;
}

// Returns the level of a phase at a pixel that has its own curve.
fn pixel_level(phase: f32, colour: u32, x: u32, y: u32) -> u32 {
    let turns = 3u * ROWS * COLUMNS * (INTERVALS + 1u);
    let firstzero = phase >= between(colour, x, y, turns, 1u);
    let t = select(phase, 0.0, firstzero) * (f32(INTERVALS) / TAU);
    let k = min(u32(t), INTERVALS - 1u);
    let here = between(colour, x, y, k, INTERVALS + 1u);
    let next = between(colour, x, y, k + 1u, INTERVALS + 1u);
    return u32(clamp(here + (next - here) * (t - f32(k)) + 0.5, 0.0, 255.0));
}

// Returns the level of a phase from -3π/2 to 3π/2.
fn level(angle: f32, colour: u32, x: i32, y: i32) -> u32 {
    let phase = select(angle, angle + TAU, angle < 0.0);
    if (PIXELS) { return pixel_level(select(phase, 0.0, phase >= TAU), colour, u32(x), u32(y)); }
    let step = u32(phase * (f32(STEPS) / TAU) + 0.5) & (STEPS - 1u);
    if (TABLE) { return response[step]; }
    return step;
}

fn put(x: i32, y: i32, rgb: vec3u) {
    levels[u32(y * frame.width + x)] = rgb.x | (rgb.y << 8u) | (rgb.z << 16u) | 0xff000000u;
    textureStore(shown, vec2i(x, y), vec4f(vec3f(rgb) / 255.0, 1.0));
}

@compute @workgroup_size(64)
fn encode(@builtin(global_invocation_id) at: vec3u) {
    let x = i32(at.x);
    let y = i32(at.y);
    if (x >= frame.width) { return; }
    let scale = full_light();
    let inverse = over(scale);
    var rgb = vec3u(0);
    for (var c = 0u; c < 3u; c++) {
        let v = value(c, x, y, per_dark(scale));
        let half = arc_cosine(min(sqrt(dot(v, v)) * inverse, 1.0));
        rgb[c] = level(angle(v) + select(-half, half, ((x + y) & 1) == 0), c, x, y);
    }
    put(x, y, rgb);
}

@compute @workgroup_size(64)
fn peak(@builtin(global_invocation_id) at: vec3u, @builtin(local_invocation_index) thread: u32) {
    let x = i32(at.x);
    let y = i32(at.y);
    var square = 0.0;
    if (x < frame.width) {
        for (var c = 0u; c < 3u; c++) {
            let v = value(c, x, y, 0.0);
            square = max(square, dot(v, v));
        }
    }
    most[thread] = square;
    for (var step = 32u; step > 0u; step /= 2u) {
        workgroupBarrier();
        if (thread < step) { most[thread] = max(most[thread], most[thread + step]); }
    }
    if (thread == 0u) { atomicMax(&largest, bitcast<u32>(most[0])); }
}
