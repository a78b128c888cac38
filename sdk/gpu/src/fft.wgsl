// 1D Fourier transforms of the lines of a plane in workgroup memory, with the operations of a convolution before and
// after them. The header from fft.rs defines the constants in capitals. fft.rs appends the stages for this length
// (Stockham's form, radices 2, 3, 4, 5 and 7; other primes by direct sums) and `transform`.

struct Lines {
    // The number of lines. A value is at plane·colour + line·i + step·j, for j below count.
    lines: u32, from_plane: u32, from_line: u32, from_step: u32,
    from_count: u32, to_plane: u32, to_line: u32, to_step: u32,
    to_count: u32, table_plane: u32, unused_a: u32, unused_b: u32,
}

@group(0) @binding(0) var<uniform> lines: Lines;
// exp(2πi j/N), computed in f64 because drivers' sines are too inaccurate.
@group(0) @binding(1) var<storage, read> roots: array<vec2f>;
@group(0) @binding(2) var<storage, read> source: array<vec2f>;
@group(0) @binding(3) var<storage, read_write> result: array<vec2f>;
// The filter, columns first. If EVEN in both frequencies, it is one quadrant.
@group(0) @binding(4) var<storage, read> table: array<vec2f>;
@group(0) @binding(5) var<storage, read> turn: array<vec2f>;

var<workgroup> row: array<vec2f, N * LINES>;

fn times(a: vec2f, b: vec2f) -> vec2f { return vec2f(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x); }

// Returns sign·i·a.
fn quarter(a: vec2f, sign: f32) -> vec2f { return vec2f(-sign * a.y, sign * a.x); }

fn root(k: u32, sign: f32) -> vec2f { return roots[k] * vec2f(1, sign); }

fn dft2(a: vec2f, b: vec2f, sign: f32) -> array<vec2f, 2> { return array<vec2f, 2>(a + b, a - b); }

fn dft3(a: vec2f, b: vec2f, c: vec2f, sign: f32) -> array<vec2f, 3> {
    let sum = b + c;
    let even = a - 0.5 * sum;
    let odd = quarter(0.8660254037844386 * (b - c), sign);
    return array<vec2f, 3>(a + sum, even + odd, even - odd);
}

fn dft4(a: vec2f, b: vec2f, c: vec2f, d: vec2f, sign: f32) -> array<vec2f, 4> {
    let even = a + c;
    let odd = b + d;
    let x = a - c;
    let y = quarter(b - d, sign);
    return array<vec2f, 4>(even + odd, x + y, even - odd, x - y);
}

fn dft5(a: vec2f, b: vec2f, c: vec2f, d: vec2f, e: vec2f, sign: f32) -> array<vec2f, 5> {
    let s = b + e;
    let t = c + d;
    let x = b - e;
    let y = c - d;
    let even = a + 0.30901699437494745 * s - 0.8090169943749475 * t;
    let other = a - 0.8090169943749475 * s + 0.30901699437494745 * t;
    let odd = quarter(0.9510565162951535 * x + 0.5877852522924731 * y, sign);
    let turned = quarter(0.5877852522924731 * x - 0.9510565162951535 * y, sign);
    return array<vec2f, 5>(a + s + t, even + odd, other + turned, other - turned, even - odd);
}

fn dft7(
    a: vec2f, b: vec2f, c: vec2f, d: vec2f, e: vec2f, f: vec2f, g: vec2f, sign: f32,
) -> array<vec2f, 7> {
    let s = b + g;
    let t = c + f;
    let u = d + e;
    let x = b - g;
    let y = c - f;
    let z = d - e;
    let c1 = 0.6234898018587336;
    let c2 = -0.2225209339563144;
    let c3 = -0.9009688679024191;
    let s1 = 0.7818314824680298;
    let s2 = 0.9749279121818236;
    let s3 = 0.4338837391175581;
    let m1 = a + c1 * s + c2 * t + c3 * u;
    let m2 = a + c2 * s + c3 * t + c1 * u;
    let m3 = a + c3 * s + c1 * t + c2 * u;
    let n1 = quarter(s1 * x + s2 * y + s3 * z, sign);
    let n2 = quarter(s2 * x - s3 * y - s1 * z, sign);
    let n3 = quarter(s3 * x - s1 * y + s2 * z, sign);
    return array<vec2f, 7>(a + s + t + u, m1 + n1, m2 + n2, m3 + n3, m3 - n3, m2 - n2, m1 - n1);
}

@compute @workgroup_size(THREADS)
fn convolve(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let colour = group.y;
    // Neighbouring threads work on neighbouring lines, which for columns are adjacent in memory.
    let l = thread % LINES;
    let t = thread / LINES;
    let line = group.x * LINES + l;
    let there = line < lines.lines;
    for (var j = t; j < N; j += EACH) {
        var v = vec2f(0);
        if (there && j < lines.from_count) {
            let at = colour * lines.from_plane + line * lines.from_line + j * lines.from_step;
            if (IN_PLACE) { v = result[at]; } else { v = source[at]; }
            if (TURN) { v = times(v, turn[colour]); }
        }
        row[j * LINES + l] = v;
    }
    workgroupBarrier();
    if (FORWARD) { transform(t, l, -1.0); }
    if (FILTER) {
        let column = min(line, lines.lines - 1u);
        let near = min(column, lines.lines - column);
        for (var j = t; j < N; j += EACH) {
            let even = near * (N / 2u + 1u) + min(j, N - j);
            let at = colour * lines.table_plane + select(column * N + j, even, EVEN);
            let factor = select(table[at], table[at] * vec2f(1, -1), CONJUGATE);
            row[j * LINES + l] = times(row[j * LINES + l], factor);
        }
        workgroupBarrier();
    }
    if (INVERSE) { transform(t, l, 1.0); }
    for (var j = t; j < lines.to_count; j += EACH) {
        if (there) {
            let at = colour * lines.to_plane + line * lines.to_line + j * lines.to_step;
            if (ADD) { result[at] += row[j * LINES + l]; } else { result[at] = row[j * LINES + l]; }
        }
    }
}
