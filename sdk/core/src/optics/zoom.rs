//! The Fourier transform at points of any spacing: the chirp z-transform (Rabiner, Schafer and Rader, 1969).

use crate::optics::fft::fast_size;
use num_complex::{Complex32, Complex64};
use phasefront_kernels::transforms;
use rustfft::Fft;
use std::f64::consts::PI;
use std::sync::Arc;

/// A plan for lines of one length N and one spacing a: X(m) = Σ x(n)·exp(−i2π·a·n·m), where n and m count from the
/// middle, −(N−1)/2 to (N−1)/2. The spacing 1/N is that of a discrete Fourier transform. The plan is immutable and can
/// be shared between threads.
pub struct Zoom {
    fft: [Arc<dyn Fft<f32>>; 2],
    /// exp(−iπ·a·n²).
    chirp: Vec<Complex32>,
    /// The spectrum of exp(iπ·a·k²) for all differences k = m − n, over the length of the transform.
    kernel: Vec<Complex32>,
}

impl Zoom {
    /// Plans lines of `length` values with `spacing`, in cycles per value.
    ///
    /// # Panics
    /// Panics if `length` is 0.
    pub fn new(length: usize, spacing: f64) -> Self {
        assert!(length > 0);
        let padded = fast_size(2 * length - 1);
        let fft = transforms(padded);
        // n·m = (n² + m² − (m − n)²)/2, so that the sum is a convolution.
        let chirp = |at: f64| narrow(Complex64::cis((PI * spacing * at * at).rem_euclid(2.0 * PI)));
        let middle = (length as f64 - 1.0) / 2.0;
        let mut kernel = vec![Complex32::ZERO; padded];
        for k in 0..length {
            let value = chirp(k as f64) / padded as f32;
            kernel[k] = value;
            kernel[(padded - k) % padded] = value;
        }
        fft[0].process(&mut kernel);
        Zoom {
            fft,
            chirp: (0..length).map(|n| chirp(n as f64 - middle).conj()).collect(),
            kernel,
        }
    }

    /// Returns working memory for one call at a time.
    pub fn work(&self) -> Vec<Complex32> {
        let work = self.fft.iter().map(|fft| fft.get_inplace_scratch_len()).max();
        vec![Complex32::ZERO; self.kernel.len() + work.unwrap_or(0)]
    }

    /// Transforms `line` in place.
    ///
    /// # Panics
    /// Panics if `line` has another length or `work` belongs to another plan.
    pub fn transform(&self, line: &mut [Complex32], work: &mut [Complex32]) {
        assert_eq!(line.len(), self.chirp.len());
        let (padded, work) = work.split_at_mut(self.kernel.len());
        padded.fill(Complex32::ZERO);
        for ((to, from), chirp) in padded.iter_mut().zip(&*line).zip(&self.chirp) {
            *to = from * chirp;
        }
        self.fft[0].process_with_scratch(padded, &mut work[..self.fft[0].get_inplace_scratch_len()]);
        for (value, kernel) in padded.iter_mut().zip(&self.kernel) {
            *value *= kernel;
        }
        self.fft[1].process_with_scratch(padded, &mut work[..self.fft[1].get_inplace_scratch_len()]);
        for ((to, from), chirp) in line.iter_mut().zip(&*padded).zip(&self.chirp) {
            *to = from * chirp;
        }
    }

    /// Applies the adjoint of [`Self::transform`], the sum with the other sign of the exponent, to `line` in place.
    ///
    /// # Panics
    /// Panics under the same conditions as [`Self::transform`].
    pub fn adjoint(&self, line: &mut [Complex32], work: &mut [Complex32]) {
        line.iter_mut().for_each(|value| *value = value.conj());
        self.transform(line, work);
        line.iter_mut().for_each(|value| *value = value.conj());
    }
}

fn narrow(value: Complex64) -> Complex32 {
    Complex32::new(value.re as f32, value.im as f32)
}
