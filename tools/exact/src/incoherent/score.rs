//! How near the views of a hologram come to what incoherent light shows, in focus and out of focus.

use super::{Pupil, stack};
use ndarray::{Array2, Array3, s};
use phasefront::Display;
use phasefront_core::optics::metrics;
use phasefront_io::Result;
use phasefront_io::ldi::Ldi;
use serde::Serialize;

/// The depths of focus of the figures, one in the middle of each part of the volume.
const DEPTHS: usize = 6;
/// The largest blur in pixels of what counts as in focus, and the smallest of what counts as out of focus.
const IN_FOCUS: f64 = 2.0;
const OUT_OF_FOCUS: f64 = 6.0;

/// The similarity of views to what incoherent light shows, over all depths of focus together and after one common
/// scale. The blur of a pixel is what the display's whole aperture makes of its visible surface.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Natural {
    /// The PSNR of the amplitude over all pixels, in dB.
    pub psnr: f64,
    /// That of pixels with a blur below 2 pixels. `None` if there are none.
    pub in_focus_psnr: Option<f64>,
    /// That of pixels with a blur above 6 pixels. `None` if there are none.
    pub out_of_focus_psnr: Option<f64>,
    /// The mean SSIM of the amplitudes.
    pub ssim: f64,
}

impl Natural {
    /// Returns the mean of each figure over scenes. One that some scenes lack is the mean over the others.
    pub fn mean(scenes: impl Iterator<Item = Natural> + Clone) -> Self {
        let mean = |figure: fn(Natural) -> Option<f64>| {
            let (sum, count) = scenes
                .clone()
                .filter_map(figure)
                .fold((0.0, 0), |(sum, n), f| (sum + f, n + 1));
            (count > 0).then(|| sum / f64::from(count))
        };
        Natural {
            psnr: mean(|f| Some(f.psnr)).unwrap_or(f64::NAN),
            in_focus_psnr: mean(|f| f.in_focus_psnr),
            out_of_focus_psnr: mean(|f| f.out_of_focus_psnr),
            ssim: mean(|f| Some(f.ssim)).unwrap_or(f64::NAN),
        }
    }
}

/// What incoherent light shows of a scene at the judged depths of focus.
pub struct Judge {
    /// The depths of focus, z in metres.
    z_m: Vec<f64>,
    /// The amplitudes, (C, H, W), at each.
    truth: Vec<Array3<f32>>,
    /// The blur in pixels of each colour's pixels at each depth of focus.
    blur: Vec<Array3<f32>>,
}

impl Judge {
    /// Returns z, in metres, of the focal planes at which a hologram for `display` is compared.
    pub fn z_m(display: &Display) -> Vec<f64> {
        let depth = |i: usize| (i as f64 + 0.5) / DEPTHS as f64;
        (0..DEPTHS).map(|i| display.z_of_depth(depth(i))).collect()
    }

    /// Computes what `pupil` shows of `ldi`.
    ///
    /// # Errors
    /// Returns an error if the pupil passes nothing.
    pub fn of(ldi: &Ldi, display: &Display, pupil: Pupil) -> Result<Self> {
        let z_m = Self::z_m(display);
        let front: &Array2<f32> = &ldi.layers[0].depth;
        let blur = |z_m: &f64| {
            Array3::from_shape_fn((display.colours(), front.nrows(), front.ncols()), |(c, y, x)| {
                let depth = Some(front[(y, x)]).filter(|d| !d.is_nan()).unwrap_or(1.0);
                let sine = display.aperture_radius() * display.wavelengths_m()[c] / (2.0 * display.pitch_m());
                ((z_m - display.z_of_depth(f64::from(depth))).abs() * sine / display.pitch_m()) as f32
            })
        };
        Ok(Judge {
            truth: stack(ldi, display, pupil, &z_m)?,
            blur: z_m.iter().map(blur).collect(),
            z_m,
        })
    }

    /// Returns z, in metres, of the depths of focus, and what incoherent light shows at each: amplitudes, (C, H, W).
    pub fn shown(&self) -> (&[f64], &[Array3<f32>]) {
        (&self.z_m, &self.truth)
    }

    /// Judges `views`, amplitudes (C, H, W) at each of [`Self::z_m`]. `margin` pixels at the border do not count.
    ///
    /// # Errors
    /// Returns an error if the views differ in shape from the scene.
    pub fn judge(&self, views: &[Array3<f32>], margin: usize) -> Result<Natural> {
        let (_, height, width) = self.truth[0].dim();
        let inner = s![.., margin..height - margin, margin..width - margin];
        let pairs = || {
            views
                .iter()
                .zip(&self.truth)
                .map(|(a, b)| (a.slice(inner), b.slice(inner)))
        };
        let products = |a: f32, b: f32| f64::from(a) * f64::from(b);
        let (mut of_both, mut of_views) = (0.0, 0.0);
        for (view, truth) in pairs() {
            of_both += view.iter().zip(&truth).map(|(a, b)| products(*a, *b)).sum::<f64>();
            of_views += view.iter().map(|a| products(*a, *a)).sum::<f64>();
        }
        let scale = if of_views > 0.0 {
            (of_both / of_views) as f32
        } else {
            1.0
        };
        let (mut sums, mut ssim) = ([(0.0, 0usize); 3], 0.0);
        for ((view, truth), blur) in pairs().zip(&self.blur) {
            let view = view.mapv(|a| a * scale);
            ssim += metrics::compare(view.view(), truth)?.ssim_overall / self.z_m.len() as f64;
            for ((a, b), blur) in view.iter().zip(&truth).zip(blur.slice(inner)) {
                let square = f64::from(a - b).powi(2);
                let blur = f64::from(*blur);
                for ((sum, count), counts) in sums.iter_mut().zip([true, blur < IN_FOCUS, blur > OUT_OF_FOCUS]) {
                    *sum += if counts { square } else { 0.0 };
                    *count += usize::from(counts);
                }
            }
        }
        let [all, sharp, blurred] = sums.map(|(sum, count)| (count > 0).then(|| -10.0 * (sum / count as f64).log10()));
        Ok(Natural {
            psnr: all.unwrap_or(f64::NAN),
            in_focus_psnr: sharp,
            out_of_focus_psnr: blurred,
            ssim,
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use phasefront_io::ldi::LdiLayer;

    fn scene() -> Ldi {
        let layer = LdiLayer {
            rgb: Array3::from_shape_fn((3, 40, 40), |(c, y, x)| ((7 * y + 3 * x + c) % 11) as f32 / 10.0),
            depth: Array2::from_shape_fn((40, 40), |(_, x)| if x < 20 { 0.05 } else { 0.95 }),
        };
        Ldi::new(vec![layer]).unwrap()
    }

    #[test]
    fn the_truth_is_perfect_whatever_its_brightness() {
        let display = Display::default();
        let judged = Judge::of(&scene(), &display, Pupil::of_aperture(&display)).unwrap();
        let dimmed: Vec<_> = judged.truth.iter().map(|view| view * 0.3).collect();
        let figures = judged.judge(&dimmed, 2).unwrap();
        assert!(figures.psnr > 100.0 && figures.ssim > 0.9999, "{figures:?}");
    }

    #[test]
    fn an_error_counts_where_its_pixels_are_sharp_or_blurred() {
        let display = Display::default();
        let judged = Judge::of(&scene(), &display, Pupil::of_aperture(&display)).unwrap();
        // The left half is near. Its blur at the first depth of focus is below 2 pixels, and above 6 at the last.
        let with_error = |at: usize| {
            let mut views = judged.truth.clone();
            let mut left = views[at].slice_mut(s![.., .., ..20]);
            left += 0.1;
            judged.judge(&views, 0).unwrap()
        };
        let (near, far) = (with_error(0), with_error(5));
        assert!(
            near.in_focus_psnr.unwrap() < 30.0 && near.out_of_focus_psnr.unwrap() > 35.0,
            "{near:?}"
        );
        assert!(
            far.in_focus_psnr.unwrap() > 35.0 && far.out_of_focus_psnr.unwrap() < 30.0,
            "{far:?}"
        );
    }

    #[test]
    fn a_flat_scene_has_nothing_out_of_focus_behind_a_small_aperture() {
        let mut flat = scene();
        flat.layers[0].depth.fill(0.5);
        let display = Display::from_toml("aperture_radius = 0.3").unwrap();
        let judged = Judge::of(&flat, &display, Pupil::of_aperture(&display)).unwrap();
        let figures = judged.judge(&judged.truth, 0).unwrap();
        assert_eq!(figures.out_of_focus_psnr, None);
        let mean = Natural::mean(
            [
                figures,
                Natural {
                    out_of_focus_psnr: Some(20.0),
                    ..figures
                },
            ]
            .into_iter(),
        );
        assert_eq!(mean.out_of_focus_psnr, Some(20.0));
    }
}
