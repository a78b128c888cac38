//! A rung of the ladder on the CPU: from amplitudes and depth to levels.

use super::SessionOptions;
use super::brightness::BrightnessTracker;
use super::engine::{Encoded, Target};
use super::quality::Rung;
use super::statistics::BackendReport;
use crate::encode::Scale;
use crate::error::Result;
use crate::frame::RgbdFrame;
use crate::pipeline::{Pipeline, PipelineScratch};
use crate::slm;
use num_complex::Complex32;
use std::time::{Duration, Instant};

/// Plan and memory.
pub(super) struct OnCpu {
    pipeline: Pipeline,
    scratch: PipelineScratch,
    field: Vec<Complex32>,
    /// Where the display has over 8 bits.
    phases: Vec<f32>,
}

impl OnCpu {
    pub(super) fn new(options: &SessionOptions, rung: &Rung) -> Result<Self> {
        let (height, width) = (rung.height, rung.width);
        let mut pipeline = Pipeline::new(
            height,
            width,
            rung.method.clone(),
            &options.display,
            options.encoding.clone(),
            Scale::Max,
            options.response.clone(),
        )?;
        if let Some(illumination) = &options.illumination {
            pipeline = pipeline.with_illumination(illumination.clone());
        }
        if let Some(correction) = &options.correction {
            pipeline = pipeline.with_correction(correction)?;
        }
        Ok(OnCpu {
            scratch: pipeline.scratch(),
            pipeline,
            field: vec![Complex32::ZERO; 3 * height * width],
            phases: match options.display.bits() {
                0..=8 => Vec::new(),
                _ => vec![0.0; 3 * height * width],
            },
        })
    }

    pub(super) fn report(&self) -> BackendReport {
        let engine = self.pipeline.method().engine();
        engine.map_or_else(BackendReport::default, |engine| BackendReport {
            name: engine.name.into(),
            why: engine.why.clone(),
        })
    }

    /// Makes the levels, of `bits`, of `frame`, which follows the last one after `elapsed`.
    pub(super) fn process(
        &mut self,
        frame: &RgbdFrame,
        elapsed: Option<Duration>,
        brightness: &mut BrightnessTracker,
        target: Target<'_>,
        bits: u32,
    ) -> Result<Encoded> {
        let OnCpu {
            pipeline,
            scratch,
            field,
            phases,
        } = self;
        let (method, propagate) = pipeline.field(frame, field, scratch)?;
        let start = Instant::now();
        let scale = brightness.next(field, elapsed);
        let modulation = match target.words {
            None => pipeline.modulate_at(field, scale, target.levels, scratch),
            Some(words) => {
                let modulation = pipeline.phases_at(field, scale, phases, scratch);
                slm::linear_words(phases, bits, words);
                for (level, word) in target.levels.iter_mut().zip(words) {
                    *level = (*word >> (bits - 8)) as u8;
                }
                modulation
            }
        };
        Ok(Encoded {
            scale: modulation.scale,
            method,
            propagate,
            encode: start.elapsed(),
        })
    }
}
