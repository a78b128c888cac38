//! Log messages of the library, to whoever listens: the packages pass them on to the platform's log.

use crate::error::{PhasefrontError, guard};
use log::{Level, LevelFilter, Log, Metadata, Record};
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

/// Hears log messages, on any thread.
#[uniffi::export(foreign)]
pub trait LogListener: Send + Sync {
    /// One message.
    fn on_log(&self, level: LogLevel, message: String) -> Result<(), PhasefrontError>;
}

struct Forward(RwLock<Option<Arc<dyn LogListener>>>);

static FORWARD: Forward = Forward(RwLock::new(None));

thread_local! {
    /// Whether this thread's listener is at work: what it causes to be logged is not told to it.
    static TELLING: Cell<bool> = const { Cell::new(false) };
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
        *FORWARD.0.write().unwrap_or_else(PoisonError::into_inner) = listener;
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
        let listener = self.0.read().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some(listener) = listener {
            let level = match record.level() {
                Level::Error => LogLevel::Error,
                Level::Warn => LogLevel::Warning,
                Level::Info => LogLevel::Info,
                Level::Debug | Level::Trace => LogLevel::Debug,
            };
            // There is nobody to tell that telling failed.
            let _ = listener.on_log(level, record.args().to_string());
        }
        TELLING.set(false);
    }

    fn flush(&self) {}
}
