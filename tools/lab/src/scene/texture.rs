//! The picture on a mesh, and its sampling.

use phasefront::Size;
use phasefront_io::{Error, Result};

/// The alpha from which a sampled point of a surface is solid. Below it the surface has a hole.
pub(super) const ALPHA_CUT: f32 = 0.5;

/// An RGBA picture of 8 bits that repeats in both directions. Where alpha is below one half, the surface has a hole.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    width: usize,
    height: usize,
    texels: Vec<[u8; 4]>,
}

impl Texture {
    /// Makes a texture of `texels`, row by row. Returns an error if it is empty or the count is not `width * height`.
    pub fn new(size: Size, texels: Vec<[u8; 4]>) -> Result<Self> {
        let Size { width, height } = size;
        if texels.is_empty() || width.checked_mul(height) != Some(texels.len()) {
            return Err(Error::Input(format!(
                "a texture of {width}x{height} cannot hold {} texels",
                texels.len()
            )));
        }
        Ok(Self { width, height, texels })
    }

    /// Makes a texture like [`new`](Self::new) from texels whose count the caller guarantees to be right and not zero.
    pub(super) fn sized(size: Size, texels: Vec<[u8; 4]>) -> Self {
        let Size { width, height } = size;
        debug_assert!(!texels.is_empty() && texels.len() == width * height);
        Self { width, height, texels }
    }

    /// Makes a texture of one colour, RGB in [0, 1].
    pub fn plain(rgb: [f32; 3]) -> Self {
        let [r, g, b] = rgb.map(|v| (v * 255.0).round() as u8);
        Self {
            width: 1,
            height: 1,
            texels: vec![[r, g, b, 255]],
        }
    }

    /// Returns the width in texels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the height in texels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns the texels, row by row, RGBA.
    pub fn texels(&self) -> &[[u8; 4]] {
        &self.texels
    }

    /// Samples RGBA in [0, 1] at `uv`, bilinearly between the four nearest texel centres. The centre of texel (i, j) is
    /// at ((i + ½) / width, (j + ½) / height).
    pub fn sample(&self, uv: [f32; 2]) -> [f32; 4] {
        let (x0, x1, fx) = neighbours(uv[0], self.width);
        let (y0, y1, fy) = neighbours(uv[1], self.height);
        let (top, bottom) = (&self.texels[y0 * self.width..], &self.texels[y1 * self.width..]);
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        std::array::from_fn(|c| {
            let at = |row: &[[u8; 4]], x: usize| f32::from(row[x][c]);
            mix(
                mix(at(top, x0), at(top, x1), fx),
                mix(at(bottom, x0), at(bottom, x1), fx),
                fy,
            ) / 255.0
        })
    }
}

/// Returns the two texels beside coordinate `t`, and its position between them as a fraction.
fn neighbours(t: f32, size: usize) -> (usize, usize, f32) {
    let position = (t - t.floor()) * size as f32 - 0.5;
    let below = position.floor();
    // `below` is from −1 to `size`. It is `size` if rounding made t − ⌊t⌋ one.
    let wrap = |index: f32| {
        if index < 0.0 { size - 1 } else { index as usize % size }
    };
    (wrap(below), wrap(below + 1.0), position - below)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn sampling_is_exact_at_centres_linear_between_and_repeats() {
        let texture = Texture::new(
            Size { width: 2, height: 2 },
            vec![[0, 0, 0, 255], [255, 0, 0, 255], [0, 255, 0, 255], [255, 255, 51, 0]],
        )
        .unwrap();
        assert_eq!(texture.sample([0.25, 0.25]), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(texture.sample([0.75, 0.75]), [1.0, 1.0, 0.2, 0.0]);
        assert_eq!(texture.sample([0.5, 0.5]), [0.5, 0.5, 0.05, 0.75]);
        assert_eq!(texture.sample([0.375, 0.25]), [0.25, 0.0, 0.0, 1.0]);
        // These positions are halfway between the last texel and the first texel of the next repeat.
        for u in [0.0, 1.0, -3.0, 7.0] {
            assert_eq!(texture.sample([u, 0.25])[0], 0.5);
        }
        assert_eq!(texture.sample([-0.75, 2.25]), texture.sample([0.25, 0.25]));
        // The largest float below 0 wraps to 1 by rounding.
        assert_eq!(texture.sample([-1e-12, 0.25])[0], 0.5);
    }

    #[test]
    fn wrong_sizes_are_refused() {
        assert!(Texture::new(Size { width: 0, height: 0 }, Vec::new()).is_err());
        assert!(Texture::new(Size { width: 2, height: 2 }, vec![[0; 4]; 3]).is_err());
        assert!(
            Texture::new(
                Size {
                    width: usize::MAX,
                    height: 2
                },
                vec![[0; 4]; 3]
            )
            .is_err()
        );
    }
}
