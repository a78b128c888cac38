//! Converts a filtered field to levels in one dispatch: dark threshold, double phase and the modulator's response.

use super::local::Local;
use super::shared::Shared;
use super::{COLUMNS, EncoderJob, LevelsBuffers};
use crate::Result;
use crate::device::{Device, Dispatch};
use phasefront_core::encode::brightness::Brightness;
use phasefront_core::frame::Past;

/// Encodes one field into several output buffers by double phase.
pub(super) struct DoublePhase {
    /// Finds the largest amplitude, if full brightness is defined by it.
    peak: Option<Dispatch>,
    /// One dispatch for each output buffer if there is no correction.
    encode: Vec<Dispatch>,
    pub(super) local: Option<Local>,
}

impl DoublePhase {
    pub(super) fn new(
        device: &Device,
        job: &EncoderJob<'_>,
        shared: &Shared<'_>,
        buffers: &[LevelsBuffers],
    ) -> Result<Self> {
        let grid = [job.size.width.div_ceil(COLUMNS), job.size.height, 1];
        let peak = if job.options.brightness == Brightness::FrameMax {
            let program = device.program("the largest amplitude", shared.source.clone(), "peak");
            let mut arguments = shared.arguments(&[0, 1, 2, 3, 9]);
            arguments.push((4, shared.largest.as_entire_binding()));
            Some(program.on(device, &arguments, grid)?)
        } else {
            None
        };
        let steps = job.options.local_steps + job.options.midpoint_steps + job.options.focus_steps;
        let (local, encode) = if steps > 0 {
            (Some(Local::new(device, job, shared, buffers)?), Vec::new())
        } else {
            let program = device.program("double phase", shared.source.clone(), "encode");
            let arguments = shared.arguments(&[0, 1, 2, 3, 5, 8, 9]);
            (
                None,
                shared.levels_program(device, &program, &arguments, grid, buffers)?,
            )
        };
        Ok(DoublePhase { peak, encode, local })
    }

    /// Sets the previous frame of the next submission.
    pub(super) fn set_past(&self, device: &Device, past: Option<Past>) {
        if let Some(local) = &self.local {
            local.set_past(device, past);
        }
    }

    /// Saves the field for a correction. Must be called before the field is filtered.
    pub(super) fn keep(&self, pass: &mut wgpu::ComputePass<'_>) {
        if let Some(local) = &self.local {
            local.keep(pass);
        }
    }

    /// Encodes into the output buffers with that index, or only starts the steps of natural focus.
    pub(super) fn run(&self, pass: &mut wgpu::ComputePass<'_>, buffers: usize) {
        if let Some(peak) = &self.peak {
            peak.run(pass);
        }
        match &self.local {
            Some(local) => local.run(pass, buffers),
            None => self.encode[buffers].run(pass),
        }
    }
}
