//! The wave of a frame as the encoder reads it: the pixels that a method keeps, and those that have changed.

use super::mean_phase::{self, Sums};
use super::standing::Changed;
use crate::Size;
use crate::parallel::prelude::*;
use num_complex::{Complex32, Complex64};
use phasefront_kernels::fir::Pixel;
use phasefront_kernels::wide;
use std::ops::Range;

/// The units of a wave of amplitude 1 in the sweep's fixed point. Parts of more than 2 saturate.
pub(super) const UNIT: f32 = 8192.0;

/// The number of values that one thread takes at a time.
const PART: usize = 1 << 14;

/// The sums of the real and of the imaginary parts of pixels.
pub(crate) type PixelSum = [i64; 2];

/// Pixels of a wave.
#[derive(Clone, Copy)]
pub(crate) enum Pixels<'a> {
    /// Fixed point of the plane sweep, in 1/[`UNIT`], and the sum of each colour's pixels.
    Fixed(&'a [Pixel], &'a [PixelSum; 3]),
    /// Values of a network.
    Float(&'a [Complex32]),
}

/// The wave of a frame, without the mean phase of each colour.
#[derive(Clone, Copy)]
pub(crate) struct Wave<'a> {
    /// The pixels, (C, H, W), with their mean phase.
    pub(super) pixels: Pixels<'a>,
    /// The size of the frame.
    pub(super) size: Size,
    /// The factor that removes the mean phase of each colour.
    pub(crate) turns: [Complex32; 3],
    /// `None` if the method keeps nothing from frame to frame.
    pub(crate) changed: Option<Changed<'a>>,
    /// Whether the frame was computed to its end. Otherwise the values are unspecified.
    pub(super) is_whole: bool,
}

/// The pixels of a colour of a [`Wave`].
#[derive(Clone, Copy)]
pub(crate) struct WavePlane<'a> {
    pixels: Pixels<'a>,
    turn: Complex32,
}

impl<'a> Pixels<'a> {
    fn len(self) -> usize {
        match self {
            Pixels::Fixed(pixels, _) => pixels.len(),
            Pixels::Float(values) => values.len(),
        }
    }

    /// Returns `count` pixels from `from` on.
    fn part(self, from: usize, count: usize) -> Self {
        match self {
            Pixels::Fixed(pixels, sums) => Pixels::Fixed(&pixels[from..][..count], sums),
            Pixels::Float(values) => Pixels::Float(&values[from..][..count]),
        }
    }

    /// Returns the factor that removes the mean phase of colour `colour`, which has `size` pixels.
    pub(super) fn turn_of(self, colour: usize, size: usize) -> Complex32 {
        match self {
            Pixels::Fixed(_, sums) => turn_of_sum(sums[colour]),
            Pixels::Float(values) => mean_phase::turn_of(&values[colour * size..][..size]),
        }
    }

    /// Works like [`Self::turn_of`], but sums only the ranges of the colour's pixels again of which `differs` is true.
    pub(super) fn turn_where(
        self,
        colour: usize,
        size: usize,
        differs: impl Fn(Range<usize>) -> bool + Sync,
        sums: &mut Sums,
    ) -> Complex32 {
        match self {
            Pixels::Fixed(_, sums) => turn_of_sum(sums[colour]),
            Pixels::Float(values) => sums.turn_of(colour, &values[colour * size..][..size], differs),
        }
    }
}

impl<'a> Wave<'a> {
    /// Returns the number of values.
    pub(crate) fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Returns value `at` of (C, H, W).
    #[inline(always)]
    pub(crate) fn value(&self, at: usize) -> Complex32 {
        let pixel = match self.pixels {
            Pixels::Fixed(pixels, _) => value(pixels[at]),
            Pixels::Float(values) => values[at],
        };
        pixel * self.turns[at / self.size.pixels()]
    }

    /// Returns whether a value of a range of (C, H, W) may differ from the wave before, apart from the mean phase.
    pub(crate) fn differs(&self, values: Range<usize>) -> bool {
        (self.changed).is_none_or(|changed| changed.changes.any_value(values, self.size, changed.reach))
    }

    pub(crate) fn plane(&self, colour: usize) -> WavePlane<'a> {
        let size = self.size.pixels();
        WavePlane {
            pixels: self.pixels.part(colour * size, size),
            turn: self.turns[colour],
        }
    }

    /// Writes all values into `field`, (C, H, W), if the wave is whole.
    pub(super) fn write(&self, field: &mut [Complex32]) {
        if !self.is_whole {
            return;
        }
        for (colour, plane) in field.chunks_exact_mut(self.size.pixels()).enumerate() {
            let wave = self.plane(colour);
            let parts = plane.par_chunks_mut(PART).enumerate();
            parts.for_each(|(part, plane)| wave.write(part * PART, plane));
        }
    }
}

impl WavePlane<'_> {
    /// Writes the values from `from` on into `to`.
    pub(crate) fn write(self, from: usize, to: &mut [Complex32]) {
        let turn = self.turn;
        match self.pixels.part(from, to.len()) {
            Pixels::Fixed(pixels, _) => wide!(for (to, pixel) in to.iter_mut().zip(pixels) {
                *to = value(*pixel) * turn;
            }),
            Pixels::Float(values) => wide!(for (to, value) in to.iter_mut().zip(values) {
                *to = *value * turn;
            }),
        }
    }
}

/// Returns the factor that removes the mean phase of pixels with this sum.
fn turn_of_sum([re, im]: PixelSum) -> Complex32 {
    mean_phase::turn(Complex64::new(re as f64, im as f64))
}

/// Returns the value of a pixel in fixed point.
#[inline(always)]
pub(super) fn value(pixel: Pixel) -> Complex32 {
    Complex32::new(pixel.re() as f32, pixel.im() as f32) * (1.0 / UNIT)
}
