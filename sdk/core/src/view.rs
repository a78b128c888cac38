//! Views of holograms as an eye or a camera sees them.

pub mod colours;
pub mod preview;
pub mod refocus;
