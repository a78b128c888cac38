// A field divided by the lasers' light that falls on the modulator, in place: the twin of illumination.rs.

struct Frame { width: u32, height: u32, plane: u32, rows: u32, columns: u32, unused_a: u32, unused_b: u32, unused_c: u32 }

@group(0) @binding(0) var<uniform> frame: Frame;
// One over the light's amplitude at the nodes: three planes of rows x columns.
@group(0) @binding(1) var<storage, read> gains: array<f32>;
@group(0) @binding(2) var<storage, read_write> field: array<vec2f>;
@group(0) @binding(3) var<storage, read> turn: array<vec2f>;

// The node before pixel n of `count`, and how far it is to the next of `nodes`.
fn before(n: u32, count: u32, nodes: u32) -> u32 { return min(n * (nodes - 1u) / max(count - 1u, 1u), nodes - 2u); }
fn beyond(n: u32, count: u32, nodes: u32) -> f32 {
    let steps = max(count - 1u, 1u);
    return f32(n * (nodes - 1u) - before(n, count, nodes) * steps) / f32(steps);
}

@compute @workgroup_size(64)
fn divide(@builtin(global_invocation_id) at: vec3u) {
    if (at.x >= frame.width) { return; }
    let j = before(at.x, frame.width, frame.columns);
    let i = before(at.y, frame.height, frame.rows);
    let fx = beyond(at.x, frame.width, frame.columns);
    let fy = beyond(at.y, frame.height, frame.rows);
    let node = (at.z * frame.rows + i) * frame.columns + j;
    let left = gains[node] + (gains[node + frame.columns] - gains[node]) * fy;
    let right = gains[node + 1u] + (gains[node + frame.columns + 1u] - gains[node + 1u]) * fy;
    let gain = left + (right - left) * fx;
    let place = at.z * frame.plane + at.y * frame.width + at.x;
    var v = field[place] * gain;
    if (TURN) {
        let by = turn[at.z];
        v = vec2f(v.x * by.x - v.y * by.y, v.x * by.y + v.y * by.x);
    }
    field[place] = v;
}
