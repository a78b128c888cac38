//! From a frame as it comes to what a chain reads: groups of four channels in the chain's numbers. The twins are
//! [`crate::frame`] and the kernels' quantiser.

use super::chain::{GROUP, Numbers};
use super::device::{Constants, Device, Dispatch};
use super::{Error, Result};
use crate::frame::{
    ColourFormat, ColourImage, ColourPlan, Orientation, Plane, RgbdFrame, yuv_constants,
};
use crate::network::InputKind;
use crate::network::chain::{Chain, Quantisation};
use ndarray::{Array2, Array3};

/// How colour comes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Colour {
    /// Three planes of f32 in \[0, 1] of the frame's size: an [`RgbdFrame`]'s.
    Planar,
    /// Images of a camera, which are turned upright, cropped and resized to the frame.
    Camera {
        /// How they lie in memory. Strides may differ from image to image.
        format: ColourFormat,
        /// Rows of the sensor.
        height: usize,
        /// Columns of the sensor.
        width: usize,
        /// How they become upright.
        orientation: Orientation,
    },
}

/// How normalized depth comes: one plane of the frame's size, 0 nearest, 1 farthest, without holes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Depth {
    /// f32 in \[0, 1].
    F32,
    /// 65535 is 1.
    U16,
}

/// Colour of a frame, as planned by [`Colour`].
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum ColourData<'a> {
    /// (3, H, W).
    Planar(&'a [f32]),
    /// A camera's image.
    Camera(ColourImage<'a>),
}

/// Depth of a frame, (H, W), as planned by [`Depth`].
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum DepthData<'a> {
    /// f32 in \[0, 1].
    F32(&'a [f32]),
    /// 65535 is 1.
    U16(&'a [u16]),
}

/// A frame, borrowed.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// Its colour.
    pub colour: ColourData<'a>,
    /// Its depth.
    pub depth: DepthData<'a>,
}

impl<'a> Frame<'a> {
    /// A planar frame.
    pub fn of(frame: &'a RgbdFrame) -> Self {
        Frame {
            colour: ColourData::Planar(frame.rgb().to_slice().expect("contiguous")),
            depth: DepthData::F32(frame.depth().to_slice().expect("contiguous")),
        }
    }

    /// The same frame on the CPU, (`height`, `width`): the twin of the input stage. `orientation` is that of a
    /// camera's image.
    ///
    /// # Errors
    /// [`crate::Error::Frame`] for data of another size, or values that no frame has.
    pub fn read(
        &self,
        orientation: Orientation,
        height: usize,
        width: usize,
    ) -> crate::Result<RgbdFrame> {
        let rgb = match &self.colour {
            ColourData::Planar(values) => values.to_vec(),
            ColourData::Camera(image) => {
                let plan = ColourPlan::new(image, orientation, height, width)?;
                let mut rgb = vec![0.0; 3 * height * width];
                plan.convert(image, &mut rgb, &mut plan.scratch())?;
                rgb
            }
        };
        let depth = match self.depth {
            DepthData::F32(values) => values.to_vec(),
            DepthData::U16(words) => words.iter().map(|&w| f32::from(w) / 65535.0).collect(),
        };
        let wrong = |what: &str, is: usize| {
            crate::Error::Frame(format!(
                "{what} has {is} values; the frame is {width}×{height}"
            ))
        };
        let (colours, depths) = (rgb.len(), depth.len());
        RgbdFrame::new(
            Array3::from_shape_vec((3, height, width), rgb)
                .map_err(|_| wrong("colour", colours))?,
            Array2::from_shape_vec((height, width), depth).map_err(|_| wrong("depth", depths))?,
        )
    }
}

/// What a [`Packer`] writes.
#[derive(Clone, Copy)]
pub(super) enum Form<'a> {
    /// The input of a chain in its numbers.
    Chain(&'a Chain, Numbers),
    /// Red, green, blue and depth of each pixel, f32, as they are: what the plane sweep reads.
    Surfaces,
}

impl Form<'_> {
    fn channels(&self) -> usize {
        match self {
            Form::Chain(chain, _) => chain.inputs,
            Form::Surfaces => GROUP,
        }
    }

    fn numbers(&self) -> Numbers {
        match self {
            Form::Chain(_, numbers) => *numbers,
            Form::Surfaces => Numbers::F32,
        }
    }
}

/// Where a [`Packer`] reads.
#[derive(Clone, Copy)]
pub(super) enum Source<'a> {
    /// The network's input planes themselves, f32, of any number, in its own buffer.
    Planes,
    /// A complex field on the GPU, and how a pre-filter takes it.
    Field(&'a wgpu::Buffer, InputKind),
    /// A frame's surfaces on the GPU, and the sweep's field of it.
    Seeded(&'a wgpu::Buffer, &'a wgpu::Buffer),
    /// A frame, in its own buffers.
    Frame(Colour, Depth),
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
    /// Where colour goes, and depth.
    pub(super) colour: wgpu::Buffer,
    depth: wgpu::Buffer,
    size: (usize, usize),
    formats: Option<(Colour, Depth)>,
    camera: Option<Camera>,
    pub(super) input: ChainInput,
    step: Dispatch,
}

/// How a camera's images are read.
struct Camera {
    plan: ColourPlan,
    constants: Constants,
    /// Where each plane begins in the colour buffer, and what there is room for.
    places: Vec<(usize, usize)>,
}

impl Packer {
    /// The stage for frames of `size` (height, width), into memory of its own or `input`, which another stage of the same
    /// form and size had.
    pub(super) fn new(
        device: &Device,
        form: Form<'_>,
        size: (usize, usize),
        source: Source<'_>,
        input: Option<ChainInput>,
    ) -> Result<Self> {
        let (height, width) = size;
        let area = height * width;
        let (channels, numbers) = (form.channels(), form.numbers());
        let groups = channels.div_ceil(GROUP);
        let input = match input {
            Some(input) => input,
            None => ChainInput::new(device, groups * area, numbers)?,
        };
        let frame = [width, height, area, 0].map(|n| n as u32);
        let frame = device.constants("frame", bytemuck::cast_slice(&frame))?;
        let mut header = match numbers {
            Numbers::F16 => "enable f16;\n".to_owned(),
            _ => String::new(),
        };
        header += &format!(
            "alias Value = {};\nconst CHANNELS: u32 = {channels}u;\nconst GROUPS: u32 = {groups}u;\nconst MIDDLE: f32 = {:?};\n",
            numbers.value(),
            match form {
                Form::Chain(..) => 0.5,
                Form::Surfaces => 0.0,
            },
        );
        let mut source_text = String::new();
        let mut camera = None;
        let mut taps = None;
        let mut formats = None;
        let (colour, depth_bytes) = match source {
            Source::Planes => {
                source_text += include_str!("input_planes.wgsl");
                (
                    device.buffer("the network's input", 4 * channels * area)?,
                    0,
                )
            }
            Source::Field(field, kind) => {
                header += &format!(
                    "const SPLIT: bool = {};\nconst SPLIT_STEP: f32 = {:?};\nconst REMAINDER_GAIN: f32 = {:?};\n",
                    kind == InputKind::SplitBlurredField,
                    InputKind::SPLIT_STEP,
                    InputKind::REMAINDER_GAIN
                );
                source_text += include_str!("input_field.wgsl");
                (field.clone(), 0)
            }
            Source::Seeded(surfaces, _) => {
                source_text += include_str!("input_seeded.wgsl");
                (surfaces.clone(), 0)
            }
            Source::Frame(colour, depth) => {
                formats = Some((colour, depth));
                header += &format!("const WORDS: bool = {};\n", depth == Depth::U16);
                let bytes = match colour {
                    Colour::Planar => {
                        source_text += include_str!("input_planar.wgsl");
                        12 * area
                    }
                    Colour::Camera {
                        format,
                        height: rows,
                        width: columns,
                        orientation,
                    } => {
                        let sensor = (rows, columns);
                        let plan =
                            ColourPlan::for_format(format, sensor, orientation, height, width)?;
                        let (made, bytes) = Camera::new(device, plan, format, sensor)?;
                        let (constants, table) = made.taps();
                        header += &constants;
                        taps = Some(device.table("taps", bytemuck::cast_slice(&table))?);
                        camera = Some(made);
                        source_text += include_str!("input_camera.wgsl");
                        bytes
                    }
                };
                source_text += include_str!("input_frame.wgsl");
                let depth_bytes = match depth {
                    Depth::F32 => 4 * area,
                    Depth::U16 => 2 * area,
                };
                (device.buffer("colour", bytes)?, depth_bytes)
            }
        };
        let depth = device.buffer("depth", depth_bytes)?;
        let store = match numbers {
            Numbers::Int8 => include_str!("input_int8.wgsl"),
            _ => include_str!("input_float.wgsl"),
        };
        let text = header + include_str!("input.wgsl") + &source_text + store;
        let program = device.program("the input", text, "pack");
        let mut arguments = vec![
            (0, frame.buffer.as_entire_binding()),
            (1, colour.as_entire_binding()),
            (3, input.first.as_entire_binding()),
        ];
        match source {
            Source::Frame(..) => arguments.push((2, depth.as_entire_binding())),
            Source::Seeded(_, seed) => arguments.push((2, seed.as_entire_binding())),
            Source::Planes | Source::Field(..) => {}
        }
        let steps = match form {
            Form::Chain(chain, Numbers::Int8) => Some(steps(device, chain)?),
            _ => None,
        };
        if let Some(steps) = &steps {
            arguments.push((4, input.last.as_entire_binding()));
            arguments.push((5, input.image.as_entire_binding()));
            arguments.push((6, steps.buffer.as_entire_binding()));
        }
        if let (Some(camera), Some(taps)) = (&camera, &taps) {
            arguments.push((7, camera.constants.buffer.as_entire_binding()));
            arguments.push((8, taps.buffer.as_entire_binding()));
        }
        let step = program.on(device, &arguments, [width.div_ceil(64), height, 1])?;
        Ok(Packer {
            colour,
            depth,
            size,
            formats,
            camera,
            input,
            step,
        })
    }

    /// Sends a frame on its way; it is there when what is submitted next begins.
    pub(super) fn upload(&self, device: &Device, frame: &Frame<'_>) -> Result<()> {
        let area = self.size.0 * self.size.1;
        let Some((colour, depth)) = self.formats else {
            return Ok(());
        };
        let length = |what: &str, is: usize, right: usize| match is == right {
            true => Ok(()),
            false => Err(crate::Error::Frame(format!(
                "{what} has {is} values; {right} are right"
            ))),
        };
        let other = |what: &str| {
            crate::Error::Frame(format!("{what} comes in another form than was planned"))
        };
        match (frame.colour, colour, &self.camera) {
            (ColourData::Planar(values), Colour::Planar, _) => {
                length("colour", values.len(), 3 * area)?;
                write(device, &self.colour, 0, bytemuck::cast_slice(values));
            }
            (ColourData::Camera(image), Colour::Camera { orientation, .. }, Some(camera)) => {
                if !camera.plan.fits(&image, orientation) {
                    return Err(other("colour").into());
                }
                camera.upload(device, &self.colour, &image)?;
            }
            _ => return Err(other("colour").into()),
        }
        match (frame.depth, depth) {
            (DepthData::F32(values), Depth::F32) => {
                length("depth", values.len(), area)?;
                write(device, &self.depth, 0, bytemuck::cast_slice(values));
            }
            (DepthData::U16(words), Depth::U16) => {
                length("depth", words.len(), area)?;
                write(device, &self.depth, 0, bytemuck::cast_slice(words));
            }
            _ => return Err(other("depth").into()),
        }
        Ok(())
    }

    /// What frames come as, where they do.
    pub(super) fn formats(&self) -> Option<(Colour, Depth)> {
        self.formats
    }

    pub(super) fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.step.run(pass);
    }
}

/// Copies `bytes` to `at` of `to`, which is a multiple of 4. Copies take whole words, so what is missing is 0.
fn write(device: &Device, to: &wgpu::Buffer, at: usize, bytes: &[u8]) {
    let (words, rest) = bytes.split_at(bytes.len() / 4 * 4);
    device.queue.write_buffer(to, at as u64, words);
    if !rest.is_empty() {
        let mut word = [0; 4];
        word[..rest.len()].copy_from_slice(rest);
        let at = (at + words.len()) as u64;
        device.queue.write_buffer(to, at, &word);
    }
}

impl Camera {
    /// A camera's images, and how many bytes they may have.
    fn new(
        device: &Device,
        plan: ColourPlan,
        format: ColourFormat,
        (height, width): (usize, usize),
    ) -> Result<(Self, usize)> {
        let mut places = Vec::new();
        let mut bytes = 0;
        for (_, pixel_bytes, share) in format.layout() {
            let (rows, columns) = (height.div_ceil(*share), width.div_ceil(*share));
            // Cameras pad rows, and Android's chroma planes have every second byte.
            let room = rows * (columns * pixel_bytes.max(&2) + 256).next_multiple_of(256);
            places.push((bytes, room));
            bytes += room;
        }
        let (levels, matrix) = match format {
            ColourFormat::Nv12(encoding) | ColourFormat::Yuv420(encoding) => {
                yuv_constants(encoding)
            }
            _ => ([0.0; 4], [0.0; 4]),
        };
        let mut all = [0u32; 20];
        for (to, value) in all[12..].iter_mut().zip(levels.into_iter().chain(matrix)) {
            *to = value.to_bits();
        }
        let constants = device.constants("the camera", bytemuck::cast_slice(&all))?;
        Ok((
            Camera {
                plan,
                constants,
                places,
            },
            bytes,
        ))
    }

    /// The table of taps and the constants that say where each axis lies in it.
    fn taps(&self) -> (String, Vec<u32>) {
        let mut table = Vec::new();
        let yuv = self.places.len() > 1;
        let mut constants = format!("const YUV: bool = {yuv};\n");
        for (name, axis) in ["X", "Y", "OTHER_X", "OTHER_Y"]
            .into_iter()
            .zip(self.plan.axes())
        {
            let (starts, weights, count) = axis.tables();
            let (other, side) = match name.strip_prefix("OTHER_") {
                Some(side) => ("OTHER_", side),
                None => ("", name),
            };
            constants += &format!(
                "const {other}AT_{side}: u32 = {}u;\nconst {other}COUNT_{side}: u32 = {count}u;\n",
                table.len()
            );
            table.extend_from_slice(starts);
            table.extend(weights.iter().map(|weight| weight.to_bits()));
        }
        (constants, table)
    }

    fn upload(&self, device: &Device, to: &wgpu::Buffer, image: &ColourImage<'_>) -> Result<()> {
        let format = image.format();
        let (height, width) = image.shape();
        let mut planes = image.planes().to_vec();
        let mut tight = Vec::new();
        for ((plane, (_, pixel_bytes, share)), (_, room)) in
            planes.iter_mut().zip(format.layout()).zip(&self.places)
        {
            let (rows, columns) = (height.div_ceil(*share), width.div_ceil(*share));
            let last = (rows - 1) * plane.row_stride + (columns - 1) * plane.pixel_stride;
            plane.bytes = &plane.bytes[..last + pixel_bytes];
            if plane.bytes.len() > *room {
                tight.push(tightened(plane, rows, columns, *pixel_bytes));
            } else {
                tight.push(Vec::new());
            }
        }
        for (plane, (tight, ((_, pixel_bytes, share), _))) in planes
            .iter_mut()
            .zip(tight.iter().zip(format.layout().iter().zip(&self.places)))
        {
            if !tight.is_empty() {
                *plane = Plane::new(tight, width.div_ceil(*share) * pixel_bytes, *pixel_bytes);
            }
        }
        let image = ColourImage::new(format, width, height, &planes)?;
        let mut words = [0i32; 12];
        for (c, (plane, view)) in self.plan.views(&image).into_iter().enumerate() {
            words[4 * c] = (self.places[plane].0 + view.origin) as i32;
            words[4 * c + 1] = view.step_x as i32;
            words[4 * c + 2] = view.step_y as i32;
        }
        device
            .queue
            .write_buffer(&self.constants.buffer, 0, bytemuck::cast_slice(&words));
        for (plane, (at, _)) in image.planes().iter().zip(&self.places) {
            write(device, to, *at, plane.bytes);
        }
        Ok(())
    }
}

/// A plane's pixels without gaps: for strides beyond what cameras have.
fn tightened(plane: &Plane<'_>, rows: usize, columns: usize, pixel_bytes: usize) -> Vec<u8> {
    let pixel = |i: usize| {
        let at = i / columns * plane.row_stride + i % columns * plane.pixel_stride;
        &plane.bytes[at..at + pixel_bytes]
    };
    (0..rows * columns).flat_map(pixel).copied().collect()
}

/// The smallest real numbers that round to each u8 value or above, as the first layer and as the last one round their
/// input: comparisons are exact on every GPU, divisions are not.
fn steps(device: &Device, chain: &Chain) -> Result<Constants> {
    let rounding = |i: usize| {
        let layer = &chain.layers[i];
        layer.quantisation.input.ok_or_else(|| {
            Error::Core(crate::Error::Network(format!(
                "layer {i}'s input is not rounded"
            )))
        })
    };
    let (first, last): (Quantisation, Quantisation) =
        (rounding(0)?, rounding(chain.layers.len() - 1)?);
    let concatenated = |real: f32| match chain.concat_rounded_input {
        true => last.quantise(first.dequantise(first.quantise(real))),
        false => last.quantise(real),
    };
    let mut values = thresholds(|real| first.quantise(real));
    values.extend(thresholds(concatenated));
    device.table("roundings", bytemuck::cast_slice(&values))
}

/// For each k of 0 … 255 the smallest number that `rounded`, which never falls, takes to k or above; the largest where
/// there is none.
fn thresholds(rounded: impl Fn(f32) -> u8) -> Vec<f32> {
    // The order of floats as that of integers.
    let float = |key: i32| {
        f32::from_bits(if key < 0 {
            !key as u32 | 1 << 31
        } else {
            key as u32
        })
    };
    let key = |real: f32| {
        let bits = real.to_bits();
        if bits >> 31 == 1 {
            !(bits & !(1 << 31)) as i32
        } else {
            bits as i32
        }
    };
    (0..=255u8)
        .map(|k| {
            let (mut low, mut high) = (i64::from(key(f32::MIN)), i64::from(key(f32::MAX)));
            while low < high {
                let middle = (low + high).div_euclid(2);
                match rounded(float(middle as i32)) >= k {
                    true => high = middle,
                    false => low = middle + 1,
                }
            }
            float(high as i32)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::device::testing::{device, run};
    use super::*;
    use crate::Network;
    use crate::frame::{Rotation, YuvEncoding};

    /// Camera images of odd sizes, turned, made larger and smaller, in the numbers of float chains.
    #[test]
    fn the_input_is_that_of_the_cpu() {
        let Some(device) = device() else { return };
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
            let planes = [
                Plane::new(&luma, sensor.1, 1),
                Plane::new(&chroma, 2 * half.1, 2),
            ];
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
                let form = Form::Chain(network.chain(), numbers);
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
        let Some(device) = device() else { return };
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

    #[test]
    fn thresholds_round_as_the_quantiser_does() {
        for (scale, zero_point) in [(1.0 / 254.0, 127), (0.017, 31), (0.3, 0), (1e-3, 255)] {
            let q = Quantisation { scale, zero_point };
            let steps = thresholds(|real| q.quantise(real));
            for i in -40_000..40_000 {
                let real = i as f32 / 30_000.0;
                let found = steps.iter().rposition(|&step| real >= step);
                let expected = q.quantise(real);
                let least = steps.iter().rposition(|step| *step < f32::MAX);
                assert_eq!(found, Some(usize::from(expected)), "{real} {least:?}");
            }
            for &step in &steps[1..] {
                for real in [step.next_down(), step, step.next_up()] {
                    let found = steps.iter().rposition(|&step| real >= step);
                    assert_eq!(found, Some(usize::from(q.quantise(real))), "{real}");
                }
            }
        }
    }
}
