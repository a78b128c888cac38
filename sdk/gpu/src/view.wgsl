// Renders what an eye sees of a hologram: `sum` averages the light of FACTOR × FACTOR pixels of the modulator, and
// `draw` resamples the amplitude of the propagated means to the pixels of a screen. The header from view.rs defines the
// constants in capitals.

@group(0) @binding(0) var levels: texture_2d<f32>;
// The light of each level, exp(iφ).
@group(0) @binding(1) var<storage, read> lights: array<vec2f>;
@group(0) @binding(2) var<storage, read> weights: array<f32>;
@group(0) @binding(3) var<storage, read_write> sums: array<vec2f>;

@group(0) @binding(4) var<storage, read> field: array<vec2f>;
// For x, then for y: the first value of each pixel of the screen, then its weights.
@group(0) @binding(5) var<storage, read> taps: array<u32>;
// The amplitude of full light.
@group(0) @binding(6) var<uniform> scale: vec4f;
@group(0) @binding(7) var image: texture_storage_2d<rgba8unorm, write>;

@compute @workgroup_size(64)
fn sum(@builtin(global_invocation_id) at: vec3u) {
    if (at.x >= WIDTH) { return; }
    var light: array<vec2f, 3>;
    for (var pixel = 0u; pixel < FACTOR * FACTOR; pixel++) {
        let place = FACTOR * at.xy + vec2u(pixel % FACTOR, pixel / FACTOR);
        let level = vec3u(255.0 * textureLoad(levels, place, 0).rgb + 0.5);
        light[0] += lights[level.r];
        light[1] += lights[level.g];
        light[2] += lights[level.b];
    }
    for (var c = 0u; c < 3u; c++) {
        let place = c * PLANE + at.y * WIDTH + at.x;
        sums[place] = weights[place] * light[c];
    }
}

// Returns the sRGB values of the lasers' light.
fn srgb(light: vec3f) -> vec3f {
    let linear = clamp(TO_SRGB * light, vec3f(0), vec3f(1));
    let curved = 1.055 * pow(linear, vec3f(1.0 / 2.4)) - 0.055;
    return select(curved, 12.92 * linear, linear <= vec3f(0.0031308));
}

@compute @workgroup_size(64)
fn draw(@builtin(global_invocation_id) at: vec3u) {
    if (at.x >= SCREEN_WIDTH) { return; }
    var rgb = vec3f(0);
    for (var j = 0u; j < COUNT_Y; j++) {
        let row = (taps[AT_Y + at.y] + j) * WIDTH;
        let weight_y = bitcast<f32>(taps[AT_Y + SCREEN_HEIGHT + at.y * COUNT_Y + j]);
        for (var i = 0u; i < COUNT_X; i++) {
            let place = row + taps[at.x] + i;
            let weight = weight_y * bitcast<f32>(taps[SCREEN_WIDTH + at.x * COUNT_X + i]);
            rgb += weight * vec3f(length(field[place]), length(field[PLANE + place]), length(field[2u * PLANE + place]));
        }
    }
    rgb *= scale.x;
    textureStore(image, at.xy, vec4f(select(min(rgb, vec3f(1)), srgb(rgb * rgb), LIGHT), 1));
}
