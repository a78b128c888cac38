// Decides the depth of the display's pixels from conditioned readings, along the edges of the colour: the counterpart
// of condition/surfaces.rs, pixels.rs and history.rs. The header defines the constants of condition/readings.rs.

struct Sizes {
    // Of the display.
    width: u32,
    height: u32,
    // Of the readings.
    columns: u32,
    rows: u32,
    // Whether readings have several pixels, and whether the choices of the previous frame count.
    coarse: u32,
    past: u32,
}

@group(0) @binding(0) var<uniform> sizes: Sizes;
// The depth of the readings, then their kinds, four to a word.
@group(0) @binding(1) var<storage, read> readings: array<u32>;
// Along x and then along y: the reading of each pixel, the pixel's offset from its middle, and the first pixel of each
// reading and one past its last.
@group(0) @binding(2) var<storage, read> places: array<u32>;
// Red, green, blue and depth of each pixel.
@group(0) @binding(3) var<storage, read_write> picture: array<f32>;
// The sums of red, green and blue of each reading's pixels, and the sum of all squares.
@group(0) @binding(4) var<storage, read_write> colours: array<vec4f>;
// For each pixel the depth of the first and of the second surface, and the lead of the first.
@group(0) @binding(5) var<storage, read_write> choices: array<f32>;
// The last depth of each pixel at an edge, and its colour then, with 255 in the highest byte; zeros if there is none.
@group(0) @binding(6) var<storage, read_write> history: array<vec2u>;

// The kinds of readings.
const INSIDE: u32 = 0u;
const FILLED_KIND: u32 = 2u;
const MIXED: u32 = 3u;
const MOST: u32 = 4u;
const FAR: f32 = 1e30;
// Stands for the depth of a pixel without a history. It lies far from every surface.
const NONE: f32 = -9.0;

fn depth_of(reading: u32) -> f32 { return bitcast<f32>(readings[reading]); }

fn kind_of(reading: u32) -> u32 {
    return (readings[sizes.columns * sizes.rows + reading / 4u] >> (8u * (reading % 4u))) & 255u;
}

// Returns where the places along an axis begin.
fn begin(y: bool) -> u32 { return select(0u, 2u * (sizes.width + sizes.columns), y); }

fn pixels(y: bool) -> u32 { return select(sizes.width, sizes.height, y); }

fn cell(y: bool, pixel: u32) -> u32 { return places[begin(y) + pixel]; }

fn offset(y: bool, pixel: u32) -> f32 { return bitcast<f32>(places[begin(y) + pixels(y) + pixel]); }

fn covered(y: bool, reading: u32) -> vec2u {
    let at = begin(y) + 2u * (pixels(y) + reading);
    return vec2u(places[at], places[at + 1u]);
}

fn colour_of(pixel: u32) -> vec3f {
    return vec3f(picture[4u * pixel], picture[4u * pixel + 1u], picture[4u * pixel + 2u]);
}

fn square(v: vec3f) -> f32 { return v.x * v.x + v.y * v.y + v.z * v.z; }

// Returns the reading `k` of the 3×3 around (`column`, `row`). Those beyond the border repeat.
fn around(column: u32, row: u32, k: u32) -> u32 {
    let x = min(max(column + k % 3u, 1u) - 1u, sizes.columns - 1u);
    let y = min(max(row + k / 3u, 1u) - 1u, sizes.rows - 1u);
    return y * sizes.columns + x;
}

// Sums the colours of the readings at edges and next to them.
@compute @workgroup_size(64)
fn sum(@builtin(global_invocation_id) at: vec3u) {
    if (at.x >= sizes.columns) { return; }
    var near = false;
    for (var k = 0u; k < 9u; k++) { near |= kind_of(around(at.x, at.y, k)) != INSIDE; }
    if (!near) { return; }
    let x = covered(false, at.x);
    let y = covered(true, at.y);
    var sums = vec4f(0);
    for (var row = y.x; row < y.y; row++) {
        for (var column = x.x; column < x.y; column++) {
            let colour = colour_of(row * sizes.width + column);
            sums += vec4f(colour, square(colour));
        }
    }
    colours[at.y * sizes.columns + at.x] = sums;
}

struct Surface {
    depth: f32,
    count: f32,
    covers: array<f32, 9>,
    slopes: array<f32, 9>,
    has: array<f32, 9>,
    // The number of pixels, and the sums of their colours and squares.
    pixels: f32,
    sums: vec4f,
    colour: vec3f,
    // −1/2σ² and −³⁄₂·ln σ² of its colours' normal distribution.
    narrow: f32,
    peak: f32,
}

var<private> surfaces: array<Surface, MOST>;
var<private> count: u32;

// Adds the colours of a reading to a surface.
fn add(s: u32, reading: u32) {
    let x = covered(false, reading % sizes.columns);
    let y = covered(true, reading / sizes.columns);
    surfaces[s].pixels += f32((x.y - x.x) * (y.y - y.x));
    surfaces[s].sums += colours[reading];
}

// Begins a surface with the depth and the colours of a reading. It covers reading `k` of the 3×3, and none for 9.
fn begin_surface(reading: u32, k: u32) {
    let s = count;
    count += 1u;
    surfaces[s].depth = depth_of(reading);
    surfaces[s].count = 1.0;
    surfaces[s].pixels = 0.0;
    surfaces[s].sums = vec4f(0);
    for (var other = 0u; other < 9u; other++) { surfaces[s].covers[other] = select(0.0, 1.0, other == k); }
    add(s, reading);
}

// Shares the mixed reading `k` of this depth between the surfaces before and behind it. Returns whether both exist.
fn split(k: u32, depth: f32) -> bool {
    var before = MOST;
    var behind = MOST;
    var before_apart = FAR;
    var behind_apart = FAR;
    for (var s = 0u; s < count; s++) {
        let apart = abs(surfaces[s].depth - depth);
        if (surfaces[s].depth < depth) {
            if (apart < before_apart) { before = s; before_apart = apart; }
        } else if (apart < behind_apart) { behind = s; behind_apart = apart; }
    }
    if (before == MOST || behind == MOST) { return false; }
    let share = (depth - surfaces[before].depth) / (surfaces[behind].depth - surfaces[before].depth);
    surfaces[before].covers[k] += 1.0 - share;
    surfaces[behind].covers[k] += share;
    return true;
}

// Returns the end behind or before a mixed reading of a ramp of two mixed readings along a row or a column, or the
// number of readings if there is none.
fn end_of_ramp(reading: u32, behind: bool) -> u32 {
    let place = vec2i(vec2u(reading % sizes.columns, reading / sizes.columns));
    let all = vec2i(vec2u(sizes.columns, sizes.rows));
    for (var ramp = 0u; ramp < 8u; ramp++) {
        // Left, right, up and down, with the reading as the second and as the third of the ramp.
        let along = vec2i(select(0, 2 * i32(ramp / 2u) - 1, ramp < 4u), select(2 * i32(ramp / 2u) - 5, 0, ramp < 4u));
        let first = place - along * (1 + i32(ramp % 2u));
        let last = first + 3 * along;
        if (any(min(first, last) < vec2i(0)) || any(max(first, last) >= all)) { continue; }
        var is_ramp = true;
        var depth = 0.0;
        var end = 0u;
        for (var k = 0; k < 4; k++) {
            let at = vec2u(first + k * along);
            end = at.y * sizes.columns + at.x;
            let next = depth_of(end);
            is_ramp &= k == 0 || (next != depth && (next > depth) == behind);
            is_ramp &= (kind_of(end) == MIXED) == (k == 1 || k == 2);
            depth = next;
        }
        if (is_ramp && abs(depth - depth_of(reading)) > TOLERANCE) { return end; }
    }
    return sizes.columns * sizes.rows;
}

// Shares the mixed `reading`, `k` of the 3×3 around `middle`. One of the two surfaces may be borrowed from the end of a
// ramp. Returns whether both exist.
fn shared_out(middle: u32, reading: u32, k: u32) -> bool {
    let depth = depth_of(reading);
    if (split(k, depth)) { return true; }
    if (sizes.coarse == 0u || kind_of(middle) != MIXED || count == 0u || count == MOST) { return false; }
    let end = end_of_ramp(reading, surfaces[0].depth < depth);
    if (end == sizes.columns * sizes.rows) { return false; }
    begin_surface(end, 9u);
    return split(k, depth);
}

// Groups the 3×3 readings around (`column`, `row`) to surfaces: first those that are neither filled nor mixed, then the
// filled ones, then the mixed ones.
fn group(column: u32, row: u32) {
    // Nearest first.
    var order = array<u32, 9>(4u, 1u, 3u, 5u, 7u, 0u, 2u, 6u, 8u);
    count = 0u;
    let middle = around(column, row, 4u);
    for (var i = 0u; i < 27u; i++) {
        let k = order[i % 9u];
        let reading = around(column, row, k);
        let round = i / 9u;
        if (max(kind_of(reading), 1u) - 1u != round) { continue; }
        let depth = depth_of(reading);
        var nearest = 0u;
        var apart = FAR;
        for (var s = 0u; s < count; s++) {
            let distance = abs(surfaces[s].depth - depth);
            if (distance < apart) { nearest = s; apart = distance; }
        }
        if (apart <= TOLERANCE) {
            surfaces[nearest].depth += (depth - surfaces[nearest].depth) / (surfaces[nearest].count + 1.0);
            surfaces[nearest].count += 1.0;
            surfaces[nearest].covers[k] += 1.0;
            if (round < 2u) { add(nearest, reading); }
        } else if (round == 2u && shared_out(middle, reading, k)) {
        } else if (count < MOST) {
            begin_surface(reading, k);
        }
    }
    for (var s = 0u; s < count; s++) { finish(s, column, row); }
}

// Computes what a surface covers and the distribution of its colours.
fn finish(s: u32, column: u32, row: u32) {
    for (var k = 0u; k < 9u; k++) {
        let reading = around(column, row, k);
        var covers = surfaces[s].covers[k];
        if (count > 1u && kind_of(reading) == FILLED_KIND) {
            covers = select((1.0 - FILLED) / f32(count - 1u), FILLED, covers >= 1.0);
        }
        surfaces[s].covers[k] = covers;
        let has = select(0.0, 1.0, covers >= 1.0);
        surfaces[s].has[k] = has;
        surfaces[s].slopes[k] = has * (depth_of(reading) - surfaces[s].depth);
    }
    let mean = surfaces[s].sums / surfaces[s].pixels;
    let variance = max(mean.w - square(mean.xyz), LEAST_VARIANCE);
    surfaces[s].colour = mean.xyz;
    surfaces[s].narrow = -0.5 / variance;
    surfaces[s].peak = -1.5 * log(variance);
}

// Interpolates values of the 3×3 readings at the offset `at` from the middle one.
fn interpolated(values: array<f32, 9>, at: vec2f) -> f32 {
    var v = values;
    let below = select(at.y, 1.0 + at.y, at.y < 0.0);
    let row = select(3u, 0u, at.y < 0.0);
    let left = (1.0 - below) * v[row] + below * v[row + 3u];
    let middle = (1.0 - below) * v[row + 1u] + below * v[row + 4u];
    let right = (1.0 - below) * v[row + 2u] + below * v[row + 5u];
    return left * max(-at.x, 0.0) + middle * (1.0 - abs(at.x)) + right * max(at.x, 0.0);
}

fn surface_depth(s: u32, at: vec2f) -> f32 {
    let known = interpolated(surfaces[s].has, at);
    let slope = interpolated(surfaces[s].slopes, at);
    return clamp(surfaces[s].depth + select(0.0, slope / known, known > 0.05), 0.0, 1.0);
}

// Returns the depth of a pixel between the readings.
fn between_readings(column: u32, row: u32, at: vec2f) -> f32 {
    // The four readings around the pixel begin at 0, 1, 3 or 4 of the 3×3.
    let first = select(1u, 0u, at.x < 0.0) + select(3u, 0u, at.y < 0.0);
    let share = select(at, 1.0 + at, at < vec2f(0));
    let v = vec4f(
        depth_of(around(column, row, first)),
        depth_of(around(column, row, first + 1u)),
        depth_of(around(column, row, first + 3u)),
        depth_of(around(column, row, first + 4u)),
    );
    let above = v.x + share.x * (v.y - v.x);
    let below = v.z + share.x * (v.w - v.z);
    return clamp(above + share.y * (below - above), 0.0, 1.0);
}

// Returns the last depth of a pixel of this colour, or NONE if there is none or the colour has changed.
fn held(pixel: u32, colour: vec3f) -> f32 {
    let last = history[pixel];
    if (sizes.past == 0u || last.y >> 24u == 0u) { return NONE; }
    let bytes = vec3f(vec3u(last.y, last.y >> 8u, last.y >> 16u) & vec3u(255u));
    let same = square(colour - bytes * (1.0 / 255.0)) <= STAYS * STAYS;
    return select(NONE, bitcast<f32>(last.x), same);
}

// Chooses among the surfaces for a pixel, and returns the depths of the first and of the second, and the lead of the
// first.
fn chosen(at: vec2f, colour: vec3f, held: f32) -> vec3f {
    if (count == 1u) { return vec3f(surface_depth(0u, at), 0.0, FAR); }
    var likelihoods: array<f32, MOST>;
    var most = -FAR;
    var nearest = FAR;
    for (var s = 0u; s < count; s++) {
        likelihoods[s] = square(colour - surfaces[s].colour) * surfaces[s].narrow + surfaces[s].peak;
        most = max(most, likelihoods[s]);
        nearest = min(nearest, abs(surfaces[s].depth - held));
    }
    // The depth and the score.
    var first = vec2f(0.0, -FAR);
    var second = vec2f(0.0, -FAR);
    for (var s = 0u; s < count; s++) {
        let apart = abs(surfaces[s].depth - held);
        let lead = select(0.0, KEEP, apart <= SAME && apart <= nearest);
        let evidence = max(likelihoods[s] - most, -MOST_EVIDENCE);
        let score = PLACE * interpolated(surfaces[s].covers, at) + evidence + lead;
        let own = vec2f(surface_depth(s, at), score);
        if (score > first.y) {
            second = first;
            first = own;
        } else if (score > second.y) {
            second = own;
        }
    }
    return vec3f(first.x, second.x, first.y - second.y);
}

// Decides each pixel by itself.
@compute @workgroup_size(64)
fn choose(@builtin(global_invocation_id) at: vec3u) {
    if (at.x >= sizes.width) { return; }
    let pixel = at.y * sizes.width + at.x;
    let column = cell(false, at.x);
    let row = cell(true, at.y);
    let place = vec2f(offset(false, at.x), offset(true, at.y));
    if (kind_of(row * sizes.columns + column) == INSIDE) {
        let depth = between_readings(column, row, place);
        choices[3u * pixel] = depth;
        picture[4u * pixel + 3u] = depth;
        return;
    }
    let colour = colour_of(pixel);
    group(column, row);
    let choice = chosen(place, colour, held(pixel, colour));
    choices[3u * pixel] = choice.x;
    choices[3u * pixel + 1u] = choice.y;
    choices[3u * pixel + 2u] = choice.z;
}

// Returns a weight that falls from 1 to a quarter where `square` is that of `distance`.
fn quarter(square: f32, distance: f32) -> f32 {
    let fall = 1.0 + square * (1.0 / (distance * distance));
    return 1.0 / (fall * fall);
}

// Returns the mean vote of a pixel's neighbours, 1 for its first depth and −1 for its second.
fn vote(at: vec2u, colour: vec3f) -> f32 {
    let pixel = at.y * sizes.width + at.x;
    let first = choices[3u * pixel];
    let second = choices[3u * pixel + 1u];
    var sum = 0.0;
    var weights = 0.0;
    for (var k = 0u; k < 9u; k++) {
        let other = (at.y + k / 3u - 1u) * sizes.width + at.x + k % 3u - 1u;
        let depth = choices[3u * other];
        let step = vec2f(f32(k % 3u), f32(k / 3u)) - 1.0;
        let alike = max(quarter(square(colour_of(other) - colour), ALIKE), LEAST_ALIKE);
        let weight = quarter(step.x * step.x + step.y * step.y, NEAR) * alike;
        sum += select(-weight, weight, abs(depth - first) <= abs(depth - second));
        weights += weight;
    }
    // The pixel itself has no vote.
    return (sum - 1.0) / (weights - 1.0);
}

// Lets the neighbours of pixels at edges vote, and the pixels follow slowly.
@compute @workgroup_size(64)
fn decide(@builtin(global_invocation_id) at: vec3u) {
    if (at.x >= sizes.width) { return; }
    let pixel = at.y * sizes.width + at.x;
    if (kind_of(cell(true, at.y) * sizes.columns + cell(false, at.x)) == INSIDE) {
        if (sizes.past == 0u) { history[pixel] = vec2u(0u); }
        return;
    }
    let colour = colour_of(pixel);
    var depth = choices[3u * pixel];
    let lead = choices[3u * pixel + 2u];
    let inside = at.x > 0u && at.y > 0u && at.x + 1u < sizes.width && at.y + 1u < sizes.height;
    if (inside && lead < NEIGHBOURS && lead + NEIGHBOURS * vote(at.xy, colour) <= 0.0) {
        depth = choices[3u * pixel + 1u];
    }
    let last = held(pixel, colour);
    if (abs(depth - last) <= SAME) { depth = last + SHARE * (depth - last); }
    let bytes = vec3u(colour * 255.0 + 0.5);
    history[pixel] = vec2u(bitcast<u32>(depth), bytes.x | (bytes.y << 8u) | (bytes.z << 16u) | 0xff000000u);
    picture[4u * pixel + 3u] = depth;
}
