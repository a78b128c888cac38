//! Compares the focal stack and the steps of natural focus with their naive forms, and tests what they bring.
use crate::encode::through_aperture;

use ndarray::{Array2, Array3};
use phasefront_core::Size;
use phasefront_core::display::Display;
use phasefront_core::display::illumination::Illumination;
use phasefront_core::display::levels::LevelsMut;
use phasefront_core::display::target::Target;
use phasefront_core::encode::EncoderOptions;
use phasefront_core::encode::natural::{self, NaturalSteps};
use phasefront_core::focus::{self, FocalStack, motion_per_m};
use phasefront_core::frame::RgbdFrame;
use phasefront_core::method::Method;
use phasefront_core::method::sweep::Sweep;
use phasefront_core::optics::asm::{Padding, padded_size};
use phasefront_core::pipeline::Pipeline;
use phasefront_core::pipeline::display_plan::DisplayPlan;
use rustfft::num_complex::Complex64;

/// A near square before a slope, with a texture of its own on each.
fn frame(colours: usize, size: Size) -> RgbdFrame {
    let (h, w) = size.shape();
    let square = |y: usize, x: usize| (h / 4..h / 2 + 1).contains(&y) && (w / 3..w - w / 4).contains(&x);
    let rgb = Array3::from_shape_fn((colours, h, w), |(c, y, x)| {
        let texture = ((x * 7 + y * 13 + c * 29) % 11) as f32 / 11.0;
        if square(y, x) {
            1.0 - 0.3 * texture
        } else {
            0.6 * texture
        }
    });
    let depth = Array2::from_shape_fn((h, w), |(y, x)| {
        if square(y, x) {
            0.1
        } else {
            0.5 + 0.5 * x as f32 / w as f32
        }
    });
    RgbdFrame::new(rgb, depth).unwrap()
}

#[test]
fn the_stack_agrees_with_every_point_at_every_pinhole() {
    for (toml, (h, w), z_mm) in [
        ("", (33, 47), vec![-2.7, 0.4, 3.0]),
        ("wavelengths_nm = [532]", (20, 66), vec![0.0]),
        ("aperture_radius = 0.5\npitch_um = 6.4", (17, 9), vec![2.0]),
        ("volume_depth_mm = 0.01", (5, 7), vec![0.0]),
        ("", (1, 1), vec![1.0]),
    ] {
        let display = Display::from_toml(toml).unwrap();
        let size = Size::from_shape((h, w));
        let frame = frame(display.colours(), size);
        let (rgb, depth) = frame.values();
        let z_m: Vec<_> = z_mm.iter().map(|z| z * 1e-3).collect();
        let stack = FocalStack::new(size, &display, &z_m).unwrap();
        let mut scratch = stack.scratch();
        stack.prepare(depth, &mut scratch);
        for (colour, amplitude) in rgb.chunks_exact(h * w).enumerate() {
            for index in 0..z_m.len() {
                let mut out = vec![0.0; h * w];
                stack.write(colour, index, amplitude, &mut out, &mut scratch);
                assert!(
                    out == focus::reference(&stack, colour, index, amplitude, depth),
                    "{toml}: {w}×{h}"
                );
            }
        }
    }
}

#[test]
fn a_point_is_sharp_in_focus_and_a_disc_out_of_focus() {
    let (h, w) = (61, 61);
    let size = Size { width: w, height: h };
    let display = Display::default();
    let mut frame = RgbdFrame::black(3, size);
    let (rgb, depth) = frame.planes_mut();
    rgb[h * w + 30 * w + 30] = 1.0;
    depth.fill(0.0);
    let (near_m, per_m) = (
        display.z_of_depth(0.0),
        motion_per_m(&display, display.wavelengths_m()[1]),
    );
    // A smooth sin θ ≈ θ: 3 mm are 12.2 pixels for green light.
    assert!((per_m * 3e-3 - 3e-3 * 520e-9 / 16e-6 / 8e-6).abs() < 0.01);
    let z_m = [near_m, near_m - 3e-3];
    let stack = FocalStack::new(size, &display, &z_m).unwrap();
    let (rgb, depth) = frame.values();
    let mut scratch = stack.scratch();
    stack.prepare(depth, &mut scratch);
    let mut planes = [0, 1].map(|index| {
        let mut out = vec![0.0; h * w];
        stack.write(1, index, &rgb[h * w..2 * h * w], &mut out, &mut scratch);
        out
    });
    assert!(planes[0] == rgb[h * w..2 * h * w]);
    planes[1].iter_mut().for_each(|a| *a *= *a);
    assert!((planes[1].iter().sum::<f32>() - 1.0).abs() < 1e-3);
    let mean_square: f32 = (planes[1].iter().enumerate())
        .map(|(at, light)| light * (((at / w) as f32 - 30.0).powi(2) + ((at % w) as f32 - 30.0).powi(2)))
        .sum();
    // The mean square radius of a disc of radius r is r²/2.
    let radius = (2.0 * f64::from(mean_square)).sqrt();
    assert!((radius - per_m * 3e-3).abs() < 0.5, "{radius}");
}

#[test]
fn every_plane_has_its_turn() {
    for planes in 3..=21 {
        let turns = natural::turns(planes);
        let steps = (5..5 + turns).map(|step| natural::turn(step, planes));
        assert!(steps.clone().all(|turn| turn.len() >= 3), "{planes}");
        let mut seen: Vec<_> = steps.flatten().collect();
        seen.sort_unstable();
        assert_eq!(seen, (0..planes).collect::<Vec<_>>());
    }
}

/// Returns w_p of each plane of `z_m` for pixels at `pixels_m`.
fn weights(pixels_m: &[f64], z_m: &[f64], per_m: f64) -> Vec<Vec<f64>> {
    let weight = |pixel_m: &f64, z_m: &f64| {
        let blur = (pixel_m - z_m) * per_m;
        1.0 + natural::IN_FOCUS * (-(blur / natural::FOCUS_PX).powi(2)).exp()
    };
    let sum = |pixel_m: &f64| z_m.iter().map(|z_m| weight(pixel_m, z_m)).sum::<f64>();
    let share = |pixel_m: &f64, z: &f64| weight(pixel_m, z) * z_m.len() as f64 / sum(pixel_m);
    let plane = |z: &f64| pixels_m.iter().map(|pixel_m| share(pixel_m, z)).collect();
    z_m.iter().map(plane).collect()
}

#[test]
fn steps_of_natural_focus_agree_with_sums_in_f64() {
    const SCALE: f32 = 0.9;
    let beam = Array3::from_shape_fn((3, 4, 7), |(c, y, x)| 1.0 / (1.0 + (c + y * 2 + x) as f32 / 9.0));
    let laser = Illumination::new(beam.view()).unwrap();
    for (toml, (h, w), light, maps, steps) in [
        ("", (24, 37), None, 1, 1),
        ("offset_mm = 2\naperture_radius = 0.9", (30, 21), Some(&laser), 1, 3),
        ("wavelengths_nm = [532]\noffset_mm = -1", (24, 37), None, 3, 2),
        ("volume_depth_mm = 0.5", (20, 18), None, 4, 2),
        ("", (1, 5), None, 2, 2),
    ] {
        let size = Size::from_shape((h, w));
        let display = Display::from_toml(toml).unwrap();
        let target = Target {
            illumination: light.cloned(),
            ..display.clone().with_size(size).unwrap().into()
        };
        let (frame, colours) = (frame(display.colours(), size), display.wavelengths_m());
        let start = |map: usize| (0..colours.len() * h * w).map(move |i| ((i + map) * 37 % 628) as f32 / 100.0);
        let start: Vec<Vec<f32>> = (0..maps).map(|map| start(map).collect()).collect();
        let mut results = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().unwrap().install(|| {
                let plan = NaturalSteps::new(size, &target, steps).unwrap();
                let (mut phases, mut scratch) = (start.clone(), plan.scratch(maps));
                plan.aim(&frame, &mut scratch);
                let mut all: Vec<_> = phases.iter_mut().map(Vec::as_mut_slice).collect();
                plan.correct_maps(SCALE, &mut all, &mut scratch);
                phases
            })
        });
        assert!(results[0] == results[1], "{w}×{h}: other bits on other threads");
        let got = std::mem::take(&mut results[0]);
        let (z_m, (rgb, depth)) = (natural::planes(&display), frame.values());
        let farthest_m = z_m.iter().map(|z| (z - display.offset_m()).abs()).fold(0.0, f64::max);
        let longest_m = display.longest_wavelength_m();
        let padded = padded_size(size, display.pitch_m(), longest_m, farthest_m, Padding::Reach).unwrap();
        let stack = FocalStack::new(size, &display, &z_m).unwrap();
        for (c, amplitude) in rgb.chunks_exact(h * w).enumerate() {
            let amplitudes = |index: usize| -> Vec<f64> {
                let plane = focus::reference(&stack, c, index, amplitude, depth);
                plane.iter().map(|a| f64::from(*a) / f64::from(SCALE)).collect()
            };
            let per_m = motion_per_m(&display, colours[c]);
            let z_of_depth: Vec<_> = depth.iter().map(|d| display.z_of_depth((*d).into())).collect();
            let weights = weights(&z_of_depth, &z_m, per_m);
            let wanted: Vec<_> = (0..z_m.len()).map(amplitudes).collect();
            let light = |i: usize| light.map_or(1.0, |laser| 1.0 / f64::from(laser.gain(c, i / w, i % w, size)));
            let light: Vec<f64> = (0..h * w).map(light).collect();
            let way = |distance_m: f64, u: &[Complex64]| {
                through_aperture(u, size, padded, colours[c], distance_m, display.aperture_radius())
            };
            let mut expected: Vec<Vec<f64>> = (start.iter())
                .map(|map| {
                    map[c * h * w..][..h * w]
                        .iter()
                        .map(|phase| f64::from(*phase))
                        .collect()
                })
                .collect();
            natural::reference(
                |p, u| way(z_m[p] - display.offset_m(), u),
                |p, u| way(display.offset_m() - z_m[p], u),
                (&wanted, &weights),
                &mut expected,
                &light,
                steps,
            );
            for (expected, got) in expected.iter().zip(&got) {
                let got = &got[c * h * w..][..h * w];
                let apart = |(e, g): (&f64, &f32)| (Complex64::cis(*e) - Complex64::cis(f64::from(*g))).norm_sqr();
                let error = (expected.iter().zip(got).map(apart).sum::<f64>() / (h * w) as f64).sqrt();
                assert!(error < 2e-3, "{toml}, {w}×{h}, colour {c}: {error}");
            }
        }
    }
}

/// Returns the mean square difference between the displayed amplitudes of one colour's `levels` and the focal stack.
fn error(levels: &[u8], scale: f32, frame: &RgbdFrame, display: &Display) -> f64 {
    let size = frame.size();
    let (h, w) = size.shape();
    let z_m = [-2e-3, 0.0, 2e-3];
    let stack = FocalStack::new(size, display, &z_m).unwrap();
    let (rgb, depth) = frame.values();
    let light = levels
        .iter()
        .map(|level| Complex64::from_polar(scale.into(), f64::from(*level) * std::f64::consts::TAU / 256.0));
    let light: Vec<_> = light.collect();
    let wavelength_m = display.wavelengths_m()[0];
    let padded = padded_size(size, display.pitch_m(), wavelength_m, 4e-3, Padding::Reach).unwrap();
    let squares = z_m.iter().enumerate().map(|(index, z)| {
        let seen = through_aperture(&light, size, padded, wavelength_m, z - display.offset_m(), 1.0);
        let wanted = focus::reference(&stack, 0, index, rgb, depth);
        let inside = |at: &usize| (12..h - 12).contains(&(at / w)) && (12..w - 12).contains(&(at % w));
        let values = (0..h * w)
            .filter(inside)
            .map(|at| (seen[at].norm() - f64::from(wanted[at])).powi(2));
        values.sum::<f64>()
    });
    squares.sum::<f64>() / (3 * (h - 24) * (w - 24)) as f64
}

#[test]
fn steps_bring_the_light_to_that_of_the_world_and_go_on_in_video() {
    let toml = "width = 96\nheight = 72\nwavelengths_nm = [520]\noffset_mm = 1";
    let display = Display::from_toml(toml).unwrap();
    let (target, frame) = (Target::from(&display), frame(1, display.size()));
    let made = |focus_steps: usize, frames: usize| {
        let options = EncoderOptions {
            focus_steps,
            ..EncoderOptions::default()
        };
        let method = Method::Sweep(Sweep::for_display(&display));
        let pipeline = Pipeline::new(frame.size(), method, &target, &options).unwrap();
        let (mut levels, mut scratch) = (vec![0; 72 * 96], pipeline.scratch());
        let mut past = None;
        for _ in 0..frames {
            let out = LevelsMut::Bytes(&mut levels);
            let report = pipeline.process_after(past, &frame, out, &mut scratch).unwrap();
            past = Some(phasefront_core::frame::Past {
                scale: report.scale,
                elapsed: std::time::Duration::ZERO,
            });
        }
        error(&levels, past.unwrap().scale, &frame, &display)
    };
    let [none, few, many, in_video] = [made(0, 1), made(5, 1), made(30, 1), made(5, 6)];
    assert!(few < 0.6 * none && many < 0.4 * none, "{none} {few} {many}");
    assert!(in_video < 0.8 * few, "{few} {in_video}");
}

#[test]
fn what_natural_focus_cannot_do_is_refused() {
    let refused = |result: phasefront_core::runtime::error::Result<()>, what: &str| {
        let why = result.err().unwrap().to_string();
        assert!(why.contains(what) && !why.contains('\n'), "{why}");
    };
    let options = |focus_steps, midpoint_steps| EncoderOptions {
        focus_steps,
        midpoint_steps,
        ..EncoderOptions::default()
    };
    refused(options(1001, 0).check(), "at most 1000");
    refused(options(1, 1).check(), "give one of the two");
    let target = Target::default();
    let alone = DisplayPlan::new(Size { width: 6, height: 4 }, &target, &options(1, 0));
    refused(alone.map(|_| ()), "need the RGB-D frame");
    let display = Display::from_toml("volume_depth_mm = 900").unwrap();
    refused(
        FocalStack::new(Size { width: 6, height: 4 }, &display, &[0.0]).map(|_| ()),
        "a volume of",
    );
}
