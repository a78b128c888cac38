//! What a camera shows of the modulator: patterns, the marks that register them, and photographs.

pub mod homography;
pub mod marks;
pub mod pattern;
pub mod photograph;
