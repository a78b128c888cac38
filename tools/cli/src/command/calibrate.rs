//! `phasefront calibrate`: makes the files that a `--display` file refers to, from photographs of a display.

use clap::{Args, Subcommand, ValueEnum};
use ndarray::{Axis, stack};
use phasefront::Display;
use phasefront_calibration::COLOURS;
use phasefront_calibration::camera::marks;
use phasefront_calibration::camera::pattern::{DARK, PATTERNS, Pattern};
use phasefront_calibration::camera::photograph::Photograph;
use phasefront_calibration::curves::lut::{self, Refusal};
use phasefront_calibration::curves::report;
use phasefront_calibration::optics::laser;
use phasefront_calibration::optics::spot::{self, Search, TRIALS};
use phasefront_calibration::rehearse::{self, Rehearsal};
use phasefront_command::flags::{DisplayFlags, OverwriteFlag, parse_size};
use phasefront_command::terminal::{self, progress_bar};
use phasefront_core::runtime::file;
use phasefront_io::display::calibration::{self, AberrationFile, Entry};
use phasefront_io::output::{self, Holding};
use phasefront_io::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Calibrate a real display, or rehearse it on a simulated one
#[derive(Subcommand)]
pub(crate) enum Calibrate {
    Lut(Lut),
    Laser(Laser),
    Aberration(Aberration),
    Pack(Pack),
    Rehearse(Rehearse),
}

impl Calibrate {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        match self {
            Calibrate::Lut(command) => command.run(json),
            Calibrate::Laser(command) => command.run(json),
            Calibrate::Aberration(command) => command.run(json),
            Calibrate::Pack(command) => command.run(json),
            Calibrate::Rehearse(command) => command.run(json),
        }
    }
}

/// Find each pixel's phase curve: write the 256 patterns, or read their photographs
///
/// First run it with `--patterns DIR`. Show each pattern on the modulator, focus on it, and photograph it in each
/// colour as red/capture_000.png (or .tif) … blue/capture_255.png. Photographs must be linear and not saturated, and
/// the camera must not move. Then run it with `--captures DIR -o table.pfp`.
#[derive(Args)]
#[command(group = clap::ArgGroup::new("step").required(true))]
pub(crate) struct Lut {
    /// Write pattern_000.png to pattern_255.png to this folder
    #[arg(long, value_name = "DIR", group = "step", conflicts_with = "output")]
    patterns: Option<PathBuf>,
    /// Level that makes the marks of --patterns dark, which turns the phase by about π [default: 105]
    #[arg(long, value_name = "LEVEL", requires = "patterns")]
    dark: Option<u8>,
    /// Folder with the folders red, green and blue of photographs
    #[arg(long, value_name = "DIR", group = "step", requires = "output")]
    captures: Option<PathBuf>,
    /// Output table for a phone: `per_pixel` of a display file
    #[arg(short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Also write the full tables to this folder: full_red.npy …, uint8 (H, W, 256)
    #[arg(long, value_name = "DIR", requires = "captures")]
    full: Option<PathBuf>,
    /// Write drawings of curves, residuals and maps to this folder
    #[arg(long, value_name = "DIR", requires = "captures")]
    report: Option<PathBuf>,
    #[command(flatten)]
    display: DisplayFlags,
    #[command(flatten)]
    overwrite: OverwriteFlag,
}

impl Lut {
    fn run(self, json: bool) -> Result<()> {
        self.check_outputs()?;
        let display = self.display.read_of_midpoint()?.target.display;
        let pattern = Pattern::new(display.height(), display.width())?;
        match (&self.patterns, &self.captures, &self.output) {
            (Some(folder), ..) => {
                let pattern = pattern.with_dark(self.dark.unwrap_or(DARK));
                self.write_patterns(json, &pattern, folder)
            }
            (None, Some(captures), Some(output)) => self.measure(json, &pattern, captures, output),
            _ => Err(Error::Input("give --patterns, or --captures and -o".into())),
        }
    }

    fn check_outputs(&self) -> Result<()> {
        for folder in [&self.patterns, &self.full, &self.report].into_iter().flatten() {
            output::folder(folder, self.overwrite.holding())?;
        }
        (self.output.iter()).try_for_each(|path| output::new_file(path, &[], self.overwrite.is_given()))?;
        self.captures.iter().try_for_each(|captures| reading_captures(captures))
    }

    fn write_patterns(&self, json: bool, pattern: &Pattern, folder: &Path) -> Result<()> {
        let path = |k: usize| folder.join(format!("pattern_{k:03}.png"));
        output::make_folder(folder)?;
        let bar = progress_bar(PATTERNS as u64, "patterns");
        for k in 0..PATTERNS {
            grey(pattern.frame(k as u8), &path(k))?;
            bar.inc(1);
        }
        bar.finish_and_clear();
        terminal::print(
            json,
            &json!({"patterns": PATTERNS, "folder": folder.display().to_string()}),
            format!(
                "{PATTERNS} patterns in {}; photograph each in red, green and blue light",
                terminal::name(folder)
            ),
        );
        Ok(())
    }

    fn measure(&self, json: bool, pattern: &Pattern, captures: &Path, path: &Path) -> Result<()> {
        let spool = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let (mut curves, mut problems) = (Vec::new(), Vec::new());
        for (colour, name) in COLOURS.iter().enumerate() {
            let folder = captures.join(name);
            let source = |k: usize| lut::read_capture(&folder, colour, k);
            let bar = progress_bar(0, name);
            let progress = |done: usize, of: usize| {
                bar.set_length(of as u64);
                bar.set_position(done as u64);
            };
            let measured = lut::measure(pattern, colour, &source, spool, &progress);
            bar.finish_and_clear();
            match measured {
                Ok(measured) => curves.push(measured),
                Err(Refusal::Problems(some)) => problems.extend(some),
                Err(Refusal::Other(e)) => return Err(e),
            }
        }
        for problem in &problems {
            log::warn!("{}", captures.join(problem.to_string()).display());
        }
        let curves: [lut::Curves; 3] = curves.try_into().map_err(|_| {
            Error::file(
                captures,
                format!(
                    "{} of {} captures cannot be used, each named above",
                    problems.len(),
                    3 * PATTERNS
                ),
            )
        })?;
        let per_pixel = lut::compact(&curves)?;
        let report = report::report(&curves, &per_pixel);
        for colour in &report.colours {
            for [x, y] in &colour.silent_at {
                log::warn!(
                    "{}: pixel ({x}, {y}) does not answer: dust, or dead; its curve is its neighbours'",
                    colour.colour
                );
            }
        }
        if let Some(folder) = &self.report {
            output::make_folder(folder)?;
            report::draw(&curves, folder)?;
        }
        if let Some(folder) = &self.full {
            output::make_folder(folder)?;
            for curves in &curves {
                let path = folder.join(format!("full_{}.npy", COLOURS[curves.colour]));
                output::write_atomically(&path, |file| lut::write_full(curves, &per_pixel, file))?;
            }
        }
        calibration::write_per_pixel(path, &per_pixel)?;
        terminal::print(
            json,
            &json!({"output": path.display().to_string(), "report": report}),
            format!("{}\n{}", report.text(), terminal::name(path)),
        );
        Ok(())
    }
}

/// Find the laser's amplitude over the modulator, from photographs of a diffuser in its place
///
/// CAPTURES has folders red, green and blue. Each holds diffuser.png (or .tif) and capture_000.png, a photograph of
/// pattern 0 from the same camera position, which shows where the modulator is.
#[derive(Args)]
pub(crate) struct Laser {
    /// Folder with the folders red, green and blue
    #[arg(value_name = "CAPTURES")]
    captures: PathBuf,
    /// Fit a mixture of this many Gaussian beams
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=4))]
    gaussians: Option<u8>,
    #[command(flatten)]
    display: DisplayFlags,
    /// Output map: `laser` of a display file
    #[arg(short, value_name = "OUT.png")]
    output: PathBuf,
    #[command(flatten)]
    overwrite: OverwriteFlag,
}

impl Laser {
    fn run(self, json: bool) -> Result<()> {
        output::new_file(&self.output, &["png"], self.overwrite.is_given())?;
        reading_captures(&self.captures)?;
        let display = self.display.read_of_midpoint()?.target.display;
        let shape = (display.height(), display.width());
        let pattern = Pattern::new(shape.0, shape.1)?;
        let (mut maps, mut left) = (Vec::new(), Vec::new());
        for (colour, name) in COLOURS.iter().enumerate() {
            let folder = self.captures.join(name);
            let read = |stem: &str| -> Result<(PathBuf, Photograph)> {
                let path = photo_path(&folder, stem)?;
                let photo = Photograph::read(&path, colour)?;
                Ok((path, photo))
            };
            let ((marked_path, marked), (path, photo)) = (read("capture_000")?, read("diffuser")?);
            if (marked.height, marked.width) != (photo.height, photo.width) {
                return Err(Error::file(
                    path,
                    format!(
                        "is {}×{}, {} is {}×{}; one camera must take both from one place",
                        photo.width,
                        photo.height,
                        marked_path.display(),
                        marked.width,
                        marked.height
                    ),
                ));
            }
            let registration =
                marks::Registration::find(&marked, &pattern).map_err(|e| Error::file(&marked_path, e))?;
            let map = laser::map(&photo, &registration, shape).map_err(|e| Error::file(&path, e))?;
            let map = match self.gaussians {
                None => map,
                Some(count) => {
                    let (fitted, _, rest) = laser::mixture(&map, count.into())?;
                    left.push(rest);
                    fitted
                }
            };
            maps.push(map);
        }
        let views: Vec<_> = maps.iter().map(|map| map.view()).collect();
        let all = stack(Axis(0), &views).map_err(|e| Error::file(&self.output, e))?;
        calibration::write_laser(&self.output, all.view())?;
        let least: Vec<f32> = (maps.iter())
            .map(|map| {
                let most = map.iter().copied().fold(0.0, f32::max);
                map.iter().copied().fold(f32::INFINITY, f32::min) / most
            })
            .collect();
        terminal::print(
            json,
            &json!({"output": self.output.display().to_string(), "least_amplitude": least, "fit_residual": left}),
            format!(
                "{}: least amplitude {:.2}, {:.2}, {:.2} of the most in red, green, blue",
                terminal::name(&self.output),
                least[0],
                least[1],
                least[2]
            ),
        );
        Ok(())
    }
}

/// Find the coefficients of an aberration from photographs of a focused spot, round by round
///
/// Focus the camera at --z-mm and run the command, which writes trial_00.png to trial_10.png to DIR/round_0. Show each
/// trial, photograph it as capture_00.png … in the same folder, and run the command again for the next round. The last
/// run writes the coefficients of that colour and z into FILE. You can also write coefficients found by hand into FILE.
#[derive(Args)]
pub(crate) struct Aberration {
    /// Folder of the search
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// z of the spot, mm from the middle of the volume
    #[arg(long, value_name = "Z", allow_negative_numbers = true)]
    z_mm: f64,
    /// Colour of the light
    #[arg(long, value_enum)]
    colour: ColourName,
    /// Position of the spot in the frame, from its left and top, 0 to 1, for aberrations that differ over it [default:
    /// the middle, for the whole frame]
    #[arg(long, value_name = "X,Y", value_parser = parse_place)]
    at: Option<[f64; 2]>,
    #[command(flatten)]
    display: DisplayFlags,
    /// Output coefficients: `aberration` of a display file
    #[arg(short, value_name = "FILE.toml")]
    output: PathBuf,
    #[command(flatten)]
    overwrite: OverwriteFlag,
}

#[derive(Clone, Copy, PartialEq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ColourName {
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
    colour: ColourName,
    at: Option<[f64; 2]>,
    search: Search,
}

impl Aberration {
    fn run(self, json: bool) -> Result<()> {
        // The command adds coefficients to this file, and the display's file may refer to it, so it is an input too.
        output::check_file(&self.output)?;
        let state = self.folder.join("search.json");
        let file = self.display.read_of_three()?;
        let entries = if self.output.exists() {
            calibration::read_entries(&self.output)?
        } else {
            Vec::new()
        };
        let now = if state.exists() {
            output::reading(&state)?;
            let text = file::read_text(&state).map_err(|e| Error::file(&state, format!("cannot be read: {e}")))?;
            let now: SearchFile = serde_json::from_str(&text).map_err(|e| Error::file(&state, e))?;
            if (now.z_mm, now.colour, now.at) != (self.z_mm, self.colour, self.at) {
                return Err(Error::file(
                    &state,
                    "is of another z, colour or place; a search needs a folder of its own",
                ));
            }
            let sharpness = self.sharpness(&now, &file.target.display)?;
            SearchFile {
                search: now.search.learn(&sharpness),
                ..now
            }
        } else {
            let start = self
                .entry(&entries)
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
            SearchFile {
                z_mm: self.z_mm,
                colour: self.colour,
                at: self.at,
                search: Search::from(start),
            }
        };
        if now.search.is_done() {
            return self.finish(json, &now, entries, &state);
        }
        let round = self.round(&now);
        output::make_folder(&round)?;
        let (place, z_m) = (self.at.unwrap_or(spot::MIDDLE), self.z_mm / 1e3);
        let target = &file.target;
        for (i, trial) in now.search.trials().iter().enumerate() {
            let levels = spot::levels(target, self.index(), z_m, place, trial)?;
            grey(levels, &round.join(format!("trial_{i:02}.png")))?;
        }
        write_state(&state, &now)?;
        terminal::print(
            json,
            &json!({"round": now.search.round, "rounds": spot::ROUNDS, "folder": round.display().to_string(), "best": now.search.best}),
            format!(
                "round {} of {}: photograph trial_00.png to trial_{:02}.png of {} as capture_00.png …, then run this again",
                now.search.round + 1,
                spot::ROUNDS,
                TRIALS - 1,
                terminal::name(&round)
            ),
        );
        Ok(())
    }

    fn index(&self) -> usize {
        self.colour as usize
    }

    fn round(&self, now: &SearchFile) -> PathBuf {
        self.folder.join(format!("round_{}", now.search.round))
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
            let photo = Photograph::read(&path, self.index())?;
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
            let zoom = photo.width as f64 / display.width() as f64;
            *value = spot::sharpness(&photo, spot::window(zoom)).map_err(|e| Error::file(&path, e))?;
        }
        Ok(sharpness)
    }

    fn finish(&self, json: bool, now: &SearchFile, entries: Vec<Entry>, state: &Path) -> Result<()> {
        let mut entries = entries;
        let mut entry = self.entry(&entries).unwrap_or(Entry {
            z_mm: self.z_mm,
            x: self.at.map(|at| at[0]),
            y: self.at.map(|at| at[1]),
            red: [0.0; 5],
            green: [0.0; 5],
            blue: [0.0; 5],
            laser: None,
        });
        entries.retain(|e| (e.z_mm, e.x, e.y) != (entry.z_mm, entry.x, entry.y));
        *entry.colour_mut(self.index()) = now.search.best;
        entries.push(entry);
        entries.sort_by(|a, b| a.z_mm.total_cmp(&b.z_mm));
        if let AberrationFile::Spatial(_) = calibration::aberrations(&entries)? {
            log::info!("aberrations that differ over the frame are corrected by --method layers alone");
        }
        calibration::write_aberrations(&self.output, &entries)?;
        std::fs::remove_file(state).map_err(|e| Error::file(state, format!("cannot be removed: {e}")))?;
        terminal::print(
            json,
            &json!({"output": self.output.display().to_string(), "coefficients_rad": now.search.best}),
            format!(
                "{}: coefficients {:.3?} rad",
                terminal::name(&self.output),
                now.search.best
            ),
        );
        Ok(())
    }
}

fn write_state(path: &Path, now: &SearchFile) -> Result<()> {
    let text = serde_json::to_string_pretty(now).map_err(|e| Error::file(path, e))?;
    output::write_atomically(path, |file| writeln!(file, "{text}"))
}

/// Put a display's file and all files that it refers to into one file for an app
#[derive(Args)]
pub(crate) struct Pack {
    #[command(flatten)]
    display: DisplayFlags,
    /// Output file for the app
    #[arg(short, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    overwrite: OverwriteFlag,
}

impl Pack {
    fn run(self, json: bool) -> Result<()> {
        output::new_file(&self.output, &[], self.overwrite.is_given())?;
        let file = self.display.read()?;
        let bytes = file.corrected()?.to_bytes()?;
        output::write_atomically(&self.output, |file| file.write_all(&bytes))?;
        terminal::print(
            json,
            &json!({"file": self.output.display().to_string(), "bytes": bytes.len()}),
            format!("{}: {} bytes", terminal::name(&self.output), bytes.len()),
        );
        Ok(())
    }
}

/// Rehearse a calibration on a simulated display with a simulated camera
///
/// Writes the files of the calibration, a display.toml that refers to them, outcome.json, photographs and drawings.
#[derive(Args)]
pub(crate) struct Rehearse {
    /// Size of the modulator
    #[arg(long, value_name = "WxH", default_value = "320x180", value_parser = parse_size)]
    size: (usize, usize),
    /// Number of camera pixels across one pixel of the modulator
    #[arg(long, value_name = "Z", default_value_t = 2.5)]
    zoom: f64,
    /// Seed of the display's flaws and the camera's noise
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// z of the focused spot, mm
    #[arg(long, value_name = "Z", default_value_t = 12.0, allow_negative_numbers = true)]
    spot_z_mm: f64,
    /// Keep all photographs, as input for `calibrate lut` and `calibrate laser`
    #[arg(long)]
    captures: bool,
    /// Output folder
    #[arg(short, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    overwrite: OverwriteFlag,
}

impl Rehearse {
    fn run(self, json: bool) -> Result<()> {
        let (width, height) = self.size;
        let rehearsal = Rehearsal {
            display: Display::from_toml(&format!("width = {width}\nheight = {height}"))?,
            zoom: self.zoom,
            seed: self.seed,
            spot_z_m: self.spot_z_mm / 1e3,
            keep_captures: self.captures,
        };
        output::folder(&self.output, self.overwrite.holding())?;
        let bar = progress_bar(0, "photographs and rows");
        let outcome = rehearse::run(&rehearsal, &self.output, &|done, of| {
            bar.set_length(of as u64);
            bar.set_position(done as u64);
        })?;
        bar.finish_and_clear();
        let line = |what: &str, of: &rehearse::BeforeAfter, digits: usize| {
            let list = |values: &[f64; 3]| {
                let all: Vec<_> = values.iter().map(|v| format!("{v:.digits$}")).collect();
                all.join(" / ")
            };
            format!("{what:<34}{:>24}   {:>24}", list(&of.before), list(&of.after))
        };
        let text = [
            format!("{:<34}{:>24}   {:>24}", "red / green / blue", "before", "after"),
            line("phase error, rad RMS", &outcome.phase_error_rad, 3),
            line("black against white, dB", &outcome.black_db, 1),
            line("unevenness of flat grey", &outcome.unevenness, 3),
            line("Strehl ratio of the spot", &outcome.strehl, 3),
            String::new(),
            outcome.lut.text(),
            format!("{} photographs; {}", outcome.photographs, terminal::name(&self.output)),
        ];
        let value = serde_json::to_value(&outcome).map_err(|e| Error::file(&self.output, e))?;
        terminal::print(json, &value, text.join("\n"));
        Ok(())
    }
}

/// Marks the photographs of all colours as inputs.
fn reading_captures(captures: &Path) -> Result<()> {
    COLOURS
        .iter()
        .try_for_each(|colour| output::reading_folder(&captures.join(colour)))
}

/// Returns the path of the photograph `stem` in `folder`, a PNG or TIFF.
fn photo_path(folder: &Path, stem: &str) -> Result<PathBuf> {
    ["png", "tif", "tiff", "PNG", "TIF", "TIFF"]
        .iter()
        .map(|extension| folder.join(format!("{stem}.{extension}")))
        .find(|path| path.is_file())
        .ok_or_else(|| {
            Error::file(
                folder.join(format!("{stem}.png")),
                "is missing (.tif would do as well); photograph it and run again",
            )
        })
}

/// Writes levels, (H, W), as a grey PNG of 8 bits.
fn grey(levels: ndarray::Array2<u8>, path: &Path) -> Result<()> {
    let (height, width) = levels.dim();
    let values = levels.iter().map(|v| u16::from(*v)).collect();
    let photo = Photograph {
        height,
        width,
        values,
        full: 255,
    };
    photo.write(path)
}
