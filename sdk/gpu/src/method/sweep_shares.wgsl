// The positions of points among the planes and their shares of light there, as in shares.rs of phasefront-core. The
// header from sweep.rs defines COUNT, the number of planes, HIDDEN, the number of hidden layers, BETWEEN, whether
// points can be between planes, and MEET.

// Returns k for a depth on plane k.
fn position(depth: f32) -> f32 {
    let position = depth * f32(COUNT);
    return clamp(select(floor(position), position - 0.5, BETWEEN), 0.0, f32(COUNT - 1u));
}

// Returns the share of a point of `depth` that a plane blocks and emits.
fn share(depth: f32, plane: u32) -> f32 {
    let behind = position(depth) - f32(plane);
    return saturate(select((1.0 + behind) / (1.0 - MEET), (1.0 - behind) / MEET, behind >= 0.0));
}
