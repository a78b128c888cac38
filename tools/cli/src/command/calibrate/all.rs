//! `phasefront calibrate all`: all calibrations of a display, one after another, without a person.

use super::Told;
use super::aberration::{Aberration, ColourName};
use super::capture::{Capture, CaptureFlags};
use super::diagnosis;
use super::laser::Laser;
use super::lut::Lut;
use super::model::LearnModel;
use clap::{Args, ValueEnum};
use phasefront::{Display, Target};
use phasefront_calibration::camera::program::ClaimedFolder;
use phasefront_calibration::colours;
use phasefront_calibration::optics::spot;
use phasefront_command::flags::{DisplayFlags, OverwriteFlag};
use phasefront_command::terminal;
use phasefront_io::display::{self, calibration};
use phasefront_io::output::{self, Holding};
use phasefront_io::{Error, Result};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The calibrated display's file, which also tells a folder of this command.
const DISPLAY: &str = "display.toml";
/// The files of the calibrations.
const TABLE: &str = "table.pfp";
const LASER: &str = "laser.png";
const ABERRATION: &str = "aberration.toml";
const MODEL: &str = "model.pfm";

/// Run all calibrations one after another, with photographs by a program
///
/// Measures the phase curves, the laser and the aberration of each colour, and with --photographs learns a model of
/// the rest. Then it photographs a picture on the calibrated display and says what is wrong with it. DIR then holds
/// display.toml, which names the files of the calibration, and all photographs. After an interruption, the same command
/// continues: it takes the photographs that are missing, and skips a calibration whose file is there.
#[derive(Args)]
pub(crate) struct All {
    /// Folder of the calibration
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// z of the spot for the aberration, mm from the middle of the volume
    #[arg(long, value_name = "Z", allow_negative_numbers = true)]
    z_mm: f64,
    /// Level that makes the marks of the patterns dark, which turns the phase by about π [default: 105]
    #[arg(long, value_name = "LEVEL")]
    dark: Option<u8>,
    /// Fit a mixture of this many Gaussian beams to the laser
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=4))]
    gaussians: Option<u8>,
    /// Learn a model from so many photographs for each colour [default: no model]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(4..=1000))]
    photographs: Option<u16>,
    #[command(flatten)]
    capture: CaptureFlags,
    #[command(flatten)]
    display: DisplayFlags,
}

impl All {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        if !self.capture.is_given() {
            return Err(Error::Usage(
                "--capture is needed: a program that shows and photographs the patterns; without one, run each calibration by itself".into(),
            ));
        }
        let target = self.display.read_without_offset()?.target;
        self.check(&target)?;
        output::folder(&self.folder, Holding::RunOf(DISPLAY))?;
        output::make_folder(&self.folder)?;
        let _claimed = ClaimedFolder::new(&self.folder)?;
        let mut file = CalibratedFile::begin(&self.folder, self.display.name())?;
        let mut capture = self.capture.later()?;
        let has = |name: &str| self.folder.join(name).is_file();
        let mut step = |name: &str, [key, made]: [&str; 2], done, make: &dyn Fn(&mut Capture<'_>) -> Result<Told>| {
            let path = self.folder.join(made);
            let mut told = if done {
                let line = format!("{}: is there already", terminal::name(&path));
                Told::new(json!({"output": path.display().to_string()}), line)
            } else {
                make(&mut capture)?
            };
            file.name(key, made)?;
            told.value["step"] = name.into();
            Told::new(told.value, format!("{name}: {}", told.line)).print(json);
            Result::Ok(())
        };
        step("curves", ["per_pixel", TABLE], has(TABLE), &|capture| {
            self.curves(capture)
        })?;
        step("laser", ["laser", LASER], has(LASER), &|capture| self.laser(capture))?;
        let display = &target.display;
        for (index, name) in colours(display).iter().enumerate() {
            let search = |capture: &mut Capture<'_>| self.aberration(display, index, capture);
            let done = self.is_searched(index)?;
            step(
                &format!("aberration, {name}"),
                ["aberration", ABERRATION],
                done,
                &search,
            )?;
        }
        if let Some(photographs) = self.photographs {
            let learn = |capture: &mut Capture<'_>| self.model(photographs, capture);
            step("model", ["model", MODEL], has(MODEL), &learn)?;
        }
        diagnosis::diagnosis(&self.display(), &self.folder, &mut capture)?.print(json);
        let path = self.folder.join(DISPLAY);
        Told::new(json!({"display": path.display().to_string()}), terminal::name(&path)).print(json);
        Ok(())
    }

    /// Checks what would otherwise fail only after many photographs.
    fn check(&self, target: &Target) -> Result<()> {
        let display = &target.display;
        if self.photographs.is_some() && target.panel.adds() {
            return Err(Error::Usage(
                "--photographs: a learned model is for a panel without carrier, lens and flatness; leave one out"
                    .into(),
            ));
        }
        if display.bits() != 8 {
            return Err(Error::Input(format!(
                "a display of {} bits; curves are measured for 8 bits",
                display.bits()
            )));
        }
        for colour in 0..display.colours() {
            spot::levels(&Target::from(display), colour, self.z_mm / 1e3, spot::MIDDLE, &[0.0; 5])?;
        }
        Ok(())
    }

    /// Returns the display as it is calibrated so far.
    fn display(&self) -> DisplayFlags {
        DisplayFlags::of_file(&self.folder.join(DISPLAY))
    }

    fn captures(&self) -> PathBuf {
        self.folder.join("captures")
    }

    fn curves(&self, capture: &mut Capture<'_>) -> Result<Told> {
        let lut = Lut {
            patterns: None,
            dark: self.dark,
            captures: Some(self.captures()),
            output: Some(self.folder.join(TABLE)),
            full: None,
            report: Some(self.folder.join("report")),
            capture: CaptureFlags::default(),
            display: self.display(),
            overwrite: OverwriteFlag::default(),
        };
        lut.calibrate(capture)
    }

    fn laser(&self, capture: &mut Capture<'_>) -> Result<Told> {
        let laser = Laser {
            captures: self.captures(),
            gaussians: self.gaussians,
            capture: CaptureFlags::default(),
            display: self.display(),
            output: self.folder.join(LASER),
            overwrite: OverwriteFlag::default(),
        };
        laser.calibrate(capture)
    }

    fn aberration(&self, display: &Display, colour: usize, capture: &mut Capture<'_>) -> Result<Told> {
        let aberration = Aberration {
            folder: self.folder.join("search").join(colours(display)[colour]),
            z_mm: self.z_mm,
            colour: (display.colours() > 1).then(|| ColourName::value_variants()[colour]),
            at: None,
            capture: CaptureFlags::default(),
            display: self.display(),
            output: self.folder.join(ABERRATION),
            overwrite: OverwriteFlag::default(),
        };
        aberration.calibrate(capture)
    }

    /// Checks whether the aberration of a colour is found.
    fn is_searched(&self, colour: usize) -> Result<bool> {
        let path = self.folder.join(ABERRATION);
        if !path.is_file() {
            return Ok(false);
        }
        let mut entries = calibration::read_entries(&path)?;
        Ok(entries.iter_mut().any(|entry| *entry.colour_mut(colour) != [0.0; 5]))
    }

    fn model(&self, photographs: u16, capture: &mut Capture<'_>) -> Result<Told> {
        let model = LearnModel {
            folder: self.folder.join("holograms"),
            photographs,
            capture: CaptureFlags::default(),
            display: self.display(),
            output: self.folder.join(MODEL),
            overwrite: OverwriteFlag::default(),
        };
        model.calibrate(capture)
    }
}

/// The display's file, which names each calibration when it is made.
struct CalibratedFile {
    path: PathBuf,
    table: toml::Table,
}

impl CalibratedFile {
    /// Writes the file of the display `name` without calibrations to `folder`.
    ///
    /// # Errors
    /// Returns an error if `folder` holds the calibration of another display.
    fn begin(folder: &Path, name: Option<&str>) -> Result<Self> {
        let path = folder.join(DISPLAY);
        let table = name.map(display::uncalibrated).transpose()?.unwrap_or_default();
        if path.is_file() && display::uncalibrated(&path.display().to_string())? != table {
            return Err(Error::file(
                path,
                "is of another display; a calibration needs a folder of its own",
            ));
        }
        let file = CalibratedFile { path, table };
        file.write()?;
        Ok(file)
    }

    /// Adds the calibration `made`.
    fn name(&mut self, key: &str, made: &str) -> Result<()> {
        self.table.insert(key.into(), made.into());
        self.write()
    }

    fn write(&self) -> Result<()> {
        let text = toml::to_string(&self.table).map_err(|e| Error::file(&self.path, e))?;
        output::write_atomically(&self.path, |file| file.write_all(text.as_bytes()))
    }
}
