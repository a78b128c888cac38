//! Turns a midpoint hologram into the modulator's levels: propagation over the offset, correction of the display's
//! wavefront errors, phase encoding and look-up table.
//!
//! This module does not depend on how the midpoint hologram was made.

use crate::Size;
use crate::display::levels::LevelsMut;
use crate::display::panel::PanelPlan;
use crate::display::registration::RegistrationPlan;
use crate::display::response;
use crate::display::target::Target;
use crate::encode::brightness::{Brightness, Percentile};
use crate::encode::midpoint::{MidpointScratch, MidpointSteps};
use crate::encode::modelled::{ModelScratch, ModelSteps};
use crate::encode::natural::{NaturalScratch, NaturalSteps};
use crate::encode::{Encoder, EncoderOptions, EncoderScratch, Encoding, Source};
use crate::frame::{Past, RgbdFrame};
use crate::method::wave::Wave;
use crate::optics::asm::Propagator;
use crate::optics::fft::ConvolveScratch;
use crate::pipeline::shown::Shown;
use crate::runtime::cancel::Cancel;
use crate::runtime::error::{Error, Result};
use crate::runtime::stage::stage;
use num_complex::Complex32;
use std::time::Duration;

/// A plan for one shape, target and encoding. It is immutable and can be shared between threads.
pub struct DisplayPlan {
    colours: usize,
    height: usize,
    width: usize,
    /// `None` if the field is already at the modulator and needs no correction.
    offset: Option<Vec<Propagator>>,
    registration: Option<RegistrationPlan>,
    encoder: Encoder,
    midpoint: Option<MidpointSteps>,
    /// Takes the place of `midpoint` on a display with a learned model.
    modelled: Option<ModelSteps>,
    /// Needs the frame of each field ([`DisplayPlan::aim`]).
    natural: Option<NaturalSteps>,
    panel: Option<PanelPlan>,
    bits: u32,
    keeps_phase: bool,
    brightness: Brightness,
}

/// The working memory of a [`DisplayPlan`] for one call at a time.
pub struct DisplayScratch {
    propagation: Option<ConvolveScratch>,
    /// A plane for registration. Empty if no colour is moved.
    moved: Vec<Complex32>,
    encoder: EncoderScratch,
    midpoint: Option<MidpointScratch>,
    modelled: Option<ModelScratch>,
    natural: Option<NaturalScratch>,
    /// Phases in memory before they are converted to levels. Empty if the encoder writes levels directly.
    phases: Vec<f32>,
    percentile: Percentile,
    /// The levels of the latest frame, if what stands still keeps them.
    shown: Option<Shown>,
    cancel: Cancel,
}

impl DisplayScratch {
    /// Makes the computation stop early once `cancel` is requested.
    pub fn set_cancel(&mut self, cancel: &Cancel) {
        self.encoder.set_cancel(cancel);
        if let Some(midpoint) = &mut self.midpoint {
            midpoint.set_cancel(cancel);
        }
        if let Some(modelled) = &mut self.modelled {
            modelled.set_cancel(cancel);
        }
        if let Some(natural) = &mut self.natural {
            natural.set_cancel(cancel);
        }
        self.cancel = cancel.clone();
    }
}

/// The result of encoding a field for the modulator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Modulation {
    /// The amplitude that maps to full light.
    pub scale: f32,
    /// The time from the field to levels.
    pub encode: Duration,
}

impl DisplayPlan {
    /// Plans the path of midpoint holograms of `size` to `target`. The correction of an aberration is part
    /// of the offset's transfer function, so it costs no extra time.
    ///
    /// # Errors
    /// Returns an error if the size, offset or correction cannot be planned, a scale is not positive, the pre-filter
    /// is for another display or offset, or a table is for another modulator.
    pub fn new(size: Size, target: &Target, options: &EncoderOptions) -> Result<Self> {
        Self::from_z(size, 0.0, target, options)
    }

    /// Plans the path of fields at `z_m` to `target`.
    ///
    /// # Errors
    /// Returns the same errors as [`Self::new`].
    pub fn from_z(size: Size, z_m: f64, target: &Target, options: &EncoderOptions) -> Result<Self> {
        if options.focus_steps > 0 {
            return Err(Error::Setting(
                "steps of natural focus need the RGB-D frame of a field; leave them out for a field alone".into(),
            ));
        }
        Self::for_frames(size, z_m, target, options)
    }

    /// Works like [`Self::from_z`] for fields whose frames are known: [`Self::aim`] takes each.
    ///
    /// # Errors
    /// Returns the same errors as [`Self::new`].
    pub fn for_frames(size: Size, z_m: f64, target: &Target, options: &EncoderOptions) -> Result<Self> {
        if let Encoding::Deep(network) = &options.encoding {
            network.check_prefilter(&target.display)?;
        }
        let distance_m = target.display.offset_m() - z_m;
        let colours = target.display.colours();
        Ok(DisplayPlan {
            colours,
            height: size.height,
            width: size.width,
            offset: target.propagators(size, 1, distance_m, target.correction.as_ref())?,
            registration: RegistrationPlan::new(size, colours, &target.registration)?,
            encoder: Encoder::new(size, target, options)?,
            midpoint: match options.midpoint_steps {
                steps if steps > 0 && target.model.is_none() => Some(MidpointSteps::new(size, target, steps)?),
                _ => None,
            },
            modelled: ModelSteps::new(size, target, options.midpoint_steps)?,
            natural: match options.focus_steps {
                0 => None,
                steps => Some(NaturalSteps::new(size, target, steps)?),
            },
            panel: PanelPlan::new(&target.panel, &target.display, size)?,
            bits: target.display.bits(),
            keeps_phase: options.encoding.keeps_phase(),
            brightness: options.brightness,
        })
    }

    /// Returns whether the encoding was trained on the phase of a network's field, which
    /// [`remove_mean_phase`](crate::method::mean_phase::remove_mean_phase) would change.
    pub fn keeps_phase(&self) -> bool {
        self.keeps_phase
    }

    /// Returns the number of colours.
    pub fn colours(&self) -> usize {
        self.colours
    }

    /// Returns the size of a hologram.
    pub fn size(&self) -> Size {
        Size {
            width: self.width,
            height: self.height,
        }
    }

    /// Returns working memory for one call at a time.
    pub fn scratch(&self) -> DisplayScratch {
        DisplayScratch {
            propagation: self.offset.as_ref().map(|plans| plans[0].scratch()),
            encoder: self.encoder.scratch(),
            moved: match &self.registration {
                None => Vec::new(),
                Some(_) => vec![Complex32::ZERO; self.height * self.width],
            },
            midpoint: self.midpoint.as_ref().map(MidpointSteps::scratch),
            modelled: self.modelled.as_ref().map(ModelSteps::scratch),
            natural: self.natural.as_ref().map(|natural| natural.scratch(1)),
            phases: if self.needs_phases() || self.bits > 8 {
                vec![0.0; self.colours * self.height * self.width]
            } else {
                Vec::new()
            },
            percentile: Percentile::default(),
            shown: None,
            cancel: Cancel::default(),
        }
    }

    /// Returns whether bytes are made from phases in memory rather than directly from the field.
    fn needs_phases(&self) -> bool {
        self.midpoint.is_some() || self.modelled.is_some() || self.natural.is_some() || self.panel.is_some()
    }

    /// Lets what stands still in a video keep its levels, in [`Self::modulate_wave`]. This takes memory for another
    /// hologram.
    pub(super) fn keep_standing(&self, scratch: &mut DisplayScratch) {
        if self.takes_waves() {
            scratch.shown = Some(Shown::new(self.colours * self.height * self.width));
        }
    }

    /// Returns whether [`Self::modulate_wave`] works: bytes are made row by row from a field that is already at the
    /// modulator.
    pub(super) fn takes_waves(&self) -> bool {
        let is_there = self.offset.is_none() && self.registration.is_none();
        is_there && self.bits <= 8 && !self.needs_phases() && self.encoder.takes_waves()
    }

    /// Stores the frame of the next field for the steps of natural focus.
    ///
    /// # Panics
    /// Panics if `scratch` belongs to another plan or the frame has another shape or other colours.
    pub fn aim(&self, frame: &RgbdFrame, scratch: &mut DisplayScratch) {
        if let (Some(plan), Some(of)) = (&self.natural, &mut scratch.natural) {
            plan.aim(frame, of);
        }
    }

    /// Propagates `field`, (C, H, W), to the modulator in place. Allocates nothing.
    ///
    /// # Panics
    /// Panics if `scratch` belongs to another plan or `field` does not have C·H·W values.
    pub fn propagate(&self, field: &mut [Complex32], scratch: &mut DisplayScratch) {
        if let (Some(plans), Some(waves)) = (&self.offset, &mut scratch.propagation) {
            for (plan, plane) in plans.iter().zip(field.chunks_exact_mut(self.height * self.width)) {
                if scratch.cancel.requested() {
                    return;
                }
                plan.propagate(plane, waves);
            }
        }
        if let Some(plan) = &self.registration {
            let planes = field.chunks_exact_mut(self.height * self.width);
            for (colour, plane) in planes.enumerate() {
                plan.apply(colour, plane, &mut scratch.moved);
            }
        }
    }

    /// Encodes a field at the modulator, (C, H, W), into `levels`. Afterwards the contents of `field` are unspecified.
    /// For a frame that follows another, smoothed brightness starts from its `past`, and the steps at the midpoint
    /// continue from its result. Allocates nothing.
    ///
    /// # Panics
    /// Panics if `field` or `levels` does not have C·H·W values, or if `levels` are words and the display has up to 8
    /// bits.
    pub fn modulate(
        &self,
        past: Option<Past>,
        field: &mut [Complex32],
        levels: LevelsMut<'_>,
        scratch: &mut DisplayScratch,
    ) -> Modulation {
        let stage = stage!("encode");
        let scale = match levels {
            LevelsMut::Bytes(levels) if !self.needs_phases() => {
                let scale = self.brightness.scale(field, past, &mut scratch.percentile);
                (self.encoder).encode_levels(field, scale, levels, &mut scratch.encoder)
            }
            levels => {
                let mut phases = std::mem::take(&mut scratch.phases);
                let scale = self.phases(past, field, &mut phases, scratch);
                match levels {
                    LevelsMut::Bytes(levels) => {
                        if !(self.panel.as_ref()).is_some_and(|panel| panel.levels(&phases, levels)) {
                            self.encoder.levels(&phases, levels);
                        }
                    }
                    LevelsMut::Words(words) => response::linear_words(&phases, self.bits, words),
                }
                scratch.phases = phases;
                scale
            }
        };
        Modulation {
            scale,
            encode: stage.end(),
        }
    }

    /// Works like [`Self::modulate`] for the wave of a method. What stands still keeps its levels after
    /// [`Self::keep_standing`]. If the frame is given up, levels may be old.
    ///
    /// # Panics
    /// Panics if this plan takes no waves, or `levels` or the wave does not have C·H·W values.
    pub(super) fn modulate_wave(
        &self,
        past: Option<Past>,
        wave: Wave<'_>,
        levels: &mut [u8],
        scratch: &mut DisplayScratch,
    ) -> Modulation {
        assert!(self.takes_waves());
        let stage = stage!("encode");
        let DisplayScratch {
            encoder,
            percentile,
            shown,
            cancel,
            ..
        } = scratch;
        let mut of_frame = Shown::default();
        let of = shown.as_mut().unwrap_or(&mut of_frame);
        let most = || self.encoder.most(Source::Wave(wave), encoder);
        let (scale, changed) = of.begin(past, &wave, self.brightness, percentile, most);
        match shown {
            None => self.encoder.encode_wave(wave, scale, None, levels, encoder),
            Some(shown) => {
                (self.encoder).encode_wave(wave, scale, changed, &mut shown.levels, encoder);
                if cancel.requested() {
                    shown.give_up();
                } else {
                    levels.copy_from_slice(&shown.levels);
                }
            }
        }
        Modulation {
            scale,
            encode: stage.end(),
        }
    }

    /// Works like [`Self::modulate`], but writes phases in \[0, 2π), and returns the amplitude that maps to full light.
    ///
    /// # Panics
    /// Panics if `field` or `phases` does not have C·H·W values.
    pub fn phases(
        &self,
        past: Option<Past>,
        field: &mut [Complex32],
        phases: &mut [f32],
        scratch: &mut DisplayScratch,
    ) -> f32 {
        let scale = self.brightness.scale(field, past, &mut scratch.percentile);
        let mut midpoint = self.midpoint.as_ref().zip(scratch.midpoint.as_mut());
        if let Some((plan, of)) = &mut midpoint {
            plan.keep(field, past.map(|past| past.scale), of);
        }
        let mut modelled = self.modelled.as_ref().zip(scratch.modelled.as_mut());
        if let Some((plan, of)) = &mut modelled {
            plan.keep(field, of);
        }
        let mut natural = self.natural.as_ref().zip(scratch.natural.as_mut());
        if let Some((plan, of)) = &mut natural {
            plan.keep(field, past.map(|past| past.scale), of);
        }
        let scale = self.encoder.encode(field, scale, phases, &mut scratch.encoder);
        if let Some((plan, of)) = natural {
            let _stage = stage!("natural focus");
            plan.correct(scale, phases, of);
        }
        if let Some((plan, of)) = midpoint {
            let _stage = stage!("midpoint");
            plan.correct(scale, phases, of);
        }
        if let Some((plan, of)) = modelled {
            let _stage = stage!("learned model");
            plan.correct(phases, of);
        }
        if let Some(panel) = &self.panel {
            panel.add(phases);
        }
        scale
    }
}
