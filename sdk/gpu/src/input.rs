//! Converts a captured frame to what a chain reads: groups of four channels in the chain's numbers. The twins are
//! [`phasefront_core::frame`] and the kernels' quantiser.

mod camera;
mod frame;
mod rounding;
mod source;

pub use frame::{Colour, ColourData, Depth, DepthData, Frame};
pub(super) use source::Source;

use super::Result;
use super::device::{Device, Dispatch};
use super::numbers::{GROUP, Numbers};
use phasefront_core::method::network::chain::Chain;
use source::{Frames, Reader};

/// What a [`Packer`] writes.
#[derive(Clone, Copy)]
pub(super) enum Form<'a> {
    /// The input of a chain in its numbers, depth stretched by so much about the middle.
    Chain(&'a Chain, Numbers, f32),
    /// Red, green, blue and depth of each pixel, f32, as they are: what the plane sweep reads.
    Surfaces,
}

impl Form<'_> {
    fn channels(&self) -> usize {
        match self {
            Form::Chain(chain, ..) => chain.inputs,
            Form::Surfaces => GROUP,
        }
    }

    /// Pixels along each side of what the chain's layers take as one.
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

    /// The text of the program that takes pixels from `reader` to this form.
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

/// What a chain reads, on the GPU.
#[derive(Clone)]
pub(super) struct ChainInput {
    /// The first layer's input, or a frame's surfaces.
    pub(super) first: wgpu::Buffer,
    /// What the last layer reads of it: the same buffer but in int8.
    pub(super) last: wgpu::Buffer,
    /// It in f32, for a head that adds to it; the same buffer but in int8.
    pub(super) image: wgpu::Buffer,
}

impl ChainInput {
    /// Memory for so many groups of four channels at a pixel.
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
    /// Where the network's input planes go, where they come by themselves.
    pub(super) planes: wgpu::Buffer,
    frames: Option<Frames>,
    pub(super) input: ChainInput,
    step: Dispatch,
}

impl Packer {
    /// The stage for frames of `size` (height, width), into memory of its own or `input`, which another stage of the
    /// same form and size had.
    pub(super) fn new(
        device: &Device,
        form: Form<'_>,
        size: (usize, usize),
        source: Source<'_>,
        input: Option<ChainInput>,
    ) -> Result<Self> {
        let (height, width) = size;
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
            input,
            step,
        })
    }

    /// Sends a frame on its way; it is there when what is submitted next begins.
    pub(super) fn upload(&self, device: &Device, frame: &Frame<'_>) -> Result<()> {
        match &self.frames {
            Some(frames) => frames.upload(device, frame),
            None => Ok(()),
        }
    }

    /// What frames come as, where they do.
    pub(super) fn formats(&self) -> Option<(Colour, Depth)> {
        self.frames.as_ref().map(|frames| frames.formats)
    }

    pub(super) fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.step.run(pass);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::device::testing::{device, run};
    use super::*;
    use phasefront_core::frame::{ColourFormat, ColourImage, Orientation, Plane, Rotation, YuvEncoding};
    use phasefront_core::method::network::Network;

    /// Camera images of odd sizes, turned, made larger and smaller, in the numbers of float chains.
    #[test]
    fn the_input_is_that_of_the_cpu() {
        let device = device();
        let network = Network::from_onnx(include_bytes!("../../../models/rgbd-8.onnx")).unwrap();
        let format = ColourFormat::Nv12(YuvEncoding::default());
        let orientation = Orientation {
            rotation: Rotation::Clockwise90,
            mirrored: true,
        };
        for ((height, width), sensor) in [
            ((61, 47), (75, 101)),
            ((384, 384), (301, 407)),
            ((540, 960), (1081, 607)),
        ] {
            let colour = Colour::Camera {
                format,
                height: sensor.0,
                width: sensor.1,
                orientation,
            };
            let byte = |i: usize| (i * 7 % 251) as u8;
            let luma: Vec<u8> = (0..sensor.0 * sensor.1).map(byte).collect();
            let half = (sensor.0.div_ceil(2), sensor.1.div_ceil(2));
            let chroma: Vec<u8> = (0..2 * half.0 * half.1).map(byte).collect();
            let planes = [Plane::new(&luma, sensor.1, 1), Plane::new(&chroma, 2 * half.1, 2)];
            let image = ColourImage::new(format, sensor.1, sensor.0, &planes).unwrap();
            let words: Vec<u16> = (0..height * width).map(|i| (i * 4099) as u16).collect();
            let frame = Frame {
                colour: ColourData::Camera(image),
                depth: DepthData::U16(&words),
            };
            let twin = frame.read(orientation, height, width).unwrap();
            for (numbers, most) in [(Numbers::F32, 1e-4), (Numbers::F16, 5e-4)] {
                if numbers == Numbers::F16 && !device.has_half() {
                    continue;
                }
                let source = Source::Frame(colour, Depth::U16);
                let size = (height, width);
                let form = Form::Chain(network.chain(), numbers, 1.0);
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
                            "{numbers:?} {size:?} at {x}, {y}: {value} {expected}"
                        );
                    }
                }
            }
        }
    }

    /// A depth's last bit says which plane its pixel is on.
    #[test]
    fn surfaces_have_the_bits_of_the_cpu() {
        let device = device();
        let words: Vec<u16> = (0..=u16::MAX).collect();
        let colours: Vec<f32> = (0..3 << 16).map(|i| (i % 977) as f32 / 977.0).collect();
        let (size, source) = ((256, 256), Source::Frame(Colour::Planar, Depth::U16));
        let packer = device
            .guarded(|| Packer::new(&device, Form::Surfaces, size, source, None))
            .unwrap();
        let frame = Frame {
            colour: ColourData::Planar(&colours),
            depth: DepthData::U16(&words),
        };
        packer.upload(&device, &frame).unwrap();
        run(&device, |pass| packer.run(pass));
        let twin = frame.read(Orientation::default(), 256, 256).unwrap();
        let (rgb, depth) = (twin.rgb(), twin.depth());
        let expected: Vec<[f32; 4]> = depth
            .indexed_iter()
            .map(|((y, x), &d)| [rgb[(0, y, x)], rgb[(1, y, x)], rgb[(2, y, x)], d])
            .collect();
        let bytes = device.read(&packer.input.first, 16 << 16).unwrap();
        assert!(bytes == bytemuck::cast_slice::<_, u8>(&expected));
    }
}
