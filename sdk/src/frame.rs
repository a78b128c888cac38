//! One RGB-D frame as the optics and the networks take it: planar, amplitudes, normalized depth; and the colour
//! images of cameras that become it.
//!
//! Depth in metres, disparity or raw units becomes normalized depth in [`crate::depth`].

mod colour;
mod convert;
mod plane;
pub mod reference;
mod resample;

pub(crate) use colour::check_size;
pub use colour::{ColourFormat, ColourImage, MAX_SOURCE_PIXELS, YuvEncoding, YuvMatrix};
#[cfg(feature = "gpu")]
pub(crate) use convert::yuv_constants;
pub use convert::{ColourPlan, ColourScratch};
pub use plane::{Orientation, Plane, Rotation};
pub(crate) use resample::Axis;
pub use resample::Crop;

use crate::error::{Error, Result};
use ndarray::{Array2, Array3, ArrayView2, ArrayView3};

/// Colour as amplitude in \[0, 1], (3, H, W), and normalized depth, (H, W), 0 nearest, 1 farthest.
#[derive(Debug, Clone, PartialEq)]
pub struct RgbdFrame {
    rgb: Array3<f32>,
    depth: Array2<f32>,
}

impl RgbdFrame {
    /// Joins `rgb`, (3, H, W), and `depth`, (H, W).
    ///
    /// # Errors
    /// Shapes that do not fit, an empty frame, or a value that is not finite or outside \[0, 1].
    pub fn new(rgb: Array3<f32>, depth: Array2<f32>) -> Result<Self> {
        let (channels, height, width) = rgb.dim();
        if channels != 3 {
            return Err(Error::Frame(format!(
                "colour has {channels} planes; it must have 3: red, green, blue"
            )));
        }
        if height == 0 || width == 0 {
            return Err(Error::Frame(format!(
                "the image is empty ({width}×{height}); each side must be at least 1"
            )));
        }
        if depth.dim() != (height, width) {
            return Err(Error::Frame(format!(
                "colour is {width}×{height} and depth {}×{}; they must be alike",
                depth.dim().1,
                depth.dim().0
            )));
        }
        for (what, bad) in [
            ("colour", rgb.iter().find(|v| !(0.0..=1.0).contains(*v))),
            ("depth", depth.iter().find(|v| !(0.0..=1.0).contains(*v))),
        ] {
            if let Some(value) = bad {
                return Err(Error::Frame(format!(
                    "{what} holds {value}; every value must lie in 0..=1"
                )));
            }
        }
        // Copied only where values do not lie row by row already.
        Ok(RgbdFrame {
            rgb: match rgb.is_standard_layout() {
                true => rgb,
                false => rgb.as_standard_layout().into_owned(),
            },
            depth: match depth.is_standard_layout() {
                true => depth,
                false => depth.as_standard_layout().into_owned(),
            },
        })
    }

    /// A black frame at the far end of the volume.
    pub(crate) fn black((height, width): (usize, usize)) -> Self {
        RgbdFrame {
            rgb: Array3::zeros((3, height, width)),
            depth: Array2::ones((height, width)),
        }
    }

    /// Colour and depth to write into; what is written must be in \[0, 1].
    pub(crate) fn planes_mut(&mut self) -> (&mut [f32], &mut [f32]) {
        let planes = self.rgb.as_slice_mut().zip(self.depth.as_slice_mut());
        planes.expect("both are made in standard layout")
    }

    /// (H, W).
    pub fn shape(&self) -> (usize, usize) {
        self.depth.dim()
    }

    /// The amplitudes, (3, H, W), contiguous.
    pub fn rgb(&self) -> ArrayView3<'_, f32> {
        self.rgb.view()
    }

    /// The normalized depth, (H, W), contiguous.
    pub fn depth(&self) -> ArrayView2<'_, f32> {
        self.depth.view()
    }

    /// The amplitudes and the normalized depth as they lie in memory.
    pub(crate) fn values(&self) -> (&[f32], &[f32]) {
        let contiguous = "standard layout";
        (
            self.rgb.as_slice().expect(contiguous),
            self.depth.as_slice().expect(contiguous),
        )
    }

    /// # Errors
    /// Another shape than a plan's.
    pub(crate) fn check_shape(&self, plan: (usize, usize)) -> Result<()> {
        let (height, width) = self.shape();
        if (height, width) != plan {
            return Err(Error::Frame(format!(
                "the frame is {width}×{height}; this plan takes {}×{}",
                plan.1, plan.0
            )));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn message(rgb: Array3<f32>, depth: Array2<f32>) -> String {
        RgbdFrame::new(rgb, depth).unwrap_err().to_string()
    }

    #[test]
    fn unusable_frames_are_named() {
        let rgb = || Array3::zeros((3, 2, 4));
        let depth = || Array2::zeros((2, 4));
        assert!(message(Array3::zeros((4, 2, 4)), depth()).contains("4 planes"));
        assert!(message(Array3::zeros((3, 0, 4)), Array2::zeros((0, 4))).contains("empty"));
        assert!(message(rgb(), Array2::zeros((4, 2))).contains("4×2 and depth 2×4"));
        for bad in [f32::NAN, f32::INFINITY, -0.1, 1.1] {
            assert!(message(rgb(), depth() + bad).starts_with("frame: depth"));
            assert!(message(rgb() + bad, depth()).starts_with("frame: colour"));
        }
    }
}
