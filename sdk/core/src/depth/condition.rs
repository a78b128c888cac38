//! Conditioning of depth: from a sensor's readings, with holes, noise, mixed depths and a shift, to clean depth of the
//! display's resolution along the edges of the colour image. Tests compare the results with [`mod@reference`].
//!
//! The steps work on the readings, except for the last two, which work on the display's pixels at edges:
//! 1. `register`: the shift between depth and colour is found from their edges.
//! 2. `fill`: holes take the depth of the surface with their colour.
//! 3. `smooth`: noise within surfaces is removed; slopes stay.
//! 4. `edges`: readings at edges are found, and those whose depth is a mixture of two surfaces.
//! 5. `surfaces`: the 3×3 readings around a reading at an edge form surfaces. Each display pixel there takes the
//!    surface that covers its place and has its colour. All other pixels are interpolated.
//! 6. Pixels that are nearly undecided follow their neighbours of the same colour.
//!
//! Clean depth of the display's resolution is only shifted and filled.

mod axis;
mod colour;
mod edges;
mod fill;
mod pixels;
pub mod reference;
mod register;
mod smooth;
mod surfaces;

use crate::depth::{no_reading, sharpness};
use crate::frame::Crop;
use crate::runtime::error::{Error, Result};
use axis::AxisMap;
use colour::Moments;
use edges::Kind;
use fill::FillScratch;
use pixels::{Decider, Pixels};
use register::Registration;
use smooth::SmoothScratch;

/// A plan for one shape of depth and of colour. It is immutable and can be shared between threads.
#[derive(Debug, Clone)]
pub struct Conditioner {
    depth: (usize, usize),
    out: (usize, usize),
    crop: Crop,
    registers: bool,
}

/// The working memory of a [`Conditioner`] for one call at a time, and the shift found in previous calls.
pub struct ConditionScratch {
    registration: Option<Registration>,
    x: AxisMap,
    y: AxisMap,
    readings: Vec<f32>,
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
    }
}

impl Conditioner {
    /// Plans the conditioning of the part `crop` of (h, w) = `depth` readings for (H, W) = `out`. If `aligned`, the
    /// edges of depth and colour already coincide, and no shift is searched.
    ///
    /// # Errors
    /// Returns an error if a side lies outside 1..=65536.
    pub fn new(depth: (usize, usize), crop: Crop, out: (usize, usize), aligned: bool) -> Result<Self> {
        let sides = [depth.0, depth.1, out.0, out.1];
        if sides.contains(&0) || sides.iter().any(|n| *n > 1 << 16) {
            return Err(Error::Setting(format!(
                "depth of {}×{} for a frame of {}×{}: each side must lie in 1..=65536",
                depth.1, depth.0, out.1, out.0
            )));
        }
        Ok(Conditioner {
            depth,
            out,
            crop,
            registers: !aligned,
        })
    }

    /// Returns (H, W) of the conditioned depth.
    pub fn shape(&self) -> (usize, usize) {
        self.out
    }

    /// Allocates working memory for one call at a time.
    pub fn scratch(&self) -> ConditionScratch {
        let size = self.depth.0 * self.depth.1;
        ConditionScratch {
            registration: self
                .registers
                .then(|| Registration::new(self.depth, self.crop, self.out)),
            x: AxisMap::new(self.depth.1, self.out.1),
            y: AxisMap::new(self.depth.0, self.out.0),
            readings: vec![0.0; size],
            kinds: vec![Kind::Inside; size],
            bent: vec![false; size],
            colours: vec![Moments::default(); size],
            fill: FillScratch::new(size),
            smooth: SmoothScratch::new(self.depth),
            pixels: Pixels::new(size, self.out.0 * self.out.1),
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
        let (height, width) = self.out;
        assert_eq!(depth.len(), self.depth.0 * self.depth.1);
        assert_eq!(rgb.len(), 3 * height * width);
        assert_eq!(to.len(), height * width);
        let holes = depth.iter().filter(|d| d.is_nan()).count();
        if holes == depth.len() {
            return Err(no_reading());
        }
        self.place(depth, rgb, scratch);
        let axes = (&scratch.x, &scratch.y);
        scratch.readings.copy_from_slice(depth);
        if holes > 0 {
            colour::colours(rgb, axes, fill::REACH, |i| depth[i].is_nan(), &mut scratch.colours);
            fill::fill(&mut scratch.readings, self.depth.1, &scratch.colours, &mut scratch.fill);
        }
        if self.depth == self.out && sharpness::measure_planes(rgb, &scratch.readings, width).is_clean() {
            scratch.kinds.fill(Kind::Inside);
        } else {
            smooth::smooth(&mut scratch.readings, self.depth.1, &mut scratch.smooth);
            edges::find(&scratch.readings, self.depth.1, &mut scratch.bent, &mut scratch.kinds);
            let kinds = &scratch.kinds;
            colour::colours(rgb, axes, 1, |i| kinds[i] != Kind::Inside, &mut scratch.colours);
        }
        let readings = surfaces::Readings {
            depth: &scratch.readings,
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
        Ok(())
    }

    /// Finds the shift between depth and colour and places the display's pixels among the readings.
    fn place(&self, depth: &[f32], rgb: &[f32], scratch: &mut ConditionScratch) {
        let (shift_y, shift_x) = match &mut scratch.registration {
            Some(registration) => registration.shift(depth, rgb),
            None => (0.0, 0.0),
        };
        scratch.x.place(self.crop.x + shift_x, self.crop.width);
        scratch.y.place(self.crop.y + shift_y, self.crop.height);
    }
}

#[cfg(test)]
mod tests;
