// A frame as it comes to what the chain reads: groups of four channels, each minus a half, in the chain's numbers. The
// header that input.rs writes before this text gives `Value` and the constants in capitals.

struct Frame { width: u32, height: u32, plane: u32, unused: u32 }
// The smallest real number that rounds to each u8 value or above, for the first layer and for the last one.
struct Steps { first: array<f32, 256>, last: array<f32, 256> }

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> colour: array<u32>;
@group(0) @binding(2) var<storage, read> depth: array<u32>;
@group(0) @binding(3) var<storage, read_write> first: array<Value>;
@group(0) @binding(4) var<storage, read_write> last: array<u32>;
@group(0) @binding(5) var<storage, read_write> image: array<vec4f>;
@group(0) @binding(6) var<storage, read> steps: Steps;

fn rgb(x: u32, y: u32) -> vec3f {
    let at = y * frame.width + x;
    if (COLOUR == PLANAR) {
        return vec3f(
            bitcast<f32>(colour[at]), bitcast<f32>(colour[frame.plane + at]), bitcast<f32>(colour[2u * frame.plane + at]),
        );
    }
    let word = colour[at];
    let v = vec3f(f32(word & 255u), f32((word >> 8u) & 255u), f32((word >> 16u) & 255u)) / 255.0;
    return select(v, v.zyx, COLOUR == BGRA);
}

fn distance(at: u32) -> f32 {
    if (DEPTH == REAL) { return bitcast<f32>(depth[at]); }
    return f32((depth[at / 2u] >> (16u * (at % 2u))) & 65535u) / 65535.0;
}

// Channels 4 group … 4 group + 3.
fn channels(group: u32, x: u32, y: u32) -> vec4f {
    let at = y * frame.width + x;
    if (COLOUR == READY) {
        var v = vec4f(0);
        for (var k = 0u; k < 4u; k++) {
            if (4u * group + k < CHANNELS) { v[k] = bitcast<f32>(colour[(4u * group + k) * frame.plane + at]); }
        }
        return v;
    }
    return vec4f(rgb(x, y), distance(at)) - 0.5;
}

fn rounded_first(real: f32) -> u32 {
    var k = 0u;
    for (var step = 128u; step > 0u; step /= 2u) {
        if (real >= steps.first[k + step]) { k += step; }
    }
    return k;
}

fn rounded_last(real: f32) -> u32 {
    var k = 0u;
    for (var step = 128u; step > 0u; step /= 2u) {
        if (real >= steps.last[k + step]) { k += step; }
    }
    return k;
}

@compute @workgroup_size(64)
fn pack(@builtin(global_invocation_id) at: vec3u) {
    let x = at.x;
    let y = at.y;
    if (x >= frame.width) { return; }
    for (var group = 0u; group < GROUPS; group++) {
        let v = channels(group, x, y);
        store(group, group * frame.plane + y * frame.width + x, v);
    }
}
