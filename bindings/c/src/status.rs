//! The result of a call: a number, and one line about what went wrong.

use phasefront_ffi::{PhasefrontError, guard};
use std::cell::RefCell;
use std::ffi::{CString, c_char};

/// The result of a call.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfStatus {
    /// The call succeeded.
    Ok = 0,
    /// The physics of a display is impossible or out of range.
    Display = 1,
    /// A frame, plane or image has the wrong shape or unusable values.
    Frame = 2,
    /// A frame is not later than the previous one. It is refused; later frames are not affected.
    Timestamp = 3,
    /// A setting or an argument is invalid or cannot be planned.
    Setting = 4,
    /// A file is not a hologram network, or the network is for another display.
    Network = 5,
    /// A file cannot be read.
    File = 6,
    /// A session cannot answer the call in its mode or state.
    Session = 7,
    /// Phasefront has a bug. The call had no effect, or the frame is lost. Please report it.
    Internal = 8,
}

pub(crate) type Result<T> = std::result::Result<T, PhasefrontError>;

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Returns the status of `body`, and keeps its message for [`pf_last_error`].
pub(crate) fn call(body: impl FnOnce() -> Result<()>) -> PfStatus {
    let Err(error) = guard(body) else {
        return PfStatus::Ok;
    };
    LAST.set(c_text(&error.to_string()));
    match error {
        PhasefrontError::Display(_) => PfStatus::Display,
        PhasefrontError::Frame(_) => PfStatus::Frame,
        PhasefrontError::Timestamp(_) => PfStatus::Timestamp,
        PhasefrontError::Setting(_) => PfStatus::Setting,
        PhasefrontError::Network(_) => PfStatus::Network,
        PhasefrontError::File(_) => PfStatus::File,
        PhasefrontError::Session(_) => PfStatus::Session,
        PhasefrontError::Internal(_) => PfStatus::Internal,
    }
}

/// Converts `text` for C. Spaces replace zeros in it, which would end it early.
pub(crate) fn c_text(text: &str) -> CString {
    CString::new(text.replace('\0', " ")).unwrap_or_default()
}

/// Returns one line about the last call of this thread that did not return PF_STATUS_OK; an empty line if there was
/// none. It is valid until the next such call of this thread.
#[unsafe(no_mangle)]
pub extern "C" fn pf_last_error() -> *const c_char {
    LAST.with_borrow(|text| text.as_ptr())
}

/// Returns the version of the library, such as "0.1.0". It is always valid.
#[unsafe(no_mangle)]
pub extern "C" fn pf_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    VERSION.as_ptr().cast()
}

/// Returns the third-party notices of the library as Markdown in UTF-8. An app must show them with its own notices.
/// They are always valid.
#[unsafe(no_mangle)]
pub extern "C" fn pf_third_party_notices() -> *const c_char {
    const NOTICES: &str = concat!(include_str!("../../../ios/Sources/PhasefrontCore/THIRD-PARTY.md"), "\0");
    NOTICES.as_ptr().cast()
}
