//! The sources of frames: folders, films and pipes.

use super::Video;
use indicatif::ProgressBar;
use phasefront_command::flags::check_used;
use phasefront_command::terminal::{progress_bar, progress_count};
use phasefront_core::depth::DepthUnit;
use phasefront_io::film::sequence::{self, Sequence};
use phasefront_io::film::video::{self, RawVideo, VideoFrame};
use phasefront_io::film::{self, Film, Pixels};
use phasefront_io::{Error, Result, frame, output};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

/// (H, W) of the colour, and of the depth if there is one.
type Shapes = ((usize, usize), Option<(usize, usize)>);

/// A source of frames that all have one size.
pub(super) struct Source {
    input: Input,
    /// The name of the input.
    path: PathBuf,
    /// (H, W) of the colour and of the depth of the first frame.
    shapes: Option<Shapes>,
    given: usize,
    /// Fixed near and far, in metres.
    range_m: Option<(f32, f32)>,
}

enum Input {
    Folder(Folder),
    Film(Box<FilmSource>),
    Pipe { raw: RawVideo, first: Option<VideoFrame> },
}

struct Folder {
    paths: Vec<(PathBuf, PathBuf)>,
    unit: DepthUnit,
    invert: bool,
    /// The frames that were read, if they are shown again.
    kept: Vec<Arc<VideoFrame>>,
    next: usize,
    total: usize,
}

struct FilmSource {
    colour: Film,
    depth: FilmDepth,
    unit: DepthUnit,
    invert: bool,
    first: Option<VideoFrame>,
    frames: Option<u64>,
}

/// The place of a film's depth.
enum FilmDepth {
    /// A film of its own.
    Film(Film),
    /// The right half of the pictures.
    Beside,
    /// The session's depth network.
    Network,
}

impl Source {
    /// Opens the source that `flags` name, and returns it with the (H, W) of its first frame.
    pub(super) fn open(flags: &Video) -> Result<(Source, (usize, usize))> {
        let (input, shape) = Input::open(flags)?;
        let source = Source {
            input,
            path: flags.input.clone(),
            shapes: None,
            given: 0,
            range_m: flags.depth.range()?,
        };
        Ok((source, shape))
    }

    /// Returns the next frame, or `None` at the end.
    ///
    /// # Errors
    /// Returns an error if a frame cannot be read or has another size than the frames before it.
    pub(super) fn next(&mut self) -> Result<Option<Arc<VideoFrame>>> {
        let Some(frame) = self.input.next()? else {
            return Ok(None);
        };
        let shapes = (frame.shape(), frame.depth_shape());
        let first = *self.shapes.get_or_insert(shapes);
        if shapes != first {
            let said = |((h, w), depth): Shapes| match depth {
                Some((dh, dw)) => format!("{w}×{h} with depth of {dw}×{dh}"),
                None => format!("{w}×{h}"),
            };
            return Err(Error::Input(format!(
                "{}: is {}, the first frame {}; frames of a video have one size, and pictures of any size go to `phasefront hologram` with folders for --rgb and --depth",
                self.name(self.given),
                said(shapes),
                said(first)
            )));
        }
        if let Some((near_m, far_m)) = self.range_m.filter(|_| self.given == 0) {
            let beyond = frame.beyond(near_m, far_m);
            if beyond > frame::DOUBTFULLY_CLIPPED {
                log::warn!(
                    "{}: {:.0} % of the depth lies before near {near_m} m or beyond far {far_m} m and is shown there; both are metres",
                    self.name(0),
                    100.0 * beyond
                );
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

    /// Checks whether frames are available before they are due.
    pub(super) fn is_stored(&self) -> bool {
        !matches!(self.input, Input::Pipe { .. })
    }

    pub(super) fn progress(&self) -> ProgressBar {
        let frames = match &self.input {
            Input::Folder(folder) => Some(folder.total as u64),
            Input::Film(film) => film.frames,
            Input::Pipe { .. } => None,
        };
        match frames {
            Some(frames) => progress_bar(frames, "frames"),
            None => progress_count("frames"),
        }
    }
}

impl Input {
    fn open(flags: &Video) -> Result<(Input, (usize, usize))> {
        let unit = flags.depth.options()?.unit;
        let is_pipe = flags.input.as_os_str() == "-";
        let is_film = !is_pipe && film::is_film(&flags.input);
        let is_folder = !is_pipe && !is_film;
        let a_film = "a film, as clip.mp4";
        check_used(&[
            ("--pairs", flags.pairs.is_some(), is_folder, "a folder"),
            ("--repeat", flags.repeat > 1, is_folder, "a folder"),
            ("--invert", flags.seen.invert(), !is_pipe, "a folder or a film"),
            ("--depth-video", flags.depth_video.is_some(), is_film, a_film),
            ("--depth-beside", flags.depth_beside, is_film, a_film),
            ("--depth-network", flags.seen.network().is_some(), is_film, a_film),
        ])?;
        if is_pipe {
            check_range(flags, unit)?;
            return open_pipe(flags, unit);
        }
        if flags.raw.is_some() {
            return Err(Error::Input("--raw is for frames on stdin; give - as input".into()));
        }
        if is_film {
            return open_film(flags, unit);
        }
        let Sequence {
            frames: paths,
            unit: said,
        } = match &flags.pairs {
            None => sequence::of_folder(&flags.input)?,
            Some(pattern) => {
                let (colour, depth) = pattern.split_once(',').ok_or_else(|| {
                    Error::Input("--pairs takes two patterns with a comma between, as rgb_*.png,depth_*.png".into())
                })?;
                sequence::by_pattern(&flags.input, colour, depth)?
            }
        };
        // Layouts that define their unit never hold normalized depth.
        let unit = said.filter(|_| unit == DepthUnit::Normalized).unwrap_or(unit);
        check_range(flags, unit)?;
        let folders: BTreeSet<_> = (paths.iter())
            .flat_map(|(colour, depth)| [colour.parent(), depth.parent()])
            .flatten()
            .collect();
        for folder in folders {
            output::reading(folder)?;
        }
        let shape = video::read_frame(&paths[0].0, &paths[0].1, unit)?.shape();
        let total = paths.len() * flags.repeat as usize;
        let folder = Folder {
            paths,
            unit,
            invert: flags.seen.invert(),
            kept: Vec::new(),
            next: 0,
            total,
        };
        Ok((Input::Folder(folder), shape))
    }

    fn next(&mut self) -> Result<Option<Arc<VideoFrame>>> {
        match self {
            Input::Pipe { raw, first } => match first.take() {
                Some(frame) => Ok(Some(Arc::new(frame))),
                None => Ok(raw.read(&mut std::io::stdin().lock())?.map(Arc::new)),
            },
            Input::Film(film) => Ok(film.next()?.map(Arc::new)),
            Input::Folder(folder) => folder.next(),
        }
    }
}

impl Folder {
    fn next(&mut self) -> Result<Option<Arc<VideoFrame>>> {
        if self.next == self.total {
            return Ok(None);
        }
        let at = self.next % self.paths.len();
        self.next += 1;
        if let Some(frame) = self.kept.get(at) {
            return Ok(Some(frame.clone()));
        }
        let (colour, depth) = &self.paths[at];
        let mut frame = video::read_frame(colour, depth, self.unit)?;
        if self.invert {
            frame.invert().map_err(|e| Error::file(depth, e))?;
        }
        let frame = Arc::new(frame);
        if self.total > self.paths.len() {
            self.kept.push(frame.clone());
        }
        Ok(Some(frame))
    }
}

/// Refuses near and far if depth of `unit` has no metres.
fn check_range(flags: &Video, unit: DepthUnit) -> Result<()> {
    if flags.depth.range()?.is_some() && unit == DepthUnit::Normalized {
        Err(Error::Input(
            "--near and --far are metres and normalized depth has no unit; leave them out, or name the unit by --depth-unit"
                .into(),
        ))
    } else {
        Ok(())
    }
}

fn open_pipe(flags: &Video, unit: DepthUnit) -> Result<(Input, (usize, usize))> {
    let Some((width, height)) = flags.raw else {
        return Err(Error::Input(
            "raw frames on stdin need --raw WxH, the size of their colour".into(),
        ));
    };
    let (depth_width, depth_height) = flags.raw_depth.unwrap_or((width, height));
    let raw = RawVideo {
        colour: (height, width),
        depth: (depth_height, depth_width),
        unit,
    };
    let first = raw.read(&mut std::io::stdin().lock())?;
    if first.is_none() {
        return Err(Error::Input("stdin holds no frame".into()));
    }
    Ok((Input::Pipe { raw, first }, (height, width)))
}

fn open_film(flags: &Video, unit: DepthUnit) -> Result<(Input, (usize, usize))> {
    let path = &flags.input;
    let depth = match (&flags.depth_video, flags.depth_beside, flags.seen.network()) {
        (Some(depth), false, None) => {
            check_range(flags, unit)?;
            FilmDepth::Film(Film::open(depth, Pixels::Grey)?)
        }
        (None, true, None) => FilmDepth::Beside,
        (None, false, Some(_)) => FilmDepth::Network,
        _ => {
            return Err(Error::file(
                path,
                "a film holds colour alone; its depth comes from one of --depth-video FILE, --depth-beside and --depth-network FILE",
            ));
        }
    };
    let mut film = FilmSource {
        colour: Film::open(path, Pixels::Rgb)?,
        depth,
        unit,
        invert: flags.seen.invert(),
        first: None,
        frames: film::about(path).map(|about| about.frames),
    };
    film.first = film.read()?;
    let first = film
        .first
        .as_ref()
        .ok_or_else(|| Error::file(path, "holds no picture"))?;
    let shape = first.shape();
    Ok((Input::Film(Box::new(film)), shape))
}

impl FilmSource {
    fn next(&mut self) -> Result<Option<VideoFrame>> {
        match self.first.take() {
            Some(frame) => Ok(Some(frame)),
            None => self.read(),
        }
    }

    fn read(&mut self) -> Result<Option<VideoFrame>> {
        let Some(colour) = self.colour.read()? else {
            if let FilmDepth::Film(film) = &mut self.depth
                && film.read()?.is_some()
            {
                log::warn!("the film of colour ends before that of depth; the video ends with it");
            }
            return Ok(None);
        };
        let mut frame = match &mut self.depth {
            FilmDepth::Film(film) => match film.read()? {
                None => {
                    log::warn!("the film of depth ends before that of colour; the video ends with it");
                    return Ok(None);
                }
                Some(depth) => {
                    VideoFrame::of_big_endian(colour.shape, colour.bytes, depth.shape, &depth.bytes, self.unit)
                }
            },
            FilmDepth::Beside => VideoFrame::of_halves(colour.shape, &colour.bytes)?,
            FilmDepth::Network => return Ok(Some(VideoFrame::without_depth(colour.shape, colour.bytes))),
        };
        if self.invert {
            frame.invert()?;
        }
        Ok(Some(frame))
    }
}
