// Stores the input of an int8 chain minus 128, in the roundings of the first and the last layer. Appended to pack.wgsl.

// The smallest real number that rounds to each u8 value or above, for the first and for the last layer.
struct Steps { first: array<f32, 256>, last: array<f32, 256> }

@group(0) @binding(4) var<storage, read_write> last: array<u32>;
@group(0) @binding(5) var<storage, read_write> image: array<vec4f>;
@group(0) @binding(6) var<storage, read> steps: Steps;

fn rounded_first(real: f32) -> u32 {
    var k = 0u;
    for (var step = 128u; step > 0u; step /= 2u) {
        if (real >= steps.first[k + step]) { k += step; }
    }
    return k;
}

fn rounded_last(real: f32) -> u32 {
    var k = 0u;
    for (var step = 128u; step > 0u; step /= 2u) {
        if (real >= steps.last[k + step]) { k += step; }
    }
    return k;
}

fn store(at: u32, v: vec4f) {
    var a = 0u;
    var b = 0u;
    for (var k = 0u; k < 4u; k++) {
        // Channels that pad the group have weight 0.
        a |= rounded_first(v[k]) << (8u * k);
        b |= rounded_last(v[k]) << (8u * k);
    }
    first[at] = a ^ 0x80808080u;
    last[at] = b ^ 0x80808080u;
    image[at] = v;
}
