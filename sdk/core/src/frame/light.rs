//! Conversion of encoded colours to the amplitudes of a display's lasers. The oracle is
//! [`super::reference::amplitudes`].
//!
//! A curve gives the light of each value, and a matrix the light of each laser: the picture's primaries and the lasers'
//! meet in X, Y and Z, both with white D65. Light that the lasers cannot show lies outside 0..=1, and is brought in
//! along the line to white, which keeps the hue: colours nearer to the edge of what the lasers show than the picture's
//! most saturated colour lies beyond it are compressed, all others stay. The amplitude is the root of the light. One
//! laser shows the luminance.

use super::encoding::{Knee, RgbEncoding};
use crate::Bounds;
use crate::display::Display;
use crate::display::primaries::{Matrix, inverse, product, transposed};
use crate::parallel::prelude::*;
use phasefront_kernels::wide;

/// The number of intervals of a [`Table`].
const INTERVALS: usize = 1 << 10;
/// The number of pixels that a thread converts at once.
const PART: usize = 1 << 12;

/// A function on \[0, 1] by linear interpolation.
#[derive(Clone)]
struct Table(Box<[[f32; 2]; 2 * INTERVALS]>);

impl Table {
    fn new(function: impl Fn(f64) -> f64) -> Self {
        let at = |i: usize| function(i as f64 / INTERVALS as f64);
        let mut table = Box::new([[0.0; 2]; 2 * INTERVALS]);
        for (i, entry) in table[..INTERVALS].iter_mut().enumerate() {
            *entry = [at(i) as f32, (at(i + 1) - at(i)) as f32];
        }
        table[INTERVALS] = [at(INTERVALS) as f32, 0.0];
        Table(table)
    }

    /// Returns the function at `x` in \[0, 1].
    #[inline(always)]
    fn at(&self, x: f32) -> f32 {
        // The upper bits of 1 + x count the intervals. Masking them needs no check of bounds.
        const BELOW: u32 = 23 - INTERVALS.trailing_zeros();
        let interval = ((1.0 + x).to_bits() - 1f32.to_bits()) >> BELOW;
        let [value, rise] = self.0[interval as usize % (2 * INTERVALS)];
        value + (x * INTERVALS as f32 - interval as f32) * rise
    }
}

/// The curve of an encoding.
#[derive(Clone)]
enum Curve {
    Srgb,
    Other(Table),
}

impl Curve {
    fn new(encoding: RgbEncoding) -> Self {
        if encoding.is_high_dynamic_range() {
            Curve::Other(Table::new(|value| encoding.light(value)))
        } else {
            Curve::Srgb
        }
    }

    /// Replaces values in \[0, 1] by their light.
    fn apply(&self, row: &mut [f32]) {
        match self {
            Curve::Srgb => wide!(for value in row.iter_mut() {
                *value = srgb_light(*value);
            }),
            Curve::Other(table) => wide!(for value in row.iter_mut() {
                *value = table.at(*value);
            }),
        }
    }
}

/// Returns the light of an sRGB value in \[0, 1] to 1e-5 of it, in operations that vectors have: u^2.4 is u² times a
/// polynomial in √u, fitted to u^0.4 for the smallest relative error and exact at 1.
#[inline(always)]
fn srgb_light(value: f32) -> f32 {
    const FITTED: [f32; 6] = [0.03589631, 1.3350097, -0.79768395, 0.7521987, -0.43172368, 0.10630292];
    let u = value * (1.0 / 1.055) + 0.055 / 1.055;
    let root = u.sqrt();
    let [a, b, c, d, e, f] = FITTED;
    let curved = u * u * (a + root * (b + root * (c + root * (d + root * (e + root * f)))));
    if value <= 0.04045 {
        value * (1.0 / 12.92)
    } else {
        curved
    }
}

/// A plan that converts the colours of one encoding to amplitudes of the lasers of one display. It is immutable and can
/// be shared between threads.
#[derive(Clone)]
pub struct LightPlan {
    encoding: RgbEncoding,
    curve: Curve,
    highlights: Option<Highlights>,
    lasers: Lasers,
}

/// The system gamma and the knee of high dynamic range.
#[derive(Clone)]
struct Highlights {
    /// The gain by the fourth root of the luminance.
    gain: Option<Table>,
    luminance: [f32; 3],
    knee: [f32; 2],
}

#[derive(Clone)]
enum Lasers {
    One([f32; 3]),
    Three([[f32; 3]; 3], Gamut),
}

/// The compression of saturated colours, by the saturation 1 − least/most of the light of the three lasers, which is 1
/// at the edge of what they show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gamut {
    /// The knee of the saturation; one that begins at infinity changes nothing.
    pub(super) knee: Knee,
}

impl Gamut {
    /// The least saturation that is compressed. Below it colours stay, whatever the lasers.
    const LEAST: f64 = 0.8;

    /// Returns the compression for colours that `matrix` takes to the light of the lasers.
    pub(super) fn new(matrix: &Matrix) -> Self {
        let saturation = |colour: [f64; 3]| {
            let most = colour.iter().copied().fold(0.0, f64::max);
            1.0 - colour.iter().copied().fold(f64::INFINITY, f64::min) / most
        };
        // The primaries are the most saturated colours of a picture.
        let most = transposed(matrix).map(saturation).into_iter().fold(0.0, f64::max);
        let knee = if most > 1.0 {
            Knee::new((2.0 - most).max(Self::LEAST), most)
        } else {
            Knee {
                from: f64::INFINITY,
                rate: 0.0,
            }
        };
        Gamut { knee }
    }

    /// Brings the light of three lasers inside.
    #[inline(always)]
    fn compress(&self, [red, green, blue]: [&mut [f32]; 3]) {
        let (from, rate) = (self.knee.from as f32, self.knee.rate as f32);
        for ((r, g), b) in red.iter_mut().zip(green).zip(blue) {
            let most = r.at_least(*g).at_least(*b);
            let saturation = (most - r.at_most(*g).at_most(*b)) / most.at_least(f32::MIN_POSITIVE);
            let excess = (saturation - from).at_least(0.0);
            let kept = saturation.at_most(from) + excess / (1.0 + rate * excess);
            let factor = kept / saturation.at_least(f32::MIN_POSITIVE);
            let full = 1.0 / most.at_least(1.0);
            for light in [r, g, b] {
                *light = (most - factor * (most - *light)) * full;
            }
        }
    }
}

/// The numbers that convert one encoding's colours to the light of three lasers, for a GPU's program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightConstants {
    /// The encoding.
    pub encoding: RgbEncoding,
    /// The matrix from linear colours to the light of the lasers, row by row.
    pub matrix: [[f32; 3]; 3],
    /// The weights of red, green and blue in the luminance.
    pub luminance: [f32; 3],
    /// Where the knee of saturation begins and its rate. A knee that begins above every saturation changes nothing.
    pub gamut: [f32; 2],
    /// Where the knee of high dynamic range begins and its rate.
    pub highlights: [f32; 2],
    /// The light of 1 in hybrid log-gamma, and of 10000 cd/m², in multiples of the reference white.
    pub full: [f32; 2],
}

impl LightConstants {
    /// Returns the numbers for three lasers.
    pub fn new(encoding: RgbEncoding, display: &Display) -> Self {
        let matrix = to_lasers(encoding, display);
        let (gamut, highlights) = (Gamut::new(&matrix).knee, Knee::of_highlights());
        LightConstants {
            encoding,
            matrix: matrix.map(single),
            luminance: single(encoding.to_xyz()[1]),
            gamut: [gamut.from.min(1e30) as f32, gamut.rate as f32],
            highlights: [highlights.from as f32, highlights.rate as f32],
            full: [
                RgbEncoding::Bt2020Hlg.gain(1.0) as f32,
                RgbEncoding::Bt2020Pq.light(1.0) as f32,
            ],
        }
    }
}

/// Returns the matrix from linear colours of `encoding` to the light of three lasers. Lasers that mix no D65 get the
/// red, green and blue of sRGB.
pub(super) fn to_lasers(encoding: RgbEncoding, display: &Display) -> Matrix {
    let lasers = display.primaries().unwrap_or_else(|| RgbEncoding::Srgb.to_xyz());
    let from_xyz = inverse(&lasers).expect("three colours that mix white");
    product(&from_xyz, &encoding.to_xyz())
}

fn single(row: [f64; 3]) -> [f32; 3] {
    row.map(|v| v as f32)
}

impl LightPlan {
    /// Plans the conversion of colours in `encoding` for the lasers of `display`. Returns `None` for amplitudes, which
    /// need none.
    pub fn new(encoding: RgbEncoding, display: &Display) -> Option<Self> {
        if encoding == RgbEncoding::Amplitude {
            return None;
        }
        let [_, luminance, _] = encoding.to_xyz();
        let highlights = encoding.is_high_dynamic_range().then(|| {
            let knee = Knee::of_highlights();
            let has_gain = encoding == RgbEncoding::Bt2020Hlg;
            Highlights {
                gain: has_gain.then(|| Table::new(|root| encoding.gain(root.powi(4)))),
                luminance: single(luminance),
                knee: [knee.from as f32, knee.rate as f32],
            }
        });
        let lasers = if display.colours() == 3 {
            let matrix = to_lasers(encoding, display);
            Lasers::Three(matrix.map(single), Gamut::new(&matrix))
        } else {
            Lasers::One(single(luminance))
        };
        Some(LightPlan {
            encoding,
            curve: Curve::new(encoding),
            highlights,
            lasers,
        })
    }

    /// Returns the encoding of the colours.
    pub fn encoding(&self) -> RgbEncoding {
        self.encoding
    }

    /// Converts encoded colours, rows of red, green and blue in \[0, 1], to amplitudes of three lasers in place.
    pub(super) fn convert_rows(&self, rows: [&mut [f32]; 3]) {
        let [red, green, blue] = rows;
        self.decode([&mut *red, &mut *green, &mut *blue]);
        match &self.lasers {
            Lasers::Three(matrix, gamut) => mix(matrix, gamut, [red, green, blue]),
            Lasers::One(_) => unreachable!("one laser's amplitudes are made from a picture"),
        }
    }

    /// Converts an encoded picture, (3, H, W) in \[0, 1], to amplitudes, (C, H, W), on the current thread pool. Does
    /// not allocate.
    ///
    /// # Panics
    /// Panics if `amplitude` does not have C·H·W values for the display's C lasers.
    pub fn convert(&self, rgb: &[f32], amplitude: &mut [f32]) {
        let size = rgb.len() / 3;
        let plane = |c: usize, part: usize, len: usize| &rgb[c * size + part * PART..][..len];
        match &self.lasers {
            Lasers::One(weights) => {
                assert_eq!(amplitude.len(), size);
                amplitude.par_chunks_mut(PART).enumerate().for_each(|(part, out)| {
                    let mut rows = [[0.0; PART]; 3];
                    let len = out.len();
                    let rows = rows.each_mut().map(|row| &mut row[..len]);
                    let [red, green, blue] = rows;
                    red.copy_from_slice(plane(0, part, len));
                    green.copy_from_slice(plane(1, part, len));
                    blue.copy_from_slice(plane(2, part, len));
                    self.decode([&mut *red, &mut *green, &mut *blue]);
                    wide!({
                        for (((to, r), g), b) in out.iter_mut().zip(&*red).zip(&*green).zip(&*blue) {
                            let light = weights[0] * r + weights[1] * g + weights[2] * b;
                            *to = light.sqrt().at_most(1.0);
                        }
                    });
                });
            }
            Lasers::Three(..) => {
                assert_eq!(amplitude.len(), 3 * size);
                let (red, others) = amplitude.split_at_mut(size);
                let (green, blue) = others.split_at_mut(size);
                (red.par_chunks_mut(PART))
                    .zip(green.par_chunks_mut(PART))
                    .zip(blue.par_chunks_mut(PART))
                    .enumerate()
                    .for_each(|(part, ((red, green), blue))| {
                        let len = red.len();
                        red.copy_from_slice(plane(0, part, len));
                        green.copy_from_slice(plane(1, part, len));
                        blue.copy_from_slice(plane(2, part, len));
                        self.convert_rows([red, green, blue]);
                    });
            }
        }
    }

    /// Replaces encoded colours by their linear light in \[0, 1].
    fn decode(&self, rows: [&mut [f32]; 3]) {
        let [red, green, blue] = rows;
        for row in [&mut *red, &mut *green, &mut *blue] {
            self.curve.apply(row);
        }
        let Some(highlights) = &self.highlights else {
            return;
        };
        let [from, rate] = highlights.knee;
        match &highlights.gain {
            Some(table) => {
                let [wr, wg, wb] = highlights.luminance;
                wide!(for ((r, g), b) in red.iter_mut().zip(&mut *green).zip(&mut *blue) {
                    let luminance = wr * *r + wg * *g + wb * *b;
                    let gain = table.at(luminance.sqrt().sqrt().at_most(1.0));
                    (*r, *g, *b) = below_full([*r, *g, *b], gain, from, rate).into();
                });
            }
            None => wide!(for ((r, g), b) in red.iter_mut().zip(&mut *green).zip(&mut *blue) {
                (*r, *g, *b) = below_full([*r, *g, *b], 1.0, from, rate).into();
            }),
        }
    }
}

/// Returns a colour of high dynamic range, multiplied by `gain`, below full light: one factor for all three keeps their
/// hue. The knee begins at `from`.
#[inline(always)]
fn below_full(colour: [f32; 3], gain: f32, from: f32, rate: f32) -> [f32; 3] {
    let [r, g, b] = colour;
    let most = gain * r.at_least(g).at_least(b);
    let excess = (most - from).at_least(0.0);
    let kept = most.at_most(from) + excess / (1.0 + rate * excess);
    let factor = gain * (kept.at_most(1.0) / most.at_least(f32::MIN_POSITIVE));
    colour.map(|light| factor * light)
}

/// Converts linear colours to amplitudes of three lasers in place.
fn mix(matrix: &[[f32; 3]; 3], gamut: &Gamut, [red, green, blue]: [&mut [f32]; 3]) {
    /// The pixels that are checked for colours outside before they are compressed.
    const RUN: usize = 64;
    /// Light above full light that is rounding.
    const ROUNDING: f32 = 1e-4;
    let least_share = 1.0 - gamut.knee.from as f32;
    let [mr, mg, mb] = *matrix;
    wide!({
        let runs = (red.chunks_mut(RUN))
            .zip(green.chunks_mut(RUN))
            .zip(blue.chunks_mut(RUN));
        for ((red, green), blue) in runs {
            let mut outside = 0;
            for ((to_r, to_g), to_b) in red.iter_mut().zip(&mut *green).zip(&mut *blue) {
                let light = |m: [f32; 3]| m[0] * *to_r + m[1] * *to_g + m[2] * *to_b;
                let (r, g, b) = (light(mr), light(mg), light(mb));
                let (most, least) = (r.at_least(g).at_least(b), r.at_most(g).at_most(b));
                outside |= u32::from(least < least_share * most) | u32::from(most > 1.0 + ROUNDING);
                (*to_r, *to_g, *to_b) = (r, g, b);
            }
            if outside > 0 {
                gamut.compress([&mut *red, &mut *green, &mut *blue]);
            }
            for row in [red, green, blue] {
                for light in row {
                    *light = light.clamp(0.0, 1.0).sqrt();
                }
            }
        }
    });
}

/// Returns the matrix, row by row, from the light of the lasers of `display`, the squares of their amplitudes, to
/// linear sRGB. One laser is white: its matrix has ones in its first column and zeros in the others.
pub fn light_to_srgb(display: &Display) -> [[f32; 3]; 3] {
    if display.colours() == 1 {
        return [[1.0, 0.0, 0.0]; 3];
    }
    let back = inverse(&to_lasers(RgbEncoding::Srgb, display)).expect("three colours that mix white");
    back.map(single)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::reference;
    use super::*;
    use crate::display::primaries::times;

    /// Pictures' colours: corners, greys, dark colours and random ones, in three planes.
    fn colours() -> Vec<[f32; 3]> {
        let mut state = 7u32;
        let mut random = || {
            state = state.wrapping_mul(1664525).wrapping_add(1013904223);
            (state >> 8) as f32 / (1u32 << 24) as f32
        };
        let corners = (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2 & 1].map(|v| v as f32));
        let greys = (0..=255).map(|v| [v as f32 / 255.0; 3]);
        let mut all: Vec<_> = corners.chain(greys).collect();
        all.extend((0..5000).map(|_| [random(), random(), random()]));
        all
    }

    fn planes(colours: &[[f32; 3]]) -> Vec<f32> {
        (0..3)
            .flat_map(|c| colours.iter().map(move |colour| colour[c]))
            .collect()
    }

    #[test]
    fn amplitudes_are_those_of_the_definition() {
        let colours = colours();
        for toml in [
            "",
            "wavelengths_nm = [638, 532, 450]",
            "wavelengths_nm = [660, 532, 473]\npowers = [1, 1, 1]",
            "wavelengths_nm = [532, 532, 532]",
            "wavelengths_nm = [532]",
        ] {
            let display = Display::from_toml(toml).unwrap();
            for encoding in RgbEncoding::ALL {
                let Some(plan) = LightPlan::new(encoding, &display) else {
                    assert_eq!(encoding, RgbEncoding::Amplitude);
                    continue;
                };
                let mut amplitude = vec![f32::NAN; display.colours() * colours.len()];
                plan.convert(&planes(&colours), &mut amplitude);
                for (i, colour) in colours.iter().enumerate() {
                    let right = reference::amplitudes(colour.map(f64::from), encoding, &display);
                    for (c, right) in right.into_iter().enumerate() {
                        let found = f64::from(amplitude[c * colours.len() + i]);
                        // A dark value of perceptual quantization is the difference of two interpolated ones.
                        let most = if encoding.is_high_dynamic_range() { 2e-3 } else { 2e-5 };
                        assert!(
                            (found - right).abs() < most,
                            "{toml} {encoding:?} {colour:?} {c}: {found} {right}"
                        );
                    }
                }
            }
        }
    }

    /// White is full light of all lasers, black is none, and grey is the root of its light on every laser.
    #[test]
    fn greys_are_equal_light_of_all_lasers() {
        let plan = LightPlan::new(RgbEncoding::Srgb, &Display::default()).unwrap();
        for value in [0.0f32, 0.2, 0.5, 1.0] {
            let mut amplitude = [0.0; 3];
            plan.convert(&[value; 3], &mut amplitude);
            let right = RgbEncoding::Srgb.light(f64::from(value)).sqrt();
            assert!(
                amplitude.iter().all(|a| (f64::from(*a) - right).abs() < 1e-5),
                "{value}: {amplitude:?}"
            );
        }
        let unbalanced = Display::from_toml("powers = [1, 1, 1]").unwrap();
        let plan = LightPlan::new(RgbEncoding::Srgb, &unbalanced).unwrap();
        let mut amplitude = [0.0; 3];
        plan.convert(&[1.0; 3], &mut amplitude);
        let light = amplitude.map(|a| a * a);
        assert!(
            (light[0] - 1.0).abs() < 1e-3 && (light[1] - 0.691).abs() < 1e-3,
            "{light:?}"
        );
    }

    /// What lies inside stays exactly; what lies outside keeps its hue: the light stays on the line to white.
    #[test]
    fn colours_outside_keep_their_hue() {
        let display = Display::from_toml("wavelengths_nm = [638, 532, 450]").unwrap();
        let plan = LightPlan::new(RgbEncoding::Srgb, &display).unwrap();
        let matrix = to_lasers(RgbEncoding::Srgb, &display);
        for colour in [[0.0, 0.0, 1.0], [0.05, 0.0, 0.7], [0.5, 0.4, 0.3]] {
            let mut amplitude = [0.0; 3];
            plan.convert(&colour.map(|v: f64| v as f32), &mut amplitude);
            let light = amplitude.map(|a| f64::from(a * a));
            let aim = times(&matrix, colour.map(|v| RgbEncoding::Srgb.light(v)));
            // The differences of the lasers' light keep their ratio.
            let (a, b) = (light[2] - light[0], light[1] - light[0]);
            let (c, d) = (aim[2] - aim[0], aim[1] - aim[0]);
            assert!(
                (a * d - b * c).abs() < 1e-4 * a.hypot(b) * c.hypot(d),
                "{colour:?} {light:?} {aim:?}"
            );
            let outside = aim.iter().any(|v| *v < 0.0);
            let moved = light.iter().zip(aim).any(|(a, b)| (a - b).abs() > 1e-4);
            assert_eq!(outside, moved, "{colour:?}");
        }
    }

    #[test]
    fn the_light_of_lasers_is_srgb_again() {
        let display = Display::default();
        let plan = LightPlan::new(RgbEncoding::Srgb, &display).unwrap();
        let back = light_to_srgb(&display);
        for colour in [[0.8f32, 0.2, 0.1], [0.3, 0.6, 0.4], [0.9, 0.9, 0.95]] {
            let mut amplitude = [0.0; 3];
            plan.convert(&colour, &mut amplitude);
            for c in 0..3 {
                let light: f32 = (0..3).map(|laser| back[c][laser] * amplitude[laser].powi(2)).sum();
                assert!((f64::from(light) - RgbEncoding::Srgb.light(f64::from(colour[c]))).abs() < 1e-4);
            }
        }
        let one = Display::from_toml("wavelengths_nm = [532]").unwrap();
        assert_eq!(light_to_srgb(&one), [[1.0, 0.0, 0.0]; 3]);
    }
}
