// What an eye sees of a modulator's levels: the field behind the modulator, and the amplitudes that came of it.

struct Frame { width: u32, height: u32, plane: u32, unused: u32 }

@group(0) @binding(0) var<uniform> frame: Frame;
// (cos φ, sin φ) of the phase that each level shows.
@group(0) @binding(1) var<storage, read> shown: array<vec2f, 256>;
@group(0) @binding(2) var<storage, read> levels: array<u32>;
@group(0) @binding(3) var<storage, read_write> field: array<vec2f>;
@group(0) @binding(4) var<storage, read> seen: array<vec2f>;
@group(0) @binding(5) var picture: texture_storage_2d<rgba8unorm, write>;
@group(0) @binding(6) var<storage, read_write> amplitudes: array<vec4f>;

@compute @workgroup_size(64)
fn shine(@builtin(global_invocation_id) at: vec3u) {
    if (at.x >= frame.width) { return; }
    let i = at.y * frame.width + at.x;
    let word = levels[i];
    field[i] = shown[word & 255u];
    field[frame.plane + i] = shown[(word >> 8u) & 255u];
    field[2u * frame.plane + i] = shown[(word >> 16u) & 255u];
}

@compute @workgroup_size(64)
fn see(@builtin(global_invocation_id) at: vec3u) {
    if (at.x >= frame.width) { return; }
    let i = at.y * frame.width + at.x;
    let rgb = vec3f(length(seen[i]), length(seen[frame.plane + i]), length(seen[2u * frame.plane + i]));
    amplitudes[i] = vec4f(rgb, 1.0);
    textureStore(picture, vec2u(at.x, at.y), vec4f(rgb, 1.0));
}
