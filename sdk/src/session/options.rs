//! The options of a session.

use super::focus::Focus;
use super::quality::{self, Backend, Quality, QualityLevel};
use phasefront_core::Size;
use phasefront_core::depth::stream::DepthOptions;
#[cfg(feature = "tract")]
use phasefront_core::depth_network::DepthNetwork;
use phasefront_core::display::target::Target;
use phasefront_core::encode::EncoderOptions;
use phasefront_core::method::Method;
use phasefront_core::runtime::error::{Error, Result};
#[cfg(feature = "gpu")]
use phasefront_gpu::{ChainOptions, DeviceOptions};
use std::num::NonZeroUsize;
#[cfg(feature = "tract")]
use std::sync::Arc;

/// The options of a session for its GPU.
#[cfg(feature = "gpu")]
#[derive(Debug, Clone, Default)]
pub struct GpuOptions {
    /// The choice of the device, and programs that an earlier run compiled for it.
    pub device: DeviceOptions,
    /// The options for networks. By default f32 networks run in 16 bits if the GPU supports it.
    #[doc(hidden)]
    pub chain: ChainOptions,
}

/// The options of a session. [`SessionOptions::new`] sets the defaults.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct SessionOptions {
    /// The target of the holograms.
    pub target: Target,
    /// The quality levels, best first; at most [`Self::MOST_QUALITY_LEVELS`].
    pub quality_levels: Vec<QualityLevel>,
    /// Whether the session may change its quality level by itself.
    pub quality: Quality,
    /// The target rate in frames per second. A live session drops frames that arrive sooner; an adaptive session steps
    /// down if it cannot hold the rate. With `None`, a session takes every frame and does not adapt its quality level
    /// to frame times.
    pub target_rate_hz: Option<f64>,
    /// The conversion of fields to levels.
    pub encoder: EncoderOptions,
    /// Whether what stands still in a video keeps its wave on the CPU: a frame computes only the parts where colour or
    /// depth have changed by more than a camera's noise. Seeded networks, and those on tract, compute whole frames.
    pub keep_standing: bool,
    /// The processing of depth.
    pub depth: DepthOptions,
    /// The network that estimates the depth of frames without depth. A live session runs it on its own thread, at the
    /// network's own rate, so that the result depends on timing; other sessions run it for each frame.
    #[cfg(feature = "tract")]
    pub depth_network: Option<Arc<DepthNetwork>>,
    /// The backend of quality levels that do not set their own.
    pub backend: Backend,
    /// The options of the GPU.
    #[cfg(feature = "gpu")]
    pub gpu: GpuOptions,
    /// The number of threads to compute with, at most [`Self::MOST_THREADS`]; with `None`, as many as the device has,
    /// up to that maximum.
    pub threads: Option<NonZeroUsize>,
    /// The maximum number of pixels of a quality level and of the modulator. The memory of a session is a multiple of
    /// it.
    pub most_pixels: usize,
}

impl SessionOptions {
    /// The maximum number of threads in a session's pool. A live session has one more thread.
    pub const MOST_THREADS: usize = 256;

    /// The maximum number of quality levels. Each is planned once when the session is created.
    pub const MOST_QUALITY_LEVELS: usize = QualityLevel::MOST;

    /// The default of [`Self::most_pixels`]: 8192×4096, which includes 8K UHD.
    pub const MOST_PIXELS: usize = 1 << 25;

    /// Returns the default options for `target`. The method is [`Method::Auto`] with a bundled network if one was
    /// trained for the display, otherwise the plane sweep.
    #[cfg(feature = "models")]
    pub fn for_target(target: impl Into<Target>) -> Self {
        let target = target.into();
        let method = phasefront_models::default_method(&target.display);
        SessionOptions::new(target, method)
    }

    /// Returns the default options for `target` and `focus`, with the method of [`Focus::default_method`].
    ///
    /// # Errors
    /// Returns an error for natural focus without steps if the bundled network was not trained for the display.
    pub fn for_focus(target: impl Into<Target>, focus: Focus) -> Result<Self> {
        let target = target.into();
        let method = focus.default_method(&target.display)?;
        let mut options = SessionOptions::new(target, method);
        options.encoder.focus_steps = focus.steps();
        Ok(options)
    }

    /// Returns the default options for holograms at the modulator's resolution by `method`: AA-DPM, smoothed
    /// brightness, near and far limits by percentiles, no target rate.
    pub fn new(target: impl Into<Target>, method: Method) -> Self {
        let target = target.into();
        let size = target.modulator();
        SessionOptions {
            quality_levels: vec![QualityLevel {
                method,
                size,
                backend: None,
                encoder: None,
            }],
            quality: Quality::Adaptive,
            target_rate_hz: None,
            encoder: EncoderOptions::default(),
            keep_standing: true,
            depth: DepthOptions::default(),
            #[cfg(feature = "tract")]
            depth_network: None,
            backend: Backend::Cpu,
            #[cfg(feature = "gpu")]
            gpu: GpuOptions::default(),
            threads: None,
            most_pixels: Self::MOST_PIXELS,
            target,
        }
    }

    pub(super) fn check(&self) -> Result<()> {
        quality::check(&self.quality_levels, self.quality, self.target.modulator())?;
        // Quality levels are no larger than the modulator.
        let Size { width, height } = self.target.modulator();
        if height.saturating_mul(width) > self.most_pixels {
            return Err(Error::Setting(format!(
                "a session for {width}×{height} pixels; most_pixels allows {}: set it higher where the memory is there",
                self.most_pixels
            )));
        }
        if let Some(threads) = self.threads
            && threads.get() > Self::MOST_THREADS
        {
            return Err(Error::Setting(format!(
                "{threads} threads are too many; 1 to {} are right, or none for as many as the device has",
                Self::MOST_THREADS
            )));
        }
        if let Some(rate) = self.target_rate_hz
            && !(rate.is_finite() && (0.01..=1000.0).contains(&rate))
        {
            return Err(Error::Setting(format!(
                "a target rate of {rate} frames a second cannot be aimed at; it must lie in 0.01..=1000"
            )));
        }
        self.target.check()?;
        self.encoder.check()?;
        self.depth.check()
    }
}
