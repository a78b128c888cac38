//! Modulators by name or by their TOML file, and the images that their inputs take.

use crate::error::{Answer, of_core};
use crate::hologram::{RawHologram, copied, size};
use crate::target::RawTarget;
use js_sys::{Object, Uint8Array};
use phasefront::output::{Layout, ModulatorSpec};
use wasm_bindgen::prelude::*;

/// A modulator.
#[wasm_bindgen]
pub struct RawModulator(ModulatorSpec);

#[wasm_bindgen]
impl RawModulator {
    /// Returns the names of the modulators that the module knows.
    pub fn names() -> Vec<String> {
        ModulatorSpec::names().map(str::to_owned).collect()
    }

    /// Returns the modulator called `name`.
    ///
    /// # Errors
    /// Throws an error of kind `display` for another name.
    pub fn named(name: &str) -> Answer<RawModulator> {
        ModulatorSpec::shipped(name).map(RawModulator).map_err(of_core)
    }

    /// Reads a modulator's file.
    ///
    /// # Errors
    /// Throws an error of kind `display` if the text is not a modulator.
    #[wasm_bindgen(js_name = fromToml)]
    pub fn from_toml(text: &str) -> Answer<RawModulator> {
        ModulatorSpec::from_toml(text).map(RawModulator).map_err(of_core)
    }

    /// Returns the target of holograms for the modulator.
    ///
    /// # Errors
    /// Throws an error of kind `display` if levels of more than 8 bits are not evenly spaced.
    pub fn target(&self) -> Answer<RawTarget> {
        let core = self.0.target().map_err(of_core)?;
        Ok(RawTarget { core })
    }

    /// Returns the size of the images that its input takes: an object of the form `OutputSize`.
    #[wasm_bindgen(js_name = outputSize)]
    pub fn output_size(&self) -> Object {
        size(self.0.output_size())
    }

    /// Writes image `image` of those that its input takes of `hologram` into `to`, whose rows begin `row_stride` bytes
    /// apart.
    ///
    /// # Errors
    /// Throws an error of kind `setting` if there is no such image, it does not fit, or the hologram is for another
    /// modulator.
    #[wasm_bindgen(js_name = writeOutput)]
    pub fn write_output(&self, hologram: &RawHologram, image: u32, to: &Uint8Array, row_stride: u32) -> Answer<()> {
        let hologram = hologram.here()?;
        let input = self.0.input(hologram.size(), hologram.target()).map_err(of_core)?;
        let all = self.0.output_size();
        let row = all.size.width * all.pixel_bytes;
        copied(to, row_stride, (all.size.height, row), |bytes| {
            input.write(hologram.output_levels(), image as usize, bytes, row)
        })
    }

    /// Writes the same image in the pixels of a screen that drives the modulator, red, green, blue and alpha. The red,
    /// green and blue of a grey image are its level.
    ///
    /// # Errors
    /// Throws an error of kind `setting` in the cases of [`Self::write_output`], and for images of 16 bits.
    #[wasm_bindgen(js_name = writePixels)]
    pub fn write_pixels(&self, hologram: &RawHologram, image: u32, to: &Uint8Array, row_stride: u32) -> Answer<()> {
        let hologram = hologram.here()?;
        let input = self.0.input(hologram.size(), hologram.target()).map_err(of_core)?;
        let all = self.0.output_size();
        let row = 4 * all.size.width;
        copied(to, row_stride, (all.size.height, row), |bytes| {
            input.write_pixels(hologram.output_levels(), image as usize, Layout::Rgba, bytes, row)
        })
    }
}
