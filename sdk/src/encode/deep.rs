//! The deep double phase method's pre-filter (DDPM, Eq. 6): a small network that was trained, together with the one that
//! made the field and through encoding and aperture, to leave what double phase can show.
//!
//! It reads the field at the modulator as it is, its phase included: neither a mean phase is taken out nor is it scaled.

use crate::display::Display;
use crate::error::{Error, Result};
use crate::method::check_display;
use crate::network::{FilterPlan, FilterScratch, Network};
use num_complex::Complex32;

/// How far the modulator may stand from where a pre-filter was trained for: what light spreads over it stays below a
/// tenth of a pixel of 8 µm.
const OFFSET_TOLERANCE_M: f64 = 20e-6;

/// A pre-filter for one shape.
pub struct Deep {
    network: FilterPlan,
}

/// Working memory of [`Deep::filter`].
pub struct DeepScratch(FilterScratch);

impl Deep {
    /// Plans the filtering of (3, `height`, `width`) fields.
    ///
    /// # Errors
    /// A network that is no pre-filter, or that the kernels do not take.
    pub fn new(height: usize, width: usize, network: &Network) -> Result<Self> {
        Ok(Deep {
            network: network.filter_plan(height, width)?,
        })
    }

    /// Working memory for one call at a time.
    pub fn scratch(&self) -> DeepScratch {
        DeepScratch(self.network.scratch())
    }

    /// Replaces `field`, (3, H, W) at the modulator, by the pre-encoding field.
    ///
    /// # Panics
    /// If `field` has not 3·H·W values.
    pub fn filter(&self, field: &mut [Complex32], scratch: &mut DeepScratch) {
        self.network.filter(field, &mut scratch.0);
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
