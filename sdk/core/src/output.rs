//! Packs a hologram's levels into the images that a modulator's driver takes: colours in one image or one after
//! another, flipped, shifted, at the modulator's resolution with the hologram in the middle.
//!
//! The border around the hologram is amplitude 0 in double phase: a checkerboard of π/2 and 3π/2, whose light does not
//! pass the aperture. A constant level would appear as a bright frame.
//!
//! A per-pixel table counts pixels before flips and shifts. Measure it with the same flips; a shift moves the hologram
//! away from the pixels that the table assumes.

mod cells;
mod input;
pub mod modulator;
mod split;

use crate::Size;
pub use cells::{BitPlanes, Cells};
pub use input::{ModulatorInput, OutputSize};
pub use split::Split;

use crate::display::levels::Levels;
use crate::display::response::Response;
use crate::display::response::per_pixel::PerPixel;
use crate::display::target::Target;
use crate::parallel::prelude::*;
use crate::runtime::error::{Error, Result};
use std::f32::consts::FRAC_PI_2;
use std::sync::Arc;

/// The arrangement of the colours' levels in images. If all colours share one image, a hologram of one laser repeats
/// its level in each. Levels with fewer bits than their place in the image use its upper bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Layout {
    /// One image with bytes red, green, blue.
    Rgb,
    /// One image with bytes red, green, blue, alpha 255.
    Rgba,
    /// One image with bytes blue, green, red, alpha 255.
    Bgra,
    /// One image with 32-bit little-endian words: red in the lowest 10 bits, then green, then blue, alpha 3. This is
    /// Android's RGBA_1010102 and Metal's rgb10a2.
    Rgb10,
    /// One image for each colour in the order red, green, blue, with one byte for each pixel.
    Grey,
    /// One image for each colour in the order red, green, blue, with one 16-bit little-endian word for each pixel.
    Grey16,
    /// One image for each colour, whose red, green and blue bytes share the bits of one level.
    #[doc(hidden)]
    Split(Split),
}

impl Layout {
    /// Returns the number of images for a hologram of `colours`.
    pub fn images(self, colours: usize) -> usize {
        match self {
            Layout::Grey | Layout::Grey16 | Layout::Split(_) => colours,
            _ => 1,
        }
    }

    /// Returns the number of bytes of a pixel.
    pub fn pixel_bytes(self) -> usize {
        match self {
            Layout::Rgb | Layout::Split(_) => 3,
            Layout::Rgba | Layout::Bgra | Layout::Rgb10 => 4,
            Layout::Grey => 1,
            Layout::Grey16 => 2,
        }
    }

    /// Returns the number of bits that an image reserves for a level.
    pub(crate) fn place_bits(self) -> u32 {
        match self {
            Layout::Rgb10 => 10,
            Layout::Grey16 => 16,
            Layout::Split(split) => split.bits(),
            _ => 8,
        }
    }

    /// Returns whether one image has all colours, with one byte for each.
    pub(crate) fn is_byte_for_each_colour(self) -> bool {
        self.images(3) == 1 && self.place_bits() == 8
    }

    /// Writes a pixel of image `image` from the `level` of each colour. Levels are as wide as their place.
    pub(crate) fn write_pixel(self, image: usize, level: impl Fn(usize) -> u16, pixel: &mut [u8]) {
        let byte = |colour| level(colour) as u8;
        match self {
            Layout::Rgb => pixel.copy_from_slice(&[byte(0), byte(1), byte(2)]),
            Layout::Rgba => pixel.copy_from_slice(&[byte(0), byte(1), byte(2), 255]),
            Layout::Bgra => pixel.copy_from_slice(&[byte(2), byte(1), byte(0), 255]),
            Layout::Rgb10 => {
                let colours = (0..3).map(|c| u32::from(level(c)) << (10 * c));
                let word = colours.fold(3 << 30, |word, colour| word | colour);
                pixel.copy_from_slice(&word.to_le_bytes());
            }
            Layout::Grey => pixel[0] = byte(image),
            Layout::Grey16 => pixel.copy_from_slice(&level(image).to_le_bytes()),
            Layout::Split(split) => pixel.copy_from_slice(&split.pixel(level(image))),
        }
    }

    /// Reads the level of `colour` from a pixel of image `image`, as wide as its place. Returns `None` if another image
    /// holds the colour.
    fn read_pixel(self, image: usize, colour: usize, pixel: &[u8]) -> Option<u16> {
        let alone = |level: u16| (colour == image).then_some(level);
        match self {
            Layout::Rgb | Layout::Rgba => Some(pixel[colour].into()),
            Layout::Bgra => Some(pixel[2 - colour].into()),
            Layout::Rgb10 => {
                let word = u32::from_le_bytes([pixel[0], pixel[1], pixel[2], pixel[3]]);
                Some((word >> (10 * colour)) as u16 & 0x3ff)
            }
            Layout::Grey => alone(pixel[0].into()),
            Layout::Grey16 => alone(u16::from_le_bytes([pixel[0], pixel[1]])),
            Layout::Split(split) => alone(split.level([pixel[0], pixel[1], pixel[2]])),
        }
    }
}

/// The placement of a hologram on its modulator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Placement {
    /// The arrangement of colours in images.
    pub layout: Layout,
    /// Whether the whole image is flipped left to right.
    pub flip_x: bool,
    /// Whether the whole image is flipped top to bottom.
    pub flip_y: bool,
    /// The hologram's shift to the right of the middle in pixels, before flips. Pixels outside the modulator are cut
    /// off.
    pub shift_x: i32,
    /// The hologram's shift below the middle in pixels, before flips.
    pub shift_y: i32,
}

impl Placement {
    /// Returns a placement in the middle without flips.
    pub fn centred(layout: Layout) -> Self {
        Placement {
            layout,
            flip_x: false,
            flip_y: false,
            shift_x: 0,
            shift_y: 0,
        }
    }
}

/// A plan for one modulator, hologram shape and placement. It is immutable and can be shared between threads.
#[derive(Debug, Clone)]
pub struct Output {
    colours: usize,
    modulator: Size,
    hologram: Size,
    placement: Placement,
    /// The position of the image's upper left pixel in the hologram. It may lie outside.
    from: (i64, i64),
    /// The number of bits of a level in bytes and of a level in words.
    bits: (u32, u32),
    around: Dark,
}

/// The border around the hologram: double phase of amplitude 0.
#[derive(Debug, Clone)]
enum Dark {
    /// The levels for even and for odd x + y of the hologram.
    Everywhere([u8; 2]),
    /// Levels that depend on the modulator's pixel.
    PerPixel(Arc<PerPixel>),
}

/// The phases of darkness for even and for odd x + y.
const DARK: [f32; 2] = [FRAC_PI_2, 3.0 * FRAC_PI_2];

impl Output {
    /// Plans images at the modulator's resolution for holograms of a size and for `target`.
    ///
    /// # Errors
    /// Returns an error if the hologram is larger than the modulator or a per-pixel table is for a smaller one.
    pub fn new(target: &Target, Size { width, height }: Size, placement: Placement) -> Result<Self> {
        target.check()?;
        let (modulator, bits) = (target.modulator(), target.display.bits());
        if height > modulator.height || width > modulator.width {
            return Err(Error::Setting(format!(
                "a hologram of {width}×{height} does not fit the modulator of {}×{}",
                modulator.width, modulator.height
            )));
        }
        let from =
            |modulator: usize, hologram: usize, shift: i32| -(((modulator - hologram) / 2) as i64 + i64::from(shift));
        Ok(Output {
            colours: target.display.colours(),
            modulator,
            hologram: Size { width, height },
            placement,
            from: (
                from(modulator.height, height, placement.shift_y),
                from(modulator.width, width, placement.shift_x),
            ),
            bits: match &target.response {
                Response::Linear { bits: bytes } => (*bytes, bits),
                Response::Lut { .. } if target.panel.levels_turns.is_some() => (bits, bits),
                Response::Lut { .. } | Response::PerPixel(_) => (8, bits),
            },
            around: match target.response.clone() {
                Response::PerPixel(table) => Dark::PerPixel(table),
                same => Dark::Everywhere(DARK.map(|phase| same.level(phase, 0))),
            },
        })
    }

    /// Returns the number of bytes of an image without gaps between rows.
    pub fn image_bytes(&self) -> usize {
        self.modulator.height * self.row_bytes()
    }

    /// Returns the number of bytes of a row of an image.
    pub fn row_bytes(&self) -> usize {
        self.modulator.width * self.placement.layout.pixel_bytes()
    }

    /// Returns the size of an image.
    pub fn size(&self) -> Size {
        self.modulator
    }

    /// Writes image `image` of a hologram of `levels`, (C, H, W), into `bytes`, whose rows begin `row_stride` bytes
    /// apart. Bytes between rows stay as they are. Allocates nothing.
    ///
    /// # Errors
    /// Returns an error if the layout does not have this image or `bytes` cannot hold it.
    ///
    /// # Panics
    /// Panics if `levels` does not have the planned length.
    pub fn write(&self, levels: Levels<'_>, image: usize, bytes: &mut [u8], row_stride: usize) -> Result<()> {
        let size = self.colours * self.hologram.height * self.hologram.width;
        let (byte_bits, word_bits) = self.bits;
        match levels {
            Levels::Bytes(levels) => {
                assert_eq!(levels.len(), size);
                let level = |at: usize| u16::from(levels[at]);
                let dark = |odd: usize, colour: usize, (y, x): (usize, usize)| match &self.around {
                    Dark::Everywhere(levels) => levels[odd].into(),
                    Dark::PerPixel(table) => {
                        let Size { width, height } = self.modulator;
                        let at = (colour * height + y) * width + x;
                        table.level(DARK[odd], at).into()
                    }
                };
                self.write_levels((level, byte_bits), dark, image, (bytes, row_stride))
            }
            Levels::Words(levels) => {
                assert_eq!(levels.len(), size);
                // The levels of π/2 and 3π/2.
                let quarter = (1u16 << word_bits) / 4;
                let dark = |odd: usize, _: usize, _: (usize, usize)| quarter * [1, 3][odd];
                self.write_levels((|at| levels[at], word_bits), dark, image, (bytes, row_stride))
            }
        }
    }

    /// Reads the levels in image `image`, of the display's bits, into their places in `levels`, (C, H, W). This is the
    /// inverse of [`Self::write`]. Levels that other images hold and pixels that were shifted off the modulator stay
    /// unchanged.
    ///
    /// # Errors
    /// Returns an error if the layout does not have this image or its pixels have fewer bits than the display.
    ///
    /// # Panics
    /// Panics if `levels` or `bytes` does not have the planned length.
    pub fn read(&self, bytes: &[u8], image: usize, levels: &mut [u16]) -> Result<()> {
        let layout = self.placement.layout;
        let Size { width, height } = self.hologram;
        let Size {
            width: out_width,
            height: out_height,
        } = self.modulator;
        assert_eq!(bytes.len(), self.image_bytes());
        assert_eq!(levels.len(), self.colours * height * width);
        self.check_image(image)?;
        let (place, bits) = (layout.place_bits(), self.bits.1);
        if place < bits {
            return Err(Error::Setting(format!(
                "{layout:?} has {place} bits a level, the display has {bits}; what it leaves out cannot be read"
            )));
        }
        for y in 0..height {
            for x in 0..width {
                let (row, column) = (y as i64 - self.from.0, x as i64 - self.from.1);
                if !(0..out_height as i64).contains(&row) || !(0..out_width as i64).contains(&column) {
                    continue;
                }
                let row = flip(row as usize, out_height, self.placement.flip_y);
                let column = flip(column as usize, out_width, self.placement.flip_x);
                let pixel = &bytes[(row * out_width + column) * layout.pixel_bytes()..][..layout.pixel_bytes()];
                for colour in 0..self.colours {
                    if let Some(level) = layout.read_pixel(image, colour, pixel) {
                        levels[(colour * height + y) * width + x] = level >> (place - bits);
                    }
                }
            }
        }
        Ok(())
    }

    fn check_image(&self, image: usize) -> Result<()> {
        let layout = self.placement.layout;
        if image >= layout.images(self.colours) {
            return Err(Error::Setting(format!(
                "there is no image {image}; {layout:?} has {}",
                layout.images(self.colours)
            )));
        }
        Ok(())
    }

    fn write_levels(
        &self,
        (level, bits): (impl Fn(usize) -> u16 + Sync, u32),
        dark: impl Fn(usize, usize, (usize, usize)) -> u16 + Sync,
        image: usize,
        (bytes, row_stride): (&mut [u8], usize),
    ) -> Result<()> {
        let layout = self.placement.layout;
        let Size { width, height } = self.hologram;
        let Size {
            width: out_width,
            height: out_height,
        } = self.modulator;
        self.check_image(image)?;
        let place = layout.place_bits();
        let placed = |level: u16| {
            if bits <= place {
                level << (place - bits)
            } else {
                level >> (bits - place)
            }
        };
        let pixel_bytes = layout.pixel_bytes();
        let rows = rows(bytes, row_stride, (out_height, self.row_bytes()))?;
        rows.enumerate().for_each(|(y, row)| {
            let modulator_y = flip(y, out_height, self.placement.flip_y);
            let y = self.from.0 + modulator_y as i64;
            for (x, pixel) in row.chunks_exact_mut(pixel_bytes).enumerate() {
                let modulator_x = flip(x, out_width, self.placement.flip_x);
                let x = self.from.1 + modulator_x as i64;
                let inside = (0..height as i64).contains(&y) && (0..width as i64).contains(&x);
                let level = |place: usize| {
                    let colour = place % self.colours;
                    placed(if inside {
                        level((colour * height + y as usize) * width + x as usize)
                    } else {
                        dark((x + y).rem_euclid(2) as usize, colour, (modulator_y, modulator_x))
                    })
                };
                layout.write_pixel(image, level, pixel);
            }
        });
        Ok(())
    }
}

/// Returns the number of bytes from the first to the last of an image of `height` rows of `row_bytes` bytes that begin
/// `row_stride` bytes apart.
///
/// # Errors
/// Returns an error if rows overlap or `len` bytes cannot hold them.
fn check_rows(len: usize, row_stride: usize, (height, row_bytes): (usize, usize)) -> Result<usize> {
    let needed = row_stride.saturating_mul(height - 1).saturating_add(row_bytes);
    if row_stride < row_bytes || len < needed {
        return Err(Error::Setting(format!(
            "{len} bytes with rows {row_stride} bytes apart cannot hold {height} rows of {row_bytes} bytes: they must be \
             {row_bytes} bytes apart or more, and have {} bytes at least",
            row_bytes * height
        )));
    }
    Ok(needed)
}

/// Returns the rows of such an image in `bytes`.
///
/// # Errors
/// Returns an error if rows overlap or `bytes` cannot hold them.
pub(crate) fn rows(
    bytes: &mut [u8],
    row_stride: usize,
    (height, row_bytes): (usize, usize),
) -> Result<impl IndexedParallelIterator<Item = &mut [u8]>> {
    let len = check_rows(bytes.len(), row_stride, (height, row_bytes))?;
    Ok(bytes[..len]
        .par_chunks_mut(row_stride)
        .map(move |row| &mut row[..row_bytes]))
}

/// Returns position `at` of `n`, counted from the other end if `flipped`.
fn flip(at: usize, n: usize, flipped: bool) -> usize {
    if flipped { n - 1 - at } else { at }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::display::Display;

    fn target(size: Size, bits: u32) -> Target {
        let Size { width, height } = size;
        let toml = format!("width = {width}\nheight = {height}\nbits = {bits}");
        Display::from_toml(&toml).unwrap().into()
    }

    /// Returns levels that identify colour, row and column.
    fn levels(size: Size) -> Vec<u8> {
        let Size { width, height } = size;
        (0..3 * height * width)
            .map(|i| {
                let (c, y, x) = (i / (height * width), i / width % height, i % width);
                (100 + 50 * c + 10 * y + x) as u8
            })
            .collect()
    }

    fn image(output: &Output, levels: &[u8], image: usize) -> Vec<u8> {
        let mut bytes = vec![7; output.image_bytes()];
        output
            .write(Levels::Bytes(levels), image, &mut bytes, output.row_bytes())
            .unwrap();
        bytes
    }

    #[test]
    fn each_layout_holds_each_colour_in_its_place() {
        let levels = levels(Size { width: 3, height: 2 });
        for (layout, expected) in [
            (Layout::Rgb, vec![100, 150, 200, 101, 151, 201]),
            (Layout::Rgba, vec![100, 150, 200, 255, 101, 151]),
            (Layout::Bgra, vec![200, 150, 100, 255, 201, 151]),
            (Layout::Grey, vec![100, 101, 102, 110, 111, 112]),
            (Layout::Grey16, vec![0, 100, 0, 101, 0, 102]),
        ] {
            let output = Output::new(
                &target(Size { width: 3, height: 2 }, 8),
                Size { width: 3, height: 2 },
                Placement::centred(layout),
            );
            let output = output.unwrap();
            assert_eq!(image(&output, &levels, 0)[..6], expected, "{layout:?}");
            assert!(
                output
                    .write(
                        Levels::Bytes(&levels),
                        layout.images(3),
                        &mut vec![0; output.image_bytes()],
                        output.row_bytes()
                    )
                    .is_err()
            );
            if layout == Layout::Grey {
                assert_eq!(image(&output, &levels, 2), [200, 201, 202, 210, 211, 212]);
            }
        }
    }

    #[test]
    fn holograms_stand_in_the_middle_shifted_and_flipped_with_darkness_around() {
        let levels = levels(Size { width: 3, height: 2 });
        // In a 7×4 modulator the hologram has two columns to its left and one row above it.
        let place = |x: usize, y: usize, p: &Placement| {
            let x = if p.flip_x { 6 - x } else { x } as i32 - 2 - p.shift_x;
            let y = if p.flip_y { 3 - y } else { y } as i32 - 1 - p.shift_y;
            if (0..3).contains(&x) && (0..2).contains(&y) {
                (100 + 10 * y + x) as u8
            } else {
                // π/2 and 3π/2 continue the hologram's checkerboard.
                [64, 192][(x + y).rem_euclid(2) as usize]
            }
        };
        for (flip_x, flip_y, shift_x, shift_y) in [
            (false, false, 0, 0),
            (true, false, 0, 0),
            (false, true, 1, 0),
            (true, true, -3, 2),
            (false, false, 100, 0),
        ] {
            let placement = Placement {
                flip_x,
                flip_y,
                shift_x,
                shift_y,
                ..Placement::centred(Layout::Grey)
            };
            let output = Output::new(
                &target(Size { width: 7, height: 4 }, 8),
                Size { width: 3, height: 2 },
                placement,
            )
            .unwrap();
            for (i, byte) in image(&output, &levels, 0).into_iter().enumerate() {
                assert_eq!(byte, place(i % 7, i / 7, &placement), "{placement:?} {i}");
            }
        }
        assert!(
            Output::new(
                &target(Size { width: 2, height: 4 }, 8),
                Size { width: 3, height: 2 },
                Placement::centred(Layout::Rgb)
            )
            .is_err()
        );
    }

    #[test]
    fn rows_with_gaps_have_the_same_pixels_and_keep_their_gaps() {
        let levels = levels(Size { width: 3, height: 2 });
        for layout in [Layout::Rgb, Layout::Bgra, Layout::Grey16] {
            let output = Output::new(
                &target(Size { width: 5, height: 4 }, 8),
                Size { width: 3, height: 2 },
                Placement::centred(layout),
            )
            .unwrap();
            let (plain, row) = (image(&output, &levels, 0), output.row_bytes());
            let stride = row + 7;
            let mut gaps = vec![7; 3 * stride + row];
            output.write(Levels::Bytes(&levels), 0, &mut gaps, stride).unwrap();
            for (wide, plain) in gaps.chunks(stride).zip(plain.chunks(row)) {
                assert_eq!(wide[..row], *plain);
                assert!(wide[row..].iter().all(|byte| *byte == 7));
            }
            for (len, stride) in [(plain.len() - 1, row), (1000, row - 1), (1000, usize::MAX)] {
                let refused = output
                    .write(Levels::Bytes(&levels), 0, &mut vec![0; len], stride)
                    .unwrap_err();
                assert!(refused.to_string().contains("4 rows"), "{refused}");
            }
        }
    }

    #[test]
    fn few_bits_stand_in_the_upper_ones() {
        for bits in 1..=8 {
            let placement = Placement::centred(Layout::Grey);
            let output = Output::new(
                &target(Size { width: 1, height: 1 }, bits),
                Size { width: 1, height: 1 },
                placement,
            )
            .unwrap();
            let top = ((1u32 << bits) - 1) as u8;
            assert_eq!(image(&output, &[top; 3], 0), [top << (8 - bits)]);
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let ten = Split::new([&[9, 8, 7], &[6, 5, 4], &[3, 2, 1, 0]]).unwrap();
        let all = [
            (Layout::Rgb, 8),
            (Layout::Bgra, 5),
            (Layout::Rgb10, 10),
            (Layout::Grey, 4),
            (Layout::Grey16, 10),
            (Layout::Split(ten), 10),
        ];
        for (layout, bits) in all {
            let placement = Placement {
                flip_x: true,
                flip_y: true,
                shift_x: 1,
                ..Placement::centred(layout)
            };
            let output = Output::new(
                &target(Size { width: 9, height: 6 }, bits),
                Size { width: 5, height: 3 },
                placement,
            )
            .unwrap();
            let words: Vec<u16> = (0..45).map(|i| (i * 37 + 5) % (1 << bits)).collect();
            let bytes: Vec<u8> = words.iter().map(|word| *word as u8).collect();
            let mut read = vec![0; words.len()];
            for image in 0..layout.images(3) {
                let mut pixels = vec![0; output.image_bytes()];
                let levels = if bits > 8 {
                    Levels::Words(&words)
                } else {
                    Levels::Bytes(&bytes)
                };
                output.write(levels, image, &mut pixels, output.row_bytes()).unwrap();
                output.read(&pixels, image, &mut read).unwrap();
            }
            assert_eq!(read, words, "{layout:?}");
        }
        let output = Output::new(
            &target(Size { width: 2, height: 1 }, 10),
            Size { width: 2, height: 1 },
            Placement::centred(Layout::Grey),
        )
        .unwrap();
        let error = output.read(&[0; 2], 0, &mut [0; 6]).unwrap_err().to_string();
        assert!(error.contains("10"), "{error}");
    }

    #[test]
    fn ten_bits_stand_in_words() {
        let target = target(Size { width: 2, height: 1 }, 10);
        let words = [1023, 5, 512, 6, 256, 7];
        for (layout, expected) in [
            (
                Layout::Rgb10,
                (1023u32 | 512 << 10 | 256 << 20 | 3 << 30).to_le_bytes().to_vec(),
            ),
            (Layout::Grey16, (1023u16 << 6).to_le_bytes().to_vec()),
            (Layout::Rgb, vec![255, 128, 64]),
        ] {
            let output = Output::new(&target, Size { width: 2, height: 1 }, Placement::centred(layout)).unwrap();
            let mut bytes = vec![0; output.image_bytes()];
            output
                .write(Levels::Words(&words), 0, &mut bytes, output.row_bytes())
                .unwrap();
            assert_eq!(bytes[..expected.len()], expected, "{layout:?}");
        }
        let around = Output::new(
            &target,
            Size { width: 1, height: 1 },
            Placement::centred(Layout::Grey16),
        )
        .unwrap();
        let mut bytes = vec![0; around.image_bytes()];
        around
            .write(Levels::Words(&[1, 2, 3]), 1, &mut bytes, around.row_bytes())
            .unwrap();
        assert_eq!(bytes[..4], [0x80, 0, 0, 0xc0]);
    }
}
