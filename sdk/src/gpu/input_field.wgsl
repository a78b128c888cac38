// Channels from a complex field: the real parts of its colours, then the imaginary ones. Goes behind input.wgsl.

@group(0) @binding(1) var<storage, read> colour: array<vec2f>;

fn channels(group: u32, x: u32, y: u32) -> vec4f {
    let at = y * frame.width + x;
    let red = colour[at];
    let green = colour[frame.plane + at];
    let blue = colour[2u * frame.plane + at];
    return select(vec4f(green.y, blue.y, 0, 0), vec4f(red.x, green.x, blue.x, red.y), group == 0u);
}
