// Channels from a complex field: the real parts of the colours, then the imaginary parts. With SPLIT, both in two
// parts. Appended to pack.wgsl.

@group(0) @binding(1) var<storage, read> colour: array<vec2f>;

fn channels(group: u32, x: u32, y: u32) -> vec4f {
    let at = y * frame.width + x;
    let red = colour[at];
    let green = colour[frame.plane + at];
    let blue = colour[2u * frame.plane + at];
    let re = vec3f(red.x, green.x, blue.x);
    let im = vec3f(red.y, green.y, blue.y);
    if (!SPLIT) { return select(vec4f(im.yz, 0, 0), vec4f(re, im.x), group == 0u); }
    let first_re = in_steps(re);
    let first_im = in_steps(im);
    let rest_re = REMAINDER_GAIN * (re - first_re);
    let rest_im = REMAINDER_GAIN * (im - first_im);
    if (group == 0u) { return vec4f(first_re, first_im.x); }
    if (group == 1u) { return vec4f(first_im.yz, rest_re.xy); }
    return vec4f(rest_re.z, rest_im);
}

fn in_steps(values: vec3f) -> vec3f {
    return round(values / SPLIT_STEP) * SPLIT_STEP;
}
