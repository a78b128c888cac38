//! Hologram files: modulator levels in a PNG, or a complex field in a `.npy`, with what is needed to look at them
//! again.

pub mod packed;
mod views;

pub use views::AberratedOptics;

use crate::display::{DisplayFile, lut_of};
use crate::input::{self, MOST_ARRAY, MOST_PICTURE, npy};
use crate::output::{self, Pending, has_extension};
use crate::picture::{PngShape, interleaved, open_image, write_png_of};
use crate::{Error, Result};
use image::DynamicImage;
use ndarray::{Array3, ArrayView3, Ix3};
use ndarray_npy::WriteNpyExt;
use num_complex::Complex32;
use phasefront::Display;
use phasefront::output::ModulatorSpec;
use phasefront::target::Response;
use phasefront_core::runtime::file;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Name of the PNG text chunk that holds a [`HologramInfo`].
const PNG_CHUNK: &str = "phasefront";

/// Name of the PNG text chunk by which it is known what a hologram was made of ([`read_made_of`]).
const MADE_OF_CHUNK: &str = "phasefront-made-of";

/// What is needed to look at a hologram again; it travels with the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HologramInfo {
    /// The display it was made for; the hologram stands at its offset.
    pub display: Display,
    /// How the field became phases; absent for a complex hologram.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoder: Option<String>,
    /// The amplitude that full light stands for; absent for a complex hologram.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f32>,
    /// The modulator's look-up table, if it is not linear: the level of each of 256 phase steps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lut: Option<Vec<u8>>,
    /// The phase that each of the modulator's levels shows, in turns of 2π, if they are not even over one turn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub levels_turns: Option<Vec<f64>>,
    /// What else of a calibrated display it was made for, as the display's file names it: its view needs that file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub calibrated: Vec<String>,
}

/// What full light may stand for: an amplitude of a field that was made of amplitudes up to 1.
const SCALES: std::ops::RangeInclusive<f32> = 1e-6..=1e6;

/// Most characters of an encoder's name and of a key of a display's file.
const MOST_NAME: usize = 64;

impl HologramInfo {
    /// The text chunk that a PNG carries of it.
    fn chunk(&self, path: &Path) -> Result<(&'static str, String)> {
        let text = serde_json::to_string(self).map_err(|e| Error::file(path, e))?;
        Ok((PNG_CHUNK, text))
    }

    /// Checks what a file says.
    ///
    /// # Errors
    /// Values that no hologram of ours has.
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
        Ok(())
    }

    /// The display as far as this says it.
    ///
    /// # Errors
    /// A table that has not 256 entries, or a hologram for a display whose calibration is in files of its own.
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
        })
    }
}

/// Levels of a modulator, (C, H, W).
#[derive(Debug, Clone, PartialEq)]
pub enum Levels {
    /// Of up to 8 bits.
    Bytes(Array3<u8>),
    /// Of more.
    Words(Array3<u16>),
}

impl Levels {
    /// (C, H, W).
    pub fn dim(&self) -> (usize, usize, usize) {
        match self {
            Levels::Bytes(levels) => levels.dim(),
            Levels::Words(levels) => levels.dim(),
        }
    }

    /// The hologram of them that `info` is about.
    pub fn hologram(self, info: HologramInfo) -> Hologram {
        match self {
            Levels::Bytes(levels) => Hologram::PhaseOnly(levels, info),
            Levels::Words(levels) => Hologram::Words(levels, info),
        }
    }
}

/// A hologram as a file holds it.
#[derive(Debug, Clone, PartialEq)]
pub enum Hologram {
    /// Modulator levels, (C, H, W).
    PhaseOnly(Array3<u8>, HologramInfo),
    /// Modulator levels of over 8 bits, (C, H, W).
    Words(Array3<u16>, HologramInfo),
    /// A complex field, (C, H, W).
    Complex(Array3<Complex32>, HologramInfo),
}

/// Writes a phase-only hologram, (C, H, W), as an 8-bit PNG of levels that carries `info`: RGB, or grey for one laser.
///
/// # Errors
/// A file that cannot be written.
pub fn write_phase_only(path: &Path, levels: ArrayView3<'_, u8>, info: &HologramInfo) -> Result<()> {
    write_bytes(path, levels, &[info.chunk(path)?])
}

fn write_bytes(path: &Path, levels: ArrayView3<'_, u8>, texts: &[(&str, String)]) -> Result<()> {
    let (colours, height, width) = levels.dim();
    let shape = PngShape::of_levels(colours, height, width);
    write_png_of(path, shape, &interleaved(levels, |v| v), texts)
}

/// Writes a phase-only hologram of over 8 bits, (C, H, W), as a 16-bit PNG of levels that carries `info`: RGB, or grey
/// for one laser.
///
/// # Errors
/// A file that cannot be written.
pub fn write_words(path: &Path, levels: ArrayView3<'_, u16>, info: &HologramInfo) -> Result<()> {
    write_words_of(path, levels, &[info.chunk(path)?])
}

fn write_words_of(path: &Path, levels: ArrayView3<'_, u16>, texts: &[(&str, String)]) -> Result<()> {
    let (colours, height, width) = levels.dim();
    let words = levels.permuted_axes([1, 2, 0]);
    let bytes: Vec<u8> = words.iter().flat_map(|level| level.to_be_bytes()).collect();
    let shape = PngShape {
        depth: png::BitDepth::Sixteen,
        ..PngShape::of_levels(colours, height, width)
    };
    write_png_of(path, shape, &bytes, texts)
}

/// Writes `hologram` to the file of its kind.
///
/// # Errors
/// A file that cannot be written.
pub fn write_hologram(path: &Path, hologram: &Hologram) -> Result<()> {
    match hologram {
        Hologram::PhaseOnly(levels, info) => write_phase_only(path, levels.view(), info),
        Hologram::Words(levels, info) => write_words(path, levels.view(), info),
        Hologram::Complex(field, info) => write_complex(path, field.view(), info),
    }
}

/// Writes the levels of `hologram`, and what they were made of, which [`read_made_of`] gives back.
///
/// # Errors
/// A file that cannot be written; a complex field.
pub fn write_made_of(path: &Path, hologram: &Hologram, made_of: &str) -> Result<()> {
    let texts = [hologram.info().chunk(path)?, (MADE_OF_CHUNK, made_of.to_owned())];
    match hologram {
        Hologram::PhaseOnly(levels, _) => write_bytes(path, levels.view(), &texts),
        Hologram::Words(levels, _) => write_words_of(path, levels.view(), &texts),
        Hologram::Complex(..) => Err(Error::file(path, "a complex field is no PNG")),
    }
}

/// Writes a complex hologram, (C, H, W), as a `.npy` of complex64 with `info` in `NAME.json` beside it.
///
/// # Errors
/// A file that cannot be written.
pub fn write_complex(path: &Path, field: ArrayView3<'_, Complex32>, info: &HologramInfo) -> Result<()> {
    let beside = beside(path)?;
    let text = serde_json::to_string_pretty(info).map_err(|e| Error::file(&beside, e))?;
    let field = Pending::write(path, |file| field.write_npy(file).map_err(std::io::Error::other))?;
    let info = Pending::write(&beside, |file| writeln!(file, "{text}"))?;
    field.place()?;
    info.place()
}

/// Declares the two files of a complex hologram as outputs.
///
/// # Errors
/// Those of [`output::file`]; a `NAME.json` that does not belong to a hologram.
pub fn declare_complex(path: &Path) -> Result<()> {
    output::file(path, &["npy"])?;
    output::file(&beside(path)?, &[])
}

/// The `NAME.json` of a complex hologram; one that is there is a hologram's, as only those are replaced.
fn beside(path: &Path) -> Result<PathBuf> {
    let beside = path.with_extension("json");
    if beside.is_file() {
        // Ours has a table of 1024 entries at most.
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

/// Reads a hologram: a PNG of levels that carries its [`HologramInfo`], or a `.npy` with its `.json`.
///
/// # Errors
/// A file that is missing or cut short, or an image that is no hologram of ours.
pub fn read_hologram(path: &Path) -> Result<Hologram> {
    if has_extension(path, "npy") {
        let field = npy::read::<Complex32, Ix3>(&input::bytes(path, MOST_ARRAY)?)
            .map_err(|e| Error::file(path, format!("is not a whole complex64 .npy of shape (C, H, W): {e}")))?;
        let beside = path.with_extension("json");
        output::reading(&beside)?;
        let text = file::read_text(&beside)
            .map_err(|e| Error::file(&beside, format!("is needed beside {}: {e}", path.display())))?;
        let info: HologramInfo = serde_json::from_str(&text).map_err(|e| Error::file(&beside, e))?;
        info.check().map_err(|e| Error::file(&beside, e))?;
        let colours = info.display.colours();
        if field.dim().0 != colours || field.is_empty() {
            return Err(Error::file(
                path,
                format!("has shape {:?}; it must be ({colours}, H, W)", field.dim()),
            ));
        }
        return Ok(Hologram::Complex(field.as_standard_layout().into_owned(), info));
    }
    let info = read_info(path)?.ok_or_else(|| {
        Error::file(
            path,
            "carries no `phasefront` text chunk; it must be a hologram PNG as written by `phasefront hologram`",
        )
    })?;
    levels_of(open_image(path)?, &info)
        .map(|levels| levels.hologram(info))
        .map_err(|why| Error::file(path, why))
}

/// The levels that `image` holds.
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

/// The [`HologramInfo`] that a PNG carries, `None` where the file is another image.
fn read_info(path: &Path) -> Result<Option<HologramInfo>> {
    let Some(text) = read_text(path, PNG_CHUNK)? else {
        return Ok(None);
    };
    serde_json::from_str(&text)
        .map_err(|e| Error::Input(e.to_string()))
        .and_then(|info: HologramInfo| info.check().map(|()| Some(info)))
        .map_err(|e| Error::file(path, format!("its `{PNG_CHUNK}` text chunk is broken: {e}")))
}

/// What [`write_made_of`] noted in a PNG, and the hologram's scale; `None` where it noted nothing.
///
/// # Errors
/// A file that cannot be read.
pub fn read_made_of(path: &Path) -> Result<Option<(String, Option<f32>)>> {
    let made_of = read_text(path, MADE_OF_CHUNK)?;
    let scale = read_info(path)?.and_then(|info| info.scale);
    Ok(made_of.map(|made_of| (made_of, scale)))
}

/// The text chunk called `name` of a PNG, `None` where it has none or is no PNG.
fn read_text(path: &Path, name: &str) -> Result<Option<String>> {
    let file = input::open(path, MOST_PICTURE)?;
    let Ok(reader) = png::Decoder::new(file).read_info() else {
        return Ok(None);
    };
    let chunks = &reader.info().uncompressed_latin1_text;
    Ok((chunks.iter().find(|chunk| chunk.keyword == name)).map(|chunk| chunk.text.clone()))
}

/// Whether `path` holds a hologram of ours rather than a picture.
///
/// # Errors
/// A file that cannot be read.
pub fn is_hologram(path: &Path) -> Result<bool> {
    Ok(has_extension(path, "npy") || read_info(path)?.is_some())
}
