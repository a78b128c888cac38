//! From the field at the modulator to levels, as a buffer and as a texture: the filters of AA-DPM, BL-DPM and DDPM,
//! double phase, the response. The twin of [`crate::encode`] and [`crate::slm`].

use super::brightness::Steadier;
use super::chain::{ChainOptions, ChainPlan, End, Numbers};
use super::device::{Constants, Device, Dispatch};
use super::fft::{Convolution, Planes, quadrant};
use super::input::{Form, Packer, Source};
use super::{Error, Result};
use crate::brightness::{Brightness, Past};
use crate::encode::Encoding;
use crate::encode::anti_alias::AntiAlias;
use crate::encode::band_limit::BandLimit;
use crate::encode::deep;
use crate::illumination::Illumination;
use crate::network::Network;
use crate::slm::{Response, per_pixel};

/// Taps to one side up to which the blur is done in the same sweep as what follows it.
const FUSED_HALF: usize = 2;
/// Columns of a workgroup.
const COLUMNS: usize = 64;

/// The mean phase of a field, from the sums of the workgroups that made it.
pub(super) struct MeanPhase {
    step: Dispatch,
    /// Three complex f32: what each colour is to be multiplied by.
    pub(super) turn: wgpu::Buffer,
}

impl MeanPhase {
    pub(super) fn new(device: &Device, partial: &wgpu::Buffer, parts: usize) -> Result<Self> {
        let parts = device.constants("parts", bytemuck::cast_slice(&[parts as u32, 0, 0, 0]))?;
        let turn = device.buffer("the mean phase", 24)?;
        let program = device.program("the mean phase", include_str!("turn.wgsl").into(), "find");
        let arguments = [
            (0, parts.buffer.as_entire_binding()),
            (1, partial.as_entire_binding()),
            (2, turn.as_entire_binding()),
        ];
        let step = program.on(device, &arguments, [1, 1, 1])?;
        Ok(MeanPhase { step, turn })
    }

    pub(super) fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.step.run(pass);
    }
}

/// Where a frame's levels go.
pub(super) struct Target {
    /// (H, W) words: red, green, blue, 255 from the lowest byte on.
    pub(super) levels: wgpu::Buffer,
    /// The same as a picture.
    pub(super) texture: wgpu::Texture,
}

impl Target {
    pub(super) fn new(device: &Device, (height, width): (usize, usize)) -> Result<Self> {
        let most = device.limits().max_texture_dimension_2d as usize;
        if height.max(width) > most {
            return Err(Error::Refused(format!(
                "a picture of {width}×{height} is too large for {}, which takes {most} a side",
                device.name()
            )));
        }
        Ok(Target {
            levels: device.buffer("levels", 4 * height * width)?,
            texture: device.inner.create_texture(&wgpu::TextureDescriptor {
                label: Some("levels"),
                size: wgpu::Extent3d {
                    width: width as u32,
                    height: height as u32,
                    depth_or_array_layers: 1,
                },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba8Unorm,
                usage: wgpu::TextureUsages::STORAGE_BINDING
                    | wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            }),
        })
    }
}

/// The encoding of one field buffer into several targets.
pub(super) struct Encoder {
    /// Of steady brightness.
    steadier: Option<Steadier>,
    prefilter: Option<Prefilter>,
    convolution: Option<Convolution>,
    before: Vec<Dispatch>,
    /// For each target.
    encode: Vec<Dispatch>,
    /// One u32: the bits of the largest squared amplitude, or of the squared steady scale.
    pub(super) largest: wgpu::Buffer,
    brightness: Brightness,
}

impl Encoder {
    /// `field` is (3, H, W); `light` is that of a modulator of (H, W), in whose middle the frame stands; `turn` is what
    /// the field's colours are multiplied by on the way in, if anything.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn new(
        device: &Device,
        field: &wgpu::Buffer,
        size: (usize, usize),
        encoding: &Encoding,
        options: ChainOptions,
        brightness: Brightness,
        response: &Response,
        light: Option<(&Illumination, (usize, usize))>,
        mut turn: Option<&wgpu::Buffer>,
        targets: &[Target],
    ) -> Result<Self> {
        let (height, width) = size;
        let frame = [width, height, width * height, 0].map(|n| n as u32);
        let frame = device.constants("frame", bytemuck::cast_slice(&frame))?;
        let mut convolution = None;
        let mut before = Vec::new();
        let mut taps = vec![1.0];
        let mut prefilter = None;
        let mut seen = field.clone();
        match encoding {
            Encoding::DoublePhase => {}
            Encoding::AntiAlias { sigma, width: wide } => {
                taps = AntiAlias::new(*sigma, *wide)?.taps().to_vec();
            }
            Encoding::BandLimit { k } => {
                let limit = BandLimit::new(height, width, *k)?;
                let kept = quadrant(size, |kx, ky| f32::from(u8::from(limit.keeps(kx, ky))));
                convolution = Some(Convolution::new(
                    device,
                    &Planes {
                        field,
                        size,
                        padded: size,
                        factors: &[&kept],
                        turn: turn.take(),
                    },
                )?);
            }
            Encoding::Deep(network) => {
                let mut made = Prefilter::new(device, network, field, size, options)?;
                if network.input().is_blurred() {
                    let blur = deep::blur()?;
                    let blur = Blur {
                        device,
                        frame: &frame,
                        taps: blur.taps(),
                        size,
                    };
                    made.blur = blur.steps(field, None)?.into();
                }
                seen = made.chain.field.clone();
                prefilter = Some(made);
            }
        }
        let mut half = taps.len() - 1;
        if half > FUSED_HALF {
            let blur = Blur {
                device,
                frame: &frame,
                taps: &taps,
                size,
            };
            before.extend(blur.steps(field, turn.take())?);
            half = 0;
        }
        taps.resize(3, 0.0);
        let fixed = match brightness {
            Brightness::Fixed(scale) => scale,
            _ => 0.0,
        };
        let settings = [taps[0], taps[1], taps[2], fixed];
        let settings = device.constants("settings", bytemuck::cast_slice(&settings))?;
        let largest = device.buffer("the largest amplitude", 4)?;
        let steadier = match brightness {
            Brightness::Steady => {
                let len = 3 * height * width;
                Some(Steadier::new(device, field, len, &largest)?)
            }
            _ => None,
        };
        let mut curves = None;
        let (steps, table) = match response {
            Response::Linear { bits } => (1u32 << bits, vec![0]),
            Response::Lut { level, .. } => (256, level.map(u32::from).to_vec()),
            Response::PerPixel(pixels) => {
                let nodes = per_pixel::nodes(height, width, pixels.spacing());
                curves = Some((nodes, pixels.spacing(), pixels.intervals()));
                let values = pixels.knots().iter().chain(pixels.turns());
                (256, values.map(|value| value.to_bits()).collect())
            }
        };
        static UNLIT: [f32; 12] = [1.0; 12];
        let gains = light.map_or(&UNLIT[..], |(light, _)| light.gains());
        let (lit, modulator) = light.map_or(((2, 2), size), |(light, modulator)| {
            (light.nodes(), modulator)
        });
        let gains = device.table("light", bytemuck::cast_slice(gains))?;
        let ((rows, columns), spacing, intervals) = curves.unwrap_or(((1, 1), 1, 1));
        let header = format!(
            "const HALF: i32 = {half};
            const TURN: bool = {};
            const FIXED: bool = {};
            const STEPS: u32 = {steps}u;
            const TABLE: bool = {};
            const PIXELS: bool = {};
            const ROWS: u32 = {rows}u;
            const COLUMNS: u32 = {columns}u;
            const SPACING: u32 = {spacing}u;
            const INTERVALS: u32 = {intervals}u;
            const LIT: bool = {};
            const LIGHT_ROWS: u32 = {}u;
            const LIGHT_COLUMNS: u32 = {}u;
            const ALL_HEIGHT: u32 = {}u;
            const ALL_WIDTH: u32 = {}u;
            ",
            turn.is_some(),
            matches!(brightness, Brightness::Fixed(_)),
            table.len() > 1,
            curves.is_some(),
            light.is_some(),
            lit.0,
            lit.1,
            modulator.0,
            modulator.1,
        );
        let source = header + include_str!("encode.wgsl");
        let response = device.table("the response", bytemuck::cast_slice(&table))?;
        let turn = turn.unwrap_or(&response.buffer);
        let common = [
            (9, gains.buffer.as_entire_binding()),
            (0, frame.buffer.as_entire_binding()),
            (1, settings.buffer.as_entire_binding()),
            (2, seen.as_entire_binding()),
            (3, turn.as_entire_binding()),
        ];
        let grid = [width.div_ceil(COLUMNS), height, 1];
        if brightness == Brightness::FrameMax {
            let program = device.program("the largest amplitude", source.clone(), "peak");
            let mut arguments = common.to_vec();
            arguments.push((4, largest.as_entire_binding()));
            before.push(program.on(device, &arguments, grid)?);
        }
        let program = device.program("double phase", source, "encode");
        let encode = targets
            .iter()
            .map(|target| {
                let view = target.texture.create_view(&Default::default());
                let mut arguments = common.to_vec();
                arguments.push((5, largest.as_entire_binding()));
                arguments.push((6, target.levels.as_entire_binding()));
                arguments.push((7, wgpu::BindingResource::TextureView(&view)));
                arguments.push((8, response.buffer.as_entire_binding()));
                program.on(device, &arguments, grid)
            })
            .collect::<Result<_>>()?;
        Ok(Encoder {
            steadier,
            prefilter,
            convolution,
            before,
            encode,
            largest,
            brightness,
        })
    }

    /// Where the scale of the frame comes from that is submitted next, if it is steady.
    pub(super) fn heed(&self, device: &Device, past: Option<Past>) {
        if let Some(steadier) = &self.steadier {
            steadier.heed(device, past);
        }
    }

    /// To be called before the pass: the largest amplitude of this frame is not known yet.
    pub(super) fn reset(&self, encoder: &mut wgpu::CommandEncoder) {
        if self.brightness == Brightness::FrameMax {
            encoder.clear_buffer(&self.largest, 0, None);
        }
        if let Some(steadier) = &self.steadier {
            steadier.reset(encoder);
        }
    }

    /// Encodes into the target of that index.
    pub(super) fn run(&self, pass: &mut wgpu::ComputePass<'_>, target: usize) {
        // Of the field as it comes, as on the CPU.
        if let Some(steadier) = &self.steadier {
            steadier.run(pass);
        }
        if let Some(prefilter) = &self.prefilter {
            prefilter.blur.iter().for_each(|step| step.run(pass));
            prefilter.packer.run(pass);
            prefilter.chain.run(pass);
        }
        if let Some(convolution) = &self.convolution {
            convolution.run(pass);
        }
        self.before.iter().for_each(|step| step.run(pass));
        self.encode[target].run(pass);
    }

    /// The scale that a frame had whose `largest` was read back.
    pub(super) fn scale(&self, largest: u32) -> f32 {
        match self.brightness {
            Brightness::Fixed(scale) => scale,
            _ => f32::from_bits(largest).sqrt(),
        }
    }
}

/// DDPM's network on a field.
struct Prefilter {
    /// Where the network asks for it.
    blur: Vec<Dispatch>,
    packer: Packer,
    chain: ChainPlan,
}

impl Prefilter {
    fn new(
        device: &Device,
        network: &Network,
        field: &wgpu::Buffer,
        size: (usize, usize),
        options: ChainOptions,
    ) -> Result<Self> {
        if !network.input().is_field() {
            return Err(crate::Error::Network(format!(
                "a pre-filter takes 'field', this network '{}'",
                network.input()
            ))
            .into());
        }
        let chain = network.chain();
        let numbers = Numbers::of(device, chain, options.float)?;
        let packer = Packer::new(
            device,
            Form::Chain(chain, numbers),
            size,
            Source::Field(field, network.input()),
            None,
        )?;
        let end = End::Field(network.head(), network.input());
        let (input, fusion) = (&packer.input, options.fusion);
        let chain = ChainPlan::new(device, chain, numbers, size, input, end, fusion)?;
        Ok(Prefilter {
            blur: Vec::new(),
            packer,
            chain,
        })
    }
}

struct Blur<'a> {
    device: &'a Device,
    frame: &'a Constants,
    taps: &'a [f32],
    size: (usize, usize),
}

impl Blur<'_> {
    /// Along x, with the mean phase taken out where `turn` says it, then along y back into `field`.
    fn steps(&self, field: &wgpu::Buffer, turn: Option<&wgpu::Buffer>) -> Result<[Dispatch; 2]> {
        let (height, width) = self.size;
        let room = (self.device).buffer("the blurred field", 24 * height * width)?;
        Ok([
            self.step((1, 0), field, &room, turn)?,
            self.step((0, 1), &room, field, None)?,
        ])
    }

    fn step(
        &self,
        along: (i32, i32),
        from: &wgpu::Buffer,
        to: &wgpu::Buffer,
        turn: Option<&wgpu::Buffer>,
    ) -> Result<Dispatch> {
        let device = self.device;
        let mut taps = self.taps.to_vec();
        taps.resize(32, 0.0);
        let taps = device.constants("taps", bytemuck::cast_slice(&taps))?;
        let header = format!(
            "const HALF: i32 = {};\nconst TURN: bool = {};\nconst ALONG: vec2i = vec2i({}, {});\n",
            self.taps.len() - 1,
            turn.is_some(),
            along.0,
            along.1
        );
        let program = device.program("blur", header + include_str!("blur.wgsl"), "blur");
        let arguments = [
            (0, self.frame.buffer.as_entire_binding()),
            (1, taps.buffer.as_entire_binding()),
            (2, from.as_entire_binding()),
            (3, to.as_entire_binding()),
            (4, turn.unwrap_or(from).as_entire_binding()),
        ];
        program.on(
            device,
            &arguments,
            [self.size.1.div_ceil(COLUMNS), self.size.0, 3],
        )
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::device::testing::{apart, device, field, read, run, upload};
    use super::*;
    use crate::encode::Scale;
    use crate::modulator::remove_mean_phase;
    use crate::slm::per_pixel::PerPixel;
    use num_complex::Complex32;
    use std::sync::Arc;

    #[test]
    fn the_mean_phase_is_that_of_the_cpu() {
        let Some(device) = device() else { return };
        // Sums of parts, as the last layer leaves them.
        for parts in [1, 7, 1000] {
            let mut sums = field(parts);
            let partial: Vec<Complex32> = (0..3 * parts)
                .map(|i| sums[i % 3 * parts + i / 3])
                .collect();
            let buffer = upload(&device, &partial);
            let mean = device
                .guarded(|| MeanPhase::new(&device, &buffer, parts))
                .unwrap();
            run(&device, |pass| mean.run(pass));
            let turn = read(&device, &mean.turn, 3);
            let expected: Vec<Complex32> = sums
                .chunks_exact(parts)
                .map(|plane| {
                    let sum: Complex32 = plane.iter().sum();
                    Complex32::from_polar(1.0, -sum.arg())
                })
                .collect();
            assert!(apart(&turn, &expected) < 1e-4, "{turn:?} {expected:?}");
            remove_mean_phase(&mut sums);
        }
        // Darkness has no phase and is left alone.
        let buffer = upload(&device, &[Complex32::ZERO; 3]);
        let mean = device
            .guarded(|| MeanPhase::new(&device, &buffer, 1))
            .unwrap();
        run(&device, |pass| mean.run(pass));
        assert_eq!(read(&device, &mean.turn, 3), [Complex32::ONE; 3]);
    }

    #[test]
    fn levels_are_those_of_the_cpu() {
        let Some(device) = device() else { return };
        let lut = Response::lut(std::array::from_fn(|i| (i * 7 % 256) as u8));
        let wide = Encoding::AntiAlias {
            sigma: 2.0,
            width: 9,
        };
        let five = Encoding::AntiAlias {
            sigma: 1.0,
            width: 5,
        };
        let eight = Response::Linear { bits: 8 };
        let wide = || wide.clone();
        let (nodes, intervals) = (per_pixel::nodes(61, 47, 16), 8);
        let count = 3 * nodes.0 * nodes.1;
        // Curves that differ from node to node; the steepest do not reach 2π.
        let knots: Vec<f32> = (0..count)
            .flat_map(|n| (0..=intervals).map(move |k| 3.0 + k as f32 * (20.0 + n as f32 * 0.35)))
            .collect();
        let turns: Vec<f32> = (0..count).map(|n| 6.27 - 0.01 * n as f32).collect();
        let table = PerPixel::new(61, 47, 16, intervals, &knots, &turns).unwrap();
        let pixels = Response::PerPixel(Arc::new(table));
        let cases = [
            (
                (61, 47),
                Encoding::ANTI_ALIAS,
                Scale::Fixed(1.0),
                pixels.clone(),
            ),
            ((61, 47), Encoding::DoublePhase, Scale::Max, pixels),
            ((61, 47), Encoding::DoublePhase, Scale::Max, eight.clone()),
            ((61, 47), Encoding::ANTI_ALIAS, Scale::Max, lut.clone()),
            (
                (61, 47),
                Encoding::ANTI_ALIAS,
                Scale::Fixed(0.7),
                Response::Linear { bits: 5 },
            ),
            ((61, 47), five, Scale::Max, eight.clone()),
            ((61, 47), wide(), Scale::Fixed(1.1), eight.clone()),
            ((61, 47), Encoding::BAND_LIMIT, Scale::Max, lut),
            ((1, 1), wide(), Scale::Max, eight.clone()),
            ((384, 384), Encoding::ANTI_ALIAS, Scale::Max, eight.clone()),
            ((540, 960), Encoding::ANTI_ALIAS, Scale::Fixed(1.0), eight),
        ];
        for (size, encoding, scale, response) in cases {
            let area = size.0 * size.1;
            let turns =
                [(0.6, 0.8), (-1.0, 0.0), (0.0, 1.0)].map(|(re, im)| Complex32::new(re, im));
            let turn = upload(&device, &turns);
            let mut expected = field(area);
            let buffer = upload(&device, &expected);
            let (encoder, targets) = device
                .guarded(|| {
                    let targets = [Target::new(&device, size)?, Target::new(&device, size)?];
                    let encoder = Encoder::new(
                        &device,
                        &buffer,
                        size,
                        &encoding,
                        ChainOptions::default(),
                        scale.into(),
                        &response,
                        None,
                        Some(&turn),
                        &targets,
                    )?;
                    Ok((encoder, targets))
                })
                .unwrap();
            run(&device, |pass| encoder.run(pass, 1));
            let words: Vec<u32> =
                bytemuck::pod_collect_to_vec(&device.read(&targets[1].levels, 4 * area).unwrap());
            for (plane, turn) in expected.chunks_exact_mut(area).zip(turns) {
                plane.iter_mut().for_each(|value| *value *= turn);
            }
            let mut given = expected.clone();
            let twin = crate::encode::Encoder::new(size.0, size.1, encoding.clone()).unwrap();
            let mut levels = vec![0; 3 * area];
            let used = twin.encode_levels(
                &mut expected,
                scale,
                &response,
                &mut levels,
                &mut twin.scratch(),
            );
            let mut phase = vec![0.0; 3 * area];
            twin.encode(
                &mut given,
                Scale::Fixed(used),
                &mut phase,
                &mut twin.scratch(),
            );
            let largest: Vec<u32> =
                bytemuck::pod_collect_to_vec(&device.read(&encoder.largest, 4).unwrap());
            let found = encoder.scale(largest[0]);
            assert!(
                (found - used).abs() < 1e-4 * used,
                "{size:?} {encoding:?}: {found} {used}"
            );
            // A level may be its neighbour where the phase lies within rounding of the bound between them.
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
                    // acos is steep at full light.
                    let near = (step - step.floor() - 0.5).abs();
                    // Where curves say, a neighbour, and seldom.
                    let neighbour = pixels && level.abs_diff(expected) == 1;
                    beside += usize::from(neighbour);
                    assert!(
                        level == expected || near < 0.1 || neighbour,
                        "{size:?} {encoding:?} {scale:?}: {level} for {expected} at {i} of {c}, step {step}"
                    );
                }
            }
            assert!(beside * 50 < 3 * area, "{beside} of {} beside", 3 * area);
            assert!(words.iter().all(|word| word >> 24 == 255));
        }
    }
}
