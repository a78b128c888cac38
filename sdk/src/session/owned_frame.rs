//! A copy of a camera frame in the session's own memory, which a live session keeps when the camera reclaims its
//! buffer.

use phasefront_core::Size;
use phasefront_core::depth::camera::{Alignment, CameraFrame};
use phasefront_core::depth::image::{ConfidenceFormat, DepthFormat, DepthImage};
use phasefront_core::frame::{ColourFormat, ColourImage, Orientation, Plane, RgbEncoding};
use phasefront_core::runtime::error::Result;

/// The memory and strides of one plane.
#[derive(Debug, Default)]
struct OwnedPlane {
    bytes: Vec<u8>,
    row_stride: usize,
    pixel_stride: usize,
}

impl OwnedPlane {
    fn copy(&mut self, plane: &Plane<'_>) {
        self.bytes.clear();
        self.bytes.extend_from_slice(plane.bytes);
        self.row_stride = plane.row_stride;
        self.pixel_stride = plane.pixel_stride;
    }

    fn plane(&self) -> Plane<'_> {
        Plane::new(&self.bytes, self.row_stride, self.pixel_stride)
    }
}

/// The properties of a frame other than its planes.
#[derive(Debug)]
struct Description {
    timestamp_ns: u64,
    colour: (ColourFormat, Size),
    encoding: RgbEncoding,
    depth: Option<(DepthFormat, Size)>,
    confidence: Option<ConfidenceFormat>,
    orientation: Orientation,
    alignment: Alignment,
}

/// A copied frame, whose memory is reused for the next.
#[derive(Debug)]
pub(super) struct OwnedFrame {
    description: Description,
    colour: [OwnedPlane; 3],
    depth: OwnedPlane,
    confidence: OwnedPlane,
}

impl OwnedFrame {
    /// Copies `frame`, into the memory of an earlier one if available.
    pub(super) fn copy(frame: &CameraFrame<'_>, spare: Option<OwnedFrame>) -> Self {
        let description = Description {
            timestamp_ns: frame.timestamp_ns,
            colour: (frame.colour.format(), frame.colour.size()),
            encoding: frame.colour.encoding(),
            depth: frame.depth.map(|depth| (depth.format(), depth.size())),
            confidence: frame
                .depth
                .and_then(|depth| depth.confidence())
                .map(|(format, _)| format),
            orientation: frame.orientation,
            alignment: frame.alignment,
        };
        let mut copy = match spare {
            Some(spare) => OwnedFrame { description, ..spare },
            None => OwnedFrame {
                description,
                colour: Default::default(),
                depth: OwnedPlane::default(),
                confidence: OwnedPlane::default(),
            },
        };
        for (to, plane) in copy.colour.iter_mut().zip(frame.colour.planes()) {
            to.copy(plane);
        }
        if let Some(depth) = &frame.depth {
            copy.depth.copy(&depth.plane());
            if let Some((_, plane)) = depth.confidence() {
                copy.confidence.copy(&plane);
            }
        }
        copy
    }

    /// Returns the frame, borrowed from this copy.
    ///
    /// # Errors
    /// Returns an error only if the original frame was invalid.
    pub(super) fn frame(&self) -> Result<CameraFrame<'_>> {
        let d = &self.description;
        let (format, size) = d.colour;
        let planes: [Plane<'_>; 3] = std::array::from_fn(|i| self.colour[i].plane());
        let colour = ColourImage::new(format, size, &planes[..format.planes()])?;
        let colour = colour.with_encoding(d.encoding);
        let depth = match d.depth {
            Some((format, size)) => {
                let depth = DepthImage::new(format, size, self.depth.plane())?;
                Some(match d.confidence {
                    Some(format) => depth.with_confidence(format, size, self.confidence.plane())?,
                    None => depth,
                })
            }
            None => None,
        };
        Ok(CameraFrame {
            timestamp_ns: d.timestamp_ns,
            colour,
            depth,
            orientation: d.orientation,
            alignment: d.alignment,
        })
    }
}
