//! Sequences of colour and depth files in the folder layouts of data sets.

use crate::picture::depth_map;
use crate::{Error, Result, input, output};
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
/// The file extensions of pictures.
const PICTURES: [&str; 7] = ["png", "jpg", "jpeg", "bmp", "webp", "tif", "tiff"];
/// The further file extensions of colour.
const COLOURS: [&str; 4] = ["heic", "heif", "exr", "hdr"];
/// The further file extensions of depth.
const NUMBERS: [&str; 5] = ["exr", "npy", "npz", "pgm", "pfm"];

/// What a file shows. It decides which file extensions count; other files are ignored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shows {
    /// Colour: a picture.
    Colour,
    /// Depth: a picture, or an array of numbers.
    Depth,
}

impl Shows {
    /// Checks whether the file at `path` may show this. Hidden files do not.
    fn is_by(self, path: &Path) -> bool {
        let more: &[&str] = match self {
            Shows::Colour => &COLOURS,
            Shows::Depth => &NUMBERS,
        };
        let hidden = path
            .file_name()
            .is_none_or(|name| name.to_string_lossy().starts_with('.'));
        !hidden
            && PICTURES
                .iter()
                .chain(more)
                .any(|ending| output::has_extension(path, ending))
    }
}

/// Frames in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Sequence {
    /// The colour and depth files of each frame.
    pub frames: Vec<(PathBuf, PathBuf)>,
    /// The unit of the depth values, if the layout defines it.
    pub unit: Option<DepthUnit>,
}

/// Returns the frames of `dir`: a sequence of the TUM RGB-D benchmark (`rgb.txt`, `depth.txt`), folders `rgb` and
/// `depth` with the file numbers of a Redwood scan or with equal names, or numbered files in one folder, where
/// `color_7.jpg` or `rgb_007.png` belongs to `depth_7.png` or `depth_007.npy`. Frames that lack a file are left out
/// with a warning.
///
/// # Errors
/// Returns an error if the folder has none of these layouts or no whole frame, or if two files claim to be the same
/// part of a frame.
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
        return two_folders(dir, &colour, &dir.join("depth"));
    }
    if let Some(why) = other_folders(dir)? {
        return Err(Error::file(dir, why));
    }
    numbered(dir)
}

/// Returns advice if `dir` holds folders of pictures with other names, and no pictures beside them.
fn other_folders(dir: &Path) -> Result<Option<String>> {
    let is_image = |path: &PathBuf| Shows::Depth.is_by(path);
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
/// file that matches both patterns belongs to the longer pattern. Frames that lack a file are left out with a warning.
///
/// # Errors
/// Returns an error if a pattern is invalid or there is no whole frame.
pub fn by_pattern(dir: &Path, colour: &str, depth: &str) -> Result<Sequence> {
    let mut colours = matching(dir, colour, Shows::Colour)?;
    let mut depths = matching(dir, depth, Shows::Depth)?;
    let (longer, shorter) = if colour.len() > depth.len() {
        (&colours, &mut depths)
    } else {
        (&depths, &mut colours)
    };
    let taken: BTreeSet<_> = longer.values().cloned().collect();
    shorter.retain(|_, path| !taken.contains(path));
    if colours.is_empty() && depths.is_empty() {
        return Err(Error::file(dir, format!("holds no files {colour} and {depth}")));
    }
    join(colours, depths).sequence(dir, &format!("--pairs {colour},{depth}"), None)
}

/// The files of two kinds, joined by a key.
struct Joined<K> {
    pairs: Vec<(K, PathBuf, PathBuf)>,
    /// The files without a partner.
    alone: Vec<PathBuf>,
}

fn join<K: Ord>(colours: BTreeMap<K, PathBuf>, mut depths: BTreeMap<K, PathBuf>) -> Joined<K> {
    let (mut pairs, mut alone) = (Vec::new(), Vec::new());
    for (key, colour) in colours {
        match depths.remove(&key) {
            Some(depth) => pairs.push((key, colour, depth)),
            None => alone.push(colour),
        }
    }
    alone.extend(depths.into_values());
    Joined { pairs, alone }
}

impl<K> Joined<K> {
    /// Returns the whole frames of `dir`, which were joined by `what`. Warns of the others, because a recording may
    /// lack the depth of some frames.
    fn sequence(self, dir: &Path, what: &str, unit: Option<DepthUnit>) -> Result<Sequence> {
        let Joined { pairs, alone } = self;
        let name = |path: &Path| path.file_name().unwrap_or_default().display().to_string();
        if let Some(first) = alone.first() {
            if pairs.is_empty() {
                return Err(Error::file(
                    dir,
                    format!("has no colour with depth by {what}: {} has no partner", name(first)),
                ));
            }
            log::warn!(
                "{}: {} of {} frames have both colour and depth by {what}; the others are left out, such as that of {}",
                dir.display(),
                pairs.len(),
                pairs.len() + alone.len(),
                name(first)
            );
        }
        let frames = pairs.into_iter().map(|(_, colour, depth)| (colour, depth)).collect();
        Ok(Sequence { frames, unit })
    }
}

/// Adds the file of `key`.
///
/// # Errors
/// Returns an error if there is one already.
fn add<K: Ord>(files: &mut BTreeMap<K, PathBuf>, key: K, path: PathBuf) -> Result<()> {
    let Some(other) = files.insert(key, path.clone()) else {
        return Ok(());
    };
    let other = other.file_name().unwrap_or_default().display().to_string();
    Err(Error::file(
        path,
        format!("stands for the same picture as {other}; keep one of them, or give it a name of its own"),
    ))
}

/// Returns the frames of a folder whose files are numbered.
fn numbered(dir: &Path) -> Result<Sequence> {
    let (mut colours, mut depths) = (BTreeMap::new(), BTreeMap::new());
    for path in files_of(dir)? {
        let Some(stem) = path.file_stem().and_then(|s| s.to_str()) else {
            continue;
        };
        let number =
            |prefix: &str| -> Option<u64> { stem.strip_prefix(prefix)?.trim_start_matches(['_', '-']).parse().ok() };
        let colour = ["color", "colour", "rgb"].into_iter().find_map(number);
        if let Some(number) = colour.filter(|_| Shows::Colour.is_by(&path)) {
            add(&mut colours, number, path)?;
        } else if let Some(number) = number("depth").filter(|_| Shows::Depth.is_by(&path)) {
            add(&mut depths, number, path)?;
        }
    }
    if colours.is_empty() && depths.is_empty() {
        return Err(Error::file(
            dir,
            "holds no frames; they are named color_0.jpg and depth_0.png, color_1.jpg and depth_1.png …",
        ));
    }
    join(colours, depths).sequence(dir, "number", None)
}

/// The text that a `*` stands for. Numbers sort before other text.
type Key = (Option<u64>, String);

fn matching(dir: &Path, pattern: &str, what: Shows) -> Result<BTreeMap<Key, PathBuf>> {
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
        let key = name.strip_prefix(before).and_then(|rest| rest.strip_suffix(after));
        // A pattern with an extension names its files; without one it also matches files of other kinds.
        if let Some(key) = key
            && (after.contains('.') || what.is_by(&path))
        {
            found.insert((key.parse().ok(), key.to_owned()), path);
        }
    }
    Ok(found)
}

fn files_of(dir: &Path) -> Result<Vec<PathBuf>> {
    let refuse = |e: std::io::Error| Error::file(dir, format!("cannot be read: {e}"));
    let entries = std::fs::read_dir(dir).map_err(refuse)?;
    let mut paths = (entries.map(|entry| entry.map(|e| e.path()).map_err(refuse))).collect::<Result<Vec<_>>>()?;
    paths.sort(); // So that messages do not depend on the file system.
    Ok(paths)
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
    let Joined { pairs, alone } = join(images(colour, Shows::Colour)?, images(depth, Shows::Depth)?);
    let pairs = (pairs.into_iter()).map(|(name, colour, depth)| (name.text, colour, depth));
    Ok(Named {
        pairs: pairs.collect(),
        alone,
    })
}

/// Returns the files of a folder that may show `what`, keyed and sorted by name without extension.
///
/// # Errors
/// Returns an error if the folder cannot be read or two files have the same name.
pub fn images(dir: &Path, what: Shows) -> Result<BTreeMap<Name, PathBuf>> {
    let mut found = BTreeMap::new();
    for path in files_of(dir)?.into_iter().filter(|path| what.is_by(path)) {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        add(&mut found, Name::new(stem), path)?;
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

    /// Returns the number of a name that is a number, or a number and a time, as in Redwood's scans.
    fn frame(&self) -> Option<&Part> {
        let (number, time) = self.text.split_once('-').unwrap_or((&self.text, "0"));
        let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
        self.parts.first().filter(|_| digits(number) && digits(time))
    }
}

/// Returns the frames of a colour folder and a depth folder of `dir`: a Redwood scan or a similar recording, whose file
/// names begin with the frame's number, such as 0000012-000000366371.png, or files of equal names.
fn two_folders(dir: &Path, colour: &Path, depth: &Path) -> Result<Sequence> {
    let (colours, depths) = (images(colour, Shows::Colour)?, images(depth, Shows::Depth)?);
    let Some(empty) = [(colour, &colours), (depth, &depths)]
        .into_iter()
        .find(|(_, files)| files.is_empty())
    else {
        let (Some(colours_by_number), Some(depths_by_number)) = (by_number(&colours)?, by_number(&depths)?) else {
            return join(colours, depths).sequence(dir, "name", None);
        };
        // Millimetres are 16-bit numbers.
        let first = depths_by_number.values().next();
        let unit = first
            .is_some_and(|path| depth_map::has_16_bits(path))
            .then_some(DepthUnit::Millimetres);
        return join(colours_by_number, depths_by_number).sequence(dir, "number", unit);
    };
    Err(Error::file(empty.0, "holds no pictures"))
}

/// Returns the files by the frame's number, or `None` if one has another name.
fn by_number(files: &BTreeMap<Name, PathBuf>) -> Result<Option<BTreeMap<Part, PathBuf>>> {
    let mut numbered = BTreeMap::new();
    for (name, path) in files {
        let Some(number) = name.frame() else { return Ok(None) };
        add(&mut numbered, number.clone(), path.clone())?;
    }
    Ok(Some(numbered))
}

/// Reads a sequence of the TUM RGB-D benchmark and pairs each colour image with the depth image nearest in time.
fn tum(dir: &Path) -> Result<Sequence> {
    let colours = timed(dir, "rgb.txt")?;
    let depths = timed(dir, "depth.txt")?;
    let mut frames = Vec::new();
    let mut least = f64::INFINITY;
    for (time, colour) in &colours {
        let apart = |at: f64| (at - time).abs();
        let nearest = depths.iter().min_by(|(a, _), (b, _)| apart(*a).total_cmp(&apart(*b)));
        let Some((at, depth)) = nearest else { continue };
        least = least.min(apart(*at));
        if apart(*at) <= TUM_APART_S {
            frames.push((colour.clone(), depth.clone()));
        }
    }
    let (found, all) = (frames.len(), colours.len());
    let reach = format!("of the {all} colour images of rgb.txt have a depth image within {TUM_APART_S} s");
    if frames.is_empty() {
        let least = if least.is_finite() {
            format!("; the nearest is {least:.3} s away")
        } else {
            String::new()
        };
        return Err(Error::file(dir, format!("none {reach}{least}")));
    }
    if found < all {
        log::warn!("{}: {found} {reach}; the others are left out", dir.display());
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
                Err(_) => Err(Error::file(&path, format!("{line:?} is no time and a file's name"))),
            }
        })
        .collect()
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
            ("depth/0000010-000000400000.png", ""),
        ]);
        let words = image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::new(2, 2);
        words.save(dir.path().join("depth/0000002-000000040000.png")).unwrap();
        let found = of_folder(dir.path()).unwrap();
        let expected = [("0000002-000000033369.jpg", "0000002-000000040000.png")];
        assert_eq!(names(&found), pairs(&expected));
        assert_eq!(found.unit, Some(DepthUnit::Millimetres));
        // 8-bit pictures and floating point hold no millimetres.
        let bytes = folder(&[("rgb/1.png", ""), ("depth/1.png", "")]);
        image::GrayImage::new(2, 2)
            .save(bytes.path().join("depth/1.png"))
            .unwrap();
        assert_eq!(of_folder(bytes.path()).unwrap().unit, None);
        let floats = folder(&[("rgb/1.png", ""), ("depth/1.npy", "")]);
        ndarray_npy::write_npy(floats.path().join("depth/1.npy"), &ndarray::Array2::<f32>::ones((2, 2))).unwrap();
        assert_eq!(of_folder(floats.path()).unwrap().unit, None);
        let none = folder(&[("image/1.jpg", ""), ("depth/2.png", "")]);
        assert!(
            of_folder(none.path())
                .unwrap_err()
                .to_string()
                .contains("1.jpg has no partner")
        );
    }

    #[test]
    fn frames_of_a_folder_are_paired_in_the_order_of_their_numbers() {
        let dir = folder(&[("notes.txt", "")]);
        assert!(of_folder(dir.path()).unwrap_err().to_string().contains("no frames"));
        for name in [
            "color_10.jpg",
            "depth_10.png",
            "rgb_2.png",
            "depth_0002.npy",
            "depth_11.png",
        ] {
            std::fs::write(dir.path().join(name), "").unwrap();
        }
        let expected = [("rgb_2.png", "depth_0002.npy"), ("color_10.jpg", "depth_10.png")];
        assert_eq!(names(&of_folder(dir.path()).unwrap()), pairs(&expected));
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
        let found = by_pattern(dir.path(), "left_*_rgb.png", "z/left_*.png").unwrap();
        assert_eq!(names(&found), pairs(&expected), "the frame without depth is left out");
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
        let found = by_pattern(dir.path(), "left_*.png", "left_*_z.png").unwrap();
        assert_eq!(names(&found), pairs(&expected[..1]));
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
        assert_eq!(names(&of_folder(dir.path()).unwrap()), pairs(&expected));
        std::fs::write(dir.path().join("rgb/cat 9.jpg"), "").unwrap();
        let refused = of_folder(dir.path()).unwrap_err().to_string();
        assert!(
            refused.contains("cat 9.jpg") && refused.contains("cat 9.png"),
            "{refused}"
        );
    }
}
