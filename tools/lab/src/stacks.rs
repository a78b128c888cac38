//! What incoherent light shows of a data set's scenes: the goal of networks for natural focus.
//!
//! A folder holds `stack_000123.npz` for each scene, with two arrays: `depths`, float32 (K), normalized, and
//! `amplitudes`, uint8 (K, C, H, W), what an eye sees that focuses on each of them ([`incoherent::stack`]), times 255.
//! The depths are one in each Kth of the volume, at random places, so that no depth is missing over all scenes.

use crate::dataset::{self, Manifest};
use ndarray::{Array1, Array4, Axis};
use ndarray_npy::NpzWriter;
use phasefront_exact::incoherent::{self, Pupil};
use phasefront_io::dice::Dice;
use phasefront_io::{Error, Result, output};
use rayon::prelude::*;
use std::io::{Cursor, Write};
use std::path::Path;

/// Makes the stacks of the data set in `data`, which `manifest` describes, with `depths` depths each, and keeps those
/// that are in `dir`. `made` is called for each scene that is done.
///
/// # Errors
/// Returns an error if a scene cannot be read or a stack cannot be written.
pub fn make(manifest: &Manifest, data: &Path, dir: &Path, depths: usize, made: &(dyn Fn() + Sync)) -> Result<()> {
    let display = &manifest.display;
    (0..manifest.scenes).into_par_iter().try_for_each(|index| {
        let path = dir.join(format!("stack_{index:06}.npz"));
        if Manifest::pair_path(data, index).exists() && !path.exists() {
            let ldi = dataset::read_pair(manifest, data, index)?.ldi;
            let places = places(manifest.scene_seed(index), depths);
            let z_m: Vec<f64> = places.iter().map(|d| display.z_of_depth(f64::from(*d))).collect();
            let views = incoherent::stack(&ldi, display, Pupil::of_aperture(display), &z_m)?;
            let mut amplitudes = Array4::zeros((depths, display.colours(), manifest.size, manifest.size));
            for (view, mut to) in views.iter().zip(amplitudes.axis_iter_mut(Axis(0))) {
                to.zip_mut_with(view, |to, a| *to = (a * 255.0).round().min(255.0) as u8);
            }
            let archive = || -> std::result::Result<Vec<u8>, ndarray_npy::WriteNpzError> {
                let mut npz = NpzWriter::new_compressed(Cursor::new(Vec::new()));
                npz.add_array("depths", &Array1::from(places))?;
                npz.add_array("amplitudes", &amplitudes)?;
                Ok(npz.finish()?.into_inner())
            };
            let bytes = archive().map_err(|e| Error::file(&path, e))?;
            output::write_atomically(&path, |file| file.write_all(&bytes))?;
        }
        made();
        Ok(())
    })
}

/// Returns the normalized depths of a stack.
fn places(seed: u64, count: usize) -> Vec<f32> {
    let mut dice = Dice::new(seed);
    let place = |k: usize| ((k as f64 + dice.range(0.0, 1.0)) / count as f64) as f32;
    (0..count).map(place).collect()
}
