//! `phasefront calibrate model`: what photographs of holograms say about a display beyond its other calibrations.

use super::capture::{Capture, CaptureFlags};
use super::{Told, channel, find_photo};
use clap::Args;
use phasefront::Target;
use phasefront_calibration::camera::pattern::Pattern;
use phasefront_calibration::camera::photograph::Photograph;
use phasefront_calibration::camera::program::{self, Shot};
use phasefront_calibration::colours;
use phasefront_calibration::learned::album::Album;
use phasefront_calibration::learned::fit::{self, Fitted, Sample};
use phasefront_calibration::learned::scenes::{self, Scene};
use phasefront_command::flags::{DisplayFlags, OverwriteFlag};
use phasefront_command::terminal::{self, progress_bar};
use phasefront_core::display::model::Model;
use phasefront_core::runtime::file;
use phasefront_io::display::calibration;
use phasefront_io::output::{self, Holding};
use phasefront_io::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The list of the holograms in a folder of photographs.
const LIST: &str = "holograms.json";

/// Learn a model of the display from photographs of holograms: crosstalk, aperture, undiffracted light
///
/// Calibrate everything else first. The first run writes marks.png and hologram_000.png … to DIR/red, DIR/green and
/// DIR/blue, or DIR/laser, and holograms.json, which says where to focus for each. Show each, photograph it as
/// capture_marks.png and capture_000.png … in the same folder, and run the command again. With --capture, a program
/// shows and photographs all of them.
#[derive(Args)]
pub(crate) struct LearnModel {
    /// Folder of the holograms and their photographs
    #[arg(value_name = "DIR")]
    pub(super) folder: PathBuf,
    /// Number of photographs for each colour
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = clap::value_parser!(u16).range(4..=1000))]
    pub(super) photographs: u16,
    #[command(flatten)]
    pub(super) capture: CaptureFlags,
    #[command(flatten)]
    pub(super) display: DisplayFlags,
    /// Output model: `model` of a display file
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: PathBuf,
    #[command(flatten)]
    pub(super) overwrite: OverwriteFlag,
}

/// The contents of [`LIST`].
#[derive(Serialize, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
struct List {
    /// The z to focus on for each hologram, in mm.
    z_mm: Vec<f64>,
}

impl LearnModel {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        output::new_file(&self.output, &[], self.overwrite.is_given())?;
        self.calibrate(&mut self.capture.later()?)?.print(json);
        Ok(())
    }

    /// Takes the photographs that are missing, if there is a program, and fits the model if none is missing.
    pub(super) fn calibrate(&self, capture: &mut Capture<'_>) -> Result<Told> {
        output::folder(&self.folder, Holding::RunOf(LIST))?;
        let target = Target {
            model: None,
            ..self.display.read()?.corrected()?
        };
        target.check()?;
        self.check_list(&target)?;
        let names = colours(&target.display);
        let jobs = names.iter().enumerate().map(|(colour, name)| OfColour {
            target: &target,
            colour,
            name,
            folder: self.folder.join(name),
            count: self.photographs.into(),
        });
        let jobs: Vec<_> = jobs.collect();
        // All photographs are there before the first fit, which takes minutes.
        let mut missing = 0;
        for job in jobs.iter().filter(|_| !jobs.iter().all(OfColour::is_complete)) {
            output::make_folder(&job.folder)?;
            missing += job.samples(capture)?.1;
        }
        if missing > 0 {
            return Ok(self.ask(missing));
        }
        let fitted: Result<Vec<Fitted>> = jobs.iter().map(|job| job.fit(capture)).collect();
        let fitted = fitted?;
        let misfit: Vec<[f64; 2]> = fitted.iter().map(|one| one.misfit).collect();
        let models = fitted.into_iter().map(|one| one.model).collect();
        calibration::write_model(&self.output, &Model::new(fit::nodes(target.modulator()), models)?)?;
        let list = |which: usize| {
            let all: Vec<_> = misfit.iter().map(|of| format!("{:.3}", of[which])).collect();
            all.join(" / ")
        };
        Ok(Told::new(
            json!({"output": self.output.display().to_string(), "misfit": misfit}),
            format!(
                "{}: misfit of the light {} without the model, {} with it ({})",
                terminal::name(&self.output),
                list(0),
                list(1),
                names.join(" / ")
            ),
        ))
    }

    /// Writes the list of holograms, or compares it with that of an earlier run.
    fn check_list(&self, target: &Target) -> Result<()> {
        let count = usize::from(self.photographs);
        let mm = |index| (scenes::z_m(target, index, count) * 1e9).round() / 1e6;
        let list = List {
            z_mm: (0..count).map(mm).collect(),
        };
        let path = self.folder.join(LIST);
        if path.exists() {
            let text = file::read_text(&path).map_err(|e| Error::file(&path, e))?;
            let there: List = serde_json::from_str(&text).map_err(|e| Error::file(&path, e))?;
            if there != list {
                return Err(Error::file(
                    path,
                    format!(
                        "lists {} photographs, or other depths, --photographs says {count}; a model needs a folder of its own",
                        there.z_mm.len()
                    ),
                ));
            }
            return Ok(());
        }
        output::make_folder(&self.folder)?;
        let text = serde_json::to_string_pretty(&list).map_err(|e| Error::file(&path, e))?;
        output::write_atomically(&path, |file| writeln!(file, "{text}"))
    }

    fn ask(&self, missing: usize) -> Told {
        Told::new(
            json!({"folder": self.folder.display().to_string(), "missing": missing}),
            format!(
                "{missing} photographs to take: show marks.png and each hologram_….png of {}, focus as {LIST} says, photograph them as capture_marks.png, capture_000.png …, then run this again",
                terminal::name(&self.folder)
            ),
        )
    }
}

/// The photographs of one colour.
struct OfColour<'a> {
    target: &'a Target,
    colour: usize,
    name: &'a str,
    folder: PathBuf,
    count: usize,
}

impl OfColour<'_> {
    /// Checks whether all photographs are there.
    fn is_complete(&self) -> bool {
        let there = |stem: &str| find_photo(&self.folder, &format!("capture_{stem}")).is_some();
        there("marks") && (0..self.count).all(|index| there(&format!("{index:03}")))
    }

    /// Fits the model to the photographs.
    fn fit(&self, capture: &mut Capture<'_>) -> Result<Fitted> {
        let (samples, _) = self.samples(capture)?;
        let bar = progress_bar(0, self.name);
        let progress = |done: usize, of: usize| {
            bar.set_length(of as u64);
            bar.set_position(done as u64);
        };
        let fitted = fit::fit(self.target, self.colour, &samples, &progress);
        bar.finish_and_clear();
        fitted.map_err(|e| Error::file(&self.folder, e))
    }

    /// Returns the photographs and the number of those that are missing. A program takes them if there is one.
    fn samples(&self, capture: &mut Capture<'_>) -> Result<(Vec<Sample>, usize)> {
        let pattern = Pattern::new(self.target.modulator())?;
        let marks = scenes::marks(
            self.target,
            self.colour,
            &pattern,
            scenes::z_m(self.target, 0, self.count),
        )?;
        let begin = |photo: &Photograph| Album::new(self.target, self.colour, photo);
        let mut album = self.photograph("marks", &marks, capture, begin)?;
        let (mut samples, mut missing) = (Vec::new(), usize::from(album.is_none()));
        let bar = progress_bar(self.count as u64, self.name);
        for index in 0..self.count {
            bar.inc(1);
            let scene = scenes::scene(self.target, self.colour, index, self.count)?;
            let check = |photo: &Photograph| match &mut album {
                None => Ok(None),
                Some(album) => {
                    album.check(&scene, photo)?;
                    Ok(Some((album.registration(), photo.clone())))
                }
            };
            match self
                .photograph(&format!("{index:03}"), &scene, capture, check)?
                .flatten()
            {
                None => missing += 1,
                Some((registration, photograph)) => samples.push(Sample {
                    scene,
                    photograph,
                    registration,
                }),
            }
        }
        bar.finish_and_clear();
        Ok((samples, missing))
    }

    /// Returns what `check` says of the photograph of `scene`, which a program takes if it is not there. Without a
    /// program, writes the levels and returns `None`.
    fn photograph<T>(
        &self,
        stem: &str,
        scene: &Scene,
        capture: &mut Capture<'_>,
        mut check: impl FnMut(&Photograph) -> std::result::Result<T, String>,
    ) -> Result<Option<T>> {
        let channel = channel(&self.target.display, self.colour);
        let mut read = |path: &Path| {
            let photo = Photograph::read(path, channel).map_err(|e| e.to_string())?;
            check(&photo)
        };
        if let Some(path) = find_photo(&self.folder, &format!("capture_{stem}")) {
            output::reading(&path)?;
            return read(&path)
                .map(Some)
                .map_err(|why| Error::file(&path, format!("{why}; remove it")));
        }
        let shot = Shot {
            levels: scene.levels.view(),
            colour: self.name,
            wavelength_m: self.target.display.wavelengths_m()[self.colour],
            z_m: scene.z_m,
            // The fit finds the exposure of each photograph.
            may_expose: true,
        };
        if let Some(program) = capture.program()? {
            let path = self.folder.join(format!("capture_{stem}.png"));
            return program.take(&shot, &path, read).map(Some);
        }
        let name = if stem == "marks" {
            "marks.png".into()
        } else {
            format!("hologram_{stem}.png")
        };
        program::write_levels(scene.levels.view(), &self.folder.join(name))?;
        Ok(None)
    }
}
