// The last layer, which writes its six planes or the complex field that they represent, with each workgroup's sum of
// the field for the mean phase. Appended to chain.wgsl, whose `sums` returns the planes as t.a… (0 to 3) and t.b… (4
// and 5). HEAD: 0 planes, 1 amplitude and phase, 2 correction of the image, 3 correction of a field, 4 correction of a
// seed, 5 correction of a field in two parts. If layers compute squares, SIDE is 2, and each of a square's pixels has
// its own block of filters and its own groups of the input.

@group(0) @binding(5) var<storage, read_write> planes: array<f32>;
@group(0) @binding(6) var<storage, read_write> field: array<vec2f>;
@group(0) @binding(7) var<storage, read_write> partial: array<vec2f>;

const THREADS: u32 = 64u;

var<workgroup> shared_sums: array<vec2f, 3u * THREADS>;

// Computes tanh to 3e-7, which drivers do not guarantee, as 1 − 2/(e^2x + 1). Beyond ±10 it is ±1.
fn tanh4(x: vec4f) -> vec4f {
    return 1.0 - 2.0 / (exp2(clamp(x, vec4f(-10), vec4f(10)) * 2.885390081777927) + 1.0);
}

// Writes `pixel` of the square at (place_x, place_y).
fn finish(thread: u32, pixel: i32, place_x: i32, place_y: i32, low: vec4f, high: vec4f) {
    if (place_x >= frame.width || place_y >= frame.height) { return; }
    let x = SIDE * place_x + pixel % SIDE;
    let y = SIDE * place_y + pixel / SIDE;
    if (x >= frame.columns || y >= frame.rows) { return; }
    let at = u32(y * frame.columns + x);
    let plane = u32(frame.columns * frame.rows);
    let groups = BESIDE / u32(SIDE * SIDE);
    let input = u32(pixel) * groups * frame.plane + u32(place_y * frame.width + place_x);
    var a = low;
    var b = high;
    if (TANH) {
        a = tanh4(a);
        b = tanh4(b);
    }
    if (HEAD == 0u) {
        planes[at] = a.x;
        planes[plane + at] = a.y;
        planes[2u * plane + at] = a.z;
        planes[3u * plane + at] = a.w;
        planes[4u * plane + at] = b.x;
        planes[5u * plane + at] = b.y;
        return;
    }
    let first = a.xyz;
    let second = vec3f(a.w, b.xy);
    var red: vec2f;
    var green: vec2f;
    var blue: vec2f;
    if (HEAD == 1u) {
        let amplitude = (first + 1.0) * 0.70710678;
        red = amplitude.x * direction(second.x);
        green = amplitude.y * direction(second.y);
        blue = amplitude.z * direction(second.z);
    } else {
        var re = first;
        var im = second;
        if (HEAD == 2u) {
            // The input holds colours minus a half.
            re += base(input).xyz + 0.5;
        } else if (HEAD == 3u) {
            re += base(input).xyz;
            im += vec3f(base(input).w, base(frame.plane + input).xy);
        } else if (HEAD == 5u) {
            // The field is in two parts.
            let second = base(frame.plane + input);
            let third = base(2u * frame.plane + input);
            re += base(input).xyz + vec3f(second.zw, third.x) / REMAINDER_GAIN;
            im += vec3f(base(input).w, second.xy) + third.yzw / REMAINDER_GAIN;
        } else {
            // The input holds a seed u as ½(Re u − ½) and ½ Im u, after RGB-D.
            let seed = base(frame.plane + input);
            re += 2.0 * seed.xyz + 0.5;
            im += 2.0 * vec3f(seed.w, base(2u * frame.plane + input).xy);
        }
        red = vec2f(re.x, im.x);
        green = vec2f(re.y, im.y);
        blue = vec2f(re.z, im.z);
    }
    field[at] = red;
    field[plane + at] = green;
    field[2u * plane + at] = blue;
    shared_sums[3u * thread] += red;
    shared_sums[3u * thread + 1u] += green;
    shared_sums[3u * thread + 2u] += blue;
}

@compute @workgroup_size(32, 2)
fn last(
    @builtin(global_invocation_id) at: vec3u,
    @builtin(workgroup_id) tile: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let x = i32(at.x);
    let y = 4 * i32(at.y);
    shared_sums[3u * thread] = vec2f(0);
    shared_sums[3u * thread + 1u] = vec2f(0);
    shared_sums[3u * thread + 2u] = vec2f(0);
    for (var pixel = 0; pixel < SIDE * SIDE; pixel++) {
        let t = sums(u32(pixel), x, y);
        finish(thread, pixel, x, y, t.a0, t.b0);
        finish(thread, pixel, x, y + 1, t.a1, t.b1);
        finish(thread, pixel, x, y + 2, t.a2, t.b2);
        finish(thread, pixel, x, y + 3, t.a3, t.b3);
    }
    if (HEAD != 0u) {
        for (var step = THREADS / 2u; step > 0u; step /= 2u) {
            workgroupBarrier();
            if (thread < step) {
                for (var c = 0u; c < 3u; c++) {
                    shared_sums[3u * thread + c] += shared_sums[3u * (thread + step) + c];
                }
            }
        }
        if (thread == 0u) {
            let slot = 3u * (tile.y * frame.tiles + tile.x);
            partial[slot] = shared_sums[0];
            partial[slot + 1u] = shared_sums[1];
            partial[slot + 2u] = shared_sums[2];
        }
    }
}
