//! Fit of a smooth surface to the values of single pixels. The surface is bilinear between the nodes of a coarse grid.
//! It is the least-squares fit to the pixels that have a value, with a penalty on its bending energy.
//!
//! Nodes in a hole (a mark or dust) or beyond the last pixel take the values of least bending, which continues the
//! slope around them.

use ndarray::{Array2, Array3, ArrayView2};
use phasefront::Size;
use phasefront_core::display::response::per_pixel;
use rayon::prelude::*;

/// The weight of the bending energy relative to a node's share of pixels. Waves shorter than 2π nodes are treated as
/// noise.
const STIFFNESS: f64 = 1.0;
/// The residual at which the solver stops, relative to the first one.
const SOLVED: f64 = 1e-7;

/// Fits surfaces to the N values of each pixel of `seen`, where NaN marks pixels without values. Returns the values at
/// nodes every `spacing` pixels, or `None` if no pixel has values.
pub fn fit<const N: usize>(seen: ArrayView2<'_, [f32; N]>, spacing: usize) -> Option<Array2<[f32; N]>> {
    let (height, width) = seen.dim();
    let shape = per_pixel::nodes(Size { width, height }, spacing);
    let system = System::of(seen, shape, spacing);
    if system.pixels == 0.0 {
        return None;
    }
    let all: Vec<Vec<f64>> = (0..N).into_par_iter().map(|n| system.solve(n)).collect();
    let columns = shape.1;
    Some(Array2::from_shape_fn(shape, |(i, j)| {
        std::array::from_fn(|n| all[n][i * columns + j] as f32)
    }))
}

/// The normal equations of the pixels, with the penalty.
struct System {
    /// The size of the grid, (Gh, Gw).
    shape: (usize, usize),
    /// The coefficients that couple each node to the nodes around it, row by row, (Gh, Gw, 9).
    gram: Array3<f64>,
    /// The weighted sum of pixels at each node, (Gh, Gw, N).
    right: Array3<f64>,
    pixels: f64,
    weight: f64,
}

impl System {
    fn of<const N: usize>(seen: ArrayView2<'_, [f32; N]>, shape: (usize, usize), spacing: usize) -> Self {
        let height = seen.nrows();
        let (rows, columns) = shape;
        const AROUND: usize = 9;
        let mut lines = Array3::<f64>::zeros((rows, columns, AROUND + N));
        let values = lines.as_slice_mut().expect("standard layout");
        let values = values.par_chunks_exact_mut(columns * (AROUND + N));
        values.enumerate().for_each(|(i, line)| {
            let first = (i * spacing).saturating_sub(spacing - 1);
            for y in first..(i * spacing + spacing).min(height) {
                let dy = y.abs_diff(i * spacing) as f64 / spacing as f64;
                // The two rows of nodes around this row of pixels, and its weights in them.
                let row = y / spacing;
                let part = (y % spacing) as f64 / spacing as f64;
                for (x, value) in seen.row(y).iter().enumerate() {
                    if value.iter().any(|v| v.is_nan()) {
                        continue;
                    }
                    let (column, along) = (x / spacing, (x % spacing) as f64 / spacing as f64);
                    for (j, wx) in [(column, 1.0 - along), (column + 1, along)] {
                        let weight = (1.0 - dy) * wx;
                        if weight == 0.0 {
                            continue;
                        }
                        let node = &mut line[j * (AROUND + N)..][..AROUND + N];
                        for (v, wv) in [(row, 1.0 - part), (row + 1, part)] {
                            for (u, wu) in [(column, 1.0 - along), (column + 1, along)] {
                                let (down, right) = (v + 1 - i, u + 1 - j);
                                node[3 * down + right] += weight * wv * wu;
                            }
                        }
                        for (sum, value) in node[AROUND..].iter_mut().zip(value) {
                            *sum += weight * f64::from(*value);
                        }
                    }
                }
            }
        });
        let gram = lines.slice(ndarray::s![.., .., ..AROUND]).to_owned();
        System {
            shape,
            right: lines.slice(ndarray::s![.., .., AROUND..]).to_owned(),
            pixels: gram.sum(),
            gram,
            weight: STIFFNESS * (spacing * spacing) as f64,
        }
    }

    /// Multiplies `from` by the matrix of the equations and adds the product to `to`, which must be 0.
    fn apply(&self, from: &[f64], to: &mut [f64]) {
        let (rows, columns) = self.shape;
        for i in 0..rows {
            for j in 0..columns {
                let around = self.gram.slice(ndarray::s![i, j, ..]);
                let mut sum = 0.0;
                for (n, share) in around.iter().enumerate().filter(|(_, share)| **share != 0.0) {
                    sum += share * from[(i + n / 3 - 1) * columns + j + n % 3 - 1];
                }
                to[i * columns + j] += sum;
            }
        }
        // The penalty has second differences along x and y, and mixed ones, which count twice.
        let mut bend = |at: &[(usize, f64)], weight: f64| {
            let bent: f64 = at.iter().map(|(node, share)| share * from[*node]).sum();
            for (node, share) in at {
                to[*node] += weight * share * bent;
            }
        };
        for i in 0..rows {
            for j in 0..columns {
                let at = i * columns + j;
                if j + 2 < columns {
                    bend(&[(at, 1.0), (at + 1, -2.0), (at + 2, 1.0)], self.weight);
                }
                if i + 2 < rows {
                    let (next, last) = (at + columns, at + 2 * columns);
                    bend(&[(at, 1.0), (next, -2.0), (last, 1.0)], self.weight);
                }
                if i + 1 < rows && j + 1 < columns {
                    let below = at + columns;
                    let corners = [(at, 1.0), (at + 1, -1.0), (below, -1.0), (below + 1, 1.0)];
                    bend(&corners, 2.0 * self.weight);
                }
            }
        }
    }

    /// Solves for value `n` of the nodes by the conjugate gradient method.
    fn solve(&self, n: usize) -> Vec<f64> {
        let right: Vec<f64> = self.right.slice(ndarray::s![.., .., n]).iter().copied().collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        // The iteration starts at the mean.
        let mean = right.iter().sum::<f64>() / self.pixels;
        let mut nodes = vec![mean; right.len()];
        let mut image = vec![0.0; right.len()];
        self.apply(&nodes, &mut image);
        let mut residual: Vec<f64> = right.iter().zip(&image).map(|(a, b)| a - b).collect();
        // The preconditioner is the diagonal: the pixels of each node and the penalty.
        let own: Vec<f64> = (self.gram.slice(ndarray::s![.., .., 4]).iter())
            .map(|own| 1.0 / (own + 12.0 * self.weight))
            .collect();
        let scaled = |v: &[f64]| -> Vec<f64> { v.iter().zip(&own).map(|(a, b)| a * b).collect() };
        let mut direction = scaled(&residual);
        let mut error = dot(&residual, &direction);
        let enough = error * SOLVED * SOLVED;
        for _ in 0..20 * (self.shape.0 + self.shape.1) {
            if error <= enough || error <= f64::MIN_POSITIVE {
                break;
            }
            image.fill(0.0);
            self.apply(&direction, &mut image);
            let step = error / dot(&direction, &image);
            (nodes.iter_mut().zip(&direction)).for_each(|(v, d)| *v += step * d);
            (residual.iter_mut().zip(&image)).for_each(|(v, d)| *v -= step * d);
            let next = scaled(&residual);
            let before = std::mem::replace(&mut error, dot(&residual, &next));
            let turn = error / before;
            (direction.iter_mut().zip(&next)).for_each(|(d, r)| *d = r + turn * *d);
        }
        nodes
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use phasefront_io::dice::Dice;

    /// Interpolates the grid at a pixel.
    fn read(nodes: &Array2<[f32; 2]>, spacing: usize, y: usize, x: usize) -> [f32; 2] {
        let (rows, columns) = nodes.dim();
        let at = |i: usize, j: usize, n: usize| nodes[(i.min(rows - 1), j.min(columns - 1))][n];
        let (i, j) = (y / spacing, x / spacing);
        let (v, u) = (
            (y % spacing) as f32 / spacing as f32,
            (x % spacing) as f32 / spacing as f32,
        );
        std::array::from_fn(|n| {
            let left = at(i, j, n) * (1.0 - v) + at(i + 1, j, n) * v;
            let right = at(i, j + 1, n) * (1.0 - v) + at(i + 1, j + 1, n) * v;
            left * (1.0 - u) + right * u
        })
    }

    #[test]
    fn a_plane_comes_back_through_holes_and_at_the_rim() {
        for (shape, spacing) in [((40, 61), 4), ((7, 30), 32), ((33, 33), 1)] {
            let truth = |y: usize, x: usize| [0.3 + 0.01 * y as f32 - 0.02 * x as f32, 1.0];
            let seen = Array2::from_shape_fn(shape, |(y, x)| {
                let hole = (2..16).contains(&y) && (8..27).contains(&x) || y == 0;
                if hole { [f32::NAN; 2] } else { truth(y, x) }
            });
            let nodes = fit(seen.view(), spacing).unwrap();
            for y in 0..shape.0 {
                for x in 0..shape.1 {
                    let (ours, truth) = (read(&nodes, spacing, y, x), truth(y, x));
                    let apart = (ours[0] - truth[0]).abs().max((ours[1] - truth[1]).abs());
                    assert!(apart < 2e-4, "{shape:?} {y} {x}: {ours:?} {truth:?}");
                }
            }
        }
        assert!(fit(Array2::from_elem((9, 9), [f32::NAN; 2]).view(), 4).is_none());
    }

    /// Tests a wave as long as typical variations over a panel, with noise of a third of its amplitude.
    #[test]
    fn noise_is_smoothed_and_waves_stay() {
        let (shape, spacing) = ((80, 144), 3);
        let mut dice = Dice::new(4);
        let truth = |y: usize, x: usize| (x as f32 * 0.06 + y as f32 * 0.03).sin();
        let seen = Array2::from_shape_fn(shape, |(y, x)| {
            let noise: f64 = (0..12).map(|_| dice.unit() - 0.5).sum();
            [truth(y, x) + 0.3 * noise as f32, 0.0]
        });
        let nodes = fit(seen.view(), spacing).unwrap();
        let mut square = 0.0;
        for y in 0..shape.0 {
            for x in 0..shape.1 {
                square += (read(&nodes, spacing, y, x)[0] - truth(y, x)).powi(2);
            }
        }
        let rms = (square / (shape.0 * shape.1) as f32).sqrt();
        assert!(rms < 0.04, "{rms}");
    }
}
