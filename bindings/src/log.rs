//! Log messages of the library, to whoever listens: the packages pass them on to the platform's log.

use crate::error::{ListenerError, PhasefrontError, guard};
use log::{Level, LevelFilter, Log, Metadata, Record};
use phasefront_core::runtime::caught::caught;
use std::cell::Cell;
use std::sync::{Arc, PoisonError, RwLock};

/// How much a message matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, uniffi::Enum)]
pub enum LogLevel {
    /// What went wrong.
    Error,
    /// What looks wrong.
    Warning,
    /// What is done.
    Info,
    /// Details.
    Debug,
}

/// Hears log messages, on any thread. It may call the library, but where a session computes on its thread it cannot
/// wait for a frame: `process`, `warm_up` and previews are refused there, and closing does not wait. What it throws is
/// ignored.
#[uniffi::export(foreign)]
pub trait LogListener: Send + Sync {
    /// One message.
    fn on_log(&self, level: LogLevel, message: String) -> Result<(), ListenerError>;
}

struct Forward(RwLock<Option<Arc<dyn LogListener>>>);

static FORWARD: Forward = Forward(RwLock::new(None));

thread_local! {
    /// Whether this thread's listener is at work: what it causes to be logged is not told to it.
    static TELLING: Cell<bool> = const { Cell::new(false) };
}

/// Ends the listener's work on this thread, also where it panicked.
struct Telling;

impl Drop for Telling {
    fn drop(&mut self) {
        TELLING.set(false);
    }
}

/// Sends messages of `level` and above to `listener`; none for silence. Of the libraries underneath, warnings and
/// errors are sent.
///
/// # Errors
/// A process that already logs elsewhere.
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
        // Not under the lock: what ends with the listener may call the library, which logs.
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
            // There is nobody to tell that telling failed.
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

    /// Panics at one message, and logs when it ends.
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

    /// Panics as it ends.
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

    /// All in one test: there is one listener a process.
    #[test]
    fn a_listener_that_throws_panics_or_logs_as_it_ends_is_told_of_the_next_message() {
        let (sender, told) = channel();
        let messages = ["panic", "panic twice", "error", "next"];
        set_log_listener(LogLevel::Info, Some(Arc::new(Unruly(sender.clone())))).unwrap();
        messages.iter().for_each(|message| log::info!("{message}"));
        // A second thread, so that a deadlock is a failure and not a test without end.
        let replaced = std::thread::spawn(move || set_log_listener(LogLevel::Info, Some(Arc::new(Unruly(sender)))));
        let told: Vec<_> = (0..5)
            .map(|_| told.recv_timeout(std::time::Duration::from_secs(60)).unwrap())
            .collect();
        replaced.join().unwrap().unwrap();
        assert_eq!(told, [&messages[..], &["the end"]].concat());
        set_log_listener(LogLevel::Info, None).unwrap();
    }
}
