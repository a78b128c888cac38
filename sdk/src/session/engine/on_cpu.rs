//! Computes a quality level on the CPU, from amplitudes and depth to levels.

use crate::session::options::SessionOptions;
use crate::session::quality::QualityLevel;
use crate::session::statistics::BackendReport;
use phasefront_core::pipeline::{Pipeline, PipelineScratch};
use phasefront_core::runtime::cancel::Cancel;
use phasefront_core::runtime::error::Result;

/// The plan and memory of a quality level on the CPU.
pub(in crate::session) struct OnCpu {
    pub(super) pipeline: Pipeline,
    pub(super) scratch: PipelineScratch,
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
        if options.keep_standing {
            pipeline.keep_standing(&mut scratch);
        }
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
        let QualityLevel { size, method, .. } = quality_level;
        Pipeline::new(
            *size,
            method.clone(),
            &options.target,
            quality_level.encoder(&options.encoder),
        )
    }

    pub(in crate::session) fn report(&self) -> BackendReport {
        let method = self.pipeline.method();
        let (engine, sweep) = (method.engine(), method.swept_on());
        let name = engine.map(|engine| engine.name).or(sweep.map(|isa| isa.name()));
        let sweep = sweep.map(|isa| format!("the plane sweep in 16-bit integers on {isa}"));
        let why: Vec<_> = engine
            .map(|engine| engine.why.clone())
            .into_iter()
            .chain(sweep)
            .collect();
        BackendReport {
            name: name.unwrap_or_default().into(),
            why: why.join("; "),
        }
    }
}
