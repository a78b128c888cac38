//! Why a frame becomes no hologram.

/// Why a frame was not made into a hologram, without fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum DropReason {
    /// A newer frame came while it waited.
    Superseded,
    /// It came sooner than the target rate asks for.
    AboveTargetRate,
    /// The session was paused.
    Paused,
    /// The session was reset before it was done.
    Reset,
    /// The session was closed before it was done.
    Closed,
}
