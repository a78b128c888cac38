//! The begin and end of stages. The packages pass them to the platform's profiler.

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
    /// The whole work on a frame on the session's threads. It contains all other stages except `Plan` and `Preview`.
    Frame,
    /// Rotating, converting and resizing the colour image.
    Colour,
    /// Reading, aligning, temporally smoothing and refining the depth.
    Depth,
    /// Computing the midpoint hologram from the frame.
    Method,
    /// Propagating from the midpoint to the modulator.
    Propagate,
    /// Encoding the field into levels.
    Encode,
    /// Correction steps at the midpoint, inside `Encode`.
    Midpoint,
    /// Computing a frame on a GPU, including both transfers.
    Gpu,
    /// Creating the plans and memory of a quality level.
    Plan,
    /// Computing a preview.
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

/// A receiver of the begin and end of stages, which is called on the threads that compute them. The stages of one
/// thread are nested. The receiver must not call the library. Errors that it throws are ignored.
#[uniffi::export(foreign)]
pub trait StageListener: Send + Sync {
    /// Reports that a stage begins on this thread.
    fn on_begin(&self, stage: Stage) -> Result<(), ListenerError>;
    /// Reports that the stage that began last on this thread ends.
    fn on_end(&self, stage: Stage) -> Result<(), ListenerError>;
}

static LISTENER: RwLock<Option<Arc<dyn StageListener>>> = RwLock::new(None);
/// Whether the spans of this process arrive here. It is known once a listener was set.
static COLLECTING: OnceLock<bool> = OnceLock::new();

fn listener() -> Option<Arc<dyn StageListener>> {
    LISTENER.read().unwrap_or_else(PoisonError::into_inner).clone()
}

/// Reports every stage of every session to `listener`. Without a listener, nothing is reported and nothing is spent.
/// Set it between frames, because it may receive only the end of a stage that has already begun.
///
/// # Errors
/// Returns an error if the process already collects Rust's `tracing` elsewhere, where the spans of stages go.
#[uniffi::export]
pub fn set_stage_listener(listener: Option<Arc<dyn StageListener>>) -> Result<(), PhasefrontError> {
    guard(|| {
        let before = std::mem::replace(&mut *LISTENER.write().unwrap_or_else(PoisonError::into_inner), listener);
        // Dropping the listener may call the library, so the lock is released first.
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
        // Each place in the code asks only once whether there is a listener.
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
            // An error of the listener cannot be reported anywhere.
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
    use phasefront::{Display, ImageSession, Method, SessionOptions, Size, Sweep};
    use std::sync::Mutex;

    /// Keeps what it receives, and panics each time.
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
        let colour = ColourImage::new(
            ColourFormat::Rgb,
            Size { width: 24, height: 16 },
            &[Plane::new(&rgb, 24 * 3, 3)],
        )
        .unwrap();
        let depth = DepthImage::new(
            DepthFormat::NormalizedU8,
            Size { width: 24, height: 16 },
            Plane::new(&depth, 24, 1),
        )
        .unwrap();
        session.process(&CameraFrame::new(0, colour, depth)).unwrap();
    }

    /// There is one listener per process, so one test covers everything.
    #[test]
    fn a_listener_hears_each_stage_begin_and_end_until_it_is_gone() {
        let display = Display::default().with_size(Size { width: 24, height: 16 }).unwrap();
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
