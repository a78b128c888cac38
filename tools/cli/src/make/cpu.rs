//! The core's methods for RGB-D images, on the CPU.

use super::levels::{Out, described, levels_by, stack};
use super::{HologramRequest, HologramResult};
use crate::flags::encoder::Encoder;
use ndarray::Array3;
use num_complex::Complex32;
use phasefront::{Pipeline, RgbdFrame};
use phasefront_io::Result;
use phasefront_io::display::DisplayFile;

impl HologramRequest {
    pub(super) fn on_cpu(
        &self,
        stage: &'static str,
        method: phasefront::Method,
        frame: &RgbdFrame,
        display: &DisplayFile,
        encoder: Encoder,
    ) -> Result<HologramResult> {
        let (height, width) = frame.shape();
        let target = display.corrected()?;
        let options = self.encoder_options(&encoder.options);
        let pipeline = Pipeline::new((height, width), method, &target, &options)?;
        let mut scratch = pipeline.scratch();
        let mut field = Array3::from_elem((pipeline.colours(), height, width), Complex32::ZERO);
        let shape = field.dim();
        let values = field.as_slice_mut().expect("standard layout");
        let (predict, propagate) = pipeline.field(frame, values, &mut scratch)?;
        // The encoder filters the field in place, so keep a copy if it is requested.
        let kept = self.keeps_field.then(|| values.to_vec());
        let (levels, words, modulation) = levels_by(&target.display, (height, width), |out| match out {
            Out::Bytes(bytes) => pipeline.modulate(values, bytes, &mut scratch),
            Out::Words(phases, words) => pipeline.modulate_words(values, phases, words, &mut scratch),
        });
        let engine = pipeline.method().engine();
        Ok(HologramResult {
            method: stage,
            field: kept.map(|values| stack(values, shape)),
            levels,
            words,
            encoder,
            scale: modulation.scale,
            stages: vec![
                (stage, predict),
                ("propagate", propagate),
                ("encode", modulation.encode),
            ],
            engine: engine.map(described),
        })
    }
}
