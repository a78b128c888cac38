//! The sources of the input stage and their parts of its program.

use super::camera::Camera;
use super::condition::Conditioning;
use super::frame::{Colour, ColourData, Depth, DepthData, Frame};
use super::light;
use crate::Result;
use crate::device::Device;
use phasefront_core::Size;
use phasefront_core::frame::ColourPlan;
use phasefront_core::method::network::InputKind;

/// The source that a [`super::Packer`] reads.
#[derive(Clone, Copy)]
pub(crate) enum Source<'a> {
    /// Any number of f32 planes, the network's input, in the packer's own buffer.
    Planes,
    /// A complex field on the GPU, and the input format of the pre-filter.
    Field(&'a wgpu::Buffer, InputKind),
    /// A frame's surfaces and the sweep's field of that frame, both on the GPU.
    Seeded(&'a wgpu::Buffer, &'a wgpu::Buffer),
    /// A frame's surfaces on the GPU: red, green, blue and depth.
    Surfaces(&'a wgpu::Buffer),
    /// A frame, in the packer's own buffers. Its surfaces have no depth if that is readings.
    Frame(Colour, Depth),
}

/// The buffers and the program text for a [`Source`].
pub(super) struct Reader {
    /// The constants of the program.
    pub(super) header: String,
    /// The part of the program that reads values from the source.
    pub(super) text: String,
    /// The planes, the field, the surfaces or the colour.
    pub(super) first: wgpu::Buffer,
    /// The sweep's field or the depth.
    pub(super) second: Option<wgpu::Buffer>,
    pub(super) frames: Option<Frames>,
}

/// The formats and buffers of frames.
pub(super) struct Frames {
    pub(super) formats: (Colour, Depth),
    pub(super) camera: Option<Camera>,
    size: Size,
    colour: wgpu::Buffer,
    depth: Option<wgpu::Buffer>,
    /// Adds the depth of readings.
    pub(super) conditioning: Option<Conditioning>,
}

impl Reader {
    /// Creates a reader of pixels with this number of `channels`.
    pub(super) fn new(device: &Device, source: Source<'_>, channels: usize, size: Size) -> Result<Self> {
        let reader = |text: &str, first| Reader {
            header: String::new(),
            text: text.to_owned(),
            first,
            second: None,
            frames: None,
        };
        Ok(match source {
            Source::Planes => {
                let bytes = 4 * channels * size.height * size.width;
                let planes = device.buffer("the network's input", bytes)?;
                reader(include_str!("planes.wgsl"), planes)
            }
            Source::Field(field, kind) => Reader {
                header: format!(
                    "const SPLIT: bool = {};\nconst SPLIT_STEP: f32 = {:?};\nconst REMAINDER_GAIN: f32 = {:?};\n",
                    kind == InputKind::SplitBlurredField,
                    InputKind::SPLIT_STEP,
                    InputKind::REMAINDER_GAIN
                ),
                ..reader(include_str!("field.wgsl"), field.clone())
            },
            Source::Seeded(surfaces, seed) => Reader {
                second: Some(seed.clone()),
                ..reader(include_str!("seeded.wgsl"), surfaces.clone())
            },
            Source::Surfaces(surfaces) => {
                let text = [include_str!("surfaces.wgsl"), include_str!("frame.wgsl")].concat();
                reader(&text, surfaces.clone())
            }
            Source::Frame(colour, depth) => Reader::of_frames(device, colour, depth, size)?,
        })
    }

    fn of_frames(device: &Device, colour: Colour, depth: Depth, size: Size) -> Result<Self> {
        let Size { width, height } = size;
        let area = height * width;
        let mut header = format!("const WORDS: bool = {};\n", depth == Depth::U16);
        let (bytes, text, camera) = match colour {
            Colour::Planar => (12 * area, include_str!("planar.wgsl"), None),
            Colour::Camera {
                format,
                size: sensor,
                orientation,
                light,
            } => {
                let plan = ColourPlan::for_format(format, sensor, orientation, size)?;
                let (camera, bytes, constants) = Camera::new(device, plan, format, sensor)?;
                header += &constants;
                header += &light::header(&light);
                (
                    bytes,
                    concat!(include_str!("light.wgsl"), include_str!("camera.wgsl")),
                    Some(camera),
                )
            }
        };
        let depth_bytes = match depth {
            Depth::F32 => Some(4 * area),
            Depth::U16 => Some(2 * area),
            Depth::Readings(_) => None,
        };
        let depth_text = match depth_bytes {
            Some(_) => include_str!("depth.wgsl"),
            None => "fn distance_at(at: u32) -> f32 { return 0.0; }\n",
        };
        let frames = Frames {
            formats: (colour, depth),
            camera,
            size,
            colour: device.buffer("colour", bytes)?,
            depth: depth_bytes.map(|bytes| device.buffer("depth", bytes)).transpose()?,
            conditioning: None,
        };
        Ok(Reader {
            header,
            text: [text, depth_text, include_str!("frame.wgsl")].concat(),
            first: frames.colour.clone(),
            second: frames.depth.clone(),
            frames: Some(frames),
        })
    }
}

impl Frames {
    pub(super) fn upload(&self, device: &Device, frame: &Frame<'_>) -> Result<()> {
        let area = self.size.height * self.size.width;
        let length = |what: &str, is: usize, right: usize| {
            if is == right {
                Ok(())
            } else {
                Err(phasefront_core::runtime::error::Error::Frame(format!(
                    "{what} has {is} values; {right} are right"
                )))
            }
        };
        let other = |what: &str| {
            phasefront_core::runtime::error::Error::Frame(format!("{what} comes in another form than was planned"))
        };
        let (colour, depth) = self.formats;
        match (frame.colour, colour, &self.camera) {
            (ColourData::Planar(values), Colour::Planar, _) => {
                length("colour", values.len(), 3 * area)?;
                device.write(&self.colour, 0, bytemuck::cast_slice(values));
            }
            (ColourData::Camera(image), Colour::Camera { orientation, .. }, Some(camera)) => {
                if !camera.fits(&image, orientation) {
                    return Err(other("colour").into());
                }
                camera.upload(device, &self.colour, &image)?;
            }
            _ => return Err(other("colour").into()),
        }
        match (frame.depth, depth, &self.depth, &self.conditioning) {
            (DepthData::F32(values), Depth::F32, Some(buffer), _) => {
                length("depth", values.len(), area)?;
                device.write(buffer, 0, bytemuck::cast_slice(values));
            }
            (DepthData::U16(words), Depth::U16, Some(buffer), _) => {
                length("depth", words.len(), area)?;
                device.write(buffer, 0, bytemuck::cast_slice(words));
            }
            (DepthData::Readings(readings), Depth::Readings(_), _, Some(conditioning)) => {
                conditioning.upload(device, &readings)?;
            }
            _ => return Err(other("depth").into()),
        }
        Ok(())
    }
}
