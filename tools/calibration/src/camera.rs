//! The camera side of a calibration: test patterns, the marks that register them, and photographs, which a program of
//! the user may take.

pub mod homography;
pub mod marks;
pub mod pattern;
pub mod photograph;
pub mod program;
