//! Bounded reading of files. Only regular files up to a maximum size are opened, because a path from outside may lead
//! to an endless device, a blocking pipe, or a file larger than memory.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// The maximum size of a network file, in bytes.
pub const MOST_NETWORK: u64 = 1 << 28;
/// The maximum size of a depth network's file, in bytes.
pub const MOST_DEPTH_NETWORK: u64 = 1 << 31;
/// The maximum size of a calibration file, in bytes. It fits the tables of the largest modulator.
pub const MOST_TARGET: u64 = 1 << 30;
/// The maximum size of a text file written by hand, such as a display's TOML, in bytes.
pub const MOST_TEXT: u64 = 1 << 24;

/// Opens a regular file of at most `most` bytes.
///
/// # Errors
/// Returns an error if the system does, the file is not regular, or the file is larger.
pub fn open(path: &Path, most: u64) -> Result<File> {
    // The check precedes the opening because opening a pipe waits for its writer.
    check(&std::fs::metadata(path)?, most)?;
    let file = File::open(path)?;
    // The opened file is checked again because the name may lead elsewhere now.
    check(&file.metadata()?, most)?;
    Ok(file)
}

fn check(about: &std::fs::Metadata, most: u64) -> Result<()> {
    if !about.is_file() {
        return Err(Error::new(ErrorKind::InvalidInput, "it is not a regular file"));
    }
    if about.len() > most {
        return Err(too_large(&about.len().to_string(), most));
    }
    Ok(())
}

fn too_large(bytes: &str, most: u64) -> Error {
    Error::new(
        ErrorKind::InvalidInput,
        format!("it has {bytes} bytes; {most} are the most"),
    )
}

/// Reads a regular file of at most `most` bytes.
///
/// # Errors
/// Returns an error if [`open`] does, or if the file grows too large during the read.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>> {
    let file = open(path, most)?;
    let mut bytes = Vec::with_capacity(file.metadata()?.len() as usize);
    // Files in `/proc` report a length of 0, and other files may still grow.
    file.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        return Err(too_large(&format!("over {most}"), most));
    }
    Ok(bytes)
}

/// Reads the text of a regular file of at most [`MOST_TEXT`] bytes: UTF-8, or UTF-16 with a byte-order mark. The mark
/// is left out.
///
/// # Errors
/// Returns an error if [`open`] does, if the file grows too large during the read, or if the bytes are not text.
pub fn read_text(path: &Path) -> Result<String> {
    text(read(path, MOST_TEXT)?).ok_or_else(|| Error::new(ErrorKind::InvalidData, "it is not text in UTF-8"))
}

/// Decodes text. Programs on Windows begin it with a byte-order mark.
fn text(bytes: Vec<u8>) -> Option<String> {
    let wide = |of: fn([u8; 2]) -> u16| {
        let (words, []) = bytes[2..].as_chunks::<2>() else {
            return None;
        };
        String::from_utf16(&words.iter().map(|word| of(*word)).collect::<Vec<_>>()).ok()
    };
    match &bytes[..] {
        [0xef, 0xbb, 0xbf, text @ ..] => String::from_utf8(text.to_vec()).ok(),
        [0xff, 0xfe, ..] => wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => wide(u16::from_be_bytes),
        _ => String::from_utf8(bytes).ok(),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Returns a path in the temporary folder that no other process uses.
    fn place(name: &str) -> std::path::PathBuf {
        std::env::temp_dir().join(format!("phasefront-file-{}-{name}", std::process::id()))
    }

    #[test]
    fn only_regular_files_up_to_a_size_are_read() {
        let path = place("four");
        std::fs::write(&path, b"four").unwrap();
        assert_eq!(read(&path, 4).unwrap(), b"four");
        assert_eq!(read_text(&path).unwrap(), "four");
        let why = read(&path, 3).unwrap_err().to_string();
        assert_eq!(why, "it has 4 bytes; 3 are the most");
        for marked in [
            &b"\xef\xbb\xbfh\xc3\xa9"[..],
            b"\xff\xfeh\0\xe9\0",
            b"\xfe\xff\0h\0\xe9",
        ] {
            std::fs::write(&path, marked).unwrap();
            assert_eq!(read_text(&path).unwrap(), "hé");
        }
        std::fs::write(&path, b"\xff\xfeh").unwrap();
        assert!(read_text(&path).is_err());
        std::fs::write(&path, b"\xff").unwrap();
        assert!(read_text(&path).unwrap_err().to_string().contains("UTF-8"));
        std::fs::remove_file(&path).unwrap();
        assert!(read(&path, 4).is_err());
        let why = read(&std::env::temp_dir(), 4).unwrap_err().to_string();
        assert!(why.contains("not a regular file"), "{why}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn devices_and_files_without_a_length_are_bounded() {
        let why = read(Path::new("/dev/zero"), 4).unwrap_err().to_string();
        assert!(why.contains("not a regular file"), "{why}");
        // The file reports a length of 0.
        let why = read(Path::new("/proc/cpuinfo"), 4).unwrap_err().to_string();
        assert_eq!(why, "it has over 4 bytes; 4 are the most");
    }
}
