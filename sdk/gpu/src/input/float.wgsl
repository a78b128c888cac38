// Stores the input of a floating-point chain. Appended to pack.wgsl.

fn store(at: u32, v: vec4f) { first[at] = Value(v); }
