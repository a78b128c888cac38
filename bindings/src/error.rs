//! The error of the bindings: a kind that apps can act on, and the core's message.

use phasefront_core::runtime::caught::caught;

/// The error of a call. The message is one line that names what is wrong and what would be right.
#[derive(Debug, Clone, PartialEq, thiserror::Error, uniffi::Error)]
#[uniffi(flat_error)]
pub enum PhasefrontError {
    /// The physics of a display is impossible or out of range.
    #[error("{0}")]
    Display(String),
    /// A frame, plane or image has the wrong shape or unusable values.
    #[error("{0}")]
    Frame(String),
    /// A frame is not later than the previous one. It is refused; later frames are not affected.
    #[error("{0}")]
    Timestamp(String),
    /// A setting or an argument is invalid or cannot be planned.
    #[error("{0}")]
    Setting(String),
    /// A file is not a hologram network, or the network is for another display.
    #[error("{0}")]
    Network(String),
    /// A file cannot be read.
    #[error("{0}")]
    File(String),
    /// A session cannot answer the call in its mode or state.
    #[error("{0}")]
    Session(String),
    /// Phasefront has a bug. The call had no effect, or the frame is lost. Please report it.
    #[error("{0}")]
    Internal(String),
}

impl From<phasefront::Error> for PhasefrontError {
    fn from(error: phasefront::Error) -> Self {
        use phasefront::Error;
        let kind = match &error {
            Error::Display(_) => PhasefrontError::Display,
            Error::Frame(_) => PhasefrontError::Frame,
            Error::Timestamp { .. } => PhasefrontError::Timestamp,
            Error::Setting(_) => PhasefrontError::Setting,
            Error::Network(_) => PhasefrontError::Network,
            Error::Session(_) | Error::Threads(_) | Error::Lost(_) => PhasefrontError::Session,
            _ => PhasefrontError::Internal,
        };
        kind(error.to_string())
    }
}

/// An error that a listener threw. It is not flat, because UniFFI cannot read a flat error and would panic on the
/// session's thread.
#[derive(Debug, Clone, PartialEq, thiserror::Error, uniffi::Error)]
pub enum ListenerError {
    /// The listener threw an error or an exception.
    #[error("the listener threw: {reason}")]
    Threw {
        /// The message.
        reason: String,
    },
}

impl From<uniffi::UnexpectedUniFFICallbackError> for ListenerError {
    fn from(error: uniffi::UnexpectedUniFFICallbackError) -> Self {
        let reason = error.reason.replace('\n', " ");
        ListenerError::Threw { reason }
    }
}

/// Returns the result of `call`. A panic in it becomes an error.
pub fn guard<T>(call: impl FnOnce() -> Result<T, PhasefrontError>) -> Result<T, PhasefrontError> {
    caught(call).unwrap_or_else(|message| {
        Err(PhasefrontError::Internal(format!(
            "internal error: {message}; please report it"
        )))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_an_error_of_one_line() {
        let result: Result<(), _> = guard(|| panic!("no {}\nat all", "way"));
        assert_eq!(
            result,
            Err(PhasefrontError::Internal(
                "internal error: no way at all; please report it".into()
            ))
        );
        assert_eq!(guard(|| Ok(1)), Ok(1));
    }

    /// Panics when it is dropped.
    struct Bomb;

    impl Drop for Bomb {
        fn drop(&mut self) {
            std::panic::resume_unwind(Box::new(Bomb));
        }
    }

    #[test]
    fn a_panic_whose_payload_panics_is_an_error_too() {
        let result: Result<(), _> = guard(|| std::panic::resume_unwind(Box::new(Bomb)));
        let message = "internal error: a panic; please report it";
        assert_eq!(result, Err(PhasefrontError::Internal(message.into())));
    }

    #[test]
    fn kinds_and_messages_of_the_core_are_kept() {
        let late = phasefront::Error::Timestamp {
            given_ns: 3,
            last_ns: 5,
        };
        assert_eq!(
            PhasefrontError::from(late.clone()),
            PhasefrontError::Timestamp(late.to_string())
        );
        let plan = phasefront::Error::Setting("no z".into());
        assert_eq!(PhasefrontError::from(plan), PhasefrontError::Setting("no z".into()));
    }
}
