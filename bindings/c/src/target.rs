//! What holograms are made for.

use crate::pointer::{bytes, free, give, object, read, text};
use crate::status::{PfStatus, Result, call};
use phasefront_ffi::{Display, Target, display_from_toml};
use std::ffi::c_char;
use std::sync::Arc;

/// What holograms are made for: a display and, where it is calibrated, what its modulator answers to a phase, its
/// lasers' light, what corrects its optics. Immutable; one serves many sessions.
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

/// A display with levels in equal steps of phase, in TOML, as "width = 1920\npitch_um = 8.0"; what is left out has the
/// default value, so "" is the default display.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_target_from_toml(toml: *const c_char, target: *mut *mut PfTarget) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe { give(target, "target", || Ok(given(Target::of_display(display(toml)?)?))) })
}

/// A display, as in pf_target_from_toml, whose modulator was calibrated as a whole: of 256 levels the one at i shows
/// the phase 2*pi*i/256.
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

/// The bytes of a calibration's file, as `phasefront calibrate pack` writes it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_target_from_bytes(file: *const u8, length: usize, target: *mut *mut PfTarget) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(target, "target", || {
            Ok(given(Target::from_bytes(bytes(file, length, "file")?)?))
        })
    })
}

/// A calibration's file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_target_from_file(path: *const c_char, target: *mut *mut PfTarget) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(target, "target", || {
            Ok(given(Target::from_file(text(path, "path")?.to_owned())?))
        })
    })
}

/// Pixels of its modulator.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_target_size(target: *const PfTarget, width: *mut u32, height: *mut u32) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        let display = read(target, "target")?.0.display()?;
        give(width, "width", || {
            give(height, "height", || Ok(display.height)).map(|()| display.width)
        })
    })
}

/// Ends a target. Sessions and options that were made for it go on.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_target_free(target: *mut PfTarget) {
    // SAFETY: the rules of this border.
    unsafe { free(target) };
}
