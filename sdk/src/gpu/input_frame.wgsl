// Channels from colour and depth, each minus a half, and of a second group the place in the frame. Goes behind input.wgsl and input_planar.wgsl or
// input_camera.wgsl, which know what `colour` holds.

@group(0) @binding(2) var<storage, read> depth: array<u32>;

fn distance_at(at: u32) -> f32 {
    if (WORDS) { return f32((depth[at / 2u] >> (16u * (at % 2u))) & 65535u) / 65535.0; }
    return bitcast<f32>(depth[at]);
}

fn channels(group: u32, x: u32, y: u32) -> vec4f {
    if (group == 1u) {
        let place = (vec2f(vec2u(x, y)) + 0.5) / vec2f(vec2u(frame.width, frame.height)) - 0.5;
        return vec4f(place, 0.0, 0.0);
    }
    return vec4f(rgb(x, y), distance_at(y * frame.width + x)) - 0.5;
}
