//! One stage of a frame: a span for traces, and the time it took.

use crate::runtime::clock::Instant;
use std::time::Duration;
use tracing::span::EnteredSpan;

/// A stage that is under way on this thread. Its span ends when it is dropped. Without a listener a span costs
/// some 20 ns.
pub struct Stage {
    start: Instant,
    _span: EnteredSpan,
}

impl Stage {
    /// Enters `span` and starts the clock.
    pub fn of(span: tracing::Span) -> Self {
        Stage {
            start: Instant::now(),
            _span: span.entered(),
        }
    }

    /// Ends it, and says how long it took.
    pub fn end(self) -> Duration {
        self.start.elapsed()
    }
}

/// Begins a stage: its name, and fields of its span.
#[macro_export]
macro_rules! stage {
    ($name:literal $(, $field:ident = $value:expr)*) => {
        $crate::runtime::stage::Stage::of(tracing::debug_span!(target: "phasefront", $name $(, $field = $value)*))
    };
}
pub use crate::stage;
