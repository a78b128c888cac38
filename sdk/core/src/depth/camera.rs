//! What a camera gives at one moment: colour, depth, and how they belong together.

use super::align::Cameras;
use super::image::DepthImage;
use crate::frame::{ColourImage, Orientation};
use crate::runtime::error::{Error, Result};

/// How far the aspect ratios of aligned colour and depth may lie apart, relative.
const ASPECT_TOLERANCE: f64 = 0.02;

/// How the pixels of depth and colour correspond.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Alignment {
    /// Both show the same field of view, whatever their resolutions.
    #[default]
    Aligned,
    /// By two cameras; each reading is taken to where the colour camera sees it.
    Cameras(Cameras),
}

/// Colour and depth of one moment, borrowed.
#[derive(Debug, Clone, Copy)]
pub struct CameraFrame<'a> {
    /// When it was taken, in nanoseconds of any clock that runs forward.
    pub timestamp_ns: u64,
    /// The colour image.
    pub colour: ColourImage<'a>,
    /// The depth image.
    pub depth: DepthImage<'a>,
    /// How both must be turned to stand upright.
    pub orientation: Orientation,
    /// How their pixels correspond.
    pub alignment: Alignment,
}

impl<'a> CameraFrame<'a> {
    /// A frame of aligned images that stand upright.
    pub fn new(timestamp_ns: u64, colour: ColourImage<'a>, depth: DepthImage<'a>) -> Self {
        CameraFrame {
            timestamp_ns,
            colour,
            depth,
            orientation: Orientation::default(),
            alignment: Alignment::Aligned,
        }
    }

    /// Checks that colour and depth belong together.
    ///
    /// # Errors
    /// [`Error::Frame`]: aligned images of other aspect ratios, cameras that cannot be, or cameras with normalized
    /// depth, which has no metres to project.
    pub fn check(&self) -> Result<()> {
        let ((height, width), (depth_height, depth_width)) = (self.colour.shape(), self.depth.shape());
        match self.alignment {
            Alignment::Aligned => {
                let ratio = (width * depth_height) as f64 / (height * depth_width) as f64;
                // A pixel more or less of a small image is no other field of view.
                let rounding = 1.0 / depth_height.min(depth_width) as f64;
                match (ratio - 1.0).abs() <= ASPECT_TOLERANCE.max(rounding) {
                    true => Ok(()),
                    false => Err(Error::Frame(format!(
                        "depth is {depth_width}×{depth_height}, colour {width}×{height}: their aspect ratios differ, so they do not show the same field of view; give the intrinsics of both cameras"
                    ))),
                }
            }
            Alignment::Cameras(cameras) => {
                cameras.check()?;
                match self.depth.format().is_metric() {
                    true => Ok(()),
                    false => Err(Error::Frame(format!(
                        "depth is {:?}, which has no metres to take to the colour camera; depth in metres, millimetres or disparity is needed",
                        self.depth.format()
                    ))),
                }
            }
        }
    }
}
