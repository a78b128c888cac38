// Reads the surfaces of a frame: red, green, blue and depth.

@group(0) @binding(1) var<storage, read> surfaces: array<vec4f>;

fn rgb(x: u32, y: u32) -> vec3f { return surfaces[y * frame.width + x].rgb; }

fn distance_at(at: u32) -> f32 { return surfaces[at].a; }
