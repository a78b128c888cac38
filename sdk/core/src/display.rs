//! The physics of a holographic display, validated at construction.
//!
//! Lengths are in metres (`_m`). The TOML form uses mm, µm and nm, and its keys name the unit.

pub mod illumination;
pub mod lens;
pub mod levels;
pub mod model;
pub mod panel;
pub mod primaries;
pub mod registration;
pub mod response;
pub mod target;

use crate::Size;
use crate::runtime::error::{Error, Result};
use crate::runtime::keys;
use primaries::{Balance, Matrix};
use serde::{Deserialize, Serialize};

/// The largest number of pixels of a modulator, 8192²: twice as many as the largest modulators have.
const MOST_PIXELS: usize = 1 << 26;

/// A spatial light modulator, its lasers, and the display volume.
///
/// z points toward the viewer. The midpoint hologram lies at z = 0, the volume spans z ∈ \[−V/2, V/2\], and the
/// modulator lies at z = `offset_m`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "DisplayToml", into = "DisplayToml")]
pub struct Display {
    size: Size,
    pitch_m: f64,
    wavelengths_m: Vec<f64>,
    volume_depth_m: f64,
    offset_m: f64,
    bits: u32,
    aperture_radius: f64,
    balance: Balance,
}

/// The TOML form of a [`Display`]. Missing keys take the values of [`Display::default`].
#[derive(Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct DisplayToml {
    width: usize,
    height: usize,
    pitch_um: f64,
    wavelengths_nm: Vec<f64>,
    volume_depth_mm: f64,
    offset_mm: f64,
    bits: u32,
    aperture_radius: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    white: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    powers: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    primaries: Option<Matrix>,
}

impl Default for Display {
    /// Returns the paper's display: 1920×1080, 8 µm, 638/520/450 nm, a volume of 6 mm around the modulator, 8 bits, and
    /// an aperture as wide as the first order.
    fn default() -> Self {
        Display {
            size: Size {
                width: 1920,
                height: 1080,
            },
            pitch_m: 8e-6,
            wavelengths_m: vec![638e-9, 520e-9, 450e-9],
            volume_depth_m: 6e-3,
            offset_m: 0.0,
            bits: 8,
            aperture_radius: 1.0,
            balance: Balance::Unknown,
        }
    }
}

impl Default for DisplayToml {
    fn default() -> Self {
        Display::default().into()
    }
}

impl From<Display> for DisplayToml {
    fn from(d: Display) -> Self {
        // Multiplying by 1e9 gives 637.9999…; files should say 638.
        let round = |x: f64| (x * 1e6).round() / 1e6;
        let (white, powers, primaries) = match d.balance {
            Balance::Unknown => (None, None, None),
            Balance::White(white) => (Some(white), None, None),
            Balance::Powers(powers) => (None, Some(powers), None),
            Balance::Primaries(primaries) => (None, None, Some(primaries)),
        };
        DisplayToml {
            width: d.size.width,
            height: d.size.height,
            pitch_um: round(d.pitch_m * 1e6),
            wavelengths_nm: d.wavelengths_m.iter().map(|l| round(l * 1e9)).collect(),
            volume_depth_mm: round(d.volume_depth_m * 1e3),
            offset_mm: round(d.offset_m * 1e3),
            bits: d.bits,
            aperture_radius: d.aperture_radius,
            white,
            powers,
            primaries,
        }
    }
}

impl TryFrom<DisplayToml> for Display {
    type Error = Error;

    fn try_from(t: DisplayToml) -> Result<Self> {
        // Dividing by a power of ten rounds once: 638/1e9 is the f64 nearest to 638e-9.
        let display = Display {
            size: Size {
                width: t.width,
                height: t.height,
            },
            pitch_m: t.pitch_um / 1e6,
            wavelengths_m: t.wavelengths_nm.iter().map(|l| l / 1e9).collect(),
            volume_depth_m: t.volume_depth_mm / 1e3,
            offset_m: t.offset_mm / 1e3,
            bits: t.bits,
            aperture_radius: t.aperture_radius,
            balance: match (t.white, t.powers, t.primaries) {
                (None, None, None) => Balance::Unknown,
                (Some(white), None, None) => Balance::White(white),
                (None, Some(powers), None) => Balance::Powers(powers),
                (None, None, Some(primaries)) => Balance::Primaries(primaries),
                _ => {
                    return Err(Error::Display(
                        "at most one of white, powers and primaries may be given; they say the same".into(),
                    ));
                }
            },
        };
        display.check()?;
        Ok(display)
    }
}

impl Display {
    /// Parses the TOML form.
    ///
    /// ```
    /// let display = phasefront::Display::from_toml("pitch_um = 3.74\nwidth = 3840\nheight = 2160")?;
    /// assert_eq!(display.pitch_m(), 3.74e-6);
    /// # Ok::<(), phasefront::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns an error if the text is not valid TOML, has an unknown key, or has a value out of range.
    pub fn from_toml(text: &str) -> Result<Self> {
        toml::from_str(text).map_err(|e| {
            let message = keys::message(&e);
            Error::Display(match e.span() {
                Some(span) => {
                    let line = text[..span.start.min(text.len())].matches('\n').count() + 1;
                    format!("line {line}: {message}")
                }
                None => message,
            })
        })
    }

    fn check(&self) -> Result<()> {
        let refuse = |what: String| Err(Error::Display(what));
        let sides = 1..=65536;
        if !sides.contains(&self.size.width) || !sides.contains(&self.size.height) {
            return refuse(format!(
                "width and height are {}; each must lie in 1..=65536",
                self.size
            ));
        }
        if self.size.pixels() > MOST_PIXELS {
            return refuse(format!(
                "width and height are {}; {MOST_PIXELS} pixels in all are the most",
                self.size
            ));
        }
        if !(0.1e-6..=1e-3).contains(&self.pitch_m) {
            return refuse(format!("pitch_um is {}; it must lie in 0.1..=1000", self.pitch_m * 1e6));
        }
        if ![1, 3].contains(&self.wavelengths_m.len()) {
            return refuse(format!(
                "wavelengths_nm has {} lasers; three are right, for red, green and blue, or one",
                self.wavelengths_m.len()
            ));
        }
        for l in &self.wavelengths_m {
            if !(100e-9..=20e-6).contains(l) {
                return refuse(format!("a wavelength is {} nm; each must lie in 100..=20000", l * 1e9));
            }
            if *l > 2.0 * self.pitch_m {
                return refuse(format!(
                    "a wavelength of {} nm needs a pitch of at least half of it; pitch_um is {}",
                    l * 1e9,
                    self.pitch_m * 1e6
                ));
            }
        }
        if self.wavelengths_m.windows(2).any(|pair| pair[1] > pair[0]) {
            let mut right = self.wavelengths_m.clone();
            right.sort_by(|a, b| b.total_cmp(a));
            return refuse(format!(
                "wavelengths_nm is {}; three lasers stand in the order red, green, blue, the longest first: {}",
                nm(&self.wavelengths_m),
                nm(&right)
            ));
        }
        if !(self.volume_depth_m > 0.0 && self.volume_depth_m <= 1.0) {
            return refuse(format!(
                "volume_depth_mm is {}; it must lie above 0 and up to 1000",
                self.volume_depth_m * 1e3
            ));
        }
        if !self.offset_m.is_finite() || self.offset_m.abs() > 10.0 {
            return refuse(format!(
                "offset_mm is {}; it must lie in -10000..=10000",
                self.offset_m * 1e3
            ));
        }
        if !(1..=10).contains(&self.bits) {
            return refuse(format!("bits is {}; it must lie in 1..=10", self.bits));
        }
        if !(0.25..=1.25).contains(&self.aperture_radius) {
            return refuse(format!(
                "aperture_radius is {}; it must lie in 0.25..=1.25, where 1 is the whole first order",
                self.aperture_radius
            ));
        }
        self.balance.check(self.colours())
    }

    /// Returns the size of the modulator.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Returns the distance between neighbouring pixels, in metres.
    pub fn pitch_m(&self) -> f64 {
        self.pitch_m
    }

    /// Returns the wavelengths in metres: red, green and blue, or that of the single laser.
    pub fn wavelengths_m(&self) -> &[f64] {
        &self.wavelengths_m
    }

    /// Returns the longest wavelength, whose light spreads farthest, in metres.
    pub fn longest_wavelength_m(&self) -> f64 {
        self.wavelengths_m.iter().copied().fold(0.0, f64::max)
    }

    /// Returns the number of lasers, C: 3 or 1. Frames, fields, levels and views have C planes.
    pub fn colours(&self) -> usize {
        self.wavelengths_m.len()
    }

    /// Returns, for each laser, the phase of a path that has one turn at the wavelength `at_nm`, in turns: at_nm/λ. It
    /// leaves out the dispersion of the modulator's material.
    ///
    /// # Errors
    /// Returns an error if `at_nm` is not the wavelength of light that displays use, 300 to 2000 nm.
    #[doc(hidden)]
    pub fn phase_factors(&self, at_nm: f64) -> Result<Vec<f64>> {
        if !(300.0..=2000.0).contains(&at_nm) {
            return Err(Error::Display(format!(
                "at_nm is {at_nm}; it is the wavelength of a measurement, 300 to 2000 nm"
            )));
        }
        Ok(self
            .wavelengths_m
            .iter()
            .map(|wavelength_m| at_nm * 1e-9 / wavelength_m)
            .collect())
    }

    /// Returns the depth V of the volume, in metres.
    pub fn volume_depth_m(&self) -> f64 {
        self.volume_depth_m
    }

    /// Returns the z of the modulator relative to the midpoint of the volume, in metres, positive toward the viewer.
    pub fn offset_m(&self) -> f64 {
        self.offset_m
    }

    /// Returns the number of bits of a modulator level, 1 to 10. Only sessions support more than 8.
    pub fn bits(&self) -> u32 {
        self.bits
    }

    /// Returns the radius of the aperture in the Fourier plane, which passes the image and blocks the checkerboard of
    /// double phase (Eq. 8). A radius of 1 reaches the Nyquist frequency ½/pitch, the paper's r of half the image
    /// resolution.
    pub fn aperture_radius(&self) -> f64 {
        self.aperture_radius
    }

    /// Returns what is known about the lasers' light relative to each other.
    pub fn balance(&self) -> &Balance {
        &self.balance
    }

    /// Returns X, Y and Z (rows; CIE 1931 2° observer) of the red, green and blue laser (columns) at full light, scaled
    /// so that the brightest D65 that they mix has Y = 1. Returns `None` for one laser and for lasers that cannot mix
    /// D65.
    pub fn primaries(&self) -> Option<[[f64; 3]; 3]> {
        self.balance.primaries(&self.wavelengths_m)
    }

    /// Returns this display with another balance of its lasers.
    ///
    /// # Errors
    /// Returns an error if the display has one laser or the numbers cannot be those of three lasers.
    pub fn with_balance(self, balance: Balance) -> Result<Self> {
        let display = Display { balance, ..self };
        display.check()?;
        Ok(display)
    }

    /// Returns this display with its modulator at z = `offset_m`.
    ///
    /// # Errors
    /// Returns an error if the offset is not finite or exceeds 10 m.
    pub fn with_offset_m(self, offset_m: f64) -> Result<Self> {
        let display = Display { offset_m, ..self };
        display.check()?;
        Ok(display)
    }

    /// Returns this display with a modulator of `size`.
    ///
    /// # Errors
    /// Returns an error if a side lies outside 1..=65536, or if there are over 2²⁶ pixels.
    pub fn with_size(self, size: Size) -> Result<Self> {
        let display = Display { size, ..self };
        display.check()?;
        Ok(display)
    }

    /// Returns the z of a point of normalized depth d (0 nearest, 1 farthest), V/2 − V·d, in metres.
    pub fn z_of_depth(&self, d: f64) -> f64 {
        self.volume_depth_m / 2.0 - self.volume_depth_m * d
    }
}

/// Formats wavelengths as in the TOML form.
fn nm(wavelengths_m: &[f64]) -> String {
    let all: Vec<_> = (wavelengths_m.iter())
        .map(|m| ((m * 1e15).round() / 1e6).to_string())
        .collect();
    format!("[{}]", all.join(", "))
}

/// Checks that `what`, which has `colours` colours, matches a display with `right` lasers.
///
/// # Errors
/// Returns an error if the numbers differ.
pub(crate) fn check_colours(what: &str, colours: usize, right: usize) -> Result<()> {
    if colours == right {
        Ok(())
    } else {
        Err(Error::Setting(format!(
            "{what} has {colours} {}, the display {right}; both must have as many",
            if colours == 1 { "colour" } else { "colours" }
        )))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn toml_form_round_trips_and_fills_in_defaults() {
        let d = Display::from_toml("pitch_um = 3.74\nwavelengths_nm = [638, 520, 450]").unwrap();
        assert_eq!(d.pitch_m(), 3.74e-6);
        assert_eq!(d.size().width, 1920);
        assert_eq!(d.wavelengths_m(), Display::default().wavelengths_m());
        let text = toml::Value::try_from(&d).unwrap();
        assert_eq!(text["wavelengths_nm"][0].as_float(), Some(638.0));
    }

    #[test]
    fn impossible_displays_are_named() {
        for (text, word) in [
            ("width = 0", "width"),
            ("width = 65536\nheight = 65536", "67108864 pixels in all"),
            ("width = 65536\nheight = 1025", "67108864 pixels in all"),
            ("width = 3.5", "expected a whole number from 0"),
            ("pitch_um = \"8\"", "expected a number"),
            ("wavelengths_nm = 532", "expected a list"),
            ("pitch_um = nan", "pitch_um"),
            ("pitch_um = 0.2", "wavelength"),
            ("wavelengths_nm = [638, 520, -450]", "wavelength"),
            ("volume_depth_mm = 0", "volume_depth_mm"),
            ("wavelengths_nm = [638, 520]", "2 lasers"),
            ("wavelengths_nm = []", "0 lasers"),
            ("offset_mm = inf", "offset_mm"),
            ("bits = 11", "bits"),
            ("aperture_radius = 0", "aperture_radius"),
            ("aperture_radius = nan", "aperture_radius"),
            ("pich_um = 8", "unknown key `pich_um`; did you mean `pitch_um`?"),
            ("pitch_mm = 0.008", "unknown key `pitch_mm`; did you mean `pitch_um`?"),
            ("wavelengths_nm = [450, 520, 638]", "the longest first: [638, 520, 450]"),
            ("wavelengths_nm = [638, 450, 520]", "red, green, blue"),
            ("width = ", "line 1"),
        ] {
            let message = Display::from_toml(text).unwrap_err().to_string();
            assert!(message.contains(word), "{text}: {message}");
            assert!(!message.contains('\n'), "{message}");
        }
        assert!(Display::from_toml("width = 65536\nheight = 1024").is_ok());
        // The three lasers may have the same wavelength.
        assert!(Display::from_toml("wavelengths_nm = [532, 532, 532]").is_ok());
    }

    #[test]
    fn one_laser_is_a_display() {
        let d = Display::from_toml("wavelengths_nm = [532]").unwrap();
        assert_eq!((d.colours(), d.wavelengths_m()), (1, &[532e-9][..]));
        let text = toml::to_string(&d).unwrap();
        assert_eq!(Display::from_toml(&text).unwrap(), d);
        assert_eq!(Display::default().colours(), 3);
    }

    #[test]
    fn depth_runs_from_the_viewer_away() {
        let d = Display::default();
        assert_eq!(d.z_of_depth(0.0), 3e-3);
        assert_eq!(d.z_of_depth(1.0), -3e-3);
    }
}
