//! What the numbers of a picture's red, green and blue mean: their primaries and their curve.

use crate::display::primaries::{D65, Matrix, inverse, times, white};

/// The meaning of a picture's red, green and blue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum RgbEncoding {
    /// sRGB (IEC 61966-2-1), and BT.709 video, which screens show alike.
    #[default]
    Srgb,
    /// Display P3: the primaries of DCI-P3, white D65 and the curve of sRGB. Photographs and videos of phones.
    DisplayP3,
    /// BT.2020 of standard dynamic range, with the curve of sRGB.
    Bt2020,
    /// BT.2020 with hybrid log-gamma (BT.2100). Light above the reference white of 203 cd/m² is brought below full
    /// light.
    Bt2020Hlg,
    /// BT.2020 with perceptual quantization (BT.2100, SMPTE ST 2084). As for hybrid log-gamma, light above the
    /// reference white is brought below full light.
    Bt2020Pq,
    /// Amplitudes of the lasers themselves: the value is the amplitude, its square is the light. This is the convention
    /// of the paper, its data sets and its networks' training.
    Amplitude,
}

/// The light of the reference white of BT.2408 in cd/m². It becomes almost full light, as the white of sRGB does.
const REFERENCE_WHITE: f64 = 203.0;
/// The brightest light of a high dynamic range picture that is told from brighter light, in cd/m².
const PEAK: f64 = 1000.0;

impl RgbEncoding {
    /// Every encoding.
    pub const ALL: [RgbEncoding; 6] = [
        RgbEncoding::Srgb,
        RgbEncoding::DisplayP3,
        RgbEncoding::Bt2020,
        RgbEncoding::Bt2020Hlg,
        RgbEncoding::Bt2020Pq,
        RgbEncoding::Amplitude,
    ];

    /// Returns the name in files and flags.
    pub fn name(self) -> &'static str {
        match self {
            RgbEncoding::Srgb => "srgb",
            RgbEncoding::DisplayP3 => "display-p3",
            RgbEncoding::Bt2020 => "bt2020",
            RgbEncoding::Bt2020Hlg => "bt2020-hlg",
            RgbEncoding::Bt2020Pq => "bt2020-pq",
            RgbEncoding::Amplitude => "amplitude",
        }
    }

    /// Returns the encoding with this name, or `None`.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|encoding| encoding.name() == name)
    }

    /// Returns whether light may exceed the reference white.
    pub fn is_high_dynamic_range(self) -> bool {
        matches!(self, RgbEncoding::Bt2020Hlg | RgbEncoding::Bt2020Pq)
    }

    /// Returns the matrix from linear red, green and blue to X, Y and Z, where white has Y = 1.
    pub fn to_xyz(self) -> [[f64; 3]; 3] {
        let primaries = match self {
            RgbEncoding::Srgb | RgbEncoding::Amplitude => [[0.64, 0.33], [0.3, 0.6], [0.15, 0.06]],
            RgbEncoding::DisplayP3 => [[0.68, 0.32], [0.265, 0.69], [0.15, 0.06]],
            RgbEncoding::Bt2020 | RgbEncoding::Bt2020Hlg | RgbEncoding::Bt2020Pq => {
                [[0.708, 0.292], [0.17, 0.797], [0.131, 0.046]]
            }
        };
        let columns = primaries.map(white);
        let matrix: Matrix = std::array::from_fn(|row| std::array::from_fn(|c| columns[c][row]));
        let powers = times(&inverse(&matrix).expect("three colours"), white(D65));
        matrix.map(|row| std::array::from_fn(|c| row[c] * powers[c]))
    }

    /// Returns the light of an encoded value in \[0, 1]: the fraction of full light; for perceptual quantization the
    /// multiple of the reference white, and for hybrid log-gamma the light of the scene, where 1 is the most.
    pub fn light(self, value: f64) -> f64 {
        match self {
            RgbEncoding::Amplitude => value * value,
            RgbEncoding::Srgb | RgbEncoding::DisplayP3 | RgbEncoding::Bt2020 => {
                if value <= 0.04045 {
                    value / 12.92
                } else {
                    ((value + 0.055) / 1.055).powf(2.4)
                }
            }
            RgbEncoding::Bt2020Hlg => {
                let (a, b, c) = (0.17883277, 0.28466892, 0.55991073);
                if value <= 0.5 {
                    value * value / 3.0
                } else {
                    (((value - c) / a).exp() + b) / 12.0
                }
            }
            RgbEncoding::Bt2020Pq => {
                let (m1, m2) = (2610.0 / 16384.0, 2523.0 / 4096.0 * 128.0);
                let (c1, c2, c3) = (3424.0 / 4096.0, 2413.0 / 4096.0 * 32.0, 2392.0 / 4096.0 * 32.0);
                let root = value.powf(1.0 / m2);
                let light = ((root - c1).max(0.0) / (c2 - c3 * root)).powf(1.0 / m1);
                10000.0 * light / REFERENCE_WHITE
            }
        }
    }

    /// Returns the factor from the light of a scene to that of a screen, in multiples of the reference white, for a
    /// scene of this luminance: the system gamma of hybrid log-gamma on a screen of 1000 cd/m², 1.2. Other encodings
    /// are of the screen's light.
    pub(super) fn gain(self, luminance: f64) -> f64 {
        match self {
            RgbEncoding::Bt2020Hlg => PEAK / REFERENCE_WHITE * luminance.max(0.0).powf(0.2),
            _ => 1.0,
        }
    }
}

/// Brings `value` from \[0, `most`] to \[0, 1]: values up to `from` stay, those above approach 1 on a hyperbola that
/// begins with slope 1 and takes `most` to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Knee {
    pub(super) from: f64,
    /// The rate of the hyperbola from + x/(1 + rate·x), where x is the excess over `from`.
    pub(super) rate: f64,
}

impl Knee {
    /// Returns the knee that takes `most` > 1 to 1.
    pub(super) fn new(from: f64, most: f64) -> Self {
        let (room, excess) = (1.0 - from, most - from);
        Knee {
            from,
            rate: (excess - room) / (room * excess),
        }
    }

    /// Returns the knee of high dynamic range: light up to 85 % of the reference white stays.
    pub(super) fn of_highlights() -> Self {
        Knee::new(0.85, PEAK / REFERENCE_WHITE)
    }

    /// Returns the value after the knee.
    pub(super) fn apply(&self, value: f64) -> f64 {
        let excess = (value - self.from).max(0.0);
        value.min(self.from) + excess / (1.0 + self.rate * excess)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// The values come from the standards: IEC 61966-2-1, BT.2100 (Table 5), BT.2408 (Table 1), ST 2084.
    #[test]
    fn the_curves_are_those_of_the_standards() {
        for (encoding, value, light) in [
            (RgbEncoding::Srgb, 0.5, 0.21404114),
            (RgbEncoding::Srgb, 0.04, 0.0030959752),
            (RgbEncoding::DisplayP3, 1.0, 1.0),
            (RgbEncoding::Bt2020Hlg, 0.5, 1.0 / 12.0),
            (RgbEncoding::Bt2020Hlg, 1.0, 1.0),
            (RgbEncoding::Bt2020Pq, 1.0, 10000.0 / 203.0),
            (RgbEncoding::Bt2020Pq, 0.58068888, 1.0),
            (RgbEncoding::Bt2020Pq, 0.0, 0.0),
        ] {
            let found = encoding.light(value);
            assert!(
                (found - light).abs() < 1e-5 * light.max(1e-2),
                "{encoding:?} {value}: {found}"
            );
        }
        // 75 % of hybrid log-gamma is the reference white.
        let scene = RgbEncoding::Bt2020Hlg.light(0.75);
        assert!((scene * RgbEncoding::Bt2020Hlg.gain(scene) - 1.0).abs() < 5e-3);
    }

    #[test]
    fn the_matrices_are_those_of_the_standards() {
        for (encoding, row, right) in [
            (RgbEncoding::Srgb, 1, [0.2126, 0.7152, 0.0722]),
            (RgbEncoding::Srgb, 0, [0.4124, 0.3576, 0.1805]),
            (RgbEncoding::DisplayP3, 1, [0.2290, 0.6917, 0.0793]),
            (RgbEncoding::Bt2020, 1, [0.2627, 0.6780, 0.0593]),
        ] {
            let found = encoding.to_xyz()[row];
            let near = found.iter().zip(right).all(|(a, b)| (a - b).abs() < 1e-4);
            assert!(near, "{encoding:?} {found:?}");
        }
    }

    #[test]
    fn names_are_read_back() {
        for encoding in RgbEncoding::ALL {
            assert_eq!(RgbEncoding::from_name(encoding.name()), Some(encoding));
        }
        assert_eq!(RgbEncoding::from_name("adobe"), None);
    }

    #[test]
    fn a_knee_rises_smoothly_to_one() {
        let knee = Knee::new(0.85, 5.0);
        assert_eq!(knee.apply(0.5), 0.5);
        assert!((knee.apply(5.0) - 1.0).abs() < 1e-12);
        let slope = |x: f64| (knee.apply(x + 1e-6) - knee.apply(x - 1e-6)) / 2e-6;
        assert!((slope(0.85) - 1.0).abs() < 1e-4);
        assert!((0..500).all(|i| slope(f64::from(i) / 100.0 + 0.01) > 0.0));
    }
}
