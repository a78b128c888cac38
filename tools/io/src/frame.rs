//! An RGB-D frame from its files: colour and depth brought to one shape, depth normalized.

pub mod fit;

use crate::frame::fit::Placement;
use crate::input::decode::{self, Reading};
use crate::picture;
use crate::picture::depth_map::{self, DepthFile};
use crate::{Error, Result};
use image::metadata::Orientation;
use ndarray::{Array2, Array3, ArrayView2};
use phasefront::RgbdFrame;
use phasefront_core::depth;
use phasefront_core::depth::DepthUnit;
use phasefront_core::depth::refine::Refiner;
use std::path::Path;

/// How far the aspect ratios of colour and depth may lie apart, relative.
const ASPECT_TOLERANCE: f64 = 0.01;

/// Share of the depth that --near and --far clip, beyond which that is said.
pub const DOUBTFULLY_CLIPPED: f64 = 0.9;

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
    let (image, orientation) = decode::open_picture(rgb_path, Reading::UPRIGHT)?;
    let rgb = picture::amplitudes(image);
    let normalized = options.unit == DepthUnit::Normalized;
    let file = depth_map::read(depth_path, normalized)?;
    let (_, height, width) = rgb.dim();
    if is_turned_alone(depth_path, &file, orientation, (height, width))? {
        log::warn!(
            "{}: is taken as it is, upright; the colour's Exif data turn the colour: {orientation:?}",
            depth_path.display()
        );
    }
    let mut readings = file.depth;
    if normalized && let Some(bad) = readings.iter().find(|v| v.is_infinite()) {
        return Err(Error::file(
            depth_path,
            format!("holds {bad}; normalized depth must lie in 0..=1, NaN where there is no reading"),
        ));
    }
    if normalized && let Some(doubt) = doubt(&readings) {
        log::warn!("{}: {doubt}", depth_path.display());
    }
    let (depth_height, depth_width) = readings.dim();
    if (depth_height, depth_width) != (height, width) {
        if !has_aspect((depth_height, depth_width), (height, width)) {
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
        let clipped = normalized.clipped as f64 / readings.len() as f64;
        if clipped > DOUBTFULLY_CLIPPED {
            log::warn!(
                "{}: {:.0} % of the depth lies before near {near} m or beyond far {far} m and is shown there; both are metres",
                depth_path.display(),
                100.0 * clipped
            );
        }
        log::info!(
            "{}: near {near:.3} m, far {far:.3} m, {} pixels filled",
            depth_path.display(),
            normalized.filled
        );
    }
    RgbdFrame::new(rgb, normalized.depth).map_err(|e| Error::file(rgb_path, e))
}

/// Whether two shapes, (H, W), are of one aspect ratio.
fn has_aspect((h, w): (usize, usize), (height, width): (usize, usize)) -> bool {
    let cross = |a: usize, b: usize| a as f64 * b as f64;
    let ratio = cross(width, h) / cross(height, w);
    (ratio - 1.0).abs() <= ASPECT_TOLERANCE
}

/// Whether Exif data turned colour of (H, W) = `shape` and not its depth, and both shapes fit all the same.
///
/// # Errors
/// Depth that fits the colour only as it is stored.
pub(crate) fn is_turned_alone(
    depth_path: &Path,
    depth: &DepthFile,
    colour: Orientation,
    (height, width): (usize, usize),
) -> Result<bool> {
    if colour == Orientation::NoTransforms || depth.orientation != Orientation::NoTransforms {
        return Ok(false);
    }
    let shape = depth.depth.dim();
    let fits = has_aspect(shape, (height, width));
    if !fits && decode::swaps_sides(colour) && has_aspect(shape, (width, height)) {
        return Err(Error::file(
            depth_path,
            format!(
                "depth is {}×{}, as the colour is stored, but the colour's Exif data turn it to {width}×{height}; turn the depth alike, or remove the colour's orientation (exiftool -Orientation= -overwrite_original)",
                shape.1, shape.0
            ),
        ));
    }
    Ok(fits)
}

/// What makes it doubtful that `depth` is normalized, if anything does.
fn doubt(depth: &Array2<f32>) -> Option<String> {
    /// Depth that is stretched over its range reaches beyond this.
    const LITTLE: f32 = 0.25;
    /// Share of zeros that a near surface has seldom.
    const MANY: f32 = 0.1;
    let most = depth.iter().copied().fold(0.0, f32::max);
    let zeros = depth.iter().filter(|d| **d == 0.0).count() as f32 / depth.len().max(1) as f32;
    if (0.0..LITTLE).contains(&most) && most > 0.0 {
        return Some(format!(
            "as normalized depth it uses {:.1} % of its range; if its numbers are millimetres, metres or a sensor's, say so by --depth-unit",
            100.0 * most
        ));
    }
    (zeros > MANY && zeros < 1.0).then(|| {
        format!(
            "{:.0} % of it is 0, which as normalized depth is the nearest; if that means no reading, --depth-unit says what its numbers are",
            100.0 * zeros
        )
    })
}

/// Normalized depth, (h, w), of `depth` on any scale on which farther is larger: between `near` and `far`, by default
/// its 1st and 99th percentile.
///
/// # Errors
/// No number at all, or a range that is no range.
pub fn relative(depth: ArrayView2<'_, f32>, near: Option<f32>, far: Option<f32>) -> Result<Array2<f32>> {
    // What metres are normalized by takes numbers above 0 for readings.
    let least = depth.iter().copied().fold(f32::INFINITY, f32::min);
    let shift = if least > 0.0 { 0.0 } else { 1.0 - least };
    let shifted = depth.mapv(|d| d + shift);
    let [near, far] = [near, far].map(|end| end.map(|end| end + shift));
    Ok(depth::normalize(shifted.view(), DepthUnit::Metres, near, far)?.depth)
}

/// The frame of `rgb`, (3, H, W), and of noisy or incomplete `depth`, (h, w), normalized, placed on a modulator:
/// refined along the colour's edges.
///
/// # Errors
/// Shapes that are empty or too large.
pub fn refined(rgb: &Array3<f32>, depth: &Array2<f32>, placement: &Placement) -> Result<RgbdFrame> {
    let (_, height, width) = rgb.dim();
    let crop = placement.depth_crop(depth.dim(), (height, width));
    let colour = placement.colour(rgb.view());
    let colour = colour.as_standard_layout().into_owned();
    let depth = depth.as_standard_layout();
    let refiner = Refiner::new(depth.dim(), crop, placement.inner())?;
    let mut to = Array2::zeros(placement.inner());
    refiner.refine(
        depth.as_slice().expect("standard layout"),
        &vec![1.0; depth.len()],
        colour.as_slice().expect("standard layout"),
        to.as_slice_mut().expect("standard layout"),
        &mut refiner.scratch(),
    )?;
    placement.frame(colour, to)
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

    #[test]
    fn depth_that_is_hardly_normalized_is_doubted() {
        let plane = |value: &dyn Fn(usize) -> f32| Array2::from_shape_fn((10, 10), |(y, x)| value(10 * y + x));
        assert_eq!(doubt(&plane(&|i| i as f32 / 99.0)), None);
        // Millimetres of a room in 16 bits.
        assert!(doubt(&plane(&|i| (800.0 + 40.0 * i as f32) / 65535.0)).is_some_and(|d| d.contains("7.3 %")));
        assert!(doubt(&plane(&|i| if i % 5 == 0 { 0.0 } else { 0.9 })).is_some_and(|d| d.contains("20 % of it is 0")));
    }

    #[test]
    fn relative_depth_is_stretched_whatever_its_scale() {
        let plane = Array2::from_shape_fn((20, 20), |(y, x)| (20 * y + x) as f32);
        let depth = relative(plane.view(), None, None).expect("numbers");
        assert_eq!((depth[(0, 0)], depth[(19, 19)]), (0.0, 1.0));
        let other = relative(plane.mapv(|v| 0.5 * v - 300.0).view(), None, None).expect("numbers");
        assert!((&depth - &other).iter().all(|d| d.abs() < 1e-5));
    }
}
