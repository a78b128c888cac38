//! Display files: the TOML file of a display and the files that it refers to.

pub mod calibration;
pub(crate) mod lens;
mod lut;
mod panel;
pub mod spatial;

use crate::display::calibration::AberrationFile;
use crate::output::has_extension;
use crate::{Error, Result, input};
use phasefront::output::ModulatorSpec;
use phasefront::target::Response;
use phasefront::{Display, Target};
use phasefront_core::display::lens::Lens;
use phasefront_core::runtime::keys;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A display file and the contents of the files that it refers to.
#[derive(Debug, Clone)]
pub struct DisplayFile {
    /// The display settings without aberrations.
    pub target: Target,
    /// The modulator and its input layout.
    pub device: ModulatorSpec,
    /// The modulator's look-up table, if the modulator is calibrated as a whole.
    pub lut: Option<[u8; 256]>,
    /// The correction of the display's aberrations.
    pub aberration: Option<AberrationFile>,
    /// The lens in whose focal plane the picture lies. Otherwise it lies about the modulator.
    pub lens: Option<Lens>,
}

impl From<Display> for DisplayFile {
    fn from(display: Display) -> Self {
        DisplayFile {
            target: (&display).into(),
            device: display.into(),
            lut: None,
            aberration: None,
            lens: None,
        }
    }
}

impl DisplayFile {
    /// Returns the target with its correction, if the correction is the same for all depths and the whole frame.
    ///
    /// # Errors
    /// Returns an error if the aberrations change over depth or over the frame. Only SM-LBM corrects those.
    pub fn corrected(&self) -> Result<Target> {
        let correction = match &self.aberration {
            None => None,
            Some(AberrationFile::Uniform(all)) if all.constant().is_some() => all.constant(),
            Some(_) => {
                return Err(Error::Input(
                    "the display's aberration changes over depth or over the frame; --method layers corrects it, a network must be trained for it".into(),
                ));
            }
        };
        Ok(Target {
            correction,
            ..self.target.clone()
        })
    }

    /// Returns the parts of the calibration that a hologram file does not store, by their keys in the display file.
    pub fn calibrated(&self, phase_only: bool) -> Vec<String> {
        let keys = [
            (
                "per_pixel or phases of each laser",
                phase_only && self.target.response.size().is_some(),
            ),
            ("laser", phase_only && self.target.illumination.is_some()),
            ("aberration", self.aberration.is_some()),
            ("model", phase_only && self.target.model.is_some()),
            (
                "carrier_mrad, lens_mm or flatness",
                phase_only && self.target.panel.adds(),
            ),
            (lens::PLANE, self.lens.is_some()),
        ];
        let there = keys.into_iter().filter(|(_, there)| *there);
        there.map(|(key, _)| key.to_owned()).collect()
    }
}

/// Finds a display by the path of its file or by a device name. A device is bundled or is a file in
/// `phasefront/devices` of the user's configuration folder.
///
/// # Errors
/// Returns the errors of [`read_display`], or an error if `name` is neither a file nor a device.
pub fn find_display(name: &str) -> Result<DisplayFile> {
    if let Some(path) = display_path(name) {
        return read_display(&path);
    }
    let device = ModulatorSpec::shipped(name)
        .map_err(|e| Error::Input(format!("--display {name}: no such file, and {}", one_line_of(&e))))?;
    Ok(DisplayFile {
        target: device.target()?,
        device,
        lut: None,
        aberration: None,
        lens: None,
    })
}

/// Returns the keys of the display `name`, a file or a device, without those that a calibration measures. The names of
/// flatness maps become absolute, so that the keys can move to a file elsewhere.
///
/// # Errors
/// Returns an error if `name` is neither a file nor a device, or if the file is not TOML.
pub fn uncalibrated(name: &str) -> Result<toml::Table> {
    let mut table = match display_path(name) {
        None => ModulatorSpec::shipped_table(name)?,
        Some(path) => {
            let mut table = parse(&path)?;
            let absolute = |value: &mut toml::Value| -> Result<()> {
                if let toml::Value::String(name) = value {
                    let moved = std::path::absolute(path.with_file_name(&*name)).map_err(|e| Error::file(&path, e))?;
                    *name = moved.display().to_string();
                }
                Ok(())
            };
            match table.get_mut("flatness") {
                Some(toml::Value::Array(names)) => names.iter_mut().try_for_each(absolute)?,
                Some(toml::Value::Table(at)) => at.get_mut("file").map_or(Ok(()), absolute)?,
                Some(name) => absolute(name)?,
                None => {}
            }
            table
        }
    };
    let measured = [&NAMED[..], &PHASES].concat();
    table.retain(|key, _| !measured.contains(&key));
    Ok(table)
}

fn parse(path: &Path) -> Result<toml::Table> {
    let text = input::text(path)?;
    let table = toml::from_str(&text).map_err(|e| Error::file(path, e.message().trim().replace('\n', " ")))?;
    ModulatorSpec::on_device(table).map_err(|e| Error::file(path, one_line_of(&e)))
}

/// Returns the file that --display `name` reads, or `None` if `name` is a device without a file.
pub fn display_path(name: &str) -> Option<PathBuf> {
    let path = Path::new(name);
    if path.exists() || has_extension(path, "toml") {
        return Some(path.to_owned());
    }
    own_devices()
        .into_iter()
        .find(|own| own.file_stem() == Some(name.as_ref()))
}

fn one_line_of(error: &phasefront::Error) -> String {
    error.to_string().trim_start_matches("display: ").to_owned()
}

/// Returns the files of the user's own devices, sorted.
pub fn own_devices() -> Vec<PathBuf> {
    let folder = std::env::var_os("XDG_CONFIG_HOME")
        .map(PathBuf::from)
        .or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".config")));
    let entries = folder.and_then(|folder| std::fs::read_dir(folder.join("phasefront/devices")).ok());
    let mut files: Vec<_> = (entries.into_iter().flatten().flatten())
        .map(|entry| entry.path())
        .filter(|path| has_extension(path, "toml"))
        .collect();
    files.sort();
    files
}

/// The keys of a display file that name other files.
const NAMED: [&str; 5] = ["lut", "per_pixel", "laser", "aberration", "model"];

/// The keys that define the phase of each level. A file has at most one of them.
const PHASES: [&str; 4] = ["lut", "per_pixel", "levels_turns", "range_turns"];

/// Returns the keys of `table` whose one value serves all lasers, although it holds for one wavelength.
fn one_for_all(table: &toml::Table) -> Vec<&'static str> {
    let one = |key: &str| match table.get(key) {
        Some(toml::Value::String(_)) => true,
        Some(toml::Value::Array(values)) => key == "levels_turns" && !values.iter().any(toml::Value::is_array),
        Some(toml::Value::Float(turns)) => *turns != 1.0,
        Some(toml::Value::Integer(turns)) => *turns != 1,
        _ => false,
    };
    ["lut", "levels_turns", "range_turns", "flatness"]
        .into_iter()
        .filter(|key| one(key))
        .collect()
}

/// Checks the keys in the `table` of the display file at `path`.
fn check_keys(path: &Path, table: &toml::Table) -> Result<()> {
    let known = [&keys::DISPLAY[..], &keys::DEVICE, &NAMED, &panel::KEYS, &lens::KEYS].concat();
    keys::check(table, &known).map_err(|e| Error::file(path, one_line_of(&e)))?;
    let phases: Vec<_> = PHASES.into_iter().filter(|key| table.contains_key(*key)).collect();
    match phases[..] {
        [] | [_] => Ok(()),
        _ => Err(Error::file(
            path,
            format!(
                "{} each say what phase a level shows; give one of them",
                phases.join(" and ")
            ),
        )),
    }
}

/// Reads a display's TOML file. The keys `lut`, `per_pixel`, `laser`, `aberration` and `model` name files relative to
/// it: `crate::display::lut` describes `lut`, and [`crate::display::calibration`] the others. [`ModulatorSpec`],
/// `crate::display::panel` and `crate::display::lens` describe the remaining keys.
///
/// # Errors
/// Returns an error if a file is missing or has invalid contents.
pub fn read_display(path: &Path) -> Result<DisplayFile> {
    let mut table = parse(path)?;
    check_keys(path, &table)?;
    let one_for_all = one_for_all(&table);
    let luts = lut::take(path, &mut table)?;
    let mut named = |key: &str| match table.remove(key) {
        None => Ok(None),
        Some(toml::Value::String(name)) => Ok(Some(path.with_file_name(name))),
        Some(_) => Err(Error::file(path, format!("{key} must be the name of a file"))),
    };
    let per_pixel_path = named("per_pixel")?;
    let (laser_path, aberration_path, model_path) = (named("laser")?, named("aberration")?, named("model")?);
    let mut panel = panel::take(path, &mut table)?;
    let focal_m = lens::take(path, &mut table)?;
    let device = ModulatorSpec::from_table(table).map_err(|e| Error::file(path, one_line_of(&e)))?;
    let display = &device.display;
    let (lut, of_lasers) = match luts {
        None => (None, None),
        Some(luts) => luts.read(path, display)?,
    };
    let per_pixel = match per_pixel_path {
        None => None,
        Some(path) => {
            let table = calibration::read_per_pixel(&path)?;
            if table.size() != display.size() {
                return Err(Error::file(
                    path,
                    format!(
                        "is for {} pixels, the display has {}; calibrate this display",
                        table.size(),
                        display.size()
                    ),
                ));
            }
            Some(Arc::new(table))
        }
    };
    let mut target = device.target()?;
    let calibrated = match (per_pixel, lut) {
        (Some(table), _) => Some(Response::PerPixel(table)),
        (None, None) if of_lasers.is_some() => of_lasers.map(|table| Response::PerPixel(Arc::new(table))),
        (None, Some(lut)) => Some(Response::lut(lut)),
        (None, None) => None,
    };
    if let Some(response) = calibrated {
        target.response = response;
    }
    target.illumination = laser_path.map(|p| calibration::read_laser(&p)).transpose()?;
    if focal_m.is_some() {
        panel.carry_by_default(Lens::default_carrier_rad(&target.display));
    }
    panel.onto(path, &mut target)?;
    if let Some(path) = model_path {
        target.model = Some(calibration::read_model(&path)?.into());
        target.check().map_err(|e| Error::file(path, e))?;
    }
    let aberration = match aberration_path {
        None => None,
        Some(path) => {
            let aberration = calibration::read_aberrations(&path)?;
            aberration.check(&target.display).map_err(|e| Error::file(path, e))?;
            Some(aberration)
        }
    };
    if target.display.colours() > 1 && !one_for_all.is_empty() {
        log::warn!(
            "{}: {} holds for one wavelength, and the display has {} lasers; write at which it was measured (docs/devices.md, at_nm), or a value for each laser",
            path.display(),
            one_for_all.join(" and "),
            target.display.colours()
        );
    }
    let lens = focal_m.map(|focal_m| lens::of(focal_m, &target, aberration.is_some()));
    let lens = lens.transpose().map_err(|e| Error::file(path, one_line_of(&e)))?;
    Ok(DisplayFile {
        target,
        device,
        lut,
        aberration,
        lens,
    })
}

/// Converts levels to a look-up table.
///
/// # Errors
/// Returns an error if there are not exactly 256 entries, or if all are equal.
pub(crate) fn lut_of(levels: &[u8]) -> Result<[u8; 256]> {
    let table: [u8; 256] = levels.try_into().map_err(|_| {
        Error::Input(format!(
            "the look-up table has {} entries; it must have 256",
            levels.len()
        ))
    })?;
    if table == [table[0]; 256] {
        return Err(Error::Input(format!(
            "the look-up table gives the level {} for every phase; a modulator that shows phases has more",
            table[0]
        )));
    }
    Ok(table)
}
