//! Camera input: a [`CameraFrame`] joins a [`ColourImage`] and a [`DepthImage`], which borrow the camera's memory.

pub use phasefront_core::depth::align::{Cameras, Intrinsics};
pub use phasefront_core::depth::camera::{Alignment, CameraFrame};
pub use phasefront_core::depth::image::{ConfidenceFormat, DepthFormat, DepthImage};
pub use phasefront_core::depth::range::DepthRange;
pub use phasefront_core::depth::stream::DepthOptions;
#[cfg(feature = "tract")]
pub use phasefront_core::depth_network::{ColourScale, DepthNetwork};
pub use phasefront_core::frame::encoding::RgbEncoding;
pub use phasefront_core::frame::{ColourFormat, ColourImage, Orientation, Plane, Rotation, YuvEncoding, YuvMatrix};
