//! Modulators by name or by their TOML file, and the images that their inputs take.

use crate::hologram::{LAYOUTS, PfHologram, PfMemory, PfOutputSize};
use crate::pointer::{free, give, object, pick, read, text};
use crate::status::{PfStatus, call};
use crate::target::PfTarget;
use phasefront_ffi::RawModulator;
use std::ffi::c_char;
use std::sync::Arc;

/// A modulator: its display, the phases of its levels, and the images that its input takes.
pub struct PfModulator(Arc<RawModulator>);

/// Creates a modulator that the command `phasefront devices` lists, such as "holoeye-pluto".
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_modulator_named(name: *const c_char, modulator: *mut *mut PfModulator) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(modulator, "modulator", || {
            let modulator = RawModulator::named(text(name, "name")?.to_owned())?;
            Ok(object(PfModulator(modulator)))
        })
    })
}

/// Creates a modulator of the text of its file, with keys such as packing and levels_turns.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_modulator_from_toml(toml: *const c_char, modulator: *mut *mut PfModulator) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(modulator, "modulator", || {
            let modulator = RawModulator::from_toml(text(toml, "toml")?.to_owned())?;
            Ok(object(PfModulator(modulator)))
        })
    })
}

/// Creates the target of holograms for a modulator.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_modulator_target(modulator: *const PfModulator, target: *mut *mut PfTarget) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(target, "target", || {
            Ok(object(PfTarget(read(modulator, "modulator")?.0.target())))
        })
    })
}

/// Returns the size of the images that a modulator's input takes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_modulator_output_size(modulator: *const PfModulator, size: *mut PfOutputSize) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(size, "size", || {
            Ok(read(modulator, "modulator")?.0.output_size().into())
        })
    })
}

/// Writes image `number` of those that a modulator's input takes of a hologram into memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_modulator_write_output(
    modulator: *const PfModulator,
    hologram: *const PfHologram,
    number: u32,
    memory: PfMemory,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        let hologram = read(hologram, "hologram")?.0.clone();
        (read(modulator, "modulator")?.0).write_output(hologram, number as usize, memory.into())
    })
}

/// Writes the same image in the pixels of a screen that drives the modulator, PF_LAYOUT_RGBA or PF_LAYOUT_BGRA. The
/// red, green and blue of a grey image are its level; images of 16 bits are refused. A pixel has 4 bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_modulator_write_pixels(
    modulator: *const PfModulator,
    hologram: *const PfHologram,
    number: u32,
    layout: u32,
    memory: PfMemory,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        let layout = pick(&LAYOUTS, layout, "layout")?;
        let hologram = read(hologram, "hologram")?.0.clone();
        (read(modulator, "modulator")?.0).write_pixels(hologram, number as usize, layout, memory.into())
    })
}

/// Frees a modulator. Targets that it created are not affected.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_modulator_free(modulator: *mut PfModulator) {
    // SAFETY: the rules of this border.
    unsafe { free(modulator) };
}
