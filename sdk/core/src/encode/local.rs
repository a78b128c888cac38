//! Local correction of a phase map: what double phase shows behind the aperture is drawn toward the field that is
//! wanted, by the aperture's filter alone. No propagation, no transform, any offset.
//!
//! With e the phasors that the modulator shows, |e| = 1, L the light that falls on it, and g the wanted field over the
//! scale, a step is
//!
//!   z = L·e + B∗(g − L·e),  e' = z/|z|,
//!
//! the projection of Gerchberg and Saxton (Optik 35, 237, 1972) with a short filter B in the aperture's place, which
//! cuts off no more than the corners of the spectrum's square, where the checkerboard's copy of the picture lies: its
//! circle in 7×7 taps ([`LocalFilter`]). At the frame's edges g − L·e is mirrored about the last pixel,
//! which is not repeated: so the checkerboard goes on.
//!
//! Rows flow through all steps at once: a step's row needs three rows of the step before on either side, so a part of
//! the frame keeps seven rows a step and begins that much earlier.

use super::start::{Start, StartScratch};
use num_complex::{Complex32, Complex64};
use phasefront_kernels::wide;
use std::f64::consts::PI;
use std::ops::Range;

/// Rows and columns to either side that a step looks at.
pub(super) const REACH: usize = 3;
/// Rows that a step keeps of the one before.
const KEPT: usize = 2 * REACH + 1;

/// Most steps. After the second they bring nothing.
pub(super) const MAX_STEPS: usize = 8;

/// B in 7×7 taps: the aperture's circle by least squares, with 1 at frequency 0 and 0 at (½, ½). The zero counts most:
/// there stands the light of the checkerboard, 10⁵ times the spectrum's mean.
#[derive(Debug, Clone, Copy)]
pub struct LocalFilter {
    /// At (dy, dx), alike in all quadrants and about the diagonals.
    taps: [[f32; REACH + 1]; REACH + 1],
}

impl LocalFilter {
    /// At (dy, dx), from 0 to 3 each.
    pub fn taps(&self) -> &[[f32; REACH + 1]; REACH + 1] {
        &self.taps
    }

    /// Of an aperture of `radius`, 1 reaching the Nyquist frequency.
    ///
    /// The circle's own taps are k(ρ) = R·J₁(πRρ)/(2ρ); what they lack at the two frequencies is added as a constant
    /// and as a checkerboard, which is least in their squares.
    pub fn of_aperture(radius: f64) -> Self {
        let circle = |y: usize, x: usize| match (x * x + y * y) as f64 {
            0.0 => PI * radius * radius / 4.0,
            square => radius * libm::j1(PI * radius * square.sqrt()) / (2.0 * square.sqrt()),
        };
        let sign = |y: usize, x: usize| if (x + y).is_multiple_of(2) { 1.0 } else { -1.0 };
        let reach = REACH as isize;
        let all = (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| (y.unsigned_abs(), x.unsigned_abs())));
        let (sum, turned) = all.fold((0.0, 0.0), |(sum, turned), (y, x)| {
            (sum + circle(y, x), turned + sign(y, x) * circle(y, x))
        });
        // [N 1; 1 N]·[even; odd] = [1 − sum; −turned] for N taps.
        let n = KEPT as f64 * KEPT as f64;
        let even = (n * (1.0 - sum) + turned) / (n * n - 1.0);
        let odd = (-n * turned - (1.0 - sum)) / (n * n - 1.0);
        let tap = |y, x| (circle(y, x) + even + odd * sign(y, x)) as f32;
        LocalFilter {
            taps: std::array::from_fn(|y| std::array::from_fn(|x| tap(y, x))),
        }
    }
}

/// What a part of a plane is corrected toward.
#[derive(Clone, Copy)]
pub(super) struct Wanted<'a> {
    /// (H, W), as the modulator's field shall be.
    pub(super) plane: &'a [Complex32],
    /// 1 over the amplitude that full light stands for.
    pub(super) per_scale: f32,
}

/// Working memory of a part of a plane.
pub(super) struct LocalScratch {
    /// For each step, the rows of g − L·e in a ring, with REACH empty columns on either side.
    rings: Vec<Complex32>,
    /// Sums of the rows 0, 1, 2, 3 above and below.
    sums: Vec<Complex32>,
    /// The start's row, and a step's.
    row: Vec<Complex32>,
    /// The light on a row.
    light: Vec<f32>,
}

impl LocalScratch {
    /// For `steps` ≥ 1 of rows of `width`.
    pub(super) fn new(steps: usize, width: usize) -> Self {
        let padded = width + 2 * REACH;
        LocalScratch {
            rings: vec![Complex32::ZERO; steps * KEPT * padded],
            sums: vec![Complex32::ZERO; (REACH + 1) * padded],
            row: vec![Complex32::ZERO; width],
            light: vec![1.0; width],
        }
    }
}

impl LocalFilter {
    /// Corrects rows `rows` of a plane that begins as `start`, and hands each to `then`: its index and the field whose
    /// phase is shown.
    pub(super) fn correct(
        &self,
        rows: Range<usize>,
        start: &Start<'_>,
        wanted: Wanted<'_>,
        of_start: &mut StartScratch,
        scratch: &mut LocalScratch,
        mut then: impl FnMut(usize, &[Complex32]),
    ) {
        let LocalScratch {
            rings,
            sums,
            row,
            light,
        } = scratch;
        let Wanted { plane, per_scale } = wanted;
        let (height, width) = (start.height, row.len());
        let padded = width + 2 * REACH;
        let steps = rings.len() / (KEPT * padded);
        let first = rows.start.saturating_sub(REACH * steps);
        of_start.begin(start, first);
        for front in first..rows.end + REACH * steps {
            if front < height {
                start.row(front, row, of_start);
                start.light_row(front, light);
                let goal = &plane[front * width..][..width];
                let to = &mut rings[front % KEPT * padded..][..padded];
                let sign = if front.is_multiple_of(2) { 1.0 } else { -1.0 };
                wide!(begin(row, goal, light, per_scale, sign, &mut to[REACH..][..width]));
                mirror_ends(to);
            }
            for step in 1..=steps {
                // What the rows that are asked for need of this step.
                let reach = REACH * (steps - step);
                let Some(y) = front.checked_sub(REACH * step) else {
                    break;
                };
                if y + reach < rows.start || y >= (rows.end + reach).min(height) {
                    continue;
                }
                let (before, after) = rings.split_at_mut(step * KEPT * padded);
                let ring = &before[(step - 1) * KEPT * padded..];
                let of_ring = |at: isize| &ring[mirrored(at, height) % KEPT * padded..][..padded];
                let around = std::array::from_fn(|i| {
                    let (y, i) = (y as isize, i as isize + 1);
                    [of_ring(y - i), of_ring(y + i)]
                });
                let goal = &plane[y * width..][..width];
                wide!(self.draw(of_ring(y as isize), around, goal, per_scale, sums, row));
                if step < steps {
                    start.light_row(y, light);
                    let to = &mut after[y % KEPT * padded..][..padded];
                    wide!(project(row, goal, light, per_scale, &mut to[REACH..][..width]));
                    mirror_ends(to);
                } else {
                    then(y, row);
                }
            }
        }
    }

    /// z = g − d + B∗d of a row, d = g − L·e being that of the row and of those around it: [above, below], the nearest
    /// first.
    #[inline(always)]
    fn draw(
        &self,
        own: &[Complex32],
        around: [[&[Complex32]; 2]; REACH],
        goal: &[Complex32],
        per_scale: f32,
        sums: &mut [Complex32],
        out: &mut [Complex32],
    ) {
        let padded = own.len();
        let sums: &mut [f32] = bytemuck::cast_slice_mut(sums);
        let (copy, rest) = sums.split_at_mut(2 * padded);
        copy.copy_from_slice(bytemuck::cast_slice(own));
        for (sum, [above, below]) in rest.chunks_exact_mut(2 * padded).zip(around) {
            let above: &[f32] = bytemuck::cast_slice(above);
            let below: &[f32] = bytemuck::cast_slice(below);
            for ((sum, above), below) in sum.iter_mut().zip(above).zip(below) {
                *sum = above + below;
            }
        }
        let goal: &[f32] = bytemuck::cast_slice(goal);
        let out: &mut [f32] = bytemuck::cast_slice_mut(out);
        let n = out.len();
        let own = &copy[2 * REACH..][..n];
        for ((out, goal), own) in out.iter_mut().zip(goal).zip(own) {
            *out = goal * per_scale - own;
        }
        for (row, taps) in [&*copy].into_iter().chain(rest.chunks_exact(2 * padded)).zip(self.taps) {
            // Runs at 0, 1, 2, 3 columns to the left and to the right.
            let left = |i: usize| &row[2 * (REACH - i)..][..n];
            let right = |i: usize| &row[2 * (REACH + i)..][..n];
            let (l1, r1, l2, r2) = (left(1), right(1), left(2), right(2));
            let (middle, l3, r3) = (left(0), left(3), right(3));
            for (i, out) in out.iter_mut().enumerate() {
                let near = middle[i] * taps[0] + (l1[i] + r1[i]) * taps[1];
                let far = (l2[i] + r2[i]) * taps[2] + (l3[i] + r3[i]) * taps[3];
                *out += near + far;
            }
        }
    }
}

/// The pixel of `count` that stands for `at`, which may lie outside: mirrored about the first and the last.
fn mirrored(at: isize, count: usize) -> usize {
    let period = 2 * (count as isize - 1).max(1);
    let at = at.rem_euclid(period);
    at.min(period - at).min(count as isize - 1) as usize
}

/// Fills the columns outside of a row.
fn mirror_ends(row: &mut [Complex32]) {
    let width = row.len() - 2 * REACH;
    for i in 0..REACH as isize {
        let (left, right) = (-1 - i, width as isize + i);
        for at in [left, right] {
            row[(at + REACH as isize) as usize] = row[REACH + mirrored(at, width)];
        }
    }
}

/// g − L·e of a row whose phasors are those of double phase: (f/|f|)·(c ± i·√(1 − c²)), c = |f| over the scale.
#[inline(always)]
fn begin(field: &[Complex32], goal: &[Complex32], light: &[f32], per_scale: f32, sign: f32, to: &mut [Complex32]) {
    const RUN: usize = 16;
    let signs: [f32; RUN] = std::array::from_fn(|x| if x % 2 == 0 { sign } else { -sign });
    let runs = (field.chunks(RUN).zip(goal.chunks(RUN))).zip(light.chunks(RUN));
    for (((field, goal), light), to) in runs.zip(to.chunks_mut(RUN)) {
        let values = (field.iter().zip(goal)).zip(light.iter().zip(signs));
        for (((f, g), (light, sign)), to) in values.zip(to) {
            let norm = (f.re * f.re + f.im * f.im).sqrt();
            let cosine = (norm * per_scale).min(1.0);
            let sine = sign * (1.0 - cosine * cosine).sqrt();
            let dark = norm <= f32::MIN_POSITIVE;
            let inverse = 1.0 / if dark { 1.0 } else { norm };
            let (re, im) = (if dark { 1.0 } else { f.re * inverse }, f.im * inverse);
            *to = counted(
                g.re * per_scale - light * (re * cosine - im * sine),
                g.im * per_scale - light * (re * sine + im * cosine),
            );
        }
    }
}

/// What is missing at a pixel. Where that is no number nothing is, so that its neighbours are corrected all the same.
#[inline(always)]
fn counted(re: f32, im: f32) -> Complex32 {
    let is = re * re + im * im < f32::INFINITY;
    Complex32::new(if is { re } else { 0.0 }, if is { im } else { 0.0 })
}

/// g − L·z/|z| of a row.
#[inline(always)]
fn project(drawn: &[Complex32], goal: &[Complex32], light: &[f32], per_scale: f32, to: &mut [Complex32]) {
    let values = drawn.iter().zip(goal).zip(light);
    for (((z, g), light), to) in values.zip(to) {
        let square = (z.re * z.re + z.im * z.im).max(f32::MIN_POSITIVE);
        let length = light / square.sqrt();
        *to = counted(g.re * per_scale - z.re * length, g.im * per_scale - z.im * length);
    }
}

/// The same by sums over whole planes in f64: the oracle. `start`, (H, W), is what double phase begins with, divided by
/// the light; `goal` is what shall be shown, both over the scale; `light` falls on each pixel. Gives z of the last
/// step.
pub fn reference(
    filter: &LocalFilter,
    (height, width): (usize, usize),
    start: &[Complex64],
    goal: &[Complex64],
    light: &[f64],
    steps: usize,
) -> Vec<Complex64> {
    let mut shown: Vec<Complex64> = (start.iter().zip(light).enumerate())
        .map(|(i, (f, light))| {
            let half = f.norm().min(1.0).acos();
            let even = (i / width + i % width).is_multiple_of(2);
            let phase = f.arg() + if even { half } else { -half };
            Complex64::from_polar(*light, phase)
        })
        .collect();
    let mut drawn = shown.clone();
    for _ in 0..steps {
        let d: Vec<Complex64> = goal.iter().zip(&shown).map(|(g, e)| g - e).collect();
        for (i, z) in drawn.iter_mut().enumerate() {
            let (y, x) = (i / width, i % width);
            let reach = REACH as isize;
            let mut sum = Complex64::ZERO;
            for (dy, dx) in (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dy, dx))) {
                let (y, x) = (y as isize + dy, x as isize + dx);
                let at = mirrored(y, height) * width + mirrored(x, width);
                sum += d[at] * f64::from(filter.taps[dy.unsigned_abs()][dx.unsigned_abs()]);
            }
            *z = shown[i] + sum;
        }
        for ((e, z), light) in shown.iter_mut().zip(&drawn).zip(light) {
            *e = z / z.norm() * light;
        }
    }
    drawn
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_filter_keeps_the_picture_and_stops_the_checkerboard() {
        for radius in [0.5, 0.8, 1.0] {
            let taps = LocalFilter::of_aperture(radius).taps;
            let at = |sign: f64| {
                let places = |i: usize| if i > 0 { 2.0 } else { 1.0 };
                let tap =
                    |y: usize, x: usize| places(y) * places(x) * f64::from(taps[y][x]) * sign.powi((x + y) as i32);
                (0..16).map(|i| tap(i / 4, i % 4)).sum::<f64>()
            };
            assert!((at(1.0) - 1.0).abs() < 1e-6, "{}", at(1.0));
            assert!(at(-1.0).abs() < 1e-6, "{}", at(-1.0));
        }
    }

    /// Its taps are those of the circle, apart from what makes the two frequencies right.
    #[test]
    fn the_filter_is_the_circle_in_few_taps() {
        let taps = LocalFilter::of_aperture(1.0).taps;
        // Quadrature over the circle: 1/N² Σ cos(2π(fx·x + fy·y)) over the frequencies that pass.
        let n = 1024;
        for (y, x) in [(0, 0), (0, 1), (1, 1), (2, 3)] {
            let frequency = |i: usize| (i as f64 + 0.5) / n as f64 - 0.5;
            let sum: f64 = (0..n * n)
                .map(|i| (frequency(i / n), frequency(i % n)))
                .filter(|(fy, fx)| fx * fx + fy * fy <= 0.25)
                .map(|(fy, fx)| (2.0 * PI * (fx * x as f64 + fy * y as f64)).cos())
                .sum();
            let apart = sum / (n * n) as f64 - f64::from(taps[y][x]);
            assert!(apart.abs() < 6e-3, "{y} {x}: {apart}");
        }
    }
}
