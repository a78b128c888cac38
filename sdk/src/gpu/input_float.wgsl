// The input of a chain in floating point. Goes behind input.wgsl.

fn store(group: u32, at: u32, v: vec4f) { first[at] = Value(v); }
