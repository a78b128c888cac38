//! Pictures for the surfaces of random scenes, from a folder of the user.

use crate::scene::Texture;
use phasefront::Size;
use phasefront_io::dice::Dice;
use phasefront_io::fingerprint::Fingerprint;
use phasefront_io::{Error, Result, output, picture};
use std::path::Path;

/// The file extensions of pictures.
const EXTENSIONS: [&str; 3] = ["jpg", "jpeg", "png"];

/// Reads the pictures (.jpg, .jpeg, .png) in `folder`, in the order of their names.
///
/// # Errors
/// Returns an error if the folder has no pictures or a picture cannot be read.
pub fn read_photographs(folder: &Path) -> Result<Vec<Texture>> {
    let entries = std::fs::read_dir(folder).map_err(|e| Error::file(folder, e))?;
    let mut paths = entries
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<std::io::Result<Vec<_>>>()
        .map_err(|e| Error::file(folder, e))?;
    paths.retain(|path| EXTENSIONS.iter().any(|e| output::has_extension(path, e)));
    paths.sort();
    if paths.is_empty() {
        return Err(Error::file(folder, "holds no .jpg, .jpeg or .png file"));
    }
    let read = |path: &std::path::PathBuf| {
        let (size, rgb) = picture::read_rgb_bytes(path)?;
        let texels = rgb.chunks_exact(3).map(|p| [p[0], p[1], p[2], 255]);
        Texture::new(size, texels.collect())
    };
    paths.iter().map(read).collect()
}

/// Returns a random piece of `photograph` as a texture of `size`. Each texel is the mean of a square of the photograph,
/// of a random side up to the largest that fits.
pub(super) fn piece(photograph: &Texture, size: Size, dice: &mut Dice) -> Texture {
    let (width, height) = (photograph.width(), photograph.height());
    let largest = (width / size.width).min(height / size.height).max(1);
    let square = dice.integer(1, largest);
    let corner = |dice: &mut Dice, whole: usize, part: usize| dice.integer(0, whole.saturating_sub(part * square));
    let (left, top) = (corner(dice, width, size.width), corner(dice, height, size.height));
    let mean = |x: usize, y: usize| {
        let mut sum = [0u32; 3];
        for (j, i) in (0..square).flat_map(|j| (0..square).map(move |i| (j, i))) {
            let row = (top + y * square + j) % height;
            let texel = photograph.texels()[row * width + (left + x * square + i) % width];
            (0..3).for_each(|c| sum[c] += u32::from(texel[c]));
        }
        let count = (square * square) as u32;
        let [r, g, b] = sum.map(|sum| ((sum + count / 2) / count) as u8);
        [r, g, b, 255]
    };
    let texels = (0..size.pixels()).map(|index| mean(index % size.width, index / size.width));
    Texture::sized(size, texels.collect())
}

/// Computes FNV-1a over sizes and texels, by which a data set identifies its photographs.
pub fn fingerprint(photographs: &[Texture]) -> u64 {
    let mut hash = Fingerprint::default();
    for photograph in photographs {
        hash.numbers(&[photograph.width(), photograph.height()]);
        hash.bytes(photograph.texels().as_flattened());
    }
    hash.value()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn pictures_are_read_by_name_and_known_again() {
        let folder = tempfile::tempdir().unwrap();
        for (name, grey) in [("b.png", 9), ("a.PNG", 200)] {
            picture::write_rgba(&folder.path().join(name), Size { width: 3, height: 2 }, &[grey; 24]).unwrap();
        }
        std::fs::write(folder.path().join("LICENCE.txt"), "free").unwrap();
        let photographs = read_photographs(folder.path()).unwrap();
        assert_eq!(photographs.len(), 2);
        assert_eq!(photographs[0].texels()[5][..3], [200; 3]);
        assert_eq!((photographs[1].width(), photographs[1].height()), (3, 2));
        let turned = [photographs[1].clone(), photographs[0].clone()];
        assert_ne!(fingerprint(&photographs), fingerprint(&turned));
        assert_eq!(fingerprint(&photographs), fingerprint(&photographs.clone()));
    }

    #[test]
    fn a_folder_without_whole_pictures_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let refusal = |text: &str| {
            let error = read_photographs(folder.path()).unwrap_err().to_string();
            assert!(error.contains(text), "{error}");
        };
        refusal("holds no .jpg");
        std::fs::write(folder.path().join("cut.jpg"), "no picture").unwrap();
        refusal("cut.jpg");
    }
}
