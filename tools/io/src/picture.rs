//! Colour pictures, read as amplitudes or bytes and written as PNG.

pub mod colours;
pub mod depth_map;
pub mod difference;
pub mod export;
pub(crate) mod heif;
pub(crate) mod linear;
pub mod photo;
pub mod plot;

use crate::Result;
use crate::input::decode::{self, Reading};
use crate::output::Pending;
use image::{DynamicImage, RgbImage};
use ndarray::{Array3, ArrayView3, s};
use phasefront::Size;
use std::path::Path;

/// Opens the picture at `path` and turns it upright.
pub(crate) fn open_image(path: &Path) -> Result<DynamicImage> {
    decode::open_picture(path, Reading::UPRIGHT).map(|(image, _)| image)
}

/// Drops an alpha channel that says that every pixel is opaque, as screenshots have.
pub(crate) fn opaque(image: DynamicImage) -> DynamicImage {
    match &image {
        DynamicImage::ImageRgba8(rgba) if rgba.pixels().all(|pixel| pixel.0[3] == 255) => image.into_rgb8().into(),
        DynamicImage::ImageLumaA8(grey) if grey.pixels().all(|pixel| pixel.0[1] == 255) => image.into_luma8().into(),
        _ => image,
    }
}

/// Reads the amplitudes of an image, (3, H, W) in \[0, 1], upright. Grey images give three equal colours. Alpha is
/// ignored.
///
/// # Errors
/// Returns an error if the file is missing, truncated, or not one of
/// [`COLOUR_FORMATS`](crate::input::decode::COLOUR_FORMATS).
pub fn read_rgb(path: &Path) -> Result<Array3<f32>> {
    open_image(path).map(amplitudes)
}

/// Converts `image` to amplitudes, (3, H, W) in \[0, 1].
pub fn amplitudes(image: DynamicImage) -> Array3<f32> {
    let shape = (3, image.height() as usize, image.width() as usize);
    // A conversion through float images would need twice the memory.
    let values = match image {
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => planar(&image.into_rgb16(), |v| f32::from(v) / 65535.0),
        image => planar(&image.into_rgb8(), |v| f32::from(v) / 255.0),
    };
    Array3::from_shape_vec(shape, values).expect("three values for each pixel")
}

/// Returns the values of interleaved pixels of three colours, one plane after the other.
fn planar<T: Copy>(pixels: &[T], value: impl Fn(T) -> f32) -> Vec<f32> {
    let mut values = Vec::with_capacity(pixels.len());
    for colour in 0..3 {
        values.extend(pixels.as_chunks::<3>().0.iter().map(|pixel| value(pixel[colour])));
    }
    values
}

/// Reads the size of an image, upright, and its pixels as rows of RGB bytes. Grey images give three equal colours.
/// Alpha is ignored.
///
/// # Errors
/// Returns an error if the file is missing, truncated, or not one of
/// [`COLOUR_FORMATS`](crate::input::decode::COLOUR_FORMATS).
pub fn read_rgb_bytes(path: &Path) -> Result<(Size, Vec<u8>)> {
    let image = open_image(path)?.into_rgb8();
    let size = Size {
        width: image.width() as usize,
        height: image.height() as usize,
    };
    Ok((size, image.into_raw()))
}

/// Writes amplitudes, (C, H, W), as an 8-bit RGB PNG. Values above 1 are clipped, and one laser's are grey.
///
/// # Errors
/// Returns an error if the file cannot be written.
pub fn write_amplitude(path: &Path, amplitude: ArrayView3<'_, f32>) -> Result<()> {
    let bytes = amplitude_bytes(amplitude);
    let (_, height, width) = amplitude.dim();
    write_png_of(path, PngShape::of_levels(3, Size { width, height }), &bytes, &[])
}

/// Converts amplitudes, (C, H, W), to rows of RGB bytes. One laser's are grey.
pub fn amplitude_bytes(amplitude: ArrayView3<'_, f32>) -> Vec<u8> {
    // The whole part of a value plus the largest number below ½ is what `f32::round` gives by a call.
    const HALF: f32 = 0.499_999_97;
    interleaved(as_rgb(&amplitude), |v| (v.clamp(0.0, 1.0) * 255.0 + HALF) as u8)
}

/// Views a stack of (C, H, W) as (3, H, W). A single plane is repeated for all three colours.
pub fn as_rgb<'a, T>(stack: &'a ArrayView3<'_, T>) -> ArrayView3<'a, T> {
    let (_, height, width) = stack.dim();
    stack.broadcast((3, height, width)).expect("three colours or one")
}

pub(crate) fn interleaved<T: Copy>(stack: ArrayView3<'_, T>, byte: impl Fn(T) -> u8) -> Vec<u8> {
    let (colours, height, width) = stack.dim();
    let mut bytes = vec![0; colours * height * width];
    for (y, row) in bytes.chunks_exact_mut((colours * width).max(1)).enumerate() {
        for colour in 0..colours {
            let values = stack.slice(s![colour, y, ..]);
            for (to, value) in row[colour..].iter_mut().step_by(colours).zip(values) {
                *to = byte(*value);
            }
        }
    }
    bytes
}

/// Writes an 8-bit RGB PNG.
///
/// # Errors
/// Returns an error if the file cannot be written.
pub fn write_rgb(path: &Path, picture: &RgbImage) -> Result<()> {
    let (width, height) = picture.dimensions();
    let shape = PngShape::of_levels(
        3,
        Size {
            width: width as usize,
            height: height as usize,
        },
    );
    write_png_of(path, shape, picture.as_raw(), &[])
}

/// Writes rows of `rgba` as an 8-bit RGBA PNG.
///
/// # Errors
/// Returns an error if the file cannot be written.
pub fn write_rgba(path: &Path, size: Size, rgba: &[u8]) -> Result<()> {
    let Size { width, height } = size;
    let shape = PngShape {
        width,
        height,
        color: png::ColorType::Rgba,
        depth: png::BitDepth::Eight,
    };
    write_png_of(path, shape, rgba, &[])
}

/// The size and type of a PNG's pixels.
#[derive(Clone, Copy)]
pub(crate) struct PngShape {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) color: png::ColorType,
    pub(crate) depth: png::BitDepth,
}

impl PngShape {
    /// Creates the shape of bytes of `colours` and `size`.
    pub(crate) fn of_levels(colours: usize, size: Size) -> Self {
        let Size { width, height } = size;
        PngShape {
            width,
            height,
            color: png_color(colours),
            depth: png::BitDepth::Eight,
        }
    }
}

/// Returns the PNG colour type for a number of colours: RGB, or grey for one laser.
pub(crate) fn png_color(colours: usize) -> png::ColorType {
    match colours {
        1 => png::ColorType::Grayscale,
        _ => png::ColorType::Rgb,
    }
}

/// Writes rows of `pixels` as a PNG with text chunks of these names. 16-bit values are big-endian.
pub(crate) fn write_png_of(path: &Path, shape: PngShape, pixels: &[u8], texts: &[(&str, String)]) -> Result<()> {
    pending_png(path, shape, pixels, texts)?.place()
}

/// Performs [`write_png_of`] without putting the file in place yet.
pub(crate) fn pending_png(path: &Path, shape: PngShape, pixels: &[u8], texts: &[(&str, String)]) -> Result<Pending> {
    Pending::write(path, |file| {
        let mut encoder = png::Encoder::new(file, shape.width as u32, shape.height as u32);
        encoder.set_color(shape.color);
        encoder.set_depth(shape.depth);
        let other = std::io::Error::other;
        for (name, text) in texts {
            encoder.add_text_chunk((*name).into(), text.clone()).map_err(other)?;
        }
        let mut writer = encoder.write_header().map_err(other)?;
        writer.write_image_data(pixels).map_err(other)?;
        writer.finish().map_err(other)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_rounded_and_interleaved_and_come_back() {
        let value = |i: usize| (i % 256) as f32 / 255.0;
        let stack = Array3::from_shape_fn((3, 40, 9), |(c, y, x)| value(c * 91 + y * 9 + x));
        let bytes = amplitude_bytes(stack.view());
        for ((c, y, x), value) in stack.indexed_iter() {
            assert_eq!(bytes[3 * (9 * y + x) + c], (value * 255.0).round() as u8);
        }
        let image = RgbImage::from_raw(9, 40, bytes).expect("its bytes");
        assert_eq!(amplitudes(image.into()), stack);
        let below = 0.5f32.next_down() / 255.0;
        let edges = [below, 0.5 / 255.0, 1.5 / 255.0, 254.499 / 255.0, -1.0, 2.0, f32::NAN];
        let edges = Array3::from_shape_fn((1, 1, edges.len()), |(_, _, x)| edges[x]);
        let expected: Vec<u8> = (edges.iter().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8)).collect();
        let pixels = amplitude_bytes(edges.view());
        assert!(pixels.as_chunks::<3>().0.iter().map(|pixel| pixel[0]).eq(expected));
    }
}
