//! What a session makes, and how.

use crate::error::{PhasefrontError, guard};
use crate::network::Network;
use crate::target::Target;
use phasefront::{Sweep, input, output, session};
use std::num::NonZeroUsize;
use std::sync::Arc;

/// How a session runs; fixed when it is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum RunningMode {
    /// Each frame is answered by itself.
    Image,
    /// Each frame is answered; depth and brightness are smoothed over time. Timestamps must rise.
    Video,
    /// Frames are submitted without waiting, and the listener hears what becomes of them. Timestamps must rise.
    Live,
}

/// How the field becomes phases.
#[derive(Debug, Clone, uniffi::Enum)]
pub enum Encoding {
    /// Double phase on the field as it is.
    DoublePhase,
    /// A small Gaussian blur first (AA-DPM).
    AntiAlias {
        /// Standard deviation, pixels; 0.7 as published.
        sigma: f32,
        /// Taps, an odd number; 3 as published.
        width: u32,
    },
    /// High diagonal frequencies cut first (BL-DPM).
    BandLimit {
        /// The bound of |tan(πfx)·tan(πfy)|, f in cycles a pixel; 1 as published.
        k: f32,
    },
    /// A pre-filter network first (DDPM), trained for the display's offset together with the hologram network.
    Deep {
        /// The pre-filter.
        prefilter: Arc<Network>,
    },
}

/// Which amplitude full light stands for.
#[derive(Debug, Clone, Copy, PartialEq, uniffi::Enum)]
pub enum Brightness {
    /// Near the frame's largest, moving smoothly from frame to frame, so that video does not flicker.
    Smoothed,
    /// This one; what is brighter is clipped.
    Fixed {
        /// The amplitude.
        scale: f32,
    },
    /// The frame's largest.
    FrameMax,
}

/// Which metres are shown at the ends of the volume.
#[derive(Debug, Clone, Copy, PartialEq, uniffi::Enum)]
pub enum DepthRange {
    /// The 1st and 99th percentile of the readings, in video smoothed.
    Percentiles,
    /// These.
    Fixed {
        /// Metres shown nearest.
        near_m: f32,
        /// Metres shown farthest.
        far_m: f32,
    },
}

/// What makes holograms.
#[derive(Debug, Clone, uniffi::Enum)]
pub enum Method {
    /// A trained network.
    Trained {
        /// The network, for the session's display.
        network: Arc<Network>,
    },
    /// The plane sweep, for any display: slower, and nothing needs to be trained.
    Sweep,
    /// For each frame what suits its depth: the plane sweep where it is clean, as rendered depth is, the trained
    /// network where it is noisy or incomplete, as sensors' depth is.
    Auto {
        /// The network, for the session's display.
        network: Arc<Network>,
    },
}

/// One quality: a method, a resolution, and how the displayed image is corrected. A hologram smaller than the modulator
/// is shown in its middle.
#[derive(Debug, Clone, uniffi::Record)]
pub struct QualityLevel {
    /// What makes the hologram.
    pub method: Method,
    /// Width of the hologram, pixels.
    pub width: u32,
    /// Height of the hologram, pixels.
    pub height: u32,
    /// Local steps of this quality level; none for the session's.
    #[uniffi(default = None)]
    pub local_steps: Option<u32>,
    /// Steps at the midpoint of this quality level; none for the session's.
    #[uniffi(default = None)]
    pub midpoint_steps: Option<u32>,
}

/// Whether a session may change its quality.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum Quality {
    /// It changes the quality level: down where frames take longer than the target rate allows or the device is hot, up
    /// where there is room.
    Adaptive,
    /// It stays at this quality level.
    Fixed {
        /// 0 the best.
        quality_level: u32,
    },
}

/// How hot the device is, as its system says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum Thermal {
    /// Not warm: nothing is limited.
    Nominal,
    /// Warm: frames may take a little less time.
    Fair,
    /// Hot: half the time.
    Serious,
    /// Too hot: the lowest quality level.
    Critical,
}

/// Where frames are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum Backend {
    /// On the CPU.
    Cpu,
    /// On the GPU, where this library was built for it, there is one and it answers as the CPU does; else on the CPU.
    /// The statistics' `backend` and `backend_why` say which it is, and why.
    Gpu,
}

/// What a session makes, and how. [`session_options`] gives the defaults; change what differs.
#[derive(Debug, Clone, uniffi::Record)]
pub struct SessionOptions {
    /// What holograms are for.
    pub target: Arc<Target>,
    /// Quality levels, the best first: 1 to 16.
    pub quality_levels: Vec<QualityLevel>,
    /// Whether the session may change its quality level by itself.
    pub quality: Quality,
    /// Frames a second that are aimed at; none takes every frame and never steps.
    pub target_rate_hz: Option<f64>,
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
    pub local_steps: Option<u32>,
    /// Steps of correction at the midpoint, 0 to 100, each of which costs four transforms a colour: 3 for stills, 1 for
    /// video, where it goes on from the frame before.
    #[uniffi(default = 0)]
    pub midpoint_steps: u32,
    /// Which metres are shown at the ends of the volume.
    pub depth_range: DepthRange,
    /// Readings less sure than this, in 0..=1, are none. ARKit's "low" is 0, "medium" ½, "high" 1.
    pub least_confidence: f32,
    /// Threads to compute with, at most 256; none for as many as the device has.
    pub threads: Option<u32>,
    /// Most pixels of a quality level and of the modulator, 8192×4096 unless it is set: what a session allocates is a
    /// multiple of them.
    #[uniffi(default = 33554432)]
    pub most_pixels: u64,
    /// Where frames are computed.
    pub backend: Backend,
}

/// How the levels of the colours lie in images for a modulator's driver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum Layout {
    /// One image, bytes red, green, blue.
    Rgb,
    /// One image, bytes red, green, blue, alpha 255.
    Rgba,
    /// One image, bytes blue, green, red, alpha 255.
    Bgra,
    /// An image for each colour, one after another: red, green, blue; a byte a pixel.
    Grey,
}

/// How a hologram is put on its modulator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Record)]
pub struct Placement {
    /// How colours lie in images.
    pub layout: Layout,
    /// Whether left and right are exchanged, of the whole image.
    #[uniffi(default = false)]
    pub flip_x: bool,
    /// Whether top and bottom are exchanged, of the whole image.
    #[uniffi(default = false)]
    pub flip_y: bool,
    /// How many pixels to the right of the middle the hologram stands, before flips.
    #[uniffi(default = 0)]
    pub shift_x: i32,
    /// How many pixels below the middle it stands, before flips.
    #[uniffi(default = 0)]
    pub shift_y: i32,
}

impl From<Placement> for output::Placement {
    fn from(placement: Placement) -> Self {
        output::Placement {
            layout: match placement.layout {
                Layout::Rgb => output::Layout::Rgb,
                Layout::Rgba => output::Layout::Rgba,
                Layout::Bgra => output::Layout::Bgra,
                Layout::Grey => output::Layout::Grey,
            },
            flip_x: placement.flip_x,
            flip_y: placement.flip_y,
            shift_x: placement.shift_x,
            shift_y: placement.shift_y,
        }
    }
}

impl Method {
    fn core(&self, display: &phasefront::Display) -> phasefront::Method {
        match self {
            Method::Trained { network } => phasefront::Method::trained(network.core.clone()),
            Method::Sweep => phasefront::Method::Sweep(Sweep::for_display(display)),
            Method::Auto { network } => phasefront::Method::Auto(Sweep::for_display(display), network.core.clone()),
        }
    }
}

/// The default options for `target`: holograms of its modulator's resolution by `method` and AA-DPM with one step of
/// correction, or, without a method, by the network that is built in, by the plane sweep where it was not trained for
/// the display; smoothed brightness, near and far by percentiles.
#[uniffi::export(default(method = None))]
pub fn session_options(target: Arc<Target>, method: Option<Method>) -> Result<SessionOptions, PhasefrontError> {
    guard(|| {
        let defaults = match &method {
            Some(method) => {
                let method = method.core(&target.core.display);
                session::SessionOptions::new(target.core.clone(), method)
            }
            None => default_options(&target.core),
        };
        Ok(SessionOptions::new(target, defaults))
    })
}

#[cfg(feature = "built-in-network")]
fn default_options(target: &phasefront::Target) -> session::SessionOptions {
    phasefront_models::session_options(target.clone())
}

#[cfg(not(feature = "built-in-network"))]
fn default_options(target: &phasefront::Target) -> session::SessionOptions {
    let sweep = Sweep::for_display(&target.display);
    session::SessionOptions::new(target.clone(), phasefront::Method::Sweep(sweep))
}

impl SessionOptions {
    /// Those of the core, for the same `target`.
    fn new(target: Arc<Target>, core: session::SessionOptions) -> Self {
        let network = |core: &Arc<phasefront::Network>| Arc::new(Network { core: core.clone() });
        let method = |method: &phasefront::Method| match method {
            phasefront::Method::Network(core) | phasefront::Method::Seeded(core) => {
                Method::Trained { network: network(core) }
            }
            phasefront::Method::Auto(_, core) => Method::Auto { network: network(core) },
            _ => Method::Sweep,
        };
        SessionOptions {
            target,
            quality_levels: (core.quality_levels.iter())
                .map(|quality_level| QualityLevel {
                    method: method(&quality_level.method),
                    width: quality_level.width as u32,
                    height: quality_level.height as u32,
                    local_steps: None,
                    midpoint_steps: None,
                })
                .collect(),
            quality: match core.quality {
                session::Quality::Adaptive => Quality::Adaptive,
                session::Quality::Fixed(quality_level) => Quality::Fixed {
                    quality_level: quality_level as u32,
                },
            },
            target_rate_hz: core.target_rate_hz,
            encoding: match &core.encoder.encoding {
                phasefront::Encoding::AntiAlias { sigma, width } => Encoding::AntiAlias {
                    sigma: *sigma,
                    width: *width as u32,
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
            midpoint_steps: core.encoder.midpoint_steps as u32,
            depth_range: match core.depth.range {
                input::DepthRange::Percentiles => DepthRange::Percentiles,
                input::DepthRange::Fixed { near_m, far_m } => DepthRange::Fixed { near_m, far_m },
            },
            least_confidence: core.depth.least_confidence,
            threads: core.threads.map(|threads| threads.get() as u32),
            most_pixels: core.most_pixels as u64,
            backend: match core.backend {
                session::Backend::Cpu => Backend::Cpu,
                session::Backend::Gpu => Backend::Gpu,
            },
        }
    }
}

impl TryFrom<&SessionOptions> for session::SessionOptions {
    type Error = PhasefrontError;

    fn try_from(options: &SessionOptions) -> Result<Self, PhasefrontError> {
        let [best, ..] = options.quality_levels.as_slice() else {
            return Err(PhasefrontError::Setting(
                "there are no quality levels; give at least one: a method and a resolution".into(),
            ));
        };
        let target = options.target.core.clone();
        let method = |quality_level: &QualityLevel| quality_level.method.core(&target.display);
        let mut to = session::SessionOptions::new(target.clone(), method(best));
        to.quality = options.quality.into();
        to.target_rate_hz = options.target_rate_hz;
        let steps = |asked: Option<u32>, defaults: usize| asked.map_or(defaults, |steps| steps as usize);
        let defaults = phasefront::EncoderOptions::from(match &options.encoding {
            Encoding::DoublePhase => phasefront::Encoding::DoublePhase,
            Encoding::AntiAlias { sigma, width } => phasefront::Encoding::AntiAlias {
                sigma: *sigma,
                width: *width as usize,
            },
            Encoding::BandLimit { k } => phasefront::Encoding::BandLimit { k: *k },
            Encoding::Deep { prefilter } => phasefront::Encoding::Deep(prefilter.core.clone()),
        });
        to.encoder = phasefront::EncoderOptions {
            dark_threshold: options.dark_threshold.unwrap_or(defaults.dark_threshold),
            local_steps: steps(options.local_steps, defaults.local_steps),
            midpoint_steps: options.midpoint_steps as usize,
            ..defaults
        };
        to.encoder.brightness = match options.brightness {
            Brightness::Smoothed => phasefront::Brightness::Smoothed,
            Brightness::Fixed { scale } => phasefront::Brightness::Fixed(scale),
            Brightness::FrameMax => phasefront::Brightness::FrameMax,
        };
        to.quality_levels = (options.quality_levels.iter())
            .map(|quality_level| session::QualityLevel {
                method: method(quality_level),
                height: quality_level.height as usize,
                width: quality_level.width as usize,
                backend: None,
                encoder: Some(phasefront::EncoderOptions {
                    local_steps: steps(quality_level.local_steps, to.encoder.local_steps),
                    midpoint_steps: steps(quality_level.midpoint_steps, to.encoder.midpoint_steps),
                    ..to.encoder.clone()
                }),
            })
            .collect();
        to.depth.range = match options.depth_range {
            DepthRange::Percentiles => input::DepthRange::Percentiles,
            DepthRange::Fixed { near_m, far_m } => input::DepthRange::Fixed { near_m, far_m },
        };
        to.depth.least_confidence = options.least_confidence;
        to.backend = match options.backend {
            Backend::Cpu => session::Backend::Cpu,
            Backend::Gpu => session::Backend::Gpu,
        };
        to.most_pixels = usize::try_from(options.most_pixels).unwrap_or(usize::MAX);
        to.threads = match options.threads {
            None => None,
            Some(threads) => Some(NonZeroUsize::new(threads as usize).ok_or_else(|| {
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
            Quality::Fixed { quality_level } => session::Quality::Fixed(quality_level as usize),
        }
    }
}

impl From<Thermal> for session::Thermal {
    fn from(thermal: Thermal) -> Self {
        match thermal {
            Thermal::Nominal => session::Thermal::Nominal,
            Thermal::Fair => session::Thermal::Fair,
            Thermal::Serious => session::Thermal::Serious,
            Thermal::Critical => session::Thermal::Critical,
        }
    }
}
