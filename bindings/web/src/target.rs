//! What holograms are made for.

use crate::error::{Answer, object, of_core, setting};
use js_sys::{Array, Object};
use phasefront::target::Response;
use phasefront::{Display, Target};
use wasm_bindgen::prelude::*;

/// A display, its modulator's response, its lasers' light, what corrects its optics.
#[wasm_bindgen]
pub struct RawTarget {
    pub(crate) core: Target,
}

#[wasm_bindgen]
impl RawTarget {
    /// A display in its TOML form, with levels in equal steps of phase.
    ///
    /// # Errors
    /// `display`: a text that is none, or a display that cannot be.
    #[wasm_bindgen(js_name = fromToml)]
    pub fn from_toml(toml: &str) -> Answer<RawTarget> {
        let core = Display::from_toml(toml).map_err(of_core)?.into();
        Ok(RawTarget { core })
    }

    /// The same display, whose modulator was calibrated as a whole: of 256 levels the one at i shows the phase
    /// 2πi/256.
    ///
    /// # Errors
    /// `setting`: another number of levels.
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

    /// A calibration's file.
    ///
    /// # Errors
    /// As [`Target::from_bytes`].
    #[wasm_bindgen(js_name = fromBytes)]
    pub fn from_bytes(file: &[u8]) -> Answer<RawTarget> {
        let core = Target::from_bytes(file).map_err(of_core)?;
        Ok(RawTarget { core })
    }

    /// Its display: an object of the form `Display`.
    pub fn display(&self) -> Object {
        let display = &self.core.display;
        // Metres times 1e9 leave the last digit off (637.9999…).
        let round = |value: f64| JsValue::from((value * 1e6).round() / 1e6);
        let lasers = display.wavelengths_m().iter().map(|l| round(l * 1e9));
        object([
            ("width", display.width().into()),
            ("height", display.height().into()),
            ("pitchUm", round(display.pitch_m() * 1e6)),
            ("wavelengthsNm", lasers.collect::<Array>().into()),
            ("volumeDepthMm", round(display.volume_depth_m() * 1e3)),
            ("offsetMm", round(display.offset_m() * 1e3)),
            ("bits", display.bits().into()),
            ("apertureRadius", display.aperture_radius().into()),
        ])
    }
}
