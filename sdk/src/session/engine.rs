//! Where CPU and GPU meet: what takes a frame on one rung of the ladder from amplitudes and depth to levels, and which of
//! the two it is.

use super::SessionOptions;
use super::brightness::BrightnessTracker;
use super::on_cpu::OnCpu;
#[cfg(feature = "gpu")]
use super::on_gpu::{Failure, OnGpu};
use super::quality::{Backend, Rung};
use super::statistics::BackendReport;
use crate::error::Result;
use crate::frame::{CameraFrame, RgbdFrame};
use std::time::Duration;

/// A frame that is ready to become a hologram.
pub(super) struct Ready<'a> {
    /// None for a frame that comes from no camera. The GPU reads it itself.
    #[cfg_attr(not(feature = "gpu"), expect(dead_code))]
    pub(super) camera: Option<&'a CameraFrame<'a>>,
    /// Its colour and depth at the hologram's resolution.
    pub(super) rgbd: &'a RgbdFrame,
    /// How long after the frame before, where that one counts.
    pub(super) elapsed: Option<Duration>,
}

/// Where levels go, (3, H, W).
pub(super) struct Target<'a> {
    pub(super) levels: &'a mut [u8],
    /// Of a display of over 8 bits.
    pub(super) words: Option<&'a mut [u16]>,
}

/// What became of a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Encoded {
    pub(super) scale: f32,
    pub(super) method: Duration,
    pub(super) propagate: Duration,
    pub(super) encode: Duration,
}

/// What a session knows of its GPU: rungs share the device, and none of them tries one again that is of no use.
#[derive(Default)]
pub(super) struct Seat {
    #[cfg(feature = "gpu")]
    device: Option<std::sync::Arc<crate::gpu::Device>>,
    #[cfg(feature = "gpu")]
    refusal: Option<String>,
}

/// What a rung is planned from.
pub(super) struct Ground<'a> {
    pub(super) options: &'a SessionOptions,
    pub(super) rung: &'a Rung,
    pub(super) seat: &'a mut Seat,
}

/// The plan of a rung.
pub(super) struct Engine {
    place: Place,
    /// Why it is the CPU though the GPU was asked for.
    refusal: Option<String>,
    /// Whether [`Engine::report`] gives something new.
    pub(super) turned: bool,
}

enum Place {
    Cpu(Box<OnCpu>),
    #[cfg(feature = "gpu")]
    Gpu(Box<OnGpu>),
}

impl Engine {
    /// Plans a rung where it is asked for, or on the CPU where the GPU does not serve.
    ///
    /// # Errors
    /// What the CPU refuses too.
    pub(super) fn new(ground: &mut Ground<'_>) -> Result<Self> {
        let asked = ground.rung.backend.unwrap_or(ground.options.backend);
        let refusal = match asked {
            Backend::Cpu => None,
            Backend::Gpu => match Self::on_gpu(ground)? {
                Ok(place) => {
                    return Ok(Engine {
                        place,
                        refusal: None,
                        turned: true,
                    });
                }
                Err(why) => Some(why),
            },
        };
        Ok(Engine {
            place: Place::Cpu(Box::new(OnCpu::new(ground.options, ground.rung)?)),
            refusal,
            turned: true,
        })
    }

    /// The GPU, or why not.
    #[cfg(feature = "gpu")]
    fn on_gpu(ground: &mut Ground<'_>) -> Result<std::result::Result<Place, String>> {
        let Ground {
            options,
            rung,
            seat,
        } = ground;
        if let Some(why) = &seat.refusal {
            return Ok(Err(why.clone()));
        }
        match OnGpu::new(options, rung, seat.device.clone()) {
            Ok(gpu) => {
                seat.device = gpu.device().cloned();
                Ok(Ok(Place::Gpu(Box::new(gpu))))
            }
            Err(crate::gpu::Error::Core(why)) => Err(why),
            Err(why) => Ok(Err(seat.refuse(&why))),
        }
    }

    #[cfg(not(feature = "gpu"))]
    fn on_gpu(ground: &mut Ground<'_>) -> Result<std::result::Result<Place, String>> {
        let Seat {} = ground.seat;
        Ok(Err(
            "no GPU: this library was built without it (feature gpu)".into(),
        ))
    }

    /// What runs the frames, and why.
    pub(super) fn report(&self) -> BackendReport {
        let mut report = match &self.place {
            Place::Cpu(cpu) => cpu.report(),
            #[cfg(feature = "gpu")]
            Place::Gpu(gpu) => gpu.report(),
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
    pub(super) fn process(
        &mut self,
        ground: &mut Ground<'_>,
        ready: &Ready<'_>,
        brightness: &mut BrightnessTracker,
        target: Target<'_>,
    ) -> Result<Encoded> {
        match &mut self.place {
            Place::Cpu(cpu) => {
                let bits = ground.options.display.bits();
                cpu.process(ready.rgbd, ready.elapsed, brightness, target, bits)
            }
            #[cfg(feature = "gpu")]
            Place::Gpu(gpu) => {
                let before = gpu.openings();
                let made = gpu.process(ready, brightness, target.levels);
                if gpu.openings() != before {
                    ground.seat.device = gpu.device().cloned();
                    self.turned = true;
                }
                match made {
                    Ok(made) => Ok(made),
                    Err(Failure::Frame(why)) => Err(why),
                    Err(Failure::Gpu(why)) => {
                        // The GPU's memory goes first.
                        gpu.let_go();
                        ground.seat.device = None;
                        self.refusal = Some(ground.seat.refuse(&why));
                        self.place = Place::Cpu(Box::new(OnCpu::new(ground.options, ground.rung)?));
                        self.turned = true;
                        self.process(ground, ready, brightness, target)
                    }
                }
            }
        }
    }
}

#[cfg(feature = "gpu")]
impl Seat {
    /// The reason in words; one that holds for all rungs is kept.
    fn refuse(&mut self, why: &crate::gpu::Error) -> String {
        use crate::gpu::Error;
        let reason = why.to_string();
        if let Error::None(_) | Error::Wrong(_) | Error::Lost(_) = why {
            self.refusal = Some(reason.clone());
        }
        reason
    }

    /// The device that rungs share.
    pub(super) fn device(&self) -> Option<std::sync::Arc<crate::gpu::Device>> {
        self.device.clone()
    }
}
