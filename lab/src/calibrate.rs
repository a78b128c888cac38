//! Calibrating a real display: from photographs of it to the files that a `Display` file refers to.
//!
//! * [`lut`] finds each pixel's phase curve from photographs of the patterns of [`pattern`], which [`marks`]
//!   registers and [`curve`] fits, and makes the per-pixel table that a phone holds by a [`surface`] through them.
//! * [`laser`] makes the map of the laser's amplitude.
//! * [`spot`] finds the coefficients of an aberration from photographs of a focused spot, by what [`pupil`] says of
//!   them.
//! * [`rehearse`] does all three on a simulated display.
//!
//! What files of a calibration look like is in [`table`]; its figures and drawings are [`report`]'s and [`chart`]'s.

pub mod chart;
pub mod curve;
pub mod homography;
pub mod laser;
pub mod lut;
pub mod marks;
pub mod pattern;
pub mod photograph;
pub mod pupil;
pub mod rehearse;
pub mod report;
pub mod spot;
pub mod surface;
pub mod table;

/// The names of the three colours, in their order: the folders of their photographs.
pub const COLOURS: [&str; 3] = ["red", "green", "blue"];
