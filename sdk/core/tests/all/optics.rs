//! Compares the optics with the paper's equations in f64 and checks physical laws.
use crate::network_models;
use crate::reference;
use phasefront_core::Size;

use ndarray::{Array2, Array3};
use network_models::Model;
use phasefront_core::display::Display;
use phasefront_core::display::illumination::Illumination;
use phasefront_core::display::levels::LevelsMut;
use phasefront_core::display::panel::Flatness;
use phasefront_core::display::panel::Panel;
use phasefront_core::display::response::Response;
use phasefront_core::display::response::per_pixel;
use phasefront_core::display::response::per_pixel::PerPixel;
use phasefront_core::display::target::Target;
use phasefront_core::encode::anti_alias::AntiAlias;
use phasefront_core::encode::brightness::Brightness;
use phasefront_core::encode::{Encoder, double_phase};
use phasefront_core::encode::{EncoderOptions, Encoding};
use phasefront_core::frame::RgbdFrame;
use phasefront_core::method::Method;
use phasefront_core::method::network::Network;
use phasefront_core::optics;
use phasefront_core::optics::aperture::{Aperture, Opening};
use phasefront_core::optics::asm::{self, Padding, Propagator};
use phasefront_core::optics::zernike::Aberration;
use phasefront_core::pipeline::Pipeline;
use phasefront_core::pipeline::display_plan::DisplayPlan;
use phasefront_core::view::refocus::{Refocus, phase_only_field};
use reference::{relative_error, test_plane, widen};
use rustfft::num_complex::{Complex32, Complex64};
use std::f64::consts::PI;
use std::sync::Arc;

const SIZES: [Size; 5] = [
    Size { width: 64, height: 64 },
    Size { width: 47, height: 61 },
    Size {
        width: 480,
        height: 270,
    },
    Size { width: 1, height: 1 },
    Size { width: 130, height: 7 },
];
const RED: f64 = 638e-9;
const PITCH: f64 = 8e-6;

fn propagated(plane: &[Complex32], Size { width: w, height: h }: Size, s: f64, padding: Padding) -> Vec<Complex32> {
    let plan = Propagator::new(Size { width: w, height: h }, PITCH, RED, s, padding).unwrap();
    let mut out = plane.to_vec();
    plan.propagate(&mut out, &mut plan.scratch());
    out
}

/// Returns options that scale each frame by its largest amplitude.
fn largest(encoding: Encoding) -> EncoderOptions {
    EncoderOptions {
        brightness: Brightness::FrameMax,
        ..encoding.into()
    }
}

fn double_phase_encoder(size: Size) -> Encoder {
    Encoder::new(size, &Target::default(), &EncoderOptions::plain(Encoding::DoublePhase)).unwrap()
}

fn energy(plane: &[Complex32]) -> f64 {
    plane.iter().map(|v| f64::from(v.norm_sqr())).sum()
}

/// Returns light that stays away from the frame's edge over ±3 mm.
fn inner_plane(Size { width: w, height: h }: Size, margin: usize) -> Vec<Complex32> {
    let taper = |i: usize, n: usize| {
        let edge = i.min(n - 1 - i) as f32 - margin as f32;
        (edge / 16.0).clamp(0.0, 1.0)
    };
    let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
    let mut plane = test_plane(Size { width: w, height: h }, 3);
    for (i, value) in plane.iter_mut().enumerate() {
        *value *= smooth(taper(i / w, h)) * smooth(taper(i % w, w));
    }
    plane
}

#[test]
fn propagation_agrees_with_equation_2() {
    for size in SIZES {
        let plane = test_plane(size, 1);
        for distance in [3e-3, -1.7e-3, 0.0, 20e-3] {
            for padding in [Padding::Reach, Padding::Double, Padding::Circular] {
                let padded = asm::padded_size(size, PITCH, RED, distance, padding).unwrap();
                let wide = widen(&plane, size);
                let expected = reference::asm(&wide, PITCH, RED, distance, padded);
                let carrier = asm::carrier(distance, RED);
                let mut out = propagated(&plane, size, distance, padding);
                if padding == Padding::Double
                    && asm::reach_m(distance, RED, PITCH) / PITCH > size.height.min(size.width) as f64
                {
                    continue; // The band limit applies, so the equation differs.
                }
                out.iter_mut().for_each(|v| *v *= carrier);
                let error = relative_error(&widen(&out, size), &expected);
                assert!(error < 1e-4, "{size} {distance} {padding:?}: {error:e}");
            }
        }
    }
}

#[test]
fn the_naive_oracle_agrees_too() {
    for (size, padded) in [
        (Size { width: 14, height: 9 }, Size { width: 27, height: 20 }),
        (Size { width: 47, height: 61 }, Size { width: 64, height: 75 }),
    ] {
        let wide = widen(&test_plane(size, 2), size);
        let expected = reference::asm(&wide, PITCH, RED, 2e-3, padded);
        let naive = optics::reference::propagate(&wide, PITCH, RED, 2e-3, padded);
        assert!(relative_error(&naive, &expected) < 1e-9);
    }
}

#[test]
fn colours_share_a_shape_and_agree_with_equation_2() {
    let size = Size { width: 47, height: 61 };
    for lambdas in [&[638e-9, 520e-9, 450e-9][..], &[532e-9]] {
        let plans = Propagator::for_colours(size, PITCH, lambdas, 6e-3, Padding::Reach).unwrap();
        assert_eq!(plans.len(), lambdas.len());
        let mut scratch = plans[0].scratch();
        for (plan, &lambda) in plans.iter().zip(lambdas) {
            let mut plane = test_plane(size, 4);
            let expected = reference::asm(&widen(&plane, size), PITCH, lambda, 6e-3, plan.padded_size());
            plan.propagate(&mut plane, &mut scratch);
            plane.iter_mut().for_each(|v| *v *= asm::carrier(6e-3, lambda));
            assert!(relative_error(&widen(&plane, size), &expected) < 1e-4);
        }
    }
}

#[test]
fn padding_by_reach_holds_what_double_padding_holds() {
    for (size, distance) in [
        (
            Size {
                width: 256,
                height: 256,
            },
            3e-3,
        ),
        (
            Size {
                width: 480,
                height: 270,
            },
            -3e-3,
        ),
        (
            Size {
                width: 320,
                height: 192,
            },
            6e-3,
        ),
    ] {
        let plane = inner_plane(size, 4);
        let near = widen(&propagated(&plane, size, distance, Padding::Reach), size);
        let far = widen(&propagated(&plane, size, distance, Padding::Double), size);
        let error = relative_error(&near, &far);
        assert!(error < 2e-3, "{size} {distance}: {error:e}");
    }
}

#[test]
fn energy_is_kept_and_the_way_back_returns_the_field() {
    for size in SIZES {
        let plane = test_plane(size, 5);
        let there = propagated(&plane, size, 2.5e-3, Padding::Circular);
        assert!((energy(&there) / energy(&plane) - 1.0).abs() < 1e-4, "{size}");
        let back = propagated(&there, size, -2.5e-3, Padding::Circular);
        assert!(relative_error(&widen(&back, size), &widen(&plane, size)) < 1e-4);
    }
    // Energy is also conserved in a padded frame if the light does not leave it.
    let size = Size {
        width: 240,
        height: 200,
    };
    let plane = inner_plane(size, 40);
    let there = propagated(&plane, size, 3e-3, Padding::Reach);
    assert!((energy(&there) / energy(&plane) - 1.0).abs() < 1e-3);
    let back = propagated(&there, size, -3e-3, Padding::Reach);
    assert!(relative_error(&widen(&back, size), &widen(&plane, size)) < 0.03);
}

#[test]
fn a_positive_distance_converges_light_that_a_lens_sends_toward_the_viewer() {
    // A wave that converges at z = +5 mm has the phase −πr²/(λ·z). It must become brighter there and not at −5 mm.
    let (h, w) = (128, 128);
    let lens: Vec<_> = (0..h * w)
        .map(|i| {
            let (y, x) = ((i / w) as f64 - 64.0, (i % w) as f64 - 64.0);
            let r2 = (x * x + y * y) * PITCH * PITCH;
            let inside = if x.hypot(y) < 20.0 { 1.0 } else { 0.0 };
            Complex32::from_polar(inside, (-PI * r2 / (RED * 5e-3)) as f32)
        })
        .collect();
    let peak = |plane: Vec<Complex32>| plane.iter().map(Complex32::norm_sqr).fold(0.0, f32::max);
    let toward = peak(propagated(&lens, Size { width: w, height: h }, 5e-3, Padding::Reach));
    let away = peak(propagated(&lens, Size { width: w, height: h }, -5e-3, Padding::Reach));
    assert!(toward > 10.0 * away, "{toward} {away}");
}

#[test]
fn the_band_limit_keeps_a_far_field_from_wrapping_around() {
    // At 2 m the kernel is far wider than the doubled plane. The result must still be finite and no brighter.
    let size = Size { width: 64, height: 64 };
    let plane = inner_plane(size, 8);
    let far = propagated(&plane, size, 2.0, Padding::Double);
    assert!(far.iter().all(|v| v.is_finite()));
    assert!(energy(&far) < energy(&plane));
}

#[test]
fn distances_that_cannot_be_held_are_refused() {
    for bad in [f64::NAN, f64::INFINITY, 1e3] {
        let e = Propagator::new(Size { width: 64, height: 64 }, PITCH, RED, bad, Padding::Reach)
            .err()
            .unwrap();
        assert!(!e.to_string().contains('\n'), "{e}");
    }
    assert!(Propagator::new(Size { width: 64, height: 0 }, PITCH, RED, 1e-3, Padding::Reach).is_err());
}

#[test]
fn double_phase_agrees_with_equation_7() {
    for Size { width: w, height: h } in SIZES {
        let mut field: Vec<_> = (0..3)
            .flat_map(|c| test_plane(Size { width: w, height: h }, 10 + c))
            .collect();
        let wide = Array3::from_shape_vec(
            (3, h, w),
            field.iter().map(|v| Complex64::new(v.re.into(), v.im.into())).collect(),
        )
        .unwrap();
        let brightest = wide.iter().map(|v| v.norm()).fold(0.0, f64::max);
        for (scale, number) in [(None, brightest), (Some(0.8), 0.8)] {
            let encoder = double_phase_encoder(Size { width: w, height: h });
            let mut phase = vec![0.0; 3 * h * w];
            let used = encoder.encode(&mut field, scale, &mut phase, &mut encoder.scratch());
            assert!((f64::from(used) - number).abs() < 1e-6);
            let expected = reference::double_phase(&wide, number);
            for (got, want) in phase.iter().zip(&expected) {
                // acos is infinitely steep at the brightest pixels, so this compares phasors.
                let apart = (Complex64::from_polar(1.0, f64::from(*got)) - Complex64::from_polar(1.0, *want)).norm();
                assert!(apart < 1.5e-3, "{got} {want}");
            }
            let error: f64 = phase
                .iter()
                .zip(&expected)
                .map(|(a, b)| (Complex64::from_polar(1.0, f64::from(*a)) - Complex64::from_polar(1.0, *b)).norm_sqr())
                .sum();
            assert!((error / phase.len() as f64).sqrt() < 1e-4);
        }
    }
}

#[test]
fn every_encoding_brings_a_smooth_field_back_through_the_aperture() {
    let (h, w) = (96, 120);
    let smooth = |c: usize, y: usize, x: usize| {
        let (y, x) = (y as f32 / h as f32, x as f32 / w as f32);
        let turn = std::f32::consts::TAU;
        let amplitude = 0.5 + 0.2 * (turn * x).sin() + 0.2 * (turn * y + c as f32).cos();
        Complex32::from_polar(amplitude, 0.4 * (turn * (x + y)).sin())
    };
    let field = Array3::from_shape_fn((3, h, w), |(c, y, x)| smooth(c, y, x));
    for encoding in [Encoding::DoublePhase, Encoding::ANTI_ALIAS, Encoding::BAND_LIMIT] {
        let encoder = Encoder::new(
            Size { width: w, height: h },
            &Target::default(),
            &encoding.clone().into(),
        )
        .unwrap();
        let mut phase = vec![0.0; 3 * h * w];
        let mut given = field.clone().into_raw_vec_and_offset().0;
        let scale = encoder.encode(&mut given, None, &mut phase, &mut encoder.scratch());
        assert!(phase.iter().all(|p| (0.0..std::f32::consts::TAU).contains(p)));
        let response = Response::linear(8).unwrap();
        let mut levels = vec![0; phase.len()];
        response.levels(&phase, 0, &mut levels);
        let mut shown = vec![Complex32::ZERO; phase.len()];
        phase_only_field(&levels, &response, scale, &mut shown);
        let aperture = Aperture::new(Size { width: w, height: h }, Opening::centred(0.7)).unwrap();
        for (shown, wanted) in shown.chunks_exact_mut(h * w).zip(field.outer_iter()) {
            aperture.filter(shown, &mut aperture.scratch());
            let wanted: Vec<_> = wanted.iter().copied().collect();
            let error = relative_error(
                &widen(shown, Size { width: w, height: h }),
                &widen(&wanted, Size { width: w, height: h }),
            );
            assert!(error < 0.02, "{encoding:?}: {error}");
        }
    }
}

#[test]
fn refocus_agrees_with_equation_2_from_any_offset() {
    for (offset_m, size) in [
        (0.0, Size { width: 64, height: 64 }),
        (6e-3, Size { width: 47, height: 61 }),
        (
            -4e-3,
            Size {
                width: 480,
                height: 270,
            },
        ),
    ] {
        let display = Display::default().with_offset_m(offset_m).unwrap();
        let hologram: Vec<_> = (0..3).flat_map(|c| test_plane(size, 20 + c)).collect();
        let z = [3e-3, 0.0, -2.2e-3];
        let plan = Refocus::new(size, &display, &z, None).unwrap();
        let padded = asm::padded_size(
            size,
            PITCH,
            RED,
            z.iter().map(|z| (z - offset_m).abs()).fold(0.0, f64::max),
            Padding::Reach,
        )
        .unwrap();
        let views = plan.focal_stack(&hologram, &z).unwrap();
        for (view, z) in views.iter().zip(z) {
            for (c, lambda) in display.wavelengths_m().iter().copied().enumerate() {
                let area = size.pixels();
                let plane = widen(&hologram[c * area..][..area], size);
                let expected = reference::asm(&plane, PITCH, lambda, z - offset_m, padded);
                let seen = Array2::from_shape_vec(
                    size.shape(),
                    view[c * area..][..area]
                        .iter()
                        .map(|v| Complex64::from(f64::from(*v)))
                        .collect(),
                )
                .unwrap();
                let error = relative_error(&seen, &expected.mapv(|v| Complex64::from(v.norm())));
                assert!(error < 1e-4, "{offset_m} {z}: {error:e}");
            }
        }
        assert!(plan.focal_stack(&hologram, &[0.5]).is_err());
    }
}

#[test]
fn deep_encoding_is_the_pre_filter_and_then_double_phase() {
    for input in ["field", "blurred-field", "split-blurred-field"] {
        deep_encoding(input);
    }
}

fn deep_encoding(input: &'static str) {
    let model = Model {
        input,
        inputs: if input.starts_with("split") { 12 } else { 6 },
        ..Model::prefilter("6")
    };
    let network = Arc::new(Network::from_onnx(&model.bytes()).unwrap());
    let display = Display::default().with_offset_m(6e-3).unwrap();
    let (h, w) = (40, 33);
    let plan = |display: &Display, network: &Arc<Network>| {
        let options = largest(Encoding::Deep(network.clone()));
        DisplayPlan::new(Size { width: w, height: h }, &display.into(), &options)
    };
    let modulator = plan(&display, &network).unwrap();
    assert!(modulator.keeps_phase());
    let mut field: Vec<_> = (0..3 * h * w)
        .map(|i| Complex32::from_polar(0.5 + 0.3 * (i as f32).sin(), i as f32 * 0.01))
        .collect();
    let mut filtered = field.clone();
    if input != "field" {
        let blur = AntiAlias::new(0.7, 3).unwrap();
        (filtered.chunks_exact_mut(h * w)).for_each(|plane| blur.filter(plane, w));
    }
    let filter = network.filter_plan(Size { width: w, height: h }).unwrap();
    filter.filter(&mut filtered, &mut filter.scratch());
    let encoder = double_phase_encoder(Size { width: w, height: h });
    let mut expected = vec![0; 3 * h * w];
    let mut scratch = encoder.scratch();
    let scale = encoder.encode_levels(&mut filtered, None, &mut expected, &mut scratch);
    let mut levels = vec![0; 3 * h * w];
    let out = LevelsMut::Bytes(&mut levels);
    let modulation = modulator.modulate(None, &mut field, out, &mut modulator.scratch());
    assert_eq!((modulation.scale, levels), (scale, expected));

    let why = |display: &Display, network| plan(display, network).err().unwrap().to_string();
    let elsewhere = Display::default().with_offset_m(5.9e-3).unwrap();
    assert!(why(&elsewhere, &network).contains("offset of 6.000 mm"));
    let hologram = Arc::new(Network::from_onnx(&Model::new(3, 8).bytes()).unwrap());
    assert!(why(&Display::default(), &hologram).contains("'rgbd'"));
}

/// Compares the correction, which is an additional phase in the offset's transfer function, with Eq. 2 in f64.
#[test]
fn a_correction_is_part_of_the_offset() {
    let a = Aberration::new([
        [0.5, -1.2, 0.7, 0.4, -0.9],
        [0.6, -1.5, 0.8, 0.5, -1.1],
        [0.7, -1.7, 0.9, 0.6, -1.3],
    ])
    .unwrap();
    for (offset_m, size) in [
        (0.0, Size { width: 47, height: 61 }),
        (4e-3, Size { width: 72, height: 40 }),
    ] {
        let display = Display::default().with_offset_m(offset_m).unwrap();
        let Size { width: w, height: h } = size;
        let target = Target {
            correction: Some(a.clone()),
            ..Target::from(&display)
        };
        let plan = DisplayPlan::new(Size { width: w, height: h }, &target, &Encoding::DoublePhase.into()).unwrap();
        let mut field: Vec<_> = (0..3).flat_map(|c| test_plane(size, 50 + c)).collect();
        let given = field.clone();
        plan.propagate(&mut field, &mut plan.scratch());
        let plans = Propagator::for_colours_corrected(
            Size { width: w, height: h },
            PITCH,
            display.wavelengths_m(),
            offset_m,
            &a,
            PITCH,
        )
        .unwrap();
        // Compares first in the plan's own periodic plane, then with enough space that nothing wraps around: the
        // kernel's tails at the corner frequencies reach farther than rays do.
        for (Size { width: pw, height: ph }, most) in [
            (plans[0].padded_size(), 1e-4),
            (
                Size {
                    width: 4 * w,
                    height: 4 * h,
                },
                0.03,
            ),
        ] {
            for (c, lambda) in display.wavelengths_m().iter().copied().enumerate() {
                let area = h * w;
                let mut plane = Array2::zeros((ph, pw));
                let source = widen(&given[c * area..][..area], size);
                plane.slice_mut(ndarray::s![..h, ..w]).assign(&source);
                let mut spectrum = reference::fft2(&plane, false);
                for ((ky, kx), value) in spectrum.indexed_iter_mut() {
                    let bin = |k: usize, n: usize| {
                        (if 2 * k < n { k as f64 } else { k as f64 - n as f64 }) / (n as f64 * PITCH)
                    };
                    let (mu, nu) = (bin(kx, pw), bin(ky, ph));
                    let root = (lambda.powi(-2) - mu * mu - nu * nu).sqrt();
                    let phase = 2.0 * PI * offset_m * (root - 1.0 / lambda) + a.phase(c, mu, nu, PITCH);
                    *value *= Complex64::from_polar(1.0, phase);
                }
                let expected = reference::fft2(&spectrum, true);
                let expected = expected.slice(ndarray::s![..h, ..w]).to_owned();
                let error = relative_error(&widen(&field[c * area..][..area], size), &expected);
                assert!(error < most, "{offset_m} {size} {c}: {error}");
            }
        }
    }
}

/// Checks that a hologram smaller than the modulator is lit by the middle of the beam, after the filter.
#[test]
fn what_a_pixel_sends_is_divided_by_what_it_gets() {
    let display = Display::from_toml("width = 60\nheight = 50").unwrap();
    let (h, w) = (40, 33);
    let beam = Array3::from_shape_fn((3, 4, 5), |(c, y, x)| 1.0 / (1.0 + (c + y * 2 + x) as f32 / 9.0));
    let laser = Illumination::new(beam.view()).unwrap();
    let target = Target {
        illumination: Some(laser.clone()),
        ..display.into()
    };
    let options = EncoderOptions {
        brightness: Brightness::Fixed(2.5),
        ..EncoderOptions::plain(Encoding::ANTI_ALIAS)
    };
    let plan = DisplayPlan::new(Size { width: w, height: h }, &target, &options).unwrap();
    let mut field: Vec<_> = (0..3)
        .flat_map(|c| test_plane(Size { width: w, height: h }, 60 + c))
        .collect();
    let mut filtered = field.clone();
    let mut levels = vec![0; 3 * h * w];
    let out = LevelsMut::Bytes(&mut levels);
    plan.modulate(None, &mut field, out, &mut plan.scratch());
    let filter = AntiAlias::new(0.7, 3).unwrap();
    for plane in filtered.chunks_exact_mut(h * w) {
        filter.filter(plane, w);
    }
    laser.divide(
        &mut filtered,
        Size { width: w, height: h },
        Size { width: 60, height: 50 },
    );
    let encoder = double_phase_encoder(Size { width: w, height: h });
    let mut expected = vec![0; 3 * h * w];
    encoder.encode_levels(&mut filtered, Some(2.5), &mut expected, &mut encoder.scratch());
    assert_eq!(levels, expected);
}

/// Checks that a panel's phases in whole levels are added to the levels modulo their number, with 8 and with 10 bits
/// and with every step of the encoder.
#[test]
fn a_panel_adds_its_phases_after_the_encoder() {
    let (h, w) = (40, 33);
    let field: Vec<_> = (0..3)
        .flat_map(|c| test_plane(Size { width: w, height: h }, 80 + c))
        .collect();
    let steps = |at: usize| (at * 13 % 256) as u16;
    for (midpoint_steps, bits) in [(0, 8), (1, 8), (0, 10)] {
        let display = Display::from_toml(&format!("width = {w}\nheight = {h}\nbits = {bits}")).unwrap();
        let plain = Target::from(display);
        let maps = (0..h * w).map(|at| steps(at) << 8).collect();
        let added = Target {
            panel: Panel {
                flatness: Some(Flatness::new(Size { width: w, height: h }, maps).unwrap()),
                ..Panel::default()
            },
            ..plain.clone()
        };
        let options = EncoderOptions {
            midpoint_steps,
            ..Encoding::ANTI_ALIAS.into()
        };
        let [before, after] = [&plain, &added].map(|target| {
            let plan = DisplayPlan::new(Size { width: w, height: h }, target, &options).unwrap();
            let (mut field, mut scratch) = (field.clone(), plan.scratch());
            let mut words = vec![0; 3 * h * w];
            if bits > 8 {
                plan.modulate(None, &mut field, LevelsMut::Words(&mut words), &mut scratch);
                return words;
            }
            let mut levels = vec![0; 3 * h * w];
            plan.modulate(None, &mut field, LevelsMut::Bytes(&mut levels), &mut scratch);
            levels.into_iter().map(u16::from).collect()
        });
        let count = 1u16 << bits;
        let mut other = 0;
        for (at, (before, after)) in before.iter().zip(&after).enumerate() {
            let want = (before + steps(at % (h * w)) * (count / 256)) % count;
            let apart = want.abs_diff(*after);
            assert!(apart.min(count - apart) <= 1, "{bits} {at}: {want} {after}");
            other += usize::from(apart != 0);
        }
        // A sum is rounded once more than its parts.
        assert!(other < before.len() / 500, "{other}");
    }
}

#[test]
fn thin_frames_pass_the_whole_pipeline_and_huge_ones_are_refused() {
    let network = Arc::new(Network::from_onnx(&Model::int8(8, 24).bytes()).unwrap());
    let prefilter = Arc::new(Network::from_onnx(&Model::prefilter("6").bytes()).unwrap());
    let target = Target::from(Display::default().with_offset_m(6e-3).unwrap());
    let pipeline = |height, width| {
        let method = Method::trained(network.clone());
        let options = largest(Encoding::Deep(prefilter.clone()));
        Pipeline::new(Size { width, height }, method, &target, &options)
    };
    for (h, w) in [(1, 1), (7, 5000), (5000, 7)] {
        let value = |c: usize, y: usize, x: usize| ((c * 7 + x * 3 + y * 5) % 256) as f32 / 255.0;
        let rgb = Array3::from_shape_fn((3, h, w), |(c, y, x)| value(c, y, x));
        let depth = Array2::from_shape_fn((h, w), |(y, x)| value(9, y, x));
        let frame = RgbdFrame::new(rgb, depth).unwrap();
        let levels = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().unwrap().install(|| {
                let plan = pipeline(h, w).unwrap();
                let mut levels = vec![0; 3 * h * w];
                let report = plan.process(&frame, &mut levels, &mut plan.scratch());
                assert!(report.unwrap().scale.is_finite());
                levels
            })
        });
        assert!(levels[0] == levels[1], "{w}×{h}: other bits on other threads");
        assert!(h * w == 1 || levels[0].iter().any(|level| *level != levels[0][0]));
    }
    for side in [0, 1 << 14, 1 << 15, 1 << 40] {
        let why = pipeline(side, side).err().unwrap().to_string();
        let named = ["empty", "too large", "over the"].iter().any(|word| why.contains(word));
        assert!(!why.contains('\n') && named, "{why}");
    }
}

/// Runs each stage on whole planes: filter, light, largest amplitude, double phase, levels. The encoder works row by
/// row and must produce the same bits on any number of threads.
#[test]
fn one_sweep_from_field_to_levels_is_stage_after_stage() {
    for (Size { width: w, height: h }, more) in [
        (Size { width: 47, height: 61 }, (0, 0)),
        (Size { width: 300, height: 40 }, (10, 13)),
        (Size { width: 130, height: 7 }, (1, 0)),
        (Size { width: 1, height: 1 }, (3, 2)),
        (Size { width: 1, height: 33 }, (0, 5)),
        (Size { width: 40, height: 1 }, (0, 0)),
    ] {
        let modulator = Size {
            width: w + more.1,
            height: h + more.0,
        };
        let beam = Array3::from_shape_fn((3, 4, 7), |(c, y, x)| 1.0 / (1.0 + (c + y * 2 + x) as f32 / 9.0));
        let laser = Illumination::new(beam.view()).unwrap();
        let (rows, columns) = per_pixel::nodes(modulator, 16);
        let knots = (0..3 * rows * columns * 9).map(|i| (i % 9) as f32 * (20.0 + (i / 9 % 11) as f32));
        let turns = vec![6.0; 3 * rows * columns];
        let knots = knots.collect::<Vec<_>>();
        let table = PerPixel::new(modulator, 16, 8, &knots, &turns).unwrap();
        let given: Vec<_> = (0..3)
            .flat_map(|c| test_plane(Size { width: w, height: h }, 70 + c))
            .collect();
        for (encoding, blur) in [
            (Encoding::DoublePhase, None),
            (Encoding::ANTI_ALIAS, Some((0.7, 3))),
            (Encoding::AntiAlias { sigma: 2.0, width: 9 }, Some((2.0, 9))),
        ] {
            for (light, scale, response) in [
                (None, None, Response::linear(8).unwrap()),
                (Some(&laser), None, Response::PerPixel(table.clone().into())),
                (Some(&laser), Some(1.5), Response::linear(5).unwrap()),
            ] {
                let display = Display::default().with_size(modulator);
                let target = Target {
                    response: response.clone(),
                    illumination: light.cloned(),
                    ..display.unwrap().into()
                };
                let response = response.centred(Size { width: w, height: h }).unwrap();
                let mut field = given.clone();
                if let Some((sigma, taps)) = blur {
                    let filter = AntiAlias::new(sigma, taps).unwrap();
                    for plane in field.chunks_exact_mut(h * w) {
                        filter.filter(plane, w);
                    }
                }
                if let Some(light) = light {
                    for (i, value) in field.iter_mut().enumerate() {
                        let (y, x) = (i / w % h + more.0 / 2, i % w + more.1 / 2);
                        *value *= light.gain(i / (h * w), y, x, modulator);
                    }
                }
                let largest = field.iter().map(Complex32::norm_sqr).fold(0.0, f32::max);
                let used = match scale {
                    None => largest.sqrt(),
                    Some(scale) => scale,
                };
                let mut phases = vec![0.0; field.len()];
                for (row, out) in phases.chunks_exact_mut(w).enumerate() {
                    double_phase::encode_row(&field[row * w..][..w], row % h, used, out);
                }
                let values = phases.iter().enumerate();
                let levels: Vec<_> = values.map(|(at, phase)| response.level(*phase, at)).collect();

                for threads in [1, 3] {
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
                    pool.build().unwrap().install(|| {
                        let options = EncoderOptions::plain(encoding.clone());
                        let encoder = Encoder::new(Size { width: w, height: h }, &target, &options).unwrap();
                        let mut scratch = encoder.scratch();
                        let (mut field, mut got) = (given.clone(), vec![0; 3 * h * w]);
                        let scaled = encoder.encode_levels(&mut field, scale, &mut got, &mut scratch);
                        assert!((scaled, &got) == (used, &levels), "{w}×{h} {encoding:?} {scale:?}");
                        let (mut field, mut got) = (given.clone(), vec![0.0; 3 * h * w]);
                        encoder.encode(&mut field, scale, &mut got, &mut scratch);
                        assert!(got == phases, "{w}×{h} {encoding:?} {scale:?}");
                    });
                }
            }
        }
    }
}
