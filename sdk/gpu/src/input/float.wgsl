// The input of a chain in floating point. Goes behind pack.wgsl.

fn store(at: u32, v: vec4f) { first[at] = Value(v); }
