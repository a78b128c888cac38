//! The calibration files that a display file refers to: the per-pixel table, the laser map, the aberrations
//! and the learned model.
//!
//! * The table holds the bytes of [`phasefront_core::display::response::per_pixel`].
//! * The learned model holds the bytes of [`phasefront_core::display::model`].
//! * The laser map is an 8- or 16-bit PNG, RGB, or grey for one laser. It holds the lasers' amplitudes at nodes spread
//!   evenly from the first to the last pixel of each axis. Each colour has an arbitrary scale.
//! * The aberrations are TOML with one `[[at]]` for each calibrated distance, sorted by ascending z. Each has the
//!   correction's coefficients a₃ to a₇ in radians, and `x` and `y`, from 0 to 1 over the frame, if they vary over it:
//!
//! ```toml
//! [[at]]
//! z_mm = 0.0
//! red = [0.12, -0.8, 0.0, 0.05, 0.0]
//! green = [0.15, -1.0, 0.0, 0.06, 0.0]
//! blue = [0.17, -1.2, 0.0, 0.07, 0.0]
//! ```
//!
//! A display with one laser uses `laser = […]` instead.

use crate::display::spatial::SpatialAberrations;
use crate::input::{self, MOST_ARRAY};
use crate::output::write_atomically;
use crate::picture::{self, open_image};
use crate::{Error, Result};
use image::DynamicImage;
use ndarray::{Array3, ArrayView3};
use phasefront::Display;
use phasefront::target::{Aberration, Illumination};
use phasefront_core::display::model::Model;
use phasefront_core::display::response::per_pixel::PerPixel;
use phasefront_core::optics::zernike::{Aberrations, Coefficients};
use phasefront_core::runtime::keys;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::Path;

/// Reads a per-pixel table.
///
/// # Errors
/// Returns an error if the file is missing or is not a per-pixel table.
pub fn read_per_pixel(path: &Path) -> Result<PerPixel> {
    let bytes = input::bytes(path, MOST_ARRAY)?;
    PerPixel::from_bytes(&bytes).map_err(|e| Error::file(path, e))
}

/// Writes a per-pixel table.
///
/// # Errors
/// Returns an error if the file cannot be written.
pub fn write_per_pixel(path: &Path, table: &PerPixel) -> Result<()> {
    write_atomically(path, |file| file.write_all(&table.to_bytes()))
}

/// Reads a learned model.
///
/// # Errors
/// Returns an error if the file is missing or is not a learned model.
pub fn read_model(path: &Path) -> Result<Model> {
    let bytes = input::bytes(path, MOST_ARRAY)?;
    Model::from_bytes(&bytes).map_err(|e| Error::file(path, e))
}

/// Writes a learned model.
///
/// # Errors
/// Returns an error if the file cannot be written.
pub fn write_model(path: &Path, model: &Model) -> Result<()> {
    write_atomically(path, |file| file.write_all(&model.to_bytes()))
}

/// Reads a laser map.
///
/// # Errors
/// Returns an error if the file is missing or is neither RGB nor grey, or if a colour has no light.
pub fn read_laser(path: &Path) -> Result<Illumination> {
    let image = open_image(path)?;
    let colours = match image {
        DynamicImage::ImageRgb8(_) | DynamicImage::ImageRgb16(_) => 3,
        DynamicImage::ImageLuma8(_) | DynamicImage::ImageLuma16(_) => 1,
        _ => {
            return Err(Error::file(
                path,
                format!(
                    "holds {:?} pixels; a laser map is RGB, or grey for one laser",
                    image.color()
                ),
            ));
        }
    };
    let image = image.into_rgb32f();
    let (width, height) = (image.width() as usize, image.height() as usize);
    let pixels = image.into_raw();
    let amplitude = Array3::from_shape_fn((colours, height, width), |(c, y, x)| pixels[3 * (y * width + x) + c]);
    Illumination::new(amplitude.view()).map_err(|e| Error::file(path, e))
}

/// Writes a laser map of amplitudes, (C, Gh, Gw), as a 16-bit PNG. Each colour is scaled to its largest value.
///
/// # Errors
/// Returns an error if the file cannot be written.
pub fn write_laser(path: &Path, amplitude: ArrayView3<'_, f32>) -> Result<()> {
    let (colours, height, width) = amplitude.dim();
    let most: Vec<f32> = (amplitude.outer_iter())
        .map(|plane| plane.iter().copied().fold(f32::MIN_POSITIVE, f32::max))
        .collect();
    let mut bytes = Vec::with_capacity(2 * amplitude.len());
    for y in 0..height {
        for x in 0..width {
            for (c, most) in most.iter().enumerate() {
                let value = (amplitude[(c, y, x)] / most * 65535.0).round() as u16;
                bytes.extend(value.to_be_bytes());
            }
        }
    }
    write_atomically(path, |file| {
        let mut encoder = png::Encoder::new(file, width as u32, height as u32);
        encoder.set_color(picture::png_color(colours));
        encoder.set_depth(png::BitDepth::Sixteen);
        let other = std::io::Error::other;
        let mut writer = encoder.write_header().map_err(other)?;
        writer.write_image_data(&bytes).map_err(other)?;
        writer.finish().map_err(other)
    })
}

/// One `[[at]]` entry.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// The z coordinate relative to the midpoint, in mm.
    pub z_mm: f64,
    /// The horizontal position in the frame, from 0 at the left to 1 at the right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x: Option<f64>,
    /// The vertical position in the frame, from 0 at the top to 1 at the bottom.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub y: Option<f64>,
    /// The coefficients a₃ to a₇ for red, in radians.
    #[serde(default)]
    pub red: Coefficients,
    /// The coefficients a₃ to a₇ for green, in radians.
    #[serde(default)]
    pub green: Coefficients,
    /// The coefficients a₃ to a₇ for blue, in radians.
    #[serde(default)]
    pub blue: Coefficients,
    /// The coefficients for a display with one laser. They replace the other three.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub laser: Option<Coefficients>,
}

impl Entry {
    /// Creates an entry without an aberration for a display of `colours` lasers, 3 or 1.
    pub fn flat(z_mm: f64, place: Option<[f64; 2]>, colours: usize) -> Self {
        Entry {
            z_mm,
            x: place.map(|p| p[0]),
            y: place.map(|p| p[1]),
            red: [0.0; 5],
            green: [0.0; 5],
            blue: [0.0; 5],
            laser: (colours == 1).then_some([0.0; 5]),
        }
    }

    /// Returns the coefficients of one colour; the only ones for one laser.
    pub fn colour_mut(&mut self, colour: usize) -> &mut Coefficients {
        match (&mut self.laser, colour) {
            (Some(laser), _) => laser,
            (None, 0) => &mut self.red,
            (None, 1) => &mut self.green,
            (None, _) => &mut self.blue,
        }
    }

    fn aberration(&self) -> phasefront::Result<Aberration> {
        let three = [self.red, self.green, self.blue];
        match self.laser {
            Some(_) if three != [Coefficients::default(); 3] => Err(phasefront::Error::Display(
                "laser stands in the place of red, green and blue; give one or the others".into(),
            )),
            Some(laser) => Aberration::new([laser]),
            None => Aberration::new(three),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AberrationToml {
    at: Vec<Entry>,
}

/// The contents of an aberration file.
#[derive(Debug, Clone, PartialEq)]
pub enum AberrationFile {
    /// Aberrations that are the same over the whole frame.
    Uniform(Aberrations),
    /// Aberrations that vary over the frame. Only exact waves correct them.
    Spatial(SpatialAberrations),
}

impl AberrationFile {
    /// Returns the number of colours that it corrects.
    pub fn colours(&self) -> usize {
        let entries = self.entries();
        let laser = entries.first().is_some_and(|entry| entry.laser.is_some());
        if laser { 1 } else { 3 }
    }

    /// Checks that it has one correction for each laser of `display`.
    ///
    /// # Errors
    /// Returns an error if the number of colours differs.
    pub fn check(&self, display: &Display) -> Result<()> {
        let (of, right) = (self.colours(), display.colours());
        if of == right {
            Ok(())
        } else {
            Err(Error::Input(format!(
                "the aberration is of {of} colours, the display has {right}; both must have as many"
            )))
        }
    }

    /// Returns the entries of the file.
    pub fn entries(&self) -> Vec<Entry> {
        let entries = |all: &Aberrations, place: Option<[f64; 2]>| -> Vec<Entry> {
            let entry = |(z_m, a): &(f64, Aberration)| {
                let (laser, [red, green, blue]) = match *a.coefficients() {
                    [laser] => (Some(laser), Default::default()),
                    [red, green, blue] => (None, [red, green, blue]),
                    _ => unreachable!("of three colours or one"),
                };
                Entry {
                    z_mm: z_m * 1e3,
                    x: place.map(|p| p[0]),
                    y: place.map(|p| p[1]),
                    red,
                    green,
                    blue,
                    laser,
                }
            };
            all.calibrated().iter().map(entry).collect()
        };
        match self {
            AberrationFile::Uniform(all) => entries(all, None),
            AberrationFile::Spatial(all) => (all.points())
                .flat_map(|(place, all)| entries(all, Some(place)))
                .collect(),
        }
    }
}

/// Reads the entries of an aberration file.
///
/// # Errors
/// Returns an error if the file is missing or is not an aberration file.
pub fn read_entries(path: &Path) -> Result<Vec<Entry>> {
    let text = input::text(path)?;
    let parsed: AberrationToml = toml::from_str(&text).map_err(|e| Error::file(path, keys::message(&e)))?;
    Ok(parsed.at)
}

/// Reads an aberration file.
///
/// # Errors
/// Returns the errors of [`read_entries`], and an error if the distances do not ascend or if only some entries have a
/// place.
pub fn read_aberrations(path: &Path) -> Result<AberrationFile> {
    aberrations(&read_entries(path)?).map_err(|e| Error::file(path, e))
}

/// Converts entries to aberrations.
///
/// # Errors
/// Returns the errors of [`read_aberrations`] except those of reading the file.
pub fn aberrations(entries: &[Entry]) -> Result<AberrationFile> {
    let placed = entries.iter().filter(|e| e.x.is_some() && e.y.is_some());
    if placed.count() == 0 && entries.iter().all(|e| e.x.is_none() && e.y.is_none()) {
        let at: phasefront::Result<Vec<_>> = (entries.iter()).map(|e| Ok((e.z_mm / 1e3, e.aberration()?))).collect();
        return Ok(AberrationFile::Uniform(Aberrations::new(at?)?));
    }
    let points: Option<Vec<_>> = entries.iter().map(|e| Some(([e.x?, e.y?], e))).collect();
    let points = points.ok_or_else(|| {
        Error::Input("some places have x and y and some have not; give both to all or to none".into())
    })?;
    let mut places: Vec<(_, Vec<(f64, Aberration)>)> = Vec::new();
    for (place, entry) in points {
        let at = (entry.z_mm / 1e3, entry.aberration()?);
        match places.iter_mut().find(|(other, _)| *other == place) {
            Some((_, all)) => all.push(at),
            None => places.push((place, vec![at])),
        }
    }
    let points: phasefront::Result<Vec<_>> = (places.into_iter())
        .map(|(place, at)| Ok((place, Aberrations::new(at)?)))
        .collect();
    Ok(AberrationFile::Spatial(SpatialAberrations::new(points?)?))
}

/// Writes an aberration file.
///
/// # Errors
/// Returns an error if [`aberrations`] refuses the entries or the file cannot be written.
pub fn write_aberrations(path: &Path, entries: &[Entry]) -> Result<()> {
    aberrations(entries).map_err(|e| Error::file(path, e))?;
    let mut text = String::new();
    for entry in entries {
        // Rust formats an f64 as valid TOML with all its digits.
        text.push_str(&format!("[[at]]\nz_mm = {:?}\n", entry.z_mm));
        for (name, place) in [("x", entry.x), ("y", entry.y)] {
            if let Some(place) = place {
                text.push_str(&format!("{name} = {place:?}\n"));
            }
        }
        let colours = match entry.laser {
            Some(laser) => vec![("laser", laser)],
            None => vec![("red", entry.red), ("green", entry.green), ("blue", entry.blue)],
        };
        for (name, a) in colours {
            text.push_str(&format!("{name} = {a:?}\n"));
        }
        text.push('\n');
    }
    write_atomically(path, |file| file.write_all(text.as_bytes()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn laser_maps_keep_their_amplitudes() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("laser.png");
        let map = Array3::from_shape_fn((3, 4, 5), |(c, y, x)| {
            (c + 1) as f32 * (1.0 + (y * 5 + x) as f32 / 30.0)
        });
        write_laser(&path, map.view()).unwrap();
        let read = read_laser(&path).unwrap();
        let direct = Illumination::new(map.view()).unwrap();
        for (a, b) in read.gains().iter().zip(direct.gains()) {
            assert!((a - b).abs() < 1e-4);
        }
        let green = map.slice(ndarray::s![1..2, .., ..]);
        write_laser(&path, green).unwrap();
        let alone = read_laser(&path).unwrap();
        assert_eq!(alone.gains(), &read.gains()[20..40]);
        image::RgbaImage::new(4, 4).save(&path).unwrap();
        assert!(read_laser(&path).unwrap_err().to_string().contains("RGB"));
    }

    #[test]
    fn aberrations_are_written_and_read_and_wrong_ones_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("aberration.toml");
        // Places in a single row.
        let entry = |z_mm: f64, x: Option<f64>| Entry {
            z_mm,
            x,
            y: x.map(|_| 0.5),
            red: [0.1, -0.2, 0.3, 0.0, 1.5],
            green: [z_mm; 5],
            blue: [0.0; 5],
            laser: None,
        };
        write_aberrations(&path, &[entry(-1.0, None), entry(2.0, None)]).unwrap();
        let AberrationFile::Uniform(read) = read_aberrations(&path).unwrap() else {
            panic!("not uniform");
        };
        assert_eq!(read.at(0.5e-3).coefficients()[1], [0.5; 5]);
        assert_eq!(read.at(0.0).coefficients()[0], [0.1, -0.2, 0.3, 0.0, 1.5]);
        write_aberrations(&path, &[entry(0.0, Some(0.2)), entry(0.0, Some(0.8))]).unwrap();
        let AberrationFile::Spatial(read) = read_aberrations(&path).unwrap() else {
            panic!("not spatial");
        };
        let places: Vec<_> = read.points().map(|(place, _)| place).collect();
        assert_eq!(places, [[0.2, 0.5], [0.8, 0.5]]);
        let laser = |z_mm: f64| Entry {
            laser: Some([0.5, 0.0, -1.0, 0.0, z_mm]),
            red: [0.0; 5],
            green: [0.0; 5],
            ..entry(z_mm, None)
        };
        write_aberrations(&path, &[laser(0.0), laser(1.0)]).unwrap();
        let read = read_aberrations(&path).unwrap();
        assert_eq!(read.colours(), 1);
        let AberrationFile::Uniform(read) = read else {
            panic!("not uniform");
        };
        assert_eq!(read.at(1e-3).coefficients(), [[0.5, 0.0, -1.0, 0.0, 1.0]]);
        for (entries, word) in [
            (vec![laser(0.0), entry(1.0, None)], "one colour and of three"),
            (
                vec![Entry {
                    laser: Some([0.0; 5]),
                    ..entry(0.0, None)
                }],
                "laser stands in the place of",
            ),
            (vec![entry(2.0, None), entry(1.0, None)], "ascend"),
            (vec![entry(0.0, None), entry(1.0, Some(0.5))], "x and y"),
            (vec![entry(0.0, Some(1.5))], "0 to 1"),
            (
                vec![
                    entry(0.0, Some(0.2)),
                    Entry {
                        y: Some(0.9),
                        ..entry(0.0, Some(0.8))
                    },
                ],
                "every column must have a point in every row",
            ),
        ] {
            let e = write_aberrations(&path, &entries).unwrap_err().to_string();
            assert!(e.contains(word), "{e}");
        }
        std::fs::write(&path, "[[at]]\nz_mm = 0\npink = [1]").unwrap();
        assert!(read_aberrations(&path).unwrap_err().to_string().contains("pink"));
    }
}
