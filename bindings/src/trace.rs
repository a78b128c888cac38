//! When stages begin and end, to whoever listens: the packages pass it on to the platform's profiler.

use crate::error::{ListenerError, PhasefrontError, guard};
use phasefront_core::runtime::caught::caught;
use std::sync::{Arc, OnceLock, PoisonError, RwLock};
use tracing::span::Id;
use tracing::{Metadata, Subscriber, subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::filter::filter_fn;
use tracing_subscriber::layer::{Context, SubscriberExt};
use tracing_subscriber::registry::LookupSpan;

/// A part of the work on a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum Stage {
    /// All of a frame's work on the session's threads; the others, but for `Plan` and `Preview`, lie within it.
    Frame,
    /// Colour: turned, converted, resized.
    Colour,
    /// Depth: read, aligned, smoothed over time, refined.
    Depth,
    /// From the frame to the midpoint hologram.
    Method,
    /// From the midpoint to the modulator.
    Propagate,
    /// From the field to levels.
    Encode,
    /// Steps at the midpoint, within `Encode`.
    Midpoint,
    /// A frame that a GPU computes, with the ways there and back.
    Gpu,
    /// Plans and memory of a quality level are made.
    Plan,
    /// A small view.
    Preview,
}

impl Stage {
    fn of(span: &Metadata<'_>) -> Option<Self> {
        Some(match span.name() {
            _ if span.target() != "phasefront" => return None,
            "frame" => Stage::Frame,
            "colour" => Stage::Colour,
            "depth" => Stage::Depth,
            "method" => Stage::Method,
            "propagate" => Stage::Propagate,
            "encode" => Stage::Encode,
            "midpoint" => Stage::Midpoint,
            "gpu" => Stage::Gpu,
            "plan" => Stage::Plan,
            "preview" => Stage::Preview,
            _ => return None,
        })
    }
}

/// Hears when stages begin and end, on the threads that compute them: on one thread they lie within one another. It
/// must not call the library. What it throws is ignored.
#[uniffi::export(foreign)]
pub trait StageListener: Send + Sync {
    /// A stage begins on this thread.
    fn on_begin(&self, stage: Stage) -> Result<(), ListenerError>;
    /// The stage that began last on this thread ends.
    fn on_end(&self, stage: Stage) -> Result<(), ListenerError>;
}

static LISTENER: RwLock<Option<Arc<dyn StageListener>>> = RwLock::new(None);
/// Whether the spans of this process come here; known once a listener was set.
static COLLECTING: OnceLock<bool> = OnceLock::new();

fn listener() -> Option<Arc<dyn StageListener>> {
    LISTENER.read().unwrap_or_else(PoisonError::into_inner).clone()
}

/// Tells `listener` of every stage of every session; None for silence, which costs nothing. Set it between frames: of a
/// stage that is under way it may hear the end alone.
///
/// # Errors
/// A process that already collects Rust's `tracing` elsewhere: the spans of stages go there.
#[uniffi::export]
pub fn set_stage_listener(listener: Option<Arc<dyn StageListener>>) -> Result<(), PhasefrontError> {
    guard(|| {
        let before = std::mem::replace(&mut *LISTENER.write().unwrap_or_else(PoisonError::into_inner), listener);
        // Not under the lock: what ends with the listener may call the library.
        drop(before);
        let collecting = *COLLECTING.get_or_init(|| {
            let told = filter_fn(|span| Stage::of(span).is_some() && self::listener().is_some());
            let collector = tracing_subscriber::registry().with(Forward.with_filter(told));
            subscriber::set_global_default(collector).is_ok()
        });
        if !collecting {
            return Err(PhasefrontError::Setting(
                "this process already collects Rust's `tracing`; the spans of stages go there".into(),
            ));
        }
        // Whether anybody listens is asked once a place in the code.
        tracing::callsite::rebuild_interest_cache();
        Ok(())
    })
}

struct Forward;

impl Forward {
    fn tell<S: Subscriber + for<'a> LookupSpan<'a>>(
        span: &Id,
        context: &Context<'_, S>,
        tell: impl FnOnce(&dyn StageListener, Stage) -> Result<(), ListenerError>,
    ) {
        if let (Some(stage), Some(listener)) = (context.metadata(span).and_then(Stage::of), listener()) {
            // There is nobody to tell that telling failed.
            let _ = caught(|| tell(&*listener, stage));
        }
    }
}

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for Forward {
    fn on_enter(&self, span: &Id, context: Context<'_, S>) {
        Self::tell(span, &context, |listener, stage| listener.on_begin(stage));
    }

    fn on_exit(&self, span: &Id, context: Context<'_, S>) {
        Self::tell(span, &context, |listener, stage| listener.on_end(stage));
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use phasefront::input::{CameraFrame, ColourFormat, ColourImage, DepthFormat, DepthImage, Plane};
    use phasefront::{Display, ImageSession, Method, SessionOptions, Sweep};
    use std::sync::Mutex;

    /// Keeps what it hears, and panics each time.
    struct Unruly(Mutex<Vec<(bool, Stage)>>);

    impl StageListener for Unruly {
        fn on_begin(&self, stage: Stage) -> Result<(), ListenerError> {
            self.0.lock().unwrap().push((true, stage));
            std::panic::resume_unwind(Box::new("no thanks"))
        }

        fn on_end(&self, stage: Stage) -> Result<(), ListenerError> {
            self.0.lock().unwrap().push((false, stage));
            std::panic::resume_unwind(Box::new("no thanks"))
        }
    }

    fn frame(session: &ImageSession) {
        let (rgb, depth) = (vec![180; 24 * 16 * 3], vec![90; 24 * 16]);
        let colour = ColourImage::new(ColourFormat::Rgb, 24, 16, &[Plane::new(&rgb, 24 * 3, 3)]).unwrap();
        let depth = DepthImage::new(DepthFormat::NormalizedU8, 24, 16, Plane::new(&depth, 24, 1)).unwrap();
        session.process(&CameraFrame::new(0, colour, depth)).unwrap();
    }

    /// All in one test: there is one listener a process.
    #[test]
    fn a_listener_hears_each_stage_begin_and_end_until_it_is_gone() {
        let display = Display::default().with_size(16, 24).unwrap();
        let method = Method::Sweep(Sweep::for_display(&display));
        let session = ImageSession::new(SessionOptions::new(display, method)).unwrap();
        frame(&session);
        let heard = Arc::new(Unruly(Mutex::default()));
        set_stage_listener(Some(heard.clone())).unwrap();
        frame(&session);
        set_stage_listener(None).unwrap();
        frame(&session);
        let heard = std::mem::take(&mut *heard.0.lock().unwrap());
        let inside = [
            Stage::Colour,
            Stage::Depth,
            Stage::Method,
            Stage::Propagate,
            Stage::Encode,
        ];
        let mut expected = vec![(true, Stage::Frame)];
        expected.extend(inside.iter().flat_map(|stage| [(true, *stage), (false, *stage)]));
        expected.push((false, Stage::Frame));
        assert_eq!(heard, expected);
    }
}
