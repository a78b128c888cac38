//! The one error of the bindings: a kind that apps can act on, and the core's message.

use phasefront_core::runtime::caught::caught;

/// Why Phasefront refused to go on. The message is one line that names what is wrong and what would be right.
#[derive(Debug, Clone, PartialEq, thiserror::Error, uniffi::Error)]
#[uniffi(flat_error)]
pub enum PhasefrontError {
    /// A display whose physics is impossible or out of range.
    #[error("{0}")]
    Display(String),
    /// A frame, plane or image of the wrong shape or with unusable values.
    #[error("{0}")]
    Frame(String),
    /// A frame that is not later than the last one. It is refused; what follows is not harmed.
    #[error("{0}")]
    Timestamp(String),
    /// A setting or an argument that cannot be meant or planned for.
    #[error("{0}")]
    Setting(String),
    /// What is not a hologram network, or one for another display.
    #[error("{0}")]
    Network(String),
    /// A file that cannot be read.
    #[error("{0}")]
    File(String),
    /// A call that a session cannot answer in its mode or state.
    #[error("{0}")]
    Session(String),
    /// A fault of Phasefront. The call had no effect, or the frame is lost; please report it.
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

/// What a listener threw, whatever it was. An error that comes in must not be flat: a flat one only goes out, and
/// taking it in would be a panic on the session's thread.
#[derive(Debug, Clone, PartialEq, thiserror::Error, uniffi::Error)]
pub enum ListenerError {
    /// With its own words.
    #[error("the listener threw: {reason}")]
    Threw {
        /// What it said.
        reason: String,
    },
}

impl From<uniffi::UnexpectedUniFFICallbackError> for ListenerError {
    fn from(error: uniffi::UnexpectedUniFFICallbackError) -> Self {
        let reason = error.reason.replace('\n', " ");
        ListenerError::Threw { reason }
    }
}

/// What `call` gives, a panic in it made an error.
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

    /// Panics as it ends.
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
