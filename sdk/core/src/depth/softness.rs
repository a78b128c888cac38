//! Measures whether the edges of a frame's depth are soft. The plane sweep, which relies on every depth, displays the
//! better image where edges are sharp, even if some lie at the wrong place. A network displays the better one where
//! depth is soft everywhere, as depth from motion and depth that a network estimated.
//!
//! Conditioning makes a soft edge sharp in the middle, so the measure compares the largest step of an edge with the
//! whole change around it.

use crate::Bounds;
use crate::Size;
use crate::frame::RgbdFrame;
use crate::parallel::prelude::*;

/// The change of depth over a window above which it holds an edge, as a share of the volume.
pub const EDGE: f32 = 0.1;
/// The least number of steps of a window.
const LEAST_WINDOW: usize = 25;
/// The number of windows along the longer side of a large frame: a sensor's reading grows with the display.
const WINDOWS: usize = 41;
/// The number of lines along the longer side of a large frame that are measured.
const MEASURED: usize = 480;
/// The share of a window's change that a sharp edge makes in one step.
pub const ONE_STEP: f32 = 0.75;
/// The least share of sharp edges in depth that is not soft.
const SHARP: f32 = 0.5;
/// The distance from [`SHARP`] within which a video frame stays what the previous frame was.
const HYSTERESIS: f32 = 0.05;
/// The number of lines in a thread's unit of work. The first of each is measured.
pub const LINES: usize = 32;

/// Returns whether depth of which `sharp_edges` of the edges are sharp is soft. `was` says it of the previous frame of
/// a video, so that a video does not alternate between two methods.
pub fn is_soft(sharp_edges: f32, was: Option<bool>) -> bool {
    let bound = match was {
        Some(true) => SHARP + HYSTERESIS,
        Some(false) => SHARP - HYSTERESIS,
        None => SHARP,
    };
    sharp_edges < bound
}

/// Returns the share of the edges in the depth of `frame`, along rows and columns, that are sharp: one step makes most
/// of the change around it. Returns 1 for a frame without edges. A slope is no edge, and neither is the crease where
/// two slopes meet without a step.
///
/// Runs on the current thread pool. Does not allocate.
pub fn sharp_edges(frame: &RgbdFrame) -> f32 {
    let depth = frame.values().1;
    let Size { width, height } = frame.size();
    let (window, every) = scale(frame.size());
    let part = |part: usize, of: usize| (part * LINES..((part + 1) * LINES).min(of)).step_by(every);
    let rows = (0..height.div_ceil(LINES)).into_par_iter();
    let rows = rows.map(|i| edges(depth, part(i, height), width, (1, width), window));
    let columns = (0..width.div_ceil(LINES)).into_par_iter();
    let columns = columns.map(|i| edges(depth, part(i, width), 1, (width, height), window));
    let (sharp, all) = rows
        .chain(columns)
        .reduce_with(|a, b| (a.0 + b.0, a.1 + b.1))
        .unwrap_or_default();
    share(sharp, all)
}

/// Returns the number of steps of a window of frames of `size`, and the number of lines of which one is measured.
pub fn scale(size: Size) -> (usize, usize) {
    let longer = size.height.max(size.width);
    ((longer / WINDOWS).max(LEAST_WINDOW), (longer / MEASURED).max(1))
}

/// Returns the share of `sharp` among `all` edges, and 1 if there are none.
pub fn share(sharp: u32, all: u32) -> f32 {
    if all == 0 { 1.0 } else { sharp as f32 / all as f32 }
}

/// Returns the number of sharp edges and of all edges along `lines`. Successive lines start `next` values apart and
/// have `length` values, `step` apart.
fn edges(
    depth: &[f32],
    lines: impl Iterator<Item = usize>,
    next: usize,
    (step, length): (usize, usize),
    window: usize,
) -> (u32, u32) {
    let (mut sharp, mut all) = (0, 0);
    for line in lines {
        let at = |i: usize| depth[line * next + i * step];
        let change = |i: usize| (at(i + 1) - at(i)).abs();
        // The steeper slope beside an edge is no part of it, so the crease where two surfaces meet is no edge. To know
        // both slopes, half a window on either side must be in the frame.
        let beside = window.div_ceil(2);
        for start in beside..length.saturating_sub(window + beside) {
            let end = start + window;
            let change_of_window = at(end) - at(start);
            if change_of_window.abs() <= EDGE {
                continue;
            }
            let slope = |from: usize, steps: usize| {
                let step = (at(from + steps) - at(from)) / steps as f32 * change_of_window.signum();
                step.at_least(0.0) * window as f32
            };
            let (left, right) = (start.min(window), (length - 1 - end).min(window));
            let whole = change_of_window.abs() - slope(start - left, left).at_least(slope(end, right));
            if whole <= EDGE {
                continue;
            }
            // Each edge is counted once, where the first of its largest steps is in the middle.
            let at_middle = start + window / 2;
            let middle = change(at_middle);
            if (start..at_middle).any(|i| change(i) >= middle) || (at_middle + 1..end).any(|i| change(i) > middle) {
                continue;
            }
            all += 1;
            sharp += u32::from(middle >= ONE_STEP * whole);
        }
    }
    (sharp, all)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use ndarray::{Array2, Array3};

    fn frame(depth: Array2<f32>) -> RgbdFrame {
        let (height, width) = depth.dim();
        RgbdFrame::new(Array3::from_elem((3, height, width), 0.5), depth).unwrap()
    }

    /// A square before a wall whose edges ramp over `ramp` pixels; the middle `jump` of a ramp is one step.
    fn square(size: usize, ramp: usize, jump: f32) -> f32 {
        let along = |at: usize| {
            let rise = |from: usize| {
                let share = (at as f32 - from as f32) / ramp as f32;
                let step = if share >= 0.5 { jump } else { 0.0 };
                step + (1.0 - jump) * share.clamp(0.0, 1.0)
            };
            (rise(size / 4) - rise(3 * size / 4)).clamp(0.0, 1.0)
        };
        sharp_edges(&frame(Array2::from_shape_fn((size, size + 7), |(y, x)| {
            0.8 - 0.6 * along(y).min(along(x))
        })))
    }

    #[test]
    fn soft_edges_are_told_from_sharp_ones_at_any_size() {
        for size in [120, 300, 1100] {
            let reach = (size / WINDOWS).max(LEAST_WINDOW);
            assert!(square(size, 1, 0.0) > 0.95, "{size}");
            assert!(square(size, reach / 2, 0.0) < 0.05, "{size}");
            // What conditioning makes of a soft edge.
            assert!(square(size, reach / 2, 0.5) < 0.3, "{size}");
            assert!(square(size, reach / 2, 0.9) > 0.7, "{size}");
        }
    }

    #[test]
    fn what_has_no_edges_is_not_soft() {
        for (height, width) in [(1, 1), (2, 9), (26, 25), (90, 130)] {
            let slope = Array2::from_shape_fn((height, width), |(y, x)| (0.006 * x as f32 + 0.002 * y as f32).min(1.0));
            for depth in [Array2::from_elem((height, width), 0.4), slope] {
                assert_eq!(sharp_edges(&frame(depth)), 1.0, "{height}×{width}");
            }
        }
        assert!(!is_soft(1.0, None) && !is_soft(1.0, Some(true)));
    }

    #[test]
    fn creases_of_an_interior_are_not_soft() {
        let (height, width) = (240, 320);
        // Side walls, floor and ceiling, which meet a far wall without a step.
        let walls = Array2::from_shape_fn((height, width), |(y, x)| {
            let border = x.min(width - 1 - x).min(y).min(height - 1 - y) as f32;
            (0.012 * border).min(0.7)
        });
        assert_eq!(sharp_edges(&frame(walls.clone())), 1.0);
        let mut with_box = walls;
        with_box.slice_mut(ndarray::s![90..170, 120..180]).fill(0.3);
        assert!(sharp_edges(&frame(with_box)) > 0.9);
    }

    #[test]
    fn any_number_of_threads_finds_the_same() {
        let depth = Array2::from_shape_fn((77, 93), |(y, x)| match y {
            0..40 => 0.2 + 0.5 * f32::from(x > 40),
            _ => (x as f32 / 20.0 - 1.5).clamp(0.2, 0.7),
        });
        let frame = frame(depth);
        let of = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| sharp_edges(&frame))
        };
        let share = of(1);
        assert!(share == of(3) && (0.3..0.7).contains(&share), "{share}");
    }

    #[test]
    fn what_lies_near_the_bound_stays_what_it_was() {
        for was in [true, false] {
            assert_eq!(is_soft(SHARP + 0.02, Some(was)), was);
            assert_eq!(is_soft(SHARP - 0.02, Some(was)), was);
            assert!(is_soft(SHARP - 0.1, Some(was)) && !is_soft(SHARP + 0.1, Some(was)));
        }
        assert!(is_soft(SHARP - 0.01, None) && !is_soft(SHARP + 0.01, None));
    }
}
