//! Aberrations that vary over the frame, as a display file defines them.

use crate::{Error, Result};
use phasefront::target::Aberration;
use phasefront_core::optics::zernike::Aberrations;

/// Corrections on a grid over the frame: bilinear between the points, and constant beyond the outermost points.
#[derive(Debug, Clone, PartialEq)]
pub struct SpatialAberrations {
    /// The columns in ascending order, as fractions of the frame's width.
    x: Vec<f64>,
    /// The rows in ascending order, as fractions of the frame's height.
    y: Vec<f64>,
    /// The corrections, row by row.
    at: Vec<Aberrations>,
}

impl SpatialAberrations {
    /// Creates a grid from corrections at points (x, y), each from 0 to 1 over the frame, in any order.
    ///
    /// # Errors
    /// Returns an error if a point lies outside the frame or the points do not form a full grid.
    pub fn new(points: Vec<([f64; 2], Aberrations)>) -> Result<Self> {
        let axis = |i: usize| {
            let mut all: Vec<f64> = points.iter().map(|(place, _)| place[i]).collect();
            all.sort_by(f64::total_cmp);
            all.dedup();
            all
        };
        let (x, y) = (axis(0), axis(1));
        if x.iter().chain(&y).any(|v| !(0.0..=1.0).contains(v)) {
            return Err(Error::Input(
                "a calibrated point outside the frame; x and y must lie in 0 to 1".into(),
            ));
        }
        let find = |x: f64, y: f64| points.iter().find(|(place, _)| *place == [x, y]);
        let at: Option<Vec<_>> = (y.iter())
            .flat_map(|y| x.iter().map(move |x| find(*x, *y).map(|(_, a)| a.clone())))
            .collect();
        match at {
            Some(at) if !at.is_empty() && at.len() == points.len() => Ok(SpatialAberrations { x, y, at }),
            _ => Err(Error::Input(format!(
                "{} calibrated points in {} columns and {} rows; every column must have a point in every row, once",
                points.len(),
                x.len(),
                y.len()
            ))),
        }
    }

    /// Returns the calibrated points and their corrections, row by row.
    pub fn points(&self) -> impl Iterator<Item = ([f64; 2], &Aberrations)> {
        let columns = self.x.len();
        let place = move |i: usize| [self.x[i % columns], self.y[i / columns]];
        self.at.iter().enumerate().map(move |(i, a)| (place(i), a))
    }

    /// Returns the correction at (`x`, `y`), in fractions of the frame, and at `z_m`.
    pub fn at(&self, x: f64, y: f64, z_m: f64) -> Aberration {
        let split = |axis: &[f64], v: f64| {
            let next = axis.partition_point(|a| *a <= v).clamp(1, axis.len().max(2) - 1);
            match axis.get(next) {
                None => (0, 0, 0.0),
                Some(end) => {
                    let begin = axis[next - 1];
                    (next - 1, next, ((v - begin) / (end - begin)).clamp(0.0, 1.0))
                }
            }
        };
        let (i0, i1, ty) = split(&self.y, y);
        let (j0, j1, tx) = split(&self.x, x);
        let row = |i: usize| {
            let at = |j: usize| self.at[i * self.x.len() + j].at(z_m);
            at(j0).mix(&at(j1), tx)
        };
        row(i0).mix(&row(i1), ty)
    }

    /// Returns the largest sideways displacement of light, in metres.
    pub fn reach_m(&self, pitch_m: f64) -> f64 {
        (self.at.iter().flat_map(Aberrations::calibrated))
            .map(|(_, a)| a.reach_m(pitch_m))
            .fold(0.0, f64::max)
    }
}
