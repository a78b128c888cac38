//! Aberrations and their correction, Eq. 14–19: five Zernike terms over the pupil, for each colour and distance.
//!
//! # The pupil
//! The pupil's coordinates are frequencies: ρ·(cos θ, sin θ) = (µ, ν)/f₁, where f₁ = 1/(2·pitch) is the Nyquist
//! frequency, so that the paper's aperture is ρ ≤ 1. The five terms, in radians, with x = ρ cos θ and y = ρ sin θ:
//!
//! a₃(2ρ² − 1) + a₄(x² − y²) + 2a₅xy + (3ρ² − 2)(a₆x + a₇y)
//!
//! The coefficients describe the *correction*, which focuses the wave tightly. The aberration of the display has the
//! opposite sign. Beyond ρ = 1 the polynomials continue, as a lens does.

use crate::runtime::error::{Error, Result};
use std::f64::consts::PI;

/// The names of the five terms.
pub const TERMS: [&str; 5] = [
    "focus",
    "vertical astigmatism",
    "oblique astigmatism",
    "horizontal coma",
    "vertical coma",
];

/// The coefficients a₃ to a₇ of one colour, in radians.
pub type Coefficients = [f64; 5];

/// The largest magnitude of a coefficient, in radians. Beyond it, no padding holds the light.
const MOST: f64 = 1e4;

/// Returns the sum of Eq. 14–18, in radians, at (`x`, `y`) of the pupil, whose rim has radius 1.
pub fn terms(a: &Coefficients, x: f64, y: f64) -> f64 {
    let square = x * x + y * y;
    a[0] * (2.0 * square - 1.0)
        + a[1] * (x * x - y * y)
        + a[2] * 2.0 * x * y
        + (3.0 * square - 2.0) * (a[3] * x + a[4] * y)
}

/// The correction at one distance, with coefficients for each colour.
#[derive(Debug, Clone, PartialEq)]
pub struct Aberration {
    coefficients: Vec<Coefficients>,
}

impl Aberration {
    /// Creates a zero correction for `colours` colours.
    pub fn none(colours: usize) -> Self {
        Aberration {
            coefficients: vec![[0.0; 5]; colours],
        }
    }

    /// Creates a correction from the coefficients a₃ to a₇, in radians, of red, green and blue or of the single laser.
    ///
    /// # Errors
    /// Returns an error if there are neither three colours nor one, or if a coefficient is not finite or exceeds ±10⁴.
    pub fn new(coefficients: impl Into<Vec<[f64; 5]>>) -> Result<Self> {
        let coefficients = coefficients.into();
        if ![1, 3].contains(&coefficients.len()) {
            return Err(Error::Setting(format!(
                "an aberration of {} colours; three are right, or one",
                coefficients.len()
            )));
        }
        match coefficients.iter().flatten().find(|a| a.is_nan() || a.abs() > MOST) {
            Some(a) => Err(Error::Setting(format!(
                "an aberration coefficient of {a} rad; it must lie in -10000..=10000"
            ))),
            None => Ok(Aberration { coefficients }),
        }
    }

    /// Returns the coefficients of each colour, in radians.
    pub fn coefficients(&self) -> &[[f64; 5]] {
        &self.coefficients
    }

    /// Returns the phase of Φ, in radians, at the frequency (`mu`, `nu`), in cycles per metre.
    pub fn phase(&self, colour: usize, mu: f64, nu: f64, pitch_m: f64) -> f64 {
        let rim = 1.0 / (2.0 * pitch_m);
        terms(&self.coefficients[colour], mu / rim, nu / rim)
    }

    /// Returns the largest sideways shift of light by the correction, in metres: the maximum slope of the phase over
    /// the whole square of frequencies, divided by 2π.
    pub fn reach_m(&self, pitch_m: f64) -> f64 {
        let slope = |a: &Coefficients| {
            // Bounds |∂/∂x| and |∂/∂y| of each term on |x|, |y| ≤ 1.
            let x = 4.0 * a[0].abs() + 2.0 * a[1].abs() + 2.0 * a[2].abs();
            x + 10.0 * a[3].abs().max(a[4].abs()) + 6.0 * a[3].abs().min(a[4].abs())
        };
        let steepest = self.coefficients.iter().map(slope).fold(0.0, f64::max);
        steepest / (2.0 * PI) * 2.0 * pitch_m
    }

    /// Returns the aberration that this correction compensates.
    pub fn reversed(&self) -> Self {
        Aberration {
            coefficients: self.coefficients.iter().map(|a| a.map(|a| -a)).collect(),
        }
    }

    /// Returns `1 − t` of this correction plus `t` of `other`, which must have the same colours.
    pub fn mix(&self, other: &Self, t: f64) -> Self {
        let colours = self.coefficients.iter().zip(&other.coefficients);
        let mix = |(a, b): (&Coefficients, &Coefficients)| std::array::from_fn(|j| a[j] + (b[j] - a[j]) * t);
        Aberration {
            coefficients: colours.map(mix).collect(),
        }
    }
}

/// Corrections at calibrated distances. Between two distances they are interpolated linearly; beyond the ends, the
/// first or the last applies.
#[derive(Debug, Clone, PartialEq)]
pub struct Aberrations {
    at: Vec<(f64, Aberration)>,
}

impl Aberrations {
    /// Creates the corrections from pairs of z and correction. z is relative to the midpoint, in metres, positive
    /// toward the viewer.
    ///
    /// # Errors
    /// Returns an error if there is no correction, if a z is not finite or they do not ascend, or if the numbers of
    /// colours differ.
    pub fn new(at: Vec<(f64, Aberration)>) -> Result<Self> {
        if at.is_empty() {
            return Err(Error::Setting(
                "no distances at which aberrations are known; give at least one".into(),
            ));
        }
        if !at.iter().all(|(z, _)| z.is_finite()) || !at.is_sorted_by(|a, b| a.0 < b.0) {
            let z: Vec<_> = at.iter().map(|(z, _)| z * 1e3).collect();
            return Err(Error::Setting(format!(
                "aberrations at z = {z:?} mm; distances must ascend"
            )));
        }
        let colours = at[0].1.coefficients.len();
        if at.iter().any(|(_, a)| a.coefficients.len() != colours) {
            return Err(Error::Setting(
                "aberrations of one colour and of three; all distances must have the same".into(),
            ));
        }
        Ok(Aberrations { at })
    }

    /// Returns the calibrated distances, in metres, and their corrections.
    pub fn calibrated(&self) -> &[(f64, Aberration)] {
        &self.at
    }

    /// Returns the correction at `z_m`.
    pub fn at(&self, z_m: f64) -> Aberration {
        let next = self.at.partition_point(|(z, _)| *z <= z_m);
        match (next.checked_sub(1), self.at.get(next)) {
            (Some(i), Some((z, far))) => {
                let (z0, near) = &self.at[i];
                near.mix(far, (z_m - z0) / (z - z0))
            }
            (Some(i), None) => self.at[i].1.clone(),
            (None, _) => self.at[0].1.clone(),
        }
    }

    /// Returns the correction if it is the same at all depths. A phone can then apply it during the propagation to the
    /// modulator.
    pub fn constant(&self) -> Option<Aberration> {
        let first = &self.at[0].1;
        self.at.iter().all(|(_, a)| a == first).then(|| first.clone())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const PITCH: f64 = 8e-6;

    #[test]
    fn the_terms_are_those_of_equations_14_to_18() {
        for (rho, theta) in [(0.0, 0.3), (0.5, 1.1), (1.0, -2.0), (0.8, 3.0f64)] {
            let square: f64 = rho * rho;
            let polar = [
                2.0 * square - 1.0,
                square * (2.0 * theta).cos(),
                square * (2.0 * theta).sin(),
                (3.0 * square - 2.0) * rho * theta.cos(),
                (3.0 * square - 2.0) * rho * theta.sin(),
            ];
            for (j, expected) in polar.iter().enumerate() {
                let mut a = [0.0; 5];
                a[j] = 1.7;
                let ours = terms(&a, rho * theta.cos(), rho * theta.sin());
                assert!((ours - 1.7 * expected).abs() < 1e-12, "{j}: {ours} {expected}");
            }
        }
    }

    #[test]
    fn coefficients_run_piecewise_linearly_over_depth() {
        let of = |a: f64| Aberration::new([[a; 5], [2.0 * a; 5], [0.0; 5]]).unwrap();
        let all = Aberrations::new(vec![(-1e-3, of(1.0)), (0.0, of(2.0)), (2e-3, of(4.0))]).unwrap();
        for (z, a) in [(-5e-3, 1.0), (-1e-3, 1.0), (-0.5e-3, 1.5), (1e-3, 3.0), (9e-3, 4.0)] {
            let at = all.at(z);
            assert!((at.coefficients()[1][4] - 2.0 * a).abs() < 1e-12, "{z}: {at:?}");
        }
        assert!(all.constant().is_none());
        let same = Aberrations::new(vec![(0.0, of(1.0)), (1e-3, of(1.0))]).unwrap();
        assert_eq!(same.constant(), Some(of(1.0)));
        assert!(Aberrations::new(vec![]).is_err());
        assert!(Aberrations::new(vec![(0.0, of(1.0)), (0.0, of(1.0))]).is_err());
        assert!(Aberration::new([[f64::NAN; 5]; 3]).is_err());
    }

    #[test]
    fn no_slope_is_beyond_the_reach() {
        let cases = [
            [1.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, -2.0, 1.0, 0.0, 0.0],
            [0.3, 0.2, -0.5, 1.5, -0.7],
        ];
        for a in cases {
            let aberration = Aberration::new([a; 3]).unwrap();
            let reach = aberration.reach_m(PITCH);
            let df = 1.0 / (2.0 * PITCH) * 1e-4;
            for i in -10..=10 {
                for j in -10..=10 {
                    let (mu, nu) = (f64::from(i) / 20.0 / PITCH, f64::from(j) / 20.0 / PITCH);
                    let at = |mu: f64, nu: f64| aberration.phase(1, mu, nu, PITCH);
                    for slope in [at(mu + df, nu) - at(mu - df, nu), at(mu, nu + df) - at(mu, nu - df)] {
                        assert!((slope / (4.0 * PI * df)).abs() <= reach * 1.001, "{a:?} {i} {j}");
                    }
                }
            }
        }
    }
}
