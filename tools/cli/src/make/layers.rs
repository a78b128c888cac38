//! The methods for layered depth images, on the CPU.

use super::field::{self, Stage};
use super::{HologramRequest, HologramResult, Method, described};
use crate::flags::encoder::Encoder;
use ndarray::Array3;
use num_complex::Complex32;
use phasefront::Size;
use phasefront::{Display, Network};
use phasefront_command::flags::PrecisionName;
use phasefront_command::networks;
use phasefront_command::terminal::progress_bar;
use phasefront_core::method::network::InputKind;
use phasefront_core::pipeline::display_plan::DisplayPlan;
use phasefront_exact::corrected::{self, Correction, spatial};
use phasefront_exact::{point_based, sm_lbm};
use phasefront_io::display::DisplayFile;
use phasefront_io::display::calibration::AberrationFile;
use phasefront_io::ldi::Ldi;
use phasefront_io::{Error, Result};
use std::sync::Arc;
use std::time::Instant;

/// The default number of planes for the methods of exact waves.
const DEFAULT_PLANES: usize = 256;

/// A field, with the names of its stage and engine.
struct Wave {
    stage: &'static str,
    field: Array3<Complex32>,
    engine: Option<String>,
}

impl HologramRequest {
    /// Makes a hologram of `ldi` by a method for layered depth images.
    pub(super) fn by_layers(
        &self,
        method: Method,
        ldi: &Ldi,
        file: &DisplayFile,
        encoder: Encoder,
    ) -> Result<HologramResult> {
        // A correction that is the same for all depths is part of the offset. Only SM-LBM handles others.
        let (target, varying) = match (method, file.corrected()) {
            (_, Ok(target)) => (target, None),
            (Method::Layers, Err(_)) => (file.target.clone(), file.aberration.as_ref()),
            (_, Err(e)) => return Err(e),
        };
        let display = &target.display;
        let options = self.encoder_options(&encoder.options);
        let modulator = DisplayPlan::new(ldi.size(), &target, &options)?;
        let start = Instant::now();
        let wave = self.wave(method, ldi, display, varying)?;
        let made = Stage {
            name: wave.stage,
            time: start.elapsed(),
        };
        let encoding = field::Encoding {
            plan: &modulator,
            display,
            encoder,
            is_at_modulator: false,
            keeps_field: self.keeps_field,
        };
        Ok(HologramResult {
            engine: wave.engine,
            ..encoding.of(wave.field, made)
        })
    }

    /// Computes the field of `ldi` with `method`, corrected for an aberration that varies over depth or over the frame.
    fn wave(&self, method: Method, ldi: &Ldi, display: &Display, varying: Option<&AberrationFile>) -> Result<Wave> {
        let Size { width, height } = ldi.size();
        let planes = self.planes.unwrap_or(DEFAULT_PLANES);
        let bar = progress_bar(0, "");
        let progress = |done: usize, total: usize| {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
        };
        let mut engine = None;
        let (stage, field) = match method {
            Method::Core(_) => {
                let plan = self.network_for_layers(display)?.plan_for(ldi.size(), display)?;
                let mut field = Array3::zeros((display.colours(), height, width));
                let values = field.as_slice_mut().expect("standard layout");
                plan.field(ldi, values, &mut plan.scratch())?;
                engine = Some(described(plan.engine()));
                ("network", field)
            }
            Method::Points => {
                bar.set_message("rows");
                let occlusion = self.occlusion.unwrap_or_default().occlusion();
                let field = point_based::hologram(ldi, display, planes, occlusion, &progress)?;
                ("points", field)
            }
            Method::Layers => {
                bar.set_message("planes");
                let field = match varying {
                    None => sm_lbm::hologram(ldi, display, planes, &progress)?,
                    Some(AberrationFile::Uniform(all)) => {
                        let correction = Correction::of_aberrations(all, ldi.size(), planes, display)?;
                        corrected::hologram(ldi, display, planes, &correction, &progress)?
                    }
                    Some(AberrationFile::Spatial(all)) => spatial::hologram(ldi, display, planes, all, &progress)?,
                };
                ("layers", field)
            }
        };
        bar.finish_and_clear();
        Ok(Wave { stage, field, engine })
    }

    /// Reads the network of --network, which must take layers and suit `display`.
    fn network_for_layers(&self, display: &Display) -> Result<Arc<Network>> {
        let name = self.hologram.network.as_deref().ok_or_else(|| {
            Error::Usage("--method network with --ldi needs a --network for layered depth images".into())
        })?;
        let network = networks::network(name, self.hologram.precision.map(PrecisionName::precision))?;
        if !matches!(network.input(), InputKind::Ldi { .. }) {
            return Err(Error::Input(format!(
                "--network {name} takes '{}'; for a layered depth image one for 'ldi2' to 'ldi9' is needed",
                network.input()
            )));
        }
        network.check_display(display)?;
        Ok(network)
    }
}
