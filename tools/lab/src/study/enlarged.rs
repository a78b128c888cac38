//! Measures what it is worth to read enlarged depth on the grid that it came from. The depth of a data set's scenes is
//! read on coarser grids, enlarged to the scenes' size, and spoiled as files spoil it. Each is conditioned as it is
//! and on its own grid, and the holograms of both are compared with the true one.

use crate::dataset::{self, Manifest};
use crate::evaluate::{Method, Shown, Viewer};
use crate::sensor::coarse::{Coarse, Sampling};
use image::codecs::jpeg::JpegEncoder;
use image::imageops::{self, FilterType};
use image::{ImageBuffer, ImageEncoder, Luma};
use ndarray::{Array2, Array3};
use phasefront::Size;
use phasefront_core::depth::enlarged::{self, Enlarged, Enlarging};
use phasefront_exact::truth::{judge, visible_depth, visible_frame, visible_rgb};
use phasefront_io::dice::Dice;
use phasefront_io::frame::conditioned;
use phasefront_io::frame::fit::Placement;
use phasefront_io::ldi::{Ldi, LdiLayer};
use phasefront_io::{Error, Result};
use rayon::prelude::*;
use serde::Serialize;
use std::path::Path;

/// The factors.
pub const FACTORS: [f64; 7] = [2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0];
/// The ways of enlarging, and the filters of the image crate that do it.
const WAYS: [(Enlarging, &str, FilterType); 3] = [
    (Enlarging::Nearest, "nearest", FilterType::Nearest),
    (Enlarging::Bilinear, "bilinear", FilterType::Triangle),
    (Enlarging::Bicubic, "bicubic", FilterType::CatmullRom),
];
/// The standard deviation of noise, as a share of the volume.
const NOISE: f32 = 0.005;
/// The quality of JPEG.
const QUALITY: u8 = 90;
/// The difference from the true depth, as a share of the volume, above which a pixel's depth is wrong.
const WRONG: f32 = 0.03;

/// What becomes of enlarged depth in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Spoiled {
    /// Nothing.
    Not,
    /// White noise of half a percent of the volume.
    Noise,
    /// Rounding to 8 bits.
    Bits,
    /// 8 bits and JPEG of quality 90.
    Jpeg,
}

impl Spoiled {
    /// All ways.
    pub const ALL: [Spoiled; 4] = [Spoiled::Not, Spoiled::Noise, Spoiled::Bits, Spoiled::Jpeg];

    /// Returns `depth`, (H, W) in \[0, 1], spoiled in this way. The same seed gives the same noise.
    ///
    /// # Errors
    /// Returns an error if a JPEG cannot be made.
    pub fn spoil(self, depth: &Array2<f32>, seed: u64) -> Result<Array2<f32>> {
        let mut dice = Dice::new(seed);
        let byte = |d: f32| (d.clamp(0.0, 1.0) * 255.0).round() as u8;
        Ok(match self {
            Spoiled::Not => depth.mapv(|d| d.clamp(0.0, 1.0)),
            Spoiled::Noise => depth.mapv(|d| {
                let normal = (0..12).map(|_| dice.unit()).sum::<f64>() as f32 - 6.0;
                (d + NOISE * normal).clamp(0.0, 1.0)
            }),
            Spoiled::Bits => depth.mapv(|d| f32::from(byte(d)) / 255.0),
            Spoiled::Jpeg => {
                let Size { width, height } = Size::from_shape(depth.dim());
                let bytes: Vec<u8> = depth.iter().map(|d| byte(*d)).collect();
                let refused = |why: image::ImageError| Error::Input(why.to_string());
                let mut file = Vec::new();
                let encoder = JpegEncoder::new_with_quality(&mut file, QUALITY);
                encoder
                    .write_image(&bytes, width as u32, height as u32, image::ExtendedColorType::L8)
                    .map_err(refused)?;
                let grey = image::load_from_memory(&file).map_err(refused)?.into_luma8();
                Array2::from_shape_fn((height, width), |(y, x)| {
                    f32::from(grey.get_pixel(x as u32, y as u32).0[0]) / 255.0
                })
            }
        })
    }
}

/// Reads `depth`, (H, W), on a grid that is `factor` times coarser, in the middle of each cell where `by` is nearest
/// and by its mean otherwise, and enlarges it again.
pub fn enlarge(depth: &Array2<f32>, factor: f64, by: Enlarging) -> Array2<f32> {
    let sensor = Coarse {
        ratio: factor,
        sampling: match by {
            Enlarging::Nearest => Sampling::Nearest,
            _ => Sampling::Mean,
        },
        shift: [0, 0],
        noise: 0.0,
        holes: false,
    };
    let readings = sensor.read(depth.view(), 0).depth;
    let from = Size::from_shape(readings.dim());
    let values: Vec<f32> = readings.iter().copied().collect();
    let grid = ImageBuffer::<Luma<f32>, Vec<f32>>::from_raw(from.width as u32, from.height as u32, values);
    let Size { width, height } = Size::from_shape(depth.dim());
    let filter = (WAYS.iter().find(|way| way.0 == by)).map_or(FilterType::Nearest, |way| way.2);
    let large = imageops::resize(
        &grid.expect("a value for each reading"),
        width as u32,
        height as u32,
        filter,
    );
    Array2::from_shape_fn((height, width), |(y, x)| large.get_pixel(x as u32, y as u32).0[0])
}

/// The quality of holograms of one depth, means over the scenes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Quality {
    /// The share of pixels whose depth is wrong.
    pub wrong: f64,
    /// The amplitude PSNR of the field at the midpoint, in dB, and its SSIM.
    pub field: (f64, f64),
    /// The same of the displayed image.
    pub displayed: (f64, f64),
}

/// The results of one factor, way and spoiling.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The factor; 1 is the true depth.
    pub factor: f64,
    /// The way of enlarging.
    pub by: &'static str,
    /// What became of the depth.
    pub spoiled: Spoiled,
    /// The number of scenes.
    pub scenes: usize,
    /// The number of scenes whose depth was found to be enlarged.
    pub found: usize,
    /// The number of scenes whose factor and way were found.
    pub right: usize,
    /// The quality of depth conditioned as it is.
    pub given: Quality,
    /// The quality of depth conditioned on its own grid, where that was found.
    pub on_grid: Quality,
}

/// Studies the first `scenes` scenes of the data set in `dir` by `method`, seen as a field and as `shown`. `done` is
/// called after each depth.
///
/// # Errors
/// Returns an error if a pair cannot be read or a hologram cannot be made.
pub fn study(
    (manifest, dir): (&Manifest, &Path),
    scenes: usize,
    method: &Method<'_>,
    shown: &Shown,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<Row>> {
    let viewer = Viewer::new(manifest)?;
    let cases = cases();
    let of_scene = |index: usize| {
        let pair = dataset::read_pair(manifest, dir, index)?;
        let (rgb, truth) = (visible_rgb(&pair.ldi), visible_depth(&pair.ldi));
        let complex = Shown::complex();
        let wave = viewer.views(None, &pair.hologram, &complex, &[0.0])?.views;
        let quality = |depth: &Array2<f32>| -> Result<Quality> {
            let placement = Placement::as_is(Size::from_shape(truth.dim()));
            let depth = conditioned(&rgb, depth, &placement)?.depth().to_owned();
            let wrong = depth
                .iter()
                .zip(&truth)
                .filter(|(a, b)| (**a - **b).abs() > WRONG)
                .count();
            let scene = Ldi::new(vec![LdiLayer {
                rgb: rgb.clone(),
                depth,
            }])?;
            let field: Array3<_> = method.field(&scene)?;
            let frame = visible_frame(&scene, &manifest.display)?;
            let seen = |shown: &Shown| -> Result<(f64, f64)> {
                let views = viewer.views(Some(&frame), &field, shown, &[0.0])?.views;
                let figures = judge(&views, &wave, 0)?;
                Ok((figures.amplitude_psnr, figures.amplitude_ssim))
            };
            Ok(Quality {
                wrong: wrong as f64 / truth.len() as f64,
                field: seen(&complex)?,
                displayed: seen(shown)?,
            })
        };
        let judged = cases.iter().map(|((factor, by), spoiled)| {
            let large = by.map_or_else(|| truth.clone(), |by| enlarge(&truth, *factor, by));
            let depth = spoiled.spoil(&large, index as u64)?;
            let found = enlarged::find(depth.view());
            let given = quality(&depth)?;
            let on_grid = match found {
                Some(found) => quality(&found.readings(depth.view()))?,
                None => given,
            };
            done();
            Ok((found, given, on_grid))
        });
        judged.collect::<Result<Vec<_>>>()
    };
    let of_scenes = (0..scenes).into_par_iter().map(of_scene).collect::<Result<Vec<_>>>()?;
    let rows = cases.iter().enumerate().map(|(at, ((factor, by), spoiled))| {
        let each: Vec<_> = of_scenes.iter().map(|scene| scene[at]).collect();
        let is_right = |found: &Enlarged| found.factor == *factor && Some(found.by) == *by;
        let name = WAYS
            .iter()
            .find(|way| Some(way.0) == *by)
            .map_or("true depth", |way| way.1);
        Row {
            factor: *factor,
            by: name,
            spoiled: *spoiled,
            scenes,
            found: each.iter().filter(|scene| scene.0.is_some()).count(),
            right: each
                .iter()
                .filter(|scene| scene.0.as_ref().is_some_and(is_right))
                .count(),
            given: mean(each.iter().map(|scene| scene.1)),
            on_grid: mean(each.iter().map(|scene| scene.2)),
        }
    });
    Ok(rows.collect())
}

/// A factor, the way of enlarging, `None` for the true depth, and what became of the depth.
type Case = ((f64, Option<Enlarging>), Spoiled);

fn cases() -> Vec<Case> {
    let enlarged = FACTORS
        .iter()
        .flat_map(|factor| WAYS.iter().map(move |way| (*factor, Some(way.0))));
    std::iter::once((1.0, None))
        .chain(enlarged)
        .flat_map(|case| Spoiled::ALL.map(|spoiled| (case, spoiled)))
        .collect()
}

fn mean(all: impl ExactSizeIterator<Item = Quality>) -> Quality {
    let count = all.len() as f64;
    let sum = all.fold(Quality::default(), |a, b| Quality {
        wrong: a.wrong + b.wrong,
        field: (a.field.0 + b.field.0, a.field.1 + b.field.1),
        displayed: (a.displayed.0 + b.displayed.0, a.displayed.1 + b.displayed.1),
    });
    let pair = |(a, b): (f64, f64)| (a / count, b / count);
    Quality {
        wrong: sum.wrong / count,
        field: pair(sum.field),
        displayed: pair(sum.displayed),
    }
}
