//! A model of a display that is learned from photographs: what a pixel's phase does to the light, beyond the phase
//! curves, the laser's map and the aberration of a [`super::target::Target`].
//!
//! For intended phases θ in \[0, 2π] and the laser's amplitude Λ, the field at the modulator is
//!
//!   v = Λ·(L·exp(iψ) + Q),  ψ = W∗(θ + c(θ)),
//!
//! where c is an error of the phase curve, W a kernel of 3×3 pixels (crosstalk; beyond the border, pixels repeat), L
//! the relative light and Q the light that is not diffracted. Its spectrum is multiplied by the pupil A, and propagates
//! from there as on an ideal display. c is piecewise linear, A is bilinear over the first order, and L and Q are
//! bilinear over the modulator. All are the same for each pixel of a colour otherwise.

use crate::Bounds;
use crate::Size;
use crate::runtime::error::{Error, Result};
use num_complex::Complex32;
use std::f32::consts::TAU;

/// The number of nodes of the curve, at the phases 2πk/16.
pub const CURVE: usize = 17;
/// The number of nodes of the pupil along each axis, from frequency −½ to ½ in cycles per pixel.
pub const PUPIL: usize = 17;
/// The largest number of nodes along an axis of the maps over the modulator.
pub const MOST_NODES: usize = 64;

const MAGIC: &[u8; 8] = b"PFMODEL1";

/// The model of one colour.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourModel {
    /// c, in radians, at the phases 2πk/16.
    pub curve: [f32; CURVE],
    /// W, three rows of three from the top left: the weight of each neighbour. Their sum is 1.
    pub crosstalk: [f32; 9],
    /// A, (PUPIL, PUPIL), rows of one vertical frequency.
    pub pupil: Vec<Complex32>,
    /// L, (rows, columns).
    pub light: Vec<Complex32>,
    /// Q, (rows, columns).
    pub undiffracted: Vec<Complex32>,
}

/// The models of all colours of a display.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// The number of rows and columns of nodes over the modulator.
    nodes: (usize, usize),
    colours: Vec<ColourModel>,
}

impl ColourModel {
    /// Returns the model of an ideal display with `nodes` over the modulator.
    pub fn ideal(nodes: (usize, usize)) -> Self {
        ColourModel {
            curve: [0.0; CURVE],
            crosstalk: std::array::from_fn(|i| if i == 4 { 1.0 } else { 0.0 }),
            pupil: vec![Complex32::ONE; PUPIL * PUPIL],
            light: vec![Complex32::ONE; nodes.0 * nodes.1],
            undiffracted: vec![Complex32::ZERO; nodes.0 * nodes.1],
        }
    }

    /// Returns c, W, A, L and Q as one list.
    pub fn values(&self) -> Vec<f32> {
        let planes = [&self.pupil, &self.light, &self.undiffracted];
        let complex = planes.into_iter().flatten().flat_map(|value| [value.re, value.im]);
        self.curve.into_iter().chain(self.crosstalk).chain(complex).collect()
    }

    /// Creates the model from [`Self::values`].
    ///
    /// # Panics
    /// Panics if there are too few values.
    pub fn from_values(values: &[f32]) -> Self {
        let (curve, rest) = values.split_at(CURVE);
        let (crosstalk, rest) = rest.split_at(9);
        let complex: Vec<_> = (rest.as_chunks::<2>().0.iter())
            .map(|[re, im]| Complex32::new(*re, *im))
            .collect();
        let (pupil, rest) = complex.split_at(PUPIL * PUPIL);
        let (light, undiffracted) = rest.split_at(rest.len() / 2);
        ColourModel {
            curve: std::array::from_fn(|i| curve[i]),
            crosstalk: std::array::from_fn(|i| crosstalk[i]),
            pupil: pupil.to_vec(),
            light: light.to_vec(),
            undiffracted: undiffracted.to_vec(),
        }
    }

    /// Returns θ + c(θ) and its slope at `phase`, θ in \[0, 2π].
    #[inline(always)]
    pub fn response(&self, phase: f32) -> (f32, f32) {
        const STEPS: f32 = (CURVE - 1) as f32 / TAU;
        let (at, part) = node(phase * STEPS, CURVE);
        let rise = self.curve[at + 1] - self.curve[at];
        (phase + self.curve[at] + part * rise, 1.0 + rise * STEPS)
    }

    /// Returns the least and the largest response.
    pub fn reach(&self) -> [f32; 2] {
        [0.0, TAU].map(|phase| self.response(phase).0)
    }

    /// Returns the response that is `wanted` modulo 2π, or the nearest within reach.
    pub fn nearest(&self, wanted: f32) -> f32 {
        let [low, high] = self.reach();
        let turned = low + (wanted - low).rem_euclid(TAU);
        if turned <= high {
            turned
        } else if turned - high < low + TAU - turned {
            high
        } else {
            low
        }
    }

    /// Returns the phase in \[0, 2π] whose response is `wanted`, or the nearest within reach.
    pub fn inverse(&self, wanted: f32) -> f32 {
        let (mut from, mut to) = (0.0, TAU);
        for _ in 0..24 {
            let middle = 0.5 * (from + to);
            if self.response(middle).0 < wanted {
                from = middle
            } else {
                to = middle
            }
        }
        0.5 * (from + to)
    }

    /// Writes W∗`phases`, (H, W), to row `y` of the result.
    ///
    /// # Panics
    /// Panics if `row` is not W long or the plane has no row `y`.
    pub fn spread_row(&self, phases: &[f32], y: usize, row: &mut [f32]) {
        let (width, height) = (row.len(), phases.len() / row.len());
        let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1)].map(|y| &phases[y * width..][..width]);
        for (x, value) in row.iter_mut().enumerate() {
            let columns = [x.saturating_sub(1), x, (x + 1).min(width - 1)];
            let mut sum = 0.0;
            for (row, weights) in rows.iter().zip(self.crosstalk.as_chunks::<3>().0) {
                for (x, weight) in columns.iter().zip(weights) {
                    sum += row[*x] * weight;
                }
            }
            *value = sum;
        }
    }

    /// Writes row `y` of the transpose of W∗, applied to `values`, (H, W).
    ///
    /// # Panics
    /// Panics if `row` is not W long or the plane has no row `y`.
    pub fn gather_row(&self, values: &[f32], y: usize, row: &mut [f32]) {
        let (width, height) = (row.len(), values.len() / row.len());
        row.fill(0.0);
        for (dy, weights) in self.crosstalk.as_chunks::<3>().0.iter().enumerate() {
            for source in targets(y, height, dy) {
                let line = &values[source * width..][..width];
                for (dx, weight) in weights.iter().enumerate() {
                    for (x, value) in row.iter_mut().enumerate() {
                        for source in targets(x, width, dx) {
                            *value += line[source] * weight;
                        }
                    }
                }
            }
        }
    }

    /// Returns A at the frequency (`fx`, `fy`), in cycles per pixel within ±½.
    pub fn pupil_at(&self, fx: f64, fy: f64) -> Complex32 {
        blend(&self.pupil, PUPIL, pupil_node(fy), pupil_node(fx))
    }

    fn check(&self, nodes: (usize, usize)) -> Result<()> {
        let area = nodes.0 * nodes.1;
        let sizes = [self.pupil.len(), self.light.len(), self.undiffracted.len()] == [PUPIL * PUPIL, area, area];
        let planes = [&self.pupil, &self.light, &self.undiffracted];
        let finite = planes.into_iter().flatten().all(|value| value.is_finite())
            && self.curve.iter().chain(&self.crosstalk).all(|value| value.is_finite());
        if !sizes || !finite {
            return Err(refuse("holds values that are not finite, or too few of them"));
        }
        let sum: f32 = self.crosstalk.iter().sum();
        if (sum - 1.0).abs() > 1e-3 {
            return Err(refuse(format!("the crosstalk has the sum {sum}; it must be 1")));
        }
        if (0..CURVE - 1).any(|k| self.response((k as f32 + 0.5) / (CURVE - 1) as f32 * TAU).1 <= 0.0) {
            return Err(refuse("the phase curve falls; it must rise"));
        }
        Ok(())
    }
}

/// Returns the positions whose neighbour `d` (0 before, 1 own, 2 after) is `at`, if pixels repeat beyond the border.
fn targets(at: usize, count: usize, d: usize) -> impl Iterator<Item = usize> {
    let own = (at + 1).checked_sub(d).filter(|source| *source < count);
    let border = match d {
        0 => (at == 0).then_some(0),
        2 => (at == count - 1).then_some(at),
        _ => None,
    };
    own.into_iter().chain(border)
}

/// Returns the node of the pupil before `frequency`, in cycles per pixel, and the part of the way to the next.
pub fn pupil_node(frequency: f64) -> (usize, f32) {
    node(((frequency + 0.5) * (PUPIL - 1) as f64) as f32, PUPIL)
}

/// Returns the node before `at` of `count` and the part of the way to the next.
#[inline(always)]
fn node(at: f32, count: usize) -> (usize, f32) {
    let before = (at.at_least(0.0) as usize).min(count - 2);
    (before, (at - before as f32).clamp(0.0, 1.0))
}

fn blend(plane: &[Complex32], columns: usize, (i, fy): (usize, f32), (j, fx): (usize, f32)) -> Complex32 {
    let row = |i: usize| plane[i * columns + j] * (1.0 - fx) + plane[i * columns + j + 1] * fx;
    row(i) * (1.0 - fy) + row(i + 1) * fy
}

/// Returns the node before pixel `at` of `count` and the part of the way to the next of `nodes`.
pub fn around(at: usize, count: usize, nodes: usize) -> (usize, f32) {
    node(at as f32 * (nodes - 1) as f32 / (count.max(2) - 1) as f32, nodes)
}

impl Model {
    /// Creates the model of a display from those of its colours, with `nodes` over the modulator.
    ///
    /// # Errors
    /// Returns an error if there are not 1 or 3 colours, an axis has fewer than 2 or more than [`MOST_NODES`] nodes, a
    /// value is not finite, the crosstalk's sum is not 1, or a phase curve falls.
    pub fn new(nodes: (usize, usize), colours: Vec<ColourModel>) -> Result<Self> {
        let allowed = 2..=MOST_NODES;
        if !allowed.contains(&nodes.0) || !allowed.contains(&nodes.1) || !matches!(colours.len(), 1 | 3) {
            return Err(refuse(format!(
                "has {} colours of {}×{} nodes; there must be 1 or 3 colours of 2 to {MOST_NODES} nodes a side",
                colours.len(),
                nodes.1,
                nodes.0
            )));
        }
        colours.iter().try_for_each(|colour| colour.check(nodes))?;
        Ok(Model { nodes, colours })
    }

    /// Returns the models of the colours.
    pub fn colours(&self) -> &[ColourModel] {
        &self.colours
    }

    /// Returns the number of rows and columns of nodes over the modulator.
    pub fn nodes(&self) -> (usize, usize) {
        self.nodes
    }

    /// Returns L and Q of `colour` at pixel (`x`, `y`) of a modulator.
    pub fn light(&self, colour: usize, y: usize, x: usize, modulator: Size) -> [Complex32; 2] {
        let of = &self.colours[colour];
        let (row, column) = (
            around(y, modulator.height, self.nodes.0),
            around(x, modulator.width, self.nodes.1),
        );
        [&of.light, &of.undiffracted].map(|plane| blend(plane, self.nodes.1, row, column))
    }

    /// Reads a model from the bytes of a file.
    ///
    /// # Errors
    /// Returns an error if the bytes are not those of a model, are incomplete, or hold an invalid value.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let rest = bytes.strip_prefix(MAGIC.as_slice());
        let rest =
            rest.ok_or_else(|| refuse("does not begin with PFMODEL1; `phasefront calibrate model` writes one"))?;
        let short = || refuse("is cut short, or longer than its header says");
        let (header, values) = rest.split_first_chunk::<3>().ok_or_else(short)?;
        let [colours, rows, columns] = header.map(usize::from);
        let count = CURVE + 9 + 2 * (PUPIL * PUPIL + 2 * rows * columns);
        if values.len() != 4 * colours * count || colours == 0 {
            return Err(short());
        }
        let values: Vec<f32> = (values.as_chunks().0.iter()).map(|b| f32::from_le_bytes(*b)).collect();
        Model::new(
            (rows, columns),
            values.chunks_exact(count).map(ColourModel::from_values).collect(),
        )
    }

    /// Returns the bytes of the file: `PFMODEL1`, the number of colours, rows and columns as bytes, and for each colour
    /// c, W, A, L and Q as little-endian f32.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([self.colours.len(), self.nodes.0, self.nodes.1].map(|n| n as u8));
        for colour in &self.colours {
            bytes.extend(colour.values().into_iter().flat_map(f32::to_le_bytes));
        }
        bytes
    }
}

fn refuse(what: impl std::fmt::Display) -> Error {
    Error::Setting(format!("the learned model {what}"))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn model() -> Model {
        let wave = |i: usize| Complex32::from_polar(1.0 + 0.02 * (i % 5) as f32, 0.03 * (i % 7) as f32);
        let colour = ColourModel {
            curve: std::array::from_fn(|k| 0.2 * (k as f32 * 0.7).sin()),
            crosstalk: [0.01, 0.05, 0.02, 0.1, 0.7, 0.04, 0.0, 0.06, 0.02],
            pupil: (0..PUPIL * PUPIL).map(wave).collect(),
            light: (0..6).map(wave).collect(),
            undiffracted: (0..6).map(|i| wave(i) * 0.05).collect(),
        };
        Model::new((2, 3), vec![colour]).unwrap()
    }

    #[test]
    fn a_model_goes_through_its_bytes_and_bad_bytes_are_named() {
        let model = model();
        let bytes = model.to_bytes();
        assert_eq!(Model::from_bytes(&bytes).unwrap(), model);
        let said = |bytes: &[u8]| Model::from_bytes(bytes).unwrap_err().to_string();
        assert!(said(b"PFCALIB1").contains("PFMODEL1"));
        assert!(said(&bytes[..bytes.len() - 1]).contains("cut short"));
        let mut bad = bytes.clone();
        bad[11..15].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(said(&bad).contains("not finite"));
        bad[11..15].copy_from_slice(&9f32.to_le_bytes());
        assert!(said(&bad).contains("falls"));
        let mut bad = bytes.clone();
        bad[11 + 4 * CURVE..][..4].copy_from_slice(&1f32.to_le_bytes());
        assert!(said(&bad).contains("sum"));
        let mut bad = bytes;
        bad[9] = 1;
        assert!(said(&bad).contains("cut short"));
    }

    #[test]
    fn the_response_is_inverted() {
        let model = model();
        let colour = &model.colours()[0];
        for k in 0..200 {
            let phase = k as f32 / 200.0 * TAU;
            let shown = colour.response(phase).0;
            let back = colour.inverse(shown);
            let again = colour.response(back).0;
            assert!((again - shown).abs() < 1e-4, "{phase} {back}");
            let slope = (colour.response(phase + 1e-2).0 - shown) / 1e-2;
            assert!((slope - colour.response(phase + 5e-3).1).abs() < 0.1, "{phase}");
        }
    }

    #[test]
    fn gathering_is_the_transpose_of_spreading() {
        let model = model();
        let colour = &model.colours()[0];
        for (height, width) in [(1, 1), (1, 5), (4, 1), (5, 7), (2, 2)] {
            let plane = |seed: usize| -> Vec<f32> {
                (0..height * width)
                    .map(|i| ((i * 7 + seed) % 11) as f32 - 5.0)
                    .collect()
            };
            let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
            let (a, b) = (plane(1), plane(4));
            let (mut spread, mut gathered) = (a.clone(), a.clone());
            for (y, (spread, gathered)) in
                (spread.chunks_exact_mut(width).zip(gathered.chunks_exact_mut(width))).enumerate()
            {
                colour.spread_row(&a, y, spread);
                colour.gather_row(&b, y, gathered);
            }
            assert!((dot(&spread, &b) - dot(&a, &gathered)).abs() < 1e-3, "{height}×{width}");
        }
    }

    #[test]
    fn maps_are_bilinear() {
        let model = model();
        let colour = &model.colours()[0];
        assert_eq!(
            model.light(0, 0, 0, Size { width: 11, height: 9 }),
            [colour.light[0], colour.undiffracted[0]]
        );
        assert_eq!(model.light(0, 8, 10, Size { width: 11, height: 9 })[0], colour.light[5]);
        let between = (colour.light[1] + colour.light[4]) / 2.0;
        assert!((model.light(0, 4, 5, Size { width: 11, height: 9 })[0] - between).norm() < 1e-6);
        assert_eq!(colour.pupil_at(0.0, 0.0), colour.pupil[PUPIL / 2 * PUPIL + PUPIL / 2]);
        assert_eq!(colour.pupil_at(-0.5, 0.5), colour.pupil[(PUPIL - 1) * PUPIL]);
    }
}
