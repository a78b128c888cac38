//! Exact waves of layered depth images: silhouette-mask layers, with aberrations corrected, and single points; and what
//! a hologram is worth beside them.
//!
//! The crate stands below both commands: `phasefront` corrects aberrations that change over depth with it and judges
//! holograms by it, `phasefront-lab` makes data sets and studies with it.

pub mod corrected;
pub mod point_based;
pub mod sm_lbm;
pub mod truth;
