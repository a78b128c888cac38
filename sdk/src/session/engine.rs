//! Computes the levels of a frame from amplitudes and depth at one quality level, on the CPU or the GPU. Only this
//! module falls back from the GPU to the CPU.

mod brightness;
mod frame_input;
mod on_cpu;
#[cfg(feature = "gpu")]
mod on_gpu;

pub(super) use brightness::BrightnessTracker;
pub(super) use frame_input::FrameInput;
pub(super) use on_cpu::OnCpu;
#[cfg(feature = "gpu")]
pub use on_gpu::GpuOptions;

use super::SessionOptions;
use super::quality::{Backend, QualityLevel};
use super::statistics::BackendReport;
#[cfg(feature = "gpu")]
use on_gpu::{Failure, OnGpu};
use phasefront_core::display::levels::LevelsMut;
use phasefront_core::pipeline::FrameReport;
use phasefront_core::runtime::cancel::Cancel;
use phasefront_core::runtime::error::Result;

/// The GPU state of a session. Quality levels share the device, and a GPU that turned out to be unusable is not tried
/// again.
#[derive(Default)]
pub(super) struct GpuState {
    #[cfg(feature = "gpu")]
    device: Option<std::sync::Arc<phasefront_gpu::Device>>,
    #[cfg(feature = "gpu")]
    refusal: Option<String>,
    /// Whether the levels of the next frame stay on the GPU, if it computes them.
    #[cfg(feature = "gpu")]
    pub(super) stay: bool,
    /// The levels of the last frame, if they stayed on the GPU.
    #[cfg(feature = "gpu")]
    pub(super) kept: Option<Box<phasefront_gpu::GpuLevels>>,
}

/// The inputs for planning a quality level.
pub(super) struct LevelContext<'a> {
    pub(super) options: &'a SessionOptions,
    pub(super) quality_level: &'a QualityLevel,
    pub(super) gpu: &'a mut GpuState,
    /// Cancels a frame on the CPU.
    pub(super) cancel: &'a Cancel,
}

/// The plan of a quality level.
pub(super) struct Engine {
    processor: Processor,
    /// The reason for using the CPU although the GPU was requested.
    refusal: Option<String>,
    /// Whether [`Engine::report`] has changed.
    pub(super) report_is_new: bool,
}

enum Processor {
    Cpu(Box<OnCpu>),
    #[cfg(feature = "gpu")]
    Gpu(Box<OnGpu>),
}

impl Engine {
    /// Plans a quality level for the requested backend, or for the CPU if the GPU is unusable.
    ///
    /// # Errors
    /// Returns an error if the CPU refuses the quality level too.
    pub(super) async fn new(context: &mut LevelContext<'_>) -> Result<Self> {
        let asked = context.quality_level.backend.unwrap_or(context.options.backend);
        let on_cpu = |context: &LevelContext<'_>| -> Result<Processor> {
            let cpu = OnCpu::new(context.options, context.quality_level, context.cancel)?;
            Ok(Processor::Cpu(Box::new(cpu)))
        };
        let (processor, refusal) = match asked {
            Backend::Cpu => (on_cpu(context)?, None),
            Backend::Gpu => match Self::on_gpu(context).await? {
                Ok(processor) => (processor, None),
                Err(why) => (on_cpu(context)?, Some(why)),
            },
        };
        Ok(Engine {
            processor,
            refusal,
            report_is_new: true,
        })
    }

    /// Plans the quality level on the GPU, or returns the reason why that is impossible.
    #[cfg(feature = "gpu")]
    async fn on_gpu(context: &mut LevelContext<'_>) -> Result<std::result::Result<Processor, String>> {
        let LevelContext {
            options,
            quality_level,
            gpu,
            ..
        } = context;
        if let Some(why) = &gpu.refusal {
            return Ok(Err(why.clone()));
        }
        match OnGpu::new(options, quality_level, gpu.device.clone()).await {
            Ok(on_gpu) => {
                gpu.device = on_gpu.device().cloned();
                Ok(Ok(Processor::Gpu(Box::new(on_gpu))))
            }
            Err(phasefront_gpu::GpuError::Core(why)) => Err(why),
            Err(why) => Ok(Err(gpu.refuse(&why))),
        }
    }

    #[cfg(not(feature = "gpu"))]
    async fn on_gpu(context: &mut LevelContext<'_>) -> Result<std::result::Result<Processor, String>> {
        let GpuState {} = context.gpu;
        Ok(Err("no GPU: this library was built without it (feature gpu)".into()))
    }

    /// Returns the backend that computes the frames, and the reason for it.
    pub(super) fn report(&self) -> BackendReport {
        let mut report = match &self.processor {
            Processor::Cpu(cpu) => cpu.report(),
            #[cfg(feature = "gpu")]
            Processor::Gpu(gpu) => gpu.report(),
        };
        if let Some(refusal) = &self.refusal {
            report.why = format!("{refusal}; {}", report.why);
        }
        report
    }

    /// Returns whether the frame's depth comes as readings, from which the processor decides the depth of pixels.
    pub(super) fn takes_readings(&self) -> bool {
        !matches!(self.processor, Processor::Cpu(_))
    }

    /// Updates the state of the processor with a frame, without computing its levels.
    ///
    /// # Errors
    /// Returns an error if the frame is invalid. Of a GPU that is lost, the next frame tells.
    pub(super) async fn replay(&mut self, input: &mut FrameInput<'_>, brightness: &BrightnessTracker) -> Result<()> {
        let past = brightness.past(input.elapsed);
        match &mut self.processor {
            Processor::Cpu(cpu) => cpu.skip(past, input.rgbd()),
            #[cfg(feature = "gpu")]
            Processor::Gpu(gpu) => match gpu.read(input, past).await {
                Err(Failure::Frame(why)) => Err(why),
                Ok(()) | Err(Failure::Gpu(_)) => Ok(()),
            },
        }
    }

    /// Computes the levels of a frame. If the GPU turns out to be unusable, switches to the CPU from this frame on.
    ///
    /// # Errors
    /// Returns an error if the frame has another shape or was lost with its GPU.
    #[cfg_attr(not(feature = "gpu"), expect(unused_variables))] // Only the fallback uses the context.
    pub(super) async fn process(
        &mut self,
        context: &mut LevelContext<'_>,
        input: &mut FrameInput<'_>,
        brightness: &mut BrightnessTracker,
        levels: LevelsMut<'_>,
    ) -> Result<FrameReport> {
        #[cfg(feature = "gpu")]
        let levels = match &mut self.processor {
            Processor::Cpu(_) => levels,
            Processor::Gpu(gpu) => {
                let LevelsMut::Bytes(bytes) = levels else {
                    unreachable!("a GPU refuses a display of more than 8 bits");
                };
                let before = gpu.openings();
                let made = gpu.process(input, brightness, bytes, context.gpu.stay).await;
                if gpu.openings() != before {
                    context.gpu.device = gpu.device().cloned();
                    self.report_is_new = true;
                }
                match made {
                    Ok((report, kept)) => {
                        context.gpu.kept = kept.map(Box::new);
                        return Ok(report);
                    }
                    Err(Failure::Frame(why)) => return Err(why),
                    Err(Failure::Gpu(why)) => self.fall_back(context, &why)?,
                }
                LevelsMut::Bytes(bytes)
            }
        };
        match &mut self.processor {
            Processor::Cpu(cpu) => {
                let past = brightness.past(input.elapsed);
                let made = cpu.process(past, input.rgbd(), levels)?;
                brightness.set_scale(made.scale);
                Ok(made)
            }
            #[cfg(feature = "gpu")]
            Processor::Gpu(_) => unreachable!("it answered, or the CPU took over"),
        }
    }

    /// Lets the CPU take over from a GPU that is unusable.
    #[cfg(feature = "gpu")]
    fn fall_back(&mut self, context: &mut LevelContext<'_>, why: &phasefront_gpu::GpuError) -> Result<()> {
        if let Processor::Gpu(gpu) = &mut self.processor {
            // Free the GPU's memory first.
            gpu.release();
        }
        context.gpu.device = None;
        self.refusal = Some(context.gpu.refuse(why));
        let cpu = OnCpu::new(context.options, context.quality_level, context.cancel)?;
        self.processor = Processor::Cpu(Box::new(cpu));
        self.report_is_new = true;
        Ok(())
    }
}

#[cfg(feature = "gpu")]
impl GpuState {
    /// Returns the reason as text, and stores it if it holds for all quality levels.
    fn refuse(&mut self, why: &phasefront_gpu::GpuError) -> String {
        use phasefront_gpu::GpuError;
        let reason = why.to_string();
        if let GpuError::None(_) | GpuError::Wrong(_) | GpuError::Lost(_) = why {
            self.refusal = Some(reason.clone());
        }
        reason
    }

    /// Returns the device that the quality levels share.
    pub(super) fn device(&self) -> Option<std::sync::Arc<phasefront_gpu::Device>> {
        self.device.clone()
    }
}
