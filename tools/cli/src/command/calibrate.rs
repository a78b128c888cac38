//! `phasefront calibrate`: makes the files that a `--display` file refers to, from photographs of a display.

mod aberration;
mod all;
mod capture;
mod diagnosis;
mod laser;
mod lut;
mod model;
mod pack;
mod rehearse;
mod white;

use clap::Subcommand;
use phasefront::Display;
use phasefront_command::terminal;
use phasefront_io::{Error, Result, output};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Calibrate a real display, or rehearse it on a simulated one
#[derive(Subcommand)]
pub(crate) enum Calibrate {
    All(all::All),
    Lut(lut::Lut),
    Laser(laser::Laser),
    Aberration(aberration::Aberration),
    Model(model::LearnModel),
    Pack(pack::Pack),
    White(white::White),
    Rehearse(rehearse::Rehearse),
}

impl Calibrate {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        match self {
            Calibrate::All(command) => command.run(json),
            Calibrate::Lut(command) => command.run(json),
            Calibrate::Laser(command) => command.run(json),
            Calibrate::Aberration(command) => command.run(json),
            Calibrate::Model(command) => command.run(json),
            Calibrate::Pack(command) => command.run(json),
            Calibrate::White(command) => command.run(json),
            Calibrate::Rehearse(command) => command.run(json),
        }
    }
}

/// The result of a calibration.
struct Told {
    value: Value,
    /// The result in one line.
    line: String,
    /// A table that comes before it, if there is one.
    table: String,
}

impl Told {
    fn new(value: Value, line: String) -> Self {
        Told {
            value,
            line,
            table: String::new(),
        }
    }

    fn print(&self, json: bool) {
        let text = [&self.table, &self.line].map(String::as_str);
        terminal::print(json, &self.value, text.join("\n").trim_start());
    }
}

/// Marks the photographs of all colours as inputs.
fn reading_captures(captures: &Path, colours: &[&str]) -> Result<()> {
    colours
        .iter()
        .try_for_each(|colour| output::reading_folder(&captures.join(colour)))
}

/// Returns the channel of an RGB photograph that sees laser `colour` of `display`: 0 red, 1 green, 2 blue.
pub(super) fn channel(display: &Display, colour: usize) -> usize {
    match display.wavelengths_m() {
        // Where two neighbouring channels of a camera see about as much.
        [laser_m] if *laser_m > 585e-9 => 0,
        [laser_m] if *laser_m > 490e-9 => 1,
        [_] => 2,
        _ => colour,
    }
}

/// Returns the path of the photograph `stem` in `folder`, a PNG or TIFF, if there is one.
fn find_photo(folder: &Path, stem: &str) -> Option<PathBuf> {
    ["png", "tif", "tiff", "PNG", "TIF", "TIFF"]
        .iter()
        .map(|extension| folder.join(format!("{stem}.{extension}")))
        .find(|path| path.is_file())
}

/// Returns the path of the photograph `stem` in `folder`, a PNG or TIFF.
fn photo_path(folder: &Path, stem: &str) -> Result<PathBuf> {
    find_photo(folder, stem).ok_or_else(|| {
        Error::file(
            folder.join(format!("{stem}.png")),
            "is missing (.tif would do as well); photograph it and run again",
        )
    })
}
