//! Structured light: the first Kinect.
//!
//! - Resolution: 640×480 pixels, here for a frame of [`FRAME_WIDTH`]; 57° along a row; 75 mm between the projector and
//!   the camera.
//! - Disparity: whole numbers of 11 bits with an error of half a step. One step is 2.85·10⁻³ m⁻¹ times the square of
//!   the distance (Khoshelham and Elberink, Sensors 12, 2012).
//! - Shadows: no reading where the projector's light does not arrive, on one side of near surfaces.
//! - Edges: a reading is that of a place up to one reading away, so edges are not straight. 40 % of the readings at
//!   edges are missing, and those in blobs. These sizes are our choice, from captured frames.

use super::{FRAME_WIDTH, Reading, coarser, focal_length, metres, middles, normal, normalized};
use super::{remove_at_edges, remove_blobs, shadows};
use ndarray::{Array2, ArrayView2};
use phasefront_io::dice::Dice;

/// The sensor's pixels along a row.
const WIDTH: f64 = 640.0;
const BASELINE_M: f32 = 0.075;
const DEGREES: f64 = 57.0;
/// The step of disparity, in inverse metres.
pub const STEP: f32 = 2.85e-3;
/// The standard deviation of disparity, in steps.
const NOISE_STEPS: f32 = 0.5;
/// The share of readings at edges that are missing.
const EDGE_HOLES: f64 = 0.4;

/// Reads the true `depth`, (H, W).
pub(super) fn read(depth: ArrayView2<'_, f32>, dice: &mut Dice) -> Reading {
    let (h, w) = coarser(depth.dim(), FRAME_WIDTH / WIDTH);
    let clean = middles(depth, (h, w));
    let mut readings = Array2::from_shape_fn((h, w), |(y, x)| {
        let mut beside = |at: usize, size: usize| (at + dice.integer(0, 2)).saturating_sub(1).min(size - 1);
        let steps = 1.0 / (STEP * metres(clean[(beside(y, h), beside(x, w))])) + NOISE_STEPS * normal(dice);
        normalized(1.0 / (STEP * steps.round()))
    });
    remove_at_edges(&mut readings, &clean, EDGE_HOLES, dice);
    remove_blobs(&mut readings, dice);
    let parallax = BASELINE_M * focal_length(w as f64, DEGREES);
    for (mut readings, clean) in readings.outer_iter_mut().zip(clean.outer_iter()) {
        let disparity: Vec<f32> = clean.iter().map(|d| parallax / metres(*d)).collect();
        for (reading, hidden) in readings.iter_mut().zip(shadows(&disparity)) {
            if hidden {
                *reading = f32::NAN;
            }
        }
    }
    Reading::new(readings)
}
