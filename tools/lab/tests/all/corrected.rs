//! Tests SM-LBM with aberration correction against Eq. 5 in f64, plane by plane, and against known results.
use crate::reference;
use phasefront::Size;

use ndarray::{Array2, Array3, Axis, s};
use num_complex::{Complex32, Complex64};
use phasefront::Display;
use phasefront::target::Aberration;
use phasefront_core::optics::asm::{Padding, Propagator};
use phasefront_core::optics::zernike::Aberrations;
use phasefront_exact::corrected::{self, Correction, spatial};
use phasefront_exact::sm_lbm;
use phasefront_io::display::spatial::SpatialAberrations;
use phasefront_io::ldi::{Ldi, LdiLayer};
use phasefront_lab::scene;
use reference::{asm_periodic, fft2, relative_error, widen};
use std::f64::consts::PI;

fn hologram(ldi: &Ldi, planes: usize, correction: &Correction) -> Array3<Complex32> {
    corrected::hologram(ldi, &Display::default(), planes, correction, &|_, _| {}).unwrap()
}

fn random_ldi(Size { width: w, height: h }: Size, layers: usize) -> Ldi {
    let scene = scene::random_scene(7, Size { width: w, height: h });
    scene::render_ldi_reference(&scene, Size { width: w, height: h }, layers).unwrap()
}

fn size_for(ldi: &Ldi) -> Size {
    corrected::padded_size(ldi.size(), &Display::default()).unwrap()
}

fn plane_of(hologram: &Array3<Complex32>, colour: usize) -> Array2<Complex64> {
    let plane = hologram.index_axis(Axis(0), colour);
    let plane = plane.as_standard_layout();
    widen(plane.as_slice().unwrap(), Size::from_shape(plane.dim()))
}

/// Returns an asymmetric aberration: a shift, a defocus and an astigmatism, all growing with z.
fn kernel(z: f64, lambda: f64, mu: f64, nu: f64) -> Complex64 {
    let shift = mu * 6e-6 + nu * (1e-5 * (1.0 + z / 3e-3));
    let defocus = 0.3e-3 * lambda * (mu * mu - 0.5 * nu * nu) * (1.0 + z / 6e-3);
    Complex64::from_polar(1.0 - 0.1 * z / 3e-3, -2.0 * PI * (shift + defocus))
}

#[test]
fn agrees_with_equation_5_plane_by_plane() {
    let display = Display::default();
    let (volume, pitch) = (display.volume_depth_m(), display.pitch_m());
    for (frame, planes, z_m) in [
        (Size { width: 33, height: 40 }, 9, vec![-2e-3, 0.5e-3, 1e-3]),
        (
            Size { width: 35, height: 21 },
            6,
            (0..6).map(|k| 2.5e-3 - 1e-3 * f64::from(k)).rev().collect(),
        ),
    ] {
        let ldi = random_ldi(frame, 3);
        let padded = size_for(&ldi);
        let shape = padded.shape();
        let correction = Correction::sampled(z_m.clone(), padded, &display, kernel).unwrap();
        let ours = hologram(&ldi, planes, &correction);
        let z = |k: usize| volume / 2.0 - volume * (k as f64 + 0.5) / planes as f64;
        let plane_of_depth = |d: f32| ((f64::from(d) * planes as f64) as usize).min(planes - 1);
        // Φ(z) is interpolated between its two neighbours.
        let phi = |z: f64, lambda: f64, mu: f64, nu: f64| {
            let next = z_m.partition_point(|at| *at <= z);
            if next == 0 || next == z_m.len() {
                return kernel(z_m[next.min(z_m.len() - 1)], lambda, mu, nu);
            }
            let t = (z - z_m[next - 1]) / (z_m[next] - z_m[next - 1]);
            kernel(z_m[next - 1], lambda, mu, nu) * (1.0 - t) + kernel(z_m[next], lambda, mu, nu) * t
        };
        for (colour, lambda) in display.wavelengths_m().iter().copied().enumerate() {
            let content = |k: usize| {
                let mut plane: Array2<Option<f64>> = Array2::from_elem(shape, None);
                for layer in ldi.layers.iter().rev() {
                    for (at, d) in layer.depth.indexed_iter() {
                        if !d.is_nan() && plane_of_depth(*d) == k {
                            plane[at] = Some(layer.rgb[(colour, at.0, at.1)].into());
                        }
                    }
                }
                plane
            };
            let mut sum: Array2<Complex64> = Array2::zeros(shape);
            for k in 0..planes {
                let start = Complex64::from_polar(1.0, 2.0 * PI * z(k) / lambda);
                let mut field = content(k).mapv(|a| a.unwrap_or(0.0) * start);
                for j in (0..k).rev() {
                    field = asm_periodic(&field, pitch, lambda, z(j) - z(j + 1));
                    field.zip_mut_with(&content(j), |v, hit| {
                        if hit.is_some() {
                            *v = Complex64::ZERO;
                        }
                    });
                }
                field = asm_periodic(&field, pitch, lambda, z(k) - z(0));
                let mut spectrum = fft2(&field, false);
                for ((ky, kx), value) in spectrum.indexed_iter_mut() {
                    let frequency = |k: usize, n: usize| {
                        let signed = if 2 * k < n { k as f64 } else { k as f64 - n as f64 };
                        signed / (n as f64 * pitch)
                    };
                    let (mu, nu) = (frequency(kx, shape.1), frequency(ky, shape.0));
                    *value *= phi(z(k), lambda, mu, nu);
                }
                sum += &asm_periodic(&fft2(&spectrum, true), pitch, lambda, -z(k));
            }
            let expected = sum.slice(s![..frame.height, ..frame.width]).to_owned();
            let error = relative_error(&plane_of(&ours, colour), &expected);
            assert!(error < 1e-4, "{frame:?}, colour {colour}: {error:e}");
        }
    }
}

#[test]
fn kernels_of_one_change_nothing() {
    let ldi = random_ldi(Size { width: 47, height: 61 }, 3);
    let plain = sm_lbm::hologram(&ldi, &Display::default(), 64, &|_, _| {}).unwrap();
    for z_m in [vec![0.0], vec![-3e-3, 0.0, 1e-3, 3e-3], vec![5e-3, 6e-3]] {
        let shape = size_for(&ldi).shape();
        let ones = Correction::new(
            z_m.clone(),
            vec![Array3::from_elem((3, shape.0, shape.1), Complex32::ONE); z_m.len()],
        )
        .unwrap();
        let ours = hologram(&ldi, 64, &ones);
        for colour in 0..3 {
            let error = relative_error(&plane_of(&ours, colour), &plane_of(&plain, colour));
            assert!(error < 1e-3, "{z_m:?}, colour {colour}: {error:e}");
        }
    }
}

#[test]
fn a_shift_moves_the_hologram() {
    let ldi = random_ldi(Size { width: 72, height: 64 }, 2);
    let display = Display::default();
    // The shift is two pixels right and three down, and the plane is larger than necessary by this amount.
    let Size { width: w, height: h } = size_for(&ldi);
    let shift = |_: f64, _: f64, mu: f64, nu: f64| Complex64::from_polar(1.0, -2.0 * PI * 8e-6 * (2.0 * mu + 3.0 * nu));
    let correction = Correction::sampled(
        vec![0.0],
        Size {
            width: w + 2,
            height: h + 3,
        },
        &display,
        shift,
    )
    .unwrap();
    let ours = hologram(&ldi, 30, &correction);
    let one = |_: f64, _: f64, _: f64, _: f64| Complex64::ONE;
    let still = Correction::sampled(
        vec![0.0],
        Size {
            width: w + 2,
            height: h + 3,
        },
        &display,
        one,
    )
    .unwrap();
    let plain = hologram(&ldi, 30, &still);
    for colour in 0..3 {
        let moved = plane_of(&ours, colour).slice(s![3.., 2..]).to_owned();
        let still = plane_of(&plain, colour).slice(s![..61, ..70]).to_owned();
        assert!(relative_error(&moved, &still) < 1e-3);
    }
}

#[test]
fn a_defocus_moves_the_focus() {
    // This display needs the front of the volume 0.4 mm nearer and leaves the rear unchanged.
    let (frame, moved_m) = ((96, 96), 0.4e-3);
    let display = Display::default();
    for (depth, ahead_m) in [(0.0, moved_m), (0.5, moved_m / 2.0), (1.0, 0.0)] {
        let ldi = Ldi::new(vec![LdiLayer {
            rgb: Array3::from_shape_fn(
                (3, 96, 96),
                |(_, y, x)| {
                    if (x / 3 + y / 4) % 2 == 0 { 0.8 } else { 0.2 }
                },
            ),
            depth: Array2::from_elem(frame, depth),
        }])
        .unwrap();
        // Halfway, the mean of the two kernels applies: two images, each with half the amplitude.
        let defocus = move |z: f64, lambda: f64, mu: f64, nu: f64| {
            let ahead_m = if z > 0.0 { moved_m } else { 0.0 };
            let f2 = mu * mu + nu * nu;
            let bend = lambda * f2 / (1.0 + (1.0 - lambda * lambda * f2).sqrt());
            // ASM by −ahead makes the field at z + ahead the image.
            Complex64::from_polar(1.0, 2.0 * PI * ahead_m * bend)
        };
        let ends = vec![display.z_of_depth(0.995), display.z_of_depth(0.005)];
        let correction = Correction::sampled(ends, size_for(&ldi), &display, defocus).unwrap();
        let ours = hologram(&ldi, 100, &correction);
        let z = sm_lbm::plane_z_m(sm_lbm::plane_of_depth(depth, 100), 100, &display);
        let error_at = |z_m: f64| {
            let lambda = display.wavelengths_m()[1];
            let plan = Propagator::new(
                Size { width: 96, height: 96 },
                display.pitch_m(),
                lambda,
                z_m,
                Padding::Reach,
            )
            .unwrap();
            let mut plane = ours.index_axis(Axis(0), 1).to_owned();
            plan.propagate(plane.as_slice_mut().unwrap(), &mut plan.scratch());
            let image = ldi.layers[0].rgb.index_axis(Axis(0), 1);
            let difference = &plane.mapv(|v| v.norm()) - &image;
            let inner = difference.slice(s![30..66, 30..66]).mapv(|d| d * d);
            inner.mean().unwrap().sqrt()
        };
        if depth == 0.5 {
            assert!(error_at(z) > 0.02 && error_at(z + moved_m) > 0.02);
        } else {
            let sharp = error_at(z + ahead_m);
            assert!(sharp < 0.01, "depth {depth}: {sharp}");
            assert!(error_at(z + moved_m - ahead_m) > 0.1);
        }
    }
}

#[test]
fn what_cannot_be_computed_is_refused() {
    let display = Display::default();
    let ldi = random_ldi(Size { width: 32, height: 32 }, 1);
    let shape = size_for(&ldi);
    let one = |_: f64, _: f64, _: f64, _: f64| Complex64::ONE;
    let refused = |result: phasefront_io::Result<Correction>, word: &str| {
        let message = result.err().unwrap().to_string();
        assert!(message.contains(word) && !message.contains('\n'), "{message}");
    };
    refused(Correction::new(vec![], vec![]), "at least one");
    refused(Correction::sampled(vec![1e-3, 0.0], shape, &display, one), "ascend");
    refused(Correction::sampled(vec![f64::NAN], shape, &display, one), "ascend");
    let nan = |_: f64, _: f64, mu: f64, _: f64| Complex64::new(0.0, 1.0 / mu * 0.0);
    refused(Correction::sampled(vec![0.0], shape, &display, nan), "no numbers");
    let cube = |n| Array3::from_elem((3, n, n), Complex32::ONE);
    refused(Correction::new(vec![0.0, 1.0], vec![cube(4), cube(5)]), "one shape");

    let small = Correction::new(vec![0.0], vec![cube(32)]).unwrap();
    let refused = |planes, correction: &Correction, word: &str| {
        let e = corrected::hologram(&ldi, &display, planes, correction, &|_, _| {});
        let message = e.unwrap_err().to_string();
        assert!(message.contains(word) && !message.contains('\n'), "{message}");
    };
    refused(8, &small, "at least");
    refused(0, &small, "1 to 1000000");
}

#[test]
fn too_many_propagations_are_refused_before_they_begin() {
    // Every one of 600 planes has points and its own kernel: 600²/2 is more than 512²/2.
    let planes = 600;
    let display = Display::default();
    let ldi = Ldi::new(vec![LdiLayer {
        rgb: Array3::from_elem((3, 1, planes), 0.5),
        depth: Array2::from_shape_fn((1, planes), |(_, x)| (x as f32 + 0.5) / planes as f32),
    }])
    .unwrap();
    let shape = size_for(&ldi).shape();
    let z_m: Vec<f64> = (0..planes)
        .rev()
        .map(|k| sm_lbm::plane_z_m(k, planes, &display))
        .collect();
    let one = Array3::from_elem((3, shape.0, shape.1), Complex32::ONE);
    let correction = Correction::new(z_m, vec![one; planes]).unwrap();
    let e = corrected::hologram(&ldi, &display, planes, &correction, &|_, _| {});
    let message = e.unwrap_err().to_string();
    assert!(
        message.contains("propagations") && message.contains("131072"),
        "{message}"
    );
}

/// Compares interpolated kernels for coefficients that change over depth with a separate kernel for each plane.
#[test]
#[ignore = "slow: 10 seconds of a core"]
fn coefficients_that_change_over_depth_are_followed() {
    let ldi = random_ldi(Size { width: 56, height: 48 }, 3);
    let display = Display::default();
    let at = |a: [f64; 5]| Aberration::new([a; 3]).unwrap();
    let all = Aberrations::new(vec![
        (-2e-3, at([0.5, -1.0, 0.3, 0.0, 0.4])),
        (1e-3, at([-0.3, 0.8, 0.0, 0.5, -0.2])),
    ])
    .unwrap();
    let planes = 96;
    let ours = Correction::of_aberrations(&all, Size { width: 56, height: 48 }, planes, &display).unwrap();
    let z_m: Vec<_> = (0..planes)
        .rev()
        .map(|k| sm_lbm::plane_z_m(k, planes, &display))
        .collect();
    let lambda = display.wavelengths_m();
    let exact = Correction::sampled(z_m, ours.size(), &display, |z, l, mu, nu| {
        let colour = lambda.iter().position(|x| *x == l).unwrap();
        Complex64::from_polar(1.0, all.at(z).phase(colour, mu, nu, display.pitch_m()))
    })
    .unwrap();
    let (ours, exact) = (hologram(&ldi, planes, &ours), hologram(&ldi, planes, &exact));
    for colour in 0..3 {
        let error = relative_error(&plane_of(&ours, colour), &plane_of(&exact, colour));
        assert!(error < 0.02, "{colour}: {error}");
    }
}

#[test]
fn one_correction_over_the_frame_is_the_fourier_filter() {
    let ldi = random_ldi(Size { width: 52, height: 40 }, 2);
    let display = Display::default();
    let a = Aberration::new([[0.8, -0.5, 0.4, 0.3, -0.6]; 3]).unwrap();
    let all = Aberrations::new(vec![(0.0, a)]).unwrap();
    let correction = Correction::of_aberrations(&all, Size { width: 52, height: 40 }, 7, &display).unwrap();
    let filtered = hologram(&ldi, 7, &correction);
    let points = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
    let points = points.map(|place| (place, all.clone())).to_vec();
    let spatial = SpatialAberrations::new(points).unwrap();
    let ours = spatial::hologram(&ldi, &display, 7, &spatial, &|_, _| {}).unwrap();
    for colour in 0..3 {
        let error = relative_error(&plane_of(&ours, colour), &plane_of(&filtered, colour));
        // The truncation of the sub-hologram causes an error of up to 0.0505, in blue.
        assert!(error < 0.06, "{colour}: {error}");
    }
}
