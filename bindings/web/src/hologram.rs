//! Results, which leave the module as copies.

use crate::error::{Answer, object, of_core, setting};
use js_sys::{Array, Float32Array, Object, Uint8Array, Uint8ClampedArray};
use phasefront::output::{Layout, Output, Placement};
use phasefront::session::{FrameTimes, Hologram};
use std::time::Duration;
use wasm_bindgen::prelude::*;

/// Converts times to an object of the form `FrameTimes`.
pub(crate) fn times(times: FrameTimes) -> Object {
    let ms = |time: Duration| JsValue::from(time.as_secs_f64() * 1e3);
    object([
        ("colourMs", ms(times.colour)),
        ("depthMs", ms(times.depth)),
        ("methodMs", ms(times.method)),
        ("propagateMs", ms(times.propagate)),
        ("encodeMs", ms(times.encode)),
        ("totalMs", ms(times.total())),
    ])
}

/// The hologram of one frame.
#[wasm_bindgen]
pub struct RawHologram {
    pub(crate) core: Hologram,
}

#[wasm_bindgen]
impl RawHologram {
    /// Returns the metadata: an object of the form `HologramInfo`.
    pub fn info(&self) -> Object {
        let (height, width) = self.core.shape();
        let range = self.core.range_m().map(|(near, far)| [near, far].map(JsValue::from));
        object([
            ("timestampNs", self.core.timestamp_ns().into()),
            ("width", width.into()),
            ("height", height.into()),
            ("colours", self.core.colours().into()),
            ("scale", self.core.scale().into()),
            (
                "rangeM",
                range.map_or(JsValue::NULL, |range| Array::from_iter(range).into()),
            ),
            ("validDepth", self.core.valid_depth().into()),
            ("qualityLevel", self.core.quality_level().into()),
            ("times", times(self.core.times()).into()),
        ])
    }

    /// Returns the modulator levels, (C, H, W).
    pub fn levels(&self) -> Uint8Array {
        Uint8Array::from(self.core.levels())
    }

    /// Returns the z in mm of the scene point at (`x`, `y`) of the picture, each from 0 to 1.
    #[wasm_bindgen(js_name = zAt)]
    pub fn z_at(&self, x: f64, y: f64) -> f64 {
        self.core.z_at(x, y) * 1e3
    }

    /// Returns the view of an eye focused at `z_mm`: rows of red, green, blue and alpha.
    ///
    /// # Errors
    /// Throws an error of kind `setting` in the cases of [`Hologram::preview`].
    pub fn preview(&self, z_mm: f64, width: u32, height: u32) -> Answer<Uint8ClampedArray> {
        let (w, h) = (width as usize, height as usize);
        let mut rgba = vec![0; Hologram::preview_bytes(h, w).map_err(of_core)?];
        self.core.preview(z_mm / 1e3, h, w, &mut rgba).map_err(of_core)?;
        Ok(Uint8ClampedArray::from(&rgba[..]))
    }

    /// Returns the view of an eye focused at `z_mm` at full resolution: amplitudes where 1 is white, (C, H, W).
    ///
    /// # Errors
    /// Throws an error of kind `setting` if z is too far away.
    pub fn refocus(&self, z_mm: f64) -> Answer<Float32Array> {
        let amplitudes = self.core.refocus(z_mm / 1e3).map_err(of_core)?;
        Ok(Float32Array::from(&amplitudes[..]))
    }

    /// Returns the real and imaginary part of each pixel of the complex field behind the aperture at `z_mm`, (C, H, W,
    /// 2).
    ///
    /// # Errors
    /// Throws an error of kind `setting` if z is too far away.
    pub fn field(&self, z_mm: f64) -> Answer<Float32Array> {
        let field = self.core.field(z_mm / 1e3).map_err(of_core)?;
        let parts: Vec<f32> = field.iter().flat_map(|value| [value.re, value.im]).collect();
        Ok(Float32Array::from(&parts[..]))
    }

    /// Returns one of the images for the modulator's driver: an object of the form `OutputImage`. `flips` are the flips
    /// of x and y; `shift` is the offset to the right and down in pixels.
    ///
    /// # Errors
    /// Throws an error of kind `setting` if the layout is unknown, if it does not have the image, or if [`Output::new`]
    /// fails.
    pub fn output(&self, layout: &str, flips: &[u8], shift: &[i32], image: u32) -> Answer<Object> {
        let (&[flip_x, flip_y], &[shift_x, shift_y]) = (flips, shift) else {
            return Err(setting("a placement has two flips and two shifts"));
        };
        let layout = match layout {
            "rgb" => Layout::Rgb,
            "rgba" => Layout::Rgba,
            "bgra" => Layout::Bgra,
            "grey" => Layout::Grey,
            other => {
                return Err(setting(&format!(
                    "there is no layout '{other}'; there are rgb, rgba, bgra, grey"
                )));
            }
        };
        let placement = Placement {
            flip_x: flip_x != 0,
            flip_y: flip_y != 0,
            shift_x,
            shift_y,
            ..Placement::centred(layout)
        };
        let plan = Output::new(self.core.target(), self.core.shape(), placement).map_err(of_core)?;
        let mut bytes = vec![0; plan.image_bytes()];
        plan.write(self.core.output_levels(), image as usize, &mut bytes)
            .map_err(of_core)?;
        let (height, width) = plan.shape();
        Ok(object([
            ("width", width.into()),
            ("height", height.into()),
            ("pixelBytes", layout.pixel_bytes().into()),
            ("data", Uint8Array::from(&bytes[..]).into()),
        ]))
    }
}
