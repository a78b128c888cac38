//! The naive oracle of the sweep. It processes whole planes, every plane, one step at a time, with f64 sums.

use super::filters::Filters;
use super::{Sweep, hidden, hidden_reach, optics, plane_of_depth};
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
    frame.check(frame.shape(), display.colours())?;
    let (height, width) = frame.shape();
    let (rgb, depth) = frame.values();
    let size = height * width;
    let sources = hidden::reference(depth, height, width, hidden_reach(display));
    let mut result = Vec::with_capacity(display.colours() * size);
    for (colour, optics) in optics(display, &sweep, z_m)?.iter().enumerate() {
        let filters = Filters::new(optics, sweep.taps / 2);
        // Light may leave the frame and return, so the black border is as wide as the reach of the filters.
        let border = sweep.planes * (filters.step.len() - 1) + filters.home.len();
        let mut plane = Plane::new(height + 2 * border, width + 2 * border);
        for k in (0..sweep.planes).rev() {
            plane.convolve(&filters.step);
            let middle = (k as f64 + 0.5) / sweep.planes as f64;
            let mut carried = Vec::new();
            for layer in (0..=sweep.hidden_layers).rev() {
                for pixel in 0..size {
                    let source = match layer {
                        0 => pixel,
                        _ => match sources[(layer - 1) * size + pixel] {
                            hidden::NOTHING => continue,
                            source => source as usize,
                        },
                    };
                    if plane_of_depth(depth[source], sweep.planes) == k {
                        let (y, x) = (pixel / width + border, pixel % width + border);
                        let value = f64::from(rgb[colour * size + source]);
                        plane.values[y * plane.width + x] = value.into();
                        let behind = f64::from(depth[source]) - middle;
                        carried.push((y, x, f64::from(filters.carry) * value * behind));
                    }
                }
            }
            for (y, x, light) in carried {
                plane.values[y * plane.width + x].im -= 4.0 * light;
                for (y, x) in [(y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)] {
                    plane.values[y * plane.width + x].im += light;
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

struct Plane {
    height: usize,
    width: usize,
    values: Vec<Complex64>,
}

impl Plane {
    fn new(height: usize, width: usize) -> Self {
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
