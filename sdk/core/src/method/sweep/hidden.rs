//! Hidden surfaces, which an RGB-D frame does not show but which still emit light.
//!
//! Behind a pixel are the surfaces that its deeper neighbours show. The hidden layers continue them under the nearer
//! surface, as far as light can reach. On a pixel's left, right, upper and lower side, the search looks for
//!
//! - its *near* source, the first pixel that is deeper than this one by more than [`JUMP`] and whose next pixel is not
//!   another jump deeper, as at a blurred edge, and
//! - its *far* source, the first pixel beyond the near source that is deeper than it by more than [`JUMP`],
//!
//! by a rule from pixel to pixel (`Found::next`), so that the cost does not depend on the reach. The nearest source of
//! the four sides is the first hidden layer. The nearest source deeper than that is the second.

use super::workers::Workers;
use crate::Size;
use crate::method::standing::{BLOCK, Changes};
use crate::parallel::prelude::*;

/// The difference in normalized depth above which two pixels are on different surfaces.
pub const JUMP: f32 = 0.02;
/// The index of no source.
pub const NOTHING: u32 = u32::MAX;
/// The number of rows of a task.
const BAND: usize = 2 * BLOCK;
/// The depth of no source, which is not deeper than anything.
const NO_DEPTH: f32 = -1.0;

/// A source on one side of a pixel, with its depth and distance.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Source {
    depth: f32,
    distance: u32,
}

/// The sources on one side of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Found {
    near: Source,
    far: Source,
    /// Whether the next pixel on that side is a jump deeper.
    edge: bool,
}

const NONE: Source = Source {
    depth: NO_DEPTH,
    distance: 0,
};

impl Found {
    const NOTHING: Found = Found {
        near: NONE,
        far: NONE,
        edge: false,
    };

    fn is_nothing(&self) -> bool {
        self.near.depth == NO_DEPTH && !self.edge
    }

    /// Returns the sources of a pixel of `depth`, given those of its neighbour and the neighbour's own depth. The
    /// candidates are the neighbour itself, its near source and its far source. The first that is deep enough and
    /// within `reach` becomes the near source, and the one after it the far source.
    #[inline(always)]
    fn next(self, neighbour: f32, depth: f32, reach: u32) -> Found {
        let aged = |source: Source| Source {
            depth: if source.distance < reach {
                source.depth
            } else {
                NO_DEPTH
            },
            distance: source.distance + 1,
        };
        let (near, far) = (aged(self.near), aged(self.far));
        let least = depth + JUMP;
        let itself = Source {
            depth: neighbour,
            distance: 1,
        };
        let deeper = |source: Source| source.depth > least;
        let edge = deeper(itself);
        // A neighbour that is itself at an edge is a pixel of a blurred edge and belongs to neither surface.
        let itself = if self.edge { NONE } else { itself };
        Found {
            edge,
            near: if deeper(itself) {
                itself
            } else if deeper(near) {
                near
            } else if deeper(far) {
                far
            } else {
                NONE
            },
            far: if deeper(itself) {
                if near.depth > neighbour + JUMP {
                    near
                } else {
                    far_of(far, neighbour)
                }
            } else if deeper(near) {
                far
            } else {
                NONE
            },
        }
    }
}

/// Returns `far` if it is deeper than a surface at `depth`.
#[inline(always)]
fn far_of(far: Source, depth: f32) -> Source {
    if far.depth > depth + JUMP { far } else { NONE }
}

/// The sources of a pixel's hidden layers. Sides are added one after another.
#[derive(Clone, Copy)]
struct Layers {
    source: [u32; 2],
    depth: [f32; 2],
    distance: [u32; 2],
}

impl Layers {
    const NOTHING: Layers = Layers {
        source: [NOTHING; 2],
        depth: [NO_DEPTH; 2],
        distance: [u32::MAX; 2],
    };

    /// Adds the sources of one side. `index` returns the source's pixel for a distance on that side.
    fn add(&mut self, found: Found, index: impl Fn(u32) -> usize) {
        for Source { depth, distance } in [found.near, found.far] {
            if depth == NO_DEPTH {
                return;
            }
            if distance < self.distance[0] {
                if self.depth[0] > depth + JUMP && self.distance[0] < self.distance[1] {
                    self.move_back();
                } else if self.depth[1] <= depth + JUMP {
                    self.source[1] = NOTHING;
                    self.depth[1] = NO_DEPTH;
                    self.distance[1] = u32::MAX;
                }
                self.source[0] = index(distance) as u32;
                self.depth[0] = depth;
                self.distance[0] = distance;
            } else if depth > self.depth[0] + JUMP && distance < self.distance[1] {
                self.source[1] = index(distance) as u32;
                self.depth[1] = depth;
                self.distance[1] = distance;
            }
        }
    }

    fn move_back(&mut self) {
        self.source[1] = self.source[0];
        self.depth[1] = self.depth[0];
        self.distance[1] = self.distance[0];
    }
}

/// A search for one frame shape and reach. It is immutable and can be shared between threads.
#[derive(Debug, Clone)]
pub struct Hidden {
    height: usize,
    width: usize,
    reach: usize,
}

/// The working memory of [`Hidden::find`].
pub struct HiddenScratch {
    workers: Workers<Work>,
}

struct Work {
    /// The sources above or below the current row for each column.
    columns: Vec<Found>,
    /// Whether any column of each [`BLOCK`] has found a source. The others are skipped together.
    busy: Vec<bool>,
    /// The layers of a band, (BAND, W).
    layers: Vec<Layers>,
}

impl Hidden {
    /// Plans the search in frames of `size` up to `reach` pixels.
    pub fn new(size: Size, reach: usize) -> Self {
        let Size { width, height } = size;
        Hidden { height, width, reach }
    }

    /// Returns how far from a pixel the depth affects its sources: one pixel beyond the farthest source.
    fn dependence(&self) -> usize {
        self.reach + 1
    }

    /// Returns working memory for one call at a time, sized for the current thread pool.
    pub fn scratch(&self) -> HiddenScratch {
        HiddenScratch {
            workers: Workers::new(|| Work {
                columns: vec![Found::NOTHING; self.width],
                busy: vec![false; self.width.div_ceil(BLOCK)],
                layers: vec![Layers::NOTHING; BAND.min(self.height) * self.width],
            }),
        }
    }

    /// Finds, for each pixel of normalized `depth`, (H, W), the pixels that its hidden layers continue, and writes them
    /// into `sources`, (2, H, W), as indices into the frame or [`NOTHING`]. Allocates nothing.
    ///
    /// # Panics
    /// Panics if a length is wrong.
    pub fn find(&self, depth: &[f32], sources: &mut [u32], scratch: &mut HiddenScratch) {
        self.check(depth, sources);
        let (first, second) = sources.split_at_mut(self.height * self.width);
        (first.par_chunks_mut(BAND * self.width))
            .zip(second.par_chunks_mut(BAND * self.width))
            .enumerate()
            .for_each(|(band, layers)| {
                (scratch.workers).with(|work| self.band(depth, band * BAND, layers.into(), None, work));
            });
    }

    /// Works like [`Self::find`] where the frame has changed since the last call: rows that do not depend on a block of
    /// `changes` keep their sources. Adds to `affected` the blocks with a pixel whose source is another one, or is in a
    /// block of `changes`.
    pub(super) fn find_where(
        &self,
        changes: &Changes,
        affected: &mut Changes,
        depth: &[f32],
        sources: &mut [u32],
        scratch: &mut HiddenScratch,
    ) {
        self.check(depth, sources);
        let (first, second) = sources.split_at_mut(self.height * self.width);
        (first.par_chunks_mut(BAND * self.width))
            .zip(second.par_chunks_mut(BAND * self.width))
            .zip(affected.blocks.par_chunks_mut(BAND / BLOCK * changes.across))
            .enumerate()
            .filter(|(band, _)| {
                let (top, around) = (band * BAND, self.dependence());
                changes.any(top.saturating_sub(around)..top + BAND + around)
            })
            .for_each(|(band, (layers, affected))| {
                let known = Some((changes, affected));
                (scratch.workers).with(|work| self.band(depth, band * BAND, layers.into(), known, work));
            });
    }

    fn check(&self, depth: &[f32], sources: &[u32]) {
        let size = self.height * self.width;
        assert!(depth.len() == size && sources.len() == 2 * size);
    }

    /// Finds the sources of the rows from `top` on that `of_layers` hold. If the changes of the frame are known, adds
    /// those of the sources to the rows' blocks.
    fn band(
        &self,
        depth: &[f32],
        top: usize,
        [first, second]: [&mut [u32]; 2],
        known: Option<(&Changes, &mut [bool])>,
        work: &mut Work,
    ) {
        let (width, reach) = (self.width, self.reach as u32);
        let row = |y: usize| &depth[y * width..][..width];
        let rows = first.len() / width;
        let layers = &mut work.layers[..first.len()];
        layers.fill(Layers::NOTHING);
        for (y, layers) in layers.chunks_exact_mut(width).enumerate() {
            along(row(top + y), layers, (top + y) * width, reach);
        }
        // Sources are at most `reach` rows away, and the row behind a source determines whether it is at an edge. A
        // walk that starts there without sources therefore finds the same result.
        let before = self.dependence();
        let (columns, busy) = (&mut work.columns, &mut work.busy);
        columns.fill(Found::NOTHING);
        busy.fill(false);
        for y in top.saturating_sub(before) + 1..top + rows {
            let layers = y.checked_sub(top).map(|y| &mut layers[y * width..][..width]);
            step(columns, busy, row(y - 1), row(y), reach, layers, |x, d| {
                (y - d as usize) * width + x
            });
        }
        columns.fill(Found::NOTHING);
        busy.fill(false);
        let last = (top + rows - 1 + before).min(self.height - 1);
        for y in (top..last).rev() {
            let layers = (y < top + rows).then(|| &mut layers[(y - top) * width..][..width]);
            step(columns, busy, row(y + 1), row(y), reach, layers, |x, d| {
                (y + d as usize) * width + x
            });
        }
        if let Some((changes, affected)) = known {
            for (y, layers) in layers.chunks_exact(width).enumerate() {
                let before = first[y * width..].chunks(BLOCK).zip(second[y * width..].chunks(BLOCK));
                let affected = &mut affected[y / BLOCK * changes.across..][..changes.across];
                for ((affected, layers), (first, second)) in affected.iter_mut().zip(layers.chunks(BLOCK)).zip(before) {
                    let now = layers.iter().map(|layers| layers.source);
                    let mut both = now.zip(first.iter().zip(second));
                    *affected |= both.any(|(now, (first, second))| {
                        let is_changed = |source: u32| {
                            source != NOTHING && changes.contains(source as usize / width, source as usize % width)
                        };
                        now != [*first, *second] || now.into_iter().any(is_changed)
                    });
                }
            }
        }
        for ((first, second), layers) in first.iter_mut().zip(second).zip(layers) {
            [*first, *second] = layers.source;
        }
    }
}

/// Adds the sources on the left and right of a row's pixels. `at` is the index of the row's first pixel in the frame.
fn along(depth: &[f32], layers: &mut [Layers], at: usize, reach: u32) {
    let width = depth.len();
    let mut x = 1;
    while x < width {
        x += calm(&depth[x - 1..width - 1], &depth[x..]);
        let mut found = Found::NOTHING;
        while x < width {
            found = found.next(depth[x - 1], depth[x], reach);
            if found.is_nothing() {
                break;
            }
            layers[x].add(found, |distance| at + x - distance as usize);
            x += 1;
        }
        x += 1;
    }
    // The right side, where x counts from the right.
    let mut x = 1;
    while x < width {
        x += calm_back(&depth[1..=width - x], &depth[..width - x]);
        let mut found = Found::NOTHING;
        while x < width {
            let i = width - 1 - x;
            found = found.next(depth[i + 1], depth[i], reach);
            if found.is_nothing() {
                break;
            }
            layers[i].add(found, |distance| at + i + distance as usize);
            x += 1;
        }
        x += 1;
    }
}

/// Returns how many pixels, from the first on, have a neighbour that is not a jump deeper.
fn calm(neighbours: &[f32], depths: &[f32]) -> usize {
    let whole = (neighbours.chunks_exact(BLOCK))
        .zip(depths.chunks_exact(BLOCK))
        .take_while(|(neighbours, depths)| !any_jump(neighbours, depths))
        .count()
        * BLOCK;
    let rest = neighbours[whole..].iter().zip(&depths[whole..]);
    whole + rest.take_while(|(n, d)| **n <= **d + JUMP).count()
}

/// Works like [`calm`] from the last pixel backwards.
fn calm_back(neighbours: &[f32], depths: &[f32]) -> usize {
    let whole = (neighbours.rchunks_exact(BLOCK))
        .zip(depths.rchunks_exact(BLOCK))
        .take_while(|(neighbours, depths)| !any_jump(neighbours, depths))
        .count()
        * BLOCK;
    let left = depths.len() - whole;
    let rest = neighbours[..left].iter().zip(&depths[..left]).rev();
    whole + rest.take_while(|(n, d)| **n <= **d + JUMP).count()
}

/// Returns whether any neighbour is a jump deeper. Checking all without an early exit takes only a few instructions.
fn any_jump(neighbours: &[f32], depths: &[f32]) -> bool {
    let jumps = neighbours.iter().zip(depths).map(|(n, d)| *n > *d + JUMP);
    jumps.fold(false, |any, jump| any | jump)
}

/// Advances all columns by one row and adds their sources to the row's `layers`, if given. `index(x, distance)` returns
/// a source's pixel. Blocks of columns that have found nothing and find nothing are skipped.
fn step(
    columns: &mut [Found],
    busy: &mut [bool],
    neighbours: &[f32],
    depths: &[f32],
    reach: u32,
    mut layers: Option<&mut [Layers]>,
    index: impl Fn(usize, u32) -> usize,
) {
    for (block, busy) in busy.iter_mut().enumerate() {
        let x = block * BLOCK..((block + 1) * BLOCK).min(columns.len());
        let (neighbours, depths) = (&neighbours[x.clone()], &depths[x.clone()]);
        if !*busy && !any_jump(neighbours, depths) {
            continue;
        }
        let columns = &mut columns[x.clone()];
        *busy = false;
        for ((found, neighbour), depth) in columns.iter_mut().zip(neighbours).zip(depths) {
            *found = found.next(*neighbour, *depth, reach);
            *busy |= !found.is_nothing();
        }
        if let Some(layers) = &mut layers {
            for ((x, layers), found) in x.clone().zip(&mut layers[x]).zip(columns) {
                layers.add(*found, |distance| index(x, distance));
            }
        }
    }
}

/// Finds the same sources as [`Hidden::find`] naively, as the oracle for tests: for each side of each pixel, it walks
/// from a pixel beyond `reach`.
pub fn reference(depth: &[f32], size: Size, reach: usize) -> Vec<u32> {
    let Size { width, height } = size;
    let size = height * width;
    assert_eq!(depth.len(), size);
    let mut sources = vec![NOTHING; 2 * size];
    for y in 0..height {
        for x in 0..width {
            let mut layers = Layers::NOTHING;
            let sides: [(isize, usize); 4] = [
                (-1, x),
                (1, width - 1 - x),
                (-(width as isize), y),
                (width as isize, height - 1 - y),
            ];
            for (step, room) in sides {
                let at = |distance: usize| (y * width + x).wrapping_add_signed(step * distance as isize);
                let mut found = Found::NOTHING;
                for distance in (0..room.min(reach + 1)).rev() {
                    found = found.next(depth[at(distance + 1)], depth[at(distance)], reach as u32);
                }
                layers.add(found, |distance| at(distance as usize));
            }
            [sources[y * width + x], sources[size + y * width + x]] = layers.source;
        }
    }
    sources
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size { width: 75, height: 101 };

    /// Checks the sources after a change, and the blocks that are affected, value by value.
    #[test]
    fn a_change_is_found_in_all_blocks_that_it_affects() {
        let mut state = 1u32;
        let mut random = |most: usize| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 16) as usize % most
        };
        let mut paint = |depth: &mut [f32], side: usize| {
            let (top, left) = (random(SIZE.height), random(SIZE.width));
            let (down, across, value) = (1 + random(side), 1 + random(side), random(10) as f32 / 10.0);
            for row in depth.chunks_exact_mut(SIZE.width).skip(top).take(down) {
                row[left..].iter_mut().take(across).for_each(|depth| *depth = value);
            }
        };
        let size = SIZE.pixels();
        let mut more = 0;
        for _ in 0..40 {
            let mut depth = vec![0.9; size];
            (0..6).for_each(|_| paint(&mut depth, 50));
            let (plan, mut sources) = (Hidden::new(SIZE, 21), vec![NOTHING; 2 * size]);
            let mut scratch = plan.scratch();
            plan.find(&depth, &mut sources, &mut scratch);
            let before = (depth.clone(), sources.clone());
            paint(&mut depth, 12);

            let mut changes = Changes::all(SIZE);
            let block = |at: usize| at / SIZE.width / BLOCK * changes.across + at % SIZE.width / BLOCK;
            let mut blocks = vec![false; changes.blocks.len()];
            (0..size).for_each(|at| blocks[block(at)] |= depth[at] != before.0[at]);
            let expected = reference(&depth, SIZE, 21);
            let mut affected = blocks.clone();
            for (i, (now, then)) in expected.iter().zip(&before.1).enumerate() {
                let is_of_changed = *now != NOTHING && blocks[block(*now as usize)];
                affected[block(i % size)] |= now != then || is_of_changed;
            }
            more += usize::from(affected != blocks);

            let mut found = Changes::all(SIZE);
            found.blocks.copy_from_slice(&blocks);
            changes.blocks.copy_from_slice(&blocks);
            plan.find_where(&changes, &mut found, &depth, &mut sources, &mut scratch);
            assert!(sources == expected);
            assert!(found.blocks == affected);
        }
        assert!(more > 10, "{more}");
    }
}
