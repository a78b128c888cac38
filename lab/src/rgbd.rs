//! An RGB-D frame from its files: colour and depth brought to one shape, depth normalized.

use crate::error::{Error, Result};
use crate::files;
use ndarray::Array2;
use phasefront::RgbdFrame;
use phasefront::unstable::depth::{self, DepthUnit};
use std::path::Path;

/// How far the aspect ratios of colour and depth may lie apart, relative.
const ASPECT_TOLERANCE: f64 = 0.01;

/// What a depth file's numbers mean.
#[derive(Debug, Clone, Copy)]
pub struct DepthOptions {
    /// Their unit.
    pub unit: DepthUnit,
    /// Metres that become d = 0; the 1st percentile if absent.
    pub near_m: Option<f32>,
    /// Metres that become d = 1; the 99th percentile if absent.
    pub far_m: Option<f32>,
}

/// Reads a frame. Depth of another shape but the same aspect ratio is resampled, with a warning.
///
/// # Errors
/// Files that cannot be read, or that do not belong together.
pub fn read(rgb_path: &Path, depth_path: &Path, options: DepthOptions) -> Result<RgbdFrame> {
    let rgb = files::read_rgb(rgb_path)?;
    let normalized = options.unit == DepthUnit::Normalized;
    let mut readings = files::read_depth(depth_path, normalized)?;
    if normalized && let Some(bad) = readings.iter().find(|v| v.is_infinite()) {
        return Err(Error::file(
            depth_path,
            format!("holds {bad}; normalized depth must lie in 0..=1, NaN where there is no reading"),
        ));
    }
    let (_, height, width) = rgb.dim();
    let (depth_height, depth_width) = readings.dim();
    if (depth_height, depth_width) != (height, width) {
        let cross = |a: usize, b: usize| a as f64 * b as f64;
        let ratio = cross(width, depth_height) / cross(height, depth_width);
        if (ratio - 1.0).abs() > ASPECT_TOLERANCE || ratio.is_nan() {
            return Err(Error::file(
                depth_path,
                format!(
                    "depth is {depth_width}×{depth_height}, colour {width}×{height}: their aspect ratios differ; they must show the same field of view"
                ),
            ));
        }
        log::warn!(
            "{}: depth of {depth_width}×{depth_height} is resampled to the colour's {width}×{height}",
            depth_path.display()
        );
        readings = nearest(&readings, (height, width));
    }
    let normalized = depth::normalize(readings.view(), options.unit, options.near_m, options.far_m)
        .map_err(|e| Error::file(depth_path, e))?;
    if let Some((near, far)) = normalized.range_m {
        log::info!(
            "{}: near {near:.3} m, far {far:.3} m, {} pixels filled",
            depth_path.display(),
            normalized.filled
        );
    }
    RgbdFrame::new(rgb, normalized.depth).map_err(|e| Error::file(rgb_path, e))
}

/// The nearest sample: an average across an edge would be a depth where nothing is.
fn nearest(plane: &Array2<f32>, (height, width): (usize, usize)) -> Array2<f32> {
    let (h, w) = plane.dim();
    Array2::from_shape_fn((height, width), |(y, x)| {
        plane[((2 * y + 1) * h / (2 * height), (2 * x + 1) * w / (2 * width))]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_sample_is_the_centred_one() {
        let plane = Array2::from_shape_fn((2, 3), |(y, x)| (3 * y + x) as f32);
        let doubled = nearest(&plane, (4, 6));
        assert!(doubled.indexed_iter().all(|((y, x), v)| *v == plane[(y / 2, x / 2)]));
        assert_eq!(nearest(&doubled, (2, 3)), plane);
    }
}
