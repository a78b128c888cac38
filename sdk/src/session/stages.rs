//! All stages of a session's frames, and what one frame leaves for the next. Which frame is next is not known here.

use super::SessionOptions;
use super::brightness::BrightnessTracker;
use super::hologram::{Hologram, Pool, Viewer};
use super::quality::{Ladder, Quality, QualityChange, Thermal};
use super::statistics::{BackendReport, FrameTimes};
use crate::depth::stream::DepthStream;
use crate::encode::Scale;
use crate::error::{Error, Result};
use crate::frame::{CameraFrame, ColourPlan, ColourScratch, RgbdFrame};
use crate::pipeline::{Pipeline, PipelineScratch};
use crate::slm;
use num_complex::Complex32;
use rayon::ThreadPool;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A gap between frames after which the past is no guide.
const LONGEST_GAP: Duration = Duration::from_secs(1);

/// Plans and memory of one rung.
struct RungPlan {
    pipeline: Pipeline,
    scratch: PipelineScratch,
    frame: RgbdFrame,
    field: Vec<Complex32>,
    /// Where the display has over 8 bits.
    phases: Vec<f32>,
    depth: DepthStream,
    colour: Option<(ColourPlan, ColourScratch)>,
}

/// The stages of a session.
pub(super) struct Stages {
    options: SessionOptions,
    pool: ThreadPool,
    ladder: Ladder,
    /// None after a panic: it is made anew.
    plan: Option<RungPlan>,
    brightness: BrightnessTracker,
    viewer: Arc<Viewer>,
    levels: Pool<u8>,
    words: Pool<u16>,
    depths: Pool<u16>,
    last_ns: Option<u64>,
}

/// What a frame became.
pub(super) struct Made {
    pub(super) hologram: Hologram,
    pub(super) change: Option<QualityChange>,
}

impl Stages {
    pub(super) fn new(options: SessionOptions) -> Result<Self> {
        let mut pool = rayon::ThreadPoolBuilder::new().thread_name(|i| format!("phasefront {i}"));
        if let Some(threads) = options.threads {
            pool = pool.num_threads(threads.get());
        }
        let pool = pool
            .build()
            .map_err(|e| Error::Session(format!("its threads cannot be started: {e}")))?;
        let start = match options.quality {
            Quality::Adaptive => 0,
            Quality::Fixed(rung) => rung,
        };
        let mut stages = Stages {
            ladder: Ladder::new(options.ladder.len(), start),
            plan: None,
            brightness: BrightnessTracker::new(options.brightness),
            viewer: Arc::new(Viewer::new(&options)),
            levels: Pool::default(),
            words: Pool::default(),
            depths: Pool::default(),
            last_ns: None,
            pool,
            options,
        };
        stages.plan = Some(stages.plan_rung()?);
        Ok(stages)
    }

    fn plan_rung(&self) -> Result<RungPlan> {
        let rung = &self.options.ladder[self.ladder.rung()];
        let (height, width) = (rung.height, rung.width);
        let depth = DepthStream::new(self.options.depth, (height, width))?;
        self.pool.install(|| {
            let mut pipeline = Pipeline::new(
                height,
                width,
                rung.method.clone(),
                &self.options.display,
                self.options.encoding.clone(),
                Scale::Max,
                self.options.response.clone(),
            )?;
            if let Some(illumination) = &self.options.illumination {
                pipeline = pipeline.with_illumination(illumination.clone());
            }
            if let Some(correction) = &self.options.correction {
                pipeline = pipeline.with_correction(correction)?;
            }
            Ok(RungPlan {
                scratch: pipeline.scratch(),
                pipeline,
                frame: RgbdFrame::black((height, width)),
                field: vec![Complex32::ZERO; 3 * height * width],
                phases: match self.options.display.bits() {
                    0..=8 => Vec::new(),
                    _ => vec![0.0; 3 * height * width],
                },
                depth,
                colour: None,
            })
        })
    }

    /// Forgets half-done work after a panic.
    pub(super) fn recover(&mut self) {
        self.plan = None;
        self.last_ns = None;
    }

    pub(super) fn rung(&self) -> usize {
        self.ladder.rung()
    }

    pub(super) fn backend(&self) -> BackendReport {
        let plan = self.plan.as_ref();
        let engine = plan.and_then(|plan| plan.pipeline.method().engine());
        engine.map_or_else(BackendReport::default, |engine| BackendReport {
            name: engine.name.into(),
            why: engine.why.clone(),
        })
    }

    /// Runs a black frame through all stages that do not need a camera's frame.
    pub(super) fn warm_up(&mut self) -> Result<()> {
        let mut plan = self.take_plan()?;
        let size = plan.field.len();
        let mut levels = self.levels.take(size);
        let result = self.pool.install(|| {
            plan.frame.planes_mut().0.fill(0.0);
            plan.pipeline.process(
                &plan.frame,
                &mut plan.field,
                &mut levels.values,
                &mut plan.scratch,
            )
        });
        self.plan = Some(plan);
        result.map(|_| ())
    }

    fn take_plan(&mut self) -> Result<RungPlan> {
        match self.plan.take() {
            Some(plan) => Ok(plan),
            None => self.plan_rung(),
        }
    }

    /// Makes the hologram of `frame`; `past` says whether the frames before it count.
    pub(super) fn process(
        &mut self,
        frame: &CameraFrame<'_>,
        past: bool,
        thermal: Thermal,
        quality: Quality,
    ) -> Result<Made> {
        let start = Instant::now();
        let elapsed = (self.last_ns.filter(|_| past))
            .and_then(|last| frame.timestamp_ns.checked_sub(last))
            .map(Duration::from_nanos)
            .filter(|gap| *gap <= LONGEST_GAP);
        let mut plan = self.take_plan()?;
        let made = self.run(&mut plan, frame, elapsed);
        self.plan = Some(plan);
        let hologram = made?;
        self.last_ns = Some(frame.timestamp_ns);
        let period = self
            .options
            .target_rate_hz
            .map(|rate| Duration::from_secs_f64(1.0 / rate));
        let change = self
            .ladder
            .observe(start.elapsed(), period, thermal, quality);
        if change.is_some() {
            // The memory of the rung before goes first.
            self.plan = None;
            self.plan = Some(self.plan_rung()?);
        }
        Ok(Made { hologram, change })
    }

    fn run(
        &mut self,
        plan: &mut RungPlan,
        frame: &CameraFrame<'_>,
        elapsed: Option<Duration>,
    ) -> Result<Hologram> {
        let Stages {
            pool,
            brightness,
            levels,
            words,
            depths,
            options,
            ..
        } = self;
        let shape = plan.pipeline.shape();
        let mut levels = levels.take(3 * shape.0 * shape.1);
        let bits = options.display.bits();
        let mut words = (bits > 8).then(|| words.take(3 * shape.0 * shape.1));
        let mut depths = depths.take(shape.0 * shape.1);
        let mut times = FrameTimes::default();
        let (report, scale) = pool.install(|| -> Result<_> {
            let start = Instant::now();
            let fits =
                |(colour, _): &&mut (ColourPlan, _)| colour.fits(&frame.colour, frame.orientation);
            if plan.colour.as_mut().filter(fits).is_none() {
                let colour = ColourPlan::new(&frame.colour, frame.orientation, shape.0, shape.1)?;
                let scratch = colour.scratch();
                plan.colour = Some((colour, scratch));
            }
            let (rgb, depth) = plan.frame.planes_mut();
            if let Some((colour, scratch)) = &mut plan.colour {
                colour.convert(&frame.colour, rgb, scratch)?;
            }
            times.colour = start.elapsed();
            let start = Instant::now();
            let report = plan.depth.next(frame, elapsed, rgb, depth)?;
            for (to, d) in depths.values.iter_mut().zip(&*depth) {
                *to = (d * 65535.0 + 0.5) as u16;
            }
            times.depth = start.elapsed();
            (times.method, times.propagate) =
                plan.pipeline
                    .field(&plan.frame, &mut plan.field, &mut plan.scratch)?;
            let start = Instant::now();
            let scale = brightness.next(&plan.field, elapsed);
            let RungPlan {
                pipeline,
                field,
                phases,
                scratch,
                ..
            } = plan;
            let modulation = match &mut words {
                None => pipeline.modulate_at(field, scale, &mut levels.values, scratch),
                Some(words) => {
                    let modulation = pipeline.phases_at(field, scale, phases, scratch);
                    slm::linear_words(phases, bits, &mut words.values);
                    for (level, word) in levels.values.iter_mut().zip(&words.values) {
                        *level = (word >> (bits - 8)) as u8;
                    }
                    modulation
                }
            };
            times.encode = start.elapsed();
            Ok((report, modulation.scale))
        })?;
        Ok(Hologram {
            timestamp_ns: frame.timestamp_ns,
            shape,
            levels,
            words,
            depth: depths,
            scale,
            times,
            range_m: report.range_m,
            valid_depth: report.valid,
            rung: self.ladder.rung(),
            viewer: self.viewer.clone(),
        })
    }
}
