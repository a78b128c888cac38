// Converts encoded colours to the amplitudes of the lasers: the counterpart of frame/light.rs. The header from light.rs
// has the constants in capitals.

// Returns the light of encoded values.
fn light_of(v: vec3f) -> vec3f {
    if (ENCODING == HLG) {
        return select((exp((v - 0.55991073) / 0.17883277) + 0.28466892) / 12.0, v * v / 3.0, v <= vec3f(0.5));
    }
    if (ENCODING == PQ) {
        let root = pow(v, vec3f(32.0 / 2523.0));
        let light = max(root - 0.8359375, vec3f(0)) / (18.8515625 - 18.6875 * root);
        return PQ_FULL * pow(light, vec3f(16384.0 / 2610.0));
    }
    return select(pow((v + 0.055) / 1.055, vec3f(2.4)), v / 12.92, v <= vec3f(0.04045));
}

// Keeps a value below `from`, and takes what is above it below 1 on a hyperbola.
fn knee(value: f32, from_: f32, rate: f32) -> f32 {
    let excess = max(value - from_, 0.0);
    return min(value, from_) + excess / (1.0 + rate * excess);
}

fn most_of(v: vec3f) -> f32 { return max(v.x, max(v.y, v.z)); }

fn amplitudes(v: vec3f) -> vec3f {
    if (ENCODING == AMPLITUDE) { return v; }
    var light = light_of(v);
    if (ENCODING == HLG || ENCODING == PQ) {
        if (ENCODING == HLG) { light *= HLG_GAIN * pow(max(dot(LUMINANCE, light), 0.0), 0.2); }
        let most = most_of(light);
        light *= min(knee(most, HIGHLIGHTS.x, HIGHLIGHTS.y), 1.0) / max(most, 1e-30);
    }
    light = TO_LASERS * light;
    let most = most_of(light);
    let least = min(light.x, min(light.y, light.z));
    let saturation = (most - least) / max(most, 1e-30);
    let kept = knee(saturation, GAMUT.x, GAMUT.y) / max(saturation, 1e-30);
    let inside = most - kept * (most - light);
    return sqrt(clamp(inside / max(most, 1.0), vec3f(0), vec3f(1)));
}
