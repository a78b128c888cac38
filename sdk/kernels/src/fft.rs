//! Fourier transforms of lines, by rustfft. They are compiled here once: a crate that calls the planner compiles all of
//! its transforms, and so would each of its tests.

use rustfft::Fft;
#[cfg(not(all(target_arch = "wasm32", target_os = "unknown")))]
use rustfft::FftPlanner as Planner;
#[cfg(all(target_arch = "wasm32", target_os = "unknown"))]
use rustfft::FftPlannerWasmSimd as Planner;
use std::sync::Arc;

/// Returns the forward and the inverse transform of `length` values, both without a factor.
pub fn transforms(length: usize) -> [Arc<dyn Fft<f32>>; 2] {
    // A browser's module names the planner with SIMD: the planner that chooses while it runs brings all transforms
    // without SIMD too, a tenth of the module.
    #[cfg(not(all(target_arch = "wasm32", target_os = "unknown")))]
    let mut planner = Planner::new();
    #[cfg(all(target_arch = "wasm32", target_os = "unknown"))]
    let mut planner = Planner::new().expect("rustfft has SIMD for f32");
    [planner.plan_fft_forward(length), planner.plan_fft_inverse(length)]
}
