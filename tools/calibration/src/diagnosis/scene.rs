//! The forward model: what a camera sees of a hologram in a given [`State`].

use super::state::{Chroma, State};
use crate::diagnosis::Shown;
use ndarray::Array2;
use num_complex::{Complex32, Complex64};
use phasefront::Size;
use phasefront::target::{Aberration, Response};
use phasefront_core::display::levels::Levels;
use phasefront_core::display::panel::PanelPlan;
use phasefront_core::optics::aperture;
use phasefront_core::optics::asm::{self, Padding, Transfer};
use phasefront_core::optics::fft::{Fft2, frequency};
use phasefront_io::Result;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// A rectangle of the modulator, in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rect {
    pub x: usize,
    pub y: usize,
    pub size: Size,
}

/// The parts of the light, relative to each other: modulated, not modulated, and modulated with the opposite phase.
pub(super) type Parts = [Complex64; 3];

/// The hologram's light in a part of the modulator.
pub(super) struct Scene<'a> {
    shown: &'a Shown<'a>,
    response: Response,
    panel: Option<PanelPlan>,
    aberration: Option<Aberration>,
    /// The part of the modulator whose light is compared.
    pub roi: Rect,
    /// The part whose light reaches it.
    field: Rect,
    fft: Fft2,
}

impl<'a> Scene<'a> {
    /// Plans the light of `roi` at distances up to `reach_m` from the modulator.
    pub(super) fn new(shown: &'a Shown<'a>, roi: Rect, reach_m: f64) -> Result<Self> {
        let display = &shown.target.display;
        let (pitch_m, longest_m) = (display.pitch_m(), display.longest_wavelength_m());
        let aberration = shown.target.correction.as_ref().map(Aberration::reversed);
        let reach = asm::reach_m(reach_m, longest_m, pitch_m) + aberration.as_ref().map_or(0.0, |a| a.reach_m(pitch_m));
        let reach = (reach / pitch_m).ceil() as usize + 8;
        let along = |from: usize, length: usize, most: usize| {
            let first = from.saturating_sub(reach);
            (first, (from + length + reach).min(most) - first)
        };
        let size = shown.size;
        let ((x, width), (y, height)) = (
            along(roi.x, roi.size.width, size.width),
            along(roi.y, roi.size.height, size.height),
        );
        let field = Rect {
            x,
            y,
            size: Size { width, height },
        };
        let padded = asm::padded_size(field.size, pitch_m, longest_m, reach_m, Padding::Reach)?;
        Ok(Scene {
            shown,
            response: shown.target.response.clone().centred(size)?,
            panel: PanelPlan::new(&shown.target.panel, display, size)?,
            aberration,
            roi,
            field,
            fft: Fft2::new(field.size, padded),
        })
    }

    /// Returns the level that arrives at pixel (`y`, `x`) of the modulator for `laser`.
    fn arriving(&self, state: &State, laser: usize, y: usize, x: usize) -> f64 {
        let Size { width, height } = self.shown.size;
        let from = if state.range.len() == 3 {
            state.order[laser]
        } else {
            laser
        };
        let sent = |y: isize, x: isize| {
            let (y, x) = (y.clamp(0, height as isize - 1), x.clamp(0, width as isize - 1));
            match state.chroma {
                Chroma::Own => self.sent(from, y as usize, x as usize),
                Chroma::Shared { wide, high } => self.shared(from, (y as usize, x as usize), (wide, high)),
            }
        };
        let [h, v] = state.taps;
        let level = if state.zoom != 1.0 {
            let place = |at: usize, n: usize| (at as f64 + 0.5 - n as f64 / 2.0) / state.zoom + n as f64 / 2.0 - 0.5;
            let (v, u) = (place(y, height), place(x, width));
            if v < -0.5 || u < -0.5 || v > height as f64 - 0.5 || u > width as f64 - 0.5 {
                return 0.0;
            }
            let (y0, x0) = (v.floor(), u.floor());
            let row = |y: f64| {
                let [a, b] = [0, 1].map(|right| sent(y as isize, x0 as isize + right));
                a + (b - a) * (u - x0)
            };
            row(y0) + (row(y0 + 1.0) - row(y0)) * (v - y0)
        } else if h != 0.0 || v != 0.0 {
            let (y, x) = (y as isize, x as isize);
            let row = |y: isize| sent(y, x) * (1.0 - 2.0 * h) + h * (sent(y, x - 1) + sent(y, x + 1));
            row(y) * (1.0 - 2.0 * v) + v * (row(y - 1) + row(y + 1))
        } else {
            sent(y as isize, x as isize)
        };
        let most = f64::from((1u32 << self.shown.target.display.bits()) - 1);
        let level = level.clamp(0.0, most);
        if state.tone == 1.0 {
            level
        } else {
            most * (level / most).powf(state.tone)
        }
    }

    fn sent(&self, laser: usize, y: usize, x: usize) -> f64 {
        let Size { width, height } = self.shown.size;
        let at = (laser * height + y) * width + x;
        match self.shown.levels {
            Levels::Bytes(levels) => levels[at].into(),
            Levels::Words(levels) => levels[at].into(),
        }
    }

    /// Returns a level after a link whose pixels share colours.
    fn shared(&self, laser: usize, (y, x): (usize, usize), (wide, high): (usize, usize)) -> f64 {
        let luma = |y: usize, x: usize| {
            let [r, g, b] = [0, 1, 2].map(|laser| self.sent(laser, y, x));
            (0.2126 * r + 0.7152 * g + 0.0722 * b).round()
        };
        let mean = |laser: usize, over: f64| {
            let Size { width, height } = self.shown.size;
            let mut sum = 0.0;
            for v in y / high * high..y / high * high + high {
                for u in x / wide * wide..x / wide * wide + wide {
                    let (v, u) = (v.min(height - 1), u.min(width - 1));
                    sum += (self.sent(laser, v, u) - luma(v, u)) / over;
                }
            }
            (sum / (wide * high) as f64).round()
        };
        let (cb, cr) = (|| mean(2, 1.8556), || mean(0, 1.5748));
        luma(y, x)
            + match laser {
                0 => 1.5748 * cr(),
                1 => -0.1873 * cb() - 0.4681 * cr(),
                _ => 1.8556 * cb(),
            }
    }

    fn phase(&self, laser: usize, level: f64, y: usize, x: usize) -> f64 {
        let Size { width, height } = self.shown.size;
        match (&self.response, self.shown.levels) {
            (Response::Linear { .. }, _) | (_, Levels::Words(_)) => {
                level * TAU / f64::from(1u32 << self.shown.target.display.bits())
            }
            (response, _) => response
                .phase(level.round() as u8, (laser * height + y) * width + x)
                .into(),
        }
    }

    /// Returns the field of `laser` at the state's z behind the aperture, over the field's rectangle. `parts` weighs
    /// its parts; `ghost` is the amplitude of the state's ghost image.
    pub(super) fn field(&self, state: &State, laser: usize, parts: Parts, ghost: Complex64) -> Vec<Complex32> {
        let Size { width, height } = self.field.size;
        let sign = if state.inverted { -1.0 } else { 1.0 } * state.range[laser];
        let mut plane = vec![Complex32::ZERO; width * height];
        plane.par_chunks_exact_mut(width).enumerate().for_each(|(row, values)| {
            for (column, value) in values.iter_mut().enumerate() {
                let (y, x) = (self.field.y + row, self.field.x + column);
                let level = self.arriving(state, laser, y, x);
                let modulated = Complex64::from_polar(1.0, sign * self.phase(laser, level, y, x));
                let mut sum = parts[0] * modulated + parts[1] + parts[2] * modulated.conj();
                if let Some(panel) = &self.panel {
                    let at = (laser * self.shown.size.height + y) * self.shown.size.width + x;
                    sum *= Complex64::from_polar(1.0, -f64::from(panel.added(at)));
                }
                *value = Complex32::new(sum.re as f32, sum.im as f32);
            }
        });
        self.propagate(&mut plane, state, laser, ghost);
        plane
    }

    fn propagate(&self, plane: &mut [Complex32], state: &State, laser: usize, ghost: Complex64) {
        let display = &self.shown.target.display;
        let (pitch_m, wavelength_m) = (display.pitch_m(), display.wavelengths_m()[laser]);
        let (padded, distance_m) = (self.fft.padded_size(), state.z_m - display.offset_m());
        let transfer = match &self.aberration {
            None => Transfer::new(padded, pitch_m, wavelength_m, distance_m, |_, _| true),
            Some(aberration) => Transfer::corrected(padded, pitch_m, wavelength_m, distance_m, |mu, nu| {
                aberration.phase(laser, mu, nu, pitch_m)
            }),
        };
        let [right, down] = state.ghost_shift;
        let filter = |kx: usize, column: &mut [Complex32]| {
            transfer.apply(kx, column);
            let fx = frequency(kx, padded.width);
            for (ky, value) in column.iter_mut().enumerate() {
                let fy = frequency(ky, padded.height);
                if !aperture::passes(fx, fy, display.aperture_radius()) {
                    *value = Complex32::ZERO;
                } else if ghost != Complex64::ZERO {
                    let sine2 = (fx * fx + fy * fy) * (wavelength_m / pitch_m).powi(2);
                    let path = state.ghost_path_m / wavelength_m * ((1.0 - sine2).max(0.0).sqrt() - 1.0);
                    let factor = 1.0 + ghost * Complex64::from_polar(1.0, TAU * (path - fx * right - fy * down));
                    *value *= Complex32::new(factor.re as f32, factor.im as f32);
                }
            }
        };
        self.fft.convolve(plane, filter, &mut self.fft.convolve_scratch());
    }

    /// Returns the light of `laser` that a camera sees, (H, W) of the rectangle that is compared.
    pub(super) fn light(&self, state: &State, laser: usize) -> Array2<f32> {
        let parts = [Complex64::ONE, state.undiffracted[laser], state.conjugate[laser]];
        let field = self.field(state, laser, parts, state.ghost[laser]);
        self.blurred(field.iter().map(|value| value.norm_sqr()).collect(), state.blur)
    }

    /// Returns values over the field's rectangle blurred as by the camera, cropped to the one that is compared.
    pub(super) fn blurred(&self, values: Vec<f32>, sigma: f64) -> Array2<f32> {
        let Size { width, height } = self.field.size;
        let reach = (3.0 * sigma).ceil() as isize;
        let taps: Vec<f32> = (-reach..=reach)
            .map(|at| (-(at as f64 / sigma).powi(2) / 2.0).exp() as f32)
            .collect();
        let sum: f32 = taps.iter().sum();
        let clamped =
            |at: usize, i: usize, n: usize| (at as isize + i as isize - reach).clamp(0, n as isize - 1) as usize;
        let (left, top) = (self.roi.x - self.field.x, self.roi.y - self.field.y);
        let (wide, high) = (self.roi.size.width, self.roi.size.height);
        let mut rows = vec![0.0f32; height * wide];
        rows.par_chunks_exact_mut(wide).enumerate().for_each(|(y, row)| {
            for (x, value) in row.iter_mut().enumerate() {
                let tap = |(i, tap): (usize, &f32)| tap * values[y * width + clamped(left + x, i, width)];
                *value = taps.iter().enumerate().map(tap).sum::<f32>() / sum;
            }
        });
        let mut out = Array2::zeros((high, wide));
        let lines = out.as_slice_mut().expect("standard layout");
        lines.par_chunks_exact_mut(wide).enumerate().for_each(|(y, line)| {
            for (i, tap) in taps.iter().enumerate() {
                let row = &rows[clamped(top + y, i, height) * wide..][..wide];
                line.iter_mut().zip(row).for_each(|(to, from)| *to += tap / sum * from);
            }
        });
        out
    }

    /// Returns the size of the hologram.
    pub(super) fn whole(&self) -> Size {
        self.shown.size
    }

    /// Returns the size of the field's rectangle, and the left and upper distance to the one that is compared.
    pub(super) fn around(&self) -> (Size, [usize; 2]) {
        (self.field.size, [self.roi.x - self.field.x, self.roi.y - self.field.y])
    }
}
