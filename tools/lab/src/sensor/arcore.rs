//! Depth from motion as ARCore gives it: `acquireDepthImage16Bits`, smoothed and without holes.
//!
//! - Resolution: 160×120 pixels, the size on most phones; here for a frame of [`FRAME_WIDTH`].
//! - Error: Google documents that it grows with the square of the distance. Its size is our choice: 1 % at 1 m for a
//!   reading of raw depth, before the smoothing.
//! - Smoothing: by a deviation of one reading, across edges. Google documents the filter ("smooth and interpolate"),
//!   not its width.
//! - Unit: whole millimetres, which is the format of the image.

use super::{FRAME_WIDTH, Reading, coarser, means, metres, normal, normalized, smooth};
use ndarray::ArrayView2;
use phasefront_io::dice::Dice;

/// The sensor's pixels along a row.
const WIDTH: f64 = 160.0;
/// The standard deviation at 1 m before the smoothing, in metres.
const NOISE_M: f32 = 0.01;
/// The deviation of the smoothing, in readings.
const SMOOTHING: f64 = 1.0;

/// Reads the true `depth`, (H, W).
pub(super) fn read(depth: ArrayView2<'_, f32>, dice: &mut Dice) -> Reading {
    let shape = coarser(depth.dim(), FRAME_WIDTH / WIDTH);
    let raw = means(depth, shape).mapv(|d| {
        let z = metres(d);
        z + NOISE_M * z * z * normal(dice)
    });
    Reading::new(smooth(&raw, SMOOTHING).mapv(|z| normalized((1000.0 * z).round() / 1000.0)))
}
