//! A rung of the ladder on the GPU: from a camera's colour and refined depth to levels.

use super::SessionOptions;
use super::brightness::BrightnessTracker;
use super::engine::{Encoded, Ready};
use super::quality::Rung;
use super::statistics::BackendReport;
use crate::error::Error;
use crate::gpu::{
    self, ChainOptions, Colour, ColourData, Depth, Device, DeviceOptions, Frame, Handed, Job,
    Otherwise, Renderer,
};
use std::sync::Arc;
use std::time::Instant;

/// Which GPU a session computes on, and how.
#[derive(Debug, Clone, Default)]
pub struct GpuOptions {
    /// Which one, and what was compiled for it on an earlier run.
    pub device: DeviceOptions,
    /// How networks are computed: f32 networks in 16 bits where the GPU has them, if nothing else is said.
    pub chain: ChainOptions,
}

/// A frame that came to nothing.
#[derive(Debug)]
pub(super) enum Failure {
    /// It is lost or wrong; the next one goes on.
    Frame(Error),
    /// The GPU is of no use for this rung.
    Gpu(gpu::Error),
}

impl From<gpu::Error> for Failure {
    fn from(why: gpu::Error) -> Self {
        match why {
            gpu::Error::Core(why) => Failure::Frame(why),
            why => Failure::Gpu(why),
        }
    }
}

/// Plans and memory.
pub(super) struct OnGpu(Renderer);

impl OnGpu {
    /// Plans `rung` on `device`, or on one that is opened and tried out.
    pub(super) fn new(
        options: &SessionOptions,
        rung: &Rung,
        device: Option<Arc<Device>>,
    ) -> gpu::Result<Self> {
        if options.display.bits() > 8 {
            return Err(gpu::Error::Refused(format!(
                "it writes levels of up to 8 bits, the display has {}",
                options.display.bits()
            )));
        }
        let (height, width) = (rung.height, rung.width);
        let response = options.response.clone().centred(height, width)?;
        let job = Job {
            illumination: options.illumination.clone(),
            correction: options.correction,
            chain: options.gpu.chain,
            ..Job::new(
                height,
                width,
                rung.method.clone(),
                &options.display,
                options.encoding.clone(),
                options.brightness,
                response,
            )
        };
        let device_options = options.gpu.device.clone();
        Renderer::on(device, device_options, job, Otherwise::Error).map(OnGpu)
    }

    pub(super) fn device(&self) -> Option<&Arc<Device>> {
        self.0.pipeline().map(|pipeline| pipeline.device())
    }

    pub(super) fn report(&self) -> BackendReport {
        let Some(pipeline) = self.0.pipeline() else {
            return BackendReport {
                name: "no GPU at this moment".into(),
                why: self
                    .0
                    .reason()
                    .map_or_else(String::new, gpu::Error::to_string),
            };
        };
        let mut why = format!(
            "asked for, and it answers as the CPU does; {}",
            pipeline.describe()
        );
        if let Some(reason) = self.0.reason() {
            why += &format!("; opened again after: {reason}");
        }
        BackendReport {
            name: pipeline.device().name(),
            why,
        }
    }

    /// How often a device was opened.
    pub(super) fn openings(&self) -> usize {
        self.0.openings()
    }

    /// Gives the GPU's memory back.
    pub(super) fn let_go(&mut self) {
        self.0.let_go();
    }

    /// Makes the levels of a frame, whose colour is the camera's where it comes from one.
    pub(super) fn process(
        &mut self,
        ready: &Ready<'_>,
        brightness: &mut BrightnessTracker,
        levels: &mut [u8],
    ) -> Result<Encoded, Failure> {
        let start = Instant::now();
        let handed = self.hand_in(ready, brightness)?;
        self.take_out(handed, start, brightness, levels)
    }

    fn hand_in(
        &mut self,
        ready: &Ready<'_>,
        brightness: &BrightnessTracker,
    ) -> Result<Handed, Failure> {
        let planar = Frame::of(ready.rgbd);
        let (colour, frame) = match ready.camera {
            None => (Colour::Planar, planar),
            Some(camera) => {
                let (height, width) = camera.colour.shape();
                let colour = Colour::Camera {
                    format: camera.colour.format(),
                    height,
                    width,
                    orientation: camera.orientation,
                };
                let frame = Frame {
                    colour: ColourData::Camera(camera.colour),
                    ..planar
                };
                (colour, frame)
            }
        };
        self.0.expect(colour, Depth::F32)?;
        let past = brightness.past(ready.elapsed);
        Ok(self.0.submit_after(past, &frame)?)
    }

    fn take_out(
        &mut self,
        handed: Handed,
        start: Instant,
        brightness: &mut BrightnessTracker,
        levels: &mut [u8],
    ) -> Result<Encoded, Failure> {
        let report = self.0.collect(handed, levels).map_err(|why| match why {
            gpu::Error::Core(why) => Failure::Frame(why),
            why => Failure::Frame(Error::Lost(format!("{why}, and this frame with it"))),
        })?;
        brightness.heed(report.scale);
        let times = report.times.unwrap_or_default();
        Ok(Encoded {
            scale: report.scale,
            // With the ways to the GPU and back, and all of it where there are no time stamps.
            method: start
                .elapsed()
                .saturating_sub(times.propagate + times.encode),
            propagate: times.propagate,
            encode: times.encode,
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{Display, Method, Network, RgbdFrame};
    use ndarray::{Array2, Array3};
    use std::time::Duration;

    /// A device that goes while a frame is on it takes this frame along and no other.
    #[test]
    fn a_frame_in_flight_is_lost_with_its_device_and_the_next_goes_on() {
        let network = Network::from_onnx(include_bytes!("../../../models/rgbd-8-int8.onnx"));
        let method = Method::Network(Arc::new(network.unwrap()));
        let display = Display::from_toml("width = 34\nheight = 21").unwrap();
        let mut options = SessionOptions::new(display, method).unwrap();
        options.gpu.device.name = Some("llvmpipe".into());
        let Ok(mut gpu) = OnGpu::new(&options, &options.ladder[0], None) else {
            println!("skipped: no driver in software (mesa-vulkan-drivers)");
            return;
        };
        let rgb = Array3::from_shape_fn((3, 21, 34), |(c, y, x)| ((c + y + x) % 9) as f32 / 8.0);
        let frame = RgbdFrame::new(rgb, Array2::from_elem((21, 34), 0.4)).unwrap();
        let mut brightness = BrightnessTracker::new(options.brightness);
        let mut first = vec![0; 3 * 21 * 34];
        let mut ready = Ready {
            camera: None,
            rgbd: &frame,
            elapsed: None,
        };
        let made = gpu.process(&ready, &mut brightness, &mut first);
        let scale = made.unwrap().scale;
        ready.elapsed = Some(Duration::from_millis(33));
        let handed = gpu.hand_in(&ready, &brightness).unwrap();
        let before = gpu.openings();
        gpu.device().unwrap().wgpu().0.destroy();
        let mut levels = vec![0; first.len()];
        let lost = gpu.take_out(handed, Instant::now(), &mut brightness, &mut levels);
        assert!(
            matches!(&lost, Err(Failure::Frame(Error::Lost(why))) if !why.contains('\n')),
            "{:?}",
            lost.err()
        );
        assert_eq!(gpu.report().name, "no GPU at this moment");
        let made = gpu.process(&ready, &mut brightness, &mut levels);
        // The same scene: its scale stays, and so do its levels.
        assert!((made.unwrap().scale - scale).abs() < 1e-6);
        assert_eq!(levels, first);
        assert_eq!(gpu.openings(), before + 1);
        assert!(gpu.report().why.contains("opened again"));
    }
}
