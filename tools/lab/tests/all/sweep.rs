//! Tests the plane sweep on displays for which no network was trained. The sweep and exact waves on the same surfaces
//! are compared with the ground truth. A captured frame must show no seams between tiles.
use crate::skip;
use phasefront::Size;

use ndarray::Array3;
use num_complex::Complex32;
use phasefront::input::{ColourFormat, ColourImage, Orientation, Plane};
use phasefront::{Display, RgbdFrame, Sweep};
use phasefront_core::depth::DepthUnit;
use phasefront_core::depth::condition::Conditioner;
use phasefront_core::frame::{ColourPlan, Crop};
use phasefront_core::method::sweep;
use phasefront_core::method::sweep::SweepPlan;
use phasefront_core::optics::asm::{Padding, Propagator};
use phasefront_core::optics::metrics;
use phasefront_core::view::refocus::Refocus;
use phasefront_exact::sm_lbm;
use phasefront_exact::truth::filled;
use phasefront_io::ldi::Ldi;
use phasefront_io::picture::{self, depth_map};
use phasefront_lab::scene;
use std::path::Path;

const SIZE: usize = 96;
/// The number of planes of the ground truth.
const TRUE_PLANES: usize = 200;

fn scene_of(seed: u64) -> (Ldi, RgbdFrame) {
    let scene = scene::random_scene(
        seed,
        Size {
            width: SIZE,
            height: SIZE,
        },
    );
    let ldi = scene::render_ldi_reference(
        &scene,
        Size {
            width: SIZE,
            height: SIZE,
        },
        5,
    )
    .unwrap();
    let front = &ldi.layers[0];
    let depth = front.depth.mapv(|d| if d.is_nan() { 1.0 } else { d });
    let mut rgb = front.rgb.clone();
    for ((_, y, x), value) in rgb.indexed_iter_mut() {
        if front.depth[(y, x)].is_nan() {
            *value = 0.0;
        }
    }
    (ldi.clone(), RgbdFrame::new(rgb, depth).unwrap())
}

/// Propagates a midpoint hologram to the display.
fn to_display(mut field: Array3<Complex32>, display: &Display) -> Array3<Complex32> {
    if display.offset_m() != 0.0 {
        let plans = Propagator::for_colours(
            Size {
                width: SIZE,
                height: SIZE,
            },
            display.pitch_m(),
            display.wavelengths_m(),
            display.offset_m(),
            Padding::Reach,
        );
        let values = field.as_slice_mut().unwrap();
        for (plan, plane) in plans.unwrap().iter().zip(values.chunks_exact_mut(SIZE * SIZE)) {
            plan.propagate(plane, &mut plan.scratch());
        }
    }
    field
}

fn decibels(field: &Array3<Complex32>, truth: &Array3<Complex32>) -> f64 {
    let [a, b] = [field, truth].map(|field| field.mapv(|u| u.norm()));
    metrics::compare(a.view(), b.view()).unwrap().psnr_overall
}

#[test]
fn other_displays_need_no_training() {
    for toml in [
        "",
        "pitch_um = 6.4",
        "pitch_um = 3.74",
        "volume_depth_mm = 12.0",
        "wavelengths_nm = [660, 532, 473]",
        "wavelengths_nm = [638, 520, 450]\npitch_um = 4.5\nvolume_depth_mm = 3.0",
        "offset_mm = 6.0",
        "offset_mm = -10.0",
        "offset_mm = 20.0",
    ] {
        let display = Display::from_toml(toml).unwrap();
        let sweep = Sweep::for_display(&display);
        let offset_m = display.offset_m();
        let ends_there = sweep::reaches(&display, offset_m);
        let z_m = if ends_there { offset_m } else { 0.0 };
        let plan = SweepPlan::new(
            Size {
                width: SIZE,
                height: SIZE,
            },
            &display,
            sweep,
            z_m,
        )
        .unwrap();
        let (mut swept, mut exact) = (0.0, 0.0);
        for seed in [7, 8] {
            let (ldi, frame) = scene_of(seed);
            let waves = |ldi: &Ldi, planes| {
                let field = sm_lbm::hologram(ldi, &display, planes, &|_, _| {}).unwrap();
                to_display(field, &display)
            };
            let truth = waves(&ldi, TRUE_PLANES);
            exact += decibels(&waves(&filled(&frame, &display).unwrap(), sweep.planes), &truth) / 2.0;
            let mut field = Array3::from_elem((3, SIZE, SIZE), Complex32::ZERO);
            let values = field.as_slice_mut().unwrap();
            plan.field(&frame, values, &mut plan.scratch()).unwrap();
            let field = if ends_there { field } else { to_display(field, &display) };
            swept += decibels(&field, &truth) / 2.0;
        }
        println!("{toml:?}: {sweep:?} sweep {swept:.2} dB, exact waves {exact:.2} dB");
        assert!(swept > exact - 1.5, "{toml:?}: {swept} dB beside {exact} dB");
    }
}

/// Returns a captured frame of 640×480, converted to 1080p as a session does.
fn captured(folder: &Path) -> RgbdFrame {
    const OUT: Size = Size {
        width: 1920,
        height: 1080,
    };
    let (size, bytes) = picture::read_rgb_bytes(&folder.join("color_0.jpg")).unwrap();
    let plane = Plane::new(&bytes, 3 * size.width, 3);
    let image = ColourImage::new(ColourFormat::Rgb, size, &[plane]).unwrap();
    let plan = ColourPlan::new(&image, Orientation::default(), OUT).unwrap();
    let mut rgb = Array3::zeros((3, OUT.height, OUT.width));
    let amplitudes = rgb.as_slice_mut().unwrap();
    plan.convert(&image, amplitudes, &mut plan.scratch()).unwrap();
    let millimetres = depth_map::read_depth(&folder.join("depth_0.png"), false).unwrap();
    let given = Size::from_shape(millimetres.dim());
    let depth = phasefront_core::depth::normalize(millimetres.view(), DepthUnit::Millimetres, None, None)
        .unwrap()
        .depth;
    let conditioner = Conditioner::new(given, Crop::cover(given, OUT), OUT, false).unwrap();
    let mut conditioned = ndarray::Array2::zeros(OUT.shape());
    let mut scratch = conditioner.scratch();
    conditioner
        .condition(
            depth.as_slice().unwrap(),
            amplitudes,
            conditioned.as_slice_mut().unwrap(),
            &mut scratch,
        )
        .unwrap();
    RgbdFrame::new(rgb, conditioned).unwrap()
}

#[test]
fn a_captured_frame_has_no_seams_between_tiles() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/redwood");
    if !folder.exists() {
        skip::or_fail("captured data", format!("{} is not there", folder.display()));
        return;
    }
    let frame = captured(&folder);
    let Size { width, height } = frame.size();
    let display = Display::default();
    let default = Sweep::for_display(&display);
    // One tile of 1920 pixels covers the whole frame.
    let [tiles, whole] = [default.tile, 1920].map(|tile| {
        let sweep = Sweep { tile, ..default };
        let plan = SweepPlan::new(frame.size(), &display, sweep, 0.0).unwrap();
        let mut field = vec![Complex32::ZERO; 3 * height * width];
        plan.field(&frame, &mut field, &mut plan.scratch()).unwrap();
        field
    });
    let worst = |a: &[f32], b: &[f32]| (a.iter().zip(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let difference = (tiles.iter().zip(&whole))
        .map(|(a, b)| (a - b).norm())
        .fold(0.0, f32::max);
    println!("tiles and whole frame differ by {difference:.1e}");
    assert!(difference < 3e-3, "{difference}");
    let z_m = [2.4e-3, -2.4e-3];
    let refocus = Refocus::new(frame.size(), &display, &z_m, None).unwrap();
    let views = [&tiles, &whole].map(|field| refocus.focal_stack(field, &z_m).unwrap());
    for (z_m, (tiled, whole)) in z_m.iter().zip(views[0].iter().zip(&views[1])) {
        assert!(worst(tiled, whole) < 3e-3, "{z_m}: {}", worst(tiled, whole));
        // Steps between columns are no larger across the tiles' edges than elsewhere.
        let step = |x: usize| {
            let rows = tiled.chunks_exact(width);
            let steps: f32 = rows.map(|row| (row[x] - row[x - 1]).abs()).sum();
            f64::from(steps) / (3 * height) as f64
        };
        let seams = (1..width / default.tile + 1).map(|i| i * default.tile);
        let seams: Vec<f64> = seams.filter(|x| *x < width).map(step).collect();
        let others: Vec<f64> = (1..width).filter(|x| x % default.tile != 0).map(step).collect();
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        println!(
            "z {z_m}: steps {:.5} over edges, {:.5} elsewhere",
            mean(&seams),
            mean(&others)
        );
        assert!(mean(&seams) < 1.5 * mean(&others), "{seams:?}");
    }
}
