//! Results: handles whose memory is read in place.

use crate::error::{PhasefrontError, guard};
use crate::options::Placement;
use crate::statistics::FrameTimes;
use num_complex::Complex32;
use phasefront::output::Output;
use phasefront::session;
use std::sync::Arc;

/// The hologram of one frame: modulator levels of three colours. For the layers by hand, which keep it alive while its
/// planes are read.
#[derive(Debug, uniffi::Object)]
pub struct RawHologram {
    core: session::Hologram,
}

/// What is known of a hologram.
#[derive(Debug, Clone, PartialEq, uniffi::Record)]
pub struct HologramInfo {
    /// The frame's timestamp.
    pub timestamp_ns: u64,
    /// Pixels along x.
    pub width: u32,
    /// Pixels along y.
    pub height: u32,
    /// How many colours its levels have: 3, or 1 for a display of one laser.
    pub colours: u32,
    /// The amplitude that full light stands for.
    pub scale: f32,
    /// Metres at the near end of the volume; none for normalized depth.
    pub near_m: Option<f32>,
    /// Metres at the far end of the volume; none for normalized depth.
    pub far_m: Option<f32>,
    /// The share of the depth sensor's pixels that had a usable reading.
    pub valid_depth: f32,
    /// The quality level that it was made at, 0 the best.
    pub quality_level: u32,
    /// How long each stage took.
    pub times: FrameTimes,
}

impl RawHologram {
    pub(crate) fn new(core: session::Hologram) -> Arc<Self> {
        Arc::new(RawHologram { core })
    }
}

#[uniffi::export]
impl RawHologram {
    /// What is known of it.
    pub fn info(&self) -> Result<HologramInfo, PhasefrontError> {
        guard(|| {
            let (height, width) = self.core.shape();
            let (near_m, far_m) = self.core.range_m().unzip();
            Ok(HologramInfo {
                timestamp_ns: self.core.timestamp_ns(),
                width: width as u32,
                height: height as u32,
                colours: self.core.colours() as u32,
                scale: self.core.scale(),
                near_m,
                far_m,
                valid_depth: self.core.valid_depth(),
                quality_level: self.core.quality_level() as u32,
                times: self.core.times().into(),
            })
        })
    }

    /// Another handle to the same hologram: whoever reads its memory holds one.
    pub fn share(self: Arc<Self>) -> Result<Arc<Self>, PhasefrontError> {
        Ok(self)
    }

    /// Where the levels of one colour lie, a byte each, row by row without gaps: 0 red, 1 green, 2 blue, or 0 of one
    /// laser. The colours follow one another without gaps, too. Valid as long as this object.
    ///
    /// # Errors
    /// Another colour.
    pub fn plane_address(&self, colour: u32) -> Result<u64, PhasefrontError> {
        guard(|| Ok(self.core.plane(colour as usize)?.as_ptr() as u64))
    }

    /// How many bytes lie there.
    pub fn plane_len(&self) -> Result<u64, PhasefrontError> {
        guard(|| Ok(self.core.plane(0)?.len() as u64))
    }

    /// z of what is seen at (`x`, `y`) of the picture, each 0 to 1 from its upper left corner, mm: where to focus when
    /// it is tapped on.
    pub fn z_at(&self, x: f64, y: f64) -> Result<f64, PhasefrontError> {
        guard(|| Ok(self.core.z_at(x, y) * 1e3))
    }

    /// What an eye focused at `z_mm` sees, `width` × `height` pixels.
    ///
    /// # Errors
    /// An empty image, or a z too far away.
    pub fn preview(&self, z_mm: f64, width: u32, height: u32) -> Result<Arc<RawImage>, PhasefrontError> {
        guard(|| {
            let (w, h) = (width as usize, height as usize);
            let mut bytes = vec![0; session::Hologram::preview_bytes(h, w)?];
            self.core.preview(z_mm / 1e3, h, w, &mut bytes)?;
            Ok(Arc::new(RawImage {
                bytes,
                width,
                height,
                pixel_bytes: 4,
            }))
        })
    }

    /// What an eye focused at `z_mm` sees of the whole hologram: amplitudes, of which 1 is white.
    ///
    /// # Errors
    /// A z too far away.
    pub fn refocus(&self, z_mm: f64) -> Result<Arc<RawPlanes>, PhasefrontError> {
        guard(|| Ok(self.planes(Numbers::Amplitudes(self.core.refocus(z_mm / 1e3)?))))
    }

    /// The complex field that the levels make behind the aperture at `z_mm`, 0 the midpoint, without the carrier: real
    /// and imaginary part of each pixel.
    ///
    /// # Errors
    /// A z too far away.
    pub fn field(&self, z_mm: f64) -> Result<Arc<RawPlanes>, PhasefrontError> {
        guard(|| Ok(self.planes(Numbers::Field(self.core.field(z_mm / 1e3)?))))
    }

    /// Image `image` of those that the modulator's driver takes, of the modulator's resolution: levels as they are, in
    /// the upper bits of a byte, the hologram where `placement` says.
    ///
    /// # Errors
    /// An image that the layout has not.
    pub fn output(&self, placement: Placement, image: u32) -> Result<Arc<RawImage>, PhasefrontError> {
        guard(|| {
            let placement: phasefront::output::Placement = placement.into();
            let plan = Output::new(self.core.target(), self.core.shape(), placement)?;
            let mut bytes = vec![0; plan.image_bytes()];
            plan.write(self.core.output_levels(), image as usize, &mut bytes)?;
            let (height, width) = plan.shape();
            Ok(Arc::new(RawImage {
                bytes,
                width: width as u32,
                height: height as u32,
                pixel_bytes: placement.layout.pixel_bytes() as u32,
            }))
        })
    }
}

impl RawHologram {
    /// `numbers` of its shape.
    fn planes(&self, numbers: Numbers) -> Arc<RawPlanes> {
        let (height, width) = self.core.shape();
        Arc::new(RawPlanes {
            numbers,
            width: width as u32,
            height: height as u32,
            colours: self.core.colours() as u32,
        })
    }
}

/// Numbers of 32 bits at each pixel of each colour: planes row by row without gaps, one after another. For the layers
/// by hand.
#[derive(Debug, uniffi::Object)]
pub struct RawPlanes {
    numbers: Numbers,
    width: u32,
    height: u32,
    colours: u32,
}

#[derive(Debug)]
enum Numbers {
    Amplitudes(Vec<f32>),
    Field(Vec<Complex32>),
}

#[uniffi::export]
impl RawPlanes {
    /// Another handle to the same planes: whoever reads their memory holds one.
    pub fn share(self: Arc<Self>) -> Result<Arc<Self>, PhasefrontError> {
        Ok(self)
    }

    /// Where the plane of one colour lies: 0 red, 1 green, 2 blue, or 0 of one laser. Valid as long as this object.
    ///
    /// # Errors
    /// Another colour.
    pub fn plane_address(&self, colour: u32) -> Result<u64, PhasefrontError> {
        guard(|| {
            if colour >= self.colours {
                return Err(PhasefrontError::Setting(format!(
                    "there is no plane {colour}; there are {}, and 0 is the first",
                    self.colours
                )));
            }
            let size = u64::from(self.pixel_bytes()?) * u64::from(self.width) * u64::from(self.height);
            let first = match &self.numbers {
                Numbers::Amplitudes(values) => values.as_ptr() as u64,
                Numbers::Field(values) => values.as_ptr() as u64,
            };
            Ok(first + u64::from(colour) * size)
        })
    }

    /// Bytes of a pixel: 4 of an amplitude, 8 of a real and an imaginary part.
    pub fn pixel_bytes(&self) -> Result<u32, PhasefrontError> {
        guard(|| {
            Ok(match &self.numbers {
                Numbers::Amplitudes(_) => size_of::<f32>() as u32,
                Numbers::Field(_) => size_of::<Complex32>() as u32,
            })
        })
    }

    /// Pixels along x.
    pub fn width(&self) -> Result<u32, PhasefrontError> {
        Ok(self.width)
    }

    /// Pixels along y.
    pub fn height(&self) -> Result<u32, PhasefrontError> {
        Ok(self.height)
    }

    /// Planes: 3, or 1 of a display of one laser.
    pub fn colours(&self) -> Result<u32, PhasefrontError> {
        Ok(self.colours)
    }
}

/// An image, row by row without gaps. For the layers by hand.
#[derive(Debug, uniffi::Object)]
pub struct RawImage {
    bytes: Vec<u8>,
    width: u32,
    height: u32,
    pixel_bytes: u32,
}

#[uniffi::export]
impl RawImage {
    /// Another handle to the same image: whoever reads its memory holds one.
    pub fn share(self: Arc<Self>) -> Result<Arc<Self>, PhasefrontError> {
        Ok(self)
    }

    /// Where its bytes lie. Valid as long as this object.
    pub fn address(&self) -> Result<u64, PhasefrontError> {
        Ok(self.bytes.as_ptr() as u64)
    }

    /// How many bytes lie there.
    pub fn byte_len(&self) -> Result<u64, PhasefrontError> {
        Ok(self.bytes.len() as u64)
    }

    /// Pixels along x.
    pub fn width(&self) -> Result<u32, PhasefrontError> {
        Ok(self.width)
    }

    /// Pixels along y.
    pub fn height(&self) -> Result<u32, PhasefrontError> {
        Ok(self.height)
    }

    /// Bytes of a pixel.
    pub fn pixel_bytes(&self) -> Result<u32, PhasefrontError> {
        Ok(self.pixel_bytes)
    }
}
