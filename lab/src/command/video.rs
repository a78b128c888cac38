//! `phasefront video`: RGB-D frames to phase maps and previews, one after another or as a live stream.

use super::flags::{BackendFlags, DepthFlags, DisplayFlags, EncoderFlags, parse_size, progress_bar};
use super::hologram::PrecisionName;
use super::method::{CoreMethod, Parts};
use clap::{Args, ValueEnum};
use ndarray::ArrayView3;
use phasefront::input::DepthRange;
use phasefront::session::{Backend, Event, Quality, RunningMode, Statistics};
use phasefront::unstable::depth::DepthUnit;
use phasefront::{Brightness, Hologram, Session, SessionOptions, Sweep, Target};
use phasefront_lab::files::{self, HologramInfo};
use phasefront_lab::video::{self, RawVideo, VideoFrame};
use phasefront_lab::{Error, Result, gpu};
use serde_json::json;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};

/// Make phase maps and previews of RGB-D video
#[derive(Args)]
pub(crate) struct Video {
    /// Folder of color_0.jpg and depth_0.png, color_1.jpg and depth_1.png …; or - for raw frames on stdin
    input: PathBuf,
    /// Raw frames on stdin: size of their colour, rows of RGB bytes
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    raw: Option<(usize, usize)>,
    /// Raw frames on stdin: size of their depth, rows of 16-bit little-endian numbers [default: the colour's]
    #[arg(long, value_name = "WxH", value_parser = parse_size, requires = "raw")]
    raw_depth: Option<(usize, usize)>,
    #[command(flatten)]
    depth: DepthFlags,
    /// How the holograms are made
    #[arg(long, value_enum, default_value_t = CoreMethod::Network)]
    method: CoreMethod,
    /// A network that comes along, or an ONNX file [default: 8]
    #[arg(long, value_name = "ddpm-8|8|15|FILE")]
    network: Option<String>,
    /// Numbers that a network which comes along computes in
    #[arg(long, value_enum, default_value_t = PrecisionName::Int8)]
    precision: PrecisionName,
    #[command(flatten)]
    encoder: EncoderFlags,
    /// Size of the holograms [default: the first frame's colour]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<(usize, usize)>,
    #[command(flatten)]
    display: DisplayFlags,
    #[command(flatten)]
    backend: BackendFlags,
    /// Which amplitude full light stands for
    #[arg(long, value_enum, default_value_t = BrightnessName::Steady)]
    brightness: BrightnessName,
    /// Frames a second of the input
    #[arg(long, value_name = "N", default_value_t = 30.0)]
    rate: f64,
    /// Submit frames at that rate and drop those for which there is no time
    #[arg(long)]
    live: bool,
    /// Let a live stream step down to half and a quarter of the resolution where it cannot hold the rate
    #[arg(long, requires = "live")]
    adaptive: bool,
    /// Show the frames of a folder so many times
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
    /// Write a preview of each hologram too, focused at this z
    #[arg(long, value_name = "MM", allow_negative_numbers = true, requires = "output")]
    preview_mm: Option<f64>,
    /// Folder of what comes out: phase_000000.png …, preview_000000.png …, statistics.json
    #[arg(short, value_name = "DIR")]
    output: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum BrightnessName {
    /// What all but one pixel of a thousand stay under, smoothed over time
    Steady,
    /// Each frame's largest
    Max,
}

/// Frames from where they come.
enum Source {
    Folder {
        paths: Vec<(PathBuf, PathBuf)>,
        unit: DepthUnit,
        /// Frames that were read, where they are shown again.
        kept: Vec<Arc<VideoFrame>>,
        next: usize,
        total: usize,
    },
    Pipe {
        raw: RawVideo,
        first: Option<VideoFrame>,
    },
}

impl Source {
    fn next(&mut self) -> Result<Option<Arc<VideoFrame>>> {
        match self {
            Source::Pipe { raw, first } => match first.take() {
                Some(frame) => Ok(Some(Arc::new(frame))),
                None => Ok(raw.read(&mut std::io::stdin().lock())?.map(Arc::new)),
            },
            Source::Folder {
                paths,
                unit,
                kept,
                next,
                total,
            } => {
                if next == total {
                    return Ok(None);
                }
                let at = *next % paths.len();
                *next += 1;
                if let Some(frame) = kept.get(at) {
                    return Ok(Some(frame.clone()));
                }
                let (colour, depth) = &paths[at];
                let frame = Arc::new(video::read_frame(colour, depth, *unit)?);
                if *total > paths.len() {
                    kept.push(frame.clone());
                }
                Ok(Some(frame))
            }
        }
    }

    fn total(&self) -> u64 {
        match self {
            Source::Folder { total, .. } => *total as u64,
            Source::Pipe { .. } => 0,
        }
    }
}

/// Writes what comes out, and keeps what the report needs.
struct Sink {
    output: Option<PathBuf>,
    preview_z_m: Option<f64>,
    info: HologramInfo,
    scales: Vec<f32>,
}

impl Sink {
    fn take(&mut self, hologram: &Hologram) -> Result<()> {
        let index = self.scales.len();
        self.scales.push(hologram.scale());
        let Some(dir) = &self.output else {
            return Ok(());
        };
        let (height, width) = hologram.shape();
        let levels =
            ArrayView3::from_shape((3, height, width), hologram.levels()).map_err(|e| Error::Input(e.to_string()))?;
        let info = HologramInfo {
            scale: Some(hologram.scale()),
            ..self.info.clone()
        };
        files::write_phase_only(&dir.join(format!("phase_{index:06}.png")), levels, &info)?;
        if let Some(z_m) = self.preview_z_m {
            let mut rgba = vec![0; 4 * height * width];
            hologram.preview(z_m, height, width, &mut rgba)?;
            let path = dir.join(format!("preview_{index:06}.png"));
            files::write_rgba(&path, width, height, &rgba)?;
        }
        Ok(())
    }
}

/// A session that is warm. Where the GPU was asked for and does not serve, that is said; where it does, what was
/// compiled for it is kept.
fn start(options: SessionOptions, mode: RunningMode) -> Result<Session> {
    let asked = options.backend;
    let session = Session::new(options, mode)?;
    session.warm_up()?;
    match session.gpu() {
        Some(device) => gpu::keep_programs(&device),
        None if asked == Backend::Gpu => {
            log::warn!("on the CPU: {}", session.statistics().backend.why);
        }
        None => {}
    }
    Ok(session)
}

impl Video {
    pub(crate) fn run(self, threads: Option<NonZeroUsize>, json: bool) -> Result<()> {
        if !(self.rate.is_finite() && self.rate > 0.0 && self.rate <= 1000.0) {
            return Err(Error::Input(format!(
                "--rate {}: it must lie above 0 and up to 1000",
                self.rate
            )));
        }
        let unit = self.depth.options().unit;
        let (mut source, (height, width)) = self.source(unit)?;
        let (options, info) = self.options(height, width, threads)?;
        if let Some(dir) = &self.output {
            std::fs::create_dir_all(dir).map_err(|e| Error::file(dir, e))?;
        }
        let mut sink = Sink {
            output: self.output.clone(),
            preview_z_m: self.preview_mm.map(|mm| mm / 1e3),
            info,
            scales: Vec::new(),
        };
        let bar = progress_bar(source.total(), "frames");
        let start = Instant::now();
        let memory = memory_mb();
        let statistics = match self.live {
            true => self.live(options, &mut source, &mut sink, &bar)?,
            false => self.one_by_one(options, &mut source, &mut sink, &bar)?,
        };
        let seconds = start.elapsed().as_secs_f64();
        bar.finish_and_clear();
        self.report(json, &statistics, seconds, &sink.scales, [memory, memory_mb()])
    }

    fn source(&self, unit: DepthUnit) -> Result<(Source, (usize, usize))> {
        if self.input.as_os_str() == "-" {
            let Some((width, height)) = self.raw else {
                return Err(Error::Input(
                    "raw frames on stdin need --raw WxH, the size of their colour".into(),
                ));
            };
            let (depth_width, depth_height) = self.raw_depth.unwrap_or((width, height));
            let raw = RawVideo {
                colour: (height, width),
                depth: (depth_height, depth_width),
                unit,
            };
            let first = raw.read(&mut std::io::stdin().lock())?;
            if first.is_none() {
                return Err(Error::Input("stdin holds no frame".into()));
            }
            return Ok((Source::Pipe { raw, first }, (height, width)));
        }
        if self.raw.is_some() {
            return Err(Error::Input("--raw is for frames on stdin; give - as input".into()));
        }
        let paths = video::frames_of_folder(&self.input)?;
        let shape = video::read_frame(&paths[0].0, &paths[0].1, unit)?.shape();
        let total = paths.len() * self.repeat as usize;
        let source = Source::Folder {
            paths,
            unit,
            kept: Vec::new(),
            next: 0,
            total,
        };
        Ok((source, shape))
    }

    fn options(
        &self,
        height: usize,
        width: usize,
        threads: Option<NonZeroUsize>,
    ) -> Result<(SessionOptions, HologramInfo)> {
        let file = self.display.read()?;
        let (width, height) = self.size.unwrap_or((width, height));
        let modulator = &file.target.display;
        if let Some(light) = &file.target.illumination
            && (height, width) != (modulator.height(), modulator.width())
        {
            let (rows, columns) = light.nodes();
            return Err(Error::Input(format!(
                "the display's laser map ({columns}×{rows} nodes) is for {}×{} pixels, the frames are {width}×{height}; give --size or leave the map out",
                modulator.width(),
                modulator.height()
            )));
        }
        let target = file.corrected()?;
        let target = Target {
            display: target.display.with_size(height, width)?,
            response: target.response.centred(height, width)?,
            ..target
        };
        let display = target.display.clone();
        let (method, encoder) = self.method.of(&Parts {
            network: self.network.as_deref(),
            precision: self.precision.precision(),
            display: &display,
            sweep: Sweep::for_display(&display),
            encoder: &self.encoder,
        })?;
        let mut options = SessionOptions::new(target, method);
        options.encoder = encoder.options;
        options.encoder.brightness = match self.brightness {
            BrightnessName::Steady => Brightness::Steady,
            BrightnessName::Max => Brightness::FrameMax,
        };
        let depth = self.depth.options();
        options.depth.range = match (depth.near_m, depth.far_m) {
            (None, None) => DepthRange::Percentiles,
            (Some(near_m), Some(far_m)) => DepthRange::Fixed { near_m, far_m },
            _ => {
                return Err(Error::Input("video needs both --near and --far, or neither".into()));
            }
        };
        if let Some(device) = self.backend.device()? {
            options.backend = Backend::Gpu;
            options.gpu.device = device;
        }
        options.threads = threads;
        options.quality = Quality::Fixed(0);
        if self.adaptive {
            options.quality = Quality::Adaptive;
            options.target_rate_hz = Some(self.rate);
            for part in [2, 4] {
                let mut rung = options.ladder[0].clone();
                rung.height = (height / part).max(1);
                rung.width = (width / part).max(1);
                options.ladder.push(rung);
            }
        }
        let info = HologramInfo {
            display,
            encoder: Some(encoder.name.into()),
            scale: None,
            lut: file.lut.map(Vec::from),
            calibrated: file.calibrated(true),
        };
        Ok((options, info))
    }

    fn timestamp_ns(&self, frame: u64) -> u64 {
        (frame as f64 * 1e9 / self.rate) as u64
    }

    /// Every frame answered.
    fn one_by_one(
        &self,
        options: SessionOptions,
        source: &mut Source,
        sink: &mut Sink,
        bar: &indicatif::ProgressBar,
    ) -> Result<Statistics> {
        let session = start(options, RunningMode::Video)?;
        let mut frame = 0;
        while let Some(image) = source.next()? {
            sink.take(&session.process(&image.camera_frame(self.timestamp_ns(frame))?)?)?;
            frame += 1;
            bar.inc(1);
        }
        Ok(session.statistics())
    }

    /// Frames at their rate, as a camera gives them.
    fn live(
        &self,
        options: SessionOptions,
        source: &mut Source,
        sink: &mut Sink,
        bar: &indicatif::ProgressBar,
    ) -> Result<Statistics> {
        // Results are written beside the session's thread; where writing is too slow, it waits and drops frames.
        let (sender, results) = mpsc::sync_channel::<Hologram>(2);
        let failure = Arc::new(Mutex::new(None));
        let listener = {
            let (bar, failure) = (bar.clone(), failure.clone());
            move |event| match event {
                Event::Hologram(hologram) => {
                    bar.inc(1);
                    // The writer ends only when this thread does.
                    let _ = sender.send(hologram);
                }
                Event::Dropped { .. } => bar.inc(1),
                Event::Failed { timestamp_ns, error } => {
                    bar.inc(1);
                    let mut failure = failure.lock().unwrap_or_else(|e| e.into_inner());
                    failure.get_or_insert((timestamp_ns, error));
                }
                Event::QualityChanged { change, .. } => {
                    bar.println(format!("rung {} to {}: {:?}", change.from, change.to, change.reason))
                }
                _ => {}
            }
        };
        let session = start(options, RunningMode::Live(Box::new(listener)))?;
        let (submitted, written) = std::thread::scope(|scope| {
            let writer = scope.spawn(move || {
                let mut result = Ok(());
                for hologram in results {
                    if result.is_ok() {
                        result = sink.take(&hologram);
                    }
                }
                result
            });
            let submitted = self.submit_all(&session, source);
            session.close();
            let statistics = session.statistics();
            // The listener, and with it the channel, goes with the session.
            drop(session);
            let written = writer.join();
            (submitted.map(|()| statistics), written)
        });
        written.map_err(|_| Error::Input("the writer of results panicked".into()))??;
        let statistics = submitted?;
        if let Some((timestamp_ns, error)) = failure.lock().unwrap_or_else(|e| e.into_inner()).take() {
            log::warn!(
                "{} frames failed, the first at {timestamp_ns} ns: {error}",
                statistics.failed
            );
        }
        Ok(statistics)
    }

    fn submit_all(&self, session: &Session, source: &mut Source) -> Result<()> {
        let paced = matches!(source, Source::Folder { .. });
        let start = Instant::now();
        let mut frame = 0;
        while let Some(image) = source.next()? {
            let timestamp = self.timestamp_ns(frame);
            if paced {
                // A pipe's own rate is a camera's; files come when they are due.
                let due = start + Duration::from_nanos(timestamp);
                std::thread::sleep(due.saturating_duration_since(Instant::now()));
            }
            session.submit(&image.camera_frame(timestamp)?)?;
            frame += 1;
        }
        Ok(())
    }

    fn report(
        &self,
        json: bool,
        statistics: &Statistics,
        seconds: f64,
        scales: &[f32],
        memory_mb: [Option<f64>; 2],
    ) -> Result<()> {
        let ms = |time: Duration| (time.as_secs_f64() * 1e5).round() / 100.0;
        let stages: serde_json::Map<_, _> = (statistics.times.stages().into_iter())
            .map(|(stage, time)| (stage.to_owned(), json!(ms(time))))
            .collect();
        let s = statistics;
        let change = scales.windows(2).map(|pair| f64::from(pair[1] / pair[0] - 1.0).powi(2));
        let change = (change.sum::<f64>() / (scales.len().max(2) - 1) as f64).sqrt();
        let result = json!({
            "output": self.output.as_ref().map(|path| path.display().to_string()), "submitted": s.submitted, "processed": s.processed, "failed": s.failed,
            "refused": s.refused,
            "dropped": {
                "superseded": s.dropped.superseded, "above_target_rate": s.dropped.above_target_rate,
                "paused": s.dropped.paused, "reset": s.dropped.reset, "closed": s.dropped.closed,
            },
            "seconds": seconds, "rate_hz": s.processed as f64 / seconds, "recent_rate_hz": s.rate_hz,
            "stage_ms": stages, "total_ms": ms(s.times.total()), "backend": s.backend.name,
            "backend_reason": s.backend.why, "rung": s.rung, "scale_change": change, "memory_mb": memory_mb,
        });
        if let Some(dir) = &self.output {
            files::write_atomically(&dir.join("statistics.json"), |file| {
                serde_json::to_writer_pretty(&mut *file, &result)?;
                std::io::Write::write_all(file, b"\n")
            })?;
        }
        super::print(
            json,
            &result,
            format!(
                "{} of {} frames in {seconds:.1} s, {:.1} a second; {} dropped, {} failed; {:.1} ms a frame",
                s.processed,
                s.submitted,
                s.processed as f64 / seconds,
                s.dropped.total(),
                s.failed,
                ms(s.times.total())
            ),
        );
        Ok(())
    }
}

/// Memory in use, MB; None where the system does not say.
fn memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    let kb: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some((kb / 1024.0).round())
}
