//! Decoding of pictures and depth maps. All of them pass through `decode`, which limits their pixels, turns them
//! upright according to their Exif data, and converts a decoder's panic to an error.

use crate::input::{self, MOST_PICTURE, jpeg, jpeg_end, openexr, quiet};
use crate::{Error, Result};
use image::codecs::png::PngDecoder;
use image::metadata::Orientation;
use image::{DynamicImage, ImageBuffer, ImageDecoder, ImageFormat, ImageReader};
use ndarray::{Array2, Axis};
use phasefront::Size;
use std::io::{BufRead, Cursor, Read, Seek, SeekFrom};
use std::path::Path;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

/// The supported formats of pictures with whole numbers, for messages.
const PICTURE_FORMATS: &str = "PNG, JPEG, WebP, TIFF or BMP, of 8 or 16 bits";
/// The supported colour formats, for messages.
pub const COLOUR_FORMATS: &str = "PNG, JPEG, WebP, TIFF or BMP of 8 or 16 bits, OpenEXR, Radiance (.hdr) or HEIC";
/// The supported depth formats, for messages.
pub const DEPTH_FORMATS: &str =
    "grey PNG, TIFF, WebP, JPEG, BMP or PGM of 8 or 16 bits, TIFF, OpenEXR or PFM of floating point, .npy or .npz";

/// The maximum number of pixels of an image, 8192²: more than two 8K frames.
pub const MOST_PIXELS: u64 = 1 << 26;

/// The maximum number of bytes of a PNG's colour profile, other metadata and a row of its pixels.
const MOST_PNG_DATA: u64 = 1 << 25;

/// Advice for HEIC and AVIF files, for which no maintained Rust decoder exists. libheif decodes HEIC's pictures.
const HEIC: &str = "is HEIC, which is not read here; --photo takes it with its depth, --rgb its colour, and `heif-convert --with-aux` of libheif writes it as PNG";
const AVIF: &str = "is AVIF, which is not read; save it as PNG or JPEG";

/// Advice for GIF files, which are read nowhere because they hold at most 256 colours.
const GIF: &str = "is a GIF, which is not read; save its picture as PNG: `ffmpeg -i picture.gif frame_%04d.png` does so for all pictures of one that moves";

/// Options for reading a picture.
#[derive(Debug, Clone, Copy)]
pub struct Reading {
    /// The maximum number of pixels.
    pub most_pixels: u64,
    /// Whether the picture is turned according to its Exif data.
    pub upright: bool,
}

impl Reading {
    /// Reads a picture upright.
    pub(crate) const UPRIGHT: Reading = Reading {
        most_pixels: MOST_PIXELS,
        upright: true,
    };
    /// Reads a picture without turning it, for pixels that other data refer to, such as textures.
    pub const AS_STORED: Reading = Reading {
        upright: false,
        ..Self::UPRIGHT
    };
}

/// One channel of a depth map, (H, W), with the values of its file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plane {
    pub(crate) values: Array2<f32>,
    pub(crate) numbers: Numbers,
}

/// The type of the numbers in a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Numbers {
    /// Integers up to `most`.
    Integers { most: f32 },
    /// Floating point of 16 bits.
    Halves,
    /// Floating point of 32 or 64 bits.
    Floats,
}

impl Numbers {
    /// Returns the largest number, which files of distances hold where there is no reading. For types whose largest
    /// number is over 10⁹, [`DepthUnit::metres`](phasefront_core::depth::DepthUnit::metres) finds it.
    pub(crate) fn no_reading(self) -> f32 {
        match self {
            Numbers::Integers { most } => most,
            Numbers::Halves => half::f16::MAX.to_f32(),
            Numbers::Floats => f32::MAX,
        }
    }
}

/// The pixels of a file.
#[derive(Debug)]
pub(crate) enum Pixels {
    /// Integers of 8 or 16 bits.
    Image(DynamicImage),
    /// Other numbers, in one channel.
    Plane(Plane),
}

/// The pixels of a file and their orientation.
#[derive(Debug)]
pub(crate) struct Decoded {
    pub(crate) pixels: Pixels,
    /// The orientation from the Exif data. It is already applied if [`Reading::upright`] is set.
    pub(crate) orientation: Orientation,
}

pub(crate) type Said<T> = std::result::Result<T, String>;

/// Decodes the picture or depth map in `from`.
///
/// # Errors
/// Returns an error if the file is of another kind, broken or truncated, or has too many pixels.
pub(crate) fn decode<R: BufRead + Seek>(mut from: R, how: Reading) -> Said<Decoded> {
    let mut head = Vec::new();
    (from.by_ref().take(16).read_to_end(&mut head))
        .and_then(|_| from.seek(SeekFrom::Start(0)))
        .map_err(|e| format!("cannot be read: {e}"))?;
    let decoded = quiet::caught(|| match kind(&head)? {
        Kind::Tiff => tiff(from, how),
        Kind::Exr => openexr::depth(from, how.most_pixels).map(|plane| Decoded {
            pixels: Pixels::Plane(plane),
            orientation: Orientation::NoTransforms,
        }),
        Kind::Image(format) => image(from, format, how),
    });
    let Decoded { pixels, orientation } = decoded.map_err(|why| broken(&why))??;
    let pixels = if how.upright {
        turned(pixels, orientation)
    } else {
        pixels
    };
    Ok(Decoded { pixels, orientation })
}

/// Decodes the picture in `bytes`, in colour or grey.
///
/// # Errors
/// Returns the errors of `decode`, and an error if the values are not those of a picture.
pub fn picture_of(bytes: &[u8], how: Reading) -> Said<(DynamicImage, Orientation)> {
    picture(decode(Cursor::new(bytes), how)?)
}

/// Decodes the colour or grey picture in the file at `path`. Returns the picture and its orientation.
///
/// # Errors
/// Returns the errors of `decode`, and an error if the file cannot be read or the values are not those of a picture.
pub fn open_picture(path: &Path, how: Reading) -> Result<(DynamicImage, Orientation)> {
    let file = input::open(path, MOST_PICTURE)?;
    decode(file, how).and_then(picture).map_err(|e| Error::file(path, e))
}

fn picture(decoded: Decoded) -> Said<(DynamicImage, Orientation)> {
    match decoded.pixels {
        Pixels::Image(image) => Ok((image, decoded.orientation)),
        Pixels::Plane(_) => Err(format!(
            "holds numbers of 32 bits or floating point, which are read as depth alone here; a picture is {PICTURE_FORMATS}"
        )),
    }
}

enum Kind {
    Tiff,
    Exr,
    Image(ImageFormat),
}

/// Returns advice if `head` begins an unsupported picture format of phones.
pub(crate) fn unread_container(head: &[u8]) -> Option<&'static str> {
    let brand = head.get(8..12).filter(|_| head.get(4..8) == Some(b"ftyp"))?;
    match brand {
        b"avif" | b"avis" => Some(AVIF),
        b"heic" | b"heix" | b"hevc" | b"heim" | b"mif1" | b"msf1" => Some(HEIC),
        _ => None,
    }
}

/// Checks whether `head` begins a HEIC file.
pub(crate) fn is_heic(head: &[u8]) -> bool {
    unread_container(head) == Some(HEIC)
}

/// Returns the kind of a file, from its first bytes.
fn kind(head: &[u8]) -> Said<Kind> {
    if let Some(why) = unread_container(head) {
        return Err(why.into());
    }
    if head.starts_with(b"\x76\x2f\x31\x01") {
        return Ok(Kind::Exr);
    }
    match image::guess_format(head) {
        Ok(ImageFormat::Gif) => Err(GIF.into()),
        Ok(ImageFormat::Tiff) => Ok(Kind::Tiff),
        Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Bmp | ImageFormat::WebP)) => {
            Ok(Kind::Image(format))
        }
        // BigTIFF has another version number.
        _ if head.starts_with(b"II\x2b\0") || head.starts_with(b"MM\0\x2b") => Ok(Kind::Tiff),
        _ => Err(format!(
            "is not a picture of a kind that is read: {COLOUR_FORMATS}; depth also as PGM, PFM, .npy or .npz"
        )),
    }
}

pub(crate) fn broken(why: &dyn std::fmt::Display) -> String {
    format!("is not a whole picture: {why}")
}

/// Checks the number of pixels, because a small file may hold a large image.
pub(crate) fn check(size: Size, most: u64) -> Said<()> {
    if (size.width as u64).saturating_mul(size.height as u64) > most {
        return Err(format!("has {size} pixels; {most} in all are the most"));
    }
    Ok(())
}

fn image<R: BufRead + Seek>(mut from: R, format: ImageFormat, how: Reading) -> Said<Decoded> {
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(8 * how.most_pixels);
    match format {
        ImageFormat::Png => {
            let mut data = limits.clone();
            data.max_alloc = Some(MOST_PNG_DATA);
            let decoder = PngDecoder::with_limits(from, data);
            return decoded(decoder.map_err(|e| broken(&e))?, limits, how);
        }
        ImageFormat::Jpeg => {
            let unread = |e: std::io::Error| format!("cannot be read: {e}");
            jpeg::check(&mut from)?;
            from.rewind().map_err(unread)?;
            let mut bytes = Vec::new();
            from.read_to_end(&mut bytes).map_err(unread)?;
            if jpeg_end::end(&bytes).is_none() {
                return Err(broken(&"its JPEG is cut short, without a mark of its end"));
            }
            from.rewind().map_err(unread)?;
        }
        _ => {}
    }
    let mut reader = ImageReader::with_format(from, format);
    reader.limits(limits.clone());
    decoded(reader.into_decoder().map_err(|e| broken(&e))?, limits, how)
}

fn decoded(mut decoder: impl ImageDecoder, limits: image::Limits, how: Reading) -> Said<Decoded> {
    let (width, height) = decoder.dimensions();
    let size = Size {
        width: width as usize,
        height: height as usize,
    };
    check(size, how.most_pixels)?;
    decoder.set_limits(limits).map_err(|e| broken(&e))?;
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let image = DynamicImage::from_decoder(decoder).map_err(|e| broken(&e))?;
    Ok(Decoded {
        pixels: Pixels::Image(image),
        orientation,
    })
}

fn tiff<R: BufRead + Seek>(from: R, how: Reading) -> Said<Decoded> {
    let broken = |e: tiff::TiffError| broken(&e);
    let mut limits = Limits::default();
    limits.decoding_buffer_size = (8 * how.most_pixels) as usize;
    limits.intermediate_buffer_size = limits.decoding_buffer_size;
    let mut decoder = Decoder::new(from).map_err(broken)?.with_limits(limits);
    let (width, height) = decoder.dimensions().map_err(broken)?;
    let size = Size {
        width: width as usize,
        height: height as usize,
    };
    check(size, how.most_pixels)?;
    let colours = decoder.colortype().map_err(broken)?;
    let number = |decoder: &mut Decoder<R>, tag| decoder.find_tag_unsigned::<u16>(tag).map_err(broken);
    let orientation = number(&mut decoder, Tag::Orientation)?
        .and_then(|exif| Orientation::from_exif(exif.try_into().ok()?))
        .unwrap_or(Orientation::NoTransforms);
    if number(&mut decoder, Tag::PlanarConfiguration)? == Some(2) && !matches!(colours, ColorType::Gray(_)) {
        return Err("is a TIFF that holds its colours one after the other; save it with interleaved colours".into());
    }
    let values = decoder.read_image().map_err(broken)?;
    let pixels = tiff_pixels(values, colours, size).ok_or_else(|| {
        format!("is a TIFF of {colours:?}; grey of 8 to 64 bits is read, grey with alpha, RGB and RGBA of 8 and 16")
    })?;
    Ok(Decoded { pixels, orientation })
}

/// Returns the pixels of a TIFF if their type is supported.
fn tiff_pixels(values: DecodingResult, colours: ColorType, size: Size) -> Option<Pixels> {
    let (width, height) = (size.width as u32, size.height as u32);
    use DecodingResult::{U8, U16};
    let image = match (values, colours) {
        (U8(v), ColorType::Gray(8)) => ImageBuffer::from_raw(width, height, v).map(DynamicImage::ImageLuma8),
        (U8(v), ColorType::GrayA(8)) => ImageBuffer::from_raw(width, height, v).map(DynamicImage::ImageLumaA8),
        (U8(v), ColorType::RGB(8)) => ImageBuffer::from_raw(width, height, v).map(DynamicImage::ImageRgb8),
        (U8(v), ColorType::RGBA(8)) => ImageBuffer::from_raw(width, height, v).map(DynamicImage::ImageRgba8),
        (U16(v), ColorType::Gray(16)) => ImageBuffer::from_raw(width, height, v).map(DynamicImage::ImageLuma16),
        (U16(v), ColorType::GrayA(16)) => ImageBuffer::from_raw(width, height, v).map(DynamicImage::ImageLumaA16),
        (U16(v), ColorType::RGB(16)) => ImageBuffer::from_raw(width, height, v).map(DynamicImage::ImageRgb16),
        (U16(v), ColorType::RGBA(16)) => ImageBuffer::from_raw(width, height, v).map(DynamicImage::ImageRgba16),
        (values, ColorType::Gray(_)) => return tiff_plane(values, size.shape()),
        _ => None,
    };
    image.map(Pixels::Image)
}

fn tiff_plane(values: DecodingResult, shape: (usize, usize)) -> Option<Pixels> {
    use DecodingResult::{F16, F32, F64, I8, I16, I32, U32};
    let integers = |most: f32| Numbers::Integers { most };
    let (values, numbers) = match values {
        F16(v) => (v.into_iter().map(f32::from).collect(), Numbers::Halves),
        F32(v) => (v, Numbers::Floats),
        F64(v) => (v.into_iter().map(|v| v as f32).collect(), Numbers::Floats),
        I8(v) => (v.into_iter().map(f32::from).collect(), integers(i8::MAX.into())),
        I16(v) => (v.into_iter().map(f32::from).collect(), integers(i16::MAX.into())),
        I32(v) => (v.into_iter().map(|v| v as f32).collect(), integers(i32::MAX as f32)),
        U32(v) => (v.into_iter().map(|v| v as f32).collect(), integers(u32::MAX as f32)),
        _ => return None,
    };
    let values = Array2::from_shape_vec(shape, values).ok()?;
    Some(Pixels::Plane(Plane { values, numbers }))
}

fn turned(pixels: Pixels, orientation: Orientation) -> Pixels {
    match pixels {
        Pixels::Image(mut image) => {
            image.apply_orientation(orientation);
            Pixels::Image(image)
        }
        Pixels::Plane(Plane { values, numbers }) => Pixels::Plane(Plane {
            values: turned_plane(values, orientation),
            numbers,
        }),
    }
}

fn turned_plane(mut plane: Array2<f32>, orientation: Orientation) -> Array2<f32> {
    use Orientation::{
        FlipHorizontal, FlipVertical, NoTransforms, Rotate90, Rotate90FlipH, Rotate180, Rotate270, Rotate270FlipH,
    };
    let (transposed, columns, rows) = match orientation {
        NoTransforms => return plane,
        FlipHorizontal => (false, true, false),
        FlipVertical => (false, false, true),
        Rotate180 => (false, true, true),
        Rotate90FlipH => (true, false, false),
        Rotate90 => (true, true, false),
        Rotate270 => (true, false, true),
        Rotate270FlipH => (true, true, true),
    };
    if transposed {
        plane = plane.reversed_axes();
    }
    if columns {
        plane.invert_axis(Axis(1));
    }
    if rows {
        plane.invert_axis(Axis(0));
    }
    plane.as_standard_layout().into_owned()
}

/// Checks whether an orientation swaps width and height.
pub(crate) fn swaps_sides(orientation: Orientation) -> bool {
    orientation.to_exif() >= 5
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn planes_are_turned_as_pictures_are() {
        for exif in 1..=8 {
            let orientation = Orientation::from_exif(exif).unwrap();
            let image = image::GrayImage::from_fn(5, 3, |x, y| image::Luma([(5 * y + x) as u8]));
            let plane = Array2::from_shape_fn((3, 5), |(y, x)| (5 * y + x) as f32);
            let mut image = DynamicImage::from(image);
            image.apply_orientation(orientation);
            let image = image.into_luma8();
            let plane = turned_plane(plane, orientation);
            assert_eq!(
                (plane.ncols() as u32, plane.nrows() as u32),
                image.dimensions(),
                "{exif}"
            );
            for ((y, x), value) in plane.indexed_iter() {
                assert_eq!(*value, f32::from(image.get_pixel(x as u32, y as u32).0[0]), "{exif}");
            }
            assert_eq!(swaps_sides(orientation), plane.nrows() == 5, "{exif}");
        }
    }
}
