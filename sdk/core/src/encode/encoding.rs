//! The encodings: what each is, its name, and the plan of its filter. Dark, light, correction and levels are the same
//! for all, and [`super::Encoder`]'s.

pub mod anti_alias;
pub mod band_limit;
pub mod deep;

use crate::display::Display;
use crate::method::network::Network;
use crate::optics::fft::ConvolveScratch;
use crate::runtime::cancel::Cancel;
use crate::runtime::error::Result;
use anti_alias::AntiAlias;
use band_limit::BandLimit;
use deep::{Deep, DeepScratch};
use num_complex::Complex32;
use std::sync::Arc;

/// A way from a field to phases.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Encoding {
    /// Double phase on the field as it is, Eq. 7.
    DoublePhase,
    /// AA-DPM: a small Gaussian blur first. `sigma` in pixels over `width` taps (odd).
    AntiAlias {
        /// Standard deviation, pixels.
        sigma: f32,
        /// Taps, an odd number.
        width: usize,
    },
    /// BL-DPM: high diagonal frequencies cut first; larger `k` keeps more.
    BandLimit {
        /// The bound of |tan(πfx)·tan(πfy)|, f in cycles a pixel.
        k: f32,
    },
    /// DDPM: a pre-filter network first, trained for the modulator's offset.
    Deep(Arc<Network>),
}

impl Encoding {
    /// AA-DPM as published: σ 0.7 over 3 pixels.
    pub const ANTI_ALIAS: Self = Encoding::AntiAlias { sigma: 0.7, width: 3 };
    /// BL-DPM as published: k = 1.
    pub const BAND_LIMIT: Self = Encoding::BandLimit { k: 1.0 };

    /// Those that need no network, as published: what they are called, what they are, themselves.
    pub const BY_NAME: &[(&str, &str, Encoding)] = &[
        ("double", "Double phase", Encoding::DoublePhase),
        (
            "anti-alias",
            "Double phase after a small blur (AA-DPM)",
            Encoding::ANTI_ALIAS,
        ),
        (
            "band-limit",
            "Double phase after a cut of high frequencies (BL-DPM)",
            Encoding::BAND_LIMIT,
        ),
    ];

    /// Whether it was trained on the phase that a network's field has.
    #[doc(hidden)]
    pub fn keeps_phase(&self) -> bool {
        matches!(self, Encoding::Deep(_))
    }
}

/// The filter of an encoding for one shape.
pub(super) enum Prefilter {
    None,
    AntiAlias(AntiAlias),
    /// With the values of a plane.
    BandLimit(BandLimit, usize),
    Deep(Box<Deep>),
}

/// Working memory of a [`Prefilter`] that needs the whole field.
pub(super) enum PrefilterScratch {
    Spectrum(ConvolveScratch),
    Deep(DeepScratch),
}

impl PrefilterScratch {
    /// Has a network end where `cancel` is requested.
    pub(super) fn set_cancel(&mut self, cancel: &Cancel) {
        if let PrefilterScratch::Deep(scratch) = self {
            scratch.set_cancel(cancel);
        }
    }
}

impl Prefilter {
    /// Plans the filter of `encoding` for (H, W) fields of the colours of `display`.
    pub(super) fn new((height, width): (usize, usize), encoding: &Encoding, display: &Display) -> Result<Self> {
        Ok(match encoding {
            Encoding::DoublePhase => Prefilter::None,
            Encoding::AntiAlias { sigma, width } => Prefilter::AntiAlias(AntiAlias::new(*sigma, *width)?),
            Encoding::BandLimit { k } => {
                let plane = height * width;
                Prefilter::BandLimit(BandLimit::new(height, width, *k)?, plane)
            }
            Encoding::Deep(network) => Prefilter::Deep(Box::new(Deep::new(height, width, network, display)?)),
        })
    }

    /// None where nothing needs the whole field.
    pub(super) fn scratch(&self) -> Option<PrefilterScratch> {
        match self {
            Prefilter::None | Prefilter::AntiAlias(_) => None,
            Prefilter::BandLimit(plan, _) => Some(PrefilterScratch::Spectrum(plan.scratch())),
            Prefilter::Deep(plan) => Some(PrefilterScratch::Deep(plan.scratch())),
        }
    }

    /// A blur, which is done row by row.
    pub(super) fn blur(&self) -> Option<&AntiAlias> {
        match self {
            Prefilter::AntiAlias(blur) => Some(blur),
            _ => None,
        }
    }

    /// Filters `field`, (C, H, W), by what needs all of it.
    pub(super) fn filter(&self, field: &mut [Complex32], scratch: &mut PrefilterScratch) {
        match (self, scratch) {
            (Prefilter::BandLimit(plan, plane), PrefilterScratch::Spectrum(scratch)) => {
                for plane in field.chunks_exact_mut(*plane) {
                    plan.filter(plane, scratch);
                }
            }
            (Prefilter::Deep(plan), PrefilterScratch::Deep(scratch)) => plan.filter(field, scratch),
            _ => unreachable!("the scratch is this plan's"),
        }
    }
}
