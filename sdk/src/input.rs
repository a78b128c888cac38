//! What cameras give: a [`CameraFrame`] joins a [`ColourImage`] and a [`DepthImage`], each borrowed as it lies in the
//! camera's memory.

pub use crate::depth::align::{Cameras, Intrinsics};
pub use crate::depth::camera::{Alignment, CameraFrame};
pub use crate::depth::image::{ConfidenceFormat, DepthFormat, DepthImage};
pub use crate::depth::range::DepthRange;
pub use crate::depth::stream::DepthOptions;
pub use crate::frame::{ColourFormat, ColourImage, Orientation, Plane, Rotation, YuvEncoding, YuvMatrix};
