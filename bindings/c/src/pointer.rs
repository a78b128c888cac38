//! Access to memory that C points at. Pointers are checked as far as possible.

use crate::status::Result;
use phasefront_ffi::{PhasefrontError, guard};
use std::ffi::{CStr, c_char};

fn null(name: &str) -> PhasefrontError {
    PhasefrontError::Setting(format!("{name} is NULL; point it at what the call takes"))
}

/// Returns the value that `pointer` points at.
///
/// # Safety
/// It is NULL, or valid for reads as long as `'a`.
pub(crate) unsafe fn read<'a, T>(pointer: *const T, name: &str) -> Result<&'a T> {
    // SAFETY: the caller's promise.
    unsafe { pointer.as_ref() }.ok_or_else(|| null(name))
}

/// A struct that later versions may extend.
///
/// # Safety
/// Its first field is its size in bytes, a `usize`, which the caller sets.
pub(crate) unsafe trait Extensible {
    /// The name in C.
    const NAME: &'static str;
}

/// Checks that `pointer` points at a struct of this version's size.
///
/// # Safety
/// It is NULL, or valid for reads of its size.
unsafe fn check_size<T: Extensible>(pointer: *const T, name: &str) -> Result<()> {
    // SAFETY: the caller's promise, and that of the trait.
    let size = *unsafe { read(pointer.cast::<usize>(), name) }?;
    if size == size_of::<T>() {
        return Ok(());
    }
    let (of, right) = (T::NAME, size_of::<T>());
    Err(PhasefrontError::Setting(format!(
        "{name}->size is {size}; it is sizeof({of}), {right}"
    )))
}

/// Returns the struct that `pointer` points at.
///
/// # Safety
/// It is NULL, or valid for reads as long as `'a`.
pub(crate) unsafe fn read_sized<'a, T: Extensible>(pointer: *const T, name: &str) -> Result<&'a T> {
    // SAFETY: the caller's promise.
    unsafe {
        check_size(pointer, name)?;
        read(pointer, name)
    }
}

/// Writes the result of `make` to the struct `to`, whose size the caller has set.
///
/// # Safety
/// `to` is NULL, or valid for a write and for a read of its size.
pub(crate) unsafe fn give_sized<T: Extensible>(to: *mut T, name: &str, make: impl FnOnce() -> Result<T>) -> Result<()> {
    // SAFETY: the caller's promise.
    unsafe {
        check_size(to, name)?;
        give(to, name, make)
    }
}

/// Returns the value that `pointer` points at, to be changed.
///
/// # Safety
/// It is NULL, or valid for reads and writes as long as `'a`, and nobody else uses it.
pub(crate) unsafe fn change<'a, T>(pointer: *mut T, name: &str) -> Result<&'a mut T> {
    // SAFETY: the caller's promise.
    unsafe { pointer.as_mut() }.ok_or_else(|| null(name))
}

/// Writes the result of `make` to `to`. If `to` is NULL, `make` is not called.
///
/// # Safety
/// `to` is NULL, or valid for a write. Its memory need not be initialized.
pub(crate) unsafe fn give<T>(to: *mut T, name: &str, make: impl FnOnce() -> Result<T>) -> Result<()> {
    if to.is_null() {
        return Err(null(name));
    }
    let value = make()?;
    // SAFETY: the caller's promise.
    unsafe { to.write(value) };
    Ok(())
}

/// Creates an object that belongs to the caller until [`free`].
pub(crate) fn object<T>(value: T) -> *mut T {
    Box::into_raw(Box::new(value))
}

/// Frees an object.
///
/// # Safety
/// It is NULL, or was created by [`object`] and not freed before.
pub(crate) unsafe fn free<T>(pointer: *mut T) {
    if !pointer.is_null() {
        // SAFETY: the caller's promise. A panic of its destructor ends here.
        let value = unsafe { Box::from_raw(pointer) };
        let _ = guard(|| {
            drop(value);
            Ok(())
        });
    }
}

/// Returns the bytes at `data`; none if it is NULL and there are none.
///
/// # Safety
/// It is NULL, or valid for `length` bytes as long as `'a`.
pub(crate) unsafe fn bytes<'a>(data: *const u8, length: usize, name: &str) -> Result<&'a [u8]> {
    match (data.is_null(), length) {
        (true, 0) => Ok(&[]),
        (true, _) => Err(null(name)),
        (false, _) if isize::try_from(length).is_err() => Err(PhasefrontError::Setting(format!(
            "{name} has {length} bytes, more than there can be"
        ))),
        // SAFETY: the caller's promise.
        (false, _) => Ok(unsafe { std::slice::from_raw_parts(data, length) }),
    }
}

/// Returns the text at `text`.
///
/// # Safety
/// It is NULL, or points at bytes that end with a zero and live as long as `'a`.
pub(crate) unsafe fn text<'a>(text: *const c_char, name: &str) -> Result<&'a str> {
    if text.is_null() {
        return Err(null(name));
    }
    // SAFETY: the caller's promise.
    unsafe { CStr::from_ptr(text) }
        .to_str()
        .map_err(|_| PhasefrontError::Setting(format!("{name} is no UTF-8; give it as that")))
}

/// Returns the one of `all` that has `number` in C.
pub(crate) fn pick<T: Copy>(all: &[T], number: u32, name: &str) -> Result<T> {
    all.get(number as usize).copied().ok_or_else(|| {
        PhasefrontError::Setting(format!(
            "{name} is {number}; it is 0 to {}",
            all.len().saturating_sub(1)
        ))
    })
}
