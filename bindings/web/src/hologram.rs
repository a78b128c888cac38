//! Results, which leave the module as copies, images into the memory of the page.

#[cfg(feature = "webgpu")]
use crate::error::error;
use crate::error::{Answer, object, of_core, setting};
use js_sys::{Array, Float32Array, Object, Uint8Array};
use phasefront::Size;
#[cfg(feature = "webgpu")]
use phasefront::output::Levels;
use phasefront::output::{Layout, Output, OutputSize, Placement};
use phasefront::session::{FrameTimes, Hologram};
#[cfg(feature = "webgpu")]
use phasefront_gpu::{GpuError, GpuView, paint};
use std::cell::RefCell;
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
        let Size { width, height } = self.core.size();
        let range = self.core.range_m().map(|(near, far)| [near, far].map(JsValue::from));
        object([
            ("timestamp", (self.core.timestamp_ns().unwrap_or(0) as f64 / 1e3).into()),
            ("width", width.into()),
            ("height", height.into()),
            ("colours", self.core.colours().into()),
            ("scale", self.core.scale().into()),
            (
                "rangeM",
                range.map_or(JsValue::NULL, |range| Array::from_iter(range).into()),
            ),
            ("validDepth", self.core.valid_depth().unwrap_or(0.0).into()),
            ("qualityLevel", self.core.quality_level().into()),
            ("times", times(self.core.times()).into()),
            ("encoding", self.core.encoding().name().into()),
        ])
    }

    /// Checks whether the levels stayed on the GPU.
    #[wasm_bindgen(js_name = onGpu)]
    pub fn on_gpu(&self) -> bool {
        #[cfg(feature = "webgpu")]
        return self.core.on_gpu().is_some();
        #[cfg(not(feature = "webgpu"))]
        false
    }

    /// Draws the modulator's image, whose levels stayed on the GPU, to a canvas.
    ///
    /// # Errors
    /// Rejects with an error of kind `setting` if the canvas has another context, and of kind `session` if the GPU was
    /// lost.
    #[cfg(feature = "webgpu")]
    #[wasm_bindgen(js_name = paintLevels)]
    pub async fn paint_levels(&self, canvas: JsValue) -> Answer<()> {
        let levels = self.core.on_gpu().ok_or_else(elsewhere)?;
        let (target, size) = (self.core.target(), self.core.size());
        let modulator = target.modulator();
        let around = if size == modulator {
            None
        } else {
            let plan = Output::new(target, size, Placement::centred(Layout::Rgba)).map_err(of_core)?;
            let mut around = vec![0; 4 * modulator.pixels()];
            let dark = vec![0; self.core.colours() * size.pixels()];
            (plan.write(Levels::Bytes(&dark), 0, &mut around, plan.row_bytes())).map_err(of_core)?;
            Some(around)
        };
        let painted = paint(levels.texture(), modulator, around.as_deref(), &canvas).await;
        painted.map_err(of_gpu)
    }

    /// Draws the view of an eye focused at `z_mm` to a canvas, from levels that stayed on the GPU.
    ///
    /// # Errors
    /// Rejects in the cases of [`Self::write_preview`] and [`Self::paint_levels`].
    #[cfg(feature = "webgpu")]
    #[wasm_bindgen(js_name = paintPreview)]
    pub async fn paint_preview(&self, z_mm: f64, width: u32, height: u32, canvas: JsValue) -> Answer<()> {
        let levels = self.core.on_gpu().ok_or_else(elsewhere)?;
        let screen = Size {
            width: width as usize,
            height: height as usize,
        };
        let draw = async |view: &GpuView| paint(view.texture(), screen, None, &canvas).await;
        let drawn = self.core.view_on_gpu(levels, z_mm / 1e3, screen, draw).await;
        drawn.map_err(of_gpu)
    }

    /// Returns the modulator levels, (C, H, W).
    ///
    /// # Errors
    /// Throws an error of kind `setting` if they stayed on the GPU.
    pub fn levels(&self) -> Answer<Uint8Array> {
        Ok(Uint8Array::from(self.here()?.levels()))
    }

    /// Returns the z in mm of the scene point at (`x`, `y`) of the picture, each from 0 to 1.
    #[wasm_bindgen(js_name = zAt)]
    pub fn z_at(&self, x: f64, y: f64) -> f64 {
        self.core.z_at(x, y) * 1e3
    }

    /// Writes the view of an eye focused at `z_mm` into `to`: pixels in `layout`, `rgb`, `rgba` or `bgra`, whose rows
    /// begin `row_stride` bytes apart.
    ///
    /// # Errors
    /// Throws an error of kind `setting` in the cases of [`Hologram::write_preview`].
    #[wasm_bindgen(js_name = writePreview)]
    pub fn write_preview(
        &self,
        z_mm: f64,
        width: u32,
        height: u32,
        name: &str,
        to: &Uint8Array,
        row_stride: u32,
    ) -> Answer<()> {
        let core = self.here()?;
        let layout = layout(name)?;
        let screen = Size {
            width: width as usize,
            height: height as usize,
        };
        let row = layout.pixel_bytes() * screen.width;
        copied(to, row_stride, (screen.height, row), |bytes| {
            core.write_preview(z_mm / 1e3, screen, layout, bytes, row)
        })
    }

    /// Returns the view of an eye focused at `z_mm` at full resolution: amplitudes where 1 is white, (C, H, W).
    ///
    /// # Errors
    /// Throws an error of kind `setting` if z is too far away.
    pub fn refocus(&self, z_mm: f64) -> Answer<Float32Array> {
        let amplitudes = self.here()?.refocus(z_mm / 1e3).map_err(of_core)?;
        Ok(Float32Array::from(&amplitudes[..]))
    }

    /// Returns the real and imaginary part of each pixel of the complex field behind the aperture at `z_mm`, (C, H, W,
    /// 2).
    ///
    /// # Errors
    /// Throws an error of kind `setting` if z is too far away.
    pub fn field(&self, z_mm: f64) -> Answer<Float32Array> {
        let field = self.here()?.field(z_mm / 1e3).map_err(of_core)?;
        let parts: Vec<f32> = field.iter().flat_map(|value| [value.re, value.im]).collect();
        Ok(Float32Array::from(&parts[..]))
    }

    /// Returns the size of the images of a layout: an object of the form `OutputSize`.
    ///
    /// # Errors
    /// Throws an error of kind `setting` if the layout is unknown.
    #[wasm_bindgen(js_name = outputSize)]
    pub fn output_size(&self, name: &str) -> Answer<Object> {
        let layout = layout(name)?;
        Ok(size(OutputSize {
            size: self.core.target().modulator(),
            pixel_bytes: layout.pixel_bytes(),
            images: layout.images(self.core.colours()),
        }))
    }

    /// Writes one of the images for the modulator's driver into `to`, whose rows begin `row_stride` bytes apart.
    /// `flips` are the flips of x and y; `shift` is the offset to the right and down in pixels.
    ///
    /// # Errors
    /// Throws an error of kind `setting` if the layout is unknown, if it does not have the image, if the image does not
    /// fit, or if [`Output::new`] fails.
    #[wasm_bindgen(js_name = writeOutput)]
    pub fn write_output(
        &self,
        name: &str,
        flips: &[u8],
        shift: &[i32],
        image: u32,
        to: &Uint8Array,
        row_stride: u32,
    ) -> Answer<()> {
        let core = self.here()?;
        let (&[flip_x, flip_y], &[shift_x, shift_y]) = (flips, shift) else {
            return Err(setting("a placement has two flips and two shifts"));
        };
        let placement = Placement {
            flip_x: flip_x != 0,
            flip_y: flip_y != 0,
            shift_x,
            shift_y,
            ..Placement::centred(layout(name)?)
        };
        let plan = Output::new(core.target(), core.size(), placement).map_err(of_core)?;
        copied(to, row_stride, (plan.size().height, plan.row_bytes()), |bytes| {
            plan.write(core.output_levels(), image as usize, bytes, plan.row_bytes())
        })
    }
}

impl RawHologram {
    /// Returns the hologram if its levels are in the module's memory.
    ///
    /// # Errors
    /// Returns an error of kind `setting` if they stayed on the GPU.
    pub(crate) fn here(&self) -> Answer<&Hologram> {
        if self.on_gpu() {
            return Err(setting(
                "the levels stayed on the GPU; draw them, or process the frame without onGpu",
            ));
        }
        Ok(&self.core)
    }
}

#[cfg(feature = "webgpu")]
fn elsewhere() -> JsValue {
    setting("the levels are not on the GPU; write them into an image")
}

#[cfg(feature = "webgpu")]
fn of_gpu(why: GpuError) -> JsValue {
    match why {
        GpuError::Core(why) => of_core(why),
        GpuError::Lost(_) => error("session", &why.to_string()),
        _ => setting(&why.to_string()),
    }
}

fn layout(name: &str) -> Answer<Layout> {
    Ok(match name {
        "rgb" => Layout::Rgb,
        "rgba" => Layout::Rgba,
        "bgra" => Layout::Bgra,
        "rgb10" => Layout::Rgb10,
        "grey" => Layout::Grey,
        "grey16" => Layout::Grey16,
        other => {
            return Err(setting(&format!(
                "there is no layout '{other}'; there are rgb, rgba, bgra, rgb10, grey, grey16"
            )));
        }
    })
}

/// Converts a size to an object of the form `OutputSize`.
pub(crate) fn size(size: OutputSize) -> Object {
    object([
        ("width", size.size.width.into()),
        ("height", size.size.height.into()),
        ("pixelBytes", size.pixel_bytes.into()),
        ("images", size.images.into()),
    ])
}

thread_local! {
    /// The module's memory for an image on its way out, kept for the next one.
    static IMAGE: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// Lets `write` fill an image of (H, bytes of a row) and copies it into `to`, whose rows begin `row_stride` bytes
/// apart.
pub(crate) fn copied(
    to: &Uint8Array,
    row_stride: u32,
    (height, row): (usize, usize),
    write: impl FnOnce(&mut [u8]) -> phasefront::Result<()>,
) -> Answer<()> {
    let stride = row_stride as usize;
    let needed = stride.saturating_mul(height.saturating_sub(1)).saturating_add(row);
    if stride < row || (to.length() as usize) < needed {
        return Err(setting(&format!(
            "{} bytes with rows {stride} bytes apart cannot hold {height} rows of {row} bytes",
            to.length()
        )));
    }
    IMAGE.with_borrow_mut(|image| {
        image.resize(height * row, 0);
        write(image).map_err(of_core)?;
        // Without gaps, all rows are one.
        let run = if stride == row { height * row } else { row };
        for (n, bytes) in image.chunks_exact(run.max(1)).enumerate() {
            let from = (n * stride) as u32;
            to.subarray(from, from + run as u32).copy_from(bytes);
        }
        Ok(())
    })
}
