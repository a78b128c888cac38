//! Conversion of the depth images and confidence maps of phones to metres and confidences in 0..=1.

use crate::Bounds;
use crate::Size;
use crate::depth::{DepthUnit, NO_READING_FROM};
use crate::frame::{Plane, check_size};
use crate::runtime::error::{Error, Result};
use half::f16;

/// The memory layout of a depth image: one plane of little-endian numbers.
///
/// In all formats except the normalized and the relative ones, 0, negative numbers, the largest code of an integer
/// format, the largest finite 16-bit float, numbers of 10⁹ or more, and NaN mean no reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
    /// Android's DEPTH16: millimetres in the lower 13 bits, and a confidence in the upper 3 bits, where 0 means 100 %,
    /// 1 means none, and n means (n − 1)/7. If it is read as [`Self::MillimetresU16`] by mistake, all but the most
    /// confident readings are off by 8 metres or more, without an error.
    AndroidDepth16,
    /// Bytes from 0 nearest to 255 farthest. Every pixel is a reading.
    NormalizedU8,
    /// 16-bit numbers from 0 nearest to 65535 farthest. Every pixel is a reading.
    NormalizedU16,
    /// Relative inverse depth as 32-bit floats, as networks estimate it from colour alone (MiDaS, Depth Anything; by
    /// tract, Core ML or LiteRT): larger where nearer, on any scale. NaN and numbers beyond ±10⁹ mean no reading.
    RelativeF32,
    /// Relative inverse depth as 16-bit floats. Numbers that are not finite, and the largest finite ones, mean no
    /// reading.
    RelativeF16,
}

impl DepthFormat {
    /// Returns the number of bytes of a pixel.
    pub fn pixel_bytes(self) -> usize {
        match self {
            DepthFormat::NormalizedU8 => 1,
            DepthFormat::MetresF32 | DepthFormat::DisparityF32 | DepthFormat::RelativeF32 => 4,
            _ => 2,
        }
    }

    /// Returns whether readings are distances rather than normalized or relative depth.
    pub fn is_metric(self) -> bool {
        !self.is_relative() && !matches!(self, DepthFormat::NormalizedU8 | DepthFormat::NormalizedU16)
    }

    /// Returns whether readings have no scale.
    pub(crate) fn is_relative(self) -> bool {
        matches!(self, DepthFormat::RelativeF32 | DepthFormat::RelativeF16)
    }

    /// Returns the reading in `pixel`, which has [`Self::pixel_bytes`] bytes, and its confidence. The reading is in
    /// metres, or normalized depth, or minus the relative inverse depth. It is NaN if the pixel has no reading.
    #[doc(hidden)]
    pub fn reading(self, pixel: &[u8]) -> (f32, f32) {
        let u16_at = || u16::from_le_bytes([pixel[0], pixel[1]]);
        let f16_at = || f16::from_le_bytes([pixel[0], pixel[1]]).to_f32();
        let f32_at = || f32::from_le_bytes([pixel[0], pixel[1], pixel[2], pixel[3]]);
        let f16_reading = || {
            Some(f16_at())
                .filter(|v| v.abs() < f16::MAX.to_f32())
                .unwrap_or(f32::NAN)
        };
        let farther = |nearer: f32| {
            if nearer.abs() < NO_READING_FROM {
                -nearer
            } else {
                f32::NAN
            }
        };
        let metres = |unit: DepthUnit, value: f32| unit.metres(value).unwrap_or(f32::NAN);
        // The largest code stands for all that lies beyond, or for no reading.
        let millimetres = |code: u16, most: u16| match code < most {
            true => metres(DepthUnit::Millimetres, f32::from(code)),
            false => f32::NAN,
        };
        match self {
            DepthFormat::MetresF32 => (metres(DepthUnit::Metres, f32_at()), 1.0),
            DepthFormat::MetresF16 => (metres(DepthUnit::Metres, f16_reading()), 1.0),
            DepthFormat::DisparityF32 => (metres(DepthUnit::Disparity, f32_at()), 1.0),
            DepthFormat::DisparityF16 => (metres(DepthUnit::Disparity, f16_reading()), 1.0),
            DepthFormat::MillimetresU16 => (millimetres(u16_at(), u16::MAX), 1.0),
            DepthFormat::AndroidDepth16 => {
                let (distance, code) = (u16_at() & 0x1fff, u16_at() >> 13);
                let confidence = match code {
                    0 => 1.0,
                    code => f32::from(code - 1) / 7.0,
                };
                (millimetres(distance, 0x1fff), confidence)
            }
            DepthFormat::NormalizedU8 => (f32::from(pixel[0]) / 255.0, 1.0),
            DepthFormat::NormalizedU16 => (f32::from(u16_at()) / 65535.0, 1.0),
            DepthFormat::RelativeF32 => (farther(f32_at()), 1.0),
            DepthFormat::RelativeF16 => (farther(f16_reading()), 1.0),
        }
    }
}

/// The memory layout of a confidence map: one plane of bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ConfidenceFormat {
    /// 0 low, 1 medium, 2 high, as in ARKit's ARConfidenceLevel.
    LowMediumHigh,
    /// 0 none to 255 full, as in ARCore's acquireRawDepthConfidenceImage.
    U8,
}

impl ConfidenceFormat {
    /// Converts `byte` to a confidence in 0..=1.
    pub(crate) fn confidence(self, byte: u8) -> f32 {
        match self {
            ConfidenceFormat::LowMediumHigh => f32::from(byte.min(2)) / 2.0,
            ConfidenceFormat::U8 => f32::from(byte) / 255.0,
        }
    }
}

/// A borrowed depth image with an optional confidence map.
#[derive(Debug, Clone, Copy)]
pub struct DepthImage<'a> {
    format: DepthFormat,
    size: Size,
    plane: Plane<'a>,
    confidence: Option<(ConfidenceFormat, Plane<'a>)>,
}

impl<'a> DepthImage<'a> {
    /// Creates a depth image of `size` in `plane`.
    ///
    /// # Errors
    /// Returns [`Error::Frame`] if the image is empty or too large, a stride is too small, or the plane has too few
    /// bytes.
    pub fn new(format: DepthFormat, size: Size, plane: Plane<'a>) -> Result<Self> {
        check_size("depth", size)?;
        plane.check("depth", size, format.pixel_bytes())?;
        Ok(DepthImage {
            format,
            size,
            plane,
            confidence: None,
        })
    }

    /// Adds a confidence map of `size`. The confidence of a reading is the lower of the map's and
    /// the depth format's own.
    ///
    /// # Errors
    /// Returns an error in the cases of [`Self::new`], or if the map's size differs from the depth's.
    pub fn with_confidence(mut self, format: ConfidenceFormat, size: Size, plane: Plane<'a>) -> Result<Self> {
        if size != self.size {
            return Err(Error::Frame(format!(
                "confidence is {size} and depth {}; they must be alike",
                self.size
            )));
        }
        plane.check("confidence", size, 1)?;
        self.confidence = Some((format, plane));
        Ok(self)
    }

    /// Returns the memory layout.
    pub fn format(&self) -> DepthFormat {
        self.format
    }

    /// Returns the size in the sensor's orientation.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Returns the plane of readings.
    pub fn plane(&self) -> Plane<'a> {
        self.plane
    }

    /// Returns the format and the plane of the confidence map, if there is one.
    pub fn confidence(&self) -> Option<(ConfidenceFormat, Plane<'a>)> {
        self.confidence
    }

    /// Writes the readings to `values` and their confidences to `confidence`, both (H, W) in the sensor's orientation,
    /// and returns the number of readings. Does not allocate.
    ///
    /// Readings are those of [`DepthFormat::reading`]. A pixel without a reading, or with a confidence below `least`,
    /// becomes NaN with confidence 0.
    ///
    /// # Panics
    /// Panics if `values` or `confidence` does not have H·W values.
    pub fn readings(&self, least: f32, values: &mut [f32], confidence: &mut [f32]) -> usize {
        assert_eq!(values.len(), self.size.pixels());
        assert_eq!(confidence.len(), self.size.pixels());
        let rows = values
            .chunks_exact_mut(self.size.width)
            .zip(confidence.chunks_exact_mut(self.size.width));
        let mut valid = 0;
        for (y, (values, confidences)) in rows.enumerate() {
            for (x, (value, confidence)) in values.iter_mut().zip(confidences).enumerate() {
                let at = y * self.plane.row_stride + x * self.plane.pixel_stride;
                let pixel = &self.plane.bytes[at..at + self.format.pixel_bytes()];
                let (reading, mut sure) = self.format.reading(pixel);
                if let Some((format, plane)) = self.confidence {
                    let byte = plane.bytes[y * plane.row_stride + x * plane.pixel_stride];
                    sure = sure.at_most(format.confidence(byte));
                }
                let is_reading = !reading.is_nan() && sure >= least;
                (*value, *confidence) = match is_reading {
                    true => (reading, sure),
                    false => (f32::NAN, 0.0),
                };
                valid += usize::from(is_reading);
            }
        }
        valid
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn each_format_reads_as_its_platform_says() {
        let f16_bytes = |v: f32| f16::from_f32(v).to_le_bytes().to_vec();
        let cases = [
            (DepthFormat::MetresF32, 2.5f32.to_le_bytes().to_vec(), 2.5, 1.0),
            (DepthFormat::MetresF16, f16_bytes(2.5), 2.5, 1.0),
            (DepthFormat::DisparityF32, 0.4f32.to_le_bytes().to_vec(), 2.5, 1.0),
            (DepthFormat::DisparityF16, f16_bytes(0.5), 2.0, 1.0),
            (DepthFormat::MillimetresU16, 9000u16.to_le_bytes().to_vec(), 9.0, 1.0),
            (DepthFormat::AndroidDepth16, 2500u16.to_le_bytes().to_vec(), 2.5, 1.0),
            (
                DepthFormat::AndroidDepth16,
                (1 << 13 | 2500u16).to_le_bytes().to_vec(),
                2.5,
                0.0,
            ),
            (
                DepthFormat::AndroidDepth16,
                (7 << 13 | 8190u16).to_le_bytes().to_vec(),
                8.19,
                6.0 / 7.0,
            ),
            (DepthFormat::NormalizedU8, vec![0], 0.0, 1.0),
            (DepthFormat::NormalizedU8, vec![255], 1.0, 1.0),
            (DepthFormat::NormalizedU16, vec![0xff, 0xff], 1.0, 1.0),
            (DepthFormat::RelativeF32, (-2.5f32).to_le_bytes().to_vec(), 2.5, 1.0),
            (DepthFormat::RelativeF16, f16_bytes(0.5), -0.5, 1.0),
        ];
        for (format, bytes, metres, confidence) in cases {
            assert_eq!(bytes.len(), format.pixel_bytes());
            let (value, sure) = format.reading(&bytes);
            assert!(
                (value - metres).abs() < 1e-6 && sure == confidence,
                "{format:?} {value}"
            );
        }
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e9, 1e10, f32::MAX] {
            for format in [DepthFormat::MetresF32, DepthFormat::DisparityF32] {
                assert!(format.reading(&bad.to_le_bytes()).0.is_nan(), "{format:?} {bad}");
            }
            // Halves hold infinity in the place of the largest of these.
            for format in [DepthFormat::MetresF16, DepthFormat::DisparityF16] {
                assert!(format.reading(&f16_bytes(bad)).0.is_nan(), "{format:?} {bad}");
            }
        }
        for format in [
            DepthFormat::MetresF16,
            DepthFormat::DisparityF16,
            DepthFormat::RelativeF16,
        ] {
            assert!(format.reading(&f16_bytes(65504.0)).0.is_nan(), "{format:?}");
            assert!(!format.reading(&f16_bytes(65472.0)).0.is_nan(), "{format:?}");
        }
        for bad in [f32::MAX, -f32::MAX, 1e10] {
            assert!(DepthFormat::RelativeF32.reading(&bad.to_le_bytes()).0.is_nan());
        }
        assert!(DepthFormat::MillimetresU16.reading(&[0xff, 0xff]).0.is_nan());
        assert_eq!(DepthFormat::MillimetresU16.reading(&[0xfe, 0xff]).0, 65.534);
        assert!(DepthFormat::AndroidDepth16.reading(&[0xff, 0x1f]).0.is_nan());
        assert_eq!(DepthFormat::RelativeF32.reading(&[0; 4]).0, 0.0);
        assert!(DepthFormat::RelativeF16.reading(&f16_bytes(f32::INFINITY)).0.is_nan());
        assert!(DepthFormat::MillimetresU16.reading(&[0, 0]).0.is_nan());
        assert!(DepthFormat::AndroidDepth16.reading(&[0, 0x20]).0.is_nan());
    }

    /// Compares images with random strides with each pixel read separately.
    #[test]
    fn any_strides_read_alike() {
        use rand::{RngExt, SeedableRng};
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        for format in [
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
        ] {
            for confidences in [None, Some(ConfidenceFormat::LowMediumHigh), Some(ConfidenceFormat::U8)] {
                let (w, h) = (random.random_range(1..20), random.random_range(1..20));
                let n = format.pixel_bytes();
                let pixel = n + random.random_range(0..3);
                let row = (w - 1) * pixel + n + random.random_range(0..9);
                let bytes: Vec<u8> = (0..(h - 1) * row + (w - 1) * pixel + n)
                    .map(|_| random.random())
                    .collect();
                let map: Vec<u8> = (0..h * (2 * w + 1)).map(|_| random.random_range(0..=255)).collect();
                let mut image =
                    DepthImage::new(format, Size { width: w, height: h }, Plane::new(&bytes, row, pixel)).unwrap();
                if let Some(format) = confidences {
                    image = image
                        .with_confidence(format, Size { width: w, height: h }, Plane::new(&map, 2 * w + 1, 2))
                        .unwrap();
                }
                let (mut values, mut sure) = (vec![9.0; w * h], vec![9.0; w * h]);
                let valid = image.readings(0.4, &mut values, &mut sure);
                assert_eq!(valid, values.iter().filter(|v| !v.is_nan()).count());
                for y in 0..h {
                    for x in 0..w {
                        let (value, own) = format.reading(&bytes[y * row + x * pixel..][..n]);
                        let map = confidences.map_or(1.0, |f| f.confidence(map[y * (2 * w + 1) + 2 * x]));
                        let (is, is_sure) = (values[y * w + x], sure[y * w + x]);
                        match value.is_nan() || own.min(map) < 0.4 {
                            true => assert!(is.is_nan() && is_sure == 0.0),
                            false => assert!(is == value && is_sure == own.min(map)),
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn images_that_are_not_whole_are_named() {
        let bytes = [0; 60];
        let image = |w, h, row, pixel| {
            DepthImage::new(
                DepthFormat::MetresF32,
                Size { width: w, height: h },
                Plane::new(&bytes, row, pixel),
            )
        };
        for (refused, word) in [
            (image(0, 3, 20, 4), "empty"),
            (image(7680, 4320, 30720, 4), "too large"),
            (image(5, 4, 20, 4), "60 bytes are too few"),
            (image(5, 3, 19, 4), "row stride of 19"),
            (image(5, 3, 20, 2), "pixel stride of 2"),
            (
                image(5, 3, 20, 4).and_then(|i| {
                    i.with_confidence(
                        ConfidenceFormat::U8,
                        Size { width: 4, height: 3 },
                        Plane::new(&bytes, 4, 1),
                    )
                }),
                "confidence is 4×3 and depth 5×3",
            ),
            (
                image(5, 3, 20, 4).and_then(|i| {
                    i.with_confidence(
                        ConfidenceFormat::U8,
                        Size { width: 5, height: 3 },
                        Plane::new(&bytes, 4, 1),
                    )
                }),
                "confidence: a row stride of 4",
            ),
        ] {
            let message = refused.map(|_| ()).map_err(|e| e.to_string());
            assert!(message.as_ref().is_err_and(|m| m.contains(word)), "{word}: {message:?}");
        }
    }
}
