//! The one error type of the core. Each message is one line that names what is wrong and what would be right, of at
//! most 600 characters and none that controls a terminal, whatever stands in the file that it quotes.

use std::fmt::{Display, Formatter, Write};
use std::sync::Arc;

/// Why the core refused to go on.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A display whose physics is impossible or out of range.
    #[error("display: {}", Line(.0))]
    Display(String),
    /// A frame, plane or stack of the wrong shape or with unusable values.
    #[error("frame: {}", Line(.0))]
    Frame(String),
    /// A setting or an argument that cannot be meant or planned for: a distance, a size, a parameter.
    #[error("{}", Line(.0))]
    Setting(String),
    /// An ONNX file that is not a hologram network.
    #[error("network: {}", Line(.0))]
    Network(String),
    /// A call that a session cannot answer in its mode or state.
    #[error("session: {}", Line(.0))]
    Session(String),
    /// Threads of a session that the system does not start.
    #[error("session: its threads cannot be started: {}", Line(&.0.to_string()))]
    Threads(#[source] Arc<dyn std::error::Error + Send + Sync>),
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
    #[error("{}", Line(.0))]
    Lost(String),
    /// A panic inside; a fault of this library. The frame is lost, the session goes on.
    #[error("internal error: {}; please report it", Line(.0))]
    Internal(String),
}

/// The core's result.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// The same of one part of what was given, which `part` names.
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

/// Characters of a message that are shown at its beginning and at its end, which says what would be right.
const BEGINNING: usize = 350;
const END: usize = 200;

/// A message on one line: control characters escaped, the middle left out where it is too long.
pub struct Line<'a>(pub &'a str);

impl Display for Line<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let count = self.0.chars().count();
        let cut = count > BEGINNING + END;
        for (i, character) in self.0.chars().enumerate() {
            match character {
                _ if cut && i == BEGINNING => f.write_str(" … ")?,
                _ if cut && i > BEGINNING && i < count - END => {}
                // Marks that turn the direction of what follows are not control characters by name.
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
