//! `phasefront video`: makes phase maps and previews of RGB-D frames, one after another or as a live stream.

mod sink;
mod source;

use crate::flags::backend::BackendFlags;
use crate::flags::colours::ColourFlags;
use crate::flags::depth::DepthFlags;
use crate::flags::frame::{SeenDepthFlags, warn_of_size};
use crate::flags::method::{CoreMethod, HologramFlags};
use crate::given::{Flag, SOURCE};
use crate::make;
use crate::record::{Before, RunRecord};
use clap::{ArgGroup, Args, ValueEnum};
use phasefront::Size;
use phasefront::input::DepthRange;
use phasefront::session::{Event, Quality, Statistics};
use phasefront::{Brightness, Hologram, LiveSession, SessionOptions, VideoSession};
use phasefront_cli::frame_statistics::{FrameStatistics, rounded_ms};
use phasefront_cli::gpu;
use phasefront_command::flags::parse_size;
use phasefront_command::terminal;
use phasefront_io::hologram::{self, HologramInfo};
use phasefront_io::{Error, Result, film};
use serde_json::json;
use sink::Sink;
use source::Source;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};

/// Make phase maps and previews of RGB-D video
#[derive(Args)]
#[command(group = ArgGroup::new(SOURCE).multiple(true))]
pub(crate) struct Video {
    /// Folder of color_0.jpg and depth_0.png, color_1.jpg and depth_1.png …, of folders rgb and depth with equal names,
    /// or in the layout of TUM's or Redwood's data sets; a film (.mp4, by ffmpeg); or - for raw frames on stdin. All
    /// frames must have one size
    input: PathBuf,
    /// Names of a folder's colour and depth files, where each * stands for the same text: 'left_*.png,left_*_z.png'
    #[arg(long, group = SOURCE, value_name = "COLOUR,DEPTH", help_heading = "Input")]
    pairs: Option<String>,
    /// Film in grey with the depth of the input film
    #[arg(long, group = SOURCE, value_name = "FILE", help_heading = "Input")]
    depth_video: Option<PathBuf>,
    /// Take the depth of a film from the right half of its pictures, in grey; a margin in their middle is left out
    #[arg(long, group = SOURCE, conflicts_with_all = ["depth_unit", "depth_scale", "near", "far"], help_heading = "Input")]
    depth_beside: bool,
    #[command(flatten)]
    colours: ColourFlags,
    #[command(flatten)]
    seen: SeenDepthFlags,
    /// Size of the colour of raw frames on stdin, rows of RGB bytes
    #[arg(long, group = SOURCE, value_name = "WxH", value_parser = parse_size, help_heading = "Input")]
    raw: Option<Size>,
    /// Size of the depth of raw frames on stdin, rows of 16-bit little-endian numbers [default: the colour's]
    #[arg(long, group = SOURCE, value_name = "WxH", value_parser = parse_size, requires = "raw", help_heading = "Input")]
    raw_depth: Option<Size>,
    #[command(flatten)]
    depth: DepthFlags,
    /// Method for the holograms [default: auto; network with --network or --encoder deep]
    #[arg(long, value_enum, help_heading = "Method")]
    method: Option<CoreMethod>,
    /// Size of the holograms [default: the size of the first frame's colour]
    #[arg(long, value_name = "WxH", value_parser = parse_size, help_heading = "Display")]
    size: Option<Size>,
    #[command(flatten)]
    hologram: HologramFlags,
    #[command(flatten)]
    backend: BackendFlags,
    /// Amplitude that full light stands for
    #[arg(long, value_enum, default_value_t = BrightnessName::Smoothed, help_heading = "Expert")]
    brightness: BrightnessName,
    /// Frames per second of the input [default: a film's own rate, else 30]
    #[arg(long, value_name = "N", help_heading = "Input")]
    rate: Option<f64>,
    /// Submit frames at the input's rate and drop those for which there is no time
    #[arg(long, help_heading = "Input")]
    live: bool,
    /// Let a live stream step down to half and a quarter of the resolution if it cannot hold the rate
    #[arg(long, requires = "live", help_heading = "Input")]
    adaptive: bool,
    /// Let what stands still keep its wave, as --live does: a frame computes only what has changed by more than a
    /// camera's noise
    #[arg(long, help_heading = "Method")]
    keep_standing: bool,
    /// Number of times to show the frames of a folder
    #[arg(long, group = SOURCE, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..), help_heading = "Input")]
    repeat: u32,
    /// Also write a preview of each hologram, focused at this z
    #[arg(
        long,
        value_name = "MM",
        allow_negative_numbers = true,
        requires = "output",
        help_heading = "Output"
    )]
    preview_mm: Option<f64>,
    /// Continue an earlier run with the same flags and input
    #[arg(long, requires = "output", conflicts_with_all = ["live", "overwrite"])]
    resume: bool,
    /// Replace the files of an earlier run
    #[arg(long, requires = "output")]
    overwrite: bool,
    /// Output folder: phase_000000.png …, preview_000000.png …, request.json, statistics.json; for NAME.mp4 the folder
    /// NAME, with a film of the previews and the lossless NAME-phases.mp4 beside it. Required unless --live or --json
    /// is given, which report without it
    #[arg(short, long, value_name = "DIR|NAME.mp4")]
    output: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum BrightnessName {
    /// 99.9th percentile of the amplitudes, smoothed over time
    Smoothed,
    /// Largest amplitude of each frame
    Max,
}

impl Video {
    pub(crate) fn run(mut self, threads: Option<NonZeroUsize>, json: bool, flags: &[Flag]) -> Result<()> {
        if self.output.is_none() && !self.live && !json {
            return Err(Error::Usage(
                "no output is asked for: -o DIR writes the holograms; --json alone reports how long they took".into(),
            ));
        }
        check_rate(self.rate)?;
        let before = Before::of_flags(self.resume, self.overwrite);
        let (mut source, size) = Source::open(&mut self)?;
        let rate = self.rate.or(source.rate_hz()).unwrap_or(30.0);
        check_rate(Some(rate))?;
        let (options, info) = self.options(size, threads, rate)?;
        let preview_mm = self.preview_mm();
        if let Some(mm) = preview_mm {
            hologram::check_z(&info.display, mm / 1e3)?;
        }
        let record = self.record(flags, &info.display, rate)?;
        let mut sink = Sink::new(
            self.output.as_deref(),
            preview_mm.map(|mm| mm / 1e3),
            info,
            before,
            record,
        )?;
        sink.expect_interrupts(self.live);
        let bar = source.progress();
        let start = Instant::now();
        let memory = memory_mb();
        let statistics = if self.live {
            self.live(options, &mut source, &mut sink, &bar, rate)?
        } else {
            self.one_by_one(options, &mut source, &mut sink, &bar, rate)?
        };
        let seconds = start.elapsed().as_secs_f64();
        bar.finish_and_clear();
        sink.finish(rate)?;
        self.report(json, &statistics, seconds, &sink, [memory, memory_mb()])
    }

    /// Returns the z of the previews. A film needs previews, so it has a default z.
    fn preview_mm(&self) -> Option<f64> {
        let film = self.output.as_deref().filter(|path| film::is_film(path));
        self.preview_mm.or(film.map(|_| 0.0))
    }

    /// Records all flags that affect the output, with the values that folders, films and defaults give them.
    fn record(&self, flags: &[Flag], display: &phasefront::Display, rate: f64) -> Result<RunRecord> {
        let mut record = RunRecord::new("video", flags)?;
        self.depth.record(&mut record);
        record.choice("--method", Some(&self.hologram.method(self.method)));
        record.display(self.hologram.display.name(), display)?;
        record.set("--rate", Some(rate));
        record.set("--preview-mm", self.preview_mm());
        Ok(record)
    }

    fn options(
        &self,
        colour: Size,
        threads: Option<NonZeroUsize>,
        rate: f64,
    ) -> Result<(SessionOptions, HologramInfo)> {
        let file = self.colours.display(&self.hologram.display)?;
        let modulator = &file.target.display;
        if self.size.is_none() {
            let Size { width, height } = modulator.size();
            let flag = format!("--size {width}x{height}");
            warn_of_size(colour, modulator, self.hologram.display.is_given(), &flag);
        }
        let size = self.size.unwrap_or(colour);
        let (mut options, encoder) =
            make::session::options(&self.hologram, self.method, (&file, size), &self.backend, threads)?;
        options.encoder.brightness = match self.brightness {
            BrightnessName::Smoothed => Brightness::Smoothed,
            BrightnessName::Max => Brightness::FrameMax,
        };
        options.keep_standing = self.keep_standing || self.live;
        options.depth.range = match self.depth.range()? {
            None => DepthRange::Percentiles,
            Some((near_m, far_m)) => DepthRange::Fixed { near_m, far_m },
        };
        options.depth_network = self.seen.open(size)?.map(Arc::new);
        if self.adaptive {
            options.quality = Quality::Adaptive;
            options.target_rate_hz = Some(rate);
            for part in [2, 4] {
                let mut quality_level = options.quality_levels[0].clone();
                quality_level.size = Size {
                    width: (size.width / part).max(1),
                    height: (size.height / part).max(1),
                };
                options.quality_levels.push(quality_level);
            }
        }
        let info = HologramInfo {
            display: options.target.display.clone(),
            ..make::levels_info(&file, encoder.name, None) // The frames say their scale and colours.
        };
        Ok((options, info))
    }

    /// Processes every frame in sequence.
    fn one_by_one(
        &self,
        options: SessionOptions,
        source: &mut Source,
        sink: &mut Sink,
        bar: &indicatif::ProgressBar,
        rate: f64,
    ) -> Result<Statistics> {
        // Steps and what stands still keep more than a replay restores.
        let keeps_more = options.keep_standing || options.encoder.midpoint_steps + options.encoder.focus_steps > 0;
        let backend = options.backend;
        let session = VideoSession::new(options)?;
        gpu::warm_up(session.handle(), backend)?;
        let mut resuming = sink.resumes();
        let mut frame = 0;
        while let Some(read) = source.next()? {
            let named = |e: phasefront::Error| Error::Input(format!("{}: {e}", source.name(frame)));
            let image = read.camera_frame(timestamp_ns(frame, rate))?;
            let written = if resuming { sink.written(&read)? } else { None };
            resuming = written.is_some();
            match written {
                Some(scale) if keeps_more => {
                    session.process(&image).map_err(named)?;
                    sink.skip(scale);
                }
                Some(scale) => {
                    session.replay(&image, scale).map_err(named)?;
                    sink.skip(scale);
                }
                None => sink.take(&session.process(&image).map_err(named)?, Some(&read))?,
            }
            frame += 1;
            bar.inc(1);
        }
        Ok(session.statistics())
    }

    /// Submits frames at their rate, as a camera does.
    fn live(
        &self,
        options: SessionOptions,
        source: &mut Source,
        sink: &mut Sink,
        bar: &indicatif::ProgressBar,
        rate: f64,
    ) -> Result<Statistics> {
        // Another thread writes the results. If writing is too slow, the session's thread waits and drops frames.
        let (sender, results) = mpsc::sync_channel::<Hologram>(2);
        let failure = Arc::new(Mutex::new(None));
        let listener = {
            let (bar, failure) = (bar.clone(), failure.clone());
            move |event| match event {
                Event::Processed(hologram) => {
                    bar.inc(1);
                    // The writer ends only when this thread does, so sending does not fail.
                    let _ = sender.send(hologram);
                }
                Event::Dropped { .. } => bar.inc(1),
                Event::Failed { timestamp_ns, error } => {
                    bar.inc(1);
                    let mut failure = failure.lock().unwrap_or_else(|e| e.into_inner());
                    failure.get_or_insert((timestamp_ns, error));
                }
                Event::QualityChanged { from, to, reason, .. } => {
                    bar.println(format!("quality level {from} to {to}: {reason:?}"));
                }
                _ => {}
            }
        };
        let backend = options.backend;
        let session = LiveSession::new(options, listener)?;
        gpu::warm_up(session.handle(), backend)?;
        let (submitted, written) = std::thread::scope(|scope| {
            let writer = scope.spawn(move || {
                let mut result = Ok(());
                for hologram in results {
                    if result.is_ok() {
                        result = sink.take(&hologram, None);
                    }
                }
                result
            });
            let submitted = submit_all(&session, source, rate);
            session.close();
            let statistics = session.statistics();
            // Dropping the session drops the listener and the channel, so the writer ends.
            drop(session);
            let written = writer.join();
            (submitted.map(|()| statistics), written)
        });
        written.map_err(|_| Error::Input("the writer of results panicked".into()))??;
        let statistics = submitted?;
        if let Some((timestamp_ns, error)) = failure.lock().unwrap_or_else(|e| e.into_inner()).take() {
            let frame = (timestamp_ns as f64 * rate / 1e9).round() as usize;
            log::warn!(
                "{} frames failed, the first {}: {error}",
                statistics.failed,
                source.name(frame)
            );
        }
        Ok(statistics)
    }

    fn report(
        &self,
        json: bool,
        statistics: &Statistics,
        seconds: f64,
        sink: &Sink,
        memory_mb: [Option<f64>; 2],
    ) -> Result<()> {
        let stages: serde_json::Map<_, _> = (statistics.times.stages().into_iter())
            .map(|(stage, time)| (stage.to_owned(), json!(rounded_ms(time))))
            .collect();
        let s = statistics;
        let scales = &sink.scales;
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
            "stage_ms": stages, "total_ms": rounded_ms(s.times.total()), "frame_times": FrameStatistics::of(&sink.times), "backend": s.backend.name,
            "backend_reason": s.backend.why, "quality_level": s.quality_level, "scale_change": change, "memory_mb": memory_mb,
        });
        sink.write_report(&result)?;
        terminal::print(
            json,
            &result,
            format!(
                "{} of {} frames in {seconds:.1} s, {:.1} a second; {} dropped, {} failed; {:.1} ms a frame",
                s.processed,
                s.submitted,
                s.processed as f64 / seconds,
                s.dropped.total(),
                s.failed,
                rounded_ms(s.times.total())
            ),
        );
        Ok(())
    }
}

fn check_rate(rate_hz: Option<f64>) -> Result<()> {
    match rate_hz {
        Some(rate) if !(rate.is_finite() && rate > 0.0 && rate <= 1000.0) => Err(Error::Usage(format!(
            "--rate {rate}: it must lie above 0 and up to 1000"
        ))),
        _ => Ok(()),
    }
}

fn timestamp_ns(frame: usize, rate_hz: f64) -> u64 {
    (frame as f64 * 1e9 / rate_hz) as u64
}

fn submit_all(session: &LiveSession, source: &mut Source, rate_hz: f64) -> Result<()> {
    let paced = source.is_stored();
    let start = Instant::now();
    let mut frame = 0;
    while let Some(image) = source.next()? {
        let timestamp = timestamp_ns(frame, rate_hz);
        if paced {
            // A pipe delivers frames at its camera's rate. Frames from files wait until they are due.
            let due = start + Duration::from_nanos(timestamp);
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
        }
        session.submit(&image.camera_frame(timestamp)?)?;
        frame += 1;
    }
    Ok(())
}

/// Returns the memory in use in MB, or `None` if the system does not report it.
fn memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    let kb: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some((kb / 1024.0).round())
}
