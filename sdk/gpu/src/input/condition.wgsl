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

// Not a uniform: lavapipe compiles a program anew for each dispatch where a uniform alone decides a branch, and keeps
// what it compiled.
@group(0) @binding(0) var<storage, read> sizes: Sizes;
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

// The surfaces around the readings of a tile of 8×8 pixels. Surface `s` of the reading in `slot` has its value `field`
// at (4·field + s)·64 + slot.
var<workgroup> surfaces: array<f32, 64 * MOST * 16>;
// The mean depth of a surface.
const DEPTH: u32 = 0u;
// The share of each of the 3×3 readings that it covers.
const COVERS: u32 = 1u;
// While readings are grouped: the sums of the colours of its pixels, of their squares, and the number of pixels.
// Afterwards: the mean colour, −1/2σ² and −³⁄₂·ln σ² of the colours' normal distribution.
const COLOURS: u32 = 10u;
// The number of its readings. Afterwards, in the first surface, the number of surfaces.
const COUNT: u32 = 15u;

fn place_of(slot: u32, s: u32, field: u32) -> u32 { return (MOST * field + s) * 64u + slot; }

fn value(slot: u32, s: u32, field: u32) -> f32 { return surfaces[place_of(slot, s, field)]; }

// Adds the colours of a reading to a surface.
fn add(slot: u32, s: u32, reading: u32) {
    let x = covered(false, reading % sizes.columns);
    let y = covered(true, reading / sizes.columns);
    for (var k = 0u; k < 4u; k++) { surfaces[place_of(slot, s, COLOURS + k)] += colours[reading][k]; }
    surfaces[place_of(slot, s, COLOURS + 4u)] += f32((x.y - x.x) * (y.y - y.x));
}

// Begins a surface with the depth and the colours of a reading. It covers reading `k` of the 3×3, and none for 9.
fn begin_surface(slot: u32, s: u32, reading: u32, k: u32) {
    for (var field = COVERS; field < COUNT; field++) {
        surfaces[place_of(slot, s, field)] = select(0.0, 1.0, k < 9u && field == COVERS + k);
    }
    surfaces[place_of(slot, s, DEPTH)] = depth_of(reading);
    surfaces[place_of(slot, s, COUNT)] = 1.0;
    add(slot, s, reading);
}

// Shares the mixed reading `k` of this depth between the surfaces before and behind it, of `count`. Returns whether
// both exist.
fn split(slot: u32, count: u32, k: u32, depth: f32) -> bool {
    var before = MOST;
    var behind = MOST;
    var before_apart = FAR;
    var behind_apart = FAR;
    for (var s = 0u; s < count; s++) {
        let own = value(slot, s, DEPTH);
        let apart = abs(own - depth);
        if (own < depth) {
            if (apart < before_apart) { before = s; before_apart = apart; }
        } else if (apart < behind_apart) { behind = s; behind_apart = apart; }
    }
    if (before == MOST || behind == MOST) { return false; }
    let nearer = value(slot, before, DEPTH);
    let share = (depth - nearer) / (value(slot, behind, DEPTH) - nearer);
    surfaces[place_of(slot, before, COVERS + k)] += 1.0 - share;
    surfaces[place_of(slot, behind, COVERS + k)] += share;
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

// Returns the reading at the end of a ramp from which the mixed `reading` borrows the surface that it lacks, or the
// number of readings if there is none. `count` surfaces are there, and the reading is one of the 3×3 around `middle`.
fn borrowed(slot: u32, count: u32, middle: u32, reading: u32) -> u32 {
    if (sizes.coarse == 0u || kind_of(middle) != MIXED || count == 0u || count == MOST) {
        return sizes.columns * sizes.rows;
    }
    return end_of_ramp(reading, value(slot, 0u, DEPTH) < depth_of(reading));
}

// Groups the 3×3 readings around (`column`, `row`) to surfaces: first those that are neither filled nor mixed, then the
// filled ones, then the mixed ones.
fn group(slot: u32, column: u32, row: u32) {
    let middle = around(column, row, 4u);
    var count = 0u;
    for (var i = 0u; i < 27u; i++) {
        // Nearest first: 4, 1, 3, 5, 7, 0, 2, 6, 8.
        let k = select((0x62075314u >> (4u * (i % 9u))) & 15u, 8u, i % 9u == 8u);
        let reading = around(column, row, k);
        let round = i / 9u;
        if (max(kind_of(reading), 1u) - 1u != round) { continue; }
        let depth = depth_of(reading);
        var nearest = 0u;
        var apart = FAR;
        for (var s = 0u; s < count; s++) {
            let distance = abs(value(slot, s, DEPTH) - depth);
            if (distance < apart) { nearest = s; apart = distance; }
        }
        if (apart <= TOLERANCE) {
            let members = value(slot, nearest, COUNT) + 1.0;
            surfaces[place_of(slot, nearest, DEPTH)] += (depth - value(slot, nearest, DEPTH)) / members;
            surfaces[place_of(slot, nearest, COUNT)] = members;
            surfaces[place_of(slot, nearest, COVERS + k)] += 1.0;
            if (round < 2u) { add(slot, nearest, reading); }
            continue;
        }
        var is_shared = round == 2u && split(slot, count, k, depth);
        if (round == 2u && !is_shared) {
            let end = borrowed(slot, count, middle, reading);
            if (end != sizes.columns * sizes.rows) {
                begin_surface(slot, count, end, 9u);
                count += 1u;
                is_shared = split(slot, count, k, depth);
            }
        }
        if (!is_shared && count < MOST) {
            begin_surface(slot, count, reading, k);
            count += 1u;
        }
    }
    for (var s = 0u; s < count; s++) { finish(slot, s, count, column, row); }
    surfaces[place_of(slot, 0u, COUNT)] = f32(count);
}

// Computes what a surface of `count` covers and the distribution of its colours.
fn finish(slot: u32, s: u32, count: u32, column: u32, row: u32) {
    for (var k = 0u; k < 9u; k++) {
        if (count > 1u && kind_of(around(column, row, k)) == FILLED_KIND) {
            let place = place_of(slot, s, COVERS + k);
            surfaces[place] = select((1.0 - FILLED) / f32(count - 1u), FILLED, surfaces[place] >= 1.0);
        }
    }
    let pixels = value(slot, s, COLOURS + 4u);
    let mean = colour_of_surface(slot, s) / pixels;
    let variance = max(value(slot, s, COLOURS + 3u) / pixels - square(mean), LEAST_VARIANCE);
    for (var k = 0u; k < 3u; k++) { surfaces[place_of(slot, s, COLOURS + k)] = mean[k]; }
    surfaces[place_of(slot, s, COLOURS + 3u)] = -0.5 / variance;
    surfaces[place_of(slot, s, COLOURS + 4u)] = -1.5 * log(variance);
}

fn colour_of_surface(slot: u32, s: u32) -> vec3f {
    return vec3f(value(slot, s, COLOURS), value(slot, s, COLOURS + 1u), value(slot, s, COLOURS + 2u));
}

// Interpolates values of two rows of three readings at the offset `at` from the middle of the 3×3 readings.
fn interpolated(above: vec3f, below: vec3f, at: vec2f) -> f32 {
    let share = select(at.y, 1.0 + at.y, at.y < 0.0);
    let v = (1.0 - share) * above + share * below;
    return v.x * max(-at.x, 0.0) + v.y * (1.0 - abs(at.x)) + v.z * max(at.x, 0.0);
}

// Returns the depth of the three readings from the 3×3's `first` on.
fn depths(column: u32, row: u32, first: u32) -> vec3f {
    return vec3f(
        depth_of(around(column, row, first)),
        depth_of(around(column, row, first + 1u)),
        depth_of(around(column, row, first + 2u)),
    );
}

// Returns the shares of the three readings from the 3×3's `first` on that a surface covers.
fn shares(slot: u32, s: u32, first: u32) -> vec3f {
    return vec3f(
        value(slot, s, COVERS + first),
        value(slot, s, COVERS + first + 1u),
        value(slot, s, COVERS + first + 2u),
    );
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

// Chooses among the surfaces in `slot`, those around (`column`, `row`), for a pixel. Returns the depths of the first
// and of the second, and the lead of the first.
fn chosen(slot: u32, column: u32, row: u32, at: vec2f, colour: vec3f, held: f32) -> vec3f {
    let count = u32(value(slot, 0u, COUNT));
    var likelihoods = vec4f(-FAR);
    var nearest = FAR;
    for (var s = 0u; s < count; s++) {
        let apart = square(colour - colour_of_surface(slot, s));
        let likelihood = apart * value(slot, s, COLOURS + 3u) + value(slot, s, COLOURS + 4u);
        likelihoods = select(likelihoods, vec4f(likelihood), vec4u(0u, 1u, 2u, 3u) == vec4u(s));
        nearest = min(nearest, abs(value(slot, s, DEPTH) - held));
    }
    let most = max(max(likelihoods.x, likelihoods.y), max(likelihoods.z, likelihoods.w));
    // The two rows of readings around the pixel begin at 0 or at 3 of the 3×3.
    let upper = select(3u, 0u, at.y < 0.0);
    let lower = upper + 3u;
    let above = depths(column, row, upper);
    let below = depths(column, row, lower);
    // The depth and the score.
    var first = vec2f(0.0, -FAR);
    var second = vec2f(0.0, -FAR);
    for (var s = 0u; s < count; s++) {
        let depth = value(slot, s, DEPTH);
        let covers_above = shares(slot, s, upper);
        let covers_below = shares(slot, s, lower);
        let has_above = select(vec3f(0), vec3f(1), covers_above >= vec3f(1));
        let has_below = select(vec3f(0), vec3f(1), covers_below >= vec3f(1));
        let known = interpolated(has_above, has_below, at);
        let slope = interpolated(has_above * (above - depth), has_below * (below - depth), at);
        let apart = abs(depth - held);
        let lead = select(0.0, KEEP, apart <= SAME && apart <= nearest);
        let evidence = max(likelihoods[s] - most, -MOST_EVIDENCE);
        let score = PLACE * interpolated(covers_above, covers_below, at) + evidence + lead;
        let own = vec2f(clamp(depth + select(0.0, slope / known, known > 0.05), 0.0, 1.0), score);
        if (score > first.y) {
            second = first;
            first = own;
        } else if (score > second.y) {
            second = own;
        }
    }
    return vec3f(first.x, second.x, first.y - second.y);
}

// Decides each pixel by itself. A workgroup takes 8×8 pixels: first it groups the readings at edges that they lie in,
// each at the slot of its first pixel.
@compute @workgroup_size(8, 8)
fn choose(@builtin(global_invocation_id) at: vec3u, @builtin(local_invocation_id) lane: vec3u) {
    let is_inside = at.x < sizes.width && at.y < sizes.height;
    let x = min(at.x, sizes.width - 1u);
    let y = min(at.y, sizes.height - 1u);
    let column = cell(false, x);
    let row = cell(true, y);
    let is_at_edge = kind_of(row * sizes.columns + column) != INSIDE;
    var first = lane.xy;
    while (is_inside && first.x > 0u && cell(false, x - lane.x + first.x - 1u) == column) { first.x -= 1u; }
    while (is_inside && first.y > 0u && cell(true, y - lane.y + first.y - 1u) == row) { first.y -= 1u; }
    if (is_inside && is_at_edge && all(first == lane.xy)) { group(8u * lane.y + lane.x, column, row); }
    workgroupBarrier();
    if (!is_inside) { return; }
    let pixel = y * sizes.width + x;
    let place = vec2f(offset(false, x), offset(true, y));
    if (!is_at_edge) {
        let depth = between_readings(column, row, place);
        choices[3u * pixel] = depth;
        picture[4u * pixel + 3u] = depth;
        return;
    }
    let colour = colour_of(pixel);
    let choice = chosen(8u * first.y + first.x, column, row, place, colour, held(pixel, colour));
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
