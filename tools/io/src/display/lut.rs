//! The look-up tables of a display file: one for all lasers, one for each, or one for the wavelength at which it was
//! measured.
//!
//! ```toml
//! lut = "lut.txt"                                   # or one of these
//! lut = ["red.txt", "green.txt", "blue.txt"]
//! lut = { file = "lut.txt", at_nm = 638 }
//! ```
//!
//! A table is a text file of 256 levels, or of two columns, the numbers 0 to 255 in any order and their levels (a
//! Meadowlark `.lut`). A table of one wavelength λ₀ gives the phase φ of a laser λ the level of the phase φ·λ/λ₀: a
//! level makes the same path at every wavelength, if the dispersion of the material is left out.

use super::lut_of;
use crate::{Error, Result, input};
use phasefront::Display;
use phasefront_core::display::response::per_pixel::PerPixel;
use serde::Deserialize;
use std::path::Path;

/// The value of the key `lut`.
#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum Luts {
    One(String),
    Lasers(Vec<String>),
    At { file: String, at_nm: f64 },
}

/// Removes the key `lut` from the `table` of the display file at `path`.
pub(super) fn take(path: &Path, table: &mut toml::Table) -> Result<Option<Luts>> {
    let luts = table.remove("lut").map(Luts::deserialize).transpose();
    luts.map_err(|_| {
        Error::file(
            path,
            "lut must be the name of a file, a list of one for each laser, or { file = \"lut.txt\", at_nm = 638 }",
        )
    })
}

impl Luts {
    /// Reads the tables named in the file at `path`: one for all lasers of `display`, or curves for each.
    pub(super) fn read(self, path: &Path, display: &Display) -> Result<(Option<[u8; 256]>, Option<PerPixel>)> {
        let read = |name: &String| read_lut(&path.with_file_name(name), display);
        let refuse = |why: phasefront::Error| Error::file(path, super::one_line_of(&why));
        let (tables, factors) = match &self {
            Luts::One(name) => return Ok((Some(read(name)?), None)),
            Luts::Lasers(names) if names.len() == display.colours() => {
                let tables = names.iter().map(read).collect::<Result<Vec<_>>>()?;
                (tables, vec![1.0; names.len()])
            }
            Luts::Lasers(names) => {
                return Err(Error::file(
                    path,
                    format!(
                        "lut names {} files; the display has {} lasers",
                        names.len(),
                        display.colours()
                    ),
                ));
            }
            Luts::At { file, at_nm } => {
                let factors = display.phase_factors(*at_nm).map_err(refuse)?;
                (vec![read(file)?; factors.len()], factors)
            }
        };
        if display.bits() != 8 {
            return Err(Error::file(path, "lut of each laser is for a display of 8 bits"));
        }
        if let Some(table) = tables.iter().find(|table| !table.is_sorted()) {
            let fall = table.windows(2).position(|pair| pair[1] < pair[0]).unwrap_or_default();
            return Err(Error::file(
                path,
                format!(
                    "a table for lasers of their own must rise with the phase; it falls after step {fall}. Give one table as lut = \"FILE\", or levels_turns"
                ),
            ));
        }
        let reach: Vec<f64> = factors.iter().map(|factor| factor * 255.0 / 256.0).collect();
        let curves = PerPixel::of_lasers(display.size(), &reach, |laser, turns| {
            let step = (256.0 * turns / factors[laser]).max(0.0);
            let table = tables[laser].map(f64::from);
            let before = (step as usize).min(254);
            table[before] + (table[before + 1] - table[before]) * (step - before as f64)
        });
        Ok((None, Some(curves.map_err(refuse)?)))
    }
}

/// Reads a look-up table for `display`.
fn read_lut(path: &Path, display: &Display) -> Result<[u8; 256]> {
    let text = input::text(path)?;
    let refuse = |why: String| Err(Error::file(path, why));
    // Editors on Windows write a byte-order mark.
    let numbers = text.trim_start_matches('\u{feff}').split_whitespace();
    let numbers: std::result::Result<Vec<u16>, _> = numbers.map(str::parse).collect();
    let mut numbers = numbers.map_err(|e| Error::file(path, format!("holds what is no level of 0..=255: {e}")))?;
    if numbers.len() == 512 {
        let mut pairs: Vec<_> = numbers.chunks(2).map(|pair| (pair[0], pair[1])).collect();
        pairs.sort();
        if !pairs.iter().map(|(step, _)| usize::from(*step)).eq(0..256) {
            return refuse("has 512 numbers; in two columns, the first holds each of 0 to 255 once".into());
        }
        numbers = pairs.into_iter().map(|(_, level)| level).collect();
        if let Some(voltage) = numbers.iter().find(|number| **number > 255) {
            return refuse(format!(
                "holds the driver's voltage {voltage}, and images hold levels up to 255; load the file into the modulator's driver and leave lut out"
            ));
        }
    }
    let levels: std::result::Result<Vec<u8>, _> = numbers.into_iter().map(u8::try_from).collect();
    let levels = levels.map_err(|e| Error::file(path, format!("holds what is no level of 0..=255: {e}")))?;
    let lut = lut_of(&levels).map_err(|e| Error::file(path, e))?;
    let most = lut.into_iter().max().unwrap_or_default();
    if u32::from(most) >> display.bits() != 0 {
        return refuse(format!(
            "holds a level of {most}, over the {} bits of the display",
            display.bits()
        ));
    }
    Ok(lut)
}
