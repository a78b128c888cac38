//! Tests sessions end to end with the bundled network: formats, modes, invalid frames and reports.
use crate::camera;
use phasefront::Size;

use camera::{DEPTH_FORMATS, Scene, depth, frame, options, with_confidence};
use num_complex::Complex32;
use phasefront::input::{
    Alignment, CameraFrame, Cameras, ColourFormat, ColourImage, DepthFormat, Intrinsics, Orientation, Plane,
    RgbEncoding, Rotation,
};
use phasefront::output::{Layout, Output, Placement};
use phasefront::session::{DropReason, Event, Quality, QualityLevel, Thermal};
use phasefront::target::{Aberration, Response};
use phasefront::{
    Brightness, Display, EncoderOptions, Error, ImageSession, LiveSession, Method, SessionOptions, Sweep, Target,
    VideoSession,
};
use phasefront_core::optics::aperture::Opening;
use phasefront_core::view::refocus::Refocus;
use std::sync::mpsc;

const W: usize = 64;
const H: usize = 48;

fn image_session() -> ImageSession {
    ImageSession::new(options(Size { width: W, height: H })).unwrap()
}

#[test]
fn an_image_becomes_a_hologram_that_shows_it() {
    let session = image_session();
    session.warm_up().unwrap();
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let hologram = session.process(&frame(5, &scene, &metres)).unwrap();
    assert_eq!(
        (hologram.timestamp_ns(), hologram.size(), hologram.quality_level()),
        (Some(5), Size { width: W, height: H }, 0)
    );
    assert_eq!(hologram.levels().len(), 3 * H * W);
    assert_eq!(hologram.plane(2).unwrap(), &hologram.levels()[2 * H * W..]);
    assert!(hologram.plane(3).is_err());
    let (near, far) = hologram.range_m().unwrap();
    assert!((near - 1.0).abs() < 0.01 && (far - 3.0).abs() < 0.05, "{near} {far}");
    assert_eq!(hologram.valid_depth(), Some(1.0));
    // A tap on the square focuses near; a tap on the right end of the wall focuses far.
    let display = &hologram.target().display;
    assert!((hologram.z_at(0.3, 0.4) - display.z_of_depth(0.0)).abs() < 1e-4);
    assert!(hologram.z_at(0.99, 0.9) < display.z_of_depth(0.9));
    assert_eq!(hologram.z_at(-3.0, f64::NAN), hologram.z_at(0.0, 0.0));
    // The square is bright and yellow in the preview; the wall is not.
    let mut rgba = vec![0; 4 * 24 * 32];
    hologram
        .write_preview(
            hologram.z_at(0.3, 0.4),
            Size { width: 32, height: 24 },
            Layout::Rgba,
            &mut rgba,
            128,
        )
        .unwrap();
    let pixel = |x: usize, y: usize| &rgba[4 * (y * 32 + x)..][..4];
    let (square, wall) = (pixel(9, 9), pixel(25, 20));
    assert!(square[0] > 150 && square[2] < 130 && square[3] == 255, "{square:?}");
    assert!(wall[0] < 100, "{wall:?}");
    for (layout, row_stride, len) in [
        (Layout::Rgba, 128, 3071),
        (Layout::Rgba, 127, 3072),
        (Layout::Grey16, 128, 3072),
    ] {
        assert!(
            hologram
                .write_preview(
                    0.0,
                    Size { width: 32, height: 24 },
                    layout,
                    &mut rgba[..len],
                    row_stride
                )
                .is_err()
        );
    }
    let statistics = session.statistics();
    assert_eq!((statistics.submitted, statistics.processed), (1, 1));
    assert!(!statistics.backend.name.is_empty() && !statistics.backend.why.is_empty());
    assert!(hologram.times().total() > std::time::Duration::ZERO);
}

#[test]
fn every_depth_format_gives_the_same_hologram() {
    let session = image_session();
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let taps = [(0.3, 0.4), (0.1, 0.9), (0.5, 0.9), (0.9, 0.1)];
    let mut first: Option<Vec<f64>> = None;
    for format in DEPTH_FORMATS {
        let bytes = scene.depth_bytes(format);
        let frame = CameraFrame::new(1, scene.colour(), depth(&bytes, format, Size { width: W, height: H }));
        let hologram = session.process(&frame).unwrap();
        assert_eq!(hologram.range_m().is_some(), format.is_metric());
        let z: Vec<f64> = taps.map(|(x, y)| hologram.z_at(x, y)).to_vec();
        let first = first.get_or_insert_with(|| z.clone());
        for (a, b) in z.iter().zip(first) {
            assert!((a - *b).abs() < 1.5e-4, "{format:?}: {z:?}");
        }
    }
}

#[test]
fn frames_are_turned_upright_colour_and_depth_together() {
    let session = image_session();
    let scene = Scene::new(Size { width: W, height: H }, 4);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let upright = session.process(&frame(1, &scene, &metres)).unwrap();
    let turned = |values: &[u8], n: usize| -> Vec<u8> {
        // The image is upside down, so the last pixel comes first.
        values.chunks_exact(n).rev().flatten().copied().collect()
    };
    let (rgba, depth_bytes) = (turned(&scene.rgba, 4), turned(&metres, 4));
    let colour = ColourImage::new(
        ColourFormat::Rgba,
        Size { width: W, height: H },
        &[Plane::new(&rgba, 4 * W, 4)],
    )
    .unwrap()
    .with_encoding(RgbEncoding::Amplitude);
    let depth = depth(&depth_bytes, DepthFormat::MetresF32, Size { width: W, height: H });
    let mut half = CameraFrame::new(2, colour, depth);
    half.orientation = Orientation {
        rotation: Rotation::Half,
        mirrored: false,
    };
    assert_eq!(session.process(&half).unwrap().levels(), upright.levels());
}

#[test]
fn cameras_apart_are_aligned() {
    let session = image_session();
    let scene = Scene::new(Size { width: W, height: H }, 20);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let camera = Intrinsics {
        fx: 60.0,
        fy: 60.0,
        cx: 31.5,
        cy: 23.5,
    };
    let mut frame = frame(1, &scene, &metres);
    let mut cameras = Cameras::concentric(camera, camera);
    frame.alignment = Alignment::Cameras(cameras);
    let same = session.process(&frame).unwrap();
    assert!(same.z_at(0.4, 0.4) > 2.5e-3);
    // The colour camera is 0.2 m to the left, so it sees the square 12 pixels farther right.
    cameras.translation_m = [0.2, 0.0, 0.0];
    frame.alignment = Alignment::Cameras(cameras);
    let moved = session.process(&frame).unwrap();
    assert!(moved.z_at(0.65, 0.4) > 2.0e-3, "{}", moved.z_at(0.65, 0.4));
}

#[test]
fn a_display_of_ten_bits_gets_words() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let eight = image_session().process(&frame(1, &scene, &metres)).unwrap();
    let display = Display::from_toml("width = 64\nheight = 48\noffset_mm = 2\nbits = 10").unwrap();
    let target = Target::from(display);
    let method = options(Size { width: W, height: H }).quality_levels[0].method.clone();
    let mut options = SessionOptions::new(target.clone(), method);
    let session = ImageSession::new(options.clone()).unwrap();
    let ten = session.process(&frame(1, &scene, &metres)).unwrap();
    assert!(eight.words().is_none());
    let words = ten.words().unwrap();
    for ((word, upper), level) in words.iter().zip(ten.levels()).zip(eight.levels()) {
        assert_eq!(word >> 2, u16::from(*upper));
        // The words are the same phase, rounded to 10 bits instead of 8, around the circle.
        let apart = (i32::from(*word) - 4 * i32::from(*level)).rem_euclid(1024);
        assert!(apart <= 3 || apart >= 1021, "{word} {level}");
    }
    let output = Output::new(
        &target,
        Size { width: W, height: H },
        Placement::centred(Layout::Grey16),
    );
    let mut bytes = vec![0; 2 * W * H];
    output
        .unwrap()
        .write(ten.output_levels(), 1, &mut bytes, 2 * W)
        .unwrap();
    assert_eq!(u16::from_le_bytes([bytes[0], bytes[1]]), words[W * H] << 6);
    options.target.response = Response::lut([0; 256]);
    assert!(ImageSession::new(options).is_err());
}

/// Submits invalid frames to a session, each followed by a valid one.
struct Trial<'a> {
    session: VideoSession,
    scene: &'a Scene,
    metres: &'a [u8],
    timestamp: u64,
}

impl<'a> Trial<'a> {
    fn new(scene: &'a Scene, metres: &'a [u8]) -> Self {
        let mut trial = Trial {
            session: VideoSession::new(options(Size { width: W, height: H })).unwrap(),
            scene,
            metres,
            timestamp: 0,
        };
        trial.good();
        trial
    }

    /// Returns a valid timestamp.
    fn next(&self) -> u64 {
        self.timestamp + 50
    }

    fn good(&mut self) {
        self.timestamp += 100;
        let frame = frame(self.timestamp, self.scene, self.metres);
        self.session.process(&frame).unwrap();
    }

    /// Asserts that the frame called `name` is refused with one line that contains `word`, and that the next valid
    /// frame works.
    fn refuses(&mut self, name: &str, word: &str, frame: phasefront::Result<CameraFrame<'_>>) {
        let made = frame.and_then(|frame| self.session.process(&frame));
        let message = made.unwrap_err().to_string();
        assert!(message.contains(word), "{name}: {message}");
        assert!(!message.contains('\n'), "{name}: {message}");
        self.good();
    }
}

#[test]
fn bad_colour_is_named_and_harms_nothing() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let mut trial = Trial::new(&scene, &metres);
    let depth = depth(&metres, DepthFormat::MetresF32, Size { width: W, height: H });
    let short = "12288 bytes are too few";
    for (name, (w, h), (row, pixel), word) in [
        ("a row too few", (W, H + 1), (4 * W, 4), short),
        ("short rows", (W, H), (4 * W - 1, 4), "row stride of 255"),
        ("short pixels", (W, H), (4 * W, 3), "pixel stride of 3"),
        ("no pixels", (0, H), (4 * W, 4), "empty"),
        ("8K", (7680, 4320), (4 * W, 4), "too large"),
    ] {
        let plane = Plane::new(&scene.rgba, row, pixel);
        let colour = ColourImage::new(ColourFormat::Rgba, Size { width: w, height: h }, &[plane]);
        let at = trial.next();
        trial.refuses(name, word, colour.map(|c| CameraFrame::new(at, c, depth)));
    }
}

#[test]
fn bad_depth_is_named_and_harms_nothing() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let mut trial = Trial::new(&scene, &metres);
    let whole = depth(&metres, DepthFormat::MetresF32, Size { width: W, height: H });
    let metres_of = |bytes, h| Ok(depth(bytes, DepthFormat::MetresF32, Size { width: W, height: h }));
    let nan: Vec<u8> = f32::NAN.to_le_bytes().repeat(W * H);
    let zero = vec![0; 4 * W * H];
    let unsure = vec![10; W * H];
    for (name, depth, word) in [
        ("no number", metres_of(&nan, H), "no usable reading"),
        ("no distance", metres_of(&zero, H), "no usable reading"),
        ("half", metres_of(&zero, H / 2), "aspect ratios differ"),
        (
            "none sure",
            with_confidence(whole, &unsure, Size { width: W, height: H }),
            "confidence 0.25 or more",
        ),
        (
            "confidence of another size",
            with_confidence(
                whole,
                &unsure,
                Size {
                    width: W / 2,
                    height: H,
                },
            ),
            "confidence is 32×48",
        ),
    ] {
        let at = trial.next();
        let frame = depth.map(|depth| CameraFrame::new(at, scene.colour(), depth));
        trial.refuses(name, word, frame);
    }
}

/// Depth that says little of the scene gives a hologram all the same.
#[test]
fn unusual_depth_gives_a_hologram() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let black = Scene {
        rgba: [0, 0, 0, 255].repeat(W * H),
        ..Scene::new(Size { width: W, height: H }, 10)
    };
    let process = |colour: &Scene, metres: &[f32], (width, height): (usize, usize)| {
        let bytes: Vec<u8> = metres.iter().flat_map(|m| m.to_le_bytes()).collect();
        let depth = depth(&bytes, DepthFormat::MetresF32, Size { width, height });
        let frame = CameraFrame::new(1, colour.colour(), depth);
        image_session().process(&frame).unwrap()
    };
    let lies_near = |hologram: &phasefront::Hologram, x: f64| {
        let near = hologram.target().display.z_of_depth(0.0);
        (hologram.z_at(x, 0.4) - near).abs() < 1e-4
    };
    // One value lies in the middle of the volume, whatever it is.
    let [two, seven] = [2.0, 7.0].map(|m| process(&scene, &vec![m; W * H], (W, H)));
    assert_eq!(two.levels(), seven.levels());
    assert!((two.z_at(0.3, 0.4) - two.target().display.z_of_depth(0.5)).abs() < 1e-4);
    // What is no distance is a hole.
    let with = |bad: &[f32]| -> Vec<f32> {
        let metres = scene.metres.iter().enumerate();
        metres
            .map(|(i, m)| if i % 3 == 0 { bad[i / 3 % bad.len()] } else { *m })
            .collect()
    };
    let bad = [f32::INFINITY, f32::NEG_INFINITY, f32::NAN, -1.0, 0.0];
    let [holes, bad] = [&[f32::NAN][..], &bad].map(|bad| process(&scene, &with(bad), (W, H)));
    assert_eq!(holes.levels(), bad.levels());
    assert!((bad.valid_depth().unwrap() - 2.0 / 3.0).abs() < 1e-3 && lies_near(&bad, 0.3));
    // Twice the colour's size.
    let large = Scene::new(
        Size {
            width: 2 * W,
            height: 2 * H,
        },
        20,
    );
    let large = process(&scene, &large.metres, (2 * W, 2 * H));
    assert!(lies_near(&large, 0.3) && !lies_near(&large, 0.6));
    // No colour to find edges in, and none to show.
    let dark = process(&black, &scene.metres, (W, H));
    assert!(lies_near(&dark, 0.3) && !lies_near(&dark, 0.6));
    let mut rgba = vec![255; 4 * W * H];
    dark.write_preview(0.0, Size { width: W, height: H }, Layout::Rgba, &mut rgba, 4 * W)
        .unwrap();
    assert!(rgba.chunks_exact(4).all(|pixel| pixel[..3].iter().all(|v| *v < 8)));
    // A shift of 24 pixels, where 6 are searched, is not undone.
    let apart = process(&scene, &Scene::new(Size { width: W, height: H }, 34).metres, (W, H));
    assert!(!lies_near(&apart, 0.2) && lies_near(&apart, 0.62));
}

#[test]
fn bad_alignment_is_named_and_harms_nothing() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let mut trial = Trial::new(&scene, &metres);
    let flat = vec![0; W * H];
    let flat = depth(&flat, DepthFormat::NormalizedU8, Size { width: W, height: H });
    let whole = depth(&metres, DepthFormat::MetresF32, Size { width: W, height: H });
    for (name, fx, depth, word) in [
        ("no focal length", f64::NAN, whole, "intrinsics of colour"),
        ("depth without metres", 60.0, flat, "has no metres"),
    ] {
        let camera = Intrinsics {
            fx,
            fy: 60.0,
            cx: 0.0,
            cy: 0.0,
        };
        let mut frame = CameraFrame::new(trial.next(), scene.colour(), depth);
        frame.alignment = Alignment::Cameras(Cameras::concentric(camera, camera));
        trial.refuses(name, word, Ok(frame));
    }
}

#[test]
fn late_frames_are_named_and_counted() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let mut trial = Trial::new(&scene, &metres);
    let late = "timestamps must rise";
    trial.refuses("an old frame", late, Ok(frame(10, &scene, &metres)));
    let last = timestamp_of(&trial.session);
    trial.refuses("the last again", late, Ok(frame(last, &scene, &metres)));
    let statistics = trial.session.statistics();
    assert_eq!(statistics.pending, 0);
    // Two frames were late, and `timestamp_of` submitted the third.
    assert_eq!(statistics.refused, 3);
    assert_eq!(
        statistics.submitted,
        statistics.processed + statistics.failed + statistics.refused
    );
    trial.session.reset();
    let first = frame(1, &scene, &metres);
    trial.session.process(&first).unwrap();
}

/// Returns the last accepted timestamp, from the refusal of an old one.
fn timestamp_of(session: &VideoSession) -> u64 {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    match session.process(&frame(0, &scene, &metres)) {
        Err(Error::Timestamp { last_ns, .. }) => last_ns,
        other => panic!("{other:?}"),
    }
}

/// A reset or close does not wait for a frame that is no longer needed.
#[test]
fn a_frame_is_given_up_when_its_session_is_reset_or_closed() {
    let (height, width) = (480, 640);
    let scene = Scene::new(Size { width, height }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let session = VideoSession::new(options(Size { width, height })).unwrap();
    let first = session.process(&frame(1, &scene, &metres)).unwrap();
    // Repeats until the call hits a frame that is being computed.
    let met = |end: &(dyn Fn() + Sync)| {
        let processing = std::sync::atomic::AtomicBool::new(true);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while processing.load(std::sync::atomic::Ordering::Relaxed) {
                    end();
                    std::thread::sleep(std::time::Duration::from_millis(1));
                }
            });
            let why = (2..).find_map(|time| session.process(&frame(time, &scene, &metres)).err());
            processing.store(false, std::sync::atomic::Ordering::Relaxed);
            why.unwrap().to_string()
        })
    };
    let why = met(&|| session.reset());
    assert!(why.contains("given up"), "{why}");
    let s = session.statistics();
    assert_eq!((s.dropped.reset, s.failed, s.pending), (1, 0, 0));
    session.reset();
    let again = session.process(&frame(1, &scene, &metres)).unwrap();
    assert!(again.levels() == first.levels());
    // A session that is closed before a frame begins refuses the frame; in both cases nothing is pending.
    let why = met(&|| session.close());
    assert!(why.contains("given up") || why.contains("closed"), "{why}");
    let s = session.statistics();
    assert_eq!((s.dropped.closed + s.refused, s.failed, s.pending), (1, 0, 0));
}

#[test]
fn pause_and_close_are_kept_to() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let frame = |t| frame(t, &scene, &metres);
    let image = image_session();
    // Without a past, timestamps do not matter and equal frames give equal results.
    let (a, b) = (image.process(&frame(9)).unwrap(), image.process(&frame(3)).unwrap());
    assert_eq!(a.levels(), b.levels());
    image.pause();
    assert!(image.process(&frame(1)).unwrap_err().to_string().contains("paused"));
    image.resume();
    image.process(&frame(1)).unwrap();
    image.close();
    assert!(image.process(&frame(1)).unwrap_err().to_string().contains("closed"));
    assert_eq!(a.levels().len(), 3 * W * H);
    let live = LiveSession::new(options(Size { width: W, height: H }), |_| {}).unwrap();
    live.close();
    assert!(live.submit(&frame(1)).unwrap_err().to_string().contains("closed"));
    live.close();
}

/// A reset discards the past even if the first frame after it fails.
#[test]
fn a_reset_forgets_the_past_also_where_the_next_frame_fails() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let far = Scene {
        metres: scene.metres.iter().map(|m| 0.5 * m + 6.0).collect(),
        ..Scene::new(Size { width: W, height: H }, 10)
    };
    let far_metres = far.depth_bytes(DepthFormat::MetresF32);
    // Colour and depth do not match.
    let odd = |t| {
        CameraFrame::new(
            t,
            scene.colour(),
            depth(&metres, DepthFormat::MetresF32, Size { width: H, height: W }),
        )
    };
    let new = || VideoSession::new(options(Size { width: W, height: H })).unwrap();
    let alone = new().process(&frame(30, &far, &far_metres)).unwrap();
    let session = new();
    session.process(&frame(10, &scene, &metres)).unwrap();
    session.reset();
    assert!(session.process(&odd(20)).unwrap_err().to_string().contains("aspect"));
    let after = session.process(&frame(30, &far, &far_metres)).unwrap();
    assert_eq!((after.range_m(), after.scale()), (alone.range_m(), alone.scale()));
    assert!(after.levels() == alone.levels());
}

/// A replayed frame passes the same checks as a processed one.
#[test]
fn a_replay_is_refused_where_a_frame_is() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let session = VideoSession::new(options(Size { width: W, height: H })).unwrap();
    for scale in [f32::NAN, f32::INFINITY, 0.0, -1.0] {
        let refused = session.replay(&frame(1, &scene, &metres), scale);
        let message = refused.unwrap_err().to_string();
        assert!(message.contains("scale") && message.contains("positive"), "{message}");
    }
    session.pause();
    let paused = session.replay(&frame(1, &scene, &metres), 1.0);
    assert!(paused.unwrap_err().to_string().contains("paused"));
    session.resume();
    session.replay(&frame(2, &scene, &metres), 0.7).unwrap();
    let s = session.statistics();
    assert_eq!((s.submitted, s.processed, s.dropped.paused), (2, 1, 1));
    // A reset cancels it, as it cancels a frame.
    let session = VideoSession::new(options(Size {
        width: 640,
        height: 480,
    }))
    .unwrap();
    let large = Scene::new(
        Size {
            width: 640,
            height: 480,
        },
        10,
    );
    let metres = large.depth_bytes(DepthFormat::MetresF32);
    let replaying = std::sync::atomic::AtomicBool::new(true);
    let why = std::thread::scope(|scope| {
        scope.spawn(|| {
            while replaying.load(std::sync::atomic::Ordering::Relaxed) {
                session.reset();
                std::thread::yield_now();
            }
        });
        let why = (1..2000).find_map(|time| session.replay(&frame(time, &large, &metres), 1.0).err());
        replaying.store(false, std::sync::atomic::Ordering::Relaxed);
        why.map(|why| why.to_string())
    });
    assert!(why.as_ref().is_some_and(|why| why.contains("given up")), "{why:?}");
    let s = session.statistics();
    assert_eq!((s.dropped.reset, s.failed, s.pending), (1, 0, 0));
}

/// Returns the numbers of frames up to `last` that were processed, superseded and, for timestamp 7, dropped during a
/// pause.
fn burst(events: &mpsc::Receiver<Event>, last: u64) -> (u64, u64, u64) {
    let (mut done, mut superseded, mut paused) = (0, 0, 0);
    loop {
        match events.recv().unwrap() {
            Event::Processed(hologram) => {
                done += 1;
                if hologram.timestamp_ns() == Some(last) {
                    break;
                }
            }
            Event::Dropped {
                reason: DropReason::Superseded,
                ..
            } => superseded += 1,
            Event::Dropped {
                timestamp_ns: 7,
                reason: DropReason::Paused,
            } => paused += 1,
            other => panic!("{other:?}"),
        }
    }
    (done, superseded, paused)
}

#[test]
fn a_live_session_answers_or_drops_every_frame() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let nan: Vec<u8> = f32::NAN.to_le_bytes().repeat(W * H);
    let (sender, events) = mpsc::channel();
    let listener = move |event| sender.send(event).unwrap();
    let session = LiveSession::new(options(Size { width: W, height: H }), listener).unwrap();
    // If submitted one at a time, every frame is answered.
    for timestamp in 1..=5 {
        assert_eq!(session.submit(&frame(timestamp, &scene, &metres)).unwrap(), None);
        match events.recv().unwrap() {
            Event::Processed(hologram) => assert_eq!(hologram.timestamp_ns(), Some(timestamp)),
            other => panic!("{other:?}"),
        }
    }
    // A frame without depth fails, and the next one works.
    let blind = CameraFrame::new(
        6,
        scene.colour(),
        depth(&nan, DepthFormat::MetresF32, Size { width: W, height: H }),
    );
    session.submit(&blind).unwrap();
    match events.recv().unwrap() {
        Event::Failed { timestamp_ns: 6, error } => assert!(error.to_string().contains("no usable")),
        other => panic!("{other:?}"),
    }
    // Late frames are refused, and the next one works.
    for late in [6, 2] {
        match session.submit(&frame(late, &scene, &metres)) {
            Err(Error::Timestamp { given_ns, last_ns: 6 }) => assert_eq!(given_ns, late),
            other => panic!("{other:?}"),
        }
    }
    session.pause();
    let paused = session.submit(&frame(7, &scene, &metres)).unwrap();
    assert_eq!(paused, Some(DropReason::Paused));
    session.resume();
    // In a burst, the newest frame is answered, and it supersedes the others.
    let last = 100;
    for timestamp in 8..=last {
        session.submit(&frame(timestamp, &scene, &metres)).unwrap();
    }
    let (done, superseded, paused) = burst(&events, last);
    assert_eq!((done + superseded, paused), (93, 1));
    session.reset();
    session.submit(&frame(1, &scene, &metres)).unwrap();
    session.close();
    let statistics = session.statistics();
    assert_eq!(statistics.submitted, 5 + 1 + 2 + 1 + 93 + 1);
    assert_eq!((statistics.refused, statistics.failed, statistics.pending), (2, 1, 0));
    assert_eq!(statistics.dropped.superseded, superseded);
    let told: Vec<_> = events.try_iter().collect();
    assert!(
        matches!(
            told[..],
            [
                Event::Processed(_) | Event::Dropped { timestamp_ns: 1, .. },
                Event::Closed
            ]
        ),
        "the last frame is answered or dropped, once, and the end is told last: {told:?}"
    );
    assert_eq!(
        statistics.submitted,
        statistics.processed + statistics.failed + statistics.refused + statistics.dropped.total()
    );
}

#[test]
fn a_listener_may_panic_and_may_close() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let (sender, events) = mpsc::channel();
    let session = std::sync::Arc::new(std::sync::OnceLock::<LiveSession>::new());
    let listener = {
        let session = session.clone();
        move |event: Event| {
            let Event::Processed(hologram) = event else {
                return;
            };
            let session = session.get().unwrap();
            let timestamp = hologram.timestamp_ns().unwrap();
            sender.send(timestamp).unwrap();
            match timestamp {
                1 => panic!("at the first"),
                _ => session.close(),
            }
        }
    };
    let live = LiveSession::new(options(Size { width: W, height: H }), listener).unwrap();
    let live = session.get_or_init(|| live);
    live.submit(&frame(1, &scene, &metres)).unwrap();
    assert_eq!(events.recv().unwrap(), 1);
    live.submit(&frame(2, &scene, &metres)).unwrap();
    assert_eq!(events.recv().unwrap(), 2);
    live.close();
    assert_eq!(live.statistics().listener_panics, 1);
    assert_eq!(live.statistics().processed, 2);
}

/// Panics when it is dropped.
struct Bomb;

impl Drop for Bomb {
    fn drop(&mut self) {
        std::panic::resume_unwind(Box::new(Bomb));
    }
}

#[test]
fn a_listener_whose_panic_panics_again_hears_the_next_frame() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let (sender, events) = mpsc::channel();
    let listener = move |event| {
        sender.send(format!("{event:?}")).unwrap();
        // This avoids the hook's message on stderr.
        std::panic::resume_unwind(Box::new(Bomb));
    };
    let session = LiveSession::new(options(Size { width: W, height: H }), listener).unwrap();
    for timestamp in 1..=3 {
        session.submit(&frame(timestamp, &scene, &metres)).unwrap();
        let told = events.recv_timeout(std::time::Duration::from_secs(60)).unwrap();
        assert!(told.contains("Hologram"), "{told}");
    }
    session.close();
    assert_eq!(events.try_iter().collect::<Vec<_>>(), ["Closed"]);
    assert_eq!(session.statistics().listener_panics, 4);
}

/// Closing on the listener's thread does not wait, and the end is still reported after every drop.
#[test]
fn a_listener_that_closes_its_session_hears_the_end_last() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let (sender, events) = mpsc::channel();
    let session = std::sync::Arc::new(std::sync::OnceLock::<LiveSession>::new());
    let submitted = std::sync::Arc::new(std::sync::Barrier::new(2));
    let listener = {
        let (session, submitted) = (session.clone(), submitted.clone());
        move |event: Event| {
            if let Event::Processed(_) = event {
                submitted.wait();
                session.get().unwrap().close();
            }
            sender.send(event).unwrap();
        }
    };
    let live = LiveSession::new(options(Size { width: W, height: H }), listener).unwrap();
    let live = session.get_or_init(|| live);
    live.submit(&frame(1, &scene, &metres)).unwrap();
    // Wait until the first frame is a hologram; only then can the others be dropped.
    while live.statistics().processed == 0 {
        std::thread::yield_now();
    }
    (2..10).for_each(|t| _ = live.submit(&frame(t, &scene, &metres)).unwrap());
    submitted.wait();
    let long = std::time::Duration::from_secs(60);
    let told: Vec<_> = (0..10).map(|_| events.recv_timeout(long).unwrap()).collect();
    assert!(matches!(told[0], Event::Processed(_)), "{told:?}");
    assert!(
        told[1..9].iter().all(|event| matches!(event, Event::Dropped { .. })),
        "{told:?}"
    );
    assert!(matches!(told[9], Event::Closed), "{told:?}");
    assert!(events.try_recv().is_err());
}

#[test]
fn closing_while_a_frame_is_processed_leaves_none_pending() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    for _ in 0..20 {
        let session = image_session();
        let begun = std::sync::Barrier::new(3);
        std::thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| {
                    begun.wait();
                    while session.process(&frame(1, &scene, &metres)).is_ok() {}
                });
            }
            begun.wait();
            std::thread::yield_now();
            session.close();
            let statistics = session.statistics();
            assert_eq!(statistics.pending, 0);
            let known = statistics.processed + statistics.refused + statistics.dropped.closed;
            assert_eq!(statistics.submitted, known);
        });
        assert!(session.warm_up().unwrap_err().to_string().contains("closed"));
    }
}

#[test]
fn a_preview_beyond_any_screen_is_refused_before_it_is_planned() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let hologram = image_session().process(&frame(1, &scene, &metres)).unwrap();
    let mut rgba = vec![0; 4 << 15];
    let refused = hologram
        .write_preview(
            0.0,
            Size {
                width: 1 << 15,
                height: 1,
            },
            Layout::Rgba,
            &mut rgba,
            1 << 17,
        )
        .unwrap_err()
        .to_string();
    assert!(refused.contains("16384 pixels a side"), "{refused}");
}

#[test]
fn a_whole_view_is_what_the_levels_become_behind_the_aperture() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    for (offset_mm, bits) in [(0, 8), (3, 5), (1, 10)] {
        let text = format!("width = {W}\nheight = {H}\noffset_mm = {offset_mm}\nbits = {bits}");
        let display = Display::from_toml(&text).unwrap();
        let method = Method::Sweep(Sweep::for_display(&display));
        let session = ImageSession::new(SessionOptions::new(display.clone(), method)).unwrap();
        let hologram = session.process(&frame(1, &scene, &metres)).unwrap();
        let turn = std::f32::consts::TAU / (1 << bits) as f32;
        let light = |level: f32| Complex32::from_polar(hologram.scale(), turn * level);
        let shown: Vec<Complex32> = match hologram.words() {
            Some(words) => words.iter().map(|level| light(f32::from(*level))).collect(),
            None => hologram.levels().iter().map(|level| light(f32::from(*level))).collect(),
        };
        let opening = Opening::centred(display.aperture_radius());
        for z_m in [0.0, 1.5e-3, -2e-3] {
            let plan = Refocus::new(Size { width: W, height: H }, &display, &[z_m], Some(opening)).unwrap();
            let wanted = plan.focal_stack(&shown, &[z_m]).unwrap().remove(0);
            let (seen, field) = (hologram.refocus(z_m).unwrap(), hologram.field(z_m).unwrap());
            assert_eq!((seen.len(), field.len()), (3 * H * W, 3 * H * W));
            let error: f32 = seen.iter().zip(&wanted).map(|(a, b)| (a - b).powi(2)).sum();
            let power: f32 = wanted.iter().map(|a| a * a).sum();
            assert!((error / power).sqrt() < 1e-6, "{text} {z_m}: {error} of {power}");
            assert!(seen.iter().zip(&field).all(|(a, b)| *a == b.norm()));
        }
        let refused = |z_m: f64| hologram.refocus(z_m).unwrap_err().to_string();
        assert!(refused(f64::NAN).contains("must be finite"), "{}", refused(f64::NAN));
        assert!(refused(100.0).contains("a shorter distance"), "{}", refused(100.0));
    }
}

#[test]
fn a_whole_view_passes_the_optics_that_are_corrected() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let correction = Aberration::new([[0.6, 0.2, -0.1, 0.1, 0.05]; 3]).unwrap();
    let [plain, corrected] = [None, Some(correction)].map(|correction| {
        let target = Target {
            correction,
            ..Display::default()
                .with_size(Size { width: W, height: H })
                .unwrap()
                .into()
        };
        let method = Method::Sweep(Sweep::for_display(&target.display));
        let session = ImageSession::new(SessionOptions::new(target, method)).unwrap();
        session.process(&frame(1, &scene, &metres)).unwrap()
    });
    let [a, b] = [&plain, &corrected].map(|hologram| hologram.refocus(0.0).unwrap());
    let apart = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
    let power = apart(&a, &vec![0.0; a.len()]);
    assert_ne!(plain.levels(), corrected.levels());
    assert!(apart(&a, &b) < 0.02 * power, "{} of {power}", apart(&a, &b));
}

#[test]
fn options_that_cannot_be_meant_are_named() {
    let refuse = |change: &dyn Fn(&mut SessionOptions), word: &str| {
        let mut options = options(Size { width: W, height: H });
        change(&mut options);
        let refused = ImageSession::new(options).map(|_| ());
        let message = refused.unwrap_err().to_string();
        assert!(message.contains(word), "{word}: {message}");
    };
    refuse(&|o| o.quality_levels.clear(), "no quality levels");
    let many = |o: &mut SessionOptions| {
        o.quality_levels = vec![o.quality_levels[0].clone(); SessionOptions::MOST_QUALITY_LEVELS + 1]
    };
    refuse(&many, "17 quality levels are too many; 1 to 16 are right");
    refuse(&|o| o.quality = Quality::Fixed(1), "no quality level 1");
    refuse(&|o| o.quality_levels[0].size.width = W + 1, "quality level 0 is 65×48");
    refuse(&|o| o.target_rate_hz = Some(0.0), "target rate");
    refuse(
        &|o| o.threads = std::num::NonZeroUsize::new(70_000),
        "1 to 256 are right",
    );
    refuse(&|o| o.most_pixels = W * H - 1, "most_pixels allows 3071");
    let worse = |o: &mut SessionOptions| {
        let planes = Sweep {
            planes: 0,
            ..Sweep::for_display(&o.target.display)
        };
        o.quality_levels.push(QualityLevel {
            method: Method::Sweep(planes),
            ..o.quality_levels[0].clone()
        });
    };
    refuse(&worse, "quality level 1: sweep: 0 planes");
    let worse = |o: &mut SessionOptions| {
        o.quality_levels[0].encoder = Some(EncoderOptions {
            local_steps: 9,
            ..Default::default()
        });
    };
    refuse(&worse, "at most 8");
    refuse(&|o| o.encoder.brightness = Brightness::Fixed(0.0), "full light");
    refuse(&|o| o.depth.least_confidence = 2.0, "confidence");
    let session = image_session();
    assert!(session.set_quality(Quality::Fixed(7)).is_err());
    session.set_quality(Quality::Fixed(0)).unwrap();
    session.set_thermal(Thermal::Critical);
}
