//! Compares the time of SM-LBM with that of two plain 2D transforms by rustfft for each plane, of the same padded size,
//! on the same threads, in the same run. Run it with `cargo bench --bench sm_lbm`.
//!
//! The scenes have the highest density: every plane has points in every row, so no row is skipped. rustfft computes 1D
//! transforms, so a 2D transform consists of the rows, a transposition (by the crate that rustfft itself uses) and the
//! columns, and its result stays transposed. The benchmark also times the 1D transforms alone, as if columns could be
//! transformed in place.

use ndarray::{Array2, Array3};
use num_complex::Complex32;
use phasefront::Display;
use phasefront_core::Size;
use phasefront_core::optics::asm::{self, Padding};
use phasefront_exact::sm_lbm;
use phasefront_io::Result;
use phasefront_io::dice::Dice;
use phasefront_io::ldi::{Ldi, LdiLayer};
use rayon::prelude::*;
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;
use std::time::Instant;

const ROUNDS: usize = 5;

/// Plain 2D transforms of a plane, without the other steps of SM-LBM.
struct Bare {
    row: [Arc<dyn Fft<f32>>; 2],
    column: [Arc<dyn Fft<f32>>; 2],
    size: Size,
    plane: Vec<Complex32>,
    transposed: Vec<Complex32>,
    scratch: Vec<Complex32>,
    parts: usize,
}

impl Bare {
    fn new(Size { width, height }: Size) -> Self {
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
            size: Size { width, height },
            plane: vec![Complex32::ZERO; height * width],
            transposed: vec![Complex32::ZERO; height * width],
            scratch: vec![Complex32::ZERO; longest.unwrap_or(0).max(1) * parts],
            parts,
        }
    }

    /// Transforms all lines of `plane` by `fft`.
    fn lines(fft: &dyn Fft<f32>, plane: &mut [Complex32], scratch: &mut [Complex32], parts: usize) {
        let lines = plane.len() / fft.len();
        let piece = scratch.len() / parts;
        plane
            .par_chunks_mut(lines.div_ceil(parts) * fft.len())
            .zip(scratch.par_chunks_mut(piece))
            .for_each(|(lines, scratch)| fft.process_with_scratch(lines, scratch));
    }

    /// Transforms forward and back `planes` times: rows, columns; columns, rows.
    fn run(&mut self, planes: usize, transpose: bool) {
        let Size { width, height } = self.size;
        let Bare {
            row,
            column,
            plane,
            transposed,
            scratch,
            parts,
            ..
        } = self;
        for _ in 0..planes {
            Self::lines(&*row[0], plane, scratch, *parts);
            if transpose {
                transpose::transpose(plane, transposed, width, height);
            }
            Self::lines(&*column[0], transposed, scratch, *parts);
            Self::lines(&*column[1], transposed, scratch, *parts);
            if transpose {
                transpose::transpose(transposed, plane, height, width);
            }
            Self::lines(&*row[1], plane, scratch, *parts);
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
        "    frame     padded  planes  1D only    bare    ours  ours/1D  ours/bare  planes/s  buffers MB  points MB"
    );
    for (height, width, planes) in [(384, 384, 64), (1080, 1920, 24)] {
        let mut dice = Dice::new(1);
        let ldi = Ldi::new(vec![LdiLayer {
            rgb: Array3::from_shape_simple_fn((3, height, width), || dice.unit() as f32),
            depth: Array2::from_shape_simple_fn((height, width), || dice.unit() as f32),
        }])?;
        let red = display.wavelengths_m()[0];
        let volume_m = display.volume_depth_m();
        let padded = asm::padded_size(Size { width, height }, display.pitch_m(), red, volume_m, Padding::Reach)?;
        let mut bare = Bare::new(padded);
        let [mut lines_ms, mut bare_ms, mut ours_ms] = [f64::INFINITY; 3];
        let a_plane = |start: Instant| start.elapsed().as_secs_f64() * 1e3 / (3 * planes) as f64;
        for _ in 0..ROUNDS {
            let start = Instant::now();
            bare.run(3 * planes, false);
            lines_ms = lines_ms.min(a_plane(start));
            let start = Instant::now();
            bare.run(3 * planes, true);
            bare_ms = bare_ms.min(a_plane(start));
            let start = Instant::now();
            sm_lbm::hologram(&ldi, &display, planes, &|_, _| {})?;
            ours_ms = ours_ms.min(a_plane(start));
        }
        println!(
            "{:>9}  {:>9}  {planes:6}  {lines_ms:7.2}  {bare_ms:6.2}  {ours_ms:6.2}  {:7.2}  {:9.2}  {:8.1}  {:10.1}  {:9.1}",
            format!("{width}×{height}"),
            format!("{}×{}", padded.width, padded.height),
            ours_ms / lines_ms,
            ours_ms / bare_ms,
            1e3 / ours_ms,
            (2 * padded.height * padded.width * size_of::<Complex32>()) as f64 / 1e6,
            (20 * height * width) as f64 / 1e6,
        );
    }
    Ok(())
}
