// The phasors that steps correct, and the pixels that stand still, appended to local.wgsl. See encode/still.rs.
// `arrive` writes levels.

// L·e. Between frames it holds the previous frame's values.
@group(0) @binding(16) var<storage, read_write> phasors: array<vec2f>;
// The previous frame's wanted field at the modulator.
@group(0) @binding(17) var<storage, read_write> kept: array<vec2f>;
// The square of the largest change of a static pixel. It is negative if there is no previous frame.
@group(0) @binding(18) var<uniform> bound: vec4f;

fn place(at: vec3u) -> u32 { return at.z * frame.plane + at.y * u32(frame.width) + at.x; }

// Returns the phasor that the steps start from: `e`, or at a static pixel the previous frame's. `u` is the wanted field
// at the modulator.
fn start(at: vec3u, u: vec2f, e: vec2f) -> vec2f {
    let change = u - kept[place(at)];
    let first = select(e, phasors[place(at)], dot(change, change) <= bound.x);
    kept[place(at)] = u;
    phasors[place(at)] = first;
    return first;
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
