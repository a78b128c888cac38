//! Camera frames and their layout in memory.

use crate::pointer::{Extensible, bytes, pick, read};
use crate::status::Result;
use phasefront_ffi::{
    Cameras, ColourFormat, ColourInfo, ConfidenceFormat, ConfidenceInfo, DepthFormat, DepthInfo, FrameInfo, Intrinsics,
    Orientation, PlaneInfo, Pose, RgbEncoding, Rotation, YuvMatrix,
};

/// The memory layout of a colour image.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfColourFormat {
    /// One plane with the bytes red, green, blue, alpha. Alpha is ignored.
    Rgba = 0,
    /// One plane with the bytes blue, green, red, alpha. Alpha is ignored.
    Bgra = 1,
    /// One plane with the bytes red, green, blue.
    Rgb = 2,
    /// Two planes: luma, and interleaved blue and red chroma at half the resolution.
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

/// The matrix that converts luma and chroma to colour.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfYuvMatrix {
    /// ITU-R BT.601, for standard definition, JPEG and most Android cameras.
    Bt601 = 0,
    /// ITU-R BT.709, for high definition.
    Bt709 = 1,
    /// ITU-R BT.2020 with non-constant luminance, for films of high dynamic range.
    Bt2020 = 2,
}

const YUV_MATRICES: [YuvMatrix; 3] = [YuvMatrix::Bt601, YuvMatrix::Bt709, YuvMatrix::Bt2020];

/// The meaning of a picture's red, green and blue.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfRgbEncoding {
    /// sRGB, and BT.709 video, which screens show alike.
    Srgb = 0,
    /// Display P3, as phones take photographs and videos.
    DisplayP3 = 1,
    /// BT.2020 of standard dynamic range, with the curve of sRGB.
    Bt2020 = 2,
    /// BT.2020 with hybrid log-gamma.
    Bt2020Hlg = 3,
    /// BT.2020 with perceptual quantization.
    Bt2020Pq = 4,
    /// Amplitudes of the lasers, as in the paper and its data sets.
    Amplitude = 5,
}

const RGB_ENCODINGS: [RgbEncoding; 6] = RgbEncoding::ALL;

/// Returns the PfRgbEncoding of `encoding`.
pub(crate) fn encoding_number(encoding: RgbEncoding) -> u32 {
    let place = RGB_ENCODINGS.iter().position(|known| *known == encoding);
    place.expect("all encodings are listed") as u32
}

/// The memory layout of a depth image. In all formats except the normalized and the relative ones, 0, negative numbers,
/// NaN, numbers of 1e9 or more, the largest code of an integer format and the largest finite 16-bit float mean no
/// reading.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfDepthFormat {
    /// Metres as 32-bit floats.
    MetresF32 = 0,
    /// Metres as 16-bit floats.
    MetresF16 = 1,
    /// Inverse metres as 32-bit floats.
    DisparityF32 = 2,
    /// Inverse metres as 16-bit floats.
    DisparityF16 = 3,
    /// Millimetres in all 16 bits.
    MillimetresU16 = 4,
    /// Android's DEPTH16: millimetres in the lower 13 bits, and a confidence in the upper 3 bits.
    AndroidDepth16 = 5,
    /// Bytes from 0 nearest to 255 farthest. Every pixel is a reading.
    NormalizedU8 = 6,
    /// 16-bit numbers from 0 nearest to 65535 farthest. Every pixel is a reading.
    NormalizedU16 = 7,
    /// Relative inverse depth as 32-bit floats, as networks estimate it: larger where nearer, on any scale. NaN
    /// and numbers beyond 1e9 in magnitude mean no reading.
    RelativeF32 = 8,
    /// Relative inverse depth as 16-bit floats.
    RelativeF16 = 9,
}

const DEPTH_FORMATS: [DepthFormat; 10] = [
    DepthFormat::MetresF32,
    DepthFormat::MetresF16,
    DepthFormat::DisparityF32,
    DepthFormat::DisparityF16,
    DepthFormat::MillimetresU16,
    DepthFormat::AndroidDepth16,
    DepthFormat::NormalizedU8,
    DepthFormat::NormalizedU16,
    DepthFormat::RelativeF32,
    DepthFormat::RelativeF16,
];

/// The memory layout of a confidence map.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfConfidenceFormat {
    /// 0 low, 1 medium, 2 high, as in ARKit's ARConfidenceLevel.
    LowMediumHigh = 0,
    /// 0 none to 255 full, as in ARCore's acquireRawDepthConfidenceImage.
    U8 = 1,
}

const CONFIDENCE_FORMATS: [ConfidenceFormat; 2] = [ConfidenceFormat::LowMediumHigh, ConfidenceFormat::U8];

/// The clockwise rotation that turns a sensor's image upright.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfRotation {
    /// No rotation.
    Upright = 0,
    /// A quarter turn.
    Clockwise90 = 1,
    /// Half a turn.
    Half = 2,
    /// Three quarters of a turn.
    Clockwise270 = 3,
}

const ROTATIONS: [Rotation; 4] = [
    Rotation::Upright,
    Rotation::Clockwise90,
    Rotation::Half,
    Rotation::Clockwise270,
];

/// A plane of an image.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfPlane {
    /// The first byte; NULL if there is no such plane.
    pub data: *const u8,
    /// The number of bytes of the plane.
    pub length: usize,
    /// The number of bytes from one row to the next.
    pub row_stride: u32,
    /// The number of bytes from one pixel to the next in a row.
    pub pixel_stride: u32,
}

/// A colour image.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfColour {
    /// The memory layout, a PfColourFormat.
    pub format: u32,
    /// The width of the sensor's image, in pixels.
    pub width: u32,
    /// The height of the sensor's image, in pixels.
    pub height: u32,
    /// The matrix of luma and chroma, a PfYuvMatrix. Other formats ignore it.
    pub matrix: u32,
    /// Whether luma spans 16 to 235 and chroma 16 to 240 instead of 0 to 255 for both. Other formats ignore it.
    pub video_range: bool,
    /// The planes, in the format's order.
    pub planes: [PfPlane; 3],
}

/// A depth image.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfDepth {
    /// The memory layout, a PfDepthFormat.
    pub format: u32,
    /// The width of the sensor's image, in pixels.
    pub width: u32,
    /// The height of the sensor's image, in pixels.
    pub height: u32,
    /// The plane. Without data there is no depth, and the session's depth network estimates it.
    pub plane: PfPlane,
}

/// The confidence map of a depth image.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfConfidence {
    /// The memory layout, a PfConfidenceFormat.
    pub format: u32,
    /// The width in pixels, equal to the depth image's.
    pub width: u32,
    /// The height in pixels, equal to the depth image's.
    pub height: u32,
    /// The plane. Without data there is no map.
    pub plane: PfPlane,
}

/// The pinhole model of a camera, in pixels of its image before the image is turned upright. The middle of the first
/// pixel is (0, 0).
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfIntrinsics {
    /// The focal length along x.
    pub fx: f64,
    /// The focal length along y.
    pub fy: f64,
    /// The x of the principal point.
    pub cx: f64,
    /// The y of the principal point.
    pub cy: f64,
}

/// The intrinsics and the relative pose of the depth camera and the colour camera. A point p of the depth camera (x
/// right, y down, z forward) is at R*p + t of the colour camera.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfCameras {
    /// The intrinsics of the colour camera.
    pub colour: PfIntrinsics,
    /// The intrinsics of the depth camera.
    pub depth: PfIntrinsics,
    /// R, row by row; 1, 0, 0, 0, 1, 0, 0, 0, 1 for cameras with the same orientation.
    pub rotation: [f64; 9],
    /// t, in metres.
    pub translation_m: [f64; 3],
}

/// A frame: colour, depth, and their relation. Initialize it with its size and zeros:
/// `PfFrame frame = {sizeof frame};`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfFrame {
    /// The size of this struct, sizeof(PfFrame). Set it before the call.
    pub size: usize,
    /// The time at which the frame was taken, in nanoseconds of any clock that runs forward.
    pub timestamp_ns: u64,
    /// The colour image.
    pub colour: PfColour,
    /// The depth image.
    pub depth: PfDepth,
    /// The confidence map of the depth image.
    pub confidence: PfConfidence,
    /// The clockwise rotation that turns all images upright, a PfRotation.
    pub rotation: u32,
    /// Whether left and right are exchanged after the rotation, as front cameras need.
    pub mirrored: bool,
    /// The cameras; NULL if depth and colour have the same field of view.
    pub cameras: *const PfCameras,
    /// The meaning of the colours, a PfRgbEncoding.
    pub rgb_encoding: u32,
}

// SAFETY: its first field is its size.
unsafe impl Extensible for PfFrame {
    const NAME: &'static str = "PfFrame";
}

/// The memory and the description of a frame.
pub(crate) struct Taken<'a> {
    pub(crate) colour: [&'a [u8]; 3],
    pub(crate) depth: &'a [u8],
    pub(crate) confidence: &'a [u8],
    pub(crate) info: FrameInfo,
}

impl PfFrame {
    /// # Safety
    /// The planes and cameras are NULL, or valid as long as `self`.
    pub(crate) unsafe fn take(&self) -> Result<Taken<'_>> {
        // SAFETY: the caller's promise, here and below.
        let memory = |plane: &PfPlane, name: &str| unsafe { bytes(plane.data, plane.length, name) };
        let [luma, chroma, chroma_v] = &self.colour.planes;
        let planes = (self.colour.planes.iter()).take_while(|plane| !plane.data.is_null());
        let confidence = if self.confidence.plane.data.is_null() {
            None
        } else {
            Some(self.confidence.info()?)
        };
        let depth = if self.depth.plane.data.is_null() {
            None
        } else {
            Some(self.depth.info()?)
        };
        let cameras = if self.cameras.is_null() {
            None
        } else {
            // SAFETY: as above.
            Some(unsafe { read(self.cameras, "cameras") }?.into())
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
                timestamp_ns: i64::try_from(self.timestamp_ns).unwrap_or(i64::MAX),
                colour: ColourInfo {
                    format: pick(&COLOUR_FORMATS, self.colour.format, "colour.format")?,
                    width: self.colour.width as usize,
                    height: self.colour.height as usize,
                    planes: planes.map(PlaneInfo::from).collect(),
                    matrix: pick(&YUV_MATRICES, self.colour.matrix, "colour.matrix")?,
                    video_range: self.colour.video_range,
                    encoding: pick(&RGB_ENCODINGS, self.rgb_encoding, "rgb_encoding")?,
                },
                depth,
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

impl PfDepth {
    fn info(&self) -> Result<DepthInfo> {
        Ok(DepthInfo {
            format: pick(&DEPTH_FORMATS, self.format, "depth.format")?,
            width: self.width as usize,
            height: self.height as usize,
            plane: (&self.plane).into(),
        })
    }
}

impl PfConfidence {
    fn info(&self) -> Result<ConfidenceInfo> {
        Ok(ConfidenceInfo {
            format: pick(&CONFIDENCE_FORMATS, self.format, "confidence.format")?,
            width: self.width as usize,
            height: self.height as usize,
            plane: (&self.plane).into(),
        })
    }
}

impl From<&PfPlane> for PlaneInfo {
    fn from(plane: &PfPlane) -> Self {
        PlaneInfo {
            row_stride: plane.row_stride as usize,
            pixel_stride: plane.pixel_stride as usize,
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

    /// Checks that a number has the same name in C and here.
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
            D::RelativeF32,
            D::RelativeF16,
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
        let encodings = [
            PfRgbEncoding::Srgb,
            PfRgbEncoding::DisplayP3,
            PfRgbEncoding::Bt2020,
            PfRgbEncoding::Bt2020Hlg,
            PfRgbEncoding::Bt2020Pq,
            PfRgbEncoding::Amplitude,
        ];
        of(&encodings.map(|e| e as u32));
        same(
            &encodings.each_ref().map(|e| e as _),
            &RGB_ENCODINGS.each_ref().map(|e| e as _),
        );
        same(
            &[&PfYuvMatrix::Bt601, &PfYuvMatrix::Bt709, &PfYuvMatrix::Bt2020],
            &YUV_MATRICES.each_ref().map(|m| m as _),
        );
        same(
            &[&PfConfidenceFormat::LowMediumHigh, &PfConfidenceFormat::U8],
            &CONFIDENCE_FORMATS.each_ref().map(|c| c as _),
        );
    }
}
