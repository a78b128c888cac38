//! Measurements of sessions as apps use them: camera frames with the depth of a sensor, through all stages.

use super::{Machine, forget_peak_memory, named, peak_memory_mb, scene};
use crate::frame_statistics::{FrameStatistics, rounded_ms};
use crate::gpu;
use ndarray::{Array2, ArrayView3};
use phasefront::input::{CameraFrame, ColourFormat, ColourImage, DepthFormat, DepthImage, Plane, RgbEncoding};
use phasefront::{SessionOptions, Size, VideoSession};
use phasefront_core::frame::Crop;
use phasefront_io::dice::Dice;
use phasefront_io::frame::fit::{Fit, Placement};
use phasefront_io::frame::{self, Captured, DepthOptions};
use phasefront_io::{Result, picture};
use serde::Serialize;
use std::path::Path;
use std::time::{Duration, Instant};

/// The size of the sensor's depth. Colour of another shape shows a part of it.
const SENSOR: Size = Size {
    width: 256,
    height: 192,
};

/// The largest error of the sensor, as a share of the distance.
const NOISE: f64 = 0.005;

/// The largest error of the camera, in levels of a byte.
const COLOUR_NOISE: usize = 3;

/// The distances of the near and the far end of normalized depth, in metres.
const RANGE_M: (f32, f32) = (0.5, 3.0);

/// The number of frames where no time is given.
const FRAMES: usize = 30;

/// What the camera does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Camera {
    /// It stands, as the scene does, so that only noise differs from frame to frame.
    Stands,
    /// It moves, so that every frame is computed whole.
    Moves,
}

/// A scene that stands still before a camera and a depth sensor.
#[derive(Debug, Clone)]
pub struct Scene {
    name: String,
    /// Rows of RGB bytes.
    colour: Vec<u8>,
    encoding: RgbEncoding,
    size: Size,
    /// The distances in metres, of [`Self::sensor`]; NaN where the sensor has no reading.
    depth_m: Vec<f32>,
    sensor: Size,
}

impl Scene {
    /// Returns the scenes that need no files, `balls` and `leaves`, as a camera of `size` sees them.
    ///
    /// # Errors
    /// Returns an error if the size is empty.
    pub fn made(size: Size) -> Result<Vec<Self>> {
        let made = [("balls", scene::balls(size)?), ("leaves", scene::leaves(size)?)];
        let scene = |(name, frame): (&str, phasefront::RgbdFrame)| {
            let depth = frame.depth().to_owned();
            Scene::new(
                name,
                frame.rgb(),
                RgbEncoding::Srgb,
                &depth,
                &Placement::as_is(size),
                RANGE_M,
            )
        };
        Ok(made.into_iter().map(scene).collect())
    }

    /// Reads a scene from a picture and its depth: the largest part of them that has the shape of `size`.
    ///
    /// # Errors
    /// Returns an error if a file cannot be read or the files do not match.
    pub fn read(rgb: &Path, depth: &Path, options: DepthOptions, size: Size) -> Result<Self> {
        let Captured {
            rgb: colours,
            encoding,
            depth,
            shown,
        } = frame::read(rgb, depth, options, None)?;
        let (_, height, width) = colours.dim();
        let placement = Placement::new(Size { width, height }, size, Fit::Cover);
        let range_m = shown.map_or(RANGE_M, |shown| (shown.near_m, shown.far_m));
        let name = rgb.file_name().unwrap_or_default().to_string_lossy();
        Ok(Scene::new(&name, colours.view(), encoding, &depth, &placement, range_m))
    }

    fn new(
        name: &str,
        rgb: ArrayView3<'_, f32>,
        encoding: RgbEncoding,
        depth: &Array2<f32>,
        placement: &Placement,
        (near_m, far_m): (f32, f32),
    ) -> Self {
        let (_, height, width) = rgb.dim();
        let size = placement.inner();
        let sensor = sensor_of(size);
        let Crop {
            x: left,
            y: top,
            width: columns,
            height: rows,
        } = placement.depth_crop(Size::from_shape(depth.dim()), Size { width, height });
        let reading = |(y, x): (usize, usize)| {
            let row = top + (y as f64 + 0.5) * rows / sensor.height as f64;
            let column = left + (x as f64 + 0.5) * columns / sensor.width as f64;
            near_m + (far_m - near_m) * depth[(row as usize, column as usize)]
        };
        Scene {
            name: name.to_owned(),
            colour: picture::amplitude_bytes(placement.colour(rgb).view()),
            encoding,
            size,
            depth_m: Array2::from_shape_fn(sensor.shape(), reading)
                .into_raw_vec_and_offset()
                .0,
            sensor,
        }
    }

    /// Returns what the sensor reads of the scene: little-endian f32, in metres.
    fn readings(&self, dice: &mut Dice) -> Vec<u8> {
        let mut noisy = |metres: &f32| metres * (1.0 + dice.range(-NOISE, NOISE) as f32);
        (self.depth_m.iter())
            .flat_map(|metres| noisy(metres).to_le_bytes())
            .collect()
    }

    /// Returns what the camera sees of the scene: rows of RGB bytes.
    fn colours(&self, dice: &mut Dice) -> Vec<u8> {
        let mut noisy = |byte: &u8| {
            let error = dice.integer(0, 2 * COLOUR_NOISE);
            (usize::from(*byte) + error).saturating_sub(COLOUR_NOISE).min(255) as u8
        };
        self.colour.iter().map(&mut noisy).collect()
    }

    /// Returns the camera's frame of these `colours` and `readings`.
    fn frame<'a>(&self, timestamp_ns: u64, colours: &'a [u8], readings: &'a [u8]) -> Result<CameraFrame<'a>> {
        let plane = Plane::new(colours, 3 * self.size.width, 3);
        let colour = ColourImage::new(ColourFormat::Rgb, self.size, &[plane])?.with_encoding(self.encoding);
        let plane = Plane::new(readings, 4 * self.sensor.width, 4);
        let depth = DepthImage::new(DepthFormat::MetresF32, self.sensor, plane)?;
        Ok(CameraFrame::new(timestamp_ns, colour, depth))
    }
}

/// Returns the size of the largest part of the sensor that has the shape of `colour`.
fn sensor_of(colour: Size) -> Size {
    let (w, h) = (colour.width as f64, colour.height as f64);
    let scale = (SENSOR.width as f64 / w).min(SENSOR.height as f64 / h);
    let side = |n: f64| ((n * scale).round() as usize).max(1);
    Size {
        width: side(w),
        height: side(h),
    }
}

/// The measurements of a session on one scene.
#[derive(Debug, Clone, Serialize)]
pub struct SessionRow {
    /// The name of the scene, or that of its picture's file.
    pub scene: String,
    /// What the camera does.
    pub camera: Camera,
    /// The method: `network`, `sweep`, `seeded` or `auto`.
    pub method: &'static str,
    /// The number of convolution layers; 0 without a network.
    pub layers: usize,
    /// The precision: `f32` or `int8` of a network, `int16` of the sweep.
    pub precision: String,
    /// The backend: an instruction set, `tract`, or a GPU's name.
    pub backend: String,
    /// The width in pixels.
    pub width: usize,
    /// The height in pixels.
    pub height: usize,
    /// The number of threads of the session.
    pub threads: usize,
    /// The time that the session takes to open and to warm up.
    pub start_ms: f64,
    /// The times of the frames.
    #[serde(flatten)]
    pub frames: FrameStatistics,
    /// The peak memory of this process in MB, if the system reports it.
    pub peak_memory_mb: Option<f64>,
}

/// Measures a session with `options` on `scene`: processes frames until `budget` is spent, at least five, or 30 without
/// a budget. The noise differs from frame to frame, and is the same in every run.
///
/// # Errors
/// Returns an error if the session cannot be opened or refuses the frames.
pub fn measure(
    mut options: SessionOptions,
    scene: &Scene,
    camera: Camera,
    budget: Option<Duration>,
) -> Result<SessionRow> {
    // The scene stands still. Before a camera that moves, a frame is to take as long as one in which all moves.
    options.keep_standing &= camera == Camera::Stands;
    forget_peak_memory();
    let (asked, threads) = (options.backend, options.threads);
    let (method, network) = named(&options.quality_levels[0].method);
    let layers = network.map_or(0, |network| network.layers());
    let precision = network.map_or("int16".to_owned(), |network| network.precision().to_string());
    let Size { width, height } = options.quality_levels[0].size;
    let start = Instant::now();
    let session = VideoSession::new(options)?;
    gpu::warm_up(session.handle(), asked)?;
    let start_ms = rounded_ms(start.elapsed());
    let mut dice = Dice::new(0);
    let mut times = Vec::new();
    let start = Instant::now();
    while match budget {
        Some(budget) => times.len() < 5 || start.elapsed() < budget,
        None => times.len() < FRAMES,
    } {
        let (colours, readings) = (scene.colours(&mut dice), scene.readings(&mut dice));
        let timestamp_ns = times.len() as u64 * 1_000_000_000 / 30;
        let frame = scene.frame(timestamp_ns, &colours, &readings)?;
        times.push(session.process(&frame)?.times());
    }
    Ok(SessionRow {
        scene: scene.name.clone(),
        camera,
        method,
        layers,
        precision,
        backend: session.statistics().backend.name,
        width,
        height,
        threads: threads.map_or_else(|| Machine::this().cores, usize::from),
        start_ms,
        frames: FrameStatistics::of(&times).expect("at least five frames"),
        peak_memory_mb: peak_memory_mb(),
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_sensor_shows_the_colours_part_and_noise_changes() {
        let size = |width, height| Size { width, height };
        assert_eq!(sensor_of(size(1920, 1080)), size(256, 144));
        assert_eq!(sensor_of(size(1600, 1200)), SENSOR);
        assert_eq!(sensor_of(size(1080, 1920)), size(108, 192));
        let scenes = Scene::made(size(64, 48)).unwrap();
        for scene in &scenes {
            assert_eq!(scene.colour.len(), 3 * 64 * 48);
            let metres = |readings: Vec<u8>| -> Vec<f32> {
                let values = readings.as_chunks::<4>().0.iter();
                values.map(|bytes| f32::from_le_bytes(*bytes)).collect()
            };
            let mut dice = Dice::new(0);
            let [one, other] = [0; 2].map(|_| scene.colours(&mut dice));
            assert_ne!(one, other);
            let is_near = |(byte, right): (&u8, &u8)| usize::from(byte.abs_diff(*right)) <= COLOUR_NOISE;
            assert!(one.iter().zip(&scene.colour).all(is_near));
            let [one, other] = [0; 2].map(|_| metres(scene.readings(&mut dice)));
            assert_ne!(one, other);
            let (near_m, far_m) = RANGE_M;
            for values in [&one, &other] {
                assert_eq!(values.len(), SENSOR.pixels());
                assert!(values.iter().all(|m| (0.99 * near_m..1.01 * far_m).contains(m)));
                let near = (values.iter().zip(&scene.depth_m)).all(|(m, right)| (m / right - 1.0).abs() < 0.0051);
                assert!(near);
            }
        }
    }
}
