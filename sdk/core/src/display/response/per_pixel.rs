//! A compact table of levels for each pixel: monotone knots on a coarse grid, small enough for a phone.
//!
//! A table of 256 levels for each of 1920×1080 pixels and three colours takes 1.6 GB. The differences between pixels
//! come from the thickness and the field of the liquid crystal, which change slowly over the panel. The table therefore
//! stores curves for nodes every `spacing` pixels. Each curve holds the levels of `intervals` + 1 phases, and the table
//! is interpolated linearly in x, y and phase.
//!
//! # The file
//! All numbers are little-endian, without padding:
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `PFPIXEL1` |
//! | 4 × u32 | height H, width W of the modulator; spacing s; intervals K |
//! | (C, Gh, Gw, K+1) × u16 | levels × 128 of the phases 2πk/K, colour by colour, rows from the top |
//! | (C, Gh, Gw) × u16 | `turn`/2π × 65535 |
//!
//! The number of colours C is 3 or 1; it follows from the length of the file. Node (i, j) lies on pixel (s·i, s·j). Gh
//! = ⌈(H−1)/s⌉ + 1 and Gw = ⌈(W−1)/s⌉ + 1, so the nodes reach the last pixel or lie beyond it.
//!
//! # The rule
//! For a phase φ at pixel (x, y), let t = φ·K/2π and k = min(⌊t⌋, K−1). Knots k and k+1 of the four nodes around the
//! pixel are interpolated in y, then in x, then by t−k. The level is the result plus ½, clamped to 0..=255, with its
//! fraction dropped. If the modulator cannot reach 2π, the knots continue to rise over 255. From the phase `turn` on,
//! which is interpolated in the same way, the smallest phase is nearer than the largest, so phase 0 determines the
//! level. All arithmetic is in f32.

use crate::Bounds;
use crate::Size;
use crate::runtime::error::{Error, Result};
use std::f32::consts::TAU;

/// The first bytes of the file.
const MAGIC: &[u8; 8] = b"PFPIXEL1";
/// The number of steps of a level in the file.
const FRACTIONS: f32 = 128.0;
/// The largest number of phase intervals.
pub const MAX_INTERVALS: usize = 64;

/// The levels of every pixel. The table is immutable and can be shared between threads.
#[derive(Debug, Clone, PartialEq)]
pub struct PerPixel {
    /// The size of the modulator.
    modulator: Size,
    /// The upper left pixel of the part of the modulator that a stack (C, H, W) covers; `window` is the size of that
    /// part.
    corner: (usize, usize),
    window: Size,
    spacing: usize,
    intervals: usize,
    /// The grid of nodes, (Gh, Gw).
    nodes: (usize, usize),
    /// The knots, (C, Gh, Gw, K+1), in levels.
    levels: Vec<f32>,
    /// The phases from which phase 0 is nearer, (C, Gh, Gw), in radians.
    turn: Vec<f32>,
}

/// Returns the grid (Gh, Gw) of nodes every `spacing` pixels over `size`.
pub fn nodes(size: Size, spacing: usize) -> (usize, usize) {
    let Size { width, height } = size;
    let along = |n: usize| n.saturating_sub(1).div_ceil(spacing) + 1;
    (along(height), along(width))
}

impl PerPixel {
    /// Creates a table for a modulator of `size` with nodes every `spacing` pixels.
    ///
    /// `levels`, (C, Gh, Gw, `intervals` + 1), are the levels of the phases 2πk/`intervals`. They may exceed 255 for
    /// phases that the modulator does not reach. `turn`, (C, Gh, Gw), are the phases from which phase 0 is nearer, or
    /// 2π if the modulator reaches all phases. C is 3 or 1.
    ///
    /// Values are rounded to the precision of the file, so that a table does not change when it is written and read.
    ///
    /// # Errors
    /// Returns an error if a size is 0, there are more than [`MAX_INTERVALS`] intervals, lengths do not match, levels
    /// fall along a curve or lie outside 0..=511, or a `turn` lies outside 0..=2π.
    pub fn new(size: Size, spacing: usize, intervals: usize, levels: &[f32], turn: &[f32]) -> Result<Self> {
        let refuse = |what: String| Err(Error::Setting(format!("per-pixel table: {what}")));
        let most = f32::from(u16::MAX) / FRACTIONS;
        if let Some(level) = levels.iter().find(|l| !(0.0..=most).contains(*l)) {
            return refuse(format!("a level of {level}; it must lie in 0..={most:.0}"));
        }
        if let Some(turn) = turn.iter().find(|t| !(0.0..=TAU).contains(*t)) {
            return refuse(format!("a turn at {turn} rad; it must lie in 0..=2π"));
        }
        let levels: Vec<u16> = (levels.iter()).map(|l| (l * FRACTIONS).round() as u16).collect();
        let turn: Vec<u16> = (turn.iter())
            .map(|t| (t / TAU * f32::from(u16::MAX)).round() as u16)
            .collect();
        Self::of_fractions(size, spacing, intervals, &levels, &turn)
    }

    fn of_fractions(size: Size, spacing: usize, intervals: usize, levels: &[u16], turn: &[u16]) -> Result<Self> {
        let Size { width, height } = size;
        let refuse = |what: String| Err(Error::Setting(format!("per-pixel table: {what}")));
        if height == 0 || width == 0 || spacing == 0 || height > 65536 || width > 65536 {
            return refuse(format!(
                "{width}×{height} pixels, a node every {spacing}; sizes must lie in 1..=65536"
            ));
        }
        if !(1..=MAX_INTERVALS).contains(&intervals) {
            return refuse(format!(
                "{intervals} intervals of phase; there must be 1 to {MAX_INTERVALS}"
            ));
        }
        let nodes = nodes(Size { width, height }, spacing);
        let one = nodes.0 * nodes.1;
        let count = if turn.len() == one { one } else { 3 * one };
        if turn.len() != count || levels.len() != count * (intervals + 1) {
            return refuse(format!(
                "{} levels and {} turns; {width}×{height} pixels, a node every {spacing}, need {} and {count}, or a third of both for one colour",
                levels.len(),
                turn.len(),
                count * (intervals + 1)
            ));
        }
        if !levels.chunks_exact(intervals + 1).all(<[u16]>::is_sorted) {
            return refuse("a curve falls; levels must rise with the phase".into());
        }
        Ok(PerPixel {
            modulator: size,
            corner: (0, 0),
            window: size,
            spacing,
            intervals,
            nodes,
            levels: levels.iter().map(|l| f32::from(*l) / FRACTIONS).collect(),
            turn: turn.iter().map(|t| f32::from(*t) / f32::from(u16::MAX) * TAU).collect(),
        })
    }

    /// Creates a table whose curve depends on the laser alone. `level` returns the level of a phase, in turns, for the
    /// laser with an index, and `reach` is the phase of each laser's last level, in turns; from half-way between it and
    /// a whole turn, phase 0 is nearer. There are as many lasers as `reach` has values, 3 or 1.
    ///
    /// # Errors
    /// Returns the errors of [`Self::new`].
    pub fn of_lasers(size: Size, reach: &[f64], level: impl Fn(usize, f64) -> f64) -> Result<Self> {
        let spacing = size.width.max(size.height).saturating_sub(1).max(1);
        let (rows, columns) = nodes(size, spacing);
        let most = f64::from(u16::MAX) / f64::from(FRACTIONS);
        let (mut levels, mut turns) = (Vec::new(), Vec::new());
        for (laser, reach) in reach.iter().enumerate() {
            for _ in 0..rows * columns {
                let phases = (0..=MAX_INTERVALS).map(|k| k as f64 / MAX_INTERVALS as f64);
                levels.extend(phases.map(|phase| level(laser, phase).clamp(0.0, most) as f32));
                turns.push(((reach.min(1.0) + 1.0) / 2.0) as f32 * TAU);
            }
        }
        Self::new(size, spacing, MAX_INTERVALS, &levels, &turns)
    }

    /// Reads a table from the bytes of a file.
    ///
    /// # Errors
    /// Returns an error if the bytes are not a valid table or are incomplete.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let refuse = |what: String| Error::Setting(format!("per-pixel table: {what}"));
        let rest = bytes
            .strip_prefix(MAGIC.as_slice())
            .ok_or_else(|| refuse("does not begin with PFPIXEL1".into()))?;
        let Some((head, rest)) = rest.split_first_chunk::<16>() else {
            return Err(refuse("is cut short".into()));
        };
        let number = |i: usize| u32::from_le_bytes([0, 1, 2, 3].map(|j| head[4 * i + j])) as usize;
        let (height, width, spacing, intervals) = (number(0), number(1), number(2), number(3));
        let sizes = [height, width, spacing, intervals];
        if sizes.iter().any(|n| !(1..=65536).contains(n)) {
            return Err(refuse(format!("holds impossible sizes {sizes:?}")));
        }
        let (rows, columns) = nodes(Size { width, height }, spacing);
        // The number of bytes of one colour.
        let needed = 2 * rows * columns * (intervals + 2);
        let count = rest.len() / needed * rows * columns;
        if ![needed, 3 * needed].contains(&rest.len()) {
            return Err(refuse(format!(
                "has {} bytes of curves; {width}×{height} pixels, a node every {spacing}, need {needed} a colour, of which there are 3 or 1",
                rest.len()
            )));
        }
        let values: Vec<u16> = (rest.chunks_exact(2))
            .map(|pair| u16::from_le_bytes([pair[0], pair[1]]))
            .collect();
        let (levels, turn) = values.split_at(count * (intervals + 1));
        Self::of_fractions(Size { width, height }, spacing, intervals, levels, turn)
    }

    /// Returns the bytes of the file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        for number in [
            self.modulator.height,
            self.modulator.width,
            self.spacing,
            self.intervals,
        ] {
            bytes.extend((number as u32).to_le_bytes());
        }
        for level in &self.levels {
            bytes.extend(((level * FRACTIONS).round() as u16).to_le_bytes());
        }
        for turn in &self.turn {
            bytes.extend(((turn / TAU * f32::from(u16::MAX)).round() as u16).to_le_bytes());
        }
        bytes
    }

    /// Returns the part of the table of `size` in its middle, for a hologram smaller than the modulator.
    ///
    /// # Errors
    /// Returns an error if the table has fewer pixels.
    pub fn centred(&self, size: Size) -> Result<Self> {
        let Size { width, height } = size;
        let Size {
            width: columns,
            height: rows,
        } = self.window;
        if height > rows || width > columns {
            return Err(Error::Setting(format!(
                "per-pixel table: for {} pixels, the hologram has {size}; it must not be larger",
                self.window
            )));
        }
        Ok(PerPixel {
            corner: (
                self.corner.0 + (rows - height) / 2,
                self.corner.1 + (columns - width) / 2,
            ),
            window: size,
            ..self.clone()
        })
    }

    /// Returns the number of colours.
    pub fn colours(&self) -> usize {
        self.turn.len() / (self.nodes.0 * self.nodes.1)
    }

    /// Returns the size of the planes that this table is for.
    pub fn size(&self) -> Size {
        self.window
    }

    /// Returns the number of pixels between nodes.
    pub fn spacing(&self) -> usize {
        self.spacing
    }

    /// Returns the number of phase intervals, K.
    pub fn intervals(&self) -> usize {
        self.intervals
    }

    /// Returns the knots of all nodes, (C, Gh, Gw, K+1), in levels.
    pub fn knots(&self) -> &[f32] {
        &self.levels
    }

    /// Returns the phase of each node, (C, Gh, Gw), from which phase 0 is nearer than the largest phase.
    pub fn turns(&self) -> &[f32] {
        &self.turn
    }

    /// Returns the level for `phase`, in \[0, 2π), at value `at` of a stack (C, H, W). This implements the rule
    /// directly; tests compare the form for rows with it.
    ///
    /// # Panics
    /// Panics if `at` lies outside the stack.
    pub fn level(&self, phase: f32, at: usize) -> u8 {
        let turn = self.interpolate(at, |node| self.turn[node]);
        let phase = if phase >= turn { 0.0 } else { phase };
        let t = phase * (self.intervals as f32 / TAU);
        let k = (t as usize).min(self.intervals - 1);
        let knot = |k: usize| self.interpolate(at, |node| self.levels[node * (self.intervals + 1) + k]);
        let (here, next) = (knot(k), knot(k + 1));
        rounded(here + (next - here) * (t - k as f32))
    }

    /// Interpolates a value between the four nodes around value `at` of the stack, in y first, then in x.
    fn interpolate(&self, at: usize, value: impl Fn(usize) -> f32) -> f32 {
        let (colour, y, x) = self.place(at);
        let (i, fy) = self.split(y);
        let (j, fx) = self.split(x);
        let column = |j: usize| {
            let (top, bottom) = (self.node(colour, i, j), self.node(colour, i + 1, j));
            let (top, bottom) = (value(top), value(bottom));
            top + (bottom - top) * fy
        };
        let (left, right) = (column(j), column(j + 1));
        left + (right - left) * fx
    }

    /// Returns the colour and the modulator pixel (y, x) of value `at` of a stack.
    fn place(&self, at: usize) -> (usize, usize, usize) {
        let Size { width, height } = self.window;
        let plane = height * width;
        assert!(at < self.colours() * plane, "a place outside the modulator");
        let (y, x) = (at % plane / width, at % width);
        (at / plane, y + self.corner.0, x + self.corner.1)
    }

    /// Returns the node before pixel `n` of an axis, and the fraction of the way to the next node.
    fn split(&self, n: usize) -> (usize, f32) {
        (n / self.spacing, (n % self.spacing) as f32 / self.spacing as f32)
    }

    /// Returns the index of node (i, j). Indices beyond the grid, whose weight is 0, are clamped to the last node.
    fn node(&self, colour: usize, i: usize, j: usize) -> usize {
        let (rows, columns) = self.nodes;
        (colour * rows + i.min(rows - 1)) * columns + j.min(columns - 1)
    }

    /// Writes the level of each of `phases`, which begin at value `first` of a stack (C, H, W) and lie in one row. The
    /// results are bit-identical to [`Self::level`]. Does not allocate.
    ///
    /// # Panics
    /// Panics if the lengths differ or the phases extend beyond the row.
    #[inline(always)]
    pub(crate) fn levels(&self, phases: &[f32], first: usize, levels: &mut [u8]) {
        assert_eq!(phases.len(), levels.len());
        let (colour, y, x) = self.place(first);
        let end = self.corner.1 + self.window.width;
        assert!(x + phases.len() <= end, "a run beyond its row");
        let (i, fy) = self.split(y);
        let column = |j: usize, curve: &mut _| self.column((colour, i, j), fy, curve);
        let mut j = x / self.spacing;
        let mut left = [0.0; MAX_INTERVALS + 1];
        let mut right = left;
        let mut left_turn = column(j, &mut left);
        let mut ends = [[0.0; 4]; MAX_INTERVALS];
        let (mut phases, mut levels, mut x) = (phases, levels, x);
        while !phases.is_empty() {
            let right_turn = column(j + 1, &mut right);
            let curves = left.windows(2).zip(right.windows(2));
            for (ends, (left, right)) in ends.iter_mut().zip(curves).take(self.intervals) {
                *ends = [left[0], right[0] - left[0], left[1], right[1] - left[1]];
            }
            let count = phases.len().min((j + 1) * self.spacing - x);
            let (run, rest) = phases.split_at(count);
            let (shown, others) = std::mem::take(&mut levels).split_at_mut(count);
            let start = x - j * self.spacing;
            let node = Between {
                ends: &ends,
                turn: (left_turn, right_turn - left_turn),
                intervals: self.intervals,
                step: self.spacing as f32,
            };
            let blocks = run.chunks(LANES).zip(shown.chunks_mut(LANES));
            for (n, (run, shown)) in blocks.enumerate() {
                node.levels(run, (start + n * LANES) as f32, shown);
            }
            (phases, levels) = (rest, others);
            x += count;
            j += 1;
            (left, left_turn) = (right, right_turn);
        }
    }

    /// Interpolates the curve of node (colour, i, j), a fraction `fy` of the way to the node below, into `curve`.
    /// Returns its turn.
    #[inline(always)]
    fn column(&self, (colour, i, j): (usize, usize, usize), fy: f32, curve: &mut [f32; MAX_INTERVALS + 1]) -> f32 {
        let (top, bottom) = (self.node(colour, i, j), self.node(colour, i + 1, j));
        let knots = self.intervals + 1;
        let of_node = |node: usize| &self.levels[node * knots..][..knots];
        for ((value, top), bottom) in curve.iter_mut().zip(of_node(top)).zip(of_node(bottom)) {
            *value = top + (bottom - top) * fy;
        }
        self.turn[top] + (self.turn[bottom] - self.turn[top]) * fy
    }

    /// Returns the smallest phase whose curve reaches `level` at value `at` of a stack, in \[0, 2π).
    pub(crate) fn phase(&self, level: u8, at: usize) -> f32 {
        let knots = self.intervals + 1;
        let value = |k: usize| self.interpolate(at, |node| self.levels[node * knots + k]);
        let wanted = f32::from(level);
        let mut here = value(0);
        if wanted <= here {
            return 0.0;
        }
        for k in 0..self.intervals {
            let next = value(k + 1);
            if next >= wanted {
                let t = k as f32 + (wanted - here) / (next - here);
                return super::wrap(t * (TAU / self.intervals as f32));
            }
            here = next;
        }
        // The curve ends at 2π, and the table produces no level beyond it.
        0.0
    }
}

/// The number of values in a block.
const LANES: usize = 32;

/// The curves between two nodes of a row.
struct Between<'a> {
    /// For each interval: the left node's first knot, its difference to the right node's, and the same for the second
    /// knot. They are adjacent because the look-up dominates the time.
    ends: &'a [[f32; 4]; MAX_INTERVALS],
    /// The left node's turn, and its difference to the right node's.
    turn: (f32, f32),
    intervals: usize,
    /// The number of pixels between nodes.
    step: f32,
}

impl Between<'_> {
    /// Writes the levels of at most [`LANES`] phases. The first is `first` pixels from the left node.
    // These are index loops over arrays of one fixed length. All of them vectorise except the middle one, which looks
    // up knots.
    #[allow(clippy::needless_range_loop)]
    #[inline(always)]
    fn levels(&self, phases: &[f32], first: f32, levels: &mut [u8]) {
        let mut wanted = [0.0; LANES];
        wanted[..phases.len()].copy_from_slice(phases);
        let per_radian = self.intervals as f32 / TAU;
        let last = (self.intervals - 1) as f32;
        let (mut along, mut part, mut interval) = ([0.0; LANES], [0.0; LANES], [0; LANES]);
        for i in 0..LANES {
            let fx = (first + i as f32) / self.step;
            let turn = self.turn.0 + self.turn.1 * fx;
            let phase = if wanted[i] >= turn { 0.0 } else { wanted[i] };
            let t = phase * per_radian;
            let k = whole(t).at_most(last);
            (along[i], part[i], interval[i]) = (fx, t - k, bits(k) & 63);
        }
        let ends: [[f32; 4]; LANES] = interval.map(|k| self.ends[k as usize]);
        let mut shown = [0; LANES];
        for i in 0..LANES {
            let [here, way, next, next_way] = ends[i];
            let here = here + way * along[i];
            let next = next + next_way * along[i];
            let level = here + (next - here) * part[i] + 0.5;
            shown[i] = bits(whole(level.clamp(0.0, 255.0))) as u8;
        }
        levels.copy_from_slice(&shown[..levels.len()]);
    }
}

/// Rounds to a level by adding ½ and dropping the fraction.
fn rounded(level: f32) -> u8 {
    (level + 0.5) as u8
}

/// 2²³, from which on floats have no fraction.
const WHOLE: f32 = 8_388_608.0;

/// Returns the integer part of a non-negative value far below 2²³. Vector conversions to an integer and back are slow
/// if they must handle values out of range.
fn whole(value: f32) -> f32 {
    let nearest = value + WHOLE - WHOLE;
    if nearest > value { nearest - 1.0 } else { nearest }
}

/// Returns a whole value below 2²³ in the low bits of an integer.
fn bits(whole: f32) -> u32 {
    (whole + WHOLE).to_bits()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Creates a table of curves that bend and differ between nodes. If `short`, they do not reach 2π.
    fn table(size: Size, spacing: usize, intervals: usize, short: bool) -> PerPixel {
        let (rows, columns) = nodes(size, spacing);
        let mut levels = Vec::new();
        let mut turn = Vec::new();
        for node in 0..3 * rows * columns {
            let reach = if short {
                0.7 + 0.02 * (node % 9) as f32
            } else {
                1.0 + 0.03 * (node % 7) as f32
            };
            for k in 0..=intervals {
                let t = k as f32 / intervals as f32 / reach;
                levels.push(255.0 * (t + 0.1 * (TAU * t).sin().min(0.0) * f32::from(t < 1.0)).max(0.0));
            }
            for k in 1..=intervals {
                let n = levels.len();
                levels[n - 1 - intervals + k] = levels[n - 1 - intervals + k].max(levels[n - 2 - intervals + k]);
            }
            turn.push(if reach < 1.0 { (reach + 1.0) / 2.0 * TAU } else { TAU });
        }
        PerPixel::new(size, spacing, intervals, &levels, &turn).unwrap()
    }

    fn phases(n: usize, seed: usize) -> Vec<f32> {
        let mut all: Vec<f32> = (0..n)
            .map(|i| ((i * 7919 + seed * 31) % 10_007) as f32 / 10_007.0 * TAU)
            .collect();
        let end = all.len() - 1;
        all[0] = 0.0;
        all[end] = TAU.next_down();
        all
    }

    #[test]
    fn rows_agree_with_the_rule_to_the_bit() {
        for (size, spacing, intervals) in [
            (Size { width: 301, height: 7 }, 32, 32),
            (Size { width: 65, height: 33 }, 32, 64),
            (Size { width: 1, height: 1 }, 5, 1),
            (Size { width: 10, height: 9 }, 1, 17),
            (Size { width: 40, height: 5 }, 64, 8),
        ] {
            for short in [false, true] {
                let table = table(size, spacing, intervals, short);
                let Size { width: w, height: h } = size;
                for row in 0..3 * h {
                    let phases = phases(w, row);
                    for begin in [0, w / 3] {
                        let mut out = vec![0; w - begin];
                        table.levels(&phases[begin..], row * w + begin, &mut out);
                        for (x, level) in out.iter().enumerate() {
                            let at = row * w + begin + x;
                            assert_eq!(*level, table.level(phases[begin + x], at), "{size} {at}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_level_shows_the_phase_that_asks_for_it() {
        let table = table(Size { width: 50, height: 20 }, 16, 32, false);
        for at in [0, 77, 999, 1500, 2999] {
            for i in 0..200 {
                let phase = i as f32 / 200.0 * TAU;
                let shown = table.phase(table.level(phase, at), at);
                let error = (shown - phase).abs();
                // Half a level at the steepest point of the curve.
                assert!(error.min(TAU - error) < 0.04, "{phase} {shown}");
            }
        }
    }

    #[test]
    fn phases_out_of_reach_get_the_nearer_end() {
        let levels: Vec<f32> = (0..=8).map(|k| k as f32 / 8.0 * 340.0).collect();
        let levels: Vec<f32> = levels.iter().cycle().take(9 * 12).copied().collect();
        let table = PerPixel::new(Size { width: 4, height: 3 }, 4, 8, &levels, &[TAU * 0.875; 12]).unwrap();
        assert_eq!(table.level(TAU * 0.5, 5), 170);
        assert_eq!(table.level(TAU * 0.8, 5), 255);
        assert_eq!(table.level(TAU * 0.87, 5), 255);
        assert_eq!(table.level(TAU * 0.88, 5), 0);
    }

    #[test]
    fn a_centred_table_is_the_middle_of_the_whole() {
        let whole = table(Size { width: 65, height: 33 }, 16, 32, true);
        let part = whole.centred(Size { width: 41, height: 20 }).unwrap();
        assert_eq!((part.size(), part.corner), (Size { width: 41, height: 20 }, (6, 12)));
        let phases = phases(41, 1);
        let mut levels = vec![0; 41];
        for row in [0, 19, 20, 45, 59] {
            part.levels(&phases, row * 41, &mut levels);
            for (x, level) in levels.iter().enumerate() {
                let at = (row / 20 * 33 + row % 20 + 6) * 65 + x + 12;
                assert_eq!(*level, whole.level(phases[x], at));
                assert_eq!(*level, part.level(phases[x], row * 41 + x));
            }
        }
        assert_eq!(part.centred(Size { width: 41, height: 2 }).unwrap().corner, (15, 12));
        assert!(part.centred(Size { width: 3, height: 21 }).is_err());
    }

    #[test]
    fn bytes_hold_the_table_and_broken_ones_are_named() {
        let table = table(Size { width: 65, height: 33 }, 16, 32, true);
        let bytes = table.to_bytes();
        assert_eq!(PerPixel::from_bytes(&bytes).unwrap(), table);
        let message = |bytes: &[u8]| PerPixel::from_bytes(bytes).unwrap_err().to_string();
        assert!(message(b"what").contains("PFPIXEL1"));
        assert!(message(&bytes[..12]).contains("cut short"));
        assert!(message(&bytes[..bytes.len() - 1]).contains("bytes of curves"));
        let mut zero = bytes.clone();
        zero[8..12].fill(0);
        assert!(message(&zero).contains("sizes"));
        let mut falling = bytes;
        falling[24..26].copy_from_slice(&60000u16.to_le_bytes());
        assert!(message(&falling).contains("falls"));
    }
}
