//! Depth maps in files of any supported kind: one number for each pixel.

use crate::input::decode::{self, DEPTH_FORMATS, Numbers, Pixels, Plane, Reading};
use crate::input::{self, MOST_ARRAY, MOST_PICTURE, anymap, npy, npz};
use crate::output::has_extension;
use crate::{Error, Result};
use image::metadata::Orientation;
use image::{DynamicImage, ImageBuffer, Pixel, Primitive};
use ndarray::Array2;
use std::io::BufRead;
use std::path::Path;

/// A depth map, (H, W), and the orientation from its file's Exif data.
#[derive(Debug)]
pub(crate) struct DepthFile {
    pub(crate) depth: Array2<f32>,
    pub(crate) orientation: Orientation,
}

/// Reads the values of a depth map, (H, W), from a file of [`DEPTH_FORMATS`], upright. If `normalized` is set, integers
/// are divided by the largest value of their type. Otherwise the largest value of an integer type and of 16-bit floats
/// becomes NaN, for no reading. Of colours that are nearly equal the mean is used, and of others the one channel that
/// varies. Alpha is ignored.
///
/// # Errors
/// Returns an error if the file is missing, truncated, or of another kind.
pub fn read_depth(path: &Path, normalized: bool) -> Result<Array2<f32>> {
    read(path, normalized).map(|file| file.depth)
}

/// Reads a depth map as [`read_depth`] does, and its orientation.
pub(crate) fn read(path: &Path, normalized: bool) -> Result<DepthFile> {
    let (Plane { mut values, numbers }, orientation) = plane(path)?;
    match numbers {
        Numbers::Integers { most } if normalized => values.mapv_inplace(|v| v / most),
        _ if normalized => {}
        numbers => values.mapv_inplace(|v| if v < numbers.no_reading() { v } else { f32::NAN }),
    }
    Ok(DepthFile {
        depth: values,
        orientation,
    })
}

/// Checks whether a depth map has whole numbers of 16 bits.
pub(crate) fn has_16_bits(path: &Path) -> bool {
    let words = f32::from(u16::MAX);
    plane(path).is_ok_and(|(plane, _)| matches!(plane.numbers, Numbers::Integers { most } if most == words))
}

/// Reads a depth map as its file has it, and its orientation.
fn plane(path: &Path) -> Result<(Plane, Orientation)> {
    let refuse = |why: String| Error::file(path, why);
    let mut file = input::open(path, MOST_PICTURE)?;
    let head = (file.fill_buf()).map_err(|e| Error::file(path, format!("cannot be read: {e}")))?;
    let is_npy = head.starts_with(b"\x93NUMPY") || has_extension(path, "npy");
    let (is_npz, is_anymap) = (head.starts_with(b"PK\x03\x04"), anymap::is(head));
    let plane = if is_npy {
        npy::read_plane(npy::open(path)?)
    } else if is_npz {
        npz::read_plane(&input::bytes(path, MOST_ARRAY)?)
    } else if is_anymap {
        anymap::read_plane(&input::bytes(path, MOST_ARRAY)?)
    } else {
        let decoded = decode::decode(file, Reading::UPRIGHT).map_err(refuse)?;
        let plane = match decoded.pixels {
            Pixels::Plane(plane) => plane,
            Pixels::Image(image) => of_image(image).map_err(refuse)?,
        };
        return Ok((plane, decoded.orientation));
    };
    Ok((plane.map_err(refuse)?, Orientation::NoTransforms))
}

fn of_image(image: DynamicImage) -> std::result::Result<Plane, String> {
    let shape = (image.height() as usize, image.width() as usize);
    let kind = image.color();
    let (values, most) = match image {
        DynamicImage::ImageLuma8(grey) => (floats(grey.into_raw()), f32::from(u8::MAX)),
        DynamicImage::ImageLuma16(grey) => (floats(grey.into_raw()), f32::from(u16::MAX)),
        DynamicImage::ImageLumaA8(grey) => (grey.pixels().map(|p| p.0[0].into()).collect(), f32::from(u8::MAX)),
        DynamicImage::ImageLumaA16(grey) => (grey.pixels().map(|p| p.0[0].into()).collect(), f32::from(u16::MAX)),
        DynamicImage::ImageRgb8(rgb) => (of_colours(&rgb)?, f32::from(u8::MAX)),
        DynamicImage::ImageRgba8(rgba) => (of_colours(&rgba)?, f32::from(u8::MAX)),
        DynamicImage::ImageRgb16(rgb) => (of_colours(&rgb)?, f32::from(u16::MAX)),
        DynamicImage::ImageRgba16(rgba) => (of_colours(&rgba)?, f32::from(u16::MAX)),
        _ => return Err(format!("holds {kind:?} pixels; depth is {DEPTH_FORMATS}")),
    };
    let values = Array2::from_shape_vec(shape, values).map_err(|e| e.to_string())?;
    Ok(Plane {
        values,
        numbers: Numbers::Integers { most },
    })
}

fn floats<T: Into<f32>>(levels: Vec<T>) -> Vec<f32> {
    levels.into_iter().map(Into::into).collect()
}

/// The largest difference of a grey pixel's colours, as a share of full scale. Lossy compression leaves up to two
/// levels of 255, and colour conversion one.
const MOST_APART: f32 = 4.0 / 255.0;

/// Returns the grey of each pixel of `image`: the mean of its colours if they are nearly equal in every pixel, or the
/// one channel that varies.
///
/// # Errors
/// Returns an error if the image has colours.
fn of_colours<P: Pixel>(image: &ImageBuffer<P, Vec<P::Subpixel>>) -> std::result::Result<Vec<f32>, String>
where
    P::Subpixel: Into<f32>,
{
    let full: f32 = P::Subpixel::DEFAULT_MAX_VALUE.into();
    let colours = || image.pixels().map(|pixel| pixel.to_rgb().0.map(Into::<f32>::into));
    let is_grey = colours().all(|[r, g, b]| r.max(g).max(b) - r.min(g).min(b) <= MOST_APART * full);
    if is_grey {
        return Ok(colours().map(|[r, g, b]| (r + g + b) / 3.0).collect());
    }
    let first = colours().next().unwrap_or_default();
    let varies = [0, 1, 2].map(|channel| colours().any(|colour| colour[channel] != first[channel]));
    match varies {
        [true, false, false] => Ok(colours().map(|[r, ..]| r).collect()),
        [false, true, false] => Ok(colours().map(|[_, g, _]| g).collect()),
        [false, false, true] => Ok(colours().map(|[.., b]| b).collect()),
        _ => Err(format!(
            "holds colours: it looks like a colour picture, or a depth map in false colours; depth is {DEPTH_FORMATS}"
        )),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use image::{Rgb, RgbImage};

    fn read(pixel: impl Fn(u32, u32) -> [u8; 3]) -> std::result::Result<Vec<f32>, String> {
        let image = RgbImage::from_fn(16, 8, |x, y| Rgb(pixel(x, y)));
        of_image(image.into()).map(|plane| plane.values.into_raw_vec_and_offset().0)
    }

    fn level(x: u32, y: u32) -> u8 {
        (20 + 16 * y + x) as u8
    }

    #[test]
    fn grey_with_the_noise_of_compression_is_read() {
        let want = read(|x, y| [level(x, y); 3]).unwrap();
        assert_eq!(want[17], 37.0);
        // Lossy WebP stores luma and chroma of 8 bits and a limited range.
        let lossy = read(|x, y| [level(x, y), level(x, y) + 1, level(x, y)]).unwrap();
        assert!(want.iter().zip(&lossy).all(|(a, b)| (a - b).abs() <= 0.5));
        assert!(read(|x, y| [level(x, y), level(x, y), level(x, y) + 5]).is_err());
        // A few coloured pixels are a picture.
        assert!(
            read(|x, y| if (x, y) == (9, 3) {
                [200, 30, 30]
            } else {
                [level(x, y); 3]
            })
            .is_err()
        );
    }

    #[test]
    fn depth_in_one_channel_is_read() {
        let want = read(|x, y| [level(x, y); 3]).unwrap();
        assert_eq!(read(|x, y| [level(x, y), 0, 0]).unwrap(), want);
        assert_eq!(read(|x, y| [0, level(x, y), 255]).unwrap(), want);
        assert_eq!(read(|x, y| [0, 0, level(x, y)]).unwrap(), want);
        assert!(read(|_, _| [200, 0, 0]).is_err());
        assert!(read(|x, y| [level(x, y), level(y, x), 0]).is_err());
    }
}
