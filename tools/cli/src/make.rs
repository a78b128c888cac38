//! Makes holograms, from a request to the levels of the modulator. [`HologramRequest::make`] chooses the CPU or a GPU.
//! `hologram`, `view` and `judge` use it.

mod cpu;
pub(crate) mod field;
mod gpu;
mod judged;
mod layers;
mod lens;
mod request;
pub(crate) mod session;

pub(crate) use judged::{Judged, judge};
pub(crate) use lens::{FOURIER, judge_in_focus};
pub(crate) use request::{HologramRequest, Image, ImageFlags, Method};

use crate::flags::encoder::Encoder;
use crate::flags::method::CoreMethod;
use ndarray::Array3;
use num_complex::Complex32;
use phasefront_command::flags::sweep_for;
use phasefront_core::method::network::Engine;
use phasefront_core::view::colours::ViewColours;
use phasefront_io::display::DisplayFile;
use phasefront_io::hologram::{Hologram, HologramInfo, Levels};
use phasefront_io::ldi::{Ldi, LdiLayer};
use phasefront_io::{Error, Result};
use std::time::Duration;

impl HologramRequest {
    /// Makes the hologram of `image` for `display`.
    pub(crate) fn make(&self, display: &DisplayFile, image: &Image) -> Result<HologramResult> {
        if let Some(lens) = &display.lens {
            let Image::Rgbd(frame) = image else {
                return Err(Error::Usage(
                    "the focal plane of a lens takes --rgb with --depth, no layered depth image".into(),
                ));
            };
            return Ok(HologramResult {
                view_colours: self.view_colours(&display.target.display, image),
                ..self.in_focal_plane(lens, frame, display)?
            });
        }
        let method = self.method();
        let is_of_rgbd = matches!((method, image), (Method::Core(_), Image::Rgbd(_)));
        self.hologram.encoder.check_focus(is_of_rgbd)?;
        let device = self.backend.device()?;
        if device.is_some()
            && (matches!(method, Method::Layers | Method::Points) || self.keeps_field || self.image.ldi.is_some())
        {
            return Err(Error::Usage(
                "--backend gpu runs --method network, sweep and auto on RGB-D, without --complex and --judge; the rest is the CPU's"
                    .into(),
            ));
        }
        let made = match (method, image) {
            (Method::Core(method), Image::Rgbd(frame)) => {
                let shown = &display.target.display;
                let sweep = sweep_for(shown, self.planes, self.taps);
                let (core, encoder) = self.hologram.read(method, shown, sweep)?;
                match &device {
                    Some(options) => self.on_gpu(core, frame, display, encoder, options),
                    None => self.on_cpu(core, frame, display, encoder),
                }
            }
            (method, Image::Rgbd(frame)) => {
                let ldi = Ldi::new(vec![LdiLayer::from(frame)])?;
                self.by_layers(method, &ldi, display, self.hologram.encoder.read()?)
            }
            (method, Image::Layers(ldi)) => self.by_layers(method, ldi, display, self.hologram.encoder.read()?),
        }?;
        Ok(HologramResult {
            view_colours: self.view_colours(&display.target.display, image),
            ..made
        })
    }
}

/// A field at the modulator, its levels, and the time of each stage.
pub(crate) struct HologramResult {
    pub(crate) method: &'static str,
    pub(crate) field: Option<Array3<Complex32>>,
    pub(crate) levels: Levels,
    pub(crate) encoder: Encoder,
    pub(crate) scale: f32,
    /// The stages and their times. The last stage is the encoder.
    pub(crate) stages: Vec<(&'static str, Duration)>,
    pub(crate) engine: Option<String>,
    /// How views become pictures.
    pub(crate) view_colours: ViewColours,
}

impl HologramResult {
    /// Returns the hologram of the levels.
    pub(crate) fn hologram(&self, info: HologramInfo) -> Hologram {
        Hologram::Levels(self.levels.clone(), info)
    }
}

/// Makes a stack of `shape` from `values`.
fn stack(values: Vec<Complex32>, shape: (usize, usize, usize)) -> Array3<Complex32> {
    Array3::from_shape_vec(shape, values).expect("a stack of the frame's shape")
}

/// Returns the name of the method that made a frame's field.
fn name(is_swept: bool) -> &'static str {
    if is_swept {
        CoreMethod::Sweep.name()
    } else {
        CoreMethod::Network.name()
    }
}

/// Describes the engine of a network and why it was chosen.
fn described(engine: &Engine) -> String {
    format!("{} ({})", engine.name, engine.why)
}

/// Returns the metadata for files of levels that `encoder` made for `display`. `colours` are those of views if they
/// are known.
pub(crate) fn levels_info(display: &DisplayFile, encoder: &str, colours: Option<&ViewColours>) -> HologramInfo {
    let shown = &display.target.display;
    HologramInfo {
        calibrated: display.calibrated(true),
        display: shown.clone(),
        encoder: Some(encoder.into()),
        scale: None,
        lut: display.lut.map(Vec::from),
        levels_turns: display.target.panel.levels_turns.clone(),
        srgb_of_light: colours.and_then(|colours| HologramInfo::light_rows(colours, shown.colours())),
    }
}

/// Returns the metadata for files of the levels and of the field.
pub(crate) fn infos(display: &DisplayFile, made: &HologramResult) -> (HologramInfo, HologramInfo) {
    let levels = HologramInfo {
        scale: Some(made.scale),
        ..levels_info(display, made.encoder.name, Some(&made.view_colours))
    };
    let field = HologramInfo {
        encoder: None,
        scale: None,
        lut: None,
        levels_turns: None,
        calibrated: display.calibrated(false),
        ..levels.clone()
    };
    (levels, field)
}
