//! The calibration beside a depth map of the Middlebury stereo data sets, `calib.txt`, which makes its disparities, in
//! pixels, distances.

use crate::{Error, Result, input};
use ndarray::Array2;
use phasefront::Size;
use std::path::Path;

/// Two cameras: distance is `focal_pixels · baseline_m / (disparity + offset)`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cameras {
    focal_pixels: f64,
    baseline_m: f64,
    /// The difference of the cameras' principal points along x, in pixels.
    offset: f64,
    size: Option<Size>,
}

impl Cameras {
    /// Reads the lines `cam0=[f 0 cx; 0 f cy; 0 0 1]`, `doffs=`, `baseline=` in millimetres, `width=` and `height=`.
    /// Other text is no such calibration.
    fn parse(text: &str) -> Option<Self> {
        let value = |key: &str| {
            text.lines()
                .find_map(|line| line.trim().strip_prefix(key)?.strip_prefix('='))
        };
        let number = |key: &str| value(key)?.trim().parse::<f64>().ok().filter(|v| v.is_finite());
        let focal = value("cam0")?.trim().strip_prefix('[')?.split([' ', ';']).next()?;
        let side = |key: &str| number(key).map(|v| v as usize);
        let cameras = Cameras {
            focal_pixels: focal.parse().ok()?,
            baseline_m: number("baseline")? * 1e-3,
            offset: number("doffs")?,
            size: side("width")
                .zip(side("height"))
                .map(|(width, height)| Size { width, height }),
        };
        (cameras.focal_pixels > 0.0 && cameras.baseline_m > 0.0).then_some(cameras)
    }
}

/// Converts disparities in pixels, (H, W), to inverse metres if a `calib.txt` of Middlebury lies beside the file at
/// `path`. Infinity and 0 stay, which mean no reading. Returns whether there is one.
///
/// # Errors
/// Returns an error if the calibration cannot be read or is for another size.
pub(crate) fn inverse_metres(path: &Path, disparity: &mut Array2<f32>) -> Result<bool> {
    let calibration = path.with_file_name("calib.txt");
    if !calibration.is_file() {
        return Ok(false);
    }
    let Some(cameras) = Cameras::parse(&input::text(&calibration)?) else {
        return Ok(false);
    };
    let found = Size::from_shape(disparity.dim());
    if let Some(size) = cameras.size.filter(|size| *size != found) {
        return Err(Error::file(
            path,
            format!(
                "has {found} pixels, but calib.txt beside it is for {size}; disparities in pixels need their own size"
            ),
        ));
    }
    let scale = 1.0 / (cameras.focal_pixels * cameras.baseline_m);
    disparity.mapv_inplace(|d| match d > 0.0 && d.is_finite() {
        true => ((f64::from(d) + cameras.offset) * scale) as f32,
        false => d,
    });
    Ok(true)
}
