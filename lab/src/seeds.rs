//! What seeded networks are trained on: the sweep's fields of a data set's scenes, on depths that were given.
//!
//! A folder holds for each scene `depth_000123.npy`, uint16 (V, H, W): V variants of its visible depth, d·65535, clean or
//! as a phone would measure it; the training package makes them. To each, [`make`] adds `seed_000123.npy`, int16
//! (V, 6, H, W): the real planes of the field's three colours and its three imaginary ones, times [`SCALE`]; and to all,
//! `seeds.json`, which says by which sweep.

use crate::dataset::{self, Manifest};
use crate::error::{Error, Result};
use crate::files;
use ndarray::{Array2, Array3, Array4, Axis};
use ndarray_npy::{ReadNpyExt, WriteNpyExt};
use num_complex::Complex32;
use phasefront::sweep::SweepPlan;
use phasefront::{RgbdFrame, Sweep};
use rayon::prelude::*;
use std::fs::File;
use std::io::{BufReader, Write};
use std::path::{Path, PathBuf};

/// What a field is multiplied by: amplitudes up to 4 fit, in steps of 1.2·10⁻⁴.
pub const SCALE: f32 = 8192.0;
/// The first words of `seeds.json`.
const FORMAT: &str = "phasefront-seeds-1";

/// Makes the seeds of the data set in `data`, which `manifest` describes, for all depths in `dir` that have none yet, by
/// `sweep`. `made` hears of each that is there.
///
/// # Errors
/// Depths that are of another shape than the scenes, seeds of another sweep, or a folder that cannot be written.
pub fn make(
    manifest: &Manifest,
    data: &Path,
    dir: &Path,
    sweep: Sweep,
    made: &(dyn Fn() + Sync),
) -> Result<()> {
    let place = dir.join("seeds.json");
    let description = serde_json::json!({
        "format": FORMAT, "scale": SCALE, "planes": sweep.planes, "taps": sweep.taps,
        "hidden_layers": sweep.hidden_layers, "between_planes": sweep.between_planes,
    });
    match std::fs::read(&place) {
        Ok(bytes) => {
            if serde_json::from_slice::<serde_json::Value>(&bytes).ok() != Some(description) {
                return Err(Error::file(
                    place,
                    "the folder holds seeds of another sweep; choose another folder or the same sweep",
                ));
            }
        }
        Err(_) => {
            files::write_atomically(&place, |file| writeln!(file, "{description}"))?;
        }
    }
    let plan = SweepPlan::new(manifest.size, manifest.size, &manifest.display, sweep, 0.0)?;
    (0..manifest.scenes).into_par_iter().try_for_each(|index| {
        let file = |what: &str| -> PathBuf { dir.join(format!("{what}_{index:06}.npy")) };
        let (depths, seeds) = (file("depth"), file("seed"));
        if depths.exists() && !seeds.exists() {
            let pair = dataset::read_pair(manifest, data, index)?;
            let colour = crate::evaluate::visible_rgb(&pair.ldi);
            let fields = fields(&plan, &colour, &read_depths(&depths, manifest.size)?)?;
            files::write_atomically(&seeds, |file| {
                fields.write_npy(file).map_err(std::io::Error::other)
            })?;
        }
        made();
        Ok(())
    })
}

fn read_depths(path: &Path, size: usize) -> Result<Array3<u16>> {
    let file = File::open(path).map_err(|e| Error::file(path, e))?;
    let depths = Array3::<u16>::read_npy(BufReader::new(file)).map_err(|e| Error::file(path, e))?;
    match depths.dim() {
        (_, height, width) if (height, width) == (size, size) => Ok(depths),
        (_, height, width) => Err(Error::file(
            path,
            format!("depths are {width}×{height}; the scenes are {size}×{size}"),
        )),
    }
}

/// The fields of one scene on all its depths.
fn fields(plan: &SweepPlan, colour: &Array3<f32>, depths: &Array3<u16>) -> Result<Array4<i16>> {
    let (variants, height, width) = depths.dim();
    let mut fields = Array4::zeros((variants, 6, height, width));
    let mut scratch = plan.scratch();
    let mut field = Array3::from_elem((3, height, width), Complex32::ZERO);
    for (depth, mut planes) in depths.outer_iter().zip(fields.outer_iter_mut()) {
        let depth: Array2<f32> = depth.mapv(|d| f32::from(d) / 65535.0);
        let frame = RgbdFrame::new(colour.clone(), depth)?;
        let values = field.as_slice_mut().expect("standard layout");
        plan.field(&frame, values, &mut scratch)?;
        for (c, colour) in field.outer_iter().enumerate() {
            let stored = |value: f32| (value * SCALE).round() as i16;
            let mut plane = |c: usize, part: fn(&Complex32) -> f32| {
                planes
                    .index_axis_mut(Axis(0), c)
                    .zip_mut_with(&colour, |to, from| *to = stored(part(from)));
            };
            plane(c, |value| value.re);
            plane(c + 3, |value| value.im);
        }
    }
    Ok(fields)
}
