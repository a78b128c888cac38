//! Modulators by name or by their TOML file, and the images that their inputs take.

use crate::error::{PhasefrontError, guard};
use crate::hologram::{OutputSize, RawHologram, RawMemory};
use crate::target::Target;
use phasefront::Size;
use phasefront::output::{Layout, Levels, ModulatorInput, ModulatorSpec};
use phasefront::session::Hologram;
use std::sync::Arc;

/// A modulator: its display, the phases of its levels, and the images that its input takes. The layers written by hand
/// use it.
#[derive(Debug, uniffi::Object)]
pub struct RawModulator {
    core: ModulatorSpec,
    target: Arc<Target>,
}

/// Returns the names of the modulators that the library knows.
#[uniffi::export]
pub fn modulator_names() -> Vec<String> {
    ModulatorSpec::names().map(str::to_owned).collect()
}

#[uniffi::export]
impl RawModulator {
    /// Returns the modulator called `name`, one of [`modulator_names`].
    ///
    /// # Errors
    /// Returns an error for another name.
    #[uniffi::constructor]
    pub fn named(name: String) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| Self::new(ModulatorSpec::shipped(&name)?))
    }

    /// Reads a modulator's file.
    ///
    /// # Errors
    /// Returns an error if the text is not TOML, a key is unknown, a value is out of its range, or levels of more than
    /// 8 bits are not evenly spaced.
    #[uniffi::constructor]
    pub fn from_toml(text: String) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| Self::new(ModulatorSpec::from_toml(&text)?))
    }

    /// Returns the target of holograms for the modulator.
    pub fn target(&self) -> Arc<Target> {
        self.target.clone()
    }

    /// Returns the size of the images that its input takes.
    pub fn output_size(&self) -> OutputSize {
        self.core.output_size().into()
    }

    /// Writes image `image` of those that its input takes of `hologram`.
    ///
    /// # Errors
    /// Returns an error if there is no such image, it does not fit, or the hologram is larger than the modulator or for
    /// another number of lasers or bits; with bit planes, also if it has another size.
    pub fn write_output(&self, hologram: Arc<RawHologram>, image: usize, to: RawMemory) -> Result<(), PhasefrontError> {
        guard(|| {
            self.write(&hologram.core, to, |input, levels, bytes| {
                input.write(levels, image, bytes, to.row_stride)
            })
        })
    }

    /// Writes the same image in the pixels of a screen that drives the modulator, `layout` Rgba or Bgra. The red, green
    /// and blue of a grey image are its level.
    ///
    /// # Errors
    /// Returns an error in the cases of [`Self::write_output`], for another layout, and for images of 16 bits.
    pub fn write_pixels(
        &self,
        hologram: Arc<RawHologram>,
        image: usize,
        layout: Layout,
        to: RawMemory,
    ) -> Result<(), PhasefrontError> {
        guard(|| {
            self.write(&hologram.core, to, |input, levels, bytes| {
                input.write_pixels(levels, image, layout, bytes, to.row_stride)
            })
        })
    }

    /// Reads the levels of a hologram of `height` × `width` pixels back from its images, which follow one another
    /// without gaps. Writes 2 bytes a level, planes of colours one after another without gaps.
    ///
    /// # Errors
    /// Returns an error for another number of bytes, or for cells that are those of no level.
    pub fn read(&self, images: &[u8], width: usize, height: usize, to: RawMemory) -> Result<(), PhasefrontError> {
        guard(|| {
            let input = self.core.input(Size { width, height }, &self.target.core)?;
            let mut levels = vec![0; self.core.display.colours() * height * width];
            let (bytes, _) = to.bytes()?.as_chunks_mut::<2>();
            if bytes.len() != levels.len() {
                return Err(PhasefrontError::Setting(format!(
                    "memory for {} levels; the hologram has {}",
                    bytes.len(),
                    levels.len()
                )));
            }
            input.read(images, &mut levels)?;
            (bytes.iter_mut().zip(levels)).for_each(|(bytes, level)| *bytes = level.to_ne_bytes());
            Ok(())
        })
    }
}

impl RawModulator {
    fn new(core: ModulatorSpec) -> Result<Arc<Self>, PhasefrontError> {
        let target = Arc::new(Target { core: core.target()? });
        Ok(Arc::new(RawModulator { core, target }))
    }

    /// Lets `write` write an image of `hologram` for the input into the bytes of `to`, on the hologram's threads.
    fn write(
        &self,
        hologram: &Hologram,
        to: RawMemory,
        write: impl FnOnce(&ModulatorInput, Levels<'_>, &mut [u8]) -> phasefront::Result<()> + Send,
    ) -> Result<(), PhasefrontError> {
        let input = self.core.input(hologram.size(), hologram.target())?;
        let (levels, bytes) = (hologram.output_levels(), to.bytes()?);
        Ok(hologram.on_threads(|| write(&input, levels, bytes))?)
    }
}
