//! The target of holograms.

use crate::pointer::{bytes, free, give, object, read, text};
use crate::status::{PfStatus, Result, call};
use phasefront_ffi::{Display, Target, display_from_toml};
use std::ffi::c_char;
use std::sync::Arc;

/// The target of holograms: a display and its calibration, if there is one: the modulator's response to phases, the
/// light of the lasers, and the correction of the optics. It is immutable and can be used by several sessions.
pub struct PfTarget(pub(crate) Arc<Target>);

fn given(target: Arc<Target>) -> *mut PfTarget {
    object(PfTarget(target))
}

/// # Safety
/// As [`text`].
unsafe fn display(toml: *const c_char) -> Result<Display> {
    // SAFETY: the caller's promise.
    display_from_toml(unsafe { text(toml, "toml") }?.to_owned())
}

/// Creates the target for a display in TOML, such as "width = 1920\npitch_um = 8.0", whose levels are equal steps of
/// phase. Missing keys have default values, so "" is the default display.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_target_from_toml(toml: *const c_char, target: *mut *mut PfTarget) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe { give(target, "target", || Ok(given(Target::of_display(display(toml)?)?))) })
}

/// Creates the target for a display in TOML whose modulator was calibrated as a whole. There are 256 levels; the level
/// at i displays the phase 2*pi*i/256.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_target_with_look_up_table(
    toml: *const c_char,
    levels: *const u8,
    count: usize,
    target: *mut *mut PfTarget,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(target, "target", || {
            let levels = bytes(levels, count, "levels")?.to_vec();
            Ok(given(Target::with_look_up_table(display(toml)?, levels)?))
        })
    })
}

/// Reads a target from the bytes of a calibration file, as `phasefront calibrate pack` writes it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_target_from_bytes(file: *const u8, length: usize, target: *mut *mut PfTarget) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(target, "target", || {
            Ok(given(Target::from_bytes(bytes(file, length, "file")?)?))
        })
    })
}

/// Reads a target from a calibration file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_target_from_file(path: *const c_char, target: *mut *mut PfTarget) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(target, "target", || {
            Ok(given(Target::from_file(text(path, "path")?.to_owned())?))
        })
    })
}

/// Returns the number of pixels of the modulator along x and y.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_target_size(target: *const PfTarget, width: *mut u32, height: *mut u32) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        let display = read(target, "target")?.0.display();
        give(width, "width", || {
            give(height, "height", || Ok(display.height as u32)).map(|()| display.width as u32)
        })
    })
}

/// Frees a target. Sessions and options that were created for it are not affected.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_target_free(target: *mut PfTarget) {
    // SAFETY: the rules of this border.
    unsafe { free(target) };
}
