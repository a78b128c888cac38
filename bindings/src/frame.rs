//! Camera frames: what lies where in the memory that comes with them.

use crate::error::PhasefrontError;
use phasefront::input::{self, CameraFrame, ColourImage, DepthImage, Plane};

/// How a colour image lies in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum ColourFormat {
    /// One plane; bytes red, green, blue, alpha (which is not looked at).
    Rgba,
    /// One plane; bytes blue, green, red, alpha (which is not looked at). iOS' 32BGRA.
    Bgra,
    /// One plane; bytes red, green, blue.
    Rgb,
    /// Two planes: luma; and at half the resolution blue and red chroma side by side. iOS' 420f and 420v.
    Nv12,
    /// Three planes: luma, and at half the resolution blue chroma (U) and red chroma (V). Android's YUV_420_888.
    Yuv420,
}

/// The matrix between luma, chroma and colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum YuvMatrix {
    /// ITU-R BT.601: standard definition, JPEG, most Android cameras.
    Bt601,
    /// ITU-R BT.709: high definition.
    Bt709,
}

/// How a depth image lies in memory. But for the normalized ones, 0, negative numbers and what is not finite mean no
/// reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum DepthFormat {
    /// Metres, 32-bit floats: ARKit's sceneDepth, AVFoundation's DepthFloat32.
    MetresF32,
    /// Metres, 16-bit floats: AVFoundation's DepthFloat16.
    MetresF16,
    /// Inverse metres, 32-bit floats: AVFoundation's DisparityFloat32.
    DisparityF32,
    /// Inverse metres, 16-bit floats: AVFoundation's DisparityFloat16.
    DisparityF16,
    /// Millimetres, all 16 bits: ARCore's acquireDepthImage16Bits, HardwareBuffer's D_16.
    MillimetresU16,
    /// Android's DEPTH16: millimetres in the lower 13 bits, a confidence in the upper 3. Not the same as millimetres
    /// in all 16.
    AndroidDepth16,
    /// 0 nearest to 255 farthest; every pixel is a reading.
    NormalizedU8,
    /// 0 nearest to 65535 farthest; every pixel is a reading.
    NormalizedU16,
}

/// How a confidence map lies in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum ConfidenceFormat {
    /// 0 low, 1 medium, 2 high: ARKit's ARConfidenceLevel.
    LowMediumHigh,
    /// 0 none to 255 full: ARCore's acquireRawDepthConfidenceImage.
    U8,
}

/// How far a sensor's picture must be turned clockwise to stand upright.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum Rotation {
    /// Not at all.
    Upright,
    /// A quarter turn.
    Clockwise90,
    /// Half a turn.
    Half,
    /// Three quarters.
    Clockwise270,
}

/// How a sensor's picture becomes the one that is shown: turned, then mirrored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Record)]
pub struct Orientation {
    /// The turn.
    pub rotation: Rotation,
    /// Whether left and right are exchanged after the turn, as front cameras need.
    #[uniffi(default = false)]
    pub mirrored: bool,
}

/// Where the pixels of one plane lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Record)]
pub struct PlaneInfo {
    /// Bytes from one row to the next.
    pub row_stride: u32,
    /// Bytes from one pixel to the next in a row.
    pub pixel_stride: u32,
}

/// What a colour image is.
#[derive(Debug, Clone, PartialEq, Eq, uniffi::Record)]
pub struct ColourInfo {
    /// How it lies in memory.
    pub format: ColourFormat,
    /// Pixels along x, as the sensor gives them.
    pub width: u32,
    /// Pixels along y.
    pub height: u32,
    /// Its planes, in the format's order.
    pub planes: Vec<PlaneInfo>,
    /// The matrix of luma and chroma; other formats do not look at it.
    pub matrix: YuvMatrix,
    /// Whether luma runs over 16..=235 and chroma over 16..=240, not both over 0..=255; other formats do not look at
    /// it.
    pub video_range: bool,
}

/// What a depth image is.
#[derive(Debug, Clone, PartialEq, Eq, uniffi::Record)]
pub struct DepthInfo {
    /// How it lies in memory.
    pub format: DepthFormat,
    /// Pixels along x, as the sensor gives them.
    pub width: u32,
    /// Pixels along y.
    pub height: u32,
    /// Its plane.
    pub plane: PlaneInfo,
}

/// What a confidence map is.
#[derive(Debug, Clone, PartialEq, Eq, uniffi::Record)]
pub struct ConfidenceInfo {
    /// How it lies in memory.
    pub format: ConfidenceFormat,
    /// Pixels along x: as many as the depth has.
    pub width: u32,
    /// Pixels along y: as many as the depth has.
    pub height: u32,
    /// Its plane.
    pub plane: PlaneInfo,
}

/// The pinhole model of a camera, in pixels of its image before it is turned upright. The middle of the first pixel is
/// (0, 0).
#[derive(Debug, Clone, Copy, PartialEq, uniffi::Record)]
pub struct Intrinsics {
    /// Focal length along x.
    pub fx: f64,
    /// Focal length along y.
    pub fy: f64,
    /// x of the principal point.
    pub cx: f64,
    /// y of the principal point.
    pub cy: f64,
}

/// Where a point p of the depth camera (x right, y down, z forward) is for the colour camera: R·p + t.
#[derive(Debug, Clone, PartialEq, uniffi::Record)]
pub struct Pose {
    /// R, its 9 numbers row by row.
    pub rotation: Vec<f64>,
    /// t, 3 numbers, metres.
    pub translation_m: Vec<f64>,
}

/// How the depth camera and the colour camera stand to each other.
#[derive(Debug, Clone, PartialEq, uniffi::Record)]
pub struct Cameras {
    /// Of the colour image.
    pub colour: Intrinsics,
    /// Of the depth image.
    pub depth: Intrinsics,
    /// From depth to colour; none for cameras at one place that look one way.
    #[uniffi(default = None)]
    pub pose: Option<Pose>,
}

/// What a frame is; its memory comes beside it.
#[derive(Debug, Clone, PartialEq, uniffi::Record)]
pub struct FrameInfo {
    /// When it was taken, in nanoseconds of any clock that runs forward.
    pub timestamp_ns: u64,
    /// The colour image.
    pub colour: ColourInfo,
    /// The depth image.
    pub depth: DepthInfo,
    /// The confidence map of the depth, where there is one.
    pub confidence: Option<ConfidenceInfo>,
    /// How all must be turned to stand upright.
    pub orientation: Orientation,
    /// How the pixels of depth and colour correspond; none where both show the same field of view.
    pub cameras: Option<Cameras>,
}

/// The memory of a frame: the planes of colour (empty behind the format's last), depth, and confidence (empty where
/// there is none).
#[derive(Clone, Copy)]
pub(crate) struct FrameMemory<'a> {
    pub(crate) colour: [&'a [u8]; 3],
    pub(crate) depth: &'a [u8],
    pub(crate) confidence: &'a [u8],
}

impl FrameInfo {
    /// The core's frame in `memory`.
    ///
    /// # Errors
    /// [`PhasefrontError::Frame`]: what [`ColourImage::new`] or [`DepthImage::new`] refuses.
    pub(crate) fn frame<'a>(&self, memory: FrameMemory<'a>) -> Result<CameraFrame<'a>, PhasefrontError> {
        let encoding = input::YuvEncoding {
            matrix: match self.colour.matrix {
                YuvMatrix::Bt601 => input::YuvMatrix::Bt601,
                YuvMatrix::Bt709 => input::YuvMatrix::Bt709,
            },
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
        let size = |width: u32, height: u32| (width as usize, height as usize);
        let (width, height) = size(self.colour.width, self.colour.height);
        let colour = ColourImage::new(format, width, height, &planes)?;

        let format = match self.depth.format {
            DepthFormat::MetresF32 => input::DepthFormat::MetresF32,
            DepthFormat::MetresF16 => input::DepthFormat::MetresF16,
            DepthFormat::DisparityF32 => input::DepthFormat::DisparityF32,
            DepthFormat::DisparityF16 => input::DepthFormat::DisparityF16,
            DepthFormat::MillimetresU16 => input::DepthFormat::MillimetresU16,
            DepthFormat::AndroidDepth16 => input::DepthFormat::AndroidDepth16,
            DepthFormat::NormalizedU8 => input::DepthFormat::NormalizedU8,
            DepthFormat::NormalizedU16 => input::DepthFormat::NormalizedU16,
        };
        let (width, height) = size(self.depth.width, self.depth.height);
        let mut depth = DepthImage::new(format, width, height, self.depth.plane.plane(memory.depth))?;
        if let Some(info) = &self.confidence {
            let format = match info.format {
                ConfidenceFormat::LowMediumHigh => input::ConfidenceFormat::LowMediumHigh,
                ConfidenceFormat::U8 => input::ConfidenceFormat::U8,
            };
            let (width, height) = size(info.width, info.height);
            let plane = info.plane.plane(memory.confidence);
            depth = depth.with_confidence(format, width, height, plane)?;
        }

        let mut frame = CameraFrame::new(self.timestamp_ns, colour, depth);
        frame.orientation = input::Orientation {
            rotation: match self.orientation.rotation {
                Rotation::Upright => input::Rotation::Upright,
                Rotation::Clockwise90 => input::Rotation::Clockwise90,
                Rotation::Half => input::Rotation::Half,
                Rotation::Clockwise270 => input::Rotation::Clockwise270,
            },
            mirrored: self.orientation.mirrored,
        };
        if let Some(cameras) = &self.cameras {
            frame.alignment = input::Alignment::Cameras(cameras.try_into()?);
        }
        Ok(frame)
    }
}

impl PlaneInfo {
    fn plane(self, bytes: &[u8]) -> Plane<'_> {
        Plane::new(bytes, self.row_stride as usize, self.pixel_stride as usize)
    }
}

impl From<Intrinsics> for input::Intrinsics {
    fn from(Intrinsics { fx, fy, cx, cy }: Intrinsics) -> Self {
        input::Intrinsics { fx, fy, cx, cy }
    }
}

impl TryFrom<&Cameras> for input::Cameras {
    type Error = PhasefrontError;

    fn try_from(cameras: &Cameras) -> Result<Self, PhasefrontError> {
        let mut to = input::Cameras::concentric(cameras.colour.into(), cameras.depth.into());
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
