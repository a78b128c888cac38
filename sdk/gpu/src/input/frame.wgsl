// Channels from colour and depth, each minus MIDDLE, with depth stretched about it, and in a second group the position
// in the frame. Appended to pack.wgsl and to planar.wgsl or camera.wgsl, which read `colour`.

@group(0) @binding(2) var<storage, read> depth: array<u32>;

// Returns the f32 nearest to w/65535, whose binary fraction repeats the bits of w. Drivers' divisions are not exact,
// and the sweep needs the exact plane of each pixel.
fn normalized(w: u32) -> f32 {
    if (w == 0u) { return 0.0; }
    let bits = (w << 16u) | w;
    let zeros = countLeadingZeros(bits);
    let leading = (bits << zeros) | (w >> (16u - zeros));
    // A carry out of the mantissa increments the exponent.
    let rounded = (leading >> 8u) + ((leading >> 7u) & 1u);
    return bitcast<f32>(((125u - zeros) << 23u) + rounded);
}

fn distance_at(at: u32) -> f32 {
    if (WORDS) { return normalized((depth[at / 2u] >> (16u * (at % 2u))) & 65535u); }
    return bitcast<f32>(depth[at]);
}

fn channels(group: u32, x: u32, y: u32) -> vec4f {
    if (group == 1u) {
        let place = (vec2f(vec2u(x, y)) + 0.5) / vec2f(vec2u(frame.width, frame.height)) - 0.5;
        return vec4f(place, 0.0, 0.0);
    }
    let value = vec4f(rgb(x, y), distance_at(y * frame.width + x)) - MIDDLE;
    return vec4f(value.rgb, value.a * DEPTH_SCALE);
}
