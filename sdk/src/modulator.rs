//! From the midpoint hologram to the modulator's levels: offset, correction of what the display does to the
//! wave, phase encoding, look-up table.
//!
//! Where the midpoint hologram comes from, a network or the laboratory, is not known here.

use crate::display::Display;
use crate::encode::{Encoder, EncoderScratch, Encoding, Scale, deep};
use crate::error::{Error, Result};
use crate::illumination::Illumination;
use crate::slm::Response;
use crate::wave::asm::{Padding, Propagator};
use crate::wave::fft::ConvolveScratch;
use crate::wave::zernike::Aberration;
use num_complex::{Complex32, Complex64};
use phasefront_kernels::wide;
use rayon::prelude::*;
use std::time::{Duration, Instant};

/// A plan for one shape, display and encoding. Immutable; shared between threads.
pub struct Modulator {
    height: usize,
    width: usize,
    display: Display,
    /// None where the modulator stands at the midpoint and there is nothing to correct.
    offset: Option<[Propagator; 3]>,
    encoder: Encoder,
    keeps_phase: bool,
    scale: Scale,
    response: Response,
}

/// Working memory of a [`Modulator`] for one call at a time.
pub struct ModulatorScratch {
    propagation: Option<ConvolveScratch>,
    encoder: EncoderScratch,
}

/// What became of a field on the modulator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Modulation {
    /// The amplitude that full light stands for.
    pub scale: f32,
    /// Time from the field to levels.
    pub encode: Duration,
}

impl Modulator {
    /// Plans the way of (3, `height`, `width`) midpoint holograms to `display`, whose response is
    /// `response`.
    ///
    /// # Errors
    /// An offset, shape or encoding that cannot be planned, a pre-filter for another display, a fixed scale that is
    /// not positive, or a response made for a smaller modulator.
    pub fn new(
        height: usize,
        width: usize,
        display: &Display,
        encoding: Encoding,
        scale: Scale,
        response: Response,
    ) -> Result<Self> {
        if let Scale::Fixed(scale) = scale
            && !(scale > 0.0 && scale.is_finite())
        {
            return Err(Error::Plan(format!(
                "a scale of {scale} cannot stand for full light; it must be above 0"
            )));
        }
        if let Encoding::Deep(network) = &encoding {
            deep::check(network, display)?;
        }
        let response = response.centred(height, width)?;
        let offset = match display.offset_m() {
            0.0 => None,
            offset_m => Some(Propagator::for_colours(
                height,
                width,
                display.pitch_m(),
                display.wavelengths_m(),
                offset_m,
                Padding::Reach,
            )?),
        };
        Ok(Modulator {
            height,
            width,
            display: display.clone(),
            offset,
            keeps_phase: matches!(encoding, Encoding::Deep(_)),
            encoder: Encoder::new(height, width, encoding)?,
            scale,
            response,
        })
    }

    /// The same for a display whose lasers light it as `illumination` says: what a pixel shall send is divided by what
    /// it gets, where the light falls and nothing filters it any more. A hologram smaller than the modulator stands in its
    /// middle.
    pub fn with_illumination(mut self, illumination: Illumination) -> Self {
        let modulator = (self.display.height(), self.display.width());
        self.encoder = self.encoder.with_illumination(illumination, modulator);
        self
    }

    /// The same for a display with an aberration that is one for all depths: its correction Φ is part of the offset's
    /// transfer function, so that it costs nothing beside it.
    ///
    /// # Errors
    /// A correction that moves light farther than can be padded.
    pub fn with_correction(mut self, correction: &Aberration) -> Result<Self> {
        self.offset = Some(Propagator::for_colours_corrected(
            self.height,
            self.width,
            self.display.pitch_m(),
            self.display.wavelengths_m(),
            self.display.offset_m(),
            correction,
            self.display.pitch_m(),
        )?);
        Ok(self)
    }

    /// Whether the encoding was trained on the phase that a network's field has, so that [`remove_mean_phase`] would
    /// take from it what it knows.
    pub fn keeps_phase(&self) -> bool {
        self.keeps_phase
    }

    /// (H, W).
    pub fn shape(&self) -> (usize, usize) {
        (self.height, self.width)
    }

    /// Working memory for one call at a time.
    pub fn scratch(&self) -> ModulatorScratch {
        ModulatorScratch {
            propagation: self.offset.as_ref().map(|plans| plans[0].scratch()),
            encoder: self.encoder.scratch(),
        }
    }

    /// Takes a midpoint hologram, (3, H, W), to the modulator: ASM(H, offset)·exp(−i2π·offset/λ), Eq. 6,
    /// whose second factor takes back the carrier that propagation here leaves out from the start; with the
    /// correction of an aberration, where there is one. Allocates nothing.
    ///
    /// # Panics
    /// If `field` has not 3·H·W values.
    pub fn propagate(&self, field: &mut [Complex32], scratch: &mut ModulatorScratch) {
        if let (Some(plans), Some(scratch)) = (&self.offset, &mut scratch.propagation) {
            for (plan, plane) in plans
                .iter()
                .zip(field.chunks_exact_mut(self.height * self.width))
            {
                plan.propagate(plane, scratch);
            }
        }
    }

    /// Encodes a field at the modulator, (3, H, W), into `levels`, (3, H, W). `field` is worked on:
    /// what it holds afterwards means nothing. Allocates nothing.
    ///
    /// # Panics
    /// If `field` or `levels` has not 3·H·W values.
    pub fn modulate(
        &self,
        field: &mut [Complex32],
        levels: &mut [u8],
        scratch: &mut ModulatorScratch,
    ) -> Modulation {
        self.modulate_at(field, self.scale, levels, scratch)
    }

    /// [`Self::modulate`] at another scale than the planned one.
    ///
    /// # Panics
    /// If `field` or `levels` has not 3·H·W values.
    pub fn modulate_at(
        &self,
        field: &mut [Complex32],
        scale: Scale,
        levels: &mut [u8],
        scratch: &mut ModulatorScratch,
    ) -> Modulation {
        let start = Instant::now();
        let scale =
            self.encoder
                .encode_levels(field, scale, &self.response, levels, &mut scratch.encoder);
        Modulation {
            scale,
            encode: start.elapsed(),
        }
    }

    /// [`Self::modulate_at`] to phases in \[0, 2π), for modulators whose levels do not fit bytes.
    ///
    /// # Panics
    /// If `field` or `phases` has not 3·H·W values.
    pub fn phases_at(
        &self,
        field: &mut [Complex32],
        scale: Scale,
        phases: &mut [f32],
        scratch: &mut ModulatorScratch,
    ) -> Modulation {
        let start = Instant::now();
        let scale = self
            .encoder
            .encode(field, scale, phases, &mut scratch.encoder);
        Modulation {
            scale,
            encode: start.elapsed(),
        }
    }
}

/// Turns each colour of `field`, (3, H, W), by its mean phase arg Σu, so that its phase is centred on 0:
/// a network's constant phase is arbitrary, and double phase wraps least around 0.
pub fn remove_mean_phase(field: &mut [Complex32]) {
    let size = field.len() / 3;
    if size == 0 {
        return;
    }
    for plane in field.chunks_exact_mut(size) {
        let turn = Complex64::from_polar(1.0, -sum(plane).arg());
        let turn = Complex32::new(turn.re as f32, turn.im as f32);
        plane.par_chunks_mut(PART).for_each(|part| {
            wide(|| {
                for value in part {
                    *value *= turn;
                }
            });
        });
    }
}

/// Values of a part that one thread takes.
const PART: usize = 1 << 14;

/// The sum of `values`, halved again and again at fixed places: the same bits on any number of threads.
fn sum(values: &[Complex32]) -> Complex64 {
    if values.len() > PART {
        let (first, second) = values.split_at(values.len().div_ceil(PART).div_ceil(2) * PART);
        let (first, second) = rayon::join(|| sum(first), || sum(second));
        return first + second;
    }
    const LANES: usize = 16;
    wide(|| {
        let (runs, rest) = values.as_chunks::<LANES>();
        let mut sums = [Complex32::ZERO; LANES];
        for run in runs {
            for (sum, value) in sums.iter_mut().zip(run) {
                *sum += value;
            }
        }
        let all = sums.iter().chain(rest);
        all.map(|v| Complex64::new(v.re.into(), v.im.into())).sum()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_phase_is_taken_from_each_colour() {
        let mut field: Vec<_> = (0..3 * 20_000)
            .map(|i| {
                Complex32::from_polar(
                    1.0 + (i % 7) as f32,
                    (i / 20_000) as f32 + 0.1 * (i % 3) as f32,
                )
            })
            .collect();
        remove_mean_phase(&mut field);
        for plane in field.chunks_exact(20_000) {
            let sum: Complex32 = plane.iter().sum();
            assert!(sum.arg().abs() < 1e-4);
        }
    }
}
