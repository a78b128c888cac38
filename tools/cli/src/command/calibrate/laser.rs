//! `phasefront calibrate laser`: the laser's amplitude over the modulator.

use super::capture::{Capture, CaptureFlags};
use super::{Told, channel, find_photo, photo_path, reading_captures};
use clap::Args;
use ndarray::{Array2, Axis, stack};
use phasefront::Display;
use phasefront::Size;
use phasefront_calibration::camera::marks;
use phasefront_calibration::camera::pattern::Pattern;
use phasefront_calibration::camera::photograph::Photograph;
use phasefront_calibration::camera::program::Shot;
use phasefront_calibration::colours;
use phasefront_calibration::curves::lut::Checks;
use phasefront_calibration::optics::laser;
use phasefront_command::flags::{DisplayFlags, OverwriteFlag};
use phasefront_command::terminal;
use phasefront_io::display::calibration;
use phasefront_io::output;
use phasefront_io::{Error, Result};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Find the laser's amplitude over the modulator, from photographs of a diffuser in its place
///
/// CAPTURES has folders red, green and blue, or laser. Each holds diffuser.png (or .tif) and capture_000.png, a
/// photograph of pattern 0 from the same camera position, which shows where the modulator is. With --capture, a
/// program takes flat.png instead, a photograph of the modulator with all pixels at level 0.
#[derive(Args)]
pub(crate) struct Laser {
    /// Folder with the folders red, green and blue, or laser
    #[arg(value_name = "CAPTURES")]
    pub(super) captures: PathBuf,
    /// Fit a mixture of this many Gaussian beams
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=4))]
    pub(super) gaussians: Option<u8>,
    #[command(flatten)]
    pub(super) capture: CaptureFlags,
    #[command(flatten)]
    pub(super) display: DisplayFlags,
    /// Output map: `laser` of a display file
    #[arg(short, long, value_name = "OUT.png")]
    pub(super) output: PathBuf,
    #[command(flatten)]
    pub(super) overwrite: OverwriteFlag,
}

impl Laser {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        output::new_file(&self.output, &["png"], self.overwrite.is_given())?;
        self.calibrate(&mut self.capture.later()?)?.print(json);
        Ok(())
    }

    /// Takes the photographs that are missing, if there is a program, and maps the light.
    pub(super) fn calibrate(&self, capture: &mut Capture<'_>) -> Result<Told> {
        let display = self.display.read_without_offset()?.target.display;
        self.take(&display, capture)?;
        reading_captures(&self.captures, colours(&display))?;
        let size = display.size();
        let pattern = Pattern::new(Size {
            width: size.width,
            height: size.height,
        })?;
        let (mut maps, mut left) = (Vec::new(), Vec::new());
        for (colour, name) in colours(&display).iter().enumerate() {
            let folder = self.captures.join(name);
            let read = |stem: &str| -> Result<(PathBuf, Photograph)> {
                let path = photo_path(&folder, stem)?;
                let photo = Photograph::read(&path, channel(&display, colour))?;
                Ok((path, photo))
            };
            let ((marked_path, marked), (path, photo)) = (read("capture_000")?, read(light_stem(&folder))?);
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
            let map = laser::map(&photo, &registration, size).map_err(|e| Error::file(&path, e))?;
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
        Ok(Told::new(
            json!({"output": self.output.display().to_string(), "least_amplitude": least, "fit_residual": left}),
            format!(
                "{}: least amplitude {:.2?} of the most in {}",
                terminal::name(&self.output),
                least,
                colours(&display).join(", ")
            ),
        ))
    }

    /// Lets the program of --capture, if there is one, take the photographs that are missing.
    fn take(&self, display: &Display, capture: &mut Capture<'_>) -> Result<()> {
        if !capture.is_given() {
            return Ok(());
        }
        let pattern = Pattern::new(display.size())?;
        let (frame, flat) = (pattern.frame(0), Array2::zeros(pattern.size().shape()));
        let lasers = colours(display).iter().zip(display.wavelengths_m());
        for (colour, (name, wavelength_m)) in lasers.enumerate() {
            let channel = channel(display, colour);
            let folder = self.captures.join(name);
            output::make_folder(&folder)?;
            let mut shot = Shot {
                levels: frame.view(),
                colour: name,
                wavelength_m: *wavelength_m,
                z_m: display.offset_m(),
                may_expose: true,
            };
            if find_photo(&folder, "capture_000").is_none()
                && let Some(program) = capture.program()?
            {
                program.take(&shot, &folder.join("capture_000.png"), |path| {
                    let photo = Photograph::read(path, channel).map_err(|e| e.to_string())?;
                    Checks::default()
                        .check(&photo, &pattern, 0)
                        .map_err(|what| what.told(0))
                })?;
            }
            if find_photo(&folder, light_stem(&folder)).is_none()
                && let Some(program) = capture.program()?
            {
                // As bright as the pattern, and of the same exposure.
                (shot.levels, shot.may_expose) = (flat.view(), false);
                let marked = Photograph::read(&photo_path(&folder, "capture_000")?, channel)?;
                let registration = marks::register(&marked, &pattern)?;
                program.take(&shot, &folder.join("flat.png"), |path| {
                    let photo = Photograph::read(path, channel).map_err(|e| e.to_string())?;
                    laser::map(&photo, &registration, pattern.size()).map_err(|e| e.to_string())
                })?;
            }
        }
        Ok(())
    }
}

/// Returns the name of the photograph that shows the light: of a diffuser, or of a flat modulator.
fn light_stem(folder: &Path) -> &'static str {
    match find_photo(folder, "diffuser") {
        Some(_) => "diffuser",
        None if find_photo(folder, "flat").is_some() => "flat",
        None => "diffuser",
    }
}
