//! Photos with embedded depth from phones: JPEGs with XMP of GDepth or Dynamic Depth 1.0, and HEIC with an auxiliary
//! picture of disparity or distance (`heif`).
//!
//! * GDepth (`developers.google.com/depthmap-metadata`): the XMP itself contains the depth image in base64. An image
//!   too long for one segment is in extended XMP (Adobe's XMP specification, part 3).
//! * Dynamic Depth 1.0: the XMP lists the images that follow the photo in the file.
//!
//! A depth image holds d_n from 0, near, to 1, far. `RangeLinear`: d = near + d_n·(far − near). `RangeInverse`, which
//! portrait modes use: d = far·near / (far − d_n·(far − near)), so d_n is linear in inverse distance.

mod apple;
mod dynamic_depth;
mod samsung;

use crate::frame::{Doubt, before_enlarging, check_aspect};
use crate::input::decode::{self, Reading};
use crate::input::{self, MOST_PHOTO};
use crate::picture::colours::{self, Colours};
use crate::picture::heif;
use crate::{Error, Result};
use base64::Engine;
use base64::engine::general_purpose::STANDARD_NO_PAD;
use ndarray::Array2;
use phasefront::Size;
use phasefront::input::RgbEncoding;
use roxmltree::{Document, Node};
use std::path::Path;

/// The namespace of GDepth.
const GDEPTH: &str = "http://ns.google.com/photos/1.0/depthmap/";
/// The namespaces of Dynamic Depth.
const DEPTH_MAP: &str = "http://ns.google.com/photos/dd/1.0/depthmap/";
const ITEM: &str = "http://ns.google.com/photos/dd/1.0/item/";
/// The first bytes of an APP1 segment with XMP, and of one with extended XMP.
const XMP: &[u8] = b"http://ns.adobe.com/xap/1.0/\0";
const EXTENDED_XMP: &[u8] = b"http://ns.adobe.com/xmp/extension/\0";
/// The length of the header of each part of extended XMP: a GUID, the total length, and the offset of the part.
const EXTENDED_HEAD: usize = 32 + 4 + 4;
/// The maximum number of pixels of the depth image, 4096²: more than phones photograph.
const MOST_DEPTH_PIXELS: u64 = 1 << 24;
/// The maximum number of marks (`<`, `"`, `'`) in XMP. Elements and attributes take far more memory than their
/// characters.
const MOST_MARKS: usize = 1 << 15;

/// Advice for a photo without depth.
const ADVICE: &str = "Phones store depth in portraits; for other photos there is --depth-network (docs/depth.md says how to make one), and --rgb with --depth flat";

/// The meaning of the depth values of a photo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Range {
    /// The values are linear in distance.
    Linear,
    /// The values are linear in inverse distance.
    Inverse,
}

/// A photo with depth, upright.
#[derive(Debug, Clone)]
pub struct Photo {
    /// The colours, (3, H, W), and their meaning.
    pub colours: Colours,
    /// The depth d_n, (h, w) in 0..=1: 0 is near and 1 is far. It covers the same field of view as the photo,
    /// stretched.
    pub depth: Array2<f32>,
    /// The meaning of d_n.
    pub range: Range,
    /// The distances of d_n = 0 and d_n = 1 in metres, if the file gives them.
    pub range_m: Option<(f64, f64)>,
}

impl Photo {
    /// Returns the distances in metres, (h, w), if the file gives its range.
    pub fn metres(&self) -> Option<Array2<f32>> {
        let (near, far) = self.range_m?;
        Some(self.depth.mapv(|d| {
            let d = f64::from(d);
            (match self.range {
                Range::Linear => near + d * (far - near),
                Range::Inverse => far * near / (far - d * (far - near)),
            }) as f32
        }))
    }
}

/// Reads a photo with embedded depth. Its colours mean `asked` or what the file says.
///
/// # Errors
/// Returns an error with advice if the file is missing or broken or has no supported depth.
pub fn read(path: &Path, asked: Option<RgbEncoding>) -> Result<Photo> {
    let bytes = input::bytes(path, MOST_PHOTO)?;
    if decode::is_heic(&bytes) {
        return of_heic(path, &bytes, asked);
    }
    of_bytes(&bytes, &path.display().to_string(), asked).map_err(|why| Error::file(path, why))
}

/// Reads a portrait in HEIC. Its depth is disparity unless the file says that it is distance.
fn of_heic(path: &Path, file: &[u8], asked: Option<RgbEncoding>) -> Result<Photo> {
    let decoded = heif::decode(path)?;
    let colours = decoded.colours(asked)?;
    let Some(numbers) = decoded.depth()? else {
        return Err(Error::file(path, format!("holds no depth. {ADVICE}")));
    };
    check_aspect(Size::from_shape(numbers.dim()), colours.size()).map_err(|why| Error::file(path, why))?;
    let meaning = apple::meaning(file).unwrap_or(apple::Meaning {
        range: Range::Inverse,
        range_m: None,
    });
    let depth = match meaning.range {
        Range::Linear => numbers,
        Range::Inverse => numbers.mapv(|d| 1.0 - d),
    };
    let (depth, enlarged) = before_enlarging(depth, colours.size());
    if let Some(enlarged) = enlarged {
        log::warn!("{}: its depth {}", path.display(), Doubt::Enlarged(enlarged));
    }
    Ok(Photo {
        colours,
        depth,
        range: meaning.range,
        range_m: meaning.range_m,
    })
}

fn of_bytes(bytes: &[u8], name: &str, asked: Option<RgbEncoding>) -> std::result::Result<Photo, String> {
    if let Some(why) = decode::unread_container(bytes) {
        return Err(why.into());
    }
    if !bytes.starts_with(&[0xFF, 0xD8]) {
        return Err("is no JPEG; --photo takes a JPEG with depth inside, or with --depth-network any picture; other pictures go to --rgb with --depth".into());
    }
    let (colour, orientation) = decode::picture_of(bytes, Reading::UPRIGHT)?;
    let found = Xmp::read(bytes).and_then(|xmp| xmp.depth(bytes)).map_err(|why| match samsung::depth(bytes) {
        Some((depth, tag)) => format!(
            "holds Samsung's {depth}, whose form Samsung does not publish; `exiftool -b -{tag} PHOTO > depth.tif` takes it out for --rgb and --depth, with --invert if white is near"
        ),
        None => why,
    })?;
    // The depth image has the orientation of the stored photo, whatever its own metadata say.
    let how = Reading {
        most_pixels: MOST_DEPTH_PIXELS,
        ..Reading::AS_STORED
    };
    let depth = decode::picture_of(&found.image, how);
    let (mut depth, _) = depth.map_err(|why| format!("the depth inside {why}"))?;
    depth.apply_orientation(orientation);
    let grey = depth.into_luma16();
    let (w, h) = (grey.width() as usize, grey.height() as usize);
    let grey = grey.into_raw().into_iter().map(|v| f32::from(v) / 65535.0);
    let colours = colours::of_bytes(colour, bytes, name, asked)?;
    let depth = Array2::from_shape_vec((h, w), grey.collect()).map_err(|e| e.to_string())?;
    let (depth, enlarged) = before_enlarging(depth, colours.size());
    if let Some(enlarged) = enlarged {
        log::warn!("{name}: its depth {}", Doubt::Enlarged(enlarged));
    }
    Ok(Photo {
        colours,
        depth,
        range: found.range,
        range_m: found.range_m,
    })
}

/// A depth image that is still encoded.
struct Found {
    image: Vec<u8>,
    range: Range,
    range_m: Option<(f64, f64)>,
}

/// The XMP of a JPEG.
struct Xmp {
    main: String,
    extended: Option<String>,
}

impl Xmp {
    fn read(jpeg: &[u8]) -> std::result::Result<Self, String> {
        let mut main = None;
        let mut parts: Vec<&[u8]> = Vec::new();
        for segment in app1_segments(jpeg) {
            if let Some(text) = segment.strip_prefix(XMP) {
                main.get_or_insert(text);
            } else if let Some(part) = segment.strip_prefix(EXTENDED_XMP) {
                parts.push(part);
            }
        }
        let main = main.ok_or_else(|| format!("holds no depth: it has no XMP. {ADVICE}"))?;
        let main = String::from_utf8(main.to_vec()).map_err(|_| "its XMP is no UTF-8")?;
        let extended = if parts.is_empty() {
            None
        } else {
            Some(extended(&main, &parts)?)
        };
        Ok(Xmp { main, extended })
    }

    fn depth(&self, jpeg: &[u8]) -> std::result::Result<Found, String> {
        let main = parse(&self.main)?;
        let extended = self.extended.as_deref().map(parse).transpose()?;
        let documents: Vec<_> = std::iter::once(&main).chain(&extended).collect();
        let value = |space: &'static str, name: &'static str| {
            documents.iter().find_map(|xml| property(xml.root(), space, name))
        };
        if let Some(data) = value(GDEPTH, "Data") {
            let packed: Vec<u8> = data
                .bytes()
                .filter(|b| !b.is_ascii_whitespace() && *b != b'=')
                .collect();
            let image = STANDARD_NO_PAD.decode(packed);
            return Found::new(
                image.map_err(|e| format!("its GDepth:Data is no base64: {e}"))?,
                |name| value(GDEPTH, name),
            );
        }
        if value(GDEPTH, "Format").is_some() {
            return Err(
                "its GDepth has no Data; it was cut when the photo was edited or sent: take the original".into(),
            );
        }
        if let Some(uri) = value(DEPTH_MAP, "DepthURI") {
            let image = dynamic_depth::item(&documents, jpeg, uri)?.to_vec();
            return Found::new(image, |name| value(DEPTH_MAP, name));
        }
        Err(format!(
            "holds no depth: its XMP has neither GDepth nor Dynamic Depth. {ADVICE}"
        ))
    }
}

impl Found {
    fn new<'a>(image: Vec<u8>, value: impl Fn(&'static str) -> Option<&'a str>) -> std::result::Result<Self, String> {
        let range = match value("Format") {
            None | Some("RangeInverse") => Range::Inverse,
            Some("RangeLinear") => Range::Linear,
            Some(other) => {
                return Err(format!(
                    "its depth is {other:?}; RangeInverse and RangeLinear are known"
                ));
            }
        };
        let number = |name| value(name).and_then(|text| text.trim().parse::<f64>().ok());
        let metres = match value("Units").unwrap_or("m").to_ascii_lowercase().as_str() {
            "m" | "meters" | "metres" => Some(1.0),
            "mm" | "millimeters" => Some(1e-3),
            _ => None,
        };
        let range_m = match (number("Near"), number("Far"), metres) {
            (Some(near), Some(far), Some(unit)) if near > 0.0 && near < far && far.is_finite() => {
                Some((near * unit, far * unit))
            }
            _ => None,
        };
        Ok(Found { image, range, range_m })
    }
}

/// Parses XMP.
fn parse(text: &str) -> std::result::Result<Document<'_>, String> {
    let marks = text.bytes().filter(|byte| matches!(byte, b'<' | b'"' | b'\''));
    if marks.count() > MOST_MARKS {
        return Err(format!("its XMP has over {MOST_MARKS} elements and attributes"));
    }
    Document::parse(text).map_err(|e| format!("its XMP is broken: {e}"))
}

/// Returns the APP1 segments before the image data.
fn app1_segments(jpeg: &[u8]) -> Vec<&[u8]> {
    const APP1: u8 = 0xE1;
    const START_OF_SCAN: u8 = 0xDA;
    let mut found = Vec::new();
    let mut rest = &jpeg[2..];
    while let [0xFF, marker, high, low, ..] = *rest {
        let length = usize::from(u16::from_be_bytes([high, low]));
        if marker == START_OF_SCAN || length < 2 || rest.len() < 2 + length {
            break;
        }
        if marker == APP1 {
            found.push(&rest[4..2 + length]);
        }
        rest = &rest[2 + length..];
    }
    found
}

/// Joins the extended XMP that `main` refers to from its parts.
fn extended(main: &str, parts: &[&[u8]]) -> std::result::Result<String, String> {
    let head = |part: &[u8]| -> Option<(usize, usize)> {
        let number = |at: usize| Some(u32::from_be_bytes(*part.get(at..)?.first_chunk()?) as usize);
        Some((number(32)?, number(36)?))
    };
    let mut named = Vec::new();
    for part in parts {
        let (guid, _) = (part.split_at_checked(32)).ok_or("a part of its extended XMP is cut short")?;
        if std::str::from_utf8(guid).is_ok_and(|guid| main.contains(guid)) {
            let (length, offset) = head(part).ok_or("a part of its extended XMP is cut short")?;
            named.push((length, offset, &part[EXTENDED_HEAD..]));
        }
    }
    let got: usize = named.iter().map(|(_, _, part)| part.len()).sum();
    let length = named.first().map_or(0, |(length, ..)| *length);
    // This check precedes the allocation, because a part may claim any length.
    if got < length {
        return Err(format!("of its extended XMP {got} of {length} bytes are there"));
    }
    let mut text = vec![0; length];
    for (said, offset, part) in named {
        let place = text.get_mut(offset..).and_then(|rest| rest.get_mut(..part.len()));
        let place = place
            .filter(|_| said == length)
            .ok_or("its extended XMP does not fit together")?;
        place.copy_from_slice(part);
    }
    String::from_utf8(text).map_err(|_| "its extended XMP is no UTF-8".into())
}

/// Returns an XMP property, an attribute or an element, anywhere below `node`.
fn property<'a>(node: Node<'a, '_>, space: &str, name: &str) -> Option<&'a str> {
    node.descendants().find_map(|node| {
        let element = node.has_tag_name((space, name)).then(|| node.text()).flatten();
        node.attribute((space, name)).or(element)
    })
}
