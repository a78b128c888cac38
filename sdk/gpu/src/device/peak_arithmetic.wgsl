// Independent chains of multiply-adds. Appended to peak.wgsl.

@compute @workgroup_size(256)
fn compute(@builtin(global_invocation_id) at: vec3u) {
    let seed = source[at.x % 16u];
    let x = lane(seed);
    var a = lane(seed + 1u);
    var b = lane(seed + 2u);
    var c = lane(seed + 3u);
    var d = lane(seed + 4u);
    var e = lane(seed + 5u);
    var f = lane(seed + 6u);
    var g = lane(seed + 7u);
    var h = lane(seed + 8u);
    for (var k = 0u; k < ROUNDS; k++) {
        a = more(a, x);
        b = more(b, x);
        c = more(c, x);
        d = more(d, x);
        e = more(e, x);
        f = more(f, x);
        g = more(g, x);
        h = more(h, x);
    }
    result[at.x % 16u] = bits(a) + bits(b) + bits(c) + bits(d) + bits(e) + bits(f) + bits(g) + bits(h);
}
