//! Frames on the GPU, and on the CPU where the GPU does not serve and the caller wants that. A device that is lost is
//! opened again.

use super::device::{Device, DeviceOptions};
use super::input::{Colour, Depth, Frame};
use super::pipeline::{Deliver, FrameReport, Job, Pipeline, StageTimes, Ticket};
use super::probe::probe;
use super::watch::watched;
use super::{Error, Result};
use crate::brightness::{Brightness, Past, Percentile};
use crate::encode::Scale;
use crate::frame::Orientation;
use num_complex::Complex32;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How often in a row a lost device is opened again before it counts as of no use.
const ATTEMPTS: usize = 3;
/// How long opening may take, and compiling programs and trying them out: drivers in software compile slowly.
const OPENING: Duration = Duration::from_secs(30);
const TRYING: Duration = Duration::from_secs(60);
const TRYING_SOFTWARE: Duration = Duration::from_secs(600);

/// What happens where the GPU does not serve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Otherwise {
    /// The error goes to the caller.
    Error,
    /// The CPU does the work; [`Renderer::reason`] says why.
    Cpu,
}

/// Frames of one [`Job`], on a device that was found to be right.
pub struct Renderer {
    job: Job,
    options: DeviceOptions,
    otherwise: Otherwise,
    place: Place,
    reason: Option<Error>,
    /// How often a device was opened: a frame of an earlier one is lost.
    epoch: usize,
    /// Losses since the last frame that came through.
    losses: usize,
}

enum Place {
    Gpu(Box<Pipeline>),
    Cpu(Box<Cpu>),
    /// A device was lost; the next frame opens another.
    Lost,
}

struct Cpu {
    pipeline: crate::Pipeline,
    scratch: crate::pipeline::PipelineScratch,
    field: Vec<Complex32>,
    percentile: Percentile,
    done: Vec<(u64, Vec<u8>, FrameReport)>,
    serial: u64,
}

/// A frame that was handed in.
#[derive(Debug)]
pub struct Handed(Inside);

#[derive(Debug)]
enum Inside {
    Gpu { epoch: usize, ticket: Ticket },
    Cpu { serial: u64 },
}

impl Renderer {
    /// Opens a device, tries it out by [`probe`], and plans `job` on it.
    ///
    /// # Errors
    /// What the CPU refuses too; with [`Otherwise::Error`] also what only the GPU does.
    pub fn new(options: DeviceOptions, job: Job, otherwise: Otherwise) -> Result<Self> {
        Self::on(None, options, job, otherwise)
    }

    /// [`Renderer::new`] on a `device` that is open, where there is one; `options` say which is opened should it be lost.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn on(
        device: Option<Arc<Device>>,
        options: DeviceOptions,
        job: Job,
        otherwise: Otherwise,
    ) -> Result<Self> {
        let mut renderer = Renderer {
            job,
            options,
            otherwise,
            place: Place::Lost,
            reason: None,
            epoch: 0,
            losses: 0,
        };
        renderer.open(device.filter(|device| device.check().is_ok()))?;
        Ok(renderer)
    }

    /// Why frames are made on the CPU; the last loss of a device where they are not.
    pub fn reason(&self) -> Option<&Error> {
        self.reason.as_ref()
    }

    /// The GPU's plan; none where the CPU does the work.
    pub fn pipeline(&self) -> Option<&Pipeline> {
        match &self.place {
            Place::Gpu(pipeline) => Some(pipeline),
            _ => None,
        }
    }

    /// How often a device was opened.
    pub(crate) fn openings(&self) -> usize {
        self.epoch
    }

    /// Gives the device's memory back, and what is on it up; the next frame opens one again.
    pub(crate) fn let_go(&mut self) {
        self.place = Place::Lost;
    }

    /// Opens a device unless one is given, or turns to the CPU.
    fn open(&mut self, device: Option<Arc<Device>>) -> Result<()> {
        self.epoch += 1;
        let opened = match (self.losses < ATTEMPTS, &self.reason) {
            (true, _) => trusted(device, &self.options, &self.job),
            (false, Some(last)) => Err(Error::Lost(format!("{ATTEMPTS} times in a row: {last}"))),
            (false, None) => Err(Error::Lost(format!("{ATTEMPTS} times in a row"))),
        };
        match opened {
            Ok(pipeline) => self.place = Place::Gpu(Box::new(pipeline)),
            Err(why @ Error::Core(_)) => return Err(why),
            Err(why) => {
                self.reason = Some(why.clone());
                if self.otherwise == Otherwise::Error {
                    return Err(why);
                }
                self.place = Place::Cpu(Box::new(Cpu::new(&self.job)?));
            }
        }
        Ok(())
    }

    /// Frames come so from now on, as [`Pipeline::expect`].
    ///
    /// # Errors
    /// As that.
    pub fn expect(&mut self, colour: Colour, depth: Depth) -> Result<()> {
        if let Place::Gpu(pipeline) = &mut self.place {
            match pipeline.expect(colour, depth) {
                // The next frame finds out, and opens another device for these formats.
                Ok(()) | Err(Error::Lost(_)) => {}
                Err(why) => return Err(why),
            }
        }
        (self.job.colour, self.job.depth) = (colour, depth);
        Ok(())
    }

    /// Hands a frame in, in the formats of the job. On the GPU [`super::FLIGHTS`] may be on their way.
    ///
    /// # Errors
    /// Bytes of another length than planned, or what [`Renderer::new`] refuses where a device was lost before.
    pub fn submit(&mut self, frame: &Frame<'_>) -> Result<Handed> {
        self.submit_after(None, frame)
    }

    /// [`Renderer::submit`] for steady brightness, whose scale comes from `past`.
    ///
    /// # Errors
    /// As [`Renderer::submit`].
    pub fn submit_after(&mut self, past: Option<Past>, frame: &Frame<'_>) -> Result<Handed> {
        loop {
            match &mut self.place {
                Place::Gpu(pipeline) => match pipeline.submit_after(past, frame, Deliver::Levels) {
                    Ok(ticket) => {
                        let epoch = self.epoch;
                        return Ok(Handed(Inside::Gpu { epoch, ticket }));
                    }
                    Err(why) => self.note(why)?,
                },
                Place::Cpu(cpu) => return cpu.process(past, frame, &self.job),
                Place::Lost => self.open(None)?,
            }
        }
    }

    /// Waits for a frame and copies its levels, (3, H, W).
    ///
    /// # Errors
    /// [`Error::Lost`] for a frame that went with its device; the next one goes on.
    ///
    /// # Panics
    /// If `levels` has not 3·H·W values.
    pub fn collect(&mut self, frame: Handed, levels: &mut [u8]) -> Result<FrameReport> {
        match (frame.0, &mut self.place) {
            (Inside::Gpu { epoch, ticket }, Place::Gpu(pipeline)) if epoch == self.epoch => {
                match pipeline.collect(ticket, levels) {
                    Ok(report) => {
                        self.losses = 0;
                        Ok(report)
                    }
                    Err(why) => {
                        self.note(why.clone())?;
                        Err(why)
                    }
                }
            }
            (Inside::Cpu { serial }, Place::Cpu(cpu)) => cpu.collect(serial, levels),
            _ => Err(Error::Lost("with the device that it was on".into())),
        }
    }

    /// Keeps the reason of a loss, after which the next frame opens another device; gives back other errors.
    fn note(&mut self, why: Error) -> Result<()> {
        match why {
            Error::Core(_) => Err(why),
            why => {
                self.place = Place::Lost;
                self.reason = Some(why);
                self.losses += 1;
                Ok(())
            }
        }
    }
}

/// Plans `job` on `device`, or on one that is opened, if it answers, and as the CPU does.
fn trusted(device: Option<Arc<Device>>, options: &DeviceOptions, job: &Job) -> Result<Pipeline> {
    let device = match device {
        Some(device) => device,
        None => {
            let options = options.clone();
            let open = move || Device::open(&options).map(Arc::new);
            watched("while it was opened", OPENING, open)?
        }
    };
    let patience = match device.is_software() {
        true => TRYING_SOFTWARE,
        false => TRYING,
    };
    let job = job.clone();
    watched("while it was tried out", patience, move || {
        probe(&device, &job)?;
        Pipeline::new(&device, &job)
    })
}

impl Cpu {
    fn new(job: &Job) -> Result<Self> {
        let pipeline = job.on_cpu()?;
        Ok(Cpu {
            scratch: pipeline.scratch(),
            pipeline,
            field: vec![Complex32::ZERO; 3 * job.height * job.width],
            percentile: Percentile::new(),
            done: Vec::new(),
            serial: 0,
        })
    }

    fn process(&mut self, past: Option<Past>, frame: &Frame<'_>, job: &Job) -> Result<Handed> {
        let orientation = match job.colour {
            Colour::Camera { orientation, .. } => orientation,
            Colour::Planar => Orientation::default(),
        };
        let frame = frame.read(orientation, job.height, job.width)?;
        let mut levels = vec![0; self.field.len()];
        let (field, scratch) = (&mut self.field, &mut self.scratch);
        let (method, propagate) = self.pipeline.field(&frame, field, scratch)?;
        let start = Instant::now();
        let scale = match job.brightness {
            Brightness::FrameMax => Scale::Max,
            Brightness::Fixed(scale) => Scale::Fixed(scale),
            Brightness::Steady => Scale::Fixed(self.percentile.scale(field, past)),
        };
        let made = self
            .pipeline
            .modulate_at(field, scale, &mut levels, scratch);
        self.serial += 1;
        let report = FrameReport {
            scale: made.scale,
            times: Some(StageTimes {
                input: Duration::ZERO,
                method,
                propagate,
                encode: start.elapsed(),
            }),
        };
        self.done.push((self.serial, levels, report));
        Ok(Handed(Inside::Cpu {
            serial: self.serial,
        }))
    }

    fn collect(&mut self, serial: u64, levels: &mut [u8]) -> Result<FrameReport> {
        let at = self.done.iter().position(|(done, ..)| *done == serial);
        let Some(at) = at else {
            return Err(crate::Error::Plan("the frame was collected before".into()).into());
        };
        let (_, made, report) = self.done.swap_remove(at);
        levels.copy_from_slice(&made);
        Ok(report)
    }
}

#[cfg(test)]
impl Renderer {
    /// Takes the device away, as drivers do.
    pub(crate) fn lose(&self) {
        if let Place::Gpu(pipeline) = &self.place {
            pipeline.device().wgpu().0.destroy();
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::device::Allowed;
    use super::super::device::testing::software;
    use super::super::{ChainOptions, Float};
    use super::*;
    use crate::encode::{Encoding, Scale};
    use crate::slm::Response;
    use crate::{Display, Method, Network, RgbdFrame};
    use ndarray::{Array2, Array3};

    const SIZE: (usize, usize) = (21, 34);

    fn network() -> Arc<Network> {
        let bytes = include_bytes!("../../../models/rgbd-8-int8.onnx");
        Arc::new(Network::from_onnx(bytes).unwrap())
    }

    fn job(network: &Arc<Network>) -> Job {
        let display = Display::default();
        let response = Response::linear(8).unwrap();
        let (encoding, scale) = (Encoding::ANTI_ALIAS, Scale::Fixed(1.0));
        let method = Method::Network(network.clone());
        Job::new(SIZE.0, SIZE.1, method, &display, encoding, scale, response)
    }

    fn frame() -> RgbdFrame {
        let rgb = Array3::from_shape_fn((3, SIZE.0, SIZE.1), |(c, y, x)| {
            ((c * 5 + y * 3 + x) % 17) as f32 / 16.0
        });
        RgbdFrame::new(rgb, Array2::from_elem(SIZE, 0.3)).unwrap()
    }

    #[test]
    fn a_lost_device_costs_the_frames_in_flight_and_no_more() {
        let network = network();
        let Ok(mut renderer) = Renderer::new(software(), job(&network), Otherwise::Error) else {
            println!("skipped: no driver in software (mesa-vulkan-drivers)");
            return;
        };
        assert!(renderer.reason().is_none() && renderer.pipeline().is_some());
        let frame = frame();
        let bytes = Frame::of(&frame);
        let mut before = vec![0; 3 * SIZE.0 * SIZE.1];
        let handed = renderer.submit(&bytes).unwrap();
        renderer.collect(handed, &mut before).unwrap();

        let flying = [
            renderer.submit(&bytes).unwrap(),
            renderer.submit(&bytes).unwrap(),
        ];
        renderer.lose();
        let mut levels = vec![0; before.len()];
        for handed in flying {
            let lost = renderer.collect(handed, &mut levels).unwrap_err();
            assert!(matches!(lost, Error::Lost(_)), "{lost}");
        }
        let handed = renderer.submit(&bytes).unwrap();
        renderer.collect(handed, &mut levels).unwrap();
        assert_eq!(levels, before);
        assert!(matches!(renderer.reason(), Some(Error::Lost(_))));

        // Lost with nothing in flight: the next frame finds out, and goes on.
        renderer.lose();
        let handed = renderer.submit(&bytes).unwrap();
        renderer.collect(handed, &mut levels).unwrap();
        assert_eq!(levels, before);
    }

    #[test]
    fn without_a_gpu_the_caller_chooses() {
        let network = network();
        let none = DeviceOptions {
            name: Some("no such card".into()),
            programs: None,
        };
        let refused = Renderer::new(none.clone(), job(&network), Otherwise::Error)
            .err()
            .unwrap();
        assert!(matches!(refused, Error::None(_)), "{refused}");
        let mut renderer = Renderer::new(none.clone(), job(&network), Otherwise::Cpu).unwrap();
        assert!(matches!(renderer.reason(), Some(Error::None(_))));
        let frame = frame();
        let bytes = Frame::of(&frame);
        let handed = [
            renderer.submit(&bytes).unwrap(),
            renderer.submit(&bytes).unwrap(),
        ];
        let mut levels = vec![0; 3 * SIZE.0 * SIZE.1];
        for handed in handed {
            renderer.collect(handed, &mut levels).unwrap();
        }
        assert!(levels.iter().any(|&level| level != 0));
        // What the CPU refuses too is refused.
        let empty = Job {
            width: 0,
            ..job(&network)
        };
        assert!(Renderer::new(none, empty, Otherwise::Cpu).is_err());
    }

    #[test]
    fn what_a_gpu_lacks_goes_to_the_cpu_or_to_the_caller() {
        let little = Allowed {
            features: wgpu::Features::empty(),
            limits: |limits| wgpu::Limits {
                max_storage_buffer_binding_size: 1 << 24,
                ..limits
            },
            ..Default::default()
        };
        let Ok(device) = Device::open_with(&software(), &little) else {
            println!("skipped: no driver in software (mesa-vulkan-drivers)");
            return;
        };
        let device = Arc::new(device);
        let bytes = include_bytes!("../../../models/rgbd-8.onnx");
        let network = Arc::new(Network::from_onnx(bytes).unwrap());
        let halves = ChainOptions {
            float: Float::F16,
            ..Default::default()
        };
        let wanted = Job {
            chain: halves,
            ..job(&network)
        };
        let refused = Pipeline::new(&device, &wanted).err().unwrap();
        assert!(refused.to_string().contains("shader-f16"), "{refused}");
        assert_eq!(
            Pipeline::new(&device, &job(&network)).unwrap().numbers(),
            "f32"
        );
        let wide = Job {
            width: 40_000,
            height: 600,
            ..job(&network)
        };
        let refused = Pipeline::new(&device, &wide).err().unwrap();
        assert!(matches!(refused, Error::Refused(_)), "{refused}");
        // Frames that fit no device fit the CPU; a smaller one stands for them here.
        let mut renderer = Renderer::new(software(), job(&network), Otherwise::Cpu).unwrap();
        renderer.losses = ATTEMPTS;
        renderer.reason = Some(Error::Lost("pulled out".into()));
        renderer.place = Place::Lost;
        let frame = frame();
        let handed = renderer.submit(&Frame::of(&frame)).unwrap();
        let mut levels = vec![0; 3 * SIZE.0 * SIZE.1];
        renderer.collect(handed, &mut levels).unwrap();
        assert!(renderer.pipeline().is_none());
        let reason = renderer.reason().unwrap().to_string();
        assert!(
            reason.contains("in a row: the GPU was lost: pulled out"),
            "{reason}"
        );
    }
}
