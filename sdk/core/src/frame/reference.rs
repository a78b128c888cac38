//! The definitions of the conversion of camera images and of encoded colours. They compute each output pixel separately
//! in f64. Tests compare `convert` and `light` with them.

use super::colour::{ColourFormat, ColourImage, YuvEncoding, YuvMatrix};
use super::encoding::{Knee, RgbEncoding};
use super::light::{Gamut, to_lasers};
use super::plane::Orientation;
use super::resample::Crop;
use crate::Size;
use crate::display::Display;
use crate::display::primaries::times;

/// Converts `image`, turned by `orientation`, to amplitudes, (3, H, W), of `size`.
///
/// The output covers [`Crop::cover`] of the image. Each pixel is the mean of the image under a triangle as wide as the
/// pixel, but at least as wide as a sample. A chroma sample lies in the middle of its four pixels.
pub fn convert(image: &ColourImage<'_>, orientation: Orientation, size: Size) -> Vec<f32> {
    let Size { width, height } = size;
    let upright = orientation.upright_size(image.size());
    let crop = Crop::cover(upright, size);
    let mut rgb = vec![0.0; 3 * height * width];
    for y in 0..height {
        for x in 0..width {
            let centre = (
                crop.x + (x as f64 + 0.5) * crop.width / width as f64,
                crop.y + (y as f64 + 0.5) * crop.height / height as f64,
            );
            let sizes = (crop.width / width as f64, crop.height / height as f64);
            let mean = |plane, byte, share| mean(image, orientation, plane, byte, share, centre, sizes);
            let colour = match image.format() {
                ColourFormat::Rgba | ColourFormat::Rgb => [0, 1, 2].map(|b| mean(0, b, 1) / 255.0),
                ColourFormat::Bgra => [2, 1, 0].map(|b| mean(0, b, 1) / 255.0),
                ColourFormat::Nv12(encoding) => rgb_of_yuv([mean(0, 0, 1), mean(1, 0, 2), mean(1, 1, 2)], encoding),
                ColourFormat::Yuv420(encoding) => rgb_of_yuv([mean(0, 0, 1), mean(1, 0, 2), mean(2, 0, 2)], encoding),
            };
            for (c, value) in colour.into_iter().enumerate() {
                rgb[(c * height + y) * width + x] = value.clamp(0.0, 1.0) as f32;
            }
        }
    }
    rgb
}

/// Returns the mean of one byte of a plane under the triangle around `centre`, in upright pixels. Each sample of the
/// plane covers `share` × `share` pixels.
fn mean(
    image: &ColourImage<'_>,
    orientation: Orientation,
    plane: usize,
    byte: usize,
    share: usize,
    centre: (f64, f64),
    size: (f64, f64),
) -> f64 {
    let Size { width, height } = image.size();
    let plane = image.planes()[plane];
    let Size {
        width: upright_width,
        height: upright_height,
    } = orientation.upright_size(image.size());
    let (mut sum, mut weights) = (0.0, 0.0);
    for row in 0..height.div_ceil(share) {
        for column in 0..width.div_ceil(share) {
            // The middle of the sample in the sensor's image, then in the upright image.
            let x = (column as f64 + 0.5) * share as f64 / width as f64;
            let y = (row as f64 + 0.5) * share as f64 / height as f64;
            let (x, y) = turn(orientation, x, y);
            let (x, y) = (x * upright_width as f64, y * upright_height as f64);
            let weight = |apart: f64, size: f64| (1.0 - apart.abs() / size.max(share as f64)).max(0.0);
            let weight = weight(x - centre.0, size.0) * weight(y - centre.1, size.1);
            let at = row * plane.row_stride + column * plane.pixel_stride + byte;
            sum += weight * f64::from(plane.bytes[at]);
            weights += weight;
        }
    }
    sum / weights
}

/// Converts a point of the sensor's image to the upright image. Both have sides of length 1.
fn turn(orientation: Orientation, x: f64, y: f64) -> (f64, f64) {
    use super::plane::Rotation;
    let (x, y) = match orientation.rotation {
        Rotation::Upright => (x, y),
        Rotation::Clockwise90 => (1.0 - y, x),
        Rotation::Half => (1.0 - x, 1.0 - y),
        Rotation::Clockwise270 => (y, 1.0 - x),
    };
    (if orientation.mirrored { 1.0 - x } else { x }, y)
}

/// Converts luma and chroma to colour by solving Y = Kr·R + Kg·G + Kb·B, U = (B − Y)/(2 − 2Kb), V = (R − Y)/(2 −
/// 2Kr).
fn rgb_of_yuv([y, u, v]: [f64; 3], encoding: YuvEncoding) -> [f64; 3] {
    let (kr, kb) = match encoding.matrix {
        YuvMatrix::Bt601 => (0.299, 0.114),
        YuvMatrix::Bt709 => (0.2126, 0.0722),
        YuvMatrix::Bt2020 => (0.2627, 0.0593),
    };
    let (y, u, v) = if encoding.video_range {
        ((y - 16.0) / 219.0, (u - 128.0) / 224.0, (v - 128.0) / 224.0)
    } else {
        (y / 255.0, (u - 128.0) / 255.0, (v - 128.0) / 255.0)
    };
    let red = y + (2.0 - 2.0 * kr) * v;
    let blue = y + (2.0 - 2.0 * kb) * u;
    [red, (y - kr * red - kb * blue) / (1.0 - kr - kb), blue]
}

/// Converts one encoded colour to the amplitudes of the lasers of `display`, as [`super::LightPlan`] does.
pub fn amplitudes(rgb: [f64; 3], encoding: RgbEncoding, display: &Display) -> Vec<f64> {
    let luminance = |rgb: [f64; 3]| times(&encoding.to_xyz(), rgb)[1];
    let mut light = rgb.map(|value| encoding.light(value));
    if encoding.is_high_dynamic_range() {
        let gain = encoding.gain(luminance(light));
        light = light.map(|v| gain * v);
        let most = light.iter().copied().fold(0.0, f64::max);
        if most > 0.0 {
            light = light.map(|v| v * Knee::of_highlights().apply(most).min(1.0) / most);
        }
    }
    if display.colours() == 1 {
        return vec![luminance(light).sqrt()];
    }
    let matrix = to_lasers(encoding, display);
    let lasers = times(&matrix, light);
    let most = lasers.iter().copied().fold(0.0, f64::max);
    let saturation = 1.0 - lasers.iter().copied().fold(f64::INFINITY, f64::min) / most;
    let kept = Gamut::new(&matrix).knee.apply(saturation);
    let inside = |light: f64| {
        if saturation > 0.0 {
            most - (most - light) * kept / saturation
        } else {
            light
        }
    };
    lasers
        .iter()
        .map(|v| (inside(*v) / most.max(1.0)).clamp(0.0, 1.0).sqrt())
        .collect()
}
