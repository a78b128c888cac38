//! The panel settings of a display file: carrier, lens, flatness correction, and the registration of colours.
//!
//! ```toml
//! carrier_mrad = [4.0, 0.0]              # right and down, the same for all colours
//! lens_mm = 300.0                        # positive focuses light toward the viewer
//! flatness = { file = "CAL_LSH0802200_520nm.bmp", at_nm = 520 }  # or one file for each colour
//! shift_px = [[0.5, 0.0], [0.0, 0.0], [-0.25, 1.0]]   # red, green, blue, or the one laser: right and down
//! scale = [1.001, 1.0, 0.998]
//! ```
//!
//! A flatness file is a grey image of the modulator's size whose full range is 2π (Hamamatsu's correction pattern), or
//! a CSV of levels 0 to 1023 whose first row and column are coordinates (Santec), separated by commas, semicolons or
//! tabs. It is added to the phases modulo 2π. A map measured at one wavelength is unwrapped, and each laser of the
//! wavelength λ takes it times at_nm/λ: the path that it makes up for is the same.

use crate::input::{self, MOST_PICTURE};
use crate::output::has_extension;
use crate::picture::open_image;
use crate::{Error, Result};
use image::DynamicImage;
use phasefront::Size;
use phasefront::Target;
use phasefront_core::display::panel::Flatness;
use phasefront_core::display::registration::Registration;
use phasefront_core::runtime::keys;
use serde::Deserialize;
use std::path::Path;

/// The keys of a display file that this module reads.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PanelToml {
    carrier_mrad: Option<[f64; 2]>,
    lens_mm: Option<f64>,
    flatness: Option<FlatnessToml>,
    #[serde(default)]
    shift_px: Vec<[f64; 2]>,
    #[serde(default)]
    scale: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum FlatnessToml {
    One(String),
    Colours([String; 3]),
    At { file: String, at_nm: f64 },
}

/// The names of these keys.
pub(crate) const KEYS: [&str; 5] = ["carrier_mrad", "lens_mm", "flatness", "shift_px", "scale"];

/// Removes the panel's keys from the `table` of the display file at `path` and parses them.
pub(crate) fn take(path: &Path, table: &mut toml::Table) -> Result<PanelToml> {
    let own: toml::Table = (KEYS.iter())
        .filter_map(|key| Some(((*key).to_owned(), table.remove(*key)?)))
        .collect();
    PanelToml::deserialize(own).map_err(|e| match e.message() {
        message if message.contains("untagged") => Error::file(
            path,
            "flatness must be the name of a file, of three, for red, green and blue, or { file = …, at_nm = 520 }",
        ),
        _ => Error::file(path, keys::message(&e)),
    })
}

impl PanelToml {
    /// Takes `carrier_rad` if the file sets no carrier.
    pub(crate) fn carry_by_default(&mut self, carrier_rad: [f64; 2]) {
        self.carrier_mrad.get_or_insert(carrier_rad.map(|angle| angle * 1e3));
    }

    /// Applies the settings from the file at `path` to `target`.
    pub(crate) fn onto(self, path: &Path, target: &mut Target) -> Result<()> {
        let panel = &mut target.panel;
        panel.carrier_rad = self.carrier_mrad.unwrap_or_default().map(|mrad| mrad / 1e3);
        panel.lens_m = self.lens_mm.map(|mm| mm / 1e3);
        let modulator = target.display.size();
        let read = |name: &String| read_flatness(&path.with_file_name(name), modulator);
        let maps = match &self.flatness {
            None => None,
            Some(FlatnessToml::One(name)) => Some(read(name)?),
            Some(FlatnessToml::Colours(names)) => Some(names.iter().map(read).collect::<Result<Vec<_>>>()?.concat()),
            Some(FlatnessToml::At { file, at_nm }) => {
                let factors = target.display.phase_factors(*at_nm).map_err(|e| Error::file(path, e))?;
                let turns = unwrapped(&read(file)?, modulator.width)
                    .map_err(|why| Error::file(path.with_file_name(file), why))?;
                let scaled = |factor: f64| turns.iter().map(move |turn| (turn * factor).round() as i64 as u16);
                Some(factors.into_iter().flat_map(scaled).collect())
            }
        };
        if let Some(maps) = maps {
            panel.flatness = Some(Flatness::new(modulator, maps)?);
        }
        target.registration = Registration {
            shift_px: self.shift_px,
            scale: self.scale,
        };
        Ok(())
    }
}

/// Reads a manufacturer's flatness map for a modulator of `size`, in units of 2π/65536.
///
/// # Errors
/// Returns an error if the file is missing or has another format or size.
fn read_flatness(path: &Path, size: Size) -> Result<Vec<u16>> {
    let (found, turns) = if has_extension(path, "csv") {
        read_csv(path)?
    } else {
        read_image(path)?
    };
    if found != size {
        return Err(Error::file(
            path,
            format!("is a map of {found} pixels, the display has {size}; both must be of one size"),
        ));
    }
    Ok(turns)
}

/// Returns `map`, in units of 2π/65536, without jumps of a turn: each pixel lies within half a turn of the one to its
/// left, and the first pixel of a row of the one above.
fn unwrapped(map: &[u16], width: usize) -> std::result::Result<Vec<f64>, String> {
    let apart = |value: u16, before: u16| f64::from(value.wrapping_sub(before) as i16);
    let mut turns: Vec<f64> = Vec::with_capacity(map.len());
    for (at, &value) in map.iter().enumerate() {
        turns.push(match (at % width, at / width) {
            (0, 0) => f64::from(value),
            (0, _) => turns[at - width] + apart(value, map[at - width]),
            _ => turns[at - 1] + apart(value, map[at - 1]),
        });
    }
    let torn = (width..turns.len()).find(|at| (turns[*at] - turns[at - width]).abs() > 32768.0);
    match torn {
        None => Ok(turns),
        Some(at) => Err(format!(
            "jumps at row {}, column {}, so its phases at other wavelengths are unknown; give a map for each laser",
            at / width,
            at % width
        )),
    }
}

fn read_image(path: &Path) -> Result<(Size, Vec<u16>)> {
    let image = open_image(path)?;
    let size = Size {
        width: image.width() as usize,
        height: image.height() as usize,
    };
    let turns = match image {
        DynamicImage::ImageLuma16(grey) => grey.into_raw(),
        DynamicImage::ImageLuma8(grey) => grey.into_raw().into_iter().map(|v| u16::from(v) << 8).collect(),
        // A grey BMP is often stored as RGB with equal colours.
        DynamicImage::ImageRgb8(rgb) if rgb.pixels().all(|p| p.0[0] == p.0[1] && p.0[1] == p.0[2]) => {
            rgb.pixels().map(|p| u16::from(p.0[0]) << 8).collect()
        }
        other => {
            return Err(Error::file(
                path,
                format!(
                    "holds {:?} pixels; a flatness map is grey, of 8 or 16 bits",
                    other.color()
                ),
            ));
        }
    };
    Ok((size, turns))
}

fn read_csv(path: &Path) -> Result<(Size, Vec<u16>)> {
    let text =
        String::from_utf8(input::bytes(path, MOST_PICTURE)?).map_err(|_| Error::file(path, "is not text in UTF-8"))?;
    let mut turns = Vec::new();
    let mut width = None;
    // Where the comma is the decimal sign, programs separate by semicolons.
    let separator = [';', '\t'].into_iter().find(|sign| text.contains(*sign)).unwrap_or(',');
    let lines = text
        .trim_start_matches('\u{feff}')
        .lines()
        .enumerate()
        .skip(1)
        .filter(|(_, line)| !line.trim().is_empty());
    for (number, line) in lines {
        let before = turns.len();
        for value in line.trim_end_matches(['\r', separator]).split(separator).skip(1) {
            let level: Option<f64> = value.trim().replace(',', ".").parse().ok();
            let level = (level.filter(|level| (0.0..1024.0).contains(level)))
                .ok_or_else(|| Error::file(path, format!("line {}: {value:?} is no level of 0..=1023", number + 1)))?;
            turns.push((level * 64.0).round() as u16);
        }
        let count = turns.len() - before;
        if *width.get_or_insert(count) != count {
            return Err(Error::file(
                path,
                format!(
                    "line {} has {count} levels, the first has {}",
                    number + 1,
                    width.unwrap_or(0)
                ),
            ));
        }
    }
    let width = width.filter(|width| *width > 0).ok_or_else(|| {
        Error::file(
            path,
            "holds no levels; there must be a row of coordinates, then rows of levels 0 to 1023",
        )
    })?;
    let size = Size {
        width,
        height: turns.len() / width,
    };
    Ok((size, turns))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// A bowl of 3.4 turns at 520 nm is one of 3.4·520/λ turns at λ.
    #[test]
    fn a_map_of_one_wavelength_serves_the_others() {
        let bowl = |at: usize, factor: f64| {
            let (y, x) = ((at / 64) as f64 - 24.0, (at % 64) as f64 - 32.0);
            (65536.0 * 3.4 * factor * (x * x + y * y) / 1600.0).round() as i64 as u16
        };
        let map: Vec<u16> = (0..64 * 48).map(|at| bowl(at, 1.0)).collect();
        let turns = unwrapped(&map, 64).unwrap();
        for factor in [520.0 / 638.0, 1.0, 520.0 / 450.0] {
            // The constant phase of whole turns differs, which is not seen.
            let constant = (turns[0] * factor).round() as i64 as u16;
            let constant = constant.wrapping_sub(bowl(0, factor));
            for (at, turn) in turns.iter().enumerate() {
                let scaled = ((turn * factor).round() as i64 as u16).wrapping_sub(constant);
                assert!((scaled.wrapping_sub(bowl(at, factor)) as i16).abs() <= 2, "{at}");
            }
        }
        let steep: Vec<u16> = (0..64 * 48).map(|at| (at * at * 977) as u16).collect();
        assert!(unwrapped(&steep, 64).unwrap_err().contains("a map for each laser"));
    }

    #[test]
    fn makers_maps_are_read_and_others_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let grey = image::GrayImage::from_fn(3, 2, |x, y| image::Luma([(10 * y + x) as u8]));
        grey.save(path("grey.bmp")).unwrap();
        DynamicImage::from(grey.clone())
            .into_rgb8()
            .save(path("rgb.bmp"))
            .unwrap();
        let want: Vec<u16> = [0, 1, 2, 10, 11, 12].map(|v| v << 8).into();
        for name in ["grey.bmp", "rgb.bmp"] {
            assert_eq!(
                read_flatness(&path(name), Size { width: 3, height: 2 }).unwrap(),
                want,
                "{name}"
            );
        }
        let deep = image::ImageBuffer::from_fn(3, 2, |x, y| image::Luma([(1000 * y + x) as u16]));
        deep.save(path("deep.png")).unwrap();
        let read = read_flatness(&path("deep.png"), Size { width: 3, height: 2 }).unwrap();
        assert_eq!(read, [0, 1, 2, 1000, 1001, 1002]);
        std::fs::write(path("santec.csv"), "Y/X,0,1,2\n0,5,6,7\n1,1021,1022,1023\n").unwrap();
        let read = read_flatness(&path("santec.csv"), Size { width: 3, height: 2 }).unwrap();
        assert_eq!(read, [5, 6, 7, 1021, 1022, 1023].map(|v| v << 6));
        for (name, text) in [
            ("semicolons.csv", "Y/X;0;1;2\r\n0;5;6,5;7\r\n1;1021;1022;1023\r\n"),
            (
                "tabs.csv",
                "\u{feff}Y/X\t0\t1\t2\n0\t5.0\t6.5\t7\n1\t1021\t1022\t1023\t\n",
            ),
            ("decimals.csv", "Y/X,0,1,2\n0,5.0,6.5,7.00\n1,1021,1022,1023\n"),
        ] {
            std::fs::write(path(name), text).unwrap();
            let read = read_flatness(&path(name), Size { width: 3, height: 2 }).unwrap();
            assert_eq!(read, [320, 416, 448, 1021 << 6, 1022 << 6, 1023 << 6], "{name}");
        }

        image::RgbImage::from_pixel(3, 2, image::Rgb([1, 2, 3]))
            .save(path("colour.png"))
            .unwrap();
        for (name, text) in [
            ("high.csv", "y,0\n0,1024\n"),
            ("uneven.csv", "y,0,1\n0,1,2\n1,3\n"),
            ("empty.csv", "y,0\n"),
        ] {
            std::fs::write(path(name), text).unwrap();
        }
        for (name, word) in [
            ("grey.bmp", "3×2"),
            ("santec.csv", "3×2"),
            ("colour.png", "grey"),
            ("none.bmp", "read"),
            ("high.csv", "1023"),
            ("uneven.csv", "line 3"),
            ("empty.csv", "no levels"),
        ] {
            let error = read_flatness(&path(name), Size { width: 4, height: 2 })
                .unwrap_err()
                .to_string();
            assert!(error.contains(word), "{name}: {error}");
        }
    }
}
