//! The images that a modulator's input takes of a hologram, and back.

use super::modulator::{ModulatorSpec, Packing};
use super::{BitPlanes, Layout, Output, Placement, check_rows, rows};
use crate::Size;
use crate::display::levels::Levels;
use crate::display::target::Target;
// Without threads, the iterators of the standard library need no trait here.
#[allow(unused_imports)]
use crate::parallel::prelude::*;
use crate::runtime::error::{Error, Result};

/// The size and the number of the images that a modulator's input takes of a hologram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OutputSize {
    /// The size of an image.
    pub size: Size,
    /// The number of bytes of a pixel.
    pub pixel_bytes: usize,
    /// The number of images: one, or one for each colour.
    pub images: usize,
}

/// A plan for the input of one modulator and holograms of one shape. It is immutable and can be shared between threads.
#[derive(Debug, Clone)]
pub struct ModulatorInput {
    size: OutputSize,
    colours: usize,
    plan: Plan,
}

#[derive(Debug, Clone)]
enum Plan {
    Planes(BitPlanes),
    Images(Box<Output>),
}

impl ModulatorSpec {
    /// Returns the size of the images that the modulator's input takes.
    #[doc(hidden)]
    pub fn output_size(&self) -> OutputSize {
        let size = self.display.size();
        match &self.packing {
            Packing::Images(layout) => OutputSize {
                size,
                pixel_bytes: layout.pixel_bytes(),
                images: layout.images(self.display.colours()),
            },
            // Two cells along each axis, and red, green and blue for each.
            Packing::BitPlanes(_) => OutputSize {
                size: Size {
                    width: 2 * size.width,
                    height: 2 * size.height,
                },
                pixel_bytes: 3,
                images: 1,
            },
        }
    }

    /// Plans the images of holograms of `size` for `target`. A smaller hologram lies in the middle of the
    /// modulator.
    ///
    /// # Errors
    /// Returns an error if the target has another number of lasers or bits, or if the hologram is larger than the
    /// modulator; with bit planes, also if it is smaller.
    #[doc(hidden)]
    pub fn input(&self, size: Size, target: &Target) -> Result<ModulatorInput> {
        let (own, theirs) = (&self.display, &target.display);
        if (theirs.colours(), theirs.bits()) != (own.colours(), own.bits()) {
            return Err(Error::Setting(format!(
                "the hologram has {} lasers and levels of {} bits, the modulator {} and {}; make it for the modulator's target",
                theirs.colours(),
                theirs.bits(),
                own.colours(),
                own.bits()
            )));
        }
        let (flip_x, flip_y) = (self.flip_x, self.flip_y);
        let plan = match &self.packing {
            Packing::BitPlanes(cells) => {
                let modulator = self.display.size();
                if size != modulator {
                    return Err(Error::Setting(format!(
                        "a hologram of {size} for a modulator of {modulator} pixels; for bit planes both must be of one size"
                    )));
                }
                Plan::Planes(BitPlanes::new(cells, size, flip_x, flip_y))
            }
            Packing::Images(layout) => {
                let placement = Placement {
                    flip_x,
                    flip_y,
                    ..Placement::centred(*layout)
                };
                Plan::Images(Box::new(Output::new(&self.target()?, size, placement)?))
            }
        };
        Ok(ModulatorInput {
            size: self.output_size(),
            colours: self.display.colours(),
            plan,
        })
    }
}

impl ModulatorInput {
    /// Writes image `image` of a hologram of `levels`, (C, H, W), into `bytes`, whose rows begin `row_stride` bytes
    /// apart.
    ///
    /// # Errors
    /// Returns an error if there is no such image, `bytes` cannot hold it, or the levels have another number of values
    /// or bits.
    pub fn write(&self, levels: Levels<'_>, image: usize, bytes: &mut [u8], row_stride: usize) -> Result<()> {
        if image >= self.size.images {
            return Err(Error::Setting(format!(
                "there is no image {image}; the modulator takes {}",
                self.size.images
            )));
        }
        match (&self.plan, levels) {
            (Plan::Planes(plan), Levels::Bytes(levels)) => {
                let maps: Vec<_> = levels.chunks_exact(levels.len() / self.colours).collect();
                plan.pack(&maps, bytes, row_stride)
            }
            (Plan::Planes(_), Levels::Words(_)) => {
                Err(Error::Setting("levels of over 8 bits have no bit planes".into()))
            }
            (Plan::Images(plan), levels) => plan.write(levels, image, bytes, row_stride),
        }
    }

    /// Writes image `image`, as [`Self::write`] does, in the pixels of a screen that drives the modulator: Rgba or Bgra
    /// with alpha 255. The red, green and blue of a grey image are its level. Allocates nothing.
    ///
    /// # Errors
    /// Returns an error in the cases of [`Self::write`], for another layout, and for images of 16 bits, which a pixel
    /// does not hold.
    pub fn write_pixels(
        &self,
        levels: Levels<'_>,
        image: usize,
        layout: Layout,
        bytes: &mut [u8],
        row_stride: usize,
    ) -> Result<()> {
        let OutputSize {
            size: Size { width, height },
            pixel_bytes,
            ..
        } = self.size;
        if !matches!(layout, Layout::Rgba | Layout::Bgra) {
            return Err(Error::Setting(format!(
                "pixels in {layout:?}; a screen's are Rgba or Bgra"
            )));
        }
        if !matches!(pixel_bytes, 1 | 3) {
            return Err(Error::Setting(
                "the modulator takes 16 bits of grey, which a screen's pixels do not hold; write the image without a layout".into(),
            ));
        }
        check_rows(bytes.len(), row_stride, (height, 4 * width))?;
        self.write(levels, image, bytes, row_stride)?;
        rows(bytes, row_stride, (height, 4 * width))?.for_each(|row| {
            // The image's pixels are narrower, so from the end of a row on none is overwritten before it is read.
            for x in (0..width).rev() {
                let first = x * pixel_bytes;
                let [red, green, blue] = match pixel_bytes {
                    1 => [row[first]; 3],
                    _ => [row[first], row[first + 1], row[first + 2]],
                };
                row[4 * x..4 * x + 4].copy_from_slice(&match layout {
                    Layout::Bgra => [blue, green, red, 255],
                    _ => [red, green, blue, 255],
                });
            }
        });
        Ok(())
    }

    /// Reads `levels`, (C, H, W), back from all images, which follow one another in `bytes` without gaps.
    ///
    /// # Errors
    /// Returns an error for another number of bytes, or if the cells of a pixel are those of no level.
    ///
    /// # Panics
    /// Panics if `levels` does not have the planned length.
    pub fn read(&self, bytes: &[u8], levels: &mut [u16]) -> Result<()> {
        let OutputSize {
            size: Size { width, height },
            pixel_bytes,
            images,
        } = self.size;
        let image = height * width * pixel_bytes;
        if bytes.len() != images * image {
            return Err(Error::Setting(format!(
                "the images have {} bytes; {} are the modulator's",
                bytes.len(),
                images * image
            )));
        }
        match &self.plan {
            Plan::Planes(plan) => {
                let mut plane = vec![0; levels.len() / self.colours];
                for (colour, levels) in levels.chunks_exact_mut(plane.len()).enumerate() {
                    // Each colour has its share of the 24 planes.
                    plan.unpack(bytes, colour * (24 / self.colours), &mut plane)?;
                    (levels.iter_mut().zip(&plane)).for_each(|(level, byte)| *level = (*byte).into());
                }
                Ok(())
            }
            Plan::Images(plan) => {
                (bytes.chunks_exact(image).enumerate()).try_for_each(|(n, bytes)| plan.read(bytes, n, levels))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn every_bundled_modulator_gives_back_its_levels() {
        for name in ModulatorSpec::names() {
            let spec = ModulatorSpec::shipped(name).unwrap();
            let (display, output) = (&spec.display, spec.output_size());
            let size = display.size();
            let input = spec.input(size, &spec.target().unwrap()).unwrap();
            let count = display.colours() * size.height * size.width;
            let words: Vec<u16> = (0..count).map(|i| (i * 37 % (1 << display.bits())) as u16).collect();
            let bytes: Vec<u8> = words.iter().map(|word| *word as u8).collect();
            let levels = match display.bits() {
                0..=8 => Levels::Bytes(&bytes),
                _ => Levels::Words(&words),
            };
            let row = output.size.width * output.pixel_bytes;
            let mut images = vec![0; output.images * output.size.height * row];
            for (n, image) in images.chunks_exact_mut(output.size.height * row).enumerate() {
                input.write(levels, n, image, row).unwrap();
            }
            let mut read = vec![0; count];
            input.read(&images, &mut read).unwrap();
            assert!(read == words, "{name}");
            assert!(input.write(levels, output.images, &mut images, row).is_err());
            assert!(input.read(&images[1..], &mut read).is_err());
            let target = spec.target().unwrap();
            assert!(
                spec.input(
                    Size {
                        width: size.width,
                        height: size.height + 1
                    },
                    &target
                )
                .is_err()
            );
        }
    }

    /// Compares with the image that the input takes, for bit planes, a split level and grey, with gaps between rows.
    #[test]
    fn pixels_have_the_bytes_of_the_image() {
        for (toml, bytes) in [
            (
                "bits = 4\npacking = { memory = [3, 2, 1, 7, 0, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13, 12], layout = [[2, 3], [0, 1]] }",
                3,
            ),
            (
                "bits = 10\nwavelengths_nm = [532]\npacking = { red = [9, 8, 7], green = [6, 5, 4], blue = [3, 2, 1, 0] }",
                3,
            ),
            ("bits = 8\npacking = \"grey\"", 1),
            ("bits = 8\nwavelengths_nm = [532]\npacking = \"grey\"\nflip_x = true", 1),
            ("bits = 8\npacking = \"rgb\"", 3),
        ] {
            let spec = ModulatorSpec::from_toml(&format!("width = 7\nheight = 5\n{toml}")).unwrap();
            let (size, colours) = (spec.output_size(), spec.display.colours());
            assert_eq!(size.pixel_bytes, bytes, "{toml}");
            let input = spec
                .input(Size { width: 7, height: 5 }, &spec.target().unwrap())
                .unwrap();
            let words: Vec<u16> = (0..colours * 35)
                .map(|i| (i * 37 % (1 << spec.display.bits())) as u16)
                .collect();
            let narrow: Vec<u8> = words.iter().map(|word| *word as u8).collect();
            let levels = match spec.display.bits() {
                0..=8 => Levels::Bytes(&narrow),
                _ => Levels::Words(&words),
            };
            let (row, stride) = (size.size.width * bytes, size.size.width * 4 + 3);
            let last = size.images - 1;
            let mut plain = vec![0; size.size.height * row];
            input.write(levels, last, &mut plain, row).unwrap();
            for (layout, order) in [(Layout::Rgba, [0, 1, 2]), (Layout::Bgra, [2, 1, 0])] {
                let mut pixels = vec![9; size.size.height * stride];
                input.write_pixels(levels, last, layout, &mut pixels, stride).unwrap();
                for (y, row) in plain.chunks_exact(row).enumerate() {
                    for (x, pixel) in row.chunks_exact(bytes).enumerate() {
                        let got = &pixels[y * stride + 4 * x..][..4];
                        let want = order.map(|c| pixel[c % bytes]);
                        assert_eq!((&got[..3], got[3]), (&want[..], 255), "{toml}: {layout:?}, {x}, {y}");
                    }
                    assert_eq!(
                        pixels[y * stride + 4 * size.size.width..][..3],
                        [9; 3],
                        "{toml}: between rows"
                    );
                }
                let mut small = vec![9; size.size.height * row + 1];
                assert!(
                    input
                        .write_pixels(levels, last, layout, &mut small, 4 * size.size.width)
                        .is_err()
                );
                assert!(small.iter().all(|byte| *byte == 9), "nothing was written");
                assert!(
                    input
                        .write_pixels(levels, size.images, layout, &mut pixels, stride)
                        .is_err()
                );
            }
            assert!(input.write_pixels(levels, 0, Layout::Rgb, &mut plain, row).is_err());
        }
        let spec = ModulatorSpec::from_toml("width = 4\nheight = 4\nbits = 10").unwrap();
        let input = spec
            .input(Size { width: 4, height: 4 }, &spec.target().unwrap())
            .unwrap();
        let refused = input.write_pixels(Levels::Words(&[0; 48]), 0, Layout::Rgba, &mut [0; 64], 16);
        assert!(refused.unwrap_err().to_string().contains("16 bits of grey"));
    }
}
