//! Conversion of holograms to and from the image files for a modulator's input.
//!
//! A layout with all colours in one image, or with one laser, uses one PNG. A layout with separate colours uses three:
//! `NAME-red.png`, `NAME-green.png` and `NAME-blue.png`.

use crate::display::DisplayFile;
use crate::hologram::Hologram;
use crate::output::{self, Pending};
use crate::picture::{PngShape, opaque, open_image, pending_png};
use crate::{Error, Result};
use image::DynamicImage;
use ndarray::Array3;
use phasefront::Size;
use phasefront::output::Packing;
use phasefront::output::{BitPlanes, Layout, Levels, Output, Placement};
use std::path::{Path, PathBuf};

/// The names of the colours, in order.
pub const COLOURS: [&str; 3] = ["red", "green", "blue"];

/// Returns the index of the colour called `name` among `colours`.
///
/// # Errors
/// Returns an error if the name is unknown or the display has one laser, and therefore no red, green and blue.
pub fn colour(name: &str, colours: usize) -> Result<usize> {
    let known = COLOURS.iter().take(colours).position(|known| *known == name);
    known.filter(|_| colours == COLOURS.len()).ok_or_else(|| {
        Error::Input(format!(
            "--colour {name}: the display has one laser, whose maps have no other colour; leave it out"
        ))
    })
}

/// The pixels of one image file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    /// The size in pixels.
    pub size: Size,
    /// The rows of pixels, with 16-bit values big-endian.
    pub bytes: Vec<u8>,
    /// The pixel format.
    pub kind: Kind,
}

/// The pixel format of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// RGB with one byte per channel.
    Rgb,
    /// Grey with 8 bits.
    Grey,
    /// Grey with 16 bits.
    Grey16,
}

impl Image {
    /// Writes the image as a PNG.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        self.pending(path)?.place()
    }

    fn pending(&self, path: &Path) -> Result<Pending> {
        let (color, depth) = match self.kind {
            Kind::Rgb => (png::ColorType::Rgb, png::BitDepth::Eight),
            Kind::Grey => (png::ColorType::Grayscale, png::BitDepth::Eight),
            Kind::Grey16 => (png::ColorType::Grayscale, png::BitDepth::Sixteen),
        };
        let size = PngShape {
            width: self.size.width,
            height: self.size.height,
            color,
            depth,
        };
        pending_png(path, size, &self.bytes, &[])
    }

    /// Reads a PNG, BMP or TIFF. Palettes become their colours.
    ///
    /// # Errors
    /// Returns an error if the file is missing, truncated, or of another kind.
    pub fn read(path: &Path) -> Result<Self> {
        let image = opaque(open_image(path)?);
        let size = Size {
            width: image.width() as usize,
            height: image.height() as usize,
        };
        let (bytes, kind) = match image {
            DynamicImage::ImageRgb8(rgb) => (rgb.into_raw(), Kind::Rgb),
            DynamicImage::ImageLuma8(grey) => (grey.into_raw(), Kind::Grey),
            DynamicImage::ImageLuma16(grey) => (
                grey.into_raw().into_iter().flat_map(u16::to_be_bytes).collect(),
                Kind::Grey16,
            ),
            other => {
                return Err(Error::file(
                    path,
                    format!(
                        "holds {:?} pixels; a frame has RGB of 8 bits, or grey of 8 or 16",
                        other.color()
                    ),
                ));
            }
        };
        Ok(Image { size, bytes, kind })
    }
}

impl Image {
    /// Returns the image with the pixels of `kind`: a grey image that a BMP or a palette stores as RGB becomes grey.
    fn of_kind(&self, kind: Kind) -> Image {
        let pixels = self.bytes.as_chunks::<3>().0;
        let is_grey = |[red, green, blue]: &[u8; 3]| red == green && green == blue;
        match (self.kind, kind) {
            (Kind::Rgb, Kind::Grey) if pixels.iter().all(is_grey) => Image {
                size: self.size,
                bytes: pixels.iter().map(|pixel| pixel[0]).collect(),
                kind,
            },
            _ => self.clone(),
        }
    }
}

fn kind(layout: Layout) -> Kind {
    match layout {
        Layout::Grey => Kind::Grey,
        Layout::Grey16 => Kind::Grey16,
        _ => Kind::Rgb,
    }
}

/// Swaps the bytes of 16-bit pixels: the core uses little-endian values and PNG uses big-endian ones.
fn swap(kind: Kind, bytes: &mut [u8]) {
    if kind == Kind::Grey16 {
        bytes.as_chunks_mut::<2>().0.iter_mut().for_each(|word| word.reverse());
    }
}

fn output(display: &DisplayFile, size: Size, layout: Layout) -> Result<Output> {
    let placement = Placement {
        flip_x: display.device.flip_x,
        flip_y: display.device.flip_y,
        ..Placement::centred(layout)
    };
    Ok(Output::new(&display.target, size, placement)?)
}

/// Plans the bit planes of a modulator of `cells` for a hologram of `size` that covers every pixel.
///
/// # Errors
/// Returns an error if the hologram has another size.
pub fn bit_planes(display: &DisplayFile, size: Size, cells: &phasefront::output::Cells) -> Result<BitPlanes> {
    let modulator = display.device.display.size();
    if size != modulator {
        return Err(Error::Input(format!(
            "a hologram of {}×{} for a modulator of {}×{} pixels; for bit planes both must be of one size",
            size.width, size.height, modulator.width, modulator.height
        )));
    }
    let device = &display.device;
    Ok(BitPlanes::new(cells, size, device.flip_x, device.flip_y))
}

/// Packs a phase-only hologram into one image, or one image for each colour.
///
/// # Errors
/// Returns an error if the hologram is complex, is larger than the modulator, or was made for another display.
pub fn pack(hologram: &Hologram, display: &DisplayFile) -> Result<Vec<Image>> {
    hologram.check_display(display)?;
    let size = hologram.size();
    let colours = display.device.display.colours();
    let Hologram::Levels(levels, _) = hologram else {
        return Err(Error::Input(
            "a complex hologram has no levels; give the PNG of `phasefront hologram`".into(),
        ));
    };
    match (&display.device.packing, levels.view()) {
        (Packing::Images(layout), levels) => {
            let output = output(display, size, *layout)?;
            (0..layout.images(colours))
                .map(|image| {
                    let mut bytes = vec![0; output.image_bytes()];
                    output.write(levels, image, &mut bytes, output.row_bytes())?;
                    swap(kind(*layout), &mut bytes);
                    Ok(Image {
                        size: output.size(),
                        bytes,
                        kind: kind(*layout),
                    })
                })
                .collect()
        }
        (Packing::BitPlanes(cells), Levels::Bytes(levels)) => {
            let plan = bit_planes(display, size, cells)?;
            let maps: Vec<&[u8]> = levels.chunks_exact(size.height * size.width).collect();
            Ok(vec![pack_maps(&plan, &maps)?])
        }
        _ => Err(Error::Input("levels of over 8 bits have no bit planes".into())),
    }
}

/// Packs a hologram like [`pack`], or the image of the colour called `name` alone.
///
/// # Errors
/// Returns the errors of [`pack`], and an error if the packing has not an image for each colour.
pub fn pack_colour(hologram: &Hologram, display: &DisplayFile, name: Option<&str>) -> Result<Vec<Image>> {
    let mut images = pack(hologram, display)?;
    let Some(name) = name else {
        return Ok(images);
    };
    match COLOURS.iter().position(|known| *known == name) {
        Some(colour) if images.len() == COLOURS.len() => Ok(vec![images.swap_remove(colour)]),
        _ => Err(Error::Input(
            "--colour is for packings of an image a colour; this display has all in one, or one laser".into(),
        )),
    }
}

/// Packs `maps` of levels, (H, W) each, into the frame that displays them in sequence.
///
/// # Errors
/// Returns an error if the number of maps does not divide 24.
pub fn pack_maps(plan: &BitPlanes, maps: &[&[u8]]) -> Result<Image> {
    let mut bytes = vec![0; plan.frame_bytes()];
    plan.pack(maps, &mut bytes, 3 * plan.frame_size().width)?;
    Ok(Image {
        size: plan.frame_size(),
        bytes,
        kind: Kind::Rgb,
    })
}

/// Extracts the levels, (C, H, W), of `size`, from the centre of the modulator in `images`.
///
/// # Errors
/// Returns an error if the images have another number, size or kind.
pub fn unpack(images: &[Image], display: &DisplayFile, size: Size) -> Result<Array3<u16>> {
    let colours = display.device.display.colours();
    let wanted = match &display.device.packing {
        Packing::Images(layout) => kind(*layout),
        _ => Kind::Rgb,
    };
    let images: Vec<Image> = images.iter().map(|image| image.of_kind(wanted)).collect();
    let mut levels = Array3::zeros((colours, size.height, size.width));
    let values = levels.as_slice_mut().expect("standard layout");
    let fits = |count: usize, size: Size, kind: Kind| match &images[..] {
        all if all.len() != count => Err(Error::Input(format!(
            "{} images; the display's packing has {count}",
            all.len()
        ))),
        all => all
            .iter()
            .find(|image| (image.size, image.kind) != (size, kind))
            .map_or(Ok(()), |image| {
                Err(Error::Input(format!(
                    "a frame of {}×{} {:?}; the display's are {}×{} {kind:?}",
                    image.size.width, image.size.height, image.kind, size.width, size.height
                )))
            }),
    };
    match &display.device.packing {
        Packing::BitPlanes(cells) => {
            let plan = bit_planes(display, size, cells)?;
            fits(1, plan.frame_size(), Kind::Rgb)?;
            let mut plane = vec![0; size.height * size.width];
            for (colour, values) in values.chunks_exact_mut(plane.len()).enumerate() {
                plan.unpack(&images[0].bytes, 8 * colour, &mut plane)?;
                values
                    .iter_mut()
                    .zip(&plane)
                    .for_each(|(value, level)| *value = (*level).into());
            }
        }
        Packing::Images(layout) => {
            let output = output(display, size, *layout)?;
            fits(layout.images(colours), output.size(), kind(*layout))?;
            for (n, image) in images.iter().enumerate() {
                let mut bytes = image.bytes.clone();
                swap(image.kind, &mut bytes);
                output.read(&bytes, n, values)?;
            }
        }
        _ => return Err(Error::Input("a packing that is not known here".into())),
    }
    Ok(levels)
}

/// Writes `images` to `path`, or to one file for each colour beside it, and returns the file names.
///
/// # Errors
/// Returns an error if a file cannot be written.
pub fn write(path: &Path, images: &[Image]) -> Result<Vec<PathBuf>> {
    let files = paths(path, images.len());
    let pending = files.iter().zip(images).map(|(path, image)| image.pending(path));
    // No file takes its place before all are on the disk.
    pending
        .collect::<Result<Vec<_>>>()?
        .into_iter()
        .try_for_each(Pending::place)?;
    Ok(files)
}

/// Declares the output files of a hologram for `display`.
///
/// # Errors
/// Returns the errors of [`output::file`].
pub fn declare(path: &Path, display: &DisplayFile) -> Result<()> {
    output::extension(path, &["png"])?;
    let count = match &display.device.packing {
        Packing::Images(layout) => layout.images(display.device.display.colours()),
        _ => 1,
    };
    if count > 1 && output::is_stdout(path) {
        return Err(Error::file(
            path,
            format!("is stdout, which takes one file; the modulator takes {count} images"),
        ));
    }
    paths(path, count)
        .iter()
        .try_for_each(|path| output::file(path, &["png"]))
}

/// Returns the paths of `count` images: `path` itself for one, or one path for each colour for three.
pub fn paths(path: &Path, count: usize) -> Vec<PathBuf> {
    if count == 1 {
        return vec![path.to_owned()];
    }
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let extension = path.extension().unwrap_or_default().to_string_lossy().into_owned();
    (COLOURS.iter().take(count))
        .map(|colour| path.with_file_name(format!("{stem}-{colour}.{extension}")))
        .collect()
}
