//! Reading and writing films (mp4 and every other format of ffmpeg) with the installed `ffmpeg`.

mod light;
pub mod sequence;
pub mod survey;
pub mod video;

use crate::{Error, Result, output};
use light::Light;
use phasefront::Size;
use phasefront::input::RgbEncoding;
use std::collections::BTreeMap;
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
    version(path).map(|_| ())
}

/// Returns what ffmpeg says of its version.
fn version(path: &Path) -> Result<String> {
    let said = |program: &str| {
        let output = Command::new(program).arg("-version").stdin(Stdio::null()).output();
        output.ok().filter(|output| output.status.success())
    };
    match (said("ffmpeg"), said("ffprobe")) {
        (Some(output), Some(_)) => Ok(String::from_utf8_lossy(&output.stdout).into_owned()),
        _ => Err(Error::file(
            path,
            "films need ffmpeg and its ffprobe, which are not installed; without them there are folders of pictures and raw frames on stdin",
        )),
    }
}

/// Returns the options that keep every picture of a film once, whatever times it has.
fn each_picture(version: &str) -> [&'static str; 2] {
    // -fps_mode is as old as version 5.1. Later versions drop -vsync.
    let number = version.split_whitespace().nth(2).unwrap_or_default();
    let is_old = ["0.", "1.", "2.", "3.", "4.", "5.0"]
        .iter()
        .any(|old| number.starts_with(old));
    [if is_old { "-vsync" } else { "-fps_mode" }, "passthrough"]
}

/// What ffprobe says about a film.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct About {
    /// The number of pictures in a second, in Hz: their mean where the rate varies.
    pub rate_hz: f64,
    /// The total number of pictures.
    pub frames: u64,
    /// The meaning of the colours that [`Film`] gives: those of an HDR film become those of its SDR twin.
    pub encoding: RgbEncoding,
    /// The transfer function of its light.
    light: Light,
}

impl About {
    /// Returns whether the film is for HDR displays, whose light [`Film`] maps to that of SDR displays.
    pub fn is_hdr(&self) -> bool {
        self.light == Light::Hdr
    }
}

/// Asks `ffprobe` about the film at `path`. Returns `None` if it cannot tell.
pub fn about(path: &Path) -> Option<About> {
    let mut ffprobe = Command::new("ffprobe")
        .args(["-v", "error", "-select_streams", "v:0", "-of", "compact"])
        .args([
            "-show_entries",
            "stream=avg_frame_rate,color_primaries,color_transfer:packet=pts_time,duration_time,flags",
        ])
        .args(READS)
        .arg(url(path))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .ok()?;
    let mut times = Times::default();
    let mut stream = None;
    for line in BufReader::new(ffprobe.stdout.take()?)
        .lines()
        .map_while(std::result::Result::ok)
    {
        let mut parts = line.split('|');
        let kind = parts.next();
        let values: BTreeMap<&str, &str> = parts.filter_map(|part| part.split_once('=')).collect();
        let number = |key: &str| values.get(key)?.parse::<f64>().ok();
        match kind {
            // Pictures before the beginning of an edit list are not shown.
            Some("packet") if values.get("flags").is_none_or(|flags| !flags.contains('D')) => {
                times.add(number("pts_time"), number("duration_time"));
            }
            Some("stream") => {
                let (over, under) = values.get("avg_frame_rate")?.split_once('/')?;
                let rate_hz = over.parse::<f64>().ok()? / under.parse::<f64>().ok()?;
                let light = Light::of(values.get("color_transfer").copied());
                stream = Some((rate_hz, light, encoding(values.get("color_primaries").copied(), light)));
            }
            _ => {}
        }
    }
    let _ = ffprobe.wait();
    let (said, light, encoding) = stream?;
    let counted = times.rate_hz();
    // The container's rate is exact where pictures have a constant rate. Some containers state another one than their
    // pictures have.
    let is_said = said.is_finite() && counted.is_none_or(|counted| (counted / said - 1.0).abs() < 1e-3);
    let rate_hz = if is_said { said } else { counted? };
    (rate_hz.is_finite() && rate_hz > 0.0).then_some(About {
        rate_hz,
        frames: times.pictures,
        encoding,
        light,
    })
}

/// Returns the meaning of the colours of a film for which ffprobe says these primaries, after its light became that of
/// an SDR display. The curve of BT.709 is shown as that of sRGB is.
fn encoding(primaries: Option<&str>, light: Light) -> RgbEncoding {
    match (light, primaries) {
        (Light::Sdr, Some("bt2020")) => RgbEncoding::Bt2020,
        (Light::Sdr, Some("smpte432")) => RgbEncoding::DisplayP3,
        _ => RgbEncoding::Srgb,
    }
}

/// The times of a film's pictures in seconds.
#[derive(Default)]
struct Times {
    pictures: u64,
    first: Option<f64>,
    /// The time of the last picture, and how long it is shown, if the film says so.
    last: Option<(f64, Option<f64>)>,
}

impl Times {
    fn add(&mut self, time: Option<f64>, duration: Option<f64>) {
        self.pictures += 1;
        let Some(time) = time else { return };
        self.first = Some(self.first.map_or(time, |first| first.min(time)));
        if self.last.is_none_or(|(last, _)| time >= last) {
            self.last = Some((time, duration.filter(|duration| *duration > 0.0)));
        }
    }

    /// Returns the number of pictures in a second.
    fn rate_hz(&self) -> Option<f64> {
        let (first, (last, duration)) = (self.first?, self.last?);
        match duration {
            Some(duration) => Some(self.pictures as f64 / (last + duration - first)),
            None => Some((self.pictures - 1) as f64 / (last - first)),
        }
    }
}

/// The pixel format for decoding a film.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pixels {
    /// RGB with one byte per channel.
    Rgb,
    /// RGB with 16 bits per channel, big-endian.
    DeepRgb,
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
    /// Whether the film is opened once more, and what ffmpeg says of damage is told then.
    is_survey: bool,
}

/// One decoded picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// The size in pixels.
    pub size: Size,
    /// The pixels row by row, in the requested format.
    pub bytes: Vec<u8>,
}

impl Film {
    /// Opens a film. Its pictures come in order, each once, whatever its frame rate. Colour of HDR films, HLG and PQ,
    /// is mapped to that of their SDR twins.
    ///
    /// # Errors
    /// Returns an error if ffmpeg is not installed, or lacks what an HDR film needs, or the file does not exist.
    pub fn open(path: &Path, pixels: Pixels, about: Option<&About>) -> Result<Self> {
        let light = about.map_or(Light::Sdr, |about| about.light);
        let filter = match pixels {
            Pixels::Rgb => light.to_sdr(path)?,
            _ => None,
        };
        Self::start(path, pixels, filter.as_deref(), &[], &[])
    }

    /// Opens a film for a look at up to `most` of its pictures: those that decode alone.
    fn survey(path: &Path, pixels: Pixels, filter: Option<&str>, most: u32) -> Result<Self> {
        let most = most.to_string();
        let mut film = Self::start(path, pixels, filter, &["-skip_frame", "nokey"], &["-frames:v", &most])?;
        film.is_survey = true;
        Ok(film)
    }

    fn start(path: &Path, pixels: Pixels, filter: Option<&str>, before: &[&str], after: &[&str]) -> Result<Self> {
        let version = version(path)?;
        if !path.is_file() {
            return Err(Error::file(path, "there is no such file"));
        }
        output::reading(path)?;
        let (format, codec) = match pixels {
            Pixels::Rgb => ("rgb24", "ppm"),
            Pixels::DeepRgb => ("rgb48be", "ppm"),
            Pixels::Grey => ("gray16be", "pgm"),
        };
        let mut ffmpeg = Command::new("ffmpeg")
            .args(["-v", "error", "-nostdin"])
            .args(READS)
            .args(before)
            .arg("-i")
            .arg(url(path))
            .args(["-map", "0:v:0"])
            .args(filter.iter().flat_map(|filter| ["-vf", *filter]))
            .args(each_picture(&version))
            .args(after)
            .args(["-f", "image2pipe", "-pix_fmt", format, "-c:v", codec, "-"])
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
            is_survey: false,
        })
    }

    /// Returns the next picture, or `None` at the end.
    ///
    /// # Errors
    /// Returns an error if ffmpeg cannot read the film.
    pub fn read(&mut self) -> Result<Option<Picture>> {
        let Some((size, bytes)) = self.header()? else {
            return self.end().map(|()| None);
        };
        let mut picture = Picture {
            size,
            bytes: vec![0; bytes],
        };
        match self.pictures.read_exact(&mut picture.bytes) {
            Ok(()) => Ok(Some(picture)),
            Err(_) => Err(Error::file(&self.path, "ends within a picture")),
        }
    }

    /// Parses the header of a portable anymap, such as "P6\n640 480\n255\n". Returns the size and the number of bytes
    /// that follow.
    fn header(&mut self) -> Result<Option<(Size, usize)>> {
        let mut lines = [const { String::new() }; 3];
        for line in &mut lines {
            let read = self.pictures.read_line(line);
            read.map_err(|e| Error::file(&self.path, format!("what ffmpeg makes of it cannot be read: {e}")))?;
        }
        let [kind, size, most] = lines.each_ref().map(|line| line.trim());
        if kind.is_empty() {
            return Ok(None);
        }
        let size = size.split_once(' ').and_then(|(width, height)| {
            Some(Size {
                width: width.parse().ok()?,
                height: height.parse().ok()?,
            })
        });
        let pixel = match (kind, most) {
            ("P6", "255") => 3,
            ("P6", "65535") => 6,
            ("P5", "65535") => 2,
            _ => 0,
        };
        match size {
            Some(size) if pixel > 0 => Ok(Some((size, pixel * size.pixels()))),
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
                if let Some(line) = last_line(&said).filter(|_| !self.is_survey) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_version_of_ffmpeg_keeps_each_picture() {
        for (version, option) in [
            (
                "ffmpeg version 4.4.2-0ubuntu0.22.04.1 Copyright (c) 2000-2021",
                "-vsync",
            ),
            ("ffmpeg version 5.0 Copyright", "-vsync"),
            ("ffmpeg version 5.1.9-0+deb12u1 Copyright (c) 2000-2026", "-fps_mode"),
            ("ffmpeg version n8.0 Copyright", "-fps_mode"),
            ("ffmpeg version N-112345-g0123456789 Copyright", "-fps_mode"),
        ] {
            assert_eq!(each_picture(version), [option, "passthrough"], "{version}");
        }
    }

    #[test]
    fn the_rate_of_varying_times_is_their_mean() {
        let rate = |times: &[(f64, Option<f64>)]| {
            let mut all = Times::default();
            times
                .iter()
                .for_each(|(time, duration)| all.add(Some(*time), *duration));
            all.rate_hz()
        };
        assert_eq!(rate(&[(0.0, Some(0.1)), (0.5, Some(0.1)), (0.1, Some(0.4))]), Some(5.0));
        assert_eq!(rate(&[(2.0, None), (2.25, None), (3.0, None)]), Some(2.0));
        assert_eq!(rate(&[]), None);
    }
}
