//! A pair of cameras whose images are matched in windows: an Intel RealSense D435.
//!
//! - Cameras: baseline 50 mm, 87° over 848 pixels (data sheet of the D400 family).
//! - Error: 0.08 pixels of disparity, which Intel's guide for tuning names for good surfaces; steps of 1/32 pixel,
//!   which is the camera's resolution of disparity.
//! - Shadows: no reading where the right camera does not see what the left one sees, left of near edges. The depth
//!   image is the left camera's.
//! - Fattening: near surfaces grow by half a matching window, 2 pixels, in every direction. The size of the window is
//!   our choice; such windows have 5 to 9 pixels.

use super::{Reading, focal_length, metres, normal, normalized, shadows};
use ndarray::{Array2, ArrayView2};
use phasefront_io::dice::Dice;

const BASELINE_M: f32 = 0.05;
const DEGREES: f64 = 87.0;
/// The camera's pixels along a row.
const WIDTH: f64 = 848.0;
/// The standard deviation of disparity, in pixels of the camera.
const NOISE_PX: f32 = 0.08;
/// The steps of disparity in a pixel.
const STEPS: f32 = 32.0;
/// The number of pixels by which near surfaces are too wide.
pub const FATTENING_PX: usize = 2;

/// Reads the true `depth`, (H, W).
pub(super) fn read(depth: ArrayView2<'_, f32>, dice: &mut Dice) -> Reading {
    let (height, width) = depth.dim();
    let fat = Array2::from_shape_fn((height, width), |(y, x)| {
        let rows = y.saturating_sub(FATTENING_PX)..(y + FATTENING_PX + 1).min(height);
        let columns = x.saturating_sub(FATTENING_PX)..(x + FATTENING_PX + 1).min(width);
        rows.flat_map(|y| columns.clone().map(move |x| depth[(y, x)]))
            .fold(f32::MAX, f32::min)
    });
    let of_scene = BASELINE_M * focal_length(width as f64, DEGREES);
    let of_camera = BASELINE_M * focal_length(WIDTH, DEGREES);
    let mut readings = fat.mapv(|d| {
        let disparity = of_camera / metres(d) + NOISE_PX * normal(dice);
        normalized(of_camera / ((disparity * STEPS).round() / STEPS))
    });
    for (mut readings, fat) in readings.outer_iter_mut().zip(fat.outer_iter()) {
        let disparity: Vec<f32> = fat.iter().map(|d| of_scene / metres(*d)).collect();
        for (reading, hidden) in readings.iter_mut().zip(shadows(&disparity)) {
            if hidden {
                *reading = f32::NAN;
            }
        }
    }
    Reading::new(readings)
}
