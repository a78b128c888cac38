//! The deep double phase method's pre-filter (DDPM, Eq. 6): a small network that was trained, together with the one
//! that made the field and through encoding and aperture, to leave what double phase can show.
//!
//! It reads the field at the modulator, its phase included: neither a mean phase is taken out nor is it scaled. Where
//! it asks for that, AA-DPM's blur has gone over the field first.

use super::anti_alias::{AntiAlias, AntiAliasScratch};
use crate::display::Display;
use crate::method::network::{FilterPlan, FilterScratch, Network};
use crate::runtime::cancel::Cancel;
use crate::runtime::error::Result;
use num_complex::Complex32;

/// The blur that pre-filters for blurred fields are trained behind.
///
/// # Errors
/// None.
pub fn blur() -> Result<AntiAlias> {
    AntiAlias::new(0.7, 3)
}

/// A pre-filter for one shape.
pub struct Deep {
    /// (H, W).
    shape: (usize, usize),
    blur: Option<AntiAlias>,
    network: FilterPlan,
}

/// Working memory of [`Deep::filter`].
pub struct DeepScratch {
    blur: Option<AntiAliasScratch>,
    network: FilterScratch,
}

impl DeepScratch {
    /// Has fields end where `cancel` is requested.
    pub fn set_cancel(&mut self, cancel: &Cancel) {
        self.network.set_cancel(cancel);
    }
}

impl Deep {
    /// Plans the filtering of (C, `height`, `width`) fields of the colours of `display`.
    ///
    /// # Errors
    /// A network that is no pre-filter, that does not serve the display, or that the kernels do not take.
    pub fn new(height: usize, width: usize, network: &Network, display: &Display) -> Result<Self> {
        let blurred = network.input().is_blurred();
        Ok(Deep {
            shape: (height, width),
            blur: blurred.then(blur).transpose()?,
            network: network.filter_plan_for(height, width, display)?,
        })
    }

    /// Working memory for one call at a time.
    pub fn scratch(&self) -> DeepScratch {
        DeepScratch {
            blur: self.blur.as_ref().map(|blur| blur.scratch(self.shape.1)),
            network: self.network.scratch(),
        }
    }

    /// Replaces `field`, (C, H, W) at the modulator, by the pre-encoding field.
    ///
    /// # Panics
    /// If `field` has not C·H·W values.
    pub fn filter(&self, field: &mut [Complex32], scratch: &mut DeepScratch) {
        let (height, width) = self.shape;
        if let (Some(blur), Some(scratch)) = (&self.blur, &mut scratch.blur) {
            for plane in field.chunks_exact_mut(height * width) {
                blur.in_place(plane, width, scratch);
            }
        }
        self.network.filter(field, &mut scratch.network);
    }
}
