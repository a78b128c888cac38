//! Processing of the depth of a sequence of camera frames for a display: readings, alignment, temporal smoothing, range
//! and conditioning, in this order.

use super::align::Cameras;
use super::camera::{Alignment, CameraFrame};
use super::condition::{ConditionScratch, ConditionedReadings, Conditioner};
use super::enlarged::{self, Enlarged};
use super::image::{DepthFormat, DepthImage};
use super::range::{DepthRange, RangeTracker};
use super::smoothing::Smoother;
use crate::Size;
use crate::frame::{Crop, Orientation, Past, Plane};
use crate::runtime::error::{Error, Result};
use ndarray::{Array2, ArrayView2};
use std::time::Duration;

/// The depth settings of a session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthOptions {
    /// The range of metres between the ends of the volume.
    pub range: DepthRange,
    /// The least confidence of a reading, in 0..=1. Less confident readings are ignored. ARKit's levels are 0 ("low"),
    /// ½ ("medium") and 1 ("high").
    pub least_confidence: f32,
}

impl Default for DepthOptions {
    /// Returns percentiles, without readings of low confidence.
    fn default() -> Self {
        DepthOptions {
            range: DepthRange::Percentiles,
            least_confidence: 0.25,
        }
    }
}

impl DepthOptions {
    /// Checks the settings.
    ///
    /// # Errors
    /// Returns an error if the range is invalid or the confidence lies outside 0..=1.
    pub fn check(&self) -> Result<()> {
        if !(0.0..=1.0).contains(&self.least_confidence) {
            return Err(Error::Setting(format!(
                "a least confidence of {} means nothing; it must lie in 0..=1",
                self.least_confidence
            )));
        }
        self.range.check()
    }
}

/// The result of a frame's depth processing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthReport {
    /// The distances at the near and the far end of the volume, in metres, or `None` for normalized or relative depth.
    pub range_m: Option<(f32, f32)>,
    /// The share of the sensor's pixels with a usable reading.
    pub valid: f32,
    /// How the depth was enlarged to the colour's size, if it was. Its own readings were conditioned.
    pub enlarged: Option<Enlarged>,
}

/// The inputs that determine the plans and the memory of a [`DepthStream`].
#[derive(Debug, Clone, Copy, PartialEq)]
struct Layout {
    format: DepthFormat,
    sensor: Size,
    orientation: Orientation,
    colour: Size,
    cameras: Option<Cameras>,
}

struct Plan {
    layout: Layout,
    conditioner: Conditioner,
    scratch: ConditionScratch,
    values: Vec<f32>,
    confidence: Vec<f32>,
    /// Buffers for `values` and `confidence` while they are aligned or turned.
    moved: (Vec<f32>, Vec<f32>),
    /// How the depth was enlarged to the colour's size. The conditioner then takes the readings that it came from.
    enlarged: Option<Enlarged>,
    /// The number of frames until depth of the colour's size is examined for that.
    examined_in: u32,
}

/// The number of frames after which depth that was not enlarged is examined again: the first may show too few edges.
const EXAMINED_EVERY: u32 = 64;

/// Processes the depth of a sequence of frames for one display shape.
pub struct DepthStream {
    options: DepthOptions,
    out: Size,
    range: RangeTracker,
    /// The range of relative depth, which has no metres.
    relative_range: RangeTracker,
    smoother: Smoother,
    plan: Option<Plan>,
}

impl DepthStream {
    /// Creates a stream with depth of the size `out`.
    ///
    /// # Errors
    /// Returns an error if [`DepthOptions::check`] does.
    pub fn new(options: DepthOptions, out: Size) -> Result<Self> {
        options.check()?;
        Ok(DepthStream {
            options,
            out,
            range: RangeTracker::new(options.range),
            relative_range: RangeTracker::new(DepthRange::Percentiles),
            smoother: Smoother::default(),
            plan: None,
        })
    }

    /// Clears the history.
    pub fn reset(&mut self) {
        self.range.reset();
        self.relative_range.reset();
        self.smoother.reset();
        // A frame without a past depends on no frame before it.
        if self.plan.as_ref().is_some_and(|plan| plan.enlarged.is_some()) {
            self.plan = None;
        }
        if let Some(plan) = &mut self.plan {
            plan.scratch.reset();
            plan.examined_in = 0;
        }
    }

    /// Computes the normalized depth of `frame` along the edges of `rgb` and writes it to `depth`, (H, W) in \[0, 1]:
    /// [`Self::read`] and [`Self::decide`].
    ///
    /// # Errors
    /// Returns an error in the cases of [`Self::read`].
    ///
    /// # Panics
    /// Panics if `rgb` does not have 3·H·W values or `depth` does not have H·W.
    pub fn next(
        &mut self,
        frame: &CameraFrame<'_>,
        past: Option<Past>,
        rgb: &[f32],
        depth: &mut [f32],
    ) -> Result<DepthReport> {
        let report = self.read(frame, past, rgb)?;
        self.decide(rgb, depth);
        Ok(report)
    }

    /// Decides the depth of each pixel of the frame that was read last, along the edges of its `rgb`, and writes it to
    /// `depth`, (H, W) in \[0, 1].
    ///
    /// # Panics
    /// Panics if no frame was read, if `rgb` does not have 3·H·W values or `depth` does not have H·W.
    pub fn decide(&mut self, rgb: &[f32], depth: &mut [f32]) {
        let plan = self.plan.as_mut().expect("a frame was read");
        plan.conditioner.decide(rgb, depth, &mut plan.scratch);
    }

    /// Returns the conditioned readings of the frame that was read last, from which a GPU decides the pixels instead of
    /// [`Self::decide`].
    ///
    /// # Panics
    /// Panics if no frame was read.
    pub fn readings(&self) -> ConditionedReadings<'_> {
        let plan = self.plan.as_ref().expect("a frame was read");
        plan.conditioner.readings(&plan.scratch)
    }

    /// Reads the depth of `frame` and conditions its readings along the edges of `rgb`.
    ///
    /// `rgb`, (3, H, W), is the part [`Crop::cover`] of the frame's colour. Without a `past` there is no previous
    /// frame to smooth with. Later frames of the same layout do not allocate, unless depth of the colour's size is
    /// [`Enlarged`] or examined for that.
    ///
    /// # Errors
    /// Returns an error if the frame has no depth or no usable reading.
    ///
    /// # Panics
    /// Panics if `rgb` does not have 3·H·W values.
    pub fn read(&mut self, frame: &CameraFrame<'_>, past: Option<Past>, rgb: &[f32]) -> Result<DepthReport> {
        let Some(image) = &frame.depth else {
            return Err(Error::Frame(
                "it has no depth; give it depth, or the session a depth network".into(),
            ));
        };
        let layout = Layout {
            format: image.format(),
            sensor: image.size(),
            orientation: frame.orientation,
            colour: frame.colour.size(),
            cameras: match frame.alignment {
                Alignment::Aligned => None,
                Alignment::Cameras(cameras) => Some(cameras),
            },
        };
        self.process(image, layout, past, rgb)
    }

    /// Reads `estimate`, (h, w), the relative inverse depth that a network estimated for `rgb`, as [`Self::read`] reads
    /// a frame's depth.
    ///
    /// # Errors
    /// Returns an error if the estimate has no finite value.
    ///
    /// # Panics
    /// Panics in the cases of [`Self::read`].
    pub fn read_estimate(&mut self, estimate: &Array2<f32>, past: Option<Past>, rgb: &[f32]) -> Result<DepthReport> {
        let (height, width) = estimate.dim();
        let bytes: Vec<u8> = estimate.iter().flat_map(|v| v.to_le_bytes()).collect();
        let image = DepthImage::new(
            DepthFormat::RelativeF32,
            Size { width, height },
            Plane::new(&bytes, 4 * width, 4),
        )?;
        let layout = Layout {
            format: image.format(),
            sensor: image.size(),
            orientation: Orientation::default(),
            colour: self.out,
            cameras: None,
        };
        self.process(&image, layout, past, rgb)
    }

    fn process(
        &mut self,
        image: &DepthImage<'_>,
        layout: Layout,
        past: Option<Past>,
        rgb: &[f32],
    ) -> Result<DepthReport> {
        if past.is_none()
            || self
                .plan
                .as_ref()
                .is_some_and(|plan| plan.layout.format != layout.format)
        {
            self.reset();
        }
        if self.plan.as_ref().is_none_or(|plan| plan.layout != layout) {
            self.plan = Some(Plan::new(layout, self.out)?);
        }
        let plan = self.plan.as_mut().expect("made above");
        let found = plan.readings(image, self.options.least_confidence);
        if found == 0 {
            return Err(Error::Frame(format!(
                "depth has no usable reading in {}×{} pixels; at least one must be valid and of confidence {} or more",
                layout.sensor.width, layout.sensor.height, self.options.least_confidence
            )));
        }
        plan.shrink(self.out)?;
        let elapsed = past.map_or(Duration::ZERO, |past| past.elapsed);
        let width = plan.grid().width;
        let metric = layout.format.is_metric();
        if metric {
            self.smoother.smooth(&mut plan.values, width, elapsed, true);
        }
        let range = if metric {
            Some(self.range.next(&plan.values, elapsed)?)
        } else if layout.format.is_relative() {
            Some(self.relative_range.next(&plan.values, elapsed)?)
        } else {
            None
        };
        if let Some((near, far)) = range {
            // If all distances are equal, there is no extent to scale, so d = ½ puts the surface in the middle of the
            // volume.
            let (scale, shift) = match near < far {
                true => (1.0 / (far - near), -near / (far - near)),
                false => (0.0, 0.5),
            };
            for value in &mut plan.values {
                *value = (*value * scale + shift).clamp(0.0, 1.0);
            }
        }
        if !metric {
            self.smoother.smooth(&mut plan.values, width, elapsed, false);
        }
        plan.conditioner.find(&plan.values, rgb, &mut plan.scratch)?;
        Ok(DepthReport {
            range_m: range.filter(|_| metric),
            valid: found as f32 / layout.sensor.pixels() as f32,
            enlarged: plan.enlarged,
        })
    }
}

impl Layout {
    /// Plans the conditioning of `readings` of the sensor's field of view, upright.
    fn conditioner(&self, readings: Size, out: Size) -> Result<Conditioner> {
        let colour = self.orientation.upright_size(self.colour);
        let crop = Crop::cover(colour, out).scaled(
            readings.width as f64 / colour.width as f64,
            readings.height as f64 / colour.height as f64,
        );
        Conditioner::new(readings, crop, out, self.cameras.is_some())
    }
}

impl Plan {
    fn new(layout: Layout, out: Size) -> Result<Self> {
        let conditioner = layout.conditioner(layout.orientation.upright_size(layout.sensor), out)?;
        let scratch = conditioner.scratch();
        let plane = || vec![f32::NAN; layout.sensor.pixels()];
        Ok(Plan {
            layout,
            conditioner,
            scratch,
            values: plane(),
            confidence: plane(),
            moved: (plane(), plane()),
            enlarged: None,
            examined_in: 0,
        })
    }

    fn upright(&self) -> Size {
        self.layout.orientation.upright_size(self.layout.sensor)
    }

    /// Returns the size of the readings that are conditioned, upright.
    fn grid(&self) -> Size {
        self.enlarged.map_or(self.upright(), |enlarged| enlarged.grid)
    }

    /// Replaces `values` that were enlarged to the colour's size by the readings that they came from, and tells the log
    /// when it finds that.
    fn shrink(&mut self, out: Size) -> Result<()> {
        let layout = self.layout;
        if layout.sensor != layout.colour || layout.cameras.is_some() {
            return Ok(());
        }
        let depth = ArrayView2::from_shape(self.upright().shape(), &self.values).expect("upright values");
        if self.enlarged.is_none() {
            let is_due = self.examined_in == 0;
            self.examined_in = self.examined_in.checked_sub(1).unwrap_or(EXAMINED_EVERY - 1);
            self.enlarged = if is_due { enlarged::find(depth) } else { None };
            if let Some(found) = self.enlarged {
                log::warn!("the depth of frames was {found}; it is conditioned as depth of that size");
                self.conditioner = layout.conditioner(found.grid, out)?;
                self.scratch = self.conditioner.scratch();
            }
        }
        if let Some(found) = self.enlarged {
            let readings = found.readings(depth);
            self.values.clear();
            self.values.extend(readings.iter());
        }
        Ok(())
    }

    /// Reads `image`, aligned with the colour and upright, into `values` and `confidence`, and returns the number of
    /// readings.
    fn readings(&mut self, image: &DepthImage<'_>, least: f32) -> usize {
        self.values.resize(self.layout.sensor.pixels(), f32::NAN);
        let mut found = image.readings(least, &mut self.values, &mut self.confidence);
        if let Some(cameras) = self.layout.cameras {
            found = cameras.reproject(
                self.layout.sensor,
                self.layout.colour,
                (&self.values, &self.confidence),
                (&mut self.moved.0, &mut self.moved.1),
            );
            self.take_moved();
        }
        if self.layout.orientation != Orientation::default() {
            let Size { width, .. } = self.upright();
            for i in 0..self.values.len() {
                let sensor = self.layout.sensor;
                let (x, y) = self.layout.orientation.sensor_pixel(i % width, i / width, sensor);
                self.moved.0[i] = self.values[y * sensor.width + x];
                self.moved.1[i] = self.confidence[y * sensor.width + x];
            }
            self.take_moved();
        }
        found
    }

    fn take_moved(&mut self) {
        std::mem::swap(&mut self.values, &mut self.moved.0);
        std::mem::swap(&mut self.confidence, &mut self.moved.1);
    }
}
