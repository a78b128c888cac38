//! One RGB-D frame through all stages on the GPU, several frames in flight: the twin of [`crate::pipeline`].

use super::chain::ChainOptions;
use super::device::{Device, copy_mapped};
use super::encode::{Encoder, EncoderJob, MeanPhase, Target};
use super::fft::{Convolution, Planes};
use super::input::{Colour, Depth, Frame};
use super::method::MethodPlan;
use super::peak::Peak;
use super::{Error, Result};
use crate::brightness::{Brightness, Past};
use crate::display::Display;
use crate::encode::{Encoding, Scale, deep};
use crate::illumination::Illumination;
use crate::method::Method;
use crate::slm::Response;
use crate::wave::asm::{Padding, Propagator};
use crate::wave::zernike::Aberration;
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Duration;

/// Frames that may be in flight at a time.
pub const FLIGHTS: usize = 3;
/// Where a frame's levels begin in what is read back: behind the largest amplitude and the time stamps.
const LEVELS_AT: usize = 256;
const STAMPS_AT: u64 = 16;
/// Time stamps of a frame: before and after each stage.
const STAMPS: u32 = 8;

/// What is to be computed.
#[derive(Clone)]
pub struct Job {
    /// Pixels.
    pub height: usize,
    /// Pixels.
    pub width: usize,
    /// What makes the midpoint hologram.
    pub method: Method,
    /// The display.
    pub display: Display,
    /// From a field to phases.
    pub encoding: Encoding,
    /// What full light stands for.
    pub brightness: Brightness,
    /// From phases to levels.
    pub response: Response,
    /// The lasers' light over the modulator, where it is calibrated.
    pub illumination: Option<Illumination>,
    /// What corrects the display's aberration, where it is calibrated and one for all depths.
    pub correction: Option<Aberration>,
    /// How colour comes.
    pub colour: Colour,
    /// How depth comes.
    pub depth: Depth,
    /// How a network is computed.
    pub chain: ChainOptions,
}

impl Job {
    /// Frames as [`crate::RgbdFrame`] by `method` to `display` as [`crate::Pipeline`] makes them.
    pub fn new(
        height: usize,
        width: usize,
        method: Method,
        display: &Display,
        encoding: Encoding,
        scale: impl Into<Brightness>,
        response: Response,
    ) -> Self {
        Job {
            height,
            width,
            method,
            display: display.clone(),
            encoding,
            brightness: scale.into(),
            response,
            illumination: None,
            correction: None,
            colour: Colour::Planar,
            depth: Depth::F32,
            chain: ChainOptions::default(),
        }
    }

    /// The same on the CPU, with each frame's largest amplitude where brightness is steady: a plan on the CPU is told a
    /// steady scale by its caller, in [`crate::Pipeline::modulate_at`].
    ///
    /// # Errors
    /// What [`crate::Pipeline::new`] and the correction refuse.
    pub fn on_cpu(&self) -> crate::Result<crate::Pipeline> {
        let scale = match self.brightness {
            Brightness::Fixed(scale) => Scale::Fixed(scale),
            _ => Scale::Max,
        };
        let mut pipeline = crate::Pipeline::new(
            self.height,
            self.width,
            self.method.clone(),
            &self.display,
            self.encoding.clone(),
            scale,
            self.response.clone(),
        )?;
        if let Some(illumination) = &self.illumination {
            pipeline = pipeline.with_illumination(illumination.clone());
        }
        if let Some(correction) = &self.correction {
            pipeline = pipeline.with_correction(correction)?;
        }
        Ok(pipeline)
    }
}

/// Who wants a frame's levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deliver {
    /// The CPU: they are copied to where it reads them.
    Levels,
    /// The GPU, as [`Pipeline::texture`] or [`Pipeline::levels`]: nothing is copied.
    Shown,
}

/// A frame in flight. Given back by [`Pipeline::collect`] or [`Pipeline::finish`].
#[derive(Debug, PartialEq, Eq)]
pub struct Ticket {
    slot: usize,
    serial: u64,
}

/// How long each stage of a frame took on the GPU.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StageTimes {
    /// From the camera's format to the method's input.
    pub input: Duration,
    /// From the input to the hologram where the method ends.
    pub method: Duration,
    /// From there to the modulator.
    pub propagate: Duration,
    /// From the field to levels.
    pub encode: Duration,
}

impl StageTimes {
    /// All stages together.
    pub fn total(&self) -> Duration {
        self.input + self.method + self.propagate + self.encode
    }
}

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameReport {
    /// The amplitude that full light stands for.
    pub scale: f32,
    /// How long it took, where the device has time stamps.
    pub times: Option<StageTimes>,
}

/// A plan for one [`Job`] on one device: all buffers and programs are made with it.
pub struct Pipeline {
    device: Arc<Device>,
    size: (usize, usize),
    method: MethodPlan,
    /// None for an encoding that was trained on the field's phase as it is.
    mean: Option<MeanPhase>,
    /// None where the modulator stands at the midpoint.
    offset: Option<Convolution>,
    encoder: Encoder,
    targets: Vec<Target>,
    slots: Vec<Slot>,
    serial: u64,
}

/// What a frame in flight has to itself, besides its target.
struct Slot {
    /// The largest amplitude, the time stamps, the levels.
    readable: wgpu::Buffer,
    stamps: Option<(wgpu::QuerySet, wgpu::Buffer)>,
    flight: Option<Flight>,
}

struct Flight {
    serial: u64,
    submission: wgpu::SubmissionIndex,
    deliver: Deliver,
}

impl Pipeline {
    /// Plans `job` on `device`. Whether the device is to be trusted is [`super::probe`]'s question.
    ///
    /// # Errors
    /// What [`crate::Pipeline::new`] refuses, and [`Error::Refused`] or [`Error::OutOfMemory`] for what this device
    /// cannot do.
    pub fn new(device: &Arc<Device>, job: &Job) -> Result<Self> {
        job.method.check(&job.display)?;
        let size = (job.height, job.width);
        crate::network::check_size(size.0, size.1, crate::network::MAX_PIXELS)?;
        job.brightness.check()?;
        if let Encoding::Deep(network) = &job.encoding {
            deep::check(network, &job.display)?;
        }
        if let Some(shape) = job.response.shape()
            && shape != size
        {
            return Err(crate::Error::Plan(format!(
                "the per-pixel table is for {}×{} pixels, the hologram is {}×{}; both must be of one size",
                shape.1, shape.0, size.1, size.0
            ))
            .into());
        }
        device.guarded(|| Self::build(device, job, size))
    }

    fn build(device: &Arc<Device>, job: &Job, size: (usize, usize)) -> Result<Self> {
        let (display, formats) = (&job.display, (job.colour, job.depth));
        let method = MethodPlan::new(device, &job.method, size, display, formats, job.chain)?;
        let (sums, parts) = method.sums();
        let mean = match job.encoding {
            Encoding::Deep(_) => None,
            _ => Some(MeanPhase::new(device, sums, parts)?),
        };
        // The first to read the field turns it.
        let mut turn = mean.as_ref().map(|mean| &mean.turn);
        let (pitch_m, wavelengths_m) = (display.pitch_m(), display.wavelengths_m());
        // The rest of the way.
        let plans = match (display.offset_m() - method.z_m(), &job.correction) {
            (offset_m, Some(correction)) => Some(Propagator::for_colours_corrected(
                size.0,
                size.1,
                pitch_m,
                wavelengths_m,
                offset_m,
                correction,
                pitch_m,
            )?),
            (0.0, None) => None,
            (offset_m, None) => Some(Propagator::for_colours(
                size.0,
                size.1,
                pitch_m,
                wavelengths_m,
                offset_m,
                Padding::Reach,
            )?),
        };
        let offset = match &plans {
            None => None,
            Some(plans) => Some(Convolution::new(
                device,
                &Planes {
                    field: method.field(),
                    size,
                    padded: plans[0].padded_shape(),
                    factors: &plans.each_ref().map(|plan| plan.transfer().factors()),
                    turn: turn.take(),
                },
            )?),
        };
        let modulator = (display.height(), display.width());
        let light = (job.illumination.as_ref()).map(|light| (light, modulator));
        let targets = (0..FLIGHTS)
            .map(|_| Target::new(device, size))
            .collect::<Result<Vec<_>>>()?;
        let encoder = EncoderJob {
            field: method.field(),
            size,
            encoding: &job.encoding,
            chain: job.chain,
            brightness: job.brightness,
            response: &job.response,
            light,
            turn,
        };
        let encoder = Encoder::new(device, &encoder, &targets)?;
        let slots = (0..FLIGHTS).map(|_| Slot::new(device, size)).collect();
        Ok(Pipeline {
            device: device.clone(),
            size,
            method,
            mean,
            offset,
            encoder,
            targets,
            slots,
            serial: 0,
        })
    }

    /// (H, W).
    pub fn shape(&self) -> (usize, usize) {
        self.size
    }

    /// The device.
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// What the hologram is computed in, and how.
    pub fn describe(&self) -> String {
        let (numbers, device) = (self.numbers(), self.device.name());
        format!("{numbers} on {device}, {}", self.method.describe())
    }

    /// What the network, or a sweep by itself, is computed in: `f32`, `f16` or `int8`.
    pub fn numbers(&self) -> &'static str {
        self.method.numbers().name()
    }

    /// What the device does at its best, measured now, in these numbers.
    ///
    /// # Errors
    /// What the device refuses; [`Error::Lost`].
    pub fn peak(&self) -> Result<Peak> {
        super::peak::measure(&self.device, self.method.numbers())
    }

    /// Bytes that the method's dispatches read and write in a frame, each value once.
    pub fn method_bytes(&self) -> usize {
        self.method.bytes()
    }

    /// Frames come so from now on: the input stage alone is planned again. Frames in flight are not harmed.
    ///
    /// # Errors
    /// A format that the CPU refuses too, or what this device cannot do; frames then come as before.
    pub fn expect(&mut self, colour: Colour, depth: Depth) -> Result<()> {
        self.method.expect(&self.device, (colour, depth))
    }

    /// Sends a frame through. At most [`FLIGHTS`] may be in flight.
    ///
    /// # Errors
    /// Bytes of another length than planned, too many frames in flight, or a device that is lost.
    pub fn submit(&mut self, frame: &Frame<'_>, deliver: Deliver) -> Result<Ticket> {
        self.submit_after(None, frame, deliver)
    }

    /// [`Pipeline::submit`] for steady brightness, whose scale comes from `past`.
    ///
    /// # Errors
    /// As [`Pipeline::submit`].
    pub fn submit_after(
        &mut self,
        past: Option<Past>,
        frame: &Frame<'_>,
        deliver: Deliver,
    ) -> Result<Ticket> {
        let Some(slot) = self.slots.iter().position(|slot| slot.flight.is_none()) else {
            return Err(crate::Error::Plan(format!(
                "{FLIGHTS} frames are in flight; one must be collected first"
            ))
            .into());
        };
        let device = self.device.clone();
        let submission = device.guarded(|| {
            self.method.upload(&device, frame)?;
            self.encoder.heed(&device, past);
            Ok(device.queue.submit([self.commands(slot, deliver)]))
        })?;
        self.serial += 1;
        self.slots[slot].flight = Some(Flight {
            serial: self.serial,
            submission,
            deliver,
        });
        Ok(Ticket {
            slot,
            serial: self.serial,
        })
    }

    fn commands(&self, at: usize, deliver: Deliver) -> wgpu::CommandBuffer {
        let slot = &self.slots[at];
        let mut encoder = (self.device.inner).create_command_encoder(&Default::default());
        self.encoder.reset(&mut encoder);
        let mut stage = |index: u32, work: &dyn Fn(&mut wgpu::ComputePass<'_>)| {
            let stamps = slot.stamps.as_ref();
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: None,
                timestamp_writes: stamps.map(|(set, _)| wgpu::ComputePassTimestampWrites {
                    query_set: set,
                    beginning_of_pass_write_index: Some(2 * index),
                    end_of_pass_write_index: Some(2 * index + 1),
                }),
            });
            work(&mut pass);
        };
        stage(0, &|pass| self.method.read(pass));
        stage(1, &|pass| {
            self.method.run(pass);
            if let Some(mean) = &self.mean {
                mean.run(pass);
            }
        });
        stage(2, &|pass| {
            if let Some(offset) = &self.offset {
                offset.run(pass);
            }
        });
        stage(3, &|pass| self.encoder.run(pass, at));
        encoder.copy_buffer_to_buffer(&self.encoder.largest, 0, &slot.readable, 0, 16);
        if let Some((set, resolved)) = &slot.stamps {
            let bytes = u64::from(STAMPS) * 8;
            encoder.resolve_query_set(set, 0..STAMPS, resolved, 0);
            encoder.copy_buffer_to_buffer(resolved, 0, &slot.readable, STAMPS_AT, bytes);
        }
        if deliver == Deliver::Levels {
            let bytes = (4 * self.size.0 * self.size.1) as u64;
            let levels = &self.targets[at].levels;
            encoder.copy_buffer_to_buffer(levels, 0, &slot.readable, LEVELS_AT as u64, bytes);
        }
        encoder.finish()
    }

    /// Where a frame's picture is, or will be: RGBA of 8 bits, levels of red, green and blue. It stays until the frame
    /// is collected or finished.
    pub fn texture(&self, ticket: &Ticket) -> &wgpu::Texture {
        &self.targets[ticket.slot].texture
    }

    /// The same as a buffer: (H, W) words, red in the lowest byte, then green, blue and 255.
    pub fn levels(&self, ticket: &Ticket) -> &wgpu::Buffer {
        &self.targets[ticket.slot].levels
    }

    /// Waits for a frame and copies its levels, (3, H, W).
    ///
    /// # Errors
    /// A frame that was not asked for with [`Deliver::Levels`]; [`Error::Lost`].
    ///
    /// # Panics
    /// If `levels` has not 3·H·W values.
    pub fn collect(&mut self, ticket: Ticket, levels: &mut [u8]) -> Result<FrameReport> {
        let area = self.size.0 * self.size.1;
        assert_eq!(levels.len(), 3 * area);
        self.take(ticket, Deliver::Levels, |bytes| {
            let words = &bytes[LEVELS_AT..][..4 * area];
            for (c, plane) in levels.chunks_exact_mut(area).enumerate() {
                plane
                    .par_chunks_mut(1 << 14)
                    .zip(words.par_chunks(4 << 14))
                    .for_each(|(plane, words)| {
                        for (level, word) in plane.iter_mut().zip(words.chunks_exact(4)) {
                            *level = word[c];
                        }
                    });
            }
        })
    }

    /// Waits for a frame that stays on the GPU, and gives its place to another.
    ///
    /// # Errors
    /// [`Error::Lost`].
    pub fn finish(&mut self, ticket: Ticket) -> Result<FrameReport> {
        self.take(ticket, Deliver::Shown, |_| {})
    }

    fn take(
        &mut self,
        ticket: Ticket,
        wanted: Deliver,
        read: impl FnOnce(&[u8]),
    ) -> Result<FrameReport> {
        let slot = &mut self.slots[ticket.slot];
        let flight = slot.flight.take_if(|flight| flight.serial == ticket.serial);
        let Some(flight) = flight else {
            return Err(crate::Error::Plan("the frame was collected before".into()).into());
        };
        if wanted == Deliver::Levels && flight.deliver == Deliver::Shown {
            return Err(crate::Error::Plan(
                "the frame was submitted to be shown; its levels were not copied".into(),
            )
            .into());
        }
        self.device.map(&slot.readable, &flight.submission)?;
        let mut head = [0; LEVELS_AT];
        copy_mapped(&slot.readable, &mut head)?;
        {
            let view = slot
                .readable
                .get_mapped_range(..)
                .map_err(|why| Error::Lost(super::device::one_line(why)))?;
            read(&view);
        }
        slot.readable.unmap();
        let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|k| head[at + k]));
        let stamp = |i: usize| {
            let at = STAMPS_AT as usize + 8 * i;
            u64::from(word(at)) | u64::from(word(at + 4)) << 32
        };
        let period = f64::from(self.device.queue.get_timestamp_period()) * 1e-9;
        let stage = |i: usize| {
            let ticks = stamp(2 * i + 1).saturating_sub(stamp(2 * i));
            Duration::from_secs_f64(ticks as f64 * period)
        };
        Ok(FrameReport {
            scale: self.encoder.scale(word(0)),
            times: slot.stamps.is_some().then(|| StageTimes {
                input: stage(0),
                method: stage(1),
                propagate: stage(2),
                encode: stage(3),
            }),
        })
    }

    /// [`Pipeline::submit`] and [`Pipeline::collect`] in one.
    ///
    /// # Errors
    /// As theirs.
    ///
    /// # Panics
    /// If `levels` has not 3·H·W values.
    pub fn process(&mut self, frame: &Frame<'_>, levels: &mut [u8]) -> Result<FrameReport> {
        let ticket = self.submit(frame, Deliver::Levels)?;
        self.collect(ticket, levels)
    }
}

impl Slot {
    fn new(device: &Device, (height, width): (usize, usize)) -> Self {
        let stamps = device.features().timestamps.then(|| {
            let set = device.inner.create_query_set(&wgpu::QuerySetDescriptor {
                label: None,
                ty: wgpu::QueryType::Timestamp,
                count: STAMPS,
            });
            let resolved = device.inner.create_buffer(&wgpu::BufferDescriptor {
                label: Some("time stamps"),
                size: u64::from(STAMPS) * 8,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            });
            (set, resolved)
        });
        Slot {
            readable: device.readable("a frame", LEVELS_AT + 4 * height * width),
            stamps,
            flight: None,
        }
    }
}
