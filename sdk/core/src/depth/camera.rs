//! Camera frames: the colour and depth of one moment, and their alignment.

use super::align::Cameras;
use super::image::DepthImage;
use crate::frame::{ColourImage, Orientation};
use crate::runtime::error::{Error, Result};

/// The largest relative difference between the aspect ratios of aligned colour and depth.
const ASPECT_TOLERANCE: f64 = 0.02;

/// The correspondence between the pixels of depth and colour.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Alignment {
    /// Both images have the same field of view; their resolutions may differ.
    #[default]
    Aligned,
    /// The images come from two cameras. Each reading is projected to the colour camera.
    Cameras(Cameras),
}

/// The borrowed colour and depth of one moment.
#[derive(Debug, Clone, Copy)]
pub struct CameraFrame<'a> {
    /// The time of capture, in nanoseconds of any clock that runs forward.
    pub timestamp_ns: u64,
    /// The colour image.
    pub colour: ColourImage<'a>,
    /// The depth image. Without one, a session needs a depth network.
    pub depth: Option<DepthImage<'a>>,
    /// The rotation and mirroring that turn both images upright.
    pub orientation: Orientation,
    /// The correspondence between their pixels.
    pub alignment: Alignment,
}

impl<'a> CameraFrame<'a> {
    /// Creates a frame of aligned, upright images.
    pub fn new(timestamp_ns: u64, colour: ColourImage<'a>, depth: DepthImage<'a>) -> Self {
        CameraFrame {
            depth: Some(depth),
            ..CameraFrame::without_depth(timestamp_ns, colour)
        }
    }

    /// Creates a frame of an upright image without depth.
    pub fn without_depth(timestamp_ns: u64, colour: ColourImage<'a>) -> Self {
        CameraFrame {
            timestamp_ns,
            colour,
            depth: None,
            orientation: Orientation::default(),
            alignment: Alignment::Aligned,
        }
    }

    /// Checks that colour and depth match.
    ///
    /// # Errors
    /// Returns [`Error::Frame`] if the aspect ratios of aligned images differ, if the cameras are invalid, or if
    /// cameras are given for depth that has no metres to project.
    pub fn check(&self) -> Result<()> {
        let Some(depth) = &self.depth else {
            return Ok(());
        };
        let (colour, size) = (self.colour.size(), depth.size());
        match self.alignment {
            Alignment::Aligned => {
                let ratio = (colour.width * size.height) as f64 / (colour.height * size.width) as f64;
                // A rounding difference of one pixel in a small image does not change the field of view.
                let rounding = 1.0 / size.height.min(size.width) as f64;
                match (ratio - 1.0).abs() <= ASPECT_TOLERANCE.max(rounding) {
                    true => Ok(()),
                    false => Err(Error::Frame(format!(
                        "depth is {size}, colour {colour}: their aspect ratios differ, so they do not show the same field of view; give the intrinsics of both cameras"
                    ))),
                }
            }
            Alignment::Cameras(cameras) => {
                cameras.check()?;
                match depth.format().is_metric() {
                    true => Ok(()),
                    false => Err(Error::Frame(format!(
                        "depth is {:?}, which has no metres to take to the colour camera; depth in metres, millimetres or disparity is needed",
                        depth.format()
                    ))),
                }
            }
        }
    }
}
