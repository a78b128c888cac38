//! Renders frames on a GPU that passed [`probe_async`] and reopens a device that is lost. The session decides what
//! happens to a frame if no device is available.

use super::device::{Device, DeviceOptions};
use super::input::{Colour, Depth, Frame};
use super::pipeline::{Deliver, GpuLevels, GpuPipeline, GpuReport, Job, Ticket};
use super::probe::probe_async;
use super::watch::watched;
use super::{GpuError, Result};
use phasefront_core::frame::Past;
use std::sync::Arc;
use std::time::Duration;

/// The number of consecutive losses of a device after which it is not reopened.
const ATTEMPTS: usize = 3;
/// The time limits for opening a device and for compiling and checking its programs. Software drivers compile slowly.
const OPENING: Duration = Duration::from_secs(30);
const TRYING: Duration = Duration::from_secs(60);
const TRYING_SOFTWARE: Duration = Duration::from_secs(600);

/// Renders the frames of one [`Job`].
pub struct Renderer {
    job: Job,
    options: DeviceOptions,
    /// `None` after a device was lost: the next frame opens another.
    pipeline: Option<Box<GpuPipeline>>,
    /// The latest loss or failure to open.
    reason: Option<GpuError>,
    /// The number of times a device was opened. Frames of an earlier epoch are lost.
    epoch: usize,
    /// The number of losses since the last completed frame.
    losses: usize,
}

/// A frame in flight.
#[derive(Debug)]
pub struct InFlight {
    epoch: usize,
    ticket: Ticket,
}

impl Renderer {
    /// Plans `job` on `device`, or on a device opened with `options`, and checks the plan with [`probe_async`].
    ///
    /// # Errors
    /// Returns an error if the CPU path refuses the job or the GPU cannot be used.
    pub async fn new(device: Option<Arc<Device>>, options: DeviceOptions, job: Job) -> Result<Self> {
        let mut renderer = Renderer {
            job,
            options,
            pipeline: None,
            reason: None,
            epoch: 0,
            losses: 0,
        };
        renderer.open(device.filter(|device| device.check().is_ok())).await?;
        Ok(renderer)
    }

    /// Returns why a device was lost, if one was.
    pub fn reason(&self) -> Option<&GpuError> {
        self.reason.as_ref()
    }

    /// Returns the GPU's plan, or `None` after its device was lost.
    pub fn pipeline(&self) -> Option<&GpuPipeline> {
        self.pipeline.as_deref()
    }

    /// Returns the number of times a device was opened.
    pub fn openings(&self) -> usize {
        self.epoch
    }

    /// Frees the device's memory and drops the frames on it. The next frame opens a device again.
    pub fn release(&mut self) {
        self.pipeline = None;
    }

    /// Opens a device unless one is given.
    async fn open(&mut self, device: Option<Arc<Device>>) -> Result<&mut GpuPipeline> {
        self.epoch += 1;
        let opened = match (self.losses < ATTEMPTS, &self.reason) {
            (true, _) => trusted(device, &self.options, &self.job).await,
            (false, Some(last)) => Err(GpuError::Lost(format!("{ATTEMPTS} times in a row: {last}"))),
            (false, None) => Err(GpuError::Lost(format!("{ATTEMPTS} times in a row"))),
        };
        match opened {
            Ok(pipeline) => Ok(self.pipeline.insert(Box::new(pipeline))),
            Err(why @ GpuError::Core(_)) => Err(why),
            Err(why) => {
                self.reason = Some(why.clone());
                Err(why)
            }
        }
    }

    /// Plans the input stage again for frames in these formats, as [`GpuPipeline::expect_async`] does.
    ///
    /// # Errors
    /// Returns the errors of [`GpuPipeline::expect_async`] except a loss.
    pub async fn expect(&mut self, colour: Colour, depth: Depth) -> Result<()> {
        if let Some(pipeline) = &mut self.pipeline {
            match pipeline.expect_async(colour, depth).await {
                // The next frame notices the loss and opens another device for these formats.
                Ok(()) | Err(GpuError::Lost(_)) => {}
                Err(why) => return Err(why),
            }
        }
        (self.job.colour, self.job.depth) = (colour, depth);
        Ok(())
    }

    /// Submits a frame in the formats of the job. Smoothed brightness starts from `past`. At most [`super::FLIGHTS`]
    /// frames may be in flight.
    ///
    /// # Errors
    /// Returns an error if the frame's byte lengths differ from the plan, or, after a loss, the errors of
    /// [`Renderer::new`].
    pub async fn submit(&mut self, past: Option<Past>, frame: &Frame<'_>, deliver: Deliver) -> Result<InFlight> {
        loop {
            let pipeline = match &mut self.pipeline {
                Some(pipeline) => pipeline,
                None => self.open(None).await?,
            };
            match pipeline.submit_async(past, frame, deliver).await {
                Ok(ticket) => {
                    let epoch = self.epoch;
                    return Ok(InFlight { epoch, ticket });
                }
                Err(why) => self.note(why)?,
            }
        }
    }

    /// Reads a frame without making its hologram, as [`GpuPipeline::read_async`] does.
    ///
    /// # Errors
    /// Returns the errors of [`Renderer::submit`].
    pub async fn read(&mut self, past: Option<Past>, frame: &Frame<'_>) -> Result<()> {
        loop {
            let pipeline = match &mut self.pipeline {
                Some(pipeline) => pipeline,
                None => self.open(None).await?,
            };
            match pipeline.read_async(past, frame).await {
                Ok(()) => return Ok(()),
                Err(why) => self.note(why)?,
            }
        }
    }

    /// Waits for a frame and copies its levels, (3, H, W).
    ///
    /// # Errors
    /// Returns [`GpuError::Lost`] if the frame was lost with its device. The next frame opens another.
    ///
    /// # Panics
    /// Panics if `levels` does not have 3·H·W values.
    pub async fn collect(&mut self, frame: InFlight, levels: &mut [u8]) -> Result<GpuReport> {
        let made = self.flown_on(&frame)?.collect_async(frame.ticket, levels).await;
        self.noted(made)
    }

    /// Waits for a frame that was submitted as [`Deliver::Shown`] and copies its levels on the GPU.
    ///
    /// # Errors
    /// Returns the errors of [`Renderer::collect`].
    pub async fn keep(&mut self, frame: InFlight) -> Result<(GpuReport, GpuLevels)> {
        let pipeline = self.flown_on(&frame)?;
        let kept = async {
            let levels = pipeline.keep_async(&frame.ticket).await?;
            Ok((pipeline.finish_async(frame.ticket).await?, levels))
        };
        let kept = kept.await;
        self.noted(kept)
    }

    /// Returns the plan that a frame was submitted to.
    fn flown_on(&mut self, frame: &InFlight) -> Result<&mut GpuPipeline> {
        let pipeline = self.pipeline.as_deref_mut().filter(|_| frame.epoch == self.epoch);
        pipeline.ok_or_else(|| GpuError::Lost("with the device that it was on".into()))
    }

    /// Records whether the device answered.
    fn noted<T>(&mut self, answer: Result<T>) -> Result<T> {
        match &answer {
            Ok(_) => self.losses = 0,
            Err(why) => self.note(why.clone())?,
        }
        answer
    }

    /// Records a loss, after which the next frame opens another device. Returns any other error.
    fn note(&mut self, why: GpuError) -> Result<()> {
        match why {
            GpuError::Core(_) => Err(why),
            why => {
                self.pipeline = None;
                self.reason = Some(why);
                self.losses += 1;
                Ok(())
            }
        }
    }
}

/// Plans `job` on `device`, or on a newly opened one, and returns the plan if the device responds and agrees with the
/// CPU.
async fn trusted(device: Option<Arc<Device>>, options: &DeviceOptions, job: &Job) -> Result<GpuPipeline> {
    let device = match device {
        Some(device) => device,
        None => {
            let options = options.clone();
            let open = async move || Device::open_async(&options).await.map(Arc::new);
            watched("while it was opened", OPENING, open).await?
        }
    };
    let patience = if device.is_software() { TRYING_SOFTWARE } else { TRYING };
    let job = job.clone();
    watched("while it was tried out", patience, async move || {
        probe_async(&device, &job).await?;
        GpuPipeline::new_async(&device, &job).await
    })
    .await
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::device::Allowed;
    use super::super::device::testing::{opened, software};
    use super::super::{ChainOptions, Float};
    use super::*;
    use ndarray::{Array2, Array3};
    use phasefront_core::Size;
    use phasefront_core::display::Display;
    use phasefront_core::encode::brightness::Brightness;
    use phasefront_core::frame::RgbdFrame;
    use phasefront_core::method::Method;
    use phasefront_core::method::network::Network;
    use pollster::block_on;

    const SIZE: Size = Size { width: 34, height: 21 };

    fn network() -> Arc<Network> {
        let bytes = include_bytes!("../../../models/rgbd-8-int8.onnx");
        Arc::new(Network::from_onnx(bytes).unwrap())
    }

    fn job(network: &Arc<Network>) -> Job {
        let mut job = Job::new(SIZE, Method::Network(network.clone()), Display::default());
        job.encoder.brightness = Brightness::Fixed(1.0);
        job
    }

    fn frame() -> RgbdFrame {
        let rgb = Array3::from_shape_fn((3, SIZE.height, SIZE.width), |(c, y, x)| {
            ((c * 5 + y * 3 + x) % 17) as f32 / 16.0
        });
        RgbdFrame::new(rgb, Array2::from_elem(SIZE.shape(), 0.3)).unwrap()
    }

    /// Destroys the device, as drivers do.
    fn lose(renderer: &Renderer) {
        renderer.pipeline().unwrap().device().wgpu().0.destroy();
    }

    #[test]
    fn a_lost_device_costs_the_frames_in_flight_and_no_more() {
        let mut renderer = opened(block_on(Renderer::new(None, software(), job(&network()))));
        assert!(renderer.reason().is_none() && renderer.pipeline().is_some());
        let frame = frame();
        let bytes = Frame::of(&frame);
        let mut before = vec![0; 3 * SIZE.pixels()];
        let first = block_on(renderer.submit(None, &bytes, Deliver::Levels)).unwrap();
        block_on(renderer.collect(first, &mut before)).unwrap();

        let flying = [
            block_on(renderer.submit(None, &bytes, Deliver::Levels)).unwrap(),
            block_on(renderer.submit(None, &bytes, Deliver::Levels)).unwrap(),
        ];
        lose(&renderer);
        let mut levels = vec![0; before.len()];
        for frame in flying {
            let lost = block_on(renderer.collect(frame, &mut levels)).unwrap_err();
            assert!(matches!(lost, GpuError::Lost(_)), "{lost}");
        }
        let next = block_on(renderer.submit(None, &bytes, Deliver::Levels)).unwrap();
        block_on(renderer.collect(next, &mut levels)).unwrap();
        assert_eq!(levels, before);
        assert!(matches!(renderer.reason(), Some(GpuError::Lost(_))));

        // The device is lost with nothing in flight: the next frame notices and succeeds on a new device.
        lose(&renderer);
        let next = block_on(renderer.submit(None, &bytes, Deliver::Levels)).unwrap();
        block_on(renderer.collect(next, &mut levels)).unwrap();
        assert_eq!(levels, before);
    }

    #[test]
    fn a_gpu_that_is_not_there_is_told() {
        let none = DeviceOptions {
            name: Some("no such card".into()),
            programs: None,
        };
        let refused = block_on(Renderer::new(None, none, job(&network()))).err().unwrap();
        assert!(matches!(refused, GpuError::None(_)), "{refused}");
    }

    #[test]
    fn a_device_that_is_lost_again_and_again_is_of_no_use() {
        let mut renderer = opened(block_on(Renderer::new(None, software(), job(&network()))));
        renderer.losses = ATTEMPTS;
        renderer.reason = Some(GpuError::Lost("pulled out".into()));
        renderer.release();
        let frame = frame();
        let refused = block_on(renderer.submit(None, &Frame::of(&frame), Deliver::Levels)).unwrap_err();
        assert!(
            (refused.to_string()).contains("in a row: the GPU was lost: pulled out"),
            "{refused}"
        );
    }

    #[test]
    fn what_a_gpu_lacks_is_told() {
        let little = Allowed {
            features: wgpu::Features::empty(),
            limits: |limits| wgpu::Limits {
                max_storage_buffer_binding_size: 1 << 24,
                ..limits
            },
            ..Default::default()
        };
        let device = opened(Device::open_with(&software(), &little));
        let device = Arc::new(device);
        let bytes = include_bytes!("../../../models/rgbd-8.onnx");
        let network = Arc::new(Network::from_onnx(bytes).unwrap());
        let wanted = Job {
            chain: ChainOptions {
                float: Float::F16,
                ..Default::default()
            },
            ..job(&network)
        };
        let refused = GpuPipeline::new(&device, &wanted).err().unwrap();
        assert!(refused.to_string().contains("shader-f16"), "{refused}");
        let plan = GpuPipeline::new(&device, &job(&network)).unwrap();
        assert_eq!(plan.numbers(), "f32");
        let wide = Job {
            size: Size {
                width: 40_000,
                height: 600,
            },
            ..job(&network)
        };
        let refused = GpuPipeline::new(&device, &wide).err().unwrap();
        assert!(matches!(refused, GpuError::Refused(_)), "{refused}");
    }
}
