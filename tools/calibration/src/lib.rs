//! Calibration of a real display: from photographs of it to the files that a `Display` file refers to.
//!
//! * [`curves::lut`] computes each pixel's phase curve from photographs of the patterns of [`camera::pattern`].
//!   [`camera::marks`] registers the photographs and [`curves::curve`] fits the curves. A [`curves::surface`] through
//!   the curves gives the compact per-pixel table.
//! * [`optics::laser`] computes the map of the laser's amplitude.
//! * [`optics::spot`] finds the coefficients of an aberration from photographs of a focused spot, using the model of
//!   [`optics::pupil`].
//! * [`white`] says what a meter's readings of three lasers mean.
//! * [`learned`] fits a model of what is left to photographs of holograms.
//! * [`diagnosis`] says why a photograph of a hologram looks wrong.
//! * [`link`] says how cable, driver and converter change the pixels on their way to the modulator.
//! * [`rehearse`] does all of it on a simulated display.
//!
//! [`phasefront_io::display::calibration`] reads and writes the calibration files. [`curves::report`] and
//! [`curves::chart`] produce the figures and charts.

pub mod camera;
mod cholesky;
pub mod curves;
pub mod diagnosis;
pub mod learned;
pub mod link;
pub mod optics;
pub mod rehearse;
pub mod simulated_display;
pub mod white;

use phasefront::Display;

/// Returns the names of the display's colours, in order, which are also the folders of their photographs: red, green
/// and blue, or laser for one laser.
pub fn colours(display: &Display) -> &'static [&'static str] {
    match display.colours() {
        1 => &["laser"],
        _ => &["red", "green", "blue"],
    }
}
