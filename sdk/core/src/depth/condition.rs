//! Conditioning of depth: from a sensor's readings, with holes, noise, mixed depths and a shift, to clean depth of the
//! display's resolution along the edges of the colour image. Tests compare the results with [`mod@reference`].
//!
//! The steps work on the readings, except for the last two, which work on the display's pixels at edges:
//! 1. `register`: the shift between depth and colour is found from their edges, and whether near surfaces are too wide.
//! 2. `narrow`: near surfaces that are too wide become narrower.
//! 3. `fill`: holes take the depth of the surface with their colour.
//! 4. `smooth`: noise within surfaces is removed; slopes stay.
//! 5. `edges`: readings at edges are found, and those whose depth is a mixture of two surfaces, if the sensor mixes.
//! 6. `contradict`: readings of a few pixels near edges whose colour is that of another surface take its depth.
//! 7. `surfaces`: the 3×3 readings around a reading at an edge form surfaces. Each display pixel there takes the
//!    surface that covers its place and has its colour. All other pixels are interpolated.
//! 8. Pixels that are nearly undecided follow their neighbours of the same colour.
//! 9. `history`: in video, a pixel at an edge whose colour stays prefers the surface that it had.
//!
//! Clean depth of the display's resolution is only shifted, narrowed and filled.
//!
//! Steps 1 to 6 are [`Conditioner::find`]. The others, which work on the display's pixels, are [`Conditioner::decide`];
//! a GPU runs them from the [`ConditionedReadings`].

mod axis;
mod colour;
mod contradict;
mod edges;
mod fill;
mod history;
mod lanes;
mod narrow;
mod pixels;
mod readings;
pub mod reference;
mod register;
mod smooth;
mod surfaces;

use crate::Size;
use crate::depth::{no_reading, sharpness};
use crate::frame::Crop;
use crate::runtime::error::{Error, Result};
use crate::runtime::stage::stage;
use axis::AxisMap;
use colour::Moments;
use edges::Kind;
use fill::FillScratch;
use pixels::{Decider, Pixels};
pub use readings::{ConditionedReadings, constants};
pub use register::Misfit;
use register::Registration;
use smooth::SmoothScratch;

/// A plan for one shape of depth and of colour. It is immutable and can be shared between threads.
#[derive(Debug, Clone)]
pub struct Conditioner {
    depth: Size,
    out: Size,
    crop: Crop,
    registers: bool,
}

/// The working memory of a [`Conditioner`] for one call at a time, and what it remembers of previous calls: the shift
/// and the surfaces of pixels at edges.
pub struct ConditionScratch {
    registration: Option<Registration>,
    x: AxisMap,
    y: AxisMap,
    readings: Vec<f32>,
    /// The readings before a step that needs all of them.
    before: Vec<f32>,
    /// Whether each reading was a hole or contradicted.
    filled: Vec<bool>,
    /// Whether readings of the previous frame mixed surfaces.
    mixed: Option<bool>,
    /// The number of frames since the last reset.
    frames: usize,
    kinds: Vec<Kind>,
    bent: Vec<bool>,
    colours: Vec<Moments>,
    fill: FillScratch,
    smooth: SmoothScratch,
    pixels: Pixels,
}

impl ConditionScratch {
    /// Forgets previous calls.
    pub fn reset(&mut self) {
        self.registration.iter_mut().for_each(Registration::reset);
        self.pixels.reset();
        self.mixed = None;
        self.frames = 0;
    }
}

impl Conditioner {
    /// Plans the conditioning of the part `crop` of `depth` readings for the size `out`. If `aligned`, the
    /// edges of depth and colour already coincide, and no shift is searched.
    ///
    /// # Errors
    /// Returns an error if a side lies outside 1..=65536.
    pub fn new(depth: Size, crop: Crop, out: Size, aligned: bool) -> Result<Self> {
        let sides = [depth.height, depth.width, out.height, out.width];
        if sides.contains(&0) || sides.iter().any(|n| *n > 1 << 16) {
            return Err(Error::Setting(format!(
                "depth of {}×{} for a frame of {}×{}: each side must lie in 1..=65536",
                depth.width, depth.height, out.width, out.height
            )));
        }
        Ok(Conditioner {
            depth,
            out,
            crop,
            registers: !aligned,
        })
    }

    /// Returns the size of the conditioned depth.
    pub fn size(&self) -> Size {
        self.out
    }

    /// Allocates working memory for one call at a time.
    pub fn scratch(&self) -> ConditionScratch {
        let size = self.depth.height * self.depth.width;
        ConditionScratch {
            registration: self
                .registers
                .then(|| Registration::new(self.depth, self.crop, self.out)),
            x: AxisMap::new(self.depth.width, self.out.width),
            y: AxisMap::new(self.depth.height, self.out.height),
            readings: vec![0.0; size],
            before: vec![0.0; size],
            filled: vec![false; size],
            mixed: None,
            frames: 0,
            kinds: vec![Kind::Inside; size],
            bent: vec![false; size],
            colours: vec![Moments::default(); size],
            fill: FillScratch::new(size),
            smooth: SmoothScratch::new(self.depth),
            pixels: Pixels::new(self.depth.height, self.out),
        }
    }

    /// Conditions `depth` along the edges of `rgb`, (3, H, W), and writes it to `to`, (H, W).
    ///
    /// `depth`, (h, w), is normalized, with NaN for no reading. The result stays within 0..=1. Runs on the current
    /// thread pool. Does not allocate.
    ///
    /// # Errors
    /// Returns an error if there is no reading.
    ///
    /// # Panics
    /// Panics if a length does not match its shape.
    pub fn condition(&self, depth: &[f32], rgb: &[f32], to: &mut [f32], scratch: &mut ConditionScratch) -> Result<()> {
        self.find(depth, rgb, scratch)?;
        self.decide(rgb, to, scratch);
        Ok(())
    }

    /// Runs the steps on the readings, the first part of [`Self::condition`]. [`Self::decide`] runs the others, or
    /// another processor does, from [`Self::readings`].
    ///
    /// # Errors
    /// Returns an error if there is no reading.
    ///
    /// # Panics
    /// Panics if a length does not match its shape.
    pub fn find(&self, depth: &[f32], rgb: &[f32], scratch: &mut ConditionScratch) -> Result<()> {
        assert_eq!(depth.len(), self.depth.height * self.depth.width);
        assert_eq!(rgb.len(), 3 * self.out.height * self.out.width);
        if depth.iter().all(|d| d.is_nan()) {
            return Err(no_reading());
        }
        let growth = self.place(depth, rgb, scratch);
        self.fill(depth, rgb, growth, scratch);
        let clean = self.depth == self.out && sharpness::is_clean(rgb, &scratch.readings, self.depth.width);
        if clean {
            scratch.kinds.fill(Kind::Inside);
        } else {
            self.find_edges(rgb, scratch);
        }
        scratch.frames += 1;
        Ok(())
    }

    /// Returns what [`Self::find`] found.
    pub fn readings<'a>(&self, scratch: &'a ConditionScratch) -> ConditionedReadings<'a> {
        ConditionedReadings {
            depth: &scratch.readings,
            kinds: &scratch.kinds,
            x: &scratch.x,
            y: &scratch.y,
            are_coarse: self.are_coarse(),
            has_past: scratch.frames > 1,
        }
    }

    /// Returns whether readings have several pixels.
    fn are_coarse(&self) -> bool {
        contradict::pixels(self.crop, self.out) > 1.0
    }

    /// Decides the depth of each pixel of `rgb`, (3, H, W), from what [`Self::find`] found, and writes it to `to`,
    /// (H, W).
    ///
    /// # Panics
    /// Panics if a length does not match its shape.
    pub fn decide(&self, rgb: &[f32], to: &mut [f32], scratch: &mut ConditionScratch) {
        assert_eq!(rgb.len(), 3 * self.out.height * self.out.width);
        assert_eq!(to.len(), self.out.height * self.out.width);
        let _stage = stage!("surfaces");
        let axes = (&scratch.x, &scratch.y);
        let edges = (&scratch.kinds[..], Kind::is_at_edge);
        colour::colours(rgb, axes, 1, edges, &mut scratch.colours);
        let readings = surfaces::Readings {
            depth: &scratch.readings,
            width: self.depth.width,
            are_coarse: self.are_coarse(),
            kinds: &scratch.kinds,
            colours: &scratch.colours,
        };
        let decider = Decider {
            readings: &readings,
            x: &scratch.x,
            y: &scratch.y,
            rgb,
        };
        scratch.pixels.decide(decider, to);
    }

    /// Finds the shift between depth and colour, places the display's pixels among the readings, and returns the number
    /// of readings by which near surfaces are too wide.
    fn place(&self, depth: &[f32], rgb: &[f32], scratch: &mut ConditionScratch) -> usize {
        let _stage = stage!("register");
        let registration = scratch.registration.as_mut();
        let Misfit { shift: (y, x), growth } = registration.map_or(Misfit::default(), |r| r.misfit(depth, rgb));
        scratch.x.place(self.crop.x + x, self.crop.width);
        scratch.y.place(self.crop.y + y, self.crop.height);
        growth
    }

    /// Narrows near surfaces by `growth` readings and fills holes.
    fn fill(&self, depth: &[f32], rgb: &[f32], growth: usize, scratch: &mut ConditionScratch) {
        let width = self.depth.width;
        let stage = stage!("narrow");
        narrow::narrow(depth, width, growth, &mut scratch.readings);
        stage.end();
        let _stage = stage!("fill");
        if scratch.readings.iter().all(|reading| reading.is_nan()) {
            scratch.readings.copy_from_slice(depth);
        }
        for (filled, reading) in scratch.filled.iter_mut().zip(&scratch.readings) {
            *filled = reading.is_nan();
        }
        if scratch.filled.contains(&true) {
            let (axes, filled) = ((&scratch.x, &scratch.y), &scratch.filled);
            colour::colours(rgb, axes, fill::REACH, (filled, |filled| *filled), &mut scratch.colours);
            fill::fill(&mut scratch.readings, width, &scratch.colours, &mut scratch.fill);
        }
    }

    /// Smooths the readings, finds their kinds, and replaces contradicted readings.
    fn find_edges(&self, rgb: &[f32], scratch: &mut ConditionScratch) {
        let (axes, width) = ((&scratch.x, &scratch.y), self.depth.width);
        let stage = stage!("smooth");
        smooth::smooth(&mut scratch.readings, width, &mut scratch.smooth);
        stage.end();
        let _stage = stage!("edges");
        let mixes = edges::mixes(&scratch.readings, width, scratch.mixed);
        scratch.mixed = Some(mixes);
        edges::find(&scratch.readings, width, mixes, &mut scratch.bent, &mut scratch.kinds);
        if contradict::applies(self.crop, self.out) {
            let kinds = &scratch.kinds;
            let edges = (&kinds[..], Kind::is_at_edge);
            colour::colours(rgb, axes, 2 * fill::REACH, edges, &mut scratch.colours);
            scratch.before.copy_from_slice(&scratch.readings);
            let known = (&scratch.kinds[..], &scratch.colours[..]);
            contradict::replace(
                &scratch.before,
                width,
                known,
                &mut scratch.readings,
                &mut scratch.filled,
            );
            edges::find(&scratch.readings, width, mixes, &mut scratch.bent, &mut scratch.kinds);
        }
        for (kind, filled) in scratch.kinds.iter_mut().zip(&scratch.filled) {
            if *filled && *kind == Kind::Edge {
                *kind = Kind::Filled;
            }
        }
    }
}

#[cfg(test)]
mod tests;
