//! From a complex field to phases alone: the double phase method and what is done to a field
//! before it so that the checkerboard does not alias.
//!
//! Encoders take the field as given: its phase, its offset, its scale. Phases lie in \[0, 2π).
//! What level shows a phase is [`crate::slm`]'s knowledge.

pub mod anti_alias;
pub mod band_limit;
pub mod deep;
pub mod double_phase;

use crate::error::{Error, Result};
use crate::illumination::Illumination;
use crate::network::Network;
use crate::slm::Response;
use crate::wave::fft::Scratch;
use anti_alias::{AntiAlias, AntiAliasScratch};
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
    pub const ANTI_ALIAS: Self = Encoding::AntiAlias {
        sigma: 0.7,
        width: 3,
    };
    /// BL-DPM as published: k = 1.
    pub const BAND_LIMIT: Self = Encoding::BandLimit { k: 1.0 };
}

/// Which amplitude becomes full light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    /// The largest amplitude over all colours of the frame.
    Max,
    /// A fixed one; what is brighter is clipped. Video needs it, or it flickers.
    Fixed(f32),
}

/// A plan for one encoding and shape. Immutable; shared between threads.
pub struct Encoder {
    height: usize,
    width: usize,
    prefilter: Prefilter,
    /// With (H, W) of the modulator, in whose middle the hologram stands.
    illumination: Option<(Illumination, (usize, usize))>,
}

enum Prefilter {
    None,
    AntiAlias(AntiAlias),
    BandLimit(BandLimit),
    Deep(Deep),
}

/// Working memory of an [`Encoder`] for one call at a time.
pub struct EncoderScratch(Option<PrefilterScratch>);

enum PrefilterScratch {
    AntiAlias(AntiAliasScratch),
    Spectrum(Scratch),
    Deep(DeepScratch),
}

impl Encoder {
    /// Plans the encoding of stacks of (`height`, `width`) planes.
    ///
    /// # Errors
    /// An empty plane, a parameter out of its range, or a network that is no pre-filter.
    pub fn new(height: usize, width: usize, encoding: Encoding) -> Result<Self> {
        if height == 0 || width == 0 {
            return Err(Error::Plan(format!(
                "a plane of {width}×{height} is empty; each side must be at least 1"
            )));
        }
        let prefilter = match encoding {
            Encoding::DoublePhase => Prefilter::None,
            Encoding::AntiAlias { sigma, width } => {
                Prefilter::AntiAlias(AntiAlias::new(sigma, width)?)
            }
            Encoding::BandLimit { k } => Prefilter::BandLimit(BandLimit::new(height, width, k)?),
            Encoding::Deep(network) => Prefilter::Deep(Deep::new(height, width, &network)?),
        };
        Ok(Encoder {
            height,
            width,
            prefilter,
            illumination: None,
        })
    }

    /// The same for holograms in the middle of a modulator of (H, W), `modulator`, that is lit as `illumination` says: the
    /// field is divided by the light after its filter.
    pub fn with_illumination(
        mut self,
        illumination: Illumination,
        modulator: (usize, usize),
    ) -> Self {
        self.illumination = Some((illumination, modulator));
        self
    }

    /// Working memory for one call at a time.
    pub fn scratch(&self) -> EncoderScratch {
        EncoderScratch(match &self.prefilter {
            Prefilter::None => None,
            Prefilter::AntiAlias(plan) => {
                Some(PrefilterScratch::AntiAlias(plan.scratch(self.width)))
            }
            Prefilter::BandLimit(plan) => Some(PrefilterScratch::Spectrum(plan.scratch())),
            Prefilter::Deep(plan) => Some(PrefilterScratch::Deep(plan.scratch())),
        })
    }

    /// Encodes `field`, a stack (3, H, W), into `phase`, (3, H, W) in \[0, 2π); gives the scale it
    /// used: the amplitude that full light stands for. `field` is left filtered. Allocates nothing.
    ///
    /// # Panics
    /// If `field` or `phase` has not 3·H·W values.
    pub fn encode(
        &self,
        field: &mut [Complex32],
        scale: Scale,
        phase: &mut [f32],
        scratch: &mut EncoderScratch,
    ) -> f32 {
        assert_eq!(phase.len(), 3 * self.height * self.width);
        let scale = self.filter(field, scale, scratch);
        double_phase::encode(field, self.width, self.height * self.width, scale, phase);
        scale
    }

    /// [`Self::encode`] straight to the levels of a modulator that answers as `response` does.
    ///
    /// # Panics
    /// If `field` or `levels` has not 3·H·W values.
    pub fn encode_levels(
        &self,
        field: &mut [Complex32],
        scale: Scale,
        response: &Response,
        levels: &mut [u8],
        scratch: &mut EncoderScratch,
    ) -> f32 {
        let plane = self.height * self.width;
        assert_eq!(levels.len(), 3 * plane);
        let scale = self.filter(field, scale, scratch);
        double_phase::encode_levels(field, self.width, plane, scale, response, levels);
        scale
    }

    /// What is done to the field before double phase; gives the scale.
    fn filter(&self, field: &mut [Complex32], scale: Scale, scratch: &mut EncoderScratch) -> f32 {
        let plane = self.height * self.width;
        assert_eq!(field.len(), 3 * plane);
        if let (Prefilter::Deep(plan), Some(PrefilterScratch::Deep(scratch))) =
            (&self.prefilter, &mut scratch.0)
        {
            plan.filter(field, scratch);
        }
        for plane in field.chunks_exact_mut(plane) {
            match (&self.prefilter, &mut scratch.0) {
                (Prefilter::AntiAlias(plan), Some(PrefilterScratch::AntiAlias(rows))) => {
                    plan.filter(plane, self.width, rows);
                }
                (Prefilter::BandLimit(plan), Some(PrefilterScratch::Spectrum(scratch))) => {
                    plan.filter(plane, scratch);
                }
                _ => {}
            }
        }
        if let Some((illumination, modulator)) = &self.illumination {
            illumination.divide(field, (self.height, self.width), *modulator);
        }
        match scale {
            Scale::Max => double_phase::max_amplitude(field),
            Scale::Fixed(scale) => scale,
        }
    }
}
