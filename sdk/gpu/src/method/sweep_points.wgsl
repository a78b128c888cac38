// The plane of each pixel's points, of what is seen and of two hidden layers, in a word: 10 bits, 11 and 11. The header
// that sweep.rs writes before this text gives COUNT, the planes, and HIDDEN, the hidden layers.

@group(0) @binding(0) var<uniform> frame: vec4u;
// Red, green, blue, depth.
@group(0) @binding(1) var<storage, read> surfaces: array<vec4f>;
@group(0) @binding(2) var<storage, read> sources: array<u32>;
@group(0) @binding(3) var<storage, read_write> points: array<u32>;

const NOTHING: u32 = 0xffffffffu;
// Where nothing is hidden; there are at most 1024 planes.
const NO_PLANE: u32 = 2047u;

// ⌊depth·COUNT⌋ for depths in [0, 1], exactly, as f64 gives it: f32 would round up to the next plane.
fn plane_of(depth: f32) -> u32 {
    let bits = bitcast<u32>(depth);
    let exponent = bits >> 23u;
    if (exponent < 96u) { return 0u; }
    // The product is (high·2¹² + low)·2^(exponent − 150), low < 2¹².
    let mantissa = (bits & 0x7fffffu) | 0x800000u;
    let high = (mantissa >> 12u) * COUNT + (((mantissa & 4095u) * COUNT) >> 12u);
    let shift = 138u - exponent;
    return min(select(0u, high >> min(shift, 31u), shift < 32u), COUNT - 1u);
}

fn hidden_plane(layer: u32, pixel: u32) -> u32 {
    if (layer >= HIDDEN) { return NO_PLANE; }
    let source = sources[layer * frame.z + pixel];
    if (source == NOTHING) { return NO_PLANE; }
    return plane_of(surfaces[source].w);
}

@compute @workgroup_size(64)
fn find(@builtin(global_invocation_id) at: vec3u) {
    if (at.x >= frame.x) { return; }
    let pixel = at.y * frame.x + at.x;
    points[pixel] = plane_of(surfaces[pixel].w)
        | (hidden_plane(0u, pixel) << 10u)
        | (hidden_plane(1u, pixel) << 21u);
}
