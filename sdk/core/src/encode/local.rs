//! Local correction of phases. It moves the image of double phase behind the aperture toward the target field with a
//! short filter that approximates the aperture. It needs no propagation and no transform, and works for any offset.
//!
//! Let e be the displayed phasors, |e| = 1, L the light that falls on the modulator, and g the target field divided by
//! the scale. A step computes
//!
//!   z = L·e + B∗(g − L·e),  e' = z/|z|,
//!
//! the projection of Gerchberg and Saxton (Optik 35, 237, 1972) with a short filter B in place of the aperture. B
//! approximates the aperture's circle with 7×7 taps ([`LocalFilter`]). It removes no more than the corners of the
//! square spectrum, where the checkerboard's copy of the image lies. At the frame's edges g − L·e is mirrored about the
//! last pixel without repeating it, which continues the checkerboard.
//!
//! Rows pass through all steps at once. A step's row needs three rows of the previous step on either side, so a part of
//! the frame keeps seven rows for each step and begins three rows earlier for each step.

use super::start::{Start, StartScratch};
use crate::Bounds;
use crate::Size;
use num_complex::{Complex32, Complex64};
use phasefront_kernels::wide;
use std::f64::consts::PI;
use std::ops::Range;

/// The number of rows and columns to either side that a step reads.
pub(super) const REACH: usize = 3;
/// The number of columns whose sums are computed together: all of them stay in the first-level cache.
const COLUMNS: usize = 192;
/// The number of rows that a step keeps of the previous one.
const KEPT: usize = 2 * REACH + 1;

/// The largest number of steps. Steps after the second bring no gain.
pub(super) const MAX_STEPS: usize = 8;

/// B in 7×7 taps: a least-squares fit of the aperture's circle with the values 1 at frequency 0 and 0 at (½, ½). The
/// zero matters most because the light of the checkerboard is there, 10⁵ times the spectrum's mean.
#[derive(Debug, Clone, Copy)]
pub struct LocalFilter {
    /// The taps at (dy, dx), symmetric in all quadrants and about the diagonals.
    taps: [[f32; REACH + 1]; REACH + 1],
}

impl LocalFilter {
    /// Returns the taps at (dy, dx), each from 0 to 3.
    pub fn taps(&self) -> &[[f32; REACH + 1]; REACH + 1] {
        &self.taps
    }

    /// Returns the filter of an aperture of `radius`, where 1 reaches the Nyquist frequency.
    ///
    /// The circle's own taps are k(ρ) = R·J₁(πRρ)/(2ρ). Adding a constant and a checkerboard corrects the values at the
    /// two frequencies with the smallest sum of squares.
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

/// The target of the correction for a part of a plane.
#[derive(Clone, Copy)]
pub(super) struct Wanted<'a> {
    /// The target field at the modulator, (H, W), or `None` if it is the plane of the start.
    pub(super) plane: Option<&'a [Complex32]>,
    /// The reciprocal of the amplitude that maps to full light.
    pub(super) per_scale: f32,
}

impl Wanted<'_> {
    fn row<'a>(&'a self, y: usize, start: &'a Start<'_>, of_start: &'a StartScratch) -> &'a [Complex32] {
        match self.plane {
            Some(plane) => &plane[start.first(y)..][..start.columns.len()],
            None => start.source(y, of_start),
        }
    }
}

/// The working memory of a part of a plane.
pub(super) struct LocalScratch {
    steps: usize,
    /// The rows of g − L·e of each step in a ring, with REACH empty columns on either side.
    rings: Vec<Complex32>,
    /// Sums down some columns, for the taps at 0, 1, 2 and 3 columns to the left and right.
    sums: Vec<Complex32>,
    /// A row of the starting field or of a step.
    row: Vec<Complex32>,
    /// The light that falls on a row.
    light: Vec<f32>,
}

impl LocalScratch {
    /// Creates working memory for `steps` ≥ 1 with rows of at most `width`.
    pub(super) fn new(steps: usize, width: usize) -> Self {
        let padded = width + 2 * REACH;
        LocalScratch {
            steps,
            rings: vec![Complex32::ZERO; steps * KEPT * padded],
            sums: vec![Complex32::ZERO; (REACH + 1) * (COLUMNS + 2 * REACH)],
            row: vec![Complex32::ZERO; width],
            light: vec![1.0; width],
        }
    }
}

impl LocalFilter {
    /// Corrects the rows `rows` of some columns of a plane that begin as `start`. Calls `then` with the index of each
    /// row and the field whose phase is displayed.
    pub(super) fn correct(
        &self,
        rows: Range<usize>,
        start: &Start<'_>,
        wanted: Wanted<'_>,
        of_start: &mut StartScratch,
        scratch: &mut LocalScratch,
        mut then: impl FnMut(usize, &[Complex32]),
    ) {
        let (height, width, steps) = (start.size.height, start.columns.len(), scratch.steps);
        let padded = width + 2 * REACH;
        let rings = &mut scratch.rings[..steps * KEPT * padded];
        let (row, light) = (&mut scratch.row[..width], &mut scratch.light[..width]);
        let sums = &mut scratch.sums;
        let per_scale = wanted.per_scale;
        let first = rows.start.saturating_sub(REACH * steps);
        of_start.begin(start, first);
        for front in first..rows.end + REACH * steps {
            if front < height {
                start.row(front, row, of_start);
                start.light_row(front, light);
                let goal = wanted.row(front, start, of_start);
                let to = &mut rings[front % KEPT * padded..][..padded];
                let sign = if front.is_multiple_of(2) { 1.0 } else { -1.0 };
                wide!(begin(row, goal, light, per_scale, sign, &mut to[REACH..][..width]));
                mirror_ends(to);
            }
            for step in 1..=steps {
                // The distance from the requested rows within which this step's rows are needed.
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
                let goal = wanted.row(y, start, of_start);
                self.draw(of_ring(y as isize), around, goal, per_scale, sums, row);
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

    /// Computes z = g − d + B∗d for a row, where d = g − L·e. `own` is d of the row; `around` is d of the rows [above,
    /// below], nearest first.
    fn draw(
        &self,
        own: &[Complex32],
        around: [[&[Complex32]; 2]; REACH],
        goal: &[Complex32],
        per_scale: f32,
        sums: &mut [Complex32],
        out: &mut [Complex32],
    ) {
        let columns = goal.chunks(COLUMNS).zip(out.chunks_mut(COLUMNS)).enumerate();
        for (run, (goal, out)) in columns {
            let (from, padded) = (run * COLUMNS, goal.len() + 2 * REACH);
            let own = &own[from..][..padded];
            let around = around.map(|rows| rows.map(|row| &row[from..][..padded]));
            let sums = &mut sums[..(REACH + 1) * padded];
            wide!(self.draw_run(own, around, goal, per_scale, sums, out));
        }
    }

    /// Computes [`Self::draw`] for some columns.
    #[inline(always)]
    fn draw_run(
        &self,
        own: &[Complex32],
        around: [[&[Complex32]; 2]; REACH],
        goal: &[Complex32],
        per_scale: f32,
        sums: &mut [Complex32],
        out: &mut [Complex32],
    ) {
        let padded = own.len();
        let own = floats(own);
        let [[a1, b1], [a2, b2], [a3, b3]] = around.map(|rows| rows.map(|row| &floats(row)[..2 * padded]));
        // Sums down each column, for the taps at 0, 1, 2 and 3 columns to the left and right.
        let sums: &mut [f32] = bytemuck::cast_slice_mut(sums);
        let (c0, rest) = sums.split_at_mut(2 * padded);
        let (c1, rest) = rest.split_at_mut(2 * padded);
        let (c2, c3) = rest.split_at_mut(2 * padded);
        let c3 = &mut c3[..2 * padded];
        let taps = &self.taps;
        for i in 0..2 * padded {
            let rows = [own[i], a1[i] + b1[i], a2[i] + b2[i], a3[i] + b3[i]];
            let down = |x: usize| {
                (rows[0] * taps[0][x] + rows[1] * taps[1][x]) + (rows[2] * taps[2][x] + rows[3] * taps[3][x])
            };
            (c0[i], c1[i], c2[i], c3[i]) = (down(0), down(1), down(2), down(3));
        }
        let goal = floats(goal);
        let out: &mut [f32] = bytemuck::cast_slice_mut(out);
        let n = out.len();
        let (own, c0) = (part(own, REACH, n), part(c0, REACH, n));
        let (l1, r1, l2, r2, l3, r3) = (
            part(c1, REACH - 1, n),
            part(c1, REACH + 1, n),
            part(c2, REACH - 2, n),
            part(c2, REACH + 2, n),
            part(c3, REACH - 3, n),
            part(c3, REACH + 3, n),
        );
        for i in 0..n {
            let sum = (c0[i] + (l1[i] + r1[i])) + ((l2[i] + r2[i]) + (l3[i] + r3[i]));
            out[i] = goal[i] * per_scale - own[i] + sum;
        }
    }
}

/// Returns the real and imaginary parts of a row.
#[inline(always)]
fn floats(row: &[Complex32]) -> &[f32] {
    bytemuck::cast_slice(row)
}

/// Returns the `n` parts of a row from pixel `from` on.
#[inline(always)]
fn part(row: &[f32], from: usize, n: usize) -> &[f32] {
    &row[2 * from..][..n]
}

/// Returns the pixel of `count` for position `at`, mirrored about the first and last pixel if it is outside.
fn mirrored(at: isize, count: usize) -> usize {
    let period = 2 * (count as isize - 1).max(1);
    let at = at.rem_euclid(period);
    at.min(period - at).min(count as isize - 1) as usize
}

/// Fills the padding columns of a row by mirroring.
fn mirror_ends(row: &mut [Complex32]) {
    let width = row.len() - 2 * REACH;
    for i in 0..REACH as isize {
        let (left, right) = (-1 - i, width as isize + i);
        for at in [left, right] {
            row[(at + REACH as isize) as usize] = row[REACH + mirrored(at, width)];
        }
    }
}

/// The pixels that a loop computes together. The constant length lets it vectorise.
const RUN: usize = 16;

/// Computes g − L·e for a row of double phase.
#[inline(always)]
fn begin(field: &[Complex32], goal: &[Complex32], light: &[f32], per_scale: f32, sign: f32, to: &mut [Complex32]) {
    let signs: [f32; RUN] = std::array::from_fn(|x| if x % 2 == 0 { sign } else { -sign });
    let ((fields, field), (goals, goal)) = (field.as_chunks::<RUN>(), goal.as_chunks::<RUN>());
    let ((lights, light), (runs, rest)) = (light.as_chunks::<RUN>(), to.as_chunks_mut::<RUN>());
    for ((to, f), (g, light)) in runs.iter_mut().zip(fields).zip(goals.iter().zip(lights)) {
        #[allow(clippy::needless_range_loop)]
        for x in 0..RUN {
            to[x] = begin_value(f[x], g[x], light[x], per_scale, signs[x]);
        }
    }
    for (x, to) in rest.iter_mut().enumerate() {
        *to = begin_value(field[x], goal[x], light[x], per_scale, signs[x]);
    }
}

/// Returns g − L·e for a value f of double phase, whose phasor is (f/|f|)·(c ± i·√(1 − c²)) with c = |f| divided by the
/// scale.
#[inline(always)]
fn begin_value(f: Complex32, g: Complex32, light: f32, per_scale: f32, sign: f32) -> Complex32 {
    let norm = (f.re * f.re + f.im * f.im).sqrt();
    let cosine = (norm * per_scale).at_most(1.0);
    let sine = sign * (1.0 - cosine * cosine).sqrt();
    let dark = norm <= f32::MIN_POSITIVE;
    let inverse = 1.0 / if dark { 1.0 } else { norm };
    let (re, im) = (if dark { 1.0 } else { f.re * inverse }, f.im * inverse);
    counted(
        g.re * per_scale - light * (re * cosine - im * sine),
        g.im * per_scale - light * (re * sine + im * cosine),
    )
}

/// Returns the difference at a pixel, or 0 if it is not finite, so that the pixel's neighbours are still corrected.
#[inline(always)]
fn counted(re: f32, im: f32) -> Complex32 {
    let is = re * re + im * im < f32::INFINITY;
    Complex32::new(if is { re } else { 0.0 }, if is { im } else { 0.0 })
}

/// Computes g − L·z/|z| for a row.
#[inline(always)]
fn project(drawn: &[Complex32], goal: &[Complex32], light: &[f32], per_scale: f32, to: &mut [Complex32]) {
    let values = drawn.iter().zip(goal).zip(light);
    for (((z, g), light), to) in values.zip(to) {
        let square = (z.re * z.re + z.im * z.im).at_least(f32::MIN_POSITIVE);
        let length = light / square.sqrt();
        *to = counted(g.re * per_scale - z.re * length, g.im * per_scale - z.im * length);
    }
}

/// Computes the correction in f64 with sums over whole planes, as the oracle for tests. `start`, (H, W), is the input
/// of double phase divided by the light, and `goal` is the target field, both divided by the scale. `light` falls on
/// each pixel. Returns z of the last step.
pub fn reference(
    filter: &LocalFilter,
    Size { width, height }: Size,
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

    /// Checks that the taps are those of the circle apart from the correction of the two frequencies.
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
