// Steps at the midpoint, appended to local.wgsl and still.wgsl. See encode/midpoint.rs. `depart` starts from the result
// of double phase or local steps, or, at static pixels, from the previous frame's final phasors. `ask` and `follow` are
// the two halves of a step, each after a propagation through the aperture. The header from midpoint.rs defines WAVE and
// GAIN.

// T, the wanted field over the scale: at the modulator, then at the midpoint.
@group(0) @binding(14) var<storage, read_write> aim: array<vec2f>;
// L·e, then u, r and Kᴴ·r.
@group(0) @binding(15) var<storage, read_write> missing: array<vec2f>;

// On entry `missing` holds g − L·e.
@compute @workgroup_size(64)
fn depart(@builtin(global_invocation_id) at: vec3u) {
    if (i32(at.x) >= frame.width) { return; }
    let u = goal(at.z, i32(at.x), i32(at.y), 1.0);
    let g = u * over(full_light());
    aim[place(at)] = g;
    missing[place(at)] = start(at, u, g - missing[place(at)]);
}

@compute @workgroup_size(64)
fn ask(@builtin(global_invocation_id) at: vec3u) {
    if (i32(at.x) >= frame.width) { return; }
    let u = missing[place(at)];
    let t = aim[place(at)];
    let keep = (1.0 - WAVE) * sqrt(dot(t, t)) / sqrt(max(dot(u, u), 1.17549435e-38)) - 1.0;
    missing[place(at)] = WAVE * t + keep * u;
}

@compute @workgroup_size(64)
fn follow(@builtin(global_invocation_id) at: vec3u) {
    // A dark frame needs no correction.
    if (i32(at.x) >= frame.width || full_light() <= 0.0) { return; }
    let z = phasors[place(at)] + GAIN * missing[place(at)];
    let e = z * (light(at.z, i32(at.x), i32(at.y)) / sqrt(max(dot(z, z), 1.17549435e-38)));
    missing[place(at)] = e;
    phasors[place(at)] = e;
}
