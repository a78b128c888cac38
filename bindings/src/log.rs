//! Log messages of the library. The packages pass them to the platform's log.

use crate::error::{ListenerError, PhasefrontError, guard};
use log::{Level, LevelFilter, Log, Metadata, Record};
use phasefront_core::runtime::caught::caught;
use std::cell::Cell;
use std::sync::{Arc, PoisonError, RwLock};

/// The severity of a log message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum LogLevel {
    /// An error.
    Error,
    /// Something that may be wrong.
    Warning,
    /// An action of the library.
    Info,
    /// Details.
    Debug,
}

/// A receiver of log messages, which is called on any thread. It may call the library. On a thread that computes for a
/// session it cannot wait for a frame: `process`, `warm_up` and previews are refused, and closing does not wait. Errors
/// that it throws are ignored.
#[uniffi::export(foreign)]
pub trait LogListener: Send + Sync {
    /// Receives a message.
    fn on_log(&self, level: LogLevel, message: String) -> Result<(), ListenerError>;
}

struct Forward(RwLock<Option<Arc<dyn LogListener>>>);

static FORWARD: Forward = Forward(RwLock::new(None));

thread_local! {
    /// Whether the listener is running on this thread. It does not receive messages that it causes itself.
    static TELLING: Cell<bool> = const { Cell::new(false) };
}

/// Marks the end of the listener's work on this thread, even after a panic.
struct Telling;

impl Drop for Telling {
    fn drop(&mut self) {
        TELLING.set(false);
    }
}

/// Sends messages of `level` and above to `listener`, and warnings and errors of the libraries that Phasefront uses.
/// Without a listener, no messages are sent.
///
/// # Errors
/// Returns an error if the process already has another logger of Rust's `log`.
#[uniffi::export]
pub fn set_log_listener(level: LogLevel, listener: Option<Arc<dyn LogListener>>) -> Result<(), PhasefrontError> {
    guard(|| {
        let filter = match (&listener, level) {
            (None, _) => LevelFilter::Off,
            (_, LogLevel::Error) => LevelFilter::Error,
            (_, LogLevel::Warning) => LevelFilter::Warn,
            (_, LogLevel::Info) => LevelFilter::Info,
            (_, LogLevel::Debug) => LevelFilter::Debug,
        };
        let before = std::mem::replace(
            &mut *FORWARD.0.write().unwrap_or_else(PoisonError::into_inner),
            listener,
        );
        // Dropping the listener may call the library, which logs, so the lock is released first.
        drop(before);
        let other =
            log::set_logger(&FORWARD).is_err() && !std::ptr::addr_eq(log::logger(), std::ptr::from_ref(&FORWARD));
        if other {
            return Err(PhasefrontError::Setting(
                "this process already has a logger of Rust's `log`; messages go there".into(),
            ));
        }
        log::set_max_level(filter);
        Ok(())
    })
}

impl Log for Forward {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.level() <= Level::Warn || metadata.target().starts_with("phasefront")
    }

    fn log(&self, record: &Record<'_>) {
        if !self.enabled(record.metadata()) || TELLING.replace(true) {
            return;
        }
        let _telling = Telling;
        let listener = self.0.read().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some(listener) = listener {
            let level = match record.level() {
                Level::Error => LogLevel::Error,
                Level::Warn => LogLevel::Warning,
                Level::Info => LogLevel::Info,
                Level::Debug | Level::Trace => LogLevel::Debug,
            };
            // An error of the listener cannot be reported anywhere.
            let message = record.args().to_string();
            let _ = caught(|| listener.on_log(level, message));
        }
    }

    fn flush(&self) {}
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use std::sync::mpsc::{Sender, channel};

    /// Panics at some messages, and logs when it is dropped.
    struct Unruly(Sender<String>);

    impl LogListener for Unruly {
        fn on_log(&self, _: LogLevel, message: String) -> Result<(), ListenerError> {
            self.0.send(message.clone()).unwrap();
            match message.as_str() {
                "panic" => std::panic::resume_unwind(Box::new("no thanks")),
                "panic twice" => std::panic::resume_unwind(Box::new(Bomb)),
                _ => Err(ListenerError::Threw { reason: message }),
            }
        }
    }

    /// Panics when it is dropped.
    struct Bomb;

    impl Drop for Bomb {
        fn drop(&mut self) {
            std::panic::resume_unwind(Box::new(Bomb));
        }
    }

    impl Drop for Unruly {
        fn drop(&mut self) {
            log::info!("the end");
        }
    }

    /// There is one listener per process, so one test covers everything.
    #[test]
    fn a_listener_that_throws_panics_or_logs_as_it_ends_is_told_of_the_next_message() {
        let (sender, told) = channel();
        let messages = ["panic", "panic twice", "error", "next"];
        set_log_listener(LogLevel::Info, Some(Arc::new(Unruly(sender.clone())))).unwrap();
        messages.iter().for_each(|message| log::info!("{message}"));
        // A second thread turns a deadlock into a failure instead of a test that never ends.
        let replaced = std::thread::spawn(move || set_log_listener(LogLevel::Info, Some(Arc::new(Unruly(sender)))));
        let told: Vec<_> = (0..5)
            .map(|_| told.recv_timeout(std::time::Duration::from_secs(60)).unwrap())
            .collect();
        replaced.join().unwrap().unwrap();
        assert_eq!(told, [&messages[..], &["the end"]].concat());
        set_log_listener(LogLevel::Info, None).unwrap();
    }
}
