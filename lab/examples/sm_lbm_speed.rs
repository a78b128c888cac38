//! How fast SM-LBM is beside what it stands on: two bare 2D transforms of rustfft a plane, of the same padded size,
//! on the same threads, in the same run. `cargo run --release --example sm_lbm_speed`
//!
//! The scenes are as dense as can be: every plane has points in every row, so that no row is left out. The bare
//! transforms are rows and columns in place, without the transposition between them.

use ndarray::{Array2, Array3};
use num_complex::Complex32;
use phasefront::Display;
use phasefront::wave::asm::{self, Padding};
use phasefront_lab::Result;
use phasefront_lab::ldi::{Ldi, LdiLayer};
use phasefront_lab::scene::dice::Dice;
use phasefront_lab::sm_lbm;
use rayon::prelude::*;
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;
use std::time::Instant;

const ROUNDS: usize = 5;

/// 2D transforms of a plane without all that is between them.
struct Bare {
    row: [Arc<dyn Fft<f32>>; 2],
    column: [Arc<dyn Fft<f32>>; 2],
    plane: Vec<Complex32>,
    scratch: Vec<Complex32>,
    parts: usize,
}

impl Bare {
    fn new((height, width): (usize, usize)) -> Self {
        let mut planner = FftPlanner::new();
        let mut both = |n| [planner.plan_fft_forward(n), planner.plan_fft_inverse(n)];
        let (row, column) = (both(width), both(height));
        let longest = (row.iter().chain(&column))
            .map(|fft| fft.get_inplace_scratch_len())
            .max();
        let parts = match rayon::current_num_threads() {
            1 => 1,
            threads => 4 * threads,
        };
        Bare {
            row,
            column,
            plane: vec![Complex32::ZERO; height * width],
            scratch: vec![Complex32::ZERO; longest.unwrap_or(0).max(1) * parts],
            parts,
        }
    }

    /// `planes` times forward and back.
    fn run(&mut self, planes: usize) {
        for direction in (0..planes).flat_map(|_| [0, 1]) {
            for fft in [&self.row[direction], &self.column[direction]] {
                let lines = self.plane.len() / fft.len();
                let piece = self.scratch.len() / self.parts;
                self.plane
                    .par_chunks_mut(lines.div_ceil(self.parts) * fft.len())
                    .zip(self.scratch.par_chunks_mut(piece))
                    .for_each(|(lines, scratch)| fft.process_with_scratch(lines, scratch));
            }
        }
    }
}

fn main() -> Result<()> {
    let display = Display::default();
    println!(
        "{} threads; the least of {ROUNDS} rounds, ms a plane and colour; two bare 2D transforms beside it",
        rayon::current_num_threads()
    );
    println!(
        "    frame     padded  planes    bare    ours  ratio  planes/s  buffers MB  points MB"
    );
    for (height, width, planes) in [(384, 384, 64), (1080, 1920, 24)] {
        let mut dice = Dice::new(1);
        let ldi = Ldi::new(vec![LdiLayer {
            rgb: Array3::from_shape_simple_fn((3, height, width), || dice.unit() as f32),
            depth: Array2::from_shape_simple_fn((height, width), || dice.unit() as f32),
        }])?;
        let red = display.wavelengths_m()[0];
        let volume_m = display.volume_depth_m();
        let padded = asm::padded_shape(
            height,
            width,
            display.pitch_m(),
            red,
            volume_m,
            Padding::Reach,
        )?;
        let mut bare = Bare::new(padded);
        let (mut bare_ms, mut ours_ms) = (f64::INFINITY, f64::INFINITY);
        let a_plane = |start: Instant| start.elapsed().as_secs_f64() * 1e3 / (3 * planes) as f64;
        for _ in 0..ROUNDS {
            let start = Instant::now();
            bare.run(3 * planes);
            bare_ms = bare_ms.min(a_plane(start));
            let start = Instant::now();
            sm_lbm::hologram(&ldi, &display, planes, &|_, _| {})?;
            ours_ms = ours_ms.min(a_plane(start));
        }
        println!(
            "{:>9}  {:>9}  {planes:6}  {bare_ms:6.2}  {ours_ms:6.2}  {:5.2}  {:8.1}  {:10.1}  {:9.1}",
            format!("{width}×{height}"),
            format!("{}×{}", padded.1, padded.0),
            ours_ms / bare_ms,
            1e3 / ours_ms,
            (2 * padded.0 * padded.1 * size_of::<Complex32>()) as f64 / 1e6,
            (20 * height * width) as f64 / 1e6,
        );
    }
    Ok(())
}
