//! Runs one RGB-D frame through all stages: midpoint hologram, propagation, phase encoding, levels. Each stage is
//! timed. A session processes sequences of frames.

pub mod display_plan;
pub mod field;
mod shown;

use crate::Size;
use crate::display::levels::LevelsMut;
use crate::display::target::Target;
use crate::encode::{EncoderOptions, Encoding};
use crate::frame::{Past, RgbdFrame};
use crate::method::mean_phase::MeanPhase;
use crate::method::{Method, MethodPlan, MethodScratch};
use crate::pipeline::display_plan::{DisplayPlan, DisplayScratch, Modulation};
use crate::runtime::cancel::Cancel;
use crate::runtime::error::{Error, Result};
use crate::runtime::stage::stage;
use num_complex::Complex32;
use std::fmt::{Debug, Formatter};
use std::time::Duration;

/// A plan for one frame shape, method and target. It is immutable and can be shared between threads.
pub struct Pipeline {
    method: MethodPlan,
    display: DisplayPlan,
}

/// The working memory of a [`Pipeline`] for one frame at a time.
pub struct PipelineScratch {
    method: MethodScratch,
    display: DisplayScratch,
    /// The field that [`Pipeline::process`] works in. Empty before its first call.
    field: Vec<Complex32>,
}

/// The time that each stage of a frame took.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FrameTimes {
    /// Rotating, converting and resizing the colour image. On a GPU this includes depth of the frame's size.
    pub colour: Duration,
    /// Reading, aligning, temporally smoothing and conditioning the depth.
    pub depth: Duration,
    /// Computing the midpoint hologram from the frame. On a GPU this includes both transfers.
    pub method: Duration,
    /// Propagating from the midpoint to the modulator.
    pub propagate: Duration,
    /// Encoding the field into levels.
    pub encode: Duration,
}

impl FrameTimes {
    /// Returns the total time of all stages.
    pub fn total(&self) -> Duration {
        self.stages().into_iter().map(|(_, time)| time).sum()
    }

    /// Returns the name and time of each stage in processing order.
    pub fn stages(&self) -> [(&'static str, Duration); 5] {
        [
            ("colour", self.colour),
            ("depth", self.depth),
            ("method", self.method),
            ("propagate", self.propagate),
            ("encode", self.encode),
        ]
    }
}

/// The result of processing a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameReport {
    /// The amplitude that maps to full light.
    pub scale: f32,
    /// The time of each stage.
    pub times: FrameTimes,
}

impl PipelineScratch {
    /// Returns whether the plane sweep alone made the last frame, without a network.
    #[doc(hidden)]
    pub fn is_swept(&self) -> bool {
        self.method.is_swept()
    }

    /// Makes the computation stop early once `cancel` is requested.
    #[doc(hidden)]
    pub fn set_cancel(&mut self, cancel: &Cancel) {
        self.method.set_cancel(cancel);
        self.display.set_cancel(cancel);
    }
}

impl Pipeline {
    /// Plans `method` for frames of `size` and for `target`. If the method is a network that gives the modulator's
    /// phase, the phase is shown as it is, whatever the encoding in `options`.
    ///
    /// # Errors
    /// Returns an error if [`Method`] or the propagation to the target cannot be planned: the network is for another
    /// display, an offset or correction moves light farther than can be padded, or a parameter is out of its range.
    pub fn new(size: Size, method: Method, target: &Target, options: &EncoderOptions) -> Result<Self> {
        let method = MethodPlan::new(size, method, &target.display)?;
        let as_it_is;
        let options = if method.gives_phase() {
            if options.midpoint_steps + options.focus_steps > 0 {
                return Err(Error::Setting(
                    "the network gives the modulator's phase, which is shown as it is; 0 steps of midpoint and focus are right".into(),
                ));
            }
            as_it_is = EncoderOptions {
                brightness: options.brightness,
                ..Encoding::Phase.into()
            };
            &as_it_is
        } else {
            options
        };
        // The display plan covers the remaining distance to the modulator.
        let display = DisplayPlan::for_frames(size, method.z_m(), target, options)?;
        Ok(Pipeline { method, display })
    }

    /// Returns C, the number of colours in frames, fields and levels. It equals the number of the display's lasers.
    pub fn colours(&self) -> usize {
        self.display.colours()
    }

    /// Returns the size of a frame.
    pub fn size(&self) -> Size {
        self.method.size()
    }

    /// Returns the plan of the method.
    #[doc(hidden)]
    pub fn method(&self) -> &MethodPlan {
        &self.method
    }

    /// Returns working memory for one frame at a time.
    pub fn scratch(&self) -> PipelineScratch {
        PipelineScratch {
            method: self.method.scratch(),
            display: self.display.scratch(),
            field: Vec::new(),
        }
    }

    /// Lets what stands still in a video keep its wave and its levels, from [`Self::process_after`] to the next. This
    /// takes memory for another frame and another hologram. Seeded networks and those on tract keep nothing.
    #[doc(hidden)]
    pub fn keep_standing(&self, scratch: &mut PipelineScratch) {
        self.method.keep_standing(&mut scratch.method);
        self.display.keep_standing(&mut scratch.display);
    }

    /// Writes the field at the modulator into `field`, (C, H, W), and returns the times of the method and of the
    /// propagation. The mean phase is removed unless the encoding was trained with it.
    ///
    /// # Errors
    /// Returns an error if the frame has another shape.
    #[doc(hidden)]
    pub fn field(
        &self,
        frame: &RgbdFrame,
        field: &mut [Complex32],
        scratch: &mut PipelineScratch,
    ) -> Result<(Duration, Duration)> {
        self.method.choose(None, frame, &mut scratch.method)?;
        self.field_as_chosen(None, frame, field, scratch)
    }

    /// Works like [`Self::field`] for a frame that follows another if there is a `past`, after its method is chosen.
    fn field_as_chosen(
        &self,
        past: Option<Past>,
        frame: &RgbdFrame,
        field: &mut [Complex32],
        scratch: &mut PipelineScratch,
    ) -> Result<(Duration, Duration)> {
        let stage = stage!("method");
        let mean_phase = match self.display.keeps_phase() {
            true => MeanPhase::Kept,
            false => MeanPhase::Removed,
        };
        (self.method).field_as_chosen(past, frame, mean_phase, field, &mut scratch.method)?;
        self.display.aim(frame, &mut scratch.display);
        let method = stage.end();
        let stage = stage!("propagate");
        self.display.propagate(field, &mut scratch.display);
        Ok((method, stage.end()))
    }

    /// Encodes a field at the modulator, (C, H, W), into `levels`, like [`DisplayPlan::modulate`].
    ///
    /// # Panics
    /// Panics if `field` or `levels` does not have C·H·W values.
    #[doc(hidden)]
    pub fn modulate(
        &self,
        past: Option<Past>,
        field: &mut [Complex32],
        levels: LevelsMut<'_>,
        scratch: &mut PipelineScratch,
    ) -> Modulation {
        self.display.modulate(past, field, levels, &mut scratch.display)
    }

    /// Writes the levels of `frame` into `levels`, (C, H, W). The first call with a scratch allocates its field; later
    /// calls allocate nothing.
    ///
    /// # Errors
    /// Returns an error if the frame has another shape.
    ///
    /// # Panics
    /// Panics if `levels` does not have C·H·W values.
    pub fn process(&self, frame: &RgbdFrame, levels: &mut [u8], scratch: &mut PipelineScratch) -> Result<FrameReport> {
        self.process_after(None, frame, LevelsMut::Bytes(levels), scratch)
    }

    /// Works like [`Self::process`] for a frame that follows another if there is a `past`, and for words too.
    #[doc(hidden)]
    pub fn process_after(
        &self,
        past: Option<Past>,
        frame: &RgbdFrame,
        levels: LevelsMut<'_>,
        scratch: &mut PipelineScratch,
    ) -> Result<FrameReport> {
        self.method.choose(past, frame, &mut scratch.method)?;
        let levels = match levels {
            LevelsMut::Bytes(levels) if scratch.method.makes_waves() && self.display.takes_waves() => {
                let stage = stage!("method");
                let wave = (self.method).wave_as_chosen(past, frame, MeanPhase::Removed, &mut scratch.method)?;
                let method = stage.end();
                // The wave is at the modulator, but whoever listens to stages hears all of them.
                let propagate = stage!("propagate").end();
                let modulation = (self.display).modulate_wave(past, wave, levels, &mut scratch.display);
                return Ok(report(method, propagate, modulation));
            }
            levels => levels,
        };
        let mut field = std::mem::take(&mut scratch.field);
        let Size { width, height } = self.size();
        field.resize(self.colours() * height * width, Complex32::ZERO);
        let made = self.field_as_chosen(past, frame, &mut field, scratch);
        let report = made.map(|(method, propagate)| {
            let modulation = (self.display).modulate(past, &mut field, levels, &mut scratch.display);
            report(method, propagate, modulation)
        });
        scratch.field = field;
        report
    }

    /// Updates the state in `scratch` as [`Self::process_after`] does, without making the hologram of `frame`.
    ///
    /// # Errors
    /// Returns an error if the frame has another shape.
    #[doc(hidden)]
    pub fn skip(&self, past: Option<Past>, frame: &RgbdFrame, scratch: &mut PipelineScratch) -> Result<()> {
        self.method.choose(past, frame, &mut scratch.method)
    }

    /// Returns the levels of `frame`, (C, H, W), in new memory. For many frames, [`Self::process`] is faster.
    ///
    /// # Errors
    /// Returns an error if the frame has another shape.
    pub fn levels(&self, frame: &RgbdFrame) -> Result<Vec<u8>> {
        let Size { width, height } = self.size();
        let mut levels = vec![0; self.colours() * height * width];
        self.process(frame, &mut levels, &mut self.scratch())?;
        Ok(levels)
    }
}

fn report(method: Duration, propagate: Duration, modulation: Modulation) -> FrameReport {
    FrameReport {
        scale: modulation.scale,
        times: FrameTimes {
            method,
            propagate,
            encode: modulation.encode,
            ..FrameTimes::default()
        },
    }
}

impl Debug for Pipeline {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let mut all = f.debug_struct("Pipeline");
        all.field("shape", &self.size()).field("colours", &self.colours());
        all.finish_non_exhaustive()
    }
}

impl Debug for PipelineScratch {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PipelineScratch").finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::display::Display;
    use crate::display::illumination::Illumination;
    use crate::encode::Encoding;
    use crate::encode::brightness::Brightness;
    use crate::frame::tests::scene;
    use crate::method::network::Network;
    use crate::method::sweep::Sweep;
    use ndarray::Array3;
    use std::sync::Arc;

    fn network(bytes: &[u8]) -> Arc<Network> {
        Arc::new(Network::from_onnx(bytes).unwrap())
    }

    /// Noise in colour alone.
    const NOISE: [f32; 2] = [0.002, 0.0];
    const PAST: Past = Past {
        scale: 0.9,
        elapsed: Duration::from_millis(33),
    };

    /// Checks the way from the 16-bit wave to levels against the one by a field in memory.
    #[test]
    fn levels_of_a_wave_are_those_of_its_field() {
        let size = Size { width: 83, height: 61 };
        let display = Display::default().with_size(size).unwrap();
        let mut lit = Target::from(display.clone());
        let beam = Array3::from_shape_fn((3, 2, 3), |(c, y, x)| 1.0 - 0.1 * (c + y + x) as f32);
        lit.illumination = Some(Illumination::new(beam.view()).unwrap());
        let frame = scene(size, 40, NOISE, 1);
        for target in [&Target::from(display.clone()), &lit] {
            for (encoding, local_steps) in [
                (Encoding::DoublePhase, 0),
                (Encoding::DoublePhase, 2),
                (Encoding::ANTI_ALIAS, 0),
                (Encoding::ANTI_ALIAS, 1),
                (Encoding::BAND_LIMIT, 1),
            ] {
                for brightness in [Brightness::Smoothed, Brightness::Fixed(0.8), Brightness::FrameMax] {
                    let takes_waves = !matches!(encoding, Encoding::BandLimit { .. });
                    let options = EncoderOptions {
                        encoding: encoding.clone(),
                        local_steps,
                        brightness,
                        ..EncoderOptions::default()
                    };
                    let method = Method::Sweep(Sweep::for_display(&display));
                    let pipeline = Pipeline::new(size, method, target, &options).unwrap();
                    assert_eq!(pipeline.display.takes_waves(), takes_waves);
                    for past in [None, Some(PAST)] {
                        let mut scratch = pipeline.scratch();
                        let mut field = vec![Complex32::ZERO; 3 * size.pixels()];
                        pipeline.field(&frame, &mut field, &mut scratch).unwrap();
                        let mut expected = vec![0; field.len()];
                        let of_field =
                            pipeline.modulate(past, &mut field, LevelsMut::Bytes(&mut expected), &mut scratch);
                        let mut levels = vec![0; field.len()];
                        let report = pipeline
                            .process_after(past, &frame, LevelsMut::Bytes(&mut levels), &mut scratch)
                            .unwrap();
                        assert_eq!(report.scale, of_field.scale);
                        assert!(levels == expected, "{encoding:?} {local_steps} {brightness:?}");
                    }
                }
            }
        }
    }

    /// Checks kept levels against those that are made anew of the same wave.
    #[test]
    fn levels_that_stand_are_those_of_the_whole_wave() {
        for size in [Size { width: 83, height: 461 }, Size { width: 461, height: 83 }] {
            let display = Display::from_toml("volume_depth_mm = 1.5").unwrap();
            let display = display.with_size(size).unwrap();
            let sweep = Method::Sweep(Sweep::of_planes(&display, 9));
            let trained = Method::Network(network(include_bytes!("../../../models/natural-8-int8.onnx")));
            let beam = Array3::from_shape_fn((3, 2, 3), |(c, y, x)| 1.0 - 0.1 * (c + y + x) as f32);
            let even = Target::from(display.clone());
            let lit = Target {
                illumination: Some(Illumination::new(beam.view()).unwrap()),
                ..even.clone()
            };
            for (method, target, brightness) in [
                (&sweep, &even, Brightness::Smoothed),
                (&sweep, &even, Brightness::FrameMax),
                (&sweep, &lit, Brightness::Fixed(0.8)),
                (&trained, &even, Brightness::Fixed(0.8)),
            ] {
                check_levels_that_stand(size, method.clone(), target, brightness);
            }
        }
    }

    fn check_levels_that_stand(size: Size, method: Method, target: &Target, brightness: Brightness) {
        let options = EncoderOptions {
            brightness,
            ..EncoderOptions::default()
        };
        let pipeline = Pipeline::new(size, method, target, &options).unwrap();
        let (mut kept, mut anew) = (pipeline.scratch(), pipeline.scratch());
        pipeline.keep_standing(&mut kept);
        pipeline.method.keep_standing(&mut anew.method);
        let cancel = Cancel::default();
        let mut past = None;
        let (mut before, mut stood) = (Vec::new(), 0);
        for i in 0..16_u32 {
            let frame = scene(size, if i < 8 { 20 } else { 20 + 4 * (i as usize - 8) }, NOISE, i);
            // Other ways to make a frame come between: without levels, and given up.
            if i == 5 {
                let mut field = vec![Complex32::ZERO; 3 * size.pixels()];
                for scratch in [&mut kept, &mut anew] {
                    pipeline.field(&scene(size, 60, NOISE, 9), &mut field, scratch).unwrap();
                }
            }
            if i == 11 {
                cancel.request();
                for scratch in [&mut kept, &mut anew] {
                    scratch.set_cancel(&cancel);
                    let levels = &mut vec![0; 3 * size.pixels()];
                    let frame = scene(size, 70, NOISE, 3);
                    (pipeline.process_after(past, &frame, LevelsMut::Bytes(levels), scratch)).unwrap();
                }
                cancel.clear();
            }
            let run = |scratch: &mut PipelineScratch| {
                let mut levels = vec![0; 3 * size.pixels()];
                let report = pipeline.process_after(past, &frame, LevelsMut::Bytes(&mut levels), scratch);
                (report.unwrap().scale, levels)
            };
            let (of_kept, of_anew) = (run(&mut kept), run(&mut anew));
            assert!(of_kept == of_anew, "{brightness:?} {i}: {} {}", of_kept.0, of_anew.0);
            stood += usize::from(of_kept.1 == before);
            let scale;
            (scale, before) = of_kept;
            past = Some(Past { scale, ..PAST });
        }
        assert!((4..8).contains(&stood), "{brightness:?} {stood}");
    }

    /// Checks that no stage computes a cancelled frame and that the next frame sees nothing of it.
    #[test]
    fn a_frame_that_is_given_up_is_left_as_it_is() {
        let (height, width) = (19, 33);
        let display = Display::from_toml("width = 33\nheight = 19\noffset_mm = 6").unwrap();
        let target = &Target::from(display.clone());
        let in_the_middle = &Target::from(display.clone().with_offset_m(0.0).unwrap());
        let seeded = network(include_bytes!("../../../models/unbundled/seeded-8-80.onnx"));
        let int8 = network(include_bytes!("../../../models/rgbd-8-int8.onnx"));
        let sweep = Sweep::of_planes(&display, 8);
        let deep = network(include_bytes!("../../../models/ddpm-8-prefilter.onnx"));
        let steps = EncoderOptions {
            midpoint_steps: 1,
            ..EncoderOptions::default()
        };
        let deep = EncoderOptions {
            encoding: Encoding::Deep(deep),
            ..EncoderOptions::default()
        };
        let mut frame = RgbdFrame::black(3, Size { width, height });
        let (amplitude, depth) = frame.planes_mut();
        (amplitude.iter_mut().enumerate()).for_each(|(i, a)| *a = (i % 7) as f32 / 7.0);
        (depth.iter_mut().enumerate()).for_each(|(i, d)| *d = (i % 5) as f32 / 5.0);
        for (method, target, options) in [
            (Method::Network(int8.clone()), target, EncoderOptions::default()),
            (Method::Network(int8.clone()), in_the_middle, deep),
            (Method::Seeded(seeded), target, EncoderOptions::default()),
            (Method::Sweep(sweep), target, steps),
            (Method::Auto(sweep, int8), target, EncoderOptions::default()),
        ] {
            let pipeline = Pipeline::new(Size { width, height }, method, target, &options).unwrap();
            let values = 3 * height * width;
            let untouched = Complex32::new(1.5, -2.5);
            let run = |scratch: &mut PipelineScratch| {
                let mut levels = vec![77; values];
                scratch.field = vec![untouched; values];
                pipeline.process(&frame, &mut levels, scratch).unwrap();
                (scratch.field.clone(), levels)
            };
            let whole = run(&mut pipeline.scratch());
            assert!(whole.1.iter().any(|level| *level != 77));
            let (mut scratch, cancel) = (pipeline.scratch(), Cancel::default());
            scratch.set_cancel(&cancel);
            cancel.request();
            let (field, levels) = run(&mut scratch);
            // The field changes only by the mean phase, which rotates every value.
            assert!(field.iter().all(|u| (u.norm() - untouched.norm()).abs() < 1e-5));
            let changed = levels.iter().filter(|level| **level != 77).count();
            // A plan that keeps phases in memory converts the unset ones to levels.
            assert!(
                changed == 0 || levels.iter().all(|level| *level == levels[0]),
                "{changed}"
            );
            cancel.clear();
            assert!(run(&mut scratch) == whole);
        }
    }
}
