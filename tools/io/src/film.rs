//! Reading and writing films (mp4 and every other format of ffmpeg) with the installed `ffmpeg`.

pub mod sequence;
pub mod video;

use crate::{Error, Result, output};
use std::ffi::OsString;
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::thread::JoinHandle;

/// The file extensions of films.
const ENDINGS: [&str; 6] = ["mp4", "mov", "mkv", "webm", "avi", "m4v"];
/// The inputs that ffmpeg may open: the containers of [`ENDINGS`], each in one file. This excludes text files that list
/// other films, whatever their name.
const READS: [&str; 4] = ["-protocol_whitelist", "file", "-format_whitelist", "mov,matroska,avi"];
/// The number of bytes kept from ffmpeg's stderr.
const MOST_SAID: usize = 4096;

/// Returns `path` as a file URL, so that ffmpeg does not take names such as `-x.mp4` and `concat:x.mp4` for an option
/// or another protocol.
fn url(path: &Path) -> OsString {
    let mut url = OsString::from("file:");
    url.push(path);
    url
}

/// Checks whether the extension of `path` is that of a film.
pub fn is_film(path: &Path) -> bool {
    ENDINGS.iter().any(|ending| crate::output::has_extension(path, ending))
}

/// Checks that ffmpeg, which `path` needs, is installed.
///
/// # Errors
/// Returns an error if ffmpeg is not installed.
pub fn check(path: &Path) -> Result<()> {
    let found = Command::new("ffmpeg")
        .arg("-version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    match found {
        Ok(status) if status.success() => Ok(()),
        _ => Err(Error::file(
            path,
            "films need ffmpeg, which is not installed; without it there are folders of pictures and raw frames on stdin",
        )),
    }
}

/// The frame rate and length of a film.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct About {
    /// The frame rate in Hz.
    pub rate_hz: f64,
    /// The total number of frames, as far as ffprobe can tell.
    pub frames: u64,
}

/// Asks `ffprobe` for the frame rate and length. Returns `None` if it cannot tell.
pub fn about(path: &Path) -> Option<About> {
    let output = Command::new("ffprobe")
        .args(["-v", "error", "-select_streams", "v:0", "-of", "json"])
        .args(["-show_entries", "stream=avg_frame_rate,nb_frames:format=duration"])
        .args(READS)
        .arg(url(path))
        .stdin(Stdio::null())
        .output()
        .ok()?;
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).ok()?;
    let number = |value: &serde_json::Value| value.as_str()?.parse::<f64>().ok();
    let stream = &said["streams"][0];
    let (over, under) = stream["avg_frame_rate"].as_str()?.split_once('/')?;
    let rate_hz = over.parse::<f64>().ok()? / under.parse::<f64>().ok()?;
    let counted = number(&stream["nb_frames"]);
    let frames = counted.or_else(|| Some(number(&said["format"]["duration"])? * rate_hz))?;
    (rate_hz.is_finite() && rate_hz > 0.0).then_some(About {
        rate_hz,
        frames: frames.round() as u64,
    })
}

/// The pixel format for decoding a film.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pixels {
    /// RGB with one byte per channel.
    Rgb,
    /// Grey with 16 bits, big-endian.
    Grey,
}

/// A reader for the pictures of a film, in order and upright.
pub struct Film {
    path: std::path::PathBuf,
    ffmpeg: Child,
    pictures: BufReader<ChildStdout>,
    /// The thread that drains ffmpeg's stderr, because a full pipe would block ffmpeg. It returns the end of the
    /// output.
    said: Option<JoinHandle<String>>,
}

/// One decoded picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// The height and width, (H, W).
    pub shape: (usize, usize),
    /// The pixels row by row, in the requested format.
    pub bytes: Vec<u8>,
}

impl Film {
    /// Opens a film.
    ///
    /// # Errors
    /// Returns an error if ffmpeg is not installed or the file does not exist.
    pub fn open(path: &Path, pixels: Pixels) -> Result<Self> {
        check(path)?;
        if !path.is_file() {
            return Err(Error::file(path, "there is no such file"));
        }
        output::reading(path)?;
        let (format, codec) = match pixels {
            Pixels::Rgb => ("rgb24", "ppm"),
            Pixels::Grey => ("gray16be", "pgm"),
        };
        let mut ffmpeg = Command::new("ffmpeg")
            .args(["-v", "error", "-nostdin"])
            .args(READS)
            .arg("-i")
            .arg(url(path))
            .args([
                "-map",
                "0:v:0",
                "-f",
                "image2pipe",
                "-pix_fmt",
                format,
                "-c:v",
                codec,
                "-",
            ])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| not_started(path, &e))?;
        let pictures = BufReader::new(ffmpeg.stdout.take().expect("piped"));
        let errors = ffmpeg.stderr.take().expect("piped");
        Ok(Film {
            path: path.into(),
            ffmpeg,
            pictures,
            said: Some(std::thread::spawn(move || last_said(errors))),
        })
    }

    /// Returns the next picture, or `None` at the end.
    ///
    /// # Errors
    /// Returns an error if ffmpeg cannot read the film.
    pub fn read(&mut self) -> Result<Option<Picture>> {
        let Some((shape, bytes)) = self.header()? else {
            return self.end().map(|()| None);
        };
        let mut picture = Picture {
            shape,
            bytes: vec![0; bytes],
        };
        match self.pictures.read_exact(&mut picture.bytes) {
            Ok(()) => Ok(Some(picture)),
            Err(_) => Err(Error::file(&self.path, "ends within a picture")),
        }
    }

    /// Parses the header of a portable anymap, such as "P6\n640 480\n255\n". Returns the shape and the number of bytes
    /// that follow.
    fn header(&mut self) -> Result<Option<((usize, usize), usize)>> {
        let mut lines = [const { String::new() }; 3];
        for line in &mut lines {
            let read = self.pictures.read_line(line);
            read.map_err(|e| Error::file(&self.path, format!("what ffmpeg makes of it cannot be read: {e}")))?;
        }
        let [kind, size, most] = lines.each_ref().map(|line| line.trim());
        if kind.is_empty() {
            return Ok(None);
        }
        let shape = size
            .split_once(' ')
            .and_then(|(w, h)| Some((h.parse().ok()?, w.parse().ok()?)));
        let pixel = match (kind, most) {
            ("P6", "255") => 3,
            ("P5", "65535") => 2,
            _ => 0,
        };
        match shape {
            Some((height, width)) if pixel > 0 => Ok(Some(((height, width), pixel * height * width))),
            _ => Err(Error::file(
                &self.path,
                "ffmpeg gives pictures of an unknown kind for it",
            )),
        }
    }

    /// Waits for ffmpeg and reports its errors. ffmpeg may continue past damaged parts, which this also reports.
    fn end(&mut self) -> Result<()> {
        let said = self.said.take().and_then(|thread| thread.join().ok());
        let Some(said) = said else { return Ok(()) };
        match self.ffmpeg.wait() {
            Ok(status) if status.success() => {
                if let Some(line) = last_line(&said) {
                    log::warn!("{}: may be damaged: ffmpeg says: {line}", self.path.display());
                }
                Ok(())
            }
            _ => Err(Error::file(
                &self.path,
                format!("ffmpeg cannot read it: {}", why(&said)),
            )),
        }
    }
}

/// Returns the last [`MOST_SAID`] bytes of `errors`.
fn last_said(mut errors: impl Read) -> String {
    let (mut said, mut chunk) = (Vec::new(), [0; MOST_SAID]);
    loop {
        match errors.read(&mut chunk) {
            Ok(0) => break,
            Ok(n) => {
                said.extend_from_slice(&chunk[..n]);
                said.drain(..said.len().saturating_sub(MOST_SAID));
            }
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(_) => break,
        }
    }
    String::from_utf8_lossy(&said).into_owned()
}

impl Drop for Film {
    fn drop(&mut self) {
        // The film may not have been read to its end.
        let _ = self.ffmpeg.kill();
        let _ = self.ffmpeg.wait();
    }
}

/// The encoding of a film.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quality {
    /// H.264 that every player supports.
    Seen,
    /// Lossless H.264 in RGB, which preserves every level.
    Lossless,
}

/// Encodes the pictures in `folder` whose names match `pattern`, for example `preview_%06d.png`, as the film at `path`.
///
/// # Errors
/// Returns an error if ffmpeg is not installed or fails.
pub fn write(path: &Path, folder: &Path, pattern: &str, rate_hz: f64, quality: Quality) -> Result<()> {
    check(path)?;
    output::write_by_name(path, |half| {
        let half = std::path::absolute(half).map_err(|e| Error::file(path, e))?;
        let mut command = Command::new("ffmpeg");
        command
            // ffmpeg runs in the folder, so that the folder's name is not parsed as part of the pattern.
            .current_dir(folder)
            .args([
                "-v",
                "error",
                "-nostdin",
                "-y",
                "-f",
                "image2",
                "-pattern_type",
                "sequence",
            ])
            .args(["-framerate", &rate_hz.to_string(), "-start_number", "0", "-i"])
            .arg(url(Path::new(pattern)));
        match quality {
            // The chroma format of common players needs even sides.
            Quality::Seen => command
                .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-c:v", "libx264", "-crf", "18"])
                .args(["-pix_fmt", "yuv420p", "-movflags", "+faststart"]),
            Quality::Lossless => command.args(["-c:v", "libx264rgb", "-qp", "0", "-pix_fmt", "rgb24"]),
        };
        let output = command
            .args([
                "-map_metadata",
                "-1",
                "-fflags",
                "+bitexact",
                "-flags:v",
                "+bitexact",
                "-f",
                "mp4",
            ])
            .arg(url(&half))
            .output()
            .map_err(|e| not_started(path, &e))?;
        if output.status.success() {
            return Ok(());
        }
        let said = String::from_utf8_lossy(&output.stderr);
        Err(Error::file(path, format!("ffmpeg cannot write it: {}", why(&said))))
    })
}

fn not_started(path: &Path, why: &std::io::Error) -> Error {
    Error::file(path, format!("ffmpeg cannot be started: {why}"))
}

fn why(said: &str) -> &str {
    last_line(said).unwrap_or("it does not say why")
}

fn last_line(text: &str) -> Option<&str> {
    text.lines().map(str::trim).rfind(|line| !line.is_empty())
}
