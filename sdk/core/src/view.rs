//! Views of holograms as an eye or a camera sees them.

pub mod preview;
pub mod refocus;
