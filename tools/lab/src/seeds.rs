//! The training data of seeded networks: the sweep's fields of a data set's scenes, for given depths.
//!
//! A folder holds, for each scene, `depth_000123.npy`, uint16 (V, H, W): V variants of the visible depth, d·65535,
//! either clean or as a phone would measure it. The training package makes these files. [`make`] adds two files for
//! each scene. `refined_000123.npy`, uint16 (R, H, W), holds readings of the first variant by a sensor, each with
//! different faults, as refined by the core. `seed_000123.npy`, int16 (V + R, 6, H, W), holds the real planes of the
//! field's three colours and the three imaginary planes, times [`SCALE`], for all these depths. It also adds
//! `seeds.json`, which records the sweep and R, to the folder.

use crate::dataset::{self, Manifest};
use crate::sensor::coarse::{Coarse, Sampling};
use ndarray::{Array2, Array3, Array4, ArrayView2, ArrayView3, Axis, Ix3, concatenate, s};
use ndarray_npy::WriteNpyExt;
use num_complex::Complex32;
use phasefront::Size;
use phasefront::{RgbdFrame, Sweep};
use phasefront_core::method::sweep::SweepPlan;
use phasefront_core::runtime::file;
use phasefront_io::dice::Dice;
use phasefront_io::input::{self, MOST_ARRAY, npy};
use phasefront_io::ldi::depth_of_code;
use phasefront_io::{Error, Result, output};
use rayon::prelude::*;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The factor that multiplies a field. Amplitudes up to 4 fit, in steps of 1.2·10⁻⁴.
pub const SCALE: f32 = 8192.0;
/// The format name at the start of `seeds.json`.
const FORMAT: &str = "phasefront-seeds-1";

/// The largest noise of a refined depth's readings, as a fraction of the volume's depth.
const MOST_NOISE: f64 = 0.008;
/// The largest shift of refined depth from the colour, in display pixels.
const MOST_SHIFT: usize = 3;

/// Makes the seeds of the data set in `data`, which `manifest` describes, by `sweep`. It covers all depths in `dir`
/// that have no seeds yet, and `refined` more depths of each scene. `made` is called for each scene that is done.
///
/// # Errors
/// Returns an error if the depths differ in shape from the scenes, if the folder has seeds of another sweep, or if it
/// cannot be written.
pub fn make(
    manifest: &Manifest,
    data: &Path,
    dir: &Path,
    sweep: Sweep,
    refined: usize,
    made: &(dyn Fn() + Sync),
) -> Result<()> {
    let place = dir.join("seeds.json");
    let description = serde_json::json!({
        "format": FORMAT, "scale": SCALE, "planes": sweep.planes, "taps": sweep.taps,
        "hidden_layers": sweep.hidden_layers, "between_planes": sweep.between_planes, "refined": refined,
    });
    match file::read(&place, file::MOST_TEXT) {
        Ok(bytes) => {
            if serde_json::from_slice::<serde_json::Value>(&bytes).ok() != Some(description) {
                return Err(Error::file(
                    place,
                    "the folder holds seeds of another sweep or of other refined depths; choose another folder or the same ones",
                ));
            }
        }
        Err(_) => {
            output::write_atomically(&place, |file| writeln!(file, "{description}"))?;
        }
    }
    let plan = SweepPlan::new(
        Size {
            width: manifest.size,
            height: manifest.size,
        },
        &manifest.display,
        sweep,
        0.0,
    )?;
    (0..manifest.scenes).into_par_iter().try_for_each(|index| {
        let file_of = |what: &str| -> PathBuf { dir.join(format!("{what}_{index:06}.npy")) };
        let (depths, seeds) = (file_of("depth"), file_of("seed"));
        if depths.exists() && !seeds.exists() {
            let pair = dataset::read_pair(manifest, data, index)?;
            let colour = phasefront_exact::truth::visible_rgb(&pair.ldi);
            let mut depths = read_depths(&depths, manifest.size)?;
            if refined > 0 {
                let more = refined_depths(depths.slice(s![0, .., ..]), &colour, index, refined)?;
                output::write_atomically(&file_of("refined"), |file| {
                    more.write_npy(file).map_err(std::io::Error::other)
                })?;
                depths = concatenate![Axis(0), depths, more];
            }
            let fields = fields(&plan, &colour, depths.view())?;
            output::write_atomically(&seeds, |file| fields.write_npy(file).map_err(std::io::Error::other))?;
        }
        made();
        Ok(())
    })
}

fn read_depths(path: &Path, size: usize) -> Result<Array3<u16>> {
    let depths = npy::read::<u16, Ix3>(&input::bytes(path, MOST_ARRAY)?).map_err(|e| Error::file(path, e))?;
    match depths.dim() {
        (_, height, width) if (height, width) == (size, size) => Ok(depths),
        (_, height, width) => Err(Error::file(
            path,
            format!("depths are {width}×{height}; the scenes are {size}×{size}"),
        )),
    }
}

/// Simulates `count` readings of the true `depth` of scene `index` by a sensor with faults, and refines them with the
/// core.
fn refined_depths(depth: ArrayView2<'_, u16>, colour: &Array3<f32>, index: usize, count: usize) -> Result<Array3<u16>> {
    let (height, width) = depth.dim();
    let depth = depth.mapv(depth_of_code);
    let mut all = Array3::zeros((count, height, width));
    for (variant, mut to) in all.outer_iter_mut().enumerate() {
        let seed = ((index as u64) << 32) + variant as u64;
        let mut dice = Dice::new(seed);
        let noise = dice.range(0.0, MOST_NOISE) as f32;
        let sensor = Coarse {
            ratio: 4.0,
            sampling: Sampling::Mean,
            shift: [dice.integer(0, MOST_SHIFT) as isize; 2],
            noise,
            holes: dice.chance(0.5),
        };
        let refined = sensor.read(depth.view(), seed).session_depth(colour)?;
        to.zip_mut_with(&refined, |to, d| *to = (d * 65535.0).round() as u16);
    }
    Ok(all)
}

/// Computes the fields of one scene for all its depths.
fn fields(plan: &SweepPlan, colour: &Array3<f32>, depths: ArrayView3<'_, u16>) -> Result<Array4<i16>> {
    let (variants, height, width) = depths.dim();
    let mut fields = Array4::zeros((variants, 6, height, width));
    let mut scratch = plan.scratch();
    let mut field = Array3::from_elem((3, height, width), Complex32::ZERO);
    for (depth, mut planes) in depths.outer_iter().zip(fields.outer_iter_mut()) {
        let depth: Array2<f32> = depth.mapv(depth_of_code);
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
