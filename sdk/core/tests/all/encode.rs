//! Compares the dark threshold and the local steps of encoders with f64 sums over whole planes, and tests their
//! benefit.
use crate::reference;
use phasefront_core::Size;

use ndarray::{Array2, Array3};
use phasefront_core::display::Display;
use phasefront_core::display::illumination::Illumination;
use phasefront_core::display::levels::LevelsMut;
use phasefront_core::display::response::Response;
use phasefront_core::display::target::Target;
use phasefront_core::encode::Encoder;
use phasefront_core::encode::band_limit::BandLimit;
use phasefront_core::encode::brightness::Brightness;
use phasefront_core::encode::local::{self, LocalFilter};
use phasefront_core::encode::midpoint::{self, MidpointSteps};
use phasefront_core::encode::{EncoderOptions, Encoding};
use phasefront_core::optics::aperture::{Aperture, Opening};
use phasefront_core::optics::asm::{Padding, Propagator};
use phasefront_core::pipeline::display_plan::DisplayPlan;
use reference::test_plane;
use rustfft::num_complex::{Complex32, Complex64};

/// The first line of the description of a display with one laser.
const ONE_LASER: &str = "wavelengths_nm = [532]\n";

/// Returns the input of double phase, value by value: the field moved to the real axis where it is dark, blurred,
/// divided by the light and by `scale`.
fn start(
    field: &[Complex32],
    Size { width: w, height: h }: Size,
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

/// Compares a case with the oracle, by phases and by levels. The bits must be the same on any number of threads.
fn check(display: &str, size: Size, laser: Option<&Illumination>, options: &EncoderOptions) {
    const SCALE: f32 = 1.3;
    let Size { width: w, height: h } = size;
    let response = Response::linear(8).unwrap();
    let radius = if laser.is_some() { 0.9 } else { 1.0 };
    let display = Display::from_toml(&format!("{display}aperture_radius = {radius:?}")).unwrap();
    let colours = display.colours() as u32;
    let target = Target {
        response: response.clone(),
        illumination: laser.cloned(),
        ..display.with_size(Size { width: w, height: h }).unwrap().into()
    };
    let given: Vec<_> = (0..colours).flat_map(|c| test_plane(size, 40 + c)).collect();
    let mut results = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let encoder = Encoder::new(size, &target, options).unwrap();
            let mut scratch = encoder.scratch();
            let (mut phases, mut levels) = (vec![0.0; given.len()], vec![0; given.len()]);
            encoder.encode(&mut given.clone(), Some(SCALE), &mut phases, &mut scratch);
            encoder.encode_levels(&mut given.clone(), Some(SCALE), &mut levels, &mut scratch);
            (phases, levels)
        })
    });
    let why = format!("{w}×{h}, {colours} colours, light {}, {options:?}", laser.is_some());
    assert!(results[0] == results[1], "other bits on other threads: {why}");
    let (phases, levels) = std::mem::take(&mut results[0]);
    assert!((phases.iter().zip(&levels).enumerate()).all(|(at, (p, l))| response.level(*p, at) == *l));

    for (c, (plane, phases)) in given.chunks_exact(h * w).zip(phases.chunks_exact(h * w)).enumerate() {
        let light = |i: usize| laser.map_or(1.0, |laser| 1.0 / f64::from(laser.gain(c, i / w, i % w, size)));
        let light: Vec<f64> = (0..h * w).map(light).collect();
        let mut filtered = plane.to_vec();
        if let Encoding::BandLimit { k } = options.encoding {
            let filter = BandLimit::new(Size { width: w, height: h }, k).unwrap();
            filter.filter(&mut filtered, &mut filter.scratch());
        }
        let dark = (f64::from(options.dark_threshold), f64::from(SCALE));
        let start = start(&filtered, size, &options.encoding, dark, &light);
        let goal = |u: &Complex32| Complex64::new(u.re.into(), u.im.into()) / f64::from(SCALE);
        let goal: Vec<Complex64> = plane.iter().map(goal).collect();
        let filter = LocalFilter::of_aperture(radius);
        let expected = local::reference(&filter, size, &start, &goal, &light, options.local_steps);
        let mut squares = 0.0;
        for (z, phase) in expected.iter().zip(phases) {
            assert!((0.0..std::f32::consts::TAU).contains(phase));
            // If little remains of a value, rounding determines its direction.
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
    let alone = Illumination::new(beam.slice(ndarray::s![1..2, .., ..])).unwrap();
    let wide = Encoding::AntiAlias { sigma: 2.0, width: 9 };
    let encodings = [Encoding::DoublePhase, Encoding::ANTI_ALIAS, wide, Encoding::BAND_LIMIT];
    for size in [
        Size { width: 47, height: 61 },
        Size { width: 150, height: 40 },
        Size { width: 130, height: 7 },
        Size { width: 1, height: 1 },
        Size { width: 2, height: 2 },
        Size { width: 1, height: 33 },
        Size { width: 40, height: 1 },
        Size { width: 5, height: 3 },
    ] {
        for encoding in &encodings {
            for (dark, local_steps) in [(0.4, 0), (0.0, 1), (0.4, 1), (0.4, 2), (1.0, 3)] {
                let options = EncoderOptions {
                    dark_threshold: dark,
                    local_steps,
                    ..encoding.clone().into()
                };
                for light in [None, Some(&laser)] {
                    check("", size, light, &options);
                }
                check(ONE_LASER, size, Some(&alone), &options);
            }
        }
    }
}

/// Encodes an image with noise in its dark parts and returns the root mean square error of the amplitudes behind the
/// aperture.
fn error_behind_the_aperture(options: &EncoderOptions, laser: Option<&Illumination>) -> f64 {
    let size @ Size { width: w, height: h } = Size { width: 120, height: 96 };
    let target = Target {
        illumination: laser.cloned(),
        ..Display::default()
            .with_size(Size { width: w, height: h })
            .unwrap()
            .into()
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
    let encoder = Encoder::new(size, &target, options).unwrap();
    let mut phases = vec![0.0; field.len()];
    encoder.encode(&mut field.clone(), Some(1.0), &mut phases, &mut encoder.scratch());
    let mut shown: Vec<_> = phases.iter().map(|phase| Complex32::from_polar(1.0, *phase)).collect();
    if let Some(laser) = laser {
        laser.shine(&mut shown, size, size);
    }
    let aperture = Aperture::new(Size { width: w, height: h }, Opening::centred(1.0)).unwrap();
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
                    dark_threshold: dark,
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

/// Propagates a colour of that size over `distance_m` without the carrier, through an aperture of `radius`.
pub(crate) fn through_aperture(
    plane: &[Complex64],
    Size { width: w, height: h }: Size,
    padded: Size,
    wavelength_m: f64,
    distance_m: f64,
    radius: f64,
) -> Vec<Complex64> {
    let mut all = Array2::from_elem(padded.shape(), Complex64::ZERO);
    for (i, value) in plane.iter().enumerate() {
        all[(i / w, i % w)] = *value;
    }
    let mut spectrum = reference::fft2(&all, false);
    let pitch_m = Display::default().pitch_m();
    for ((y, x), value) in spectrum.indexed_iter_mut() {
        let frequency = |k: usize, n: usize| k.min(n - k) as f64 / n as f64;
        let square = frequency(y, padded.height).powi(2) + frequency(x, padded.width).powi(2);
        let f2 = square / pitch_m.powi(2);
        let root = (1.0 - wavelength_m.powi(2) * f2).sqrt();
        let phase = -2.0 * std::f64::consts::PI * distance_m * wavelength_m * f2 / (1.0 + root);
        *value *= if square <= 0.25 * radius * radius {
            Complex64::from_polar(1.0, phase)
        } else {
            Complex64::ZERO
        };
    }
    let back = reference::fft2(&spectrum, true);
    (0..h * w).map(|i| back[(i / w, i % w)]).collect()
}

#[test]
fn steps_at_the_midpoint_agree_with_sums_in_f64() {
    const SCALE: f32 = 1.3;
    let beam = Array3::from_shape_fn((3, 4, 7), |(c, y, x)| 1.0 / (1.0 + (c + y * 2 + x) as f32 / 9.0));
    let laser = Illumination::new(beam.view()).unwrap();
    let alone = Illumination::new(beam.slice(ndarray::s![1..2, .., ..])).unwrap();
    for (display, size @ Size { width: w, height: h }, offset_m, radius, light, steps) in [
        ("", Size { width: 47, height: 61 }, 0.0, 1.0, None, 1),
        ("", Size { width: 66, height: 40 }, 2e-3, 0.9, Some(&laser), 2),
        ("", Size { width: 20, height: 33 }, 1e-3, 0.3, None, 2),
        ("", Size { width: 9, height: 1 }, -1e-3, 1.2, None, 3),
        ("", Size { width: 1, height: 1 }, 0.0, 1.0, None, 1),
        (ONE_LASER, Size { width: 47, height: 61 }, 0.0, 1.0, None, 1),
        (ONE_LASER, Size { width: 66, height: 40 }, 2e-3, 0.9, Some(&alone), 2),
    ] {
        let display = Display::from_toml(&format!("{display}aperture_radius = {radius:?}")).unwrap();
        let display = display.with_offset_m(offset_m).unwrap();
        let target = Target {
            illumination: light.cloned(),
            ..display.clone().with_size(Size { width: w, height: h }).unwrap().into()
        };
        let planes = 0..display.colours() as u32;
        let field: Vec<_> = planes.flat_map(|c| test_plane(size, 40 + c)).collect();
        let start: Vec<f32> = (0..field.len()).map(|i| (i * 37 % 628) as f32 / 100.0).collect();
        let mut results = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().unwrap().install(|| {
                let plan = MidpointSteps::new(size, &target, steps).unwrap();
                let mut phases = start.clone();
                let mut scratch = plan.scratch();
                plan.keep(&field, None, &mut scratch);
                plan.correct(SCALE, &mut phases, &mut scratch);
                phases
            })
        });
        assert!(results[0] == results[1], "{w}×{h}: other bits on other threads");
        let phases = std::mem::take(&mut results[0]);
        let colours = display.wavelengths_m();
        let plans = Propagator::for_colours(
            Size { width: w, height: h },
            display.pitch_m(),
            colours,
            offset_m,
            Padding::Reach,
        )
        .unwrap();
        let padded = plans[0].padded_size();
        for (c, (got, field)) in phases.chunks_exact(h * w).zip(field.chunks_exact(h * w)).enumerate() {
            let light = |i: usize| light.map_or(1.0, |laser| 1.0 / f64::from(laser.gain(c, i / w, i % w, size)));
            let light: Vec<f64> = (0..h * w).map(light).collect();
            let mut wanted = field.to_vec();
            let back = Propagator::for_colours(
                Size { width: w, height: h },
                display.pitch_m(),
                colours,
                -offset_m,
                Padding::Reach,
            )
            .unwrap();
            back[c].propagate(&mut wanted, &mut back[c].scratch());
            let goal = |u: &Complex32| Complex64::new(u.re.into(), u.im.into()) / f64::from(SCALE);
            let wanted: Vec<Complex64> = wanted.iter().map(goal).collect();
            let start = start[c * h * w..].iter().zip(&light);
            let start = start
                .map(|(phase, light)| Complex64::from_polar(*light, f64::from(*phase)))
                .collect();
            let to = |distance_m: f64| {
                move |u: &[Complex64]| through_aperture(u, size, padded, colours[c], distance_m, radius)
            };
            let expected = midpoint::reference(to(-offset_m), to(offset_m), &wanted, start, &light, steps);
            let apart =
                |(e, phase): (&Complex64, &f32)| (e / e.norm() - Complex64::from_polar(1.0, f64::from(*phase))).norm();
            let squares: f64 = expected.iter().zip(got).map(apart).map(|d| d * d).sum();
            let error = (squares / (h * w) as f64).sqrt();
            assert!(error < 2e-3, "{w}×{h} at {offset_m}, colour {c}: {error}");
        }
    }
}

#[test]
fn steps_at_the_midpoint_are_part_of_the_way_to_levels() {
    let size @ Size { width: w, height: h } = Size { width: 70, height: 48 };
    let target = Target::from(Display::from_toml("width = 70\nheight = 48\noffset_mm = 1").unwrap());
    let field: Vec<_> = (0..3).flat_map(|c| test_plane(size, 50 + c)).collect();
    let levels = |midpoint_steps: usize| {
        let options = EncoderOptions {
            midpoint_steps,
            brightness: Brightness::Fixed(1.2),
            ..Default::default()
        };
        let plan = DisplayPlan::new(size, &target, &options).unwrap();
        let mut levels = vec![0; 3 * h * w];
        let out = LevelsMut::Bytes(&mut levels);
        plan.modulate(None, &mut field.clone(), out, &mut plan.scratch());
        levels
    };
    let encoder = Encoder::new(size, &target, &EncoderOptions::default()).unwrap();
    let mut phases = vec![0.0; field.len()];
    encoder.encode(&mut field.clone(), Some(1.2), &mut phases, &mut encoder.scratch());
    assert!((levels(0).iter().zip(&phases)).all(|(level, phase)| target.response.level(*phase, 0) == *level));
    let plan = MidpointSteps::new(size, &target, 2).unwrap();
    let mut scratch = plan.scratch();
    plan.keep(&field, None, &mut scratch);
    plan.correct(1.2, &mut phases, &mut scratch);
    assert!((levels(2).iter().zip(&phases)).all(|(level, phase)| target.response.level(*phase, 0) == *level));
    assert_ne!(levels(0), levels(2));
}

/// Checks that in video one step for each frame reaches the result of many steps, and that a pixel whose field changes
/// starts anew, like a single frame.
#[test]
fn steps_at_the_midpoint_go_on_where_the_picture_stands_still() {
    const SCALE: f32 = 1.2;
    let size @ Size { width: w, height: _ } = Size { width: 66, height: 40 };
    let target = Target::from(Display::from_toml("width = 66\nheight = 40\noffset_mm = 1").unwrap());
    let encoder = Encoder::new(size, &target, &EncoderOptions::default()).unwrap();
    let first: Vec<_> = (0..3).flat_map(|c| test_plane(size, 70 + c)).collect();
    let moved = |at: usize| at % w > w / 2;
    let second = first
        .iter()
        .zip((0..3).flat_map(|c| test_plane(size, 80 + c)))
        .enumerate();
    let second: Vec<_> = second
        .map(|(at, (still, other))| if moved(at) { other } else { *still })
        .collect();
    let encoded = |field: &[Complex32]| {
        let mut phases = vec![0.0; field.len()];
        encoder.encode(&mut field.to_vec(), Some(SCALE), &mut phases, &mut encoder.scratch());
        phases
    };
    let run = |steps: usize, frames: &[(&[Complex32], Option<f32>)]| {
        let plan = MidpointSteps::new(size, &target, steps).unwrap();
        let mut scratch = plan.scratch();
        let each = frames.iter().map(|(field, past)| {
            let mut phases = encoded(field);
            plan.keep(field, *past, &mut scratch);
            plan.correct(SCALE, &mut phases, &mut scratch);
            phases
        });
        each.last().unwrap()
    };
    let apart = |a: f32, b: f32| (Complex32::cis(a) - Complex32::cis(b)).norm();
    let follows = Some(SCALE);
    let still: [(&[Complex32], _); 3] = [(&first, None), (&first, follows), (&first, follows)];
    let most = run(1, &still)
        .into_iter()
        .zip(run(3, &still[..1]))
        .map(|(a, b)| apart(a, b));
    assert!(most.fold(0.0, f32::max) < 1e-2);
    assert_eq!(run(1, &[(&first, None), (&first, None)]), run(1, &still[..1]));

    // Away from the unchanged part, the moving part is the same as in a single frame.
    let anew = run(1, &[(&second, None)]);
    let after = run(1, &[(&first, None), (&second, follows)]);
    let far = (0..anew.len()).filter(|at| at % w > w / 2 + 20);
    let squares: f32 = far.clone().map(|at| apart(anew[at], after[at]).powi(2)).sum();
    assert!((squares / far.count() as f32).sqrt() < 0.1);
    let still = (0..anew.len()).filter(|at| !moved(*at) && apart(anew[*at], after[*at]) > 1e-3);
    assert!(still.count() * 3 > anew.len() / 2);
}

#[test]
fn a_dark_frame_is_dark() {
    let options = EncoderOptions {
        dark_threshold: 0.4,
        local_steps: 2,
        ..Default::default()
    };
    let encoder = Encoder::new(Size { width: 6, height: 4 }, &Target::default(), &options).unwrap();
    let mut phases = vec![1.0; 72];
    let scale = encoder.encode(&mut [Complex32::ZERO; 72], None, &mut phases, &mut encoder.scratch());
    assert_eq!(scale, 0.0);
    let sum: Complex32 = phases[..24].iter().map(|p| Complex32::from_polar(1.0, *p)).sum();
    assert!(sum.norm() < 1e-4);
}

/// Checks that a value that is not a number affects only its surroundings, not the whole frame.
#[test]
fn no_number_stays_where_it_is() {
    let size @ Size { width: w, height: h } = Size { width: 50, height: 40 };
    let target = Target::from(Display::default().with_size(Size { width: w, height: h }).unwrap());
    let good: Vec<_> = (0..3).flat_map(|c| test_plane(size, 60 + c)).collect();
    let encoder = Encoder::new(size, &target, &EncoderOptions::default()).unwrap();
    let steps = MidpointSteps::new(size, &target, 2).unwrap();
    for bad in [f32::NAN, f32::INFINITY] {
        let mut field = good.clone();
        field[20 * w + 25].im = bad;
        let [expected, phases] = [&good, &field].map(|field| {
            let mut phases = vec![0.0; field.len()];
            encoder.encode(&mut field.clone(), Some(1.2), &mut phases, &mut encoder.scratch());
            phases
        });
        for (at, (expected, phase)) in expected.iter().zip(&phases).enumerate() {
            let near = at < h * w && (at / w).abs_diff(20) <= 6 && (at % w).abs_diff(25) <= 6;
            assert!((0.0..std::f32::consts::TAU).contains(phase));
            assert!(near || expected == phase, "{at}: {expected} {phase}");
        }
        let mut corrected = phases.clone();
        let mut scratch = steps.scratch();
        steps.keep(&field, None, &mut scratch);
        steps.correct(1.2, &mut corrected, &mut scratch);
        assert_eq!(corrected[..h * w], phases[..h * w]);
        assert_ne!(corrected[h * w..], phases[h * w..]);
    }
}

fn refused(options: EncoderOptions, what: &str) {
    let why = Encoder::new(Size { width: 6, height: 4 }, &Target::default(), &options)
        .err()
        .unwrap()
        .to_string();
    assert!(why.contains(what) && !why.contains('\n'), "{why}");
}

#[test]
fn a_dark_that_is_no_share_is_refused() {
    for dark in [-0.1, 1.5, f32::NAN, f32::INFINITY] {
        let options = EncoderOptions {
            dark_threshold: dark,
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
    let options = EncoderOptions {
        midpoint_steps: 101,
        ..Default::default()
    };
    refused(options, "at most 100");
}
