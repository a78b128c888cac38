// Measures peak performance: multiply-adds on registers only, and a copy of memory. The header from peak.rs defines the
// constants in capitals and, for the arithmetic, `lane`, `bits` and `more`.

@group(0) @binding(0) var<storage, read> source: array<vec4u>;
@group(0) @binding(1) var<storage, read_write> result: array<vec4u>;

@compute @workgroup_size(256)
fn copy(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    for (var k = 0u; k < EACH; k++) {
        let at = (group.x * EACH + k) * 256u + thread;
        result[at] = source[at];
    }
}
