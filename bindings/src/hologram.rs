//! Results: handles whose memory is read in place.

use crate::error::{PhasefrontError, guard};
use crate::options::Placement;
use crate::statistics::FrameTimes;
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
    /// The rung of the ladder that it was made on, 0 the best.
    pub rung: u32,
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
                rung: self.core.rung() as u32,
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
