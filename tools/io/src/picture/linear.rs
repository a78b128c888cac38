//! Pictures of linear light, as renderers and photographs of several exposures have it: OpenEXR and Radiance (.hdr).

use crate::input::decode::{MOST_PIXELS, Said, broken, check};
use crate::input::{self, MOST_PICTURE, openexr, quiet};
use crate::{Error, Result};
use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageDecoder};
use moxcms::{Chromaticity, ColorPrimaries, ColorProfile, ToneReprCurve, XyY};
use ndarray::{Array3, Axis, stack};
use phasefront::Size;
use std::io::BufRead;
use std::path::Path;

/// Linear light, 1 for the white of a display, (3, H, W) in \[0, 1], and the profile that says what it means.
pub(crate) struct Linear {
    pub(crate) light: Array3<f32>,
    pub(crate) profile: ColorProfile,
}

/// Reads the picture at `path` if it is OpenEXR or Radiance. Light beyond white is clipped, with a warning; where a
/// file has no number, it is black.
///
/// # Errors
/// Returns an error if the file cannot be read, is broken or too large, or has no colours.
pub(crate) fn read(path: &Path) -> Result<Option<Linear>> {
    let mut file = input::open(path, MOST_PICTURE)?;
    let head = (file.fill_buf()).map_err(|e| Error::file(path, format!("cannot be read: {e}")))?;
    let (is_exr, is_radiance) = (
        head.starts_with(b"\x76\x2f\x31\x01"),
        head.starts_with(b"#?RADIANCE") || head.starts_with(b"#?RGBE"),
    );
    let decoded = quiet::caught(|| match (is_exr, is_radiance) {
        (true, _) => openexr::colour(file, MOST_PIXELS).and_then(of_exr).map(Some),
        (_, true) => radiance(file).map(Some),
        _ => Ok(None),
    });
    let linear = decoded.unwrap_or_else(|why| Err(broken(&why)));
    let Some(mut linear) = linear.map_err(|why| Error::file(path, why))? else {
        return Ok(None);
    };
    let beyond = linear.light.lanes(Axis(0)).into_iter();
    let beyond = beyond.filter(|pixel| pixel.iter().any(|v| *v > 1.0)).count();
    if beyond > 0 {
        let share = 300.0 * beyond as f64 / linear.light.len() as f64;
        log::warn!(
            "{}: {share:.1} % of its pixels are brighter than white, which is 1, and are clipped",
            path.display()
        );
    }
    (linear.light).mapv_inplace(|v| if v.is_nan() { 0.0 } else { v.clamp(0.0, 1.0) });
    Ok(Some(linear))
}

fn of_exr(light: openexr::Light) -> Said<Linear> {
    let planes: Vec<_> = light.planes.iter().map(|plane| plane.view()).collect();
    let mut profile = linear_srgb();
    if let Some([red, green, blue, white]) = light.primaries {
        let point = |[x, y]: [f32; 2]| Chromaticity { x, y };
        let [x, y] = white.map(f64::from);
        if !(x > 0.0 && y > 0.0) {
            return Err("is OpenEXR whose chromaticities have no white".into());
        }
        let primaries = ColorPrimaries {
            red: point(red),
            green: point(green),
            blue: point(blue),
        };
        profile.update_rgb_colorimetry(XyY { x, y, yb: 1.0 }, primaries);
    }
    Ok(Linear {
        light: stack(Axis(0), &planes).map_err(|e| broken(&e))?,
        profile,
    })
}

fn radiance(from: impl BufRead) -> Said<Linear> {
    let decoder = HdrDecoder::new(from).map_err(|e| broken(&e))?;
    let (width, height) = decoder.dimensions();
    let size = Size {
        width: width as usize,
        height: height as usize,
    };
    check(size, MOST_PIXELS)?;
    // Its light is that of the scene times the exposure.
    let exposure = decoder.metadata().exposure.unwrap_or(1.0);
    let image = DynamicImage::from_decoder(decoder)
        .map_err(|e| broken(&e))?
        .into_rgb32f();
    let light = Array3::from_shape_vec((size.height, size.width, 3), image.into_raw()).map_err(|e| broken(&e))?;
    Ok(Linear {
        light: light.permuted_axes([2, 0, 1]).mapv(|v| v / exposure),
        profile: linear_srgb(),
    })
}

/// Returns the profile of linear light with sRGB's primaries.
fn linear_srgb() -> ColorProfile {
    let mut profile = ColorProfile::new_srgb();
    let curve = ToneReprCurve::Parametric(vec![1.0]);
    profile.cicp = None;
    profile.red_trc = Some(curve.clone());
    profile.green_trc = Some(curve.clone());
    profile.blue_trc = Some(curve);
    profile
}
