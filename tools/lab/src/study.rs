//! The paper's two studies of SM-LBM (Fig. 2): the number of layers that an LDI needs, and the number of planes that a
//! volume needs. Both compare the amplitudes of midpoint holograms with those of the finest setting, over random
//! scenes.

pub mod enlarged;
pub mod flicker;
pub mod occlusion;
pub mod slopes;
pub mod sweep_parts;

use crate::scene;
use ndarray::Array3;
use num_complex::Complex32;
use phasefront::Display;
use phasefront::Size;
use phasefront_core::optics::metrics;
use phasefront_exact::sm_lbm;
use phasefront_io::ldi::Ldi;
use phasefront_io::{Error, Result};
use rayon::prelude::*;
use serde::Serialize;

/// The number of layers of the finest LDI. The other LDIs have from 1 layer to one fewer than this.
pub const FINEST_LAYERS: usize = 10;
/// The numbers of planes that are compared with the finest, if they are smaller: 2⁵, 2⁷, 2⁹ and 2¹¹.
pub const PLANES: [usize; 4] = [32, 128, 512, 2048];

/// The random scenes of a study: [`scene::random_scene`] of `seed` and the following seeds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scenes {
    /// The number of scenes.
    pub scenes: usize,
    /// The height and width, in pixels.
    pub size: usize,
    /// The seed of the first scene.
    pub seed: u64,
    /// The display that the holograms are for.
    pub display: Display,
}

/// The quality of one number of layers or planes compared with the finest.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The number of layers or planes.
    pub value: usize,
    /// The mean PSNR over the scenes, in dB. Infinite if one of them equals the finest to the bit.
    pub psnr: f64,
    /// The mean SSIM over the scenes.
    pub ssim: f64,
    /// The PSNR of each scene, in dB.
    pub psnr_of_scenes: Vec<f64>,
    /// The SSIM of each scene.
    pub ssim_of_scenes: Vec<f64>,
}

/// Compares holograms of LDIs of 1 to 9 layers with those of 10, by SM-LBM with `planes` planes. `done` receives the
/// planes of each finished hologram, [`layers_work`] in total.
///
/// # Errors
/// Returns an error if there are no scenes or [`sm_lbm::hologram`] fails.
pub fn layers(scenes: &Scenes, planes: usize, done: &(dyn Fn(usize) + Sync)) -> Result<Vec<Row>> {
    let values: Vec<usize> = (1..FINEST_LAYERS).collect();
    against_finest(scenes, FINEST_LAYERS, &values, FINEST_LAYERS, &|ldi, count| {
        let front = Ldi::new(ldi.layers[..count].to_vec())?;
        let hologram = sm_lbm::hologram(&front, &scenes.display, planes, &|_, _| {})?;
        done(planes);
        Ok(hologram)
    })
}

/// Returns the total planes of all holograms of [`layers`].
pub fn layers_work(scenes: &Scenes, planes: usize) -> usize {
    scenes.scenes * FINEST_LAYERS * planes
}

/// Compares holograms of [`PLANES`] with those of `finest`, from LDIs of `ldi_layers` layers. `done` receives the
/// planes of each finished hologram, [`planes_work`] in total.
///
/// # Errors
/// Returns an error if there are no scenes, if `finest` leaves nothing to compare, or if [`sm_lbm::hologram`] fails.
pub fn planes(scenes: &Scenes, ldi_layers: usize, finest: usize, done: &(dyn Fn(usize) + Sync)) -> Result<Vec<Row>> {
    let values = fewer(finest);
    if values.is_empty() {
        return Err(Error::Input(format!(
            "{finest} planes are no more than the fewest that are compared with them; take over {}",
            PLANES[0]
        )));
    }
    against_finest(scenes, ldi_layers, &values, finest, &|ldi, planes| {
        let hologram = sm_lbm::hologram(ldi, &scenes.display, planes, &|_, _| {})?;
        done(planes);
        Ok(hologram)
    })
}

/// Returns the total planes of all holograms of [`planes`].
pub fn planes_work(scenes: &Scenes, finest: usize) -> usize {
    scenes.scenes * (fewer(finest).iter().sum::<usize>() + finest)
}

fn fewer(finest: usize) -> Vec<usize> {
    PLANES.into_iter().filter(|n| *n < finest).collect()
}

type MakeHologram<'a> = dyn Fn(&Ldi, usize) -> Result<Array3<Complex32>> + Sync + 'a;

fn against_finest(
    scenes: &Scenes,
    ldi_layers: usize,
    values: &[usize],
    finest: usize,
    hologram: &MakeHologram<'_>,
) -> Result<Vec<Row>> {
    if scenes.scenes == 0 || scenes.size == 0 {
        return Err(Error::Input(
            "a study needs at least one scene of at least one pixel".into(),
        ));
    }
    let of_scenes = (0..scenes.scenes)
        .into_par_iter()
        .map(|i| {
            let size = scenes.size;
            let scene = scene::random_scene(
                scenes.seed + i as u64,
                Size {
                    width: size,
                    height: size,
                },
            );
            let ldi = scene::render_ldi_reference(
                &scene,
                Size {
                    width: size,
                    height: size,
                },
                ldi_layers,
            )?
            .quantized();
            let amplitude = |value| Ok::<_, Error>(hologram(&ldi, value)?.mapv(|v| v.norm()));
            let truth = amplitude(finest)?;
            (values.iter())
                .map(|value| Ok(metrics::compare(amplitude(*value)?.view(), truth.view())?))
                .collect::<Result<Vec<_>>>()
        })
        .collect::<Result<Vec<_>>>()?;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let row = |(i, value): (usize, &usize)| {
        let psnr: Vec<f64> = of_scenes.iter().map(|s| s[i].psnr_overall).collect();
        let ssim: Vec<f64> = of_scenes.iter().map(|s| s[i].ssim_overall).collect();
        Row {
            value: *value,
            psnr: mean(&psnr),
            ssim: mean(&ssim),
            psnr_of_scenes: psnr,
            ssim_of_scenes: ssim,
        }
    };
    Ok(values.iter().enumerate().map(row).collect())
}
