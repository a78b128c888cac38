//! The plane sweep against its naive oracle, on every instruction set, and its edge cases.
#![allow(clippy::unwrap_used)]

use ndarray::{Array2, Array3};
use num_complex::Complex32;
use phasefront::network::Isa;
use phasefront::sweep::{SweepPlan, hidden, reference};
use phasefront::{Display, RgbdFrame, Sweep};

/// A small volume, so that the naive oracle has little black to carry around.
fn display() -> Display {
    Display::from_toml("volume_depth_mm = 1.5").unwrap()
}

fn sweep() -> Sweep {
    Sweep {
        planes: 9,
        taps: 9,
        hidden_layers: 2,
        tile: 16,
    }
}

/// Surfaces at several depths with sharp edges, one slanted, and fine colour.
fn frame(height: usize, width: usize) -> RgbdFrame {
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
    let (height, width) = plan.shape();
    // What stood there before must not matter.
    let mut field = vec![Complex32::new(f32::NAN, f32::NAN); 3 * height * width];
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
        (
            37,
            35,
            Sweep {
                planes: 1,
                ..sweep()
            },
            0.0,
        ),
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
        (35, 37, sweep(), 2e-3),
        (35, 37, sweep(), -1e-3),
    ] {
        let frame = frame(height, width);
        let plan = SweepPlan::new(height, width, &display(), sweep, z_m).unwrap();
        let slow = reference::field(&frame, &display(), sweep, z_m).unwrap();
        let worst = farthest(&run(&plan, &frame), &slow);
        assert!(worst < 1e-3, "{width}×{height} {sweep:?} {z_m}: {worst}");
    }
}

#[test]
fn tiles_are_the_whole_frame() {
    let display = Display::default();
    let frame = frame(150, 170);
    let of = |tile| {
        let sweep = Sweep {
            tile,
            ..Sweep::for_display(&display)
        };
        run(
            &SweepPlan::new(150, 170, &display, sweep, 0.0).unwrap(),
            &frame,
        )
    };
    let whole = of(512);
    for tile in [32, 64, 144] {
        let worst = farthest(&of(tile), &whole);
        assert!(worst < 1e-4, "tiles of {tile}: {worst}");
    }
}

#[test]
fn instruction_sets_give_the_same_bits() {
    let frame = frame(45, 51);
    let of = |isa| {
        let plan = SweepPlan::new(45, 51, &display(), sweep(), 0.0).unwrap();
        run(&plan.on(isa).unwrap(), &frame)
    };
    let plain = of(Isa::Portable);
    for isa in Isa::f32() {
        assert!(of(isa) == plain, "{isa}");
    }
}

#[test]
fn hidden_surfaces_are_their_oracle() {
    for (height, width, reach) in [(70, 45, 7), (33, 64, 30), (1, 9, 3), (9, 1, 40)] {
        let ragged = Array2::from_shape_fn((height, width), |(y, x)| {
            ((x * 7 + y * 13 + x * y) % 17) as f32 / 16.0
        });
        for depth in [ragged, frame(height, width).depth().to_owned()] {
            let depth = depth.as_slice().unwrap();
            let plan = hidden::Hidden::new(height, width, reach);
            let mut sources = vec![0; 2 * depth.len()];
            plan.find(depth, &mut sources, &mut plan.scratch());
            assert!(sources == hidden::reference(depth, height, width, reach));
        }
    }
}
