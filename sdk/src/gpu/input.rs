//! From a frame as it comes to what a chain reads: groups of four channels, each minus a half, in the chain's numbers.
//! The twin is [`crate::frame::RgbdFrame::network_input`] and the kernels' quantiser.

use super::chain::{GROUP, Numbers};
use super::device::{Constants, Device, Dispatch};
use super::{Error, Result};
use crate::frame::RgbdFrame;
use crate::network::chain::{Chain, Quantisation};
use ndarray::{Array2, Array3};

/// How colour lies in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Colour {
    /// Three planes of f32 in \[0, 1], one after another: an [`RgbdFrame`]'s.
    Planar,
    /// Bytes red, green, blue, alpha (which is not looked at).
    Rgba,
    /// Bytes blue, green, red, alpha (which is not looked at): what iOS cameras and most screens have.
    Bgra,
}

/// How normalized depth lies in memory: one plane, 0 nearest, 1 farthest, without holes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Depth {
    /// f32 in \[0, 1].
    F32,
    /// 65535 is 1.
    U16,
}

/// What a [`Packer`] reads.
#[derive(Clone, Copy)]
pub(super) enum Source {
    /// The network's input planes themselves, f32, of any number.
    Planes,
    /// A frame.
    Frame(Colour, Depth),
}

/// A frame's bytes, rows and pixels without gaps. Little-endian, as all these devices are.
#[derive(Debug, Clone, Copy)]
pub struct FrameBytes<'a> {
    /// Colour, as planned.
    pub colour: &'a [u8],
    /// Depth, as planned.
    pub depth: &'a [u8],
}

impl<'a> FrameBytes<'a> {
    /// The bytes of a planar frame.
    pub fn of(frame: &'a RgbdFrame) -> Self {
        let rgb = frame.rgb().to_slice().expect("contiguous");
        let depth = frame.depth().to_slice().expect("contiguous");
        FrameBytes {
            colour: bytemuck::cast_slice(rgb),
            depth: bytemuck::cast_slice(depth),
        }
    }
}

impl FrameBytes<'_> {
    /// The frame that the bytes stand for, on the CPU: the twin of the input stage.
    ///
    /// # Errors
    /// [`crate::Error::Frame`] for bytes of another length, or values that no frame has.
    pub fn read(
        &self,
        colour: Colour,
        depth: Depth,
        (height, width): (usize, usize),
    ) -> Result<RgbdFrame> {
        self.check(bytes_of(Source::Frame(colour, depth), 0, height * width))?;
        let real = |bytes: &[u8]| -> Vec<f32> { bytemuck::pod_collect_to_vec(bytes) };
        let bytes = |order: [usize; 3]| -> Vec<f32> {
            let plane = |c: usize| self.colour.iter().skip(c).step_by(4);
            let bytes = order.into_iter().flat_map(plane);
            bytes.map(|&byte| f32::from(byte) / 255.0).collect()
        };
        let rgb = match colour {
            Colour::Planar => real(self.colour),
            Colour::Rgba => bytes([0, 1, 2]),
            Colour::Bgra => bytes([2, 1, 0]),
        };
        let depth = match depth {
            Depth::F32 => real(self.depth),
            Depth::U16 => {
                let words: Vec<u16> = bytemuck::pod_collect_to_vec(self.depth);
                words.iter().map(|&word| f32::from(word) / 65535.0).collect()
            }
        };
        let shape = |_| Error::from(crate::Error::Frame("lengths do not fit".into()));
        Ok(RgbdFrame::new(
            Array3::from_shape_vec((3, height, width), rgb).map_err(shape)?,
            Array2::from_shape_vec((height, width), depth).map_err(shape)?,
        )?)
    }

    fn check(&self, right: (usize, usize)) -> Result<()> {
        for (what, is, right) in [
            ("colour", self.colour.len(), right.0),
            ("depth", self.depth.len(), right.1),
        ] {
            if is != right {
                return Err(crate::Error::Frame(format!(
                    "{what} has {is} bytes; the planned format has {right}"
                ))
                .into());
            }
        }
        Ok(())
    }
}

/// Bytes of colour and of depth of `area` pixels.
fn bytes_of(source: Source, inputs: usize, area: usize) -> (usize, usize) {
    match source {
        Source::Planes => (4 * inputs * area, 0),
        Source::Frame(colour, depth) => (
            match colour {
                Colour::Planar => 12 * area,
                Colour::Rgba | Colour::Bgra => 4 * area,
            },
            match depth {
                Depth::F32 => 4 * area,
                Depth::U16 => 2 * area,
            },
        ),
    }
}

/// What a chain reads, on the GPU.
pub(super) struct ChainInput {
    /// The first layer's input.
    pub(super) first: wgpu::Buffer,
    /// What the last layer reads of it: the same buffer but in int8.
    pub(super) last: wgpu::Buffer,
    /// The first group in f32, for a head that adds to the image; the same buffer but in int8.
    pub(super) image: wgpu::Buffer,
}

/// The input stage for one frame size.
pub(super) struct Packer {
    /// Where a frame's colour goes, and its depth.
    pub(super) colour: wgpu::Buffer,
    pub(super) depth: wgpu::Buffer,
    bytes: (usize, usize),
    pub(super) input: ChainInput,
    step: Dispatch,
}

impl Packer {
    /// The stage for `chain` and frames of `size` (height, width) that come so.
    pub(super) fn new(
        device: &Device,
        chain: &Chain,
        numbers: Numbers,
        (height, width): (usize, usize),
        source: Source,
    ) -> Result<Self> {
        let area = height * width;
        let groups = chain.inputs.div_ceil(GROUP);
        let bytes = bytes_of(source, chain.inputs, area);
        let first = device.buffer("the network's input", groups * area * numbers.value_bytes())?;
        let input = match numbers {
            Numbers::Int8 => ChainInput {
                first,
                last: device.buffer("the network's input", groups * area * 4)?,
                image: device.buffer("the image", area * 16)?,
            },
            _ => ChainInput {
                last: first.clone(),
                image: first.clone(),
                first,
            },
        };
        let frame = [width, height, area, 0].map(|n| n as u32);
        let frame = device.constants("frame", bytemuck::cast_slice(&frame))?;
        let buffers = (
            device.buffer("colour", bytes.0)?,
            device.buffer("depth", bytes.1)?,
        );
        let enable = match numbers {
            Numbers::F16 => "enable f16;\n",
            _ => "",
        };
        let header = format!(
            "{enable}alias Value = {value};
            const READY: u32 = 0u;
            const PLANAR: u32 = 1u;
            const RGBA: u32 = 2u;
            const BGRA: u32 = 3u;
            const REAL: u32 = 0u;
            const WORDS: u32 = 1u;
            const COLOUR: u32 = {colour};
            const DEPTH: u32 = {depth};
            const CHANNELS: u32 = {channels}u;
            const GROUPS: u32 = {groups}u;
            ",
            value = numbers.value(),
            colour = match source {
                Source::Planes => "READY",
                Source::Frame(Colour::Planar, _) => "PLANAR",
                Source::Frame(Colour::Rgba, _) => "RGBA",
                Source::Frame(Colour::Bgra, _) => "BGRA",
            },
            depth = match source {
                Source::Planes | Source::Frame(_, Depth::F32) => "REAL",
                Source::Frame(_, Depth::U16) => "WORDS",
            },
            channels = chain.inputs,
        );
        let store = match numbers {
            Numbers::Int8 => include_str!("input_int8.wgsl"),
            _ => include_str!("input_float.wgsl"),
        };
        let program = device.program(
            "the input",
            header + include_str!("input.wgsl") + store,
            "pack",
        );
        let mut arguments = vec![
            (0, frame.buffer.as_entire_binding()),
            (1, buffers.0.as_entire_binding()),
            (2, buffers.1.as_entire_binding()),
            (3, input.first.as_entire_binding()),
        ];
        let steps = match numbers {
            Numbers::Int8 => Some(steps(device, chain)?),
            _ => None,
        };
        if let Some(steps) = &steps {
            arguments.push((4, input.last.as_entire_binding()));
            arguments.push((5, input.image.as_entire_binding()));
            arguments.push((6, steps.buffer.as_entire_binding()));
        }
        let step = program.on(device, &arguments, [width.div_ceil(64), height, 1])?;
        Ok(Packer {
            colour: buffers.0,
            depth: buffers.1,
            bytes,
            input,
            step,
        })
    }

    /// Sends a frame's bytes on their way; they are there when what is submitted next begins.
    pub(super) fn upload(&self, device: &Device, frame: &FrameBytes<'_>) -> Result<()> {
        frame.check(self.bytes)?;
        for (to, bytes) in [(&self.colour, frame.colour), (&self.depth, frame.depth)] {
            // Copies take whole words.
            let (words, rest) = bytes.split_at(bytes.len() / 4 * 4);
            device.queue.write_buffer(to, 0, words);
            if !rest.is_empty() {
                let mut word = [0; 4];
                word[..rest.len()].copy_from_slice(rest);
                device.queue.write_buffer(to, words.len() as u64, &word);
            }
        }
        Ok(())
    }

    pub(super) fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.step.run(pass);
    }
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
    let float = |key: i32| f32::from_bits(if key < 0 { !key as u32 | 1 << 31 } else { key as u32 });
    let key = |real: f32| {
        let bits = real.to_bits();
        if bits >> 31 == 1 { !(bits & !(1 << 31)) as i32 } else { bits as i32 }
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
    use super::*;

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
