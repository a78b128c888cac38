//! The plane sweep on displays that no network was trained for: beside exact waves on the same surfaces, and both beside
//! the truth.
#![allow(clippy::unwrap_used)]

use ndarray::Array3;
use num_complex::Complex32;
use phasefront::sweep::{self, SweepPlan};
use phasefront::wave::asm::{Padding, Propagator};
use phasefront::{Display, RgbdFrame, Sweep};
use phasefront_lab::evaluate::filled;
use phasefront_lab::ldi::Ldi;
use phasefront_lab::{metrics, scene, sm_lbm};

const SIZE: usize = 96;
/// Planes of the truth.
const TRUE_PLANES: usize = 200;

fn scene_of(seed: u64) -> (Ldi, RgbdFrame) {
    let scene = scene::random_scene(seed, SIZE, SIZE);
    let ldi = scene::render_ldi_reference(&scene, SIZE, SIZE, 5).unwrap();
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

/// Takes a midpoint hologram to the display.
fn to_display(mut field: Array3<Complex32>, display: &Display) -> Array3<Complex32> {
    if display.offset_m() != 0.0 {
        let plans = Propagator::for_colours(
            SIZE,
            SIZE,
            display.pitch_m(),
            display.wavelengths_m(),
            display.offset_m(),
            Padding::Reach,
        );
        let values = field.as_slice_mut().unwrap();
        for (plan, plane) in plans
            .unwrap()
            .iter()
            .zip(values.chunks_exact_mut(SIZE * SIZE))
        {
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
        "wavelengths_nm = [450, 638, 520]\npitch_um = 4.5\nvolume_depth_mm = 3.0",
        "offset_mm = 6.0",
        "offset_mm = -10.0",
        "offset_mm = 20.0",
    ] {
        let display = Display::from_toml(toml).unwrap();
        let sweep = Sweep::for_display(&display);
        let offset_m = display.offset_m();
        let ends_there = sweep::reaches(&display, offset_m);
        let z_m = if ends_there { offset_m } else { 0.0 };
        let plan = SweepPlan::new(SIZE, SIZE, &display, sweep, z_m).unwrap();
        let (mut swept, mut exact) = (0.0, 0.0);
        for seed in [7, 8] {
            let (ldi, frame) = scene_of(seed);
            let waves = |ldi: &Ldi, planes| {
                let field = sm_lbm::hologram(ldi, &display, planes, &|_, _| {}).unwrap();
                to_display(field, &display)
            };
            let truth = waves(&ldi, TRUE_PLANES);
            exact += decibels(
                &waves(&filled(&frame, &display).unwrap(), sweep.planes),
                &truth,
            ) / 2.0;
            let mut field = Array3::from_elem((3, SIZE, SIZE), Complex32::ZERO);
            let values = field.as_slice_mut().unwrap();
            plan.field(&frame, values, &mut plan.scratch()).unwrap();
            let field = if ends_there {
                field
            } else {
                to_display(field, &display)
            };
            swept += decibels(&field, &truth) / 2.0;
        }
        println!("{toml:?}: {sweep:?} sweep {swept:.2} dB, exact waves {exact:.2} dB");
        assert!(
            swept > exact - 1.5,
            "{toml:?}: {swept} dB beside {exact} dB"
        );
    }
}
