//! The error type of the core. Each message is one line that states what is wrong and what would be right. It has at
//! most 600 characters and no terminal control characters, even if it quotes a file.

use std::fmt::{Display, Formatter, Write};
use std::sync::Arc;

/// An error of the core.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A display whose physics is impossible or out of range.
    #[error("display: {}", Line(.0))]
    Display(String),
    /// A frame, plane or stack with the wrong shape or unusable values.
    #[error("frame: {}", Line(.0))]
    Frame(String),
    /// An invalid setting or argument, such as a distance, a size or a parameter.
    #[error("{}", Line(.0))]
    Setting(String),
    /// An ONNX file that is not a hologram network.
    #[error("network: {}", Line(.0))]
    Network(String),
    /// A call that a session does not support in its mode or state.
    #[error("session: {}", Line(.0))]
    Session(String),
    /// The system could not start the threads of a session.
    #[error("session: its threads cannot be started: {}", Line(&.0.to_string()))]
    Threads(#[source] Arc<dyn std::error::Error + Send + Sync>),
    /// A frame that is not later than the last one. It is refused; later frames are not affected.
    #[error(
        "timestamp: {given_ns} ns is not after {last_ns} ns, the last one taken; timestamps must rise, or the session be reset"
    )]
    Timestamp {
        /// The timestamp of the frame.
        given_ns: u64,
        /// The timestamp of the last accepted frame.
        last_ns: u64,
    },
    /// A frame that was lost with the GPU that computed it. Later frames are not affected.
    #[error("{}", Line(.0))]
    Lost(String),
    /// A panic inside this library, which is a bug. The frame is lost, and the session continues.
    #[error("internal error: {}; please report it", Line(.0))]
    Internal(String),
}

/// The result type of the core.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// Returns this error with its message prefixed by `part`, the name of the faulty part of the input.
    #[doc(hidden)]
    pub fn of(self, part: &str) -> Self {
        let named = |why: String| format!("{part}: {why}");
        match self {
            Error::Network(why) => Error::Network(named(why)),
            Error::Setting(why) => Error::Setting(named(why)),
            other => other,
        }
    }
}

/// The number of characters kept at the beginning and at the end of a message. The end says what would be right.
const BEGINNING: usize = 350;
const END: usize = 200;

/// A message on one line, with control characters replaced and the middle of a long message left out.
pub struct Line<'a>(pub &'a str);

impl Display for Line<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let count = self.0.chars().count();
        let cut = count > BEGINNING + END;
        for (i, character) in self.0.chars().enumerate() {
            match character {
                _ if cut && i == BEGINNING => f.write_str(" … ")?,
                _ if cut && i > BEGINNING && i < count - END => {}
                // Marks that change the text direction are not control characters to `is_control`.
                c if c.is_control() || matches!(c, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}') => {
                    f.write_char('\u{fffd}')?;
                }
                c => f.write_char(c)?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_message_is_one_short_line_whatever_it_quotes() {
        let name = format!("\u{1b}[31m\u{202e}{}", "x\n".repeat(2_000_000));
        let long = Error::Network(format!("node '{name}' is of no use; Conv is right")).to_string();
        assert!(
            long.chars().count() < 600 && !long.chars().any(char::is_control),
            "{long}"
        );
        assert!(
            long.starts_with("network: node '") && long.ends_with("Conv is right"),
            "{long}"
        );
        let threads = Error::Threads(Arc::new(std::io::Error::other("none\nleft")));
        assert!(threads.to_string().ends_with("started: none\u{fffd}left"), "{threads}");
        assert_eq!(std::error::Error::source(&threads).unwrap().to_string(), "none\nleft");
        let short = Error::Setting("8 µm is right".into());
        assert_eq!(short.to_string(), "8 µm is right");
    }
}
