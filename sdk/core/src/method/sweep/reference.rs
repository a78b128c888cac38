//! The naive oracle of the sweep. It processes whole planes, every plane, one step at a time, with f64 sums.

use super::filters::Filters;
use super::{MEET, Sweep, hidden, hidden_reach, optics};
use crate::Size;
use crate::display::Display;
use crate::frame::RgbdFrame;
use crate::runtime::error::Result;
use num_complex::{Complex32, Complex64};

/// Returns the hologram of `frame` at `z_m`, (C, H, W), slowly computed, with the result of
/// [`super::SweepPlan::field`].
///
/// # Errors
/// Returns the same errors as [`super::SweepPlan::new`].
pub fn field(frame: &RgbdFrame, display: &Display, sweep: Sweep, z_m: f64) -> Result<Vec<Complex32>> {
    sweep.check(display)?;
    frame.check(frame.size(), display.colours())?;
    let Size { width, height } = frame.size();
    let (rgb, depth) = frame.values();
    let size = height * width;
    let sources = hidden::reference(depth, frame.size(), hidden_reach(display));
    let mut result = Vec::with_capacity(display.colours() * size);
    for (colour, optics) in optics(display, &sweep, z_m)?.iter().enumerate() {
        let filters = Filters::new(optics, sweep.taps / 2);
        // Light may leave the frame and return, so the black border is as wide as the reach of the filters.
        let border = sweep.planes * (filters.step.len() - 1) + filters.home.len();
        let mut plane = Plane::new(Size {
            width: width + 2 * border,
            height: height + 2 * border,
        });
        for k in (0..sweep.planes).rev() {
            plane.convolve(&filters.step);
            for layer in (0..=sweep.hidden_layers).rev() {
                for pixel in 0..size {
                    let source = match layer {
                        0 => pixel,
                        _ => match sources[(layer - 1) * size + pixel] {
                            hidden::NOTHING => continue,
                            source => source as usize,
                        },
                    };
                    let share = share(&sweep, depth[source], k);
                    let light = f64::from(rgb[colour * size + source]);
                    let value = &mut plane.values[(pixel / width + border) * plane.width + pixel % width + border];
                    *value = *value * (1.0 - share) + share * light;
                }
            }
        }
        plane.convolve(&filters.home);
        for y in border..border + height {
            for x in border..border + width {
                let value = plane.values[y * plane.width + x];
                result.push(Complex32::new(value.re as f32, value.im as f32));
            }
        }
    }
    Ok(result)
}

/// Returns the share that a point of normalized `depth` blocks and emits on plane `k`.
pub(super) fn share(sweep: &Sweep, depth: f32, k: usize) -> f64 {
    let behind = f64::from(sweep.position(depth)) - k as f64;
    let meet = f64::from(MEET);
    let share = if behind >= 0.0 {
        (1.0 - behind) / meet
    } else {
        (1.0 + behind) / (1.0 - meet)
    };
    share.clamp(0.0, 1.0)
}

struct Plane {
    height: usize,
    width: usize,
    values: Vec<Complex64>,
}

impl Plane {
    fn new(size: Size) -> Self {
        let Size { width, height } = size;
        Plane {
            height,
            width,
            values: vec![Complex64::ZERO; height * width],
        }
    }

    /// Convolves with a filter along both axes. Values beyond the edges are black.
    fn convolve(&mut self, taps: &[[f32; 2]]) {
        for (step, length) in [(1, self.width), (self.width, self.height)] {
            let position = |i: usize| {
                if step == 1 { i % self.width } else { i / self.width }
            };
            let filtered = (0..self.values.len()).map(|i| {
                let mut sum = Complex64::ZERO;
                for (j, tap) in taps.iter().enumerate() {
                    let tap = Complex64::new(tap[0].into(), tap[1].into());
                    if position(i) + j < length {
                        sum += tap * self.values[i + j * step];
                    }
                    if j > 0 && position(i) >= j {
                        sum += tap * self.values[i - j * step];
                    }
                }
                sum
            });
            self.values = filtered.collect();
        }
    }
}
