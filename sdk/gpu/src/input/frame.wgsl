// Channels from colour and depth, each minus MIDDLE, with depth stretched about it, and in a second group the position
// in the frame. Appended to pack.wgsl and to the sources of colour and depth, `rgb` and `distance_at`.

fn channels(group: u32, x: u32, y: u32) -> vec4f {
    if (group == 1u) {
        let place = (vec2f(vec2u(x, y)) + 0.5) / vec2f(vec2u(frame.width, frame.height)) - 0.5;
        return vec4f(place, 0.0, 0.0);
    }
    let value = vec4f(rgb(x, y), distance_at(y * frame.width + x)) - MIDDLE;
    return vec4f(value.rgb, value.a * DEPTH_SCALE);
}
