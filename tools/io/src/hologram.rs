//! Hologram files: modulator levels in a PNG, or a complex field in a `.npy`, with the data needed to view them again.

pub mod packed;
mod phase_map;
mod views;

pub use phase_map::{levels_of_phases, read_for};
use phasefront::Size;
pub use views::{AberratedOptics, check_z};

use crate::display::{DisplayFile, lens, lut_of};
use crate::input::decode::{self, Reading};
use crate::input::{self, MOST_PICTURE, npy};
use crate::output::{self, Pending, has_extension};
use crate::picture::{PngShape, interleaved, write_png_of};
use crate::{Error, Result};
use image::DynamicImage;
use ndarray::{Array3, ArrayView3, CowArray, Ix3};
use ndarray_npy::WriteNpyExt;
use num_complex::Complex32;
use phasefront::Display;
use phasefront::output::ModulatorSpec;
use phasefront::target::Response;
use phasefront_core::display::levels::{self, LevelsMut};
use phasefront_core::runtime::file;
use phasefront_core::view::colours::ViewColours;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};

/// The keyword of the PNG text chunk that holds a [`HologramInfo`].
const PNG_CHUNK: &str = "phasefront";

/// The keyword of the PNG text chunk that records the source of a hologram ([`read_made_of`]).
const MADE_OF_CHUNK: &str = "phasefront-made-of";

/// The data needed to view a hologram again, stored with the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HologramInfo {
    /// The display that the hologram was made for. The hologram plane lies at its offset.
    pub display: Display,
    /// The encoder that converted the field to phases. Absent for a complex hologram.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoder: Option<String>,
    /// The field amplitude that full brightness represents. Absent for a complex hologram.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f32>,
    /// The modulator's look-up table, if it is not linear: the level of each of 256 phase steps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lut: Option<Vec<u8>>,
    /// The phase of each modulator level, in turns of 2π, if the phases are not evenly spaced over one turn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub levels_turns: Option<Vec<f64>>,
    /// The keys of the display file that name other calibration files. Viewing the hologram needs the display file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub calibrated: Vec<String>,
    /// The matrix from the lasers' light, the squares of the amplitudes, to linear sRGB, row by row. Absent if the
    /// picture's values were amplitudes, as which views show them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub srgb_of_light: Option<[Vec<f32>; 3]>,
}

/// The valid range of the scale: an amplitude of a field computed from amplitudes up to 1.
const SCALES: std::ops::RangeInclusive<f32> = 1e-6..=1e6;

/// The maximum length, in characters, of an encoder name or a key of a display file.
const MOST_NAME: usize = 64;

/// The content of a PNG's text chunk.
#[derive(Serialize, Deserialize)]
struct Description {
    #[serde(flatten)]
    info: HologramInfo,
    /// The checksum of the levels, which reveals a picture that was resized, turned or edited but kept the chunk.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    levels: Option<String>,
}

impl HologramInfo {
    /// Creates the info of a hologram for an uncalibrated `display`, without encoder and scale, whose views are
    /// amplitudes.
    pub fn new(display: Display) -> Self {
        HologramInfo {
            display,
            encoder: None,
            scale: None,
            lut: None,
            levels_turns: None,
            calibrated: Vec::new(),
            srgb_of_light: None,
        }
    }

    /// Creates the info of levels for `display`, of which nothing else is known.
    pub fn of_levels(display: &DisplayFile) -> Self {
        HologramInfo {
            lut: display.lut.map(Vec::from),
            levels_turns: display.target.panel.levels_turns.clone(),
            calibrated: display.calibrated(true),
            ..Self::new(display.target.display.clone())
        }
    }

    /// Returns whether the picture lies in the focal plane of a lens.
    pub fn is_in_focal_plane(&self) -> bool {
        self.calibrated.iter().any(|key| key == lens::PLANE)
    }

    /// Returns the PNG text chunk for `levels` with this info.
    fn chunk(&self, path: &Path, levels: &Levels) -> Result<(&'static str, String)> {
        let description = Description {
            info: self.clone(),
            levels: Some(levels.checksum()),
        };
        let text = serde_json::to_string(&description).map_err(|e| Error::file(path, e))?;
        Ok((PNG_CHUNK, text))
    }

    /// Checks the values read from a file.
    ///
    /// # Errors
    /// Returns an error if a value is one that this software never writes.
    fn check(&self) -> Result<()> {
        let refuse = |why: String| Err(Error::Input(why));
        if let Some(scale) = self.scale
            && !SCALES.contains(&scale)
        {
            return refuse(format!(
                "scale is {scale}; it must lie in {:e}..={:e}",
                SCALES.start(),
                SCALES.end()
            ));
        }
        if let Some(name) = (self.encoder.iter().chain(&self.calibrated)).find(|name| name.len() > MOST_NAME) {
            return refuse(format!("a name has {} bytes; {MOST_NAME} are the most", name.len()));
        }
        if let Some(lut) = &self.lut {
            lut_of(lut)?;
        }
        if let Some(turns) = &self.levels_turns {
            let bits = self.display.bits();
            if bits > 8 || turns.len() != 1 << bits {
                return refuse(format!(
                    "levels_turns has {} levels for a display of {bits} bits; up to 8 bits it has one for each level",
                    turns.len()
                ));
            }
            Response::of_turns(turns)?;
        }
        if let Some(rows) = &self.srgb_of_light {
            let lasers = self.display.colours();
            if rows
                .iter()
                .any(|row| row.len() != lasers || row.iter().any(|v| !v.is_finite()))
            {
                return refuse(format!(
                    "srgb_of_light must hold three rows of {lasers} numbers, one for each laser"
                ));
            }
        }
        Ok(())
    }

    /// Returns [`Self::srgb_of_light`] for views in `colours` on a display with `lasers`.
    pub fn light_rows(colours: &ViewColours, lasers: usize) -> Option<[Vec<f32>; 3]> {
        Some(colours.matrix()?.map(|row| row[..lasers].to_vec()))
    }

    /// Returns how views become pictures.
    pub fn view_colours(&self) -> ViewColours {
        match &self.srgb_of_light {
            None => ViewColours::Amplitude,
            Some(rows) => {
                let number = |row: &Vec<f32>, laser: usize| row.get(laser).copied().unwrap_or_default();
                ViewColours::Srgb(rows.each_ref().map(|row| [0, 1, 2].map(|laser| number(row, laser))))
            }
        }
    }

    /// Returns the display, as far as this info describes it.
    ///
    /// # Errors
    /// Returns an error if a table does not have 256 entries or if the display's calibration is in separate files.
    pub fn display_file(&self) -> Result<DisplayFile> {
        if !self.calibrated.is_empty() {
            return Err(Error::Input(format!(
                "made for a calibrated display ({}); `refocus` and `view` show it on the display's file, --display FILE",
                self.calibrated.join(", ")
            )));
        }
        let lut = self.lut.as_deref().map(lut_of).transpose()?;
        let device = ModulatorSpec {
            levels_turns: self.levels_turns.clone(),
            ..ModulatorSpec::from(self.display.clone())
        };
        let mut target = device.target()?;
        if let Some(lut) = lut {
            target.response = Response::lut(lut);
        }
        Ok(DisplayFile {
            target,
            device,
            lut,
            aberration: None,
            lens: None,
        })
    }
}

/// The levels of a modulator, (C, H, W).
#[derive(Debug, Clone, PartialEq)]
pub enum Levels {
    /// Levels of up to 8 bits.
    Bytes(Array3<u8>),
    /// Levels of more than 8 bits.
    Words(Array3<u16>),
}

impl Levels {
    /// Returns levels 0 for a hologram of a size on `display`.
    pub fn zeros(display: &Display, Size { width, height }: Size) -> Self {
        let shape = (display.colours(), height, width);
        if display.bits() <= 8 {
            Levels::Bytes(Array3::zeros(shape))
        } else {
            Levels::Words(Array3::zeros(shape))
        }
    }

    /// Returns the shape, (C, H, W).
    pub fn dim(&self) -> (usize, usize, usize) {
        match self {
            Levels::Bytes(levels) => levels.dim(),
            Levels::Words(levels) => levels.dim(),
        }
    }

    /// Returns the CRC-32 of PNG over C, H, W, as 64 bits each, and the levels, little-endian and one colour after
    /// another, as eight hexadecimal digits.
    fn checksum(&self) -> String {
        let (colours, height, width) = self.dim();
        let mut all = crc32fast::Hasher::new();
        for number in [colours, height, width] {
            all.update(&(number as u64).to_le_bytes());
        }
        match self.view() {
            levels::Levels::Bytes(levels) => all.update(levels),
            levels::Levels::Words(levels) => levels.iter().for_each(|level| all.update(&level.to_le_bytes())),
        }
        format!("{:08x}", all.finalize())
    }

    /// Returns the levels in memory.
    pub fn view(&self) -> levels::Levels<'_> {
        match self {
            Levels::Bytes(levels) => levels::Levels::Bytes(levels.as_slice().expect("standard layout")),
            Levels::Words(levels) => levels::Levels::Words(levels.as_slice().expect("standard layout")),
        }
    }

    /// Returns the memory of the levels.
    pub fn view_mut(&mut self) -> LevelsMut<'_> {
        match self {
            Levels::Bytes(levels) => LevelsMut::Bytes(levels.as_slice_mut().expect("standard layout")),
            Levels::Words(levels) => LevelsMut::Words(levels.as_slice_mut().expect("standard layout")),
        }
    }

    /// Returns the upper 8 bits of levels of `bits` bits.
    pub fn upper(&self, bits: u32) -> CowArray<'_, u8, Ix3> {
        match self {
            Levels::Bytes(levels) => levels.view().into(),
            Levels::Words(levels) => levels.mapv(|level| (level >> bits.saturating_sub(8)) as u8).into(),
        }
    }

    /// Writes the levels as a PNG with `texts`: RGB or, for one laser, grey, with 8 or 16 bits.
    fn write(&self, path: &Path, texts: &[(&str, String)]) -> Result<()> {
        let (colours, height, width) = self.dim();
        let shape = PngShape::of_levels(colours, Size { width, height });
        match self {
            Levels::Bytes(levels) => write_png_of(path, shape, &interleaved(levels.view(), |v| v), texts),
            Levels::Words(levels) => {
                let words = levels.view().permuted_axes([1, 2, 0]);
                let bytes: Vec<u8> = words.iter().flat_map(|level| level.to_be_bytes()).collect();
                let depth = png::BitDepth::Sixteen;
                write_png_of(path, PngShape { depth, ..shape }, &bytes, texts)
            }
        }
    }
}

/// A hologram as stored in a file.
#[derive(Debug, Clone, PartialEq)]
pub enum Hologram {
    /// Modulator levels.
    Levels(Levels, HologramInfo),
    /// A complex field, (C, H, W).
    Complex(Array3<Complex32>, HologramInfo),
}

/// Writes `hologram` in the file format of its kind.
///
/// # Errors
/// Returns an error if the file cannot be written.
pub fn write_hologram(path: &Path, hologram: &Hologram) -> Result<()> {
    match hologram {
        Hologram::Levels(levels, info) => levels.write(path, &[info.chunk(path, levels)?]),
        Hologram::Complex(field, info) => write_complex(path, field.view(), info),
    }
}

/// Writes the levels of `hologram` with the description `made_of`, which [`read_made_of`] returns.
///
/// # Errors
/// Returns an error if the file cannot be written or the hologram is a complex field.
pub fn write_made_of(path: &Path, hologram: &Hologram, made_of: &str) -> Result<()> {
    match hologram {
        Hologram::Levels(levels, info) => {
            let texts = [info.chunk(path, levels)?, (MADE_OF_CHUNK, made_of.to_owned())];
            levels.write(path, &texts)
        }
        Hologram::Complex(..) => Err(Error::file(path, "a complex field is no PNG")),
    }
}

/// Writes a complex hologram, (C, H, W), as a `.npy` of complex64, and `info` in `NAME.json` beside it.
///
/// # Errors
/// Returns an error if a file cannot be written.
pub fn write_complex(path: &Path, field: ArrayView3<'_, Complex32>, info: &HologramInfo) -> Result<()> {
    let beside = beside(path)?;
    let text = serde_json::to_string_pretty(info).map_err(|e| Error::file(&beside, e))?;
    let field = Pending::write(path, |file| field.write_npy(file).map_err(std::io::Error::other))?;
    let info = Pending::write(&beside, |file| writeln!(file, "{text}"))?;
    field.place()?;
    info.place()
}

/// Writes phases in radians, (C, H, W), as a `.npy` of float32.
///
/// # Errors
/// Returns an error if the file cannot be written.
pub fn write_phases(path: &Path, phases: ArrayView3<'_, f32>) -> Result<()> {
    output::write_atomically(path, |file| phases.write_npy(file).map_err(std::io::Error::other))
}

/// Declares the two files of a complex hologram as outputs.
///
/// # Errors
/// Returns the errors of [`output::file`], and an error if an existing `NAME.json` does not belong to a hologram.
pub fn declare_complex(path: &Path) -> Result<()> {
    output::file(path, &["npy"])?;
    output::file(&beside(path)?, &[])
}

/// Returns the path of the `NAME.json` of a complex hologram. An existing file must belong to a hologram, because only
/// those may be replaced.
fn beside(path: &Path) -> Result<PathBuf> {
    let beside = path.with_extension("json");
    if beside.is_file() {
        // A valid file has a table of at most 1024 entries.
        let is_small = std::fs::metadata(&beside).is_ok_and(|about| about.len() < 1 << 20);
        let is_ours =
            is_small && file::read_text(&beside).is_ok_and(|text| serde_json::from_str::<HologramInfo>(&text).is_ok());
        if !is_ours {
            let npy = path.display();
            return Err(Error::file(
                &beside,
                format!("is no description of a hologram, and {npy} needs its name; give another name"),
            ));
        }
    }
    Ok(beside)
}

/// Reads a complex field, (C, H, W), for `display` from a `.npy` of complex64 or complex128.
///
/// # Errors
/// Returns an error if the file is missing, truncated or of another type, or if the field does not have a plane for
/// each laser.
pub fn read_field(path: &Path, display: &DisplayFile) -> Result<Array3<Complex32>> {
    let field = npy::read_field(npy::open(path)?).map_err(|why| Error::file(path, why))?;
    match (field.dim().0, display.target.display.colours()) {
        (theirs, ours) if theirs == ours => Ok(field),
        (theirs, 1) => Err(Error::file(
            path,
            format!("has {theirs} planes; the display has one laser: (H, W) or (1, H, W)"),
        )),
        (theirs, ours) => Err(Error::file(
            path,
            format!(
                "has {theirs} planes; the display has {ours} lasers: (3, H, W), or give a --display of one laser, wavelengths_nm = [532]"
            ),
        )),
    }
}

/// Reads a hologram: a PNG of levels that contains its [`HologramInfo`], or a `.npy` with its `.json`.
///
/// # Errors
/// Returns an error if the file is missing, truncated, or not a hologram, or if its levels are not those that it was
/// written with.
pub fn read_hologram(path: &Path) -> Result<Hologram> {
    if has_extension(path, "npy") {
        let field = npy::read_field(npy::open(path)?).map_err(|why| Error::file(path, why))?;
        let beside = path.with_extension("json");
        output::reading(&beside)?;
        let text = file::read_text(&beside).map_err(|e| {
            let path = path.display();
            Error::file(
                &beside,
                format!("is needed beside {path}, or --display for phases of other software: {e}"),
            )
        })?;
        let info: HologramInfo = serde_json::from_str(&text).map_err(|e| Error::file(&beside, e))?;
        info.check().map_err(|e| Error::file(&beside, e))?;
        let colours = info.display.colours();
        if field.dim().0 != colours || field.is_empty() {
            return Err(Error::file(
                path,
                format!("has shape {:?}; it must be ({colours}, H, W)", field.dim()),
            ));
        }
        return Ok(Hologram::Complex(field, info));
    }
    let Description { info, levels: written } = read_description(path)?.ok_or_else(|| {
        Error::file(
            path,
            "carries no `phasefront` text chunk, as a hologram of `phasefront hologram` does; a phase map of other software needs --display",
        )
    })?;
    // Levels are for the pixels of a modulator, so that Exif data that viewers add turn nothing.
    let (image, _) = decode::open_picture(path, Reading::AS_STORED)?;
    let levels = levels_of(image, &info).map_err(|why| Error::file(path, why))?;
    if written.is_some_and(|written| written != levels.checksum()) {
        return Err(Error::file(
            path,
            "holds other levels than it was written with: another program resized, turned or edited it; take the file as `phasefront` wrote it",
        ));
    }
    Ok(Hologram::Levels(levels, info))
}

/// Returns the levels in `image`.
fn levels_of(image: DynamicImage, info: &HologramInfo) -> std::result::Result<Levels, String> {
    let (width, height) = (image.width() as usize, image.height() as usize);
    let shape @ (colours, ..) = (info.display.colours(), height, width);
    let at = |(c, y, x): (usize, usize, usize)| colours * (y * width + x) + c;
    let levels = match (image, colours) {
        (DynamicImage::ImageRgb8(image), 3) => bytes_of(image.into_raw(), shape, at),
        (DynamicImage::ImageLuma8(image), 1) => bytes_of(image.into_raw(), shape, at),
        (DynamicImage::ImageRgb16(image), 3) => words_of(image.into_raw(), shape, at),
        (DynamicImage::ImageLuma16(image), 1) => words_of(image.into_raw(), shape, at),
        (_, 1) => return Err("is not a grey image of levels, as one laser has".into()),
        _ => return Err("is not an RGB image of levels".into()),
    };
    let most = match &levels {
        Levels::Bytes(levels) => levels.iter().copied().max().unwrap_or_default().into(),
        Levels::Words(levels) => levels.iter().copied().max().unwrap_or_default(),
    };
    if u32::from(most) >> info.display.bits() != 0 {
        return Err(format!(
            "holds a level of {most}, over the {} bits that it says",
            info.display.bits()
        ));
    }
    Ok(levels)
}

type Place = (usize, usize, usize);

fn bytes_of(levels: Vec<u8>, shape: Place, at: impl Fn(Place) -> usize) -> Levels {
    Levels::Bytes(Array3::from_shape_fn(shape, |place| levels[at(place)]))
}

fn words_of(levels: Vec<u16>, shape: Place, at: impl Fn(Place) -> usize) -> Levels {
    Levels::Words(Array3::from_shape_fn(shape, |place| levels[at(place)]))
}

/// Reads the [`Description`] of a PNG. Returns `None` for other images.
fn read_description(path: &Path) -> Result<Option<Description>> {
    let Some(text) = read_text(path, PNG_CHUNK)? else {
        return Ok(None);
    };
    serde_json::from_str(&text)
        .map_err(|e| Error::Input(e.to_string()))
        .and_then(|description: Description| description.info.check().map(|()| Some(description)))
        .map_err(|e| Error::file(path, format!("its `{PNG_CHUNK}` text chunk is broken: {e}")))
}

/// Returns the description that [`write_made_of`] stored in a PNG and the hologram's scale, or `None` without a
/// description.
///
/// # Errors
/// Returns an error if the file cannot be read.
pub fn read_made_of(path: &Path) -> Result<Option<(String, Option<f32>)>> {
    let made_of = read_text(path, MADE_OF_CHUNK)?;
    let scale = read_description(path)?.and_then(|description| description.info.scale);
    Ok(made_of.map(|made_of| (made_of, scale)))
}

/// Returns the text chunk called `name` of a PNG, or `None` if there is no such chunk or the file is not a PNG.
fn read_text(path: &Path, name: &str) -> Result<Option<String>> {
    let file = input::open(path, MOST_PICTURE)?;
    let mut decoder = png::Decoder::new(file);
    decoder.set_ignore_iccp_chunk(true);
    let Ok(reader) = decoder.read_info() else {
        return Ok(None);
    };
    let chunks = &reader.info().uncompressed_latin1_text;
    Ok((chunks.iter().find(|chunk| chunk.keyword == name)).map(|chunk| chunk.text.clone()))
}

/// Checks whether `path` holds a hologram and not an ordinary picture.
///
/// # Errors
/// Returns an error if the file cannot be read.
pub fn is_hologram(path: &Path) -> Result<bool> {
    Ok(has_extension(path, "npy") || read_description(path)?.is_some())
}
