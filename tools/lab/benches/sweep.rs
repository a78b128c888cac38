//! Measures the time of the plane sweep on a frame, for several planes, tiles and hidden layers, as medians over frames
//! after an uncounted first one. It then measures the default sweep on frames of the same size with the easiest and the
//! hardest depths: one depth everywhere, a different depth at each pixel, and near and far alternating.
//!
//!     cargo bench --bench sweep -- $PWD/samples/scene_rgb.jpg $PWD/samples/scene_depth.png \
//!       [THREADS] [PLANES TAPS LAYERS TILE]

use ndarray::Array2;
use num_complex::Complex32;
use phasefront::input::RgbEncoding;
use phasefront::{Display, RgbdFrame, Sweep};
use phasefront_core::Size;
use phasefront_core::depth::DepthUnit;
use phasefront_core::method::sweep::SweepPlan;
use phasefront_io::Result;
use phasefront_io::frame::{self, Captured, DepthOptions};
use std::path::Path;
use std::time::Instant;

const FRAMES: usize = 7;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let [rgb, depth, rest @ ..] = &arguments[..] else {
        return Err(phasefront_io::Error::Input(
            "two files are needed: colour and depth".into(),
        ));
    };
    let numbers: Vec<usize> = rest.iter().filter_map(|n| n.parse().ok()).collect();
    let options = DepthOptions {
        unit: DepthUnit::Normalized,
        near_m: None,
        far_m: None,
        inverted: false,
    };
    let amplitude = Some(RgbEncoding::Amplitude);
    let Captured { rgb, depth, .. } = frame::read(Path::new(rgb), Path::new(depth), options, amplitude)?;
    let frame = RgbdFrame::new(rgb, depth)?;
    let Size { width, height } = frame.size();
    let display = Display::default();
    let default = Sweep::for_display(&display);
    let cases = sweeps(&display, &numbers);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(numbers.first().copied().unwrap_or(0))
        .build()
        .map_err(|e| phasefront_io::Error::Input(e.to_string()))?;
    let of_depth = |depth: &dyn Fn(usize, usize) -> f32| {
        let depth = Array2::from_shape_fn((height, width), |(y, x)| depth(y, x));
        RgbdFrame::new(frame.rgb().to_owned(), depth)
    };
    let noise = |y: usize, x: usize| {
        let mixed = (y as u32 * 7919 + x as u32).wrapping_mul(0x9e37_79b9);
        ((mixed ^ (mixed >> 15)).wrapping_mul(0x85eb_ca6b) >> 8) as f32 / 16_777_216.0
    };
    let made = [
        ("one depth", of_depth(&|_, _| 0.5)?),
        ("a depth a pixel", of_depth(&noise)?),
        ("near and far in turn", of_depth(&|y, x| ((y + x) % 2) as f32)?),
    ];
    let mut cases: Vec<_> = (cases.into_iter())
        .map(|sweep| ("the files'", &frame, sweep, true))
        .collect();
    cases.push(("the files', unmerged", &frame, default, false));
    let on_planes = Sweep {
        between_planes: false,
        ..default
    };
    cases.push(("the files', points on planes", &frame, on_planes, true));
    cases.extend(made.iter().map(|(name, frame)| (*name, frame, default, true)));
    println!("| frame | planes | taps | hidden layers | tile | plan ms | frame ms (least–most) |");
    println!("|---|---|---|---|---|---|---|");
    pool.install(|| -> Result<()> {
        for (name, frame, sweep, merged) in cases {
            let start = Instant::now();
            let mut plan = SweepPlan::new(frame.size(), &display, sweep, 0.0)?;
            if !merged {
                plan = plan.unmerged();
            }
            let planned = start.elapsed().as_secs_f64() * 1e3;
            let mut scratch = plan.scratch();
            let mut field = vec![Complex32::ZERO; 3 * height * width];
            let mut times = Vec::new();
            for _ in 0..=FRAMES {
                let start = Instant::now();
                plan.field(frame, &mut field, &mut scratch)?;
                times.push(start.elapsed().as_secs_f64() * 1e3);
            }
            times.remove(0);
            times.sort_unstable_by(f64::total_cmp);
            println!(
                "| {name} | {} | {} | {} | {} | {planned:.0} | {:.0} ({:.0}–{:.0}) |",
                sweep.planes,
                sweep.taps,
                sweep.hidden_layers,
                sweep.tile,
                times[FRAMES / 2],
                times[0],
                times[FRAMES - 1]
            );
        }
        Ok(())
    })
}

/// Returns the sweep of the four given numbers, or all sweeps to measure.
fn sweeps(display: &Display, numbers: &[usize]) -> Vec<Sweep> {
    let default = Sweep::for_display(display);
    if let [_, planes, taps, hidden_layers, tile] = *numbers {
        return vec![Sweep {
            planes,
            taps,
            hidden_layers,
            tile,
            ..default
        }];
    }
    let mut all = vec![default];
    all.extend([16, 24, 32, 64, 80, 96, 128].map(|planes| Sweep::of_planes(display, planes)));
    all.extend([0, 1].map(|hidden_layers| Sweep {
        hidden_layers,
        ..default
    }));
    all.extend([64, 128, 192, 384].map(|tile| Sweep { tile, ..default }));
    all
}
