//! The pre-filter of the deep double phase method (DDPM, Eq. 6). It is a small network that removes the parts of a
//! field that double phase cannot display. It was trained together with the network that computes the field, through
//! encoding and aperture.
//!
//! It reads the field at the modulator with its phase: the mean phase is not removed and the field is not scaled. If
//! the network's input requires it, the blur of AA-DPM is applied first.

use super::anti_alias::{AntiAlias, AntiAliasScratch};
use crate::Size;
use crate::display::Display;
use crate::method::network::{FilterPlan, FilterScratch, Network};
use crate::runtime::cancel::Cancel;
use crate::runtime::error::Result;
use num_complex::Complex32;

/// Returns the blur that pre-filters for blurred fields were trained with.
///
/// # Errors
/// Always succeeds because the parameters are valid.
pub fn blur() -> Result<AntiAlias> {
    AntiAlias::new(0.7, 3)
}

/// A pre-filter for one shape.
pub struct Deep {
    /// The size of a frame.
    size: Size,
    blur: Option<AntiAlias>,
    network: FilterPlan,
}

/// The working memory of [`Deep::filter`].
pub struct DeepScratch {
    blur: Option<AntiAliasScratch>,
    network: FilterScratch,
}

impl DeepScratch {
    /// Makes the computation stop early once `cancel` is requested.
    pub fn set_cancel(&mut self, cancel: &Cancel) {
        self.network.set_cancel(cancel);
    }
}

impl Deep {
    /// Plans the filtering of fields of `size` in the colours of `display`.
    ///
    /// # Errors
    /// Returns an error if the network is not a pre-filter, does not support the display, or is not supported by the
    /// kernels.
    pub fn new(size: Size, network: &Network, display: &Display) -> Result<Self> {
        let blurred = network.input().is_blurred();
        Ok(Deep {
            size,
            blur: blurred.then(blur).transpose()?,
            network: network.filter_plan_for(size, display)?,
        })
    }

    /// Returns working memory for one call at a time.
    pub fn scratch(&self) -> DeepScratch {
        DeepScratch {
            blur: self.blur.as_ref().map(|blur| blur.scratch(self.size.width)),
            network: self.network.scratch(),
        }
    }

    /// Replaces `field`, (C, H, W) at the modulator, by the filtered field.
    ///
    /// # Panics
    /// Panics if `field` does not have C·H·W values.
    pub fn filter(&self, field: &mut [Complex32], scratch: &mut DeepScratch) {
        let Size { width, height } = self.size;
        if let (Some(blur), Some(scratch)) = (&self.blur, &mut scratch.blur) {
            for plane in field.chunks_exact_mut(height * width) {
                blur.in_place(plane, width, scratch);
            }
        }
        self.network.filter(field, &mut scratch.network);
    }
}
