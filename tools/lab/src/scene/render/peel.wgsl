// Depth peeling (paper, Algorithm 1). It draws the nearest of the fragments behind the previous layer.

// True for the first layer, which has no previous layer.
override first: bool;

@group(0) @binding(0) var previous: texture_depth_2d;
@group(1) @binding(0) var picture: texture_2d<f32>;

struct Fragment {
    @invariant @builtin(position) position: vec4f,
    @location(0) @interpolate(linear) uv: vec2f,
    @location(1) @interpolate(linear) colour: vec3f,
}

// Passes a vertex on. `place` is in clip coordinates: x right and y up from -1 to 1, depth from 0 (nearest) to 1.
@vertex
fn project(@location(0) place: vec3f, @location(1) uv: vec2f, @location(2) colour: vec3f) -> Fragment {
    return Fragment(vec4f(place, 1.0), uv, colour);
}

// Samples a repeating picture bilinearly in full precision. Hardware samplers may round the weights to 8 bits.
fn sample(uv: vec2f) -> vec4f {
    let size = vec2f(textureDimensions(picture));
    let position = (uv - floor(uv)) * size - 0.5;
    let below = floor(position);
    let t = position - below;
    let a = vec2u((below + size) % size);
    let b = vec2u((below + size + 1.0) % size);
    let top = mix(textureLoad(picture, a, 0), textureLoad(picture, vec2u(b.x, a.y), 0), t.x);
    let bottom = mix(textureLoad(picture, vec2u(a.x, b.y), 0), textureLoad(picture, b, 0), t.x);
    return mix(top, bottom, t.y);
}

// Returns the colour, with the depth as alpha.
@fragment
fn peel(fragment: Fragment) -> @location(0) vec4f {
    let depth = fragment.position.z;
    if !first && depth <= textureLoad(previous, vec2u(fragment.position.xy), 0) {
        discard;
    }
    let texel = sample(fragment.uv);
    if texel.a < 0.5 {
        discard;
    }
    return vec4f(saturate(texel.rgb * fragment.colour), depth);
}
