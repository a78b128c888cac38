//! All stages of a session's frames, and the state from one frame to the next. This module does not decide which frame
//! is next.

use super::colour_stage::ColourStage;
use super::depth_estimates::DepthEstimates;
use super::engine::{Engine, FrameInput, GpuState, LevelContext, OnCpu};
use super::guarded::guarded;
use super::hologram::{Hologram, Pool, Pooled, Viewer};
use super::options::SessionOptions;
use super::quality::{LevelControl, Quality, QualityChange, Thermal};
use super::statistics::BackendReport;
use super::threads::{Threads, block_on};
use phasefront_core::Size;
use phasefront_core::depth;
use phasefront_core::depth::camera::CameraFrame;
use phasefront_core::depth::stream::{DepthReport, DepthStream};
use phasefront_core::display::levels::{LevelsMut, upper_bytes};
use phasefront_core::frame::{Past, RgbdFrame};
use phasefront_core::pipeline::FrameTimes;
use phasefront_core::runtime::cancel::Cancel;
use phasefront_core::runtime::clock::Instant;
use phasefront_core::runtime::error::Result;
use phasefront_core::runtime::stage::stage;
use std::sync::Arc;
use std::time::Duration;

/// The plans and memory of one quality level.
struct LevelPlan {
    engine: Engine,
    frame: RgbdFrame,
    depth: DepthStream,
    colour: ColourStage,
}

impl LevelPlan {
    /// Converts the colour and depth of `frame` to those of the hologram. Leaves the depth of pixels undecided if the
    /// engine decides it.
    fn take_in(
        &mut self,
        frame: &CameraFrame<'_>,
        past: Option<Past>,
        estimates: Option<&mut DepthEstimates>,
        cancel: &Cancel,
        times: &mut FrameTimes,
    ) -> Result<DepthReport> {
        let stage = stage!("colour");
        let size = self.frame.size();
        let (amplitude, depth) = self.frame.planes_mut();
        self.colour.read(frame, amplitude)?;
        let rgb = self.colour.edges(amplitude);
        times.colour = stage.end();
        let stage = stage!("depth");
        let report = match estimates {
            Some(estimates) if frame.depth.is_none() => {
                let picture = self.colour.picture(amplitude);
                let estimate = estimates.estimate(picture, size, past, cancel)?;
                self.depth.read_estimate(&estimate, past, rgb)?
            }
            _ => self.depth.read(frame, past, rgb)?,
        };
        if !self.engine.takes_readings() {
            self.depth.decide(rgb, depth);
        }
        times.depth = stage.end();
        Ok(report)
    }

    /// Returns the engine and its input: `camera`, which was taken in.
    fn input<'a>(&'a mut self, camera: &'a CameraFrame<'_>, past: Option<Past>) -> (&'a mut Engine, FrameInput<'a>) {
        let undecided = self.engine.takes_readings().then_some(&mut self.depth);
        let input = FrameInput {
            camera: Some(camera),
            frame: &mut self.frame,
            undecided,
            past,
        };
        (&mut self.engine, input)
    }

    /// Returns the depth of the frame that was taken in as d·65535, and its size: that of the hologram, or of the
    /// readings where the depth of pixels is undecided.
    fn depth_map(&self, pool: &Pool<u16>) -> (Pooled<u16>, Size) {
        let size = self.frame.size();
        if !self.engine.takes_readings() {
            let mut map = pool.take(size.pixels());
            depth::write_words(self.frame.values().1, &mut map.values);
            return (map, size);
        }
        let readings = self.depth.readings();
        let given = readings.size();
        let to = Size {
            width: given.width.min(size.width),
            height: given.height.min(size.height),
        };
        let mut map = pool.take(to.pixels());
        for (i, word) in map.values.iter_mut().enumerate() {
            let pixel = |i: usize, n: usize, pixels: usize| (2 * i + 1) * pixels / (2 * n);
            let (row, column) = (i / to.width, i % to.width);
            let (y, x) = (pixel(row, to.height, size.height), pixel(column, to.width, size.width));
            *word = depth::word(readings.depth_near(y, x));
        }
        (map, to)
    }
}

/// The stages of a session.
pub(super) struct Stages {
    context: LevelContext,
    /// The session's threads, shared with the viewer so that views need no other threads.
    pool: Arc<Threads>,
    level_control: LevelControl,
    /// The depth of frames without depth, if there is a network for it.
    estimates: Option<DepthEstimates>,
    /// The plan; `None` after a panic, so that it is created again.
    plan: Option<LevelPlan>,
    viewer: Arc<Viewer>,
    levels: Pool<u8>,
    words: Pool<u16>,
    depths: Pool<u16>,
}

/// The result of a frame.
pub(super) struct FrameResult {
    pub(super) hologram: Hologram,
    pub(super) change: Option<QualityChange>,
}

impl Stages {
    /// Plans the stages. Requesting `cancel` gives up the current frame.
    pub(super) async fn new(
        options: SessionOptions,
        estimates: Option<DepthEstimates>,
        cancel: Cancel,
    ) -> Result<Self> {
        let pool = Arc::new(Threads::start(options.threads)?);
        let start = match options.quality {
            Quality::Adaptive => 0,
            Quality::Fixed(quality_level) => quality_level,
        };
        // Check all quality levels now, so that one that cannot be planned is reported before the first step down.
        for (i, quality_level) in options.quality_levels.iter().enumerate().filter(|(i, _)| *i != start) {
            let planned = pool.install(|| OnCpu::check(&options, quality_level));
            planned.map_err(|why| why.of(&format!("quality level {i}")))?;
        }
        let mut stages = Stages {
            level_control: LevelControl::new(options.quality_levels.len(), start),
            estimates,
            plan: None,
            viewer: Arc::new(Viewer::new(options.target.clone(), pool.clone())),
            levels: Pool::default(),
            words: Pool::default(),
            depths: Pool::default(),
            pool,
            context: LevelContext {
                options,
                level: start,
                gpu: GpuState::default(),
                cancel,
            },
        };
        stages.plan = Some(stages.plan_level().await?);
        Ok(stages)
    }

    async fn plan_level(&mut self) -> Result<LevelPlan> {
        let _stage = stage!("plan");
        let Stages {
            context,
            pool,
            estimates,
            ..
        } = self;
        context.level = self.level_control.quality_level();
        let options = &context.options;
        let display = &options.target.display;
        let size = context.quality_level().size;
        let depth = DepthStream::new(options.depth, size)?;
        let colour = ColourStage::new(display, size, estimates.is_some());
        let frame = RgbdFrame::black(display.colours(), size);
        Ok(LevelPlan {
            engine: pool.run(async || Engine::new(context).await).await?,
            frame,
            depth,
            colour,
        })
    }

    /// Discards unfinished work after a panic.
    pub(super) fn recover(&mut self) {
        self.plan = None;
    }

    pub(super) fn quality_level(&self) -> usize {
        self.level_control.quality_level()
    }

    /// Returns the backend report if it changed since the last call.
    pub(super) fn new_report(&mut self) -> Option<BackendReport> {
        let engine = &mut self.plan.as_mut()?.engine;
        std::mem::take(&mut engine.report_is_new).then(|| engine.report())
    }

    /// Sets whether the levels of the next frame stay on the GPU, if it computes them.
    #[cfg(all(feature = "gpu", target_arch = "wasm32"))]
    pub(super) fn stay_on_gpu(&mut self, stay: bool) {
        self.context.gpu.stay = stay;
    }

    #[cfg(feature = "gpu")]
    pub(super) fn gpu(&self) -> Option<Arc<phasefront_gpu::Device>> {
        self.context.gpu.device()
    }

    /// Runs a black frame through all stages that do not need a camera's frame.
    pub(super) async fn warm_up(&mut self) -> Result<()> {
        let mut plan = self.take_plan().await?;
        let Stages {
            context, pool, levels, ..
        } = self;
        context.cancel.clear();
        let (amplitude, _) = plan.frame.planes_mut();
        amplitude.fill(0.0);
        let mut levels = levels.take(amplitude.len());
        let work = async || {
            let mut input = FrameInput {
                camera: None,
                frame: &mut plan.frame,
                undecided: None,
                past: None,
            };
            let levels = LevelsMut::Bytes(&mut levels.values);
            plan.engine.process(context, &mut input, levels).await
        };
        let result = pool.run(work).await;
        self.plan = Some(plan);
        result.map(|_| ())
    }

    async fn take_plan(&mut self) -> Result<LevelPlan> {
        match self.plan.take() {
            Some(plan) => Ok(plan),
            None => self.plan_level().await,
        }
    }

    /// Makes the hologram of `frame`, which follows another if there is a `past`.
    pub(super) async fn process(
        &mut self,
        frame: &CameraFrame<'_>,
        past: Option<Past>,
        thermal: Thermal,
        quality: Quality,
    ) -> Result<FrameResult> {
        let start = Instant::now();
        let mut plan = self.take_plan().await?;
        let made = self.run(&mut plan, frame, past).await;
        self.plan = Some(plan);
        let hologram = made?;
        let rate_hz = self.context.options.target_rate_hz;
        let period = rate_hz.map(|rate| Duration::from_secs_f64(1.0 / rate));
        let change = self.level_control.observe(start.elapsed(), period, thermal, quality);
        let change = match change {
            Some(change) => Some(self.step(change).await),
            None => None,
        };
        Ok(FrameResult { hologram, change })
    }

    /// Plans the chosen quality level; if that fails, stays at the previous one. The frame's hologram is made in both
    /// cases.
    async fn step(&mut self, change: QualityChange) -> QualityChange {
        // Free the memory of the previous quality level first.
        self.plan = None;
        if let Ok(plan) = self.plan_caught().await {
            self.plan = Some(plan);
            return change;
        }
        let change = self.level_control.refuse(change);
        // If this fails too, the next frame tries it again and returns the reason.
        self.plan = self.plan_caught().await.ok();
        change
    }

    /// Plans the chosen quality level and converts a panic to an error, where panics can be caught.
    async fn plan_caught(&mut self) -> Result<LevelPlan> {
        if cfg!(target_family = "wasm") {
            self.plan_level().await
        } else {
            guarded(|| block_on(self.plan_level())).0
        }
    }

    /// Updates the state as [`Self::process`] does, without making the hologram of `frame`.
    pub(super) async fn replay(&mut self, frame: &CameraFrame<'_>, past: Option<Past>) -> Result<()> {
        let mut plan = self.take_plan().await?;
        let Stages {
            context,
            pool,
            estimates,
            ..
        } = self;
        let mut times = FrameTimes::default();
        let work = async || {
            plan.take_in(frame, past, estimates.as_mut(), &context.cancel, &mut times)?;
            let (engine, mut input) = plan.input(frame, past);
            engine.replay(&mut input).await
        };
        let replayed = pool.run(work).await;
        self.plan = Some(plan);
        replayed?;
        self.context.cancel.check()
    }

    async fn run(&mut self, plan: &mut LevelPlan, frame: &CameraFrame<'_>, past: Option<Past>) -> Result<Hologram> {
        let Stages {
            context,
            pool,
            levels,
            words,
            depths,
            estimates,
            ..
        } = self;
        let size = plan.frame.size();
        let bits = context.options.target.display.bits();
        let values = plan.frame.planes_mut().0.len();
        let mut levels = levels.take(values);
        let mut words = (bits > 8).then(|| words.take(values));
        let mut times = FrameTimes::default();
        let work = async || -> Result<_> {
            let _frame = stage!("frame", timestamp_ns = frame.timestamp_ns);
            let report = plan.take_in(frame, past, estimates.as_mut(), &context.cancel, &mut times)?;
            context.cancel.check()?;
            let depth_map = plan.depth_map(depths);
            let (engine, mut input) = plan.input(frame, past);
            let made = match &mut words {
                None => LevelsMut::Bytes(&mut levels.values),
                Some(words) => LevelsMut::Words(&mut words.values),
            };
            let encoded = engine.process(context, &mut input, made).await?;
            context.cancel.check()?;
            if let Some(words) = &words {
                upper_bytes(&words.values, bits, &mut levels.values);
            }
            Ok((report, depth_map, encoded))
        };
        let (report, (depth, depth_size), encoded) = pool.run(work).await?;
        Ok(Hologram {
            timestamp_ns: Some(frame.timestamp_ns),
            size,
            levels,
            words,
            depth,
            depth_size,
            scale: encoded.scale,
            times: FrameTimes {
                colour: times.colour,
                depth: times.depth + encoded.times.depth,
                ..encoded.times
            },
            range_m: report.range_m,
            valid_depth: Some(report.valid),
            quality_level: self.level_control.quality_level(),
            encoding: frame.colour.encoding(),
            viewer: self.viewer.clone(),
            #[cfg(feature = "gpu")]
            on_gpu: self.context.gpu.kept.take(),
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::session::quality::{QualityLevel, QualityReason};
    use phasefront_core::depth::image::{DepthFormat, DepthImage};
    use phasefront_core::display::Display;
    use phasefront_core::frame::{ColourFormat, ColourImage, Plane};
    use phasefront_core::method::Method;
    use phasefront_core::method::sweep::Sweep;

    #[test]
    fn a_step_that_fails_loses_no_frame_and_is_told() {
        let display = Display::default().with_size(Size { width: 16, height: 12 }).unwrap();
        let sweep = Sweep::for_display(&display);
        let mut options = SessionOptions::new(display, Method::Sweep(sweep));
        let best = options.quality_levels[0].clone();
        options.quality_levels.push(best.clone());
        let mut stages = block_on(Stages::new(options, None, Cancel::default())).unwrap();
        // The second quality level was valid at the start and becomes invalid.
        let worse = Sweep { planes: 0, ..sweep };
        stages.context.options.quality_levels[1] = QualityLevel {
            method: Method::Sweep(worse),
            ..best
        };
        let bytes = [100; 4 * 12 * 16];
        let plane = Plane::new(&bytes, 4 * 16, 4);
        let colour = ColourImage::new(ColourFormat::Rgba, Size { width: 16, height: 12 }, &[plane]).unwrap();
        let plane = Plane::new(&bytes, 16, 1);
        let depth = DepthImage::new(DepthFormat::NormalizedU8, Size { width: 16, height: 12 }, plane).unwrap();
        let mut process = |time| {
            let frame = CameraFrame::new(time, colour, depth);
            block_on(stages.process(&frame, None, Thermal::Nominal, Quality::Fixed(1)))
        };
        let change = process(1).unwrap().change.unwrap();
        assert_eq!((change.from, change.to, change.reason), (0, 0, QualityReason::Refused));
        for time in 2..5 {
            let made = process(time).unwrap();
            assert_eq!((made.hologram.quality_level(), made.change), (0, None));
        }
    }
}
