//! A small view of a hologram, cheap enough for every frame: what an eye focused at z sees, as an RGBA image of a
//! screen's size. [`crate::refocus`] looks at all of it.
//!
//! The light of `factor` × `factor` modulator pixels is averaged into one, which keeps the middle of the Fourier plane
//! as the aperture does and takes the checkerboard of double phase away; the small field is then propagated.
//! Frequencies over 1/(2·`factor`) cycles a pixel are lost, so fine detail far from focus is blurred less than it would be.

use crate::display::Display;
use crate::error::{Error, Result};
use crate::frame::Axis;
use crate::slm::Response;
use crate::wave::asm::{Padding, Propagator};
use crate::wave::fft::Scratch;
use num_complex::Complex32;
use rayon::prelude::*;

/// A plan for one hologram shape, z and screen size. Immutable; shared between threads.
pub struct Preview {
    hologram: (usize, usize),
    small: (usize, usize),
    factor: usize,
    /// None where the hologram stands at z.
    propagators: Option<[Propagator; 3]>,
    screen: (usize, usize),
    x: Axis,
    y: Axis,
}

/// Working memory of a [`Preview`] for one call at a time.
pub struct PreviewScratch {
    field: Vec<Complex32>,
    amplitude: Vec<f32>,
    propagation: Option<Scratch>,
}

impl Preview {
    /// Plans views at `z_m` of (`height`, `width`) holograms for `display`, as images of `screen` (H, W).
    ///
    /// # Errors
    /// A hologram under 2 pixels a side, an empty screen, or a z that [`Propagator::new`] refuses.
    pub fn new(
        (height, width): (usize, usize),
        display: &Display,
        z_m: f64,
        screen: (usize, usize),
    ) -> Result<Self> {
        if height < 2 || width < 2 || screen.0 == 0 || screen.1 == 0 {
            return Err(Error::Plan(format!(
                "a preview of {}×{} of a hologram of {width}×{height}: the screen's sides must be at least 1, the hologram's 2",
                screen.1, screen.0
            )));
        }
        // Even, so that both colours of the checkerboard weigh alike.
        let ratio = (height as f64 / screen.0 as f64).min(width as f64 / screen.1 as f64);
        let factor = ((ratio / 2.0) as usize * 2).clamp(2, 8);
        let factor = factor.min(height.min(width) / 2 * 2);
        let small = (height / factor, width / factor);
        let distance_m = z_m - display.offset_m();
        let propagators = match distance_m {
            0.0 => None,
            _ => Some(Propagator::for_colours(
                small.0,
                small.1,
                display.pitch_m() * factor as f64,
                display.wavelengths_m(),
                distance_m,
                Padding::Reach,
            )?),
        };
        Ok(Preview {
            hologram: (height, width),
            small,
            factor,
            propagators,
            screen,
            x: Axis::new(small.1, 0.0, small.1 as f64, screen.1),
            y: Axis::new(small.0, 0.0, small.0 as f64, screen.0),
        })
    }

    /// Modulator pixels, along each side, whose light is averaged.
    pub fn factor(&self) -> usize {
        self.factor
    }

    /// (H, W) of the image.
    pub fn screen(&self) -> (usize, usize) {
        self.screen
    }

    /// Working memory for one call at a time, sized for the current thread pool.
    pub fn scratch(&self) -> PreviewScratch {
        let size = self.small.0 * self.small.1;
        PreviewScratch {
            field: vec![Complex32::ZERO; size],
            amplitude: vec![0.0; 3 * size],
            propagation: self.propagators.as_ref().map(|p| p[0].scratch()),
        }
    }

    /// The view of `levels`, (3, H, W), of a modulator that answers as `response` does, with full light standing for
    /// amplitude `scale`, into `rgba`: rows of red, green, blue, alpha 255; amplitude 1 is 255. Allocates nothing.
    ///
    /// # Panics
    /// If `levels` or `rgba` has another length than planned.
    pub fn look(
        &self,
        levels: &[u8],
        response: &Response,
        scale: f32,
        rgba: &mut [u8],
        scratch: &mut PreviewScratch,
    ) {
        let (height, width) = self.hologram;
        let (small_height, small_width) = self.small;
        let (screen_height, screen_width) = self.screen;
        assert_eq!(levels.len(), 3 * height * width);
        assert_eq!(rgba.len(), 4 * screen_height * screen_width);
        let factor = self.factor;
        let light = scale / (factor * factor) as f32;
        let shown: [Complex32; 256] =
            std::array::from_fn(|l| Complex32::from_polar(light, response.phase(l as u8)));
        let planes = levels.chunks_exact(height * width);
        let amplitudes = scratch
            .amplitude
            .chunks_exact_mut(small_height * small_width);
        for (colour, (levels, amplitude)) in planes.zip(amplitudes).enumerate() {
            (scratch.field.par_chunks_exact_mut(small_width))
                .zip(levels.par_chunks_exact(width * factor))
                .for_each(|(sums, rows)| {
                    sums.fill(Complex32::ZERO);
                    for row in rows.chunks_exact(width) {
                        for (sum, pixels) in sums.iter_mut().zip(row.chunks_exact(factor)) {
                            *sum += pixels.iter().map(|l| shown[*l as usize]).sum::<Complex32>();
                        }
                    }
                });
            if let (Some(plans), Some(scratch_wave)) = (&self.propagators, &mut scratch.propagation)
            {
                plans[colour].propagate(&mut scratch.field, scratch_wave);
            }
            for (amplitude, value) in amplitude.iter_mut().zip(&scratch.field) {
                *amplitude = value.norm();
            }
        }
        let amplitude = &scratch.amplitude;
        (rgba.par_chunks_exact_mut(4 * screen_width))
            .enumerate()
            .for_each(|(y, pixels)| {
                let byte = |colour: usize, x: usize| {
                    let plane = &amplitude[colour * small_height * small_width..];
                    let row = |(row, weight): (usize, f32)| {
                        let row = &plane[row * small_width..][..small_width];
                        weight * self.x.taps(x).map(|(at, w)| w * row[at]).sum::<f32>()
                    };
                    (self.y.taps(y).map(row).sum::<f32>() * 255.0 + 0.5) as u8
                };
                for (x, pixel) in pixels.as_chunks_mut::<4>().0.iter_mut().enumerate() {
                    *pixel = [byte(0, x), byte(1, x), byte(2, x), 255];
                }
            });
    }
}
