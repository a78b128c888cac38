// Channels from the network's unmodified input planes. Appended to pack.wgsl.

@group(0) @binding(1) var<storage, read> colour: array<f32>;

fn channels(group: u32, x: u32, y: u32) -> vec4f {
    var v = vec4f(0);
    for (var k = 0u; k < 4u; k++) {
        if (4u * group + k < CHANNELS) { v[k] = colour[(4u * group + k) * frame.plane + y * frame.width + x]; }
    }
    return v;
}
