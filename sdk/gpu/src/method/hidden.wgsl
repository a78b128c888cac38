// Finds the hidden surfaces of a frame from one side of its pixels: the bit-identical counterpart of sweep/hidden.rs. A
// thread walks a part of a line away from that side. It starts far enough before the part to find the same sources as a
// walk along the whole line. The header from hidden.rs defines REACH, PART, JUMP and FIRST.

struct Walk {
    // The number of lines, the pixels of a line, of the frame and of its rows.
    lines: u32, length: u32, area: u32, width: u32,
    // The start of the first line, and the strides from line to line and from pixel to pixel.
    origin: i32, line: i32, step: i32, unused: i32,
}

// A source on one side of a pixel: its depth and its distance.
struct Source { depth: f32, distance: u32 }

// The sources on one side of a pixel, and whether the next pixel there is deeper by more than a jump.
struct Found { near: Source, far: Source, edge: bool }

@group(0) @binding(0) var<uniform> walk: Walk;
// Red, green, blue and depth.
@group(0) @binding(1) var<storage, read> surfaces: array<vec4f>;
// The sources of two hidden layers.
@group(0) @binding(2) var<storage, read_write> sources: array<u32>;

const NOTHING: u32 = 0xffffffffu;
// A value that is not deeper than any depth.
const NO_DEPTH: f32 = -1.0;

fn none() -> Source { return Source(NO_DEPTH, 0u); }

fn aged(source: Source) -> Source {
    return Source(select(NO_DEPTH, source.depth, source.distance < REACH), source.distance + 1u);
}

// Returns the sources of a pixel of `depth`, from the sources and the depth of its neighbour on that side.
fn next(found: Found, neighbour: f32, depth: f32) -> Found {
    let near = aged(found.near);
    let far = aged(found.far);
    let least = depth + JUMP;
    var result = Found(none(), none(), neighbour > least);
    // A neighbour that is itself at an edge belongs to a blurred edge, not to a surface.
    if (neighbour > least && !found.edge) {
        result.near = Source(neighbour, 1u);
        if (near.depth > neighbour + JUMP) {
            result.far = near;
        } else if (far.depth > neighbour + JUMP) {
            result.far = far;
        }
    } else if (near.depth > least) {
        result.near = near;
        result.far = far;
    } else if (far.depth > least) {
        result.near = far;
    }
    return result;
}

// Returns the depth and the distance of a hidden layer's source.
fn known(source: u32, pixel: u32) -> Source {
    if (source == NOTHING) { return Source(NO_DEPTH, NOTHING); }
    let place = vec2i(vec2u(source % walk.width, source / walk.width));
    let away = abs(place - vec2i(vec2u(pixel % walk.width, pixel / walk.width)));
    return Source(surfaces[source].w, u32(away.x + away.y));
}

// Adds the sources found on one side to a pixel's hidden layers.
fn add(found: Found, pixel: u32) {
    var index = array<u32, 2>(sources[pixel], sources[walk.area + pixel]);
    var first = known(index[0], pixel);
    var second = known(index[1], pixel);
    for (var k = 0u; k < 2u; k++) {
        var source = found.near;
        if (k == 1u) { source = found.far; }
        if (source.depth == NO_DEPTH) { break; }
        let origin = u32(i32(pixel) - walk.step * i32(source.distance));
        if (source.distance < first.distance) {
            if (first.depth > source.depth + JUMP && first.distance < second.distance) {
                second = first;
                index[1] = index[0];
            } else if (second.depth <= source.depth + JUMP) {
                second = Source(NO_DEPTH, NOTHING);
                index[1] = NOTHING;
            }
            first = source;
            index[0] = origin;
        } else if (source.depth > first.depth + JUMP && source.distance < second.distance) {
            second = source;
            index[1] = origin;
        }
    }
    sources[pixel] = index[0];
    sources[walk.area + pixel] = index[1];
}

@compute @workgroup_size(64)
fn search(@builtin(global_invocation_id) at: vec3u) {
    if (at.x >= walk.lines) { return; }
    let origin = walk.origin + i32(at.x) * walk.line;
    var found = Found(none(), none(), false);
    var neighbour = 0.0;
    // The first pixel has no predecessor: it serves only as the neighbour of the next.
    for (var i = 0u; i <= PART + REACH; i++) {
        let t = i32(at.y * PART + i) - i32(REACH) - 1;
        if (t < 0) { continue; }
        if (t >= i32(walk.length)) { break; }
        let pixel = u32(origin + t * walk.step);
        let depth = surfaces[pixel].w;
        if (i > 0u && t > 0) { found = next(found, neighbour, depth); }
        neighbour = depth;
        if (i > REACH) {
            if (FIRST) {
                sources[pixel] = NOTHING;
                sources[walk.area + pixel] = NOTHING;
            }
            if (found.near.depth != NO_DEPTH) { add(found, pixel); }
        }
    }
}
