//! The scenes that `bench` makes itself.

use ndarray::{Array2, Array3};
use phasefront::{RgbdFrame, Size};
use phasefront_io::Result;
use phasefront_io::dice::Dice;

/// The number of leaves.
const LEAVES: usize = 400;

/// Makes a frame with colour everywhere and the depths of a typical scene: ground up to a wall, and balls in front. The
/// content does not change the cost of a network. A sweep costs more the closer together the depths are.
pub(super) fn balls(size: Size) -> Result<RgbdFrame> {
    let Size { width, height } = size;
    let value = |c: usize, y: usize, x: usize| ((c * 7 + x * 3 + y * 5) % 256) as f32 / 255.0;
    let depth = |y: usize, x: usize| {
        let (v, u) = (y as f32 / height as f32, x as f32 / height as f32);
        let ground = (2.0 * (1.0 - v)).min(0.95);
        (0..6).fold(ground, |depth, ball| {
            let (at, radius) = (0.2 + 0.27 * ball as f32, 0.1 + 0.02 * (ball % 3) as f32);
            let inside = radius.powi(2) - (u - at).powi(2) - (v - 0.6).powi(2);
            if inside > 0.0 {
                depth.min(0.15 * ball as f32 + 0.1 - inside.sqrt() / 2.0).max(0.0)
            } else {
                depth
            }
        })
    };
    Ok(RgbdFrame::new(
        Array3::from_shape_fn((3, height, width), |(c, y, x)| value(c, y, x)),
        Array2::from_shape_fn((height, width), |(y, x)| depth(y, x)),
    )?)
}

/// Makes a frame full of edges: discs of all sizes before one another, each of one colour and one depth, the last one
/// the nearest.
pub(super) fn leaves(size: Size) -> Result<RgbdFrame> {
    let Size { width, height } = size;
    let mut rgb = Array3::from_elem((3, height, width), 0.5);
    let mut depth = Array2::ones((height, width));
    let mut dice = Dice::new(0);
    for leaf in 0..LEAVES {
        let d = 1.0 - (leaf + 1) as f32 / LEAVES as f32;
        let colour = [0; 3].map(|_| dice.unit() as f32);
        let radius = dice.log_range(0.02, 0.2) * height as f64;
        let (x, y) = (dice.range(0.0, width as f64), dice.range(0.0, height as f64));
        let rows = |at: f64, most: usize| (at.max(0.0) as usize).min(most);
        for row in rows(y - radius, height)..rows(y + radius, height) {
            let half = (radius.powi(2) - (row as f64 - y).powi(2)).max(0.0).sqrt();
            for column in rows(x - half, width)..rows(x + half, width) {
                depth[(row, column)] = d;
                (0..3).for_each(|c| rgb[(c, row, column)] = colour[c]);
            }
        }
    }
    Ok(RgbdFrame::new(rgb, depth)?)
}
