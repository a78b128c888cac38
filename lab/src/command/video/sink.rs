//! Writes what comes out, and takes up where it was left.

use ndarray::ArrayView3;
use phasefront::Hologram;
use phasefront_lab::files::{self, HologramInfo};
use phasefront_lab::film::{self, Quality};
use phasefront_lab::{Error, Result};
use std::path::{Path, PathBuf};

/// What becomes of frames that lie in the folder already.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Before {
    /// They are told of, and nothing is done.
    Refuse,
    /// They stay, and what is missing is made.
    Resume,
    /// They go.
    Overwrite,
}

/// Writes what comes out, and keeps what the report needs.
pub(super) struct Sink {
    folder: Option<PathBuf>,
    film: Option<PathBuf>,
    preview_z_m: Option<f64>,
    info: HologramInfo,
    pub(super) scales: Vec<f32>,
}

impl Sink {
    /// Into `output`, a folder, or a film beside the folder of its name.
    pub(super) fn new(
        output: Option<&Path>,
        preview_z_m: Option<f64>,
        info: HologramInfo,
        before: Before,
    ) -> Result<Self> {
        let film = output.filter(|path| film::is_film(path));
        if let Some(path) = film {
            film::check(path)?;
            if !files::has_extension(path, "mp4") {
                return Err(Error::file(path, "a film is written as .mp4"));
            }
            if path.exists() && before == Before::Refuse {
                return Err(already(path));
            }
        }
        let folder = match film {
            Some(path) => Some(path.with_extension("")),
            None => output.map(Path::to_owned),
        };
        let preview_z_m = preview_z_m.or(film.map(|_| 0.0));
        let sink = Sink {
            folder,
            film: film.map(Path::to_owned),
            preview_z_m,
            info,
            scales: Vec::new(),
        };
        if let Some(folder) = &sink.folder {
            std::fs::create_dir_all(folder).map_err(|e| Error::file(folder, format!("cannot be made: {e}")))?;
            match before {
                Before::Refuse if sink.phase(folder, 0).exists() => return Err(already(folder)),
                Before::Overwrite => remove_frames(folder)?,
                _ => {}
            }
        }
        Ok(sink)
    }

    fn phase(&self, folder: &Path, index: usize) -> PathBuf {
        folder.join(format!("phase_{index:06}.png"))
    }

    fn preview(&self, folder: &Path, index: usize) -> PathBuf {
        folder.join(format!("preview_{index:06}.png"))
    }

    /// The scale of the next frame's hologram where it is written already.
    pub(super) fn written(&self) -> Result<Option<f32>> {
        let Some(folder) = &self.folder else { return Ok(None) };
        let path = self.phase(folder, self.scales.len());
        let seen = self.preview_z_m.is_none() || self.preview(folder, self.scales.len()).exists();
        if !path.exists() || !seen {
            return Ok(None);
        }
        let files::Hologram::PhaseOnly(_, info) = files::read_hologram(&path)? else {
            return Err(Error::file(path, "holds no phases"));
        };
        let same = HologramInfo {
            scale: None,
            ..info.clone()
        } == self.info;
        match (same, info.scale) {
            (true, Some(scale)) => Ok(Some(scale)),
            _ => Err(Error::file(
                path,
                "was made for another display or by another encoder; --resume needs the same flags, --overwrite begins anew",
            )),
        }
    }

    /// Counts a frame that was written before.
    pub(super) fn skip(&mut self, scale: f32) {
        self.scales.push(scale);
    }

    pub(super) fn take(&mut self, hologram: &Hologram) -> Result<()> {
        let index = self.scales.len();
        self.scales.push(hologram.scale());
        let Some(folder) = &self.folder else {
            return Ok(());
        };
        let (height, width) = hologram.shape();
        if let Some(z_m) = self.preview_z_m {
            let mut rgba = vec![0; 4 * height * width];
            hologram.preview(z_m, height, width, &mut rgba)?;
            files::write_rgba(&self.preview(folder, index), width, height, &rgba)?;
        }
        let levels = ArrayView3::from_shape((hologram.colours(), height, width), hologram.levels())
            .map_err(|e| Error::Input(e.to_string()))?;
        let info = HologramInfo {
            scale: Some(hologram.scale()),
            ..self.info.clone()
        };
        files::write_phase_only(&self.phase(folder, index), levels, &info)
    }

    /// Makes the films, where they are asked for: what is seen, and without loss the phases.
    pub(super) fn finish(&self, rate_hz: f64) -> Result<()> {
        let (Some(path), Some(folder)) = (&self.film, &self.folder) else {
            return Ok(());
        };
        film::write(path, &folder.join("preview_%06d.png"), rate_hz, Quality::Seen)?;
        let phases = path.with_file_name(format!("{}-phases.mp4", path.file_stem().unwrap_or_default().display()));
        film::write(&phases, &folder.join("phase_%06d.png"), rate_hz, Quality::Lossless)
    }

    pub(super) fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }
}

fn already(path: &Path) -> Error {
    Error::file(
        path,
        "holds what an earlier run made; --resume goes on with it, --overwrite makes it anew",
    )
}

/// Removes the frames of an earlier run, and nothing else.
fn remove_frames(folder: &Path) -> Result<()> {
    let refuse = |e: std::io::Error| Error::file(folder, format!("cannot be cleared: {e}"));
    for entry in std::fs::read_dir(folder).map_err(refuse)? {
        let path = entry.map_err(refuse)?.path();
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let number = name.strip_prefix("phase_").or(name.strip_prefix("preview_"));
        let is_frame = number.is_some_and(|n| n.len() == 6 && n.bytes().all(|b| b.is_ascii_digit()));
        if is_frame && files::has_extension(&path, "png") {
            std::fs::remove_file(&path).map_err(refuse)?;
        }
    }
    Ok(())
}
