//! Filtering in the Fourier domain of a zero-padded plane.
//!
//! [`Fft2::convolve`] filters a plane in three sweeps through memory. Code that needs the spectrum itself, or several
//! filters of one plane, calls the passes separately: [`Fft2::rows_forward`], [`Fft2::columns`],
//! [`Fft2::rows_inverse`]. Neither way transforms rows or columns that hold only padding.
//!
//! The 1D transforms are rustfft's: any length, mixed radix. Transforms are unnormalized; the filter includes the
//! factor 1/(H·W).

mod convolve;
mod passes;
mod size;

use crate::Size;
use crate::parallel;
pub use convolve::ConvolveScratch;
pub use passes::{Scratch, Work};
pub use size::fast_size;

use phasefront_kernels::transforms;
use rustfft::Fft;
use std::sync::Arc;

/// The number of parts of a pass for each thread. More than one lets other threads take over the work of a delayed
/// thread.
const PARTS_PER_THREAD: usize = 4;

/// The transforms of an (H, W) frame inside a padded (H', W') plane. They are immutable and can be shared between
/// threads.
pub struct Fft2 {
    height: usize,
    width: usize,
    padded_height: usize,
    padded_width: usize,
    row: [Arc<dyn Fft<f32>>; 2],
    column: [Arc<dyn Fft<f32>>; 2],
}

/// Returns the frequency of value `k` of a transform of `n` values, in cycles per value, from −½ to ½.
pub fn frequency(k: usize, n: usize) -> f64 {
    let signed = if 2 * k < n { k as f64 } else { k as f64 - n as f64 };
    signed / n as f64
}

/// Returns the number of parts of a pass on the current thread pool.
fn parts() -> usize {
    match parallel::current_num_threads() {
        1 => 1,
        threads => threads * PARTS_PER_THREAD,
    }
}

impl Fft2 {
    /// Plans the transforms of a frame of `size` at the top left of a plane of `padded_size`.
    pub fn new(size: Size, padded_size: Size) -> Self {
        let Size { width, height } = size;
        let Size {
            width: padded_width,
            height: padded_height,
        } = padded_size;
        assert!(0 < height && height <= padded_height && 0 < width && width <= padded_width);
        Fft2 {
            height,
            width,
            padded_height,
            padded_width,
            row: transforms(padded_width),
            column: transforms(padded_height),
        }
    }

    /// Returns (H', W').
    pub fn padded_size(&self) -> Size {
        Size {
            width: self.padded_width,
            height: self.padded_height,
        }
    }

    /// Returns the number of scratch values of one 1D transform.
    fn work_values(&self) -> usize {
        (self.row.iter().chain(&self.column))
            .map(|fft| fft.get_inplace_scratch_len())
            .max()
            .unwrap_or(0)
            .max(1)
    }
}
