//! The options of a session.

use crate::error::{Answer, of_core, setting};
use crate::network::RawNetwork;
use crate::target::RawTarget;
use phasefront::Size;
use phasefront::input::DepthRange;
#[cfg(feature = "webgpu")]
use phasefront::session::Backend;
use phasefront::session::{Focus, Quality, QualityLevel, SessionOptions};
use phasefront::{Brightness, EncoderOptions, Encoding, Method, Network, Sweep};
use std::sync::Arc;
use wasm_bindgen::prelude::*;

/// The method of a session. The display of a sweep is known only when the sweep is used.
enum Maker {
    Trained(Arc<Network>),
    Sweep,
    /// With the network, or with the built-in one.
    Auto(Option<Arc<Network>>),
}

/// The method that computes holograms.
#[wasm_bindgen]
pub struct RawMethod(Maker);

#[wasm_bindgen]
impl RawMethod {
    /// Creates the method of a trained network.
    pub fn trained(network: &RawNetwork) -> RawMethod {
        RawMethod(Maker::Trained(network.core.clone()))
    }

    /// Creates the plane sweep.
    pub fn sweep() -> RawMethod {
        RawMethod(Maker::Sweep)
    }

    /// Creates the method that chooses between the built-in network and the sweep by each frame's depth. It is the
    /// sweep alone if that network was not trained for the display.
    pub fn auto() -> RawMethod {
        RawMethod(Maker::Auto(None))
    }

    /// Creates the method that chooses between `network` and the sweep by each frame's depth.
    #[wasm_bindgen(js_name = autoWith)]
    pub fn auto_with(network: &RawNetwork) -> RawMethod {
        RawMethod(Maker::Auto(Some(network.core.clone())))
    }
}

impl RawMethod {
    fn core(&self, target: &phasefront::Target, focus: Focus) -> Answer<Method> {
        let method = match &self.0 {
            Maker::Trained(network) => Method::trained(network.clone()),
            Maker::Sweep => Method::Sweep(Sweep::for_display(&target.display)),
            Maker::Auto(None) => focus.default_method(&target.display).map_err(of_core)?,
            Maker::Auto(Some(network)) => Method::Auto(Sweep::for_display(&target.display), network.clone()),
        };
        focus.check(&method).map_err(of_core)?;
        Ok(method)
    }
}

/// The options of a session. Set the encoding first, then the corrections, then the quality levels: each uses what was
/// set before.
#[wasm_bindgen]
pub struct RawOptions {
    pub(crate) core: SessionOptions,
    focus: Focus,
}

/// Returns the focus with `natural_steps` of natural focus, or the coherent one for `None`.
fn focus(natural_steps: Option<u32>) -> Focus {
    natural_steps.map_or(Focus::Coherent, |steps| Focus::Natural { steps: steps as usize })
}

#[wasm_bindgen]
impl RawOptions {
    /// Returns the default options for `target` with `method`, and the number of steps of natural focus, or none for
    /// coherent focus.
    ///
    /// # Errors
    /// Throws an error of kind `setting` if natural focus without steps has no network for the display.
    #[wasm_bindgen(constructor)]
    pub fn new(target: &RawTarget, method: &RawMethod, natural_steps: Option<u32>) -> Answer<RawOptions> {
        let focus = focus(natural_steps);
        let method = method.core(&target.core, focus)?;
        Ok(RawOptions {
            core: SessionOptions::new(target.core.clone(), method),
            focus,
        })
    }

    /// Sets the encoding: `double-phase`; `anti-alias` with a standard deviation in pixels and a number of taps; or
    /// `band-limit` with its bound. Omitted values are those of the publication.
    ///
    /// # Errors
    /// Throws an error of kind `setting` if the name is unknown.
    pub fn encoding(&mut self, name: &str, sigma_or_k: Option<f32>, width: Option<u32>) -> Answer<()> {
        self.core.encoder = EncoderOptions::from(match name {
            "double-phase" => Encoding::DoublePhase,
            "anti-alias" => Encoding::AntiAlias {
                sigma: sigma_or_k.unwrap_or(0.7),
                width: width.map_or(3, |width| width as usize),
            },
            "band-limit" => Encoding::BandLimit {
                k: sigma_or_k.unwrap_or(1.0),
            },
            other => {
                return Err(setting(&format!(
                    "there is no encoding '{other}'; there are double-phase, anti-alias, band-limit, deep"
                )));
            }
        });
        Ok(())
    }

    /// Sets the encoding `deep` with its pre-filter.
    pub fn deep(&mut self, prefilter: &RawNetwork) {
        self.core.encoder = EncoderOptions::from(Encoding::Deep(prefilter.core.clone()));
    }

    /// Sets the brightness: `smoothed`, `frame-max`, or `fixed` at an amplitude.
    ///
    /// # Errors
    /// Throws an error of kind `setting` if the name is unknown, or if a fixed brightness has no amplitude.
    pub fn brightness(&mut self, name: &str, scale: Option<f32>) -> Answer<()> {
        self.core.encoder.brightness = match (name, scale) {
            ("smoothed", _) => Brightness::Smoothed,
            ("frame-max", _) => Brightness::FrameMax,
            ("fixed", Some(scale)) => Brightness::Fixed(scale),
            (other, _) => {
                return Err(setting(&format!(
                    "there is no brightness '{other}'; there are smoothed, frame-max, and fixed with its scale"
                )));
            }
        };
        Ok(())
    }

    /// Sets the corrections. Omitted values are the defaults of the encoding.
    pub fn corrections(&mut self, dark_threshold: Option<f32>, local_steps: Option<u32>, midpoint_steps: Option<u32>) {
        let encoder = &mut self.core.encoder;
        encoder.dark_threshold = dark_threshold.unwrap_or(encoder.dark_threshold);
        *encoder = stepped(encoder, local_steps, midpoint_steps);
        encoder.focus_steps = self.focus.steps();
    }

    /// Sets the depths in metres at the near and the far end of the volume.
    #[wasm_bindgen(js_name = depthRange)]
    pub fn depth_range(&mut self, near_m: f32, far_m: f32) {
        self.core.depth.range = DepthRange::Fixed { near_m, far_m };
    }

    /// Sets the confidence, from 0 to 1, below which readings are ignored.
    #[wasm_bindgen(js_name = leastConfidence)]
    pub fn least_confidence(&mut self, least: f32) {
        self.core.depth.least_confidence = least;
    }

    /// Sets whether what stands still in a video keeps its wave.
    #[wasm_bindgen(js_name = keepStanding)]
    pub fn keep_standing(&mut self, keep: bool) {
        self.core.keep_standing = keep;
    }

    /// Sets the target rate in frames per second.
    #[wasm_bindgen(js_name = targetRateHz)]
    pub fn target_rate_hz(&mut self, rate: f64) {
        self.core.target_rate_hz = Some(rate);
    }

    /// Sets the maximum number of pixels of a quality level and of the modulator.
    #[wasm_bindgen(js_name = mostPixels)]
    pub fn most_pixels(&mut self, pixels: u32) {
        self.core.most_pixels = pixels as usize;
    }

    /// Computes frames on the browser's GPU, or only on an adapter whose name contains `adapter`.
    ///
    /// # Errors
    /// Throws an error of kind `setting` if this module has no WebGPU.
    pub fn webgpu(&mut self, adapter: Option<String>) -> Answer<()> {
        #[cfg(feature = "webgpu")]
        {
            self.core.backend = Backend::Gpu;
            self.core.gpu.device.name = adapter;
            Ok(())
        }
        #[cfg(not(feature = "webgpu"))]
        {
            let _ = adapter;
            Err(setting(
                "this module has no WebGPU; import from phasefront/webgpu, or leave out the backend",
            ))
        }
    }

    /// Fixes the quality level of the session; without one, the session may change it.
    pub fn quality(&mut self, quality_level: Option<u32>) {
        self.core.quality = quality(quality_level);
    }

    /// Removes all quality levels.
    #[wasm_bindgen(js_name = clearQualityLevels)]
    pub fn clear_quality_levels(&mut self) {
        self.core.quality_levels.clear();
    }

    /// Adds a quality level below the existing ones.
    ///
    /// # Errors
    /// Throws an error of kind `setting` for steps of natural focus where the focus is coherent, or if natural focus
    /// without steps has no network for the display.
    #[wasm_bindgen(js_name = pushQualityLevel)]
    pub fn push_quality_level(
        &mut self,
        method: &RawMethod,
        width: u32,
        height: u32,
        local_steps: Option<u32>,
        midpoint_steps: Option<u32>,
        focus_steps: Option<u32>,
    ) -> Answer<()> {
        let focus = self
            .focus
            .with_steps(focus_steps.map(|steps| steps as usize))
            .map_err(of_core)?;
        self.core.quality_levels.push(QualityLevel {
            method: method.core(&self.core.target, focus)?,
            size: Size {
                width: width as usize,
                height: height as usize,
            },
            backend: None,
            encoder: Some(EncoderOptions {
                focus_steps: focus.steps(),
                ..stepped(&self.core.encoder, local_steps, midpoint_steps)
            }),
        });
        Ok(())
    }
}

/// Returns `encoder` with other numbers of steps, where given.
fn stepped(encoder: &EncoderOptions, local_steps: Option<u32>, midpoint_steps: Option<u32>) -> EncoderOptions {
    let steps = |asked: Option<u32>, defaults: usize| asked.map_or(defaults, |steps| steps as usize);
    EncoderOptions {
        local_steps: steps(local_steps, encoder.local_steps),
        midpoint_steps: steps(midpoint_steps, encoder.midpoint_steps),
        ..encoder.clone()
    }
}

/// Returns the `Quality` for a fixed quality level, or the adaptive one for `None`.
pub(crate) fn quality(quality_level: Option<u32>) -> Quality {
    quality_level.map_or(Quality::Adaptive, |quality_level| {
        Quality::Fixed(quality_level as usize)
    })
}
