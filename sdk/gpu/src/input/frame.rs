//! A borrowed captured frame, in camera formats or as planes.

use ndarray::{Array2, Array3};
use phasefront_core::Size;
use phasefront_core::depth::condition::ConditionedReadings;
use phasefront_core::frame::{ColourFormat, ColourImage, ColourPlan, LightConstants, Orientation, RgbdFrame};

/// The format of colour images.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Colour {
    /// Three planes of f32 in \[0, 1] of the frame's size, as in an [`RgbdFrame`].
    Planar,
    /// Camera images, which are turned upright, cropped and resized to the frame.
    Camera {
        /// The memory layout. Strides may differ between images.
        format: ColourFormat,
        /// The size in the sensor's orientation.
        size: Size,
        /// The orientation that makes the images upright.
        orientation: Orientation,
        /// The conversion of their colours to amplitudes.
        light: LightConstants,
    },
}

/// The format of normalized depth, from 0 (nearest) to 1 (farthest), without holes: one plane of the frame's size, or
/// conditioned readings of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Depth {
    /// f32 in \[0, 1].
    F32,
    /// u16, where 65535 represents 1.
    U16,
    /// Conditioned readings, from which the GPU decides the depth of each pixel. It remembers its choices from frame to
    /// frame.
    Readings(
        /// The size in the sensor's orientation.
        Size,
    ),
}

/// The colour of a frame in the planned [`Colour`] format.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum ColourData<'a> {
    /// (3, H, W).
    Planar(&'a [f32]),
    /// A camera image.
    Camera(ColourImage<'a>),
}

/// The depth of a frame in the planned [`Depth`] format.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum DepthData<'a> {
    /// f32 in \[0, 1], (H, W).
    F32(&'a [f32]),
    /// u16, where 65535 represents 1, (H, W).
    U16(&'a [u16]),
    /// Conditioned readings.
    Readings(ConditionedReadings<'a>),
}

/// A borrowed frame.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// The colour.
    pub colour: ColourData<'a>,
    /// The depth.
    pub depth: DepthData<'a>,
}

impl<'a> Frame<'a> {
    /// Borrows a planar frame.
    pub fn of(frame: &'a RgbdFrame) -> Self {
        Frame {
            colour: ColourData::Planar(frame.rgb().to_slice().expect("contiguous")),
            depth: DepthData::F32(frame.depth().to_slice().expect("contiguous")),
        }
    }

    /// Converts the frame to `size` on the CPU, as the input stage does. `orientation` applies to a camera
    /// image.
    ///
    /// # Errors
    /// Returns [`phasefront_core::runtime::error::Error::Frame`] if the data has another size or invalid values.
    pub fn read(&self, orientation: Orientation, size: Size) -> phasefront_core::runtime::error::Result<RgbdFrame> {
        let Size { width, height } = size;
        let rgb = match &self.colour {
            ColourData::Planar(values) => values.to_vec(),
            ColourData::Camera(image) => {
                let plan = ColourPlan::new(image, orientation, size)?;
                let mut rgb = vec![0.0; 3 * height * width];
                plan.convert(image, &mut rgb, &mut plan.scratch())?;
                rgb
            }
        };
        let depth = match self.depth {
            DepthData::F32(values) => values.to_vec(),
            DepthData::U16(words) => words.iter().map(|&w| f32::from(w) / 65535.0).collect(),
            DepthData::Readings(_) => {
                return Err(phasefront_core::runtime::error::Error::Frame(
                    "depth is readings, which the stage that conditioned them decides".into(),
                ));
            }
        };
        let wrong = |what: &str, is: usize| {
            phasefront_core::runtime::error::Error::Frame(format!(
                "{what} has {is} values; the frame is {width}×{height}"
            ))
        };
        let (colours, depths) = (rgb.len(), depth.len());
        RgbdFrame::new(
            Array3::from_shape_vec((3, height, width), rgb).map_err(|_| wrong("colour", colours))?,
            Array2::from_shape_vec((height, width), depth).map_err(|_| wrong("depth", depths))?,
        )
    }
}
