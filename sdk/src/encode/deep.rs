//! The deep double phase method's pre-filter (DDPM, Eq. 6): a small network that was trained, together with the one that
//! made the field and through encoding and aperture, to leave what double phase can show.
//!
//! It reads the field at the modulator, its phase included: neither a mean phase is taken out nor is it scaled. Where it
//! asks for that, AA-DPM's blur has gone over the field first.

use super::anti_alias::{AntiAlias, AntiAliasScratch};
use crate::display::Display;
use crate::error::{Error, Result};
use crate::method::check_display;
use crate::network::{FilterPlan, FilterScratch, Network};
use num_complex::Complex32;

/// How far the modulator may stand from where a pre-filter was trained for: what light spreads over it stays below a
/// tenth of a pixel of 8 µm.
const OFFSET_TOLERANCE_M: f64 = 20e-6;

/// The blur that pre-filters for blurred fields are trained behind.
///
/// # Errors
/// None.
pub(crate) fn blur() -> Result<AntiAlias> {
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

impl Deep {
    /// Plans the filtering of (3, `height`, `width`) fields.
    ///
    /// # Errors
    /// A network that is no pre-filter, or that the kernels do not take.
    pub fn new(height: usize, width: usize, network: &Network) -> Result<Self> {
        let blurred = network.input().is_blurred();
        Ok(Deep {
            shape: (height, width),
            blur: blurred.then(blur).transpose()?,
            network: network.filter_plan(height, width)?,
        })
    }

    /// Working memory for one call at a time.
    pub fn scratch(&self) -> DeepScratch {
        DeepScratch {
            blur: self.blur.as_ref().map(|blur| blur.scratch(self.shape.1)),
            network: self.network.scratch(),
        }
    }

    /// Replaces `field`, (3, H, W) at the modulator, by the pre-encoding field.
    ///
    /// # Panics
    /// If `field` has not 3·H·W values.
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

/// Checks that the pre-filter `network` was trained for a display like `display`, its offset included.
///
/// # Errors
/// What [`check_display`] refuses, or an offset that differs by over 20 µm.
pub fn check(network: &Network, display: &Display) -> Result<()> {
    check_display(network, display)?;
    let (trained, given) = (network.display().offset_m, display.offset_m());
    if (trained - given).abs() > OFFSET_TOLERANCE_M {
        return Err(Error::Network(format!(
            "the pre-filter was trained for an offset of {:.3} mm, the display has {:.3} mm; take one for this offset, or another encoder",
            trained * 1e3,
            given * 1e3
        )));
    }
    Ok(())
}
