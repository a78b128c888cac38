// The input of a chain in 8-bit whole numbers, minus 128, as the first layer and as the last one round it. Goes behind
// input.wgsl.

fn store(group: u32, at: u32, v: vec4f) {
    var a = 0u;
    var b = 0u;
    for (var k = 0u; k < 4u; k++) {
        // Channels that pad the group have weight 0.
        a |= rounded_first(v[k]) << (8u * k);
        b |= rounded_last(v[k]) << (8u * k);
    }
    first[at] = a ^ 0x80808080u;
    last[at] = b ^ 0x80808080u;
    if (group == 0u) { image[at] = v; }
}
