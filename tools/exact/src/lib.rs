//! Computes exact waves of layered depth images and compares holograms with them. The waves come from silhouette-mask
//! layers, with or without aberration correction, or from single points.
//!
//! Both commands use the crate: `phasefront` corrects aberrations that change over depth and evaluates holograms with
//! it, and `phasefront-lab` makes data sets and runs studies with it.

pub mod corrected;
pub mod incoherent;
pub mod point_based;
pub mod sm_lbm;
pub mod truth;
