//! The encodings, their names and the plans of their filters. The dark threshold, illumination, correction and levels
//! are common to all encodings and belong to [`super::Encoder`].

pub mod anti_alias;
pub mod band_limit;
pub mod deep;

use crate::Size;
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

/// A method of encoding a field as phases.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Encoding {
    /// Double phase on the unfiltered field, Eq. 7.
    DoublePhase,
    /// AA-DPM: double phase after a small Gaussian blur.
    AntiAlias {
        /// The standard deviation in pixels.
        sigma: f32,
        /// The number of taps, which is odd.
        width: usize,
    },
    /// BL-DPM: double phase after cutting high diagonal frequencies. A larger `k` keeps more.
    BandLimit {
        /// The bound of |tan(πfx)·tan(πfy)|, with f in cycles per pixel.
        k: f32,
    },
    /// DDPM: double phase after a pre-filter network that was trained for the modulator's offset.
    Deep(Arc<Network>),
    /// The phase of the field as it is, without its amplitude. For methods that give the modulator's phase.
    Phase,
}

impl Encoding {
    /// AA-DPM as published: σ 0.7 over 3 pixels.
    pub const ANTI_ALIAS: Self = Encoding::AntiAlias { sigma: 0.7, width: 3 };
    /// BL-DPM as published: k = 1.
    pub const BAND_LIMIT: Self = Encoding::BandLimit { k: 1.0 };

    /// The published encodings that need no network, each with its name and description.
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

    /// Returns whether the encoding needs the phase of a network's field as it is.
    #[doc(hidden)]
    pub fn keeps_phase(&self) -> bool {
        matches!(self, Encoding::Deep(_) | Encoding::Phase)
    }
}

/// The filter of an encoding for one shape.
pub(super) enum Prefilter {
    None,
    AntiAlias(AntiAlias),
    /// A band limit and the number of values in a plane.
    BandLimit(BandLimit, usize),
    Deep(Box<Deep>),
}

/// The working memory of a [`Prefilter`] that needs the whole field.
pub(super) enum PrefilterScratch {
    Spectrum(ConvolveScratch),
    Deep(DeepScratch),
}

impl PrefilterScratch {
    /// Makes a network stop early once `cancel` is requested.
    pub(super) fn set_cancel(&mut self, cancel: &Cancel) {
        if let PrefilterScratch::Deep(scratch) = self {
            scratch.set_cancel(cancel);
        }
    }
}

impl Prefilter {
    /// Plans the filter of `encoding` for fields of a size and the colours of `display`.
    pub(super) fn new(Size { width, height }: Size, encoding: &Encoding, display: &Display) -> Result<Self> {
        Ok(match encoding {
            Encoding::DoublePhase | Encoding::Phase => Prefilter::None,
            Encoding::AntiAlias { sigma, width } => Prefilter::AntiAlias(AntiAlias::new(*sigma, *width)?),
            Encoding::BandLimit { k } => {
                let plane = height * width;
                Prefilter::BandLimit(BandLimit::new(Size { width, height }, *k)?, plane)
            }
            Encoding::Deep(network) => Prefilter::Deep(Box::new(Deep::new(Size { width, height }, network, display)?)),
        })
    }

    /// Returns working memory, or `None` if the filter does not need the whole field.
    pub(super) fn scratch(&self) -> Option<PrefilterScratch> {
        match self {
            Prefilter::None | Prefilter::AntiAlias(_) => None,
            Prefilter::BandLimit(plan, _) => Some(PrefilterScratch::Spectrum(plan.scratch())),
            Prefilter::Deep(plan) => Some(PrefilterScratch::Deep(plan.scratch())),
        }
    }

    /// Returns whether the filter needs the whole field.
    pub(super) fn is_of_whole_field(&self) -> bool {
        matches!(self, Prefilter::BandLimit(..) | Prefilter::Deep(_))
    }

    /// Returns the blur if there is one. It is applied row by row.
    pub(super) fn blur(&self) -> Option<&AntiAlias> {
        match self {
            Prefilter::AntiAlias(blur) => Some(blur),
            _ => None,
        }
    }

    /// Applies the filters that need the whole field to `field`, (C, H, W).
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
