//! Double phase and the modulator's response: from a filtered field to levels, in one sweep.

use super::filter::Filtered;
use super::{COLUMNS, EncoderJob, LevelsBuffers};
use crate::brightness::Brightness;
use crate::gpu::Result;
use crate::gpu::device::{Constants, Device, Dispatch};
use crate::slm::{Response, per_pixel};

/// Double phase of one field into several buffers.
pub(super) struct DoublePhase {
    /// Finds the largest amplitude, where it is what full light stands for.
    peak: Option<Dispatch>,
    /// For each of the buffers.
    encode: Vec<Dispatch>,
}

impl DoublePhase {
    /// `largest` is what the scale is read from, and for [`Brightness::FrameMax`] first written to.
    pub(super) fn new(
        device: &Device,
        job: &EncoderJob<'_>,
        frame: &Constants,
        filtered: &Filtered<'_>,
        largest: &wgpu::Buffer,
        buffers: &[LevelsBuffers],
    ) -> Result<Self> {
        let fixed = match job.options.brightness {
            Brightness::Fixed(scale) => scale,
            _ => 0.0,
        };
        let mut settings = [0.0, 0.0, 0.0, fixed];
        settings[..filtered.taps.len()].copy_from_slice(&filtered.taps);
        let settings = device.constants("settings", bytemuck::cast_slice(&settings))?;
        static UNLIT: [f32; 12] = [1.0; 12];
        let light = job.target.illumination.as_ref();
        let gains = light.map_or(&UNLIT[..], |light| light.gains());
        let gains = device.table("light", bytemuck::cast_slice(gains))?;
        let curves = Curves::of(job.response, job.size);
        let source = header(job, filtered, &curves) + include_str!("double_phase.wgsl");
        let response = device.table("the response", bytemuck::cast_slice(&curves.table))?;
        let turn = filtered.turn.unwrap_or(&response.buffer);
        let common = [
            (9, gains.buffer.as_entire_binding()),
            (0, frame.buffer.as_entire_binding()),
            (1, settings.buffer.as_entire_binding()),
            (2, filtered.field.as_entire_binding()),
            (3, turn.as_entire_binding()),
        ];
        let grid = [job.size.1.div_ceil(COLUMNS), job.size.0, 1];
        let peak = if job.options.brightness == Brightness::FrameMax {
            let program = device.program("the largest amplitude", source.clone(), "peak");
            let mut arguments = common.to_vec();
            arguments.push((4, largest.as_entire_binding()));
            Some(program.on(device, &arguments, grid)?)
        } else {
            None
        };
        let program = device.program("double phase", source, "encode");
        let into = |buffers: &LevelsBuffers| {
            let view = buffers.texture.create_view(&Default::default());
            let mut arguments = common.to_vec();
            arguments.push((5, largest.as_entire_binding()));
            arguments.push((6, buffers.levels.as_entire_binding()));
            arguments.push((7, wgpu::BindingResource::TextureView(&view)));
            arguments.push((8, response.buffer.as_entire_binding()));
            program.on(device, &arguments, grid)
        };
        let encode = buffers.iter().map(into).collect::<Result<_>>()?;
        Ok(DoublePhase { peak, encode })
    }

    /// Encodes into the buffers of that index.
    pub(super) fn run(&self, pass: &mut wgpu::ComputePass<'_>, buffers: usize) {
        if let Some(peak) = &self.peak {
            peak.run(pass);
        }
        self.encode[buffers].run(pass);
    }
}

/// A response as the program reads it.
struct Curves {
    /// Levels of a full turn.
    steps: u32,
    /// One value that is not read where levels are linear.
    table: Vec<u32>,
    pixels: bool,
    nodes: (usize, usize),
    spacing: usize,
    intervals: usize,
}

impl Curves {
    fn of(response: &Response, (height, width): (usize, usize)) -> Self {
        let curves = |steps, table| Curves {
            steps,
            table,
            pixels: false,
            nodes: (1, 1),
            spacing: 1,
            intervals: 1,
        };
        match response {
            Response::Linear { bits } => curves(1 << bits, vec![0]),
            Response::Lut { level, .. } => curves(256, level.map(u32::from).to_vec()),
            Response::PerPixel(pixels) => {
                let values = pixels.knots().iter().chain(pixels.turns());
                Curves {
                    pixels: true,
                    nodes: per_pixel::nodes(height, width, pixels.spacing()),
                    spacing: pixels.spacing(),
                    intervals: pixels.intervals(),
                    ..curves(256, values.map(|value| value.to_bits()).collect())
                }
            }
        }
    }
}

/// What is constant in the program.
fn header(job: &EncoderJob<'_>, filtered: &Filtered<'_>, curves: &Curves) -> String {
    let (lit, modulator) = match &job.target.illumination {
        Some(light) => (light.nodes(), job.target.modulator()),
        None => ((2, 2), job.size),
    };
    format!(
        "const HALF: i32 = {};
        const TURN: bool = {};
        const FIXED: bool = {};
        const STEPS: u32 = {}u;
        const TABLE: bool = {};
        const PIXELS: bool = {};
        const ROWS: u32 = {}u;
        const COLUMNS: u32 = {}u;
        const SPACING: u32 = {}u;
        const INTERVALS: u32 = {}u;
        const LIT: bool = {};
        const LIGHT_ROWS: u32 = {}u;
        const LIGHT_COLUMNS: u32 = {}u;
        const ALL_HEIGHT: u32 = {}u;
        const ALL_WIDTH: u32 = {}u;
        ",
        filtered.taps.len() - 1,
        filtered.turn.is_some(),
        matches!(job.options.brightness, Brightness::Fixed(_)),
        curves.steps,
        curves.table.len() > 1,
        curves.pixels,
        curves.nodes.0,
        curves.nodes.1,
        curves.spacing,
        curves.intervals,
        job.target.illumination.is_some(),
        lit.0,
        lit.1,
        modulator.0,
        modulator.1,
    )
}
