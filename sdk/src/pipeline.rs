//! One RGB-D frame through all stages: midpoint hologram, offset, phase encoding, levels, with the time
//! of each. Many frames are a session's work.

use crate::display::Display;
use crate::encode::{Encoding, Scale};
use crate::error::Result;
use crate::frame::RgbdFrame;
use crate::illumination::Illumination;
use crate::method::{Method, MethodPlan, MethodScratch};
use crate::modulator::{Modulation, Modulator, ModulatorScratch, remove_mean_phase};
use crate::slm::Response;
use crate::wave::zernike::Aberration;
use num_complex::Complex32;
use std::time::{Duration, Instant};

/// A plan for one method, frame shape and display. Immutable; shared between threads.
pub struct Pipeline {
    method: MethodPlan,
    modulator: Modulator,
}

/// Working memory of a [`Pipeline`] for one frame at a time.
pub struct PipelineScratch {
    method: MethodScratch,
    modulator: ModulatorScratch,
}

/// How long each stage of a frame took.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageTimes {
    /// From the frame to the hologram where the method ends.
    pub method: Duration,
    /// From there to the modulator.
    pub propagate: Duration,
    /// From the field to levels.
    pub encode: Duration,
}

impl StageTimes {
    /// All stages together.
    pub fn total(&self) -> Duration {
        self.method + self.propagate + self.encode
    }
}

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameReport {
    /// The amplitude that full light stands for.
    pub scale: f32,
    /// How long it took.
    pub times: StageTimes,
}

impl Pipeline {
    /// Plans (`height`, `width`) frames by `method` to `display`, whose response is `response`.
    ///
    /// # Errors
    /// What [`MethodPlan::new`] or [`Modulator::new`] refuses.
    pub fn new(
        height: usize,
        width: usize,
        method: Method,
        display: &Display,
        encoding: Encoding,
        scale: Scale,
        response: Response,
    ) -> Result<Self> {
        let method = MethodPlan::new(height, width, method, display)?;
        // The modulator does the rest of the way.
        let left_m = display.offset_m() - method.z_m();
        let display = display.clone().with_offset_m(left_m)?;
        Ok(Pipeline {
            method,
            modulator: Modulator::new(height, width, &display, encoding, scale, response)?,
        })
    }

    /// [`Modulator::with_illumination`].
    pub fn with_illumination(mut self, illumination: Illumination) -> Self {
        self.modulator = self.modulator.with_illumination(illumination);
        self
    }

    /// [`Modulator::with_correction`].
    ///
    /// # Errors
    /// As that.
    pub fn with_correction(mut self, correction: &Aberration) -> Result<Self> {
        self.modulator = self.modulator.with_correction(correction)?;
        Ok(self)
    }

    /// (H, W).
    pub fn shape(&self) -> (usize, usize) {
        self.method.shape()
    }

    /// The plan of the method.
    pub fn method(&self) -> &MethodPlan {
        &self.method
    }

    /// Working memory for one frame at a time.
    pub fn scratch(&self) -> PipelineScratch {
        PipelineScratch {
            method: self.method.scratch(),
            modulator: self.modulator.scratch(),
        }
    }

    /// The field at the modulator, into `field`, (3, H, W): the method's hologram, mean phase taken out (but for an
    /// encoding that was trained with it), the rest of the offset. Gives the times of the method and of the rest.
    ///
    /// # Errors
    /// A frame of another shape.
    pub fn field(
        &self,
        frame: &RgbdFrame,
        field: &mut [Complex32],
        scratch: &mut PipelineScratch,
    ) -> Result<(Duration, Duration)> {
        let start = Instant::now();
        self.method.field(frame, field, &mut scratch.method)?;
        if !self.modulator.keeps_phase() {
            remove_mean_phase(field);
        }
        let predicted = Instant::now();
        self.modulator.propagate(field, &mut scratch.modulator);
        Ok((predicted - start, predicted.elapsed()))
    }

    /// Encodes a field at the modulator, (3, H, W), into `levels`, as [`Modulator::modulate`].
    ///
    /// # Panics
    /// If `field` or `levels` has not 3·H·W values.
    pub fn modulate(
        &self,
        field: &mut [Complex32],
        levels: &mut [u8],
        scratch: &mut PipelineScratch,
    ) -> Modulation {
        self.modulator
            .modulate(field, levels, &mut scratch.modulator)
    }

    /// [`Self::modulate`] at another scale than the planned one: a session chooses it for each frame.
    ///
    /// # Panics
    /// If `field` or `levels` has not 3·H·W values.
    pub fn modulate_at(
        &self,
        field: &mut [Complex32],
        scale: Scale,
        levels: &mut [u8],
        scratch: &mut PipelineScratch,
    ) -> Modulation {
        self.modulator
            .modulate_at(field, scale, levels, &mut scratch.modulator)
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
        scratch: &mut PipelineScratch,
    ) -> Modulation {
        self.modulator
            .phases_at(field, scale, phases, &mut scratch.modulator)
    }

    /// One frame: its field into `field` and its levels into `levels`, both (3, H, W). `field` is worked
    /// on: what it holds afterwards means nothing.
    ///
    /// # Errors
    /// A frame of another shape.
    ///
    /// # Panics
    /// If `levels` has not 3·H·W values.
    pub fn process(
        &self,
        frame: &RgbdFrame,
        field: &mut [Complex32],
        levels: &mut [u8],
        scratch: &mut PipelineScratch,
    ) -> Result<FrameReport> {
        let (method, propagate) = self.field(frame, field, scratch)?;
        let modulation = self.modulate(field, levels, scratch);
        Ok(FrameReport {
            scale: modulation.scale,
            times: StageTimes {
                method,
                propagate,
                encode: modulation.encode,
            },
        })
    }
}
