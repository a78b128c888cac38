//! What stands still in a video. Pixels whose surroundings stay as they were keep their wave.
//!
//! Methods show a frame of their own, the *shown* frame. In a frame of a video, each block of pixels that differs from
//! the shown frame by more than a tolerance replaces its part there. Of each part of the frame, only the smallest
//! rectangle that holds all pixels which such blocks can affect is computed again. So the wave is always that of the
//! shown frame, for the sweep but for rounding, and no block of the shown frame differs from the given one by more than
//! the tolerance, however long a scene stands. A camera's noise stays below it.
//!
//! The difference in colour of a block is the mean of Δa² over its pixels and colours, and that in depth the mean of
//! a²·min(1, [`DEPTH_WEIGHT`]·Δp²), with the amplitude a and the position p among the planes. Sums run in a fixed
//! order, so that all instruction sets decide alike.

use crate::Size;
use crate::frame::RgbdFrame;
use crate::method::mean_phase::Sums;
use crate::parallel::prelude::*;
use num_complex::Complex32;
use phasefront_kernels::wide;
use std::f32::consts::PI;
use std::ops::Range;

/// The number of pixels along each side of a block.
pub(crate) const BLOCK: usize = 16;

/// The largest difference in colour of a block that stands, 34 dB below full light.
const COLOUR_TOLERANCE: f32 = 4e-4;

/// The largest difference in depth of a block that stands, 24 dB below full light. It is larger than that of colour
/// because the noise of a sensor moves edges by a pixel here and there.
const DEPTH_TOLERANCE: f32 = 4e-3;

/// The share of a point's light that counts as different if its depth changes by the distance of two planes of the
/// sweep: its image becomes a little more or less sharp.
const DEPTH_WEIGHT: f32 = 0.05;

/// The largest difference of a colour's mean phase from 0 while it is kept: four levels of 8 bits.
const TURN_TOLERANCE: f32 = 2.0 * PI / 64.0;

/// The blocks of a frame that have changed.
pub(crate) struct Changes {
    /// The blocks, row by row.
    pub(super) blocks: Vec<bool>,
    /// The number of blocks across the frame.
    pub(super) across: usize,
}

impl Changes {
    /// Returns a frame of `size` in which all has changed.
    pub(super) fn all(size: Size) -> Self {
        let (across, down) = (size.width.div_ceil(BLOCK), size.height.div_ceil(BLOCK));
        Changes {
            blocks: vec![true; across * down],
            across,
        }
    }

    /// Returns whether a pixel is in a block that has changed.
    pub(super) fn contains(&self, y: usize, x: usize) -> bool {
        self.blocks[y / BLOCK * self.across + x / BLOCK]
    }

    /// Returns whether a block in these rows of pixels has changed. The rows may go beyond the frame.
    pub(crate) fn any(&self, rows: Range<usize>) -> bool {
        let down = self.blocks.len() / self.across;
        let rows = (rows.start / BLOCK).min(down)..rows.end.div_ceil(BLOCK).min(down);
        self.blocks[rows.start * self.across..rows.end * self.across].contains(&true)
    }

    /// Returns whether a change is within `reach` of the rows of a range of values, which is of planes of `size`.
    pub(super) fn any_value(&self, values: Range<usize>, size: Size, reach: usize) -> bool {
        let [first, last] = [values.start, values.end.max(1) - 1].map(|at| (at / size.pixels(), at % size.pixels()));
        // Values of two planes may lie in any row.
        let rows = if first.0 == last.0 {
            first.1 / size.width..last.1 / size.width + 1
        } else {
            0..size.height
        };
        self.any(rows.start.saturating_sub(reach)..rows.end + reach)
    }

    /// Returns the smallest rectangle that holds all pixels of `rows` and `columns` within `reach` of a block that has
    /// changed, or `None` if there are no such pixels.
    pub(crate) fn affected(&self, [rows, columns]: [&Range<usize>; 2], reach: usize) -> Option<[Range<usize>; 2]> {
        let within = |block: usize, side: &Range<usize>| {
            let first = (block * BLOCK).saturating_sub(reach).max(side.start);
            first..((block + 1) * BLOCK + reach).min(side.end)
        };
        let join = |a: &Range<usize>, b: &Range<usize>| a.start.min(b.start)..a.end.max(b.end);
        let mut all: Option<[Range<usize>; 2]> = None;
        for (row, blocks) in self.blocks.chunks_exact(self.across).enumerate() {
            let of_row = within(row, rows);
            if of_row.is_empty() {
                continue;
            }
            let changed = (blocks.iter().enumerate()).filter(|(_, changed)| **changed);
            for of_column in changed
                .map(|(column, _)| within(column, columns))
                .filter(|of| !of.is_empty())
            {
                all = Some(match &all {
                    Some([down, across]) => [join(down, &of_row), join(across, &of_column)],
                    None => [of_row.clone(), of_column],
                });
            }
        }
        all
    }
}

/// The pixels in which a wave differs from the wave before, apart from the factor of its mean phase.
#[derive(Clone, Copy)]
pub(crate) struct Changed<'a> {
    pub(super) changes: &'a Changes,
    /// How far beside a changed block pixels differ.
    pub(super) reach: usize,
    /// The number of waves so far. The wave before has the number before.
    pub(crate) number: u64,
}

impl Changed<'_> {
    /// Returns whether a pixel differs.
    pub(crate) fn any(&self) -> bool {
        self.changes.blocks.contains(&true)
    }

    /// Returns the smallest rectangle that holds all pixels of `rows` and `columns` that depend on a pixel that differs
    /// and is within `reach`, or `None` if there are none.
    pub(crate) fn affected(&self, part: [&Range<usize>; 2], reach: usize) -> Option<[Range<usize>; 2]> {
        self.changes.affected(part, self.reach + reach)
    }
}

/// The memory of what is shown.
pub(super) struct Standing {
    /// The shown frame.
    pub(super) frame: RgbdFrame,
    pub(super) changes: Changes,
    /// The number of planes of a sweep for the display, whose distance measures a change of depth.
    planes: usize,
    /// Whether the wave is that of `frame`.
    is_whole: bool,
    /// Whether the wave of the frame before is kept where nothing changes.
    keeps: bool,
    /// The factor that removes the mean phase of each colour, and the sums that the wave's own follows from.
    turns: [Complex32; 3],
    sums: Sums,
    /// The number of shown frames.
    number: u64,
}

impl Standing {
    /// Creates memory for frames of `colours` and `size` for a display whose sweep has `planes`.
    pub(super) fn new(colours: usize, size: Size, planes: usize) -> Self {
        Standing {
            frame: RgbdFrame::black(colours, size),
            changes: Changes::all(size),
            planes,
            is_whole: false,
            keeps: false,
            turns: [Complex32::ONE; 3],
            sums: Sums::new(colours, size.pixels()),
            number: 0,
        }
    }

    /// Finds what changes from the shown frame to `frame`, and shows it. Without a past, everything changes. The wave
    /// is that of the shown frame again after [`Self::finish`].
    pub(super) fn show(&mut self, frame: &RgbdFrame, has_past: bool) {
        let keeps = has_past && self.is_whole;
        (self.keeps, self.is_whole) = (keeps, false);
        self.number += 1;
        let Size { width, height } = frame.size();
        let (across, planes) = (self.changes.across, self.planes);
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
                        let mut left = 0;
                        for run in blocks.chunk_by(|a, b| a == b) {
                            let right = (left + run.len() * BLOCK).min(width);
                            if run[0] {
                                shown[left..right].copy_from_slice(&new[left..right]);
                            }
                            left = right;
                        }
                    }
                });
        }
    }

    /// Returns the number of shown frames.
    pub(super) fn number(&self) -> u64 {
        self.number
    }

    /// Returns the factor that removes the mean phase of each colour of the wave. It stays as it was while its phase is
    /// within [`TURN_TOLERANCE`] of the wave's own. `own` returns that of a colour, whose values differ from those
    /// before within `reach` of `changes`, or of the shown frame's.
    pub(super) fn turns(
        &mut self,
        changes: Option<&Changes>,
        reach: usize,
        own: impl Fn(usize, &(dyn Fn(Range<usize>) -> bool + Sync), &mut Sums) -> Complex32,
    ) -> [Complex32; 3] {
        let (keeps, size) = (self.keeps, self.frame.size());
        let changes = changes.unwrap_or(&self.changes);
        if !keeps || changes.blocks.contains(&true) {
            let differs = |values: Range<usize>| !keeps || changes.any_value(values, size, reach);
            for (colour, turn) in self.turns[..self.frame.colours()].iter_mut().enumerate() {
                let own = own(colour, &differs, &mut self.sums);
                if !keeps || (own * turn.conj()).arg().abs() > TURN_TOLERANCE {
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

    /// Forgets the wave, which is another method's.
    pub(super) fn forget(&mut self) {
        self.is_whole = false;
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
    use crate::frame::tests::scene as scene_of;
    use crate::method::mean_phase::MeanPhase;
    use crate::method::network::Network;
    use crate::method::sweep::{Sweep, SweepPlan};
    use crate::method::wave::Pixels;
    use crate::method::{Method, MethodPlan, MethodScratch, Plan, Scratch};
    use crate::runtime::cancel::Cancel;
    use num_complex::Complex32;
    use phasefront_kernels::fir::Pixel;
    use std::sync::Arc;
    use std::time::Duration;

    const SIZE: Size = Size { width: 83, height: 61 };
    /// The largest difference between the waves of a pixel in rectangles of different sizes, about 4·10⁻⁴ here.
    const ROUNDING: f32 = 1e-3;
    const PAST: Option<Past> = Some(Past {
        scale: 1.0,
        elapsed: Duration::from_millis(33),
    });

    fn scene(x: usize, noise: [f32; 2], seed: u32) -> RgbdFrame {
        scene_of(SIZE, x, noise, seed)
    }

    fn display() -> Display {
        Display::from_toml("volume_depth_mm = 1.5").unwrap()
    }

    fn sweep(layers: usize, tile: usize) -> Sweep {
        Sweep {
            tile,
            hidden_layers: layers,
            ..Sweep::of_planes(&display(), 9)
        }
    }

    fn plan_of(method: Method) -> MethodPlan {
        MethodPlan::new(SIZE, method, &display()).unwrap()
    }

    fn plan(layers: usize) -> MethodPlan {
        plan_of(Method::Sweep(sweep(layers, 16)))
    }

    fn networks() -> [Arc<Network>; 3] {
        let network = |bytes: &[u8]| Arc::new(Network::from_onnx(bytes).unwrap());
        [
            network(include_bytes!("../../../../models/rgbd-8-int8.onnx")),
            network(include_bytes!("../../../../models/rgbd-8.onnx")),
            network(include_bytes!("../../../../models/natural-8-int8.onnx")),
        ]
    }

    fn keeping(plan: &MethodPlan) -> MethodScratch {
        let mut scratch = plan.scratch();
        plan.keep_standing(&mut scratch);
        scratch
    }

    fn field(plan: &MethodPlan, past: Option<Past>, frame: &RgbdFrame, scratch: &mut MethodScratch) -> Vec<Complex32> {
        let mut field = vec![Complex32::new(f32::NAN, f32::NAN); 3 * SIZE.pixels()];
        plan.choose(past, frame, scratch).unwrap();
        plan.field_as_chosen(past, frame, MeanPhase::Kept, &mut field, scratch)
            .unwrap();
        field
    }

    fn anew(plan: &MethodPlan, frame: &RgbdFrame) -> Vec<Complex32> {
        field(plan, None, frame, &mut plan.scratch())
    }

    fn shown(scratch: &MethodScratch) -> &RgbdFrame {
        &scratch.standing.as_ref().unwrap().frame
    }

    fn changed(scratch: &MethodScratch) -> usize {
        let blocks = &scratch.standing.as_ref().unwrap().changes.blocks;
        blocks.iter().filter(|changed| **changed).count()
    }

    /// Returns the largest difference between two fields.
    fn farthest(a: &[Complex32], b: &[Complex32]) -> f32 {
        a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f32::max)
    }

    #[test]
    fn the_wave_is_that_of_the_shown_frame_which_is_near_the_given_one() {
        let swept = [(0, 16), (2, 16), (0, 48), (2, 48), (2, 96)];
        let swept = swept.map(|(layers, tile)| (Method::Sweep(sweep(layers, tile)), ROUNDING));
        // The pixels of a network do not depend on what else is computed.
        let trained = networks().map(|network| (Method::Network(network), 0.0));
        for (which, (method, rounding)) in swept.into_iter().chain(trained).enumerate() {
            let plan = plan_of(method);
            let mut scratch = keeping(&plan);
            for i in 0..6_u32 {
                let frame = scene(20 + 4 * i as usize, [0.004, 0.01], i);
                let past = PAST.filter(|_| i > 0);
                let field = field(&plan, past, &frame, &mut scratch);
                let apart = farthest(&field, &anew(&plan, shown(&scratch)));
                assert!(apart <= rounding, "{which} {i}: {apart}");
                if i == 0 {
                    assert!(*shown(&scratch) == frame);
                    continue;
                }
                let blocks = changed(&scratch);
                assert!((1..12).contains(&blocks), "{which} {i}: {blocks}");
                let wave = anew(&plan, &frame);
                let squares: f32 = field.iter().zip(&wave).map(|(a, b)| (a - b).norm_sqr()).sum();
                let error = (squares / wave.len() as f32).sqrt();
                assert!(error < 0.03, "{which} {i}: {error}");
            }
        }
    }

    #[test]
    fn the_sum_of_the_sweeps_pixels_is_kept_with_them() {
        let plan = plan(2);
        let mut scratch = keeping(&plan);
        let cancel = Cancel::default();
        scratch.set_cancel(&cancel);
        for (i, past) in [None, PAST, PAST, None, PAST, PAST].into_iter().enumerate() {
            // The fifth frame is given up.
            match i {
                4 => cancel.request(),
                _ => cancel.clear(),
            }
            field(&plan, past, &scene(20 + 4 * i, [0.004, 0.01], 1), &mut scratch);
            let Scratch::Sweep(swept) = &scratch.of_plan else {
                panic!("the sweep's scratch");
            };
            let Pixels::Fixed(pixels, sums) = swept.wave() else {
                panic!("the sweep's wave");
            };
            for (pixels, kept) in pixels.chunks_exact(SIZE.pixels()).zip(sums) {
                let add = |[re, im]: [i64; 2], pixel: &Pixel| [re + i64::from(pixel.re()), im + i64::from(pixel.im())];
                assert_eq!(pixels.iter().fold([0; 2], add), *kept, "{i}");
            }
        }
    }

    /// Checks the automatic choice, which goes from the sweep to a network as depth gets soft, and back.
    #[test]
    fn another_method_computes_all() {
        let [network, ..] = networks();
        let plan = plan_of(Method::Auto(sweep(2, 16), network));
        let mut scratch = keeping(&plan);
        let sharp = scene(40, [0.0, 0.0], 1);
        let mut soft = sharp.clone();
        let depths = soft.planes_mut().1.iter_mut().enumerate();
        depths.for_each(|(i, depth)| *depth = 0.5 + 0.3 * ((i % SIZE.width) as f32 / 9.0).sin());
        let mut choices = Vec::new();
        for frame in [&sharp, &sharp, &soft, &soft, &sharp, &sharp] {
            let apart = farthest(&field(&plan, PAST, frame, &mut scratch), &anew(&plan, frame));
            assert!(apart < ROUNDING, "{choices:?}: {apart}");
            choices.push((scratch.is_swept(), changed(&scratch)));
        }
        let all = 6 * 4;
        let expected = [(true, all), (true, 0), (false, all), (false, 0), (true, all), (true, 0)];
        assert_eq!(choices, expected);
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
    fn values_differ_in_rows_near_a_change() {
        let size = Size { width: 50, height: 70 };
        let (down, across) = (5, 4);
        let blocks = (0..down * across).map(|block| block == 9).collect();
        let changes = Changes { blocks, across };
        // The changed block has the rows 32 to 47.
        for (rows, reach, differs) in [
            (0..30, 2, false),
            (0..31, 17, true),
            (48..70, 0, false),
            (48..70, 1, true),
            (40..41, 0, true),
        ] {
            let values = size.pixels() + rows.start * 50 + 3..size.pixels() + rows.end * 50 - 3;
            assert_eq!(changes.any_value(values, size, reach), differs, "{rows:?} {reach}");
        }
        let of_two_planes = size.pixels() - 1..size.pixels() + 1;
        assert!(changes.any_value(of_two_planes, size, 0));
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
            let farthest = (shown(&scratch).values().0.iter().zip(frame.values().0)).map(|(a, b)| (a - b).abs());
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
        let run = |plan: &MethodPlan| {
            let mut scratch = keeping(plan);
            frames.each_ref().map(|frame| field(plan, PAST, frame, &mut scratch))
        };
        let expected = run(&plan(2));
        for isa in phasefront_kernels::Isa::fir() {
            let swept = SweepPlan::new(SIZE, &display(), sweep(2, 16), 0.0).unwrap();
            if let Some(swept) = swept.on(isa) {
                let plan = MethodPlan {
                    plan: Plan::Sweep(Box::new(swept)),
                    ..plan(2)
                };
                assert!(run(&plan) == expected, "{isa}");
            }
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        assert!(pool.install(|| run(&plan(2))) == expected);
    }
}
