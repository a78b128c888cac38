//! `phasefront calibrate aberration`: the coefficients of the optics' aberration.

use super::capture::{Capture, CaptureFlags};
use super::{Told, channel, find_photo, photo_path};
use clap::{Args, ValueEnum};
use ndarray::Array2;
use phasefront::{Display, Target};
use phasefront_calibration::camera::photograph::Photograph;
use phasefront_calibration::camera::program::{self, Shot};
use phasefront_calibration::colours;
use phasefront_calibration::optics::spot::{self, Search, TRIALS};
use phasefront_command::flags::{DisplayFlags, OverwriteFlag};
use phasefront_command::terminal;
use phasefront_core::runtime::file;
use phasefront_io::display::calibration::{self, AberrationFile, Entry};
use phasefront_io::output::{self, Holding};
use phasefront_io::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Find the coefficients of an aberration from photographs of a focused spot, round by round
///
/// Focus the camera at --z-mm and run the command, which writes trial_00.png to trial_10.png to DIR/round_0. Show each
/// trial, photograph it as capture_00.png … in the same folder, and run the command again for the next round. The last
/// run writes the coefficients of that colour and z into FILE. You can also write coefficients found by hand into FILE.
/// With --capture, a program shows and photographs all trials of all rounds.
#[derive(Args)]
pub(crate) struct Aberration {
    /// Folder of the search
    #[arg(value_name = "DIR")]
    pub(super) folder: PathBuf,
    /// z of the spot, mm from the middle of the volume
    #[arg(long, value_name = "Z", allow_negative_numbers = true)]
    pub(super) z_mm: f64,
    /// Colour of the light; not for one laser
    #[arg(long, value_enum)]
    pub(super) colour: Option<ColourName>,
    /// Position of the spot in the frame, from its left and top, 0 to 1, for aberrations that differ over it [default:
    /// the middle, for the whole frame]
    #[arg(long, value_name = "X,Y", value_parser = parse_place)]
    pub(super) at: Option<[f64; 2]>,
    #[command(flatten)]
    pub(super) capture: CaptureFlags,
    #[command(flatten)]
    pub(super) display: DisplayFlags,
    /// Output coefficients: `aberration` of a display file
    #[arg(short, long, value_name = "FILE.toml")]
    pub(super) output: PathBuf,
    #[command(flatten)]
    pub(super) overwrite: OverwriteFlag,
}

#[derive(Clone, Copy, PartialEq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum ColourName {
    Red,
    Green,
    Blue,
}

fn parse_place(text: &str) -> std::result::Result<[f64; 2], String> {
    let parsed = text
        .split_once(',')
        .and_then(|(x, y)| Some([x.trim().parse().ok()?, y.trim().parse().ok()?]));
    match parsed {
        Some(place) if place.iter().all(|v: &f64| (0.0..=1.0).contains(v)) => Ok(place),
        _ => Err("a place is written X,Y, as 0.5,0.25, each from 0 to 1".into()),
    }
}

/// The file `search.json` in a search's folder.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SearchFile {
    z_mm: f64,
    /// None for a display of one laser.
    colour: Option<ColourName>,
    at: Option<[f64; 2]>,
    search: Search,
}

impl Aberration {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        self.calibrate(&mut self.capture.later()?)?.print(json);
        Ok(())
    }

    /// Begins or continues the search. With a program, ends it.
    pub(super) fn calibrate(&self, capture: &mut Capture<'_>) -> Result<Told> {
        // The command adds coefficients to this file, and the display's file may refer to it, so it is an input too.
        output::check_file(&self.output)?;
        let state = self.folder.join("search.json");
        let file = self.display.read()?;
        self.check_colour(&file.target.display)?;
        let entries = match self.output.exists() {
            true => calibration::read_entries(&self.output)?,
            false => Vec::new(),
        };
        let mut now = match state.exists() {
            false => self.begin(&entries, &state, &file.target)?,
            true => {
                let now = self.read(&state)?;
                if !(0..TRIALS).all(|i| self.trial(&now, i).is_file()) {
                    self.write_trials(&now, &file.target)?;
                }
                self.take(&now, &file.target.display, capture)?;
                self.next(now, &file.target)?
            }
        };
        while capture.is_given() && !now.search.is_done() {
            write_state(&state, &now)?;
            self.take(&now, &file.target.display, capture)?;
            now = self.next(now, &file.target)?;
        }
        if now.search.is_done() {
            return self.finish(&now, entries, &state, &file.target.display);
        }
        write_state(&state, &now)?;
        Ok(Told::new(
            json!({"round": now.search.round, "rounds": spot::ROUNDS, "folder": self.round(&now).display().to_string(), "best": now.search.best}),
            format!(
                "round {} of {}: photograph trial_00.png to trial_{:02}.png of {} as capture_00.png …, then run this again",
                now.search.round + 1,
                spot::ROUNDS,
                TRIALS - 1,
                terminal::name(&self.round(&now))
            ),
        ))
    }

    fn check_colour(&self, display: &Display) -> Result<()> {
        match (display.colours(), self.colour) {
            (1, Some(_)) => Err(Error::Usage("--colour: the display has one laser; leave it out".into())),
            (3, None) => Err(Error::Usage(
                "--colour red, green or blue is needed for three lasers".into(),
            )),
            _ => Ok(()),
        }
    }

    /// Begins a search and writes its first trials.
    fn begin(&self, entries: &[Entry], state: &Path, target: &Target) -> Result<SearchFile> {
        let start = self
            .entry(entries)
            .map_or([0.0; 5], |mut e| *e.colour_mut(self.index()));
        if start != [0.0; 5] && !self.overwrite.is_given() {
            return Err(Error::file(
                &self.output,
                "has coefficients of this colour at this z already; --overwrite searches on from them",
            ));
        }
        // Photographs of another search must not be taken for this one's.
        output::folder(&self.folder, Holding::RunOf("search.json"))?;
        output::make_folder(&self.folder)?;
        let now = SearchFile {
            z_mm: self.z_mm,
            colour: self.colour,
            at: self.at,
            search: Search::from(start),
        };
        // The state comes first, because a folder of trials without it is refused as that of something else.
        write_state(state, &now)?;
        self.write_trials(&now, target)?;
        Ok(now)
    }

    fn read(&self, state: &Path) -> Result<SearchFile> {
        output::reading(state)?;
        let text = file::read_text(state).map_err(|e| Error::file(state, format!("cannot be read: {e}")))?;
        let now: SearchFile = serde_json::from_str(&text).map_err(|e| Error::file(state, e))?;
        if (now.z_mm, now.colour, now.at) != (self.z_mm, self.colour, self.at) {
            return Err(Error::file(
                state,
                "is of another z, colour or place; a search needs a folder of its own",
            ));
        }
        Ok(now)
    }

    /// Learns from the photographs of this round, and writes the trials of the next.
    fn next(&self, now: SearchFile, target: &Target) -> Result<SearchFile> {
        let sharpness = self.sharpness(&now, &target.display)?;
        let now = SearchFile {
            search: now.search.learn(&sharpness),
            ..now
        };
        if !now.search.is_done() {
            self.write_trials(&now, target)?;
        }
        Ok(now)
    }

    fn write_trials(&self, now: &SearchFile, target: &Target) -> Result<()> {
        output::make_folder(&self.round(now))?;
        for (i, levels) in self.trials(now, target)?.iter().enumerate() {
            program::write_levels(levels.view(), &self.trial(now, i))?;
        }
        Ok(())
    }

    /// Lets the program of --capture, if there is one, take the photographs of this round that are missing.
    fn take(&self, now: &SearchFile, display: &Display, capture: &mut Capture<'_>) -> Result<()> {
        if !capture.is_given() {
            return Ok(());
        }
        let (round, channel) = (self.round(now), channel(display, self.index()));
        let mut size = find_photo(&round, "capture_00")
            .map(|path| Photograph::read(&path, channel))
            .transpose()?
            .map(|photo| (photo.height, photo.width));
        for i in 0..TRIALS {
            if find_photo(&round, &format!("capture_{i:02}")).is_some() {
                continue;
            }
            let trial = Photograph::read(&self.trial(now, i), 0)?;
            let levels = Array2::from_shape_fn((trial.height, trial.width), |(y, x)| {
                trial.values[y * trial.width + x] as u8
            });
            let shot = Shot {
                levels: levels.view(),
                colour: colours(display)[self.index()],
                wavelength_m: display.wavelengths_m()[self.index()],
                z_m: self.z_mm / 1e3,
                may_expose: true,
            };
            let check = |path: &Path| {
                let photo = Photograph::read(path, channel).map_err(|e| e.to_string())?;
                let first = *size.get_or_insert((photo.height, photo.width));
                if first != (photo.height, photo.width) {
                    return Err(format!("is not {}×{} as the others", first.1, first.0));
                }
                let zoom = photo.width as f64 / display.size().width as f64;
                spot::sharpness(&photo, spot::window(zoom)).map_err(|e| e.to_string())
            };
            if let Some(program) = capture.program()? {
                program.take(&shot, &round.join(format!("capture_{i:02}.png")), check)?;
            }
        }
        Ok(())
    }

    fn index(&self) -> usize {
        self.colour.map_or(0, |colour| colour as usize)
    }

    /// Returns the levels of this round's trials.
    fn trials(&self, now: &SearchFile, target: &Target) -> Result<Vec<Array2<u8>>> {
        let (place, z_m) = (self.at.unwrap_or(spot::MIDDLE), self.z_mm / 1e3);
        let trials = now.search.trials();
        let levels = |trial| spot::levels(target, self.index(), z_m, place, trial);
        trials.iter().map(levels).collect()
    }

    fn round(&self, now: &SearchFile) -> PathBuf {
        self.folder.join(format!("round_{}", now.search.round))
    }

    fn trial(&self, now: &SearchFile, i: usize) -> PathBuf {
        self.round(now).join(format!("trial_{i:02}.png"))
    }

    /// Returns the entry of this z and place.
    fn entry(&self, entries: &[Entry]) -> Option<Entry> {
        let [x, y] = self.at.map_or([None; 2], |at| at.map(Some));
        (entries.iter())
            .find(|e| e.z_mm == self.z_mm && e.x == x && e.y == y)
            .cloned()
    }

    /// Measures the sharpness of each trial's photograph.
    fn sharpness(&self, now: &SearchFile, display: &Display) -> Result<[f64; TRIALS]> {
        let round = self.round(now);
        let mut sharpness = [0.0; TRIALS];
        let mut size = None;
        for (i, value) in sharpness.iter_mut().enumerate() {
            let path = photo_path(&round, &format!("capture_{i:02}"))?;
            let photo = Photograph::read(&path, channel(display, self.index()))?;
            let first = *size.get_or_insert((photo.height, photo.width));
            if first != (photo.height, photo.width) {
                return Err(Error::file(
                    path,
                    format!(
                        "is not {}×{} as the others; photograph the round again",
                        first.1, first.0
                    ),
                ));
            }
            let zoom = photo.width as f64 / display.size().width as f64;
            *value = spot::sharpness(&photo, spot::window(zoom)).map_err(|e| Error::file(&path, e))?;
        }
        Ok(sharpness)
    }

    fn finish(&self, now: &SearchFile, entries: Vec<Entry>, state: &Path, display: &Display) -> Result<Told> {
        let mut entries = entries;
        let flat = || Entry::flat(self.z_mm, self.at, display.colours());
        let mut entry = self.entry(&entries).unwrap_or_else(flat);
        entries.retain(|e| (e.z_mm, e.x, e.y) != (entry.z_mm, entry.x, entry.y));
        *entry.colour_mut(self.index()) = now.search.best;
        entries.push(entry);
        entries.sort_by(|a, b| a.z_mm.total_cmp(&b.z_mm));
        if let AberrationFile::Spatial(_) = calibration::aberrations(&entries)? {
            log::info!("aberrations that differ over the frame are corrected by --method layers alone");
        }
        calibration::write_aberrations(&self.output, &entries)?;
        std::fs::remove_file(state).map_err(|e| Error::file(state, format!("cannot be removed: {e}")))?;
        Ok(Told::new(
            json!({"output": self.output.display().to_string(), "coefficients_rad": now.search.best}),
            format!(
                "{}: coefficients {:.3?} rad",
                terminal::name(&self.output),
                now.search.best
            ),
        ))
    }
}

fn write_state(path: &Path, now: &SearchFile) -> Result<()> {
    let text = serde_json::to_string_pretty(now).map_err(|e| Error::file(path, e))?;
    output::write_atomically(path, |file| writeln!(file, "{text}"))
}
