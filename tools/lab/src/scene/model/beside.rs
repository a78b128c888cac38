//! Reads the files that a model names. Because a model may come from an untrusted source, it reads only regular files
//! of the model's own folder, and only up to the limits of a model.

use crate::scene::model::part::MAX_MODEL_BYTES;
use image::DynamicImage;
use phasefront_core::runtime::file;
use phasefront_io::input::decode::{self, Reading};
use phasefront_io::output;
use std::path::{Path, PathBuf};

type Result<T> = std::result::Result<T, String>;

/// The most texels of a model's pictures: a gigabyte.
const MAX_TEXELS: usize = 1 << 28;

/// The folder of a model.
pub(super) struct Beside {
    folder: PathBuf,
    /// The bytes that may still be read.
    left: u64,
    /// The texels that pictures may still have.
    texels_left: usize,
}

impl Beside {
    /// Opens the folder of the model at `path`.
    pub(super) fn new(path: &Path) -> Result<Self> {
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        Ok(Self {
            folder: folder.canonicalize().map_err(|e| format!("its folder: {e}"))?,
            left: MAX_MODEL_BYTES,
            texels_left: MAX_TEXELS,
        })
    }

    /// Reads the file `name`. Returns `None` if it does not exist.
    pub(super) fn read_if_there(&mut self, name: &str) -> Result<Option<Vec<u8>>> {
        let path = match self.folder.join(name).canonicalize() {
            Ok(path) => path,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(format!("{name}: {e}")),
        };
        if !path.starts_with(&self.folder) {
            return Err(format!("{name} lies outside the model's folder; put it there"));
        }
        let about = path.metadata().map_err(|e| format!("{name}: {e}"))?;
        if !about.is_file() {
            return Err(format!("{name} is no regular file"));
        }
        output::reading(&path).map_err(|e| e.to_string())?;
        self.left = (self.left.checked_sub(about.len()))
            .ok_or_else(|| format!("with {name} it names files of over {MAX_MODEL_BYTES} bytes in all"))?;
        file::read(&path, about.len())
            .map(Some)
            .map_err(|e| format!("{name}: {e}"))
    }

    /// Reads the file `name`.
    pub(super) fn read(&mut self, name: &str) -> Result<Vec<u8>> {
        self.read_if_there(name)?
            .ok_or_else(|| format!("{name}: there is no such file"))
    }

    /// Decodes a picture to its width, height and RGBA texels, as stored. Of 16-bit values it keeps the upper 8 bits.
    pub(super) fn texels(&mut self, bytes: &[u8]) -> Result<(usize, usize, Vec<[u8; 4]>)> {
        let image = decode::picture_of(bytes, Reading::AS_STORED)?.0;
        let (width, height) = (image.width() as usize, image.height() as usize);
        self.texels_left = (self.texels_left.checked_sub(width * height)).ok_or_else(|| {
            format!("pictures of over {MAX_TEXELS} pixels in all, each counted for each colouring of it")
        })?;
        let texels = match image {
            DynamicImage::ImageLuma16(_)
            | DynamicImage::ImageLumaA16(_)
            | DynamicImage::ImageRgb16(_)
            | DynamicImage::ImageRgba16(_) => {
                let image = image.into_rgba16();
                image.pixels().map(|pixel| pixel.0.map(|v| (v >> 8) as u8)).collect()
            }
            image => image.into_rgba8().pixels().map(|pixel| pixel.0).collect(),
        };
        Ok((width, height, texels))
    }
}
