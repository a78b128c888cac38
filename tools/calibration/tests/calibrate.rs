//! Calibration of a simulated display, compared with its true values, with noise, a rotated camera, and curves that
//! differ from pixel to pixel.
#![allow(clippy::unwrap_used)]

use ndarray::{Array2, Array3};
use num_complex::Complex32;
use phasefront::Size;
use phasefront::target::{Aberration, Response};
use phasefront::{Brightness, Display, EncoderOptions, Encoding, Target};
use phasefront_calibration::camera::pattern::Pattern;
use phasefront_calibration::camera::photograph::Photograph;
use phasefront_calibration::colours;
use phasefront_calibration::curves::lut::{self, Curves, Problem, Refusal, What};
use phasefront_calibration::rehearse;
use phasefront_calibration::simulated_display::{self, SimulatedDisplay};
use phasefront_core::display::levels::LevelsMut;
use phasefront_core::optics::metrics;
use phasefront_core::optics::zernike::Aberrations;
use phasefront_core::pipeline::display_plan::DisplayPlan;
use phasefront_exact::corrected::{self, Correction};
use phasefront_exact::sm_lbm;
use phasefront_io::display::DisplayFile;
use phasefront_io::display::calibration::AberrationFile;
use phasefront_io::hologram::{Hologram, HologramInfo, Levels};
use phasefront_io::ldi::{Ldi, LdiLayer};
use std::f64::consts::TAU;

const SIZE: Size = Size { width: 144, height: 80 };

fn display() -> Display {
    Display::from_toml(&format!("width = {}\nheight = {}", SIZE.width, SIZE.height)).unwrap()
}

fn simulated() -> SimulatedDisplay {
    SimulatedDisplay::new(&display(), 2.0, 21).unwrap()
}

fn measured(simulated: &SimulatedDisplay, colour: usize) -> Curves {
    measured_by(simulated, colour, Pattern::new(SIZE).unwrap())
}

fn measured_by(simulated: &SimulatedDisplay, colour: usize, pattern: Pattern) -> Curves {
    let dir = tempfile::tempdir().unwrap();
    let shoot = |k: usize| {
        Ok(simulated
            .photograph(pattern.frame(k as u8).view(), colour, 0.0, k as u64)
            .unwrap())
    };
    let name = colours(&display())[colour];
    lut::measure(&pattern, name, &shoot, dir.path(), &|_, _| {}).unwrap()
}

/// Computes the phase error according to the display's true curves.
fn phase_error(simulated: &SimulatedDisplay, response: &Response, colour: usize) -> f64 {
    rehearse::phase_error(simulated, response, colour)
}

#[test]
#[ignore = "slow: 18 seconds of a core"]
fn per_pixel_calibration_brings_phases_and_black_back() {
    let simulated = simulated();
    let curves = [0, 1, 2].map(|colour| measured(&simulated, colour));
    let table = lut::compact(&curves).unwrap();
    let bytes = table.to_bytes().len();
    let factory = Response::linear(8).unwrap();
    let calibrated = Response::PerPixel(table.clone().into());
    for (colour, curves) in curves.iter().enumerate() {
        let (before, after) = (
            phase_error(&simulated, &factory, colour),
            phase_error(&simulated, &calibrated, colour),
        );
        let errors = lut::errors(curves, colour, &table);
        let (grey, black) = (
            rehearse::black_level(&simulated, &factory, colour).unwrap(),
            rehearse::black_level(&simulated, &calibrated, colour).unwrap(),
        );
        eprintln!(
            "{colour}: {before:.3} rad to {after:.4}; black {grey:.1} dB to {black:.1}; {errors:?}; {bytes} bytes; silent {}",
            curves.silent.len()
        );
        assert!(before > 0.3, "{colour}: {before}");
        assert!(after < 0.02, "{colour}: {after}");
        assert!(grey - black > 10.0 && black < -35.0, "{colour}: {grey} {black}");
        assert!(errors.between_rms < 0.02 && errors.compact_rms < 0.02, "{errors:?}");
        assert!(errors.linear_rms > 0.3);
        assert!(curves.silent.is_empty() && curves.under_pi == 0.0);
    }
}

/// Measures a panel of `range` turns with a pattern of `dark` and displays by its table.
fn a_short_range_is_handled_and_reported(range: f64, under_pi: bool, dark: u8) {
    let simulated = simulated();
    let short = simulated_display::Curves {
        range: vec![range; 3],
        ..simulated.curves().clone()
    };
    let simulated = simulated.with_curves(short);
    let pattern = Pattern::new(SIZE).unwrap().with_dark(dark);
    let curves = measured_by(&simulated, 1, pattern);
    let ranges = curves.ranges();
    let median = f64::from(ranges[ranges.len() / 2]);
    assert!((median - range).abs() < 0.04 * range, "{range}: {median}");
    assert_eq!(curves.under_pi > 0.5, under_pi, "{}", curves.under_pi);
    let all = [curves.clone(), curves.clone(), curves];
    let table = Response::PerPixel(lut::compact(&all).unwrap().into());
    let error = phase_error(&simulated, &table, 1);
    assert!(error < 0.06, "{range}: {error}");
    // Phases out of reach get the nearer end.
    let at = (SIZE.height + 40) * SIZE.width + 70;
    let turn = (1.0 + simulated.phase(1, 40, 70, 255.0) / TAU) / 2.0 * TAU;
    assert_eq!(table.level((turn - 0.1) as f32, at), 255);
    assert_eq!(table.level((turn + 0.1) as f32, at), 0);
}

#[test]
#[ignore = "slow: 8 seconds of a core"]
fn ranges_under_two_pi_are_handled_and_reported() {
    a_short_range_is_handled_and_reported(0.8, false, 128);
}

#[test]
#[ignore = "slow: 8 seconds of a core"]
fn ranges_under_pi_are_handled_and_reported() {
    a_short_range_is_handled_and_reported(0.45, true, 255);
}

/// Returns the problems that [`lut::measure`] reports for photographs that `change` spoils.
fn told(change: impl Fn(usize, Photograph) -> Result<Photograph, What>) -> Vec<Problem> {
    let simulated = simulated();
    let pattern = Pattern::new(SIZE).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let shoot = |k: usize| {
        let levels = pattern.frame(k as u8);
        change(k, simulated.photograph(levels.view(), 1, 0.0, k as u64).unwrap())
    };
    match lut::measure(&pattern, "green", &shoot, dir.path(), &|_, _| {}) {
        Err(Refusal::Problems(problems)) => problems,
        other => panic!("{other:?}"),
    }
}

#[test]
fn bad_captures_are_told_one_by_one() {
    let simulated = simulated();
    let pattern = Pattern::new(SIZE).unwrap();
    let of = |k: u8| simulated.photograph(pattern.frame(k).view(), 1, 0.0, k.into()).unwrap();
    let problems = told(|k, photo| match k {
        3 => Err(What::Missing),
        10 => Ok(of(11)),
        11 => Ok(of(10)),
        40 => {
            let bright = |v: &u16| v.saturating_mul(8) & 0xfff0;
            let values = photo.values.iter().map(bright).collect();
            Ok(Photograph { values, ..photo })
        }
        90 => {
            let mut shifted = photo.clone();
            for (i, value) in shifted.values.iter_mut().enumerate() {
                let (y, x) = (i / photo.width, i % photo.width);
                let from = (x + 30) % photo.width;
                *value = photo.values[y * photo.width + from];
            }
            // The modulator must stay inside the picture.
            Ok(shifted)
        }
        130 => {
            let (height, width, small) = photo.shrunk(2);
            let values = small.iter().map(|v| *v as u16).collect();
            Ok(Photograph {
                height,
                width,
                values,
                full: photo.full,
            })
        }
        200 => {
            let values = vec![1000; photo.values.len()];
            Ok(Photograph { values, ..photo })
        }
        _ => Ok(photo),
    });
    let said: Vec<_> = problems.iter().map(ToString::to_string).collect();
    let expected = [
        ("green/capture_003", "is missing; photograph pattern_003.png"),
        ("green/capture_010", "shows pattern 011"),
        ("green/capture_011", "shows pattern 010"),
        ("green/capture_040", "shorten the exposure"),
        ("green/capture_090", "is shifted by (-30"),
        ("green/capture_130", "others are"),
        ("green/capture_200", "of the 4 corner marks"),
    ];
    assert_eq!(said.len(), expected.len(), "{said:#?}");
    for (said, (name, words)) in said.iter().zip(expected) {
        assert!(said.starts_with(name) && said.contains(words), "{said}");
        assert!(!said.contains('\n'));
    }
}

#[test]
#[ignore = "slow: 13 seconds of a core"]
fn a_dead_pixel_is_told_and_its_neighbours_stand_in() {
    let simulated = simulated();
    let pattern = Pattern::new(SIZE).unwrap();
    let dir = tempfile::tempdir().unwrap();
    // A speck of dust on the optics is dark in every photograph.
    let shoot = |k: usize| {
        let levels = pattern.frame(k as u8);
        let mut photo = simulated.photograph(levels.view(), 1, 0.0, k as u64).unwrap();
        let (y, x) = (photo.height / 2, photo.width / 2);
        for dy in 0..5 {
            for dx in 0..5 {
                photo.values[(y + dy) * photo.width + x + dx] = 40;
            }
        }
        Ok(photo)
    };
    let curves = lut::measure(&pattern, "green", &shoot, dir.path(), &|_, _| {}).unwrap();
    assert!((1..=16).contains(&curves.silent.len()), "{:?}", curves.silent);
    for (y, x) in &curves.silent {
        assert!(y.abs_diff(SIZE.height / 2) < 8 && x.abs_diff(SIZE.width / 2) < 8);
    }
    let table = lut::compact(&[curves.clone(), curves.clone(), curves]).unwrap();
    let error = phase_error(&simulated, &Response::PerPixel(table.into()), 1);
    assert!(error < 0.05, "{error}");
    // A display that does not respond at all is refused.
    let flat = |k: usize| {
        let levels = pattern.frame(0).mapv(|_| 0);
        let mut photo = simulated.photograph(levels.view(), 1, 0.0, k as u64).unwrap();
        let marked = simulated
            .photograph(pattern.frame(k as u8).view(), 1, 0.0, k as u64)
            .unwrap();
        let rows = photo.height / 3 * photo.width;
        let end = photo.values.len() - rows;
        photo.values[..rows].copy_from_slice(&marked.values[..rows]);
        photo.values[end..].copy_from_slice(&marked.values[end..]);
        Ok(photo)
    };
    match lut::measure(&pattern, "green", &flat, dir.path(), &|_, _| {}) {
        Err(Refusal::Other(e)) => assert!(e.to_string().contains("do not answer"), "{e}"),
        other => panic!("{other:?}"),
    }
}

/// Returns the correction of the wave change in Fig. 8, caused by a cylinder of 200 mm before an eyepiece of 21 mm. The
/// eyepiece maps frequency µ to λfµ in its pupil, where the cylinder adds a phase of −kx²/2f. Along x alone, this is
/// equivalent to a shift of z by f²/f₁ = 2.2 mm.
fn cylinder() -> Aberration {
    let display = Display::default();
    let shift_m = 21e-3 * 21e-3 / 200e-3;
    let coefficients = display.wavelengths_m().iter().map(|lambda| {
        // πλ·shift·µ² = K·x², and x² = (2ρ² − 1)/4 + ρ²·cos 2θ/2 + 1/4.
        let k = std::f64::consts::PI * lambda * shift_m / (4.0 * display.pitch_m().powi(2));
        [k / 4.0, k / 2.0, 0.0, 0.0, 0.0]
    });
    Aberration::new(coefficients.collect::<Vec<_>>()).unwrap()
}

/// Creates three boards one behind the other with soft upright, horizontal and slanted bars, six to nine pixels wide. A
/// double phase displays them well and a cylinder blurs them, as in the test pattern of the paper's figure.
fn boards(Size { width: w, height: h }: Size, planes: usize, in_focus: [usize; 3]) -> Ldi {
    let board = |x: usize| 3 * x / w;
    let depth = |k: usize| (k as f32 + 0.5) / planes as f32;
    let rgb = Array3::from_shape_fn((3, h, w), |(c, y, x)| {
        let (x, y, c) = (x as f32, y as f32, c as f32);
        let wave = |fx: f32, fy: f32| (std::f32::consts::TAU * (fx * x + fy * y) + c).cos();
        // The fade between boards avoids visible edges.
        let middle = (3.0 * x / w as f32).fract() - 0.5;
        let fade = (std::f32::consts::PI * middle).cos().powi(2);
        let bars = if y < h as f32 / 2.0 {
            wave(1.0 / 6.0, 0.0)
        } else {
            wave(0.11, 0.06)
        };
        fade * (0.5 + 0.35 * bars)
    });
    let depth = Array2::from_shape_fn((h, w), |(_, x)| depth(in_focus[board(x)]));
    Ldi::new(vec![LdiLayer { rgb, depth }]).unwrap()
}

#[test]
fn a_cylinder_of_200_mm_is_corrected_within_1_db() {
    let display = Display::default();
    let size = Size {
        width: 192,
        height: 128,
    };
    let (h, w) = size.shape();
    const PLANES: usize = 24;
    let in_focus = [4, 12, 20];
    let ldi = boards(size, PLANES, in_focus);
    let all = Aberrations::new(vec![(0.0, cylinder())]).unwrap();
    let plain = sm_lbm::hologram(&ldi, &display, PLANES, &|_, _| {}).unwrap();
    let correction = Correction::of_aberrations(&all, size, PLANES, &display).unwrap();
    let corrected = corrected::hologram(&ldi, &display, PLANES, &correction, &|_, _| {}).unwrap();
    let bare = DisplayFile::from(display.clone());
    let aberrated = DisplayFile {
        aberration: Some(AberrationFile::Uniform(all)),
        ..bare.clone()
    };
    // Both use the same light. If each were scaled by its largest amplitude, the corrected field, which has higher
    // peaks, would be dimmer by a quarter.
    let fixed = |options: EncoderOptions| EncoderOptions {
        brightness: Brightness::Fixed(1.0),
        ..options
    };
    let options = fixed(EncoderOptions::plain(Encoding::ANTI_ALIAS));
    let encoded = |options: &EncoderOptions, field: &Array3<Complex32>, correct: bool| {
        let target = Target {
            correction: correct.then(cylinder),
            ..bare.target.clone()
        };
        let plan = DisplayPlan::new(size, &target, options).unwrap();
        let mut field = field.clone();
        let mut levels = Array3::zeros((3, h, w));
        let mut scratch = plan.scratch();
        plan.propagate(field.as_slice_mut().unwrap(), &mut scratch);
        let modulation = plan.modulate(
            None,
            field.as_slice_mut().unwrap(),
            LevelsMut::Bytes(levels.as_slice_mut().unwrap()),
            &mut scratch,
        );
        let info = HologramInfo {
            scale: Some(modulation.scale),
            ..HologramInfo::new(display.clone())
        };
        (levels, info)
    };
    let z_m = in_focus.map(|k| sm_lbm::plane_z_m(k, PLANES, &display));
    let info = encoded(&options, &plain, false).1;
    let truth = Hologram::Complex(plain.clone(), info).views(&z_m).unwrap();
    let quality = |(levels, info): (Array3<u8>, HologramInfo), file: &DisplayFile| -> f64 {
        let views = Hologram::Levels(Levels::Bytes(levels), info)
            .views_on(file, &z_m)
            .unwrap();
        // The comparison excludes the border, where the cylinder spreads light out of the frame.
        let inner = ndarray::s![.., 16..h - 16, 16..w - 16];
        let psnr = (views.iter().zip(&truth)).map(|(view, truth)| {
            metrics::compare(view.slice(inner), truth.slice(inner))
                .unwrap()
                .psnr_overall
        });
        psnr.sum::<f64>() / z_m.len() as f64
    };
    let each = |options: &EncoderOptions| {
        let figures = [
            quality(encoded(options, &plain, false), &bare),
            quality(encoded(options, &plain, false), &aberrated),
            quality(encoded(options, &corrected, false), &aberrated),
            quality(encoded(options, &plain, true), &aberrated),
        ];
        eprintln!("without, uncorrected, corrected by layers and by the offset: {figures:.2?} dB");
        figures
    };
    let [without, uncorrected, by_layers, by_offset] = each(&options);
    assert!(without > 22.0, "{without}");
    assert!(by_layers > without - 1.0, "{without} {by_layers}");
    assert!(by_offset > without - 1.0, "{without} {by_offset}");
    assert!(uncorrected < without - 5.0, "{without} {uncorrected}");
    // Additional layers and an offset never cost quality.
    let [_, _, layers_too, offset_too] = each(&fixed(Encoding::ANTI_ALIAS.into()));
    assert!(
        layers_too > by_layers && offset_too > by_offset,
        "{layers_too} {offset_too}"
    );
}
