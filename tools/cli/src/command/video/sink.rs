//! Writes the output of a run, or continues that of an earlier run.

use crate::record::{Before, Claim, RunRecord, already, names_of};
use ndarray::Array3;
use phasefront::Hologram;
use phasefront::Size;
use phasefront::output::Layout;
use phasefront::session::FrameTimes;
use phasefront_command::interrupt;
use phasefront_io::film::video::VideoFrame;
use phasefront_io::film::{self, Quality};
use phasefront_io::hologram::{self, HologramInfo, Levels};
use phasefront_io::{Error, Result, output, picture};
use std::path::{Path, PathBuf};

/// The file of a run's report in its folder.
const STATISTICS: &str = "statistics.json";

/// Writes the output of a run and keeps the figures for its report.
pub(super) struct Sink {
    folder: Option<PathBuf>,
    /// The film of the previews and the film of the phases.
    films: Option<[PathBuf; 2]>,
    preview_z_m: Option<f64>,
    info: HologramInfo,
    record: RunRecord,
    claim: Option<Claim>,
    pub(super) scales: Vec<f32>,
    /// The times of the frames that this run made.
    pub(super) times: Vec<FrameTimes>,
}

impl Sink {
    /// Creates a sink that writes to `output`: a folder, or a film beside the folder of its name.
    pub(super) fn new(
        output: Option<&Path>,
        preview_z_m: Option<f64>,
        info: HologramInfo,
        before: Before,
        record: RunRecord,
    ) -> Result<Self> {
        let films = match output.filter(|path| film::is_film(path)) {
            Some(path) => {
                film::check(path)?;
                let name = format!("{}-phases.mp4", path.file_stem().unwrap_or_default().display());
                let films = [path.to_owned(), path.with_file_name(name)];
                for path in &films {
                    output::file(path, &["mp4"])?;
                }
                Some(films)
            }
            None => None,
        };
        let folder = match &films {
            Some([path, _]) => Some(path.with_extension("")),
            None => output.map(Path::to_owned),
        };
        let film = films.iter().flatten().find(|path| path.exists());
        if let (Some(path), Before::Refuse) = (film, before) {
            return Err(already(path));
        }
        let mut claim = None;
        if let Some(folder) = &folder {
            output::folder(folder, before.holding())?;
            let new = Claim::new(folder, &record, before, |name| is_frame(name) || name == STATISTICS)?;
            // Films beside a folder without frames do not belong to an earlier run.
            if let (Some(path), Before::Resume, false) = (film, before, new.resumes) {
                return Err(already(path));
            }
            if before == Before::Overwrite {
                remove_made(folder)?;
            }
            claim = Some(new);
        }
        Ok(Sink {
            folder,
            films,
            preview_z_m,
            info,
            record,
            claim,
            scales: Vec::new(),
            times: Vec::new(),
        })
    }

    /// Prepares for interrupts. A `live` run cannot be resumed.
    pub(super) fn expect_interrupts(&self, live: bool) {
        let Some(folder) = self.folder.as_deref().map(Path::display) else {
            return;
        };
        interrupt::advise(match live {
            true => format!("{folder} keeps the frames that are made"),
            false => {
                format!("{folder} keeps the frames that are made; the same command with --resume makes the others")
            }
        });
    }

    /// Checks whether frames of an earlier run may exist.
    pub(super) fn resumes(&self) -> bool {
        self.claim.as_ref().is_some_and(|claim| claim.resumes)
    }

    fn phase(&self, folder: &Path, index: usize) -> PathBuf {
        folder.join(format!("phase_{index:06}.png"))
    }

    fn preview(&self, folder: &Path, index: usize) -> PathBuf {
        folder.join(format!("preview_{index:06}.png"))
    }

    /// Returns the scale of the next frame's hologram if it is already written and was made of `frame`.
    pub(super) fn written(&self, frame: &VideoFrame) -> Result<Option<f32>> {
        let Some(folder) = &self.folder else { return Ok(None) };
        let path = self.phase(folder, self.scales.len());
        let seen = self.preview_z_m.is_none() || self.preview(folder, self.scales.len()).exists();
        if !path.exists() || !seen {
            return Ok(None);
        }
        match hologram::read_made_of(&path)? {
            Some((made_of, Some(scale))) if made_of == self.made_of(frame) => Ok(Some(scale)),
            _ => Err(Error::file(
                path,
                "was made of another frame than this run has there; --resume needs the same input, --overwrite begins anew",
            )),
        }
    }

    /// Returns the fingerprint that identifies the hologram of `frame`.
    fn made_of(&self, frame: &VideoFrame) -> String {
        let mut all = self.record.fingerprint();
        frame.fingerprint(&mut all);
        all.to_string()
    }

    /// Counts a frame that was written before.
    pub(super) fn skip(&mut self, scale: f32) {
        self.scales.push(scale);
    }

    /// Writes the next hologram. `frame` is its input, or `None` in a live stream, which cannot be resumed.
    pub(super) fn take(&mut self, hologram: &Hologram, frame: Option<&VideoFrame>) -> Result<()> {
        let index = self.scales.len();
        self.scales.push(hologram.scale());
        self.times.push(hologram.times());
        let Some(folder) = &self.folder else {
            return Ok(());
        };
        let Size { width, height } = hologram.size();
        if let Some(z_m) = self.preview_z_m {
            let mut rgba = vec![0; 4 * height * width];
            hologram.write_preview(z_m, hologram.size(), Layout::Rgba, &mut rgba, 4 * width)?;
            picture::write_rgba(&self.preview(folder, index), hologram.size(), &rgba)?;
        }
        let shape = (hologram.colours(), height, width);
        let info = HologramInfo {
            scale: Some(hologram.scale()),
            srgb_of_light: HologramInfo::light_rows(&hologram.view_colours(), hologram.colours()),
            ..self.info.clone()
        };
        let path = self.phase(folder, index);
        let levels = Array3::from_shape_vec(shape, hologram.levels().to_vec());
        let levels = Levels::Bytes(levels.map_err(|e| Error::Input(e.to_string()))?);
        let hologram = hologram::Hologram::Levels(levels, info);
        match frame {
            None => hologram::write_hologram(&path, &hologram),
            Some(frame) => hologram::write_made_of(&path, &hologram, &self.made_of(frame)),
        }
    }

    /// Makes the films if they are requested: one of the previews, and a lossless one of the phases.
    pub(super) fn finish(&self, rate_hz: f64) -> Result<()> {
        let (Some([seen, phases]), Some(folder)) = (&self.films, &self.folder) else {
            return Ok(());
        };
        film::write(seen, folder, "preview_%06d.png", rate_hz, Quality::Seen)?;
        film::write(phases, folder, "phase_%06d.png", rate_hz, Quality::Lossless)
    }

    /// Writes the report.
    pub(super) fn write_report(&self, report: &serde_json::Value) -> Result<()> {
        let Some(folder) = &self.folder else { return Ok(()) };
        output::write_atomically(&folder.join(STATISTICS), |file| {
            serde_json::to_writer_pretty(&mut *file, report)?;
            std::io::Write::write_all(file, b"\n")
        })
    }
}

fn is_frame(name: &str) -> bool {
    let number = name.strip_prefix("phase_").or(name.strip_prefix("preview_"));
    let digits = number.and_then(|rest| rest.strip_suffix(".png"));
    digits.is_some_and(|n| n.len() >= 6 && n.bytes().all(|b| b.is_ascii_digit()))
}

/// Removes the files of an earlier run and nothing else.
fn remove_made(folder: &Path) -> Result<()> {
    for name in names_of(folder)? {
        if is_frame(&name) || name == STATISTICS {
            let path = folder.join(name);
            std::fs::remove_file(&path).map_err(|e| Error::file(path, format!("cannot be removed: {e}")))?;
        }
    }
    Ok(())
}
