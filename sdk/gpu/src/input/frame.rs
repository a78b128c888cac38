//! A captured frame: borrowed, in the formats of cameras or as planes.

use ndarray::{Array2, Array3};
use phasefront_core::frame::{ColourFormat, ColourImage, ColourPlan, Orientation, RgbdFrame};

/// How colour comes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Colour {
    /// Three planes of f32 in \[0, 1] of the frame's size: an [`RgbdFrame`]'s.
    Planar,
    /// Images of a camera, which are turned upright, cropped and resized to the frame.
    Camera {
        /// How they lie in memory. Strides may differ from image to image.
        format: ColourFormat,
        /// Rows of the sensor.
        height: usize,
        /// Columns of the sensor.
        width: usize,
        /// How they become upright.
        orientation: Orientation,
    },
}

/// How normalized depth comes: one plane of the frame's size, 0 nearest, 1 farthest, without holes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Depth {
    /// f32 in \[0, 1].
    F32,
    /// 65535 is 1.
    U16,
}

/// Colour of a frame, as planned by [`Colour`].
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum ColourData<'a> {
    /// (3, H, W).
    Planar(&'a [f32]),
    /// A camera's image.
    Camera(ColourImage<'a>),
}

/// Depth of a frame, (H, W), as planned by [`Depth`].
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum DepthData<'a> {
    /// f32 in \[0, 1].
    F32(&'a [f32]),
    /// 65535 is 1.
    U16(&'a [u16]),
}

/// A frame, borrowed.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// Its colour.
    pub colour: ColourData<'a>,
    /// Its depth.
    pub depth: DepthData<'a>,
}

impl<'a> Frame<'a> {
    /// A planar frame.
    pub fn of(frame: &'a RgbdFrame) -> Self {
        Frame {
            colour: ColourData::Planar(frame.rgb().to_slice().expect("contiguous")),
            depth: DepthData::F32(frame.depth().to_slice().expect("contiguous")),
        }
    }

    /// The same frame on the CPU, (`height`, `width`): the twin of the input stage. `orientation` is that of a
    /// camera's image.
    ///
    /// # Errors
    /// [`phasefront_core::runtime::error::Error::Frame`] for data of another size, or values that no frame has.
    pub fn read(
        &self,
        orientation: Orientation,
        height: usize,
        width: usize,
    ) -> phasefront_core::runtime::error::Result<RgbdFrame> {
        let rgb = match &self.colour {
            ColourData::Planar(values) => values.to_vec(),
            ColourData::Camera(image) => {
                let plan = ColourPlan::new(image, orientation, height, width)?;
                let mut rgb = vec![0.0; 3 * height * width];
                plan.convert(image, &mut rgb, &mut plan.scratch())?;
                rgb
            }
        };
        let depth = match self.depth {
            DepthData::F32(values) => values.to_vec(),
            DepthData::U16(words) => words.iter().map(|&w| f32::from(w) / 65535.0).collect(),
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
