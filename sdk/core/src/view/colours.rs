//! The colours of a view on a screen: amplitudes of laser light become bytes of a picture.

use crate::Bounds;
use crate::display::Display;
use crate::frame::{RgbEncoding, light_to_srgb};
use phasefront_kernels::wide;
use std::sync::LazyLock;

/// How a view's amplitudes become a picture's red, green and blue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ViewColours {
    /// The amplitude is the value, as in pictures of [`RgbEncoding::Amplitude`].
    Amplitude,
    /// The light, the square of the amplitude, is shown in its own colour, in sRGB, by this matrix from the light of
    /// the lasers to linear sRGB, row by row; one laser is white. What sRGB cannot show is clipped.
    Srgb([[f32; 3]; 3]),
}

/// The number of intervals of [`CURVE`].
const INTERVALS: usize = 1 << 12;

/// The bytes of sRGB by the root of linear light.
static CURVE: LazyLock<[u8; INTERVALS + 1]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let root = i as f32 / INTERVALS as f32;
        (encoded(root * root) * 255.0).round() as u8
    })
});

/// Returns the sRGB value of linear light in \[0, 1] (IEC 61966-2-1).
pub fn encoded(light: f32) -> f32 {
    if light <= 0.0031308 {
        12.92 * light
    } else {
        1.055 * light.powf(1.0 / 2.4) - 0.055
    }
}

impl ViewColours {
    /// Returns the colours of views of holograms on `display` of pictures of this `encoding`.
    pub fn new(encoding: RgbEncoding, display: &Display) -> Self {
        if encoding == RgbEncoding::Amplitude {
            return ViewColours::Amplitude;
        }
        ViewColours::Srgb(light_to_srgb(display))
    }

    /// Returns the matrix from light to linear sRGB, row by row, or `None` for amplitudes.
    pub fn matrix(&self) -> Option<[[f32; 3]; 3]> {
        match self {
            ViewColours::Amplitude => None,
            ViewColours::Srgb(matrix) => Some(*matrix),
        }
    }

    /// Returns the light in linear sRGB for the amplitudes of three lasers, or of one, or `None` if views are
    /// amplitudes. What sRGB cannot show lies outside \[0, 1].
    pub fn linear(&self, amplitude: &[f32]) -> Option<[f32; 3]> {
        let matrix = self.matrix()?;
        let light = [0, 1, 2].map(|laser| amplitude.get(laser).map_or(0.0, |a| a * a));
        Some(matrix.map(|row| row[0] * light[0] + row[1] * light[1] + row[2] * light[2]))
    }

    /// Returns the bytes red, green and blue for the amplitudes of three lasers, or of one.
    pub fn bytes(&self, amplitude: &[f32]) -> [u8; 3] {
        let mut bytes = [[0]; 3];
        self.rows(amplitude.as_chunks::<1>().0, &mut bytes);
        bytes.map(|[byte]| byte)
    }

    /// Converts rows of the amplitudes of three lasers, or of one, to rows of bytes, red, green and blue.
    pub fn rows<const N: usize>(&self, amplitudes: &[[f32; N]], bytes: &mut [[u8; N]; 3]) {
        let Some(matrix) = self.matrix() else {
            for (colour, bytes) in bytes.iter_mut().enumerate() {
                let row = amplitudes.get(colour).unwrap_or(&amplitudes[0]);
                wide!(for (byte, v) in bytes.iter_mut().zip(row) {
                    *byte = (v * 255.0 + 0.5) as u8;
                });
            }
            return;
        };
        let curve: &[u8; INTERVALS + 1] = &CURVE;
        let [first, others @ ..] = amplitudes else { return };
        for (bytes, share) in bytes.iter_mut().zip(matrix) {
            let mut light = [0.0; N];
            let mut places = [0u16; N];
            wide!({
                for (light, a) in light.iter_mut().zip(first) {
                    *light = share[0] * (a * a);
                }
                for (row, share) in others.iter().zip(&share[1..]) {
                    for (light, a) in light.iter_mut().zip(row) {
                        *light += share * (a * a);
                    }
                }
                for (place, light) in places.iter_mut().zip(&light) {
                    *place = (light.at_least(0.0).at_most(1.0).sqrt() * INTERVALS as f32 + 0.5) as u16;
                }
            });
            for (byte, place) in bytes.iter_mut().zip(&places) {
                *byte = curve[usize::from(*place)];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::frame::LightPlan;

    /// Every grey and many colours of sRGB come back from the lasers' light.
    #[test]
    fn pictures_come_back() {
        for (toml, colours) in [("", 3), ("powers = [1, 1, 1]", 3), ("wavelengths_nm = [532]", 1)] {
            let display = Display::from_toml(toml).unwrap();
            let plan = LightPlan::new(RgbEncoding::Srgb, &display).unwrap();
            let view = ViewColours::new(RgbEncoding::Srgb, &display);
            // Lasers of unequal power show the brightest D65, which is less than the white of all three.
            for i in 0..=255u8 {
                for colour in [[i; 3], [i, 200 - i / 2, 60 + i / 3]] {
                    if colours == 1 && colour[0] != colour[1] {
                        continue;
                    }
                    let mut amplitude = vec![0.0; colours];
                    plan.convert(&colour.map(|v| f32::from(v) / 255.0), &mut amplitude);
                    let bytes = view.bytes(&amplitude);
                    let near = bytes.iter().zip(colour).all(|(a, b)| a.abs_diff(b) <= 1);
                    assert!(near, "{toml}: {colour:?} {bytes:?}");
                }
            }
        }
    }

    #[test]
    fn amplitudes_are_values() {
        assert_eq!(ViewColours::Amplitude.bytes(&[0.0, 0.5, 1.2]), [0, 128, 255]);
        assert_eq!(ViewColours::Amplitude.bytes(&[0.5]), [128; 3]);
        assert_eq!(ViewColours::Amplitude.matrix(), None);
    }
}
