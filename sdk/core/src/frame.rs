//! RGB-D frames in the form that the optics and the networks read (planar amplitudes and normalized depth), and the
//! camera images that are converted to them.
//!
//! [`crate::depth`] converts metres, disparity or raw units to normalized depth.

mod colour;
mod convert;
pub mod encoding;
mod light;
mod past;
mod plane;
pub mod reference;
mod resample;

use crate::Size;
pub use colour::{ColourFormat, ColourImage, MAX_SOURCE_PIXELS, YuvEncoding, YuvMatrix, check_size};

pub use encoding::RgbEncoding;
pub use light::{LightConstants, LightPlan, light_to_srgb};

pub use convert::{ColourPlan, ColourScratch, luminance, yuv_constants};
pub use past::Past;
pub use plane::{Orientation, Plane, Rotation, View};

pub use resample::{Axis, Crop};

use crate::display::Display;
use crate::runtime::error::{Error, Result};
use ndarray::{Array2, Array3, ArrayView2, ArrayView3};

/// A frame of colour and depth: amplitudes in \[0, 1], (C, H, W), and normalized depth, (H, W), 0 nearest, 1 farthest.
///
/// C is 3 for red, green and blue, or 1 for a display with one laser.
#[derive(Debug, Clone, PartialEq)]
pub struct RgbdFrame {
    rgb: Array3<f32>,
    depth: Array2<f32>,
}

impl RgbdFrame {
    /// Combines `rgb`, (C, H, W), and `depth`, (H, W).
    ///
    /// # Errors
    /// Returns an error if the shapes do not match, the frame is empty, or a value is not finite or lies outside \[0,
    /// 1].
    pub fn new(rgb: Array3<f32>, depth: Array2<f32>) -> Result<Self> {
        let (channels, height, width) = rgb.dim();
        if ![1, 3].contains(&channels) {
            return Err(Error::Frame(format!(
                "colour has {channels} planes; it must have 3, for red, green and blue, or 1"
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
        // Values already in row-major order are not copied.
        Ok(RgbdFrame {
            rgb: if rgb.is_standard_layout() {
                rgb
            } else {
                rgb.as_standard_layout().into_owned()
            },
            depth: if depth.is_standard_layout() {
                depth
            } else {
                depth.as_standard_layout().into_owned()
            },
        })
    }

    /// Converts the frame to the colours of `display`.
    ///
    /// For one laser, the amplitude becomes √Y, where Y is the luminance of the image. Light is the square of the
    /// amplitude, and Y = 0.2126·R + 0.7152·G + 0.0722·B (Rec. 709). For three lasers, a frame of one colour becomes
    /// grey.
    pub fn for_display(self, display: &Display) -> Self {
        let Size { width, height } = self.size();
        let rgb = match (self.colours(), display.colours()) {
            (3, 1) => {
                let mut amplitude = Array3::zeros((1, height, width));
                let planes = amplitude.as_slice_mut().zip(self.rgb.as_slice());
                let (amplitude_values, rgb) = planes.expect("both are made in standard layout");
                luminance(rgb, amplitude_values);
                amplitude
            }
            (1, 3) => Array3::from_shape_fn((3, height, width), |(_, y, x)| self.rgb[(0, y, x)]),
            _ => self.rgb,
        };
        RgbdFrame { rgb, depth: self.depth }
    }

    /// Converts a frame whose colours are encoded by `encoding` to amplitudes of the lasers of `display`
    /// ([`LightPlan`]); those of [`RgbEncoding::Amplitude`] as [`Self::for_display`].
    pub fn decoded(self, encoding: RgbEncoding, display: &Display) -> Self {
        let Some(plan) = LightPlan::new(encoding, display) else {
            return self.for_display(display);
        };
        let Size { width, height } = self.size();
        let rgb = self.rgb.broadcast((3, height, width)).expect("three colours or one");
        let rgb = rgb.as_standard_layout();
        let mut amplitude = Array3::zeros((display.colours(), height, width));
        let values = amplitude.as_slice_mut().zip(rgb.as_slice());
        let (amplitude_values, rgb) = values.expect("both are made in standard layout");
        plan.convert(rgb, amplitude_values);
        RgbdFrame {
            rgb: amplitude,
            depth: self.depth,
        }
    }

    /// Creates a black frame with `colours` colours at the far end of the volume.
    pub fn black(colours: usize, Size { width, height }: Size) -> Self {
        RgbdFrame {
            rgb: Array3::zeros((colours, height, width)),
            depth: Array2::ones((height, width)),
        }
    }

    /// Returns the colour and depth values for writing. Written values must lie in \[0, 1].
    #[doc(hidden)]
    pub fn planes_mut(&mut self) -> (&mut [f32], &mut [f32]) {
        let planes = self.rgb.as_slice_mut().zip(self.depth.as_slice_mut());
        planes.expect("both are made in standard layout")
    }

    /// Returns the size.
    pub fn size(&self) -> Size {
        Size::from_shape(self.depth.dim())
    }

    /// Returns the number of colours, C: 3 or 1.
    pub fn colours(&self) -> usize {
        self.rgb.dim().0
    }

    /// Returns the amplitudes, (C, H, W), contiguous.
    pub fn rgb(&self) -> ArrayView3<'_, f32> {
        self.rgb.view()
    }

    /// Returns the normalized depth, (H, W), contiguous.
    pub fn depth(&self) -> ArrayView2<'_, f32> {
        self.depth.view()
    }

    /// Returns the amplitudes and the normalized depth as slices in memory order.
    #[doc(hidden)]
    pub fn values(&self) -> (&[f32], &[f32]) {
        let contiguous = "standard layout";
        (
            self.rgb.as_slice().expect(contiguous),
            self.depth.as_slice().expect(contiguous),
        )
    }

    /// Checks that the frame has the size and the number of colours of a plan.
    ///
    /// # Errors
    /// Returns an error if the size or the number of colours differs.
    pub(crate) fn check(&self, plan: Size, colours: usize) -> Result<()> {
        let size = self.size();
        if size != plan {
            return Err(Error::Frame(format!("the frame is {size}; this plan takes {plan}")));
        }
        if self.colours() != colours {
            return Err(Error::Frame(format!(
                "the frame's colours are {}; this plan takes {colours}, as RgbdFrame::for_display gives them",
                self.colours()
            )));
        }
        Ok(())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Returns a textured wall and a ball before it whose centre is in column `x` of row 20, with noise of these
    /// amplitudes in colour and depth.
    pub(crate) fn scene(size: Size, x: usize, [of_colour, of_depth]: [f32; 2], seed: u32) -> RgbdFrame {
        let mut frame = RgbdFrame::black(3, size);
        let mut state = seed;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        let (rgb, depth) = frame.planes_mut();
        for (i, depth) in depth.iter_mut().enumerate() {
            let (row, column) = (i / size.width, i % size.width);
            let is_ball = column.abs_diff(x).pow(2) + row.abs_diff(20).pow(2) < 60;
            *depth = (if is_ball { 0.2 } else { 0.7 } + of_depth * noise()).clamp(0.0, 1.0);
            for (colour, rgb) in rgb.chunks_exact_mut(size.pixels()).enumerate() {
                let texture = (row * 3 + column * (2 + colour)) % 7;
                rgb[i] = (if is_ball { 0.9 } else { 0.1 * texture as f32 } + of_colour * noise()).clamp(0.0, 1.0);
            }
        }
        frame
    }

    fn message(rgb: Array3<f32>, depth: Array2<f32>) -> String {
        RgbdFrame::new(rgb, depth).unwrap_err().to_string()
    }

    #[test]
    fn one_laser_shows_the_luminance() {
        let one = Display::from_toml("wavelengths_nm = [532]").unwrap();
        let rgb = Array3::from_shape_fn((3, 2, 4), |(c, y, x)| (c * 8 + y * 4 + x) as f32 / 24.0);
        let depth = Array2::from_shape_fn((2, 4), |(y, x)| (y * 4 + x) as f32 / 8.0);
        let frame = RgbdFrame::new(rgb.clone(), depth).unwrap();
        let shown = frame.clone().for_display(&one);
        assert_eq!((shown.colours(), shown.depth()), (1, frame.depth()));
        for ((_, y, x), amplitude) in shown.rgb().indexed_iter() {
            let light = |c| f64::from(rgb[(c, y, x)]).powi(2);
            let luminance = 0.2126 * light(0) + 0.7152 * light(1) + 0.0722 * light(2);
            assert!((f64::from(*amplitude) - luminance.sqrt()).abs() < 1e-6);
        }
        assert_eq!(shown.clone().for_display(&one), shown);
        assert_eq!(frame.clone().for_display(&Display::default()), frame);
        let grey = shown.clone().for_display(&Display::default());
        assert!(
            grey.rgb()
                .outer_iter()
                .all(|plane| plane == shown.rgb().index_axis(ndarray::Axis(0), 0))
        );
        assert!(
            frame
                .check(Size { width: 4, height: 2 }, 1)
                .unwrap_err()
                .to_string()
                .contains("for_display")
        );
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
