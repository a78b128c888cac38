//! Random scenes of five kinds, and their common parts.

mod ground;
mod interiors;
mod natural;
mod objects;
mod parts;
mod photographs;
mod surface;
mod thin;
mod varied;

pub use interiors::interior_scene;
pub use natural::natural_scene;
pub use objects::random_scene;
pub use photographs::{fingerprint, read_photographs};
pub use varied::{hard_scene, varied_scene};
