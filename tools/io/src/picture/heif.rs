//! Photos in HEIF containers, such as the HEIC of phones, decoded by libheif's installed program: `heif-dec`, which was
//! called `heif-convert` before libheif 1.19. It turns pictures upright, keeps their colour profile, and writes the
//! depth that portraits hold as an auxiliary picture.

use crate::input::decode::{self, Reading};
use crate::input::{self, MOST_PICTURE};
use crate::picture::colours::{self, Colours};
use crate::picture::depth_map;
use crate::{Error, Result};
use ndarray::Array2;
use phasefront::input::RgbEncoding;
use std::ffi::OsStr;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

/// The names of the program, newest first.
const PROGRAMS: [&str; 2] = ["heif-dec", "heif-convert"];
const MISSING: &str = "is HEIC, which needs libheif's program heif-dec or heif-convert, and neither is installed: it is in the package libheif-examples of Debian and Ubuntu, libheif-tools of Fedora, libheif of Homebrew and MSYS2";

/// Checks whether the file at `path` is HEIC.
///
/// # Errors
/// Returns an error if the file cannot be opened.
pub(crate) fn is(path: &Path) -> Result<bool> {
    let mut head = Vec::new();
    let read = input::open(path, MOST_PICTURE)?.take(16).read_to_end(&mut head);
    read.map_err(|e| Error::file(path, format!("cannot be read: {e}")))?;
    Ok(decode::is_heic(&head))
}

/// Pictures of a HEIC file, as PNG in a folder of their own.
pub(crate) struct Decoded {
    folder: TempDir,
    path: PathBuf,
}

/// Decodes the HEIC file at `path`.
///
/// # Errors
/// Returns an error if the program is not installed or refuses the file.
pub(crate) fn decode(path: &Path) -> Result<Decoded> {
    let refuse = |why: String| Error::file(path, why);
    // The program must not take the name for an option.
    let input = std::path::absolute(path).map_err(|e| refuse(format!("cannot be read: {e}")))?;
    let folder = tempfile::tempdir().map_err(|e| refuse(format!("no folder for its pictures can be made: {e}")))?;
    let output = folder.path().join("photo.png");
    for program in PROGRAMS {
        let arguments: [&OsStr; 3] = ["--with-aux".as_ref(), input.as_os_str(), output.as_os_str()];
        let run = Command::new(program).args(arguments).stdin(Stdio::null()).output();
        match run {
            Ok(Output { status, .. }) if status.success() => {
                let path = path.to_owned();
                return Ok(Decoded { folder, path });
            }
            Ok(Output { stderr, .. }) => {
                let said = String::from_utf8_lossy(&stderr);
                let last = said
                    .lines()
                    .rfind(|line| !line.trim().is_empty())
                    .unwrap_or("it says nothing");
                return Err(refuse(format!("is no whole picture: {program} says: {}", last.trim())));
            }
            Err(why) if why.kind() == ErrorKind::NotFound => {}
            Err(why) => return Err(refuse(format!("{program} cannot be run: {why}"))),
        }
    }
    Err(refuse(MISSING.into()))
}

impl Decoded {
    /// Returns the first of the file's pictures, or the auxiliary picture of it that `ending` names.
    fn picture(&self, ending: &str) -> Option<PathBuf> {
        let names = ["photo", "photo-1"].map(|name| self.folder.path().join(format!("{name}{ending}.png")));
        names.into_iter().find(|path| path.is_file())
    }

    /// Returns the photo, upright. Its colours mean `asked` or what the file says.
    ///
    /// # Errors
    /// Returns an error if the program wrote no picture that can be read.
    pub(crate) fn colours(&self, asked: Option<RgbEncoding>) -> Result<Colours> {
        let refuse = |why: String| Error::file(&self.path, why);
        let picture = self.picture("").ok_or_else(|| refuse("holds no picture".into()))?;
        let bytes = input::bytes(&picture, MOST_PICTURE)?;
        // The program has turned the picture, whatever the Exif data say that it copies.
        let (image, _) = decode::picture_of(&bytes, Reading::AS_STORED).map_err(refuse)?;
        colours::of_bytes(image, &bytes, &self.path.display().to_string(), asked).map_err(refuse)
    }

    /// Returns the levels of a portrait's depth, (h, w) in 0..=1, or `None` if the file holds none.
    ///
    /// # Errors
    /// Returns an error if it is no depth map.
    pub(crate) fn depth(&self) -> Result<Option<Array2<f32>>> {
        let Some(depth) = self.picture("-depth") else {
            return Ok(None);
        };
        let read = depth_map::read_depth(&depth, true);
        let read = read.map_err(|e| Error::file(&self.path, format!("its depth is not read: {e}")))?;
        Ok(Some(read))
    }
}
