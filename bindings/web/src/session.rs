//! Sessions: frames in, holograms out.

use crate::error::{Answer, object, of_core, setting};
use crate::frame::RawFrame;
use crate::hologram::{RawHologram, times};
use crate::options::{RawOptions, quality};
use js_sys::Object;
use phasefront::session::{RunningMode, Session};
use wasm_bindgen::prelude::*;

/// A session.
#[wasm_bindgen]
pub struct RawSession {
    core: Session,
}

#[wasm_bindgen]
impl RawSession {
    /// A session that runs in `mode`: `image` or `video`.
    ///
    /// # Errors
    /// `setting` and others: options that cannot be meant or planned for. `session`: a live stream, which needs a
    /// thread.
    #[wasm_bindgen(constructor)]
    pub fn new(options: &RawOptions, mode: &str) -> Answer<RawSession> {
        let mode = match mode {
            "image" => RunningMode::Image,
            "video" => RunningMode::Video,
            "live-stream" => RunningMode::Live(Box::new(|_| {})),
            other => {
                return Err(setting(&format!(
                    "there is no mode '{other}'; there are image and video"
                )));
            }
        };
        let core = Session::new(options.core.clone(), mode).map_err(of_core)?;
        Ok(RawSession { core })
    }

    /// The hologram of a frame.
    ///
    /// # Errors
    /// As [`Session::process`].
    pub fn process(&self, frame: &RawFrame) -> Answer<RawHologram> {
        let core = self.core.process(&frame.frame()?).map_err(of_core)?;
        Ok(RawHologram { core })
    }

    /// Runs an empty frame through the stages.
    ///
    /// # Errors
    /// As [`Session::warm_up`].
    #[wasm_bindgen(js_name = warmUp)]
    pub fn warm_up(&self) -> Answer<()> {
        self.core.warm_up().map_err(of_core)
    }

    /// Forgets all frames so far.
    pub fn reset(&self) {
        self.core.reset();
    }

    /// Fixes the rung, or lets the session step.
    ///
    /// # Errors
    /// `setting`: a rung that is not on the ladder.
    #[wasm_bindgen(js_name = setQuality)]
    pub fn set_quality(&self, rung: Option<u32>) -> Answer<()> {
        self.core.set_quality(quality(rung)).map_err(of_core)
    }

    /// What the session has done so far: an object of the form `Statistics`.
    pub fn statistics(&self) -> Object {
        let core = self.core.statistics();
        let count = |count: u64| JsValue::from(count as f64);
        object([
            ("submitted", count(core.submitted)),
            ("processed", count(core.processed)),
            ("failed", count(core.failed)),
            ("refused", count(core.refused)),
            ("rateHz", core.rate_hz.into()),
            ("times", times(core.times).into()),
            ("backend", core.backend.name.into()),
            ("backendWhy", core.backend.why.into()),
            ("rung", core.rung.into()),
        ])
    }
}
