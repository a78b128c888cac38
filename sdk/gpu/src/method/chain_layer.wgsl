// A single hidden layer. Appended to chain.wgsl.

fn put(group: u32, x: i32, y: i32, v: vec4f) {
    if (y < frame.height && group < GROUPS_OUT) {
        let at = group * frame.plane + u32(y * frame.width + x);
        if (SKIP) {
            // The skip's value is at the result's position, and only this thread accesses it.
            result[at] = following(residual(v, result[at]));
        } else {
            result[at] = following(activation(v));
        }
    }
}

@compute @workgroup_size(32, 2)
fn layer(@builtin(global_invocation_id) at: vec3u) {
    let x = i32(at.x);
    let y = 4 * i32(at.y);
    if (x >= frame.width || y >= frame.height) { return; }
    for (var block = 0u; block < BLOCKS; block++) {
        let t = sums(block, x, y);
        put(2u * block, x, y, t.a0);
        put(2u * block, x, y + 1, t.a1);
        put(2u * block, x, y + 2, t.a2);
        put(2u * block, x, y + 3, t.a3);
        put(2u * block + 1u, x, y, t.b0);
        put(2u * block + 1u, x, y + 1, t.b1);
        put(2u * block + 1u, x, y + 2, t.b2);
        put(2u * block + 1u, x, y + 3, t.b3);
    }
}
