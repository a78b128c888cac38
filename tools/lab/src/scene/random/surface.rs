//! Textures of every spectrum: noise whose power falls as 1/f^0 to 1/f^3 down to two texels, single points, stripes,
//! checks, writing, gradients and plain surfaces, of any contrast, grey or with each colour on its own.
//!
//! Nothing here depends on the machine: chance comes from [`Dice`], sines and powers from `libm`.

use crate::scene::Texture;
use crate::scene::pattern::Pattern;
use crate::scene::random::parts::pattern;
use crate::scene::random::photographs::piece;
use phasefront_io::dice::Dice;
use std::f64::consts::TAU;

/// How often surfaces are of each kind, where a scene has no favourite: noise, points, stripes, checks, writing,
/// gradients, plain ones and patterns of [`pattern`].
const SHARES: [f64; 8] = [6.0, 0.6, 1.2, 0.7, 1.0, 0.5, 1.0, 2.0];
/// The place of points among them.
const POINTS: usize = 1;
/// How many times as often a scene's favourite is there.
const FAVOURITE: f64 = 40.0;

/// What the surfaces of one scene have in common.
pub(super) struct Surfaces<'a> {
    photographs: &'a [Texture],
    /// The brightness that surfaces lie about.
    exposure: f64,
    /// By what factor a surface's brightness differs from it at most.
    spread: f64,
    /// How far colours stand from grey, in [0, 1].
    colourfulness: f64,
    /// The share of surfaces on which each colour has a pattern of its own.
    own_colours: f64,
    /// Of what brightness leaves room for, how much textures vary by.
    contrast: [f64; 2],
    /// The share of surfaces that go from black to white.
    whole: f64,
    /// The exponents of 1/f^exponent that the power of noise falls by.
    exponents: [f64; 2],
    shares: [f64; 8],
}

impl<'a> Surfaces<'a> {
    pub(super) fn new(dice: &mut Dice, photographs: &'a [Texture]) -> Self {
        let mut shares = SHARES;
        if dice.chance(0.4) {
            shares[dice.weighted(&SHARES)] *= FAVOURITE;
        }
        let (low, high) = (dice.range(0.0, 3.0), dice.range(0.0, 3.0));
        Self {
            photographs,
            exposure: dice.range(0.06, 1.0),
            spread: dice.pick(&[1.05, 1.5, 2.5, 5.0]),
            colourfulness: dice.pick(&[0.0, 0.1, 0.3, 0.6, 1.0]),
            own_colours: dice.pick(&[0.0, 0.0, 0.2, 0.8]),
            contrast: dice.pick(&[[0.02, 0.3], [0.1, 1.0], [0.4, 1.0], [0.7, 1.0]]),
            whole: dice.pick(&[0.0, 0.25, 0.5, 0.9]),
            exponents: dice.pick(&[[0.0, 3.0], [0.0, 3.0], [low.min(high), low.max(high)]]),
            shares,
        }
    }

    /// The texture of one surface: a piece of a photograph, one of the kinds here, or two of them in a pattern.
    pub(super) fn texture(&self, dice: &mut Dice, size: (usize, usize)) -> Texture {
        if !self.photographs.is_empty() && dice.chance(0.35) {
            return piece(
                &self.photographs[dice.integer(0, self.photographs.len() - 1)],
                size,
                dice,
            );
        }
        let mut surface = self.one_kind(dice, size);
        if dice.chance(0.2) {
            let other = self.one_kind(dice, size);
            let mask = pattern(dice, size);
            for (index, (mine, its)) in surface.iter_mut().zip(other).enumerate() {
                let t = mask.at(index % size.0, index / size.0);
                *mine = std::array::from_fn(|c| mine[c] + t * (its[c] - mine[c]));
            }
        }
        let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
        let texels = surface.into_iter().map(|[r, g, b]| [byte(r), byte(g), byte(b), 255]);
        Texture::sized(size.0, size.1, texels.collect())
    }

    /// A colour of this scene, in [0, 1].
    pub(super) fn colour(&self, dice: &mut Dice) -> [f32; 3] {
        let brightness = self.exposure * dice.log_range(1.0 / self.spread, self.spread);
        let tint = self.colourfulness * dice.unit();
        let hues = [0; 3].map(|_| dice.range(-1.0, 1.0));
        hues.map(|hue| (brightness.min(1.0) * (1.0 + tint * hue)).clamp(0.0, 1.0) as f32)
    }

    /// The colours of a surface of one kind, row by row.
    fn one_kind(&self, dice: &mut Dice, size: (usize, usize)) -> Vec<[f32; 3]> {
        let kind = dice.weighted(&self.shares);
        let mean = self.colour(dice);
        let count = if dice.chance(self.own_colours) { 3 } else { 1 };
        let patterns: Vec<Pattern> = (0..count).map(|_| self.pattern(dice, kind, size)).collect();
        let [dark, bright] = self.ends(dice, mean);
        // Between black and white a power of the pattern brings about the mean.
        let powers = mean.map(|m| 1.0 / m.clamp(0.04, 0.96) - 1.0);
        let whole = dice.chance(if kind == POINTS { 0.8 } else { self.whole });
        (0..size.0 * size.1)
            .map(|index| {
                let (x, y) = (index % size.0, index / size.0);
                std::array::from_fn(|c| {
                    let v = patterns[c % count].at(x, y);
                    if whole {
                        libm::powf(v, powers[c])
                    } else {
                        dark[c] + (bright[c] - dark[c]) * v
                    }
                })
            })
            .collect()
    }

    /// The colours at a pattern's values 0 and 1, about `mean`.
    fn ends(&self, dice: &mut Dice, mean: [f32; 3]) -> [[f32; 3]; 2] {
        let contrast = dice.range(self.contrast[0], self.contrast[1]) as f32;
        let sign = if dice.chance(0.5) { 1.0 } else { -1.0 };
        [-sign, sign].map(|side| mean.map(|m| m + side * contrast * m.min(1.0 - m)))
    }

    fn pattern(&self, dice: &mut Dice, kind: usize, size: (usize, usize)) -> Pattern {
        let side = size.0.min(size.1) as f64;
        match kind {
            0 => self.noise(dice, size),
            POINTS => {
                let texels = (size.0 * size.1) as f64;
                let count = (texels * dice.log_range(3e-4, 0.05)).max(1.0) as usize;
                Pattern::points(size, count, dice.range(0.4, 1.3) as f32, dice)
            }
            2 => {
                let period = dice.log_range(2.0, side.max(4.0));
                Pattern::slanted_stripes(size, period, TAU * dice.unit(), dice.range(0.05, 1.0) as f32)
            }
            3 => Pattern::slanted_checks(size, dice.log_range(1.0, (side / 2.0).max(2.0)), TAU * dice.unit()),
            4 => {
                // Lines of 6 texels at least.
                let most = (size.1 / 6).clamp(1, 30);
                let lines = dice.integer(1, most);
                Pattern::strokes(size, lines, dice.range(0.08, 0.25) as f32, dice)
            }
            5 => Pattern::slanted_stripes(size, side * dice.log_range(1.5, 6.0), TAU * dice.unit(), 1.0),
            6 => Pattern::from_fn(size, |_, _| 0.5),
            _ => pattern(dice, size),
        }
    }

    /// Noise whose power falls as 1/f^exponent, from white noise to clouds; its contrast up to that of two tones.
    fn noise(&self, dice: &mut Dice, size: (usize, usize)) -> Pattern {
        let exponent = dice.range(self.exponents[0], self.exponents[1]);
        // An octave's power is 1/f^exponent times the area of its ring of frequencies, f².
        let roughness = libm::pow(2.0, (2.0 - exponent) / 2.0) as f32;
        let cells = dice.integer(1, 3);
        let stretch = dice.pick(&[1, 1, 1, 1, 1, 2, 6]);
        let noise = Pattern::noise(size, (cells, cells * stretch), 10, roughness, dice);
        let gain = dice.log_range(1.0, 8.0) as f32;
        Pattern::from_fn(size, |x, y| 0.5 + gain * (noise.at(x, y) - 0.5))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The part of a row's variance that differences of neighbours have: 1 of white noise, near 0 of clouds.
    fn roughness(pattern: &Pattern, side: usize) -> f64 {
        let row = |y: usize| (0..side).map(move |x| f64::from(pattern.at(x, y)));
        let (mut variance, mut steps) = (0.0, 0.0);
        for y in 0..side {
            let mean = row(y).sum::<f64>() / side as f64;
            variance += row(y).map(|v| (v - mean) * (v - mean)).sum::<f64>();
            steps += row(y)
                .zip(row(y).skip(1))
                .map(|(a, b)| 0.5 * (a - b) * (a - b))
                .sum::<f64>();
        }
        steps / variance
    }

    #[test]
    fn noise_has_the_spectrum_of_its_exponent() {
        let side = 128;
        let mut dice = Dice::new(1);
        let mut surfaces = Surfaces::new(&mut dice, &[]);
        let mut mean = |exponent: f64| {
            surfaces.exponents = [exponent; 2];
            let rough = |_| roughness(&surfaces.noise(&mut dice, (side, side)), side);
            (0..8).map(rough).sum::<f64>() / 8.0
        };
        let measured = [0.0, 1.0, 2.0, 3.0].map(&mut mean);
        // White noise over two texels each way, as the finest octave is, has one half.
        assert!((0.4..0.6).contains(&measured[0]) && measured[3] < 0.1, "{measured:.3?}");
        assert!(
            measured.windows(2).all(|pair| pair[1] < 0.85 * pair[0]),
            "{measured:.3?}"
        );
    }
}
