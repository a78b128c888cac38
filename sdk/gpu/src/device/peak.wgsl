// What a device can do at its best: multiply-adds from registers alone, and memory copied once. The header that peak.rs
// writes before this text gives the constants in capitals, and for the arithmetic `lane`, `bits` and `more`.

@group(0) @binding(0) var<storage, read> source: array<vec4u>;
@group(0) @binding(1) var<storage, read_write> result: array<vec4u>;

@compute @workgroup_size(256)
fn copy(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    for (var k = 0u; k < EACH; k++) {
        let at = (group.x * EACH + k) * 256u + thread;
        result[at] = source[at];
    }
}
