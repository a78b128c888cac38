// Steps of natural focus, appended to direction.wgsl, local.wgsl and still.wgsl. See encode/natural.rs. `depart` starts
// from the result of double phase or local steps, or, at static pixels, from the previous frame's final phasors, and
// `weigh` sums the weights of all planes. A step runs `miss` at each plane of its turn and then `follow`. The header
// from natural.rs defines the constants in capitals.

// g − L·e, then u and r·u at a plane, then Σ Kᴴ(r·u).
@group(0) @binding(14) var<storage, read_write> view: array<vec2f>;
// v.
@group(0) @binding(15) var<storage, read_write> speeds: array<f32>;
@group(0) @binding(19) var<storage, read> depths: array<f32>;
// The sum of a pixel's weights over all planes.
@group(0) @binding(20) var<storage, read_write> sums: array<f32>;
// The amplitudes of the stack at a plane, A times the scale.
@group(0) @binding(21) var<storage, read> stack: array<f32>;
// The number of that plane, and for `follow` how many planes the step looks at.
@group(0) @binding(22) var<uniform> number: vec4f;

// Returns the weight of a pixel at plane `p` before it is divided by the mean over all planes.
fn weight(at: vec3u, p: f32) -> f32 {
    let z = VOLUME_M * (0.5 - depths[at.y * u32(frame.width) + at.x]);
    let blur = (z - FIRST_M - STEP_M * p) * PER_M[at.z] / FOCUS_PX;
    return 1.0 + IN_FOCUS * exp(-blur * blur);
}

@compute @workgroup_size(64)
fn depart(@builtin(global_invocation_id) at: vec3u) {
    if (i32(at.x) >= frame.width) { return; }
    let u = goal(at.z, i32(at.x), i32(at.y), 1.0);
    _ = start(at, u, u * over(full_light()) - view[place(at)]);
    speeds[place(at)] = 0.0;
}

@compute @workgroup_size(64)
fn weigh(@builtin(global_invocation_id) at: vec3u) {
    if (i32(at.x) >= frame.width) { return; }
    var sum = 0.0;
    for (var p = 0u; p < PLANES; p++) { sum += weight(at, f32(p)); }
    sums[place(at)] = sum;
}

@compute @workgroup_size(64)
fn miss(@builtin(global_invocation_id) at: vec3u) {
    if (i32(at.x) >= frame.width) { return; }
    let u = view[place(at)];
    let a = sqrt(dot(u, u)) + FLOOR;
    let share = weight(at, number.x) * f32(PLANES) / sums[place(at)];
    view[place(at)] = u * (share * (a - stack[place(at)] * over(full_light())) / a);
}

@compute @workgroup_size(64)
fn follow(@builtin(global_invocation_id) at: vec3u) {
    // A dark frame needs no correction.
    if (i32(at.x) >= frame.width || full_light() <= 0.0) { return; }
    let e = phasors[place(at)];
    let gradient = view[place(at)];
    let slope = gradient.y * e.x - gradient.x * e.y;
    let v = MOMENTUM * speeds[place(at)] + 2.0 / number.x * slope;
    speeds[place(at)] = v;
    let rotation = direction(-RATE / PI * v);
    let z = vec2f(e.x * rotation.x - e.y * rotation.y, e.x * rotation.y + e.y * rotation.x);
    phasors[place(at)] = z * (light(at.z, i32(at.x), i32(at.y)) / sqrt(max(dot(z, z), 1.17549435e-38)));
}
