//! The options of a session.

use crate::error::{PhasefrontError, guard};
use crate::network::{DepthNetwork, Network};
use crate::target::Target;
use phasefront::Size;
use phasefront::Sweep;
use phasefront::input::DepthRange;
use phasefront::output::{Layout, Placement};
use phasefront::session::{self, Backend, Focus, Thermal};
use std::num::NonZeroUsize;
use std::sync::Arc;

/// The running mode of a session. It is fixed when the session is created.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum RunningMode {
    /// The session answers each frame independently of all others.
    Image,
    /// The session answers each frame, and smooths depth and brightness over time. Timestamps must increase.
    Video,
    /// The app submits frames without waiting, and the listener receives the outcome of each. Timestamps must increase.
    Live,
}

/// The conversion of a field to phases.
#[derive(Debug, Clone, uniffi::Enum)]
pub enum Encoding {
    /// Double phase of the unchanged field.
    DoublePhase,
    /// Double phase after a small Gaussian blur (AA-DPM).
    AntiAlias {
        /// The standard deviation in pixels; 0.7 in the paper.
        sigma: f32,
        /// The number of taps, an odd number; 3 in the paper.
        width: usize,
    },
    /// Double phase after a filter that removes high diagonal frequencies (BL-DPM).
    BandLimit {
        /// The bound of |tan(πfx)·tan(πfy)|, where f is in cycles per pixel; 1 in the paper.
        k: f32,
    },
    /// Double phase after a pre-filter network (DDPM), which was trained together with the hologram network for the
    /// offset of the display.
    Deep {
        /// The pre-filter.
        prefilter: Arc<Network>,
    },
}

/// The amplitude that maps to full light.
#[derive(Debug, Clone, Copy, PartialEq, uniffi::Enum)]
pub enum Brightness {
    /// An amplitude near the frame's largest that changes smoothly from frame to frame, so that video does not flicker.
    Smoothed,
    /// A fixed amplitude. Larger amplitudes are clipped.
    Fixed {
        /// The amplitude.
        scale: f32,
    },
    /// The largest amplitude of the frame.
    FrameMax,
}

/// How what is out of focus looks.
#[uniffi::remote(Enum)]
pub enum Focus {
    /// As a laser shows it, with halos and rings. This is the default.
    Coherent,
    /// Soft, as in the world.
    Natural {
        /// The number of steps that follow the method, 0 to 1000, each of two transforms for each plane and colour. 30
        /// bring most of the gain in stills. Without steps, as live frames need it, the method `Auto` without a network
        /// takes the built-in network for natural focus.
        steps: usize,
    },
}

/// The distances that map to the ends of the volume.
#[uniffi::remote(Enum)]
pub enum DepthRange {
    /// The 1st and 99th percentile of the readings, smoothed over time in video.
    Percentiles,
    /// Fixed distances.
    Fixed {
        /// The distance of the near end, in metres.
        near_m: f32,
        /// The distance of the far end, in metres.
        far_m: f32,
    },
}

/// The method that computes holograms.
#[derive(Debug, Clone, uniffi::Enum)]
#[uniffi(name = "HologramMethod")]
pub enum Method {
    /// The trained network for frames whose depth has soft edges, such as depth from motion or depth that a network
    /// estimated, and the plane sweep for all others. This is the default.
    Auto {
        /// The network, which must suit the session's display; none for the built-in one, or for the plane sweep alone
        /// if that network was not trained for the display.
        #[uniffi(default = None)]
        network: Option<Arc<Network>>,
    },
    /// The plane sweep, which suits any display and needs no training.
    Sweep,
    /// A trained network.
    Trained {
        /// The network, which must suit the session's display.
        network: Arc<Network>,
    },
}

/// A quality level: a method, a resolution and the number of correction steps. A hologram smaller than the modulator is
/// displayed in its centre.
#[derive(Debug, Clone, uniffi::Record)]
pub struct QualityLevel {
    /// The method that computes the hologram.
    pub method: Method,
    /// The width of the hologram in pixels.
    pub width: usize,
    /// The height of the hologram in pixels.
    pub height: usize,
    /// The number of local steps; none for the session's number.
    #[uniffi(default = None)]
    pub local_steps: Option<usize>,
    /// The number of steps at the midpoint; none for the session's number.
    #[uniffi(default = None)]
    pub midpoint_steps: Option<usize>,
    /// The number of steps of natural focus, in a session with natural focus; none for the session's number.
    #[uniffi(default = None)]
    pub focus_steps: Option<usize>,
}

/// Determines whether a session may change its quality level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum Quality {
    /// The session lowers the quality level if frames take longer than the target rate allows or the device is hot, and
    /// raises it if there is time left.
    Adaptive,
    /// The session stays at this quality level.
    Fixed {
        /// The quality level; 0 is the best.
        quality_level: usize,
    },
}

/// The thermal state of the device as reported by its system.
#[uniffi::remote(Enum)]
pub enum Thermal {
    /// The device is not warm; nothing is limited.
    Nominal,
    /// The device is warm; frames may take a little less time.
    Fair,
    /// The device is hot; frames may take half the time.
    Serious,
    /// The device is too hot; the session uses the lowest quality level.
    Critical,
}

/// The backend that computes frames.
#[uniffi::remote(Enum)]
pub enum Backend {
    /// Computes on the CPU.
    Cpu,
    /// Computes on the GPU if this library was built with GPU support, a GPU exists and its results agree with the
    /// CPU's; otherwise on the CPU. `backend` and `backend_why` in the statistics name the backend in use and the
    /// reason.
    Gpu,
}

/// How a field becomes levels.
#[derive(Debug, Clone, uniffi::Record)]
pub struct EncoderOptions {
    /// How the field becomes phases.
    pub encoding: Encoding,
    /// Which amplitude full light stands for.
    pub brightness: Brightness,
    /// Where the amplitude is below this share of full light, 0 to 1, phases are drawn to 0, against coloured speckle
    /// in the dark; none for what suits the encoding: 0.4, and 0 with a pre-filter.
    #[uniffi(default = None)]
    pub dark_threshold: Option<f32>,
    /// Steps of correction, 0 to 8, each of which draws the displayed image toward the field that is wanted; none for
    /// what suits the encoding: 1, and 0 with a pre-filter.
    #[uniffi(default = None)]
    pub local_steps: Option<usize>,
    /// Steps of correction at the midpoint, 0 to 100, each of which costs four transforms a colour.
    #[uniffi(default = 0)]
    pub midpoint_steps: usize,
}

/// The options of a session. [`session_options`] returns the defaults.
#[derive(Debug, Clone, uniffi::Record)]
pub struct SessionOptions {
    /// The target of the holograms.
    pub target: Arc<Target>,
    /// The quality levels, best first: 1 to 16.
    pub quality_levels: Vec<QualityLevel>,
    /// Whether the session may change its quality level by itself.
    pub quality: Quality,
    /// The target rate in frames per second; none if the session takes every frame and does not adapt its quality level
    /// to frame times.
    pub target_rate_hz: Option<f64>,
    /// The conversion of fields to phases.
    pub encoding: Encoding,
    /// The amplitude that maps to full light.
    pub brightness: Brightness,
    /// The share of full light, 0 to 1, below which phases are drawn to 0, which reduces coloured speckle in dark
    /// areas; none for the encoding's default: 0.4, and 0 with a pre-filter.
    #[uniffi(default = None)]
    pub dark_threshold: Option<f32>,
    /// The number of correction steps, 0 to 8. Each step draws the displayed image toward the wanted field. None for
    /// the encoding's default: 1, and 0 with a pre-filter.
    #[uniffi(default = None)]
    pub local_steps: Option<usize>,
    /// The number of correction steps at the midpoint, 0 to 100. Each step costs four transforms per colour: 3 suit
    /// stills; 1 suits video, where each frame continues from the previous one.
    #[uniffi(default = 0)]
    pub midpoint_steps: usize,
    /// How what is out of focus looks.
    pub focus: Focus,
    /// The distances that map to the ends of the volume.
    pub depth_range: DepthRange,
    /// The confidence, in 0..=1, below which readings are ignored. ARKit's "low" is 0, "medium" ½, "high" 1.
    pub least_confidence: f32,
    /// Whether what stands still in a video keeps its wave on the CPU: a frame computes only the parts where colour or
    /// depth have changed by more than a camera's noise.
    #[uniffi(default = true)]
    pub keep_standing: bool,
    /// The number of threads to compute with, at most 256; none for as many as the device has.
    pub threads: Option<usize>,
    /// The maximum number of pixels of a quality level and of the modulator; 8192×4096 by default. The memory of a
    /// session is a multiple of it.
    #[uniffi(default = 33554432)]
    pub most_pixels: usize,
    /// The backend that computes frames.
    pub backend: Backend,
    /// The network that estimates the depth of frames without depth; none if all frames have depth. A live session runs
    /// it on its own thread, at the network's own rate; other sessions run it for each frame.
    #[uniffi(default = None)]
    pub depth_network: Option<Arc<DepthNetwork>>,
}

/// The arrangement of the colours' levels in images for a modulator's driver.
#[uniffi::remote(Enum)]
#[non_exhaustive]
pub enum Layout {
    /// One image with bytes red, green, blue.
    Rgb,
    /// One image with bytes red, green, blue, alpha 255.
    Rgba,
    /// One image with bytes blue, green, red, alpha 255.
    Bgra,
    /// One image with 32-bit little-endian words: red in the lowest 10 bits, then green, then blue, alpha 3. Android's
    /// RGBA_1010102, Metal's rgb10a2.
    Rgb10,
    /// One image for each colour in the order red, green, blue, with one byte for each pixel.
    Grey,
    /// One image for each colour in the order red, green, blue, with one 16-bit little-endian word for each pixel.
    Grey16,
}

/// The placement of a hologram on its modulator.
#[uniffi::remote(Record)]
pub struct Placement {
    /// The arrangement of colours in images.
    pub layout: Layout,
    /// Whether the whole image is flipped left to right.
    #[uniffi(default = false)]
    pub flip_x: bool,
    /// Whether the whole image is flipped top to bottom.
    #[uniffi(default = false)]
    pub flip_y: bool,
    /// The hologram's shift to the right of the middle in pixels, before flips.
    #[uniffi(default = 0)]
    pub shift_x: i32,
    /// The hologram's shift below the middle in pixels, before flips.
    #[uniffi(default = 0)]
    pub shift_y: i32,
}

impl Method {
    fn core(&self, display: &phasefront::Display, focus: Focus) -> Result<phasefront::Method, PhasefrontError> {
        let sweep = || Sweep::for_display(display);
        Ok(match self {
            Method::Auto { network: Some(network) } => phasefront::Method::Auto(sweep(), network.core.clone()),
            Method::Auto { network: None } => focus.default_method(display)?,
            Method::Sweep => phasefront::Method::Sweep(sweep()),
            Method::Trained { network } => phasefront::Method::trained(network.core.clone()),
        })
    }
}

/// Returns the default options for `target`: holograms at its modulator's resolution by `method` and AA-DPM with one
/// correction step, smoothed brightness, near and far limits by percentiles. Without a method, the session chooses
/// between the built-in network and the plane sweep by each frame's depth, as `Auto` does.
#[uniffi::export(default(method = None))]
pub fn session_options(target: Arc<Target>, method: Option<Method>) -> Result<SessionOptions, PhasefrontError> {
    guard(|| {
        let method = method.unwrap_or(Method::Auto { network: None });
        let core = method.core(&target.core.display, Focus::Coherent)?;
        let defaults = session::SessionOptions::new(target.core.clone(), core);
        Ok(SessionOptions::new(target, method, defaults))
    })
}

/// Returns options for a live session on a phone: the defaults of [`session_options`] with a target rate and three
/// quality levels, at the modulator's resolution and at three quarters and half of it along each side. The session
/// lowers the level when frames are too slow for the rate or the device is hot, and raises it when there is time left.
#[uniffi::export(default(rate_hz = 30.0, method = None))]
pub fn phone_options(
    target: Arc<Target>,
    rate_hz: f64,
    method: Option<Method>,
) -> Result<SessionOptions, PhasefrontError> {
    guard(|| {
        let mut options = session_options(target, method)?;
        let best = options.quality_levels[0].clone();
        options.quality_levels.extend([3, 2].map(|quarters| QualityLevel {
            width: (best.width * quarters / 4).max(1),
            height: (best.height * quarters / 4).max(1),
            ..best.clone()
        }));
        options.target_rate_hz = Some(rate_hz);
        Ok(options)
    })
}

impl SessionOptions {
    /// Converts the options of the core, which are for the same `target` and `method`.
    fn new(target: Arc<Target>, method: Method, core: session::SessionOptions) -> Self {
        let network = |core: &Arc<phasefront::Network>| Arc::new(Network { core: core.clone() });
        SessionOptions {
            target,
            quality_levels: (core.quality_levels.iter())
                .map(|quality_level| QualityLevel {
                    method: method.clone(),
                    width: quality_level.size.width,
                    height: quality_level.size.height,
                    local_steps: None,
                    midpoint_steps: None,
                    focus_steps: None,
                })
                .collect(),
            quality: match core.quality {
                session::Quality::Adaptive => Quality::Adaptive,
                session::Quality::Fixed(quality_level) => Quality::Fixed { quality_level },
            },
            target_rate_hz: core.target_rate_hz,
            encoding: match &core.encoder.encoding {
                phasefront::Encoding::AntiAlias { sigma, width } => Encoding::AntiAlias {
                    sigma: *sigma,
                    width: *width,
                },
                phasefront::Encoding::BandLimit { k } => Encoding::BandLimit { k: *k },
                phasefront::Encoding::Deep(core) => Encoding::Deep {
                    prefilter: network(core),
                },
                _ => Encoding::DoublePhase,
            },
            brightness: match core.encoder.brightness {
                phasefront::Brightness::Smoothed => Brightness::Smoothed,
                phasefront::Brightness::Fixed(scale) => Brightness::Fixed { scale },
                phasefront::Brightness::FrameMax => Brightness::FrameMax,
            },
            dark_threshold: None,
            local_steps: None,
            midpoint_steps: core.encoder.midpoint_steps,
            focus: Focus::Coherent,
            depth_range: core.depth.range,
            least_confidence: core.depth.least_confidence,
            keep_standing: core.keep_standing,
            threads: core.threads.map(NonZeroUsize::get),
            most_pixels: core.most_pixels,
            backend: core.backend,
            depth_network: None,
        }
    }
}

impl From<&EncoderOptions> for phasefront::EncoderOptions {
    fn from(options: &EncoderOptions) -> Self {
        let defaults = phasefront::EncoderOptions::from(match &options.encoding {
            Encoding::DoublePhase => phasefront::Encoding::DoublePhase,
            Encoding::AntiAlias { sigma, width } => phasefront::Encoding::AntiAlias {
                sigma: *sigma,
                width: *width,
            },
            Encoding::BandLimit { k } => phasefront::Encoding::BandLimit { k: *k },
            Encoding::Deep { prefilter } => phasefront::Encoding::Deep(prefilter.core.clone()),
        });
        phasefront::EncoderOptions {
            dark_threshold: options.dark_threshold.unwrap_or(defaults.dark_threshold),
            local_steps: options.local_steps.unwrap_or(defaults.local_steps),
            midpoint_steps: options.midpoint_steps,
            brightness: match options.brightness {
                Brightness::Smoothed => phasefront::Brightness::Smoothed,
                Brightness::Fixed { scale } => phasefront::Brightness::Fixed(scale),
                Brightness::FrameMax => phasefront::Brightness::FrameMax,
            },
            ..defaults
        }
    }
}

impl TryFrom<&SessionOptions> for session::SessionOptions {
    type Error = PhasefrontError;

    fn try_from(options: &SessionOptions) -> Result<Self, PhasefrontError> {
        let target = options.target.core.clone();
        let mut encoder = phasefront::EncoderOptions::from(&EncoderOptions {
            encoding: options.encoding.clone(),
            brightness: options.brightness,
            dark_threshold: options.dark_threshold,
            local_steps: options.local_steps,
            midpoint_steps: options.midpoint_steps,
        });
        encoder.focus_steps = options.focus.steps();
        let quality_levels = (options.quality_levels.iter())
            .map(|quality_level| {
                let focus = options.focus.with_steps(quality_level.focus_steps)?;
                let method = quality_level.method.core(&target.display, focus)?;
                focus.check(&method)?;
                Ok(session::QualityLevel {
                    method,
                    size: Size {
                        width: quality_level.width,
                        height: quality_level.height,
                    },
                    backend: None,
                    encoder: Some(phasefront::EncoderOptions {
                        local_steps: quality_level.local_steps.unwrap_or(encoder.local_steps),
                        midpoint_steps: quality_level.midpoint_steps.unwrap_or(encoder.midpoint_steps),
                        focus_steps: focus.steps(),
                        ..encoder.clone()
                    }),
                })
            })
            .collect::<Result<Vec<_>, PhasefrontError>>()?;
        let Some(best) = quality_levels.first() else {
            return Err(PhasefrontError::Setting(
                "there are no quality levels; give at least one: a method and a resolution".into(),
            ));
        };
        let mut to = session::SessionOptions::new(target, best.method.clone());
        to.quality = options.quality.into();
        to.target_rate_hz = options.target_rate_hz;
        to.encoder = encoder;
        to.quality_levels = quality_levels;
        to.depth.range = options.depth_range;
        to.depth.least_confidence = options.least_confidence;
        to.keep_standing = options.keep_standing;
        #[cfg(feature = "tract")]
        {
            to.depth_network = options.depth_network.as_ref().map(|network| network.core.clone());
        }
        to.backend = options.backend;
        to.most_pixels = options.most_pixels;
        to.threads = match options.threads {
            None => None,
            Some(threads) => Some(NonZeroUsize::new(threads).ok_or_else(|| {
                PhasefrontError::Setting("0 threads compute nothing; give at least 1, or none for all".into())
            })?),
        };
        Ok(to)
    }
}

impl From<Quality> for session::Quality {
    fn from(quality: Quality) -> Self {
        match quality {
            Quality::Adaptive => session::Quality::Adaptive,
            Quality::Fixed { quality_level } => session::Quality::Fixed(quality_level),
        }
    }
}
