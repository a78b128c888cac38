//! The end of `phasefront calibrate all`: what is wrong with a picture on the calibrated display.

use super::capture::Capture;
use super::{Told, channel, find_photo};
use crate::command::diagnose::describe;
use ndarray::{Array3, Axis, stack};
use phasefront_calibration::camera::photograph::Photograph;
use phasefront_calibration::camera::program::Shot;
use phasefront_calibration::colours;
use phasefront_calibration::diagnosis::{Shown, diagnose};
use phasefront_calibration::learned::scenes;
use phasefront_command::flags::DisplayFlags;
use phasefront_core::display::levels::Levels;
use phasefront_io::{Error, Result, output};
use serde_json::json;
use std::path::Path;

/// The folder of the photographs.
const FOLDER: &str = "diagnosis";

/// Photographs a picture in the middle of the volume on the calibrated `display`, in the light of each laser, and says
/// what is wrong with it, or why that cannot be said.
pub(super) fn diagnosis(display: &DisplayFlags, folder: &Path, capture: &mut Capture<'_>) -> Result<Told> {
    let target = display.read()?.corrected()?;
    let folder = folder.join(FOLDER);
    output::make_folder(&folder)?;
    let (mut planes, mut photographs) = (Vec::new(), Vec::new());
    for (colour, name) in colours(&target.display).iter().enumerate() {
        let scene = scenes::scene(&target, colour, 0, 1)?;
        let read = |path: &Path| Photograph::read(path, channel(&target.display, colour));
        let photograph = match (find_photo(&folder, &format!("capture_{name}")), capture.program()?) {
            (Some(path), _) => read(&path)?,
            (None, Some(program)) => {
                let shot = Shot {
                    levels: scene.levels.view(),
                    colour: name,
                    wavelength_m: target.display.wavelengths_m()[colour],
                    z_m: scene.z_m,
                    may_expose: true,
                };
                let path = folder.join(format!("capture_{name}.png"));
                program.take(&shot, &path, |path| read(path).map_err(|e| e.to_string()))?
            }
            (None, None) => return Err(Error::file(&folder, "holds no photograph, and there is no program")),
        };
        photographs.push(photograph);
        planes.push(scene.levels);
    }
    let views: Vec<_> = planes.iter().map(|plane| plane.view()).collect();
    let levels: Array3<u8> = stack(Axis(0), &views).expect("planes of the modulator's size");
    let shown = Shown {
        levels: Levels::Bytes(levels.as_slice().expect("standard layout")),
        size: target.modulator(),
        target: &target,
        z_m: scenes::z_m(&target, 0, 1),
    };
    let (value, text) = match diagnose(&shown, &photographs) {
        Ok(diagnosis) => (json!(diagnosis), describe(&diagnosis)),
        Err(why) => (
            json!({ "why": why.to_string() }),
            format!("nothing can be said of the photographs in {}: {why}", folder.display()),
        ),
    };
    Ok(Told::new(
        json!({"step": "diagnosis", "diagnosis": value}),
        format!("diagnosis: {text}"),
    ))
}
