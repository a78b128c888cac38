// Computes the factors that remove the mean phase of each colour, from the sums of all workgroups, in one workgroup.

@group(0) @binding(0) var<uniform> parts: vec4u;
@group(0) @binding(1) var<storage, read> partial: array<vec2f>;
@group(0) @binding(2) var<storage, read_write> turn: array<vec2f>;

const THREADS: u32 = 256u;

var<workgroup> sums: array<vec2f, THREADS>;

@compute @workgroup_size(THREADS)
fn find(@builtin(local_invocation_index) thread: u32) {
    for (var c = 0u; c < 3u; c++) {
        var sum = vec2f(0);
        for (var part = thread; part < parts.x; part += THREADS) { sum += partial[3u * part + c]; }
        sums[thread] = sum;
        for (var step = THREADS / 2u; step > 0u; step /= 2u) {
            workgroupBarrier();
            if (thread < step) { sums[thread] += sums[thread + step]; }
        }
        if (thread == 0u) {
            // Scale first, so that the square does not overflow.
            let most = max(abs(sums[0].x), abs(sums[0].y));
            let v = sums[0] / max(most, 1e-30);
            turn[c] = select(vec2f(1, 0), vec2f(v.x, -v.y) / sqrt(dot(v, v)), most > 1e-30);
        }
        workgroupBarrier();
    }
}
