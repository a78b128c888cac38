//! Camera frames: the layout of the memory that is passed with them.

use crate::error::PhasefrontError;
use phasefront::Size;
use phasefront::input::{
    self, CameraFrame, ColourImage, ConfidenceFormat, DepthFormat, DepthImage, Intrinsics, Orientation, Plane,
    RgbEncoding, Rotation, YuvMatrix,
};

/// The memory layout of a colour image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum ColourFormat {
    /// One plane with the bytes red, green, blue, alpha. Alpha is ignored.
    Rgba,
    /// One plane with the bytes blue, green, red, alpha, as in iOS' 32BGRA. Alpha is ignored.
    Bgra,
    /// One plane with the bytes red, green, blue.
    Rgb,
    /// Two planes: luma, and interleaved blue and red chroma at half the resolution. iOS' 420f and 420v.
    Nv12,
    /// Three planes: luma, and at half the resolution blue chroma (U) and red chroma (V). Android's YUV_420_888.
    Yuv420,
}

/// The matrix that converts luma and chroma to colour.
#[uniffi::remote(Enum)]
pub enum YuvMatrix {
    /// ITU-R BT.601, for standard definition, JPEG and most Android cameras.
    Bt601,
    /// ITU-R BT.709, for high definition.
    Bt709,
    /// ITU-R BT.2020 with non-constant luminance, for films of high dynamic range.
    Bt2020,
}

/// The meaning of a picture's red, green and blue.
#[uniffi::remote(Enum)]
#[non_exhaustive]
pub enum RgbEncoding {
    /// sRGB (IEC 61966-2-1), and BT.709 video, which screens show alike.
    Srgb,
    /// Display P3: the primaries of DCI-P3, white D65 and the curve of sRGB. Photographs and videos of phones.
    DisplayP3,
    /// BT.2020 of standard dynamic range, with the curve of sRGB.
    Bt2020,
    /// BT.2020 with hybrid log-gamma (BT.2100). Light above the reference white of 203 cd/m² is brought below full
    /// light.
    Bt2020Hlg,
    /// BT.2020 with perceptual quantization (BT.2100, SMPTE ST 2084). As for hybrid log-gamma, light above the
    /// reference white is brought below full light.
    Bt2020Pq,
    /// Amplitudes of the lasers themselves: the value is the amplitude, its square is the light. This is the convention
    /// of the paper, its data sets and its networks' training.
    Amplitude,
}

/// The memory layout of a depth image. In all formats except the normalized and the relative ones, 0, negative numbers,
/// NaN, numbers of 10⁹ or more, the largest code of an integer format and the largest finite 16-bit float mean no
/// reading.
#[uniffi::remote(Enum)]
#[non_exhaustive]
pub enum DepthFormat {
    /// Metres as 32-bit floats: ARKit's sceneDepth, AVFoundation's DepthFloat32.
    MetresF32,
    /// Metres as 16-bit floats: AVFoundation's DepthFloat16.
    MetresF16,
    /// Inverse metres as 32-bit floats: AVFoundation's DisparityFloat32.
    DisparityF32,
    /// Inverse metres as 16-bit floats: AVFoundation's DisparityFloat16.
    DisparityF16,
    /// Millimetres in all 16 bits: ARCore's acquireDepthImage16Bits, HardwareBuffer's D_16.
    MillimetresU16,
    /// Android's DEPTH16: millimetres in the lower 13 bits, and a confidence in the upper 3 bits. It differs from
    /// millimetres in all 16 bits.
    AndroidDepth16,
    /// Bytes from 0 nearest to 255 farthest. Every pixel is a reading.
    NormalizedU8,
    /// 16-bit numbers from 0 nearest to 65535 farthest. Every pixel is a reading.
    NormalizedU16,
    /// Relative inverse depth as 32-bit floats, as networks estimate it: larger where nearer, on any scale. NaN
    /// and numbers from ±10⁹ on mean no reading.
    RelativeF32,
    /// Relative inverse depth as 16-bit floats.
    RelativeF16,
}

/// The memory layout of a confidence map.
#[uniffi::remote(Enum)]
#[non_exhaustive]
pub enum ConfidenceFormat {
    /// 0 low, 1 medium, 2 high, as in ARKit's ARConfidenceLevel.
    LowMediumHigh,
    /// 0 none to 255 full, as in ARCore's acquireRawDepthConfidenceImage.
    U8,
}

/// The clockwise rotation that turns a sensor's image upright.
#[uniffi::remote(Enum)]
pub enum Rotation {
    /// No rotation.
    Upright,
    /// A quarter turn.
    Clockwise90,
    /// Half a turn.
    Half,
    /// Three quarters of a turn.
    Clockwise270,
}

/// The transformation from a sensor's image to the upright image: a rotation, then mirroring.
#[uniffi::remote(Record)]
pub struct Orientation {
    /// The rotation.
    pub rotation: Rotation,
    /// Whether left and right are exchanged after the rotation, as front cameras need.
    #[uniffi(default = false)]
    pub mirrored: bool,
}

/// The strides of a plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Record)]
pub struct PlaneInfo {
    /// The number of bytes from one row to the next.
    pub row_stride: usize,
    /// The number of bytes from one pixel to the next in a row.
    pub pixel_stride: usize,
}

/// The format and size of a colour image.
#[derive(Debug, Clone, PartialEq, Eq, uniffi::Record)]
pub struct ColourInfo {
    /// The memory layout.
    pub format: ColourFormat,
    /// The width of the sensor's image, in pixels.
    pub width: usize,
    /// The height of the sensor's image, in pixels.
    pub height: usize,
    /// The planes, in the format's order.
    pub planes: Vec<PlaneInfo>,
    /// The matrix of luma and chroma. Other formats ignore it.
    pub matrix: YuvMatrix,
    /// Whether luma spans 16..=235 and chroma 16..=240 instead of 0..=255 for both. Other formats ignore it.
    pub video_range: bool,
    /// The meaning of red, green and blue.
    pub encoding: RgbEncoding,
}

/// The format and size of a depth image.
#[derive(Debug, Clone, PartialEq, Eq, uniffi::Record)]
pub struct DepthInfo {
    /// The memory layout.
    pub format: DepthFormat,
    /// The width of the sensor's image, in pixels.
    pub width: usize,
    /// The height of the sensor's image, in pixels.
    pub height: usize,
    /// The plane.
    pub plane: PlaneInfo,
}

/// The format and size of a confidence map.
#[derive(Debug, Clone, PartialEq, Eq, uniffi::Record)]
pub struct ConfidenceInfo {
    /// The memory layout.
    pub format: ConfidenceFormat,
    /// The width in pixels, equal to the depth image's.
    pub width: usize,
    /// The height in pixels, equal to the depth image's.
    pub height: usize,
    /// The plane.
    pub plane: PlaneInfo,
}

/// The pinhole model of a camera, in pixels of its image before the image is turned upright. The middle of the first
/// pixel is (0, 0).
#[uniffi::remote(Record)]
pub struct Intrinsics {
    /// The focal length along x.
    pub fx: f64,
    /// The focal length along y.
    pub fy: f64,
    /// The x of the principal point.
    pub cx: f64,
    /// The y of the principal point.
    pub cy: f64,
}

/// The pose of the depth camera. A point p of the depth camera (x right, y down, z forward) is at R·p + t of the colour
/// camera.
#[derive(Debug, Clone, PartialEq, uniffi::Record)]
pub struct Pose {
    /// R: 9 numbers, row by row.
    pub rotation: Vec<f64>,
    /// t: 3 numbers, in metres.
    pub translation_m: Vec<f64>,
}

/// The intrinsics and the relative pose of the depth camera and the colour camera.
#[derive(Debug, Clone, PartialEq, uniffi::Record)]
pub struct Cameras {
    /// The intrinsics of the colour camera.
    pub colour: Intrinsics,
    /// The intrinsics of the depth camera.
    pub depth: Intrinsics,
    /// The pose from the depth camera to the colour camera; none for cameras with the same position and orientation.
    #[uniffi(default = None)]
    pub pose: Option<Pose>,
}

/// The description of a frame. Its memory is passed with it.
#[derive(Debug, Clone, PartialEq, uniffi::Record)]
pub struct FrameInfo {
    /// The time at which the frame was taken, in nanoseconds of any clock that runs forward.
    pub timestamp_ns: i64,
    /// The colour image.
    pub colour: ColourInfo,
    /// The depth image; none if the session's depth network estimates it.
    pub depth: Option<DepthInfo>,
    /// The confidence map of the depth image; none if there is no map or no depth image.
    pub confidence: Option<ConfidenceInfo>,
    /// The transformation of all images to upright ones.
    pub orientation: Orientation,
    /// The correspondence of the pixels of depth and colour; none if both images have the same field of view.
    pub cameras: Option<Cameras>,
}

/// The memory of a frame: the planes of the colour image (empty after the format's last plane), the depth image and the
/// confidence map (each empty if there is none).
#[derive(Clone, Copy)]
pub(crate) struct FrameMemory<'a> {
    pub(crate) colour: [&'a [u8]; 3],
    pub(crate) depth: &'a [u8],
    pub(crate) confidence: &'a [u8],
}

impl FrameInfo {
    /// Returns the core's frame in `memory`.
    ///
    /// # Errors
    /// Returns [`PhasefrontError::Frame`] if [`ColourImage::new`] or [`DepthImage::new`] refuses an image.
    pub(crate) fn frame<'a>(&self, memory: FrameMemory<'a>) -> Result<CameraFrame<'a>, PhasefrontError> {
        let encoding = input::YuvEncoding {
            matrix: self.colour.matrix,
            video_range: self.colour.video_range,
        };
        let format = match self.colour.format {
            ColourFormat::Rgba => input::ColourFormat::Rgba,
            ColourFormat::Bgra => input::ColourFormat::Bgra,
            ColourFormat::Rgb => input::ColourFormat::Rgb,
            ColourFormat::Nv12 => input::ColourFormat::Nv12(encoding),
            ColourFormat::Yuv420 => input::ColourFormat::Yuv420(encoding),
        };
        if self.colour.planes.len() > memory.colour.len() {
            return Err(PhasefrontError::Frame(format!(
                "frame: {} colour planes are given; a format has 3 at most",
                self.colour.planes.len()
            )));
        }
        let planes: Vec<Plane<'_>> = (self.colour.planes.iter())
            .zip(memory.colour)
            .map(|(info, bytes)| info.plane(bytes))
            .collect();
        let timestamp_ns = u64::try_from(self.timestamp_ns).map_err(|_| {
            PhasefrontError::Frame(format!(
                "frame: its timestamp is {} ns; 0 is the least",
                self.timestamp_ns
            ))
        })?;
        let colour = ColourImage::new(
            format,
            Size {
                width: self.colour.width,
                height: self.colour.height,
            },
            &planes,
        )?;
        let colour = colour.with_encoding(self.colour.encoding);

        let mut frame = CameraFrame::without_depth(timestamp_ns, colour);
        if let Some(info) = &self.depth {
            let plane = info.plane.plane(memory.depth);
            let depth = DepthImage::new(
                info.format,
                Size {
                    width: info.width,
                    height: info.height,
                },
                plane,
            )?;
            frame.depth = Some(match &self.confidence {
                Some(info) => {
                    let plane = info.plane.plane(memory.confidence);
                    depth.with_confidence(
                        info.format,
                        Size {
                            width: info.width,
                            height: info.height,
                        },
                        plane,
                    )?
                }
                None => depth,
            });
        }
        frame.orientation = self.orientation;
        if let Some(cameras) = &self.cameras {
            frame.alignment = input::Alignment::Cameras(cameras.try_into()?);
        }
        Ok(frame)
    }
}

impl PlaneInfo {
    fn plane(self, bytes: &[u8]) -> Plane<'_> {
        Plane::new(bytes, self.row_stride, self.pixel_stride)
    }
}

impl TryFrom<&Cameras> for input::Cameras {
    type Error = PhasefrontError;

    fn try_from(cameras: &Cameras) -> Result<Self, PhasefrontError> {
        let mut to = input::Cameras::concentric(cameras.colour, cameras.depth);
        if let Some(Pose {
            rotation,
            translation_m,
        }) = &cameras.pose
        {
            let (rows, rest) = rotation.as_chunks::<3>();
            let rows = <[[f64; 3]; 3]>::try_from(rows).ok().filter(|_| rest.is_empty());
            let translation = <[f64; 3]>::try_from(translation_m.as_slice()).ok();
            let (Some(rows), Some(translation)) = (rows, translation) else {
                return Err(PhasefrontError::Frame(format!(
                    "frame: the pose has {} and {} numbers; a rotation has 9, row by row, a translation 3",
                    rotation.len(),
                    translation_m.len()
                )));
            };
            (to.rotation, to.translation_m) = (rows, translation);
        }
        Ok(to)
    }
}
