//! Phase maps of other software: images of levels, and arrays of levels, of phases in radians or of exp(iφ).
//!
//! A file of Phasefront describes itself. Other files say nothing, so that they are read for a display that the caller
//! names: an image holds its levels, one channel for each laser.

use super::{Hologram, HologramInfo, Levels, levels_of, read_description, read_hologram};
use crate::display::DisplayFile;
use crate::input::decode::{self, Reading};
use crate::input::npy::{self, Map};
use crate::output::has_extension;
use crate::picture::opaque;
use crate::{Error, Result};
use image::DynamicImage;
use ndarray::Array3;
use phasefront::Size;
use phasefront::target::Response;
use phasefront_core::display::panel::PanelPlan;
use phasefront_core::display::response::{linear_words, wrap};
use std::path::Path;

/// Reads a hologram like [`read_hologram`], or a phase map of other software for `display`: a PNG, BMP or TIFF of
/// levels, or a `.npy` of levels (whole numbers), of phases in radians, or of exp(iφ).
///
/// # Errors
/// Returns the errors of [`read_hologram`]. Of a phase map, returns an error if its channels, size or levels do not fit
/// the display.
pub fn read_for(path: &Path, display: Option<&DisplayFile>) -> Result<Hologram> {
    let describes_itself = match has_extension(path, "npy") {
        true => path.with_extension("json").is_file(),
        false => read_description(path)?.is_some(),
    };
    let Some(display) = display.filter(|_| !describes_itself) else {
        return read_hologram(path);
    };
    if ["jpg", "jpeg", "webp", "gif"]
        .iter()
        .any(|lossy| has_extension(path, lossy))
    {
        return Err(Error::file(
            path,
            "is a picture and no phase map, whose levels must be exact; phase maps are PNG, BMP, TIFF or .npy",
        ));
    }
    log::info!(
        "{}: says nothing of itself, so its values are taken as a phase map",
        path.display()
    );
    let info = HologramInfo::of_levels(display);
    let levels = match has_extension(path, "npy") {
        true => of_array(path, display),
        false => {
            let (image, _) = decode::open_picture(path, Reading::AS_STORED)?;
            let colours = display.target.display.colours();
            of_colours(opaque(image), colours).and_then(|image| levels_of(image, &info))
        }
    };
    Ok(Hologram::Levels(levels.map_err(|why| Error::file(path, why))?, info))
}

/// Returns an image with the channels of a display of `colours` lasers.
fn of_colours(image: DynamicImage, colours: usize) -> std::result::Result<DynamicImage, String> {
    match (image, colours) {
        (DynamicImage::ImageRgb8(rgb), 1) => match rgb.pixels().all(|p| p.0[0] == p.0[1] && p.0[1] == p.0[2]) {
            true => Ok(DynamicImage::from(rgb).into_luma8().into()),
            false => Err("has colours, and the display has one laser; give a grey phase map".into()),
        },
        (DynamicImage::ImageLuma8(_) | DynamicImage::ImageLuma16(_), 2..) => Err(format!(
            "is a grey phase map, and the display has {colours} lasers; give an RGB image with a map for each, or a display of one laser, wavelengths_nm = [532]"
        )),
        (image, _) => Ok(image),
    }
}

fn of_array(path: &Path, display: &DisplayFile) -> std::result::Result<Levels, String> {
    let bits = display.target.display.bits();
    let fits = |(planes, ..): (usize, usize, usize)| match display.target.display.colours() {
        colours if colours == planes => Ok(()),
        colours => Err(format!("has {planes} planes; the display has {colours} lasers")),
    };
    let file = npy::open(path).map_err(|e| e.to_string())?;
    let phases = match npy::read_map(file)? {
        Map::Levels(levels) => {
            fits(levels.dim())?;
            let most = levels.iter().copied().max().unwrap_or_default();
            if u32::from(most) >> bits != 0 {
                return Err(format!("holds a level of {most}; the display has {bits} bits"));
            }
            return Ok(match bits {
                0..=8 => Levels::Bytes(levels.mapv(|level| level as u8)),
                _ => Levels::Words(levels),
            });
        }
        Map::Radians(phases) => phases,
        Map::Field(field) => {
            let amplitude = field.iter().map(|value| value.norm());
            let (least, most) = amplitude.fold((f32::INFINITY, 0.0f32), |(least, most), v| (least.min(v), most.max(v)));
            if most - least > 1e-3 * most {
                return Err(
                    "is a complex field and no phase map: its amplitude varies; `phasefront encode` makes a hologram of it"
                        .into(),
                );
            }
            field.mapv(|value| value.arg())
        }
    };
    fits(phases.dim())?;
    if let Some(bad) = phases.iter().find(|phase| !phase.is_finite()) {
        return Err(format!("holds a phase of {bad}; all must be finite"));
    }
    let most = phases.iter().fold(0.0f32, |most, phase| most.max(phase.abs()));
    if most > 7.0 && phases.iter().all(|phase| phase.fract() == 0.0) {
        return Err(format!(
            "holds whole numbers up to {most} as floating point; save levels as uint8 or uint16, and phases in radians"
        ));
    }
    if (0.5..=1.0).contains(&most) {
        log::warn!(
            "{}: its phases reach {most:.2} rad; phases are radians, and levels whole numbers",
            path.display()
        );
    }
    levels_of_phases(phases, display).map_err(|e| e.to_string())
}

/// Returns the levels of phases in radians, (C, H, W), that a flat panel shows: the panel's flatness, carrier and lens
/// are added.
///
/// # Errors
/// Returns an error if the phases have more pixels than the modulator, or if a calibration does not fit it.
pub fn levels_of_phases(mut phases: Array3<f32>, display: &DisplayFile) -> phasefront::Result<Levels> {
    let shape @ (_, height, width) = phases.dim();
    let (size, target) = (Size { width, height }, &display.target);
    phases.mapv_inplace(wrap);
    let panel = PanelPlan::new(&target.panel, &target.display, size)?;
    let values = phases.as_slice_mut().expect("standard layout");
    if let Some(panel) = &panel {
        panel.add(values);
    }
    let bits = target.display.bits();
    if bits > 8 {
        let mut words = Array3::zeros(shape);
        linear_words(values, bits, words.as_slice_mut().expect("standard layout"));
        return Ok(Levels::Words(words));
    }
    let mut bytes = Array3::zeros(shape);
    let levels = bytes.as_slice_mut().expect("standard layout");
    if panel.is_none_or(|panel| !panel.levels(values, levels)) {
        let response: Response = target.response.clone().centred(size)?;
        let rows = values.chunks_exact(width).zip(levels.chunks_exact_mut(width));
        for (row, (phases, levels)) in rows.enumerate() {
            response.levels(phases, row * width, levels);
        }
    }
    Ok(Levels::Bytes(bytes))
}
