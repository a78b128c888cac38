//! Pixels that did not change since the previous frame: corrections continue from the phases that they found there.

use crate::parallel::prelude::*;
use num_complex::Complex32;

/// The largest change of a pixel's field, as a share of full light, at which the pixel counts as unchanged.
pub const STILL: f32 = 0.1;

/// The field of a frame and the phases found for the previous one.
pub(super) struct Still {
    width: usize,
    /// The field at the modulator in all colours, of this frame or, between frames, of the previous one.
    pub(super) field: Vec<Complex32>,
    /// The phases of the previous frame in all colours. NaN where this frame cannot start from them.
    before: Vec<f32>,
}

impl Still {
    /// Creates the memory for frames of `values` values in rows of `width`.
    pub(super) fn new(values: usize, width: usize) -> Self {
        Still {
            width,
            field: vec![Complex32::ZERO; values],
            before: vec![f32::NAN; values],
        }
    }

    /// Stores `field`, (C, H, W). If the frame follows one of scale `past`, its unchanged pixels keep their phases.
    ///
    /// # Panics
    /// Panics if `field` has another number of values.
    pub(super) fn keep(&mut self, field: &[Complex32], past: Option<f32>) {
        assert_eq!(field.len(), self.field.len());
        let bound = past.map_or(-1.0, |scale| (STILL * scale).powi(2));
        let rows = (self.field.par_chunks_exact_mut(self.width))
            .zip(self.before.par_chunks_exact_mut(self.width))
            .zip(field.par_chunks_exact(self.width));
        rows.for_each(|((kept, before), field)| {
            for ((kept, before), field) in kept.iter_mut().zip(before).zip(field) {
                let still = (field - *kept).norm_sqr() <= bound;
                *before = if still { *before } else { f32::NAN };
                *kept = *field;
            }
        });
    }

    /// Replaces the `phases`, (C, H, W), of unchanged pixels by those of the previous frame.
    pub(super) fn start(&self, phases: &mut [f32]) {
        let rows = (phases.par_chunks_exact_mut(self.width)).zip(self.before.par_chunks_exact(self.width));
        rows.for_each(|(phases, before)| {
            for (phase, before) in phases.iter_mut().zip(before) {
                *phase = if before.is_nan() { *phase } else { *before };
            }
        });
    }

    /// Stores the `phases` that were found.
    pub(super) fn end(&mut self, phases: &[f32]) {
        self.before.copy_from_slice(phases);
    }

    /// Forgets the phases of the previous frame.
    pub(super) fn forget(&mut self) {
        self.before.fill(f32::NAN);
    }
}
