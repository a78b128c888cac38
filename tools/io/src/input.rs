//! Files that are read. All reading begins here or in [`decode`], which open only regular files, and only up to a size.

pub mod decode;
pub mod npy;
pub mod quiet;

use crate::{Error, Result, output};
use phasefront_core::runtime::file;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Most bytes of a picture: a photograph of 200 megapixels without compression.
pub(crate) const MOST_PICTURE: u64 = 1 << 31;
/// Most bytes of arrays, tables and pages: a complex hologram of 2²⁶ pixels and three colours.
pub const MOST_ARRAY: u64 = 1 << 31;
/// Most bytes of a photo with depth inside.
pub(crate) const MOST_PHOTO: u64 = 1 << 28;
/// Most bytes of a depth network: what a message of protobuf can have.
pub const MOST_DEPTH_NETWORK: u64 = 1 << 31;

/// Opens a regular file of at most `most` bytes.
///
/// # Errors
/// An output of this command; a file that is missing, not regular or larger.
pub(crate) fn open(path: &Path, most: u64) -> Result<BufReader<File>> {
    output::reading(path)?;
    (file::open(path, most).map(BufReader::new)).map_err(|e| unread(path, &e))
}

/// The bytes of a regular file of at most `most` bytes.
///
/// # Errors
/// As `open`.
pub fn bytes(path: &Path, most: u64) -> Result<Vec<u8>> {
    output::reading(path)?;
    file::read(path, most).map_err(|e| unread(path, &e))
}

/// The text of a regular file of at most 16 MiB.
///
/// # Errors
/// As `open`; bytes that are not UTF-8.
pub fn text(path: &Path) -> Result<String> {
    output::reading(path)?;
    file::read_text(path).map_err(|e| unread(path, &e))
}

fn unread(path: &Path, why: &std::io::Error) -> Error {
    Error::file(path, format!("cannot be read: {why}"))
}

/// The bytes of a regular file of at most 2 GiB.
///
/// # Errors
/// An output of this command; a file that is missing, not regular or larger.
pub fn read_file(path: &Path) -> Result<Vec<u8>> {
    bytes(path, MOST_ARRAY)
}
