//! Reading an RGB-D frame from files: depth is normalized and conditioned for the shape of the colour on a modulator.

pub mod fit;
mod middlebury;

use crate::frame::fit::Placement;
use crate::input::decode;
use crate::picture::colours::{self, Colours};
use crate::picture::depth_map::{self, DepthFile};
use crate::{Error, Result};
use image::metadata::Orientation;
use ndarray::{Array2, Array3, ArrayView2};
use phasefront::RgbdFrame;
use phasefront::Size;
use phasefront::input::RgbEncoding;
use phasefront_core::depth;
use phasefront_core::depth::DepthUnit;
use phasefront_core::depth::condition::Conditioner;
use phasefront_core::depth::enlarged::{self, Enlarged};
use std::fmt::Display;
use std::path::Path;

/// The largest relative difference between the aspect ratios of colour and depth.
const ASPECT_TOLERANCE: f64 = 0.01;

/// How the values of a depth file are interpreted.
#[derive(Debug, Clone, Copy)]
pub struct DepthOptions {
    /// The unit of the values.
    pub unit: DepthUnit,
    /// The distance in metres that maps to d = 0. Defaults to the 1st percentile.
    pub near_m: Option<f32>,
    /// The distance in metres that maps to d = 1. Defaults to the 99th percentile.
    pub far_m: Option<f32>,
    /// Whether near and far are swapped.
    pub inverted: bool,
}

/// Colour and depth as files have them.
#[derive(Debug, Clone, PartialEq)]
pub struct Captured {
    /// The colours, (3, H, W).
    pub rgb: Array3<f32>,
    /// The meaning of the colours.
    pub encoding: RgbEncoding,
    /// The normalized depth of the same field of view, (h, w). NaN means no reading.
    pub depth: Array2<f32>,
    /// The distances that the depth shows, unless the file has normalized depth.
    pub shown: Option<ShownDepth>,
}

/// The distances that normalized depth shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShownDepth {
    /// The distance at d = 0, in metres.
    pub near_m: f32,
    /// The distance at d = 1, in metres.
    pub far_m: f32,
    /// The share of the pixels without a reading.
    pub holes: f64,
}

impl std::fmt::Display for ShownDepth {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "depth from {:.3} m to {:.3} m", self.near_m, self.far_m)?;
        if self.holes > 0.0 {
            write!(f, ", {:.1} % of it without a reading", 100.0 * self.holes)?;
        }
        Ok(())
    }
}

/// A colour picture, and the readings of the same field of view, as files hold them.
pub(crate) struct Stored {
    pub(crate) colours: Colours,
    /// The readings in the file's unit, (h, w).
    pub(crate) readings: Array2<f32>,
}

/// Reads the files of a still or of a frame of a video, colour and depth. The colours mean `asked` or what the file
/// says. `told` takes what is doubtful about them.
///
/// # Errors
/// Returns an error if a file cannot be read or if the files do not match.
pub(crate) fn stored(
    [rgb_path, depth_path]: [&Path; 2],
    options: DepthOptions,
    asked: Option<RgbEncoding>,
    told: &mut dyn FnMut(Doubt),
) -> Result<Stored> {
    let (colours, orientation) = colours::read(rgb_path, asked)?;
    let colour_size = colours.size();
    let normalized = options.unit == DepthUnit::Normalized;
    let file = depth_map::read(depth_path, normalized)?;
    if is_turned_alone(depth_path, &file, orientation, colour_size)? {
        told(Doubt::Turned(orientation));
    }
    let mut readings = file.depth;
    if options.unit == DepthUnit::Disparity && middlebury::inverse_metres(depth_path, &mut readings)? {
        told(Doubt::Middlebury);
    }
    if normalized {
        check_normalized(&readings).map_err(|why| Error::file(depth_path, why))?;
        if let Some(doubt) = Doubt::of_normalized(readings.iter().copied(), options.inverted) {
            told(doubt);
        }
    }
    check_aspect(Size::from_shape(readings.dim()), colour_size).map_err(|why| Error::file(depth_path, why))?;
    Ok(Stored { colours, readings })
}

/// Reads colour, whose meaning is `asked` or what the file says, and depth of the same aspect ratio.
///
/// # Errors
/// Returns an error if a file cannot be read or if the files do not match.
pub fn read(rgb_path: &Path, depth_path: &Path, options: DepthOptions, asked: Option<RgbEncoding>) -> Result<Captured> {
    let warn = |doubt: Doubt| log::warn!("{}: {doubt}", depth_path.display());
    let Stored { colours, readings } = stored([rgb_path, depth_path], options, asked, &mut { warn })?;
    let (readings, enlarged) = before_enlarging(readings, colours.size());
    enlarged.map(Doubt::Enlarged).into_iter().for_each(warn);
    let Colours { rgb, encoding } = colours;
    let normalized = depth::normalize(readings.view(), options.unit, options.near_m, options.far_m)
        .map_err(|e| Error::file(depth_path, e))?;
    let shown = normalized.range_m.map(|(near_m, far_m)| ShownDepth {
        near_m,
        far_m,
        holes: normalized.holes as f64 / readings.len() as f64,
    });
    if let Some(shown) = shown {
        let clipped = normalized.clipped as f64 / readings.len() as f64;
        if let Some(doubt) = Doubt::of_clipped(clipped, shown.near_m, shown.far_m) {
            warn(doubt);
        }
        log::info!(
            "{}: near {:.3} m, far {:.3} m, {} pixels without a reading",
            depth_path.display(),
            shown.near_m,
            shown.far_m,
            normalized.holes
        );
        let is_chosen = options.near_m.is_some() && options.far_m.is_some();
        let crowded = Doubt::of_crowded(&normalized.depth, shown.near_m, shown.far_m);
        crowded.filter(|_| !is_chosen).into_iter().for_each(warn);
    }
    Ok(Captured {
        rgb,
        encoding,
        depth: normalized.depth,
        shown,
    })
}

/// Returns the readings that `depth`, (H, W), was enlarged from, if it is as large as its `picture` and was enlarged;
/// otherwise `depth`.
pub(crate) fn before_enlarging(depth: Array2<f32>, picture: Size) -> (Array2<f32>, Option<Enlarged>) {
    match of_size(Size::from_shape(depth.dim()), picture).then(|| enlarged::find(depth.view())) {
        Some(Some(found)) => (found.readings(depth.view()), Some(found)),
        _ => (depth, None),
    }
}

/// Checks whether depth has at least the size of its picture. Smaller depth has the sensor's size.
pub(crate) fn of_size(depth: Size, picture: Size) -> bool {
    depth.width >= picture.width && depth.height >= picture.height
}

/// Refuses numbers that normalized depth cannot have.
fn check_normalized(depth: &Array2<f32>) -> std::result::Result<(), String> {
    if let Some(bad) = depth.iter().find(|v| v.is_infinite()) {
        return Err(format!(
            "holds {bad}; normalized depth must lie in 0..=1, NaN where there is no reading"
        ));
    }
    let most = depth.iter().copied().fold(0.0, f32::max);
    if most > 1.0 {
        return Err(format!(
            "holds {most}; normalized depth lies in 0..=1: --depth-unit says what its numbers are; a network's relative inverse depth, larger where nearer, is divided by its largest number and takes --invert"
        ));
    }
    Ok(())
}

/// Checks that colour and depth have the same aspect ratio.
///
/// # Errors
/// Returns the two sizes if they do not.
pub fn check_aspect(depth: Size, colour: Size) -> std::result::Result<(), String> {
    if has_aspect(depth, colour) {
        return Ok(());
    }
    Err(format!(
        "depth is {depth}, colour {colour}: their aspect ratios differ; they must show the same field of view"
    ))
}

/// Checks whether two sizes have the same aspect ratio.
fn has_aspect(Size { width: w, height: h }: Size, Size { width, height }: Size) -> bool {
    let cross = |a: usize, b: usize| a as f64 * b as f64;
    let ratio = cross(width, h) / cross(height, w);
    (ratio - 1.0).abs() <= ASPECT_TOLERANCE
}

/// Checks whether Exif data turned the colour image, of `size`, but not its depth, while both sizes still match.
///
/// # Errors
/// Returns an error if the depth matches the colour only as it is stored.
pub(crate) fn is_turned_alone(depth_path: &Path, depth: &DepthFile, colour: Orientation, size: Size) -> Result<bool> {
    if colour == Orientation::NoTransforms || depth.orientation != Orientation::NoTransforms {
        return Ok(false);
    }
    let found = Size::from_shape(depth.depth.dim());
    let fits = has_aspect(found, size);
    let stored = Size {
        width: size.height,
        height: size.width,
    };
    if !fits && decode::swaps_sides(colour) && has_aspect(found, stored) {
        return Err(Error::file(
            depth_path,
            format!(
                "depth is {found}, as the colour is stored, but the colour's Exif data turn it to {size}; turn the depth alike, or remove the colour's orientation (exiftool -Orientation= -overwrite_original)"
            ),
        ));
    }
    Ok(fits)
}

/// What is doubtful about a frame's depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Doubt {
    /// It was enlarged from fewer readings, which are taken in its place.
    Enlarged(Enlarged),
    /// A calibration of Middlebury lies beside it, and its numbers are taken for pixels.
    Middlebury,
    /// The colour's Exif data turned the colour alone, though both shapes match.
    Turned(Orientation),
    /// Normalized depth reaches only this value.
    Little(f32),
    /// This share of normalized depth is 0.
    Zeros(f32),
    /// Near and far clip a share of the depth.
    Clipped {
        /// The share.
        share: f64,
        /// Near in metres.
        near_m: f32,
        /// Far in metres.
        far_m: f32,
    },
    /// Most of the depth shares a small part of the range, as when numbers that stand for background or no reading make
    /// the range too large.
    Crowded {
        /// The share of the depth.
        share: f64,
        /// The ends of the part in metres.
        part_m: [f32; 2],
        /// The ends of the range in metres.
        range_m: [f32; 2],
    },
}

impl Doubt {
    /// Returns the reason to doubt that `depth` is normalized, if there is one. `inverted` tells that 0 is the
    /// farthest.
    pub fn of_normalized(depth: impl Iterator<Item = f32>, inverted: bool) -> Option<Self> {
        /// Normalized depth that uses its range exceeds this value.
        const LITTLE: f32 = 0.25;
        /// The share of zeros that is unlikely for a near surface.
        const MANY: f32 = 0.1;
        let (mut most, mut zeros, mut all) = (0.0f32, 0usize, 0usize);
        for d in depth {
            most = most.max(d);
            zeros += usize::from(d == 0.0);
            all += 1;
        }
        let zeros = zeros as f32 / all.max(1) as f32;
        match (0.0..LITTLE).contains(&most) && most > 0.0 {
            true => Some(Doubt::Little(most)),
            false => (zeros > MANY && !inverted).then_some(Doubt::Zeros(zeros)),
        }
    }

    /// Returns the reason to doubt near and far that clip `share` of the depth, if there is one.
    pub fn of_clipped(share: f64, near_m: f32, far_m: f32) -> Option<Self> {
        /// The share above which near and far are doubtful.
        const DOUBTFUL: f64 = 0.9;
        (share > DOUBTFUL).then_some(Doubt::Clipped { share, near_m, far_m })
    }

    /// Returns the reason to doubt the range from `near_m` to `far_m`, in which `depth` is normalized, if there is one.
    pub fn of_crowded(depth: &Array2<f32>, near_m: f32, far_m: f32) -> Option<Self> {
        /// The number of parts of the range.
        const PARTS: usize = 1000;
        /// The number of parts that are little of it, 3 %.
        const FEW: usize = 30;
        /// A plain background at the far end is common. It does not make the range this many times its near end.
        const DEEP: f32 = 8.0;
        let mut counts = [0usize; PARTS];
        for d in depth.iter().filter(|d| !d.is_nan()) {
            counts[((d * PARTS as f32) as usize).min(PARTS - 1)] += 1;
        }
        let all: usize = counts.iter().sum();
        let windows = counts
            .windows(FEW)
            .map(|window| window.iter().sum::<usize>())
            .enumerate();
        let (start, most) = windows.max_by_key(|(start, count)| (*count, PARTS - start))?;
        let is_background = start + FEW == PARTS && far_m < DEEP * near_m;
        if near_m >= far_m || 2 * most <= all || is_background {
            return None;
        }
        let occupied = |at: &usize| counts[*at] > 0;
        let first = (start..start + FEW).find(occupied)?;
        let last = (start..start + FEW).rev().find(occupied)?;
        let metres = |part: usize| near_m + (far_m - near_m) * part as f32 / PARTS as f32;
        Some(Doubt::Crowded {
            share: most as f64 / all as f64,
            part_m: [metres(first), metres(last + 1)],
            range_m: [near_m, far_m],
        })
    }
}

impl Display for Doubt {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Doubt::Enlarged(how) => write!(to, "was {how}; it is conditioned as depth of that size"),
            Doubt::Middlebury => write!(to, "is disparity in pixels, as calib.txt beside it is Middlebury's"),
            Doubt::Turned(how) => write!(
                to,
                "is taken as it is, upright; the colour's Exif data turn the colour: {how:?}"
            ),
            Doubt::Little(most) => write!(
                to,
                "as normalized depth it uses {:.1} % of its range; if its numbers are millimetres, metres or a sensor's, say so by --depth-unit",
                100.0 * most
            ),
            Doubt::Zeros(share) => write!(
                to,
                "{:.0} % of it is 0, which as normalized depth is the nearest; if that means no reading, --depth-unit says what its numbers are",
                100.0 * share
            ),
            Doubt::Clipped { share, near_m, far_m } => write!(
                to,
                "{:.0} % of the depth lies before near {near_m} m or beyond far {far_m} m and is shown there; both are metres",
                100.0 * share
            ),
            Doubt::Crowded {
                share,
                part_m: [from, to_m],
                range_m: [near, far],
            } => write!(
                to,
                "{:.0} % of the depth lies from {from:.3} m to {to_m:.3} m, in {:.1} % of the range from {near:.3} m to {far:.3} m that is shown; if farther numbers mean background or no reading, --far says what is farthest",
                100.0 * share,
                100.0 * (to_m - from) / (far - near)
            ),
        }
    }
}

/// Normalizes depth, (h, w), of any scale on which farther is larger, to the range from `near` to `far`. The defaults
/// are the 1st and 99th percentiles. Values that are not finite become NaN.
///
/// # Errors
/// Returns an error if no value is finite or the range is empty.
pub fn relative(depth: ArrayView2<'_, f32>, near: Option<f32>, far: Option<f32>) -> Result<Array2<f32>> {
    // The normalization of metres treats only values above 0 as readings.
    let least = depth.iter().copied().fold(f32::INFINITY, f32::min);
    let shift = if least > 0.0 { 0.0 } else { 1.0 - least };
    let shifted = depth.mapv(|d| d + shift);
    let [near, far] = [near, far].map(|end| end.map(|end| end + shift));
    Ok(depth::normalize(shifted.view(), DepthUnit::Metres, near, far)?.depth)
}

/// Creates a frame from `rgb`, (3, H, W), and normalized `depth`, (h, w) with NaN for no reading, placed on a
/// modulator. The depth is conditioned along the edges of the colour image.
///
/// # Errors
/// Returns an error if a shape is empty or too large.
pub fn conditioned(rgb: &Array3<f32>, depth: &Array2<f32>, placement: &Placement) -> Result<RgbdFrame> {
    let (_, height, width) = rgb.dim();
    let crop = placement.depth_crop(Size::from_shape(depth.dim()), Size { width, height });
    let colour = placement.colour(rgb.view());
    let colour = colour.as_standard_layout().into_owned();
    let depth = depth.as_standard_layout();
    let conditioner = Conditioner::new(Size::from_shape(depth.dim()), crop, placement.inner(), false)?;
    let mut to = Array2::zeros(placement.inner().shape());
    conditioner.condition(
        depth.as_slice().expect("standard layout"),
        colour.as_slice().expect("standard layout"),
        to.as_slice_mut().expect("standard layout"),
        &mut conditioner.scratch(),
    )?;
    placement.frame(colour, to)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_that_is_hardly_normalized_is_doubted() {
        let doubt = |value: &dyn Fn(usize) -> f32, inverted| Doubt::of_normalized((0..100).map(value), inverted);
        assert_eq!(doubt(&|i| i as f32 / 99.0, false), None);
        // Depths of an indoor scene in millimetres, stored in 16 bits.
        let indoor = doubt(&|i| (800.0 + 40.0 * i as f32) / 65535.0, false);
        assert!(indoor.is_some_and(|d| d.to_string().contains("7.3 %")));
        let zeros = |i| if i % 5 == 0 { 0.0 } else { 0.9 };
        assert_eq!(doubt(&zeros, false), Some(Doubt::Zeros(0.2)));
        assert_eq!(doubt(&zeros, true), None, "0 is the farthest");
    }

    #[test]
    fn a_range_that_most_of_the_depth_leaves_empty_is_named() {
        // A scene from 1 m to 2 m, as part of a range to `far`, and a share of pixels at its far end.
        let scene = |far: f32, background: usize| {
            Array2::from_shape_fn((10, 100), |(y, x)| match 10 * x < background {
                true => 1.0,
                false => (x + 100 * y) as f32 / 1000.0 / (far - 1.0),
            })
        };
        let crowded =
            |depth: &Array2<f32>, near, far| Doubt::of_crowded(depth, near, far).map(|doubt| doubt.to_string());
        assert_eq!(crowded(&scene(2.0, 0), 1.0, 2.0), None);
        assert_eq!(crowded(&scene(2.0, 700), 1.0, 2.0), None);
        assert_eq!(crowded(&scene(4.0, 600), 1.0, 4.0), None);
        for far in [65.535, 100.0, 1000.0, 65535.0] {
            let why = crowded(&scene(far, 50), 1.0, far).unwrap_or_default();
            assert!(
                why.starts_with("95 % of the depth") && why.contains(&format!("{far:.3} m")),
                "{why}"
            );
        }
        assert!(crowded(&scene(1000.0, 600), 1.0, 1000.0).is_some_and(|why| why.starts_with("60 %")));
        assert_eq!(crowded(&Array2::from_elem((4, 4), 0.5), 2.0, 2.0), None);
    }

    #[test]
    fn numbers_of_a_network_are_no_normalized_depth() {
        let why = check_normalized(&Array2::from_elem((2, 2), 523.25))
            .err()
            .unwrap_or_default();
        assert!(
            why.contains("523.25") && why.contains("--depth-unit") && why.contains("--invert"),
            "{why}"
        );
        assert!(check_normalized(&Array2::from_elem((2, 2), f32::INFINITY)).is_err());
        assert!(check_normalized(&Array2::from_elem((2, 2), 1.0)).is_ok());
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
