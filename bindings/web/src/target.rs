//! The target of a hologram.

use crate::error::{Answer, object, of_core, setting};
use js_sys::{Array, Object};
use phasefront::target::{Balance, Response};
use phasefront::{Display, Target};
use wasm_bindgen::prelude::*;

/// A display with its modulator response, laser light and correction of the optics.
#[wasm_bindgen]
pub struct RawTarget {
    pub(crate) core: Target,
}

#[wasm_bindgen]
impl RawTarget {
    /// Parses a display from TOML, with levels in equal phase steps.
    ///
    /// # Errors
    /// Throws an error of kind `display` if the text is not a display or the display is invalid.
    #[wasm_bindgen(js_name = fromToml)]
    pub fn from_toml(toml: &str) -> Answer<RawTarget> {
        let core = Display::from_toml(toml).map_err(of_core)?.into();
        Ok(RawTarget { core })
    }

    /// Returns the same display with a global calibration of the modulator: the i-th of 256 levels gives the phase
    /// 2πi/256.
    ///
    /// # Errors
    /// Throws an error of kind `setting` for another number of levels.
    #[wasm_bindgen(js_name = withLookUpTable)]
    pub fn with_look_up_table(&self, levels: &[u8]) -> Answer<RawTarget> {
        let levels = <[u8; 256]>::try_from(levels).map_err(|_| {
            setting(&format!(
                "the look-up table has {} levels; 256 are right, one for each phase step of 2π/256",
                levels.len()
            ))
        })?;
        let core = Target {
            response: Response::lut(levels),
            ..self.core.clone()
        };
        Ok(RawTarget { core })
    }

    /// Reads a calibration file.
    ///
    /// # Errors
    /// Throws an error in the cases of [`Target::from_bytes`].
    #[wasm_bindgen(js_name = fromBytes)]
    pub fn from_bytes(file: &[u8]) -> Answer<RawTarget> {
        let core = Target::from_bytes(file).map_err(of_core)?;
        Ok(RawTarget { core })
    }

    /// Returns the display: an object of the form `Display`.
    pub fn display(&self) -> Object {
        let display = &self.core.display;
        // Metres times 1e9 lose the last digit (637.9999…).
        let round = |value: f64| JsValue::from((value * 1e6).round() / 1e6);
        let lasers = display.wavelengths_m().iter().map(|l| round(l * 1e9));
        let numbers =
            |values: &[f64]| -> JsValue { values.iter().map(|v| JsValue::from(*v)).collect::<Array>().into() };
        let balance = match display.balance() {
            Balance::Unknown => None,
            Balance::White(white) => Some(("white", numbers(white))),
            Balance::Powers(powers) => Some(("powers", numbers(powers))),
            Balance::Primaries(rows) => {
                let rows: Array = rows.iter().map(|row| numbers(row)).collect();
                Some(("primaries", rows.into()))
            }
        };
        let known = [
            ("width", display.size().width.into()),
            ("height", display.size().height.into()),
            ("pitchUm", round(display.pitch_m() * 1e6)),
            ("wavelengthsNm", lasers.collect::<Array>().into()),
            ("volumeDepthMm", round(display.volume_depth_m() * 1e3)),
            ("offsetMm", round(display.offset_m() * 1e3)),
            ("bits", display.bits().into()),
            ("apertureRadius", display.aperture_radius().into()),
        ];
        object(known.into_iter().chain(balance))
    }
}
