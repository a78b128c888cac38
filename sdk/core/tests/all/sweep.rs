//! Compares the plane sweep with its naive oracle on every instruction set and tests its edge cases.
use crate::network_models;
use phasefront_core::Size;

use ndarray::{Array2, Array3};
use network_models::Model;
use num_complex::Complex32;
use phasefront_core::display::Display;
use phasefront_core::frame::RgbdFrame;
use phasefront_core::method::Method;
use phasefront_core::method::MethodPlan;
use phasefront_core::method::network;
use phasefront_core::method::network::Isa;
use phasefront_core::method::network::Network;
use phasefront_core::method::sweep::Sweep;
use phasefront_core::method::sweep::{SweepPlan, hidden, reference};
use std::sync::Arc;

/// Returns a display with a small volume, so that the naive oracle needs only a narrow black border.
fn display() -> Display {
    Display::from_toml("volume_depth_mm = 1.5").unwrap()
}

fn one_laser() -> Display {
    Display::from_toml("volume_depth_mm = 1.5\nwavelengths_nm = [532]").unwrap()
}

fn sweep() -> Sweep {
    Sweep {
        planes: 9,
        taps: 9,
        hidden_layers: 2,
        between_planes: true,
        tile: 16,
    }
}

/// Returns surfaces at several depths with sharp edges, one of them slanted, and fine colour.
fn frame(size: Size) -> RgbdFrame {
    let Size { width, height } = size;
    let depth = Array2::from_shape_fn((height, width), |(y, x)| {
        let (v, u) = (y as f32 / height as f32, x as f32 / width as f32);
        match () {
            () if (u - 0.3).hypot(v - 0.4) < 0.2 => 0.1,
            () if u > 0.6 && v < 0.7 => 0.35 + 0.2 * v,
            () if (u + v) < 0.35 => 0.62,
            () => 0.93,
        }
    });
    let rgb = Array3::from_shape_fn((3, height, width), |(c, y, x)| {
        ((c * 5 + y * 3 + x * x + y * x) % 11) as f32 / 10.0
    });
    RgbdFrame::new(rgb, depth).unwrap()
}

fn run(plan: &SweepPlan, frame: &RgbdFrame) -> Vec<Complex32> {
    let Size { width, height } = plan.size();
    // The previous contents must not matter.
    let mut field = vec![Complex32::new(f32::NAN, f32::NAN); frame.colours() * height * width];
    let mut scratch = plan.scratch();
    for _ in 0..2 {
        plan.field(frame, &mut field, &mut scratch).unwrap();
    }
    field
}

fn farthest(a: &[Complex32], b: &[Complex32]) -> f32 {
    assert_eq!(a.len(), b.len());
    let distances = a.iter().zip(b).map(|(a, b)| (a - b).norm());
    distances.fold(0.0, f32::max)
}

/// Returns the root mean square of the difference.
fn error(a: &[Complex32], b: &[Complex32]) -> f32 {
    let squares: f32 = a.iter().zip(b).map(|(a, b)| (a - b).norm_sqr()).sum();
    (squares / a.len() as f32).sqrt()
}

#[test]
fn the_sweep_is_its_oracle() {
    for (height, width, sweep, z_m) in [
        (33, 47, sweep(), 0.0),
        (
            41,
            16,
            Sweep {
                hidden_layers: 1,
                tile: 48,
                ..sweep()
            },
            0.0,
        ),
        (
            1,
            29,
            Sweep {
                hidden_layers: 0,
                ..sweep()
            },
            0.0,
        ),
        (30, 1, sweep(), 0.0),
        (37, 35, Sweep { planes: 1, ..sweep() }, 0.0),
        (
            37,
            35,
            Sweep {
                planes: 2,
                taps: 13,
                ..sweep()
            },
            0.0,
        ),
        (
            29,
            31,
            Sweep {
                between_planes: false,
                ..sweep()
            },
            0.0,
        ),
        (35, 37, sweep(), 2e-3),
        (35, 37, sweep(), -1e-3),
    ] {
        for display in [display(), one_laser()] {
            let frame = frame(Size { width, height }).for_display(&display);
            let plan = SweepPlan::new(Size { width, height }, &display, sweep, z_m).unwrap();
            let slow = reference::field(&frame, &display, sweep, z_m).unwrap();
            let fast = run(&plan, &frame);
            let (worst, error) = (farthest(&fast, &slow), error(&fast, &slow));
            let colours = display.colours();
            println!("{worst} {error}");
            assert!(
                worst < 2e-3 && error < 3e-4,
                "{width}×{height} {sweep:?} {z_m} {colours}: {worst} {error}"
            );
        }
    }
}

#[test]
fn the_worst_frames_are_right() {
    let (height, width) = (34, 38);
    let depths: [fn(usize, usize) -> f32; 5] = [
        |_, _| 0.0,
        |_, _| 1.0,
        |_, _| 0.5,
        |y, x| ((y * 31 + x * 17) % 23) as f32 / 22.0,
        |y, x| ((y + x) % 2) as f32,
    ];
    for (case, depth) in depths.into_iter().enumerate() {
        let depth = Array2::from_shape_fn((height, width), |(y, x)| depth(y, x));
        let frame = RgbdFrame::new(frame(Size { width, height }).rgb().to_owned(), depth).unwrap();
        let plan = SweepPlan::new(Size { width, height }, &display(), sweep(), 0.0).unwrap();
        let slow = reference::field(&frame, &display(), sweep(), 0.0).unwrap();
        let fast = run(&plan, &frame);
        let (worst, error) = (farthest(&fast, &slow), error(&fast, &slow));
        println!("{worst} {error}");
        assert!(worst < 1e-3 && error < 3e-4, "case {case}: {worst} {error}");
    }
}

#[test]
fn a_flat_frame_of_one_colour_stays_as_it_is_far_from_its_border() {
    let size = 140;
    let display = Display::default();
    let sweep = Sweep::for_display(&display);
    let plan = SweepPlan::new(
        Size {
            width: size,
            height: size,
        },
        &display,
        sweep,
        0.0,
    )
    .unwrap();
    for depth in [0.0, 0.3, 1.0] {
        let depth = Array2::from_elem((size, size), depth);
        let frame = RgbdFrame::new(Array3::from_elem((3, size, size), 0.6), depth).unwrap();
        for value in run(&plan, &frame)
            .iter()
            .skip(size * size / 2 + size / 2)
            .step_by(size * size)
        {
            // Fresnel fringes from the border remain.
            assert!((value - 0.6).norm() < 0.03, "{value}");
        }
    }
}

#[test]
fn slopes_have_no_stripes() {
    let (height, width) = (72, 64);
    let depth = Array2::from_shape_fn((height, width), |(y, x)| 0.1 + (8 * y + 3 * x) as f32 / 960.0);
    let frame = RgbdFrame::new(Array3::from_elem((3, height, width), 0.6), depth).unwrap();
    let of = |planes, between_planes| {
        let sweep = Sweep {
            planes,
            between_planes,
            ..sweep()
        };
        run(
            &SweepPlan::new(Size { width, height }, &display(), sweep, 0.0).unwrap(),
            &frame,
        )
    };
    let truth = of(300, false);
    let amplitude_error = |field: Vec<Complex32>| {
        let squares = field.iter().zip(&truth).map(|(a, b)| (a.norm() - b.norm()).powi(2));
        (squares.sum::<f32>() / truth.len() as f32).sqrt()
    };
    let (between, moved) = (amplitude_error(of(9, true)), amplitude_error(of(9, false)));
    assert!(between < 0.3 * moved, "{between} {moved}");
}

#[test]
fn what_cannot_be_swept_is_named() {
    let refused = |sweep: Sweep, z_m: f64| {
        let plan = SweepPlan::new(Size { width: 8, height: 8 }, &Display::default(), sweep, z_m);
        plan.err().unwrap().to_string()
    };
    let default = Sweep::for_display(&Display::default());
    for (sweep, z_m, message) in [
        (Sweep { planes: 0, ..default }, 0.0, "0 planes; 1 to 1024 are right"),
        (Sweep { taps: 8, ..default }, 0.0, "an odd number from 3 to 63"),
        (
            Sweep {
                taps: 3,
                planes: 8,
                ..default
            },
            0.0,
            "9 taps or 30 planes are right",
        ),
        (
            Sweep {
                hidden_layers: 3,
                ..default
            },
            0.0,
            "3 hidden layers; 0 to 2",
        ),
        (Sweep { tile: 20, ..default }, 0.0, "a multiple of 16"),
        (default, 0.1, "end at the midpoint and propagate from there"),
        (default, f64::NAN, "must be finite"),
    ] {
        let is = refused(sweep, z_m);
        assert!(is.contains(message), "{is}");
    }
}

#[test]
fn a_seeded_network_corrects_the_sweep() {
    let (height, width) = (37, 45);
    for (model, tolerance, planes, wavelengths_nm) in [
        (Model::new(4, 8), 1e-5, None, "[638, 520, 450]"),
        (Model::int8(5, 8), 0.05, None, "[638, 520, 450]"),
        (Model::new(4, 8), 1e-5, Some(24), "[638, 520, 450]"),
        // Colour 1, without stretched depth.
        (Model::new(4, 8), 1e-5, None, "[520]"),
        (Model::int8(5, 8), 0.05, Some(24), "[520]"),
    ] {
        let display = Display::from_toml(&format!("wavelengths_nm = {wavelengths_nm}")).unwrap();
        let frame = frame(Size { width, height }).for_display(&display);
        let sweep = match planes {
            Some(planes) => Sweep::of_planes(&display, planes),
            None => Sweep::for_display(&display),
        };
        let sweep = SweepPlan::new(Size { width, height }, &display, sweep, 0.0).unwrap();
        let seed = run(&sweep, &frame);
        let model = Model {
            inputs: 10,
            input: "seeded",
            seed_planes: planes,
            ..model
        };
        let network = Arc::new(Network::from_onnx(&model.bytes()).unwrap());
        // One laser is used for all three colours of the input and gives one colour of the output.
        let (rgb, seeds) = (frame.rgb(), seed.repeat(3 / frame.colours()));
        let rgb = rgb.broadcast((3, height, width)).unwrap();
        let mut input: Vec<f32> = rgb.iter().chain(frame.depth()).map(|v| v - 0.5).collect();
        input.extend(seeds.iter().map(|u| 0.5 * (u.re - 0.5)));
        input.extend(seeds.iter().map(|u| 0.5 * u.im));
        let output = network::reference::run(network.chain().unwrap(), &input, Size { width, height });
        let (re, im) = output.split_at(seeds.len());
        let expected = (seeds.iter().zip(re).zip(im)).map(|((u, re), im)| u + Complex32::new(*re, *im));
        let first = network.colour(&display).unwrap().unwrap_or(0) * height * width;
        let expected: Vec<_> = expected.skip(first).take(seed.len()).collect();
        let plan = MethodPlan::new(Size { width, height }, Method::trained(network), &display).unwrap();
        let mut field = vec![Complex32::ZERO; seed.len()];
        plan.field(&frame, &mut field, &mut plan.scratch()).unwrap();
        let worst = farthest(&field, &expected);
        assert!(worst < tolerance, "{worst}");
    }
}

#[test]
fn auto_gives_each_frame_what_suits_its_depth() {
    let (height, width) = (80, 100);
    // A modulator to which a sweep alone would continue.
    let display = Display::default().with_offset_m(2e-3).unwrap();
    let network = Arc::new(Network::from_onnx(&Model::new(4, 8).bytes()).unwrap());
    let default = Sweep::for_display(&display);
    let square = |y: usize, x: usize| (25..55).contains(&y) && (30..70).contains(&x);
    let frame = |ramp: usize| {
        let rgb = Array3::from_shape_fn((3, height, width), |(_, y, x)| 0.2 + 0.6 * f32::from(square(y, x)));
        let depth = Array2::from_shape_fn((height, width), |(y, x)| {
            let inside = (0..ramp).filter(|i| square(y, x + i)).count();
            0.8 - 0.5 * inside as f32 / ramp as f32
        });
        RgbdFrame::new(rgb, depth).unwrap()
    };
    let made = |plan: &MethodPlan, frame: &RgbdFrame| {
        let mut field = vec![Complex32::ZERO; 3 * height * width];
        plan.field(frame, &mut field, &mut plan.scratch()).unwrap();
        field
    };
    let plan = |method| MethodPlan::new(Size { width, height }, method, &display).unwrap();
    let either = plan(Method::Auto(default, network.clone()));
    assert!(either.z_m() == 0.0 && either.engine().is_some());
    let midpoint = SweepPlan::new(Size { width, height }, &display, default, 0.0).unwrap();
    let (sharp, soft) = (frame(1), frame(5));
    assert!(made(&either, &sharp) == run(&midpoint, &sharp));
    assert!(made(&either, &soft) == made(&plan(Method::trained(network)), &soft));
}

#[test]
fn tiles_are_the_whole_frame() {
    let display = Display::default();
    let frame = frame(Size {
        width: 170,
        height: 150,
    });
    let of = |tile| {
        let sweep = Sweep {
            tile,
            ..Sweep::for_display(&display)
        };
        run(
            &SweepPlan::new(
                Size {
                    width: 170,
                    height: 150,
                },
                &display,
                sweep,
                0.0,
            )
            .unwrap(),
            &frame,
        )
    };
    let whole = of(512);
    // Tiles merge other steps, which is rounding, and lack a little light near their edges.
    for tile in [32, 64, 144] {
        let tiles = of(tile);
        let (worst, error) = (farthest(&tiles, &whole), error(&tiles, &whole));
        println!("{worst} {error}");
        assert!(worst < 5e-3 && error < 4e-4, "tiles of {tile}: {worst} {error}");
    }
}

#[test]
fn instruction_sets_give_the_same_bits() {
    let frame = frame(Size { width: 51, height: 45 });
    let of = |isa| {
        let plan = SweepPlan::new(Size { width: 51, height: 45 }, &display(), sweep(), 0.0).unwrap();
        run(&plan.on(isa).unwrap(), &frame)
    };
    let plain = of(Isa::Portable);
    for isa in Isa::fir() {
        assert!(of(isa) == plain, "{isa}");
    }
}

#[test]
fn hidden_surfaces_are_their_oracle() {
    for (height, width, reach) in [(70, 45, 7), (33, 64, 30), (1, 9, 3), (9, 1, 40)] {
        let noise = Array2::from_shape_fn((height, width), |(y, x)| ((x * 7 + y * 13 + x * y) % 17) as f32 / 16.0);
        for depth in [noise, frame(Size { width, height }).depth().to_owned()] {
            let depth = depth.as_slice().unwrap();
            let plan = hidden::Hidden::new(Size { width, height }, reach);
            let mut sources = vec![0; 2 * depth.len()];
            plan.find(depth, &mut sources, &mut plan.scratch());
            assert!(sources == hidden::reference(depth, Size { width, height }, reach));
        }
    }
}

#[test]
fn what_light_spreads_too_far_in_is_refused_at_once() {
    for text in ["pitch_um = 1.0", "volume_depth_mm = 400"] {
        let display = Display::from_toml(text).unwrap();
        let refused = SweepPlan::new(
            Size { width: 16, height: 12 },
            &display,
            Sweep::for_display(&display),
            0.0,
        )
        .map(|_| ());
        let message = refused.unwrap_err().to_string();
        assert!(message.contains("512 are the most: a volume of"), "{message}");
    }
}
