//! The dark and the local steps of encoders against sums over whole planes in f64, and what they are there for.
#![allow(clippy::unwrap_used)]

#[path = "../../tests/reference.rs"]
mod reference;

use ndarray::Array3;
use phasefront::target::{Illumination, Response};
use phasefront::unstable::encode::Encoder;
use phasefront::unstable::encode::band_limit::BandLimit;
use phasefront::unstable::encode::local::{self, LocalFilter};
use phasefront::unstable::wave::aperture::Aperture;
use phasefront::{Display, EncoderOptions, Encoding, Target};
use reference::test_plane;
use rustfft::num_complex::{Complex32, Complex64};

/// What double phase begins with, value by value: the field drawn to the real axis where it is dark, blurred, divided by
/// the light, over `scale`.
fn start(
    field: &[Complex32],
    (h, w): (usize, usize),
    encoding: &Encoding,
    (dark, scale): (f64, f64),
    light: &[f64],
) -> Vec<Complex64> {
    let drawn = |u: &Complex32| {
        let u = Complex64::new(u.re.into(), u.im.into());
        let weight = if dark > 0.0 {
            (u.norm() / (dark * scale)).min(1.0)
        } else {
            1.0
        };
        u * weight + (1.0 - weight) * u.norm()
    };
    let drawn: Vec<Complex64> = field.iter().map(drawn).collect();
    let (sigma, taps) = match encoding {
        Encoding::AntiAlias { sigma, width } => (f64::from(*sigma), *width as isize),
        _ => (1.0, 1),
    };
    let half = taps / 2;
    let weight = |i: isize| (-0.5 * (i as f64 / sigma).powi(2)).exp();
    let sum: f64 = (-half..=half).map(weight).sum();
    let near = |at: usize, by: isize, count: usize| (at as isize + by).clamp(0, count as isize - 1) as usize;
    let blurred = |i: usize| {
        let around = (-half..=half).flat_map(|dy| (-half..=half).map(move |dx| (dy, dx)));
        let value = |(dy, dx)| drawn[near(i / w, dy, h) * w + near(i % w, dx, w)] * weight(dy) * weight(dx);
        around.map(value).sum::<Complex64>() / (sum * sum)
    };
    (0..h * w).map(|i| blurred(i) / light[i] / scale).collect()
}

/// A case against the oracle, by phases and by levels; the same bits on any number of threads.
fn check(shape: (usize, usize), laser: Option<&Illumination>, options: &EncoderOptions) {
    const SCALE: f32 = 1.3;
    let (h, w) = shape;
    let response = Response::linear(8).unwrap();
    let target = Target {
        response: response.clone(),
        illumination: laser.cloned(),
        ..Display::default().with_size(h, w).unwrap().into()
    };
    let given: Vec<_> = (0..3).flat_map(|c| test_plane(shape, 40 + c)).collect();
    let mut results = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let encoder = Encoder::new(shape, &target, options).unwrap();
            let mut scratch = encoder.scratch();
            let (mut phases, mut levels) = (vec![0.0; given.len()], vec![0; given.len()]);
            encoder.encode(&mut given.clone(), Some(SCALE), &mut phases, &mut scratch);
            encoder.encode_levels(&mut given.clone(), Some(SCALE), &mut levels, &mut scratch);
            (phases, levels)
        })
    });
    let why = format!("{w}×{h}, light {}, {options:?}", laser.is_some());
    assert!(results[0] == results[1], "other bits on other threads: {why}");
    let (phases, levels) = std::mem::take(&mut results[0]);
    assert!((phases.iter().zip(&levels).enumerate()).all(|(at, (p, l))| response.level(*p, at) == *l));

    for (c, (plane, phases)) in given.chunks_exact(h * w).zip(phases.chunks_exact(h * w)).enumerate() {
        let light = |i: usize| laser.map_or(1.0, |laser| 1.0 / f64::from(laser.gain(c, i / w, i % w, shape)));
        let light: Vec<f64> = (0..h * w).map(light).collect();
        let mut filtered = plane.to_vec();
        if let Encoding::BandLimit { k } = options.encoding {
            let filter = BandLimit::new(h, w, k).unwrap();
            filter.filter(&mut filtered, &mut filter.scratch());
        }
        let dark = (f64::from(options.dark), f64::from(SCALE));
        let start = start(&filtered, shape, &options.encoding, dark, &light);
        let goal = |u: &Complex32| Complex64::new(u.re.into(), u.im.into()) / f64::from(SCALE);
        let goal: Vec<Complex64> = plane.iter().map(goal).collect();
        let filter = LocalFilter::of_aperture(1.0);
        let expected = local::reference(&filter, shape, &start, &goal, &light, options.local_steps);
        let mut squares = 0.0;
        for (z, phase) in expected.iter().zip(phases) {
            assert!((0.0..std::f32::consts::TAU).contains(phase));
            // Where little is left of a value its direction is rounding's.
            let sure = z.norm().min(1.0);
            let apart = sure * (z / z.norm().max(1e-30) - Complex64::from_polar(1.0, f64::from(*phase))).norm();
            assert!(apart < 4e-3, "{z} {phase}: {apart}, {why}");
            squares += apart * apart;
        }
        let error = (squares / (h * w) as f64).sqrt();
        assert!(error < 2e-4, "{error}, {why}");
    }
}

#[test]
fn dark_and_local_steps_agree_with_sums_over_whole_planes() {
    let beam = Array3::from_shape_fn((3, 4, 7), |(c, y, x)| 1.0 / (1.0 + (c + y * 2 + x) as f32 / 9.0));
    let laser = Illumination::new(beam.view()).unwrap();
    let wide = Encoding::AntiAlias { sigma: 2.0, width: 9 };
    let encodings = [Encoding::DoublePhase, Encoding::ANTI_ALIAS, wide, Encoding::BAND_LIMIT];
    for shape in [(61, 47), (40, 150), (7, 130), (1, 1), (2, 2), (33, 1), (1, 40), (3, 5)] {
        for encoding in &encodings {
            for (dark, local_steps) in [(0.4, 0), (0.0, 1), (0.4, 1), (0.4, 2), (1.0, 3)] {
                for light in [None, Some(&laser)] {
                    let options = EncoderOptions {
                        dark,
                        local_steps,
                        ..encoding.clone().into()
                    };
                    check(shape, light, &options);
                }
            }
        }
    }
}

/// A picture with noise where it is dark, by what is seen of it behind the aperture: root mean square of the amplitudes'
/// difference.
fn error_behind_the_aperture(options: &EncoderOptions, laser: Option<&Illumination>) -> f64 {
    let shape @ (h, w) = (96, 120);
    let target = Target {
        illumination: laser.cloned(),
        ..Display::default().with_size(h, w).unwrap().into()
    };
    let value = |i: usize| {
        let (c, y, x) = (i / (h * w), i / w % h, i % w);
        let bright = (y / 12 + x / 15 + c) % 3 != 0;
        let noise = ((i * 7919 + 13) % 1009) as f32 / 1009.0;
        let amplitude = if bright {
            0.5 + 0.3 * (x as f32 * 0.2).sin()
        } else {
            0.02
        };
        Complex32::from_polar(
            amplitude,
            if bright {
                0.3 * (y as f32 * 0.1).sin()
            } else {
                std::f32::consts::TAU * noise
            },
        )
    };
    let field: Vec<Complex32> = (0..3 * h * w).map(value).collect();
    let encoder = Encoder::new(shape, &target, options).unwrap();
    let mut phases = vec![0.0; field.len()];
    encoder.encode(&mut field.clone(), Some(1.0), &mut phases, &mut encoder.scratch());
    let mut shown: Vec<_> = phases.iter().map(|phase| Complex32::from_polar(1.0, *phase)).collect();
    if let Some(laser) = laser {
        laser.shine(&mut shown, shape, shape);
    }
    let aperture = Aperture::new(h, w, 1.0).unwrap();
    for plane in shown.chunks_exact_mut(h * w) {
        aperture.filter(plane, &mut aperture.scratch());
    }
    let apart = |(shown, wanted): (&Complex32, &Complex32)| f64::from(shown.norm() - wanted.norm()).powi(2);
    let sum: f64 = shown.iter().zip(&field).map(apart).sum();
    (sum / field.len() as f64).sqrt()
}

#[test]
fn each_stage_brings_what_is_shown_nearer_to_the_field() {
    let beam = Array3::from_shape_fn((3, 4, 7), |(c, y, x)| 1.0 / (1.0 + (c + y + x) as f32 / 30.0));
    let laser = Illumination::new(beam.view()).unwrap();
    for light in [None, Some(&laser)] {
        for encoding in [Encoding::DoublePhase, Encoding::ANTI_ALIAS, Encoding::BAND_LIMIT] {
            let error = |dark, local_steps| {
                let options = EncoderOptions {
                    dark,
                    local_steps,
                    ..encoding.clone().into()
                };
                error_behind_the_aperture(&options, light)
            };
            let [plain, dark, one, two] = [error(0.0, 0), error(0.4, 0), error(0.4, 1), error(0.4, 2)];
            println!("{encoding:?}: {plain:.4} {dark:.4} {one:.4} {two:.4}");
            assert!(
                dark < 0.7 * plain && one < 0.85 * dark && two < 1.02 * one,
                "{encoding:?}"
            );
        }
    }
}

#[test]
fn a_dark_frame_is_dark() {
    let options = EncoderOptions {
        dark: 0.4,
        local_steps: 2,
        ..Default::default()
    };
    let encoder = Encoder::new((4, 6), &Target::default(), &options).unwrap();
    let mut phases = vec![1.0; 72];
    let scale = encoder.encode(&mut [Complex32::ZERO; 72], None, &mut phases, &mut encoder.scratch());
    assert_eq!(scale, 0.0);
    let sum: Complex32 = phases[..24].iter().map(|p| Complex32::from_polar(1.0, *p)).sum();
    assert!(sum.norm() < 1e-4);
}

fn refused(options: EncoderOptions, what: &str) {
    let why = Encoder::new((4, 6), &Target::default(), &options)
        .err()
        .unwrap()
        .to_string();
    assert!(why.contains(what) && !why.contains('\n'), "{why}");
}

#[test]
fn a_dark_that_is_no_share_is_refused() {
    for dark in [-0.1, 1.5, f32::NAN, f32::INFINITY] {
        let options = EncoderOptions {
            dark,
            ..Default::default()
        };
        refused(options, "from 0 to 1");
    }
}

#[test]
fn more_steps_than_bring_anything_are_refused() {
    let options = EncoderOptions {
        local_steps: 9,
        ..Default::default()
    };
    refused(options, "at most 8");
}
