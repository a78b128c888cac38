//! Photographs with values proportional to light, read from PNG or TIFF and written as PNG.
//!
//! The camera's tone curve must be off, as in a raw file developed linearly. This module cannot undo a tone curve.

use crate::camera::homography::Homography;
use image::DynamicImage;
use ndarray::Array2;
use phasefront::Size;
use phasefront_core::frame::encoding::RgbEncoding;
use phasefront_io::input::decode::{self, Reading};
use phasefront_io::output::write_atomically;
use phasefront_io::{Error, Result};
use rayon::prelude::*;
use std::path::Path;

/// The maximum number of pixels of a photograph: 200 megapixels.
const MOST_PIXELS: u64 = 200_000_000;

/// The maximum fraction of pixels at the sensor's limit. A photograph with more is treated as saturated.
pub const SATURATED_SHARE: f64 = 1e-3;

/// Grey values, (H, W), linear in light.
#[derive(Debug, Clone, PartialEq)]
pub struct Photograph {
    /// The number of pixels along y.
    pub height: usize,
    /// The number of pixels along x.
    pub width: usize,
    /// The values, row by row.
    pub values: Vec<u16>,
    /// The largest possible value: 255 for 8 bits, 65535 for 16 bits.
    pub full: u16,
}

impl Photograph {
    /// Reads an 8- or 16-bit PNG or TIFF, grey or colour. From a colour image it reads channel `colour` (0 red, 1
    /// green, 2 blue).
    ///
    /// # Errors
    /// Returns an error if the file is missing, truncated, of another kind, or larger than 200 megapixels.
    pub fn read(path: &Path, colour: usize) -> Result<Self> {
        let how = Reading {
            most_pixels: MOST_PIXELS,
            ..Reading::AS_STORED
        };
        let (image, _) = decode::open_picture(path, how)?;
        let (height, width) = (image.height() as usize, image.width() as usize);
        let eight = |bytes: Vec<u8>, channels: usize| {
            let values = every(bytes, channels, colour, u16::from);
            (values, 255)
        };
        let sixteen = |words: Vec<u16>, channels: usize| (every(words, channels, colour, |v| v), 65535);
        let (values, full) = match image {
            DynamicImage::ImageLuma8(i) => eight(i.into_raw(), 1),
            DynamicImage::ImageLumaA8(i) => eight(i.into_raw(), 2),
            DynamicImage::ImageRgb8(i) => eight(i.into_raw(), 3),
            DynamicImage::ImageRgba8(i) => eight(i.into_raw(), 4),
            DynamicImage::ImageLuma16(i) => sixteen(i.into_raw(), 1),
            DynamicImage::ImageLumaA16(i) => sixteen(i.into_raw(), 2),
            DynamicImage::ImageRgb16(i) => sixteen(i.into_raw(), 3),
            DynamicImage::ImageRgba16(i) => sixteen(i.into_raw(), 4),
            other => return Err(kind(path, &other.color())),
        };
        Ok(Photograph {
            height,
            width,
            values,
            full,
        })
    }

    /// Returns the photograph with values linear in light, of 16 bits, where they are those of sRGB.
    pub fn linear_of_srgb(&self) -> Self {
        let linear = |value: &u16| {
            let light = RgbEncoding::Srgb.light(f64::from(*value) / f64::from(self.full));
            (light * 65535.0).round() as u16
        };
        Photograph {
            values: self.values.iter().map(linear).collect(),
            full: 65535,
            ..*self
        }
    }

    /// Writes a grey PNG, with 8 bits if `full` is 255 and 16 bits otherwise.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let eight = self.full == 255;
        let bytes: Vec<u8> = if eight {
            self.values.iter().map(|v| *v as u8).collect()
        } else {
            self.values.iter().flat_map(|v| v.to_be_bytes()).collect()
        };
        write_atomically(path, |file| {
            let mut encoder = png::Encoder::new(file, self.width as u32, self.height as u32);
            encoder.set_color(png::ColorType::Grayscale);
            encoder.set_depth(if eight {
                png::BitDepth::Eight
            } else {
                png::BitDepth::Sixteen
            });
            encoder.set_compression(png::Compression::Fast);
            let other = std::io::Error::other;
            let mut writer = encoder.write_header().map_err(other)?;
            writer.write_image_data(&bytes).map_err(other)?;
            writer.finish().map_err(other)
        })
    }

    /// Returns the fraction of pixels at the sensor's limit. It is 0 unless the brightest value is a limit of sensors:
    /// 255, or the largest number of 10, 12, 14 or 16 bits, aligned to either end of a 16-bit word.
    pub fn saturated(&self) -> f64 {
        let most = self.values.iter().copied().max().unwrap_or(0);
        let is_end = match self.full {
            255 => most == 255,
            _ => [10, 12, 14, 16].iter().any(|bits| {
                let all = (1u32 << bits) - 1;
                u32::from(most) == all || u32::from(most) == all << (16 - bits)
            }),
        };
        if is_end {
            let at_end = self.values.iter().filter(|v| **v == most).count();
            at_end as f64 / self.values.len() as f64
        } else {
            0.0
        }
    }

    /// Interpolates the value at (`x`, `y`) between the four nearest pixels. Pixel centres are at half-integers, and
    /// border pixels are repeated outside.
    pub fn sample(&self, x: f64, y: f64) -> f32 {
        let (x, y) = (x - 0.5, y - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = ((x - x0) as f32, (y - y0) as f32);
        let column = |x: f64| x.clamp(0.0, (self.width - 1) as f64) as usize;
        let row = |y: f64| y.clamp(0.0, (self.height - 1) as f64) as usize;
        let (left, right) = (column(x0), column(x0 + 1.0));
        let at = |y: f64| {
            let line = &self.values[row(y) * self.width..][..self.width];
            let (a, b) = (f32::from(line[left]), f32::from(line[right]));
            a + (b - a) * fx
        };
        let (top, bottom) = (at(y0), at(y0 + 1.0));
        top + (bottom - top) * fy
    }

    /// Resamples the photograph to pixels of `size`, (H, W). `map` takes their places to the photograph, in which
    /// each is about `zoom` pixels wide. Each value is the mean over a pixel, as a fraction of the sensor's range.
    pub fn through(&self, map: &Homography, zoom: f64, Size { width, height }: Size) -> Array2<f32> {
        let n = zoom.ceil().clamp(1.0, 8.0) as usize;
        let at = |i: usize| (2 * i + 1) as f64 / (2 * n) as f64;
        let scale = 1.0 / (f32::from(self.full) * (n * n) as f32);
        let mut out = Array2::zeros((height, width));
        let rows = out.as_slice_mut().expect("standard layout");
        rows.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
            for (x, value) in row.iter_mut().enumerate() {
                for i in 0..n {
                    for j in 0..n {
                        let [u, v] = map.map([x as f64 + at(i), y as f64 + at(j)]);
                        *value += self.sample(u, v);
                    }
                }
                *value *= scale;
            }
        });
        out
    }

    /// Averages blocks of `factor`×`factor` pixels and drops incomplete blocks at the end: (H/f, W/f).
    pub fn shrunk(&self, factor: usize) -> (usize, usize, Vec<f32>) {
        let (height, width) = (self.height / factor, self.width / factor);
        let mut out = vec![0.0; height * width];
        for (y, line) in out.chunks_exact_mut(width.max(1)).enumerate() {
            for dy in 0..factor {
                let row = &self.values[(y * factor + dy) * self.width..][..width * factor];
                for (sum, block) in line.iter_mut().zip(row.chunks_exact(factor)) {
                    *sum += block.iter().map(|v| f32::from(*v)).sum::<f32>();
                }
            }
            line.iter_mut().for_each(|v| *v /= (factor * factor) as f32);
        }
        (height, width, out)
    }
}

/// Returns channel `colour` of each pixel, or the grey value of a grey image.
fn every<T: Copy>(raw: Vec<T>, channels: usize, colour: usize, to: impl Fn(T) -> u16) -> Vec<u16> {
    let channel = if channels >= 3 { colour } else { 0 };
    raw.chunks_exact(channels).map(|p| to(p[channel])).collect()
}

fn kind(path: &Path, what: &dyn std::fmt::Debug) -> Error {
    Error::file(
        path,
        format!("holds {what:?} pixels; a photograph must be grey or RGB, of 8 or 16 bits"),
    )
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn ramp(full: u16) -> Photograph {
        let values = (0..12 * 9).map(|i| (i * 331 % 256) * (full / 255)).collect();
        Photograph {
            height: 9,
            width: 12,
            values,
            full,
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let dir = tempfile::tempdir().unwrap();
        for full in [255, 65535] {
            let path = dir.path().join("p.png");
            ramp(full).write(&path).unwrap();
            assert_eq!(Photograph::read(&path, 1).unwrap(), ramp(full));
        }
    }

    #[test]
    fn tiff_is_read_and_of_colour_one_channel() {
        let dir = tempfile::tempdir().unwrap();
        let grey = dir.path().join("g.tif");
        let encoder = |path: &Path| tiff::encoder::TiffEncoder::new(std::fs::File::create(path).unwrap());
        let p = ramp(65535);
        encoder(&grey)
            .unwrap()
            .write_image::<tiff::encoder::colortype::Gray16>(12, 9, &p.values)
            .unwrap();
        assert_eq!(Photograph::read(&grey, 2).unwrap(), p);
        let colour = dir.path().join("c.TIFF");
        let rgb: Vec<u8> = (0..36 * 9).map(|i| (i % 251) as u8).collect();
        encoder(&colour)
            .unwrap()
            .write_image::<tiff::encoder::colortype::RGB8>(12, 9, &rgb)
            .unwrap();
        let green = Photograph::read(&colour, 1).unwrap();
        assert_eq!((green.values[0], green.values[1], green.full), (1, 4, 255));
        std::fs::write(&grey, b"II*\0 and nothing more").unwrap();
        assert!(Photograph::read(&grey, 0).unwrap_err().to_string().contains("g.tif"));
    }

    #[test]
    fn the_sensor_s_end_is_told_from_a_bright_wall() {
        let mut p = ramp(65535);
        p.values.fill(4095);
        assert_eq!(p.saturated(), 1.0);
        p.values.fill(40_000);
        assert_eq!(p.saturated(), 0.0);
        p.values[3] = 65535;
        assert!((p.saturated() - 1.0 / 108.0).abs() < 1e-12);
    }

    #[test]
    fn samples_lie_between_pixels_and_blocks_are_means() {
        let mut p = ramp(255);
        (p.values[0], p.values[1], p.values[12], p.values[13]) = (10, 20, 30, 40);
        assert_eq!(p.sample(1.0, 1.0), 25.0);
        assert_eq!(p.sample(-3.0, 0.5), 10.0);
        assert_eq!(p.shrunk(2).2[0], 25.0);
        assert_eq!((p.shrunk(2).0, p.shrunk(2).1), (4, 6));
    }
}
