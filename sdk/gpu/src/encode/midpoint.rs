//! Runs steps at the midpoint. Each step is two convolutions, each followed by a dispatch. The counterpart of
//! [`phasefront_core::encode::midpoint`].

use super::shared::Shared;
use super::still::{self, Still};
use super::{COLUMNS, EncoderJob, LevelsBuffers};
use crate::Result;
use crate::device::{Device, Dispatch};
use crate::fft::{Convolution, Planes};
use num_complex::Complex32;
use phasefront_core::Size;
use phasefront_core::encode::midpoint::{GAIN, MidpointSteps, WAVE};

/// The midpoint steps of one field into several output buffers.
pub(super) struct Midpoint {
    steps: usize,
    pub(super) still: Still,
    depart: Dispatch,
    /// Propagates to the midpoint: the wanted field, then the displayed wave through the aperture.
    aim: Convolution,
    back: Convolution,
    ask: Dispatch,
    forth: Convolution,
    follow: Dispatch,
    /// One dispatch for each output buffer.
    arrive: Vec<Dispatch>,
}

impl Midpoint {
    /// Plans the steps after the program `source`, which leaves g − L·e in `missing`, where g is the field in `wanted`.
    pub(super) fn new(
        device: &Device,
        job: &EncoderJob<'_>,
        shared: &Shared<'_>,
        source: &str,
        [wanted, missing]: [&wgpu::Buffer; 2],
        buffers: &[LevelsBuffers],
    ) -> Result<Self> {
        let Size { width, height } = job.size;
        let aim = device.buffer("the wave at the midpoint", 24 * height * width)?;
        let still = Still::new(device, job.size)?;
        let source = [
            &format!("const WAVE: f32 = {WAVE:?};\nconst GAIN: f32 = {GAIN:?};\n"),
            source,
            still::SOURCE,
            include_str!("midpoint.wgsl"),
        ]
        .concat();
        let by_rows = [width.div_ceil(COLUMNS), height, 3];
        let dispatch = |what: &str, entry, bindings: &[u32], own: &[(u32, &wgpu::Buffer)]| {
            let mut arguments = shared.arguments(bindings);
            arguments.extend(own.iter().map(|(at, buffer)| (*at, buffer.as_entire_binding())));
            device
                .program(what, source.clone(), entry)
                .on(device, &arguments, by_rows)
        };
        let ways = MidpointSteps::new(job.size, job.target, job.options.midpoint_steps)?;
        let convolution = |field: &wgpu::Buffer, factors: &[&[Complex32]], padded| {
            let planes = Planes {
                field,
                size: job.size,
                padded,
                factors,
                turn: None,
            };
            Convolution::new(device, &planes)
        };
        let radius = job.target.display.aperture_radius();
        let [back, forth] = [ways.back(), ways.forth()];
        let free: Vec<_> = back.iter().map(|way| way.transfer().factors()).collect();
        let stopped = [back, forth].map(|ways| {
            let through = ways.iter().map(|way| way.transfer().factors_through(radius));
            through.collect::<Vec<_>>()
        });
        let [there, here] = (stopped.each_ref()).map(|ways| ways.iter().map(Vec::as_slice).collect::<Vec<_>>());
        let begun = [
            (10, wanted),
            (14, &aim),
            (15, missing),
            (16, &still.phasors),
            (17, &still.kept),
            (18, &still.bound.buffer),
        ];
        Ok(Midpoint {
            steps: job.options.midpoint_steps,
            depart: dispatch("the way to the midpoint", "depart", &[0, 1, 3, 5], &begun)?,
            aim: convolution(&aim, &free, back[0].padded_size())?,
            back: convolution(missing, &there, back[0].padded_size())?,
            ask: dispatch(
                "what is missing at the midpoint",
                "ask",
                &[0],
                &[(14, &aim), (15, missing)],
            )?,
            forth: convolution(missing, &here, forth[0].padded_size())?,
            follow: dispatch(
                "a step at the midpoint",
                "follow",
                &[0, 1, 5, 9],
                &[(15, missing), (16, &still.phasors)],
            )?,
            arrive: still.arrive(device, shared, source.clone(), buffers)?,
            still,
        })
    }

    /// Corrects into the output buffers with that index.
    pub(super) fn run(&self, pass: &mut wgpu::ComputePass<'_>, buffers: usize) {
        self.depart.run(pass);
        self.aim.run(pass);
        for _ in 0..self.steps {
            self.back.run(pass);
            self.ask.run(pass);
            self.forth.run(pass);
            self.follow.run(pass);
        }
        self.arrive[buffers].run(pass);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::super::device::testing::{device, field, run, upload};
    use super::super::{Encoder, EncoderJob, LevelsBuffers};
    use crate::method::chain::ChainOptions;
    use ndarray::Array3;
    use num_complex::Complex32;
    use phasefront_core::Size;
    use phasefront_core::display::Display;
    use phasefront_core::display::illumination::Illumination;
    use phasefront_core::display::levels::LevelsMut;
    use phasefront_core::display::response::Response;
    use phasefront_core::display::target::Target;
    use phasefront_core::encode::EncoderOptions;
    use phasefront_core::encode::brightness::Brightness;
    use phasefront_core::frame::Past;
    use phasefront_core::optics::zernike::Aberration;
    use phasefront_core::pipeline::display_plan::DisplayPlan;

    #[test]
    fn steps_are_those_of_the_cpu() {
        let device = device();
        let beam = Array3::from_shape_fn((3, 4, 7), |(c, y, x)| 1.0 / (1.0 + (c + y + x) as f32 / 20.0));
        let laser = Illumination::new(beam.view()).unwrap();
        let lens = Aberration::new([[0.0, 0.0, 1.5, 0.0, 0.0]; 3]).unwrap();
        let cases = [
            (Size { width: 47, height: 61 }, 0.0, 1.0, (1, 1), false, None),
            (Size { width: 47, height: 61 }, 2e-3, 0.9, (0, 2), true, None),
            (Size { width: 66, height: 40 }, -1e-3, 1.0, (2, 3), false, None),
            (Size { width: 70, height: 48 }, 1e-3, 1.0, (1, 2), true, Some(lens)),
            (Size { width: 1, height: 1 }, 0.0, 1.0, (0, 1), false, None),
        ];
        for (size, offset_m, radius, (local_steps, midpoint_steps), lit, correction) in cases {
            let display = Display::from_toml(&format!("aperture_radius = {radius:?}")).unwrap();
            let display = display.with_size(size).unwrap();
            let target = Target {
                illumination: lit.then(|| laser.clone()),
                correction,
                ..display.with_offset_m(offset_m).unwrap().into()
            };
            let options = EncoderOptions {
                brightness: Brightness::Fixed(1.2),
                local_steps,
                midpoint_steps,
                ..Default::default()
            };
            let area = size.height * size.width;
            let mut values = field(area);
            let buffer = upload(&device, &values);
            let (mut encoder, buffers) = device
                .guarded(|| {
                    let buffers = [LevelsBuffers::new(&device, size)?];
                    let job = EncoderJob {
                        field: &buffer,
                        size,
                        options: &options,
                        chain: ChainOptions::default(),
                        target: &target,
                        response: &Response::Linear { bits: 8 },
                        turn: None,
                    };
                    Ok((Encoder::new(&device, &job, &buffers)?, buffers))
                })
                .unwrap();
            let twin = DisplayPlan::new(size, &target, &options).unwrap();
            let mut scratch = twin.scratch();
            let past = Past {
                scale: 1.2,
                elapsed: std::time::Duration::from_secs(1),
            };
            // A single frame, and a frame that follows another and is partly static.
            for past in [None, Some(past)] {
                if past.is_some() {
                    values
                        .iter_mut()
                        .step_by(3)
                        .for_each(|value| *value *= Complex32::new(0.3, 0.6));
                }
                device.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(&values));
                encoder.set_past(&device, past);
                run(&device, |pass| encoder.run(pass, 0));
                let words = device.read(&buffers[0].levels, 4 * area).unwrap();
                let words: Vec<u32> = bytemuck::pod_collect_to_vec(&words);
                let mut levels = vec![0; 3 * area];
                let out = LevelsMut::Bytes(&mut levels);
                twin.modulate(past, &mut values.clone(), out, &mut scratch);
                let apart = levels.iter().enumerate().map(|(at, level)| {
                    let other = (words[at % area] >> (8 * (at / area))) as u8;
                    level.wrapping_sub(other).min(other.wrapping_sub(*level))
                });
                let apart: Vec<u8> = apart.collect();
                // Rounding may change a level by one. Larger differences occur only where a value is almost zero.
                let beside = apart.iter().filter(|d| **d > 0).count();
                let beyond = apart.iter().filter(|d| **d > 1).count();
                assert!(
                    beside * 50 <= apart.len() && beyond * 1000 <= apart.len(),
                    "{beside} and {beyond} of {} beside, {size:?} at {offset_m}, {past:?}",
                    apart.len()
                );
            }
        }
    }
}
