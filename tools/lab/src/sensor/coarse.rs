//! A sensor of a coarse grid, with any of the common faults: shift from the colour, white noise and holes.

use super::{Reading, coarser, means, middles, normal, remove_at_edges, remove_blobs};
use ndarray::{Array2, ArrayView2};
use phasefront_io::dice::Dice;

/// The way a reading comes from the pixels that it covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sampling {
    /// Their mean, which at an edge is a depth that no surface has.
    Mean,
    /// The pixel in their middle.
    Nearest,
}

/// The faults of a coarse sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coarse {
    /// The width of a reading in pixels.
    pub ratio: f64,
    /// The way a reading comes from its pixels.
    pub sampling: Sampling,
    /// The distance of depth from colour, right and down, in pixels.
    pub shift: [isize; 2],
    /// The standard deviation of each reading's noise, as a fraction of the volume.
    pub noise: f32,
    /// Whether readings are missing: 40 % of those at edges, and those in blobs.
    pub holes: bool,
}

/// The share of readings at edges that are missing.
const EDGE_HOLES: f64 = 0.4;

impl Coarse {
    /// Reads the true `depth`, (H, W). Readings stay in \[0, 1]. The same seed gives the same reading.
    pub fn read(&self, depth: ArrayView2<'_, f32>, seed: u64) -> Reading {
        let mut dice = Dice::new(seed);
        let (height, width) = depth.dim();
        let [right, down] = self.shift;
        let shifted = Array2::from_shape_fn((height, width), |(y, x)| {
            let from =
                |at: usize, shift: isize, size: usize| (at as isize - shift).clamp(0, size as isize - 1) as usize;
            depth[(from(y, down, height), from(x, right, width))]
        });
        let shape = coarser((height, width), self.ratio);
        let clean = match self.sampling {
            Sampling::Mean => means(shifted.view(), shape),
            Sampling::Nearest => middles(shifted.view(), shape),
        };
        let mut readings = clean.mapv(|d| (d + self.noise * normal(&mut dice)).clamp(0.0, 1.0));
        if self.holes {
            remove_at_edges(&mut readings, &clean, EDGE_HOLES, &mut dice);
            remove_blobs(&mut readings, &mut dice);
        }
        Reading::new(readings)
    }
}
