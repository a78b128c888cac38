//! Compensation of the laser light over the modulator. A Gaussian beam is brighter in the middle than at the rim, so
//! the target amplitude is divided by the amplitude of the light.
//!
//! Beams are smooth, so the map is coarse. It is interpolated linearly between nodes that are evenly spaced from the
//! first to the last pixel of each axis.

use crate::Bounds;
use crate::Size;
use crate::parallel::prelude::*;
use crate::runtime::error::{Error, Result};
use ndarray::{ArrayView3, Axis};
use num_complex::Complex32;
use phasefront_kernels::wide;

/// The largest gain. Light below a tenth of the brightest counts as a tenth.
pub const MAX_GAIN: f32 = 10.0;

/// The reciprocal of the laser's amplitude, for a modulator of any size. It is immutable and can be shared between
/// threads.
#[derive(Debug, Clone, PartialEq)]
pub struct Illumination {
    /// The grid of nodes, (Gh, Gw).
    nodes: (usize, usize),
    /// The gain of each node, (C, Gh, Gw).
    gain: Vec<f32>,
}

impl Illumination {
    /// Creates the map from the lasers' amplitudes, (C, Gh, Gw), of any scale. Each colour is divided by its largest
    /// value.
    ///
    /// # Errors
    /// Returns an error if there are neither three colours nor one, fewer than 2 nodes along an axis, a value that is
    /// negative or not finite, or a colour without light.
    pub fn new(amplitude: ArrayView3<'_, f32>) -> Result<Self> {
        let refuse = |what: String| Err(Error::Setting(format!("laser map: {what}")));
        let (colours, rows, columns) = amplitude.dim();
        if ![1, 3].contains(&colours) || rows < 2 || columns < 2 {
            return refuse(format!(
                "{colours} colours of {columns}×{rows}; there must be 3 or 1 of at least 2×2"
            ));
        }
        let mut gain = Vec::with_capacity(amplitude.len());
        for plane in amplitude.axis_iter(Axis(0)) {
            if plane.iter().any(|a| !a.is_finite() || *a < 0.0) {
                return refuse("an amplitude below 0 or not finite".into());
            }
            let most = plane.iter().fold(0.0, |most, a| a.at_least(most));
            if most == 0.0 {
                return refuse("a colour without light".into());
            }
            gain.extend(plane.iter().map(|a| (most / a).at_most(MAX_GAIN)));
        }
        Ok(Illumination {
            nodes: (rows, columns),
            gain,
        })
    }

    /// Returns the number of colours.
    pub fn colours(&self) -> usize {
        self.gain.len() / (self.nodes.0 * self.nodes.1)
    }

    /// Returns the grid of nodes, (Gh, Gw).
    #[doc(hidden)]
    pub fn nodes(&self) -> (usize, usize) {
        self.nodes
    }

    /// Returns the reciprocal amplitude of each node, (C, Gh, Gw), from 1 to [`MAX_GAIN`].
    #[doc(hidden)]
    pub fn gains(&self) -> &[f32] {
        &self.gain
    }

    /// Returns the reciprocal amplitude at pixel (`x`, `y`) of a modulator of `size`, interpolated in y, then
    /// in x. Tests compare [`Self::divide`] with it.
    ///
    /// # Panics
    /// Panics if the map has no such colour or the pixel lies outside the modulator.
    #[doc(hidden)]
    pub fn gain(&self, colour: usize, y: usize, x: usize, Size { width, height }: Size) -> f32 {
        assert!(y < height && x < width);
        let (i, fy) = split(y, height, self.nodes.0);
        let (j, fx) = split(x, width, self.nodes.1);
        let column = |j: usize| self.column(colour, i, j, fy);
        let (left, right) = (column(j), column(j + 1));
        left + (right - left) * fx
    }

    fn column(&self, colour: usize, i: usize, j: usize, fy: f32) -> f32 {
        let (rows, columns) = self.nodes;
        let node = |i: usize| self.gain[(colour * rows + i) * columns + j];
        let (top, bottom) = (node(i), node(i + 1));
        top + (bottom - top) * fy
    }

    /// Divides `field` by the laser's amplitude. `field` is (C, H, W), a plane of `size` for each colour, and lies in
    /// the middle of a modulator of the size `modulator`. If an axis of the modulator is shorter than the field, the
    /// field's length is used. Does not allocate.
    ///
    /// # Panics
    /// Panics if `field` does not have C·H·W values.
    #[doc(hidden)]
    pub fn divide(&self, field: &mut [Complex32], size: Size, modulator: Size) {
        self.each_row(field, size, modulator, |value, gain| *value *= gain);
    }

    /// Multiplies `field` by the laser's amplitude, as the inverse of [`Self::divide`]. This simulates the illumination
    /// of the modulator.
    ///
    /// # Panics
    /// Panics if `field` does not have C·H·W values.
    #[doc(hidden)]
    pub fn shine(&self, field: &mut [Complex32], size: Size, modulator: Size) {
        self.each_row(field, size, modulator, |value, gain| *value /= gain);
    }

    /// Divides row `row` of a stack of planes with `height` rows, like [`Self::divide`].
    pub(crate) fn divide_row(&self, values: &mut [Complex32], row: usize, height: usize, modulator: Size) {
        wide!(self.change_row(values, row, height, modulator, |value, gain| *value *= gain));
    }

    /// Fills `light` with the laser's amplitude on row `row` of a stack of planes with `height` rows. The maximum is 1.
    pub(crate) fn light_row(&self, light: &mut [f32], row: usize, height: usize, modulator: Size) {
        wide!(self.change_row(light, row, height, modulator, |light, gain| *light = 1.0 / gain));
    }

    fn each_row(
        &self,
        field: &mut [Complex32],
        Size { width, height }: Size,
        modulator: Size,
        change: impl Fn(&mut Complex32, f32) + Sync,
    ) {
        assert_eq!(field.len(), self.colours() * height * width);
        let lines = field.par_chunks_exact_mut(width).enumerate();
        lines.for_each(|(row, values)| {
            wide!(self.change_row(values, row, height, modulator, &change));
        });
    }

    #[inline(always)]
    fn change_row<T>(
        &self,
        mut values: &mut [T],
        row: usize,
        height: usize,
        modulator: Size,
        change: impl Fn(&mut T, f32),
    ) {
        let width = values.len();
        let (rows, columns) = (modulator.height.max(height), modulator.width.max(width));
        let (top, left) = ((rows - height) / 2, (columns - width) / 2);
        let (i, fy) = split(row % height + top, rows, self.nodes.0);
        let (colour, end) = (row / height, left + width);
        let (spans, steps) = (self.nodes.1 - 1, (columns - 1).max(1));
        let mut at = left;
        while at < end {
            // All pixels between the same two nodes.
            let (j, _) = split(at, columns, self.nodes.1);
            let next = match j + 1 {
                last if last == spans => end,
                node => (node * steps).div_ceil(spans).min(end),
            };
            let (near, far) = (self.column(colour, i, j, fy), self.column(colour, i, j + 1, fy));
            let (run, rest) = values.split_at_mut(next - at);
            let (first, each) = ((at * spans - j * steps) as i32, spans as i32);
            for (k, value) in run.iter_mut().enumerate() {
                let fx = (first + k as i32 * each) as f32 / steps as f32;
                change(value, near + (far - near) * fx);
            }
            (values, at) = (rest, next);
        }
    }
}

/// Returns the node before pixel `n` of `count`, and the fraction of the way to the next of `nodes`.
fn split(n: usize, count: usize, nodes: usize) -> (usize, f32) {
    let steps = (count - 1).max(1);
    let scaled = n * (nodes - 1);
    let before = (scaled / steps).min(nodes - 2);
    (before, (scaled - before * steps) as f32 / steps as f32)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use ndarray::Array3;

    fn beam(nodes: (usize, usize)) -> Array3<f32> {
        let (rows, columns) = nodes;
        Array3::from_shape_fn((3, rows, columns), |(c, y, x)| {
            let (u, v) = (x as f32 / columns as f32 - 0.5, y as f32 / rows as f32 - 0.45);
            (c as f32 + 1.0) * (-(u * u + v * v) * (2.0 + c as f32)).exp()
        })
    }

    #[test]
    fn rows_agree_with_the_value_by_value_form() {
        for size in [
            Size { width: 33, height: 7 },
            Size { width: 1, height: 1 },
            Size { width: 3, height: 40 },
            Size { width: 64, height: 2 },
        ] {
            for nodes in [(2, 2), (5, 9), (50, 70)] {
                let map = Illumination::new(beam(nodes).view()).unwrap();
                let Size { width: w, height: h } = size;
                let plane = |i: usize| Complex32::new(1.0 + i as f32, -0.5);
                let field: Vec<_> = (0..3 * h * w).map(plane).collect();
                let mut divided = field.clone();
                map.divide(
                    &mut divided,
                    size,
                    Size {
                        width: w + 8,
                        height: h + 5,
                    },
                );
                for (i, value) in divided.iter().enumerate() {
                    // The modulator has five more rows and eight more columns: two rows above, four columns on the
                    // left.
                    let (y, x) = (i / w % h + 2, i % w + 4);
                    let gain = map.gain(
                        i / (h * w),
                        y,
                        x,
                        Size {
                            width: w + 8,
                            height: h + 5,
                        },
                    );
                    assert_eq!(*value, field[i] * gain, "{size} {nodes:?} {i}");
                }
                map.shine(
                    &mut divided,
                    size,
                    Size {
                        width: w + 8,
                        height: h + 5,
                    },
                );
                for (a, b) in divided.iter().zip(&field) {
                    assert!((a - b).norm() < 1e-5 * b.norm());
                }
            }
        }
    }

    #[test]
    fn corners_are_nodes_and_gains_are_bounded() {
        let mut amplitude = beam((4, 5));
        amplitude[(1, 0, 4)] = 0.0;
        let map = Illumination::new(amplitude.view()).unwrap();
        let most = amplitude.index_axis(Axis(0), 0).iter().copied().fold(0.0, f32::max);
        assert_eq!(
            map.gain(0, 99, 49, Size { width: 50, height: 100 }),
            most / amplitude[(0, 3, 4)]
        );
        assert_eq!(map.gain(1, 0, 49, Size { width: 50, height: 100 }), MAX_GAIN);
        assert!(map.gains().iter().all(|g| (1.0..=MAX_GAIN).contains(g)));
    }

    #[test]
    fn unusable_maps_are_named() {
        let message = |a: Array3<f32>| Illumination::new(a.view()).unwrap_err().to_string();
        assert!(message(Array3::ones((2, 4, 4))).contains("3 or 1 of"));
        assert!(message(Array3::ones((3, 1, 4))).contains("2×2"));
        assert!(message(Array3::zeros((3, 4, 4))).contains("without light"));
        assert!(message(Array3::from_elem((3, 4, 4), f32::NAN)).contains("not finite"));
    }
}
