//! Measurements of the time of a frame on this machine: the median of each stage of the pipeline over many frames, and
//! the machine's own peak, measured in the same run.

pub mod gpu;
pub mod random;
mod scene;
pub mod session;

use num_complex::Complex32;
use phasefront::Size;
use phasefront::{Brightness, EncoderOptions, Method, Network, Pipeline, Target};
use phasefront_core::display::levels::LevelsMut;
use phasefront_core::pipeline::display_plan::DisplayPlan;
use phasefront_io::{Error, Result};
use phasefront_kernels::{f32_peak, int8_peak};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The time for which the peak is measured.
const PEAK_TIME: Duration = Duration::from_millis(200);

/// A combination to measure.
#[derive(Debug, Clone)]
pub struct Case<'a> {
    /// The method that makes the hologram.
    pub method: &'a Method,
    /// The width and height in pixels.
    pub size: Size,
    /// The number of threads in the pool.
    pub threads: usize,
    /// The encoding of the field into levels, at one brightness.
    pub encoder: &'a EncoderOptions,
}

/// The measurements of one [`Case`]. Times are medians over frames, in milliseconds.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// The method: `network`, `sweep` or `seeded`. Its stage has the same name.
    pub method: &'static str,
    /// The number of convolution layers; 0 without a network.
    pub layers: usize,
    /// The precision: `f32` or `int8` of a network, `int16` of the sweep.
    pub precision: String,
    /// The backend: always `cpu`.
    pub backend: &'static str,
    /// The kernels that ran.
    pub kernels: String,
    /// The width in pixels.
    pub width: usize,
    /// The height in pixels.
    pub height: usize,
    /// The number of threads in the pool.
    pub threads: usize,
    /// z of the modulator from the midpoint, in mm.
    pub offset_mm: f64,
    /// The median time of each stage.
    pub stage_ms: BTreeMap<&'static str, f64>,
    /// The median time of whole frames.
    pub total_ms: f64,
    /// The times of the fastest and the slowest frame.
    pub spread_ms: [f64; 2],
    /// The extra time of encoding through the per-pixel table, in percent of the whole frame, if there is a table.
    pub table_percent: Option<f64>,
    /// The number of measured frames.
    pub frames: usize,
    /// The network's multiply-adds per second at its median time, in units of 10⁹, if its stage does nothing else.
    pub gmac_per_s: Option<f64>,
    /// The rate of the network in percent of the peak that these kernels' instructions reach here from registers alone,
    /// on as many threads.
    pub peak_percent: Option<f64>,
    /// The peak memory of this process in MB, if the system reports it.
    pub peak_memory_mb: Option<f64>,
}

/// The measured machine.
#[derive(Debug, Clone, Serialize)]
pub struct Machine {
    /// The processor's name, or its architecture if the system does not report the name.
    pub cpu: String,
    /// The number of logical cores.
    pub cores: usize,
    /// The version of this program.
    pub version: &'static str,
}

impl Machine {
    /// Describes this machine.
    pub fn this() -> Self {
        let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let name = info.lines().find_map(|line| {
            let (key, value) = line.split_once(':')?;
            (key.trim() == "model name").then(|| value.trim().to_owned())
        });
        Machine {
            cpu: name.unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            version: env!("CARGO_PKG_VERSION"),
        }
    }
}

/// Measures one case on `target`: processes frames until `budget` is spent, at least five, after one warm-up frame. If
/// the modulator has a table for each pixel, each frame is encoded a second time through it.
///
/// # Errors
/// Returns an error if the case cannot be planned.
pub fn measure(case: &Case<'_>, target: &Target, budget: Duration) -> Result<Row> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(case.threads)
        .build()
        .map_err(|e| Error::Input(format!("--threads {}: {e}", case.threads)))?;
    pool.install(|| measure_here(case, target, budget))
}

/// Returns a method's name, which is also the name of its stage in a [`Row`], and its network.
fn named(method: &Method) -> (&'static str, Option<&Arc<Network>>) {
    match method {
        Method::Network(network) => ("network", Some(network)),
        Method::Seeded(network) => ("seeded", Some(network)),
        Method::Auto(_, network) => ("auto", Some(network)),
        _ => ("sweep", None),
    }
}

fn measure_here(case: &Case<'_>, target: &Target, budget: Duration) -> Result<Row> {
    let Size { width, height } = case.size;
    let (name, network) = named(case.method);
    forget_peak_memory();
    let plain = Target::from(&target.display);
    let options = full_light(case.encoder);
    let pipeline = Pipeline::new(case.size, case.method.clone(), &plain, &options)?;
    let Times {
        stages,
        mut totals,
        mut table_encode,
    } = time_frames(case, target, &pipeline, budget)?;
    let stage_ms: BTreeMap<_, _> = (stages.into_iter())
        .map(|(stage, mut times)| (stage, median(&mut times)))
        .collect();
    let total_ms = median(&mut totals);
    let alone = network.filter(|_| name == "network");
    let chain = alone.and_then(|network| network.chain());
    let gmac_per_s = chain.map(|chain| {
        let macs = chain.macs_per_pixel() as f64 * (width * height) as f64;
        macs / stage_ms[name] / 1e6
    });
    let isa = pipeline.method().engine().and_then(|engine| engine.isa);
    let peak = isa.and_then(|isa| match network?.precision() {
        "int8" => int8_peak(isa, PEAK_TIME),
        _ => f32_peak(isa, PEAK_TIME),
    });
    Ok(Row {
        method: name,
        layers: network.map_or(0, |network| network.layers()),
        precision: network.map_or("int16".to_owned(), |network| network.precision().to_string()),
        backend: "cpu",
        kernels: (pipeline.method().engine()).map_or("", |engine| engine.name).to_owned(),
        width,
        height,
        threads: case.threads,
        offset_mm: target.display.offset_m() * 1e3,
        total_ms,
        spread_ms: [totals[0], totals[totals.len() - 1]],
        table_percent: (!table_encode.is_empty())
            .then(|| 100.0 * (median(&mut table_encode) - stage_ms["encode"]) / total_ms),
        stage_ms,
        frames: totals.len(),
        gmac_per_s,
        peak_percent: peak
            .zip(gmac_per_s)
            .map(|(peak, gmac_per_s)| 100.0 * gmac_per_s * 1e9 / peak),
        peak_memory_mb: peak_memory_mb(),
    })
}

/// Returns `encoder` with a fixed brightness.
fn full_light(encoder: &EncoderOptions) -> EncoderOptions {
    EncoderOptions {
        brightness: Brightness::Fixed(1.0),
        ..encoder.clone()
    }
}

/// The times of frames, in milliseconds.
#[derive(Default)]
struct Times {
    stages: BTreeMap<&'static str, Vec<f64>>,
    totals: Vec<f64>,
    /// The times of encoding through the table.
    table_encode: Vec<f64>,
}

/// Times frames until `budget` is spent, at least five, after one warm-up frame.
fn time_frames(case: &Case<'_>, target: &Target, pipeline: &Pipeline, budget: Duration) -> Result<Times> {
    let Size { width, height } = case.size;
    let (name, _) = named(case.method);
    let options = full_light(case.encoder);
    let by_table = (target.response.size())
        .map(|_| DisplayPlan::new(case.size, target, &options))
        .transpose()?;
    let mut by_table = by_table.map(|plan| (plan.scratch(), plan));
    let frame = scene::balls(case.size)?.for_display(&target.display);
    let mut scratch = pipeline.scratch();
    let values = pipeline.colours() * height * width;
    let mut field = vec![Complex32::ZERO; values];
    let mut levels = vec![0; values];
    let mut times = Times::default();
    pipeline.process(&frame, &mut levels, &mut scratch)?;
    let start = Instant::now();
    while times.totals.len() < 5 || start.elapsed() < budget {
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        let (method, propagate) = pipeline.field(&frame, &mut field, &mut scratch)?;
        if let Some((scratch, plan)) = &mut by_table {
            // The encoder's filter changes the field.
            let mut field = field.clone();
            let modulation = plan.modulate(None, &mut field, LevelsMut::Bytes(&mut levels), scratch);
            times.table_encode.push(ms(modulation.encode));
        }
        let out = LevelsMut::Bytes(&mut levels);
        let encode = pipeline.modulate(None, &mut field, out, &mut scratch).encode;
        for (stage, time) in [(name, method), ("propagate", propagate), ("encode", encode)] {
            times.stages.entry(stage).or_default().push(ms(time));
        }
        times.totals.push(ms(method + propagate + encode));
    }
    Ok(times)
}

/// Sorts `values`, which must not be empty, and returns the middle one.
fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Restarts Linux's count of the peak memory of this process.
fn forget_peak_memory() {
    // This fails on other systems, which have nothing to restart.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

fn peak_memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some((kilobytes / 102.4).round() / 10.0)
}
