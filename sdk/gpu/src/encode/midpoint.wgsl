// Steps at the midpoint, after local.wgsl; see encode/midpoint.rs. `depart` takes what double phase or local steps
// leave, or where a pixel stands still what the frame before ended with; `ask` and `follow` are a step's two halves,
// each behind its way through the aperture, and `arrive` writes levels. The header that midpoint.rs writes gives WAVE
// and GAIN.

// T, the wanted field over the scale: at the modulator, then at the midpoint.
@group(0) @binding(14) var<storage, read_write> aim: array<vec2f>;
// L·e, then u, r and Kᴴ·r.
@group(0) @binding(15) var<storage, read_write> missing: array<vec2f>;
// L·e; between frames that of the one before.
@group(0) @binding(16) var<storage, read_write> phasors: array<vec2f>;
// The wanted field of the frame before at the modulator.
@group(0) @binding(17) var<storage, read_write> kept: array<vec2f>;
// The square of the most that a pixel changes which stands still; below 0 where there is no frame before.
@group(0) @binding(18) var<uniform> bound: vec4f;

fn place(at: vec3u) -> u32 { return at.z * frame.plane + at.y * u32(frame.width) + at.x; }

// `missing` holds g − L·e.
@compute @workgroup_size(64)
fn depart(@builtin(global_invocation_id) at: vec3u) {
    if (i32(at.x) >= frame.width) { return; }
    let u = goal(at.z, i32(at.x), i32(at.y), 1.0);
    let change = u - kept[place(at)];
    let g = u * over(full_light());
    let e = select(g - missing[place(at)], phasors[place(at)], dot(change, change) <= bound.x);
    kept[place(at)] = u;
    aim[place(at)] = g;
    missing[place(at)] = e;
    phasors[place(at)] = e;
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
    // In darkness there is nothing to correct.
    if (i32(at.x) >= frame.width || full_light() <= 0.0) { return; }
    let z = phasors[place(at)] + GAIN * missing[place(at)];
    let e = z * (light(at.z, i32(at.x), i32(at.y)) / sqrt(max(dot(z, z), 1.17549435e-38)));
    missing[place(at)] = e;
    phasors[place(at)] = e;
}

@compute @workgroup_size(64)
fn arrive(@builtin(global_invocation_id) at: vec3u) {
    if (i32(at.x) >= frame.width) { return; }
    var rgb = vec3u(0);
    for (var c = 0u; c < 3u; c++) {
        rgb[c] = level(angle(phasors[place(vec3u(at.xy, c))]), c, i32(at.x), i32(at.y));
    }
    put(i32(at.x), i32(at.y), rgb);
}
