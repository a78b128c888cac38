// A frame as it comes to what the chain reads: groups of four channels in the chain's numbers. The header that input.rs
// writes before this text gives `Value` and the constants in capitals; behind it stand `channels`, which knows where
// values come from, and `store`, which knows the numbers.

struct Frame { width: u32, height: u32, plane: u32, unused: u32 }

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(3) var<storage, read_write> first: array<Value>;

@compute @workgroup_size(64)
fn pack(@builtin(global_invocation_id) at: vec3u) {
    if (at.x >= frame.width) { return; }
    let pixel = at.y * frame.width + at.x;
    for (var group = 0u; group < GROUPS; group++) {
        store(group * frame.plane + pixel, channels(group, at.x, at.y));
    }
}
