//! The reasons for which a session drops a frame.

/// The reason why a session dropped a frame without an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum DropReason {
    /// A newer frame arrived while this one waited.
    Superseded,
    /// The frame arrived sooner than the target rate allows.
    AboveTargetRate,
    /// The session was paused.
    Paused,
    /// The session was reset before the frame was finished.
    Reset,
    /// The session was closed before the frame was finished.
    Closed,
}
