// Two hidden layers and the skip around them in one dispatch. Intermediate values stay in workgroup memory. A tile of
// 16x16 pixels of the first layer gives 14x14 of the second; the neighbouring tiles compute the rim again. Appended to
// chain.wgsl. The second layer's weights follow the first's.

// EACH is the offset of the second layer's weights.
const TILE: i32 = 16;
const INNER: i32 = 14;

var<workgroup> between: array<Value, GROUPS * 256u>;

fn keep(group: u32, column: i32, row: i32, x: i32, y: i32, value: vec4f) {
    if (group < GROUPS) {
        let at = (i32(group) * TILE + row) * TILE + column;
        between[at] = select(zero(), activation(value), in_frame(x, y));
    }
}

fn kept(group: u32, column: i32, row: i32) -> Value {
    return between[(i32(group) * TILE + min(row, TILE - 1)) * TILE + min(column, TILE - 1)];
}

// Returns `sums` of the second layer for the tile's pixels (x, y … y + 3). The taps begin at (x, y).
fn inner_sums(block: u32, x: i32, y: i32) -> Totals {
    var w = begun(EACH + block);
    for (var kx = 0u; kx < 3u; kx++) {
        for (var group = 0u; group < GROUPS; group++) {
            let at = EACH + HEADER + ((block * 3u + kx) * GROUPS + group) * 3u * WORDS;
            let column = x + i32(kx);
            let v0 = kept(group, column, y);
            let v1 = kept(group, column, y + 1);
            let v2 = kept(group, column, y + 2);
            let v3 = kept(group, column, y + 3);
            let v4 = kept(group, column, y + 4);
            let v5 = kept(group, column, y + 5);
            tap(&w, at, v0, v1, v2, v3);
            tap(&w, at + WORDS, v1, v2, v3, v4);
            tap(&w, at + 2u * WORDS, v2, v3, v4, v5);
        }
        column_done(&w);
    }
    return ended(w, EACH + block);
}

fn write_sum(group: u32, x: i32, y: i32, within: bool, value: vec4f) {
    if (within && y < frame.height && group < GROUPS) {
        let at = group * frame.plane + u32(y * frame.width + x);
        result[at] = following(residual(value, features[at]));
    }
}

@compute @workgroup_size(16, 4)
fn pair(@builtin(workgroup_id) tile: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let left = i32(tile.x) * INNER;
    let top = i32(tile.y) * INNER;
    let column = i32(thread.x);
    let row = 4 * i32(thread.y);
    let x = left + column - 1;
    let y = top + row - 1;
    for (var block = 0u; block < BLOCKS; block++) {
        let t = sums(block, x, y);
        keep(2u * block, column, row, x, y, t.a0);
        keep(2u * block, column, row + 1, x, y + 1, t.a1);
        keep(2u * block, column, row + 2, x, y + 2, t.a2);
        keep(2u * block, column, row + 3, x, y + 3, t.a3);
        keep(2u * block + 1u, column, row, x, y, t.b0);
        keep(2u * block + 1u, column, row + 1, x, y + 1, t.b1);
        keep(2u * block + 1u, column, row + 2, x, y + 2, t.b2);
        keep(2u * block + 1u, column, row + 3, x, y + 3, t.b3);
    }
    workgroupBarrier();
    let within = column < INNER && left + column < frame.width;
    for (var block = 0u; block < BLOCKS; block++) {
        let t = inner_sums(block, column, row);
        let i = x + 1;
        let j = y + 1;
        write_sum(2u * block, i, j, within && row < INNER, t.a0);
        write_sum(2u * block, i, j + 1, within && row + 1 < INNER, t.a1);
        write_sum(2u * block, i, j + 2, within && row + 2 < INNER, t.a2);
        write_sum(2u * block, i, j + 3, within && row + 3 < INNER, t.a3);
        write_sum(2u * block + 1u, i, j, within && row < INNER, t.b0);
        write_sum(2u * block + 1u, i, j + 1, within && row + 1 < INNER, t.b1);
        write_sum(2u * block + 1u, i, j + 2, within && row + 2 < INNER, t.b2);
        write_sum(2u * block + 1u, i, j + 3, within && row + 3 < INNER, t.b3);
    }
}
