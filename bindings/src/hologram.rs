//! Results: handles to memory that is read in place.

use crate::error::{PhasefrontError, guard};
use crate::options::EncoderOptions;
use crate::statistics::FrameTimes;
use crate::target::Target;
use num_complex::Complex32;
use phasefront::Size;
use phasefront::input::RgbEncoding;
use phasefront::output::{self, Layout, Output, Placement};
use phasefront::session;
use std::sync::Arc;

/// The hologram of one frame: modulator levels of three colours. The layers written by hand keep it alive while its
/// planes are read.
#[derive(Debug, uniffi::Object)]
pub struct RawHologram {
    pub(crate) core: session::Hologram,
}

/// The images that a modulator's input takes of a hologram.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Record)]
pub struct OutputSize {
    /// The width of an image in pixels.
    pub width: usize,
    /// The height of an image in pixels.
    pub height: usize,
    /// The number of bytes of a pixel.
    pub pixel_bytes: usize,
    /// The number of images: one, or one for each colour.
    pub images: usize,
}

impl From<output::OutputSize> for OutputSize {
    fn from(size: output::OutputSize) -> Self {
        OutputSize {
            width: size.size.width,
            height: size.size.height,
            pixel_bytes: size.pixel_bytes,
            images: size.images,
        }
    }
}

/// The caller's memory for an image. The layers written by hand promise that it stays valid during the call and that
/// nobody else uses it.
#[derive(Debug, Clone, Copy, uniffi::Record)]
pub struct RawMemory {
    /// The address of the first byte.
    pub address: u64,
    /// The number of bytes.
    pub length: u64,
    /// The number of bytes from one row to the next.
    pub row_stride: usize,
}

impl RawMemory {
    /// Returns the bytes.
    ///
    /// # Errors
    /// Returns an error if there is no memory.
    #[allow(unsafe_code)]
    pub(crate) fn bytes<'a>(self) -> Result<&'a mut [u8], PhasefrontError> {
        if self.address == 0 {
            return Err(PhasefrontError::Setting("the image has no memory".into()));
        }
        // SAFETY: the promise of the layers.
        Ok(unsafe { std::slice::from_raw_parts_mut(self.address as usize as *mut u8, self.length as usize) })
    }
}

/// The properties of a hologram.
#[derive(Debug, Clone, PartialEq, uniffi::Record)]
pub struct HologramInfo {
    /// The timestamp of the frame.
    pub timestamp_ns: i64,
    /// The width in pixels.
    pub width: usize,
    /// The height in pixels.
    pub height: usize,
    /// The number of colours of the levels: 3, or 1 for a display with one laser.
    pub colours: usize,
    /// The amplitude that maps to full light.
    pub scale: f32,
    /// The distance of the near end of the volume in metres; none for normalized depth.
    pub near_m: Option<f32>,
    /// The distance of the far end of the volume in metres; none for normalized depth.
    pub far_m: Option<f32>,
    /// The share of the depth sensor's pixels that had a usable reading.
    pub valid_depth: f32,
    /// The quality level of the hologram; 0 is the best.
    pub quality_level: usize,
    /// The time that each stage took.
    pub times: FrameTimes,
    /// The meaning of the frame's colours. Views are in sRGB unless these are amplitudes, as which views show them.
    pub encoding: RgbEncoding,
}

impl RawHologram {
    pub(crate) fn new(core: session::Hologram) -> Arc<Self> {
        Arc::new(RawHologram { core })
    }
}

#[uniffi::export]
impl RawHologram {
    /// Makes the hologram of a complex field of `height` × `width` pixels at `z_mm`, 0 the midpoint: the real and the
    /// imaginary part of each pixel as 32-bit floats, planes of the target's colours row by row without gaps, one after
    /// another.
    ///
    /// # Errors
    /// A field of another size, one that is larger than the modulator, dark or not finite; a z too far away; options
    /// out of their range.
    #[uniffi::constructor]
    pub fn of_field(
        field: &[u8],
        width: usize,
        height: usize,
        z_mm: f64,
        target: Arc<Target>,
        options: EncoderOptions,
    ) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let (values, rest) = field.as_chunks::<8>();
            if !rest.is_empty() {
                return Err(PhasefrontError::Frame(format!(
                    "a field of {} bytes; a value has 8",
                    field.len()
                )));
            }
            let values: Vec<Complex32> = (values.iter())
                .map(|[a, b, c, d, e, f, g, h]| {
                    Complex32::new(
                        f32::from_ne_bytes([*a, *b, *c, *d]),
                        f32::from_ne_bytes([*e, *f, *g, *h]),
                    )
                })
                .collect();
            let size = Size { width, height };
            let core = session::Hologram::of_field(&values, size, z_mm / 1e3, &target.core, &(&options).into())?;
            Ok(RawHologram::new(core))
        })
    }

    /// Restores a hologram from its levels, the planes of the target's colours one after another without gaps, and its
    /// properties, of which it keeps the size and the scale.
    ///
    /// # Errors
    /// Returns an error if there is another number of levels, if the size or the scale is not possible, or if the
    /// target has more than 8 bits.
    #[uniffi::constructor]
    pub fn from_levels(levels: &[u8], info: HologramInfo, target: Arc<Target>) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let size = Size {
                width: info.width,
                height: info.height,
            };
            let core = session::Hologram::from_levels(levels, size, info.scale, &target.core)?;
            Ok(RawHologram::new(core.with_encoding(info.encoding)))
        })
    }

    /// Returns the properties of the hologram.
    pub fn info(&self) -> HologramInfo {
        let Size { width, height } = self.core.size();
        let (near_m, far_m) = self.core.range_m().unzip();
        HologramInfo {
            timestamp_ns: self.core.timestamp_ns().unwrap_or(0) as i64,
            width,
            height,
            colours: self.core.colours(),
            scale: self.core.scale(),
            near_m,
            far_m,
            valid_depth: self.core.valid_depth().unwrap_or(0.0),
            quality_level: self.core.quality_level(),
            times: self.core.times().into(),
            encoding: self.core.encoding(),
        }
    }

    /// Returns the matrix from the lasers' light to linear sRGB, three rows of a number for each laser, which a
    /// hologram's file holds; none if views are amplitudes.
    pub fn srgb_of_light(&self) -> Option<Vec<f32>> {
        let rows = self.core.view_colours().matrix()?;
        Some(
            rows.iter()
                .flat_map(|row| &row[..self.core.colours()])
                .copied()
                .collect(),
        )
    }

    /// Returns another handle to the same hologram. Each reader of its memory holds one.
    pub fn share(self: Arc<Self>) -> Arc<Self> {
        self
    }

    /// Returns the address of the levels of one colour: 0 red, 1 green, 2 blue, or 0 for one laser. Each level is a
    /// byte; there are no gaps between rows or between colours. The address is valid as long as this object.
    ///
    /// # Errors
    /// Returns an error for other colours.
    pub fn plane_address(&self, colour: usize) -> Result<u64, PhasefrontError> {
        guard(|| Ok(self.core.plane(colour)?.as_ptr() as u64))
    }

    /// Returns the number of bytes of a plane.
    pub fn plane_len(&self) -> u64 {
        self.core.size().pixels() as u64
    }

    /// Returns the z in mm of the scene point at (`x`, `y`) of the picture, for example to focus where the user taps.
    /// Coordinates run from 0 to 1 from the upper left corner.
    pub fn z_at(&self, x: f64, y: f64) -> f64 {
        self.core.z_at(x, y) * 1e3
    }

    /// Writes the view of an eye focused at `z_mm` in sRGB, `width` × `height` pixels in `layout`, Rgb, Rgba or Bgra.
    ///
    /// # Errors
    /// Returns an error if the image is empty or does not fit, or z is too far away.
    pub fn write_preview(
        &self,
        z_mm: f64,
        width: usize,
        height: usize,
        layout: Layout,
        to: RawMemory,
    ) -> Result<(), PhasefrontError> {
        guard(|| {
            let screen = Size { width, height };
            Ok(self
                .core
                .write_preview(z_mm / 1e3, screen, layout, to.bytes()?, to.row_stride)?)
        })
    }

    /// Returns the view of an eye focused at `z_mm` at full resolution, as amplitudes where 1 is white.
    ///
    /// # Errors
    /// Returns an error if z is too far away.
    pub fn refocus(&self, z_mm: f64) -> Result<Arc<RawPlanes>, PhasefrontError> {
        guard(|| Ok(self.planes(Numbers::Amplitudes(self.core.refocus(z_mm / 1e3)?))))
    }

    /// Returns the complex field that the levels produce behind the aperture at `z_mm`, where 0 is the midpoint: the
    /// real and the imaginary part of each pixel. The carrier is left out.
    ///
    /// # Errors
    /// Returns an error if z is too far away.
    pub fn field(&self, z_mm: f64) -> Result<Arc<RawPlanes>, PhasefrontError> {
        guard(|| Ok(self.planes(Numbers::Field(self.core.field(z_mm / 1e3)?))))
    }

    /// Returns the size of the images of `layout` for the modulator.
    pub fn output_size(&self, layout: Layout) -> OutputSize {
        let Size { width, height } = self.core.target().modulator();
        OutputSize {
            width,
            height,
            pixel_bytes: layout.pixel_bytes(),
            images: layout.images(self.core.colours()),
        }
    }

    /// Writes image `image` of those that the modulator's driver takes, at the modulator's resolution. Levels with
    /// fewer bits than their place use its upper bits; `placement` positions the hologram.
    ///
    /// # Errors
    /// Returns an error if the layout does not have this image or the image does not fit.
    pub fn write_output(&self, placement: Placement, image: usize, to: RawMemory) -> Result<(), PhasefrontError> {
        guard(|| {
            let plan = Output::new(self.core.target(), self.core.size(), placement)?;
            let (levels, bytes) = (self.core.output_levels(), to.bytes()?);
            Ok(self
                .core
                .on_threads(|| plan.write(levels, image, bytes, to.row_stride))?)
        })
    }
}

impl RawHologram {
    /// Returns planes of the hologram's shape with `numbers`.
    fn planes(&self, numbers: Numbers) -> Arc<RawPlanes> {
        let Size { width, height } = self.core.size();
        Arc::new(RawPlanes {
            numbers,
            width,
            height,
            colours: self.core.colours(),
        })
    }
}

/// Numbers of 32 bits at each pixel of each colour, without gaps between rows or planes. The layers written by hand
/// read them.
#[derive(Debug, uniffi::Object)]
pub struct RawPlanes {
    numbers: Numbers,
    width: usize,
    height: usize,
    colours: usize,
}

#[derive(Debug)]
enum Numbers {
    Amplitudes(Vec<f32>),
    Field(Vec<Complex32>),
}

#[uniffi::export]
impl RawPlanes {
    /// Returns another handle to the same planes. Each reader of their memory holds one.
    pub fn share(self: Arc<Self>) -> Arc<Self> {
        self
    }

    /// Returns the address of the plane of one colour: 0 red, 1 green, 2 blue, or 0 for one laser. The address is valid
    /// as long as this object.
    ///
    /// # Errors
    /// Returns an error for other colours.
    pub fn plane_address(&self, colour: usize) -> Result<u64, PhasefrontError> {
        guard(|| {
            if colour >= self.colours {
                return Err(PhasefrontError::Setting(format!(
                    "there is no plane {colour}; there are {}, and 0 is the first",
                    self.colours
                )));
            }
            let size = self.pixel_bytes() * self.width * self.height;
            let first = match &self.numbers {
                Numbers::Amplitudes(values) => values.as_ptr() as u64,
                Numbers::Field(values) => values.as_ptr() as u64,
            };
            Ok(first + (colour * size) as u64)
        })
    }

    /// Returns the number of bytes of a pixel: 4 for an amplitude, 8 for a real and an imaginary part.
    pub fn pixel_bytes(&self) -> usize {
        match &self.numbers {
            Numbers::Amplitudes(_) => size_of::<f32>(),
            Numbers::Field(_) => size_of::<Complex32>(),
        }
    }

    /// Returns the width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns the number of planes: 3, or 1 for a display with one laser.
    pub fn colours(&self) -> usize {
        self.colours
    }
}
