//! Phasefront for C, and for languages and frameworks that call C: C++, C#, Unity, Unreal, Flutter, Qt. This crate only
//! translates calls to `phasefront-ffi`, which serves the other languages. cbindgen generates `include/phasefront.h`
//! from this crate; the header states the rules. Numbers of C are checked before they become enums.
//!
//! # Safety
//! In every call, pointers are NULL, which is refused, or they point to as many values of their type as the length
//! beside them states, for the duration of the call. Objects were created by this library and are not yet freed.
#![allow(clippy::missing_safety_doc)]

mod frame;
mod hologram;
mod log;
mod modulator;
mod network;
mod options;
mod pointer;
mod session;
mod status;
mod target;

pub use frame::{
    PfCameras, PfColour, PfColourFormat, PfConfidence, PfConfidenceFormat, PfDepth, PfDepthFormat, PfFrame,
    PfIntrinsics, PfPlane, PfRgbEncoding, PfRotation, PfYuvMatrix,
};
pub use hologram::{
    PfFrameTimes, PfHologram, PfHologramInfo, PfLayout, PfMemory, PfOutputSize, PfPlacement, PfPlanes, PfPlanesInfo,
    pf_hologram_field, pf_hologram_free, pf_hologram_info, pf_hologram_levels, pf_hologram_output_size,
    pf_hologram_refocus, pf_hologram_write_output, pf_hologram_write_preview, pf_hologram_z_at, pf_planes_free,
    pf_planes_info,
};
pub use log::{PfLogLevel, PfOnLog, pf_set_log_listener};
pub use modulator::{
    PfModulator, pf_modulator_free, pf_modulator_from_toml, pf_modulator_named, pf_modulator_output_size,
    pf_modulator_target, pf_modulator_write_output, pf_modulator_write_pixels,
};
pub use network::{
    PfColourScale, PfDepthNetwork, PfNetwork, pf_depth_network_free, pf_depth_network_from_bytes, pf_network_built_in,
    pf_network_free, pf_network_from_bytes, pf_network_from_file,
};
pub use options::{
    PfBackend, PfMethod, PfOptions, PfQualityLevel, pf_options_clear_quality_levels, pf_options_free, pf_options_new,
    pf_options_push_quality_level, pf_options_set_anti_alias, pf_options_set_backend, pf_options_set_band_limit,
    pf_options_set_brightness_fixed, pf_options_set_brightness_frame_max, pf_options_set_brightness_smoothed,
    pf_options_set_dark_threshold, pf_options_set_deep, pf_options_set_depth_network, pf_options_set_depth_range,
    pf_options_set_double_phase, pf_options_set_keep_standing, pf_options_set_least_confidence,
    pf_options_set_local_steps, pf_options_set_midpoint_steps, pf_options_set_most_pixels,
    pf_options_set_natural_focus, pf_options_set_target_rate_hz, pf_options_set_threads,
};
pub use session::{
    PfDropReason, PfListener, PfQualityChange, PfQualityReason, PfRunningMode, PfSession, PfStatistics, PfThermal,
    pf_session_fix_quality_level, pf_session_free, pf_session_new, pf_session_pause, pf_session_process,
    pf_session_reset, pf_session_resume, pf_session_set_thermal, pf_session_statistics, pf_session_step_by_itself,
    pf_session_submit, pf_session_warm_up,
};
pub use status::{PfStatus, pf_last_error, pf_third_party_notices, pf_version};
pub use target::{
    PfTarget, pf_target_free, pf_target_from_bytes, pf_target_from_file, pf_target_from_toml, pf_target_size,
    pf_target_with_look_up_table,
};
