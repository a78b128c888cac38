//! The LiDAR of phones as ARKit gives it: `sceneDepth` of 256×192 pixels with a confidence of three levels.
//!
//! - Resolution: 256×192 pixels for the colour's 1920×1440 (Baruch et al., ARKitScenes, 2021); here for a frame of
//!   [`FRAME_WIDTH`].
//! - Noise: 0.3 % of the distance. Luetzenburg et al. (Scientific Reports 11, 2021) find models of small objects
//!   accurate to 1 cm, which is three deviations at about 1 m.
//! - Confidence: low where a reading covers two surfaces, medium beside such readings. Apple documents only the three
//!   levels; low confidence along edges is what its frames show. Sessions leave out low confidence by default.

use super::{EDGE, FAR_M, FRAME_WIDTH, NEAR_M, Reading, cell, coarser, means, metres, normal};
use ndarray::{Array2, ArrayView2};
use phasefront_io::dice::Dice;

/// The sensor's pixels along a row.
const WIDTH: f64 = 256.0;
/// The standard deviation of a reading, as a fraction of its distance.
pub const NOISE: f32 = 0.003;

/// Reads the true `depth`, (H, W).
pub(super) fn read(depth: ArrayView2<'_, f32>, dice: &mut Dice) -> Reading {
    let shape = coarser(depth.dim(), FRAME_WIDTH / WIDTH);
    let of_two = Array2::from_shape_fn(shape, |at| {
        let (least, most) = cell(depth, shape, at).fold((f32::MAX, f32::MIN), |(a, b), d| (a.min(d), b.max(d)));
        most - least > EDGE
    });
    let confidence = Array2::from_shape_fn(shape, |(y, x)| {
        let rows = y.saturating_sub(1)..(y + 2).min(shape.0);
        let mut around = rows.flat_map(|y| (x.saturating_sub(1)..(x + 2).min(shape.1)).map(move |x| (y, x)));
        match of_two[(y, x)] {
            true => 0,
            false => 2 - u8::from(around.any(|at| of_two[at])),
        }
    });
    let noisy = |d: f32| d + NOISE * metres(d) / (FAR_M - NEAR_M) * normal(dice);
    Reading {
        confidence: Some(confidence),
        ..Reading::new(means(depth, shape).mapv(noisy))
    }
}
