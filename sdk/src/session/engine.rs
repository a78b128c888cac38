//! Computes the levels of a frame from amplitudes and depth at one quality level, on the CPU or the GPU. Only this
//! module falls back from the GPU to the CPU.

mod frame_input;
mod on_cpu;
#[cfg(feature = "gpu")]
mod on_gpu;

pub(super) use frame_input::FrameInput;
pub(super) use on_cpu::OnCpu;

use super::options::SessionOptions;
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

/// What the plans of all quality levels share.
pub(super) struct LevelContext {
    pub(super) options: SessionOptions,
    /// The index of the quality level that is planned.
    pub(super) level: usize,
    pub(super) gpu: GpuState,
    /// Cancels a frame on the CPU.
    pub(super) cancel: Cancel,
}

impl LevelContext {
    pub(super) fn quality_level(&self) -> &QualityLevel {
        &self.options.quality_levels[self.level]
    }
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

impl Processor {
    fn on_cpu(context: &LevelContext) -> Result<Self> {
        let cpu = OnCpu::new(&context.options, context.quality_level(), &context.cancel)?;
        Ok(Processor::Cpu(Box::new(cpu)))
    }
}

impl Engine {
    /// Plans a quality level for the requested backend, or for the CPU if the GPU is unusable.
    ///
    /// # Errors
    /// Returns an error if the CPU refuses the quality level too.
    pub(super) async fn new(context: &mut LevelContext) -> Result<Self> {
        let asked = context.quality_level().backend.unwrap_or(context.options.backend);
        let (processor, refusal) = match asked {
            Backend::Cpu => (Processor::on_cpu(context)?, None),
            Backend::Gpu => match Self::on_gpu(context).await? {
                Ok(processor) => (processor, None),
                Err(why) => (Processor::on_cpu(context)?, Some(why)),
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
    async fn on_gpu(context: &mut LevelContext) -> Result<std::result::Result<Processor, String>> {
        if let Some(why) = &context.gpu.refusal {
            return Ok(Err(why.clone()));
        }
        let device = context.gpu.device.clone();
        match OnGpu::new(&context.options, context.quality_level(), device).await {
            Ok(on_gpu) => {
                context.gpu.device = on_gpu.device().cloned();
                Ok(Ok(Processor::Gpu(Box::new(on_gpu))))
            }
            Err(phasefront_gpu::GpuError::Core(why)) => Err(why),
            Err(why) => Ok(Err(context.gpu.refuse(&why))),
        }
    }

    #[cfg(not(feature = "gpu"))]
    async fn on_gpu(context: &mut LevelContext) -> Result<std::result::Result<Processor, String>> {
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
    pub(super) async fn replay(&mut self, input: &mut FrameInput<'_>) -> Result<()> {
        match &mut self.processor {
            Processor::Cpu(cpu) => cpu.pipeline.skip(input.past, input.rgbd(), &mut cpu.scratch),
            #[cfg(feature = "gpu")]
            Processor::Gpu(gpu) => match gpu.read(input).await {
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
        context: &mut LevelContext,
        input: &mut FrameInput<'_>,
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
                let made = gpu.process(input, bytes, context.gpu.stay).await;
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
                let past = input.past;
                cpu.pipeline.process_after(past, input.rgbd(), levels, &mut cpu.scratch)
            }
            #[cfg(feature = "gpu")]
            Processor::Gpu(_) => unreachable!("it answered, or the CPU took over"),
        }
    }

    /// Lets the CPU take over from a GPU that is unusable.
    #[cfg(feature = "gpu")]
    fn fall_back(&mut self, context: &mut LevelContext, why: &phasefront_gpu::GpuError) -> Result<()> {
        if let Processor::Gpu(gpu) = &mut self.processor {
            // Free the GPU's memory first.
            gpu.release();
        }
        context.gpu.device = None;
        self.refusal = Some(context.gpu.refuse(why));
        self.processor = Processor::on_cpu(context)?;
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
