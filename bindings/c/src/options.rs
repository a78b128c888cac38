//! What a session makes, and how.

use crate::network::PfNetwork;
use crate::pointer::{change, free, give, object, pick, read};
use crate::status::{PfStatus, Result, call};
use crate::target::PfTarget;
use phasefront_ffi::{
    Backend, Brightness, DepthRange, Encoding, Method, PhasefrontError, QualityLevel, SessionOptions, session_options,
};

/// What makes holograms.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfMethod {
    /// The network that is built in, or the plane sweep where it was not trained for the display.
    Default = 0,
    /// A trained network.
    Trained = 1,
    /// The plane sweep, for any display: slower, and nothing needs to be trained.
    Sweep = 2,
    /// For each frame what suits its depth: the plane sweep where it is clean, the network where it is noisy.
    Auto = 3,
}

/// Where frames are computed.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfBackend {
    /// On the CPU.
    Cpu = 0,
    /// On the GPU, where this library was built for it, there is one and it answers as the CPU does; else on the CPU.
    Gpu = 1,
}

const BACKENDS: [Backend; 2] = [Backend::Cpu, Backend::Gpu];

/// One quality: a method, a resolution, and how the displayed image is corrected.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfQualityLevel {
    /// A PfMethod but for PF_METHOD_DEFAULT.
    pub method: u32,
    /// Of PF_METHOD_TRAINED and PF_METHOD_AUTO; else NULL.
    pub network: *const PfNetwork,
    /// Width of the hologram, pixels.
    pub width: u32,
    /// Height of the hologram, pixels.
    pub height: u32,
    /// Local steps of this quality level; below 0 the session's.
    pub local_steps: i32,
    /// Steps at the midpoint of this quality level; below 0 the session's.
    pub midpoint_steps: i32,
}

/// What a session makes, and how.
pub struct PfOptions(pub(crate) SessionOptions);

/// # Safety
/// `network` is NULL or valid.
unsafe fn method_of(method: u32, network: *const PfNetwork) -> Result<Option<Method>> {
    // SAFETY: the caller's promise.
    let network = || unsafe { read(network, "network") }.map(|network| network.0.clone());
    Ok(match method {
        0 => None,
        1 => Some(Method::Trained { network: network()? }),
        2 => Some(Method::Sweep),
        3 => Some(Method::Auto { network: network()? }),
        other => return Err(PhasefrontError::Setting(format!("method is {other}; it is 0 to 3"))),
    })
}

/// The default options for `target`: holograms of its modulator's resolution by `method`, a PfMethod; `network` is for
/// those that take one, else NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_new(
    target: *const PfTarget,
    method: u32,
    network: *const PfNetwork,
    options: *mut *mut PfOptions,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(options, "options", || {
            let target = read(target, "target")?.0.clone();
            Ok(object(PfOptions(session_options(target, method_of(method, network)?)?)))
        })
    })
}

/// Ends options. Sessions that were made by them go on.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_free(options: *mut PfOptions) {
    // SAFETY: the rules of this border.
    unsafe { free(options) };
}

/// # Safety
/// `options` is NULL or valid.
unsafe fn try_set(options: *mut PfOptions, how: impl FnOnce(&mut SessionOptions) -> Result<()>) -> PfStatus {
    // SAFETY: the caller's promise.
    call(|| how(&mut unsafe { change(options, "options") }?.0))
}

/// # Safety
/// `options` is NULL or valid.
unsafe fn set(options: *mut PfOptions, how: impl FnOnce(&mut SessionOptions)) -> PfStatus {
    // SAFETY: the caller's promise.
    unsafe {
        try_set(options, |options| {
            how(options);
            Ok(())
        })
    }
}

/// Removes all quality levels; push at least one afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_clear_quality_levels(options: *mut PfOptions) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { set(options, |options| options.quality_levels.clear()) }
}

/// Adds a quality level, below those that are there; a session takes 16 at most.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_push_quality_level(
    options: *mut PfOptions,
    quality_level: *const PfQualityLevel,
) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe {
        try_set(options, |options| {
            let quality_level = read(quality_level, "quality_level")?;
            let method = method_of(quality_level.method, quality_level.network)?.ok_or_else(|| {
                PhasefrontError::Setting(
                    "method of a quality level is PF_METHOD_DEFAULT; name one of the others".into(),
                )
            })?;
            options.quality_levels.push(QualityLevel {
                method,
                width: quality_level.width,
                height: quality_level.height,
                local_steps: u32::try_from(quality_level.local_steps).ok(),
                midpoint_steps: u32::try_from(quality_level.midpoint_steps).ok(),
            });
            Ok(())
        })
    }
}

/// Frames a second that are aimed at; 0 takes every frame and never changes the quality level.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_target_rate_hz(options: *mut PfOptions, rate_hz: f64) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe {
        set(options, |options| {
            options.target_rate_hz = (rate_hz != 0.0).then_some(rate_hz)
        })
    }
}

/// # Safety
/// `options` is NULL or valid.
unsafe fn encode(options: *mut PfOptions, encoding: Encoding) -> PfStatus {
    // SAFETY: the caller's promise.
    unsafe { set(options, |options| options.encoding = encoding) }
}

/// Encodes by double phase on the field as it is.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_double_phase(options: *mut PfOptions) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { encode(options, Encoding::DoublePhase) }
}

/// Encodes behind a small Gaussian blur of `sigma` pixels, `width` taps (AA-DPM); 0.7 and 3 as published.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_anti_alias(options: *mut PfOptions, sigma: f32, width: u32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { encode(options, Encoding::AntiAlias { sigma, width }) }
}

/// Encodes with high diagonal frequencies cut (BL-DPM): the bound of |tan(pi*fx)*tan(pi*fy)|; 1 as published.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_band_limit(options: *mut PfOptions, k: f32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { encode(options, Encoding::BandLimit { k }) }
}

/// Encodes behind a pre-filter network (DDPM), trained for the display's offset together with the hologram network.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_deep(options: *mut PfOptions, prefilter: *const PfNetwork) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe {
        try_set(options, |options| {
            let prefilter = read(prefilter, "prefilter")?.0.clone();
            options.encoding = Encoding::Deep { prefilter };
            Ok(())
        })
    }
}

/// # Safety
/// `options` is NULL or valid.
unsafe fn brighten(options: *mut PfOptions, brightness: Brightness) -> PfStatus {
    // SAFETY: the caller's promise.
    unsafe { set(options, |options| options.brightness = brightness) }
}

/// Full light stands near the frame's largest amplitude, moving smoothly from frame to frame. The default.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_brightness_smoothed(options: *mut PfOptions) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { brighten(options, Brightness::Smoothed) }
}

/// Full light stands for the amplitude `scale`; what is brighter is clipped.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_brightness_fixed(options: *mut PfOptions, scale: f32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { brighten(options, Brightness::Fixed { scale }) }
}

/// Full light stands for the frame's largest amplitude.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_brightness_frame_max(options: *mut PfOptions) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { brighten(options, Brightness::FrameMax) }
}

/// Where the amplitude is below this share of full light, 0 to 1, phases are drawn to 0, against coloured speckle in
/// the dark. Not set, it suits the encoding: 0.4, and 0 with a pre-filter.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_dark_threshold(options: *mut PfOptions, threshold: f32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { set(options, |options| options.dark_threshold = Some(threshold)) }
}

/// Steps of correction, 0 to 8, each of which draws the displayed image toward the field that is wanted. Not set, they
/// suit the encoding: 1, and 0 with a pre-filter.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_local_steps(options: *mut PfOptions, steps: u32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { set(options, |options| options.local_steps = Some(steps)) }
}

/// Steps of correction at the midpoint, 0 to 100, each of which costs four transforms a colour: 3 for stills, 1 for
/// video, where it goes on from the frame before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_midpoint_steps(options: *mut PfOptions, steps: u32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { set(options, |options| options.midpoint_steps = steps) }
}

/// Shows these metres at the ends of the volume. Not set, they are the 1st and 99th percentile of the readings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_depth_range(options: *mut PfOptions, near_m: f32, far_m: f32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe {
        set(options, |options| {
            options.depth_range = DepthRange::Fixed { near_m, far_m }
        })
    }
}

/// Readings less sure than this, in 0 to 1, are none. ARKit's "low" is 0, "medium" 0.5, "high" 1.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_least_confidence(options: *mut PfOptions, confidence: f32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { set(options, |options| options.least_confidence = confidence) }
}

/// Threads to compute with, 1 to 256. Not set, as many as the device has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_threads(options: *mut PfOptions, threads: u32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { set(options, |options| options.threads = Some(threads)) }
}

/// Most pixels of a quality level and of the modulator, 8192x4096 unless it is set: what a session allocates is a
/// multiple.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_most_pixels(options: *mut PfOptions, pixels: u64) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { set(options, |options| options.most_pixels = pixels) }
}

/// Where frames are computed: a PfBackend.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_backend(options: *mut PfOptions, backend: u32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe {
        try_set(options, |options| {
            options.backend = pick(&BACKENDS, backend, "backend")?;
            Ok(())
        })
    }
}
