// Sweeps several planes, the farthest first, for one colour in one tile. For each plane it applies the step from the
// plane behind along rows and columns, then lets the plane's points replace their shares of the field. A tile is loaded
// with a halo into workgroup memory, and its valid part shrinks by RADIUS per step until its middle remains. The header
// from sweep.rs defines the constants in capitals, and sweep_shares.wgsl comes before this file. A thread computes EACH
// rows of a column.

struct Frame {
    width: u32, height: u32,
    // The black border around the frame, for light that leaves it and returns.
    border: u32,
    // The first plane of this dispatch. Behind the last plane there is no light.
    first: u32,
}
// The filter's centre, then the taps at distances 1, 2 …, complex.
struct Colour { taps: array<vec4f, RADIUS + 1> }

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> colours: array<Colour, 3>;
// Red, green, blue and depth.
@group(0) @binding(2) var<storage, read> surfaces: array<vec4f>;
@group(0) @binding(3) var<storage, read> sources: array<u32>;
// The planes of each pixel's points. See sweep_points.wgsl.
@group(0) @binding(4) var<storage, read> points: array<u32>;
@group(0) @binding(5) var<storage, read> behind: array<vec2f>;
@group(0) @binding(6) var<storage, read_write> result: array<vec2f>;

const HALO: u32 = RADIUS * PLANES;
const LIT: u32 = 0x80000000u;

var<workgroup> tile: array<vec2f, COLUMNS * ROWS>;
// A bit for each plane that has points here, and LIT if light comes from behind.
var<workgroup> marks: atomic<u32>;
var<workgroup> marked: u32;

fn times(a: vec2f, b: vec2f) -> vec2f { return vec2f(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x); }

// Returns the plane of a pixel's point in a layer, or the one in front of it. Layer 0 is the visible surface.
fn plane_of(word: u32, layer: u32) -> u32 {
    if (layer == 0u) { return word & 1023u; }
    return (word >> (11u * layer - 1u)) & 2047u;
}

@compute @workgroup_size(COLUMNS, ROWS / EACH)
fn cross_planes(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) thread: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let colour = group.z;
    let x = thread.x;
    let y = thread.y * EACH;
    let area = frame.width * frame.height;
    // The field is the frame and its border, offset to the right and down by HALO.
    let width = frame.width + 2u * frame.border;
    let height = frame.height + 2u * frame.border;
    let at_x = group.x * (COLUMNS - 2u * HALO) + x;
    let at_y = group.y * (ROWS - 2u * HALO) + y;
    let in_field_x = at_x >= HALO && at_x < width + HALO;
    let in_frame_x = at_x >= HALO + frame.border && at_x < HALO + frame.border + frame.width;
    // The index of the thread's first pixel, which is not used if it is outside the frame.
    let own = (at_y - HALO - frame.border) * frame.width + at_x - HALO - frame.border;

    if (index == 0u) { atomicStore(&marks, 0u); }
    workgroupBarrier();
    var v: array<vec2f, EACH>;
    var planes: array<u32, EACH>;
    var own_marks = 0u;
    for (var i = 0u; i < EACH; i++) {
        let row = at_y + i;
        v[i] = vec2f(0);
        if (frame.first + 1u < COUNT && in_field_x && row >= HALO && row < height + HALO) {
            v[i] = behind[(colour * height + row - HALO) * width + at_x - HALO];
        }
        if (any(v[i] != vec2f(0))) { own_marks |= LIT; }
        tile[(y + i) * COLUMNS + x] = v[i];
        // Outside the frame, use a plane that is not in this dispatch.
        planes[i] = 0xfffffc00u | ((frame.first + 1u) & 1023u);
        if (in_frame_x && row >= HALO + frame.border && row < HALO + frame.border + frame.height) {
            planes[i] = points[own + i * frame.width];
            for (var layer = 0u; layer <= HIDDEN; layer++) {
                let step = frame.first - plane_of(planes[i], layer);
                if (step < PLANES) { own_marks |= 1u << step; }
                if (step - 1u < PLANES) { own_marks |= 1u << (step - 1u); }
            }
        }
    }
    if (own_marks != 0u) { atomicOr(&marks, own_marks); }
    workgroupBarrier();
    if (index == 0u) { marked = atomicLoad(&marks); }
    let held = workgroupUniformLoad(&marked);

    // Without light and points the tile stays dark.
    if (held != 0u) {
        for (var step = 0u; step < PLANES; step++) {
            // Along the row. Pixels whose taps extend beyond the tile become invalid.
            for (var i = 0u; i < EACH; i++) { v[i] = times(colours[colour].taps[0].xy, v[i]); }
            for (var j = 1u; j <= RADIUS; j++) {
                let tap = colours[colour].taps[j].xy;
                let left = y * COLUMNS + max(x, j) - j;
                let right = y * COLUMNS + min(x + j, COLUMNS - 1u);
                for (var i = 0u; i < EACH; i++) {
                    v[i] += times(tap, tile[left + i * COLUMNS] + tile[right + i * COLUMNS]);
                }
            }
            workgroupBarrier();
            for (var i = 0u; i < EACH; i++) { tile[(y + i) * COLUMNS + x] = v[i]; }
            workgroupBarrier();
            // Down the column.
            var column: array<vec2f, EACH + 2u * RADIUS>;
            for (var i = 0u; i < EACH + 2u * RADIUS; i++) {
                column[i] = tile[min(max(y + i, RADIUS) - RADIUS, ROWS - 1u) * COLUMNS + x];
            }
            for (var i = 0u; i < EACH; i++) {
                v[i] = times(colours[colour].taps[0].xy, column[i + RADIUS]);
                for (var j = 1u; j <= RADIUS; j++) {
                    v[i] += times(colours[colour].taps[j].xy, column[i + RADIUS - j] + column[i + RADIUS + j]);
                }
            }
            // The plane's points, with the visible surface last.
            let plane = frame.first - step;
            if ((held & (1u << step)) != 0u) {
                for (var i = 0u; i < EACH; i++) {
                    for (var l = 0u; l <= HIDDEN; l++) {
                        let layer = HIDDEN - l;
                        // A point between planes is also on the plane behind it.
                        if (plane - plane_of(planes[i], layer) > 1u) { continue; }
                        var source = own + i * frame.width;
                        if (layer > 0u) { source = sources[(layer - 1u) * area + source]; }
                        let point = surfaces[source];
                        v[i] += share(point.w, plane) * (vec2f(point[colour], 0.0) - v[i]);
                    }
                }
            }
            if (step + 1u < PLANES) {
                workgroupBarrier();
                for (var i = 0u; i < EACH; i++) { tile[(y + i) * COLUMNS + x] = v[i]; }
                workgroupBarrier();
            }
        }
    }

    let middle_x = x >= HALO && x < COLUMNS - HALO;
    for (var i = 0u; i < EACH; i++) {
        let row = at_y + i;
        let middle_y = y + i >= HALO && y + i < ROWS - HALO;
        if (middle_x && middle_y && in_field_x && row < height + HALO) {
            result[(colour * height + row - HALO) * width + at_x - HALO] = v[i];
        }
    }
}
