//! Tests the point-based method against its definition, against waves, and for properties that hold in every scene.
use crate::reference;
use phasefront::Size;

use ndarray::{Array2, Array3, Axis, s};
use num_complex::{Complex32, Complex64};
use phasefront::Display;
use phasefront_core::optics::asm::{self, Padding, Propagator};
use phasefront_exact::point_based::{self, Occlusion};
use phasefront_exact::sm_lbm;
use phasefront_io::ldi::{Ldi, LdiLayer};
use phasefront_lab::scene;
use reference::{relative_error, widen};
use std::f64::consts::PI;

const ALL: [Occlusion; 3] = [Occlusion::None, Occlusion::Input, Occlusion::Geometric];

fn hologram(ldi: &Ldi, planes: usize, occlusion: Occlusion) -> Array3<Complex32> {
    point_based::hologram(ldi, &Display::default(), planes, occlusion, &|_, _| {}).unwrap()
}

fn random_ldi(Size { width: w, height: h }: Size, layers: usize) -> Ldi {
    let scene = scene::random_scene(7, Size { width: w, height: h });
    scene::render_ldi_reference(&scene, Size { width: w, height: h }, layers).unwrap()
}

/// Creates one layer of smooth amplitude and constant depth.
fn flat(Size { width: w, height: h }: Size, depth: f32) -> Ldi {
    Ldi::new(vec![LdiLayer {
        rgb: Array3::from_shape_fn((3, h, w), |(c, y, x)| {
            0.5 + 0.3 * ((x as f32 * 0.2).sin() * (y as f32 * 0.15 + c as f32).cos())
        }),
        depth: Array2::from_elem((h, w), depth),
    }])
    .unwrap()
}

/// Stacks two layers of the same size.
fn stacked(front: &Ldi, rear: &Ldi) -> Ldi {
    Ldi::new(vec![front.layers[0].clone(), rear.layers[0].clone()]).unwrap()
}

fn energy(hologram: &Array3<Complex32>) -> f32 {
    hologram.iter().map(Complex32::norm_sqr).sum()
}

#[test]
fn agrees_with_its_definition() {
    let display = Display::default();
    for (size, planes) in [
        (Size { width: 23, height: 17 }, 16),
        (Size { width: 16, height: 23 }, 33),
        (Size { width: 41, height: 1 }, 7),
        (Size { width: 3, height: 35 }, 200),
        (Size { width: 5, height: 5 }, 1),
    ] {
        let ldi = random_ldi(size, 4);
        for occlusion in ALL {
            let ours = hologram(&ldi, planes, occlusion);
            let expected = point_based::reference::hologram(&ldi, &display, planes, occlusion).unwrap();
            for colour in 0..3 {
                let plane = ours.index_axis(Axis(0), colour);
                let plane = widen(plane.to_slice().unwrap(), size);
                let expected = expected.index_axis(Axis(0), colour).to_owned();
                let error = relative_error(&plane, &expected);
                assert!(
                    error < 1e-5,
                    "{size:?}, {planes} planes, {occlusion:?}, colour {colour}: {error:e}"
                );
            }
        }
    }
}

#[test]
fn bands_of_rows_join() {
    // The image has more rows than one band holds and is compared with the definition.
    let ldi = random_ldi(Size { width: 6, height: 71 }, 2);
    let expected = point_based::reference::hologram(&ldi, &Display::default(), 20, Occlusion::Geometric).unwrap();
    let ours = hologram(&ldi, 20, Occlusion::Geometric);
    for colour in 0..3 {
        let plane = ours.index_axis(Axis(0), colour);
        let plane = widen(plane.to_slice().unwrap(), Size { width: 6, height: 71 });
        let expected = expected.index_axis(Axis(0), colour).to_owned();
        assert!(relative_error(&plane, &expected) < 1e-5);
    }
}

#[test]
fn a_sub_hologram_is_the_wave_of_its_point() {
    // Eq. 1 and 2 for a single pixel at z with phase 2πz/λ, seen at z = 0 and weighted like the sub-hologram.
    let size = 129;
    for lambda in [638e-9, 520e-9, 450e-9] {
        for z in [-3e-3, -1.1e-3, 0.7e-3, 2.5e-3] {
            let ours = point_based::sub_hologram(z, lambda, 8e-6);
            let radius = ours.nrows() / 2;
            let mut point = Array2::zeros((size, size));
            point[(64, 64)] = Complex64::from_polar(1.0, 2.0 * PI * z / lambda);
            let correlation = |distance: f64| {
                let wave = reference::asm_periodic(&point, 8e-6, lambda, distance);
                let wave = wave.slice(s![64 - radius..=64 + radius, 64 - radius..=64 + radius]);
                let cone = asm::reach_m(z, lambda, 8e-6) / 8e-6;
                let mut product = Complex64::ZERO;
                let mut energies = [0.0; 2];
                for (((y, x), ours), wave) in ours.indexed_iter().zip(&wave) {
                    let r2 = (y.abs_diff(radius).pow(2) + x.abs_diff(radius).pow(2)) as f64;
                    let wave = wave * (1.0 - r2 / (cone * cone)).max(0.0);
                    product += ours * wave.conj();
                    energies[0] += ours.norm_sqr();
                    energies[1] += wave.norm_sqr();
                }
                (
                    product / (energies[0] * energies[1]).sqrt(),
                    (energies[0] / energies[1]).sqrt(),
                )
            };
            let (alike, amplitude) = correlation(-z);
            let at = format!("λ {lambda:e}, z {z:e}: {alike}, amplitude × {amplitude}");
            assert!(alike.norm() > 0.92 && alike.arg().abs() < 0.3, "{at}");
            assert!((0.6..1.1).contains(&amplitude), "{at}");
            assert!(correlation(z).0.norm() < 0.4, "the other way: {at}");
        }
    }
}

#[test]
fn a_plane_of_constant_depth_gives_back_its_amplitude() {
    let size = Size {
        width: 160,
        height: 120,
    };
    let display = Display::default();
    let inner = s![32..88, 32..128];
    for depth in [0.0, 0.2, 0.45, 0.5, 0.7, 1.0] {
        let ldi = flat(size, depth);
        let ours = hologram(&ldi, 100, Occlusion::Geometric);
        let z = sm_lbm::plane_z_m(sm_lbm::plane_of_depth(depth, 100), 100, &display);
        for (colour, lambda) in display.wavelengths_m().iter().copied().enumerate() {
            let plan = Propagator::new(
                Size {
                    width: 160,
                    height: 120,
                },
                display.pitch_m(),
                lambda,
                z,
                Padding::Reach,
            )
            .unwrap();
            let mut plane = ours.index_axis(Axis(0), colour).to_owned();
            plan.propagate(plane.as_slice_mut().unwrap(), &mut plan.scratch());
            let image = ldi.layers[0].rgb.index_axis(Axis(0), colour);
            let amplitude = plane.mapv(|v| v.norm());
            let difference = (&amplitude - &image).slice(inner).mapv(|d| d * d);
            let psnr = -10.0 * difference.mean().unwrap().log10();
            assert!(psnr >= 35.0, "depth {depth}, colour {colour}: {psnr} dB");
            let ratio = amplitude.slice(inner).sum() / image.slice(inner).sum();
            assert!((ratio - 1.0).abs() < 0.01, "depth {depth}, colour {colour}: × {ratio}");
        }
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let ldi = random_ldi(Size { width: 47, height: 75 }, 3);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| hologram(&ldi, 50, Occlusion::Geometric))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn rays_are_stopped_by_what_is_before_them_and_by_nothing_else() {
    let size = Size { width: 96, height: 80 };
    // Both layers lie behind z = 0, both in front of it, or one on each side.
    for (near, far) in [(0.6, 0.9), (0.1, 0.4), (0.1, 0.9)] {
        let (front, rear) = (flat(size, near), flat(size, far));
        let both = stacked(&front, &rear);
        // A full plate blocks all light except past the frame's ends.
        let inner = s![.., 33..47, 33..63];
        let ours = hologram(&both, 64, Occlusion::Geometric);
        let alone = hologram(&both, 64, Occlusion::Input);
        assert_eq!(ours.slice(inner), alone.slice(inner), "{near} before {far}");
        assert!(energy(&(hologram(&both, 64, Occlusion::None) - &alone)) > 0.1 * energy(&alone));
        // A black plate blocks light too.
        let mut black = both.clone();
        black.layers[0].rgb.fill(0.0);
        let dark = hologram(&black, 64, Occlusion::Geometric);
        assert!(dark.slice(inner).iter().all(|v| *v == Complex32::ZERO));
        // Half a plate leaves the other half unaffected, except within the reach of light.
        let mut half = both.clone();
        half.layers[0].depth.slice_mut(s![.., 48..]).fill(f32::NAN);
        half.layers[0].rgb.slice_mut(s![.., .., 48..]).fill(0.0);
        let free = s![.., .., 80..];
        let ours = hologram(&half, 64, Occlusion::Geometric);
        let rear = hologram(&rear, 64, Occlusion::None);
        assert_eq!(ours.slice(free), rear.slice(free), "{near} before {far}");
    }
}

#[test]
fn of_two_points_on_one_plane_the_front_one_shines() {
    let both = stacked(
        &flat(Size { width: 9, height: 9 }, 0.31),
        &flat(Size { width: 9, height: 9 }, 0.32),
    );
    for occlusion in ALL {
        assert_eq!(
            hologram(&both, 10, occlusion),
            hologram(&flat(Size { width: 9, height: 9 }, 0.31), 10, occlusion)
        );
    }
}

#[test]
fn what_cannot_be_computed_is_refused() {
    let ldi = flat(Size { width: 8, height: 8 }, 0.0);
    let refuses = |display: &str, planes, word: &str| {
        let display = Display::from_toml(display).unwrap();
        let e = point_based::hologram(&ldi, &display, planes, Occlusion::None, &|_, _| {});
        let message = e.unwrap_err().to_string();
        assert!(message.contains(word) && !message.contains('\n'), "{message}");
    };
    refuses("", 0, "planes");
    refuses("", usize::MAX, "planes");
    refuses("pitch_um = 1\nvolume_depth_mm = 500", 2, "do not fit");
    let mut nothing = ldi.clone();
    nothing.layers[0].depth.fill(f32::NAN);
    assert_eq!(energy(&hologram(&nothing, 10, Occlusion::Geometric)), 0.0);
}
