//! The holograms that a learned model is fitted to: random pictures with random phases, and the one that shows where
//! the modulator is.

use crate::camera::pattern::Pattern;
use ndarray::{Array2, ArrayView2};
use num_complex::Complex32;
use phasefront::Size;
use phasefront::{Brightness, EncoderOptions, Encoding, Target};
use phasefront_core::pipeline::display_plan::DisplayPlan;
use phasefront_io::dice::Dice;
use phasefront_io::{Error, Result};
use std::f32::consts::{PI, TAU};

/// A hologram to show and to photograph.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The phases that the modulator is asked for, (H, W) in \[0, 2π).
    pub phases: Array2<f32>,
    /// The levels of these phases, (H, W).
    pub levels: Array2<u8>,
    /// The z that the camera focuses on, in metres.
    pub z_m: f64,
}

/// Returns the z of photograph `index` of `count`: the first half lies at the middle of the volume, the rest in halves
/// at a third of its depth before and behind. The camera is focused three times.
pub fn z_m(target: &Target, index: usize, count: usize) -> f64 {
    let away = target.display.volume_depth_m() / 3.0;
    match 4 * index / count.max(1) {
        0 | 1 => 0.0,
        2 => away,
        _ => -away,
    }
}

/// Returns a random field at the middle of the volume, (H, W), with amplitudes from 0 to 1: soft clouds, sharp
/// rectangles, and a smooth phase.
pub fn field(Size { width, height }: Size, seed: u64) -> Array2<Complex32> {
    let mut dice = Dice::new(seed ^ 0x5343_454e_4553);
    let clouds = |dice: &mut Dice, finest: f64, rough: f64| {
        let waves: Vec<[f64; 4]> = (0..24)
            .map(|_| {
                let length = dice.log_range(finest, 1.0) * height.max(width) as f64;
                let angle = dice.range(0.0, f64::from(TAU));
                let height = (length / height.max(width) as f64).powf(rough);
                [angle.cos() / length, angle.sin() / length, dice.range(0.0, 1.0), height]
            })
            .collect();
        let square: f64 = waves.iter().map(|wave| wave[3] * wave[3] / 2.0).sum();
        Array2::from_shape_fn((height, width), |(y, x)| {
            let wave = |[u, v, start, height]: &[f64; 4]| {
                height * (f64::from(TAU) * (u * x as f64 + v * y as f64 + start)).sin()
            };
            (waves.iter().map(wave).sum::<f64>() / square.sqrt()) as f32
        })
    };
    let mut amplitude = clouds(&mut dice, 0.02, 0.7).mapv(|v| (0.45 + 0.22 * v).clamp(0.0, 1.0));
    for _ in 0..8 {
        let (h, w) = (dice.integer(2, height / 3), dice.integer(2, width / 3));
        let (top, left) = (dice.integer(0, height - h), dice.integer(0, width - w));
        let value = dice.unit() as f32;
        amplitude
            .slice_mut(ndarray::s![top..top + h, left..left + w])
            .mapv_inplace(|old| 0.3 * old + 0.7 * value);
    }
    let strength = dice.range(0.0, 0.8) as f32;
    let phase = clouds(&mut dice, 0.1, 1.0);
    ndarray::Zip::from(&amplitude)
        .and(&phase)
        .map_collect(|a, p| Complex32::from_polar(*a, strength * p))
}

/// Returns scene `index` of `count` in `colour`, encoded for `target` as an ideal display.
///
/// # Errors
/// Returns an error if the path to the modulator cannot be planned.
pub fn scene(target: &Target, colour: usize, index: usize, count: usize) -> Result<Scene> {
    // A constant phase lets the pixels use all of their range.
    let turn = Dice::new(index as u64 ^ 0x5455_524e).range(-1.0, 1.0) as f32;
    let seed = (index * target.display.colours() + colour) as u64;
    encoded(
        target,
        colour,
        &field(target.modulator(), seed),
        turn,
        z_m(target, index, count),
    )
}

/// Returns the hologram of the marks of `pattern` at `z_m`, which shows a camera where the modulator is.
///
/// # Errors
/// Returns an error if the path to the modulator cannot be planned.
pub fn marks(target: &Target, colour: usize, pattern: &Pattern, z_m: f64) -> Result<Scene> {
    let frame = pattern.frame(0);
    let lit = |frame: ArrayView2<'_, u8>, y: usize, x: usize| frame[(y, x)] == 0 && frame[(y, x ^ 1)] == 0;
    let (height, width) = frame.dim();
    let picture = Array2::from_shape_fn((height, width), |(y, x)| {
        let bright = if x ^ 1 < width {
            lit(frame.view(), y, x)
        } else {
            frame[(y, x)] == 0
        };
        Complex32::from(if bright { 0.8 } else { 0.05 })
    });
    encoded(target, colour, &picture, 0.0, z_m)
}

fn encoded(target: &Target, colour: usize, field: &Array2<Complex32>, turn: f32, z_m: f64) -> Result<Scene> {
    let target = Target {
        model: None,
        ..target.clone()
    };
    let options = EncoderOptions {
        brightness: Brightness::Fixed(1.0),
        ..Encoding::ANTI_ALIAS.into()
    };
    let size @ Size { width, height } = Size::from_shape(field.dim());
    let plan = DisplayPlan::from_z(size, 0.0, &target, &options)?;
    let (colours, area) = (target.display.colours(), height * width);
    let mut stack: Vec<_> = (0..colours).flat_map(|_| field.iter().copied()).collect();
    let mut phases = vec![0.0; colours * area];
    let mut scratch = plan.scratch();
    plan.propagate(&mut stack, &mut scratch);
    plan.phases(None, &mut stack, &mut phases, &mut scratch);
    // Double phase wraps least in the middle of the range.
    let first = colour * area;
    let phases = phases[first..][..area].iter();
    let phases: Vec<f32> = phases
        .map(|phase| (phase + PI + turn).rem_euclid(TAU).min(TAU.next_down()))
        .collect();
    let response = target.response.clone().centred(Size { width, height })?;
    let levels = phases
        .iter()
        .enumerate()
        .map(|(i, phase)| response.level(*phase, first + i));
    let plane = |e| Error::Input(format!("a scene: {e}"));
    Ok(Scene {
        levels: Array2::from_shape_vec(size.shape(), levels.collect()).map_err(plane)?,
        phases: Array2::from_shape_vec(size.shape(), phases).map_err(plane)?,
        z_m,
    })
}
