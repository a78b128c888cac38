//! Tests a library without tract: its bundled networks run, and whatever would need tract fails with one line that says
//! so. `tests/features` builds it; with tract there is nothing to test here.
#![cfg(not(feature = "tract"))]
#![allow(clippy::unwrap_used)]

mod small_frame;

use phasefront_ffi::{
    DepthNetwork, Method, Network, PhasefrontError, RawSession, RunningMode, SessionOptions, Target, display_from_toml,
    session_options,
};
use small_frame::{H, W, process};
use std::fmt::Debug;
use std::sync::Arc;

fn options(network: Arc<Network>) -> SessionOptions {
    let display = display_from_toml(format!("width = {W}\nheight = {H}")).unwrap();
    let mut options = session_options(Target::of_display(display).unwrap(), Some(Method::Trained { network })).unwrap();
    options.threads = Some(1);
    options
}

/// Checks that an error is one line that names tract.
fn names_tract<T: Debug>(result: Result<T, PhasefrontError>) {
    let error = result.unwrap_err();
    assert!(matches!(error, PhasefrontError::Network(_)), "{error:?}");
    let line = error.to_string();
    assert!(
        line.contains("without its feature 'tract'") && !line.contains('\n'),
        "{line}"
    );
}

#[test]
fn bundled_networks_run() {
    for name in ["rgbd-8", "rgbd-15"] {
        let session = RawSession::new(options(Network::built_in(name).unwrap()), RunningMode::Image, None).unwrap();
        process(&session).unwrap();
    }
}

#[test]
fn a_network_that_the_kernels_do_not_take_is_refused() {
    // rgbd-8 with 5 of its 24 filters, a number that the kernels do not take.
    let onnx = include_bytes!("five-filters.onnx");
    names_tract(Network::from_bytes(onnx).and_then(|network| {
        RawSession::new(options(network), RunningMode::Image, None)?;
        Ok(())
    }));
}

#[test]
fn a_depth_network_is_refused() {
    names_tract(DepthNetwork::from_bytes(b"any", None, false));
}
