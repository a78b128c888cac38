//! Perspective maps between two planes, defined by four points.

use phasefront_io::{Error, Result};

/// The map (x, y) ↦ ((h₀x + h₁y + h₂)/w, (h₃x + h₄y + h₅)/w), with w = h₆x + h₇y + 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Homography([f64; 8]);

impl Homography {
    /// Computes the map that takes each point of `from` to the matching point of `to`.
    ///
    /// # Errors
    /// Returns an error if three of the points lie on one line.
    pub fn through(from: [[f64; 2]; 4], to: [[f64; 2]; 4]) -> Result<Self> {
        let mut rows = [[0.0; 9]; 8];
        for (i, ([x, y], [u, v])) in from.into_iter().zip(to).enumerate() {
            rows[2 * i] = [x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y, u];
            rows[2 * i + 1] = [0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y, v];
        }
        match solve(&mut rows) {
            Some(h) => Ok(Homography(h)),
            None => Err(Error::Input(
                "the four marks are not the corners of a quadrangle; all of the modulator must be in the picture"
                    .into(),
            )),
        }
    }

    /// Maps `point`.
    pub fn map(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let h = &self.0;
        let w = h[6] * x + h[7] * y + 1.0;
        [(h[0] * x + h[1] * y + h[2]) / w, (h[3] * x + h[4] * y + h[5]) / w]
    }
}

/// Solves the system by Gauss–Jordan elimination with partial pivoting. Returns `None` if it is singular.
fn solve(rows: &mut [[f64; 9]; 8]) -> Option<[f64; 8]> {
    for i in 0..8 {
        let pivot = (i..8).max_by(|a, b| rows[*a][i].abs().total_cmp(&rows[*b][i].abs()))?;
        rows.swap(i, pivot);
        let scale = rows[i][i];
        if scale.abs() < 1e-9 {
            return None;
        }
        rows[i].iter_mut().for_each(|v| *v /= scale);
        let line = rows[i];
        for (j, other) in rows.iter_mut().enumerate() {
            let factor = other[i];
            if j != i {
                (other.iter_mut().zip(line)).for_each(|(v, l)| *v -= factor * l);
            }
        }
    }
    let solution = std::array::from_fn(|i| rows[i][8]);
    solution.iter().all(|v| v.is_finite()).then_some(solution)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn four_points_go_where_they_shall_and_lines_stay_lines() {
        let from = [[0.0, 0.0], [1920.0, 0.0], [0.0, 1080.0], [1920.0, 1080.0]];
        let to = [[310.0, 205.0], [5720.0, 260.5], [290.0, 3390.0], [5800.0, 3301.0]];
        let map = Homography::through(from, to).unwrap();
        for (a, b) in from.into_iter().zip(to) {
            let [x, y] = map.map(a);
            assert!((x - b[0]).abs() < 1e-6 && (y - b[1]).abs() < 1e-6);
        }
        let [a, b, c] = [[100.0, 50.0], [500.0, 250.0], [1300.0, 650.0]].map(|p| map.map(p));
        let cross = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        assert!(cross.abs() < 1e-4, "{cross}");
        let back = Homography::through(to, from).unwrap().map(map.map([700.0, 300.0]));
        assert!((back[0] - 700.0).abs() < 1e-8 && (back[1] - 300.0).abs() < 1e-8);
        assert!(Homography::through([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]], from).is_err());
    }
}
