//! The plane sweep. It computes holograms of RGB-D frames by wave propagation, without training, for any display.
//!
//! As in the silhouette-mask layer-based method (SM-LBM, Eq. 1–4 of the paper), the scene is cut into planes, and a
//! wave is carried over them from back to front. Each plane's silhouette replaces the light that comes from behind it.
//! The following additions improve speed and quality:
//!
//! - [`hidden`] adds surfaces that an RGB-D frame does not show, so that edges are lit from behind;
//! - a step between planes is a convolution with a filter of a few pixels ([`fit`](self)) instead of a Fourier
//!   transform;
//! - a point between two planes is on both, with a share on each ([`shares`](self));
//! - the wave is in 16-bit fixed point, so that all instruction sets give the same bits
//!   ([`fir`](phasefront_kernels::fir));
//! - a tile of the frame processes only the planes with points in the tile and its halo, and crosses the others in one
//!   step;
//! - the last step goes from the front plane directly to the midpoint, or on to the display.
//!
//! Plane k of N is at z = V/2 − V·(k + ½)/N. [`mod@reference`] is the naive oracle.

mod filters;
mod fit;
pub mod hidden;
mod points;
pub mod reference;
mod shares;
mod spans;
mod tile;
mod workers;

use crate::Size;
use crate::display::Display;
use crate::frame::RgbdFrame;
use crate::method::standing::{BLOCK, Changes};
use crate::method::wave::{PixelSum, Pixels, Wave};
use crate::parallel::{self, prelude::*};
use crate::runtime::cancel::Cancel;
use crate::runtime::error::{Error, Result};
use filters::Filters;
pub use filters::Optics;
use hidden::{Hidden, HiddenScratch};
use num_complex::Complex32;
use phasefront_kernels::Isa;
use phasefront_kernels::fir::{Fir, Pixel, RUN};
use phasefront_kernels::wide;
pub use shares::MEET;
use shares::Slot;
use std::cmp::Reverse;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
pub use tile::MARGIN;
use tile::{Layout, Surfaces, Tile, TileScratch};
use workers::Workers;

/// The largest number of planes of a sweep.
pub const MAX_PLANES: usize = 1024;
/// The largest number of taps of a step.
pub const MAX_TAPS: usize = 63;
/// The largest number of hidden layers.
pub const MAX_HIDDEN_LAYERS: usize = 2;
/// The largest spread of light through the volume, in pixels. A tile's halo is as wide as this spread, so with a larger
/// one even a small frame would take minutes.
pub const MAX_REACH: usize = 512;
/// The largest spread of light from the front of the volume to the hologram, in pixels. For a larger one, it is better
/// to propagate from the midpoint by Fourier transforms.
pub const MAX_HOME_REACH: usize = 32;

/// The parameters of a plane sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sweep {
    /// The number of planes in the volume.
    pub planes: usize,
    /// The number of taps of the filter from plane to plane along each axis, which is odd.
    pub taps: usize,
    /// The number of hidden layers to add, 0 to [`MAX_HIDDEN_LAYERS`].
    pub hidden_layers: usize,
    /// Whether points between two planes are on both. Otherwise each point is moved to its plane, as in SM-LBM.
    pub between_planes: bool,
    /// The largest number of pixels along each side of a tile, a multiple of 16. Tiles of a frame are of equal size.
    pub tile: usize,
}

impl Sweep {
    /// Returns parameters that suit `display`: planes so close together that light spreads at most a pixel from one to
    /// the next, as far as [`Sweep::DEFAULT_PLANES`] allows, and as many taps as a step needs.
    pub fn for_display(display: &Display) -> Self {
        let reach = reach_px(display, display.volume_depth_m());
        let planes = (reach.ceil() as usize).clamp(*Self::DEFAULT_PLANES.start(), *Self::DEFAULT_PLANES.end());
        Self::of_planes(display, planes)
    }

    /// Returns a sweep of `planes` planes for `display`, with as many taps as its steps need.
    pub fn of_planes(display: &Display, planes: usize) -> Self {
        Sweep {
            planes,
            taps: Self::taps_for(display, planes),
            hidden_layers: MAX_HIDDEN_LAYERS,
            between_planes: true,
            tile: Self::TILE,
        }
    }

    /// The default largest number of pixels along each side of a tile.
    pub const TILE: usize = 320;

    /// The range of planes that [`Sweep::for_display`] chooses from.
    pub const DEFAULT_PLANES: std::ops::RangeInclusive<usize> = 16..=128;

    /// Returns the number of taps that a step between `planes` planes needs: light's reach plus four on each side.
    pub fn taps_for(display: &Display, planes: usize) -> usize {
        let step_m = display.volume_depth_m() / planes.max(1) as f64;
        let radius = reach_px(display, step_m).ceil() as usize + 4;
        (2 * radius + 1).min(MAX_TAPS)
    }

    fn check(&self, display: &Display) -> Result<()> {
        let refuse = |what: String| Err(Error::Setting(format!("sweep: {what}")));
        if !(1..=MAX_PLANES).contains(&self.planes) {
            return refuse(format!("{} planes; 1 to {MAX_PLANES} are right", self.planes));
        }
        if !(3..=MAX_TAPS).contains(&self.taps) || self.taps.is_multiple_of(2) {
            return refuse(format!(
                "{} taps; an odd number from 3 to {MAX_TAPS} is right",
                self.taps
            ));
        }
        let reach = reach_px(display, display.volume_depth_m() / self.planes as f64);
        if self.planes > 1 && self.taps / 2 < reach.ceil() as usize {
            return refuse(format!(
                "light spreads {reach:.1} pixels from plane to plane, farther than {} taps; {} taps or {} planes are right",
                self.taps,
                2 * reach.ceil() as usize + 1,
                (reach * self.planes as f64 / (self.taps / 2) as f64).ceil(),
            ));
        }
        let reach = reach_px(display, display.volume_depth_m());
        if reach > MAX_REACH as f64 {
            return refuse(format!(
                "light spreads {reach:.0} pixels through the volume; {MAX_REACH} are the most: a volume of {:.3} mm or a larger pitch is right",
                display.volume_depth_m() * 1e3 * MAX_REACH as f64 / reach
            ));
        }
        if self.hidden_layers > MAX_HIDDEN_LAYERS {
            return refuse(format!(
                "{} hidden layers; 0 to {MAX_HIDDEN_LAYERS} are right",
                self.hidden_layers
            ));
        }
        if !(16..=4096).contains(&self.tile) || !self.tile.is_multiple_of(16) {
            return refuse(format!(
                "tiles of {} pixels; a multiple of 16 from 16 to 4096 is right",
                self.tile
            ));
        }
        Ok(())
    }
}

/// Returns how far light of the longest wavelength spreads over `distance_m`, in pixels.
fn reach_px(display: &Display, distance_m: f64) -> f64 {
    crate::optics::asm::reach_m(distance_m, display.longest_wavelength_m(), display.pitch_m()) / display.pitch_m()
}

/// The deviation of a colour's fitted filters from free space: √(Σ w(f)·|H/T − 1|²) along one axis, with weights that
/// fall like the spectra of images. 0 is perfect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitError {
    /// The error of one step.
    pub step: f64,
    /// The error of all steps through the volume.
    pub volume: f64,
}

/// A plan of the sweep for one frame shape and display. It is immutable and can be shared between threads.
pub struct SweepPlan {
    size: Size,
    sweep: Sweep,
    z_m: f64,
    fir: Fir,
    filters: Vec<Filters>,
    hidden: Hidden,
    layout: Layout,
}

/// The working memory of a [`SweepPlan`] for one frame at a time, for the thread pool in which it was made.
pub struct SweepScratch {
    positions: Vec<f32>,
    slots: Vec<Slot>,
    /// The least and the most of the slots of each [`RUN`] pixels of a row.
    ranges: Vec<[Slot; 2]>,
    sources: Vec<u32>,
    hidden: HiddenScratch,
    tiles: Workers<TileScratch>,
    /// The swept wave, (C, H, W), and the sum of each colour's pixels.
    wave: Vec<Pixel>,
    sums: [PixelSum; 3],
    /// The blocks whose visible or hidden surfaces have changed since the frame before.
    changes: Changes,
    /// The rows and columns of the tiles that are computed, the largest first.
    order: Vec<[Range<usize>; 2]>,
    cancel: Cancel,
}

impl SweepScratch {
    /// Makes the computation stop early once `cancel` is requested.
    pub fn set_cancel(&mut self, cancel: &Cancel) {
        self.cancel = cancel.clone();
    }

    /// Returns the swept wave, (C, H, W).
    pub(super) fn wave(&self) -> Pixels<'_> {
        Pixels::Fixed(&self.wave, &self.sums)
    }

    /// Returns the blocks whose light the last call of [`SweepPlan::sweep_where`] with changes has changed.
    pub(super) fn changes(&self) -> &Changes {
        &self.changes
    }
}

impl SweepPlan {
    /// Plans frames of `size` for `display` with the hologram at `z_m`, where 0 is the midpoint. This fits
    /// the filters.
    ///
    /// # Errors
    /// Returns an error if the frame is empty or too large, a number of `sweep` is out of its range, or the hologram is
    /// so far away that light spreads over more than [`MAX_HOME_REACH`] from the front of the volume.
    pub fn new(size: Size, display: &Display, sweep: Sweep, z_m: f64) -> Result<Self> {
        let Size { width, height } = size;
        sweep.check(display)?;
        Isa::of_variable().map_err(Error::Setting)?;
        if height == 0 || width == 0 || height.saturating_mul(width) >= hidden::NOTHING as usize {
            return Err(Error::Setting(format!(
                "sweep: a frame of {size} pixels is empty or too large"
            )));
        }
        let optics = optics(display, &sweep, z_m)?;
        // Fitting is the only slow part of planning, and colours are independent.
        let filters = optics.par_iter().map(|optics| Filters::new(optics, sweep.taps / 2));
        let filters: Vec<Filters> = filters.collect();
        let layout = Layout::new(size, sweep, &optics, &filters);
        Ok(SweepPlan {
            size,
            sweep,
            z_m,
            fir: Fir::fastest(),
            filters,
            hidden: Hidden::new(size, hidden_reach(display)),
            layout,
        })
    }

    /// Returns the same plan on one instruction set, or `None` if this processor lacks it. All instruction sets give
    /// the same bits.
    pub fn on(self, isa: Isa) -> Option<Self> {
        Fir::new(isa).map(|fir| SweepPlan { fir, ..self })
    }

    /// Returns the same plan with separate steps between all planes, even empty ones, to measure the gain of merging
    /// them.
    pub fn unmerged(mut self) -> Self {
        self.filters.iter_mut().for_each(Filters::unmerge);
        self
    }

    /// Returns the instruction set of the filters.
    pub fn isa(&self) -> Isa {
        self.fir.isa()
    }

    /// Returns the size of the frame.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Returns the parameters of the sweep.
    pub fn sweep(&self) -> Sweep {
        self.sweep
    }

    /// Returns the position of the hologram in metres from the midpoint toward the viewer.
    pub fn z_m(&self) -> f64 {
        self.z_m
    }

    /// Returns the filters of each colour.
    pub fn filters(&self) -> &[Filters] {
        &self.filters
    }

    /// Returns the fit errors of each colour's filters.
    pub fn fit_errors(&self) -> Vec<FitError> {
        let of = |filters: &Filters| FitError {
            step: filters.errors[0],
            volume: filters.errors[1],
        };
        self.filters.iter().map(of).collect()
    }

    /// Returns working memory for one frame at a time, sized for the current thread pool.
    pub fn scratch(&self) -> SweepScratch {
        let size = self.size.pixels();
        let layers = self.sweep.hidden_layers;
        let Size { width, height } = self.size;
        SweepScratch {
            positions: vec![0.0; size],
            slots: vec![0; size],
            ranges: vec![[0; 2]; width.div_ceil(RUN) * height],
            sources: vec![0; if layers > 0 { MAX_HIDDEN_LAYERS * size } else { 0 }],
            hidden: self.hidden.scratch(),
            tiles: Workers::new(|| TileScratch::new(&self.layout, size, layers)),
            wave: vec![Pixel::ZERO; self.filters.len() * size],
            sums: [[0; 2]; 3],
            changes: Changes::all(self.size),
            order: Vec::with_capacity(self.layout.tiles(0..height, 0..width, 2).count()),
            cancel: Cancel::default(),
        }
    }

    /// Returns how far the light of a pixel spreads.
    pub(super) fn reach(&self) -> usize {
        self.layout.reach()
    }

    /// Writes the hologram of `frame`, without the carrier, at [`SweepPlan::z_m`] into `field`, (C, H, W). Allocates
    /// nothing. A frame that is given up leaves `field` as it is.
    ///
    /// # Errors
    /// Returns an error if the frame has another shape or other colours.
    ///
    /// # Panics
    /// Panics if `field` does not have C·H·W values or `scratch` belongs to another plan.
    pub fn field(&self, frame: &RgbdFrame, field: &mut [Complex32], scratch: &mut SweepScratch) -> Result<()> {
        let size = self.size.pixels();
        assert_eq!(field.len(), self.filters.len() * size);
        let is_whole = self.sweep_where(None, frame, scratch)?;
        let wave = Wave {
            pixels: scratch.wave(),
            size: self.size,
            turns: [Complex32::ONE; 3],
            changed: None,
            is_whole,
        };
        wave.write(field);
        Ok(())
    }

    /// Sweeps `frame` into the wave of `scratch`. If `changes` to the frame before are given, only what they affect is
    /// computed. Returns whether the wave is whole, which it is unless the frame is given up.
    ///
    /// # Errors
    /// Returns an error if the frame has another shape or other colours.
    pub(super) fn sweep_where(
        &self,
        changes: Option<&Changes>,
        frame: &RgbdFrame,
        scratch: &mut SweepScratch,
    ) -> Result<bool> {
        frame.check(self.size(), self.filters.len())?;
        let size = self.size.pixels();
        let SweepScratch {
            positions,
            slots,
            ranges,
            sources,
            hidden,
            tiles,
            wave,
            sums,
            changes: of_surfaces,
            order,
            cancel,
        } = scratch;
        let (rgb, depth) = frame.values();
        self.place_points(changes, depth, positions, slots, ranges);
        let layers = self.sweep.hidden_layers;
        let affected = changes.map(|changes| {
            of_surfaces.blocks.copy_from_slice(&changes.blocks);
            if layers > 0 {
                (self.hidden).find_where(changes, of_surfaces, depth, sources, hidden);
            }
            &*of_surfaces
        });
        if affected.is_none() && layers > 0 {
            self.hidden.find(depth, sources, hidden);
        }
        let surfaces = Surfaces {
            rgb,
            positions,
            slots,
            ranges,
            hidden: &sources[..layers * size],
            size: self.size,
        };
        let mut waves = wave.chunks_exact_mut(size);
        // An array of the largest number of colours avoids an allocation.
        let waves = sums
            .each_mut()
            .map(|sum| Mutex::new((waves.next().unwrap_or_default(), sum)));
        self.arrange(affected, order);
        let next = AtomicUsize::new(0);
        let take = || {
            order
                .get(next.fetch_add(1, Ordering::Relaxed))
                .filter(|_| !cancel.requested())
        };
        (0..parallel::current_num_threads())
            .into_par_iter()
            .with_max_len(1)
            .for_each(|_| {
                while let Some([rows, columns]) = take() {
                    let tile = Tile {
                        layout: &self.layout,
                        fir: self.fir,
                        surfaces,
                        rows: rows.clone(),
                        columns: columns.clone(),
                    };
                    tiles.with(|scratch| {
                        scratch.points.gather(&tile);
                        for (colour, filters) in self.filters.iter().enumerate() {
                            tile.sweep(colour, filters, scratch);
                            let mut plane = waves[colour].lock().unwrap_or_else(PoisonError::into_inner);
                            let (wave, sum) = &mut *plane;
                            tile.store(wave, sum, scratch);
                        }
                    });
                }
            });
        Ok(!cancel.requested())
    }

    /// Finds where the points of a frame's `depth` are among the planes, in the rows with `changes`.
    fn place_points(
        &self,
        changes: Option<&Changes>,
        depth: &[f32],
        positions: &mut [f32],
        slots: &mut [Slot],
        ranges: &mut [[Slot; 2]],
    ) {
        let changed = |rows: Range<usize>| changes.is_none_or(|changes| changes.any(rows));
        let Size { width, .. } = self.size;
        let (part, runs) = (BLOCK * width, width.div_ceil(RUN));
        let parts = (slots.par_chunks_mut(part)).zip(ranges.par_chunks_mut(BLOCK * runs));
        (parts
            .zip(positions.par_chunks_mut(part))
            .zip(depth.par_chunks(part))
            .enumerate())
        .filter(|(row, _)| changed(row * BLOCK..(row + 1) * BLOCK))
        .for_each(|(_, (((slots, ranges), positions), depth))| {
            wide!({
                for ((slot, position), d) in slots.iter_mut().zip(positions).zip(depth) {
                    *position = self.sweep.position(*d);
                    *slot = Sweep::slot(*position);
                }
                for (slots, ranges) in slots.chunks_exact(width).zip(ranges.chunks_exact_mut(runs)) {
                    let (whole, rest) = slots.as_chunks::<RUN>();
                    for (range, slots) in ranges.iter_mut().zip(whole) {
                        *range = shares::range(slots);
                    }
                    if let (Some(range), false) = (ranges.last_mut(), rest.is_empty()) {
                        *range = shares::range(rest);
                    }
                }
            });
        });
    }

    /// Finds the tiles to compute: those of the frame, or of the rectangle that holds what is `affected`, and of each
    /// the part that is affected. The largest come first, so that all threads end at about the same time.
    fn arrange(&self, affected: Option<&Changes>, order: &mut Vec<[Range<usize>; 2]>) {
        order.clear();
        let [rows, columns] = [0..self.size.height, 0..self.size.width];
        let Some(affected) = affected else {
            return order.extend(self.layout.tiles(rows, columns, 1));
        };
        let part = |rows: &Range<usize>, columns: &Range<usize>| affected.affected([rows, columns], self.reach());
        let Some([rows, columns]) = part(&rows, &columns) else {
            return;
        };
        // The rounding depends on the tiles, so they do not depend on the threads, and a whole frame has its own.
        let is_whole = [rows.len(), columns.len()] == [self.size.height, self.size.width];
        for [rows, columns] in self.layout.tiles(rows, columns, if is_whole { 1 } else { 2 }) {
            if let Some([rows, columns]) = part(&rows, &columns) {
                order.push([rows, columns.start / RUN * RUN..columns.end]);
            }
        }
        order.sort_unstable_by_key(|[rows, columns]| Reverse(rows.len() * columns.len()));
    }
}

/// Returns how far to search for hidden surfaces: as far as light spreads through the volume.
pub fn hidden_reach(display: &Display) -> usize {
    (reach_px(display, display.volume_depth_m()).ceil() as usize).max(1)
}

/// Returns whether a sweep can end at `z_m`, that is, whether short filters reach it from the front of the volume.
pub fn reaches(display: &Display, z_m: f64) -> bool {
    reach_px(display, z_m.abs() + display.volume_depth_m() / 2.0) <= MAX_HOME_REACH as f64
}

/// Returns the optics of each colour between the planes of `sweep` and from plane 0 to `z_m`.
pub fn optics(display: &Display, sweep: &Sweep, z_m: f64) -> Result<Vec<Optics>> {
    if !z_m.is_finite() {
        return Err(Error::Setting(format!(
            "sweep: the hologram cannot stand at z = {z_m} m; it must be finite"
        )));
    }
    let step_m = display.volume_depth_m() / sweep.planes as f64;
    let home_m = z_m - (display.volume_depth_m() - step_m) / 2.0;
    let reach = reach_px(display, home_m);
    // The volume itself may be wide, so a sweep that ends at the midpoint is always accepted.
    if z_m != 0.0 && !reaches(display, z_m) {
        return Err(Error::Setting(format!(
            "sweep: light spreads {reach:.0} pixels from the front of the volume to z = {:.3} mm, more than {MAX_HOME_REACH}; end at the midpoint and propagate from there",
            z_m * 1e3
        )));
    }
    let of = |&wavelength_m: &f64| Optics {
        pitch_m: display.pitch_m(),
        wavelength_m,
        step_m,
        planes: sweep.planes,
        home_m,
    };
    Ok(display.wavelengths_m().iter().map(of).collect())
}
