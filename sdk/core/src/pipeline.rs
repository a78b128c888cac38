//! One RGB-D frame through all stages: midpoint hologram, offset, phase encoding, levels, with the time
//! of each. Many frames are a session's work.

pub mod display_plan;

use crate::display::target::Target;
use crate::encode::EncoderOptions;
use crate::encode::brightness::Past;
use crate::frame::RgbdFrame;
use crate::method::{Method, MethodPlan, MethodScratch};
use crate::pipeline::display_plan::{DisplayPlan, DisplayScratch, Modulation, remove_mean_phase};
use crate::runtime::cancel::Cancel;
use crate::runtime::error::Result;
use crate::runtime::stage::stage;
use num_complex::Complex32;
use std::time::Duration;

/// A plan for one frame shape, method and target. Immutable; shared between threads.
pub struct Pipeline {
    method: MethodPlan,
    display: DisplayPlan,
}

/// Working memory of a [`Pipeline`] for one frame at a time.
pub struct PipelineScratch {
    method: MethodScratch,
    display: DisplayScratch,
    /// [`Pipeline::process`]'s own field; empty before its first call.
    field: Vec<Complex32>,
}

/// How long each stage of a frame took.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FrameTimes {
    /// Colour: turned, converted, resized. On a GPU, depth too.
    pub colour: Duration,
    /// Depth: read, aligned, smoothed over time, refined.
    pub depth: Duration,
    /// From the frame to the midpoint hologram; on a GPU with the ways there and back.
    pub method: Duration,
    /// From the midpoint to the modulator.
    pub propagate: Duration,
    /// From the field to levels.
    pub encode: Duration,
}

impl FrameTimes {
    /// All stages together.
    pub fn total(&self) -> Duration {
        self.stages().into_iter().map(|(_, time)| time).sum()
    }

    /// Each stage and its name, in their order.
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

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameReport {
    /// The amplitude that full light stands for.
    pub scale: f32,
    /// How long it took.
    pub times: FrameTimes,
}

impl PipelineScratch {
    /// Has frames end where `cancel` is requested.
    #[doc(hidden)]
    pub fn set_cancel(&mut self, cancel: &Cancel) {
        self.method.set_cancel(cancel);
        self.display.set_cancel(cancel);
    }
}

impl Pipeline {
    /// Plans (H, W) = `shape` frames by `method` to `target`.
    ///
    /// # Errors
    /// What [`Method`] or the way to the target refuses: a network for another display, an offset or correction that
    /// moves light farther than can be padded, a parameter out of its range.
    pub fn new(shape: (usize, usize), method: Method, target: &Target, options: &EncoderOptions) -> Result<Self> {
        let method = MethodPlan::new(shape.0, shape.1, method, &target.display)?;
        // The modulator does the rest of the way.
        let display = DisplayPlan::from_z(shape, method.z_m(), target, options)?;
        Ok(Pipeline { method, display })
    }

    /// How many colours its frames, fields and levels have, C: as many as the display has lasers.
    pub fn colours(&self) -> usize {
        self.display.colours()
    }

    /// (H, W).
    pub fn shape(&self) -> (usize, usize) {
        self.method.shape()
    }

    /// The plan of the method.
    #[doc(hidden)]
    pub fn method(&self) -> &MethodPlan {
        &self.method
    }

    /// Working memory for one frame at a time.
    pub fn scratch(&self) -> PipelineScratch {
        PipelineScratch {
            method: self.method.scratch(),
            display: self.display.scratch(),
            field: Vec::new(),
        }
    }

    /// The field at the modulator, into `field`, (C, H, W): the method's hologram, mean phase taken out (but for an
    /// encoding that was trained with it), the rest of the offset. Gives the times of the method and of the rest.
    ///
    /// # Errors
    /// A frame of another shape.
    #[doc(hidden)]
    pub fn field(
        &self,
        frame: &RgbdFrame,
        field: &mut [Complex32],
        scratch: &mut PipelineScratch,
    ) -> Result<(Duration, Duration)> {
        self.field_after(false, frame, field, scratch)
    }

    /// [`Self::field`] of a frame that `follows` the one before.
    #[doc(hidden)]
    pub fn field_after(
        &self,
        follows: bool,
        frame: &RgbdFrame,
        field: &mut [Complex32],
        scratch: &mut PipelineScratch,
    ) -> Result<(Duration, Duration)> {
        let stage = stage!("method");
        let of_method = &mut scratch.method;
        self.method.field_after(follows, frame, field, of_method)?;
        if !self.display.keeps_phase() {
            remove_mean_phase(field, self.display.colours());
        }
        let method = stage.end();
        let stage = stage!("propagate");
        self.display.propagate(field, &mut scratch.display);
        Ok((method, stage.end()))
    }

    /// Encodes a field at the modulator, (C, H, W), into `levels`, as [`DisplayPlan::modulate`].
    ///
    /// # Panics
    /// If `field` or `levels` has not C·H·W values.
    #[doc(hidden)]
    pub fn modulate(&self, field: &mut [Complex32], levels: &mut [u8], scratch: &mut PipelineScratch) -> Modulation {
        self.modulate_after(None, field, levels, scratch)
    }

    /// [`DisplayPlan::modulate_after`].
    #[doc(hidden)]
    pub fn modulate_after(
        &self,
        past: Option<Past>,
        field: &mut [Complex32],
        levels: &mut [u8],
        scratch: &mut PipelineScratch,
    ) -> Modulation {
        self.display.modulate_after(past, field, levels, &mut scratch.display)
    }

    /// [`DisplayPlan::modulate_words_after`].
    #[doc(hidden)]
    pub fn modulate_words_after(
        &self,
        past: Option<Past>,
        field: &mut [Complex32],
        phases: &mut [f32],
        words: &mut [u16],
        scratch: &mut PipelineScratch,
    ) -> Modulation {
        (self.display).modulate_words_after(past, field, phases, words, &mut scratch.display)
    }

    /// [`DisplayPlan::modulate_words`].
    ///
    /// # Panics
    /// If `field`, `phases` or `words` has not C·H·W values.
    #[doc(hidden)]
    pub fn modulate_words(
        &self,
        field: &mut [Complex32],
        phases: &mut [f32],
        words: &mut [u16],
        scratch: &mut PipelineScratch,
    ) -> Modulation {
        (self.display).modulate_words(field, phases, words, &mut scratch.display)
    }

    /// Writes the levels of `frame` into `levels`, (C, H, W). The first call with a scratch allocates the field in it,
    /// later ones allocate nothing.
    ///
    /// # Errors
    /// A frame of another shape.
    ///
    /// # Panics
    /// If `levels` has not C·H·W values.
    pub fn process(&self, frame: &RgbdFrame, levels: &mut [u8], scratch: &mut PipelineScratch) -> Result<FrameReport> {
        let mut field = std::mem::take(&mut scratch.field);
        let (height, width) = self.shape();
        field.resize(self.colours() * height * width, Complex32::ZERO);
        let report = self.process_in(&mut field, frame, levels, scratch);
        scratch.field = field;
        report
    }

    fn process_in(
        &self,
        field: &mut [Complex32],
        frame: &RgbdFrame,
        levels: &mut [u8],
        scratch: &mut PipelineScratch,
    ) -> Result<FrameReport> {
        let (method, propagate) = self.field(frame, field, scratch)?;
        let modulation = self.modulate(field, levels, scratch);
        Ok(FrameReport {
            scale: modulation.scale,
            times: FrameTimes {
                method,
                propagate,
                encode: modulation.encode,
                ..FrameTimes::default()
            },
        })
    }

    /// The levels of `frame`, (C, H, W), in new memory. For frame after frame, [`Self::process`] is faster.
    ///
    /// # Errors
    /// A frame of another shape.
    pub fn levels(&self, frame: &RgbdFrame) -> Result<Vec<u8>> {
        let (height, width) = self.shape();
        let mut levels = vec![0; self.colours() * height * width];
        self.process(frame, &mut levels, &mut self.scratch())?;
        Ok(levels)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::display::Display;
    use crate::encode::Encoding;
    use crate::method::network::Network;
    use crate::method::sweep::Sweep;
    use std::sync::Arc;

    fn network(bytes: &[u8]) -> Arc<Network> {
        Arc::new(Network::from_onnx(bytes).unwrap())
    }

    /// What has been given up is not computed, in any stage, and leaves nothing behind that the next frame would see.
    #[test]
    fn a_frame_that_is_given_up_is_left_as_it_is() {
        let (height, width) = (19, 33);
        let display = Display::from_toml("width = 33\nheight = 19\noffset_mm = 6").unwrap();
        let target = Target::from(display.clone());
        let seeded = network(include_bytes!("../../../models/seeded-8-80.onnx"));
        let int8 = network(include_bytes!("../../../models/rgbd-8-int8.onnx"));
        let sweep = Sweep::of_planes(&display, 8);
        let deep = network(include_bytes!("../../../models/ddpm-8-6mm-prefilter.onnx"));
        let steps = EncoderOptions {
            midpoint_steps: 1,
            ..EncoderOptions::default()
        };
        let deep = EncoderOptions {
            encoding: Encoding::Deep(deep),
            ..EncoderOptions::default()
        };
        let mut frame = RgbdFrame::black(3, (height, width));
        let (amplitude, depth) = frame.planes_mut();
        (amplitude.iter_mut().enumerate()).for_each(|(i, a)| *a = (i % 7) as f32 / 7.0);
        (depth.iter_mut().enumerate()).for_each(|(i, d)| *d = (i % 5) as f32 / 5.0);
        for (method, options) in [
            (Method::Network(int8.clone()), EncoderOptions::default()),
            (Method::Network(int8.clone()), deep),
            (Method::Seeded(seeded), EncoderOptions::default()),
            (Method::Sweep(sweep), steps),
            (Method::Auto(sweep, int8), EncoderOptions::default()),
        ] {
            let pipeline = Pipeline::new((height, width), method, &target, &options).unwrap();
            let values = 3 * height * width;
            let untouched = Complex32::new(1.5, -2.5);
            let run = |scratch: &mut PipelineScratch| {
                let (mut field, mut levels) = (vec![untouched; values], vec![77; values]);
                pipeline.process_in(&mut field, &frame, &mut levels, scratch).unwrap();
                (field, levels)
            };
            let whole = run(&mut pipeline.scratch());
            assert!(whole.1.iter().any(|level| *level != 77));
            let (mut scratch, cancel) = (pipeline.scratch(), Cancel::default());
            scratch.set_cancel(&cancel);
            cancel.request();
            let (field, levels) = run(&mut scratch);
            // But for the mean phase, which every value is turned by.
            assert!(field.iter().all(|u| (u.norm() - untouched.norm()).abs() < 1e-5));
            let changed = levels.iter().filter(|level| **level != 77).count();
            // Where phases lie in memory first, those of nothing become levels.
            assert!(
                changed == 0 || levels.iter().all(|level| *level == levels[0]),
                "{changed}"
            );
            cancel.clear();
            assert!(run(&mut scratch) == whole);
        }
    }
}
