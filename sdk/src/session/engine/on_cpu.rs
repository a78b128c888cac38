//! Computes a quality level on the CPU, from amplitudes and depth to levels.

use crate::session::SessionOptions;
use crate::session::engine::frame_io::{Encoded, LevelsOut};
use crate::session::quality::QualityLevel;
use crate::session::statistics::BackendReport;
use num_complex::Complex32;
use phasefront_core::encode::brightness::Past;
use phasefront_core::frame::RgbdFrame;
use phasefront_core::pipeline::{Pipeline, PipelineScratch};
use phasefront_core::runtime::cancel::Cancel;
use phasefront_core::runtime::error::Result;

/// The plan and memory of a quality level on the CPU.
pub(in crate::session) struct OnCpu {
    pipeline: Pipeline,
    scratch: PipelineScratch,
    field: Vec<Complex32>,
    bits: u32,
    /// The phases for a display with more than 8 bits; otherwise empty.
    phases: Vec<f32>,
}

impl OnCpu {
    pub(in crate::session) fn new(
        options: &SessionOptions,
        quality_level: &QualityLevel,
        cancel: &Cancel,
    ) -> Result<Self> {
        let (height, width) = (quality_level.height, quality_level.width);
        let pipeline = Self::plan(options, quality_level)?;
        let display = &options.target.display;
        let (bits, values) = (display.bits(), display.colours() * height * width);
        let mut scratch = pipeline.scratch();
        scratch.set_cancel(cancel);
        Ok(OnCpu {
            scratch,
            pipeline,
            field: vec![Complex32::ZERO; values],
            bits,
            phases: match bits {
                0..=8 => Vec::new(),
                _ => vec![0.0; values],
            },
        })
    }

    /// Checks whether `quality_level` can be planned, using less memory than [`Self::new`].
    ///
    /// # Errors
    /// Returns an error in the same cases as [`Self::new`].
    pub(in crate::session) fn check(options: &SessionOptions, quality_level: &QualityLevel) -> Result<()> {
        Self::plan(options, quality_level).map(|_| ())
    }

    fn plan(options: &SessionOptions, quality_level: &QualityLevel) -> Result<Pipeline> {
        let (shape, method) = (
            (quality_level.height, quality_level.width),
            quality_level.method.clone(),
        );
        Pipeline::new(shape, method, &options.target, quality_level.encoder(options))
    }

    pub(in crate::session) fn report(&self) -> BackendReport {
        let engine = self.pipeline.method().engine();
        engine.map_or_else(BackendReport::default, |engine| BackendReport {
            name: engine.name.into(),
            why: engine.why.clone(),
        })
    }

    /// Computes the levels of `frame`, which follows another frame if there is a `past`.
    pub(in crate::session) fn process(
        &mut self,
        frame: &RgbdFrame,
        past: Option<Past>,
        out: LevelsOut<'_>,
    ) -> Result<Encoded> {
        let OnCpu {
            pipeline,
            scratch,
            field,
            bits,
            phases,
        } = self;
        let follows = past.is_some();
        let (method, propagate) = pipeline.field_after(follows, frame, field, scratch)?;
        let modulation = match out.words {
            None => pipeline.modulate_after(past, field, out.levels, scratch),
            Some(words) => {
                let modulation = pipeline.modulate_words_after(past, field, phases, words, scratch);
                for (level, word) in out.levels.iter_mut().zip(words) {
                    *level = (*word >> (*bits - 8)) as u8;
                }
                modulation
            }
        };
        Ok(Encoded {
            scale: modulation.scale,
            method,
            propagate,
            encode: modulation.encode,
        })
    }
}
