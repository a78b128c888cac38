//! Chromatic registration. Lenses image the colours at slightly different positions and sizes, so each colour's field
//! at the modulator is shifted and scaled to compensate.
//!
//! A field is band-limited to the aperture, so values between pixels are interpolated with a windowed sinc (Lanczos,
//! four lobes), first along rows, then along columns.

use crate::Size;
use crate::display::check_colours;
use crate::parallel::prelude::*;
use crate::runtime::error::{Error, Result};
use num_complex::Complex32;

/// The shift and the scale of each colour, in the order red, green, blue. The default changes nothing.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Registration {
    /// The shifts right and down, in modulator pixels: one for each colour, or empty for no shifts.
    pub shift_px: Vec<[f64; 2]>,
    /// The scales about the middle of the hologram: one for each colour, or empty for no scaling.
    pub scale: Vec<f64>,
}

/// The number of values on each side that an interpolated value depends on.
const REACH: usize = 4;

impl Registration {
    /// Returns whether any colour is shifted or scaled.
    pub fn moves(&self) -> bool {
        self.shift_px.iter().any(|shift| *shift != [0.0; 2]) || self.scale.iter().any(|scale| *scale != 1.0)
    }

    /// Checks the shifts and scales for a display with `colours` colours.
    ///
    /// # Errors
    /// Returns an error if the number of colours differs, a shift exceeds 1000 pixels, or a scale is outside 0.8 to
    /// 1.25.
    pub(crate) fn check(&self, colours: usize) -> Result<()> {
        for (what, count) in [("shift_px", self.shift_px.len()), ("scale", self.scale.len())] {
            if count > 0 {
                check_colours(what, count, colours)?;
            }
        }
        for shift in self.shift_px.as_flattened() {
            if !(-1000.0..=1000.0).contains(shift) {
                return Err(Error::Setting(format!(
                    "a colour's shift is {shift} pixels; it must lie in -1000..=1000"
                )));
            }
        }
        for scale in &self.scale {
            if !(0.8..=1.25).contains(scale) {
                return Err(Error::Setting(format!(
                    "a colour's scale is {scale}; it must lie in 0.8..=1.25"
                )));
            }
        }
        Ok(())
    }
}

/// A plan for one shape. It is immutable and can be shared between threads.
#[derive(Debug, Clone)]
pub(crate) struct RegistrationPlan {
    height: usize,
    width: usize,
    /// The x and y axes of each colour, or `None` for a colour that does not move.
    axes: Vec<Option<[Axis; 2]>>,
}

/// The source values of each value of an axis.
#[derive(Debug, Clone)]
struct Axis(Vec<Taps>);

#[derive(Debug, Clone, Copy)]
struct Taps {
    /// The first source value, which may lie before the axis.
    first: isize,
    weights: [f32; 2 * REACH],
}

impl RegistrationPlan {
    /// Plans the registration of `colours` planes of `size`, or returns `None` if no colour moves.
    ///
    /// # Errors
    /// Returns the errors of `Registration::check`.
    pub(crate) fn new(Size { width, height }: Size, colours: usize, of: &Registration) -> Result<Option<Self>> {
        of.check(colours)?;
        if !of.moves() {
            return Ok(None);
        }
        let axes = |colour: usize| {
            let [right, down] = of.shift_px.get(colour).copied().unwrap_or_default();
            let scale = of.scale.get(colour).copied().unwrap_or(1.0);
            let moves = (right, down, scale) != (0.0, 0.0, 1.0);
            moves.then(|| [Axis::new(width, right, scale), Axis::new(height, down, scale)])
        };
        Ok(Some(RegistrationPlan {
            height,
            width,
            axes: (0..colours).map(axes).collect(),
        }))
    }

    /// Shifts and scales `plane`, (H, W), of `colour` in place. Values from outside the plane are 0. `scratch` has the
    /// same length as `plane`.
    ///
    /// # Panics
    /// Panics if the length of `plane` or `scratch` differs from the plan.
    pub(crate) fn apply(&self, colour: usize, plane: &mut [Complex32], scratch: &mut [Complex32]) {
        assert!(plane.len() == self.height * self.width && scratch.len() == plane.len());
        let Some([along_x, along_y]) = &self.axes[colour] else {
            return;
        };
        let rows = scratch.par_chunks_exact_mut(self.width);
        rows.zip(plane.par_chunks_exact(self.width)).for_each(|(out, row)| {
            for (value, taps) in out.iter_mut().zip(&along_x.0) {
                *value = taps.sum(row.len(), |x| row[x]);
            }
        });
        let moved: &[Complex32] = scratch;
        let rows = plane.par_chunks_exact_mut(self.width);
        rows.zip(along_y.0.par_iter()).for_each(|(row, taps)| {
            for (x, value) in row.iter_mut().enumerate() {
                *value = taps.sum(self.height, |y| moved[y * self.width + x]);
            }
        });
    }
}

impl Axis {
    fn new(length: usize, shift: f64, scale: f64) -> Self {
        let middle = (length as f64 - 1.0) / 2.0;
        let taps = |at: usize| {
            let from = (at as f64 - middle - shift) / scale + middle;
            let first = from.floor() as isize - (REACH as isize - 1);
            let mut weights = std::array::from_fn(|tap| lanczos(from - (first + tap as isize) as f64));
            let sum: f64 = weights.iter().sum();
            weights.iter_mut().for_each(|weight| *weight /= sum);
            Taps {
                first,
                weights: weights.map(|weight| weight as f32),
            }
        };
        Axis((0..length).map(taps).collect())
    }
}

impl Taps {
    fn sum(&self, length: usize, value: impl Fn(usize) -> Complex32) -> Complex32 {
        let mut sum = Complex32::ZERO;
        for (tap, weight) in self.weights.iter().enumerate() {
            let at = self.first + tap as isize;
            if (0..length as isize).contains(&at) {
                sum += value(at as usize) * *weight;
            }
        }
        sum
    }
}

/// Returns sinc(x)·sinc(x/REACH) for |x| < REACH, else 0.
fn lanczos(x: f64) -> f64 {
    let sinc = |x: f64| {
        if x == 0.0 {
            1.0
        } else {
            (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x)
        }
    };
    if x.abs() < REACH as f64 {
        sinc(x) * sinc(x / REACH as f64)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Returns a field around the middle whose phase changes by up to a quarter turn between neighbouring pixels.
    fn field(x: f64, y: f64) -> Complex32 {
        let amplitude = (-(x * x + 2.0 * y * y) / 300.0).exp();
        Complex32::from_polar(amplitude as f32, (0.8 * x - 0.5 * y + 0.01 * x * y) as f32)
    }

    #[test]
    fn colours_go_where_they_are_told() {
        let (height, width) = (61, 80);
        let of = Registration {
            shift_px: vec![[0.0; 2], [3.25, -1.5], [-2.0, 4.0]],
            scale: vec![1.0, 1.02, 1.0],
        };
        let plan = RegistrationPlan::new(Size { width, height }, 3, &of).unwrap().unwrap();
        let plane: Vec<Complex32> = (0..height * width)
            .map(|at| field((at % width) as f64 - 39.5, (at / width) as f64 - 30.0))
            .collect();
        let mut scratch = vec![Complex32::ZERO; plane.len()];
        let alone = Registration {
            shift_px: vec![of.shift_px[1]],
            scale: vec![of.scale[1]],
        };
        let alone = RegistrationPlan::new(Size { width, height }, 1, &alone)
            .unwrap()
            .unwrap();
        for colour in 0..3 {
            let mut moved = plane.clone();
            plan.apply(colour, &mut moved, &mut scratch);
            if colour == 1 {
                let mut other = plane.clone();
                alone.apply(0, &mut other, &mut scratch);
                assert_eq!(other, moved);
            }
            let ([right, down], scale) = (of.shift_px[colour], of.scale[colour]);
            let worst = (0..height * width)
                .filter(|at| (8..height - 8).contains(&(at / width)) && (8..width - 8).contains(&(at % width)))
                .map(|at| {
                    let x = ((at % width) as f64 - 39.5 - right) / scale;
                    let y = ((at / width) as f64 - 30.0 - down) / scale;
                    (moved[at] - field(x, y)).norm()
                })
                .fold(0.0, f32::max);
            // Shifts by whole pixels copy values.
            let most = if colour == 1 { 0.02 } else { 1e-5 };
            assert!(worst < most, "{colour}: {worst}");
        }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let of = |shift_px: &[[f64; 2]], scale: &[f64]| {
            let (shift_px, scale) = (shift_px.into(), scale.into());
            RegistrationPlan::new(Size { width: 4, height: 4 }, 3, &Registration { shift_px, scale })
        };
        for good in [of(&[], &[]), of(&[[0.0; 2]; 3], &[1.0; 3])] {
            assert!(good.unwrap().is_none());
        }
        for bad in [
            of(&[], &[1.0, 2.0, 1.0]),
            of(&[[f64::NAN, 0.0]; 3], &[]),
            of(&[[1.0, 0.0]], &[]),
        ] {
            assert!(bad.is_err());
        }
    }
}
