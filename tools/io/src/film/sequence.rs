//! Sequences of colour and depth files in the folder layouts of data sets.

use crate::film::video;
use crate::{Error, Result, input, output};
use image::{ImageDecoder, ImageReader};
use phasefront_core::depth::DepthUnit;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The largest time difference between a colour image and its depth image, in seconds. TUM's own tool uses the same
/// value.
const TUM_APART_S: f64 = 0.02;
/// The depth units per metre in the TUM RGB-D benchmark.
const TUM_UNITS_PER_M: f64 = 5000.0;
/// The names of colour folders that may lie beside a folder `depth`.
const COLOUR_FOLDERS: [&str; 3] = ["rgb", "color", "image"];
/// The file extensions of colour and depth. Files with other extensions are ignored.
const IMAGES: [&str; 12] = [
    "png", "jpg", "jpeg", "bmp", "webp", "tif", "tiff", "exr", "npy", "npz", "pgm", "pfm",
];

/// Frames in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Sequence {
    /// The colour and depth files of each frame.
    pub frames: Vec<(PathBuf, PathBuf)>,
    /// The unit of the depth values, if the layout defines it.
    pub unit: Option<DepthUnit>,
}

/// Returns the frames of `dir`: a sequence of the TUM RGB-D benchmark (`rgb.txt`, `depth.txt`), folders `rgb` and
/// `depth` with the file numbers of a Redwood scan or with equal names, or numbered files
/// ([`video::frames_of_folder`]).
///
/// # Errors
/// Returns an error if the folder has none of these layouts.
pub fn of_folder(dir: &Path) -> Result<Sequence> {
    if dir.is_file() {
        return Err(Error::file(
            dir,
            "is neither a folder nor a film of a kind that is read; ffmpeg makes one of it: `ffmpeg -i INPUT film.mp4`",
        ));
    }
    if dir.join("rgb.txt").is_file() && dir.join("depth.txt").is_file() {
        return tum(dir);
    }
    let colour = COLOUR_FOLDERS
        .iter()
        .map(|name| dir.join(name))
        .find(|path| path.is_dir());
    if let Some(colour) = colour
        && dir.join("depth").is_dir()
    {
        return two_folders(&colour, &dir.join("depth"));
    }
    if let Some(why) = other_folders(dir)? {
        return Err(Error::file(dir, why));
    }
    Ok(Sequence {
        frames: video::frames_of_folder(dir)?,
        unit: None,
    })
}

/// Returns advice if `dir` holds folders of pictures with other names, and no pictures beside them.
fn other_folders(dir: &Path) -> Result<Option<String>> {
    let is_image = |path: &PathBuf| IMAGES.iter().any(|ending| output::has_extension(path, ending));
    let mut paths = files_of(dir)?;
    paths.sort();
    let mut patterns = Vec::new();
    for path in &paths {
        if path.is_dir()
            && let Some(image) = files_of(path)?.into_iter().find(is_image)
        {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let ending = image.extension().unwrap_or_default().to_string_lossy().into_owned();
            patterns.push(format!("{name}/*.{ending}"));
        }
    }
    if patterns.len() < 2 || paths.iter().any(is_image) {
        return Ok(None);
    }
    // What is called depth comes last.
    let is_depth = |pattern: &String| {
        ["depth", "disp"]
            .iter()
            .any(|word| pattern.to_lowercase().contains(word))
    };
    patterns.sort_by_key(is_depth);
    Ok(Some(format!(
        "holds folders of other names than rgb, color or image, and depth; --pairs names their files, as --pairs '{},{}'",
        patterns[0],
        patterns[patterns.len() - 1]
    )))
}

/// Returns the frames of `dir` whose names match the patterns `colour` and `depth`, for example `left_*.png` and
/// `left_*_z.png`. Each pattern has one `*`, which stands for the same text in both. Numbers are sorted numerically. A
/// file that matches both patterns belongs to the longer pattern.
///
/// # Errors
/// Returns an error if a pattern is invalid, a file has no partner, or no file matches.
pub fn by_pattern(dir: &Path, colour: &str, depth: &str) -> Result<Sequence> {
    let mut colours = matching(dir, colour)?;
    let mut depths = matching(dir, depth)?;
    let (longer, shorter) = if colour.len() > depth.len() {
        (&colours, &mut depths)
    } else {
        (&depths, &mut colours)
    };
    let taken: BTreeSet<_> = longer.values().cloned().collect();
    shorter.retain(|_, path| !taken.contains(path));
    let alone = |a: &BTreeMap<Key, PathBuf>, b: &BTreeMap<Key, PathBuf>| {
        a.iter()
            .find(|(key, _)| !b.contains_key(*key))
            .map(|(_, path)| path.clone())
    };
    if let Some(path) = alone(&colours, &depths).or_else(|| alone(&depths, &colours)) {
        return Err(Error::file(path, format!("has no partner by --pairs {colour},{depth}")));
    }
    if colours.is_empty() {
        return Err(Error::file(dir, format!("holds no files {colour} and {depth}")));
    }
    let mut frames = Vec::new();
    while let (Some((_, colour)), Some((_, depth))) = (colours.pop_first(), depths.pop_first()) {
        frames.push((colour, depth));
    }
    Ok(Sequence { frames, unit: None })
}

/// The text that a `*` stands for. Numbers sort before other text.
type Key = (Option<u64>, String);

fn matching(dir: &Path, pattern: &str) -> Result<BTreeMap<Key, PathBuf>> {
    let pattern_path = dir.join(pattern);
    let folder = pattern_path.parent().unwrap_or(dir);
    let name = pattern_path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let Some((before, after)) = name.split_once('*').filter(|(_, after)| !after.contains('*')) else {
        return Err(Error::Input(format!(
            "--pairs {pattern}: each of the two names has one *, as in rgb_*.png,depth_*.png"
        )));
    };
    let mut found = BTreeMap::new();
    for path in files_of(folder)? {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let Some(key) = name.strip_prefix(before).and_then(|rest| rest.strip_suffix(after)) else {
            continue;
        };
        found.insert((key.parse().ok(), key.to_owned()), path);
    }
    Ok(found)
}

fn files_of(dir: &Path) -> Result<Vec<PathBuf>> {
    let refuse = |e: std::io::Error| Error::file(dir, format!("cannot be read: {e}"));
    let entries = std::fs::read_dir(dir).map_err(refuse)?;
    entries.map(|entry| entry.map(|e| e.path()).map_err(refuse)).collect()
}

/// The pictures of two folders, paired by file name without extension, with numbers sorted numerically.
#[derive(Debug, Clone, PartialEq)]
pub struct Named {
    /// The name and the colour and depth files of each pair.
    pub pairs: Vec<(String, PathBuf, PathBuf)>,
    /// The files without a partner.
    pub alone: Vec<PathBuf>,
}

/// Pairs the pictures of the folders `colour` and `depth`, for example `rgb/cat.jpg` and `depth/cat.png`.
///
/// # Errors
/// Returns an error if a folder cannot be read or two of its files have the same name.
pub fn by_name(colour: &Path, depth: &Path) -> Result<Named> {
    let colours = images(colour)?;
    let mut depths = images(depth)?;
    let (mut pairs, mut alone) = (Vec::new(), Vec::new());
    for (name, colour) in colours {
        match depths.remove(&name) {
            Some(depth) => pairs.push((name.text, colour, depth)),
            None => alone.push(colour),
        }
    }
    alone.extend(depths.into_values());
    Ok(Named { pairs, alone })
}

/// Returns the pictures of a folder, keyed and sorted by name without extension.
///
/// # Errors
/// Returns an error if the folder cannot be read or two files have the same name.
pub fn images(dir: &Path) -> Result<BTreeMap<Name, PathBuf>> {
    let mut found = BTreeMap::new();
    for path in files_of(dir)? {
        let is_image = IMAGES.iter().any(|ending| output::has_extension(&path, ending));
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if !is_image || stem.starts_with('.') {
            continue;
        }
        if let Some(other) = found.insert(Name::new(stem), path.clone()) {
            let other = other.file_name().unwrap_or_default().display().to_string();
            return Err(Error::file(
                path,
                format!("has the name of {other} but for the ending; each picture needs a name of its own"),
            ));
        }
    }
    Ok(found)
}

/// A name that sorts its numbers numerically: `a2` before `a10`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Name {
    parts: Vec<Part>,
    /// The name as text.
    pub text: String,
}

#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
enum Part {
    /// Digits without leading zeros, preceded by their count: more digits mean a larger number.
    Number(usize, String),
    Text(String),
}

impl Name {
    fn new(text: String) -> Self {
        let bytes = text.as_bytes();
        let runs = bytes.chunk_by(|a, b| a.is_ascii_digit() == b.is_ascii_digit());
        let parts = runs.map(|run| {
            let part = String::from_utf8_lossy(run);
            if run[0].is_ascii_digit() {
                let digits = part.trim_start_matches('0').to_owned();
                Part::Number(digits.len(), digits)
            } else {
                Part::Text(part.into_owned())
            }
        });
        Name {
            parts: parts.collect(),
            text,
        }
    }

    /// Checks whether the name is a number, or a number and a time, as in Redwood's scans.
    fn is_of_redwood(&self) -> bool {
        let (number, time) = self.text.split_once('-').unwrap_or((&self.text, "0"));
        let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
        digits(number) && digits(time)
    }
}

/// Returns the frames of a colour folder and a depth folder.
fn two_folders(colour: &Path, depth: &Path) -> Result<Sequence> {
    let names = [images(colour)?, images(depth)?];
    if names.iter().flat_map(BTreeMap::keys).all(Name::is_of_redwood) {
        return redwood(colour, depth);
    }
    let found = by_name(colour, depth)?;
    if let Some(path) = found.alone.first() {
        return Err(Error::file(
            path,
            format!(
                "has no partner of the same name; {} and {} need equal names",
                colour.display(),
                depth.display()
            ),
        ));
    }
    Ok(Sequence {
        frames: found
            .pairs
            .into_iter()
            .map(|(_, colour, depth)| (colour, depth))
            .collect(),
        unit: None,
    })
}

/// Reads a sequence of the TUM RGB-D benchmark and pairs each colour image with the depth image nearest in time.
fn tum(dir: &Path) -> Result<Sequence> {
    let colours = timed(dir, "rgb.txt")?;
    let depths = timed(dir, "depth.txt")?;
    let mut frames = Vec::new();
    for (time, colour) in &colours {
        let nearest = depths
            .iter()
            .min_by(|(a, _), (b, _)| (a - time).abs().total_cmp(&(b - time).abs()));
        if let Some((at, depth)) = nearest
            && (at - time).abs() <= TUM_APART_S
        {
            frames.push((colour.clone(), depth.clone()));
        }
    }
    if frames.is_empty() {
        return Err(Error::file(
            dir,
            "its rgb.txt and depth.txt have no images within 0.02 s of each other",
        ));
    }
    Ok(Sequence {
        frames,
        unit: Some(DepthUnit::Raw {
            units_per_m: TUM_UNITS_PER_M,
        }),
    })
}

/// Parses lines of a time in seconds and a file name. Lines that begin with `#` are comments.
fn timed(dir: &Path, list: &str) -> Result<Vec<(f64, PathBuf)>> {
    let path = dir.join(list);
    let text = input::text(&path)?;
    let lines = text
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines
        .map(|line| {
            let (time, name) = line.split_once(char::is_whitespace).unwrap_or_default();
            match time.parse::<f64>() {
                Ok(time) => Ok((time, dir.join(name.trim()))),
                Err(_) => Err(Error::file(&path, format!("{line:?} is no time and a file\'s name"))),
            }
        })
        .collect()
}

/// Reads a Redwood scan or a similar folder, whose file names begin with the frame's number, such as
/// 0000012-000000366371.png. Files without a partner are skipped, because the depth of a scan may begin later than its
/// colour.
fn redwood(colour: &Path, depth: &Path) -> Result<Sequence> {
    let numbered = |dir: &Path| -> Result<BTreeMap<u64, PathBuf>> {
        let mut found = BTreeMap::new();
        for path in files_of(dir)? {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let digits: String = stem.chars().take_while(char::is_ascii_digit).collect();
            if let Ok(number) = digits.parse() {
                found.insert(number, path);
            }
        }
        Ok(found)
    };
    let colours = numbered(colour)?;
    let mut depths = numbered(depth)?;
    let images = colours.len().max(depths.len());
    let frames: Vec<_> = (colours.into_iter())
        .filter_map(|(number, colour)| Some((colour, depths.remove(&number)?)))
        .collect();
    if frames.is_empty() {
        return Err(Error::file(
            depth,
            format!("holds no image of a number that {} has too", colour.display()),
        ));
    }
    if frames.len() < images {
        log::warn!(
            "{}: {} of {images} frames have both images",
            colour.display(),
            frames.len()
        );
    }
    // Depth in millimetres needs more than 8 bits.
    let unit = (!has_bytes(&frames[0].1)).then_some(DepthUnit::Millimetres);
    Ok(Sequence { frames, unit })
}

/// Checks whether a picture has 8 bits per channel.
fn has_bytes(path: &Path) -> bool {
    let decoder = ImageReader::open(path)
        .and_then(ImageReader::with_guessed_format)
        .ok()
        .and_then(|reader| reader.into_decoder().ok());
    decoder.is_some_and(|decoder| {
        let color = decoder.color_type();
        color.bytes_per_pixel() == color.channel_count()
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = dir.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        dir
    }

    fn names(sequence: &Sequence) -> Vec<(String, String)> {
        let name = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
        sequence.frames.iter().map(|(a, b)| (name(a), name(b))).collect()
    }

    fn pairs(expected: &[(&str, &str)]) -> Vec<(String, String)> {
        expected.iter().map(|(a, b)| ((*a).into(), (*b).into())).collect()
    }

    #[test]
    fn tums_images_are_paired_by_time() {
        let dir = folder(&[
            (
                "rgb.txt",
                "# time name\n1.00 rgb/a.png\n1.04 rgb/b.png\n1.50 rgb/c.png\n",
            ),
            ("depth.txt", "1.031 depth/y.png\n1.012 depth/x.png\n"),
        ]);
        let found = of_folder(dir.path()).unwrap();
        assert_eq!(names(&found), pairs(&[("a.png", "x.png"), ("b.png", "y.png")]));
        assert_eq!(found.unit, Some(DepthUnit::Raw { units_per_m: 5000.0 }));
        let broken = folder(&[("rgb.txt", "one rgb/a.png"), ("depth.txt", "")]);
        assert!(of_folder(broken.path()).unwrap_err().to_string().contains("rgb.txt"));
        let apart = folder(&[("rgb.txt", "1 a.png"), ("depth.txt", "2 b.png")]);
        assert!(of_folder(apart.path()).unwrap_err().to_string().contains("0.02 s"));
    }

    #[test]
    fn redwoods_images_are_paired_by_number() {
        let dir = folder(&[
            ("rgb/0000001-000000000000.jpg", ""),
            ("rgb/0000002-000000033369.jpg", ""),
            ("depth/0000002-000000040000.png", ""),
            ("depth/0000010-000000400000.png", ""),
        ]);
        let found = of_folder(dir.path()).unwrap();
        let expected = [("0000002-000000033369.jpg", "0000002-000000040000.png")];
        assert_eq!(names(&found), pairs(&expected));
        assert_eq!(found.unit, Some(DepthUnit::Millimetres));
        // An 8-bit picture cannot hold millimetres.
        let bytes = folder(&[("rgb/1.png", ""), ("depth/1.png", "")]);
        image::GrayImage::new(2, 2)
            .save(bytes.path().join("depth/1.png"))
            .unwrap();
        assert_eq!(of_folder(bytes.path()).unwrap().unit, None);
        let none = folder(&[("image/1.jpg", ""), ("depth/2.png", "")]);
        assert!(of_folder(none.path()).unwrap_err().to_string().contains("no image"));
    }

    #[test]
    fn a_pattern_pairs_any_names_in_the_order_of_their_numbers() {
        let dir = folder(&[
            ("left_10_rgb.png", ""),
            ("left_9_rgb.png", ""),
            ("z/left_10.png", ""),
            ("z/left_9.png", ""),
            ("notes.txt", ""),
        ]);
        let found = by_pattern(dir.path(), "left_*_rgb.png", "z/left_*.png").unwrap();
        let expected = [("left_9_rgb.png", "left_9.png"), ("left_10_rgb.png", "left_10.png")];
        assert_eq!(names(&found), pairs(&expected));
        let refused = |a: &str, b: &str| by_pattern(dir.path(), a, b).unwrap_err().to_string();
        assert!(refused("left_rgb.png", "z/left_*.png").contains("one *"));
        assert!(refused("no_*", "not_*").contains("no files"));
        std::fs::write(dir.path().join("left_11_rgb.png"), "").unwrap();
        assert!(refused("left_*_rgb.png", "z/left_*.png").contains("left_11_rgb.png"));
    }

    #[test]
    fn a_file_that_both_patterns_match_belongs_to_the_longer_one() {
        let dir = folder(&[
            ("left_1.png", ""),
            ("left_1_z.png", ""),
            ("left_2.png", ""),
            ("left_2_z.png", ""),
        ]);
        let expected = [("left_1.png", "left_1_z.png"), ("left_2.png", "left_2_z.png")];
        let found = by_pattern(dir.path(), "left_*.png", "left_*_z.png").unwrap();
        assert_eq!(names(&found), pairs(&expected));
        let turned = by_pattern(dir.path(), "left_*_z.png", "left_*.png").unwrap();
        assert_eq!(names(&turned), pairs(&expected.map(|(a, b)| (b, a))));
        std::fs::remove_file(dir.path().join("left_2_z.png")).unwrap();
        let refused = by_pattern(dir.path(), "left_*.png", "left_*_z.png").unwrap_err();
        assert!(refused.to_string().contains("left_2.png"));
    }

    #[test]
    fn folders_of_other_names_are_told_how_to_name_them() {
        let dir = folder(&[("depth_maps/1.png", ""), ("images/1.jpg", ""), ("notes.txt", "")]);
        let why = of_folder(dir.path()).unwrap_err().to_string();
        assert!(why.contains("--pairs 'images/*.jpg,depth_maps/*.png'"), "{why}");
        let pairs = by_pattern(dir.path(), "images/*.jpg", "depth_maps/*.png").unwrap();
        assert_eq!(names(&pairs), self::pairs(&[("1.jpg", "1.png")]));
        let why = of_folder(&dir.path().join("notes.txt")).unwrap_err().to_string();
        assert!(why.contains("neither a folder nor a film"), "{why}");
    }

    #[test]
    fn folders_of_equal_names_are_paired_by_them() {
        let dir = folder(&[
            ("rgb/cat 10.jpg", ""),
            ("rgb/cat 9.png", ""),
            ("rgb/notes.txt", ""),
            ("depth/cat 10.png", ""),
            ("depth/cat 9.npy", ""),
        ]);
        let found = of_folder(dir.path()).unwrap();
        let expected = [("cat 9.png", "cat 9.npy"), ("cat 10.jpg", "cat 10.png")];
        assert_eq!((names(&found), found.unit), (pairs(&expected), None));
        std::fs::write(dir.path().join("depth/dog.png"), "").unwrap();
        let refused = || of_folder(dir.path()).unwrap_err().to_string();
        assert!(refused().contains("dog.png") && refused().contains("no partner"));
        std::fs::write(dir.path().join("rgb/cat 9.jpg"), "").unwrap();
        assert!(refused().contains("cat 9") && refused().contains("a name of its own"));
    }
}
