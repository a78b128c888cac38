//! Converts the field at the modulator to levels, as a buffer and as a texture: the filters of AA-DPM, BL-DPM and DDPM,
//! double phase and the response. The counterpart of [`phasefront_core::encode`] and
//! [`phasefront_core::display::response`].

mod blur;
mod double_phase;
mod filter;
mod local;
mod mean_phase;
mod midpoint;
mod natural;
mod shared;
mod still;

pub(super) use mean_phase::MeanPhase;
pub(super) use natural::Natural;
use phasefront_core::Size;

use super::Result;
use super::brightness::Smoother;
use super::device::Device;
use crate::method::chain::ChainOptions;
use double_phase::DoublePhase;
use filter::Filter;
use local::{Last, Local};
use phasefront_core::display::response::Response;
use phasefront_core::display::target::Target;
use phasefront_core::encode::EncoderOptions;
use phasefront_core::encode::brightness::Brightness;
use phasefront_core::frame::Past;
use shared::Shared;

/// The columns of a workgroup.
const COLUMNS: usize = 64;

/// The output of one frame.
pub(super) struct LevelsBuffers {
    /// (H, W) words: red, green, blue and 255, from the lowest byte up.
    pub(super) levels: wgpu::Buffer,
    /// The same levels as a texture.
    pub(super) texture: wgpu::Texture,
}

impl LevelsBuffers {
    pub(super) fn new(device: &Device, size: Size) -> Result<Self> {
        Ok(LevelsBuffers {
            levels: device.buffer("levels", 4 * size.height * size.width)?,
            texture: device.picture("levels", size, wgpu::TextureUsages::STORAGE_BINDING)?,
        })
    }
}

/// The input and the settings of an [`Encoder`].
pub(super) struct EncoderJob<'a> {
    /// (3, H, W) complex f32.
    pub(super) field: &'a wgpu::Buffer,
    /// The size of a hologram.
    pub(super) size: Size,
    pub(super) options: &'a EncoderOptions,
    /// The options for computing a pre-filter.
    pub(super) chain: ChainOptions,
    pub(super) target: &'a Target,
    /// The target's response, for this size.
    pub(super) response: &'a Response,
    /// The factors that the field's colours are multiplied by when they are read, if any.
    pub(super) turn: Option<&'a wgpu::Buffer>,
}

/// Encodes one field buffer into several output buffers.
pub(super) struct Encoder {
    /// The stage that computes smoothed brightness, if the options request it.
    smoother: Option<Smoother>,
    filter: Filter,
    double_phase: DoublePhase,
    /// One u32: the bits of the largest squared amplitude, or of the squared smoothed scale.
    pub(super) largest: wgpu::Buffer,
    brightness: Brightness,
}

impl Encoder {
    pub(super) fn new(device: &Device, job: &EncoderJob<'_>, buffers: &[LevelsBuffers]) -> Result<Self> {
        let Size { width, height } = job.size;
        let frame = [width, height, width * height, 0].map(|n| n as u32);
        let frame = device.constants("frame", bytemuck::cast_slice(&frame))?;
        let (filter, filtered) = Filter::new(device, job, &frame)?;
        let largest = device.buffer("the largest amplitude", 4)?;
        let smoother = match job.options.brightness {
            Brightness::Smoothed => {
                let len = 3 * height * width;
                Some(Smoother::new(device, job.field, len, &largest)?)
            }
            _ => None,
        };
        Ok(Encoder {
            smoother,
            filter,
            double_phase: {
                let shared = Shared::new(device, job, &frame, &filtered, &largest)?;
                DoublePhase::new(device, job, &shared, buffers)?
            },
            largest,
            brightness: job.options.brightness,
        })
    }

    /// Returns the steps of natural focus, if there are any.
    pub(super) fn natural(&self) -> Option<&Natural> {
        match &self.double_phase.local {
            Some(Local {
                last: Last::Natural(natural),
                ..
            }) => Some(natural),
            _ => None,
        }
    }

    /// Works like [`Self::natural`].
    pub(super) fn natural_mut(&mut self) -> Option<&mut Natural> {
        match &mut self.double_phase.local {
            Some(Local {
                last: Last::Natural(natural),
                ..
            }) => Some(natural),
            _ => None,
        }
    }

    /// Sets the previous frame of the next submission. Smoothed brightness, midpoint steps and those of natural focus
    /// continue from it.
    pub(super) fn set_past(&mut self, device: &Device, past: Option<Past>) {
        self.double_phase.set_past(device, past);
        if let Some(natural) = self.natural_mut() {
            natural.set_past(past.is_some());
        }
        if let Some(smoother) = &self.smoother {
            smoother.set_past(device, past);
        }
    }

    /// Resets the largest amplitude. Must be called before the pass of each frame.
    pub(super) fn reset(&self, encoder: &mut wgpu::CommandEncoder) {
        if self.brightness == Brightness::FrameMax {
            encoder.clear_buffer(&self.largest, 0, None);
        }
        if let Some(smoother) = &self.smoother {
            smoother.reset(encoder);
        }
    }

    /// Encodes into the output buffers with that index. With steps of natural focus, it only starts them, and
    /// [`Natural::arrive`] writes levels.
    pub(super) fn run(&self, pass: &mut wgpu::ComputePass<'_>, buffers: usize) {
        // Brightness is measured on the unfiltered field, as on the CPU.
        if let Some(smoother) = &self.smoother {
            smoother.run(pass);
        }
        self.double_phase.keep(pass);
        self.filter.run(pass);
        self.double_phase.run(pass, buffers);
    }

    /// Returns the scale of a frame from its `largest`, read back.
    pub(super) fn scale(&self, largest: u32) -> f32 {
        match self.brightness {
            Brightness::Fixed(scale) => scale,
            _ => f32::from_bits(largest).sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::device::testing::{device, field, run, upload};
    use super::*;
    use ndarray::Array3;
    use num_complex::Complex32;
    use phasefront_core::display::Display;
    use phasefront_core::display::illumination::Illumination;
    use phasefront_core::display::response::per_pixel::{self, PerPixel};
    use phasefront_core::encode::Encoding;
    use phasefront_core::encode::brightness::Brightness::{self, Fixed, FrameMax};
    use std::sync::Arc;

    type Case = (Size, Encoding, Brightness, Response);

    /// Compares the levels with every correction.
    fn agree_with_the_cpu(cases: &[Case]) {
        let device = device();
        let beam = Array3::from_shape_fn((3, 4, 7), |(c, y, x)| 1.0 / (1.0 + (c + y + x) as f32 / 20.0));
        let laser = Illumination::new(beam.view()).unwrap();
        let corrections = [
            (0.0, 0, false),
            (0.4, 0, true),
            (0.4, 1, false),
            (0.0, 2, true),
            (0.4, 3, false),
        ];
        for case in cases {
            for correction in corrections {
                agrees_with_the_cpu(&device, case, correction, &laser);
            }
        }
    }

    fn agrees_with_the_cpu(
        device: &Device,
        case: &Case,
        (dark, local_steps, lit): (f32, usize, bool),
        laser: &Illumination,
    ) {
        let (size, encoding, brightness, response) = case;
        let (size, brightness) = (*size, *brightness);
        let options = EncoderOptions {
            brightness,
            dark_threshold: if matches!(encoding, Encoding::AntiAlias { width: 9, .. }) {
                0.0
            } else {
                dark
            },
            local_steps,
            ..encoding.clone().into()
        };
        let aperture_radius = if lit { 0.9 } else { 1.0 };
        let display = Display::from_toml(&format!("aperture_radius = {aperture_radius:?}")).unwrap();
        let display = display.with_size(size).unwrap();
        let target = Target {
            response: response.clone(),
            illumination: lit.then(|| laser.clone()),
            ..display.into()
        };
        let area = size.height * size.width;
        let turns = [(0.6, 0.8), (-1.0, 0.0), (0.0, 1.0)].map(|(re, im)| Complex32::new(re, im));
        let turn = upload(device, &turns);
        let mut expected = field(area);
        let buffer = upload(device, &expected);
        let (encoder, buffers) = device
            .guarded(|| {
                let buffers = [LevelsBuffers::new(device, size)?, LevelsBuffers::new(device, size)?];
                let job = EncoderJob {
                    field: &buffer,
                    size,
                    options: &options,
                    chain: ChainOptions::default(),
                    target: &target,
                    response,
                    turn: Some(&turn),
                };
                let encoder = Encoder::new(device, &job, &buffers)?;
                Ok((encoder, buffers))
            })
            .unwrap();
        run(device, |pass| encoder.run(pass, 1));
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(&device.read(&buffers[1].levels, 4 * area).unwrap());
        for (plane, turn) in expected.chunks_exact_mut(area).zip(turns) {
            plane.iter_mut().for_each(|value| *value *= turn);
        }
        let mut given = expected.clone();
        let twin = phasefront_core::encode::Encoder::new(size, &target, &options).unwrap();
        let mut levels = vec![0; 3 * area];
        let scale = match brightness {
            Fixed(scale) => Some(scale),
            _ => None,
        };
        let mut scratch = twin.scratch();
        let used = twin.encode_levels(&mut expected, scale, &mut levels, &mut scratch);
        let mut phase = vec![0.0; 3 * area];
        twin.encode(&mut given, Some(used), &mut phase, &mut scratch);
        let largest: Vec<u32> = bytemuck::pod_collect_to_vec(&device.read(&encoder.largest, 4).unwrap());
        let found = encoder.scale(largest[0]);
        assert!(
            (found - used).abs() < 1e-4 * used,
            "{size:?} {encoding:?}: {found} {used}"
        );
        let what = format!("{size:?} {options:?}");
        compare(&words, &levels, &phase, response, local_steps > 0, &what);
    }

    /// Compares levels of the GPU, one word a pixel, with those of the CPU, whose phases are `phase`.
    fn compare(words: &[u32], levels: &[u8], phase: &[f32], response: &Response, stepped: bool, what: &str) {
        let area = words.len();
        // A level may differ by one if the phase is within rounding of the bound between two levels.
        let steps = match response {
            Response::Linear { bits } => (1 << bits) as f32,
            _ => 256.0,
        };
        let pixels = matches!(response, Response::PerPixel(_));
        let mut beside = 0;
        for c in 0..3 {
            for i in 0..area {
                let (level, expected) = ((words[i] >> (8 * c)) as u8, levels[c * area + i]);
                let step = phase[c * area + i] / std::f32::consts::TAU * steps;
                // acos is steep at full brightness.
                let near = (step - step.floor() - 0.5).abs();
                // With per-pixel curves, or where a step left a small value, a few levels may differ.
                let other = (pixels && level.abs_diff(expected) == 1) || stepped;
                let same = level == expected || near < 0.1;
                beside += usize::from(!same && other);
                assert!(
                    same || other,
                    "{what}: {level} for {expected} at {i} of {c}, step {step}"
                );
            }
        }
        let most = if pixels { 50 } else { 1000 };
        assert!(beside * most <= 3 * area, "{beside} of {} beside, {what}", 3 * area);
        assert!(words.iter().all(|word| word >> 24 == 255));
    }

    #[test]
    fn levels_are_those_of_the_cpu() {
        let lut = Response::lut(std::array::from_fn(|i| (i * 7 % 256) as u8));
        let wide = Encoding::AntiAlias { sigma: 2.0, width: 9 };
        let five = Encoding::AntiAlias { sigma: 1.0, width: 5 };
        let eight = Response::Linear { bits: 8 };
        let wide = || wide.clone();
        let (nodes, intervals) = (per_pixel::nodes(Size { width: 47, height: 61 }, 16), 8);
        let count = 3 * nodes.0 * nodes.1;
        // Each node has a different curve. The steepest curves do not reach 2π.
        let knots: Vec<f32> = (0..count)
            .flat_map(|n| (0..=intervals).map(move |k| 3.0 + k as f32 * (20.0 + n as f32 * 0.35)))
            .collect();
        let turns: Vec<f32> = (0..count).map(|n| 6.27 - 0.01 * n as f32).collect();
        let table = PerPixel::new(Size { width: 47, height: 61 }, 16, intervals, &knots, &turns).unwrap();
        let pixels = Response::PerPixel(Arc::new(table));
        agree_with_the_cpu(&[
            (
                Size { width: 47, height: 61 },
                Encoding::ANTI_ALIAS,
                Fixed(1.0),
                pixels.clone(),
            ),
            (Size { width: 47, height: 61 }, Encoding::DoublePhase, FrameMax, pixels),
            (
                Size { width: 47, height: 61 },
                Encoding::DoublePhase,
                FrameMax,
                eight.clone(),
            ),
            (
                Size { width: 47, height: 61 },
                Encoding::ANTI_ALIAS,
                FrameMax,
                lut.clone(),
            ),
            (
                Size { width: 47, height: 61 },
                Encoding::ANTI_ALIAS,
                Fixed(0.7),
                Response::Linear { bits: 5 },
            ),
            (Size { width: 47, height: 61 }, five, FrameMax, eight.clone()),
            (Size { width: 47, height: 61 }, wide(), Fixed(1.1), eight.clone()),
            (Size { width: 47, height: 61 }, Encoding::BAND_LIMIT, FrameMax, lut),
            (Size { width: 1, height: 1 }, wide(), FrameMax, eight.clone()),
        ]);
    }

    #[test]
    #[ignore = "slow: 5 seconds of a core in software"]
    fn levels_of_large_frames_are_those_of_the_cpu() {
        let eight = Response::Linear { bits: 8 };
        let small = Size {
            width: 384,
            height: 384,
        };
        let large = Size {
            width: 960,
            height: 540,
        };
        agree_with_the_cpu(&[
            (small, Encoding::ANTI_ALIAS, FrameMax, eight.clone()),
            (large, Encoding::ANTI_ALIAS, Fixed(1.0), eight),
        ]);
    }
}
