//! Films (mp4 and all else that ffmpeg knows), by the `ffmpeg` that is installed: pictures out of one, pictures into
//! one.

pub mod sequence;
pub mod video;

use crate::{Error, Result, output};
use std::ffi::OsString;
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::thread::JoinHandle;

/// Endings of films' names.
const ENDINGS: [&str; 6] = ["mp4", "mov", "mkv", "webm", "avi", "m4v"];
/// What ffmpeg may open: the containers of [`ENDINGS`], each in one file. A text that lists other films, whatever its
/// name, is none of them.
const READS: [&str; 4] = ["-protocol_whitelist", "file", "-format_whitelist", "mov,matroska,avi"];
/// How much is kept of what ffmpeg writes to stderr, in bytes.
const MOST_SAID: usize = 4096;

/// `path` as ffmpeg takes it: the name of a file, not an option or another protocol, as `-x.mp4` and `concat:x.mp4`
/// are.
fn url(path: &Path) -> OsString {
    let mut url = OsString::from("file:");
    url.push(path);
    url
}

/// Whether `path` is named as a film.
pub fn is_film(path: &Path) -> bool {
    ENDINGS.iter().any(|ending| crate::output::has_extension(path, ending))
}

/// What ffmpeg is called for.
///
/// # Errors
/// No ffmpeg.
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

/// What a film says of itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct About {
    /// Frames a second.
    pub rate_hz: f64,
    /// Frames in all, as far as it knows.
    pub frames: u64,
}

/// Asks `ffprobe`; None where it does not know.
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

/// What pictures of a film are wanted as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pixels {
    /// Red, green, blue, a byte each.
    Rgb,
    /// Grey of 16 bits, big-endian.
    Grey,
}

/// The pictures of a film, one after the other, upright.
pub struct Film {
    path: std::path::PathBuf,
    ffmpeg: Child,
    pictures: BufReader<ChildStdout>,
    /// The end of what ffmpeg writes to stderr. A thread reads it all the while: a full pipe stops ffmpeg.
    said: Option<JoinHandle<String>>,
}

/// One picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// (H, W).
    pub shape: (usize, usize),
    /// Row by row, as asked.
    pub bytes: Vec<u8>,
}

impl Film {
    /// # Errors
    /// No ffmpeg, or no such file.
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

    /// The next picture; None at the end.
    ///
    /// # Errors
    /// A film that ffmpeg cannot read.
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

    /// A portable anymap's header, "P6\n640 480\n255\n": its shape, and the bytes that follow.
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

    /// Ends as ffmpeg does. It may go on over damaged parts, of which nobody else would say a word.
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

/// The last of all that `errors` gives, [`MOST_SAID`] bytes.
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
        // Where the film was not read to its end.
        let _ = self.ffmpeg.kill();
        let _ = self.ffmpeg.wait();
    }
}

/// How a film is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quality {
    /// H.264 as every player shows it.
    Seen,
    /// H.264 in RGB without loss: every level stays what it is.
    Lossless,
}

/// Makes the film at `path` of the pictures in `folder` whose names are `pattern`, as `preview_%06d.png`.
///
/// # Errors
/// No ffmpeg, or what it refuses.
pub fn write(path: &Path, folder: &Path, pattern: &str, rate_hz: f64, quality: Quality) -> Result<()> {
    check(path)?;
    output::write_by_name(path, |half| {
        let half = std::path::absolute(half).map_err(|e| Error::file(path, e))?;
        let mut command = Command::new("ffmpeg");
        command
            // In the folder, whose own name is then no part of the pattern.
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
            // Sides must be even for the colours of common players.
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
