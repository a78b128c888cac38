//! One stage of a frame, with a trace span and its duration.

use crate::runtime::clock::Instant;
use std::time::Duration;
use tracing::span::EnteredSpan;

/// A running stage on this thread. Its span ends on drop. Without a listener, a span costs about 20 ns.
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

    /// Ends the stage and returns its duration.
    pub fn end(self) -> Duration {
        self.start.elapsed()
    }
}

/// Starts a stage with a name and the fields of its span.
#[macro_export]
macro_rules! stage {
    ($name:literal $(, $field:ident = $value:expr)*) => {
        $crate::runtime::stage::Stage::of(tracing::debug_span!(target: "phasefront", $name $(, $field = $value)*))
    };
}
pub use crate::stage;
