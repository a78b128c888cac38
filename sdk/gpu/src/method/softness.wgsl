// Counts the edges in the depth of a frame, and the sharp ones among them: the counterpart of depth/softness.rs, with a
// thread for each pixel. The header from softness.rs defines HEIGHT, WIDTH, WINDOW, EVERY, LINES, EDGE and ONE_STEP.

// Red, green, blue and depth.
@group(0) @binding(0) var<storage, read> surfaces: array<vec4f>;
// The number of sharp edges and of all edges.
@group(0) @binding(1) var<storage, read_write> counts: array<atomic<u32>, 2>;

const BESIDE: u32 = (WINDOW + 1u) / 2u;

struct Line { origin: u32, step: u32, length: u32 }

fn at(line: Line, i: u32) -> f32 { return surfaces[line.origin + i * line.step].a; }

fn change(line: Line, i: u32) -> f32 { return abs(at(line, i + 1u) - at(line, i)); }

// Returns the change over a window that continues a slope of `steps` steps toward `sign`.
fn slope(line: Line, start: u32, steps: u32, sign: f32) -> f32 {
    let step = (at(line, start + steps) - at(line, start)) / f32(steps) * sign;
    return max(step, 0.0) * f32(WINDOW);
}

// Counts the edge of the window of `line` that begins at `start`, if there is one.
fn count(line: Line, start: u32) {
    let end = start + WINDOW;
    if (start < BESIDE || end + BESIDE >= line.length) { return; }
    let across = at(line, end) - at(line, start);
    if (abs(across) <= EDGE) { return; }
    let left = min(start, WINDOW);
    let right = min(line.length - 1u - end, WINDOW);
    let beside = max(slope(line, start - left, left, sign(across)), slope(line, end, right, sign(across)));
    let whole = abs(across) - beside;
    if (whole <= EDGE) { return; }
    let at_middle = start + WINDOW / 2u;
    let middle = change(line, at_middle);
    for (var i = start; i < at_middle; i++) {
        if (change(line, i) >= middle) { return; }
    }
    for (var i = at_middle + 1u; i < end; i++) {
        if (change(line, i) > middle) { return; }
    }
    atomicAdd(&counts[1], 1u);
    if (middle >= ONE_STEP * whole) { atomicAdd(&counts[0], 1u); }
}

@compute @workgroup_size(64)
fn measure(@builtin(global_invocation_id) id: vec3u) {
    let x = id.x;
    let y = id.y;
    if (x >= WIDTH) { return; }
    if (y % LINES % EVERY == 0u) { count(Line(y * WIDTH, 1u, WIDTH), x); }
    if (x % LINES % EVERY == 0u) { count(Line(x, WIDTH, HEIGHT), y); }
}
