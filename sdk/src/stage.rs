//! One stage of a frame: a span for traces, and the time it took.

use crate::clock::Instant;
use std::time::Duration;
use tracing::span::EnteredSpan;

/// A stage that is under way on this thread. Its span ends when it is dropped. Without a listener a span costs
/// some 20 ns.
pub(crate) struct Stage {
    start: Instant,
    _span: EnteredSpan,
}

impl Stage {
    pub(crate) fn of(span: tracing::Span) -> Self {
        Stage {
            start: Instant::now(),
            _span: span.entered(),
        }
    }

    /// Ends it, and says how long it took.
    pub(crate) fn end(self) -> Duration {
        self.start.elapsed()
    }
}

/// Begins a stage: its name, and fields of its span.
macro_rules! stage {
    ($name:literal $(, $field:ident = $value:expr)*) => {
        crate::stage::Stage::of(tracing::debug_span!(target: "phasefront", $name $(, $field = $value)*))
    };
}
pub(crate) use stage;
