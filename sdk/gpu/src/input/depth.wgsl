// Reads depth from a plane of f32, or of u16 if WORDS.

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
