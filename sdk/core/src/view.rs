//! Views of holograms: what an eye or a camera sees of one.

pub mod preview;
pub mod refocus;
