//! What a call gives: a number, and one line about what went wrong.

use phasefront_ffi::{PhasefrontError, guard};
use std::cell::RefCell;
use std::ffi::{CString, c_char};

/// Whether a call did what it says, and else why not.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfStatus {
    /// It did.
    Ok = 0,
    /// A display whose physics is impossible or out of range.
    Display = 1,
    /// A frame, plane or image of the wrong shape or with unusable values.
    Frame = 2,
    /// A frame that is not later than the last one. It is refused; what follows is not harmed.
    Timestamp = 3,
    /// A setting or an argument that cannot be meant or planned for.
    Setting = 4,
    /// What is not a hologram network, or one for another display.
    Network = 5,
    /// A file that cannot be read.
    File = 6,
    /// A call that a session cannot answer in its mode or state.
    Session = 7,
    /// A fault of Phasefront. The call had no effect, or the frame is lost; please report it.
    Internal = 8,
}

pub(crate) type Result<T> = std::result::Result<T, PhasefrontError>;

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// The status of `body`, its message kept for [`pf_last_error`].
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

/// `text` for C; a zero in it would end it early.
pub(crate) fn c_text(text: &str) -> CString {
    CString::new(text.replace('\0', " ")).unwrap_or_default()
}

/// What was wrong with the last call of this thread that was not PF_STATUS_OK, one line; empty before the first. Valid
/// until the next such call of this thread.
#[unsafe(no_mangle)]
pub extern "C" fn pf_last_error() -> *const c_char {
    LAST.with_borrow(|text| text.as_ptr())
}

/// The version of the library, as "0.1.0". Valid for ever.
#[unsafe(no_mangle)]
pub extern "C" fn pf_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    VERSION.as_ptr().cast()
}
