//! The core's methods for RGB-D images, on a GPU.

use super::{HologramRequest, HologramResult, name};
use crate::flags::encoder::Encoder;
use ndarray::Array3;
use phasefront::RgbdFrame;
use phasefront::Size;
use phasefront_cli::gpu;
use phasefront_core::view::colours::ViewColours;
use phasefront_gpu::{Device, DeviceOptions, Frame, GpuPipeline, Job, probe};
use phasefront_io::display::DisplayFile;
use phasefront_io::hologram::Levels;
use phasefront_io::{Error, Result};
use std::sync::Arc;

impl HologramRequest {
    /// Makes a hologram on a GPU, after a test of the GPU.
    pub(super) fn on_gpu(
        &self,
        method: phasefront::Method,
        frame: &RgbdFrame,
        display: &DisplayFile,
        encoder: Encoder,
        options: &DeviceOptions,
    ) -> Result<HologramResult> {
        if display.target.display.bits() > 8 {
            return Err(Error::Usage(
                "--backend gpu makes levels of up to 8 bits; those of over 8 are the CPU's".into(),
            ));
        }
        let Size { width, height } = frame.size();
        let mut job = Job::new(frame.size(), method, display.corrected()?);
        job.encoder = self.encoder_options(&encoder.options);
        let device = Arc::new(Device::open(options)?);
        probe(&device, &job)?;
        let mut pipeline = GpuPipeline::new(&device, &job)?;
        let mut levels = Array3::zeros((3, height, width));
        let bytes = levels.as_slice_mut().expect("standard layout");
        let report = pipeline.process(&Frame::of(frame), bytes)?;
        gpu::keep_programs(&device);
        let stage = name(pipeline.is_swept());
        let times = report.times.unwrap_or_default();
        Ok(HologramResult {
            method: stage,
            field: None,
            levels: Levels::Bytes(levels),
            encoder,
            scale: report.scale,
            stages: vec![
                ("input", times.colour),
                (stage, times.method),
                ("propagate", times.propagate),
                ("encode", times.encode),
            ],
            engine: Some(pipeline.describe()),
            view_colours: ViewColours::Amplitude,
        })
    }
}
