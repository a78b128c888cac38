//! Converts the depth of sensors and files to normalized depth. The modules handle units, range and holes, and align,
//! smooth over time and condition the depth images of phones for the resolution of the display.
//!
//! The result is d ∈ \[0, 1], 0 nearest, 1 farthest, linear in metres between near and far.

pub mod align;
pub mod camera;
pub mod condition;
pub mod enlarged;
pub mod image;
pub mod range;
pub mod sharpness;
pub mod smoothing;
pub mod softness;
pub mod stream;

use crate::Bounds;
use crate::parallel::prelude::*;
use crate::runtime::error::{Error, Result};
use ndarray::{Array2, ArrayView2};
use phasefront_kernels::wide;

/// The least number that is no reading in depth of any unit but the normalized one. Renderers write 1e10 or the largest
/// finite number where there is no surface.
pub(crate) const NO_READING_FROM: f32 = 1e9;

/// The unit of the numbers in a depth image.
///
/// In all units except [`DepthUnit::Normalized`], 0, negative numbers, numbers of 10⁹ or more and NaN mean no reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DepthUnit {
    /// Normalized depth, from 0 nearest to 1 farthest. Only NaN means no reading.
    Normalized,
    /// Metres from the camera.
    Metres,
    /// Millimetres from the camera.
    Millimetres,
    /// Inverse metres.
    Disparity,
    /// Units of the sensor.
    Raw {
        /// The number of units in a metre; 5000 in the TUM RGB-D benchmark.
        units_per_m: f64,
    },
}

impl DepthUnit {
    /// Returns the distance of a reading in metres, or `None` if `value` is not a valid reading.
    pub fn metres(self, value: f32) -> Option<f32> {
        let is_reading = |value: &f32| *value > 0.0 && *value < NO_READING_FROM;
        let metres = Some(value).filter(is_reading).map(|value| match self {
            DepthUnit::Normalized | DepthUnit::Metres => value,
            DepthUnit::Millimetres => value / 1000.0,
            DepthUnit::Disparity => 1.0 / value,
            DepthUnit::Raw { units_per_m } => (f64::from(value) / units_per_m) as f32,
        });
        metres.filter(is_reading)
    }
}

/// Returns normalized `depth` as a word, round(d·65535).
#[doc(hidden)]
#[inline(always)]
pub fn word(depth: f32) -> u16 {
    // From 2²³ on, the low bits of a float are its integer value. A saturating conversion would not vectorise.
    ((depth * 65535.0 + 0.5).floor() + 8_388_608.0).to_bits() as u16
}

/// Writes normalized `depth` as words. Does not allocate.
///
/// # Panics
/// Panics if the lengths differ.
#[doc(hidden)]
pub fn write_words(depth: &[f32], words: &mut [u16]) {
    /// The number of pixels that a thread converts at a time.
    const PART: usize = 1 << 14;
    assert_eq!(depth.len(), words.len());
    let parts = words.par_chunks_mut(PART).zip(depth.par_chunks(PART));
    parts.for_each(|(words, depth)| {
        wide!(words.iter_mut().zip(depth).for_each(|(to, depth)| *to = word(*depth)));
    });
}

/// Normalized depth and the parameters of its conversion.
#[derive(Debug, Clone, PartialEq)]
pub struct NormalizedDepth {
    /// The normalized depth, (H, W), 0 nearest, 1 farthest. NaN means no reading.
    pub depth: Array2<f32>,
    /// The distances in metres at d = 0 and d = 1, or `None` if the input was already normalized.
    pub range_m: Option<(f32, f32)>,
    /// The number of pixels without a reading.
    pub holes: usize,
    /// The number of pixels before near or beyond far, which became 0 or 1.
    pub clipped: usize,
}

/// The largest share of the pixels that near and far may clip. Beyond it, no usable depth remains.
const MOST_CLIPPED: f64 = 0.99;

/// Normalizes `depth`, (H, W), given in `unit`.
///
/// `near_m` and `far_m`, in metres, become 0 and 1; they default to
/// the 1st and 99th percentile of the readings. Values beyond them are clamped.
///
/// # Errors
/// Returns an error if the image is empty or has no reading, if more values are negative than positive, if a normalized
/// value lies outside \[0, 1], if near or far is given for normalized depth, or if the range is invalid or contains
/// almost no reading.
pub fn normalize(
    depth: ArrayView2<'_, f32>,
    unit: DepthUnit,
    near_m: Option<f32>,
    far_m: Option<f32>,
) -> Result<NormalizedDepth> {
    if depth.is_empty() {
        return Err(Error::Frame("the depth image is empty".into()));
    }
    if let DepthUnit::Raw { units_per_m } = unit
        && !(units_per_m.is_finite() && units_per_m > 0.0)
    {
        return Err(Error::Frame(format!(
            "a depth scale of {units_per_m} units a metre means nothing; it must be above 0"
        )));
    }
    let normalized = unit == DepthUnit::Normalized;
    let given = near_m.is_some() || far_m.is_some();
    if normalized && given {
        return Err(Error::Frame(
            "near and far are metres and normalized depth has no unit; leave them out, or name the unit of the depth's numbers".into(),
        ));
    }
    check_sign(depth)?;
    let metres = depth.mapv(|v| match normalized {
        true => v,
        false => unit.metres(v).unwrap_or(f32::NAN),
    });
    if normalized && let Some(bad) = metres.iter().find(|v| !v.is_nan() && !(0.0..=1.0).contains(*v)) {
        return Err(Error::Frame(format!(
            "normalized depth holds {bad}; it must lie in 0..=1, or another depth unit be named"
        )));
    }
    let holes = metres.iter().filter(|v| v.is_nan()).count();
    if holes == metres.len() {
        return Err(no_reading());
    }
    if normalized {
        return Ok(NormalizedDepth {
            depth: metres,
            range_m: None,
            holes,
            clipped: 0,
        });
    }
    let (near, far) = match (near_m, far_m) {
        (Some(near), Some(far)) => (near, far),
        _ => {
            let (low, high) = percentiles(depth.iter().filter_map(|&v| unit.metres(v)).collect());
            (near_m.unwrap_or(low), far_m.unwrap_or(high))
        }
    };
    let least = metres.iter().copied().fold(f32::INFINITY, |least, m| m.at_most(least));
    let most = metres
        .iter()
        .copied()
        .fold(f32::NEG_INFINITY, |most, m| m.at_least(most));
    if !(near.is_finite() && far.is_finite() && near >= 0.0 && (near < far || !given && near == far)) {
        return Err(Error::Frame(format!(
            "near {near} m and far {far} m are no range; near must lie before far, both in metres; the depth lies from {least} m to {most} m"
        )));
    }
    let clipped = metres.iter().filter(|m| **m < near || **m > far).count();
    if given && clipped as f64 > MOST_CLIPPED * metres.len() as f64 {
        return Err(Error::Frame(format!(
            "near {near} m and far {far} m leave nothing of the depth, which lies from {least} m to {most} m; both are metres"
        )));
    }
    // If all distances are equal, there is no extent to scale, so d = ½ puts the surface in the middle of the volume.
    let depth = match near < far {
        true => metres.mapv(|m| ((m - near) / (far - near)).clamp(0.0, 1.0)),
        false => metres.mapv(|m| if m.is_nan() { m } else { 0.5 }),
    };
    Ok(NormalizedDepth {
        depth,
        range_m: Some((near, far)),
        holes,
        clipped,
    })
}

/// Refuses depth whose values are mostly negative: z of a camera that looks along −z, as in OpenGL. A single negative
/// value, such as −1, stands for no reading.
fn check_sign(depth: ArrayView2<'_, f32>) -> Result<()> {
    let negative = depth.iter().filter(|v| **v < 0.0).count();
    let positive = depth.iter().filter(|v| **v > 0.0).count();
    let ends = depth.iter().filter(|v| **v < 0.0);
    let (least, most) = ends.fold((0.0f32, f32::NEG_INFINITY), |(a, b), v| (v.at_most(a), v.at_least(b)));
    if negative <= positive || least == most {
        return Ok(());
    }
    Err(Error::Frame(format!(
        "the sign of the depth is wrong: {:.0} % of it is negative, down to {least}, as the z of OpenGL is; distances are positive, so give −z",
        100.0 * negative as f64 / depth.len() as f64
    )))
}

fn no_reading() -> Error {
    Error::Frame("depth has no reading at all; at least one pixel must be valid".into())
}

/// Returns the 1st and 99th percentile of `readings`, which must not be empty or contain NaN.
fn percentiles(mut readings: Vec<f32>) -> (f32, f32) {
    let last = readings.len() - 1;
    let mut at = |q: f64| {
        let i = (q * last as f64).round() as usize;
        *readings.select_nth_unstable_by(i, f32::total_cmp).1
    };
    (at(0.01), at(0.99))
}

/// Replaces each NaN of `depth` by the nearest reading, measured in steps along rows and columns, in O(H·W), and
/// returns the number of replaced pixels.
///
/// # Errors
/// Returns an error if all values are NaN.
pub fn fill_nearest(depth: &mut Array2<f32>) -> Result<usize> {
    let holes = depth.iter().filter(|v| v.is_nan()).count();
    if holes == depth.len() {
        return Err(no_reading());
    }
    if holes > 0 {
        let width = depth.dim().1;
        let mut filled: Vec<f32> = depth.iter().copied().collect();
        fill_from_nearest(&mut filled, width, &mut Vec::new(), &mut Vec::new());
        depth.iter_mut().zip(filled).for_each(|(to, v)| *to = v);
    }
    Ok(holes)
}

/// Replaces each NaN of `depth`, rows of `width`, by the nearest reading, measured in steps along rows and columns.
///
/// `front` and `next` are working memory. `depth` must contain a reading.
fn fill_from_nearest(depth: &mut [f32], width: usize, front: &mut Vec<u32>, next: &mut Vec<u32>) {
    // A wave that starts at all readings at once reaches each hole from its nearest reading.
    front.clear();
    front.extend((0..depth.len() as u32).filter(|i| !depth[*i as usize].is_nan()));
    while !front.is_empty() {
        next.clear();
        for &i in front.iter() {
            let i = i as usize;
            let x = i % width;
            let neighbours = [
                (i >= width).then(|| i - width),
                (i + width < depth.len()).then(|| i + width),
                (x > 0).then(|| i - 1),
                (x + 1 < width).then(|| i + 1),
            ];
            for n in neighbours.into_iter().flatten() {
                if depth[n].is_nan() {
                    depth[n] = depth[i];
                    next.push(n as u32);
                }
            }
        }
        std::mem::swap(front, next);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use ndarray::array;

    #[test]
    fn each_unit_gives_metres_or_no_reading() {
        let raw = DepthUnit::Raw { units_per_m: 5000.0 };
        assert_eq!(DepthUnit::Metres.metres(2.5), Some(2.5));
        assert_eq!(DepthUnit::Millimetres.metres(2500.0), Some(2.5));
        assert_eq!(DepthUnit::Disparity.metres(0.4), Some(2.5));
        assert_eq!(raw.metres(12500.0), Some(2.5));
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e9, 1e10, f32::MAX] {
            for unit in [DepthUnit::Metres, DepthUnit::Millimetres, DepthUnit::Disparity, raw] {
                assert_eq!(unit.metres(bad), None, "{unit:?} {bad}");
            }
        }
        assert_eq!(DepthUnit::Disparity.metres(1e-10), None);
        assert_eq!(DepthUnit::Metres.metres(9e8), Some(9e8));
    }

    #[test]
    fn numbers_for_no_surface_do_not_widen_the_range() {
        // A fifth of the picture is background.
        for background in [1e10, f32::MAX, f32::INFINITY, 1e9] {
            let depth = Array2::from_shape_fn((10, 100), |(y, x)| match y {
                0 | 1 => background,
                _ => 1.0 + x as f32 / 100.0,
            });
            let n = normalize(depth.view(), DepthUnit::Metres, None, None).unwrap();
            assert_eq!(n.holes, 200, "{background}");
            let (near, far) = n.range_m.unwrap();
            assert!(near < 1.02 && (1.97..2.0).contains(&far), "{background}: {near} {far}");
        }
    }

    #[test]
    fn a_wrong_sign_is_named() {
        let z = Array2::from_shape_fn((4, 4), |(y, x)| -1.0 - (4 * y + x) as f32 / 10.0);
        for unit in [DepthUnit::Metres, DepthUnit::Millimetres, DepthUnit::Normalized] {
            let why = normalize(z.view(), unit, None, None).unwrap_err().to_string();
            assert!(why.contains("sign") && why.contains("-2.5"), "{why}");
        }
        // A few negative numbers among readings are no readings.
        let mut mixed = z.mapv(f32::abs);
        mixed[(0, 0)] = -1.0;
        assert_eq!(normalize(mixed.view(), DepthUnit::Metres, None, None).unwrap().holes, 1);
        // Sparse depth may have −1 where it has no reading.
        let sparse = Array2::from_shape_fn((4, 4), |(y, x)| if x == 0 { 1.0 + y as f32 } else { -1.0 });
        assert_eq!(
            normalize(sparse.view(), DepthUnit::Metres, None, None).unwrap().holes,
            12
        );
    }

    #[test]
    fn words_are_rounded() {
        let depth: Vec<f32> = (0..=70_000).map(|i| i as f32 / 70_000.0).collect();
        let mut words = vec![0; depth.len()];
        write_words(&depth, &mut words);
        for (word, depth) in words.iter().zip(&depth) {
            assert!(
                (f64::from(*word) - f64::from(*depth) * 65535.0).abs() < 0.51,
                "{depth}: {word}"
            );
        }
        assert_eq!((words[0], words[70_000]), (0, 65535));
    }

    #[test]
    fn range_defaults_to_percentiles_of_what_is_valid() {
        let mut depth = Array2::from_shape_fn((10, 101), |(_, x)| 1.0 + x as f32 / 100.0);
        depth[(0, 0)] = 0.0;
        depth[(9, 9)] = f32::NAN;
        depth[(5, 5)] = 1000.0;
        let n = normalize(depth.view(), DepthUnit::Metres, None, None).unwrap();
        assert_eq!(n.holes, 2);
        assert!(n.depth[(0, 0)].is_nan() && n.depth[(9, 9)].is_nan());
        let (near, far) = n.range_m.unwrap();
        assert!((near - 1.01).abs() < 0.011 && (far - 1.99).abs() < 0.011);
        assert_eq!(n.depth[(5, 5)], 1.0);
        assert!((n.depth[(3, 50)] - 0.5).abs() < 0.01);
    }

    #[test]
    fn holes_take_the_nearest_reading() {
        let nan = f32::NAN;
        let mut depth = array![[nan, nan, nan, 0.7], [0.2, nan, nan, nan], [nan, nan, nan, nan]];
        assert_eq!(fill_nearest(&mut depth).unwrap(), 10);
        assert_eq!(depth[(2, 0)], 0.2);
        assert_eq!(depth[(1, 3)], 0.7);
        assert!(depth.iter().all(|v| *v == 0.2 || *v == 0.7));
        assert!(fill_nearest(&mut Array2::from_elem((2, 2), nan)).is_err());
    }

    #[test]
    fn what_cannot_be_meant_is_refused() {
        let d = array![[0.5, 2.0]];
        for (unit, near, far, word) in [
            (DepthUnit::Normalized, None, None, "normalized"),
            (DepthUnit::Metres, Some(2.0), Some(1.0), "no range"),
            (DepthUnit::Metres, Some(1.0), Some(1.0), "no range"),
            (DepthUnit::Metres, Some(f32::NAN), None, "no range"),
            (DepthUnit::Raw { units_per_m: 0.0 }, None, None, "scale"),
            (DepthUnit::Normalized, Some(0.5), None, "near and far are metres"),
            (DepthUnit::Metres, Some(500.0), None, "from 0.5 m to 2 m"),
            (
                DepthUnit::Metres,
                Some(500.0),
                Some(4000.0),
                "leave nothing of the depth, which lies from 0.5 m to 2 m; both are metres",
            ),
            (DepthUnit::Metres, Some(0.1), Some(0.2), "leave nothing"),
        ] {
            let e = normalize(d.view(), unit, near, far).unwrap_err();
            assert!(e.to_string().contains(word), "{e}");
        }
        let none = normalize(array![[0.0, 0.0]].view(), DepthUnit::Metres, None, None);
        assert!(none.unwrap_err().to_string().contains("no reading"));
    }

    #[test]
    fn what_lies_beyond_near_and_far_is_counted() {
        let d = array![[0.5, 1.0, 2.0, 4.0]];
        let n = normalize(d.view(), DepthUnit::Metres, Some(1.0), Some(2.0)).unwrap();
        assert_eq!((n.depth, n.clipped), (array![[0.0, 0.0, 1.0, 1.0]], 2));
    }

    #[test]
    fn one_distance_everywhere_is_the_middle_of_the_volume() {
        let n = normalize(array![[2.0, 0.0]].view(), DepthUnit::Metres, None, None).unwrap();
        assert_eq!(n.depth[(0, 0)], 0.5);
        assert!(n.depth[(0, 1)].is_nan());
    }
}
