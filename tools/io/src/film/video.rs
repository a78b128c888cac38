//! RGB-D video: frames from a folder or a pipe, in place of a camera.

use crate::fingerprint::Fingerprint;
use crate::frame::{self, DepthOptions, Doubt, Stored};
use crate::picture;
use crate::{Error, Result};
use ndarray::Array2;
use phasefront::Size;
use phasefront::input::{CameraFrame, ColourFormat, ColourImage, DepthFormat, DepthImage, Plane, RgbEncoding};
use phasefront_core::depth::{self, DepthUnit};
use std::io::Read;
use std::path::Path;

/// One frame in memory: colour as rows of RGB bytes, and depth unless a network estimates it.
#[derive(Debug, Clone, PartialEq)]
pub struct VideoFrame {
    colour: Vec<u8>,
    colour_size: Size,
    encoding: RgbEncoding,
    depth: Option<VideoDepth>,
}

/// The depth of a frame, as little-endian values of `format`.
#[derive(Debug, Clone, PartialEq)]
struct VideoDepth {
    bytes: Vec<u8>,
    size: Size,
    format: DepthFormat,
}

impl VideoDepth {
    /// Returns the readings: normalized, or in metres with NaN for none.
    fn readings(&self) -> impl Iterator<Item = f32> {
        let pixels = self.bytes.chunks_exact(self.format.pixel_bytes());
        pixels.map(|pixel| self.format.reading(pixel).0)
    }
}

impl VideoFrame {
    /// Returns the size of the colour image.
    pub fn size(&self) -> Size {
        self.colour_size
    }

    /// Returns the size of the depth image, if there is one.
    pub fn depth_size(&self) -> Option<Size> {
        self.depth.as_ref().map(|depth| depth.size)
    }

    /// Adds the frame to the fingerprint in `hasher`.
    pub fn fingerprint(&self, hasher: &mut Fingerprint) {
        hasher.numbers(&[self.colour_size.height, self.colour_size.width]);
        hasher.bytes(&self.colour);
        if self.encoding != RgbEncoding::Amplitude {
            hasher.bytes(self.encoding.name().as_bytes());
        }
        if let Some(VideoDepth { bytes, size, format }) = &self.depth {
            hasher.numbers(&[size.height, size.width]);
            hasher.bytes(format!("{format:?}").as_bytes());
            hasher.bytes(bytes);
        }
    }

    /// Creates a frame from rows of RGB bytes, an image of `colour_size`, and big-endian 16-bit depth values of `unit`,
    /// an image of `depth_size`.
    pub fn of_big_endian(colour_size: Size, colour: Vec<u8>, depth_size: Size, depth: &[u8], unit: DepthUnit) -> Self {
        let little = depth.as_chunks::<2>().0.iter().flat_map(|[high, low]| [*low, *high]);
        let (format, bytes) = of_numbers(little.collect(), unit);
        VideoFrame {
            colour,
            colour_size,
            encoding: RgbEncoding::Amplitude,
            depth: Some(VideoDepth {
                bytes,
                size: depth_size,
                format,
            }),
        }
    }

    /// Creates a frame from a picture of `size`, rows of RGB bytes, with colour at its left and normalized grey depth
    /// at its right, each `side` columns wide.
    ///
    /// # Errors
    /// Returns an error if the picture is narrower.
    pub fn of_sides(size: Size, picture: &[u8], side: usize) -> Result<Self> {
        let Size { width, height } = size;
        let Some(right) = width.checked_sub(side).filter(|right| *right >= side) else {
            return Err(Error::Input(format!(
                "a picture of {size} has no two sides of {side} columns"
            )));
        };
        let rows = || picture.chunks_exact(3 * width);
        let colour = rows().flat_map(|row| &row[..3 * side]).copied().collect();
        let depth = rows().flat_map(|row| row[3 * right..].as_chunks::<3>().0).map(|pixel| {
            let sum: u32 = pixel.iter().map(|v| u32::from(*v)).sum();
            (sum * 65535 / (3 * 255)) as u16
        });
        Ok(VideoFrame {
            colour,
            colour_size: Size { width: side, height },
            encoding: RgbEncoding::Amplitude,
            depth: Some(VideoDepth {
                bytes: depth.flat_map(u16::to_le_bytes).collect(),
                size: Size { width: side, height },
                format: DepthFormat::NormalizedU16,
            }),
        })
    }

    /// Creates a frame without depth from rows of RGB bytes, an image of `colour_size`.
    pub fn without_depth(colour_size: Size, colour: Vec<u8>) -> Self {
        VideoFrame {
            colour,
            colour_size,
            encoding: RgbEncoding::Amplitude,
            depth: None,
        }
    }

    /// Sets the meaning of the colours, which are amplitudes without it.
    pub fn with_encoding(self, encoding: RgbEncoding) -> Self {
        VideoFrame { encoding, ..self }
    }

    /// Swaps near and far.
    ///
    /// # Errors
    /// Returns an error if the depth is not normalized.
    pub fn invert(&mut self) -> Result<()> {
        match &mut self.depth {
            Some(depth) if depth.format == DepthFormat::NormalizedU16 => {
                depth.bytes.iter_mut().for_each(|byte| *byte = 255 - *byte);
                Ok(())
            }
            _ => Err(Error::Input(
                "--invert is for normalized depth; distances and disparities say which is near by --depth-unit".into(),
            )),
        }
    }

    /// Checks that colour and depth show the same field of view, and returns the reason to doubt normalized depth, if
    /// there is one. `inverted` tells that 0 is the farthest.
    ///
    /// # Errors
    /// Returns an error if their aspect ratios differ.
    pub fn check(&self, inverted: bool) -> Result<Option<Doubt>> {
        let Some(depth) = &self.depth else { return Ok(None) };
        frame::check_aspect(depth.size, self.colour_size).map_err(Error::Input)?;
        let normalized = depth.format == DepthFormat::NormalizedU16;
        Ok(normalized
            .then(|| Doubt::of_normalized(depth.readings(), inverted))
            .flatten())
    }

    /// Returns the share of depth readings that are nearer than `near_m` or farther than `far_m`.
    pub fn beyond(&self, near_m: f32, far_m: f32) -> f64 {
        let (mut all, mut beyond) = (0usize, 0usize);
        let readings = self.depth.iter().flat_map(VideoDepth::readings);
        for metres in readings.filter(|m| !m.is_nan()) {
            all += 1;
            beyond += usize::from(!(near_m..=far_m).contains(&metres));
        }
        beyond as f64 / all.max(1) as f64
    }

    /// Returns the reason to doubt the range of the frame's depth, if it is in metres and there is one.
    pub fn crowded(&self) -> Option<Doubt> {
        let depth = (self.depth.as_ref()).filter(|depth| depth.format != DepthFormat::NormalizedU16)?;
        let metres = Array2::from_shape_vec(depth.size.shape(), depth.readings().collect()).ok()?;
        // A frame without a reading is refused elsewhere.
        let normalized = depth::normalize(metres.view(), DepthUnit::Metres, None, None).ok()?;
        let (near_m, far_m) = normalized.range_m?;
        Doubt::of_crowded(&normalized.depth, near_m, far_m)
    }

    /// Returns the frame as a view that a session accepts.
    ///
    /// # Errors
    /// Returns an error if the images are too large.
    pub fn camera_frame(&self, timestamp_ns: u64) -> Result<CameraFrame<'_>> {
        let width = self.colour_size.width;
        let plane = Plane::new(&self.colour, 3 * width, 3);
        let colour = ColourImage::new(ColourFormat::Rgb, self.colour_size, &[plane])?.with_encoding(self.encoding);
        let Some(depth) = &self.depth else {
            return Ok(CameraFrame::without_depth(timestamp_ns, colour));
        };
        let width = depth.size.width;
        let pixel = depth.format.pixel_bytes();
        let plane = Plane::new(&depth.bytes, width * pixel, pixel);
        let depth = DepthImage::new(depth.format, depth.size, plane)?;
        Ok(CameraFrame::new(timestamp_ns, colour, depth))
    }
}

/// Reads the files of a frame, colour and depth, with the checks of a still ([`frame::read`]). The colours mean `asked`
/// or what the file says. `told` takes what is doubtful about them.
///
/// # Errors
/// Returns an error if a file cannot be read, if the files do not match, or if a pixel has no normalized depth.
pub fn read_frame(
    paths: [&Path; 2],
    options: DepthOptions,
    asked: Option<RgbEncoding>,
    told: &mut dyn FnMut(Doubt),
) -> Result<VideoFrame> {
    let Stored { colours, readings } = frame::stored(paths, options, asked, told)?;
    let unit = options.unit;
    if unit == DepthUnit::Normalized
        && let Some(bad) = readings.iter().find(|d| !(0.0..=1.0).contains(*d))
    {
        return Err(Error::file(
            paths[1],
            format!("holds {bad}; normalized depth of video must lie in 0..=1"),
        ));
    }
    let (format, bytes) = depth_bytes(&readings, unit);
    Ok(VideoFrame {
        colour: picture::amplitude_bytes(colours.rgb.view()),
        colour_size: colours.size(),
        encoding: colours.encoding,
        depth: Some(VideoDepth {
            bytes,
            size: Size::from_shape(readings.dim()),
            format,
        }),
    })
}

fn depth_bytes(readings: &Array2<f32>, unit: DepthUnit) -> (DepthFormat, Vec<u8>) {
    match unit {
        DepthUnit::Normalized => (
            DepthFormat::NormalizedU16,
            (readings.iter())
                .flat_map(|d| ((d * 65535.0).round() as u16).to_le_bytes())
                .collect(),
        ),
        unit => (
            DepthFormat::MetresF32,
            (readings.iter())
                .flat_map(|d| unit.metres(*d).unwrap_or(f32::NAN).to_le_bytes())
                .collect(),
        ),
    }
}

/// Converts depths in `unit` to the little-endian 16-bit values that a session reads.
fn of_numbers(depth: Vec<u8>, unit: DepthUnit) -> (DepthFormat, Vec<u8>) {
    match unit {
        DepthUnit::Millimetres => (DepthFormat::MillimetresU16, depth),
        DepthUnit::Normalized => (DepthFormat::NormalizedU16, depth),
        unit => {
            let numbers = depth.as_chunks::<2>().0.iter().map(|n| u16::from_le_bytes(*n));
            // The largest code is no reading, as in `DepthFormat::MillimetresU16`.
            let metres = numbers.flat_map(|n| {
                let reading = (n < u16::MAX).then(|| unit.metres(n.into())).flatten();
                reading.unwrap_or(f32::NAN).to_le_bytes()
            });
            (DepthFormat::MetresF32, metres.collect())
        }
    }
}

/// The layout of raw frames in a pipe: rows of RGB bytes, then rows of 16-bit little-endian depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RawVideo {
    /// The size of the colour image.
    pub colour: Size,
    /// The size of the depth image.
    pub depth: Size,
    /// The unit of the depth values.
    pub unit: DepthUnit,
}

impl RawVideo {
    /// Reads the next frame. Returns `None` at the end.
    ///
    /// # Errors
    /// Returns an error if the pipe breaks or ends within a frame.
    pub fn read(&self, from: &mut dyn Read) -> Result<Option<VideoFrame>> {
        let mut colour = vec![0; 3 * self.colour.pixels()];
        let mut depth = vec![0; 2 * self.depth.pixels()];
        let got = fill(from, &mut colour)?;
        if got == 0 {
            return Ok(None);
        }
        let got = got
            + if got == colour.len() {
                fill(from, &mut depth)?
            } else {
                0
            };
        if got < colour.len() + depth.len() {
            return Err(Error::Input(format!(
                "the raw video ends {got} bytes into a frame of {}; is the size right?",
                colour.len() + depth.len()
            )));
        }
        let (format, bytes) = of_numbers(depth, self.unit);
        Ok(Some(VideoFrame {
            colour,
            colour_size: self.colour,
            encoding: RgbEncoding::Amplitude,
            depth: Some(VideoDepth {
                bytes,
                size: self.depth,
                format,
            }),
        }))
    }
}

/// Reads until `bytes` is full or the pipe ends. Returns the number of bytes read.
fn fill(from: &mut dyn Read, bytes: &mut [u8]) -> Result<usize> {
    let mut got = 0;
    while got < bytes.len() {
        match from.read(&mut bytes[got..]) {
            Ok(0) => break,
            Ok(n) => got += n,
            Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
            Err(e) => return Err(Error::Input(format!("the raw video cannot be read: {e}"))),
        }
    }
    Ok(got)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn raw_video_is_cut_into_frames_and_a_cut_frame_is_named() {
        let raw = RawVideo {
            colour: Size { width: 3, height: 2 },
            depth: Size { width: 2, height: 1 },
            unit: DepthUnit::Millimetres,
        };
        let bytes: Vec<u8> = (0..44).collect();
        let mut pipe = &bytes[..];
        let first = raw.read(&mut pipe).unwrap().unwrap();
        let depth = |frame: VideoFrame| frame.depth.unwrap().bytes;
        assert_eq!(
            (first.size(), first.colour[17], depth(first)[0]),
            (Size { width: 3, height: 2 }, 17, 18)
        );
        assert_eq!(depth(raw.read(&mut pipe).unwrap().unwrap()), [40, 41, 42, 43]);
        assert_eq!(raw.read(&mut pipe).unwrap(), None);
        let cut = raw.read(&mut &bytes[..30]).and_then(|_| raw.read(&mut &bytes[22..40]));
        assert!(cut.unwrap_err().to_string().contains("18 bytes into a frame of 22"));
        let units = RawVideo {
            unit: DepthUnit::Raw { units_per_m: 5000.0 },
            ..raw
        };
        let frame = units.read(&mut &bytes[..22]).unwrap().unwrap();
        let metres = f32::from(u16::from_le_bytes([18, 19])) / 5000.0;
        assert_eq!(frame.depth.unwrap().bytes[..4], metres.to_le_bytes());
    }
}
