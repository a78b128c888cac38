//! Sessions: frames in, holograms out.

use crate::error::{Answer, object, of_core, setting};
use crate::frame::RawFrame;
use crate::hologram::{RawHologram, times};
use crate::options::{RawOptions, quality};
use js_sys::Object;
use phasefront::session::SessionHandle;
use phasefront::{ImageSession, VideoSession};
use std::ops::Deref;
use wasm_bindgen::prelude::*;

/// A session.
#[wasm_bindgen]
pub struct RawSession {
    core: Core,
}

/// A session of either running mode: JavaScript has one type for both.
enum Core {
    Image(ImageSession),
    Video(VideoSession),
}

impl Deref for Core {
    type Target = SessionHandle;

    fn deref(&self) -> &SessionHandle {
        match self {
            Core::Image(session) => session,
            Core::Video(session) => session,
        }
    }
}

#[wasm_bindgen]
impl RawSession {
    /// A session that runs in `mode`: `image` or `video`.
    ///
    /// # Errors
    /// `setting` and others: a mode that there is not, or options that cannot be meant or planned for.
    #[wasm_bindgen(constructor)]
    pub fn new(options: &RawOptions, mode: &str) -> Answer<RawSession> {
        let options = options.core.clone();
        let core = match mode {
            "image" => ImageSession::new(options).map(Core::Image),
            "video" => VideoSession::new(options).map(Core::Video),
            other => {
                return Err(setting(&format!(
                    "there is no mode '{other}'; there are image and video"
                )));
            }
        };
        let core = core.map_err(of_core)?;
        Ok(RawSession { core })
    }

    /// The hologram of a frame.
    ///
    /// # Errors
    /// As [`ImageSession::process`]; a late frame in a video session.
    pub fn process(&self, frame: &RawFrame) -> Answer<RawHologram> {
        let frame = frame.frame()?;
        let made = match &self.core {
            Core::Image(session) => session.process(&frame),
            Core::Video(session) => session.process(&frame),
        };
        let core = made.map_err(of_core)?;
        Ok(RawHologram { core })
    }

    /// Runs an empty frame through the stages.
    ///
    /// # Errors
    /// As [`SessionHandle::warm_up`].
    #[wasm_bindgen(js_name = warmUp)]
    pub fn warm_up(&self) -> Answer<()> {
        self.core.warm_up().map_err(of_core)
    }

    /// Forgets all frames so far.
    pub fn reset(&self) {
        self.core.reset();
    }

    /// Fixes the quality level, or lets the session change it.
    ///
    /// # Errors
    /// `setting`: a quality level that the session does not have.
    #[wasm_bindgen(js_name = setQuality)]
    pub fn set_quality(&self, quality_level: Option<u32>) -> Answer<()> {
        self.core.set_quality(quality(quality_level)).map_err(of_core)
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
            ("qualityLevel", core.quality_level.into()),
        ])
    }
}
