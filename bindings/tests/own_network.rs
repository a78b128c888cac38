//! Loads a network of its own form, as a user exports one, and makes a hologram with it.
#![cfg(feature = "tract")]
#![allow(clippy::unwrap_used)]

mod small_frame;

use phasefront_ffi::{Method, Network, RawSession, RunningMode, Target, display_from_toml, session_options};
use small_frame::{H, W, process};

#[test]
fn an_own_network_says_what_it_is_and_makes_holograms() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/own-network.onnx");
    let network = Network::from_file(path.to_owned()).unwrap();
    let info = network.info();
    assert_eq!((info.layers, info.filters, info.precision.as_str()), (1, 6, "own"));
    assert_eq!((info.pitch_um, info.volume_depth_mm), (8.0, 6.0));
    let display = display_from_toml(format!("width = {W}\nheight = {H}")).unwrap();
    let target = Target::of_display(display).unwrap();
    let options = session_options(target, Some(Method::Trained { network })).unwrap();
    let session = RawSession::new(options, RunningMode::Image, None).unwrap();
    // The file's weights turn the frame's grey of 180 and depth of 90 into these real and imaginary parts in blue,
    // whose amplitude is the largest.
    let (grey, depth) = (180.0 / 255.0, 90.0 / 255.0);
    let part = |own: f32| own * grey + 0.05 * (2.0 * grey + depth);
    let scale = process(&session).unwrap().info().scale;
    assert!((scale - part(0.7).hypot(part(1.0))).abs() < 0.01, "{scale}");
}
