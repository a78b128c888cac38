//! Camera colour images: their formats and the check that an image is complete.
//!
//! [`super::convert`] converts them to amplitudes.

use super::encoding::RgbEncoding;
use super::plane::Plane;
use crate::Size;
use crate::runtime::error::{Error, Result};

/// The largest number of pixels of a camera image. Larger images are refused because they would be slow. 4K video and
/// 12-megapixel stills are below the limit, 8K is above it.
pub const MAX_SOURCE_PIXELS: usize = 1 << 24;

/// The matrix that converts luma and chroma to colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum YuvMatrix {
    /// ITU-R BT.601, for standard definition, JPEG and most Android cameras.
    #[default]
    Bt601,
    /// ITU-R BT.709, for high definition.
    Bt709,
    /// ITU-R BT.2020 with non-constant luminance, for films of high dynamic range.
    Bt2020,
}

/// The encoding of luma and chroma.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct YuvEncoding {
    /// The conversion matrix.
    pub matrix: YuvMatrix,
    /// Whether luma spans 16..=235 and chroma 16..=240 ("video range") instead of 0..=255 for both.
    pub video_range: bool,
}

/// The memory layout of a camera image. Each plane has its own strides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ColourFormat {
    /// One plane with the bytes red, green, blue, alpha. Alpha is ignored.
    Rgba,
    /// One plane with the bytes blue, green, red, alpha, as in iOS' 32BGRA. Alpha is ignored.
    Bgra,
    /// One plane with the bytes red, green, blue.
    Rgb,
    /// Two planes: luma, and interleaved blue and red chroma at half the resolution, rounded up. On iOS, 420f (full
    /// range) and 420v (video range).
    Nv12(YuvEncoding),
    /// Three planes: luma, and at half the resolution, rounded up, blue chroma (U, Cb) and red chroma (V, Cr). On
    /// Android, YUV_420_888 with any pixel strides, which includes NV21 and I420.
    Yuv420(YuvEncoding),
}

impl ColourFormat {
    /// Returns the number of planes of an image.
    pub fn planes(self) -> usize {
        match self {
            ColourFormat::Rgba | ColourFormat::Bgra | ColourFormat::Rgb => 1,
            ColourFormat::Nv12(_) => 2,
            ColourFormat::Yuv420(_) => 3,
        }
    }

    /// Returns for each plane its name in errors, its bytes per pixel, and the number of image pixels, along each axis,
    /// that share one of its pixels.
    #[doc(hidden)]
    pub fn layout(self) -> &'static [(&'static str, usize, usize)] {
        match self {
            ColourFormat::Rgba => &[("RGBA colour", 4, 1)],
            ColourFormat::Bgra => &[("BGRA colour", 4, 1)],
            ColourFormat::Rgb => &[("RGB colour", 3, 1)],
            ColourFormat::Nv12(_) => &[("luma", 1, 1), ("chroma", 2, 2)],
            ColourFormat::Yuv420(_) => &[("luma", 1, 1), ("U chroma", 1, 2), ("V chroma", 1, 2)],
        }
    }
}

/// A borrowed camera image.
#[derive(Debug, Clone, Copy)]
pub struct ColourImage<'a> {
    format: ColourFormat,
    size: Size,
    planes: [Plane<'a>; 3],
    encoding: RgbEncoding,
}

impl<'a> ColourImage<'a> {
    /// Creates an image of `size` in `planes`.
    ///
    /// ```
    /// use phasefront::Size;
    /// use phasefront::input::{ColourFormat, ColourImage, Plane, YuvEncoding};
    ///
    /// let (luma, chroma) = ([0; 640 * 480], [128; 640 * 240]);
    /// let format = ColourFormat::Nv12(YuvEncoding::default());
    /// let planes = [Plane::new(&luma, 640, 1), Plane::new(&chroma, 640, 2)];
    /// let image = ColourImage::new(format, Size { width: 640, height: 480 }, &planes)?;
    /// # Ok::<(), phasefront::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`Error::Frame`] if the image is empty or too large, the number of planes does not match the format, a
    /// stride is too small, or a plane has too few bytes.
    pub fn new(format: ColourFormat, size: Size, planes: &[Plane<'a>]) -> Result<Self> {
        check_size("colour", size)?;
        let layout = format.layout();
        if planes.len() != layout.len() {
            return Err(Error::Frame(format!(
                "{} colour planes are given; {format:?} has {}",
                planes.len(),
                layout.len()
            )));
        }
        let mut all = [Plane::default(); 3];
        for ((to, plane), (what, pixel_bytes, share)) in all.iter_mut().zip(planes).zip(layout) {
            let shared = Size {
                width: size.width.div_ceil(*share),
                height: size.height.div_ceil(*share),
            };
            plane.check(what, shared, *pixel_bytes)?;
            *to = *plane;
        }
        Ok(ColourImage {
            format,
            size,
            planes: all,
            encoding: RgbEncoding::default(),
        })
    }

    /// Sets the meaning of the image's red, green and blue.
    pub fn with_encoding(self, encoding: RgbEncoding) -> Self {
        ColourImage { encoding, ..self }
    }

    /// Returns the meaning of the image's red, green and blue.
    pub fn encoding(&self) -> RgbEncoding {
        self.encoding
    }

    /// Returns the memory layout.
    pub fn format(&self) -> ColourFormat {
        self.format
    }

    /// Returns the size in the sensor's orientation.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Returns the planes of the format.
    pub fn planes(&self) -> &[Plane<'a>] {
        &self.planes[..self.format.planes()]
    }
}

/// Checks the size of a camera image.
pub fn check_size(what: &str, size: Size) -> Result<()> {
    match size.width.checked_mul(size.height) {
        Some(0) => Err(Error::Frame(format!(
            "{what} is empty ({size}); each side must be at least 1"
        ))),
        Some(pixels) if pixels <= MAX_SOURCE_PIXELS => Ok(()),
        _ => Err(Error::Frame(format!(
            "{what} of {size} pixels is too large; {MAX_SOURCE_PIXELS} pixels are the most, so ask the camera for a smaller format"
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_that_are_not_whole_are_named() {
        let bytes = vec![0; 64];
        let plane = |row, pixel| Plane::new(&bytes, row, pixel);
        let yuv = ColourFormat::Yuv420(YuvEncoding::default());
        let nv12 = ColourFormat::Nv12(YuvEncoding::default());
        let cases = [
            (ColourFormat::Rgba, 0, 4, vec![plane(16, 4)], "empty"),
            (ColourFormat::Rgba, 7680, 4320, vec![plane(30720, 4)], "too large"),
            (ColourFormat::Rgba, usize::MAX, 2, vec![plane(16, 4)], "too large"),
            (ColourFormat::Rgba, 4, 5, vec![plane(16, 4)], "64 bytes are too few"),
            (ColourFormat::Bgra, 4, 4, vec![plane(15, 4)], "row stride of 15"),
            (ColourFormat::Rgb, 4, 4, vec![plane(16, 2)], "pixel stride of 2"),
            (nv12, 8, 8, vec![plane(8, 1)], "1 colour planes"),
            (
                nv12,
                8,
                8,
                vec![plane(8, 1), plane(8, 1)],
                "chroma: a pixel stride of 1",
            ),
            (
                yuv,
                8,
                8,
                vec![plane(8, 1), plane(4, 1), plane(3, 1)],
                "V chroma: a row stride of 3",
            ),
            (
                yuv,
                7,
                9,
                vec![plane(7, 1), plane(4, 1), plane(17, 1)],
                "V chroma: 64 bytes",
            ),
        ];
        for (format, width, height, planes, word) in cases {
            let refused = ColourImage::new(format, Size { width, height }, &planes);
            let message = refused.map(|_| ()).map_err(|e| e.to_string());
            assert!(message.as_ref().is_err_and(|m| m.contains(word)), "{word}: {message:?}");
        }
        let whole = ColourImage::new(
            yuv,
            Size { width: 7, height: 9 },
            &[plane(7, 1), plane(13, 3), plane(14, 2)],
        );
        assert!(whole.is_ok());
    }
}
