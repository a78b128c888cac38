// Propagates from the nearest plane to the hologram in two dispatches: rows, which drop the border at their ends, then
// columns, which also sum the field for the mean phase. The header from sweep.rs defines RADIUS and DOWN.

struct Sizes {
    // The width and height of the output, then those of the input.
    width: u32, height: u32, wide: u32, high: u32,
    border: u32, tiles: u32, unused_a: u32, unused_b: u32,
}
// The filter's centre, then the taps at distances 1, 2 …, complex.
struct Colour { taps: array<vec4f, RADIUS + 1> }

@group(0) @binding(0) var<uniform> sizes: Sizes;
@group(0) @binding(1) var<uniform> colours: array<Colour, 3>;
@group(0) @binding(2) var<storage, read> source: array<vec2f>;
@group(0) @binding(3) var<storage, read_write> field: array<vec2f>;
@group(0) @binding(4) var<storage, read_write> partial: array<vec2f>;

const THREADS: u32 = 256u;

var<workgroup> sums: array<vec2f, THREADS>;

fn times(a: vec2f, b: vec2f) -> vec2f { return vec2f(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x); }

@compute @workgroup_size(64, 4)
fn go_home(
    @builtin(global_invocation_id) at: vec3u,
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let colour = at.z;
    let there = at.x < sizes.width && at.y < sizes.height;
    var sum = vec2f(0);
    if (there) {
        let step = select(1u, sizes.wide, DOWN);
        let length = select(sizes.wide, sizes.high, DOWN);
        let middle = select(at.x, at.y, DOWN) + sizes.border;
        let line = colour * sizes.wide * sizes.high + select(at.y * sizes.wide, at.x, DOWN);
        sum = times(colours[colour].taps[0].xy, source[line + middle * step]);
        for (var j = 1u; j <= RADIUS; j++) {
            var both = vec2f(0);
            if (middle >= j) { both += source[line + (middle - j) * step]; }
            if (middle + j < length) { both += source[line + (middle + j) * step]; }
            sum += times(colours[colour].taps[j].xy, both);
        }
        field[(colour * sizes.height + at.y) * sizes.width + at.x] = sum;
    }
    if (DOWN) {
        sums[thread] = sum;
        for (var step = THREADS / 2u; step > 0u; step /= 2u) {
            workgroupBarrier();
            if (thread < step) { sums[thread] += sums[thread + step]; }
        }
        if (thread == 0u) { partial[3u * (group.y * sizes.tiles + group.x) + colour] = sums[0]; }
    }
}
