//! Depth maps in files of any supported kind: one number for each pixel.

use crate::input::decode::{self, DEPTH_FORMATS, Pixels, Plane, Reading};
use crate::input::{self, MOST_PICTURE, npy};
use crate::output::has_extension;
use crate::{Error, Result};
use image::metadata::Orientation;
use image::{DynamicImage, Pixel, Rgb};
use ndarray::Array2;
use std::path::Path;

/// A depth map, (H, W), and the orientation from its file's Exif data.
#[derive(Debug)]
pub(crate) struct DepthFile {
    pub(crate) depth: Array2<f32>,
    pub(crate) orientation: Orientation,
}

/// Reads the values of a depth map, (H, W), from a file of [`DEPTH_FORMATS`], upright. If `normalized` is set, integers
/// are divided by the largest value of their type. If the colours are equal, one of them is used. Alpha is ignored.
///
/// # Errors
/// Returns an error if the file is missing, truncated, or of another kind.
pub fn read_depth(path: &Path, normalized: bool) -> Result<Array2<f32>> {
    read(path, normalized).map(|file| file.depth)
}

/// Reads a depth map as [`read_depth`] does, and its orientation.
pub(crate) fn read(path: &Path, normalized: bool) -> Result<DepthFile> {
    let (Plane { mut values, most }, orientation) = plane(path)?;
    if let Some(most) = most.filter(|_| normalized) {
        values.mapv_inplace(|v| v / most);
    }
    Ok(DepthFile {
        depth: values,
        orientation,
    })
}

/// Checks whether a depth map has whole numbers of 16 bits.
pub(crate) fn has_16_bits(path: &Path) -> bool {
    plane(path).is_ok_and(|(plane, _)| plane.most == Some(f32::from(u16::MAX)))
}

/// Reads a depth map and its orientation.
fn plane(path: &Path) -> Result<(Plane, Orientation)> {
    let refuse = |why: String| Error::file(path, why);
    if has_extension(path, "npy") {
        let plane = npy::read_plane(npy::open(path)?).map_err(refuse)?;
        return Ok((plane, Orientation::NoTransforms));
    }
    let file = input::open(path, MOST_PICTURE)?;
    let decoded = decode::decode(file, Reading::UPRIGHT).map_err(refuse)?;
    let plane = match decoded.pixels {
        Pixels::Plane(plane) => plane,
        Pixels::Image(image) => of_image(image).map_err(refuse)?,
    };
    Ok((plane, decoded.orientation))
}

fn of_image(image: DynamicImage) -> std::result::Result<Plane, String> {
    let shape = (image.height() as usize, image.width() as usize);
    let bytes = f32::from(u8::MAX);
    let words = f32::from(u16::MAX);
    let kind = image.color();
    let (values, most) = match image {
        DynamicImage::ImageLuma8(grey) => (Some(grey.into_raw().into_iter().map(f32::from).collect()), bytes),
        DynamicImage::ImageLuma16(grey) => (Some(grey.into_raw().into_iter().map(f32::from).collect()), words),
        DynamicImage::ImageLumaA8(grey) => (Some(grey.pixels().map(|p| f32::from(p.0[0])).collect()), bytes),
        DynamicImage::ImageLumaA16(grey) => (Some(grey.pixels().map(|p| f32::from(p.0[0])).collect()), words),
        DynamicImage::ImageRgb8(rgb) => (equal(rgb.pixels().copied()), bytes),
        DynamicImage::ImageRgba8(rgba) => (equal(rgba.pixels().map(Pixel::to_rgb)), bytes),
        DynamicImage::ImageRgb16(rgb) => (equal(rgb.pixels().copied()), words),
        DynamicImage::ImageRgba16(rgba) => (equal(rgba.pixels().map(Pixel::to_rgb)), words),
        _ => return Err(format!("holds {kind:?} pixels; depth is {DEPTH_FORMATS}")),
    };
    let values: Vec<f32> = values.ok_or_else(|| {
        format!(
            "holds colours: it looks like a colour picture, or a depth map in false colours; depth is {DEPTH_FORMATS}"
        )
    })?;
    let values = Array2::from_shape_vec(shape, values).map_err(|e| e.to_string())?;
    Ok(Plane {
        values,
        most: Some(most),
    })
}

/// Returns one colour of each pixel if all three are equal in every pixel.
fn equal<T: Copy + PartialEq + Into<f32>>(pixels: impl Iterator<Item = Rgb<T>>) -> Option<Vec<f32>> {
    pixels
        .map(|Rgb([r, g, b])| (r == g && g == b).then(|| r.into()))
        .collect()
}
