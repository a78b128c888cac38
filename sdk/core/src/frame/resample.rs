//! Resampling along one axis: the part of a camera image that the display covers, and the taps of each output sample.

use crate::Size;
use std::ops::Range;

/// The displayed part of an upright image: the largest centred rectangle with the display's aspect ratio.
///
/// The unit is a pixel of the image, and (0, 0) is the top left corner of its first pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crop {
    /// The left edge.
    pub x: f64,
    /// The upper edge.
    pub y: f64,
    /// The width.
    pub width: f64,
    /// The height.
    pub height: f64,
}

impl Crop {
    /// Returns the part of an image, the first size, that covers the second.
    pub fn cover(
        Size { width, height }: Size,
        Size {
            width: out_width,
            height: out_height,
        }: Size,
    ) -> Self {
        let (h, w) = (height as f64, width as f64);
        let scale = (w / out_width as f64).min(h / out_height as f64);
        let (crop_w, crop_h) = (out_width as f64 * scale, out_height as f64 * scale);
        Crop {
            x: (w - crop_w) / 2.0,
            y: (h - crop_h) / 2.0,
            width: crop_w,
            height: crop_h,
        }
    }

    /// Returns the same part of an image with the same field of view at `x` and `y` times the resolution.
    pub fn scaled(self, x: f64, y: f64) -> Self {
        Crop {
            x: self.x * x,
            y: self.y * y,
            width: self.width * x,
            height: self.height * y,
        }
    }
}

/// The taps of each output sample along one axis.
///
/// The taps form a triangle as wide as an output sample, but at least as wide as an input sample, so that shrinking
/// averages and enlarging interpolates.
pub struct Axis {
    /// The first input sample of each output sample.
    start: Vec<u32>,
    /// The weights of each output sample: `taps` weights that sum to 1.
    weights: Vec<f32>,
    taps: usize,
    needed: Range<usize>,
    is_kept: bool,
}

impl Axis {
    /// Plans `out` samples over the interval `from`..`from` + `length` of `source` samples.
    pub fn new(source: usize, from: f64, length: f64, out: usize) -> Self {
        let scale = length / out as f64;
        let support = scale.max(1.0);
        let mut rows: Vec<(usize, Vec<f64>)> = (0..out)
            .map(|o| {
                let centre = from + (o as f64 + 0.5) * scale - 0.5;
                let first = (centre - support).ceil().max(0.0) as usize;
                let first = first.min(source - 1);
                let last = (centre + support).floor().max(0.0) as usize;
                let last = last.clamp(first, source - 1);
                let mut weights: Vec<f64> = (first..=last)
                    .map(|i| (1.0 - (i as f64 - centre).abs() / support).max(0.0))
                    .collect();
                // If the centre lies beyond the edge by more than the triangle, the edge sample is used.
                if weights.iter().all(|w| *w <= 0.0) {
                    weights.fill(1.0);
                }
                let sum: f64 = weights.iter().sum();
                weights.iter_mut().for_each(|w| *w /= sum);
                (first, weights)
            })
            .collect();
        // Weights at the ends that are only rounding errors are dropped, so that an image that is not resized has one
        // tap.
        for (first, weights) in &mut rows {
            while weights.len() > 1 && weights[weights.len() - 1] < 1e-9 {
                weights.pop();
            }
            while weights.len() > 1 && weights[0] < 1e-9 {
                weights.remove(0);
                *first += 1;
            }
        }
        let taps = rows.iter().map(|(_, w)| w.len()).max().unwrap_or(1);
        let mut axis = Axis {
            start: Vec::with_capacity(out),
            weights: vec![0.0; out * taps],
            taps,
            needed: 0..0,
            is_kept: false,
        };
        for (o, (first, weights)) in rows.into_iter().enumerate() {
            // All output samples have the same number of taps, so the last ones start earlier.
            let start = first.min(source - taps.min(source));
            axis.start.push(start as u32);
            for (k, weight) in weights.into_iter().enumerate() {
                axis.weights[o * taps + first - start + k] = weight as f32;
            }
        }
        let first = axis.start.iter().min().copied().unwrap_or(0);
        let last = axis.start.iter().max().copied().unwrap_or(0);
        axis.needed = first as usize..last as usize + taps;
        axis.is_kept = taps == 1 && axis.start.is_sorted_by(|a, b| a + 1 == *b);
        axis
    }

    /// Returns the input samples and weights of output sample `o`.
    pub fn taps(&self, o: usize) -> impl Iterator<Item = (usize, f32)> + '_ {
        let start = self.start[o] as usize;
        (self.weights[o * self.taps..][..self.taps].iter())
            .enumerate()
            .map(move |(k, w)| (start + k, *w))
    }

    /// Returns the first input sample of each output sample, the weights, and the number of weights for each output
    /// sample.
    pub fn tables(&self) -> (&[u32], &[f32], usize) {
        (&self.start, &self.weights, self.taps)
    }

    /// Returns the range of needed input samples.
    pub fn needed(&self) -> Range<usize> {
        self.needed.clone()
    }

    /// Returns whether the output samples are neighbouring input samples as they are.
    pub fn is_kept(&self) -> bool {
        self.is_kept
    }

    /// Resamples `row`, which begins with input sample `first`, to `out`.
    pub fn apply(&self, row: &[f32], first: usize, out: &mut [f32]) {
        match self.taps {
            1 => {
                for (value, start) in out.iter_mut().zip(&self.start) {
                    *value = row[*start as usize - first];
                }
            }
            2 => {
                let weights = self.weights.as_chunks::<2>().0;
                for ((value, start), w) in out.iter_mut().zip(&self.start).zip(weights) {
                    let at = *start as usize - first;
                    *value = row[at] * w[0] + row[at + 1] * w[1];
                }
            }
            taps => {
                let weights = self.weights.chunks_exact(taps);
                for ((value, start), weights) in out.iter_mut().zip(&self.start).zip(weights) {
                    let from = &row[*start as usize - first..][..taps];
                    *value = from.iter().zip(weights).map(|(v, w)| v * w).sum();
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_crop_is_the_largest_in_the_middle() {
        let crop = Crop::cover(
            Size {
                width: 1920,
                height: 1440,
            },
            Size {
                width: 1920,
                height: 1080,
            },
        );
        assert_eq!((crop.x, crop.y), (0.0, 180.0));
        assert_eq!((crop.width, crop.height), (1920.0, 1080.0));
        let crop = Crop::cover(
            Size {
                width: 640,
                height: 480,
            },
            Size { width: 50, height: 100 },
        )
        .scaled(0.5, 0.5);
        assert_eq!((crop.x, crop.y, crop.width, crop.height), (100.0, 0.0, 120.0, 240.0));
    }

    #[test]
    fn what_is_not_resized_is_copied_and_what_is_keeps_its_mean() {
        assert_eq!(Axis::new(7, 0.0, 7.0, 7).taps, 1);
        let row: Vec<f32> = (0..12).map(|i| i as f32).collect();
        for (from, length, out) in [(0.0, 12.0, 4), (0.0, 12.0, 31), (2.0, 8.0, 5), (0.0, 12.0, 1)] {
            let axis = Axis::new(12, from, length, out);
            let mut resampled = vec![0.0; out];
            let needed = axis.needed();
            axis.apply(&row[needed.clone()], needed.start, &mut resampled);
            let mean = resampled.iter().sum::<f32>() / out as f32;
            let expected = (from + length / 2.0) as f32 - 0.5;
            assert!((mean - expected).abs() < 0.02, "{from} {length} {out}: {mean}");
            assert!((0..out).all(|o| (axis.taps(o).map(|t| t.1).sum::<f32>() - 1.0).abs() < 1e-6));
        }
    }
}
