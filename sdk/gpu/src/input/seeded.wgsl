// Channels of a seeded network: colour and depth, each minus a half, with depth stretched, and the sweep's field u as
// ½(Re u − ½) and ½ Im u of the three colours. See seeded.rs. Appended to pack.wgsl.

// Red, green, blue and depth.
@group(0) @binding(1) var<storage, read> surfaces: array<vec4f>;
@group(0) @binding(2) var<storage, read> seed: array<vec2f>;

fn channels(group: u32, x: u32, y: u32) -> vec4f {
    let at = y * frame.width + x;
    if (group == 0u) { return (surfaces[at] - MIDDLE) * vec4f(1, 1, 1, DEPTH_SCALE); }
    let red = seed[at];
    let green = seed[frame.plane + at];
    let blue = seed[2u * frame.plane + at];
    if (group == 1u) { return 0.5 * vec4f(red.x - 0.5, green.x - 0.5, blue.x - 0.5, red.y); }
    return vec4f(0.5 * green.y, 0.5 * blue.y, 0.0, 0.0);
}
