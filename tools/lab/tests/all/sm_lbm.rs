//! Tests SM-LBM against Eq. 1–4 in f64, and for properties that hold in every scene.
use crate::reference;
use phasefront::Size;

use ndarray::{Array2, Array3, Axis, s};
use num_complex::{Complex32, Complex64};
use phasefront::Display;
use phasefront_core::optics::asm::{self, Padding, Propagator};
use phasefront_exact::sm_lbm;
use phasefront_io::ldi::{Ldi, LdiLayer};
use phasefront_lab::scene;
use reference::{relative_error, widen};

fn hologram(ldi: &Ldi, planes: usize) -> Array3<Complex32> {
    sm_lbm::hologram(ldi, &Display::default(), planes, &|_, _| {}).unwrap()
}

fn plane_of(hologram: &Array3<Complex32>, colour: usize) -> Array2<Complex64> {
    let plane = hologram.index_axis(Axis(0), colour);
    widen(plane.to_slice().unwrap(), Size::from_shape(plane.dim()))
}

/// Computes the reference for the same input in the same padded plane.
fn expected(ldi: &Ldi, planes: usize, colour: usize) -> Array2<Complex64> {
    let display = Display::default();
    let volume = display.volume_depth_m();
    let red = display.wavelengths_m()[0];
    let padded = asm::padded_size(ldi.size(), display.pitch_m(), red, volume, Padding::Reach).unwrap();
    let layers: Vec<_> = (ldi.layers.iter())
        .map(|layer| {
            let amplitude = layer.rgb.index_axis(Axis(0), colour).mapv(f64::from);
            (amplitude, layer.depth.mapv(f64::from))
        })
        .collect();
    let lambda = display.wavelengths_m()[colour];
    reference::sm_lbm(&layers, planes, volume, display.pitch_m(), lambda, padded)
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

#[test]
fn agrees_with_equations_1_to_4() {
    for (size, planes, most) in [
        (Size { width: 64, height: 64 }, 1, 1e-4),
        (Size { width: 64, height: 64 }, 16, 1e-4),
        (Size { width: 47, height: 61 }, 33, 1e-4),
        (
            Size {
                width: 480,
                height: 270,
            },
            8,
            1e-4,
        ),
        (Size { width: 47, height: 61 }, 256, 1e-3),
    ] {
        let ldi = random_ldi(size, 3);
        let ours = hologram(&ldi, planes);
        for colour in 0..3 {
            let error = relative_error(&plane_of(&ours, colour), &expected(&ldi, planes, colour));
            assert!(error < most, "{size:?} {planes} planes, colour {colour}: {error:e}");
        }
    }
}

#[test]
fn two_planes_equal_the_closed_computation() {
    // Rear plane U at z2, front plane A with its silhouette at z1: H = ASM(ASM(U, z1 − z2)·M + A, −z1).
    let size = Size { width: 56, height: 48 };
    let (mut front, rear) = (flat(size, 0.1), flat(size, 0.9));
    front.layers[0].depth.slice_mut(s![.., 28..]).fill(f32::NAN);
    let ldi = Ldi::new(vec![front.layers[0].clone(), rear.layers[0].clone()]).unwrap();
    let ours = hologram(&ldi, 2);
    let display = Display::default();
    let z = |k| sm_lbm::plane_z_m(k, 2, &display);
    assert!((z(0) - 1.5e-3).abs() < 1e-12 && (z(1) + 1.5e-3).abs() < 1e-12);
    let red = display.wavelengths_m()[0];
    let padded = asm::padded_size(Size { width: 56, height: 48 }, 8e-6, red, 6e-3, Padding::Reach).unwrap();
    for (colour, lambda) in display.wavelengths_m().iter().copied().enumerate() {
        let image = |l: &LdiLayer| l.rgb.index_axis(Axis(0), colour).mapv(f64::from);
        let start = |z: f64| Complex64::from_polar(1.0, 2.0 * std::f64::consts::PI * z / lambda);
        let mut field = Array2::zeros(padded.shape());
        field
            .slice_mut(s![..48, ..56])
            .assign(&image(&rear.layers[0]).mapv(|a| a * start(z(1))));
        field = reference::asm_periodic(&field, 8e-6, lambda, z(0) - z(1));
        field
            .slice_mut(s![..48, ..28])
            .assign(&image(&front.layers[0]).slice(s![.., ..28]).mapv(|a| a * start(z(0))));
        field = reference::asm_periodic(&field, 8e-6, lambda, -z(0));
        let closed = field.slice(s![..48, ..56]).to_owned();
        assert!(relative_error(&plane_of(&ours, colour), &closed) < 1e-4);
    }
}

#[test]
fn a_plane_of_constant_depth_refocuses_to_its_amplitude() {
    let size = Size {
        width: 160,
        height: 120,
    };
    for depth in [0.0, 0.3, 1.0] {
        let ldi = flat(size, depth);
        let ours = hologram(&ldi, 100);
        let display = Display::default();
        let z = sm_lbm::plane_z_m(sm_lbm::plane_of_depth(depth, 100), 100, &display);
        let inner = s![32..88, 32..128];
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
            let difference = &plane.mapv(|v| v.norm()) - &ldi.layers[0].rgb.index_axis(Axis(0), colour);
            let mean_square = difference.slice(inner).mapv(|d| d * d).mean().unwrap();
            let psnr = -10.0 * mean_square.log10();
            assert!(psnr >= 40.0, "depth {depth}, colour {colour}: {psnr} dB");
        }
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let ldi = random_ldi(Size { width: 47, height: 61 }, 3);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| hologram(&ldi, 20))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn an_empty_scene_is_dark_and_no_planes_are_refused() {
    let mut nothing = flat(Size { width: 8, height: 8 }, 0.5);
    nothing.layers[0].depth.fill(f32::NAN);
    assert!(hologram(&nothing, 10).iter().all(|v| *v == Complex32::ZERO));
    let e = sm_lbm::hologram(&nothing, &Display::default(), 0, &|_, _| {}).unwrap_err();
    assert!(e.to_string().contains("1 to 1000000"));
}

#[test]
fn black_surfaces_occlude() {
    let size = Size { width: 64, height: 64 };
    let (mut black, bright) = (flat(size, 0.2), flat(size, 0.8));
    black.layers[0].rgb.fill(0.0);
    let ldi = Ldi::new(vec![black.layers[0].clone(), bright.layers[0].clone()]).unwrap();
    let energy: f32 = hologram(&ldi, 10).iter().map(Complex32::norm_sqr).sum();
    let open: f32 = hologram(&bright, 10).iter().map(Complex32::norm_sqr).sum();
    assert!(energy < 0.1 * open, "{energy} of {open}");
}
