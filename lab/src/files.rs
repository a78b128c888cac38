//! The files of the laboratory: images in, holograms out and back. LDI folders are [`crate::ldi`]'s, data
//! sets [`crate::dataset`]'s.

use crate::calibrate::table::{self, AberrationFile};
use crate::decode::{self, Reading};
use crate::error::{Error, Result};
use crate::input::{self, MOST_ARRAY, MOST_PICTURE};
use crate::npy;
pub use crate::output::write_atomically;
use crate::output::{self, Pending};
use crate::panel_file;
use image::{DynamicImage, RgbImage};
use ndarray::{Array3, ArrayView3, Ix3};
use ndarray_npy::WriteNpyExt;
use num_complex::Complex32;
use phasefront::device::Device;
use phasefront::target::Response;
use phasefront::unstable::file;
use phasefront::unstable::keys;
use phasefront::{Display, Target};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

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
        let device = Device {
            levels_turns: self.levels_turns.clone(),
            ..Device::from(self.display.clone())
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

fn lut_of(levels: &[u8]) -> Result<[u8; 256]> {
    levels.try_into().map_err(|_| {
        Error::Input(format!(
            "the look-up table has {} entries; it must have 256",
            levels.len()
        ))
    })
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

pub use crate::decode::{COLOUR_FORMATS, DEPTH_FORMATS, MOST_PIXELS};
pub use crate::depth_file::read_depth;

/// The picture in the file at `path`, upright.
pub(crate) fn open_image(path: &Path) -> Result<DynamicImage> {
    decode::open_picture(path, Reading::UPRIGHT).map(|(image, _)| image)
}

/// The amplitudes of an image, (3, H, W) in \[0, 1], upright. Grey images have three equal colours; alpha is left out.
///
/// # Errors
/// A file that is missing, cut short, or none of [`COLOUR_FORMATS`].
pub fn read_rgb(path: &Path) -> Result<Array3<f32>> {
    open_image(path).map(amplitudes)
}

/// The amplitudes of `image`, (3, H, W) in \[0, 1].
pub(crate) fn amplitudes(image: DynamicImage) -> Array3<f32> {
    let (width, height) = (image.width() as usize, image.height() as usize);
    let amplitudes =
        |at: &dyn Fn(usize) -> f32| Array3::from_shape_fn((3, height, width), |(c, y, x)| at(3 * (y * width + x) + c));
    // Not by way of floats: that would be all of it twice.
    match image {
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => {
            let pixels = image.into_rgb16().into_raw();
            amplitudes(&|i| f32::from(pixels[i]) / 65535.0)
        }
        image => {
            let pixels = image.into_rgb8().into_raw();
            amplitudes(&|i| f32::from(pixels[i]) / 255.0)
        }
    }
}

/// The (H, W) of an image, upright, and its pixels as rows of RGB bytes. Grey images have three equal colours; alpha is
/// left out.
///
/// # Errors
/// A file that is missing, cut short, or none of [`COLOUR_FORMATS`].
pub fn read_rgb_bytes(path: &Path) -> Result<((usize, usize), Vec<u8>)> {
    let image = open_image(path)?.into_rgb8();
    let shape = (image.height() as usize, image.width() as usize);
    Ok((shape, image.into_raw()))
}

/// The bytes of a regular file of at most 2 GiB.
///
/// # Errors
/// An output of this command; a file that is missing, not regular or larger.
pub fn read_file(path: &Path) -> Result<Vec<u8>> {
    input::bytes(path, MOST_ARRAY)
}

/// Writes amplitudes, (C, H, W), as an 8-bit RGB PNG; what is over 1 is white, and one laser's are grey.
///
/// # Errors
/// A file that cannot be written.
pub fn write_amplitude(path: &Path, amplitude: ArrayView3<'_, f32>) -> Result<()> {
    let bytes = amplitude_bytes(amplitude);
    let (_, height, width) = amplitude.dim();
    write_png_of(path, PngShape::of_levels(3, height, width), &bytes, &[])
}

/// Amplitudes, (C, H, W), as rows of RGB bytes; one laser's are grey.
pub fn amplitude_bytes(amplitude: ArrayView3<'_, f32>) -> Vec<u8> {
    interleaved(as_rgb(&amplitude), |v| (v.clamp(0.0, 1.0) * 255.0).round() as u8)
}

/// A stack of (C, H, W) as one of (3, H, W): one laser's plane is all three.
pub(crate) fn as_rgb<'a, T>(stack: &'a ArrayView3<'_, T>) -> ArrayView3<'a, T> {
    let (_, height, width) = stack.dim();
    stack.broadcast((3, height, width)).expect("three colours or one")
}

fn interleaved<T: Copy>(stack: ArrayView3<'_, T>, byte: impl Fn(T) -> u8) -> Vec<u8> {
    let pixels = stack.permuted_axes([1, 2, 0]);
    pixels.iter().map(|v| byte(*v)).collect()
}

/// Writes an 8-bit RGB PNG.
///
/// # Errors
/// A file that cannot be written.
pub fn write_rgb(path: &Path, picture: &RgbImage) -> Result<()> {
    let (width, height) = picture.dimensions();
    let shape = PngShape::of_levels(3, height as usize, width as usize);
    write_png_of(path, shape, picture.as_raw(), &[])
}

/// Writes an 8-bit RGBA PNG of rows of `rgba`.
///
/// # Errors
/// A file that cannot be written.
pub fn write_rgba(path: &Path, width: usize, height: usize, rgba: &[u8]) -> Result<()> {
    let shape = PngShape {
        width,
        height,
        color: png::ColorType::Rgba,
        depth: png::BitDepth::Eight,
    };
    write_png_of(path, shape, rgba, &[])
}

/// Size and kind of a PNG's pixels.
#[derive(Clone, Copy)]
pub(crate) struct PngShape {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) color: png::ColorType,
    pub(crate) depth: png::BitDepth,
}

impl PngShape {
    /// Of (`colours`, `height`, `width`) bytes.
    fn of_levels(colours: usize, height: usize, width: usize) -> Self {
        PngShape {
            width,
            height,
            color: png_color(colours),
            depth: png::BitDepth::Eight,
        }
    }
}

/// What a PNG of so many colours is: RGB, or grey for one laser.
pub(crate) fn png_color(colours: usize) -> png::ColorType {
    match colours {
        1 => png::ColorType::Grayscale,
        _ => png::ColorType::Rgb,
    }
}

/// Writes a PNG of rows of `pixels`, words big-endian, with text chunks of these names.
fn write_png_of(path: &Path, shape: PngShape, pixels: &[u8], texts: &[(&str, String)]) -> Result<()> {
    pending_png(path, shape, pixels, texts)?.place()
}

/// As [`write_png_of`], not in its place yet.
pub(crate) fn pending_png(path: &Path, shape: PngShape, pixels: &[u8], texts: &[(&str, String)]) -> Result<Pending> {
    Pending::write(path, |file| {
        let mut encoder = png::Encoder::new(file, shape.width as u32, shape.height as u32);
        encoder.set_color(shape.color);
        encoder.set_depth(shape.depth);
        let other = std::io::Error::other;
        for (name, text) in texts {
            encoder.add_text_chunk((*name).into(), text.clone()).map_err(other)?;
        }
        let mut writer = encoder.write_header().map_err(other)?;
        writer.write_image_data(pixels).map_err(other)?;
        writer.finish().map_err(other)
    })
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

/// A display file and what it refers to.
#[derive(Debug, Clone)]
pub struct DisplayFile {
    /// What it says but for aberrations.
    pub target: Target,
    /// The modulator, and how its input takes a hologram.
    pub device: Device,
    /// The modulator's table, where it is calibrated as a whole.
    pub lut: Option<[u8; 256]>,
    /// What corrects the display's aberrations.
    pub aberration: Option<AberrationFile>,
}

impl From<Display> for DisplayFile {
    fn from(display: Display) -> Self {
        DisplayFile {
            target: (&display).into(),
            device: display.into(),
            lut: None,
            aberration: None,
        }
    }
}

impl DisplayFile {
    /// The target with the correction that is one for all depths and the whole frame, where there is something to
    /// correct.
    ///
    /// # Errors
    /// Aberrations that change over depth or over the frame, which only SM-LBM corrects.
    pub fn corrected(&self) -> Result<Target> {
        let correction = match &self.aberration {
            None => None,
            Some(AberrationFile::Uniform(all)) if all.constant().is_some() => all.constant(),
            Some(_) => {
                return Err(Error::Input(
                    "the display's aberration changes over depth or over the frame; --method layers corrects it, a network must be trained for it".into(),
                ));
            }
        };
        Ok(Target {
            correction,
            ..self.target.clone()
        })
    }

    /// Checks that `hologram` was made for this display: for its lasers, pitch and offset, and levels for its bits.
    ///
    /// # Errors
    /// What differs, of both.
    pub fn check(&self, hologram: &Hologram) -> Result<()> {
        let (theirs, ours) = (&hologram.info().display, &self.target.display);
        let of_levels = !matches!(hologram, Hologram::Complex(..));
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-5 * b.abs();
        let lasers = |display: &Display| {
            let nm = display.wavelengths_m().iter().map(|m| rounded(m * 1e9));
            format!("lasers of {} nm", nm.collect::<Vec<_>>().join("/"))
        };
        let pitch = |display: &Display| format!("a pitch of {} µm", rounded(display.pitch_m() * 1e6));
        let offset = |display: &Display| format!("an offset of {} mm", rounded(display.offset_m() * 1e3));
        let bits = |display: &Display| format!("levels of {} bits", display.bits());
        let same_lasers = theirs.colours() == ours.colours()
            && (theirs.wavelengths_m().iter().zip(ours.wavelengths_m())).all(|(a, b)| near(*a, *b));
        let same_offset = (theirs.offset_m() - ours.offset_m()).abs() < 1e-8;
        let differs = [
            (of_levels && theirs.bits() != ours.bits(), bits(theirs), bits(ours)),
            (!same_lasers, lasers(theirs), lasers(ours)),
            (!near(theirs.pitch_m(), ours.pitch_m()), pitch(theirs), pitch(ours)),
            (!same_offset, offset(theirs), offset(ours)),
        ];
        let (theirs, ours): (Vec<_>, Vec<_>) = differs
            .into_iter()
            .filter_map(|(differs, theirs, ours)| differs.then_some((theirs, ours)))
            .unzip();
        if theirs.is_empty() {
            return Ok(());
        }
        Err(Error::Input(format!(
            "the hologram is for {}, the display has {}; make it with this --display, or give the display and the --offset-mm that it was made for",
            theirs.join(", "),
            ours.join(", ")
        )))
    }

    /// What of the calibration a hologram does not carry with it, by the names of this file's keys.
    pub fn calibrated(&self, phase_only: bool) -> Vec<String> {
        let keys = [
            ("per_pixel", phase_only && self.target.response.shape().is_some()),
            ("laser", phase_only && self.target.illumination.is_some()),
            ("aberration", self.aberration.is_some()),
            (
                "carrier_mrad, lens_mm or flatness",
                phase_only && self.target.panel.adds(),
            ),
        ];
        let there = keys.into_iter().filter(|(_, there)| *there);
        there.map(|(key, _)| key.to_owned()).collect()
    }
}

/// A figure without the last digits of a float.
fn rounded(value: f64) -> String {
    ((value * 1e6).round() / 1e6).to_string()
}

/// The display of a file, or the device of that name: one that comes along, or one of the user's, a file in
/// `phasefront/devices` of the folder for configurations.
///
/// # Errors
/// As [`read_display`]; neither a file nor a name.
pub fn find_display(name: &str) -> Result<DisplayFile> {
    if let Some(path) = display_path(name) {
        return read_display(&path);
    }
    let device = Device::shipped(name)
        .map_err(|e| Error::Input(format!("--display {name}: no such file, and {}", one_line_of(&e))))?;
    Ok(DisplayFile {
        target: device.target()?,
        device,
        lut: None,
        aberration: None,
    })
}

/// The file that --display `name` reads, `None` where it is the name of a device that is no file.
pub fn display_path(name: &str) -> Option<PathBuf> {
    let path = Path::new(name);
    if path.exists() || has_extension(path, "toml") {
        return Some(path.to_owned());
    }
    own_devices()
        .into_iter()
        .find(|own| own.file_stem() == Some(name.as_ref()))
}

fn one_line_of(error: &phasefront::Error) -> String {
    error.to_string().trim_start_matches("display: ").to_owned()
}

/// The files of the user's own devices, sorted.
pub fn own_devices() -> Vec<PathBuf> {
    let folder = std::env::var_os("XDG_CONFIG_HOME")
        .map(PathBuf::from)
        .or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".config")));
    let entries = folder.and_then(|folder| std::fs::read_dir(folder.join("phasefront/devices")).ok());
    let mut files: Vec<_> = (entries.into_iter().flatten().flatten())
        .map(|entry| entry.path())
        .filter(|path| has_extension(path, "toml"))
        .collect();
    files.sort();
    files
}

/// Keys of a display's file that name other files.
const NAMED: [&str; 4] = ["lut", "per_pixel", "laser", "aberration"];
/// Keys each of which says what phase the levels show: a file has one of them at most.
const PHASES: [&str; 4] = ["lut", "per_pixel", "levels_turns", "range_turns"];

/// Checks the keys of the `table` of the display's file at `path`.
fn check_keys(path: &Path, table: &toml::Table) -> Result<()> {
    let known = [&keys::DISPLAY[..], &keys::DEVICE, &NAMED, &panel_file::KEYS].concat();
    keys::check(table, &known).map_err(|e| Error::file(path, one_line_of(&e)))?;
    let phases: Vec<_> = PHASES.into_iter().filter(|key| table.contains_key(*key)).collect();
    match phases[..] {
        [] | [_] => Ok(()),
        _ => Err(Error::file(
            path,
            format!(
                "{} each say what phase a level shows; give one of them",
                phases.join(" and ")
            ),
        )),
    }
}

/// Reads a display's TOML. Keys `lut`, `per_pixel`, `laser` and `aberration` name files, relative to it: a text file of
/// 256 levels, and those of [`crate::calibrate::table`]. Others are those of [`Device`] and [`crate::panel_file`].
///
/// # Errors
/// A file that is missing or says what cannot be.
pub fn read_display(path: &Path) -> Result<DisplayFile> {
    let text = input::text(path)?;
    let mut table: toml::Table =
        toml::from_str(&text).map_err(|e| Error::file(path, e.message().trim().replace('\n', " ")))?;
    check_keys(path, &table)?;
    let mut named = |key: &str| match table.remove(key) {
        None => Ok(None),
        Some(toml::Value::String(name)) => Ok(Some(path.with_file_name(name))),
        Some(_) => Err(Error::file(path, format!("{key} must be the name of a file"))),
    };
    let (lut_path, per_pixel_path) = (named("lut")?, named("per_pixel")?);
    let (laser_path, aberration_path) = (named("laser")?, named("aberration")?);
    let panel = panel_file::take(path, &mut table)?;
    let device = Device::from_table(table).map_err(|e| Error::file(path, one_line_of(&e)))?;
    let display = &device.display;
    let lut = match lut_path {
        None => None,
        Some(path) => {
            let levels: std::result::Result<Vec<u8>, _> =
                input::text(&path)?.split_whitespace().map(str::parse).collect();
            let levels = levels.map_err(|e| Error::file(&path, format!("holds what is no level of 0..=255: {e}")))?;
            let lut = lut_of(&levels).map_err(|e| Error::file(&path, e))?;
            let most = lut.into_iter().max().unwrap_or_default();
            if u32::from(most) >> display.bits() != 0 {
                return Err(Error::file(
                    &path,
                    format!(
                        "holds a level of {most}, over the {} bits of the display",
                        display.bits()
                    ),
                ));
            }
            Some(lut)
        }
    };
    let per_pixel = match per_pixel_path {
        None => None,
        Some(path) => {
            let table = table::read_per_pixel(&path)?;
            let (height, width) = table.shape();
            if (height, width) != (display.height(), display.width()) {
                return Err(Error::file(
                    path,
                    format!(
                        "is for {width}×{height} pixels, the display has {}×{}; calibrate this display",
                        display.width(),
                        display.height()
                    ),
                ));
            }
            Some(Arc::new(table))
        }
    };
    let mut target = device.target()?;
    let calibrated = match (per_pixel, lut) {
        (Some(table), _) => Some(Response::PerPixel(table)),
        (None, Some(lut)) => Some(Response::lut(lut)),
        (None, None) => None,
    };
    if let Some(response) = calibrated {
        target.response = response;
    }
    target.illumination = laser_path.map(|p| table::read_laser(&p)).transpose()?;
    panel.onto(path, &mut target)?;
    let aberration = match aberration_path {
        None => None,
        Some(path) => {
            let aberration = table::read_aberrations(&path)?;
            aberration.check(&target.display).map_err(|e| Error::file(path, e))?;
            Some(aberration)
        }
    };
    Ok(DisplayFile {
        target,
        device,
        lut,
        aberration,
    })
}

/// Whether the name of `path` ends in `.extension`.
pub fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}
