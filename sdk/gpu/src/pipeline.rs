//! One RGB-D frame through all stages on the GPU, several frames in flight: the twin of [`phasefront_core::pipeline`].

use super::device::{Device, copy_mapped};
use super::encode::{Encoder, EncoderJob, LevelsBuffers, MeanPhase};
use super::fft::{Convolution, Planes};
use super::input::{Colour, Depth, Frame};
use super::method::MethodPlan;
use super::{GpuError, Result};
use crate::device::peak::Peak;
use crate::method::chain::ChainOptions;
use phasefront_core::display::target::Target;
use phasefront_core::encode::brightness::Past;
use phasefront_core::encode::{EncoderOptions, Encoding};
use phasefront_core::method::Method;
use phasefront_core::pipeline::FrameTimes;
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
    /// (H, W).
    pub shape: (usize, usize),
    /// What makes the midpoint hologram.
    pub method: Method,
    /// What it is for.
    pub target: Target,
    /// How fields become levels.
    pub encoder: EncoderOptions,
    /// How colour comes.
    pub colour: Colour,
    /// How depth comes.
    pub depth: Depth,
    /// How a network is computed.
    pub chain: ChainOptions,
}

impl Job {
    /// Frames as [`phasefront_core::frame::RgbdFrame`] by `method` to `target` as
    /// [`phasefront_core::pipeline::Pipeline`] makes them.
    pub fn new(shape: (usize, usize), method: Method, target: impl Into<Target>) -> Self {
        Job {
            shape,
            method,
            target: target.into(),
            encoder: EncoderOptions::default(),
            colour: Colour::Planar,
            depth: Depth::F32,
            chain: ChainOptions::default(),
        }
    }

    /// The same on the CPU.
    ///
    /// # Errors
    /// What [`phasefront_core::pipeline::Pipeline::new`] refuses.
    pub fn on_cpu(&self) -> phasefront_core::runtime::error::Result<phasefront_core::pipeline::Pipeline> {
        phasefront_core::pipeline::Pipeline::new(self.shape, self.method.clone(), &self.target, &self.encoder)
    }
}

/// Who wants a frame's levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deliver {
    /// The CPU: they are copied to where it reads them.
    Levels,
    /// The GPU, as [`GpuPipeline::texture`] or [`GpuPipeline::levels`]: nothing is copied.
    Shown,
}

/// A frame in flight. Given back by [`GpuPipeline::collect`] or [`GpuPipeline::finish`].
#[derive(Debug, PartialEq, Eq)]
pub struct Ticket {
    slot: usize,
    serial: u64,
}

/// What became of a frame on the GPU.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GpuReport {
    /// The amplitude that full light stands for.
    pub scale: f32,
    /// How long it took, where the device has time stamps.
    pub times: Option<FrameTimes>,
}

/// A plan for one [`Job`] on one device: all buffers and programs are made with it.
pub struct GpuPipeline {
    device: Arc<Device>,
    size: (usize, usize),
    method: MethodPlan,
    /// None for an encoding that was trained on the field's phase as it is.
    mean: Option<MeanPhase>,
    /// None where the modulator stands at the midpoint.
    offset: Option<Convolution>,
    encoder: Encoder,
    buffers: Vec<LevelsBuffers>,
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

impl GpuPipeline {
    /// Plans `job` on `device`. Whether the device is to be trusted is [`super::probe`]'s question.
    ///
    /// # Errors
    /// What [`phasefront_core::pipeline::Pipeline::new`] refuses, and [`GpuError::Refused`] or
    /// [`GpuError::OutOfMemory`] for what this device cannot do.
    pub fn new(device: &Arc<Device>, job: &Job) -> Result<Self> {
        let display = &job.target.display;
        job.method.check(display)?;
        let size = job.shape;
        phasefront_core::method::network::check_size(size.0, size.1, phasefront_core::method::network::MAX_PIXELS)?;
        job.encoder.check()?;
        job.target.check()?;
        if display.colours() != 3 {
            return Err(GpuError::Refused(
                "a display of one laser, which is the CPU's; the GPU makes holograms of three colours".into(),
            ));
        }
        if !job.target.panel.is_plain() || job.target.registration.moves() {
            return Err(GpuError::Refused(
                "a panel's flatness, carrier, lens or range over 2π and colours that are moved, which are the CPU's"
                    .into(),
            ));
        }
        if let Encoding::Deep(network) = &job.encoder.encoding {
            network.check_prefilter(display)?;
        }
        device.guarded(|| Self::build(device, job, size))
    }

    fn build(device: &Arc<Device>, job: &Job, size: (usize, usize)) -> Result<Self> {
        let (target, formats) = (&job.target, (job.colour, job.depth));
        let (display, encoder) = (&target.display, &job.encoder);
        let method = MethodPlan::new(device, &job.method, size, display, formats, job.chain)?;
        let (sums, parts) = method.sums();
        let mean = match encoder.encoding.keeps_phase() {
            true => None,
            false => Some(MeanPhase::new(device, sums, parts)?),
        };
        // The first to read the field turns it.
        let mut turn = mean.as_ref().map(|mean| &mean.turn);
        // The rest of the way.
        let distance_m = display.offset_m() - method.z_m();
        let plans = target.propagators(size, 1, distance_m, target.correction.as_ref())?;
        let offset = match &plans {
            None => None,
            Some(plans) => Some(Convolution::new(
                device,
                &Planes {
                    field: method.field(),
                    size,
                    padded: plans[0].padded_shape(),
                    factors: &plans.iter().map(|plan| plan.transfer().factors()).collect::<Vec<_>>(),
                    turn: turn.take(),
                },
            )?),
        };
        let buffers = (0..FLIGHTS)
            .map(|_| LevelsBuffers::new(device, size))
            .collect::<Result<Vec<_>>>()?;
        let response = target.response.clone().centred(size.0, size.1)?;
        let encoder = EncoderJob {
            field: method.field(),
            size,
            options: encoder,
            chain: job.chain,
            target,
            response: &response,
            turn,
        };
        let encoder = Encoder::new(device, &encoder, &buffers)?;
        let slots = (0..FLIGHTS).map(|_| Slot::new(device, size)).collect();
        Ok(GpuPipeline {
            device: device.clone(),
            size,
            method,
            mean,
            offset,
            encoder,
            buffers,
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
    /// What the device refuses; [`GpuError::Lost`].
    pub fn peak(&self) -> Result<Peak> {
        crate::device::peak::measure(&self.device, self.method.numbers())
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

    /// [`GpuPipeline::submit`] for smoothed brightness, whose scale comes from `past`.
    ///
    /// # Errors
    /// As [`GpuPipeline::submit`].
    pub fn submit_after(&mut self, past: Option<Past>, frame: &Frame<'_>, deliver: Deliver) -> Result<Ticket> {
        let Some(slot) = self.slots.iter().position(|slot| slot.flight.is_none()) else {
            return Err(phasefront_core::runtime::error::Error::Setting(format!(
                "{FLIGHTS} frames are in flight; one must be collected first"
            ))
            .into());
        };
        let device = self.device.clone();
        let submission = device.guarded(|| {
            self.method.upload(&device, frame)?;
            self.encoder.set_past(&device, past);
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
            let levels = &self.buffers[at].levels;
            encoder.copy_buffer_to_buffer(levels, 0, &slot.readable, LEVELS_AT as u64, bytes);
        }
        encoder.finish()
    }

    /// Where a frame's picture is, or will be: RGBA of 8 bits, levels of red, green and blue. It stays until the frame
    /// is collected or finished.
    pub fn texture(&self, ticket: &Ticket) -> &wgpu::Texture {
        &self.buffers[ticket.slot].texture
    }

    /// The same as a buffer: (H, W) words, red in the lowest byte, then green, blue and 255.
    pub fn levels(&self, ticket: &Ticket) -> &wgpu::Buffer {
        &self.buffers[ticket.slot].levels
    }

    /// Waits for a frame and copies its levels, (3, H, W).
    ///
    /// # Errors
    /// A frame that was not asked for with [`Deliver::Levels`]; [`GpuError::Lost`].
    ///
    /// # Panics
    /// If `levels` has not 3·H·W values.
    pub fn collect(&mut self, ticket: Ticket, levels: &mut [u8]) -> Result<GpuReport> {
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
    /// [`GpuError::Lost`].
    pub fn finish(&mut self, ticket: Ticket) -> Result<GpuReport> {
        self.take(ticket, Deliver::Shown, |_| {})
    }

    fn take(&mut self, ticket: Ticket, wanted: Deliver, read: impl FnOnce(&[u8])) -> Result<GpuReport> {
        let slot = &mut self.slots[ticket.slot];
        let flight = slot.flight.take_if(|flight| flight.serial == ticket.serial);
        let Some(flight) = flight else {
            return Err(
                phasefront_core::runtime::error::Error::Setting("the frame was collected before".into()).into(),
            );
        };
        if wanted == Deliver::Levels && flight.deliver == Deliver::Shown {
            return Err(phasefront_core::runtime::error::Error::Setting(
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
                .map_err(|why| GpuError::Lost(super::device::one_line(why)))?;
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
        Ok(GpuReport {
            scale: self.encoder.scale(word(0)),
            times: slot.stamps.is_some().then(|| FrameTimes {
                colour: stage(0),
                method: stage(1),
                propagate: stage(2),
                encode: stage(3),
                ..FrameTimes::default()
            }),
        })
    }

    /// [`GpuPipeline::submit`] and [`GpuPipeline::collect`] in one.
    ///
    /// # Errors
    /// As theirs.
    ///
    /// # Panics
    /// If `levels` has not 3·H·W values.
    pub fn process(&mut self, frame: &Frame<'_>, levels: &mut [u8]) -> Result<GpuReport> {
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
