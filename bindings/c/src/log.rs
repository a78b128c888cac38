//! Log messages of the library.

use crate::pointer::pick;
use crate::status::{PfStatus, c_text, call};
use phasefront_ffi::{ListenerError, LogLevel, LogListener, set_log_listener};
use std::ffi::{c_char, c_void};
use std::sync::Arc;

/// The severity of a log message.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfLogLevel {
    /// An error.
    Error = 0,
    /// Something that may be wrong.
    Warning = 1,
    /// An action of the library.
    Info = 2,
    /// Details.
    Debug = 3,
}

const LEVELS: [LogLevel; 4] = [LogLevel::Error, LogLevel::Warning, LogLevel::Info, LogLevel::Debug];

/// A receiver of log messages, which is called on any thread. The message is valid during the call. The receiver may
/// call the library. On a thread that computes for a session it cannot wait for a frame: pf_session_process,
/// pf_session_warm_up and pf_hologram_refocus are refused.
pub type PfOnLog = Option<unsafe extern "C" fn(context: *mut c_void, level: PfLogLevel, message: *const c_char)>;

struct Listener {
    context: *mut c_void,
    on_log: unsafe extern "C" fn(*mut c_void, PfLogLevel, *const c_char),
}

// SAFETY: the caller of pf_set_log_listener promises that the context may be used on any thread.
unsafe impl Send for Listener {}
// SAFETY: the same.
unsafe impl Sync for Listener {}

impl LogListener for Listener {
    fn on_log(&self, level: LogLevel, message: String) -> Result<(), ListenerError> {
        let level = match level {
            LogLevel::Error => PfLogLevel::Error,
            LogLevel::Warning => PfLogLevel::Warning,
            LogLevel::Info => PfLogLevel::Info,
            LogLevel::Debug => PfLogLevel::Debug,
        };
        let message = c_text(&message);
        // SAFETY: the listener's own call, with its context; the message lives until it returns.
        unsafe { (self.on_log)(self.context, level, message.as_ptr()) };
        Ok(())
    }
}

/// Sends messages of `level`, a PfLogLevel, and above to `on_log`. With NULL, no messages are sent. A call on another
/// thread that is in progress when this returns still uses the previous `context`, so each context must live as long as
/// the process.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_set_log_listener(level: u32, on_log: PfOnLog, context: *mut c_void) -> PfStatus {
    call(|| {
        let listener = on_log.map(|on_log| Arc::new(Listener { context, on_log }) as Arc<_>);
        set_log_listener(pick(&LEVELS, level, "level")?, listener)
    })
}
