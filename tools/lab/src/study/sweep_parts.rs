//! Measures the effect of the plane sweep's planes, taps, hidden layers, tiles and merged steps, one at a time, beside
//! exact waves on the same surfaces. It uses rendered depth, the same with white noise, and simulated sensor depth that
//! the core has refined. It also measures the sweep on displays that no network was trained for.

use crate::scene;
use crate::sensor::Sensor;
use crate::sensor::coarse::{Coarse, Sampling};
use crate::study::Scenes;
use ndarray::{Array3, ArrayView3};
use num_complex::Complex32;
use phasefront::Size;
use phasefront::{Display, RgbdFrame, Sweep};
use phasefront_core::method::sweep;
use phasefront_core::method::sweep::SweepPlan;
use phasefront_core::optics::asm::{Padding, Propagator};
use phasefront_core::optics::metrics;
use phasefront_exact::sm_lbm;
use phasefront_exact::truth::{filled, visible_depth, visible_rgb};
use phasefront_io::ldi::Ldi;
use phasefront_io::{Error, Result};
use rayon::prelude::*;
use serde::Serialize;
use std::time::Instant;

/// The number of frames from which the fastest gives the time of a sweep.
const TIMED_FRAMES: usize = 5;

/// The sensor of the ablation: coarse, noisy, shifted and with holes, like a phone's.
const SENSOR: Coarse = Coarse {
    ratio: 4.0,
    sampling: Sampling::Mean,
    shift: [3, 3],
    noise: 0.005,
    holes: true,
};

/// The displays of [`displays`], as differences from the default display in the format of a display file.
pub const DISPLAYS: [&str; 10] = [
    "",
    "pitch_um = 6.4",
    "pitch_um = 3.74",
    "volume_depth_mm = 12.0",
    "wavelengths_nm = [660, 532, 473]",
    "wavelengths_nm = [639, 515, 445]",
    "offset_mm = 3.0",
    "offset_mm = 6.0",
    "offset_mm = -10.0",
    "offset_mm = 20.0",
];

/// The method that makes a hologram.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Propagation {
    /// SM-LBM of the visible layer and `hidden` hidden layers.
    Exact { hidden: usize, planes: usize },
    /// The sweep, with or without merged steps.
    Sweep { sweep: Sweep, merged: bool },
}

/// The means over the scenes.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Figures {
    /// The PSNR of the hologram's amplitude, in dB.
    pub psnr: f64,
    /// The SSIM of the hologram's amplitude.
    pub ssim: f64,
}

impl Figures {
    /// Compares two amplitudes, (C, H, W).
    ///
    /// # Errors
    /// Returns an error if the shapes differ.
    pub fn of(amplitude: ArrayView3<'_, f32>, truth: ArrayView3<'_, f32>) -> Result<Self> {
        let alike = metrics::compare(amplitude, truth)?;
        Ok(Figures {
            psnr: alike.psnr_overall,
            ssim: alike.ssim_overall,
        })
    }
}

/// One setting of the ablation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The changed part: `exact`, `default`, `planes`, `taps`, `hidden`, `between`, `tile` or `merge`.
    pub part: &'static str,
    /// The setting in words.
    pub setting: String,
    /// The changed value as a number, for a plot.
    pub value: usize,
    /// The quality on rendered depth.
    pub clean: Figures,
    /// The quality on rendered depth with white noise of [`Sensor::Noise`].
    pub noisy: Figures,
    /// The quality on refined depth.
    pub refined: Figures,
    /// The time for the first scene on one thread, the fastest of five frames, in ns per pixel. `None` for exact waves.
    pub ns_per_pixel: Option<f64>,
}

/// Runs the ablation on `scenes`. The true holograms and the exact waves have `planes` planes. `done` is called after
/// each hologram, [`ablation_work`] times in total.
///
/// # Errors
/// Returns an error if there are no scenes or if the display cannot be swept.
pub fn ablation(scenes: &Scenes, planes: usize, done: &(dyn Fn() + Sync)) -> Result<Vec<Row>> {
    check(scenes)?;
    let size = scenes.size;
    let display = &scenes.display;
    let settings = settings(display, planes);
    let mut plans = Vec::new();
    for (_, _, _, how) in &settings {
        plans.push(match *how {
            Propagation::Exact { .. } => None,
            Propagation::Sweep { sweep, merged } => {
                let plan = SweepPlan::new(
                    Size {
                        width: size,
                        height: size,
                    },
                    display,
                    sweep,
                    0.0,
                )?;
                Some(if merged { plan } else { plan.unmerged() })
            }
        });
    }
    let of_scenes = (0..scenes.scenes as u64)
        .into_par_iter()
        .map(|i| {
            let ldi = render(scenes, i)?;
            let truth = sm_lbm::hologram(&ldi, display, planes, &|_, _| {})?;
            let (rgb, depth) = (visible_rgb(&ldi), visible_depth(&ldi));
            let noisy = Sensor::Noise.read(depth.view(), scenes.seed + i).depth;
            let noisy = noisy.mapv(|d| d.clamp(0.0, 1.0));
            let refined = SENSOR.read(depth.view(), scenes.seed + i).session_depth(&rgb)?;
            let frames = [depth, noisy, refined].map(|depth| RgbdFrame::new(rgb.clone(), depth));
            let mut figures = Vec::new();
            for ((.., how), plan) in settings.iter().zip(&plans) {
                let mut of_way = Vec::new();
                for frame in &frames {
                    let frame = frame.as_ref().map_err(|e| Error::Input(e.to_string()))?;
                    let field = match (how, plan) {
                        (Propagation::Exact { hidden, planes }, _) => exact(frame, display, *hidden, *planes)?,
                        (_, Some(plan)) => swept(plan, frame)?,
                        _ => unreachable!("a sweep has a plan"),
                    };
                    of_way.push(alike(&field, &truth)?);
                    done();
                }
                figures.push([of_way[0], of_way[1], of_way[2]]);
            }
            Ok(figures)
        })
        .collect::<Result<Vec<_>>>()?;
    let ldi = render(scenes, 0)?;
    let frame = RgbdFrame::new(visible_rgb(&ldi), visible_depth(&ldi))?;
    let mut rows = Vec::new();
    for (i, ((part, setting, value, _), plan)) in settings.into_iter().zip(&plans).enumerate() {
        let each = |kind: usize| of_scenes.iter().map(move |figures| figures[i][kind]);
        rows.push(Row {
            part,
            setting,
            value,
            clean: mean(each(0)),
            noisy: mean(each(1)),
            refined: mean(each(2)),
            ns_per_pixel: match plan {
                Some(plan) => Some(time(plan, &frame)?),
                None => None,
            },
        });
    }
    Ok(rows)
}

/// Returns the number of holograms of [`ablation`].
pub fn ablation_work(scenes: &Scenes, planes: usize) -> usize {
    3 * scenes.scenes * settings(&scenes.display, planes).len()
}

/// Returns the settings to compare: the changed part, the setting in words, its number, and the method.
fn settings(display: &Display, planes: usize) -> Vec<(&'static str, String, usize, Propagation)> {
    let default = Sweep::for_display(display);
    let sweep = |sweep| Propagation::Sweep { sweep, merged: true };
    let mut settings = Vec::new();
    for hidden in 0..=sweep::MAX_HIDDEN_LAYERS {
        for planes in [planes, default.planes] {
            let words = format!("exact waves, {planes} planes, {hidden} hidden layers");
            settings.push(("exact", words, hidden, Propagation::Exact { hidden, planes }));
        }
    }
    let words = format!(
        "{} planes of {} taps, {} hidden layers, tiles of {}",
        default.planes, default.taps, default.hidden_layers, default.tile
    );
    settings.push(("default", words, default.planes, sweep(default)));
    for tenths in [4, 6, 8, 12, 16, 24, 32] {
        let planes = (default.planes * tenths).div_ceil(10);
        let swept = Sweep::of_planes(display, planes);
        let words = format!("{planes} planes of {} taps", swept.taps);
        settings.push(("planes", words, planes, sweep(swept)));
    }
    for more in [-4, -2, 2, 4, 8] {
        let taps = default.taps.saturating_add_signed(more);
        let words = format!("{taps} taps");
        settings.push(("taps", words, taps, sweep(Sweep { taps, ..default })));
    }
    for hidden_layers in 0..sweep::MAX_HIDDEN_LAYERS {
        let words = format!("{hidden_layers} hidden layers");
        let swept = Sweep {
            hidden_layers,
            ..default
        };
        settings.push(("hidden", words, hidden_layers, sweep(swept)));
    }
    let swept = Sweep {
        between_planes: false,
        ..default
    };
    settings.push(("between", "points moved to planes".into(), 0, sweep(swept)));
    for tile in [64, 128, 512, 1024] {
        let words = format!("tiles of {tile}");
        settings.push(("tile", words, tile, sweep(Sweep { tile, ..default })));
    }
    let how = Propagation::Sweep {
        sweep: default,
        merged: false,
    };
    settings.push(("merge", "each step by itself".into(), 0, how));
    settings
}

/// The sweep and exact waves on one display, compared with the truth for that display at its modulator.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DisplayRow {
    /// The difference from the default display, or empty for the default display.
    pub display: String,
    /// The number of planes of the sweep that suits the display.
    pub planes: usize,
    /// The number of taps of that sweep.
    pub taps: usize,
    /// SM-LBM of the visible layer, with the planes of the truth.
    pub visible: Figures,
    /// SM-LBM of the visible and the hidden layers, with the planes of the sweep.
    pub filled: Figures,
    /// The sweep.
    pub sweep: Figures,
}

/// Measures [`DISPLAYS`] on `scenes`, ignoring the display of `scenes`. `done` is called after each hologram,
/// [`displays_work`] times in total.
///
/// # Errors
/// Returns an error if there are no scenes.
pub fn displays(scenes: &Scenes, planes: usize, done: &(dyn Fn() + Sync)) -> Result<Vec<DisplayRow>> {
    check(scenes)?;
    let mut rows = Vec::new();
    for toml in DISPLAYS {
        let display = Display::from_toml(toml)?;
        let sweep = Sweep::for_display(&display);
        // The sweep goes directly to a near modulator, as in `Method::Sweep`.
        let near = sweep::reaches(&display, display.offset_m());
        let z_m = if near { display.offset_m() } else { 0.0 };
        let plan = SweepPlan::new(
            Size {
                width: scenes.size,
                height: scenes.size,
            },
            &display,
            sweep,
            z_m,
        )?;
        let of_scenes = (0..scenes.scenes as u64)
            .into_par_iter()
            .map(|i| {
                let ldi = render(scenes, i)?;
                let frame = RgbdFrame::new(visible_rgb(&ldi), visible_depth(&ldi))?;
                let there = |field| to_modulator(field, &display);
                let truth = there(sm_lbm::hologram(&ldi, &display, planes, &|_, _| {})?)?;
                let visible = there(exact(&frame, &display, 0, planes)?)?;
                done();
                let hidden = sweep::MAX_HIDDEN_LAYERS;
                let filled = there(exact(&frame, &display, hidden, sweep.planes)?)?;
                done();
                let field = swept(&plan, &frame)?;
                let swept = if near { field } else { there(field)? };
                done();
                Ok([
                    alike(&visible, &truth)?,
                    alike(&filled, &truth)?,
                    alike(&swept, &truth)?,
                ])
            })
            .collect::<Result<Vec<_>>>()?;
        let each = |setting: usize| of_scenes.iter().map(move |figures| figures[setting]);
        rows.push(DisplayRow {
            display: toml.into(),
            planes: sweep.planes,
            taps: sweep.taps,
            visible: mean(each(0)),
            filled: mean(each(1)),
            sweep: mean(each(2)),
        });
    }
    Ok(rows)
}

/// Returns the number of holograms of [`displays`].
pub fn displays_work(scenes: &Scenes) -> usize {
    3 * scenes.scenes * DISPLAYS.len()
}

fn check(scenes: &Scenes) -> Result<()> {
    if scenes.scenes == 0 || scenes.size == 0 {
        return Err(Error::Input(
            "a study needs at least one scene of at least one pixel".into(),
        ));
    }
    Ok(())
}

fn render(scenes: &Scenes, i: u64) -> Result<Ldi> {
    let size = scenes.size;
    let scene = scene::random_scene(
        scenes.seed + i,
        Size {
            width: size,
            height: size,
        },
    );
    Ok(scene::render_ldi_reference(
        &scene,
        Size {
            width: size,
            height: size,
        },
        5,
    )?
    .quantized())
}

/// Computes SM-LBM of the visible layer and the first `hidden` layers that the sweep adds.
fn exact(frame: &RgbdFrame, display: &Display, hidden: usize, planes: usize) -> Result<Array3<Complex32>> {
    let mut layers = filled(frame, display)?.layers;
    layers.truncate(1 + hidden);
    sm_lbm::hologram(&Ldi::new(layers)?, display, planes, &|_, _| {})
}

fn swept(plan: &SweepPlan, frame: &RgbdFrame) -> Result<Array3<Complex32>> {
    let Size { width, height } = plan.size();
    let mut field = Array3::zeros((3, height, width));
    let values = field.as_slice_mut().expect("standard layout");
    plan.field(frame, values, &mut plan.scratch())?;
    Ok(field)
}

/// Measures the time on one thread: the fastest of [`TIMED_FRAMES`], in ns per pixel.
fn time(plan: &SweepPlan, frame: &RgbdFrame) -> Result<f64> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .map_err(|e| Error::Input(e.to_string()))?;
    pool.install(|| {
        let Size { width, height } = plan.size();
        let mut field = vec![Complex32::ZERO; 3 * height * width];
        let mut scratch = plan.scratch();
        let mut least = f64::INFINITY;
        for _ in 0..TIMED_FRAMES {
            let start = Instant::now();
            plan.field(frame, &mut field, &mut scratch)?;
            least = least.min(start.elapsed().as_secs_f64());
        }
        Ok(least * 1e9 / (height * width) as f64)
    })
}

/// Propagates a midpoint hologram to the modulator.
fn to_modulator(mut field: Array3<Complex32>, display: &Display) -> Result<Array3<Complex32>> {
    if display.offset_m() == 0.0 {
        return Ok(field);
    }
    let (_, height, width) = field.dim();
    let plans = Propagator::for_colours(
        Size { width, height },
        display.pitch_m(),
        display.wavelengths_m(),
        display.offset_m(),
        Padding::Reach,
    )?;
    let values = field.as_slice_mut().expect("standard layout");
    for (plan, plane) in plans.iter().zip(values.chunks_exact_mut(height * width)) {
        plan.propagate(plane, &mut plan.scratch());
    }
    Ok(field)
}

fn alike(field: &Array3<Complex32>, truth: &Array3<Complex32>) -> Result<Figures> {
    let [a, b] = [field, truth].map(|field| field.mapv(|u| u.norm()));
    Figures::of(a.view(), b.view())
}

fn mean(each: impl ExactSizeIterator<Item = Figures>) -> Figures {
    let count = each.len() as f64;
    each.fold(Figures::default(), |sum, figures| Figures {
        psnr: sum.psnr + figures.psnr / count,
        ssim: sum.ssim + figures.ssim / count,
    })
}
