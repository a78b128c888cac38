//! Runs steps of natural focus. Each propagates to the planes of its turn and back and ends with a dispatch. The CPU
//! computes the focal stack that they aim at. The counterpart of [`phasefront_core::encode::natural`].

use super::shared::Shared;
use super::still::{self, Still};
use super::{COLUMNS, EncoderJob, LevelsBuffers};
use crate::Result;
use crate::device::{Device, Dispatch};
use crate::fft::{Paths, PathsJob};
use phasefront_core::Size;
use phasefront_core::display::Display;
use phasefront_core::encode::natural::{
    FLOOR, FOCUS_PX, IN_FOCUS, MOMENTUM, NaturalSteps, first_step, rate, turn, turns,
};
use phasefront_core::focus::{FocalStack, FocalStackScratch, motion_per_m};
use phasefront_core::frame::RgbdFrame;

/// The steps of natural focus of one field into several output buffers.
pub(crate) struct Natural {
    steps: usize,
    /// The number of the frame's first step.
    first: usize,
    pub(super) still: Still,
    goal: Goal,
    depart: Dispatch,
    weigh: Dispatch,
    paths: Paths,
    /// One dispatch for each plane.
    miss: Vec<Dispatch>,
    /// One dispatch for each turn.
    follow: Vec<Dispatch>,
    /// One dispatch for each output buffer.
    arrive: Vec<Dispatch>,
}

/// The focal stack that the steps aim at, and the memory for computing it.
struct Goal {
    stack: FocalStack,
    scratch: FocalStackScratch,
    /// The amplitudes of one colour at a plane, (H, W).
    amplitudes: Vec<f32>,
    /// The amplitudes at each plane, (3, H, W).
    planes: Vec<wgpu::Buffer>,
    /// Normalized depth, (H, W).
    depths: wgpu::Buffer,
}

impl Natural {
    /// Plans the steps after the program `source`, which leaves g − L·e in `view`, where g is the field in `wanted`.
    pub(super) fn new(
        device: &Device,
        job: &EncoderJob<'_>,
        shared: &Shared<'_>,
        source: &str,
        [wanted, view]: [&wgpu::Buffer; 2],
        buffers: &[LevelsBuffers],
    ) -> Result<Self> {
        let (size, display) = (job.size, &job.target.display);
        let still = Still::new(device, size)?;
        let ways = NaturalSteps::new(size, job.target, job.options.focus_steps)?;
        let ends = PathsJob {
            field: &still.phasors,
            view,
            size,
            padded: ways.padded_size(),
        };
        let count = ways.paths().len() / display.colours();
        let through = |colour: usize, plane: usize| {
            let path = &ways.paths()[colour * count + plane];
            path.factors_through(display.aperture_radius())
        };
        let factors = (0..count).map(|plane| std::array::from_fn(|colour| through(colour, plane)));
        let paths = Paths::new(device, &ends, factors, turns(count))?;
        let goal = Goal::new(device, size, ways.into_stack())?;
        let speeds = device.buffer("the speed of phases", 12 * size.pixels())?;
        let sums = device.buffer("the sums of weights", 12 * size.pixels())?;
        let source = [
            &header(display, goal.stack.z_m()),
            include_str!("../direction.wgsl"),
            source,
            still::SOURCE,
            include_str!("natural.wgsl"),
        ]
        .concat();
        let by_rows = [size.width.div_ceil(COLUMNS), size.height, 3];
        let dispatch = |what: &str, entry, bindings: &[u32], own: &[(u32, &wgpu::Buffer)]| {
            let mut arguments = shared.arguments(bindings);
            arguments.extend(own.iter().map(|(at, buffer)| (*at, buffer.as_entire_binding())));
            let program = device.program(what, source.clone(), entry);
            program.on(device, &arguments, by_rows)
        };
        let number = |number: usize| device.constants("a number", bytemuck::cast_slice(&[number as f32; 4]));
        let miss = |(plane, amplitudes): (usize, &wgpu::Buffer)| {
            let number = number(plane)?;
            let own = [
                (14, view),
                (19, &goal.depths),
                (20, &sums),
                (21, amplitudes),
                (22, &number.buffer),
            ];
            dispatch("what is missing at a plane", "miss", &[0, 1, 5], &own)
        };
        let follow = |first: usize| {
            let number = number(turn(first, count).len())?;
            let own = [(14, view), (15, &speeds), (16, &still.phasors), (22, &number.buffer)];
            dispatch("a step of natural focus", "follow", &[0, 1, 5, 9], &own)
        };
        let begun = [
            (10, wanted),
            (14, view),
            (15, &speeds),
            (16, &still.phasors),
            (17, &still.kept),
            (18, &still.bound.buffer),
        ];
        Ok(Natural {
            steps: job.options.focus_steps,
            first: 0,
            depart: dispatch("the start of natural focus", "depart", &[0, 1, 3, 5], &begun)?,
            weigh: dispatch("weights", "weigh", &[0], &[(19, &goal.depths), (20, &sums)])?,
            paths,
            miss: goal.planes.iter().enumerate().map(miss).collect::<Result<_>>()?,
            follow: (0..turns(count)).map(follow).collect::<Result<_>>()?,
            arrive: still.arrive(device, shared, source.clone(), buffers)?,
            still,
            goal,
        })
    }

    /// Returns the number of steps.
    pub(crate) fn steps(&self) -> usize {
        self.steps
    }

    /// Lets the planes go on having their turns if the next submission `follows` a frame.
    pub(super) fn set_past(&mut self, follows: bool) {
        self.first = first_step(self.first, self.steps, self.goal.planes.len(), follows);
    }

    /// Computes and uploads the focal stack of `frame`, which the next submission aims at.
    pub(crate) fn aim(&mut self, device: &Device, frame: &RgbdFrame) {
        let (rgb, depth) = frame.values();
        let goal = &mut self.goal;
        device.write(&goal.depths, 0, bytemuck::cast_slice(depth));
        goal.stack.prepare(depth, &mut goal.scratch);
        for (index, plane) in goal.planes.iter().enumerate() {
            for (colour, amplitude) in rgb.chunks_exact(depth.len()).enumerate() {
                (goal.stack).write(colour, index, amplitude, &mut goal.amplitudes, &mut goal.scratch);
                device.write(plane, 4 * colour * depth.len(), bytemuck::cast_slice(&goal.amplitudes));
            }
            // Copies the plane now, so that the driver needs no second memory for the whole stack.
            device.queue.submit([]);
        }
    }

    /// Starts the steps of a frame from the encoder's result.
    pub(super) fn begin(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.depart.run(pass);
        self.weigh.run(pass);
    }

    /// Runs step `number` of a frame.
    pub(crate) fn step(&self, number: usize, pass: &mut wgpu::ComputePass<'_>) {
        let turn = (self.first + number) % self.follow.len();
        self.paths.run(turn, pass, |pass, plane| self.miss[plane].run(pass));
        self.follow[turn].run(pass);
    }

    /// Writes levels into the output buffers with that index.
    pub(crate) fn arrive(&self, pass: &mut wgpu::ComputePass<'_>, buffers: usize) {
        self.arrive[buffers].run(pass);
    }
}

impl Goal {
    fn new(device: &Device, size: Size, stack: FocalStack) -> Result<Self> {
        let plane = |_: &f64| device.buffer("a plane of the focal stack", 12 * size.pixels());
        Ok(Goal {
            scratch: stack.scratch(),
            amplitudes: vec![0.0; size.pixels()],
            planes: stack.z_m().iter().map(plane).collect::<Result<_>>()?,
            depths: device.buffer("depths", 4 * size.pixels())?,
            stack,
        })
    }
}

/// Returns the constants of the program for planes at `z_m`, which are evenly spaced.
fn header(display: &Display, z_m: &[f64]) -> String {
    let per_m = (display.wavelengths_m().iter()).map(|wavelength_m| motion_per_m(display, *wavelength_m).to_string());
    format!(
        "const IN_FOCUS: f32 = {IN_FOCUS:?};
        const FOCUS_PX: f32 = {FOCUS_PX:?};
        const MOMENTUM: f32 = {MOMENTUM:?};
        const RATE: f32 = {:?};
        const FLOOR: f32 = {FLOOR:?};
        const PLANES: u32 = {}u;
        const FIRST_M: f32 = {:?};
        const STEP_M: f32 = {:?};
        const VOLUME_M: f32 = {:?};
        const PER_M: vec3f = vec3f({});
        ",
        rate(1),
        z_m.len(),
        z_m[0] as f32,
        (z_m[1] - z_m[0]) as f32,
        display.volume_depth_m() as f32,
        per_m.collect::<Vec<_>>().join(", ")
    )
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::Encoder;
    use super::*;
    use crate::device::testing::{device, field, upload};
    use crate::method::chain::ChainOptions;
    use ndarray::{Array2, Array3};
    use num_complex::Complex32;
    use phasefront_core::display::illumination::Illumination;
    use phasefront_core::display::levels::LevelsMut;
    use phasefront_core::display::response::Response;
    use phasefront_core::display::target::Target;
    use phasefront_core::encode::EncoderOptions;
    use phasefront_core::encode::brightness::Brightness;
    use phasefront_core::frame::Past;
    use phasefront_core::optics::zernike::Aberration;
    use phasefront_core::pipeline::display_plan::DisplayPlan;
    use std::time::Duration;

    /// Creates a square before a slope, with textures.
    fn frame(Size { width, height }: Size) -> RgbdFrame {
        let is_near = |y: usize, x: usize| (height / 4..height / 2 + 1).contains(&y) && 3 * x > width;
        let rgb = Array3::from_shape_fn((3, height, width), |(c, y, x)| {
            let texture = ((x * 7 + y * 13 + c * 29) % 11) as f32 / 11.0;
            if is_near(y, x) {
                1.0 - 0.3 * texture
            } else {
                0.6 * texture
            }
        });
        let slope = |x: usize| 0.5 + 0.5 * x as f32 / width as f32;
        let depth = Array2::from_shape_fn((height, width), |(y, x)| if is_near(y, x) { 0.1 } else { slope(x) });
        RgbdFrame::new(rgb, depth).unwrap()
    }

    /// Encodes on the GPU and returns the levels, (3, H, W).
    fn levels_of(device: &Device, encoder: &Encoder, buffers: &LevelsBuffers, area: usize) -> Vec<u8> {
        let natural = encoder.natural().unwrap();
        let mut commands = device.inner.create_command_encoder(&Default::default());
        encoder.reset(&mut commands);
        let mut pass = commands.begin_compute_pass(&Default::default());
        encoder.run(&mut pass, 0);
        (0..natural.steps()).for_each(|number| natural.step(number, &mut pass));
        natural.arrive(&mut pass, 0);
        drop(pass);
        device.queue.submit([commands.finish()]);
        let words = device.read(&buffers.levels, 4 * area).unwrap();
        (0..3 * area).map(|at| words[4 * (at % area) + at / area]).collect()
    }

    /// Compares four frames of a video: the second one is partly static, the third dark.
    fn check(target: &Target, size: Size, options: &EncoderOptions) {
        let device = device();
        let area = size.pixels();
        let values = field(area);
        let buffer = upload(&device, &values);
        let made = device.guarded(|| {
            let buffers = [LevelsBuffers::new(&device, size)?];
            let job = EncoderJob {
                field: &buffer,
                size,
                options,
                chain: ChainOptions::default(),
                target,
                response: &Response::Linear { bits: 8 },
                turn: None,
            };
            Ok((Encoder::new(&device, &job, &buffers)?, buffers))
        });
        let (mut encoder, buffers) = made.unwrap();
        let twin = DisplayPlan::for_frames(size, 0.0, target, options).unwrap();
        let mut scratch = twin.scratch();
        let (frame, dark) = (frame(size), RgbdFrame::black(3, size));
        let mut moved = values.clone();
        (moved.iter_mut().step_by(3)).for_each(|value| *value *= Complex32::new(0.3, 0.6));
        let black = vec![Complex32::ZERO; values.len()];
        let mut past = None;
        for (at, (values, frame)) in [(&values, &frame), (&moved, &frame), (&black, &dark), (&moved, &frame)]
            .into_iter()
            .enumerate()
        {
            device.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(values));
            encoder.set_past(&device, past);
            encoder.natural_mut().unwrap().aim(&device, frame);
            let found = levels_of(&device, &encoder, &buffers[0], area);
            let mut levels = vec![0; 3 * area];
            twin.aim(frame, &mut scratch);
            let out = LevelsMut::Bytes(&mut levels);
            let scale = twin.modulate(past, &mut values.clone(), out, &mut scratch).scale;
            let apart = |(a, b): (&u8, &u8)| a.wrapping_sub(*b).min(b.wrapping_sub(*a));
            let count = |least: u8| (levels.iter().zip(&found)).filter(|pair| apart(*pair) >= least).count();
            // Rounding may change a level by one. Larger differences occur only where a value is almost zero.
            let (beside, beyond) = (count(1), count(2));
            println!(
                "{beside} and {beyond} of {} beside, {size:?}, frame {at}, {past:?}",
                levels.len()
            );
            assert!(
                beside * 50 <= levels.len() && beyond * 1000 <= levels.len(),
                "{options:?}"
            );
            past = Some(Past {
                scale,
                elapsed: Duration::from_secs(1),
            });
        }
    }

    #[test]
    fn steps_are_those_of_the_cpu() {
        let beam = Array3::from_shape_fn((3, 4, 7), |(c, y, x)| 1.0 / (1.0 + (c + y + x) as f32 / 20.0));
        let laser = Illumination::new(beam.view()).unwrap();
        let lens = Aberration::new([[0.0, 0.0, 1.5, 0.0, 0.0]; 3]).unwrap();
        let (fixed, most) = (Brightness::Fixed(1.2), Brightness::FrameMax);
        let size = |width, height| Size { width, height };
        for (size, offset_m, toml, steps, lit, correction, brightness) in [
            (size(47, 61), 0.0, "", (1, 3), false, None, fixed),
            (size(47, 31), 2e-3, "aperture_radius = 0.9", (0, 2), true, None, most),
            (
                size(40, 26),
                1e-3,
                "volume_depth_mm = 2",
                (2, 3),
                true,
                Some(lens),
                fixed,
            ),
            (size(1, 1), 0.0, "", (0, 3), false, None, most),
        ] {
            let display = Display::from_toml(toml).unwrap();
            let display = display.with_size(size).unwrap();
            let target = Target {
                illumination: lit.then(|| laser.clone()),
                correction,
                ..display.with_offset_m(offset_m).unwrap().into()
            };
            let options = EncoderOptions {
                brightness,
                local_steps: steps.0,
                focus_steps: steps.1,
                ..Default::default()
            };
            check(&target, size, &options);
        }
    }
}
