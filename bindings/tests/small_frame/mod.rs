//! A small frame for sessions of its size: grey, RGB, at one depth.

use phasefront_ffi::{
    ColourFormat, ColourInfo, DepthFormat, DepthInfo, FrameInfo, Orientation, PhasefrontError, PlaneInfo, RawHologram,
    RawSession, RgbEncoding, Rotation, YuvMatrix,
};
use std::sync::Arc;

pub(crate) const W: usize = 32;
pub(crate) const H: usize = 24;

/// Makes the hologram of the frame.
pub(crate) fn process(session: &RawSession) -> Result<Arc<RawHologram>, PhasefrontError> {
    let plane = |pixel| PlaneInfo {
        row_stride: W * pixel,
        pixel_stride: pixel,
    };
    let info = FrameInfo {
        timestamp_ns: 1,
        colour: ColourInfo {
            format: ColourFormat::Rgb,
            width: W,
            height: H,
            planes: vec![plane(3)],
            matrix: YuvMatrix::Bt601,
            video_range: false,
            encoding: RgbEncoding::Amplitude,
        },
        depth: Some(DepthInfo {
            format: DepthFormat::NormalizedU8,
            width: W,
            height: H,
            plane: plane(1),
        }),
        confidence: None,
        orientation: Orientation {
            rotation: Rotation::Upright,
            mirrored: false,
        },
        cameras: None,
    };
    session.process(&[180; W * H * 3], &[], &[], &[90; W * H], &[], info)
}
