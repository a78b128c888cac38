//! Resources shared by the programs of double phase, local and midpoint correction: settings, laser light, response.

use super::filter::Filtered;
use super::{EncoderJob, LevelsBuffers};
use crate::Result;
use crate::device::{Constants, Device, Dispatch, Program};
use phasefront_core::Size;
use phasefront_core::display::response::{Response, per_pixel};
use phasefront_core::encode::brightness::Brightness;

/// The resources that the programs of double phase and of local correction share.
pub(super) struct Shared<'a> {
    pub(super) frame: &'a Constants,
    pub(super) filtered: &'a Filtered<'a>,
    /// The buffer that the scale is read from. For [`Brightness::FrameMax`] the same frame writes it first.
    pub(super) largest: &'a wgpu::Buffer,
    pub(super) source: String,
    settings: Constants,
    gains: Constants,
    response: Constants,
}

impl<'a> Shared<'a> {
    pub(super) fn new(
        device: &Device,
        job: &EncoderJob<'_>,
        frame: &'a Constants,
        filtered: &'a Filtered<'a>,
        largest: &'a wgpu::Buffer,
    ) -> Result<Self> {
        let fixed = match job.options.brightness {
            Brightness::Fixed(scale) => scale,
            _ => 0.0,
        };
        let mut settings = [0.0, 0.0, 0.0, fixed];
        settings[..filtered.taps.len()].copy_from_slice(&filtered.taps);
        static UNLIT: [f32; 12] = [1.0; 12];
        let light = job.target.illumination.as_ref();
        let gains = light.map_or(&UNLIT[..], |light| light.gains());
        let curves = Curves::of(job.response, job.size);
        Ok(Shared {
            frame,
            filtered,
            largest,
            source: header(job, filtered, &curves) + include_str!("double_phase.wgsl"),
            settings: device.constants("settings", bytemuck::cast_slice(&settings))?,
            gains: device.table("light", bytemuck::cast_slice(gains))?,
            response: device.table("the response", bytemuck::cast_slice(&curves.table))?,
        })
    }

    /// Returns the arguments for these bindings, among 0 to 3, 5, 8 and 9.
    pub(super) fn arguments(&self, bindings: &[u32]) -> Vec<(u32, wgpu::BindingResource<'_>)> {
        let of = |binding: &u32| {
            let buffer = match binding {
                0 => &self.frame.buffer,
                1 => &self.settings.buffer,
                2 => &self.filtered.field,
                // Bind any buffer if nothing is turned.
                3 => self.filtered.turn.unwrap_or(&self.response.buffer),
                5 => self.largest,
                8 => &self.response.buffer,
                _ => &self.gains.buffer,
            };
            (*binding, buffer.as_entire_binding())
        };
        bindings.iter().map(of).collect()
    }

    /// Binds a program that writes levels to these arguments and the levels, for each of `buffers`.
    pub(super) fn levels_program(
        &self,
        device: &Device,
        program: &Program,
        arguments: &[(u32, wgpu::BindingResource<'_>)],
        grid: [usize; 3],
        buffers: &[LevelsBuffers],
    ) -> Result<Vec<Dispatch>> {
        let into = |buffers: &LevelsBuffers| {
            let view = buffers.texture.create_view(&Default::default());
            let mut arguments = arguments.to_vec();
            arguments.push((6, buffers.levels.as_entire_binding()));
            arguments.push((7, wgpu::BindingResource::TextureView(&view)));
            program.on(device, &arguments, grid)
        };
        buffers.iter().map(into).collect()
    }
}

/// A response in the layout of the program.
struct Curves {
    /// The number of levels of a full turn.
    steps: u32,
    /// The table of the response. For linear levels it holds one unused value.
    table: Vec<u32>,
    pixels: bool,
    nodes: (usize, usize),
    spacing: usize,
    intervals: usize,
}

impl Curves {
    fn of(response: &Response, Size { width, height }: Size) -> Self {
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
                    nodes: per_pixel::nodes(Size { width, height }, pixels.spacing()),
                    spacing: pixels.spacing(),
                    intervals: pixels.intervals(),
                    ..curves(256, values.map(|value| value.to_bits()).collect())
                }
            }
        }
    }
}

/// Returns the constants of the program.
fn header(job: &EncoderJob<'_>, filtered: &Filtered<'_>, curves: &Curves) -> String {
    let (lit, modulator) = match &job.target.illumination {
        Some(light) => (light.nodes(), job.target.modulator()),
        None => ((2, 2), job.size),
    };
    format!(
        "const HALF: i32 = {};
        const TURN: bool = {};
        const FIXED: bool = {};
        const DARK: f32 = {:?};
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
        job.options.dark_threshold,
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
        modulator.height,
        modulator.width,
    )
}
