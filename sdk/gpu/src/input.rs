//! Converts a captured frame to the input of a chain: groups of four channels in the chain's number format. The CPU
//! counterparts are [`phasefront_core::frame`] and the quantiser of the kernels.

mod camera;
mod condition;
mod frame;
mod light;
mod read_back;
mod rounding;
mod source;

pub use frame::{Colour, ColourData, Depth, DepthData, Frame};
use phasefront_core::Size;
pub(super) use read_back::ReadBack;
pub(super) use source::Source;

use super::Result;
use super::device::{Device, Dispatch};
use super::numbers::{GROUP, Numbers};
use condition::Conditioning;
use phasefront_core::method::network::chain::Chain;
use source::{Frames, Reader};

/// The output format of a [`Packer`].
#[derive(Clone, Copy)]
pub(super) enum Form<'a> {
    /// The input of a chain in its number format, with depth stretched about the middle by this factor.
    Chain(&'a Chain, Numbers, f32),
    /// Unmodified f32 red, green, blue and depth of each pixel, the input of the plane sweep.
    Surfaces,
}

impl Form<'_> {
    fn channels(&self) -> usize {
        match self {
            Form::Chain(chain, ..) => chain.inputs,
            Form::Surfaces => GROUP,
        }
    }

    /// Returns the side of the square of pixels that the chain's layers treat as one.
    fn side(&self) -> usize {
        match self {
            Form::Chain(chain, ..) => chain.side(),
            Form::Surfaces => 1,
        }
    }

    fn numbers(&self) -> Numbers {
        match self {
            Form::Chain(_, numbers, _) => *numbers,
            Form::Surfaces => Numbers::F32,
        }
    }

    /// Returns the source of the program that converts the pixels of `reader` to this format.
    fn program(&self, reader: &Reader) -> String {
        let numbers = self.numbers();
        let (enable, store) = match numbers {
            Numbers::Int8 => ("", include_str!("input/int8.wgsl")),
            Numbers::F16 => ("enable f16;\n", include_str!("input/float.wgsl")),
            Numbers::F32 => ("", include_str!("input/float.wgsl")),
        };
        let channels = self.channels();
        let (middle, scale) = match self {
            Form::Chain(.., scale) => (0.5, *scale),
            Form::Surfaces => (0.0, 1.0),
        };
        let header = format!(
            "{enable}alias Value = {};\nconst SIDE: u32 = {}u;\nconst CHANNELS: u32 = {channels}u;\nconst GROUPS: u32 = {}u;\nconst MIDDLE: f32 = {middle:?};\nconst DEPTH_SCALE: f32 = {scale:?};\n",
            numbers.value(),
            self.side(),
            channels.div_ceil(GROUP),
        );
        header + &reader.header + include_str!("input/pack.wgsl") + &reader.text + store
    }
}

/// The input of a chain on the GPU.
#[derive(Clone)]
pub(super) struct ChainInput {
    /// The input of the first layer, or the surfaces of a frame.
    pub(super) first: wgpu::Buffer,
    /// The input in the last layer's rounding. It is the same buffer except in int8.
    pub(super) last: wgpu::Buffer,
    /// The input in f32, for a head that adds to it. It is the same buffer except in int8.
    pub(super) image: wgpu::Buffer,
}

impl ChainInput {
    /// Allocates this number of groups of four channels, over all pixels.
    fn new(device: &Device, groups: usize, numbers: Numbers) -> Result<Self> {
        let first = device.buffer("the network's input", groups * numbers.value_bytes())?;
        Ok(match numbers {
            Numbers::Int8 => ChainInput {
                first,
                last: device.buffer("the network's input", groups * 4)?,
                image: device.buffer("the image", groups * 16)?,
            },
            _ => ChainInput {
                last: first.clone(),
                image: first.clone(),
                first,
            },
        })
    }
}

/// The input stage for one frame size.
pub(super) struct Packer {
    /// The buffer for the network's input planes if the source is [`Source::Planes`].
    pub(super) planes: wgpu::Buffer,
    frames: Option<Frames>,
    pub(super) input: ChainInput,
    step: Dispatch,
    /// The frame's surfaces, if the stage writes them.
    surfaces: Option<wgpu::Buffer>,
    /// Converts the surfaces to the input, if that is another form.
    last: Option<Box<Packer>>,
}

impl Packer {
    /// Plans the stage for frames of `size`. It writes to new memory or to `input`, the memory of
    /// another stage of the same form and size.
    pub(super) fn new(
        device: &Device,
        form: Form<'_>,
        size: Size,
        source: Source<'_>,
        input: Option<ChainInput>,
    ) -> Result<Self> {
        match source {
            Source::Frame(_, Depth::Readings(_)) => Self::by_surfaces(device, form, size, source, input),
            _ => Self::alone(device, form, size, source, input),
        }
    }

    /// Works like [`Self::new`] for frames, and writes their surfaces too.
    pub(super) fn by_surfaces(
        device: &Device,
        form: Form<'_>,
        size: Size,
        source: Source<'_>,
        input: Option<ChainInput>,
    ) -> Result<Self> {
        let (is_last, surfaces) = match form {
            Form::Surfaces => (true, input.clone()),
            Form::Chain(..) => (false, None),
        };
        let mut packer = Self::alone(device, Form::Surfaces, size, source, surfaces)?;
        let surfaces = packer.input.first.clone();
        if let (Some(frames), Source::Frame(_, Depth::Readings(readings))) = (&mut packer.frames, source) {
            frames.conditioning = Some(Conditioning::new(device, readings, size, &surfaces)?);
        }
        if !is_last {
            let last = Self::alone(device, form, size, Source::Surfaces(&surfaces), input)?;
            packer.input = last.input.clone();
            packer.last = Some(Box::new(last));
        }
        Ok(packer)
    }

    /// Returns the surfaces of a frame after [`Self::condition`], (H, W) of red, green, blue and depth, if the stage
    /// writes them.
    pub(super) fn surfaces(&self) -> Option<&wgpu::Buffer> {
        self.surfaces.as_ref()
    }

    /// Plans the stage without conditioning.
    fn alone(
        device: &Device,
        form: Form<'_>,
        size: Size,
        source: Source<'_>,
        input: Option<ChainInput>,
    ) -> Result<Self> {
        let Size { width, height } = size;
        let area = height * width;
        let (rows, columns) = (height.div_ceil(form.side()), width.div_ceil(form.side()));
        let groups = form.channels().div_ceil(GROUP) * form.side().pow(2);
        let input = match input {
            Some(input) => input,
            None => ChainInput::new(device, groups * rows * columns, form.numbers())?,
        };
        let frame = [width, height, area, 0].map(|n| n as u32);
        let frame = device.constants("frame", bytemuck::cast_slice(&frame))?;
        let reader = Reader::new(device, source, form.channels(), size)?;
        let program = device.program("the input", form.program(&reader), "pack");
        let mut arguments = vec![
            (0, frame.buffer.as_entire_binding()),
            (1, reader.first.as_entire_binding()),
            (3, input.first.as_entire_binding()),
        ];
        if let Some(second) = &reader.second {
            arguments.push((2, second.as_entire_binding()));
        }
        let steps = match form {
            Form::Chain(chain, Numbers::Int8, _) => Some(rounding::steps(device, chain)?),
            _ => None,
        };
        if let Some(steps) = &steps {
            arguments.push((4, input.last.as_entire_binding()));
            arguments.push((5, input.image.as_entire_binding()));
            arguments.push((6, steps.buffer.as_entire_binding()));
        }
        let frames = reader.frames;
        if let Some(camera) = frames.as_ref().and_then(|frames| frames.camera.as_ref()) {
            arguments.push((7, camera.constants.buffer.as_entire_binding()));
            arguments.push((8, camera.taps.buffer.as_entire_binding()));
        }
        let step = program.on(device, &arguments, [columns.div_ceil(64), rows, 1])?;
        Ok(Packer {
            planes: reader.first,
            frames,
            surfaces: match form {
                Form::Surfaces => Some(input.first.clone()),
                Form::Chain(..) => None,
            },
            input,
            step,
            last: None,
        })
    }

    /// Uploads a frame. The upload is complete before the next submission starts.
    pub(super) fn upload(&self, device: &Device, frame: &Frame<'_>) -> Result<()> {
        match &self.frames {
            Some(frames) => frames.upload(device, frame),
            None => Ok(()),
        }
    }

    /// Returns the formats of the frames, or `None` if the source is not frames.
    pub(super) fn formats(&self) -> Option<(Colour, Depth)> {
        self.frames.as_ref().map(|frames| frames.formats)
    }

    pub(super) fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.step.run(pass);
    }

    /// Decides the depth of the pixels, if it comes as readings, after [`Self::run`].
    pub(super) fn condition(&self, pass: &mut wgpu::ComputePass<'_>) {
        let conditioning = self.frames.as_ref().and_then(|frames| frames.conditioning.as_ref());
        if let Some(conditioning) = conditioning {
            conditioning.run(pass);
        }
        if let Some(last) = &self.last {
            last.run(pass);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::device::testing::{device, run};
    use super::*;
    use phasefront_core::display::Display;
    use phasefront_core::frame::{
        ColourFormat, ColourImage, ColourPlan, LightConstants, LightPlan, Orientation, Plane, RgbEncoding, Rotation,
        YuvEncoding,
    };
    use phasefront_core::method::network::Network;

    /// Checks camera images of odd sizes, rotated, enlarged and reduced, in the number formats of float chains and in
    /// every encoding.
    #[test]
    fn the_input_is_that_of_the_cpu() {
        let device = device();
        let network = Network::from_onnx(include_bytes!("../../../models/rgbd-8.onnx")).unwrap();
        let format = ColourFormat::Nv12(YuvEncoding::default());
        let orientation = Orientation {
            rotation: Rotation::Clockwise90,
            mirrored: true,
        };
        let display = Display::default();
        let size = |width, height| Size { width, height };
        let (small, sensor) = (size(47, 61), size(101, 75));
        for (size, sensor, encoding) in [
            (small, sensor, RgbEncoding::Amplitude),
            (small, sensor, RgbEncoding::Srgb),
            (small, sensor, RgbEncoding::DisplayP3),
            (small, sensor, RgbEncoding::Bt2020Hlg),
            (small, sensor, RgbEncoding::Bt2020Pq),
            (size(384, 384), size(407, 301), RgbEncoding::Amplitude),
            (size(960, 540), size(607, 1081), RgbEncoding::Srgb),
        ] {
            let Size { width, height } = size;
            let colour = Colour::Camera {
                format,
                size: sensor,
                orientation,
                light: LightConstants::new(encoding, &display),
            };
            let byte = |i: usize| (i * 7 % 251) as u8;
            let luma: Vec<u8> = (0..sensor.pixels()).map(byte).collect();
            let half = (sensor.height.div_ceil(2), sensor.width.div_ceil(2));
            let chroma: Vec<u8> = (0..2 * half.0 * half.1).map(byte).collect();
            let planes = [Plane::new(&luma, sensor.width, 1), Plane::new(&chroma, 2 * half.1, 2)];
            let image = ColourImage::new(format, sensor, &planes).unwrap();
            let words: Vec<u16> = (0..height * width).map(|i| (i * 4099) as u16).collect();
            let frame = Frame {
                colour: ColourData::Camera(image),
                depth: DepthData::U16(&words),
            };
            let mut twin = frame.read(orientation, size).unwrap();
            let plan = ColourPlan::new(&image, orientation, size).unwrap();
            let plan = plan.with_light(LightPlan::new(encoding, &display));
            plan.convert(&image, twin.planes_mut().0, &mut plan.scratch()).unwrap();
            // The root of the darkest light, and a curve by interpolation, are less exact.
            let more = if encoding == RgbEncoding::Amplitude { 0.0 } else { 1e-3 };
            for (numbers, most) in [(Numbers::F32, 1e-4 + more), (Numbers::F16, 5e-4 + more)] {
                if numbers == Numbers::F16 && !device.has_half() {
                    continue;
                }
                let source = Source::Frame(colour, Depth::U16);
                let form = Form::Chain(network.chain().unwrap(), numbers, 1.0);
                let packer = device
                    .guarded(|| Packer::new(&device, form, size, source, None))
                    .unwrap();
                packer.upload(&device, &frame).unwrap();
                run(&device, |pass| packer.run(pass));
                let bytes = numbers.value_bytes() * height * width;
                let bytes = device.read(&packer.input.first, bytes).unwrap();
                let values: Vec<f32> = match numbers {
                    Numbers::F16 => bytemuck::pod_collect_to_vec::<u8, u16>(&bytes)
                        .into_iter()
                        .map(|bits| half::f16::from_bits(bits).to_f32())
                        .collect(),
                    _ => bytemuck::pod_collect_to_vec(&bytes),
                };
                for (i, pixel) in values.chunks_exact(4).enumerate() {
                    let (y, x) = (i / width, i % width);
                    let rgbd: [f32; 4] = std::array::from_fn(|c| match c {
                        3 => twin.depth()[(y, x)] - 0.5,
                        c => twin.rgb()[(c, y, x)] - 0.5,
                    });
                    for (value, expected) in pixel.iter().zip(rgbd) {
                        assert!(
                            (value - expected).abs() < most,
                            "{numbers:?} {encoding:?} {size:?} at {x}, {y}: {value} {expected}"
                        );
                    }
                }
            }
        }
    }

    /// Checks depth bit for bit, because its last bit decides which plane a pixel is on.
    #[test]
    fn surfaces_have_the_bits_of_the_cpu() {
        let device = device();
        let words: Vec<u16> = (0..=u16::MAX).collect();
        let colours: Vec<f32> = (0..3 << 16).map(|i| (i % 977) as f32 / 977.0).collect();
        let (size, source) = ((256, 256), Source::Frame(Colour::Planar, Depth::U16));
        let packer = device
            .guarded(|| Packer::new(&device, Form::Surfaces, Size::from_shape(size), source, None))
            .unwrap();
        let frame = Frame {
            colour: ColourData::Planar(&colours),
            depth: DepthData::U16(&words),
        };
        packer.upload(&device, &frame).unwrap();
        run(&device, |pass| packer.run(pass));
        let twin = frame
            .read(
                Orientation::default(),
                Size {
                    width: 256,
                    height: 256,
                },
            )
            .unwrap();
        let (rgb, depth) = (twin.rgb(), twin.depth());
        let expected: Vec<[f32; 4]> = depth
            .indexed_iter()
            .map(|((y, x), &d)| [rgb[(0, y, x)], rgb[(1, y, x)], rgb[(2, y, x)], d])
            .collect();
        let bytes = device.read(&packer.input.first, 16 << 16).unwrap();
        assert!(bytes == bytemuck::cast_slice::<_, u8>(&expected));
    }
}
