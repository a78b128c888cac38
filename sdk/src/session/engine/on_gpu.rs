//! Computes a quality level on the GPU, from the camera's colour and conditioned readings of depth to levels.

use crate::session::engine::frame_input::FrameInput;
use crate::session::options::SessionOptions;
use crate::session::quality::QualityLevel;
use crate::session::statistics::BackendReport;
use phasefront_core::display::Display;
use phasefront_core::frame::LightConstants;
use phasefront_core::pipeline::{FrameReport, FrameTimes};
use phasefront_core::runtime::error::Error;
use phasefront_core::runtime::stage::{Stage, stage};
use phasefront_gpu::{
    Colour, ColourData, Deliver, Depth, DepthData, Device, Frame, GpuError, GpuLevels, GpuReport, InFlight, Job,
    Renderer,
};
use std::sync::Arc;

/// The reason why a frame produced no result.
#[derive(Debug)]
pub(in crate::session) enum Failure {
    /// The frame is lost or invalid; the session continues with the next one.
    Frame(Error),
    /// The GPU cannot be used for this quality level.
    Gpu(GpuError),
}

impl From<GpuError> for Failure {
    fn from(why: GpuError) -> Self {
        match why {
            GpuError::Core(why) => Failure::Frame(why),
            why => Failure::Gpu(why),
        }
    }
}

/// The plans and memory of a quality level on the GPU.
pub(in crate::session) struct OnGpu(Renderer, Display);

impl OnGpu {
    /// Plans `quality_level` on `device`; without one, opens a device and tests it.
    pub(in crate::session) async fn new(
        options: &SessionOptions,
        quality_level: &QualityLevel,
        device: Option<Arc<Device>>,
    ) -> Result<Self, GpuError> {
        if options.target.display.bits() > 8 {
            return Err(GpuError::Refused(format!(
                "it writes levels of up to 8 bits, the display has {}",
                options.target.display.bits()
            )));
        }
        let size = quality_level.size;
        let job = Job {
            encoder: quality_level.encoder(&options.encoder).clone(),
            chain: options.gpu.chain,
            ..Job::new(size, quality_level.method.clone(), options.target.clone())
        };
        let renderer = Renderer::new(device, options.gpu.device.clone(), job).await?;
        Ok(OnGpu(renderer, options.target.display.clone()))
    }

    pub(in crate::session) fn device(&self) -> Option<&Arc<Device>> {
        self.0.pipeline().map(|pipeline| pipeline.device())
    }

    pub(in crate::session) fn report(&self) -> BackendReport {
        let Some(pipeline) = self.0.pipeline() else {
            return BackendReport {
                name: "no GPU at this moment".into(),
                why: self.0.reason().map_or_else(String::new, GpuError::to_string),
            };
        };
        let mut why = format!("asked for, and it answers as the CPU does; {}", pipeline.describe());
        if let Some(reason) = self.0.reason() {
            why += &format!("; opened again after: {reason}");
        }
        BackendReport {
            name: pipeline.device().name(),
            why,
        }
    }

    /// Returns how often a device was opened.
    pub(in crate::session) fn openings(&self) -> usize {
        self.0.openings()
    }

    /// Frees the GPU's memory.
    pub(in crate::session) fn release(&mut self) {
        self.0.release();
    }

    /// Computes the levels of a frame. If the frame comes from a camera, reads the camera's colour directly. The levels
    /// are copied to `levels`, or returned if `stay` says that they stay on the GPU.
    pub(in crate::session) async fn process(
        &mut self,
        input: &FrameInput<'_>,
        levels: &mut [u8],
        stay: bool,
    ) -> Result<(FrameReport, Option<GpuLevels>), Failure> {
        let stage = stage!("gpu");
        let deliver = if stay { Deliver::Shown } else { Deliver::Levels };
        let frame = self.submit(input, deliver).await?;
        let made = match deliver {
            Deliver::Levels => self.0.collect(frame, levels).await.map(|report| (report, None)),
            Deliver::Shown => self.0.keep(frame).await.map(|(report, kept)| (report, Some(kept))),
        };
        let (report, kept) = made.map_err(Failure::of_flight)?;
        Ok((frame_report(report, stage), kept))
    }

    async fn submit(&mut self, input: &FrameInput<'_>, deliver: Deliver) -> Result<InFlight, Failure> {
        let (colour, depth, frame) = self.frame(input);
        self.0.expect(colour, depth).await?;
        Ok(self.0.submit(input.past, &frame, deliver).await?)
    }

    /// Reads a frame without computing its levels, so that the next one has its past.
    pub(in crate::session) async fn read(&mut self, input: &FrameInput<'_>) -> Result<(), Failure> {
        let (colour, depth, frame) = self.frame(input);
        self.0.expect(colour, depth).await?;
        Ok(self.0.read(input.past, &frame).await?)
    }

    /// Returns the formats of a frame, and the frame. The camera's colour is read directly.
    fn frame<'a>(&self, input: &'a FrameInput<'_>) -> (Colour, Depth, Frame<'a>) {
        let mut frame = Frame::of(input.frame);
        let colour = match input.camera {
            None => Colour::Planar,
            Some(camera) => {
                frame.colour = ColourData::Camera(camera.colour);
                Colour::Camera {
                    format: camera.colour.format(),
                    size: camera.colour.size(),
                    orientation: camera.orientation,
                    light: LightConstants::new(camera.colour.encoding(), &self.1),
                }
            }
        };
        let depth = match &input.undecided {
            None => Depth::F32,
            Some(stream) => {
                let readings = stream.readings();
                let size = readings.size();
                frame.depth = DepthData::Readings(readings);
                Depth::Readings(size)
            }
        };
        (colour, depth, frame)
    }
}

impl Failure {
    /// Returns what became of a frame in flight.
    fn of_flight(why: GpuError) -> Self {
        match why {
            GpuError::Core(why) => Failure::Frame(why),
            why => Failure::Frame(Error::Lost(format!("{why}, and this frame with it"))),
        }
    }
}

fn frame_report(report: GpuReport, stage: Stage) -> FrameReport {
    let times = report.times.unwrap_or_default();
    FrameReport {
        scale: report.scale,
        times: FrameTimes {
            // Includes the transfers to and from the GPU, and all stages if there are no time stamps.
            method: (stage.end()).saturating_sub(times.depth + times.propagate + times.encode),
            depth: times.depth,
            propagate: times.propagate,
            encode: times.encode,
            ..FrameTimes::default()
        },
    }
}

#[cfg(test)]
#[path = "../../../../tests/driver.rs"]
mod driver;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::driver::{opened, software};
    use super::*;
    use crate::session::threads::block_on;
    use ndarray::{Array2, Array3};
    use phasefront_core::frame::Past;
    use phasefront_core::frame::RgbdFrame;
    use phasefront_core::method::Method;
    use phasefront_core::method::network::Network;
    use std::time::Duration;

    /// A device that is lost loses only the frame in flight.
    #[test]
    fn a_frame_in_flight_is_lost_with_its_device_and_the_next_goes_on() {
        let network = Network::from_onnx(include_bytes!("../../../../models/rgbd-8-int8.onnx"));
        let method = Method::Network(Arc::new(network.unwrap()));
        let display = Display::from_toml("width = 34\nheight = 21").unwrap();
        let mut options = SessionOptions::new(display, method);
        options.gpu.device.name = Some(software());
        let mut gpu = opened(block_on(OnGpu::new(&options, &options.quality_levels[0], None)));
        let rgb = Array3::from_shape_fn((3, 21, 34), |(c, y, x)| ((c + y + x) % 9) as f32 / 8.0);
        let mut frame = RgbdFrame::new(rgb, Array2::from_elem((21, 34), 0.4)).unwrap();
        let mut first = vec![0; 3 * 21 * 34];
        let mut input = FrameInput {
            camera: None,
            frame: &mut frame,
            undecided: None,
            past: None,
        };
        let made = block_on(gpu.process(&input, &mut first, false));
        let scale = made.unwrap().0.scale;
        let elapsed = Duration::from_millis(33);
        input.past = Some(Past { scale, elapsed });
        let flying = block_on(gpu.submit(&input, Deliver::Levels)).unwrap();
        let before = gpu.openings();
        gpu.device().unwrap().wgpu().0.destroy();
        let mut levels = vec![0; first.len()];
        let lost = block_on(gpu.0.collect(flying, &mut levels)).map_err(Failure::of_flight);
        assert!(
            matches!(&lost, Err(Failure::Frame(Error::Lost(why))) if !why.contains('\n')),
            "{:?}",
            lost.err()
        );
        assert_eq!(gpu.report().name, "no GPU at this moment");
        let made = block_on(gpu.process(&input, &mut levels, false));
        // The scene is the same, so its scale and levels are too.
        assert!((made.unwrap().0.scale - scale).abs() < 1e-6);
        assert_eq!(levels, first);
        assert_eq!(gpu.openings(), before + 1);
        assert!(gpu.report().why.contains("opened again"));
    }
}
