//! The meaning of a picture file's colours: what the file says of it (cICP, an ICC profile, gAMA and cHRM), or what the
//! caller says.

use crate::input::decode::{self, Reading};
use crate::input::{self, MOST_PICTURE, quiet};
use crate::picture::linear::{self, Linear};
use crate::picture::{self, heif};
use crate::{Error, Result};
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};
use moxcms::{
    Chromaticity, ColorPrimaries, ColorProfile, DataColorSpace, Layout, ToneReprCurve, TransformF32Executor,
    TransformOptions, XyY,
};
use ndarray::{Array3, ArrayView3, Axis};
use phasefront::input::RgbEncoding;
use phasefront::target::Balance;
use phasefront::{Display, Size};
use phasefront_core::display::primaries::{inverse, product, times, transposed};
use phasefront_core::frame::LightPlan;
use std::io::{BufRead, Cursor, Seek};
use std::path::Path;
use std::sync::Arc;
use tiff::tags::Tag;

/// The largest difference of encoded values, in 0..=1, between profiles that are taken for the same.
const SAME: f32 = 0.004;
/// The x and y of D65.
const D65: XyY = XyY {
    x: 0.3127,
    y: 0.329,
    yb: 1.0,
};

/// A picture's values and their meaning.
#[derive(Debug, Clone, PartialEq)]
pub struct Colours {
    /// The encoded values in \[0, 1], (3, H, W).
    pub rgb: Array3<f32>,
    /// The meaning of the values.
    pub encoding: RgbEncoding,
}

impl Colours {
    /// Returns the size of the picture.
    pub fn size(&self) -> Size {
        let (_, height, width) = self.rgb.dim();
        Size { width, height }
    }

    /// Returns the light in linear sRGB, (3, H, W), clipped to \[0, 1], or `None` if the values are amplitudes.
    pub fn linear_srgb(&self) -> Option<Array3<f32>> {
        // A screen of the picture's own primaries shows all its colours.
        let rows = transposed(&self.encoding.to_xyz()).map(|row| row.map(|v| v.max(0.0)));
        let primaries = Balance::Primaries(rows);
        let screen = Display::default()
            .with_balance(primaries)
            .expect("a screen's primaries");
        let plan = LightPlan::new(self.encoding, &screen)?;
        let mut light = Array3::zeros(self.rgb.dim());
        let rgb = self.rgb.as_standard_layout();
        let values = rgb.as_slice().zip(light.as_slice_mut());
        let (rgb, values) = values.expect("both are in standard layout");
        plan.convert(rgb, values);
        let from_xyz = inverse(&RgbEncoding::Srgb.to_xyz()).expect("three colours");
        let matrix = product(&from_xyz, &self.encoding.to_xyz());
        for mut pixel in light.lanes_mut(Axis(0)) {
            let own = [0, 1, 2].map(|c| f64::from(pixel[c]).powi(2));
            for (value, light) in pixel.iter_mut().zip(times(&matrix, own)) {
                *value = light.clamp(0.0, 1.0) as f32;
            }
        }
        Some(light)
    }
}

/// What a file says of its colours.
#[derive(Debug, Clone)]
enum Said {
    Encoding(RgbEncoding),
    Profile(Box<ColorProfile>),
}

/// Reads the picture at `path`, upright, and its orientation. `asked` overrides what the file says of its colours; a
/// file that says nothing is sRGB. Values of a profile other than sRGB's and Display P3's are converted to
/// [`RgbEncoding::Bt2020`].
///
/// # Errors
/// Returns the errors of [`picture::read_rgb`].
pub fn read(path: &Path, asked: Option<RgbEncoding>) -> Result<(Colours, Orientation)> {
    if heif::is(path)? {
        return Ok((heif::decode(path)?.colours(asked)?, Orientation::NoTransforms));
    }
    if let Some(Linear { light, profile }) = linear::read(path)? {
        let said = asked.map_or_else(|| Said::Profile(Box::new(profile)), Said::Encoding);
        let colours = of_values(light, said).map_err(|why| Error::file(path, why))?;
        return Ok((colours, Orientation::NoTransforms));
    }
    let (image, orientation) = decode::open_picture(path, Reading::UPRIGHT)?;
    let said = match asked {
        Some(encoding) => Said::Encoding(encoding),
        None => said(input::open(path, MOST_PICTURE)?, &path.display().to_string()),
    };
    let colours = understood(image, said).map_err(|why| Error::file(path, why))?;
    Ok((colours, orientation))
}

/// Understands the colours of `image`, decoded from the file in `bytes`, as [`read`] does. `name` names the file in
/// warnings.
///
/// # Errors
/// Returns an error if the file's profile cannot be applied.
pub(crate) fn of_bytes(
    image: DynamicImage,
    bytes: &[u8],
    name: &str,
    asked: Option<RgbEncoding>,
) -> std::result::Result<Colours, String> {
    let said = asked.map_or_else(|| said(Cursor::new(bytes), name), Said::Encoding);
    understood(image, said)
}

/// Returns what the file in `from` says of its colours; sRGB if it says nothing that can be understood.
fn said<R: BufRead + Seek>(mut from: R, name: &str) -> Said {
    let found = quiet::caught(|| {
        let head = from.fill_buf().map_err(|e| e.to_string())?;
        match image::guess_format(head) {
            Ok(ImageFormat::Png) => png(from),
            Ok(ImageFormat::Tiff) => tiff(from),
            Ok(format) => {
                let reader = ImageReader::with_format(from, format);
                let mut decoder = reader.into_decoder().map_err(|e| e.to_string())?;
                icc(decoder.icc_profile().map_err(|e| e.to_string())?)
            }
            Err(_) => Ok(None),
        }
    });
    match found.and_then(|found| found) {
        Ok(found) => found.unwrap_or(Said::Encoding(RgbEncoding::Srgb)),
        Err(why) => {
            log::warn!("{name}: its colour profile is not understood ({why}); its colours are taken for sRGB");
            Said::Encoding(RgbEncoding::Srgb)
        }
    }
}

type Found = std::result::Result<Option<Said>, String>;

fn icc(profile: Option<Vec<u8>>) -> Found {
    let Some(bytes) = profile else { return Ok(None) };
    let profile = ColorProfile::new_from_slice(&bytes).map_err(|e| e.to_string())?;
    Ok(Some(Said::Profile(Box::new(profile))))
}

/// Reads a PNG's chunks in their order of priority: cICP, iCCP, sRGB, then gAMA and cHRM (PNG, third edition, 4.3).
fn png<R: BufRead + Seek>(from: R) -> Found {
    let mut decoder = png::Decoder::new(from);
    decoder.set_ignore_text_chunk(true);
    let reader = decoder.read_info().map_err(|e| e.to_string())?;
    let info = reader.info();
    if let Some(points) = &info.coding_independent_code_points {
        let encoding = encoding_of_points(points.color_primaries.into(), points.transfer_function.into());
        return match encoding {
            Some(encoding) => Ok(Some(Said::Encoding(encoding))),
            None => Err(format!(
                "cICP of primaries {} and transfer {}",
                points.color_primaries, points.transfer_function
            )),
        };
    }
    if let Some(profile) = &info.icc_profile {
        return icc(Some(profile.to_vec()));
    }
    if info.srgb.is_some() {
        return Ok(None);
    }
    let (gamma, primaries) = (info.gama_chunk, info.chrm_chunk);
    if gamma.is_none() && primaries.is_none() {
        return Ok(None);
    }
    let mut profile = ColorProfile::new_srgb();
    if let Some(p) = primaries {
        let point = |(x, y): (png::ScaledFloat, png::ScaledFloat)| Chromaticity::new(x.into_value(), y.into_value());
        let (wx, wy) = (f64::from(p.white.0.into_value()), f64::from(p.white.1.into_value()));
        if !(wx > 0.0 && wy > 0.0) {
            return Err("cHRM without a white".into());
        }
        let primaries = ColorPrimaries {
            red: point(p.red),
            green: point(p.green),
            blue: point(p.blue),
        };
        profile.update_rgb_colorimetry(XyY { x: wx, y: wy, yb: 1.0 }, primaries);
    }
    // Writers of sRGB put 1/2.2 here for readers that know no sRGB (PNG, third edition, 11.3.2.5).
    const OF_SRGB: f32 = 0.45455;
    if let Some(gamma) = gamma.map(|gamma| gamma.into_value()).filter(|gamma| *gamma != OF_SRGB) {
        if !(0.1..=10.0).contains(&gamma) {
            return Err(format!("gAMA of {gamma}"));
        }
        let curve = ToneReprCurve::Parametric(vec![1.0 / gamma]);
        profile.cicp = None;
        profile.red_trc = Some(curve.clone());
        profile.green_trc = Some(curve.clone());
        profile.blue_trc = Some(curve);
    }
    Ok(Some(Said::Profile(Box::new(profile))))
}

fn tiff<R: BufRead + Seek>(from: R) -> Found {
    let mut decoder = tiff::decoder::Decoder::new(from).map_err(|e| e.to_string())?;
    let found = decoder.find_tag(Tag::IccProfile).map_err(|e| e.to_string())?;
    icc(found
        .map(tiff::decoder::ifd::Value::into_u8_vec)
        .transpose()
        .map_err(|e| e.to_string())?)
}

/// Returns the encoding of H.273's colour primaries and transfer characteristics, as cICP says them, or `None`
/// for others. Unknown ones (2) are those of BT.709; BT.709's curve is shown as sRGB's.
fn encoding_of_points(primaries: u16, transfer: u16) -> Option<RgbEncoding> {
    match (primaries, transfer) {
        (9, 16) => Some(RgbEncoding::Bt2020Pq),
        (9, 18) => Some(RgbEncoding::Bt2020Hlg),
        (9, 1 | 2 | 6 | 13 | 14 | 15) => Some(RgbEncoding::Bt2020),
        (12, 1 | 2 | 6 | 13) => Some(RgbEncoding::DisplayP3),
        (1 | 2 | 5 | 6 | 7, 1 | 2 | 4 | 5 | 6 | 13) => Some(RgbEncoding::Srgb),
        _ => None,
    }
}

/// Returns the profile of BT.2020's primaries with the curve of sRGB.
fn wide() -> ColorProfile {
    let mut profile = ColorProfile::new_srgb();
    profile.update_rgb_colorimetry(D65, ColorPrimaries::BT_2020);
    profile
}

/// Converts pixels of a profile to RGB of another.
struct Conversion {
    transform: Arc<TransformF32Executor>,
    channels: usize,
}

impl Conversion {
    fn new(layout: Layout, from: &ColorProfile, to: &ColorProfile) -> std::result::Result<Self, String> {
        let transform = from.create_transform_f32(layout, to, Layout::Rgb, TransformOptions::default());
        Ok(Conversion {
            transform: transform.map_err(|e| unusable(&e))?,
            channels: layout.channels(),
        })
    }

    fn convert(&self, values: &[f32]) -> std::result::Result<Vec<f32>, String> {
        let mut rgb = vec![0.0; values.len() / self.channels * 3];
        self.transform.transform(values, &mut rgb).map_err(|e| unusable(&e))?;
        Ok(rgb)
    }
}

fn unusable(why: &moxcms::CmsError) -> String {
    format!("its colour profile cannot be applied: {why}")
}

/// Returns the layout of the values that `profile` takes, or `None` if it is of other colours than red, green and blue
/// or grey.
fn layout(profile: &ColorProfile) -> Option<Layout> {
    match profile.color_space {
        DataColorSpace::Rgb => Some(Layout::Rgb),
        DataColorSpace::Gray => Some(Layout::Gray),
        _ => None,
    }
}

/// Returns the encoding whose values `profile` shows alike, if there is one: probes a grid of colours.
fn known(profile: &ColorProfile, layout: Layout) -> std::result::Result<Option<RgbEncoding>, String> {
    const SIDE: usize = 9;
    let value = |i: usize| (i % SIDE) as f32 / (SIDE - 1) as f32;
    let pixels = SIDE.pow(layout.channels() as u32);
    let probe: Vec<f32> = (0..pixels)
        .flat_map(|i| (0..layout.channels() as u32).map(move |c| value(i / SIDE.pow(c))))
        .collect();
    for (encoding, to) in [
        (RgbEncoding::Srgb, ColorProfile::new_srgb()),
        (RgbEncoding::DisplayP3, ColorProfile::new_display_p3()),
    ] {
        let shown = Conversion::new(layout, profile, &to)?.convert(&probe)?;
        let same = shown.iter().enumerate().all(|(i, v)| {
            let own = probe[if layout == Layout::Gray { i / 3 } else { i }];
            (v - own).abs() <= SAME
        });
        if same {
            return Ok(Some(encoding));
        }
    }
    Ok(None)
}

fn understood(image: DynamicImage, said: Said) -> std::result::Result<Colours, String> {
    of_values(picture::amplitudes(image), said)
}

/// Understands encoded values, (3, H, W), as [`read`] does.
fn of_values(rgb: Array3<f32>, said: Said) -> std::result::Result<Colours, String> {
    let profile = match said {
        Said::Encoding(encoding) => return Ok(Colours { rgb, encoding }),
        Said::Profile(profile) => profile,
    };
    // A decoder that turned other colours into RGB left the profile of those behind.
    let Some(layout) = layout(&profile) else {
        let encoding = RgbEncoding::Srgb;
        return Ok(Colours { rgb, encoding });
    };
    if let Some(encoding) = known(&profile, layout)? {
        return Ok(Colours { rgb, encoding });
    }
    Ok(Colours {
        rgb: in_wide(rgb.view(), &profile, layout)?,
        encoding: RgbEncoding::Bt2020,
    })
}

/// Converts values, (3, H, W), of `profile` to BT.2020.
fn in_wide(
    rgb: ArrayView3<'_, f32>,
    profile: &ColorProfile,
    layout: Layout,
) -> std::result::Result<Array3<f32>, String> {
    let conversion = Conversion::new(layout, profile, &wide())?;
    let mut wide = Array3::zeros(rgb.dim());
    for (y, row) in rgb.axis_iter(Axis(1)).enumerate() {
        // A grey profile is of the one value that all three colours have.
        let values: Vec<f32> = row.t().iter().copied().step_by(3 / layout.channels()).collect();
        let values = conversion.convert(&values)?;
        for (x, pixel) in values.chunks_exact(3).enumerate() {
            for (c, value) in pixel.iter().enumerate() {
                wide[(c, y, x)] = value.clamp(0.0, 1.0);
            }
        }
    }
    Ok(wide)
}
