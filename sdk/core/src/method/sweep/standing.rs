//! What stands still in a video. Pixels whose surroundings stay as they were keep their wave.
//!
//! The sweep shows a frame of its own, the *shown* frame. In a frame of a video, each block of pixels that differs from
//! the shown frame by more than a tolerance replaces its part there. In each tile, only the smallest rectangle that
//! holds all pixels which such blocks can affect is swept again. So the wave is always the sweep of the shown frame but
//! for rounding, and no block of the shown frame differs from the given one by more than the tolerance, however long a
//! scene stands. A camera's noise stays below it.
//!
//! The difference in colour of a block is the mean of Δa² over its pixels and colours, and that in depth the mean of
//! a²·min(1, [`DEPTH_WEIGHT`]·Δp²), with the amplitude a and the position p among the planes. Sums run in a fixed
//! order, so that all instruction sets decide alike.

use super::spans::{NOWHERE, Span, join};
use super::tile;
use crate::Size;
use crate::frame::RgbdFrame;
use crate::method::mean_phase;
use num_complex::Complex32;
use phasefront_kernels::fir::Pixel;
use phasefront_kernels::wide;
use rayon::prelude::*;
use std::f32::consts::PI;
use std::ops::Range;

/// The number of pixels along each side of a block.
pub(super) const BLOCK: usize = 16;

/// The largest difference in colour of a block that stands, 34 dB below full light.
const COLOUR_TOLERANCE: f32 = 4e-4;

/// The largest difference in depth of a block that stands, 24 dB below full light. It is larger than that of colour
/// because the noise of a sensor moves edges by a pixel here and there.
const DEPTH_TOLERANCE: f32 = 4e-3;

/// The share of a point's light that counts as different if its depth changes by the distance of two planes: its image
/// becomes a little more or less sharp.
const DEPTH_WEIGHT: f32 = 0.05;

/// The largest difference of a colour's mean phase from 0 while it is kept: four levels of 8 bits.
const TURN_TOLERANCE: f32 = 2.0 * PI / 64.0;

/// The blocks of a frame that have changed.
pub(super) struct Changes {
    blocks: Vec<bool>,
    /// The number of blocks across the frame.
    across: usize,
}

impl Changes {
    /// Returns whether a block in these rows of pixels has changed. The rows may go beyond the frame.
    pub(super) fn any(&self, rows: Range<usize>) -> bool {
        let down = self.blocks.len() / self.across;
        let rows = (rows.start / BLOCK).min(down)..rows.end.div_ceil(BLOCK).min(down);
        self.blocks[rows.start * self.across..rows.end * self.across].contains(&true)
    }

    /// Returns the smallest rectangle that holds all pixels of `rows` and `columns` within `reach` of a block that has
    /// changed, or `None` if there are no such pixels.
    pub(super) fn affected(&self, [rows, columns]: [&Range<usize>; 2], reach: usize) -> Option<[Range<usize>; 2]> {
        let within = |block: usize, side: &Range<usize>| {
            let first = (block * BLOCK).saturating_sub(reach).max(side.start);
            [first, ((block + 1) * BLOCK + reach).min(side.end)]
        };
        let is_any = |span: &Span| span[0] < span[1];
        let (mut down, mut across) = (NOWHERE, NOWHERE);
        for (row, blocks) in self.blocks.chunks_exact(self.across).enumerate() {
            let of_row = within(row, rows);
            if !is_any(&of_row) {
                continue;
            }
            let changed = (blocks.iter().enumerate()).filter(|(_, changed)| **changed);
            for of_column in changed.map(|(column, _)| within(column, columns)).filter(is_any) {
                (down, across) = (join(down, of_row), join(across, of_column));
            }
        }
        is_any(&down).then(|| [down, across].map(|span| span[0]..span[1]))
    }
}

/// The memory of what is shown.
pub(super) struct Standing {
    /// The shown frame.
    pub(super) frame: RgbdFrame,
    pub(super) changes: Changes,
    /// Whether the sweep's wave is that of `frame`.
    is_whole: bool,
    /// Whether the wave of the frame before is kept where nothing changes.
    keeps: bool,
    /// The factor that removes the mean phase of each colour.
    turns: [Complex32; 3],
    /// The number of shown frames.
    number: u64,
}

impl Standing {
    /// Creates memory for frames of `colours` and `size`.
    pub(super) fn new(colours: usize, size: Size) -> Self {
        let (across, down) = (size.width.div_ceil(BLOCK), size.height.div_ceil(BLOCK));
        Standing {
            frame: RgbdFrame::black(colours, size),
            changes: Changes {
                blocks: vec![true; across * down],
                across,
            },
            is_whole: false,
            keeps: false,
            turns: [Complex32::ONE; 3],
            number: 0,
        }
    }

    /// Finds what changes from the shown frame to `frame`, and shows it. Without a past, everything changes. The wave
    /// is that of the shown frame again after [`Self::finish`].
    pub(super) fn show(&mut self, frame: &RgbdFrame, has_past: bool, planes: usize) {
        let keeps = has_past && self.is_whole;
        (self.keeps, self.is_whole) = (keeps, false);
        self.number += 1;
        let Size { width, height } = frame.size();
        let across = self.changes.across;
        let shown = &self.frame;
        let rows = self.changes.blocks.par_chunks_mut(across).enumerate();
        rows.for_each(|(row, blocks)| match keeps {
            false => blocks.fill(true),
            true => {
                let rows = row * BLOCK..((row + 1) * BLOCK).min(height);
                wide!(compare(frame, shown, rows, planes as f32, blocks));
            }
        });
        let (shown_rgb, shown_depth) = self.frame.planes_mut();
        let (rgb, depth) = frame.values();
        let planes = shown_rgb
            .chunks_exact_mut(width * height)
            .zip(rgb.chunks_exact(width * height));
        for (shown, new) in planes.chain(std::iter::once((shown_depth, depth))) {
            (shown.par_chunks_mut(BLOCK * width))
                .zip(new.par_chunks(BLOCK * width))
                .zip(self.changes.blocks.par_chunks(across))
                .for_each(|((shown, new), blocks)| {
                    for (shown, new) in shown.chunks_exact_mut(width).zip(new.chunks_exact(width)) {
                        let parts = shown.chunks_mut(BLOCK).zip(new.chunks(BLOCK)).zip(blocks);
                        for ((shown, new), _) in parts.filter(|(_, changed)| **changed) {
                            shown.copy_from_slice(new);
                        }
                    }
                });
        }
    }

    /// Returns the number of shown frames.
    pub(super) fn number(&self) -> u64 {
        self.number
    }

    /// Returns the factor that removes the mean phase of each colour of `wave`, (C, H, W). It stays as it was while its
    /// phase is within [`TURN_TOLERANCE`] of the wave's own.
    pub(super) fn turns(&mut self, wave: &[Pixel]) -> [Complex32; 3] {
        let size = self.frame.size().pixels();
        if !self.keeps || self.changes.blocks.contains(&true) {
            for (turn, wave) in self.turns.iter_mut().zip(wave.chunks_exact(size)) {
                let own = mean_phase::turn_of(wave, tile::value);
                if !self.keeps || (own * turn.conj()).arg().abs() > TURN_TOLERANCE {
                    *turn = own;
                }
            }
        }
        self.turns
    }

    /// Notes whether the wave of the shown frame was computed to its end.
    pub(super) fn finish(&mut self, is_whole: bool) {
        self.is_whole = is_whole;
    }
}

/// The number of blocks that are compared together, so that each row is read in long runs.
const TOGETHER: usize = 16;

/// Sets which blocks of a row of blocks differ between two frames by more than the tolerance.
#[inline(always)]
fn compare(frame: &RgbdFrame, shown: &RgbdFrame, rows: Range<usize>, planes: f32, blocks: &mut [bool]) {
    let Size { width, .. } = frame.size();
    let size = frame.size().pixels();
    let colours = frame.colours();
    let ((rgb, depth), (shown_rgb, shown_depth)) = (frame.values(), shown.values());
    let weight = DEPTH_WEIGHT * planes * planes;
    for (run, blocks) in blocks.chunks_mut(TOGETHER).enumerate() {
        let left = run * TOGETHER * BLOCK;
        let count = (TOGETHER * BLOCK).min(width - left);
        // Each column of a block has sums of its own, so that the loops vectorise.
        let (mut of_colour, mut of_depth) = ([0.0; TOGETHER * BLOCK], [0.0; TOGETHER * BLOCK]);
        for y in rows.clone() {
            let at = y * width + left;
            let mut moved = [0.0; TOGETHER * BLOCK];
            for ((moved, new), old) in moved.iter_mut().zip(&depth[at..at + count]).zip(&shown_depth[at..]) {
                let share = weight * (new - old) * (new - old);
                *moved = if share < 1.0 { share } else { 1.0 };
            }
            for plane in 0..colours {
                let at = plane * size + at;
                let values = rgb[at..at + count].iter().zip(&shown_rgb[at..]);
                let sums = of_colour.iter_mut().zip(&mut of_depth).zip(&moved);
                for (((of_colour, of_depth), moved), (new, old)) in sums.zip(values) {
                    *of_colour += (new - old) * (new - old);
                    *of_depth += new * new * moved;
                }
            }
        }
        let sums = (of_colour.as_chunks::<BLOCK>().0.iter()).zip(of_depth.as_chunks::<BLOCK>().0);
        for (block, (changed, (of_colour, of_depth))) in blocks.iter_mut().zip(sums).enumerate() {
            let values = (colours * rows.len() * BLOCK.min(count - block * BLOCK)) as f32;
            let is_above = |sums: &[f32; BLOCK], most: f32| sums.iter().sum::<f32>() > most * values;
            *changed = is_above(of_colour, COLOUR_TOLERANCE) || is_above(of_depth, DEPTH_TOLERANCE);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::display::Display;
    use crate::frame::Past;
    use crate::method::mean_phase::MeanPhase;
    use crate::method::sweep::{Sweep, SweepPlan, SweepScratch};
    use crate::runtime::cancel::Cancel;
    use num_complex::Complex32;
    use std::time::Duration;

    const SIZE: Size = Size { width: 83, height: 61 };
    /// The largest difference between the waves of a pixel in rectangles of different sizes, about 4·10⁻⁴ here.
    const ROUNDING: f32 = 1e-3;
    const PAST: Option<Past> = Some(Past {
        scale: 1.0,
        elapsed: Duration::from_millis(33),
    });

    /// A sequence of numbers from −1 to 1.
    fn noise(seed: u32) -> impl FnMut() -> f32 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 23) as f32 - 1.0
        }
    }

    /// Returns a wall and a ball whose centre is in column `x`, with noise of these amplitudes in colour and depth.
    fn scene(x: usize, [of_colour, of_depth]: [f32; 2], seed: u32) -> RgbdFrame {
        let mut frame = RgbdFrame::black(3, SIZE);
        let mut noise = noise(seed);
        let (rgb, depth) = frame.planes_mut();
        for (i, depth) in depth.iter_mut().enumerate() {
            let (row, column) = (i / SIZE.width, i % SIZE.width);
            let is_ball = column.abs_diff(x).pow(2) + row.abs_diff(20).pow(2) < 60;
            *depth = (if is_ball { 0.2 } else { 0.7 } + of_depth * noise()).clamp(0.0, 1.0);
            for (colour, rgb) in rgb.chunks_exact_mut(SIZE.pixels()).enumerate() {
                let texture = (row * 3 + column * (2 + colour)) % 7;
                rgb[i] = (if is_ball { 0.9 } else { 0.1 * texture as f32 } + of_colour * noise()).clamp(0.0, 1.0);
            }
        }
        frame
    }

    fn plan(layers: usize) -> SweepPlan {
        plan_of_tiles(layers, 16)
    }

    fn plan_of_tiles(layers: usize, tile: usize) -> SweepPlan {
        let display = Display::from_toml("volume_depth_mm = 1.5").unwrap();
        let sweep = Sweep {
            tile,
            hidden_layers: layers,
            ..Sweep::of_planes(&display, 9)
        };
        SweepPlan::new(SIZE, &display, sweep, 0.0).unwrap()
    }

    fn keeping(plan: &SweepPlan) -> SweepScratch {
        let mut scratch = plan.scratch();
        plan.keep_standing(&mut scratch);
        scratch
    }

    fn field(plan: &SweepPlan, past: Option<Past>, frame: &RgbdFrame, scratch: &mut SweepScratch) -> Vec<Complex32> {
        let mut field = vec![Complex32::new(f32::NAN, f32::NAN); 3 * SIZE.pixels()];
        plan.field_after(past, frame, MeanPhase::Kept, &mut field, scratch)
            .unwrap();
        field
    }

    fn anew(plan: &SweepPlan, frame: &RgbdFrame) -> Vec<Complex32> {
        field(plan, None, frame, &mut plan.scratch())
    }

    fn changed(scratch: &SweepScratch) -> usize {
        let blocks = &scratch.standing.as_ref().unwrap().changes.blocks;
        blocks.iter().filter(|changed| **changed).count()
    }

    #[test]
    fn the_wave_is_the_sweep_of_the_shown_frame_which_is_near_the_given_one() {
        for (layers, tile) in [(0, 16), (2, 16), (0, 48), (2, 48), (2, 96)] {
            let plan = plan_of_tiles(layers, tile);
            let mut scratch = keeping(&plan);
            for i in 0..6_u32 {
                let frame = scene(20 + 4 * i as usize, [0.004, 0.01], i);
                let past = PAST.filter(|_| i > 0);
                let field = field(&plan, past, &frame, &mut scratch);
                let shown = scratch.standing.as_ref().unwrap().frame.clone();
                let farthest = (field.iter().zip(anew(&plan, &shown))).map(|(a, b)| (a - b).norm());
                let farthest = farthest.fold(0.0, f32::max);
                assert!(farthest < ROUNDING, "{layers} {tile} {i}: {farthest}");
                if i == 0 {
                    assert!(shown == frame);
                    continue;
                }
                let blocks = changed(&scratch);
                assert!((1..12).contains(&blocks), "{layers} {i}: {blocks}");
                let wave = anew(&plan, &frame);
                let squares: f32 = field.iter().zip(&wave).map(|(a, b)| (a - b).norm_sqr()).sum();
                let error = (squares / wave.len() as f32).sqrt();
                assert!(error < 0.03, "{layers} {i}: {error}");
            }
        }
    }

    #[test]
    fn the_affected_rectangle_holds_all_pixels_within_reach_and_no_more() {
        let [down, across] = [5, 7];
        for (changed, reach) in [
            (vec![], 9),
            (vec![9], 0),
            (vec![9], 21),
            (vec![1, 19], 5),
            (vec![34], 200),
        ] {
            let blocks = (0..down * across).map(|block| changed.contains(&block)).collect();
            let changes = Changes { blocks, across };
            for (rows, columns) in [(0..70, 0..100), (20..41, 48..61), (65..70, 3..30)] {
                let is_within = |y: usize, x: usize| {
                    changed.iter().any(|block| {
                        let (top, left) = (block / across * BLOCK, block % across * BLOCK);
                        let near = |at: usize, first: usize| at + reach >= first && at < first + BLOCK + reach;
                        near(y, top) && near(x, left)
                    })
                };
                let all = rows.clone().flat_map(|y| columns.clone().map(move |x| (y, x)));
                let within: Vec<_> = all.filter(|(y, x)| is_within(*y, *x)).collect();
                let range = |of: &dyn Fn(&(usize, usize)) -> usize| {
                    Some(within.iter().map(of).min()?..within.iter().map(of).max()? + 1)
                };
                let expected = range(&|(y, _)| *y).zip(range(&|(_, x)| *x)).map(|(y, x)| [y, x]);
                assert_eq!(
                    changes.affected([&rows, &columns], reach),
                    expected,
                    "{changed:?} {reach}"
                );
            }
        }
    }

    #[test]
    fn what_changes_slowly_is_shown_before_it_is_far_from_what_was() {
        let plan = plan(2);
        let mut scratch = keeping(&plan);
        let mut frame = scene(40, [0.0, 0.0], 1);
        field(&plan, None, &frame, &mut scratch);
        let mut most = 0;
        for _ in 0..8 {
            frame.planes_mut().0.iter_mut().for_each(|a| *a *= 0.99);
            field(&plan, PAST, &frame, &mut scratch);
            most = most.max(changed(&scratch));
            let shown = &scratch.standing.as_ref().unwrap().frame;
            let farthest = (shown.values().0.iter().zip(frame.values().0)).map(|(a, b)| (a - b).abs());
            assert!(farthest.fold(0.0, f32::max) < 0.06);
        }
        assert!(most > 12, "{most}");
    }

    #[test]
    fn without_a_past_or_after_a_frame_that_was_given_up_all_is_computed() {
        let plan = plan(2);
        let mut scratch = keeping(&plan);
        let still = scene(40, [0.0, 0.0], 1);
        let expected = anew(&plan, &still);
        assert!(field(&plan, PAST, &still, &mut scratch) == expected);
        assert!(field(&plan, PAST, &still, &mut scratch) == expected);
        assert_eq!(changed(&scratch), 0);
        assert!(field(&plan, None, &still, &mut scratch) == expected);
        assert_eq!(changed(&scratch), 6 * 4);
        let cancel = Cancel::default();
        scratch.set_cancel(&cancel);
        cancel.request();
        field(&plan, PAST, &scene(20, [0.0, 0.0], 1), &mut scratch);
        cancel.clear();
        assert!(field(&plan, PAST, &still, &mut scratch) == expected);
        assert_eq!(changed(&scratch), 6 * 4);
    }

    #[test]
    fn all_instruction_sets_and_numbers_of_threads_keep_the_same() {
        let frames = [0, 1, 2].map(|i| scene(30 + 5 * i as usize, [0.012, 0.03], i));
        let run = |plan: &SweepPlan| {
            let mut scratch = keeping(plan);
            frames.each_ref().map(|frame| field(plan, PAST, frame, &mut scratch))
        };
        let expected = run(&plan(2));
        for isa in phasefront_kernels::Isa::fir() {
            if let Some(plan) = plan(2).on(isa) {
                assert!(run(&plan) == expected, "{isa}");
            }
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        assert!(pool.install(|| run(&plan(2))) == expected);
    }
}
