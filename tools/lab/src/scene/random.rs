//! Random scenes of five kinds, and their common parts.

mod ground;
mod natural;
mod objects;
mod parts;
mod photographs;
mod rooms;
mod surface;
mod thin;
mod varied;

pub use natural::natural_scene;
pub use objects::random_scene;
pub use photographs::{fingerprint, read_photographs};
pub use rooms::room_scene;
pub use varied::{hard_scene, varied_scene};
