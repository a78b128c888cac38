//! Conversion of phases to modulator levels and back, with a linear response, a 256-entry look-up table for the whole
//! modulator, or a table for each pixel ([`per_pixel`]). Calibration measures the tables.

pub mod per_pixel;

use crate::Size;
use crate::runtime::error::{Error, Result};
use per_pixel::PerPixel;
use phasefront_kernels::wide;
use std::f32::consts::TAU;
use std::sync::Arc;

/// A modulator's response to phases. It is immutable and can be shared between threads.
#[derive(Debug, Clone, PartialEq)]
pub enum Response {
    /// The linear response: level round(φ/2π·2^bits) mod 2^bits.
    Linear {
        /// The number of bits of a level, 1 to 8.
        bits: u32,
    },
    /// A look-up table. The phase is rounded to one of 256 steps of 2π/256, and `level[step]` is its level.
    Lut {
        /// The level of each step.
        level: Box<[u8; 256]>,
        /// The phase of each level: the middle of its steps. A level without steps takes the phase of the nearest level
        /// with steps.
        phase: Box<[f32; 256]>,
    },
    /// A curve for each pixel of each colour, from a calibration file.
    #[doc(hidden)]
    PerPixel(Arc<PerPixel>),
}

impl Response {
    /// Creates the linear response.
    ///
    /// # Errors
    /// Returns an error if `bits` lies outside 1..=8.
    pub fn linear(bits: u32) -> Result<Self> {
        if !(1..=8).contains(&bits) {
            return Err(Error::Setting(format!(
                "a modulator of {bits} bits has no 8-bit levels; bits must lie in 1..=8"
            )));
        }
        Ok(Response::Linear { bits })
    }

    /// Creates the response of a calibrated modulator, in which `level[i]` has the phase 2πi/256.
    pub fn lut(level: [u8; 256]) -> Self {
        let mut used: [Option<f32>; 256] = [None; 256];
        for shown in 0..=255u8 {
            // The steps of a level may wrap around 2π, so their middle is the direction of a sum of unit vectors.
            let steps = (0..256).filter(|&i| level[i] == shown);
            let (sum, n) = steps.fold((num_complex::Complex32::ZERO, 0), |(sum, n), i| {
                let step = num_complex::Complex32::from_polar(1.0, i as f32 / 256.0 * TAU);
                (sum + step, n + 1)
            });
            if n > 0 {
                used[shown as usize] = Some(wrap(sum.arg()));
            }
        }
        let phase = std::array::from_fn(|l| {
            (0..256)
                .flat_map(|d| [l.checked_sub(d), Some(l + d)])
                .flatten()
                .find_map(|near| used.get(near).copied().flatten())
                .unwrap_or(0.0)
        });
        Response::Lut {
            level: Box::new(level),
            phase: Box::new(phase),
        }
    }

    /// Creates the response of a modulator whose level l has the phase `turns[l]`·2π, rising from 0.
    ///
    /// A phase becomes the level whose phase is nearest modulo 2π, or the higher of two equally near levels. Only
    /// levels in the first turn are used.
    ///
    /// # Errors
    /// Returns an error if there are fewer than 2 or more than 256 levels, or if the phases do not rise from 0 to at
    /// most 4 turns.
    pub fn of_turns(turns: &[f64]) -> Result<Self> {
        let refuse = |what: String| Err(Error::Setting(format!("a modulator's levels: {what}")));
        if !(2..=256).contains(&turns.len()) {
            return refuse(format!("{} of them; there must be 2 to 256", turns.len()));
        }
        let rises = turns.is_sorted_by(|a, b| a < b);
        if turns[0] != 0.0 || !rises || !turns.iter().all(|turn| (0.0..=4.0).contains(turn)) {
            return refuse("their phases must rise from 0, up to 4 turns".into());
        }
        let first_turn = turns.iter().take_while(|turn| **turn < 1.0).count();
        let nearest = |step: usize| {
            let apart = |turn: f64| (turn - step as f64 / 256.0).abs();
            // Level 0 is also at the end of the turn.
            let all = turns[..first_turn].iter().copied().zip(0..).chain([(1.0, 0)]);
            let best = all.reduce(|best, other| if apart(other.0) <= apart(best.0) { other } else { best });
            best.map_or(0, |(_, level)| level)
        };
        let phase = std::array::from_fn(|level| {
            let turn = turns.get(level).or(turns.last()).copied().unwrap_or(0.0);
            wrap(turn.fract() as f32 * TAU)
        });
        Ok(Response::Lut {
            level: Box::new(std::array::from_fn(nearest)),
            phase: Box::new(phase),
        })
    }

    /// Returns the response of the part of the modulator of `size` in its middle, for a smaller hologram.
    ///
    /// # Errors
    /// Returns an error if the table has fewer pixels.
    #[doc(hidden)]
    pub fn centred(self, size: Size) -> Result<Self> {
        match self {
            Response::PerPixel(table) if table.size() != size => Ok(Response::PerPixel(table.centred(size)?.into())),
            same => Ok(same),
        }
    }

    /// Returns the size of the holograms that the response is for, or `None` if it fits any.
    #[doc(hidden)]
    pub fn size(&self) -> Option<Size> {
        match self {
            Response::PerPixel(table) => Some(table.size()),
            _ => None,
        }
    }

    /// Returns the level for `phase`, in \[0, 2π), at value `at` of a stack (C, H, W).
    ///
    /// # Panics
    /// Panics if `at` lies outside the shape of the response.
    #[doc(hidden)]
    pub fn level(&self, phase: f32, at: usize) -> u8 {
        match self {
            Response::Linear { bits } => step(phase, 1 << bits) as u8,
            Response::Lut { level, .. } => level[step(phase, 256)],
            Response::PerPixel(table) => table.level(phase, at),
        }
    }

    /// Returns the phase of `level`, in \[0, 2π), at value `at` of a stack (C, H, W).
    ///
    /// # Panics
    /// Panics if `at` lies outside the shape of the response.
    #[doc(hidden)]
    pub fn phase(&self, level: u8, at: usize) -> f32 {
        match self {
            Response::Linear { bits } => {
                let levels = 1u32 << bits;
                (u32::from(level) % levels) as f32 / levels as f32 * TAU
            }
            Response::Lut { phase, .. } => phase[level as usize],
            Response::PerPixel(table) => table.phase(level, at),
        }
    }

    /// Writes the level of each of `phases`, like [`Self::level`]. `phases` is a row or a part of one that begins at
    /// value `first` of a stack (C, H, W). Does not allocate.
    ///
    /// # Panics
    /// Panics if the lengths differ, or if the phases extend beyond a row of the response's shape.
    #[inline(always)]
    #[doc(hidden)]
    pub fn levels(&self, phases: &[f32], first: usize, levels: &mut [u8]) {
        assert_eq!(phases.len(), levels.len());
        match self {
            Response::Linear { bits } => {
                for (level, phase) in levels.iter_mut().zip(phases) {
                    *level = step(*phase, 1 << bits) as u8;
                }
            }
            Response::Lut { level: table, .. } => {
                for (level, phase) in levels.iter_mut().zip(phases) {
                    *level = table[step(*phase, 256)];
                }
            }
            Response::PerPixel(table) => table.levels(phases, first, levels),
        }
    }
}

/// Wraps `phase` to \[0, 2π).
pub fn wrap(phase: f32) -> f32 {
    let wrapped = phase.rem_euclid(TAU);
    // `rem_euclid` of a tiny negative number rounds up to 2π.
    if wrapped < TAU { wrapped } else { 0.0 }
}

/// Writes the linear response of a modulator with `bits` bits, 1 to 16, for levels that do not fit in bytes. Does not
/// allocate.
///
/// # Panics
/// Panics if the lengths differ.
pub fn linear_words(phases: &[f32], bits: u32, words: &mut [u16]) {
    assert_eq!(phases.len(), words.len());
    wide!(for (word, phase) in words.iter_mut().zip(phases) {
        *word = step(*phase, 1 << bits) as u16;
    });
}

/// Returns round(φ/2π·n) mod n, where n is a power of two up to 65536.
#[inline(always)]
fn step(phase: f32, n: i32) -> usize {
    // From 2²³ on, the low bits of a float are its integer value. A saturating conversion would not vectorise.
    let rounded = (phase * (n as f32 / TAU) + 0.5).floor();
    ((rounded + 8_388_608.0).to_bits() & (n as u32 - 1)) as usize
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn linear_levels_follow_the_rule_and_wrap() {
        let r = Response::linear(8).unwrap();
        assert_eq!(r.level(0.0, 0), 0);
        assert_eq!(r.level(TAU / 2.0, 0), 128);
        assert_eq!(r.level(TAU * 255.4 / 256.0, 0), 255);
        assert_eq!(r.level(TAU * 255.6 / 256.0, 0), 0);
        let r = Response::linear(2).unwrap();
        assert_eq!(r.level(TAU * 0.24, 0), 1);
        assert_eq!(r.level(TAU * 0.9, 0), 0);
        assert!(Response::linear(0).is_err() && Response::linear(9).is_err());
    }

    #[test]
    fn every_level_shows_the_phase_that_asks_for_it() {
        let inverted = Response::lut(std::array::from_fn(|i| 255 - i as u8));
        let shallow = Response::lut(std::array::from_fn(|i| (i / 2) as u8 + 30));
        for r in [Response::linear(8).unwrap(), inverted, shallow] {
            for i in 0..256 {
                let phase = i as f32 / 256.0 * TAU;
                let shown = r.phase(r.level(phase, 0), 0);
                let error = (shown - phase).abs();
                assert!(error.min(TAU - error) < TAU / 256.0, "{i}: {shown}");
            }
        }
    }

    #[test]
    fn phases_become_the_level_that_is_nearest_around_the_turn() {
        let turns = [0.0, 0.1, 0.3, 0.35, 0.6, 0.9];
        let response = Response::of_turns(&turns).unwrap();
        for step in 0..256 {
            let turn = step as f64 / 256.0;
            let level = response.level(turn as f32 * TAU, 0);
            let apart = |l: usize| {
                let apart = (turns[l] - turn).abs();
                apart.min(1.0 - apart)
            };
            let best = (0..6).map(apart).fold(1.0, f64::min);
            assert!(apart(level.into()) < best + 1e-9, "{turn}: {level}");
            assert!((response.phase(level, 0) - turns[level as usize] as f32 * TAU).abs() < 1e-5);
        }
        // Half-way between the last level and the end of the turn.
        assert_eq!(response.level(0.96 * TAU, 0), 0);
        assert_eq!(response.level(0.94 * TAU, 0), 5);
        // In a panel of 1.5 turns, the upper levels are never used, but their phases are known.
        let over: Vec<f64> = (0..256).map(|l| 1.5 * f64::from(l) / 256.0).collect();
        let response = Response::of_turns(&over).unwrap();
        assert!((response.phase(192, 0) - 0.125 * TAU).abs() < 1e-5);
        for bad in [vec![], vec![0.0], vec![0.1, 0.2], vec![0.0, 0.5, 0.5], vec![0.0, 99.0]] {
            assert!(Response::of_turns(&bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn words_follow_the_rule() {
        let phases: Vec<f32> = (0..4096).map(|i| i as f32 / 4096.0 * TAU).collect();
        let mut words = vec![0; phases.len()];
        for bits in [8, 9, 10, 16] {
            linear_words(&phases, bits, &mut words);
            for (phase, word) in phases.iter().zip(&words) {
                let levels = f64::from(1u32 << bits);
                let exact = f64::from(*phase) / std::f64::consts::TAU * levels;
                let apart = (f64::from(*word) - exact).abs();
                assert!(apart.min(levels - apart) < 0.51, "{bits} {phase}");
            }
        }
    }

    #[test]
    fn the_slice_form_agrees() {
        let phases: Vec<f32> = (0..40_000).map(|i| i as f32 / 40_000.0 * TAU).collect();
        let mut levels = vec![0; phases.len()];
        for r in [
            Response::linear(5).unwrap(),
            Response::lut(std::array::from_fn(|i| (i * 7 % 256) as u8)),
        ] {
            r.levels(&phases, 0, &mut levels);
            assert!(phases.iter().zip(&levels).all(|(p, l)| r.level(*p, 0) == *l));
        }
    }
}
