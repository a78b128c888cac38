//! Textures of every spectrum: noise whose power falls as 1/f^0 to 1/f^3 down to two texels, single points, stripes,
//! checks, writing, gradients and plain surfaces. They have any contrast, in grey or with each colour on its own.
//!
//! The textures do not depend on the machine: random numbers come from [`Dice`], sines and powers from `libm`.

use crate::scene::Texture;
use crate::scene::pattern::Pattern;
use crate::scene::random::parts::pattern;
use crate::scene::random::photographs::piece;
use phasefront::Size;
use phasefront_io::dice::Dice;
use std::f64::consts::TAU;

/// The relative frequencies of the kinds of surfaces in a scene without a favourite: noise, points, stripes, checks,
/// writing, gradients, plain surfaces and patterns of [`pattern`].
const SHARES: [f64; 8] = [6.0, 0.6, 1.2, 0.7, 1.0, 0.5, 1.0, 2.0];
/// The index of points in [`SHARES`].
const POINTS: usize = 1;
/// The factor by which a scene's favourite kind is more frequent.
const FAVOURITE: f64 = 40.0;

/// The common properties of the surfaces of one scene.
pub(super) struct Surfaces<'a> {
    photographs: &'a [Texture],
    /// The typical brightness of surfaces.
    exposure: f64,
    /// The largest factor between a surface's brightness and the typical one.
    spread: f64,
    /// The distance of colours from grey, in [0, 1].
    colourfulness: f64,
    /// The share of surfaces on which each colour has its own pattern.
    own_colours: f64,
    /// The range of the textures' contrast, as a fraction of the contrast that the brightness allows.
    contrast: [f64; 2],
    /// The share of surfaces that range from black to white.
    whole: f64,
    /// The range of the exponent in 1/f^exponent, the power of noise.
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

    /// Returns surfaces of medium brightness with textures of high contrast: noise of every spectrum, stripes, checks,
    /// plain surfaces and patterns.
    pub(super) fn hard() -> Self {
        Self {
            photographs: &[],
            exposure: 0.5,
            spread: 1.5,
            colourfulness: 0.6,
            own_colours: 0.5,
            contrast: [0.4, 1.0],
            whole: 0.3,
            exponents: [0.0, 3.0],
            shares: [6.0, 0.0, 2.0, 1.0, 0.0, 0.0, 2.0, 1.0],
        }
    }

    /// Makes the texture of one surface: a piece of a photograph, one of the kinds of this module, or two of them in a
    /// pattern.
    pub(super) fn texture(&self, dice: &mut Dice, size: Size) -> Texture {
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
                let t = mask.at(index % size.width, index / size.width);
                *mine = std::array::from_fn(|c| mine[c] + t * (its[c] - mine[c]));
            }
        }
        let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
        let texels = surface.into_iter().map(|[r, g, b]| [byte(r), byte(g), byte(b), 255]);
        Texture::sized(size, texels.collect())
    }

    /// Returns a colour of this scene, in [0, 1].
    pub(super) fn colour(&self, dice: &mut Dice) -> [f32; 3] {
        let brightness = self.exposure * dice.log_range(1.0 / self.spread, self.spread);
        let tint = self.colourfulness * dice.unit();
        let hues = [0; 3].map(|_| dice.range(-1.0, 1.0));
        hues.map(|hue| (brightness.min(1.0) * (1.0 + tint * hue)).clamp(0.0, 1.0) as f32)
    }

    /// Returns the colours of a surface of one kind, row by row.
    fn one_kind(&self, dice: &mut Dice, size: Size) -> Vec<[f32; 3]> {
        let kind = dice.weighted(&self.shares);
        let mean = self.colour(dice);
        let count = if dice.chance(self.own_colours) { 3 } else { 1 };
        let patterns: Vec<Pattern> = (0..count).map(|_| self.pattern(dice, kind, size)).collect();
        let [dark, bright] = self.ends(dice, mean);
        // Between black and white, a power of the pattern gives approximately the mean.
        let powers = mean.map(|m| 1.0 / m.clamp(0.04, 0.96) - 1.0);
        let whole = dice.chance(if kind == POINTS { 0.8 } else { self.whole });
        (0..size.pixels())
            .map(|index| {
                let (x, y) = (index % size.width, index / size.width);
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

    /// Returns the colours at a pattern's values 0 and 1, around `mean`.
    fn ends(&self, dice: &mut Dice, mean: [f32; 3]) -> [[f32; 3]; 2] {
        let contrast = dice.range(self.contrast[0], self.contrast[1]) as f32;
        let sign = if dice.chance(0.5) { 1.0 } else { -1.0 };
        [-sign, sign].map(|side| mean.map(|m| m + side * contrast * m.min(1.0 - m)))
    }

    fn pattern(&self, dice: &mut Dice, kind: usize, size: Size) -> Pattern {
        let side = size.width.min(size.height) as f64;
        match kind {
            0 => self.noise(dice, size),
            POINTS => {
                let texels = (size.width * size.height) as f64;
                let count = (texels * dice.log_range(3e-4, 0.05)).max(1.0) as usize;
                Pattern::points(size, count, dice.range(0.4, 1.3) as f32, dice)
            }
            2 => {
                let period = dice.log_range(2.0, side.max(4.0));
                Pattern::slanted_stripes(size, period, TAU * dice.unit(), dice.range(0.05, 1.0) as f32)
            }
            3 => Pattern::slanted_checks(size, dice.log_range(1.0, (side / 2.0).max(2.0)), TAU * dice.unit()),
            4 => {
                // Lines are at least 6 texels high.
                let most = (size.height / 6).clamp(1, 30);
                let lines = dice.integer(1, most);
                Pattern::strokes(size, lines, dice.range(0.08, 0.25) as f32, dice)
            }
            5 => Pattern::slanted_stripes(size, side * dice.log_range(1.5, 6.0), TAU * dice.unit(), 1.0),
            6 => Pattern::from_fn(size, |_, _| 0.5),
            _ => pattern(dice, size),
        }
    }

    /// Makes noise whose power falls as 1/f^exponent, from white noise to clouds. Its contrast reaches up to that of
    /// two tones.
    fn noise(&self, dice: &mut Dice, size: Size) -> Pattern {
        let exponent = dice.range(self.exponents[0], self.exponents[1]);
        // The power of an octave is 1/f^exponent times the area of its ring of frequencies, f².
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

    /// Returns the share of a row's variance in the differences of neighbours: 1 for white noise, near 0 for clouds.
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
            let rough = |_| {
                roughness(
                    &surfaces.noise(
                        &mut dice,
                        Size {
                            width: side,
                            height: side,
                        },
                    ),
                    side,
                )
            };
            (0..8).map(rough).sum::<f64>() / 8.0
        };
        let measured = [0.0, 1.0, 2.0, 3.0].map(&mut mean);
        // The finest octave is white noise over two texels in each direction, so its roughness is one half.
        assert!((0.4..0.6).contains(&measured[0]) && measured[3] < 0.1, "{measured:.3?}");
        assert!(
            measured.windows(2).all(|pair| pair[1] < 0.85 * pair[0]),
            "{measured:.3?}"
        );
    }
}
