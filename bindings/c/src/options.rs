//! The options of a session.

use crate::network::{PfDepthNetwork, PfNetwork};
use crate::pointer::{Extensible, change, free, give, object, pick, read, read_sized};
use crate::status::{PfStatus, Result, call};
use crate::target::PfTarget;
use phasefront_ffi::{
    Backend, Brightness, DepthRange, Encoding, Focus, Method, PhasefrontError, QualityLevel, SessionOptions,
    session_options,
};

/// The method that computes holograms.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfMethod {
    /// The network for frames whose depth has soft edges, and the plane sweep for all others. Without a network, the
    /// built-in one, or the plane sweep alone if that network was not trained for the display. This is the default.
    Auto = 0,
    /// A trained network.
    Trained = 1,
    /// The plane sweep, which suits any display and needs no training.
    Sweep = 2,
}

/// The backend that computes frames.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfBackend {
    /// Computes on the CPU.
    Cpu = 0,
    /// Computes on the GPU if this library was built with GPU support, a GPU exists and its results agree with the
    /// CPU's; otherwise on the CPU.
    Gpu = 1,
}

const BACKENDS: [Backend; 2] = [Backend::Cpu, Backend::Gpu];

/// A quality level: a method, a resolution and the number of correction steps.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfQualityLevel {
    /// The size of this struct, sizeof(PfQualityLevel). Set it before the call.
    pub size: usize,
    /// The method, a PfMethod.
    pub method: u32,
    /// The network of PF_METHOD_TRAINED; of PF_METHOD_AUTO, or NULL for the built-in one; otherwise NULL.
    pub network: *const PfNetwork,
    /// The width of the hologram in pixels.
    pub width: u32,
    /// The height of the hologram in pixels.
    pub height: u32,
    /// The number of local steps; negative for the session's number.
    pub local_steps: i32,
    /// The number of steps at the midpoint; negative for the session's number.
    pub midpoint_steps: i32,
    /// The number of steps of natural focus, in a session with natural focus; negative for the session's number. 0 in
    /// other sessions.
    pub focus_steps: i32,
}

// SAFETY: its first field is its size.
unsafe impl Extensible for PfQualityLevel {
    const NAME: &'static str = "PfQualityLevel";
}

/// The options of a session.
pub struct PfOptions(pub(crate) SessionOptions);

/// # Safety
/// `network` is NULL or valid.
unsafe fn method_of(method: u32, network: *const PfNetwork) -> Result<Method> {
    // SAFETY: the caller's promise.
    let given = || unsafe { read(network, "network") }.map(|network| network.0.clone());
    Ok(match method {
        0 if network.is_null() => Method::Auto { network: None },
        0 => Method::Auto {
            network: Some(given()?),
        },
        1 => Method::Trained { network: given()? },
        2 => Method::Sweep,
        other => return Err(PhasefrontError::Setting(format!("method is {other}; it is 0 to 2"))),
    })
}

/// Creates the default options for `target`: holograms at its modulator's resolution by `method`, a PfMethod. `network`
/// is the method's network; NULL for the plane sweep, and for PF_METHOD_AUTO with the built-in one.
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
            Ok(object(PfOptions(session_options(
                target,
                Some(method_of(method, network)?),
            )?)))
        })
    })
}

/// Frees options. Sessions that were created from them are not affected.
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

/// Removes all quality levels. Push at least one afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_clear_quality_levels(options: *mut PfOptions) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { set(options, |options| options.quality_levels.clear()) }
}

/// Adds a quality level below the existing ones. A session takes at most 16.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_push_quality_level(
    options: *mut PfOptions,
    quality_level: *const PfQualityLevel,
) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe {
        try_set(options, |options| {
            let quality_level = read_sized(quality_level, "quality_level")?;
            options.quality_levels.push(QualityLevel {
                method: method_of(quality_level.method, quality_level.network)?,
                width: quality_level.width as usize,
                height: quality_level.height as usize,
                local_steps: usize::try_from(quality_level.local_steps).ok(),
                midpoint_steps: usize::try_from(quality_level.midpoint_steps).ok(),
                focus_steps: usize::try_from(quality_level.focus_steps).ok(),
            });
            Ok(())
        })
    }
}

/// Sets the target rate in frames per second. With 0, a session takes every frame and does not adapt its quality level
/// to frame times.
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

/// Selects double phase of the unchanged field.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_double_phase(options: *mut PfOptions) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { encode(options, Encoding::DoublePhase) }
}

/// Selects double phase after a small Gaussian blur of `sigma` pixels with `width` taps (AA-DPM); 0.7 and 3 in the
/// paper.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_anti_alias(options: *mut PfOptions, sigma: f32, width: u32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe {
        encode(
            options,
            Encoding::AntiAlias {
                sigma,
                width: width as usize,
            },
        )
    }
}

/// Selects double phase after a filter that removes high diagonal frequencies (BL-DPM). `k` is the bound of
/// |tan(pi*fx)*tan(pi*fy)|; 1 in the paper.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_band_limit(options: *mut PfOptions, k: f32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { encode(options, Encoding::BandLimit { k }) }
}

/// Selects double phase after a pre-filter network (DDPM), which was trained together with the hologram network for the
/// offset of the display.
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

/// Sets the network that estimates the depth of frames without depth. A live session runs it on its own thread, at the
/// network's own rate; other sessions run it for each frame.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_depth_network(
    options: *mut PfOptions,
    network: *const PfDepthNetwork,
) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe {
        try_set(options, |options| {
            options.depth_network = Some(read(network, "network")?.0.clone());
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

/// Maps an amplitude near the frame's largest to full light. It changes smoothly from frame to frame. This is the
/// default.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_brightness_smoothed(options: *mut PfOptions) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { brighten(options, Brightness::Smoothed) }
}

/// Maps the amplitude `scale` to full light. Larger amplitudes are clipped.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_brightness_fixed(options: *mut PfOptions, scale: f32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { brighten(options, Brightness::Fixed { scale }) }
}

/// Maps the frame's largest amplitude to full light.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_brightness_frame_max(options: *mut PfOptions) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { brighten(options, Brightness::FrameMax) }
}

/// Sets the share of full light, 0 to 1, below which phases are drawn to 0, which reduces coloured speckle in dark
/// areas. The encoding's default is 0.4, and 0 with a pre-filter.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_dark_threshold(options: *mut PfOptions, threshold: f32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { set(options, |options| options.dark_threshold = Some(threshold)) }
}

/// Sets the number of correction steps, 0 to 8. Each step draws the displayed image toward the wanted field. The
/// encoding's default is 1, and 0 with a pre-filter.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_local_steps(options: *mut PfOptions, steps: u32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { set(options, |options| options.local_steps = Some(steps as usize)) }
}

/// Sets the number of correction steps at the midpoint, 0 to 100. Each step costs four transforms per colour: 3 suit
/// stills; 1 suits video, where each frame continues from the previous one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_midpoint_steps(options: *mut PfOptions, steps: u32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { set(options, |options| options.midpoint_steps = steps as usize) }
}

/// Sets natural focus: what is out of focus is soft, as in the world. `steps` follow the method, 0 to 1000, each of two
/// transforms for each plane and colour; 30 bring most of the gain in stills. Without steps, as live frames need it,
/// PF_METHOD_AUTO without a network takes the built-in network for natural focus. The default is coherent focus: what
/// is out of focus has halos and rings, as a laser shows it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_natural_focus(options: *mut PfOptions, steps: u32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe {
        set(options, |options| {
            options.focus = Focus::Natural { steps: steps as usize }
        })
    }
}

/// Sets the distances, in metres, that map to the ends of the volume. The default is the 1st and 99th percentile of the
/// readings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_depth_range(options: *mut PfOptions, near_m: f32, far_m: f32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe {
        set(options, |options| {
            options.depth_range = DepthRange::Fixed { near_m, far_m }
        })
    }
}

/// Sets the confidence, in 0 to 1, below which readings are ignored. ARKit's "low" is 0, "medium" 0.5, "high" 1.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_least_confidence(options: *mut PfOptions, confidence: f32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { set(options, |options| options.least_confidence = confidence) }
}

/// Sets whether what stands still in a video keeps its wave on the CPU: a frame computes only the parts where colour or
/// depth have changed by more than a camera's noise. The default is true.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_keep_standing(options: *mut PfOptions, keep: bool) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { set(options, |options| options.keep_standing = keep) }
}

/// Sets the number of threads to compute with, 1 to 256. The default is as many as the device has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_threads(options: *mut PfOptions, threads: u32) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe { set(options, |options| options.threads = Some(threads as usize)) }
}

/// Sets the maximum number of pixels of a quality level and of the modulator; 8192x4096 by default. The memory of a
/// session is a multiple of it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_options_set_most_pixels(options: *mut PfOptions, pixels: u64) -> PfStatus {
    // SAFETY: the rules of this border.
    unsafe {
        set(options, |options| {
            options.most_pixels = usize::try_from(pixels).unwrap_or(usize::MAX)
        })
    }
}

/// Sets the backend that computes frames, a PfBackend.
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
