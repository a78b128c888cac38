// Converts a captured frame to the input of the chain: groups of four channels in the chain's number format. The header
// from input.rs defines `Value` and the constants in capitals. input.rs appends `channels`, which reads the source, and
// `store`, which writes the number format. If the chain's layers treat squares of two by two pixels as one, SIDE is 2,
// and the groups of a square's pixels follow one another.

struct Frame { width: u32, height: u32, plane: u32, unused: u32 }

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(3) var<storage, read_write> first: array<Value>;

@compute @workgroup_size(64)
fn pack(@builtin(global_invocation_id) at: vec3u) {
    let columns = (frame.width + SIDE - 1u) / SIDE;
    let rows = (frame.height + SIDE - 1u) / SIDE;
    if (at.x >= columns) { return; }
    let place = at.y * columns + at.x;
    for (var pixel = 0u; pixel < SIDE * SIDE; pixel++) {
        // For an odd side the last row or column is repeated.
        let x = min(SIDE * at.x + pixel % SIDE, frame.width - 1u);
        let y = min(SIDE * at.y + pixel / SIDE, frame.height - 1u);
        for (var group = 0u; group < GROUPS; group++) {
            store((pixel * GROUPS + group) * columns * rows + place, channels(group, x, y));
        }
    }
}
