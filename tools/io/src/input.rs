//! Reading of files. All input is opened here or in [`decode`], which accept only regular files up to a maximum size.

pub(crate) mod anymap;
pub mod decode;
mod jpeg;
pub(crate) mod jpeg_end;
pub mod npy;
pub(crate) mod npz;
pub(crate) mod openexr;
pub mod quiet;

use crate::{Error, Result, output};
use phasefront_core::runtime::file;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// The maximum size of a picture in bytes: a photograph of 200 megapixels without compression.
pub(crate) const MOST_PICTURE: u64 = 1 << 31;
/// The maximum size of arrays, tables and pages in bytes: a complex hologram of 2²⁶ pixels and three colours.
pub const MOST_ARRAY: u64 = 1 << 31;
/// The maximum size in bytes of a photo with embedded depth.
pub(crate) const MOST_PHOTO: u64 = 1 << 28;
/// The maximum size of a depth network in bytes, which is the limit of a protobuf message.
pub const MOST_DEPTH_NETWORK: u64 = 1 << 31;

/// Opens a regular file of at most `most` bytes.
///
/// # Errors
/// Returns an error if the file is an output of this command, is missing, is not regular, or is larger.
pub(crate) fn open(path: &Path, most: u64) -> Result<BufReader<File>> {
    output::reading(path)?;
    (file::open(path, most).map(BufReader::new)).map_err(|e| unread(path, &e))
}

/// Reads a regular file of at most `most` bytes.
///
/// # Errors
/// Returns the errors of `open`.
pub fn bytes(path: &Path, most: u64) -> Result<Vec<u8>> {
    output::reading(path)?;
    file::read(path, most).map_err(|e| unread(path, &e))
}

/// Reads the text of a regular file of at most 16 MiB.
///
/// # Errors
/// Returns the errors of `open`, and an error if the text is not UTF-8.
pub fn text(path: &Path) -> Result<String> {
    output::reading(path)?;
    file::read_text(path).map_err(|e| unread(path, &e))
}

fn unread(path: &Path, why: &std::io::Error) -> Error {
    Error::file(path, format!("cannot be read: {why}"))
}

/// Reads a regular file of at most 2 GiB.
///
/// # Errors
/// Returns an error if the file is an output of this command, is missing, is not regular, or is larger.
pub fn read_file(path: &Path) -> Result<Vec<u8>> {
    bytes(path, MOST_ARRAY)
}
