//! Simulated depth sensors, which judge how well the SDK treats depth as devices give it.
//!
//! A [`Sensor`] reads the true depth of a scene's front layer and gives a [`Reading`]: a depth image of its own
//! resolution. [`Reading::session_depth`] passes it through [`DepthStream`], as sessions do with a camera's frame.
//!
//! | sensor | resolution | what is wrong |
//! |---|---|---|
//! | `coarse-bilinear` (judge a) | 1/4 | mean of a cell; shift of 2 px right and down; noise 0.005 |
//! | `coarse-nearest` (judge b) | 1/4 | pixel in the middle of a cell; shift of 1 px right, 3 px up; noise 0.01 |
//! | `half-bilinear` (judge c) | 1/2 | mean of a cell; noise 0.003 |
//! | `noise` | 1 | noise 0.005 |
//! | `lidar` | 256 of 1024 | mean of a cell, noise that grows with distance, low confidence at edges ([`lidar`]) |
//! | `arcore` | 160 of 1024 | smooth over edges, error that grows with the square of distance ([`arcore`]) |
//! | `stereo` | 1 | steps of disparity, shadows beside near edges, near surfaces too wide ([`stereo`]) |
//! | `kinect` | 640 of 1024 | shadows, holes, steps of disparity, edges that are off by a reading ([`kinect`]) |
//! | `monocular` | 448 of 1024 | soft edges, unknown scale and offset, a smooth warp ([`monocular`]) |
//!
//! Noise is white, normal, and a fraction of the volume's depth per reading unless a sensor's module says otherwise.
//!
//! Scenes are much smaller than a device's frame. The resolution of a real sensor is therefore the one it has for a
//! frame that is [`FRAME_WIDTH`] pixels wide, of which the scene is a part. The width of its shadows, which depends on
//! what it sees, is that of a sensor that sees the whole scene and nothing else. Real sensors see normalized depth as
//! distances between [`NEAR_M`] and [`FAR_M`].
//!
//! The training package has its own model, `--sensor-depth`. It draws coarseness, shift, noise, holes and bleeding at
//! random for each scene and enlarges the depth itself, so its figures are not those of these sensors.
//!
//! Sensors do not depend on the machine: random numbers come from [`Dice`], other functions from `libm`.

pub mod arcore;
pub mod coarse;
pub mod kinect;
pub mod lidar;
pub mod monocular;
pub mod stereo;

use coarse::{Coarse, Sampling};
use ndarray::{Array2, Array3, ArrayView2};
use phasefront::Size;
use phasefront::input::{
    CameraFrame, ColourFormat, ColourImage, ConfidenceFormat, DepthFormat, DepthImage, DepthRange, Plane,
};
use phasefront_core::depth::stream::{DepthOptions, DepthStream};
use phasefront_io::Result;
use phasefront_io::dice::Dice;
use serde::{Deserialize, Serialize};

/// The width in pixels of the frame that a real sensor's resolution refers to.
pub const FRAME_WIDTH: f64 = 1024.0;
/// The distance at normalized depth 0, in metres: where the Kinect's default range begins.
pub const NEAR_M: f32 = 0.8;
/// The distance at normalized depth 1, in metres.
pub const FAR_M: f32 = 2.8;
/// The difference of depth, as a fraction of the volume, above which neighbours belong to two surfaces.
const EDGE: f32 = 0.1;

/// The simulated depth sensors of the [module](self).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Sensor {
    /// 4 times coarser, mixed depths at edges, shifted, noisy (judge a)
    CoarseBilinear,
    /// 4 times coarser, one pixel for each reading, shifted, noisier (judge b)
    CoarseNearest,
    /// 2 times coarser, mixed depths at edges, less noise (judge c)
    HalfBilinear,
    /// Full size, with white noise
    Noise,
    /// A phone's LiDAR, as ARKit gives it
    Lidar,
    /// Depth from motion, as ARCore gives it
    Arcore,
    /// A pair of infrared cameras
    Stereo,
    /// Structured light
    Kinect,
    /// A network that estimates depth from one picture
    Monocular,
}

impl Sensor {
    /// Reads the true `depth`, (H, W) in \[0, 1], of a scene. The same seed gives the same reading.
    pub fn read(self, depth: ArrayView2<'_, f32>, seed: u64) -> Reading {
        let dice = &mut Dice::new(seed);
        let coarse = |ratio, sampling, shift, noise| Coarse {
            ratio,
            sampling,
            shift,
            noise,
            holes: false,
        };
        match self {
            Sensor::CoarseBilinear => coarse(4.0, Sampling::Mean, [2, 2], 0.005).read(depth, seed),
            Sensor::CoarseNearest => coarse(4.0, Sampling::Nearest, [1, -3], 0.01).read(depth, seed),
            Sensor::HalfBilinear => coarse(2.0, Sampling::Mean, [0, 0], 0.003).read(depth, seed),
            Sensor::Noise => coarse(1.0, Sampling::Nearest, [0, 0], 0.005).read(depth, seed),
            Sensor::Lidar => lidar::read(depth, dice),
            Sensor::Arcore => arcore::read(depth, dice),
            Sensor::Stereo => stereo::read(depth, dice),
            Sensor::Kinect => kinect::read(depth, dice),
            Sensor::Monocular => monocular::read(depth, dice),
        }
    }
}

/// A depth image of a sensor's own resolution.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// Normalized depth, (h, w). NaN means no reading. Noise may take it out of \[0, 1].
    pub depth: Array2<f32>,
    /// Confidence, (h, w): 0 low, 1 medium, 2 high, as ARKit has it. `None` if the sensor gives none.
    pub confidence: Option<Array2<u8>>,
    /// Whether scale and offset of the depth are unknown.
    pub relative: bool,
}

impl Reading {
    /// Makes a reading without confidence on the scale of normalized depth.
    fn new(depth: Array2<f32>) -> Self {
        Reading {
            depth,
            confidence: None,
            relative: false,
        }
    }

    /// Returns the range of metres that a session is given for this reading: the distances at the ends of the volume,
    /// or percentiles for relative depth.
    pub fn range(&self) -> DepthRange {
        match self.relative {
            true => DepthRange::Percentiles,
            false => DepthRange::Fixed {
                near_m: NEAR_M,
                far_m: FAR_M,
            },
        }
    }

    /// Returns the images of this reading as a camera gives them, with the distances `near_m` and `far_m` at normalized
    /// depth 0 and 1.
    pub fn images(&self, near_m: f32, far_m: f32) -> Images {
        let metres = |d: &f32| near_m + d * (far_m - near_m);
        Images {
            size: Size::from_shape(self.depth.dim()),
            depth: self.depth.iter().flat_map(|d| metres(d).to_le_bytes()).collect(),
            confidence: self.confidence.as_ref().map(|map| map.iter().copied().collect()),
        }
    }

    /// Returns the normalized depth, (H, W), that a session makes of this reading and the amplitudes `rgb`, (3, H, W).
    ///
    /// # Errors
    /// Returns an error if no reading is confident enough.
    ///
    /// # Panics
    /// Panics if `rgb` does not have the standard memory layout.
    pub fn session_depth(&self, rgb: &Array3<f32>) -> Result<Array2<f32>> {
        let (_, height, width) = rgb.dim();
        let options = DepthOptions {
            range: self.range(),
            ..DepthOptions::default()
        };
        let images = self.images(NEAR_M, FAR_M);
        let colours = colour_bytes(rgb);
        let colour = ColourImage::new(
            ColourFormat::Rgb,
            Size { width, height },
            &[Plane::new(&colours, 3 * width, 3)],
        )?;
        let mut depth = Array2::zeros((height, width));
        DepthStream::new(options, Size { width, height })?.next(
            &CameraFrame::new(0, colour, images.depth()?),
            None,
            rgb.as_slice().expect("standard layout"),
            depth.as_slice_mut().expect("standard layout"),
        )?;
        Ok(depth)
    }
}

/// The bytes of a reading's images.
pub struct Images {
    size: Size,
    /// Metres in 32 bits.
    depth: Vec<u8>,
    confidence: Option<Vec<u8>>,
}

impl Images {
    /// Returns the depth image, with its confidence if the sensor gives one.
    ///
    /// # Errors
    /// Returns an error if the reading has no pixels.
    pub fn depth(&self) -> Result<DepthImage<'_>> {
        let w = self.size.width;
        let image = DepthImage::new(DepthFormat::MetresF32, self.size, Plane::new(&self.depth, 4 * w, 4))?;
        Ok(match &self.confidence {
            Some(map) => image.with_confidence(ConfidenceFormat::LowMediumHigh, self.size, Plane::new(map, w, 1))?,
            None => image,
        })
    }
}

/// Returns the amplitudes `rgb`, (3, H, W), as interleaved bytes.
pub fn colour_bytes(rgb: &Array3<f32>) -> Vec<u8> {
    let (_, height, width) = rgb.dim();
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (y, x)));
    pixels
        .flat_map(|(y, x)| [0, 1, 2].map(|c| (rgb[(c, y, x)].clamp(0.0, 1.0) * 255.0).round() as u8))
        .collect()
}

/// Returns the distance in metres at normalized depth `d`.
fn metres(d: f32) -> f32 {
    NEAR_M + d * (FAR_M - NEAR_M)
}

/// Returns the normalized depth at a distance in metres.
fn normalized(metres: f32) -> f32 {
    (metres - NEAR_M) / (FAR_M - NEAR_M)
}

/// Returns an approximately normal number of deviation 1: the sum of twelve uniform numbers.
fn normal(dice: &mut Dice) -> f32 {
    (0..12).map(|_| dice.unit()).sum::<f64>() as f32 - 6.0
}

/// Returns the shape of an image that is `ratio` times coarser than `shape`.
fn coarser(shape: (usize, usize), ratio: f64) -> (usize, usize) {
    let side = |n: usize| ((n as f64 / ratio).round() as usize).max(1);
    (side(shape.0), side(shape.1))
}

/// Returns the pixels of `depth` in the cell of reading (y, x) of an image of `shape`, row by row. Cells are a whole
/// number of pixels wide; if `shape` does not divide the pixels, some pixels belong to two cells.
fn cell<'a>(
    depth: ArrayView2<'a, f32>,
    shape: (usize, usize),
    (y, x): (usize, usize),
) -> impl Iterator<Item = f32> + 'a {
    let (height, width) = depth.dim();
    let (rows, columns) = (height.div_ceil(shape.0), width.div_ceil(shape.1));
    let place = |at: usize, part: usize, parts: usize, size: usize, count: usize| {
        let along = at as f64 + (part as f64 + 0.5) / parts as f64;
        ((along * size as f64 / count as f64) as usize).min(size - 1)
    };
    (0..rows * columns).map(move |i| {
        let row = place(y, i / columns, rows, height, shape.0);
        depth[(row, place(x, i % columns, columns, width, shape.1))]
    })
}

/// Returns the mean of each cell of an image of `shape`.
fn means(depth: ArrayView2<'_, f32>, shape: (usize, usize)) -> Array2<f32> {
    Array2::from_shape_fn(shape, |at| {
        let (sum, count) = cell(depth, shape, at).fold((0.0, 0), |(sum, count), d| (sum + d, count + 1));
        sum / count as f32
    })
}

/// Returns the pixel in the middle of each cell of an image of `shape`.
fn middles(depth: ArrayView2<'_, f32>, shape: (usize, usize)) -> Array2<f32> {
    let (height, width) = depth.dim();
    Array2::from_shape_fn(shape, |(y, x)| {
        depth[(
            (2 * y + 1) * height / (2 * shape.0),
            (2 * x + 1) * width / (2 * shape.1),
        )]
    })
}

/// Returns, for each place, the difference between the largest and the smallest value within `reach` steps along rows
/// and columns.
fn spread(plane: &Array2<f32>, reach: usize) -> Array2<f32> {
    let (height, width) = plane.dim();
    Array2::from_shape_fn((height, width), |(y, x)| {
        let rows = y.saturating_sub(reach)..(y + reach + 1).min(height);
        let columns = x.saturating_sub(reach)..(x + reach + 1).min(width);
        let (least, most) = rows
            .flat_map(|y| columns.clone().map(move |x| plane[(y, x)]))
            .fold((f32::MAX, f32::MIN), |(a, b), d| (a.min(d), b.max(d)));
        most - least
    })
}

/// Returns `plane` smoothed by a normal distribution of deviation `sigma` along rows and columns. Borders repeat.
fn smooth(plane: &Array2<f32>, sigma: f64) -> Array2<f32> {
    let reach = (3.0 * sigma).ceil() as isize;
    let weights: Vec<f32> = (-reach..=reach)
        .map(|i| libm::exp(-0.5 * (i as f64 / sigma) * (i as f64 / sigma)) as f32)
        .collect();
    let total: f32 = weights.iter().sum();
    let (height, width) = plane.dim();
    let near = |at: usize, tap: usize, size: usize| at.saturating_add(tap).saturating_sub(reach as usize).min(size - 1);
    let along = |plane: &Array2<f32>, down: bool| {
        Array2::from_shape_fn((height, width), |(y, x)| {
            let taps = weights.iter().enumerate().map(|(tap, weight)| {
                let at = if down {
                    (near(y, tap, height), x)
                } else {
                    (y, near(x, tap, width))
                };
                weight * plane[at]
            });
            taps.sum::<f32>() / total
        })
    };
    along(&along(plane, false), true)
}

/// Removes each reading beside an edge with probability `share`.
fn remove_at_edges(readings: &mut Array2<f32>, clean: &Array2<f32>, share: f64, dice: &mut Dice) {
    for (reading, spread) in readings.iter_mut().zip(&spread(clean, 1)) {
        if *spread > EDGE && dice.chance(share) {
            *reading = f32::NAN;
        }
    }
}

/// Removes the readings in one blob for every 4096 readings: surfaces that are too dark or too bright.
fn remove_blobs(readings: &mut Array2<f32>, dice: &mut Dice) {
    const READINGS_A_BLOB: usize = 4096;
    const RADIUS: f64 = 7.0;
    let (h, w) = readings.dim();
    for _ in 0..(h * w).div_ceil(READINGS_A_BLOB) {
        let (y0, x0) = (dice.range(0.0, h as f64), dice.range(0.0, w as f64));
        for ((y, x), value) in readings.indexed_iter_mut() {
            if (y as f64 - y0).hypot(x as f64 - x0) < RADIUS {
                *value = f32::NAN;
            }
        }
    }
}

/// Returns whether each place of one row is in the shadow of a nearer place to its right, for two views at a baseline
/// whose disparities, in places of this row, are `disparity`.
fn shadows(disparity: &[f32]) -> Vec<bool> {
    let mut least = f32::INFINITY;
    let mut hidden = vec![false; disparity.len()];
    for (x, d) in disparity.iter().enumerate().rev() {
        let seen_at = x as f32 - d;
        hidden[x] = seen_at > least;
        least = least.min(seen_at);
    }
    hidden
}

/// Returns the focal length in pixels of an image of `width` pixels over `degrees`.
fn focal_length(width: f64, degrees: f64) -> f32 {
    (0.5 * width / libm::tan(0.5 * degrees.to_radians())) as f32
}
