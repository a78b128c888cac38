//! Computes a quality level on the CPU, from amplitudes and depth to levels.

use crate::session::SessionOptions;
use crate::session::quality::QualityLevel;
use crate::session::statistics::BackendReport;
use phasefront_core::display::levels::LevelsMut;
use phasefront_core::encode::brightness::Past;
use phasefront_core::frame::RgbdFrame;
use phasefront_core::pipeline::{FrameReport, Pipeline, PipelineScratch};
use phasefront_core::runtime::cancel::Cancel;
use phasefront_core::runtime::error::Result;

/// The plan and memory of a quality level on the CPU.
pub(in crate::session) struct OnCpu {
    pipeline: Pipeline,
    scratch: PipelineScratch,
}

impl OnCpu {
    pub(in crate::session) fn new(
        options: &SessionOptions,
        quality_level: &QualityLevel,
        cancel: &Cancel,
    ) -> Result<Self> {
        let pipeline = Self::plan(options, quality_level)?;
        let mut scratch = pipeline.scratch();
        scratch.set_cancel(cancel);
        Ok(OnCpu { pipeline, scratch })
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
        past: Option<Past>,
        frame: &RgbdFrame,
        levels: LevelsMut<'_>,
    ) -> Result<FrameReport> {
        self.pipeline.process_after(past, frame, levels, &mut self.scratch)
    }
}
