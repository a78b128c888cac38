//! Checks that the hot calls of plans allocate nothing. There is only one test so that no other test allocates
//! meanwhile.
#![allow(clippy::unwrap_used)]

#[path = "../../../tests/counting.rs"]
mod counting;
#[path = "../../../tests/network_models.rs"]
mod network_models;

use counting::ALLOCATIONS;
use ndarray::{Array2, Array3};
use network_models::Model;
use num_complex::Complex32;
use phasefront_core::Size;
use phasefront_core::depth::condition::Conditioner;
use phasefront_core::display::Display;
use phasefront_core::display::illumination::Illumination;
use phasefront_core::display::levels::{Levels, LevelsMut};
use phasefront_core::display::model::{self, ColourModel};
use phasefront_core::display::panel::Flatness;
use phasefront_core::display::panel::Panel;
use phasefront_core::display::registration::Registration;
use phasefront_core::display::response::Response;
use phasefront_core::display::response::per_pixel;
use phasefront_core::display::response::per_pixel::PerPixel;
use phasefront_core::display::target::Target;
use phasefront_core::encode::{EncoderOptions, Encoding};
use phasefront_core::frame::{ColourFormat, ColourImage, Orientation, Plane};
use phasefront_core::frame::{ColourPlan, Crop, LightPlan, RgbEncoding};
use phasefront_core::frame::{Past, RgbdFrame};
use phasefront_core::method::Method;
use phasefront_core::method::MethodPlan;
use phasefront_core::method::network::Network;
use phasefront_core::method::sweep::Sweep;
use phasefront_core::optics::aperture::{Aperture, Opening};
use phasefront_core::optics::asm::{Padding, Propagator};
use phasefront_core::optics::zernike::Aberration;
use phasefront_core::output::{Layout, Output, Placement};
use phasefront_core::pipeline::Pipeline;
use phasefront_core::pipeline::display_plan::DisplayPlan;
use phasefront_core::view::preview::Preview;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

fn count(mut call: impl FnMut()) -> usize {
    // The first calls may grow the pool's queues. Later calls may grow a network's memory when more bands than before
    // happen to run at once. An allocation by the call itself occurs in every call.
    for _ in 0..3 {
        call();
    }
    let counted = (0..8).map(|_| {
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        call();
        ALLOCATIONS.load(Ordering::Relaxed) - before
    });
    counted.min().unwrap_or_default()
}

/// Tests colour, depth and a preview, on the current thread pool.
fn camera_frames_and_previews() {
    let (h, w) = (30, 40);
    let bytes: Vec<u8> = (0..4 * 50 * 60).map(|i| (i * 37 % 251) as u8).collect();
    let image = ColourImage::new(
        ColourFormat::Rgba,
        Size { width: 60, height: 50 },
        &[Plane::new(&bytes, 240, 4)],
    )
    .unwrap();
    let plan = ColourPlan::new(&image, Orientation::default(), Size { width: w, height: h }).unwrap();
    let mut scratch = plan.scratch();
    let mut rgb = vec![0.0; 3 * h * w];
    let convert = || plan.convert(&image, &mut rgb, &mut scratch).unwrap();
    assert_eq!(count(convert), 0);
    let light = LightPlan::new(RgbEncoding::Srgb, &Display::default());
    let plan = plan.with_light(light.clone());
    let mut scratch = plan.scratch();
    let convert = || plan.convert(&image, &mut rgb, &mut scratch).unwrap();
    assert_eq!(count(convert), 0);
    let (light, picture) = (light.unwrap(), vec![0.5; 3 * h * w]);
    assert_eq!(count(|| light.convert(&picture, &mut rgb)), 0);
    let plan = Conditioner::new(
        Size { width: 20, height: 15 },
        Crop::cover(Size { width: 20, height: 15 }, Size { width: w, height: h }),
        Size { width: w, height: h },
        false,
    )
    .unwrap();
    let mut scratch = plan.scratch();
    let depth: Vec<f32> = (0..300)
        .map(|i| if i % 7 == 0 { f32::NAN } else { (i % 20) as f32 / 20.0 })
        .collect();
    let mut conditioned = vec![0.0; h * w];
    let condition = || plan.condition(&depth, &rgb, &mut conditioned, &mut scratch).unwrap();
    assert_eq!(count(condition), 0);
    let plan = Preview::new(
        Size { width: w, height: h },
        &Target::default(),
        2e-3,
        Size { width: 20, height: 20 },
    )
    .unwrap();
    let mut scratch = plan.scratch();
    let (levels, mut rgba) = (vec![3; 3 * h * w], vec![0; 1600]);
    let look = || {
        plan.look(&levels, 1.0, (Layout::Rgba, &mut rgba, 80), &mut scratch)
            .unwrap()
    };
    assert_eq!(count(look), 0);
    let plan = Output::new(
        &Target::default(),
        Size { width: w, height: h },
        Placement::centred(Layout::Bgra),
    )
    .unwrap();
    let mut image = vec![0; plan.image_bytes()];
    let write = || {
        plan.write(Levels::Bytes(&levels), 0, &mut image, plan.row_bytes())
            .unwrap()
    };
    assert_eq!(count(write), 0);
}

/// Returns a target with all possible results of calibration and bench measurements.
fn calibrated(display: &Display, Size { width: w, height: h }: Size) -> Target {
    let (rows, columns) = per_pixel::nodes(Size { width: w, height: h }, 8);
    let levels_of = |i: usize| (i % 9) as f32 * 32.0;
    let table: Vec<f32> = (0..27 * rows * columns).map(levels_of).collect();
    let turns = vec![6.0; 3 * rows * columns];
    let table = PerPixel::new(Size { width: w, height: h }, 8, 8, &table, &turns).unwrap();
    let laser = Illumination::new(ndarray::Array3::ones((3, 5, 6)).view()).unwrap();
    let correction = Aberration::new([[0.1, 0.2, 0.3, 0.4, 0.5]; 3]).unwrap();
    let flatness = Flatness::new(Size { width: w, height: h }, (0..h * w).map(|i| 7 * i as u16).collect()).unwrap();
    Target {
        display: display.clone().with_size(Size { width: w, height: h }).unwrap(),
        panel: Panel {
            flatness: Some(flatness),
            ..Panel::default()
        },
        registration: Registration {
            scale: vec![1.01, 1.0, 0.99],
            ..Registration::default()
        },
        response: Response::PerPixel(table.into()),
        illumination: Some(laser),
        correction: Some(correction),
        model: None,
    }
}

/// Tests whole frames on a display of one laser, on the current thread pool.
fn one_laser(frame: &RgbdFrame, seeded: Arc<Network>) {
    let display = Display::from_toml("wavelengths_nm = [520]\noffset_mm = 6").unwrap();
    let Size { width: w, height: h } = frame.size();
    let frame = frame.clone().for_display(&display);
    let mut levels = vec![0; h * w];
    let model = model::Model::new((3, 4), vec![ColourModel::ideal((3, 4))]).unwrap();
    let learned = Target {
        model: Some(model.into()),
        ..Target::from(display.clone().with_size(Size { width: w, height: h }).unwrap())
    };
    let steps = EncoderOptions {
        midpoint_steps: 2,
        ..Encoding::ANTI_ALIAS.into()
    };
    let sweep = Method::Sweep(Sweep::for_display(&display));
    let plain = (Target::from(&display), Encoding::ANTI_ALIAS.into());
    for (method, (target, options)) in [
        (sweep.clone(), plain.clone()),
        (Method::trained(seeded), plain),
        (sweep, (learned, steps)),
    ] {
        let plan = Pipeline::new(Size { width: w, height: h }, method.clone(), &target, &options).unwrap();
        let mut scratch = plan.scratch();
        let mut process = || {
            plan.process(&frame, &mut levels, &mut scratch).unwrap();
        };
        // The first frame allocates the field.
        process();
        assert_eq!(count(process), 0, "one laser, {method:?}");
    }
}

/// Tests frames of a video in which a part changes, on the current thread pool.
fn what_stands_still(frame: &RgbdFrame) {
    let method = Method::Sweep(Sweep::for_display(&Display::default()));
    let plan = Pipeline::new(frame.size(), method, &Target::default(), &Encoding::ANTI_ALIAS.into()).unwrap();
    let mut scratch = plan.scratch();
    plan.keep_standing(&mut scratch);
    let past = Some(Past {
        scale: 1.0,
        elapsed: Duration::from_millis(33),
    });
    let (mut frame, mut levels) = (frame.clone(), vec![0; 3 * frame.size().pixels()]);
    let mut process = || {
        frame.planes_mut().0[..200].iter_mut().for_each(|a| *a = 1.0 - *a);
        plan.process_after(past, &frame, LevelsMut::Bytes(&mut levels), &mut scratch)
            .unwrap();
    };
    // The first frame allocates the field.
    process();
    assert_eq!(count(process), 0, "what stands still");
}

#[test]
fn hot_calls_allocate_nothing() {
    let (h, w) = (61, 47);
    let mut plane = vec![Complex32::new(0.5, 0.1); h * w];
    let mut field = vec![Complex32::new(0.5, 0.1); 3 * h * w];
    let mut levels = vec![0; 3 * h * w];
    let display = Display::default().with_offset_m(6e-3).unwrap();
    let prefilter = Model {
        input: "blurred-field",
        ..Model::prefilter("6")
    };
    let prefilter = Arc::new(Network::from_onnx(&prefilter.bytes()).unwrap());
    let seeded = Model {
        inputs: 10,
        input: "seeded",
        ..Model::new(4, 8)
    };
    let seeded = Arc::new(Network::from_onnx(&seeded.bytes()).unwrap());
    let swept = RgbdFrame::new(
        Array3::from_elem((3, h, w), 0.4),
        Array2::from_shape_fn((h, w), |(y, x)| ((x / 9 + y / 7) % 5) as f32 / 4.0),
    )
    .unwrap();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let plan = Propagator::new(Size { width: w, height: h }, 8e-6, 520e-9, 3e-3, Padding::Reach).unwrap();
            let mut scratch = plan.scratch();
            assert_eq!(count(|| plan.propagate(&mut plane, &mut scratch)), 0);
            let plan = Aperture::new(Size { width: w, height: h }, Opening::centred(1.0)).unwrap();
            let mut scratch = plan.scratch();
            assert_eq!(count(|| plan.filter(&mut plane, &mut scratch)), 0);
            for encoding in [
                Encoding::DoublePhase,
                Encoding::ANTI_ALIAS,
                Encoding::BAND_LIMIT,
                Encoding::Deep(prefilter.clone()),
            ] {
                let plan = DisplayPlan::new(
                    Size { width: w, height: h },
                    &(&display).into(),
                    &encoding.clone().into(),
                )
                .unwrap();
                let mut scratch = plan.scratch();
                let frame = || {
                    plan.propagate(&mut field, &mut scratch);
                    plan.modulate(None, &mut field, LevelsMut::Bytes(&mut levels), &mut scratch);
                };
                assert_eq!(count(frame), 0, "{encoding:?}");
            }
            let target = calibrated(&display, Size { width: w, height: h });
            let plan = DisplayPlan::new(Size { width: w, height: h }, &target, &Encoding::DoublePhase.into()).unwrap();
            let mut scratch = plan.scratch();
            let frame = || {
                plan.propagate(&mut field, &mut scratch);
                plan.modulate(None, &mut field, LevelsMut::Bytes(&mut levels), &mut scratch);
            };
            assert_eq!(count(frame), 0, "a calibrated display");
            one_laser(&swept, seeded.clone());
            for method in [
                Method::Sweep(Sweep::for_display(&display)),
                Method::trained(seeded.clone()),
                Method::Auto(Sweep::for_display(&display), seeded.clone()),
            ] {
                let plan = MethodPlan::new(Size { width: w, height: h }, method.clone(), &display).unwrap();
                let mut scratch = plan.scratch();
                let sweep = || plan.field(&swept, &mut field, &mut scratch).unwrap();
                assert_eq!(count(sweep), 0, "{method:?}");
            }
            what_stands_still(&swept);
            camera_frames_and_previews();
        });
    }
}
