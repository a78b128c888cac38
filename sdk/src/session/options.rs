//! What a session makes, and how.

#[cfg(feature = "gpu")]
use super::engine::GpuOptions;
use super::quality::{self, Backend, Quality, QualityLevel};
use phasefront_core::depth::stream::DepthOptions;
use phasefront_core::display::target::Target;
use phasefront_core::encode::EncoderOptions;
use phasefront_core::method::Method;
use phasefront_core::runtime::error::{Error, Result};
use std::num::NonZeroUsize;

/// What a session makes, and how. [`SessionOptions::new`] gives the defaults; change what differs.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct SessionOptions {
    /// What holograms are for.
    pub target: Target,
    /// Quality levels, the best first, [`Self::MOST_QUALITY_LEVELS`] at most.
    pub quality_levels: Vec<QualityLevel>,
    /// Whether the session may change its quality level by itself.
    pub quality: Quality,
    /// Frames a second that are aimed at: a live session drops frames that come sooner, and an adaptive one steps down
    /// where it cannot hold it. None takes every frame and never steps.
    pub target_rate_hz: Option<f64>,
    /// How fields become levels.
    pub encoder: EncoderOptions,
    /// What becomes of depth.
    pub depth: DepthOptions,
    /// Where frames are computed, unless their quality level says it.
    pub backend: Backend,
    /// Which GPU, and how.
    #[cfg(feature = "gpu")]
    pub gpu: GpuOptions,
    /// Threads to compute with, [`Self::MOST_THREADS`] at most; None for as many as the device has, and no more than
    /// that.
    pub threads: Option<NonZeroUsize>,
    /// Most pixels of a quality level and of the modulator: what a session allocates is a multiple of them.
    pub most_pixels: usize,
}

impl SessionOptions {
    /// Most threads of a session's pool. A live session has one more.
    pub const MOST_THREADS: usize = 256;

    /// Most quality levels of a session: each is planned once when the session is made.
    pub const MOST_QUALITY_LEVELS: usize = 16;

    /// The default of [`Self::most_pixels`]: 8192×4096, which holds 8K UHD.
    pub const MOST_PIXELS: usize = 1 << 25;

    /// Holograms of the modulator's resolution by `method`: AA-DPM, smoothed brightness, near and far by percentiles,
    /// no target rate.
    pub fn new(target: impl Into<Target>, method: Method) -> Self {
        let target = target.into();
        let (height, width) = target.modulator();
        SessionOptions {
            quality_levels: vec![QualityLevel {
                method,
                height,
                width,
                backend: None,
                encoder: None,
            }],
            quality: Quality::Adaptive,
            target_rate_hz: None,
            encoder: EncoderOptions::default(),
            depth: DepthOptions::default(),
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
        let (height, width) = self.target.modulator();
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
