// Finds the amplitude of full brightness for temporally smoothed brightness, from a histogram of some of the field's
// amplitudes. The counterpart of brightness.rs in the core, whose constants are in the header, in capitals.

struct Past { scale: f32, share: f32, unused_a: u32, unused_b: u32 }

@group(0) @binding(0) var<uniform> past: Past;
@group(0) @binding(1) var<storage, read> field: array<vec2f>;
@group(0) @binding(2) var<storage, read_write> counted: array<atomic<u32>, BINS>;
@group(0) @binding(3) var<storage, read> bins: array<u32, BINS>;
// The bits of the scale's square, as double_phase.wgsl reads them.
@group(0) @binding(4) var<storage, read_write> found: array<u32>;

const THREADS: u32 = 256u;
const EACH: u32 = BINS / THREADS;

var<workgroup> sums: array<u32, THREADS>;

@compute @workgroup_size(THREADS)
fn count(@builtin(global_invocation_id) at: vec3u) {
    for (var k = at.x; k < COUNT; k += THREADS * GROUPS) {
        let v = field[k * STEP];
        let bin = u32(clamp(sqrt(dot(v, v)) * (f32(BINS) / MOST), 0.0, f32(BINS - 1u)));
        atomicAdd(&counted[min(bin, BINS - 1u)], 1u);
    }
}

// One workgroup: finds the highest bin with more amplitudes above its lower bound than may be clipped.
@compute @workgroup_size(THREADS)
fn settle(@builtin(local_invocation_index) thread: u32) {
    var sum = 0u;
    for (var k = 0u; k < EACH; k++) { sum += bins[thread * EACH + k]; }
    sums[thread] = sum;
    workgroupBarrier();
    if (thread > 0u) { return; }
    var above = 0u;
    var part = THREADS - 1u;
    while (part > 0u && above + sums[part] <= OVER) {
        above += sums[part];
        part -= 1u;
    }
    var last = part * EACH + EACH - 1u;
    while (last > 0u && above + bins[last] <= OVER) {
        above += bins[last];
        last -= 1u;
    }
    let now = max(f32(last + 1u) * (MOST / f32(BINS)), LEAST);
    let scale = past.scale + past.share * (now - past.scale);
    found[0] = bitcast<u32>(scale * scale);
}
