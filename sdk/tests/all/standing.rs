//! Checks what sessions do with what stands still: it keeps its wave by default, and is computed anew by choice.
use crate::camera;

use camera::{Scene, frame};
use phasefront::input::{DepthFormat, DepthRange};
use phasefront::{Brightness, Display, ImageSession, Method, Network, SessionOptions, Size, Sweep, VideoSession};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SIZE: Size = Size { width: 193, height: 77 };

/// Returns options for the plane sweep, with nothing else that depends on the frames before.
fn options(keep_standing: bool) -> SessionOptions {
    let display = Display::default().with_size(SIZE).unwrap();
    let method = Method::Sweep(Sweep::for_display(&display));
    options_of(display, method, keep_standing)
}

fn options_of(display: Display, method: Method, keep_standing: bool) -> SessionOptions {
    let mut options = SessionOptions::new(display, method);
    options.keep_standing = keep_standing;
    options.encoder.brightness = Brightness::Fixed(1.0);
    options.depth.range = DepthRange::Fixed {
        near_m: 0.9,
        far_m: 3.1,
    };
    options
}

/// Returns the scene with the noise of a camera in colour.
fn noisy(at: usize, seed: u64) -> Scene {
    let random = &mut ChaCha8Rng::seed_from_u64(seed);
    let mut scene = Scene::new(SIZE, at);
    for value in &mut scene.rgba {
        *value = value.saturating_add_signed(random.random_range(-1..=1));
    }
    scene
}

fn levels(session: &VideoSession, time: u64, scene: &Scene) -> Vec<u8> {
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let hologram = session.process(&frame(1 + 33_000_000 * time, scene, &metres)).unwrap();
    hologram.levels().to_vec()
}

#[test]
fn a_camera_s_noise_stands_still_by_default_and_changes_levels_by_choice() {
    let display = Display::default().with_size(SIZE).unwrap();
    let network = Network::from_onnx(include_bytes!("../../../models/rgbd-8-int8.onnx")).unwrap();
    for method in [
        Method::Sweep(Sweep::for_display(&display)),
        Method::Network(network.into()),
    ] {
        let session = |keeps| VideoSession::new(options_of(display.clone(), method.clone(), keeps)).unwrap();
        check_noise(&session(true), &session(false));
    }
}

fn check_noise(keeping: &VideoSession, anew: &VideoSession) {
    let first = levels(keeping, 0, &noisy(40, 0));
    assert!(first == levels(anew, 0, &noisy(40, 0)));
    for time in 1..4 {
        let scene = noisy(40, time);
        assert!(levels(keeping, time, &scene) == first, "{time}");
        assert!(levels(anew, time, &scene) != first, "{time}");
    }
    // The square moves: where it was and where it is, the levels are those of the new frame.
    let moved = noisy(120, 9);
    let (kept, whole) = (levels(keeping, 4, &moved), levels(anew, 4, &moved));
    let differ = kept
        .iter()
        .zip(&whole)
        .filter(|(a, b)| a.abs_diff(**b).min(b.wrapping_sub(**a)) > 40)
        .count();
    assert!(kept != first && differ < kept.len() / 50, "{differ} of {}", kept.len());
    // After a pause nothing is kept.
    let later = noisy(120, 10);
    assert!(levels(keeping, 100, &later) == levels(anew, 100, &later));
}

#[test]
fn sessions_keep_by_default_and_single_images_keep_nothing() {
    assert!(SessionOptions::new(Display::default(), options(true).quality_levels[0].method.clone()).keep_standing);
    let session = ImageSession::new(options(true)).unwrap();
    let anew = VideoSession::new(options(false)).unwrap();
    for time in 0..2 {
        let scene = noisy(40, time);
        let metres = scene.depth_bytes(DepthFormat::MetresF32);
        let hologram = session.process(&frame(1, &scene, &metres)).unwrap();
        assert!(hologram.levels() == levels(&anew, 100 * time, &scene));
    }
}
