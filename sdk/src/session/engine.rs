//! Where CPU and GPU meet: what takes a frame on one quality level from amplitudes and depth to levels, and which
//! of the two it is. The one place that falls back from the GPU to the CPU.

mod brightness;
mod frame_io;
mod on_cpu;
#[cfg(feature = "gpu")]
mod on_gpu;

pub(super) use brightness::BrightnessTracker;
pub(super) use frame_io::{FrameInput, LevelsOut};
pub(super) use on_cpu::OnCpu;
#[cfg(feature = "gpu")]
pub use on_gpu::GpuOptions;

use super::SessionOptions;
use super::quality::{Backend, QualityLevel};
use super::statistics::BackendReport;
use frame_io::Encoded;
#[cfg(feature = "gpu")]
use on_gpu::{Failure, OnGpu};
use phasefront_core::runtime::cancel::Cancel;
use phasefront_core::runtime::error::Result;

/// What a session knows of its GPU: quality levels share the device, and none of them tries one again that is of no
/// use.
#[derive(Default)]
pub(super) struct GpuState {
    #[cfg(feature = "gpu")]
    device: Option<std::sync::Arc<phasefront_gpu::Device>>,
    #[cfg(feature = "gpu")]
    refusal: Option<String>,
}

/// What a quality level is planned from.
pub(super) struct LevelContext<'a> {
    pub(super) options: &'a SessionOptions,
    pub(super) quality_level: &'a QualityLevel,
    pub(super) gpu: &'a mut GpuState,
    /// Gives up a frame on the CPU.
    pub(super) cancel: &'a Cancel,
}

/// The plan of a quality level.
pub(super) struct Engine {
    processor: Processor,
    /// Why it is the CPU though the GPU was asked for.
    refusal: Option<String>,
    /// Whether [`Engine::report`] gives something new.
    pub(super) report_is_new: bool,
}

enum Processor {
    Cpu(Box<OnCpu>),
    #[cfg(feature = "gpu")]
    Gpu(Box<OnGpu>),
}

impl Engine {
    /// Plans a quality level where it is asked for, or on the CPU where the GPU does not serve.
    ///
    /// # Errors
    /// What the CPU refuses too.
    pub(super) fn new(context: &mut LevelContext<'_>) -> Result<Self> {
        let asked = context.quality_level.backend.unwrap_or(context.options.backend);
        let on_cpu = |context: &LevelContext<'_>| -> Result<Processor> {
            let cpu = OnCpu::new(context.options, context.quality_level, context.cancel)?;
            Ok(Processor::Cpu(Box::new(cpu)))
        };
        let (processor, refusal) = match asked {
            Backend::Cpu => (on_cpu(context)?, None),
            Backend::Gpu => match Self::on_gpu(context)? {
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

    /// The GPU, or why not.
    #[cfg(feature = "gpu")]
    fn on_gpu(context: &mut LevelContext<'_>) -> Result<std::result::Result<Processor, String>> {
        let LevelContext {
            options,
            quality_level,
            gpu,
            ..
        } = context;
        if let Some(why) = &gpu.refusal {
            return Ok(Err(why.clone()));
        }
        match OnGpu::new(options, quality_level, gpu.device.clone()) {
            Ok(on_gpu) => {
                gpu.device = on_gpu.device().cloned();
                Ok(Ok(Processor::Gpu(Box::new(on_gpu))))
            }
            Err(phasefront_gpu::GpuError::Core(why)) => Err(why),
            Err(why) => Ok(Err(gpu.refuse(&why))),
        }
    }

    #[cfg(not(feature = "gpu"))]
    fn on_gpu(context: &mut LevelContext<'_>) -> Result<std::result::Result<Processor, String>> {
        let GpuState {} = context.gpu;
        Ok(Err("no GPU: this library was built without it (feature gpu)".into()))
    }

    /// What runs the frames, and why.
    pub(super) fn report(&self) -> BackendReport {
        let mut report = match &self.processor {
            Processor::Cpu(cpu) => cpu.report(),
            #[cfg(feature = "gpu")]
            Processor::Gpu(gpu) => gpu.report(),
        };
        if let Some(refusal) = &self.refusal {
            if report.name.is_empty() {
                report.name = "cpu".into();
            }
            report.why = match report.why.is_empty() {
                true => refusal.clone(),
                false => format!("{refusal}; {}", report.why),
            };
        }
        report
    }

    /// Makes the levels of a frame. Where the GPU turns out to be of no use, on the CPU, from this frame on.
    ///
    /// # Errors
    /// A frame of another shape, or one that was lost with its GPU.
    #[cfg_attr(not(feature = "gpu"), expect(unused_variables))] // The context is for falling back.
    pub(super) fn process(
        &mut self,
        context: &mut LevelContext<'_>,
        input: &FrameInput<'_>,
        brightness: &mut BrightnessTracker,
        out: LevelsOut<'_>,
    ) -> Result<Encoded> {
        match &mut self.processor {
            Processor::Cpu(cpu) => {
                let past = brightness.past(input.elapsed);
                let made = cpu.process(input.rgbd, past, out)?;
                brightness.set_scale(made.scale);
                Ok(made)
            }
            #[cfg(feature = "gpu")]
            Processor::Gpu(gpu) => {
                let before = gpu.openings();
                let made = gpu.process(input, brightness, out.levels);
                if gpu.openings() != before {
                    context.gpu.device = gpu.device().cloned();
                    self.report_is_new = true;
                }
                match made {
                    Ok(made) => Ok(made),
                    Err(Failure::Frame(why)) => Err(why),
                    Err(Failure::Gpu(why)) => {
                        // The GPU's memory goes first.
                        gpu.release();
                        context.gpu.device = None;
                        self.refusal = Some(context.gpu.refuse(&why));
                        let cpu = OnCpu::new(context.options, context.quality_level, context.cancel)?;
                        self.processor = Processor::Cpu(Box::new(cpu));
                        self.report_is_new = true;
                        self.process(context, input, brightness, out)
                    }
                }
            }
        }
    }
}

#[cfg(feature = "gpu")]
impl GpuState {
    /// The reason in words; one that holds for all quality levels is kept.
    fn refuse(&mut self, why: &phasefront_gpu::GpuError) -> String {
        use phasefront_gpu::GpuError;
        let reason = why.to_string();
        if let GpuError::None(_) | GpuError::Wrong(_) | GpuError::Lost(_) = why {
            self.refusal = Some(reason.clone());
        }
        reason
    }

    /// The device that quality levels share.
    pub(super) fn device(&self) -> Option<std::sync::Arc<phasefront_gpu::Device>> {
        self.device.clone()
    }
}
