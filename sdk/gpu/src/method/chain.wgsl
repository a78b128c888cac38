// The loops of a chain of 3x3 convolutions. chain_float.wgsl or chain_int8.wgsl, before this text, define the number
// format.
//
// Planes are stored in groups of four channels, `[group][pixel]`, each a `Value`. A thread computes four pixels of a
// column for eight filters at a time: neighbouring threads read neighbouring pixels, a value serves up to three of the
// thread's pixels, and the weights, the same for all threads, are in uniform memory if they fit. They are stored in
// reading order: biases, then `[eight filters][column of taps][group][row of taps]`.

// The layers' columns, rows and their product, in pixels or squares of two by two; then the frame's own pixels.
struct Frame { width: i32, height: i32, plane: u32, tiles: u32, columns: i32, rows: i32, unused: vec2u }
struct Totals {
    a0: vec4f, a1: vec4f, a2: vec4f, a3: vec4f, b0: vec4f, b1: vec4f, b2: vec4f, b3: vec4f,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(2) var<storage, read> features: array<Value>;
@group(0) @binding(3) var<storage, read> beside: array<Value>;
@group(0) @binding(4) var<storage, read_write> result: array<Value>;

fn in_frame(x: i32, y: i32) -> bool { return x >= 0 && x < frame.width && y >= 0 && y < frame.height; }

// Returns a group's value at a pixel, or the value that represents 0 outside the frame.
fn value_at(group: u32, x: i32, y: i32) -> Value {
    let inside = in_frame(x, y);
    let pixel = u32(select(0, y * frame.width + x, inside));
    if (BESIDE > 0u && group >= GROUPS) {
        return select(zero(), beside[(group - GROUPS) * frame.plane + pixel], inside);
    }
    return select(zero(), features[group * frame.plane + pixel], inside);
}

// Returns the sums of filters 8 block … 8 block + 7 at the pixels (x, y … y + 3).
fn sums(block: u32, x: i32, y: i32) -> Totals {
    var w = begun(block);
    for (var kx = 0u; kx < 3u; kx++) {
        for (var group = 0u; group < GROUPS + BESIDE; group++) {
            let at = HEADER + ((block * 3u + kx) * (GROUPS + BESIDE) + group) * 3u * WORDS;
            let column = x + i32(kx) - 1;
            let v0 = value_at(group, column, y - 1);
            let v1 = value_at(group, column, y);
            let v2 = value_at(group, column, y + 1);
            let v3 = value_at(group, column, y + 2);
            let v4 = value_at(group, column, y + 3);
            let v5 = value_at(group, column, y + 4);
            tap(&w, at, v0, v1, v2, v3);
            tap(&w, at + WORDS, v1, v2, v3, v4);
            tap(&w, at + 2u * WORDS, v2, v3, v4, v5);
        }
        column_done(&w);
    }
    return ended(w, block);
}
