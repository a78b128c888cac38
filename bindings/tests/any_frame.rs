//! Passes frames of every format through the bindings, some valid, most invalid in one or more places. Each becomes a
//! hologram or is refused with a one-line error.
//!
//! `PHASEFRONT_FRAMES=1000000 cargo test --release --workspace --test any_frame` is the long run.
#![allow(clippy::unwrap_used)]

use phasefront_ffi::{
    Cameras, ColourFormat, ColourInfo, ConfidenceFormat, ConfidenceInfo, DepthFormat, DepthInfo, Encoding, FrameInfo,
    Intrinsics, Method, Orientation, PhasefrontError, PlaneInfo, Pose, RawSession, RgbEncoding, Rotation, RunningMode,
    Target, YuvMatrix, display_from_toml, session_options,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

struct Random(ChaCha8Rng);

impl Random {
    fn of<T: Clone>(&mut self, all: &[T]) -> T {
        all[self.0.random_range(0..all.len())].clone()
    }

    fn often(&mut self, share: f64) -> bool {
        self.0.random_bool(share)
    }

    /// Returns `right`, or occasionally a nearby or arbitrary number.
    fn number(&mut self, right: usize) -> usize {
        match self.0.random_range(0..60) {
            0 => self.0.random::<u32>() as usize,
            1 => self.of(&[0, u32::MAX as usize, 1 << 31, 1 << 16]),
            2 => right.wrapping_add(self.0.random_range(0..3)).wrapping_sub(1),
            _ => right,
        }
    }

    fn float(&mut self, right: f64) -> f64 {
        match self.0.random_range(0..20) {
            0 => f64::from_bits(self.0.random()),
            1 => self.of(&[0.0, -1.0, f64::NAN, f64::INFINITY, 1e300]),
            _ => right,
        }
    }

    fn floats(&mut self, right: &[f64]) -> Vec<f64> {
        let mut values: Vec<f64> = right.iter().map(|value| self.float(*value)).collect();
        if self.often(0.02) {
            values.pop();
        }
        values
    }

    fn plane(&mut self, width: usize, pixel: usize) -> PlaneInfo {
        let gap = self.of(&[0, 0, 1, 7]);
        PlaneInfo {
            row_stride: self.number(width * (pixel + gap) + gap),
            pixel_stride: self.number(pixel + gap),
        }
    }

    /// Returns about as many bytes as `plane` needs for `height` rows, at most the size of a test frame.
    fn memory(&mut self, plane: &PlaneInfo, height: usize) -> Vec<u8> {
        let needed = plane.row_stride.saturating_mul(height);
        let length = match self.0.random_range(0..20) {
            0 => needed.saturating_sub(1),
            1 => self.0.random_range(0..64),
            _ => needed,
        };
        let byte: u8 = self.0.random();
        (0..length.min(1 << 14))
            .map(|i| byte.wrapping_mul(i as u8 | 1))
            .collect()
    }
}

/// Returns two cameras a centimetre apart, or sometimes none.
fn cameras(random: &mut Random) -> Option<Cameras> {
    let camera = |random: &mut Random| Intrinsics {
        fx: random.float(20.0),
        fy: random.float(20.0),
        cx: random.float(10.0),
        cy: random.float(10.0),
    };
    random.often(0.3).then(|| Cameras {
        colour: camera(random),
        depth: camera(random),
        pose: random.often(0.5).then(|| Pose {
            rotation: random.floats(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
            translation_m: random.floats(&[0.01, 0.0, 0.0]),
        }),
    })
}

/// Returns a frame and the memory of its three planes, its depth and its confidence.
fn frame(random: &mut Random, timestamp_ns: i64) -> (FrameInfo, [Vec<u8>; 5]) {
    use ColourFormat::{Bgra, Nv12, Rgb, Rgba, Yuv420};
    let format = random.of(&[Rgba, Bgra, Rgb, Nv12, Yuv420]);
    let (width, height): (usize, usize) = (random.0.random_range(1..40), random.0.random_range(1..40));
    let half = (width.div_ceil(2), height.div_ceil(2));
    let sides: &[((usize, usize), usize)] = match format {
        Rgba | Bgra => &[((width, height), 4)],
        Rgb => &[((width, height), 3)],
        Nv12 => &[((width, height), 1), (half, 2)],
        Yuv420 => &[((width, height), 1), (half, 1), (half, 1)],
    };
    let mut planes: Vec<_> = (sides.iter())
        .map(|((width, _), pixel)| random.plane(*width, *pixel))
        .collect();
    let mut memory: [Vec<u8>; 5] = Default::default();
    for ((plane, ((_, height), _)), memory) in planes.iter().zip(sides).zip(&mut memory) {
        *memory = random.memory(plane, *height);
    }
    if random.often(0.02) {
        planes.push(planes[0]);
    }
    let depth_format = random.of(&[
        DepthFormat::MetresF32,
        DepthFormat::MetresF16,
        DepthFormat::DisparityF32,
        DepthFormat::DisparityF16,
        DepthFormat::MillimetresU16,
        DepthFormat::AndroidDepth16,
        DepthFormat::NormalizedU8,
        DepthFormat::NormalizedU16,
        DepthFormat::RelativeF32,
        DepthFormat::RelativeF16,
    ]);
    let pixel = match depth_format {
        DepthFormat::MetresF32 | DepthFormat::DisparityF32 | DepthFormat::RelativeF32 => 4,
        DepthFormat::NormalizedU8 => 1,
        _ => 2,
    };
    // The size is that of the colour, or half of it if that is an integer.
    let size = random.of(&[(width, height), (width, height), half]);
    let plane = random.plane(size.0, pixel);
    memory[3] = random.memory(&plane, size.1);
    let confidence = random.often(0.3).then(|| ConfidenceInfo {
        format: random.of(&[ConfidenceFormat::LowMediumHigh, ConfidenceFormat::U8]),
        width: random.number(size.0),
        height: random.number(size.1),
        plane: random.plane(size.0, 1),
    });
    if let Some(confidence) = &confidence {
        memory[4] = random.memory(&confidence.plane, size.1);
    }
    let info = FrameInfo {
        timestamp_ns,
        colour: ColourInfo {
            format,
            width: random.number(width),
            height: random.number(height),
            planes,
            matrix: random.of(&[YuvMatrix::Bt601, YuvMatrix::Bt709]),
            video_range: random.often(0.5),
            encoding: random.of(&RgbEncoding::ALL),
        },
        depth: Some(DepthInfo {
            format: depth_format,
            width: random.number(size.0),
            height: random.number(size.1),
            plane,
        }),
        confidence,
        orientation: Orientation {
            rotation: random.of(&[
                Rotation::Upright,
                Rotation::Clockwise90,
                Rotation::Half,
                Rotation::Clockwise270,
            ]),
            mirrored: random.often(0.5),
        },
        cameras: cameras(random),
    };
    (info, memory)
}

#[test]
fn any_frame_becomes_a_hologram_or_is_refused_in_one_line() {
    let frames: i64 = std::env::var("PHASEFRONT_FRAMES").map_or(10_000, |n| n.parse().unwrap());
    let display = display_from_toml("width = 12\nheight = 8\nvolume_depth_mm = 0.5".into()).unwrap();
    let target = Target::of_display(display).unwrap();
    let mut options = session_options(target, Some(Method::Sweep)).unwrap();
    options.encoding = Encoding::DoublePhase;
    (options.local_steps, options.dark_threshold, options.threads) = (Some(0), Some(0.0), Some(1));
    let session: Arc<RawSession> = RawSession::new(options, RunningMode::Video, None).unwrap();
    let random = &mut Random(ChaCha8Rng::seed_from_u64(1));
    let (mut made, mut refused) = (0, 0);
    for i in 1..=frames {
        let timestamp = if random.often(0.01) { 0 } else { i };
        let (info, [luma, chroma, chroma_v, depth, confidence]) = frame(random, timestamp);
        match session.process(&luma, &chroma, &chroma_v, &depth, &confidence, info.clone()) {
            Ok(hologram) => {
                assert_eq!(hologram.plane_len(), 12 * 8);
                made += 1;
            }
            Err(why) => {
                let line = why.to_string();
                let internal = matches!(why, PhasefrontError::Internal(_));
                assert!(
                    !internal && line.chars().count() < 600 && !line.contains('\n'),
                    "{line}: {info:?}"
                );
                refused += 1;
            }
        }
    }
    println!("{frames} frames: {made} holograms, {refused} refused");
    assert!(
        made > frames / 10 && refused > frames / 10,
        "{made} made, {refused} refused"
    );
}
