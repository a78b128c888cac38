//! Export of pictures for people: views and maps as PNG, JPEG or WebP, and stacks of them as an animated GIF or WebP.

use crate::{Error, Result, output, picture};
use image::codecs::gif::{GifEncoder, Repeat};
use image::codecs::jpeg::JpegEncoder;
use image::imageops::{self, FilterType};
use image::{Delay, DynamicImage, Frame, RgbImage};
use ndarray::ArrayView3;
use phasefront_core::view::colours::ViewColours;
use std::io::Write;
use std::path::Path;

/// The quality of JPEG and lossy WebP, from 0 to 100.
const QUALITY: u8 = 90;
/// The duration of a frame of an animation, in ms.
const FRAME_MS: u32 = 100;
/// The longest side of a WebP, in pixels.
const WEBP_SIDE: u32 = 16383;

/// Converts the amplitudes of a view, (C, H, W), to a picture by `colours`. Light above full light is clipped, and one
/// laser's is grey.
pub fn of_view(amplitude: ArrayView3<'_, f32>, colours: &ViewColours) -> RgbImage {
    let (lasers, height, width) = amplitude.dim();
    let (columns, rows) = (width as u32, height as u32);
    if *colours == ViewColours::Amplitude {
        return RgbImage::from_raw(columns, rows, picture::amplitude_bytes(amplitude)).expect("three bytes a pixel");
    }
    RgbImage::from_fn(columns, rows, |x, y| {
        let at = [0, 1, 2].map(|laser| amplitude[(laser.min(lasers - 1), y as usize, x as usize)]);
        image::Rgb(colours.bytes(&at[..lasers]))
    })
}

/// Scales `picture` down to a width of `width` pixels and keeps its aspect ratio. A narrower picture stays unchanged.
pub fn at_width(picture: RgbImage, width: u32) -> RgbImage {
    if picture.width() <= width {
        return picture;
    }
    let height = (f64::from(picture.height()) * f64::from(width) / f64::from(picture.width())).round() as u32;
    imageops::resize(&picture, width.max(1), height.max(1), FilterType::Triangle)
}

/// Encodes `picture` as lossy WebP of `quality`, from 0 to 100.
///
/// # Errors
/// Returns an error if the picture is too large for the format.
pub fn webp(picture: &RgbImage, quality: f32) -> Result<Vec<u8>> {
    let (width, height) = picture.dimensions();
    let encoder = webp::Encoder::from_rgb(picture.as_raw(), width, height);
    let encoded = encoder.encode_simple(false, quality).map_err(|_| too_large(picture))?;
    Ok(encoded.to_vec())
}

/// Encodes `picture` as lossless WebP.
pub fn webp_lossless(picture: &RgbImage) -> Vec<u8> {
    let (width, height) = picture.dimensions();
    webp::Encoder::from_rgb(picture.as_raw(), width, height)
        .encode_lossless()
        .to_vec()
}

fn too_large(picture: &RgbImage) -> Error {
    Error::Input(format!(
        "{}×{} pixels are too many for WebP, whose sides are at most {WEBP_SIDE}; give a smaller --width",
        picture.width(),
        picture.height()
    ))
}

/// Checks whether the extension of `path` is that of an animation: .gif or .webp.
pub fn moves(path: &Path) -> bool {
    ["gif", "webp"].iter().any(|e| output::has_extension(path, e))
}

/// Writes `picture` in the format of the file extension: .png, .jpg or .webp.
///
/// # Errors
/// Returns an error if the extension is another or the file cannot be written.
pub fn write(path: &Path, picture: &RgbImage) -> Result<()> {
    let is = |extension| output::has_extension(path, extension);
    if is("png") || output::is_stdout(path) {
        return picture::write_rgb(path, picture);
    }
    if is("webp") {
        let bytes = webp(picture, f32::from(QUALITY))?;
        return output::write_atomically(path, |file| file.write_all(&bytes));
    }
    if is("jpg") || is("jpeg") {
        return output::write_atomically(path, |file| {
            let encoder = JpegEncoder::new_with_quality(file, QUALITY);
            picture.write_with_encoder(encoder).map_err(std::io::Error::other)
        });
    }
    Err(Error::file(path, "a picture's name must end in .png, .jpg or .webp"))
}

/// Writes `pictures`, all of the same size, as an animation that plays forward and back at ten frames per second, in
/// the format of the file extension: .gif or .webp.
///
/// # Errors
/// Returns an error if the extension is another or the file cannot be written.
pub fn write_moving(path: &Path, pictures: &[RgbImage]) -> Result<()> {
    let back = pictures.iter().skip(1).rev().skip(1);
    let frames = pictures.iter().chain(back);
    if output::has_extension(path, "gif") {
        return output::write_atomically(path, |file| {
            let other = std::io::Error::other;
            let mut encoder = GifEncoder::new_with_speed(file, 10);
            encoder.set_repeat(Repeat::Infinite).map_err(other)?;
            for picture in frames {
                let image = DynamicImage::from(picture.clone()).into_rgba8();
                let delay = Delay::from_numer_denom_ms(FRAME_MS, 1);
                let frame = Frame::from_parts(image, 0, 0, delay);
                encoder.encode_frame(frame).map_err(other)?;
            }
            Ok(())
        });
    }
    if output::has_extension(path, "webp") {
        let bytes = moving_webp(frames)?;
        return output::write_atomically(path, |file| file.write_all(&bytes));
    }
    Err(Error::file(path, "a moving picture's name must end in .gif or .webp"))
}

fn moving_webp<'a>(frames: impl Iterator<Item = &'a RgbImage>) -> Result<Vec<u8>> {
    let frames: Vec<_> = frames.collect();
    let first = frames
        .first()
        .ok_or_else(|| Error::Input("no picture to write".into()))?;
    let mut config = webp::WebPConfig::new().map_err(|()| Error::Input("libwebp gave no default settings".into()))?;
    config.quality = f32::from(QUALITY);
    let (width, height) = first.dimensions();
    let mut encoder = webp::AnimEncoder::new(width, height, &config);
    for (index, picture) in frames.iter().enumerate() {
        let at_ms = index as i32 * FRAME_MS as i32;
        encoder.add_frame(webp::AnimFrame::from_rgb(picture.as_raw(), width, height, at_ms));
    }
    let encoded = encoder.try_encode().map_err(|_| too_large(first))?;
    Ok(encoded.to_vec())
}
