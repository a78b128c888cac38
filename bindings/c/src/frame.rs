//! Camera frames: what lies where in memory.

use crate::pointer::{bytes, pick, read};
use crate::status::Result;
use phasefront_ffi::{
    Cameras, ColourFormat, ColourInfo, ConfidenceFormat, ConfidenceInfo, DepthFormat, DepthInfo, FrameInfo, Intrinsics,
    Orientation, PlaneInfo, Pose, Rotation, YuvMatrix,
};

/// How a colour image lies in memory.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfColourFormat {
    /// One plane; bytes red, green, blue, alpha (which is not looked at).
    Rgba = 0,
    /// One plane; bytes blue, green, red, alpha (which is not looked at).
    Bgra = 1,
    /// One plane; bytes red, green, blue.
    Rgb = 2,
    /// Two planes: luma; and at half the resolution blue and red chroma side by side.
    Nv12 = 3,
    /// Three planes: luma, and at half the resolution blue chroma (U) and red chroma (V). Android's YUV_420_888.
    Yuv420 = 4,
}

const COLOUR_FORMATS: [ColourFormat; 5] = [
    ColourFormat::Rgba,
    ColourFormat::Bgra,
    ColourFormat::Rgb,
    ColourFormat::Nv12,
    ColourFormat::Yuv420,
];

/// The matrix between luma, chroma and colour.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfYuvMatrix {
    /// ITU-R BT.601: standard definition, JPEG, most Android cameras.
    Bt601 = 0,
    /// ITU-R BT.709: high definition.
    Bt709 = 1,
}

const YUV_MATRICES: [YuvMatrix; 2] = [YuvMatrix::Bt601, YuvMatrix::Bt709];

/// How a depth image lies in memory. But for the normalized ones, 0, negative numbers and what is not finite mean no
/// reading.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfDepthFormat {
    /// Metres, 32-bit floats.
    MetresF32 = 0,
    /// Metres, 16-bit floats.
    MetresF16 = 1,
    /// Inverse metres, 32-bit floats.
    DisparityF32 = 2,
    /// Inverse metres, 16-bit floats.
    DisparityF16 = 3,
    /// Millimetres, all 16 bits.
    MillimetresU16 = 4,
    /// Android's DEPTH16: millimetres in the lower 13 bits, a confidence in the upper 3.
    AndroidDepth16 = 5,
    /// 0 nearest to 255 farthest; every pixel is a reading.
    NormalizedU8 = 6,
    /// 0 nearest to 65535 farthest; every pixel is a reading.
    NormalizedU16 = 7,
}

const DEPTH_FORMATS: [DepthFormat; 8] = [
    DepthFormat::MetresF32,
    DepthFormat::MetresF16,
    DepthFormat::DisparityF32,
    DepthFormat::DisparityF16,
    DepthFormat::MillimetresU16,
    DepthFormat::AndroidDepth16,
    DepthFormat::NormalizedU8,
    DepthFormat::NormalizedU16,
];

/// How a confidence map lies in memory.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfConfidenceFormat {
    /// 0 low, 1 medium, 2 high: ARKit's ARConfidenceLevel.
    LowMediumHigh = 0,
    /// 0 none to 255 full: ARCore's acquireRawDepthConfidenceImage.
    U8 = 1,
}

const CONFIDENCE_FORMATS: [ConfidenceFormat; 2] = [ConfidenceFormat::LowMediumHigh, ConfidenceFormat::U8];

/// How far a sensor's picture must be turned clockwise to stand upright.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfRotation {
    /// Not at all.
    Upright = 0,
    /// A quarter turn.
    Clockwise90 = 1,
    /// Half a turn.
    Half = 2,
    /// Three quarters.
    Clockwise270 = 3,
}

const ROTATIONS: [Rotation; 4] = [
    Rotation::Upright,
    Rotation::Clockwise90,
    Rotation::Half,
    Rotation::Clockwise270,
];

/// One plane of an image.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfPlane {
    /// Its first byte; NULL where there is no such plane.
    pub data: *const u8,
    /// Bytes from there to its end.
    pub length: usize,
    /// Bytes from one row to the next.
    pub row_stride: u32,
    /// Bytes from one pixel to the next in a row.
    pub pixel_stride: u32,
}

/// A colour image.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfColour {
    /// How it lies in memory: a PfColourFormat.
    pub format: u32,
    /// Pixels along x, as the sensor gives them.
    pub width: u32,
    /// Pixels along y.
    pub height: u32,
    /// A PfYuvMatrix; only formats of luma and chroma look at it.
    pub matrix: u32,
    /// Whether luma runs over 16 to 235 and chroma over 16 to 240, not both over 0 to 255; the same.
    pub video_range: bool,
    /// Its planes, in the format's order.
    pub planes: [PfPlane; 3],
}

/// A depth image.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfDepth {
    /// How it lies in memory: a PfDepthFormat.
    pub format: u32,
    /// Pixels along x, as the sensor gives them.
    pub width: u32,
    /// Pixels along y.
    pub height: u32,
    /// Its plane.
    pub plane: PfPlane,
}

/// The confidence map of a depth image.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfConfidence {
    /// How it lies in memory: a PfConfidenceFormat.
    pub format: u32,
    /// Pixels along x: as many as the depth has.
    pub width: u32,
    /// Pixels along y: as many as the depth has.
    pub height: u32,
    /// Its plane; without data there is no map.
    pub plane: PfPlane,
}

/// The pinhole model of a camera, in pixels of its image before it is turned upright. The middle of the first pixel is
/// (0, 0).
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfIntrinsics {
    /// Focal length along x.
    pub fx: f64,
    /// Focal length along y.
    pub fy: f64,
    /// x of the principal point.
    pub cx: f64,
    /// y of the principal point.
    pub cy: f64,
}

/// How the depth camera and the colour camera stand to each other: a point p of the depth camera (x right, y down, z
/// forward) is at R*p + t for the colour camera.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfCameras {
    /// Of the colour image.
    pub colour: PfIntrinsics,
    /// Of the depth image.
    pub depth: PfIntrinsics,
    /// R, row by row; 1, 0, 0, 0, 1, 0, 0, 0, 1 for cameras that look one way.
    pub rotation: [f64; 9],
    /// t, metres.
    pub translation_m: [f64; 3],
}

/// A frame: colour, depth, and how they belong together. Start from zeros.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfFrame {
    /// When it was taken, in nanoseconds of any clock that runs forward.
    pub timestamp_ns: u64,
    /// The colour image.
    pub colour: PfColour,
    /// The depth image.
    pub depth: PfDepth,
    /// The confidence map of the depth.
    pub confidence: PfConfidence,
    /// How all must be turned to stand upright: a PfRotation.
    pub rotation: u32,
    /// Whether left and right are exchanged after the turn, as front cameras need.
    pub mirrored: bool,
    /// NULL where depth and colour show the same field of view.
    pub cameras: *const PfCameras,
}

/// The memory of a frame, and what it is.
pub(crate) struct Taken<'a> {
    pub(crate) colour: [&'a [u8]; 3],
    pub(crate) depth: &'a [u8],
    pub(crate) confidence: &'a [u8],
    pub(crate) info: FrameInfo,
}

impl PfFrame {
    /// # Safety
    /// Its planes and cameras are NULL, or valid as long as `self`.
    pub(crate) unsafe fn take(&self) -> Result<Taken<'_>> {
        // SAFETY: the caller's promise, here and below.
        let memory = |plane: &PfPlane, name: &str| unsafe { bytes(plane.data, plane.length, name) };
        let [luma, chroma, chroma_v] = &self.colour.planes;
        let planes = (self.colour.planes.iter()).take_while(|plane| !plane.data.is_null());
        let confidence = match self.confidence.plane.data.is_null() {
            true => None,
            false => Some(self.confidence.info()?),
        };
        let cameras = match self.cameras.is_null() {
            true => None,
            // SAFETY: as above.
            false => Some(unsafe { read(self.cameras, "cameras") }?.into()),
        };
        Ok(Taken {
            colour: [
                memory(luma, "colour.planes[0].data")?,
                memory(chroma, "colour.planes[1].data")?,
                memory(chroma_v, "colour.planes[2].data")?,
            ],
            depth: memory(&self.depth.plane, "depth.plane.data")?,
            confidence: memory(&self.confidence.plane, "confidence.plane.data")?,
            info: FrameInfo {
                timestamp_ns: self.timestamp_ns,
                colour: ColourInfo {
                    format: pick(&COLOUR_FORMATS, self.colour.format, "colour.format")?,
                    width: self.colour.width,
                    height: self.colour.height,
                    planes: planes.map(PlaneInfo::from).collect(),
                    matrix: pick(&YUV_MATRICES, self.colour.matrix, "colour.matrix")?,
                    video_range: self.colour.video_range,
                },
                depth: DepthInfo {
                    format: pick(&DEPTH_FORMATS, self.depth.format, "depth.format")?,
                    width: self.depth.width,
                    height: self.depth.height,
                    plane: (&self.depth.plane).into(),
                },
                confidence,
                orientation: Orientation {
                    rotation: pick(&ROTATIONS, self.rotation, "rotation")?,
                    mirrored: self.mirrored,
                },
                cameras,
            },
        })
    }
}

impl PfConfidence {
    fn info(&self) -> Result<ConfidenceInfo> {
        Ok(ConfidenceInfo {
            format: pick(&CONFIDENCE_FORMATS, self.format, "confidence.format")?,
            width: self.width,
            height: self.height,
            plane: (&self.plane).into(),
        })
    }
}

impl From<&PfPlane> for PlaneInfo {
    fn from(plane: &PfPlane) -> Self {
        PlaneInfo {
            row_stride: plane.row_stride,
            pixel_stride: plane.pixel_stride,
        }
    }
}

impl From<PfIntrinsics> for Intrinsics {
    fn from(PfIntrinsics { fx, fy, cx, cy }: PfIntrinsics) -> Self {
        Intrinsics { fx, fy, cx, cy }
    }
}

impl From<&PfCameras> for Cameras {
    fn from(cameras: &PfCameras) -> Self {
        Cameras {
            colour: cameras.colour.into(),
            depth: cameras.depth.into(),
            pose: Some(Pose {
                rotation: cameras.rotation.to_vec(),
                translation_m: cameras.translation_m.to_vec(),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Debug;

    /// What C calls a number is what it is here.
    fn same(ours: &[&dyn Debug], theirs: &[&dyn Debug]) {
        let names = |all: &[&dyn Debug]| all.iter().map(|one| format!("{one:?}")).collect::<Vec<_>>();
        assert_eq!(names(ours), names(theirs));
    }

    #[test]
    fn numbers_mean_the_same_on_both_sides() {
        use PfColourFormat as C;
        use PfDepthFormat as D;
        let of = |all: &[u32]| assert!(all.iter().enumerate().all(|(at, number)| at == *number as usize));
        let colours = [C::Rgba, C::Bgra, C::Rgb, C::Nv12, C::Yuv420];
        of(&colours.map(|c| c as u32));
        same(
            &colours.each_ref().map(|c| c as _),
            &COLOUR_FORMATS.each_ref().map(|c| c as _),
        );
        let depths = [
            D::MetresF32,
            D::MetresF16,
            D::DisparityF32,
            D::DisparityF16,
            D::MillimetresU16,
            D::AndroidDepth16,
            D::NormalizedU8,
            D::NormalizedU16,
        ];
        of(&depths.map(|d| d as u32));
        same(
            &depths.each_ref().map(|d| d as _),
            &DEPTH_FORMATS.each_ref().map(|d| d as _),
        );
        let turns = [
            PfRotation::Upright,
            PfRotation::Clockwise90,
            PfRotation::Half,
            PfRotation::Clockwise270,
        ];
        of(&turns.map(|t| t as u32));
        same(&turns.each_ref().map(|t| t as _), &ROTATIONS.each_ref().map(|t| t as _));
        same(
            &[&PfYuvMatrix::Bt601, &PfYuvMatrix::Bt709],
            &YUV_MATRICES.each_ref().map(|m| m as _),
        );
        same(
            &[&PfConfidenceFormat::LowMediumHigh, &PfConfidenceFormat::U8],
            &CONFIDENCE_FORMATS.each_ref().map(|c| c as _),
        );
    }
}
