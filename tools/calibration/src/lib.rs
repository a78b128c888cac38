//! Calibrating a real display: from photographs of it to the files that a `Display` file refers to.
//!
//! * [`curves::lut`] finds each pixel's phase curve from photographs of the patterns of [`camera::pattern`], which
//!   [`camera::marks`] registers and [`curves::curve`] fits, and makes the per-pixel table that a phone holds by a
//!   [`curves::surface`] through them.
//! * [`optics::laser`] makes the map of the laser's amplitude.
//! * [`optics::spot`] finds the coefficients of an aberration from photographs of a focused spot, by what
//!   [`optics::pupil`] says of them.
//! * [`rehearse`] does all three on a simulated display.
//!
//! The files of a calibration are in [`phasefront_io::display::calibration`]; [`curves::report`] and [`curves::chart`]
//! make its figures and drawings.

pub mod camera;
pub mod curves;
pub mod optics;
pub mod rehearse;
pub mod simulated_display;

/// The names of the three colours, in their order: the folders of their photographs.
pub const COLOURS: [&str; 3] = ["red", "green", "blue"];
