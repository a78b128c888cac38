// Reads colour from a camera image and turns it upright, crops, resizes and converts it: the counterpart of
// frame/convert.rs. The taps are a table for four axes (x and y of the first channel, x and y of the others): the first
// sample of each pixel, then its weights.

struct Camera {
    // For each channel: the byte of the first sample of the upright image, and the steps to the right and down.
    channel: array<vec4i, 3>,
    // Black, the luma factor, grey and the chroma factor; then the matrix: red of V, green of U, green of V, blue of U.
    levels: vec4f,
    matrix: vec4f,
}

@group(0) @binding(1) var<storage, read> colour: array<u32>;
@group(0) @binding(7) var<uniform> camera: Camera;
@group(0) @binding(8) var<storage, read> taps: array<u32>;

fn byte(at: u32) -> f32 { return f32((colour[at / 4u] >> (8u * (at % 4u))) & 255u); }

// Returns a channel's weighted mean under the taps of a pixel.
fn sample(channel: u32, x: u32, y: u32) -> f32 {
    let lies = camera.channel[channel];
    let other = channel > 0u;
    let count_x = select(COUNT_X, OTHER_COUNT_X, other);
    let count_y = select(COUNT_Y, OTHER_COUNT_Y, other);
    let at_x = select(AT_X, OTHER_AT_X, other);
    let at_y = select(AT_Y, OTHER_AT_Y, other);
    let first_x = i32(taps[at_x + x]);
    let first_y = i32(taps[at_y + y]);
    let weights_x = at_x + frame.width + x * count_x;
    let weights_y = at_y + frame.height + y * count_y;
    var sum = 0.0;
    for (var j = 0u; j < count_y; j++) {
        let weight = bitcast<f32>(taps[weights_y + j]);
        if (weight > 0.0) {
            for (var i = 0u; i < count_x; i++) {
                let at = lies.x + lies.y * (first_x + i32(i)) + lies.z * (first_y + i32(j));
                sum += weight * bitcast<f32>(taps[weights_x + i]) * byte(u32(at));
            }
        }
    }
    return sum;
}

fn rgb(x: u32, y: u32) -> vec3f {
    let v = vec3f(sample(0u, x, y), sample(1u, x, y), sample(2u, x, y));
    if (!YUV) { return amplitudes(clamp(v / 255.0, vec3f(0), vec3f(1))); }
    let luma = (v.x - camera.levels.x) * camera.levels.y;
    let chroma = (v.yz - camera.levels.z) * camera.levels.w;
    let m = camera.matrix;
    let all = luma + vec3f(m.x * chroma.y, m.y * chroma.x + m.z * chroma.y, m.w * chroma.x);
    return amplitudes(clamp(all, vec3f(0), vec3f(1)));
}
