//! Converts frames of every format, size, stride and orientation up to the hologram stage, and runs one in sixteen
//! through a video session.
#![no_main]

use phasefront::Size;
use libfuzzer_sys::fuzz_target;
use phasefront::input::{
    Alignment, CameraFrame, Cameras, ColourFormat, ColourImage, ConfidenceFormat, DepthFormat, DepthImage, Intrinsics,
    Orientation, Plane, Rotation, YuvEncoding, YuvMatrix,
};
use phasefront_core::depth::stream::{DepthOptions, DepthStream};
use phasefront_core::frame::{ColourPlan, Past};
use phasefront::{Display, EncoderOptions, Encoding, Method, Result, SessionOptions, Sweep, VideoSession};
use std::num::NonZeroUsize;
use std::sync::OnceLock;
use std::time::Duration;

/// Reads numbers from the front of the input, and 0 after its end. The rest is the memory of the planes.
struct Numbers<'a>(&'a [u8]);

impl Numbers<'_> {
    fn byte(&mut self) -> usize {
        match self.0.split_first() {
            Some((first, rest)) => {
                self.0 = rest;
                usize::from(*first)
            }
            None => 0,
        }
    }

    /// Returns a size, mostly small, sometimes arbitrary.
    fn size(&mut self) -> usize {
        match self.byte() {
            255 => usize::MAX - self.byte(),
            254 => self.byte() << (self.byte() % 56),
            small => small % 40,
        }
    }

    /// Returns an arbitrary float, often an ordinary one.
    fn float(&mut self) -> f64 {
        match self.byte() % 4 {
            0 => f64::from_bits(
                std::array::from_fn::<u64, 8, _>(|_| self.byte() as u64)
                    .iter()
                    .fold(0, |a, b| a << 8 | b),
            ),
            _ => self.byte() as f64 / 4.0,
        }
    }

    fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.byte() % all.len()]
    }
}

fn session() -> &'static VideoSession {
    static SESSION: OnceLock<VideoSession> = OnceLock::new();
    SESSION.get_or_init(|| {
        let display = Display::default().with_size(Size { width: 12, height: 8 }).expect("a display");
        // The results are not checked, so the method is cheap.
        let sweep = Sweep {
            hidden_layers: 0,
            tile: 16,
            ..Sweep::of_planes(&display, 2)
        };
        let method = Method::Sweep(sweep);
        let mut options = SessionOptions::new(display, method);
        options.encoder = EncoderOptions::plain(Encoding::DoublePhase);
        options.threads = NonZeroUsize::new(1);
        VideoSession::new(options).expect("a session")
    })
}

fn frame<'a>(numbers: &mut Numbers<'a>) -> Result<CameraFrame<'a>> {
    let yuv = YuvEncoding {
        matrix: numbers.of(&[YuvMatrix::Bt601, YuvMatrix::Bt709]),
        video_range: numbers.of(&[false, true]),
    };
    let format = numbers.of(&[
        ColourFormat::Rgba,
        ColourFormat::Bgra,
        ColourFormat::Rgb,
        ColourFormat::Nv12(yuv),
        ColourFormat::Yuv420(yuv),
    ]);
    let (width, height) = (numbers.size(), numbers.size());
    let strides: Vec<_> = (0..numbers.byte() % 4)
        .map(|_| (numbers.size().wrapping_mul(4), numbers.size()))
        .collect();
    let depth_format = numbers.of(&[
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
    let (depth_width, depth_height) = (numbers.size(), numbers.size());
    let depth_strides = (numbers.size().wrapping_mul(4), numbers.size());
    let confidence = numbers.byte();
    let orientation = Orientation {
        rotation: numbers.of(&[
            Rotation::Upright,
            Rotation::Clockwise90,
            Rotation::Half,
            Rotation::Clockwise270,
        ]),
        mirrored: numbers.of(&[false, true]),
    };
    let cameras = (numbers.byte() % 3 == 0).then(|| {
        let mut camera = || Intrinsics {
            fx: numbers.float(),
            fy: numbers.float(),
            cx: numbers.float(),
            cy: numbers.float(),
        };
        let mut cameras = Cameras::concentric(camera(), camera());
        cameras.translation_m = [numbers.float(), numbers.float(), numbers.float()];
        cameras
    });
    let memory = numbers.0;
    let planes: Vec<_> = strides
        .iter()
        .map(|(row, pixel)| Plane::new(memory, *row, *pixel))
        .collect();
    let colour = ColourImage::new(format, Size { width, height }, &planes)?;
    let plane = Plane::new(memory, depth_strides.0, depth_strides.1);
    let mut depth = DepthImage::new(depth_format, Size { width: depth_width, height: depth_height }, plane)?;
    if confidence % 2 == 1 {
        let format = [ConfidenceFormat::U8, ConfidenceFormat::LowMediumHigh][confidence / 2 % 2];
        depth = depth.with_confidence(format, Size { width: depth_width, height: depth_height }, Plane::new(memory, depth_width, 1))?;
    }
    let mut frame = CameraFrame::new(1, colour, depth);
    frame.orientation = orientation;
    if let Some(cameras) = cameras {
        frame.alignment = Alignment::Cameras(cameras);
    }
    Ok(frame)
}

/// Sets up a pool of this thread only: handing over the work takes longer than the work itself.
fn alone() {
    static BUILT: OnceLock<()> = OnceLock::new();
    BUILT.get_or_init(|| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread();
        pool.build_global().expect("a pool");
    });
}

/// Converts the amplitudes and depth of a frame twice, the second time as its successor.
fn take_in(frame: &CameraFrame<'_>) -> Result<()> {
    const SIZE: Size = Size { width: 12, height: 8 };
    frame.check()?;
    let plan = ColourPlan::new(&frame.colour, frame.orientation, SIZE)?;
    let mut depths = DepthStream::new(DepthOptions::default(), SIZE)?;
    let (mut rgb, mut depth) = ([f32::NAN; 3 * SIZE.pixels()], [f32::NAN; SIZE.pixels()]);
    let elapsed = Duration::from_millis(33);
    for past in [None, Some(Past { scale: 1.0, elapsed })] {
        plan.convert(&frame.colour, &mut rgb, &mut plan.scratch())?;
        depths.next(frame, past, &rgb, &mut depth)?;
        assert!(rgb.iter().chain(&depth).all(|value| (0.0..=1.0).contains(value)));
    }
    Ok(())
}

fuzz_target!(|data: &[u8]| {
    alone();
    let made = frame(&mut Numbers(data)).and_then(|mut frame| {
        take_in(&frame)?;
        if data.len() % 16 == 0 {
            let session = session();
            session.reset();
            session.process(&frame)?;
            frame.timestamp_ns = 33_000_000;
            assert_eq!(session.process(&frame)?.levels().len(), 3 * 8 * 12);
        }
        Ok(())
    });
    if let Err(why) = made {
        assert!(!matches!(why, phasefront::Error::Internal(_)), "{why}");
    }
});
