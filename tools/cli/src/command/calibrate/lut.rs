//! `phasefront calibrate lut`: each pixel's phase curve.

use super::capture::{Capture, CaptureFlags};
use super::{Told, channel, reading_captures};
use clap::Args;
use phasefront::Display;
use phasefront_calibration::camera::pattern::{DARK, PATTERNS, Pattern};
use phasefront_calibration::camera::photograph::Photograph;
use phasefront_calibration::camera::program::{self, Shot};
use phasefront_calibration::colours;
use phasefront_calibration::curves::lut::{self, Checks, Errors, Problem, Refusal, What};
use phasefront_calibration::curves::report;
use phasefront_command::flags::{DisplayFlags, OverwriteFlag, check_used};
use phasefront_command::terminal::{self, progress_bar};
use phasefront_io::display::calibration;
use phasefront_io::output;
use phasefront_io::{Error, Result};
use serde_json::json;
use std::path::{Path, PathBuf};

/// The largest number of missing photographs of one colour that are named one by one.
const MOST_NAMED: usize = 8;

/// Find each pixel's phase curve: write the 256 patterns, or read their photographs
///
/// First run it with `--patterns DIR`. Show each pattern on the modulator, focus on it, and photograph it in each
/// colour as red/capture_000.png (or .tif) … blue/capture_255.png. Photographs must be linear and not saturated, and
/// the camera must not move. Then run it with `--captures DIR -o table.pfp`. A display of one laser has the folder
/// laser instead of red, green and blue. With --capture, a program shows and photographs the patterns that --captures
/// does not hold yet.
#[derive(Args)]
#[command(group = clap::ArgGroup::new("step").required(true))]
pub(crate) struct Lut {
    /// Write pattern_000.png to pattern_255.png to this folder
    #[arg(long, value_name = "DIR", group = "step", conflicts_with = "output")]
    pub(super) patterns: Option<PathBuf>,
    /// Level that makes the marks of the patterns dark, which turns the phase by about π [default: 105]
    #[arg(long, value_name = "LEVEL")]
    pub(super) dark: Option<u8>,
    /// Folder with the folders red, green and blue, or laser, of photographs
    #[arg(long, value_name = "DIR", group = "step", requires = "output")]
    pub(super) captures: Option<PathBuf>,
    /// Output table for a phone: `per_pixel` of a display file
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: Option<PathBuf>,
    /// Also write the full tables to this folder: full_red.npy …, uint8 (H, W, 256)
    #[arg(long, value_name = "DIR", requires = "captures")]
    pub(super) full: Option<PathBuf>,
    /// Write drawings of curves, residuals and maps to this folder
    #[arg(long, value_name = "DIR", requires = "captures")]
    pub(super) report: Option<PathBuf>,
    #[command(flatten)]
    pub(super) capture: CaptureFlags,
    #[command(flatten)]
    pub(super) display: DisplayFlags,
    #[command(flatten)]
    pub(super) overwrite: OverwriteFlag,
}

impl Lut {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        let with = "--captures";
        check_used(&[("--capture", self.capture.is_given(), self.captures.is_some(), with)])?;
        let by_hand = self.patterns.is_some() || self.capture.is_given();
        check_used(&[("--dark", self.dark.is_some(), by_hand, "--patterns or --capture")])?;
        self.check_outputs()?;
        match &self.patterns {
            Some(folder) => self.write_patterns(json, folder),
            None => {
                self.calibrate(&mut self.capture.later()?)?.print(json);
                Ok(())
            }
        }
    }

    /// Takes the photographs that are missing, if there is a program, and measures the curves.
    pub(super) fn calibrate(&self, capture: &mut Capture<'_>) -> Result<Told> {
        let (Some(captures), Some(output)) = (&self.captures, &self.output) else {
            return Err(Error::Usage("give --patterns, or --captures and -o".into()));
        };
        let display = self.display.read_without_offset()?.target.display;
        if !capture.is_given() {
            reading_captures(captures, colours(&display))?;
        }
        let pattern = self.pattern(&display)?;
        self.take(&display, &pattern, captures, capture)?;
        self.measure(&display, &pattern, captures, output)
    }

    fn pattern(&self, display: &Display) -> Result<Pattern> {
        Ok(Pattern::new(display.size())?.with_dark(self.dark.unwrap_or(DARK)))
    }

    fn check_outputs(&self) -> Result<()> {
        for folder in [&self.patterns, &self.full, &self.report].into_iter().flatten() {
            output::folder(folder, self.overwrite.holding())?;
        }
        (self.output.iter()).try_for_each(|path| output::new_file(path, &[], self.overwrite.is_given()))
    }

    fn write_patterns(&self, json: bool, folder: &Path) -> Result<()> {
        let pattern = self.pattern(&self.display.read_without_offset()?.target.display)?;
        let path = |k: usize| folder.join(format!("pattern_{k:03}.png"));
        output::make_folder(folder)?;
        let bar = progress_bar(PATTERNS as u64, "patterns");
        for k in 0..PATTERNS {
            program::write_levels(pattern.frame(k as u8).view(), &path(k))?;
            bar.inc(1);
        }
        bar.finish_and_clear();
        terminal::print(
            json,
            &json!({"patterns": PATTERNS, "folder": folder.display().to_string()}),
            format!(
                "{PATTERNS} patterns in {}; photograph each in the light of each laser",
                terminal::name(folder)
            ),
        );
        Ok(())
    }

    /// Lets the program of --capture, if there is one, take the photographs that are missing.
    fn take(&self, display: &Display, pattern: &Pattern, captures: &Path, capture: &mut Capture<'_>) -> Result<()> {
        if !capture.is_given() {
            return Ok(());
        }
        let lasers = colours(display).iter().zip(display.wavelengths_m());
        for (colour, (name, wavelength_m)) in lasers.enumerate() {
            let folder = captures.join(name);
            output::make_folder(&folder)?;
            let bar = progress_bar(PATTERNS as u64, name);
            let mut checks = Checks::default();
            for k in 0..PATTERNS {
                bar.inc(1);
                let mut check = |path: &Path| {
                    let photo = Photograph::read(path, channel(display, colour)).map_err(|e| e.to_string())?;
                    checks.check(&photo, pattern, k).map_err(|what| what.told(k))
                };
                if let Some(path) = lut::capture_path(&folder, k) {
                    // The first photograph is what those to come are compared with.
                    if k == 0 {
                        check(&path).map_err(|why| Error::file(&path, format!("{why}; remove it")))?;
                    }
                    continue;
                }
                let frame = pattern.frame(k as u8);
                let shot = Shot {
                    levels: frame.view(),
                    colour: name,
                    wavelength_m: *wavelength_m,
                    z_m: display.offset_m(),
                    // No pattern is brighter than the first, and all have its exposure.
                    may_expose: k == 0,
                };
                if let Some(program) = capture.program()? {
                    program.take(&shot, &folder.join(format!("capture_{k:03}.png")), check)?;
                }
            }
            bar.finish_and_clear();
        }
        Ok(())
    }

    fn measure(&self, display: &Display, pattern: &Pattern, captures: &Path, path: &Path) -> Result<Told> {
        let colours = colours(display);
        let spool = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let (mut curves, mut problems) = (Vec::new(), Vec::new());
        for (colour, name) in colours.iter().enumerate() {
            let folder = captures.join(name);
            let source = |k: usize| lut::read_capture(&folder, channel(display, colour), k);
            let bar = progress_bar(0, name);
            let progress = |done: usize, of: usize| {
                bar.set_length(of as u64);
                bar.set_position(done as u64);
            };
            let measured = lut::measure(pattern, name, &source, spool, &progress);
            bar.finish_and_clear();
            match measured {
                Ok(measured) => curves.push(measured),
                Err(Refusal::Problems(some)) => problems.extend(some),
                Err(Refusal::Other(e)) => return Err(e),
            }
        }
        warn_of(&problems, captures, colours);
        if curves.len() < colours.len() {
            return Err(Error::file(
                captures,
                format!(
                    "{} of {} captures cannot be used, each named above",
                    problems.len(),
                    colours.len() * PATTERNS
                ),
            ));
        }
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
            for (index, curves) in curves.iter().enumerate() {
                let path = folder.join(format!("full_{}.npy", curves.colour));
                output::write_atomically(&path, |file| lut::write_full(curves, index, &per_pixel, file))?;
            }
        }
        calibration::write_per_pixel(path, &per_pixel)?;
        let errors = |of: fn(&Errors) -> f64| {
            let all: Vec<_> = report
                .colours
                .iter()
                .map(|c| format!("{:.3}", of(&c.errors_rad)))
                .collect();
            all.join(" / ")
        };
        Ok(Told {
            table: report.text(),
            line: format!(
                "{}: phase error {} rad without it, {} with it, by its own measurement",
                terminal::name(path),
                errors(|e| e.linear_rms),
                errors(|e| e.compact_rms),
            ),
            value: json!({"output": path.display().to_string(), "report": report}),
        })
    }
}

/// Warns of each problem of the photographs in `captures`, and of many that are missing in one line for each colour.
fn warn_of(problems: &[Problem], captures: &Path, colours: &[&str]) {
    let (missing, others): (Vec<_>, Vec<_>) = problems.iter().partition(|problem| problem.what == What::Missing);
    let mut named = others;
    for name in colours {
        let missing: Vec<_> = missing.iter().filter(|problem| problem.colour == *name).collect();
        match missing[..] {
            [first, ..] if missing.len() > MOST_NAMED => log::warn!(
                "{}: {} of {PATTERNS} photographs are missing, the first of pattern_{:03}.png; name it capture_{:03}.png or .tif",
                captures.join(name).display(),
                missing.len(),
                first.pattern,
                first.pattern
            ),
            _ => named.extend(missing),
        }
    }
    for problem in named {
        log::warn!("{}", captures.join(problem.to_string()).display());
    }
}
