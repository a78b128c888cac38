//! Sessions, which make holograms of frames.

use crate::error::{Answer, object, of_core, setting};
use crate::frame::RawFrame;
use crate::hologram::{RawHologram, times};
use crate::options::{RawOptions, quality};
use js_sys::Object;
use phasefront::session::AnsweringSession;
use phasefront::{ImageSession, VideoSession};
use wasm_bindgen::prelude::*;

/// A session of either running mode. JavaScript has one type for both.
#[wasm_bindgen]
pub struct RawSession {
    core: AnsweringSession,
}

fn no_mode(name: &str) -> JsValue {
    setting(&format!("there is no mode '{name}'; there are image and video"))
}

#[wasm_bindgen]
impl RawSession {
    /// Creates a session that runs in `mode`: `image` or `video`.
    ///
    /// # Errors
    /// Throws an error, of kind `setting` among others, if the mode is unknown or the options are invalid or cannot be
    /// planned for.
    #[wasm_bindgen(constructor)]
    pub fn new(options: &RawOptions, mode: &str) -> Answer<RawSession> {
        let options = options.core.clone();
        let core = match mode {
            "image" => ImageSession::new(options).map(AnsweringSession::from),
            "video" => VideoSession::new(options).map(AnsweringSession::from),
            other => return Err(no_mode(other)),
        };
        let core = core.map_err(of_core)?;
        Ok(RawSession { core })
    }

    /// Creates a session as the constructor does, and waits for the browser's GPU if the options ask for it.
    ///
    /// # Errors
    /// Rejects in the cases of the constructor.
    pub async fn open(options: &RawOptions, mode: &str) -> Answer<RawSession> {
        let options = options.core.clone();
        let core = match mode {
            "image" => ImageSession::new_async(options).await.map(AnsweringSession::from),
            "video" => VideoSession::new_async(options).await.map(AnsweringSession::from),
            other => return Err(no_mode(other)),
        };
        let core = core.map_err(of_core)?;
        Ok(RawSession { core })
    }

    /// Returns the hologram of a frame, and waits for the browser's GPU if it computes the frame. With `stay`, the
    /// levels then stay on the GPU.
    ///
    /// # Errors
    /// Rejects in the cases of [`RawSession::process`], and while another frame is computed.
    #[wasm_bindgen(js_name = processAsync)]
    pub async fn process_async(&self, frame: &RawFrame, stay: bool) -> Answer<RawHologram> {
        let frame = frame.frame()?;
        let core = self.core.process_async(&frame, stay).await.map_err(of_core)?;
        Ok(RawHologram { core })
    }

    /// Returns the hologram of a frame.
    ///
    /// # Errors
    /// Throws an error in the cases of [`ImageSession::process`], and for a late frame in a video session.
    pub fn process(&self, frame: &RawFrame) -> Answer<RawHologram> {
        let frame = frame.frame()?;
        let core = self.core.process(&frame).map_err(of_core)?;
        Ok(RawHologram { core })
    }

    /// Runs an empty frame through the stages.
    ///
    /// # Errors
    /// Throws an error in the cases of [`AnsweringSession::warm_up`].
    #[wasm_bindgen(js_name = warmUp)]
    pub fn warm_up(&self) -> Answer<()> {
        self.core.warm_up().map_err(of_core)
    }

    /// Forgets all previous frames.
    pub fn reset(&self) {
        self.core.reset();
    }

    /// Fixes the quality level, or lets the session change it.
    ///
    /// # Errors
    /// Throws an error of kind `setting` if the session does not have the quality level.
    #[wasm_bindgen(js_name = setQuality)]
    pub fn set_quality(&self, quality_level: Option<u32>) -> Answer<()> {
        self.core.set_quality(quality(quality_level)).map_err(of_core)
    }

    /// Returns the statistics so far: an object of the form `Statistics`.
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
            ("qualityLevel", core.quality_level.into()),
        ])
    }
}
