//! A camera for tests, with frames of a synthetic scene in every format, with strides and gaps.
#![allow(dead_code)]

use phasefront::Size;
use phasefront::input::{
    CameraFrame, ColourFormat, ColourImage, ConfidenceFormat, DepthFormat, DepthImage, Plane, RgbEncoding, YuvEncoding,
    YuvMatrix,
};
use phasefront::{Display, Method, Network, Result, SessionOptions};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// Returns every colour format.
pub(crate) fn colour_formats() -> Vec<ColourFormat> {
    let mut formats = vec![ColourFormat::Rgba, ColourFormat::Bgra, ColourFormat::Rgb];
    for matrix in [YuvMatrix::Bt601, YuvMatrix::Bt709, YuvMatrix::Bt2020] {
        for video_range in [false, true] {
            let encoding = YuvEncoding { matrix, video_range };
            formats.extend([ColourFormat::Nv12(encoding), ColourFormat::Yuv420(encoding)]);
        }
    }
    formats
}

/// All depth formats.
pub(crate) const DEPTH_FORMATS: [DepthFormat; 10] = [
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

/// The memory of one plane.
pub(crate) struct Memory {
    pub(crate) bytes: Vec<u8>,
    pub(crate) row_stride: usize,
    pub(crate) pixel_stride: usize,
}

impl Memory {
    /// Fills a plane with random bytes: an image of that size, pixels of `pixel` bytes, `gap` bytes between pixels and
    /// after rows, and no byte after the last pixel.
    pub(crate) fn random(random: &mut ChaCha8Rng, Size { width, height }: Size, pixel: usize, gap: usize) -> Self {
        let pixel_stride = pixel + gap;
        let row_stride = width * pixel_stride + gap;
        let length = (height - 1) * row_stride + (width - 1) * pixel_stride + pixel;
        Memory {
            bytes: (0..length).map(|_| random.random()).collect(),
            row_stride,
            pixel_stride,
        }
    }

    pub(crate) fn plane(&self) -> Plane<'_> {
        Plane::new(&self.bytes, self.row_stride, self.pixel_stride)
    }
}

/// An image of noise.
pub(crate) struct Noise {
    pub(crate) format: ColourFormat,
    pub(crate) size: Size,
    pub(crate) planes: Vec<Memory>,
}

impl Noise {
    pub(crate) fn new(seed: u64, format: ColourFormat, size: Size, gap: usize) -> Self {
        let random = &mut ChaCha8Rng::seed_from_u64(seed);
        let half = Size {
            width: size.width.div_ceil(2),
            height: size.height.div_ceil(2),
        };
        let planes: &[(Size, usize)] = match format {
            ColourFormat::Rgb => &[(size, 3)],
            ColourFormat::Nv12(_) => &[(size, 1), (half, 2)],
            ColourFormat::Yuv420(_) => &[(size, 1), (half, 1), (half, 1)],
            _ => &[(size, 4)],
        };
        Noise {
            format,
            size,
            planes: (planes.iter())
                .map(|(size, pixel)| Memory::random(random, *size, *pixel, gap))
                .collect(),
        }
    }

    pub(crate) fn image(&self) -> Result<ColourImage<'_>> {
        let planes: Vec<_> = self.planes.iter().map(Memory::plane).collect();
        let image = ColourImage::new(self.format, self.size, &planes)?;
        Ok(image.with_encoding(RgbEncoding::Amplitude))
    }
}

/// A scene with a bright square at 1 m in front of a wall from 2 m to 3 m.
pub(crate) struct Scene {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) rgba: Vec<u8>,
    pub(crate) metres: Vec<f32>,
}

impl Scene {
    /// Creates the scene with the square starting `at` pixels from the left.
    pub(crate) fn new(size: Size, at: usize) -> Self {
        let Size { width, height } = size;
        let square = |x: usize, y: usize| (at..at + width / 4).contains(&x) && (height / 4..height / 2).contains(&y);
        let pixels = || (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        Scene {
            width,
            height,
            rgba: pixels()
                .flat_map(|(x, y)| {
                    if square(x, y) {
                        [250, 200, 40, 255]
                    } else {
                        [30, (x * 255 / width) as u8, 90, 255]
                    }
                })
                .collect(),
            metres: pixels()
                .map(|(x, y)| {
                    if square(x, y) {
                        1.0
                    } else {
                        2.0 + x as f32 / width as f32
                    }
                })
                .collect(),
        }
    }

    pub(crate) fn colour(&self) -> ColourImage<'_> {
        let plane = Plane::new(&self.rgba, 4 * self.width, 4);
        ColourImage::new(
            ColourFormat::Rgba,
            Size {
                width: self.width,
                height: self.height,
            },
            &[plane],
        )
        .expect("a whole image")
        .with_encoding(RgbEncoding::Amplitude)
    }

    /// Returns the bytes of the depth in `format`.
    pub(crate) fn depth_bytes(&self, format: DepthFormat) -> Vec<u8> {
        let half = |v: f32| half::f16::from_f32(v).to_le_bytes().to_vec();
        let whole = |v: f32| (v as u16).to_le_bytes().to_vec();
        let bytes = |m: &f32| match format {
            DepthFormat::MetresF32 => m.to_le_bytes().to_vec(),
            DepthFormat::MetresF16 => half(*m),
            DepthFormat::DisparityF32 => (1.0 / m).to_le_bytes().to_vec(),
            DepthFormat::DisparityF16 => half(1.0 / m),
            DepthFormat::NormalizedU8 => vec![((m - 1.0) / 2.0 * 255.0) as u8],
            DepthFormat::NormalizedU16 => whole((m - 1.0) / 2.0 * 65535.0),
            DepthFormat::RelativeF32 => (5.0 - 2.0 * m).to_le_bytes().to_vec(),
            DepthFormat::RelativeF16 => half(5.0 - 2.0 * m),
            // Full confidence has the bits 0, so both formats in millimetres are the same.
            _ => whole(m * 1000.0),
        };
        self.metres.iter().flat_map(bytes).collect()
    }
}

/// Returns a depth image over `bytes`, tightly packed.
pub(crate) fn depth(bytes: &[u8], format: DepthFormat, size: Size) -> DepthImage<'_> {
    let width = size.width;
    let pixel = format.pixel_bytes();
    DepthImage::new(format, size, Plane::new(bytes, width * pixel, pixel)).expect("a whole image")
}

/// Returns a frame of `scene`, whose depth is in metres in the bytes `metres`.
pub(crate) fn frame<'a>(timestamp_ns: u64, scene: &'a Scene, metres: &'a [u8]) -> CameraFrame<'a> {
    let depth = depth(
        metres,
        DepthFormat::MetresF32,
        Size {
            width: scene.width,
            height: scene.height,
        },
    );
    CameraFrame::new(timestamp_ns, scene.colour(), depth)
}

/// Returns `depth` with a confidence map of the same or another size.
pub(crate) fn with_confidence<'a>(depth: DepthImage<'a>, map: &'a [u8], size: Size) -> Result<DepthImage<'a>> {
    let width = size.width;
    depth.with_confidence(ConfidenceFormat::U8, size, Plane::new(map, width, 1))
}

/// Returns options for a small display and the bundled network.
pub(crate) fn options(size: Size) -> SessionOptions {
    let Size { width, height } = size;
    let network = Network::from_onnx(include_bytes!("../../../models/rgbd-8-int8.onnx"));
    let method = Method::Network(Arc::new(network.expect("a hologram network")));
    let display = Display::from_toml(&format!("width = {width}\nheight = {height}\noffset_mm = 2"));
    SessionOptions::new(display.expect("a display"), method)
}
