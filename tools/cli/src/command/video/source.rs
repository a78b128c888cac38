//! The sources of frames: folders, films and pipes.

use super::Video;
use indicatif::ProgressBar;
use phasefront::Size;
use phasefront::input::RgbEncoding;
use phasefront_command::flags::check_used;
use phasefront_command::terminal::{progress_bar, progress_count};
use phasefront_core::depth::DepthUnit;
use phasefront_io::film::sequence::{self, Sequence};
use phasefront_io::film::survey::{self, Sides};
use phasefront_io::film::video::{self, RawVideo, VideoFrame};
use phasefront_io::film::{self, About, Film, Pixels};
use phasefront_io::frame::{DepthOptions, Doubt};
use phasefront_io::{Error, Result, output};
use std::collections::BTreeSet;
use std::mem::{Discriminant, discriminant};
use std::path::PathBuf;
use std::sync::Arc;

/// The size of the colour, and of the depth if there is one.
type Sizes = (Size, Option<Size>);

/// A source of frames that all have one size.
pub(super) struct Source {
    input: Input,
    /// The name of the input.
    path: PathBuf,
    /// The sizes of the first frame.
    sizes: Option<Sizes>,
    given: usize,
    /// Fixed near and far, in metres.
    range_m: Option<(f32, f32)>,
    /// The kinds of doubts that were told of: one warning each, however many frames there are.
    told: Vec<Discriminant<Doubt>>,
}

enum Input {
    Folder(Folder),
    Film(Box<FilmSource>),
    Pipe {
        raw: RawVideo,
        encoding: RgbEncoding,
        first: Option<Read>,
    },
}

/// A frame, and what is doubtful about it.
#[derive(Clone)]
struct Read {
    frame: Arc<VideoFrame>,
    doubts: Vec<Doubt>,
}

impl Read {
    /// Checks a frame that is no file of its own, and swaps its near and far if it is `inverted`.
    fn checked(mut frame: VideoFrame, inverted: bool) -> Result<Self> {
        let doubts = frame.check(inverted)?.into_iter().collect();
        if inverted && frame.depth_size().is_some() {
            frame.invert()?;
        }
        Ok(Read {
            frame: Arc::new(frame),
            doubts,
        })
    }
}

struct Folder {
    paths: Vec<(PathBuf, PathBuf)>,
    depth: DepthOptions,
    asked: Option<RgbEncoding>,
    /// The frames that were read, if they are shown again.
    kept: Vec<Read>,
    next: usize,
    total: usize,
}

struct FilmSource {
    path: PathBuf,
    colour: Film,
    depth: FilmDepth,
    numbers: DepthOptions,
    encoding: RgbEncoding,
    first: Option<Read>,
    about: Option<About>,
}

/// The place of a film's depth.
enum FilmDepth {
    /// A film of its own.
    Film(Film),
    /// The right side of the pictures.
    Beside(Sides),
    /// The session's depth network.
    Network,
}

impl Source {
    /// Opens the source that `flags` name, and returns it with the size of its first frame. Completes the flags by
    /// what a folder's layout defines.
    pub(super) fn open(flags: &mut Video) -> Result<(Source, Size)> {
        let (input, size) = Input::open(flags)?;
        let source = Source {
            input,
            path: flags.input.clone(),
            sizes: None,
            given: 0,
            range_m: flags.depth.range()?,
            told: Vec::new(),
        };
        Ok((source, size))
    }

    /// Returns the next frame, or `None` at the end.
    ///
    /// # Errors
    /// Returns an error if a frame cannot be read or has another size than the frames before it.
    pub(super) fn next(&mut self) -> Result<Option<Arc<VideoFrame>>> {
        let Some(Read { frame, mut doubts }) = self.input.next()? else {
            return Ok(None);
        };
        let sizes = (frame.size(), frame.depth_size());
        let first = *self.sizes.get_or_insert(sizes);
        if sizes != first {
            let said = |(colour, depth): Sizes| match depth {
                Some(depth) => format!("{colour} with depth of {depth}"),
                None => colour.to_string(),
            };
            return Err(Error::Input(format!(
                "{}: is {}, the first frame {}; frames of a video have one size, and pictures of any size go to `phasefront hologram` with folders for --rgb and --depth",
                self.name(self.given),
                said(sizes),
                said(first)
            )));
        }
        if self.given == 0 {
            doubts.extend(match self.range_m {
                Some((near_m, far_m)) => Doubt::of_clipped(frame.beyond(near_m, far_m), near_m, far_m),
                None => frame.crowded(),
            });
        }
        for doubt in doubts {
            let kind = discriminant(&doubt);
            if !self.told.contains(&kind) {
                self.told.push(kind);
                log::warn!("{}: {doubt}", self.name(self.given));
            }
        }
        self.given += 1;
        Ok(Some(frame))
    }

    /// Returns the name of a frame for messages.
    pub(crate) fn name(&self, frame: usize) -> String {
        match &self.input {
            Input::Folder(folder) => {
                let (colour, depth) = &folder.paths[frame % folder.paths.len()];
                format!("{} with {}", colour.display(), depth.display())
            }
            _ => format!("{}, frame {frame}", self.path.display()),
        }
    }

    /// Returns the frames per second of a film.
    pub(super) fn rate_hz(&self) -> Option<f64> {
        match &self.input {
            Input::Film(film) => film.about.map(|about| about.rate_hz),
            _ => None,
        }
    }

    /// Checks whether frames are available before they are due.
    pub(super) fn is_stored(&self) -> bool {
        !matches!(self.input, Input::Pipe { .. })
    }

    pub(super) fn progress(&self) -> ProgressBar {
        let frames = match &self.input {
            Input::Folder(folder) => Some(folder.total as u64),
            Input::Film(film) => film.about.map(|about| about.frames),
            Input::Pipe { .. } => None,
        };
        match frames {
            Some(frames) => progress_bar(frames, "frames"),
            None => progress_count("frames"),
        }
    }
}

impl Input {
    fn open(flags: &mut Video) -> Result<(Input, Size)> {
        let numbers = flags.depth.options(flags.seen.invert())?;
        let is_pipe = flags.input.as_os_str() == "-";
        let is_film = !is_pipe && film::is_film(&flags.input);
        let is_folder = !is_pipe && !is_film;
        let a_film = "a film, as clip.mp4";
        check_used(&[
            ("--pairs", flags.pairs.is_some(), is_folder, "a folder"),
            ("--repeat", flags.repeat > 1, is_folder, "a folder"),
            ("--invert", numbers.inverted, !is_pipe, "a folder or a film"),
            ("--depth-video", flags.depth_video.is_some(), is_film, a_film),
            ("--depth-beside", flags.depth_beside, is_film, a_film),
            ("--depth-network", flags.seen.network().is_some(), is_film, a_film),
        ])?;
        if is_pipe {
            check_range(flags, numbers)?;
            return open_pipe(flags, numbers);
        }
        if flags.raw.is_some() {
            return Err(Error::Usage("--raw is for frames on stdin; give - as input".into()));
        }
        match is_film {
            true => open_film(flags, numbers),
            false => open_folder(flags),
        }
    }

    fn next(&mut self) -> Result<Option<Read>> {
        match self {
            Input::Pipe { raw, encoding, first } => match first.take() {
                Some(read) => Ok(Some(read)),
                None => read_raw(raw, *encoding),
            },
            Input::Film(film) => film.next(),
            Input::Folder(folder) => folder.next(),
        }
    }
}

fn open_folder(flags: &mut Video) -> Result<(Input, Size)> {
    let Sequence { frames: paths, unit } = match &flags.pairs {
        None => sequence::of_folder(&flags.input)?,
        Some(pattern) => {
            let (colour, depth) = pattern.split_once(',').ok_or_else(|| {
                Error::Usage("--pairs takes two patterns with a comma between, as rgb_*.png,depth_*.png".into())
            })?;
            sequence::by_pattern(&flags.input, colour, depth)?
        }
    };
    flags.depth.take_layout(unit);
    let depth = flags.depth.options(flags.seen.invert())?;
    check_range(flags, depth)?;
    let folders: BTreeSet<_> = (paths.iter())
        .flat_map(|(colour, depth)| [colour.parent(), depth.parent()])
        .flatten()
        .collect();
    for folder in folders {
        output::reading(folder)?;
    }
    let asked = flags.colours.asked();
    let size = video::read_frame([&paths[0].0, &paths[0].1], depth, asked, &mut |_| ())?.size();
    let total = paths.len() * flags.repeat as usize;
    let folder = Folder {
        paths,
        depth,
        asked,
        kept: Vec::new(),
        next: 0,
        total,
    };
    Ok((Input::Folder(folder), size))
}

impl Folder {
    fn next(&mut self) -> Result<Option<Read>> {
        if self.next == self.total {
            return Ok(None);
        }
        let at = self.next % self.paths.len();
        self.next += 1;
        if let Some(read) = self.kept.get(at) {
            return Ok(Some(read.clone()));
        }
        let (colour, depth) = &self.paths[at];
        let mut doubts = Vec::new();
        let mut told = |doubt| doubts.push(doubt);
        let mut frame = video::read_frame([colour, depth], self.depth, self.asked, &mut told)?;
        if self.depth.inverted {
            frame.invert().map_err(|e| Error::file(depth, e))?;
        }
        let read = Read {
            frame: Arc::new(frame),
            doubts,
        };
        if self.total > self.paths.len() {
            self.kept.push(read.clone());
        }
        Ok(Some(read))
    }
}

/// Refuses near and far if depth has no metres.
fn check_range(flags: &Video, numbers: DepthOptions) -> Result<()> {
    if flags.depth.range()?.is_some() && numbers.unit == DepthUnit::Normalized {
        Err(Error::Usage(
            "--near and --far are metres and normalized depth has no unit; leave them out, or name the unit by --depth-unit"
                .into(),
        ))
    } else {
        Ok(())
    }
}

fn open_pipe(flags: &Video, numbers: DepthOptions) -> Result<(Input, Size)> {
    let Some(colour) = flags.raw else {
        return Err(Error::Usage(
            "raw frames on stdin need --raw WxH, the size of their colour".into(),
        ));
    };
    let raw = RawVideo {
        colour,
        depth: flags.raw_depth.unwrap_or(colour),
        unit: numbers.unit,
    };
    let encoding = flags.colours.viewed();
    let first = read_raw(&raw, encoding)?;
    if first.is_none() {
        return Err(Error::Input("stdin holds no frame".into()));
    }
    Ok((Input::Pipe { raw, encoding, first }, colour))
}

fn read_raw(raw: &RawVideo, encoding: RgbEncoding) -> Result<Option<Read>> {
    let frame = raw.read(&mut std::io::stdin().lock())?;
    (frame.map(|frame| Read::checked(frame.with_encoding(encoding), false))).transpose()
}

fn open_film(flags: &Video, numbers: DepthOptions) -> Result<(Input, Size)> {
    let path = &flags.input;
    let depth = match (&flags.depth_video, flags.depth_beside, flags.seen.network()) {
        (Some(depth), false, None) => {
            check_range(flags, numbers)?;
            survey::check_grey(depth)?;
            FilmDepth::Film(Film::open(depth, Pixels::Grey, None)?)
        }
        (None, true, None) => {
            let sides = survey::sides(path)?;
            if sides.margin() > 0 {
                log::warn!(
                    "{}: the {} columns of one colour between colour and depth are left out",
                    path.display(),
                    sides.margin()
                );
            }
            FilmDepth::Beside(sides)
        }
        (None, false, Some(_)) => FilmDepth::Network,
        _ => {
            return Err(Error::file(
                path,
                "a film holds colour alone; its depth comes from one of --depth-video FILE, --depth-beside and --depth-network FILE",
            ));
        }
    };
    let about = film::about(path);
    let said = about.map_or(RgbEncoding::Srgb, |about| about.encoding);
    let is_mapped = about.is_some_and(|about| about.is_hdr());
    let asked = (flags.colours.asked()).filter(|asked| !(is_mapped && asked.is_high_dynamic_range()));
    let encoding = asked.unwrap_or(said);
    let mut film = FilmSource {
        path: path.clone(),
        colour: Film::open(path, Pixels::Rgb, about.as_ref())?,
        depth,
        numbers,
        encoding,
        first: None,
        about,
    };
    film.first = film.read()?;
    let first = film
        .first
        .as_ref()
        .ok_or_else(|| Error::file(path, "holds no picture"))?;
    let size = first.frame.size();
    Ok((Input::Film(Box::new(film)), size))
}

impl FilmSource {
    fn next(&mut self) -> Result<Option<Read>> {
        match self.first.take() {
            Some(read) => Ok(Some(read)),
            None => self.read(),
        }
    }

    fn read(&mut self) -> Result<Option<Read>> {
        let Some(colour) = self.colour.read()? else {
            if let FilmDepth::Film(film) = &mut self.depth
                && film.read()?.is_some()
            {
                log::warn!("the film of colour ends before that of depth; the video ends with it");
            }
            return Ok(None);
        };
        let frame = match &mut self.depth {
            FilmDepth::Film(film) => match film.read()? {
                None => {
                    log::warn!("the film of depth ends before that of colour; the video ends with it");
                    return Ok(None);
                }
                Some(depth) => {
                    VideoFrame::of_big_endian(colour.size, colour.bytes, depth.size, &depth.bytes, self.numbers.unit)
                }
            },
            FilmDepth::Beside(sides) => VideoFrame::of_sides(colour.size, &colour.bytes, sides.side)?,
            FilmDepth::Network => VideoFrame::without_depth(colour.size, colour.bytes),
        };
        let read = Read::checked(frame.with_encoding(self.encoding), self.numbers.inverted);
        Ok(Some(read.map_err(|e| Error::file(&self.path, e))?))
    }
}
