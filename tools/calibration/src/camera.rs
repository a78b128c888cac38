//! The camera side of a calibration: test patterns, the marks that register them, and photographs.

pub mod homography;
pub mod marks;
pub mod pattern;
pub mod photograph;
