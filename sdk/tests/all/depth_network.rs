//! Tests frames without depth: their depth comes from a network, or from the app's own network as relative depth.
use crate::{camera, depth_models};
use phasefront::Size;

use camera::{Scene, depth, options};
use depth_models::{WEIGHTS, network};
use phasefront::input::{CameraFrame, ColourScale, DepthFormat, DepthNetwork};
use phasefront::session::Event;
use phasefront::{ImageSession, LiveSession, SessionOptions, VideoSession};
use std::collections::BTreeSet;
use std::sync::{Arc, mpsc};

const W: usize = 64;
const H: usize = 48;

/// Returns options with a network for pictures of `size`.
fn with_network(size: Size) -> SessionOptions {
    let Size { width, height } = size;
    let file = network(Some((height as i64, width as i64)), false);
    let mut network = DepthNetwork::from_onnx(&file).unwrap();
    network.colours = ColourScale::Unit;
    let mut options = options(Size { width: W, height: H });
    options.depth_network = Some(Arc::new(network));
    options
}

/// Returns the numbers that the network gives for `scene`.
fn relative(scene: &Scene) -> Vec<u8> {
    let pixels = scene.rgba.as_chunks::<4>().0.iter();
    let estimate = |pixel: &[u8; 4]| (0..3).map(|c| WEIGHTS[c] * f32::from(pixel[c]) / 255.0).sum::<f32>();
    pixels.flat_map(|pixel| estimate(pixel).to_le_bytes()).collect()
}

#[test]
fn a_network_in_the_session_equals_its_depth_handed_in() {
    let session = ImageSession::new(with_network(Size { width: W, height: H })).unwrap();
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let estimated = session.process(&CameraFrame::without_depth(1, scene.colour())).unwrap();
    assert_eq!((estimated.range_m(), estimated.valid_depth()), (None, Some(1.0)));
    let bytes = relative(&scene);
    let handed = CameraFrame::new(
        2,
        scene.colour(),
        depth(&bytes, DepthFormat::RelativeF32, Size { width: W, height: H }),
    );
    let handed = session.process(&handed).unwrap();
    let largest = (estimated.levels().iter().zip(handed.levels()))
        .map(|(a, b)| a.abs_diff(*b).min(b.wrapping_sub(*a)).min(a.wrapping_sub(*b)))
        .max();
    assert!(largest <= Some(1), "{largest:?}");
    // The square is less blue than the wall, so it is far.
    let display = &estimated.target().display;
    assert!((estimated.z_at(0.25, 0.4) - display.z_of_depth(1.0)).abs() < 1e-4);
    assert!(estimated.z_at(0.02, 0.9) > display.z_of_depth(0.2));
}

#[test]
fn frames_without_depth_need_a_network_that_runs() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let frame = CameraFrame::without_depth(1, scene.colour());
    let why = ImageSession::new(options(Size { width: W, height: H }))
        .unwrap()
        .process(&frame)
        .unwrap_err()
        .to_string();
    assert!(why.contains("no depth") && why.contains("a depth network"), "{why}");
    let mut numbers = with_network(Size { width: W, height: H });
    // Not a number for any colour.
    let mut file = network(Some((H as i64, W as i64)), false);
    let at = file
        .windows(4)
        .position(|bytes| bytes == WEIGHTS[2].to_le_bytes())
        .unwrap();
    file[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    numbers.depth_network = Some(Arc::new(DepthNetwork::from_onnx(&file).unwrap()));
    for _ in 0..2 {
        let why = VideoSession::new(numbers.clone())
            .unwrap()
            .process(&frame)
            .unwrap_err()
            .to_string();
        assert!(why.contains("not finite") && !why.contains('\n'), "{why}");
    }
    assert!(DepthNetwork::from_onnx(b"no network").is_err());
}

/// A live session answers each frame with the newest estimate; the first frame, and the first after a reset, with its
/// own.
#[test]
fn a_live_session_runs_the_network_at_its_own_rate() {
    let (sender, events) = mpsc::channel();
    let session = LiveSession::new(with_network(Size { width: W, height: H }), move |event| {
        let _ = sender.send(event);
    })
    .unwrap();
    let image = ImageSession::new(with_network(Size { width: W, height: H })).unwrap();
    let scenes: Vec<Scene> = [10, 30]
        .iter()
        .map(|at| Scene::new(Size { width: W, height: H }, *at))
        .collect();
    let next = || match events.recv().unwrap() {
        Event::Processed(hologram) => hologram,
        other => panic!("{other:?}"),
    };
    for (i, scene) in scenes.iter().enumerate() {
        session.reset();
        let frame = CameraFrame::without_depth(i as u64 + 1, scene.colour());
        session.submit(&frame).unwrap();
        assert_eq!(
            next().levels(),
            image.process(&frame).unwrap().levels(),
            "after reset {i}"
        );
    }
    // The square moves; after enough frames that stand still, the depth is that of the new place.
    session.reset();
    let place = |hologram: &phasefront::Hologram| (hologram.z_at(0.25, 0.4) * 1e6) as i64;
    let mut places = BTreeSet::new();
    for i in 0..400u64 {
        let scene = &scenes[usize::from(i > 0)];
        session
            .submit(&CameraFrame::without_depth(1 + i * 33_000_000, scene.colour()))
            .unwrap();
        places.insert(place(&next()));
        if i > 0 && places.len() > 1 {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    assert!(places.len() > 1, "{places:?}");
    session.close();
    assert!(matches!(events.iter().last(), Some(Event::Closed)));
}
