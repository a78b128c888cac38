//! From a complex field to phases alone: the double phase method and what is done to a field
//! before it so that the checkerboard does not alias.
//!
//! Encoders take the field as given: its phase, its offset, its scale. Phases lie in \[0, 2π).
//! What level shows a phase is [`crate::slm`]'s knowledge; an amplitude's scale is what full light stands for.

pub mod anti_alias;
pub mod band_limit;
pub mod deep;
pub mod double_phase;

use crate::brightness::Brightness;
use crate::error::{Error, Result};
use crate::illumination::Illumination;
use crate::network::Network;
use crate::slm::Response;
use crate::target::Target;
use crate::wave::fft::ConvolveScratch;
use anti_alias::{AntiAlias, AntiAliasScratch};
use band_limit::BandLimit;
use deep::{Deep, DeepScratch};
use num_complex::Complex32;
use rayon::prelude::*;
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

    /// Whether it was trained on the phase that a network's field has.
    pub(crate) fn keeps_phase(&self) -> bool {
        matches!(self, Encoding::Deep(_))
    }
}

/// How a field becomes levels.
#[derive(Debug, Clone)]
pub struct EncoderOptions {
    /// From a complex field to phases.
    pub encoding: Encoding,
    /// Which amplitude full light stands for.
    pub brightness: Brightness,
}

impl Default for EncoderOptions {
    /// AA-DPM, steady brightness.
    fn default() -> Self {
        Encoding::ANTI_ALIAS.into()
    }
}

impl From<Encoding> for EncoderOptions {
    /// This encoding, the rest as usual.
    fn from(encoding: Encoding) -> Self {
        EncoderOptions {
            encoding,
            brightness: Brightness::default(),
        }
    }
}

/// A plan for one encoding and shape. Immutable; shared between threads.
pub struct Encoder {
    height: usize,
    width: usize,
    prefilter: Prefilter,
    /// With (H, W) of the modulator, in whose middle the hologram stands.
    /// With (H, W) of the modulator, in whose middle the hologram stands.
    illumination: Option<(Illumination, (usize, usize))>,
    response: Response,
}

enum Prefilter {
    None,
    AntiAlias(AntiAlias),
    BandLimit(BandLimit),
    Deep(Deep),
}

/// Working memory of an [`Encoder`] for one call at a time.
pub struct EncoderScratch {
    prefilter: Option<PrefilterScratch>,
    /// The largest |u|² of each row.
    most: Vec<f32>,
}

enum PrefilterScratch {
    AntiAlias(AntiAliasScratch),
    Spectrum(ConvolveScratch),
    Deep(DeepScratch),
}

impl Encoder {
    /// Plans the encoding of (3, H, W) = `shape` fields at the modulator of `target`: after its filter a field is
    /// divided by the light that falls there.
    ///
    /// # Errors
    /// An empty plane, a parameter out of its range, a network that is no pre-filter, or a table for another modulator.
    pub fn new(shape: (usize, usize), target: &Target, encoding: &Encoding) -> Result<Self> {
        let (height, width) = shape;
        if height == 0 || width == 0 {
            return Err(Error::Plan(format!(
                "a plane of {width}×{height} is empty; each side must be at least 1"
            )));
        }
        target.check()?;
        let prefilter = match encoding {
            Encoding::DoublePhase => Prefilter::None,
            Encoding::AntiAlias { sigma, width } => Prefilter::AntiAlias(AntiAlias::new(*sigma, *width)?),
            Encoding::BandLimit { k } => Prefilter::BandLimit(BandLimit::new(height, width, *k)?),
            Encoding::Deep(network) => Prefilter::Deep(Deep::new(height, width, network)?),
        };
        let illumination = target.illumination.clone();
        Ok(Encoder {
            height,
            width,
            prefilter,
            illumination: illumination.map(|light| (light, target.modulator())),
            response: target.response.clone().centred(height, width)?,
        })
    }

    /// Working memory for one call at a time.
    pub fn scratch(&self) -> EncoderScratch {
        let prefilter = match &self.prefilter {
            Prefilter::None => None,
            Prefilter::AntiAlias(plan) => Some(PrefilterScratch::AntiAlias(plan.scratch(self.width))),
            Prefilter::BandLimit(plan) => Some(PrefilterScratch::Spectrum(plan.scratch())),
            Prefilter::Deep(plan) => Some(PrefilterScratch::Deep(plan.scratch())),
        };
        EncoderScratch {
            prefilter,
            most: vec![0.0; 3 * self.height],
        }
    }

    /// Encodes `field`, a stack (3, H, W), into `phase`, (3, H, W) in \[0, 2π); gives the scale it used, the amplitude
    /// that full light stands for: `scale`, or the field's largest amplitude. `field` is worked on: what it holds
    /// afterwards means nothing. Allocates nothing.
    ///
    /// # Panics
    /// If `field` or `phase` has not 3·H·W values.
    pub fn encode(
        &self,
        field: &mut [Complex32],
        scale: Option<f32>,
        phase: &mut [f32],
        scratch: &mut EncoderScratch,
    ) -> f32 {
        let scale = self.prepare(field, scale, scratch);
        self.rows(field, phase, scratch, |row, values, phases| {
            double_phase::encode_row(values, row % self.height, scale, phases);
        });
        scale
    }

    /// [`Self::encode`] straight to the target's levels.
    ///
    /// # Panics
    /// If `field` or `levels` has not 3·H·W values.
    pub fn encode_levels(
        &self,
        field: &mut [Complex32],
        scale: Option<f32>,
        levels: &mut [u8],
        scratch: &mut EncoderScratch,
    ) -> f32 {
        let scale = self.prepare(field, scale, scratch);
        self.rows(field, levels, scratch, |row, values, levels| {
            let (y, first) = (row % self.height, row * self.width);
            double_phase::encode_row_levels(values, y, scale, &self.response, first, levels);
        });
        scale
    }

    /// The filters that need the whole field at once, the light where no filter by rows comes after it, and the scale.
    fn prepare(&self, field: &mut [Complex32], scale: Option<f32>, scratch: &mut EncoderScratch) -> f32 {
        let plane = self.height * self.width;
        assert_eq!(field.len(), 3 * plane);
        match (&self.prefilter, &mut scratch.prefilter) {
            (Prefilter::BandLimit(plan), Some(PrefilterScratch::Spectrum(scratch))) => {
                for plane in field.chunks_exact_mut(plane) {
                    plan.filter(plane, scratch);
                }
            }
            (Prefilter::Deep(plan), Some(PrefilterScratch::Deep(scratch))) => {
                plan.filter(field, scratch);
            }
            _ => {}
        }
        if let Some((illumination, modulator)) = &self.illumination
            && !matches!(self.prefilter, Prefilter::AntiAlias(_))
        {
            illumination.divide(field, (self.height, self.width), *modulator);
        }
        match scale {
            Some(scale) => scale,
            None => {
                let mut most = std::mem::take(&mut scratch.most);
                self.rows(field, &mut most, scratch, |_, values, most| {
                    most[0] = double_phase::max_norm_sqr(values);
                });
                let scale = most.iter().copied().fold(0.0, f32::max).sqrt();
                scratch.most = most;
                scale
            }
        }
    }

    /// Hands each row of `field`, filtered by what needs some rows alone, and divided by the light, to `then`: its
    /// index in the stack, its values, and its part of `out`.
    fn rows<T: Send>(
        &self,
        field: &[Complex32],
        out: &mut [T],
        scratch: &mut EncoderScratch,
        then: impl Fn(usize, &[Complex32], &mut [T]) + Sync,
    ) {
        let (height, width) = (self.height, self.width);
        let per_row = out.len() / (3 * height);
        assert!(out.len() == 3 * height * per_row && (per_row == 1 || per_row == width));
        if let (Prefilter::AntiAlias(plan), Some(PrefilterScratch::AntiAlias(scratch))) =
            (&self.prefilter, &mut scratch.prefilter)
        {
            let planes = field.chunks_exact(height * width);
            let outs = out.chunks_exact_mut(height * per_row);
            for (colour, (plane, out)) in planes.zip(outs).enumerate() {
                plan.rows(plane, width, out, scratch, |y, values, out| {
                    let row = colour * height + y;
                    if let Some((illumination, modulator)) = &self.illumination {
                        illumination.divide_row(values, row, height, *modulator);
                    }
                    then(row, values, out);
                });
            }
            return;
        }
        field
            .par_chunks_exact(width)
            .zip(out.par_chunks_exact_mut(per_row))
            .enumerate()
            .for_each(|(row, (values, out))| then(row, values, out));
    }
}
