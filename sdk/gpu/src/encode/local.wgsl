// Local correction, appended to double_phase.wgsl. See encode/local.rs. `begin` writes d = g − L·e for the phasors e of
// double phase, `step_on` writes d for the next phasors, and `finish` takes the last step and writes levels. The header
// from local.rs defines GOAL_TURN and KEEP_TURN.

// g times the scale.
@group(0) @binding(10) var<storage, read> wanted: array<vec2f>;
@group(0) @binding(11) var<storage, read> previous: array<vec2f>;
@group(0) @binding(12) var<storage, read_write> next: array<vec2f>;
// B at (dy, dx), in rows of dy.
@group(0) @binding(13) var<uniform> taps: array<vec4f, 4>;

const REACH: i32 = 3;
const SIDE: u32 = 16u;
const TILE: u32 = 22u;

var<workgroup> tile: array<vec2f, TILE * TILE>;

fn goal(colour: u32, x: i32, y: i32, inverse: f32) -> vec2f {
    var g = wanted[colour * frame.plane + u32(y * frame.width + x)];
    if (GOAL_TURN) { g = turned(colour, g); }
    return g * inverse;
}

fn light(colour: u32, x: i32, y: i32) -> f32 {
    if (LIT) { return 1.0 / gain(colour, u32(x), u32(y)); }
    return 1.0;
}

@compute @workgroup_size(64)
fn begin(@builtin(global_invocation_id) at: vec3u) {
    let x = i32(at.x);
    let y = i32(at.y);
    if (x >= frame.width) { return; }
    let scale = full_light();
    let inverse = over(scale);
    let f = value(at.z, x, y, per_dark(scale));
    let norm = sqrt(dot(f, f));
    let none = norm <= 1.17549435e-38;
    let direction = select(f / select(norm, 1.0, none), vec2f(1, 0), none);
    let cosine = min(norm * inverse, 1.0);
    let root = sqrt(1.0 - cosine * cosine);
    let sine = select(-root, root, ((x + y) & 1) == 0);
    let e = vec2f(direction.x * cosine - direction.y * sine, direction.x * sine + direction.y * cosine);
    let here = at.z * frame.plane + u32(y * frame.width + x);
    next[here] = goal(at.z, x, y, inverse) - light(at.z, x, y) * e;
}

// Returns the pixel index of `at`, mirrored about the first and the last of `count` pixels.
fn mirrored(at: i32, count: i32) -> i32 {
    let period = 2 * max(count - 1, 1);
    let turn = ((at % period) + period) % period;
    return min(min(turn, period - turn), count - 1);
}

// Loads a workgroup's pixels and their surroundings.
fn load(colour: u32, group: vec3u, thread: u32) {
    workgroupBarrier();
    let corner = vec2i(group.xy * SIDE) - REACH;
    for (var i = thread; i < TILE * TILE; i += SIDE * SIDE) {
        let x = mirrored(corner.x + i32(i % TILE), frame.width);
        let y = mirrored(corner.y + i32(i / TILE), frame.height);
        tile[i] = previous[colour * frame.plane + u32(y * frame.width + x)];
    }
    workgroupBarrier();
}

// Returns z = g − d + B∗d.
fn drawn(g: vec2f, at: vec2u) -> vec2f {
    let centre = i32((at.y + 3u) * TILE + at.x + 3u);
    var z = g - tile[centre];
    for (var dy = -REACH; dy <= REACH; dy++) {
        for (var dx = -REACH; dx <= REACH; dx++) {
            z += taps[abs(dy)][abs(dx)] * tile[centre + dy * i32(TILE) + dx];
        }
    }
    return z;
}

@compute @workgroup_size(16, 16)
fn step_on(
    @builtin(global_invocation_id) at: vec3u,
    @builtin(local_invocation_id) inside: vec3u,
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    load(at.z, group, thread);
    let x = i32(at.x);
    let y = i32(at.y);
    if (x >= frame.width || y >= frame.height) { return; }
    let g = goal(at.z, x, y, over(full_light()));
    let z = drawn(g, inside.xy);
    let length = light(at.z, x, y) / sqrt(max(dot(z, z), 1.17549435e-38));
    next[at.z * frame.plane + u32(y * frame.width + x)] = g - z * length;
}

@compute @workgroup_size(16, 16)
fn finish(
    @builtin(global_invocation_id) at: vec3u,
    @builtin(local_invocation_id) inside: vec3u,
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let x = i32(at.x);
    let y = i32(at.y);
    let inverse = over(full_light());
    var rgb = vec3u(0);
    for (var c = 0u; c < 3u; c++) {
        load(c, group, thread);
        if (x < frame.width && y < frame.height) {
            rgb[c] = level(angle(drawn(goal(c, x, y, inverse), inside.xy)), c, x, y);
        }
    }
    if (x < frame.width && y < frame.height) { put(x, y, rgb); }
}

// Saves the wanted field before a filter overwrites it.
@compute @workgroup_size(64)
fn keep(@builtin(global_invocation_id) at: vec3u) {
    if (i32(at.x) >= frame.width) { return; }
    let here = at.z * frame.plane + at.y * u32(frame.width) + at.x;
    var u = field[here];
    if (KEEP_TURN) { u = turned(at.z, u); }
    next[here] = u;
}
