//! The display, in the units of its TOML form.

use crate::error::{PhasefrontError, guard};
use phasefront::target::Balance;

/// A modulator, its lasers, and the display volume. It is checked when it is used.
#[derive(Debug, Clone, PartialEq, uniffi::Record)]
pub struct Display {
    /// The number of pixels along x.
    #[uniffi(default = 1920)]
    pub width: usize,
    /// The number of pixels along y.
    #[uniffi(default = 1080)]
    pub height: usize,
    /// The distance between neighbouring pixels, in µm.
    #[uniffi(default = 8.0)]
    pub pitch_um: f64,
    /// The wavelength of the red laser, in nm.
    #[uniffi(default = 638.0)]
    pub red_nm: f64,
    /// The wavelength of the green laser, in nm.
    #[uniffi(default = 520.0)]
    pub green_nm: f64,
    /// The wavelength of the blue laser, in nm.
    #[uniffi(default = 450.0)]
    pub blue_nm: f64,
    /// The wavelength, in nm, of the only laser of a display with one laser, which replaces the other three
    /// wavelengths; none for a display with three lasers.
    #[uniffi(default = None)]
    pub laser_nm: Option<f64>,
    /// The depth of the volume, in mm.
    #[uniffi(default = 6.0)]
    pub volume_depth_mm: f64,
    /// The z of the modulator relative to the middle of the volume, in mm, positive toward the viewer.
    #[uniffi(default = 0.0)]
    pub offset_mm: f64,
    /// The number of bits of a modulator level.
    #[uniffi(default = 8)]
    pub bits: usize,
    /// The radius of the aperture in the Fourier plane; 1 is the whole first order.
    #[uniffi(default = 1.0)]
    pub aperture_radius: f64,
    /// The chromaticity x, y of the light of all lasers; none if it is not known. At most one of `white`, `powers` and
    /// `primaries` may be given; without one, all lasers together are taken for D65.
    #[uniffi(default = None)]
    pub white: Option<Vec<f64>>,
    /// The radiant powers of red, green and blue, on any scale.
    #[uniffi(default = None)]
    pub powers: Option<Vec<f64>>,
    /// X, Y and Z of red, of green and of blue, 9 numbers on any scale.
    #[uniffi(default = None)]
    pub primaries: Option<Vec<f64>>,
}

/// Reads a display from its TOML form. Missing keys have default values.
///
/// # Errors
/// Returns an error if the text is not TOML, a key is unknown, or a value is out of its range.
#[uniffi::export]
pub fn display_from_toml(text: String) -> Result<Display, PhasefrontError> {
    guard(|| Ok(phasefront::Display::from_toml(&text)?.into()))
}

impl From<phasefront::Display> for Display {
    fn from(display: phasefront::Display) -> Self {
        // Metres times 1e9 differ in the last digit (637.9999…).
        let round = |value: f64| (value * 1e6).round() / 1e6;
        let nm: Vec<f64> = display.wavelengths_m().iter().map(|l| round(l * 1e9)).collect();
        let ([red_nm, green_nm, blue_nm], laser_nm) = match nm[..] {
            [red, green, blue] => ([red, green, blue], None),
            // The defaults of the three.
            _ => ([638.0, 520.0, 450.0], nm.first().copied()),
        };
        let (white, powers, primaries) = match display.balance() {
            Balance::Unknown => (None, None, None),
            Balance::White(white) => (Some(white.to_vec()), None, None),
            Balance::Powers(powers) => (None, Some(powers.to_vec()), None),
            Balance::Primaries(rows) => (None, None, Some(rows.concat())),
        };
        Display {
            width: display.size().width,
            height: display.size().height,
            pitch_um: round(display.pitch_m() * 1e6),
            red_nm,
            green_nm,
            blue_nm,
            laser_nm,
            volume_depth_mm: round(display.volume_depth_m() * 1e3),
            offset_mm: round(display.offset_m() * 1e3),
            bits: display.bits() as usize,
            aperture_radius: display.aperture_radius(),
            white,
            powers,
            primaries,
        }
    }
}

impl TryFrom<&Display> for phasefront::Display {
    type Error = PhasefrontError;

    fn try_from(display: &Display) -> Result<Self, PhasefrontError> {
        let Display {
            width,
            height,
            pitch_um,
            red_nm,
            green_nm,
            blue_nm,
            laser_nm,
            volume_depth_mm,
            offset_mm,
            bits,
            aperture_radius,
            white,
            powers,
            primaries,
        } = display;
        // The core reads displays only from TOML. `{:?}` writes floats so that they are read back the same, except for
        // the letter case of NaN.
        let wavelengths_nm = match laser_nm {
            Some(laser_nm) => vec![laser_nm],
            None => vec![red_nm, green_nm, blue_nm],
        };
        let mut toml = format!(
            "width = {width}\nheight = {height}\npitch_um = {pitch_um:?}\nwavelengths_nm = {wavelengths_nm:?}\n\
             volume_depth_mm = {volume_depth_mm:?}\noffset_mm = {offset_mm:?}\nbits = {bits}\n\
             aperture_radius = {aperture_radius:?}"
        );
        for (key, numbers) in [("white", white), ("powers", powers)] {
            if let Some(numbers) = numbers {
                toml += &format!("\n{key} = {numbers:?}");
            }
        }
        if let Some(numbers) = primaries {
            let rows: Vec<_> = numbers.chunks(3).collect();
            toml += &format!("\nprimaries = {rows:?}");
        }
        Ok(phasefront::Display::from_toml(&toml.to_lowercase())?)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn displays_go_and_come_back() {
        let text = "width = 640\nheight = 480\npitch_um = 3.74\nwavelengths_nm = [639, 521.5, 450]\noffset_mm = -1.25\nbits = 4\naperture_radius = 0.9";
        let display = display_from_toml(text.into()).unwrap();
        assert_eq!((display.width, display.green_nm), (640, 521.5));
        let core = phasefront::Display::try_from(&display).unwrap();
        assert_eq!(core, phasefront::Display::from_toml(text).unwrap());
        let defaults = display_from_toml(String::new()).unwrap();
        let one = display_from_toml("wavelengths_nm = [532]".into()).unwrap();
        for balance in [
            "white = [0.31, 0.33]",
            "powers = [3.0, 2.5, 1.0]",
            "primaries = [[0.5, 0.2, 0.0], [0.1, 0.7, 0.1], [0.3, 0.1, 1.8]]",
        ] {
            let display = display_from_toml(balance.into()).unwrap();
            let core = phasefront::Display::try_from(&display).unwrap();
            assert_eq!(core, phasefront::Display::from_toml(balance).unwrap());
        }
        let laser_nm = Some(532.0);
        assert_eq!(one, Display { laser_nm, ..defaults });
        assert_eq!(phasefront::Display::try_from(&one).unwrap().colours(), 1);
    }

    #[test]
    fn impossible_displays_are_named() {
        let good = display_from_toml(String::new()).unwrap();
        for (bad, word) in [
            (
                Display {
                    width: 0,
                    ..good.clone()
                },
                "width",
            ),
            (
                Display {
                    pitch_um: f64::NAN,
                    ..good.clone()
                },
                "pitch_um",
            ),
            (
                Display {
                    red_nm: -1.0,
                    ..good.clone()
                },
                "wavelength",
            ),
            (
                Display {
                    offset_mm: f64::INFINITY,
                    ..good
                },
                "offset_mm",
            ),
        ] {
            match phasefront::Display::try_from(&bad) {
                Err(PhasefrontError::Display(message)) => {
                    assert!(message.contains(word), "{message}");
                }
                other => panic!("{other:?}"),
            }
        }
    }
}
