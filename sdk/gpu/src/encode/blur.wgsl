// Applies a Gaussian along rows or columns with repeated edges, for blurs too wide for double_phase.wgsl. The header
// from blur.rs defines HALF, TURN and ALONG, which is (1, 0) or (0, 1).

struct Frame { width: i32, height: i32, plane: u32, unused: u32 }

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> taps: array<vec4f, 8>;
@group(0) @binding(2) var<storage, read> source: array<vec2f>;
@group(0) @binding(3) var<storage, read_write> result: array<vec2f>;
@group(0) @binding(4) var<storage, read> turn: array<vec2f>;

@compute @workgroup_size(64)
fn blur(@builtin(global_invocation_id) at: vec3u) {
    let x = i32(at.x);
    let y = i32(at.y);
    if (x >= frame.width) { return; }
    var sum = vec2f(0);
    for (var d = -HALF; d <= HALF; d++) {
        let i = clamp(x + d * ALONG.x, 0, frame.width - 1);
        let j = clamp(y + d * ALONG.y, 0, frame.height - 1);
        let tap = u32(abs(d));
        sum += taps[tap / 4u][tap % 4u] * source[at.z * frame.plane + u32(j * frame.width + i)];
    }
    if (TURN) {
        let v = turn[at.z];
        sum = vec2f(sum.x * v.x - sum.y * v.y, sum.x * v.y + sum.y * v.x);
    }
    result[at.z * frame.plane + u32(y * frame.width + x)] = sum;
}
