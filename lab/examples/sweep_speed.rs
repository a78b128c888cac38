//! How fast the plane sweep is on a frame, for several planes, tiles and hidden layers: medians of frames after one that
//! is not counted.
//!
//!     cargo run --release --example sweep_speed -- samples/scene_rgb.jpg samples/scene_depth.png [THREADS] [PLANES TAPS LAYERS TILE]

use num_complex::Complex32;
use phasefront::depth::DepthUnit;
use phasefront::sweep::SweepPlan;
use phasefront::{Display, Sweep};
use phasefront_lab::Result;
use phasefront_lab::rgbd::{self, DepthOptions};
use std::path::Path;
use std::time::Instant;

const FRAMES: usize = 7;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [rgb, depth, rest @ ..] = &arguments[..] else {
        return Err(phasefront_lab::Error::Input(
            "two files are needed: colour and depth".into(),
        ));
    };
    let numbers: Vec<usize> = rest.iter().filter_map(|n| n.parse().ok()).collect();
    let options = DepthOptions {
        unit: DepthUnit::Normalized,
        near_m: None,
        far_m: None,
    };
    let frame = rgbd::read(Path::new(rgb), Path::new(depth), options)?;
    let (height, width) = frame.shape();
    let display = Display::default();
    let usual = Sweep::for_display(&display);
    let mut cases = vec![usual];
    if let [_, planes, taps, hidden_layers, tile] = numbers[..] {
        cases = vec![Sweep {
            planes,
            taps,
            hidden_layers,
            tile,
        }];
    } else {
        cases.extend([24, 32, 64].map(|planes| Sweep { planes, ..usual }));
        cases.extend([0, 1].map(|hidden_layers| Sweep {
            hidden_layers,
            ..usual
        }));
        cases.extend([64, 128, 192, 384].map(|tile| Sweep { tile, ..usual }));
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(numbers.first().copied().unwrap_or(0))
        .build()
        .map_err(|e| phasefront_lab::Error::Input(e.to_string()))?;
    println!("| planes | taps | hidden layers | tile | plan ms | frame ms (least–most) |");
    println!("|---|---|---|---|---|---|");
    pool.install(|| -> Result<()> {
        for sweep in cases {
            let start = Instant::now();
            let plan = SweepPlan::new(height, width, &display, sweep, 0.0)?;
            let planned = start.elapsed().as_secs_f64() * 1e3;
            let mut scratch = plan.scratch();
            let mut field = vec![Complex32::ZERO; 3 * height * width];
            let mut times = Vec::new();
            for _ in 0..=FRAMES {
                let start = Instant::now();
                plan.field(&frame, &mut field, &mut scratch)?;
                times.push(start.elapsed().as_secs_f64() * 1e3);
            }
            times.remove(0);
            times.sort_unstable_by(f64::total_cmp);
            println!(
                "| {} | {} | {} | {} | {planned:.0} | {:.0} ({:.0}–{:.0}) |",
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
