//! Runs RGB-D frames through all stages on the GPU, several in flight: the counterpart of
//! [`phasefront_core::pipeline`].

use super::device::{Device, copy_mapped};
use super::encode::{Encoder, EncoderJob, LevelsBuffers, MeanPhase};
use super::fft::{Convolution, Planes};
use super::input::{Colour, Depth, Frame, ReadBack};
use super::method::MethodPlan;
use super::{GpuError, Result};
#[cfg(not(target_arch = "wasm32"))]
use crate::device::peak::Peak;
use crate::method::chain::ChainOptions;
use phasefront_core::Size;
use phasefront_core::display::target::Target;
use phasefront_core::encode::{EncoderOptions, Encoding};
use phasefront_core::frame::Past;
use phasefront_core::method::Method;
use phasefront_core::parallel::prelude::*;
use phasefront_core::pipeline::FrameTimes;
use std::sync::Arc;
use std::time::Duration;

/// The number of frames that may be in flight at a time.
pub const FLIGHTS: usize = 3;
/// The offset of a frame's levels in its readback buffer, after the largest amplitude and the time stamps.
const LEVELS_AT: usize = 256;
const STAMPS_AT: u64 = 16;
/// The number of time stamps of a frame: one before and one after each stage.
const STAMPS: u32 = 10;
/// The stage that encodes a field, which steps of natural focus continue.
const ENCODE: u32 = 4;

/// A description of the holograms to compute.
#[derive(Clone)]
pub struct Job {
    /// The size of a frame.
    pub size: Size,
    /// The method that computes the midpoint hologram.
    pub method: Method,
    /// The display that the holograms are computed for.
    pub target: Target,
    /// The options for converting fields to levels.
    pub encoder: EncoderOptions,
    /// The format of colour images.
    pub colour: Colour,
    /// The format of depth images.
    pub depth: Depth,
    /// The options for computing a network.
    pub chain: ChainOptions,
}

impl Job {
    /// Describes frames of type [`phasefront_core::frame::RgbdFrame`] that `method` computes for `target`, with the
    /// defaults of [`phasefront_core::pipeline::Pipeline`].
    pub fn new(size: Size, method: Method, target: impl Into<Target>) -> Self {
        Job {
            size,
            method,
            target: target.into(),
            encoder: EncoderOptions::default(),
            colour: Colour::Planar,
            depth: Depth::F32,
            chain: ChainOptions::default(),
        }
    }

    /// Plans the same job on the CPU.
    ///
    /// # Errors
    /// Returns the errors of [`phasefront_core::pipeline::Pipeline::new`].
    pub fn on_cpu(&self) -> phasefront_core::runtime::error::Result<phasefront_core::pipeline::Pipeline> {
        phasefront_core::pipeline::Pipeline::new(self.size, self.method.clone(), &self.target, &self.encoder)
    }
}

/// The destination of a frame's levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deliver {
    /// The levels are copied to memory that the CPU reads.
    Levels,
    /// The levels stay on the GPU, in [`GpuPipeline::texture`] and [`GpuPipeline::levels`]. Nothing is copied.
    Shown,
}

/// A frame in flight, returned to the pipeline by [`GpuPipeline::collect`] or [`GpuPipeline::finish`].
#[derive(Debug, PartialEq, Eq)]
pub struct Ticket {
    slot: usize,
    serial: u64,
}

/// Data about a completed frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GpuReport {
    /// The amplitude that corresponds to full brightness.
    pub scale: f32,
    /// The time of each stage, if the device has time stamps.
    pub times: Option<FrameTimes>,
}

/// The levels of a frame that stay on the GPU.
pub struct GpuLevels {
    pub(crate) device: Arc<Device>,
    /// The size of a frame.
    pub(crate) size: Size,
    /// 8-bit RGBA, with the levels of red, green and blue.
    pub(crate) texture: wgpu::Texture,
}

impl GpuLevels {
    /// Returns the device and the texture, 8-bit RGBA with the levels of red, green and blue.
    pub fn texture(&self) -> (&Arc<Device>, &wgpu::Texture) {
        (&self.device, &self.texture)
    }
}

impl Drop for GpuLevels {
    fn drop(&mut self) {
        // A browser frees the memory of textures late.
        self.texture.destroy();
    }
}

/// A plan for one [`Job`] on one device. Creating the plan creates all buffers and programs.
pub struct GpuPipeline {
    device: Arc<Device>,
    size: Size,
    method: MethodPlan,
    /// Reads frames for the focal stack of steps of natural focus.
    read_back: Option<ReadBack>,
    /// Of a field that a network writes and of one that a sweep writes. Empty for an encoding that was trained on the
    /// field's unmodified phase.
    mean: [Option<MeanPhase>; 2],
    /// `None` if the modulator is at the midpoint.
    offset: Option<Convolution>,
    encoder: Encoder,
    buffers: Vec<LevelsBuffers>,
    slots: Vec<Slot>,
    serial: u64,
}

/// The resources of a frame in flight, besides its levels buffers.
struct Slot {
    /// The largest amplitude, the time stamps and the levels.
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
    /// Plans `job` on `device`. It does not check the device's results: see [`super::probe_async`].
    ///
    /// # Errors
    /// Returns the errors of [`phasefront_core::pipeline::Pipeline::new`], and [`GpuError::Refused`] or
    /// [`GpuError::OutOfMemory`] if the device cannot run the job.
    pub async fn new_async(device: &Arc<Device>, job: &Job) -> Result<Self> {
        let display = &job.target.display;
        job.method.check(display)?;
        let size = job.size;
        phasefront_core::method::network::check_size(size, phasefront_core::method::network::MAX_PIXELS)?;
        job.encoder.check()?;
        job.target.check()?;
        if display.colours() != 3 {
            return Err(GpuError::Refused(
                "a display of one laser, which is the CPU's; the GPU makes holograms of three colours".into(),
            ));
        }
        if !job.target.panel.is_plain() || job.target.registration.moves() || job.target.model.is_some() {
            return Err(GpuError::Refused(
                "a learned model, a panel's flatness, carrier, lens or range over 2π and colours that are moved, which are the CPU's"
                    .into(),
            ));
        }
        if let Encoding::Deep(network) = &job.encoder.encoding {
            network.check_prefilter(display)?;
        }
        device.guarded_async(|| Self::build(device, job, size)).await
    }

    fn build(device: &Arc<Device>, job: &Job, size: Size) -> Result<Self> {
        let (target, formats) = (&job.target, (job.colour, job.depth));
        let (display, encoder) = (&target.display, &job.encoder);
        let reads_back = encoder.focus_steps > 0;
        let method = MethodPlan::new(device, &job.method, size, display, formats, job.chain, reads_back)?;
        let of_phase = if encoder.encoding.keeps_phase() {
            None
        } else {
            Some(device.buffer("the mean phase", 24)?)
        };
        let mean = |sums: Option<(&wgpu::Buffer, usize)>| {
            let Some(((sums, parts), turn)) = sums.zip(of_phase.clone()) else {
                return Ok(None);
            };
            MeanPhase::new(device, sums, parts, turn).map(Some)
        };
        let [trained, swept] = method.sums();
        let mean = [mean(trained)?, mean(swept)?];
        // The first stage that reads the field applies the turn.
        let mut turn = of_phase.as_ref();
        // The distance from the method's plane to the modulator.
        let distance_m = display.offset_m() - method.z_m();
        let plans = target.propagators(size, 1, distance_m, target.correction.as_ref())?;
        let offset = match &plans {
            None => None,
            Some(plans) => Some(Convolution::new(
                device,
                &Planes {
                    field: method.field(),
                    size,
                    padded: plans[0].padded_size(),
                    factors: &plans.iter().map(|plan| plan.transfer().factors()).collect::<Vec<_>>(),
                    turn: turn.take(),
                },
            )?),
        };
        let buffers = (0..FLIGHTS)
            .map(|_| LevelsBuffers::new(device, size))
            .collect::<Result<Vec<_>>>()?;
        let response = target.response.clone().centred(size)?;
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
            read_back: reads_back.then(|| ReadBack::new(device, size)),
            mean,
            offset,
            encoder,
            buffers,
            slots,
            serial: 0,
        })
    }

    /// Returns the size of a frame.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Returns the device.
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// Describes the numbers, the device and the method's dispatches.
    pub fn describe(&self) -> String {
        let (numbers, device) = (self.numbers(), self.device.name());
        format!("{numbers} on {device}, {}", self.method.describe())
    }

    /// Returns the numbers that the network, or a sweep without one, is computed in: `f32`, `f16` or `int8`.
    pub fn numbers(&self) -> &'static str {
        self.method.numbers().name()
    }

    /// Measures the device's peak performance in these numbers.
    ///
    /// # Errors
    /// Returns an error if the device cannot run the measurement, or [`GpuError::Lost`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn peak(&self) -> Result<Peak> {
        crate::device::peak::measure(&self.device, self.method.numbers())
    }

    /// Returns the bytes that the method's dispatches read and write in a frame, counting each value once.
    pub fn method_bytes(&self) -> usize {
        self.method.bytes()
    }

    /// Plans the input stage again for frames in these formats. The other stages and the frames in flight stay.
    ///
    /// # Errors
    /// Returns an error if the CPU path refuses the format or the device cannot run it. The earlier formats then stay.
    pub async fn expect_async(&mut self, colour: Colour, depth: Depth) -> Result<()> {
        self.method.expect(&self.device, (colour, depth)).await
    }

    /// Submits a frame whose smoothed brightness starts from the scale in `past`. At most [`FLIGHTS`] may be in flight.
    /// Waits until the frame is read if its method or steps of natural focus depend on it, and, except in a browser,
    /// for all of these steps but the last.
    ///
    /// # Errors
    /// Returns an error if the frame's byte lengths differ from the plan, too many frames are in flight or the device
    /// is lost.
    pub async fn submit_async(&mut self, past: Option<Past>, frame: &Frame<'_>, deliver: Deliver) -> Result<Ticket> {
        let Some(slot) = self.slots.iter().position(|slot| slot.flight.is_none()) else {
            return Err(phasefront_core::runtime::error::Error::Setting(format!(
                "{FLIGHTS} frames are in flight; one must be collected first"
            ))
            .into());
        };
        let device = self.device.clone();
        let work = || {
            self.method.upload(&device, frame)?;
            self.encoder.set_past(&device, past);
            let read = self.reading(slot);
            if self.method.softness().is_some() || self.read_back.is_some() {
                return Ok((device.queue.submit([read]), true));
            }
            Ok((device.queue.submit([read, self.making(slot, deliver)]), false))
        };
        let (mut submission, is_awaited) = device.guarded_async(work).await?;
        if is_awaited {
            self.method.choose(&device, past, &submission).await?;
            self.aim(&submission).await?;
            submission = device.guarded_async(|| self.make(slot, deliver)).await?;
        }
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

    /// Lets steps of natural focus, if there are any, aim at the frame that `submission` reads.
    async fn aim(&mut self, submission: &wgpu::SubmissionIndex) -> Result<()> {
        let device = self.device.clone();
        if let (Some(read_back), Some(natural)) = (&mut self.read_back, self.encoder.natural_mut()) {
            let frame = read_back.frame(&device, submission).await?;
            let aim = || {
                natural.aim(&device, frame);
                Ok(())
            };
            device.guarded_async(aim).await?;
        }
        Ok(())
    }

    /// Submits the commands that make the hologram of the frame in slot `at`, which was read. Each step of natural
    /// focus is a submission, because drivers give up on long ones.
    fn make(&self, at: usize, deliver: Deliver) -> Result<wgpu::SubmissionIndex> {
        let queue = &self.device.queue;
        let mut submission = queue.submit([self.making(at, deliver)]);
        let Some(natural) = self.encoder.natural() else {
            return Ok(submission);
        };
        for step in 0..natural.steps() {
            let mut encoder = (self.device.inner).create_command_encoder(&Default::default());
            let is_last = step + 1 == natural.steps();
            let ends = is_last.then_some(2 * ENCODE + 1);
            self.pass(&mut encoder, at, [None, ends], |pass| {
                natural.step(step, pass);
                if is_last {
                    natural.arrive(pass, at);
                }
            });
            if is_last {
                self.deliver(&mut encoder, at, deliver);
            }
            let next = queue.submit([encoder.finish()]);
            // A wait for all steps would look like a hung device. A browser watches over its queue itself.
            #[cfg(not(target_arch = "wasm32"))]
            self.device.wait(&submission)?;
            submission = next;
        }
        Ok(submission)
    }

    /// Reads a frame without making its hologram, so that the next one has its past.
    ///
    /// # Errors
    /// Returns an error if the frame's byte lengths differ from the plan, or the device is lost.
    pub async fn read_async(&mut self, past: Option<Past>, frame: &Frame<'_>) -> Result<()> {
        let device = self.device.clone();
        let work = || {
            self.method.upload(&device, frame)?;
            Ok(device.queue.submit([self.reading(0)]))
        };
        let submission = device.guarded_async(work).await?;
        self.method.choose(&device, past, &submission).await
    }

    /// Returns whether the plane sweep alone made the last frame, without a network.
    pub fn is_swept(&self) -> bool {
        self.method.is_swept()
    }

    /// Runs `work` as stage `index` of the frame in slot `at`.
    fn stage(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        at: usize,
        index: u32,
        work: impl FnOnce(&mut wgpu::ComputePass<'_>),
    ) {
        self.pass(encoder, at, [Some(2 * index), Some(2 * index + 1)], work);
    }

    /// Runs `work` between two time stamps of the frame in slot `at`, as far as they are given.
    fn pass(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        at: usize,
        [begin, end]: [Option<u32>; 2],
        work: impl FnOnce(&mut wgpu::ComputePass<'_>),
    ) {
        let stamps = self.slots[at].stamps.as_ref();
        let stamps = stamps.filter(|_| begin.is_some() || end.is_some());
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: None,
            timestamp_writes: stamps.map(|(set, _)| wgpu::ComputePassTimestampWrites {
                query_set: set,
                beginning_of_pass_write_index: begin,
                end_of_pass_write_index: end,
            }),
        });
        work(&mut pass);
    }

    /// Returns the commands that read the frame in slot `at`, measure its depth, if the method depends on it, and read
    /// it back, if steps of natural focus do.
    fn reading(&self, at: usize) -> wgpu::CommandBuffer {
        let mut encoder = (self.device.inner).create_command_encoder(&Default::default());
        if let Some(softness) = self.method.softness() {
            softness.reset(&mut encoder);
        }
        self.stage(&mut encoder, at, 0, |pass| self.method.read(pass));
        self.stage(&mut encoder, at, 1, |pass| self.method.condition(pass));
        if let Some(softness) = self.method.softness() {
            softness.copy(&mut encoder);
        }
        if let (Some(read_back), Some(surfaces)) = (&self.read_back, self.method.surfaces()) {
            read_back.copy(&mut encoder, surfaces);
        }
        encoder.finish()
    }

    /// Returns the commands that make the hologram of the frame in slot `at`, which was read, up to the first step of
    /// natural focus if there are any.
    fn making(&self, at: usize, deliver: Deliver) -> wgpu::CommandBuffer {
        let mut encoder = (self.device.inner).create_command_encoder(&Default::default());
        self.encoder.reset(&mut encoder);
        let mean = &self.mean[usize::from(self.method.is_swept())];
        self.stage(&mut encoder, at, 2, |pass| {
            self.method.run(pass);
            if let Some(mean) = mean {
                mean.run(pass);
            }
        });
        self.stage(&mut encoder, at, 3, |pass| {
            if let Some(offset) = &self.offset {
                offset.run(pass);
            }
        });
        let is_last = self.encoder.natural().is_none();
        let stamps = [Some(2 * ENCODE), is_last.then_some(2 * ENCODE + 1)];
        self.pass(&mut encoder, at, stamps, |pass| self.encoder.run(pass, at));
        if is_last {
            self.deliver(&mut encoder, at, deliver);
        }
        encoder.finish()
    }

    /// Copies the results of the frame in slot `at` to memory that the CPU reads.
    fn deliver(&self, encoder: &mut wgpu::CommandEncoder, at: usize, deliver: Deliver) {
        let slot = &self.slots[at];
        encoder.copy_buffer_to_buffer(&self.encoder.largest, 0, &slot.readable, 0, 16);
        if let Some((set, resolved)) = &slot.stamps {
            let bytes = u64::from(STAMPS) * 8;
            encoder.resolve_query_set(set, 0..STAMPS, resolved, 0);
            encoder.copy_buffer_to_buffer(resolved, 0, &slot.readable, STAMPS_AT, bytes);
        }
        if deliver == Deliver::Levels {
            let bytes = (4 * self.size.height * self.size.width) as u64;
            let levels = &self.buffers[at].levels;
            encoder.copy_buffer_to_buffer(levels, 0, &slot.readable, LEVELS_AT as u64, bytes);
        }
    }

    /// Returns the texture that holds or will hold a frame's levels: 8-bit RGBA, with the levels of red, green and
    /// blue. It stays valid until the frame is collected or finished.
    pub fn texture(&self, ticket: &Ticket) -> &wgpu::Texture {
        &self.buffers[ticket.slot].texture
    }

    /// Returns the levels of [`GpuPipeline::texture`] as a buffer: (H, W) words, red in the lowest byte, then green,
    /// blue and 255.
    pub fn levels(&self, ticket: &Ticket) -> &wgpu::Buffer {
        &self.buffers[ticket.slot].levels
    }

    /// Copies a frame's levels to a texture that stays valid after the frame is finished.
    ///
    /// # Errors
    /// Returns [`GpuError::OutOfMemory`] or [`GpuError::Lost`].
    pub async fn keep_async(&self, ticket: &Ticket) -> Result<GpuLevels> {
        let (device, from) = (&self.device, self.texture(ticket));
        let copy = || {
            let texture = device.picture("a frame's levels", self.size, wgpu::TextureUsages::COPY_DST)?;
            let mut encoder = device.inner.create_command_encoder(&Default::default());
            encoder.copy_texture_to_texture(from.as_image_copy(), texture.as_image_copy(), from.size());
            device.queue.submit([encoder.finish()]);
            Ok(texture)
        };
        Ok(GpuLevels {
            texture: device.guarded_async(copy).await?,
            device: device.clone(),
            size: self.size,
        })
    }

    /// Waits for a frame and copies its levels, (3, H, W).
    ///
    /// # Errors
    /// Returns an error if the frame was not submitted with [`Deliver::Levels`], or [`GpuError::Lost`].
    ///
    /// # Panics
    /// Panics if `levels` does not have 3·H·W values.
    pub async fn collect_async(&mut self, ticket: Ticket, levels: &mut [u8]) -> Result<GpuReport> {
        let area = self.size.height * self.size.width;
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
        .await
    }

    /// Waits for a frame that stays on the GPU and frees its slot.
    ///
    /// # Errors
    /// Returns [`GpuError::Lost`] if the device is lost.
    pub async fn finish_async(&mut self, ticket: Ticket) -> Result<GpuReport> {
        self.take(ticket, Deliver::Shown, |_| {}).await
    }

    async fn take(&mut self, ticket: Ticket, wanted: Deliver, read: impl FnOnce(&[u8])) -> Result<GpuReport> {
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
        self.device.map(&slot.readable, &flight.submission).await?;
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
                depth: stage(1),
                method: stage(2),
                propagate: stage(3),
                encode: stage(ENCODE as usize),
            }),
        })
    }
}

impl Slot {
    fn new(device: &Device, Size { width, height }: Size) -> Self {
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
