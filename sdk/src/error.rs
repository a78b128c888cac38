//! The one error type of the core. Each message is one line that names what is wrong and what would be right.

/// Why the core refused to go on.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A display whose physics is impossible or out of range.
    #[error("display: {0}")]
    Display(String),
    /// A frame, plane or stack of the wrong shape or with unusable values.
    #[error("frame: {0}")]
    Frame(String),
    /// A plan that cannot be made or used as asked: a distance, a size, a parameter.
    #[error("{0}")]
    Plan(String),
    /// An ONNX file that is not a hologram network.
    #[error("network: {0}")]
    Network(String),
    /// A call that a session cannot answer in its mode or state.
    #[error("session: {0}")]
    Session(String),
    /// A frame that is not later than the last one. It is refused; what follows is not harmed.
    #[error(
        "timestamp: {given_ns} ns is not after {last_ns} ns, the last one taken; timestamps must rise, or the session be reset"
    )]
    Timestamp {
        /// The frame's.
        given_ns: u64,
        /// The last one that was taken.
        last_ns: u64,
    },
    /// A frame that went with the GPU that was computing it. What follows is not harmed.
    #[error("{0}")]
    Lost(String),
    /// A panic inside; a fault of this library. The frame is lost, the session goes on.
    #[error("internal error: {0}; please report it")]
    Internal(String),
}

/// The core's result.
pub type Result<T> = std::result::Result<T, Error>;
