// Packs the planes of each pixel's points into a word: 10 bits for the visible surface and 11 for each of two hidden
// layers. A point is on the plane in the word or between it and the next one behind it. sweep_shares.wgsl comes before
// this file, after the header from sweep.rs.

@group(0) @binding(0) var<uniform> frame: vec4u;
// Red, green, blue and depth.
@group(0) @binding(1) var<storage, read> surfaces: array<vec4f>;
@group(0) @binding(2) var<storage, read> sources: array<u32>;
@group(0) @binding(3) var<storage, read_write> points: array<u32>;

const NOTHING: u32 = 0xffffffffu;
// The value without a hidden surface. There are at most 1024 planes.
const NO_PLANE: u32 = 2047u;

fn hidden_plane(layer: u32, pixel: u32) -> u32 {
    if (layer >= HIDDEN) { return NO_PLANE; }
    let source = sources[layer * frame.z + pixel];
    if (source == NOTHING) { return NO_PLANE; }
    return u32(position(surfaces[source].w));
}

@compute @workgroup_size(64)
fn find(@builtin(global_invocation_id) at: vec3u) {
    if (at.x >= frame.x) { return; }
    let pixel = at.y * frame.x + at.x;
    points[pixel] = u32(position(surfaces[pixel].w))
        | (hidden_plane(0u, pixel) << 10u)
        | (hidden_plane(1u, pixel) << 21u);
}
