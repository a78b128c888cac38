//! Modulators by name or by their TOML file, and the frames that their inputs take.

use crate::error::{PhasefrontError, guard};
use crate::hologram::{RawHologram, RawImage};
use crate::target::Target;
use phasefront::output::{BitPlanes, Levels, ModulatorSpec, Output, Packing, Placement};
use std::sync::Arc;

/// A modulator: its display, the phases of its levels, and the frames that its input takes. For the layers by hand.
#[derive(Debug, uniffi::Object)]
pub struct RawModulator {
    core: ModulatorSpec,
}

#[uniffi::export]
impl RawModulator {
    /// A modulator that `phasefront devices` lists.
    ///
    /// # Errors
    /// Another name.
    #[uniffi::constructor]
    pub fn named(name: String) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let core = ModulatorSpec::shipped(&name)?;
            Ok(Arc::new(RawModulator { core }))
        })
    }

    /// Reads a modulator's file.
    ///
    /// # Errors
    /// Text that is not TOML, an unknown key, or a value out of its range.
    #[uniffi::constructor]
    pub fn from_toml(text: String) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let core = ModulatorSpec::from_toml(&text)?;
            Ok(Arc::new(RawModulator { core }))
        })
    }

    /// What holograms for it are made for.
    ///
    /// # Errors
    /// Levels of more than 8 bits that are not evenly spaced.
    pub fn target(&self) -> Result<Arc<Target>, PhasefrontError> {
        guard(|| {
            let core = self.core.target()?;
            Ok(Arc::new(Target { core }))
        })
    }

    /// The images that its input takes of `hologram`, one, or one for each colour.
    ///
    /// # Errors
    /// A hologram that is larger than the modulator or for another number of lasers or bits; with bit planes, one of
    /// another size.
    pub fn pack(&self, hologram: Arc<RawHologram>) -> Result<Vec<Arc<RawImage>>, PhasefrontError> {
        guard(|| {
            let (hologram, display) = (&hologram.core, &self.core.display);
            let theirs = &hologram.target().display;
            if (theirs.colours(), theirs.bits()) != (display.colours(), display.bits()) {
                return Err(PhasefrontError::Setting(format!(
                    "the hologram has {} lasers and levels of {} bits, the modulator {} and {}; make it for target()",
                    theirs.colours(),
                    theirs.bits(),
                    display.colours(),
                    display.bits()
                )));
            }
            let (shape, levels) = (hologram.shape(), hologram.output_levels());
            match (Frames::new(&self.core, shape)?, levels) {
                (Frames::Planes(plan), Levels::Bytes(levels)) => {
                    let maps: Vec<_> = levels.chunks_exact(shape.0 * shape.1).collect();
                    let mut bytes = vec![0; plan.frame_bytes()];
                    plan.pack(&maps, &mut bytes)?;
                    Ok(vec![image(bytes, plan.frame_shape(), 3)])
                }
                (Frames::Planes(_), Levels::Words(_)) => Err(PhasefrontError::Setting(
                    "levels of over 8 bits have no bit planes".into(),
                )),
                (Frames::Images(plan, images, pixel_bytes), levels) => (0..images)
                    .map(|n| {
                        let mut bytes = vec![0; plan.image_bytes()];
                        plan.write(levels, n, &mut bytes)?;
                        Ok(image(bytes, plan.shape(), pixel_bytes))
                    })
                    .collect(),
            }
        })
    }

    /// Reads the levels of a hologram of `height` × `width` pixels back from its images, which follow one another
    /// without gaps. The result has 2 bytes a level, planes of colours one after another.
    ///
    /// # Errors
    /// Another number of bytes, or cells that are those of no level.
    pub fn unpack(&self, images: &[u8], width: usize, height: usize) -> Result<Arc<RawImage>, PhasefrontError> {
        guard(|| {
            let shape @ (rows, columns) = (height, width);
            let frames = Frames::new(&self.core, shape)?;
            let needed = match &frames {
                Frames::Planes(plan) => plan.frame_bytes(),
                Frames::Images(plan, images, _) => images * plan.image_bytes(),
            };
            if images.len() != needed {
                return Err(PhasefrontError::Setting(format!(
                    "the images have {} bytes; {needed} are the modulator's",
                    images.len()
                )));
            }
            let colours = self.core.display.colours();
            let mut levels = vec![0u16; colours * rows * columns];
            match &frames {
                Frames::Planes(plan) => {
                    let mut plane = vec![0; rows * columns];
                    for (colour, levels) in levels.chunks_exact_mut(plane.len()).enumerate() {
                        // Each colour has its share of the 24 planes.
                        plan.unpack(images, colour * (24 / colours), &mut plane)?;
                        (levels.iter_mut().zip(&plane)).for_each(|(level, byte)| *level = (*byte).into());
                    }
                }
                Frames::Images(plan, ..) => {
                    for (n, bytes) in images.chunks_exact(plan.image_bytes()).enumerate() {
                        plan.read(bytes, n, &mut levels)?;
                    }
                }
            }
            let bytes = levels.into_iter().flat_map(u16::to_ne_bytes).collect();
            Ok(image(bytes, (colours * rows, columns), 2))
        })
    }
}

/// The plan of a modulator's frames.
enum Frames {
    Planes(BitPlanes),
    /// The plan of an image, how many there are, and the bytes of a pixel.
    Images(Box<Output>, usize, usize),
}

impl Frames {
    fn new(modulator: &ModulatorSpec, shape @ (height, width): (usize, usize)) -> Result<Self, PhasefrontError> {
        let (flip_x, flip_y) = (modulator.flip_x, modulator.flip_y);
        match &modulator.packing {
            Packing::BitPlanes(cells) => {
                let (rows, columns) = (modulator.display.height(), modulator.display.width());
                if shape != (rows, columns) {
                    return Err(PhasefrontError::Setting(format!(
                        "a hologram of {width}×{height} for a modulator of {columns}×{rows} pixels; for bit planes both must be of one size"
                    )));
                }
                Ok(Frames::Planes(BitPlanes::new(cells, shape, flip_x, flip_y)))
            }
            Packing::Images(layout) => {
                let placement = Placement {
                    flip_x,
                    flip_y,
                    ..Placement::centred(*layout)
                };
                let plan = Output::new(&modulator.target()?, shape, placement)?;
                let images = layout.images(modulator.display.colours());
                Ok(Frames::Images(Box::new(plan), images, layout.pixel_bytes()))
            }
            _ => Err(PhasefrontError::Setting("a packing that is not known here".into())),
        }
    }
}

fn image(bytes: Vec<u8>, (height, width): (usize, usize), pixel_bytes: usize) -> Arc<RawImage> {
    Arc::new(RawImage {
        bytes,
        width: width,
        height: height,
        pixel_bytes: pixel_bytes,
    })
}
