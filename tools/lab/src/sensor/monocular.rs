//! A network that estimates relative depth from one picture.
//!
//! - Resolution: 448 pixels along a row, as `--depth-network` takes pictures; here for a frame of [`FRAME_WIDTH`].
//! - Scale and offset are unknown, as those of MiDaS (Ranftl et al., 2020) and Depth Anything (Yang et al., 2024) are.
//!   The scene's normalized depth is the truth on that scale, whatever its relation to metres.
//! - Warp: a smooth error of 0.05 of the volume (root mean square). Such networks err by 4 to 10 % of the distance
//!   after their scale and offset are fitted, mostly smoothly.
//! - Edges are smoothed by a deviation of one reading, which is our choice.

use super::{FRAME_WIDTH, Reading, coarser, means, smooth};
use ndarray::{Array2, ArrayView2};
use phasefront_io::dice::Dice;
use std::f64::consts::TAU;

/// The network's pixels along a row.
const WIDTH: f64 = 448.0;
/// The root mean square of the warp, as a fraction of the volume.
const WARP: f64 = 0.05;
/// The number of waves of the warp.
const WAVES: usize = 3;
/// The deviation of the smoothing, in readings.
const SMOOTHING: f64 = 1.0;

/// Reads the true `depth`, (H, W).
pub(super) fn read(depth: ArrayView2<'_, f32>, dice: &mut Dice) -> Reading {
    let shape = coarser(depth.dim(), FRAME_WIDTH / WIDTH);
    let soft = smooth(&means(depth, shape), SMOOTHING);
    let waves = [(); WAVES].map(|()| {
        let mut rate = || dice.range(-1.2, 1.2);
        (rate(), rate(), dice.unit())
    });
    let height = WARP * libm::sqrt(2.0 / WAVES as f64);
    let (scale, offset) = (dice.log_range(0.4, 2.0) as f32, dice.unit() as f32);
    let warped = Array2::from_shape_fn(shape, |(y, x)| {
        let (u, v) = (x as f64 / shape.1 as f64, y as f64 / shape.0 as f64);
        let wave = |(along, down, start): (f64, f64, f64)| libm::cos(TAU * (along * u + down * v + start));
        let warp = height * waves.into_iter().map(wave).sum::<f64>();
        offset + scale * (soft[(y, x)] + warp as f32)
    });
    Reading {
        relative: true,
        ..Reading::new(warped)
    }
}
