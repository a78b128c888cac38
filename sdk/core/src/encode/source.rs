//! The field that an encoder reads: values in memory, or the wave of a method.

use crate::method::wave::{Wave, WavePlane};
use num_complex::Complex32;

/// A field at the modulator, (C, H, W).
#[derive(Clone, Copy)]
pub(crate) enum Source<'a> {
    Field(&'a [Complex32]),
    Wave(Wave<'a>),
}

/// A colour's plane of a [`Source`], (H, W).
#[derive(Clone, Copy)]
pub(super) enum Plane<'a> {
    Field(&'a [Complex32]),
    Wave(WavePlane<'a>),
}

impl<'a> Source<'a> {
    /// Returns the number of values.
    pub(super) fn len(self) -> usize {
        match self {
            Source::Field(values) => values.len(),
            Source::Wave(wave) => wave.len(),
        }
    }

    /// Returns a colour's plane of `size` values.
    pub(super) fn plane(self, colour: usize, size: usize) -> Plane<'a> {
        match self {
            Source::Field(values) => Plane::Field(&values[colour * size..][..size]),
            Source::Wave(wave) => Plane::Wave(wave.plane(colour)),
        }
    }
}
