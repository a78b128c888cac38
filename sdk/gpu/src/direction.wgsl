// Computes (cos πt, sin πt) to 2e-7, which drivers do not guarantee. See head.rs.
fn direction(t: f32) -> vec2f {
    let k = round(2.0 * t);
    let r = t - 0.5 * k;
    let r2 = r * r;
    let sine = r * (3.14159265 + r2 * (-5.167713 + r2 * (2.550164 + r2 * (-0.5992645 + r2 * 0.08214589))));
    let cosine = 1.0
        + r2 * (-4.934802 + r2 * (4.058712 + r2 * (-1.335263 + r2 * (0.23533063 + r2 * -0.02580689))));
    let quarter = i32(k) & 3;
    var v = vec2f(cosine, sine);
    if ((quarter & 1) == 1) { v = vec2f(-sine, cosine); }
    return select(v, -v, (quarter & 2) == 2);
}
