//! Runs the correction: one dispatch to start, one for each local step, then midpoint steps or the start of those of
//! natural focus. The last dispatch writes levels. The counterpart of [`phasefront_core::encode::local`].

use super::midpoint::Midpoint;
use super::natural::Natural;
use super::shared::Shared;
use super::{COLUMNS, EncoderJob, LevelsBuffers};
use crate::Result;
use crate::device::{Device, Dispatch};
use phasefront_core::Size;
use phasefront_core::encode::local::LocalFilter;
use phasefront_core::frame::Past;

/// The side of the square of pixels that a workgroup corrects.
const SIDE: usize = 16;

/// The correction of one field into several output buffers.
pub(super) struct Local {
    /// Saves the wanted field if a filter overwrites it.
    keep: Option<Dispatch>,
    /// The start and all local steps before the last dispatch.
    begin: Vec<Dispatch>,
    pub(super) last: Last,
}

/// The dispatches that write levels.
pub(super) enum Last {
    /// A local step for each output buffer.
    Local(Vec<Dispatch>),
    Midpoint(Box<Midpoint>),
    Natural(Box<Natural>),
}

impl Local {
    pub(super) fn new(
        device: &Device,
        job: &EncoderJob<'_>,
        shared: &Shared<'_>,
        buffers: &[LevelsBuffers],
    ) -> Result<Self> {
        let Size { width, height } = job.size;
        let bytes = 24 * height * width;
        // A saved field is turned when it is saved; otherwise the field is turned when it is read.
        let replaces = shared.filtered.replaces;
        let source = format!(
            "const KEEP_TURN: bool = {};\nconst GOAL_TURN: bool = {};\n{}{}",
            job.turn.is_some(),
            !replaces && job.turn.is_some(),
            shared.source,
            include_str!("local.wgsl")
        );
        let by_rows = [width.div_ceil(COLUMNS), height, 3];
        let (keep, wanted) = if replaces {
            let wanted = device.buffer("the wanted field", bytes)?;
            let program = device.program("the wanted field", source.clone(), "keep");
            let arguments = [
                (0, shared.frame.buffer.as_entire_binding()),
                (2, job.field.as_entire_binding()),
                (3, job.turn.unwrap_or(job.field).as_entire_binding()),
                (12, wanted.as_entire_binding()),
            ];
            (Some(program.on(device, &arguments, by_rows)?), wanted)
        } else {
            (None, job.field.clone())
        };
        let missing = [
            device.buffer("what is missing", bytes)?,
            device.buffer("what is missing after a step", bytes)?,
        ];
        let taps = LocalFilter::of_aperture(job.target.display.aperture_radius());
        let taps = device.constants("the aperture's taps", bytemuck::cast_slice(taps.taps()))?;

        let program = device.program("the start", source.clone(), "begin");
        let mut arguments = shared.arguments(&[0, 1, 2, 3, 5, 9]);
        arguments.push((10, wanted.as_entire_binding()));
        arguments.push((12, missing[0].as_entire_binding()));
        let mut begin = vec![program.on(device, &arguments, by_rows)?];

        let of_step = |step: usize, bindings: &[u32]| {
            let mut arguments = shared.arguments(bindings);
            arguments.push((10, wanted.as_entire_binding()));
            arguments.push((11, missing[step % 2].as_entire_binding()));
            arguments.push((13, taps.buffer.as_entire_binding()));
            arguments
        };
        let grid = [width.div_ceil(SIDE), height.div_ceil(SIDE)];
        let steps = job.options.local_steps;
        let (to_midpoint, to_natural) = (job.options.midpoint_steps > 0, job.options.focus_steps > 0);
        let program = device.program("a local step", source.clone(), "step_on");
        let before = if to_midpoint || to_natural { steps } else { steps - 1 };
        for step in 0..before {
            let mut arguments = of_step(step, &[0, 1, 3, 5, 9]);
            arguments.push((12, missing[(step + 1) % 2].as_entire_binding()));
            begin.push(program.on(device, &arguments, [grid[0], grid[1], 3])?);
        }
        let left = [&wanted, &missing[before % 2]];
        let last = if to_midpoint {
            Last::Midpoint(Box::new(Midpoint::new(device, job, shared, &source, left, buffers)?))
        } else if to_natural {
            Last::Natural(Box::new(Natural::new(device, job, shared, &source, left, buffers)?))
        } else {
            let program = device.program("the last local step", source, "finish");
            let arguments = of_step(before, &[0, 1, 3, 5, 8]);
            Last::Local(shared.levels_program(device, &program, &arguments, [grid[0], grid[1], 1], buffers)?)
        };
        Ok(Local { keep, begin, last })
    }

    /// Sets the previous frame of the next submission.
    pub(super) fn set_past(&self, device: &Device, past: Option<Past>) {
        match &self.last {
            Last::Local(_) => {}
            Last::Midpoint(midpoint) => midpoint.still.set_past(device, past),
            Last::Natural(natural) => natural.still.set_past(device, past),
        }
    }

    /// Saves the wanted field. Must be called before the field is filtered.
    pub(super) fn keep(&self, pass: &mut wgpu::ComputePass<'_>) {
        if let Some(keep) = &self.keep {
            keep.run(pass);
        }
    }

    /// Corrects into the output buffers with that index, or only starts the steps of natural focus.
    pub(super) fn run(&self, pass: &mut wgpu::ComputePass<'_>, buffers: usize) {
        self.begin.iter().for_each(|step| step.run(pass));
        match &self.last {
            Last::Local(finish) => finish[buffers].run(pass),
            Last::Midpoint(midpoint) => midpoint.run(pass, buffers),
            Last::Natural(natural) => natural.begin(pass),
        }
    }
}
