//! Measures the flicker of video. A static scene with depth as noisy as a phone's, or read by a simulated sensor, runs
//! through a session frame by frame, and the study measures how much the displayed image changes between frames.

use crate::scene;
use crate::sensor::coarse::{Coarse, Sampling};
use crate::sensor::{FAR_M, Images, NEAR_M, Reading, Sensor, colour_bytes};
use phasefront::Size;
use phasefront::input::{CameraFrame, ColourFormat, ColourImage, DepthRange, Plane, RgbEncoding};
use phasefront::output::Layout;
use phasefront::session::AnsweringSession;
use phasefront::{Brightness, Display, EncoderOptions, ImageSession, Method, SessionOptions, VideoSession};
use phasefront_exact::truth::{visible_depth, visible_rgb};
use phasefront_io::ldi::Ldi;
use phasefront_io::{Error, Result};
use serde::Serialize;

/// The size of the depth sensor, which is ARKit's.
const SENSOR: Size = Size {
    width: 256,
    height: 192,
};
/// The size of the scenes.
pub const SIZE: Size = Size {
    width: 4 * SENSOR.width,
    height: 4 * SENSOR.height,
};
/// The sensor's faults: noise and missing readings, new in each frame.
const FAULTS: Coarse = Coarse {
    ratio: 4.0,
    sampling: Sampling::Mean,
    shift: [0, 0],
    noise: 0.01,
    holes: true,
};
/// The distances, in metres, at normalized depth 0 and 1 in random scenes.
const RANGE_M: (f32, f32) = (0.5, 2.5);
/// The frame rate.
const RATE_HZ: u64 = 30;

/// The smoothing of a session's frames and the correction of the displayed image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting {
    /// The name in tables.
    pub name: &'static str,
    /// Whether depth is smoothed over time, with the help of earlier frames.
    pub video: bool,
    /// Whether brightness is [`Brightness::Smoothed`]. Otherwise it is [`Brightness::FrameMax`].
    pub smoothed: bool,
    /// The dark threshold, as in [`EncoderOptions`].
    pub dark_threshold: f32,
    /// The local steps, as in [`EncoderOptions`].
    pub local_steps: usize,
    /// The midpoint steps, as in [`EncoderOptions`].
    pub midpoint_steps: usize,
}

/// The default setting: each frame is processed alone.
pub const ALONE: Setting = Setting {
    name: "each frame by itself",
    video: false,
    smoothed: false,
    dark_threshold: EncoderOptions::DARK_THRESHOLD,
    local_steps: 1,
    midpoint_steps: 0,
};

/// The setting of video sessions: depth and brightness smoothed.
pub const BOTH: Setting = Setting {
    name: "both",
    video: true,
    smoothed: true,
    ..ALONE
};

/// The settings: no smoothing, smoothing of depth, of brightness, and of both. Two more smooth both: without
/// correction, and with one midpoint step that starts from the previous frame.
pub const SETTINGS: [Setting; 6] = [
    ALONE,
    Setting {
        name: "depth smoothed",
        video: true,
        ..ALONE
    },
    Setting {
        name: "brightness smoothed",
        smoothed: true,
        ..ALONE
    },
    BOTH,
    Setting {
        name: "both, AA-DPM as published",
        dark_threshold: 0.0,
        local_steps: 0,
        ..BOTH
    },
    Setting {
        name: "both, 1 midpoint step",
        midpoint_steps: 1,
        ..BOTH
    },
];

/// The changes between frames, as root mean squares over the frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The name of the setting.
    pub setting: &'static str,
    /// The change of the image's mean brightness, as a fraction of that brightness.
    pub brightness: f64,
    /// The change of a pixel's amplitude. Full light is 1.
    pub pixel: f64,
}

/// A scene that does not move, and a reading of its depth for each frame.
pub struct Standing {
    /// The size of the frames.
    size: Size,
    /// The colours, interleaved.
    rgb: Vec<u8>,
    readings: Vec<Images>,
    range: DepthRange,
}

impl Standing {
    /// Makes `frames` frames of random scene `seed`, of [`SIZE`], with depth as noisy as a phone's. The session takes
    /// the range from percentiles.
    ///
    /// # Errors
    /// Returns an error if the scene cannot be rendered.
    pub fn random(seed: u64, frames: usize) -> Result<Self> {
        let random = scene::random_scene(seed, SIZE);
        let ldi = scene::render_ldi_reference(&random, SIZE, 1)?.quantized();
        let depth = visible_depth(&ldi);
        let read = |frame| FAULTS.read(depth.view(), seed + 1 + frame).images(RANGE_M.0, RANGE_M.1);
        Ok(Standing {
            size: SIZE,
            rgb: colour_bytes(&ldi.layers[0].rgb),
            readings: (0..frames as u64).map(read).collect(),
            range: DepthRange::Percentiles,
        })
    }

    /// Makes `frames` frames of the scene `ldi`, whose depth `sensor` reads anew for each frame, the first with `seed`.
    pub fn read_by(sensor: Sensor, ldi: &Ldi, seed: u64, frames: usize) -> Self {
        let depth = visible_depth(ldi);
        let readings: Vec<Reading> = (0..frames as u64)
            .map(|frame| sensor.read(depth.view(), seed + frame))
            .collect();
        Standing {
            size: Size::from_shape(depth.dim()),
            rgb: colour_bytes(&visible_rgb(ldi)),
            range: readings.first().map_or(DepthRange::Percentiles, Reading::range),
            readings: readings.iter().map(|reading| reading.images(NEAR_M, FAR_M)).collect(),
        }
    }
}

/// Runs the frames of `standing` through a session with each of `settings`, by `method`. The displayed image is viewed
/// at full light with the focus in the middle of the volume. `done` is called after each frame.
///
/// # Errors
/// Returns an error if there are fewer than two frames or the session fails.
pub fn study(
    standing: &Standing,
    settings: &[Setting],
    display: &Display,
    method: &Method,
    done: &dyn Fn(),
) -> Result<Vec<Row>> {
    let frames = standing.readings.len();
    if frames < 2 {
        return Err(Error::Input(
            "a change from frame to frame needs at least two frames".into(),
        ));
    }
    let Size { width, height } = standing.size;
    (settings.iter())
        .map(|setting| {
            let session = setting.session(display, method, standing.range)?;
            let mut seen: Vec<Vec<f32>> = Vec::with_capacity(frames);
            for (frame, images) in standing.readings.iter().enumerate() {
                let colour = Plane::new(&standing.rgb, 3 * width, 3);
                let colour = ColourImage::new(ColourFormat::Rgb, standing.size, &[colour])?;
                let colour = colour.with_encoding(RgbEncoding::Amplitude);
                let timestamp = (1 + frame as u64) * 1_000_000_000 / RATE_HZ;
                let hologram = session.process(&CameraFrame::new(timestamp, colour, images.depth()?))?;
                let (height, width) = (height / 2, width / 2);
                let mut rgba = vec![0; 4 * height * width];
                hologram.write_preview(0.0, Size { width, height }, Layout::Rgba, &mut rgba, 4 * width)?;
                // The preview undoes the scale, but the eye sees the light, which is the amplitude divided by the
                // scale.
                let light = |byte: &u8| f32::from(*byte) / 255.0 / hologram.scale();
                let colours = rgba.chunks_exact(4).flat_map(|pixel| &pixel[..3]);
                seen.push(colours.map(light).collect());
                done();
            }
            Ok(changes(setting.name, &seen))
        })
        .collect()
}

impl Setting {
    /// Opens a session with this setting.
    fn session(&self, display: &Display, method: &Method, range: DepthRange) -> Result<AnsweringSession> {
        let mut options = SessionOptions::new(display, method.clone());
        options.depth.range = range;
        options.encoder = EncoderOptions {
            dark_threshold: self.dark_threshold,
            local_steps: self.local_steps,
            midpoint_steps: self.midpoint_steps,
            brightness: match self.smoothed {
                true => Brightness::Smoothed,
                false => Brightness::FrameMax,
            },
            ..options.encoder
        };
        Ok(if self.video {
            VideoSession::new(options)?.into()
        } else {
            ImageSession::new(options)?.into()
        })
    }
}

fn changes(setting: &'static str, seen: &[Vec<f32>]) -> Row {
    let mean = |frame: &[f32]| frame.iter().map(|v| f64::from(*v)).sum::<f64>() / frame.len() as f64;
    let means: Vec<f64> = seen.iter().map(|frame| mean(frame)).collect();
    let overall = means.iter().sum::<f64>() / means.len() as f64;
    let steps = (means.len() - 1) as f64;
    let brightness = means.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum::<f64>();
    let pixel = (seen.windows(2)).map(|pair| {
        let squares = pair[0].iter().zip(&pair[1]).map(|(a, b)| f64::from(b - a).powi(2));
        squares.sum::<f64>() / pair[0].len() as f64
    });
    Row {
        setting,
        brightness: (brightness / steps).sqrt() / overall,
        pixel: (pixel.sum::<f64>() / steps).sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_root_mean_squares() {
        let row = changes("", &[vec![1.0, 3.0], vec![2.0, 4.0], vec![2.0, 4.0]]);
        assert!((row.pixel - (0.5f64).sqrt()).abs() < 1e-9);
        assert!((row.brightness - (0.5f64).sqrt() / (8.0 / 3.0)).abs() < 1e-9);
    }
}
