//! Measurements of the time of a frame on a GPU: every stage by the device's own time stamps, and the device's peak,
//! measured in the same run.

use super::{full_light, median, named};
use phasefront::Size;
use phasefront::input::{ColourFormat, ColourImage, Orientation, Plane, RgbEncoding, YuvEncoding};
use phasefront::session::FrameTimes;
use phasefront::{EncoderOptions, Method, Target};
use phasefront_core::frame::LightConstants;
use phasefront_gpu::{
    ChainOptions, Colour, ColourData, Deliver, Depth, DepthData, Device, FLIGHTS, Frame, GpuPipeline, Job, probe,
};
use phasefront_io::Result;
use serde::Serialize;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A combination to measure on a GPU.
#[derive(Debug, Clone)]
pub struct GpuCase<'a> {
    /// The method that makes the hologram.
    pub method: &'a Method,
    /// The width and height in pixels.
    pub size: Size,
    /// The encoding of the field into levels, at one brightness.
    pub encoder: &'a EncoderOptions,
    /// The options for computing a network.
    pub chain: ChainOptions,
}

/// The measurements of one [`GpuCase`]. Times are medians over frames, in milliseconds.
#[derive(Debug, Clone, Serialize)]
pub struct GpuRow {
    /// The method: `network`, `sweep` or `seeded`. Its stage has the same name.
    pub method: &'static str,
    /// The number of convolution layers; 0 without a network.
    pub layers: usize,
    /// The number type of the network, or of a sweep without one: `f32`, `f16` or `int8`.
    pub precision: String,
    /// The backend: always `gpu`.
    pub backend: &'static str,
    /// The device, the number of layers or planes that a dispatch computes, and the number of dispatches of the method.
    pub kernels: String,
    /// The width in pixels.
    pub width: usize,
    /// The height in pixels.
    pub height: usize,
    /// The median time of each stage, if the device has time stamps.
    pub stage_ms: BTreeMap<&'static str, f64>,
    /// The median time of whole frames, one at a time, from the CPU's memory and back to it.
    pub total_ms: f64,
    /// The times of the fastest and the slowest frame.
    pub spread_ms: [f64; 2],
    /// The time per frame with several frames in flight whose levels stay on the GPU.
    pub flying_ms: f64,
    /// The extra time of encoding through the per-pixel table, in percent of all stages, if there is a table and the
    /// device has time stamps.
    pub table_percent: Option<f64>,
    /// The number of frames that were measured one at a time.
    pub frames: usize,
    /// The network's multiply-adds per second at its median time, in units of 10⁹, if its stage does nothing else.
    pub gmac_per_s: Option<f64>,
    /// The rate of the network in percent of the peak that the device reaches here from registers alone with this
    /// number type.
    pub peak_percent: Option<f64>,
    /// The bandwidth of the method's dispatches, with each value read or written once, in percent of the bandwidth of a
    /// copy here.
    pub bandwidth_percent: Option<f64>,
}

/// Measures `case` on `device`: processes frames until `budget` is spent, at least five, after one warm-up frame. If
/// the modulator has a table for each pixel, each frame is processed a second time through it.
///
/// # Errors
/// Returns an error if the case cannot be planned on the device, or if the device's results differ from the CPU's.
pub fn measure(case: &GpuCase<'_>, device: &Arc<Device>, target: &Target, budget: Duration) -> Result<GpuRow> {
    let size = case.size;
    let (name, network) = named(case.method);
    let mut job = Job::new(size, case.method.clone(), &target.display);
    job.encoder = full_light(case.encoder);
    job.chain = case.chain;
    probe(device, &job)?;
    let format = ColourFormat::Nv12(YuvEncoding::default());
    job.colour = Colour::Camera {
        format,
        size,
        orientation: Orientation::default(),
        light: LightConstants::new(RgbEncoding::default(), &target.display),
    };
    job.depth = Depth::U16;
    let mut pipeline = GpuPipeline::new(device, &job)?;
    let mut by_table = (target.response.size())
        .map(|_| {
            job.target = target.clone();
            GpuPipeline::new(device, &job)
        })
        .transpose()?;
    let images = Images::new(size);
    let planes = images.planes();
    let frame = Frame {
        colour: ColourData::Camera(ColourImage::new(format, size, &planes)?),
        depth: DepthData::U16(&images.depth),
    };
    let Alone {
        mut totals,
        stages,
        mut table_encode,
    } = Alone::measure(name, &mut pipeline, by_table.as_mut(), &frame, budget)?;
    let flying_ms = flying_ms(&mut pipeline, &frame, budget)?;
    let stage_ms: BTreeMap<_, _> = (stages.into_iter())
        .map(|(stage, mut times)| (stage, median(&mut times)))
        .collect();
    let total_ms = median(&mut totals);
    let table_percent = (!table_encode.is_empty()).then(|| {
        let all: f64 = stage_ms.values().sum();
        100.0 * (median(&mut table_encode) - stage_ms["encode"]) / all
    });
    let peak = pipeline.peak()?;
    let method_s = stage_ms.get(name).map(|ms| ms / 1e3);
    let alone = network.filter(|_| name == "network");
    let mac_per_s = method_s
        .zip(alone)
        .and_then(|(s, network)| Some(network.chain()?.macs_per_pixel() as f64 * size.pixels() as f64 / s));
    Ok(GpuRow {
        method: name,
        layers: network.map_or(0, |network| network.layers()),
        precision: pipeline.numbers().to_owned(),
        backend: "gpu",
        kernels: pipeline.describe(),
        width: size.width,
        height: size.height,
        stage_ms,
        total_ms,
        spread_ms: [totals[0], totals[totals.len() - 1]],
        flying_ms,
        table_percent,
        frames: totals.len(),
        gmac_per_s: mac_per_s.map(|rate| rate / 1e9),
        peak_percent: mac_per_s.map(|rate| 100.0 * rate / peak.mac_per_s),
        bandwidth_percent: method_s.map(|s| 100.0 * pipeline.method_bytes() as f64 / s / peak.bytes_per_s),
    })
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// The times of frames that are processed one at a time, in milliseconds.
#[derive(Default)]
struct Alone {
    totals: Vec<f64>,
    stages: BTreeMap<&'static str, Vec<f64>>,
    /// The times of encoding through the table.
    table_encode: Vec<f64>,
}

impl Alone {
    /// Times frames until `budget` is spent, at least five, after one warm-up frame. Each frame also runs through
    /// `by_table`, if given. `name` is the name of the method's stage.
    fn measure(
        name: &'static str,
        pipeline: &mut GpuPipeline,
        mut by_table: Option<&mut GpuPipeline>,
        frame: &Frame<'_>,
        budget: Duration,
    ) -> Result<Self> {
        let mut alone = Alone::default();
        let Size { width, height } = pipeline.size();
        let mut levels = vec![0; 3 * height * width];
        pipeline.process(frame, &mut levels)?;
        let start = Instant::now();
        while alone.totals.len() < 5 || start.elapsed() < budget {
            let begin = Instant::now();
            let report = pipeline.process(frame, &mut levels)?;
            alone.totals.push(ms(begin.elapsed()));
            if let Some(times) = report.times {
                alone.note(name, &times);
            }
            if let Some(by_table) = &mut by_table
                && let Some(times) = by_table.process(frame, &mut levels)?.times
            {
                alone.table_encode.push(ms(times.encode));
            }
        }
        Ok(alone)
    }

    /// Adds a frame's times.
    fn note(&mut self, name: &'static str, times: &FrameTimes) {
        let FrameTimes {
            colour,
            method,
            propagate,
            encode,
            ..
        } = *times;
        for (stage, time) in [
            ("input", colour),
            (name, method),
            ("propagate", propagate),
            ("encode", encode),
        ] {
            self.stages.entry(stage).or_default().push(ms(time));
        }
    }
}

/// Measures the time per frame with several frames in flight whose levels stay on the GPU, in milliseconds.
fn flying_ms(pipeline: &mut GpuPipeline, frame: &Frame<'_>, budget: Duration) -> Result<f64> {
    let start = Instant::now();
    let mut flying = VecDeque::new();
    let mut flown = 0;
    while flown < 5 || start.elapsed() < budget {
        if flying.len() == FLIGHTS {
            pipeline.finish(flying.pop_front().expect("not empty"))?;
            flown += 1;
        }
        flying.push_back(pipeline.submit(frame, Deliver::Shown)?);
    }
    for ticket in flying {
        pipeline.finish(ticket)?;
        flown += 1;
    }
    Ok(ms(start.elapsed()) / f64::from(flown))
}

/// A frame as phones deliver it: luma, chroma at half the resolution, depth of 16 bits.
struct Images {
    width: usize,
    luma: Vec<u8>,
    chroma: Vec<u8>,
    depth: Vec<u16>,
}

impl Images {
    fn new(size: Size) -> Self {
        let Size { width, height } = size;
        let bytes = |n: usize| (0..n).map(|i| (i * 7 % 256) as u8).collect();
        Images {
            width,
            luma: bytes(height * width),
            chroma: bytes(2 * height.div_ceil(2) * width.div_ceil(2)),
            depth: (0..height * width).map(|i| (i / 8 * 257) as u16).collect(),
        }
    }

    fn planes(&self) -> [Plane<'_>; 2] {
        [
            Plane::new(&self.luma, self.width, 1),
            Plane::new(&self.chroma, 2 * self.width.div_ceil(2), 2),
        ]
    }
}
