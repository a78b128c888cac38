//! The core's methods for RGB-D images, on the CPU.

use super::{HologramRequest, HologramResult, described, name, stack};
use crate::flags::encoder::Encoder;
use ndarray::Array3;
use num_complex::Complex32;
use phasefront::Size;
use phasefront::{Pipeline, RgbdFrame};
use phasefront_core::view::colours::ViewColours;
use phasefront_io::Result;
use phasefront_io::display::DisplayFile;
use phasefront_io::hologram::Levels;

impl HologramRequest {
    pub(super) fn on_cpu(
        &self,
        method: phasefront::Method,
        frame: &RgbdFrame,
        display: &DisplayFile,
        encoder: Encoder,
    ) -> Result<HologramResult> {
        let Size { width, height } = frame.size();
        let target = display.corrected()?;
        let options = self.encoder_options(&encoder.options);
        let pipeline = Pipeline::new(frame.size(), method, &target, &options)?;
        let mut scratch = pipeline.scratch();
        let mut field = Array3::from_elem((pipeline.colours(), height, width), Complex32::ZERO);
        let shape = field.dim();
        let values = field.as_slice_mut().expect("standard layout");
        let (predict, propagate) = pipeline.field(frame, values, &mut scratch)?;
        // The encoder filters the field in place, so keep a copy if it is requested.
        let kept = self.keeps_field.then(|| values.to_vec());
        let mut levels = Levels::zeros(&target.display, frame.size());
        let modulation = pipeline.modulate(None, values, levels.view_mut(), &mut scratch);
        let stage = name(scratch.is_swept());
        let engine = pipeline.method().engine().filter(|_| !scratch.is_swept());
        Ok(HologramResult {
            method: stage,
            field: kept.map(|values| stack(values, shape)),
            levels,
            encoder,
            scale: modulation.scale,
            stages: vec![
                (stage, predict),
                ("propagate", propagate),
                ("encode", modulation.encode),
            ],
            engine: engine.map(described),
            view_colours: ViewColours::Amplitude,
        })
    }
}
