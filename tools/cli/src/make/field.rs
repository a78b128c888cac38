//! The way from a complex field to levels, on the CPU.

use super::{HologramResult, stack};
use crate::flags::encoder::Encoder;
use ndarray::Array3;
use num_complex::Complex32;
use phasefront::Display;
use phasefront::Size;
use phasefront_core::pipeline::display_plan::DisplayPlan;
use phasefront_core::view::colours::ViewColours;
use phasefront_io::hologram::Levels;
use std::time::{Duration, Instant};

/// The stage that made a field.
pub(crate) struct Stage {
    pub(crate) name: &'static str,
    pub(crate) time: Duration,
}

/// The encoding of fields for a display.
pub(crate) struct Encoding<'a> {
    pub(crate) plan: &'a DisplayPlan,
    pub(crate) display: &'a Display,
    pub(crate) encoder: Encoder,
    /// Whether fields are at the modulator and corrected already.
    pub(crate) is_at_modulator: bool,
    /// Whether the result keeps the field at the modulator.
    pub(crate) keeps_field: bool,
}

impl Encoding<'_> {
    /// Encodes `field`, (C, H, W), which `stage` made.
    pub(crate) fn of(self, mut field: Array3<Complex32>, stage: Stage) -> HologramResult {
        let shape @ (_, height, width) = field.dim();
        let mut scratch = self.plan.scratch();
        let values = field.as_slice_mut().expect("standard layout");
        let start = Instant::now();
        if !self.is_at_modulator {
            self.plan.propagate(values, &mut scratch);
        }
        let propagate = start.elapsed();
        let kept = self.keeps_field.then(|| values.to_vec());
        let mut levels = Levels::zeros(self.display, Size { width, height });
        let modulation = self.plan.modulate(None, values, levels.view_mut(), &mut scratch);
        HologramResult {
            method: stage.name,
            field: kept.map(|values| stack(values, shape)),
            levels,
            encoder: self.encoder,
            scale: modulation.scale,
            stages: vec![
                (stage.name, stage.time),
                ("propagate", propagate),
                ("encode", modulation.encode),
            ],
            engine: None,
            view_colours: ViewColours::Amplitude,
        }
    }
}
