//! Phase to modulator levels and back: the linear response, a 256-entry look-up table for the whole
//! modulator, or a table for each pixel, [`per_pixel`]; the tables are what a calibration measured.

pub mod per_pixel;

use crate::runtime::error::{Error, Result};
use per_pixel::PerPixel;
use phasefront_kernels::wide;
use std::f32::consts::TAU;
use std::sync::Arc;

/// What a modulator answers to a phase. Immutable; shared between threads.
#[derive(Debug, Clone, PartialEq)]
pub enum Response {
    /// Level round(φ/2π·2^bits) mod 2^bits.
    Linear {
        /// Bits of a level, 1 to 8.
        bits: u32,
    },
    /// The phase is rounded to one of 256 steps of 2π/256, and `level[step]` shows it.
    Lut {
        /// The level that shows each step.
        level: Box<[u8; 256]>,
        /// For each level the middle of the steps that it shows; for a level that no step uses, the
        /// phase of the nearest one that does.
        phase: Box<[f32; 256]>,
    },
    /// Each pixel of each colour has its own curve. It comes with a calibrated target's file.
    #[doc(hidden)]
    PerPixel(Arc<PerPixel>),
}

impl Response {
    /// The linear response.
    ///
    /// # Errors
    /// `bits` outside 1..=8.
    pub fn linear(bits: u32) -> Result<Self> {
        if !(1..=8).contains(&bits) {
            return Err(Error::Setting(format!(
                "a modulator of {bits} bits has no 8-bit levels; bits must lie in 1..=8"
            )));
        }
        Ok(Response::Linear { bits })
    }

    /// The response of a calibrated modulator: `level[i]` shows the phase 2πi/256.
    pub fn lut(level: [u8; 256]) -> Self {
        let mut used: [Option<f32>; 256] = [None; 256];
        for shown in 0..=255u8 {
            // The steps of one level may wrap around 2π, so their middle is that of unit vectors.
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

    /// The response of a modulator whose level l shows `turns[l]` of 2π, in rising order from 0 on: a phase becomes
    /// the level whose phase, modulo 2π, is nearest, the higher of two that are as near. Above 2π only what the first
    /// turn does not hold is used.
    ///
    /// # Errors
    /// Fewer than 2 or more than 256 levels, or phases that do not rise from 0, up to 4 turns.
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
            // Level 0 stands at the turn's end too.
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

    /// The response of the (`height`, `width`) pixels in the middle of the modulator, where a smaller hologram stands.
    ///
    /// # Errors
    /// A table for fewer pixels.
    #[doc(hidden)]
    pub fn centred(self, height: usize, width: usize) -> Result<Self> {
        match self {
            Response::PerPixel(table) if table.shape() != (height, width) => {
                Ok(Response::PerPixel(table.centred(height, width)?.into()))
            }
            same => Ok(same),
        }
    }

    /// The shape that the response is made for, (H, W); None where it suits any.
    #[doc(hidden)]
    pub fn shape(&self) -> Option<(usize, usize)> {
        match self {
            Response::PerPixel(table) => Some(table.shape()),
            _ => None,
        }
    }

    /// The level that shows `phase`, in \[0, 2π), at value `at` of a stack (C, H, W).
    ///
    /// # Panics
    /// If `at` is outside the shape that the response is made for.
    #[doc(hidden)]
    pub fn level(&self, phase: f32, at: usize) -> u8 {
        match self {
            Response::Linear { bits } => step(phase, 1 << bits) as u8,
            Response::Lut { level, .. } => level[step(phase, 256)],
            Response::PerPixel(table) => table.level(phase, at),
        }
    }

    /// The phase that `level` shows, in \[0, 2π), at value `at` of a stack (C, H, W).
    ///
    /// # Panics
    /// As [`Self::level`].
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

    /// [`Self::level`] of each phase of a row or part of one, which begins at value `first` of a stack
    /// (C, H, W). Allocates nothing.
    ///
    /// # Panics
    /// If the lengths differ, or the response is made for a shape whose row ends before.
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

/// `phase` brought to \[0, 2π).
pub fn wrap(phase: f32) -> f32 {
    let wrapped = phase.rem_euclid(TAU);
    // rem_euclid of a tiny negative number rounds up to 2π itself.
    if wrapped < TAU { wrapped } else { 0.0 }
}

/// The linear response of a modulator of `bits`, 1 to 16, whose levels do not fit bytes. Allocates nothing.
///
/// # Panics
/// If the lengths differ.
pub fn linear_words(phases: &[f32], bits: u32, words: &mut [u16]) {
    assert_eq!(phases.len(), words.len());
    wide!(for (word, phase) in words.iter_mut().zip(phases) {
        *word = step(*phase, 1 << bits) as u16;
    });
}

/// round(φ/2π·n) mod n, for n a power of two up to 65536.
#[inline(always)]
fn step(phase: f32, n: i32) -> usize {
    // From 2²³ on a number's low bits are the integer that it is; a conversion that saturates would not vectorise.
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
        // Half-way from the last level to the turn.
        assert_eq!(response.level(0.96 * TAU, 0), 0);
        assert_eq!(response.level(0.94 * TAU, 0), 5);
        // A panel of 1.5 turns: what its upper levels show is known, though none is asked for.
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
