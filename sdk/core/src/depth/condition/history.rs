//! Earlier choices of a video's pixels at edges. Noise would change the surface of a nearly undecided pixel from frame
//! to frame. A pixel whose colour stays therefore prefers the surface that it had, and its depth follows slowly. Where
//! something moves, colours at edges change, and the pixel is decided anew.

use super::lanes::{Lanes, lanes, load, store};
use crate::parallel::prelude::*;

/// The lead of the surface that the pixel had.
pub(super) const KEEP: f32 = 6.0;
/// The largest difference of depth to the surface that the pixel had, as a share of the volume.
pub(super) const SAME: f32 = 0.06;
/// The largest difference of amplitudes at which a colour stays.
pub(super) const ALIKE: f32 = 0.1;
/// The share of the way to its new depth that a pixel moves in a frame.
pub(super) const SHARE: f32 = 0.5;

/// The last depth of each pixel at an edge, and its colour then.
pub(super) struct History {
    /// NaN where there is none.
    depth: Vec<f32>,
    /// The amplitudes in bytes, (H, 3, W).
    colours: Vec<u8>,
}

impl History {
    pub(super) fn new(pixels: usize) -> Self {
        History {
            depth: vec![f32::NAN; pixels],
            colours: vec![0; 3 * pixels],
        }
    }

    /// Forgets all choices.
    pub(super) fn reset(&mut self) {
        self.depth.fill(f32::NAN);
    }

    /// Returns the line `y` of `width` pixels.
    pub(super) fn line(&self, y: usize, width: usize) -> Line<&[f32], &[u8]> {
        Line {
            depth: &self.depth[y * width..][..width],
            colours: &self.colours[3 * y * width..][..3 * width],
        }
    }

    /// Returns all lines of `width` pixels, `count` together.
    pub(super) fn chunks(
        &mut self,
        count: usize,
        width: usize,
    ) -> impl IndexedParallelIterator<Item = impl Iterator<Item = Line<&mut [f32], &mut [u8]>>> {
        let colours = self.colours.par_chunks_mut(count * 3 * width);
        (self.depth.par_chunks_mut(count * width))
            .zip(colours)
            .map(move |(depth, colours)| {
                let colours = colours.chunks_exact_mut(3 * width);
                (depth.chunks_exact_mut(width).zip(colours)).map(|(depth, colours)| Line { depth, colours })
            })
    }
}

/// A line of pixels.
pub(super) struct Line<D, C> {
    depth: D,
    colours: C,
}

impl<D: AsRef<[f32]>, C: AsRef<[u8]>> Line<D, C> {
    /// Returns the last depths of the pixels from `x` on, which have these `colours`. They are NaN where there is none
    /// or where the colour has changed.
    #[inline(always)]
    pub(super) fn held<const N: usize>(&self, x: usize, colours: &[Lanes<N>; 3]) -> Lanes<N> {
        let (depth, bytes) = (self.depth.as_ref(), self.colours.as_ref());
        let width = depth.len();
        let mut apart = [0.0; N];
        for (c, colours) in colours.iter().enumerate() {
            let earlier: [u8; N] = load(&bytes[c * width..][..width], x, 0);
            let change: Lanes<N> = lanes(|i| colours[i] - f32::from(earlier[i]) * (1.0 / 255.0));
            apart = lanes(|i| apart[i] + change[i] * change[i]);
        }
        let depth: Lanes<N> = load(depth, x, f32::NAN);
        lanes(|i| if apart[i] <= ALIKE * ALIKE { depth[i] } else { f32::NAN })
    }
}

impl Line<&mut [f32], &mut [u8]> {
    /// Moves the last depths of `count` pixels from `x` on, which have these `colours`, toward `depths`, and returns
    /// them.
    #[inline(always)]
    pub(super) fn follow(&mut self, (x, count): (usize, usize), colours: &[Lanes; 3], depths: &Lanes) -> Lanes {
        let held = self.held(x, colours);
        let moved = lanes(|i| {
            let step = depths[i] - held[i];
            let stays = step.abs() <= SAME;
            if stays { held[i] + SHARE * step } else { depths[i] }
        });
        let width = self.depth.len();
        store(&moved, &mut self.depth[x..x + count]);
        for (c, colours) in colours.iter().enumerate() {
            let line = &mut self.colours[c * width + x..][..count];
            for (to, colour) in line.iter_mut().zip(colours) {
                *to = (colour * 255.0 + 0.5) as u8;
            }
        }
        moved
    }
}

/// Returns the lead of a surface of this `depth` for pixels with the depths `held`, of which `nearest` is the distance
/// to the nearest surface.
#[inline(always)]
pub(super) fn leads<const N: usize>(depth: f32, held: &Lanes<N>, nearest: &Lanes<N>) -> Lanes<N> {
    lanes(|i| {
        let apart = (depth - held[i]).abs();
        let is_nearest = apart <= SAME && apart <= nearest[i];
        if is_nearest { KEEP } else { 0.0 }
    })
}
