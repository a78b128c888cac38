// Packs the planes of each pixel's points into a word: 10 bits for the visible surface and 11 for each of two hidden
// layers. The header from sweep.rs defines COUNT, the number of planes, and HIDDEN, the number of hidden layers.

@group(0) @binding(0) var<uniform> frame: vec4u;
// Red, green, blue and depth.
@group(0) @binding(1) var<storage, read> surfaces: array<vec4f>;
@group(0) @binding(2) var<storage, read> sources: array<u32>;
@group(0) @binding(3) var<storage, read_write> points: array<u32>;

const NOTHING: u32 = 0xffffffffu;
// The value without a hidden surface. There are at most 1024 planes.
const NO_PLANE: u32 = 2047u;

// Returns ⌊depth·COUNT⌋ for depths in [0, 1], exactly as f64 does. f32 would round up to the next plane.
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
