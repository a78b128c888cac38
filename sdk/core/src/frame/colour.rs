//! Colour images as cameras give them: formats, and what a whole image of each is.
//!
//! How they become amplitudes is [`super::convert`]'s.

use super::plane::Plane;
use crate::runtime::error::{Error, Result};

/// Most pixels of a camera image: over this it is refused rather than slow. 4K video and 12-megapixel stills are
/// under it, 8K is over.
pub const MAX_SOURCE_PIXELS: usize = 1 << 24;

/// The matrix between luma, chroma and colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum YuvMatrix {
    /// ITU-R BT.601: standard definition, JPEG, most Android cameras.
    #[default]
    Bt601,
    /// ITU-R BT.709: high definition.
    Bt709,
}

/// What the numbers of luma and chroma mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct YuvEncoding {
    /// The matrix.
    pub matrix: YuvMatrix,
    /// Whether luma runs over 16..=235 and chroma over 16..=240 ("video range"), not both over 0..=255.
    pub video_range: bool,
}

/// How a camera image lies in memory. Each plane has its own strides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ColourFormat {
    /// One plane; bytes red, green, blue, alpha (which is not looked at).
    Rgba,
    /// One plane; bytes blue, green, red, alpha (which is not looked at). iOS' 32BGRA.
    Bgra,
    /// One plane; bytes red, green, blue.
    Rgb,
    /// Two planes: luma; and at half the resolution, rounded up, blue and red chroma side by side. iOS' 420f (full
    /// range) and 420v (video range).
    Nv12(YuvEncoding),
    /// Three planes: luma, and at half the resolution, rounded up, blue chroma (U, Cb) and red chroma (V, Cr).
    /// Android's YUV_420_888 with any pixel strides, NV21 and I420 among them.
    Yuv420(YuvEncoding),
}

impl ColourFormat {
    /// How many planes an image has.
    pub fn planes(self) -> usize {
        match self {
            ColourFormat::Rgba | ColourFormat::Bgra | ColourFormat::Rgb => 1,
            ColourFormat::Nv12(_) => 2,
            ColourFormat::Yuv420(_) => 3,
        }
    }

    /// The names of the planes in errors, the bytes of a pixel in each, and how many pixels share one.
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

/// A camera image, borrowed.
#[derive(Debug, Clone, Copy)]
pub struct ColourImage<'a> {
    format: ColourFormat,
    width: usize,
    height: usize,
    planes: [Plane<'a>; 3],
}

impl<'a> ColourImage<'a> {
    /// An image of `width` × `height` pixels in `planes`.
    ///
    /// ```
    /// use phasefront::input::{ColourFormat, ColourImage, Plane, YuvEncoding};
    ///
    /// let (luma, chroma) = ([0; 640 * 480], [128; 640 * 240]);
    /// let format = ColourFormat::Nv12(YuvEncoding::default());
    /// let planes = [Plane::new(&luma, 640, 1), Plane::new(&chroma, 640, 2)];
    /// let image = ColourImage::new(format, 640, 480, &planes)?;
    /// # Ok::<(), phasefront::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Frame`] that names an empty or too large image, another number of planes than the format has, a
    /// stride that is too small, or a plane with too few bytes.
    pub fn new(format: ColourFormat, width: usize, height: usize, planes: &[Plane<'a>]) -> Result<Self> {
        check_size("colour", width, height)?;
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
            let (width, height) = (width.div_ceil(*share), height.div_ceil(*share));
            plane.check(what, width, height, *pixel_bytes)?;
            *to = *plane;
        }
        Ok(ColourImage {
            format,
            width,
            height,
            planes: all,
        })
    }

    /// How it lies in memory.
    pub fn format(&self) -> ColourFormat {
        self.format
    }

    /// (H, W) as the sensor gives it.
    pub fn shape(&self) -> (usize, usize) {
        (self.height, self.width)
    }

    /// The planes, as many as the format has.
    pub fn planes(&self) -> &[Plane<'a>] {
        &self.planes[..self.format.planes()]
    }
}

/// Checks the size of a camera image.
pub fn check_size(what: &str, width: usize, height: usize) -> Result<()> {
    match width.checked_mul(height) {
        Some(0) => Err(Error::Frame(format!(
            "{what} is empty ({width}×{height}); each side must be at least 1"
        ))),
        Some(pixels) if pixels <= MAX_SOURCE_PIXELS => Ok(()),
        _ => Err(Error::Frame(format!(
            "{what} of {width}×{height} pixels is too large; {MAX_SOURCE_PIXELS} pixels are the most, so ask the camera for a smaller format"
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
            let refused = ColourImage::new(format, width, height, &planes);
            let message = refused.map(|_| ()).map_err(|e| e.to_string());
            assert!(message.as_ref().is_err_and(|m| m.contains(word)), "{word}: {message:?}");
        }
        let whole = ColourImage::new(yuv, 7, 9, &[plane(7, 1), plane(13, 3), plane(14, 2)]);
        assert!(whole.is_ok());
    }
}
