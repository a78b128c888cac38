// Reads colour from three planes.

@group(0) @binding(1) var<storage, read> colour: array<f32>;

fn rgb(x: u32, y: u32) -> vec3f {
    let at = y * frame.width + x;
    return vec3f(colour[at], colour[frame.plane + at], colour[2u * frame.plane + at]);
}
