//! Checks that the same frames give the same levels on every run and with any number of threads, for every method and
//! encoding.
use crate::camera;
use crate::network_models;
use phasefront::Size;

use camera::{Scene, frame};
use network_models::Model;
use phasefront::input::DepthFormat;
use phasefront::{Display, EncoderOptions, Encoding, Method, Network, SessionOptions, Sweep, VideoSession};
use std::num::NonZeroUsize;
use std::sync::Arc;

/// An odd size of more than one tile, so that tiles do not meet at powers of two.
const W: usize = 291;
const H: usize = 67;

fn network(model: &Model) -> Arc<Network> {
    Arc::new(Network::from_onnx(&model.bytes()).unwrap())
}

fn display() -> Display {
    Display::default()
        .with_size(Size { width: W, height: H })
        .unwrap()
        .with_offset_m(2e-3)
        .unwrap()
}

/// Returns the levels of three frames of a video with a moving object.
fn video(options: SessionOptions) -> Vec<u8> {
    let session = VideoSession::new(options).unwrap();
    let mut levels = Vec::new();
    for time in 0..3 {
        let scene = Scene::new(Size { width: W, height: H }, 40 + 9 * time);
        let metres = scene.depth_bytes(DepthFormat::MetresF32);
        let hologram = session
            .process(&frame(1 + 33_000_000 * time as u64, &scene, &metres))
            .unwrap();
        levels.extend_from_slice(hologram.levels());
    }
    levels
}

fn check(name: &str, options: &SessionOptions) {
    let mut first = None;
    for threads in [1, 2, 3, 7, 2] {
        let mut options = options.clone();
        options.threads = NonZeroUsize::new(threads);
        let levels = video(options);
        let first = first.get_or_insert_with(|| levels.clone());
        assert!(*first == levels, "{name} on {threads} threads");
    }
}

#[test]
fn every_method_gives_the_same_levels_on_any_number_of_threads() {
    let int8 = network(&Model::int8(8, 8));
    let sweep = Sweep::for_display(&display());
    let seeded = Model {
        inputs: 10,
        input: "seeded",
        ..Model::new(4, 8)
    };
    for (name, method) in [
        ("int8", Method::Network(int8.clone())),
        ("f32", Method::Network(network(&Model::new(6, 12)))),
        ("on tract", Method::Network(network(&Model::new(3, 5)))),
        ("sweep", Method::Sweep(sweep)),
        ("seeded", Method::Seeded(network(&seeded))),
        ("auto", Method::Auto(sweep, int8)),
    ] {
        check(name, &SessionOptions::new(display(), method));
    }
}

#[test]
fn one_laser_gives_the_same_levels_on_any_number_of_threads() {
    let display = Display::from_toml(&format!(
        "width = {W}\nheight = {H}\noffset_mm = 2\nwavelengths_nm = [532]"
    ))
    .unwrap();
    for (name, method) in [
        ("sweep", Method::Sweep(Sweep::for_display(&display))),
        ("int8", Method::Network(network(&Model::int8(8, 8)))),
    ] {
        let mut options = SessionOptions::new(display.clone(), method);
        options.encoder.midpoint_steps = 1;
        check(name, &options);
    }
}

#[test]
fn every_encoding_gives_the_same_levels_on_any_number_of_threads() {
    let method = Method::Network(network(&Model::int8(5, 8)));
    let midpoint = EncoderOptions {
        midpoint_steps: 2,
        ..EncoderOptions::default()
    };
    for (name, encoder) in [
        ("double phase", Encoding::DoublePhase.into()),
        ("anti-alias", Encoding::ANTI_ALIAS.into()),
        ("band limit", Encoding::BAND_LIMIT.into()),
        ("pre-filter", Encoding::Deep(network(&Model::prefilter("2"))).into()),
        ("midpoint steps", midpoint),
    ] {
        let mut options = SessionOptions::new(display(), method.clone());
        options.encoder = encoder;
        check(name, &options);
    }
}
