//! Reads ONNX files, plans them on the kernels and runs them on a small frame.
#![no_main]

use phasefront::Size;
use libfuzzer_sys::fuzz_target;
use num_complex::Complex32;
use phasefront::Network;
use phasefront_core::method::network::Source;

/// Planes of one value.
struct Flat;

impl Source for Flat {
    fn read(&self, plane: usize, _: usize, _: usize, into: &mut [f32]) {
        into.fill(plane as f32 / 16.0 - 0.4);
    }
}

fuzz_target!(|file: &[u8]| {
    match Network::from_onnx(file) {
        Err(why) => {
            let why = why.to_string();
            assert!(why.chars().count() < 700 && !why.contains(char::is_control), "{why}");
        }
        // Wide chains and graphs of other forms are valid but slow.
        Ok(network) if network.chain().is_none_or(|chain| chain.macs_per_pixel() > 200_000) => {}
        Ok(network) => {
            let (height, width) = (5, 7);
            if let Ok(plan) = network.plan(Size { width, height }) {
                let mut field = vec![Complex32::ZERO; 3 * height * width];
                let _ = plan.field(&Flat, &mut field, &mut plan.scratch());
            }
        }
    }
});
