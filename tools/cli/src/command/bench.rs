//! `phasefront bench`: measures how long each stage of a frame takes on this machine.

use crate::flags::backend::BackendFlags;
use crate::flags::depth::DepthFlags;
use crate::flags::encoder::{Encoder, EncoderFlags};
use crate::flags::method::{CoreMethod, HologramFlags};
use crate::make;
use clap::{Args, ValueEnum};
use phasefront::Size;
use phasefront::{Method, Network, Sweep, Target};
use phasefront_cli::bench::gpu::{GpuCase, GpuRow};
use phasefront_cli::bench::session::{self, Camera, Scene, SessionRow};
use phasefront_cli::bench::{self, Case, Machine, Row};
use phasefront_cli::gpu;
use phasefront_command::flags::{DisplayFlags, PrecisionName, check_used, parse_size};
use phasefront_command::networks::{self, Precision};
use phasefront_command::terminal::{self, figure, progress_bar};
use phasefront_core::method::network::Isa;
use phasefront_gpu::{ChainOptions, Device, DeviceOptions, Float, Fusion};
use phasefront_io::picture::plot::{self, Bar};
use phasefront_io::{Error, Result, output};
use serde_json::json;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// Measure how long each stage of a frame takes, for all combinations of the flags that are not given
///
/// With a --display that has a per-pixel table, also measure how much longer a frame takes because of the table. With
/// --session, measure all that an app does with a camera's frame.
#[derive(Args)]
#[command(mut_group("DepthFlags", |depth| depth.requires("rgb")))]
pub(crate) struct Bench {
    /// Layers of the network; 0 for the plane sweep. If no network with this number is bundled, one with random f32
    /// weights
    #[arg(long, value_name = "L", help_heading = "Method")]
    layers: Option<usize>,
    /// Number type of the network
    #[arg(long, value_enum, help_heading = "Expert")]
    precision: Option<PrecisionName>,
    /// One bundled network, or an ONNX file, instead of all bundled networks
    #[arg(long, value_name = "NAME|FILE", conflicts_with = "layers", help_heading = "Method")]
    network: Option<String>,
    /// Measure sessions: 8-bit colour of a camera with a sensor's depth of 256×192 in metres, whose noise differs from
    /// frame to frame, to levels. Reports the first frame, and the median and 95th percentile of each stage, before a
    /// camera that stands and one that moves, where every frame is computed whole
    #[arg(long, conflicts_with_all = ["layers", "fusion", "plot"])]
    session: bool,
    /// Method of --session [default: auto; network with --network or --encoder deep]
    #[arg(long, value_enum, requires = "session", help_heading = "Method")]
    method: Option<CoreMethod>,
    /// Colour image of a scene for --session, with its --depth; may be repeated [default: two scenes that need no
    /// files]
    #[arg(long, value_name = "FILE", requires_all = ["session", "depth"], help_heading = "Input")]
    rgb: Vec<PathBuf>,
    /// Depth image of the --rgb at the same place
    #[arg(long, value_name = "FILE", requires = "rgb", help_heading = "Input")]
    depth: Vec<PathBuf>,
    /// Width and height [default: 384x384, 960x540 and 1920x1080; the display's with --session]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<Size>,
    /// Seconds for each combination, with at least five frames [default: 2; 30 frames with --session]
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    #[command(flatten)]
    depth_numbers: DepthFlags,
    #[command(flatten)]
    encoder: EncoderFlags,
    /// Write a chart of the stages' times
    #[arg(long, value_name = "FILE.svg", help_heading = "Output")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    backend: BackendFlags,
    /// Number of layers that a GPU dispatch computes [default: both variants]
    #[arg(long, value_enum, help_heading = "Expert")]
    fusion: Option<FusionName>,
    /// Largest instruction set to use, to measure a smaller one than the processor has: portable, avx2, avx512, vnni,
    /// amx, neon, dotprod, i8mm
    #[arg(long, value_name = "NAME", help_heading = "Expert")]
    kernels: Option<String>,
    #[command(flatten)]
    display: DisplayFlags,
}

/// The seconds for each combination, other than sessions.
const SECONDS: u64 = 2;

/// The number of layers of the deepest network that GPUs are measured with.
const DEEPEST: usize = 30;

/// The sizes of frames that are timed where none is given.
const SIZES: [Size; 3] = [
    Size {
        width: 384,
        height: 384,
    },
    Size {
        width: 960,
        height: 540,
    },
    Size {
        width: 1920,
        height: 1080,
    },
];

/// The number of layers that a GPU dispatch computes.
#[derive(Clone, Copy, ValueEnum)]
enum FusionName {
    /// One layer
    Layers,
    /// Two layers and the skip around them
    Pairs,
}

impl Bench {
    pub(crate) fn run(self, threads: Option<NonZeroUsize>, json: bool) -> Result<()> {
        if let Some(path) = &self.plot {
            output::file(path, &["svg"])?;
        }
        if let Some(name) = &self.kernels {
            let limit = Isa::named(name).and_then(Isa::limit);
            limit.map_err(|why| Error::Usage(format!("--kernels: {why}")))?;
        }
        let on_gpu = self.backend.device()?.is_some();
        check_used(&[
            ("--kernels", self.kernels.is_some(), !on_gpu, "--backend cpu"),
            ("--fusion", self.fusion.is_some(), on_gpu, "--backend gpu"),
            ("--plot", self.plot.is_some(), !on_gpu, "--backend cpu"),
            (
                "--precision",
                self.precision.is_some(),
                self.layers != Some(0),
                "a network",
            ),
        ])?;
        if self.session {
            return self.of_sessions(threads, json);
        }
        let target = self.display.read()?.target;
        let budget = self.budget()?.unwrap_or(Duration::from_secs(SECONDS));
        let encoder = self.encoder.read()?;
        let device = self.backend.device()?;
        let methods = self.methods(&target, device.is_some())?;
        let sizes = self.size.map_or_else(|| SIZES.to_vec(), |size| vec![size]);
        match device {
            Some(options) => self.on_gpu(&methods, &sizes, (&target, &encoder), &options, budget, json),
            None => self.on_cpu(
                &methods,
                &sizes,
                (&target, &encoder),
                threads.map(NonZeroUsize::get),
                budget,
                json,
            ),
        }
    }

    /// Returns the time for each combination, if it is given.
    fn budget(&self) -> Result<Option<Duration>> {
        let budget = self.seconds.map(Duration::try_from_secs_f64).transpose();
        budget.map_err(|_| Error::Usage("--seconds must be a number of seconds, 0 or more".into()))
    }

    /// Measures sessions on each scene, before a camera that stands and one that moves.
    fn of_sessions(&self, threads: Option<NonZeroUsize>, json: bool) -> Result<()> {
        let flags = HologramFlags {
            network: self.network.clone(),
            precision: self.precision,
            encoder: self.encoder.clone(),
            display: self.display.clone(),
        };
        let file = self.display.read()?;
        let size = self.size.unwrap_or_else(|| file.target.display.size());
        let (options, encoder) = make::session::options(&flags, self.method, (&file, size), &self.backend, threads)?;
        let budget = self.budget()?;
        let scenes = self.scenes(size)?;
        let cameras = [Camera::Stands, Camera::Moves];
        let bar = progress_bar((scenes.len() * cameras.len()) as u64, "sessions");
        let mut rows = Vec::new();
        for (scene, camera) in scenes.iter().flat_map(|scene| cameras.map(|camera| (scene, camera))) {
            rows.push(session::measure(options.clone(), scene, camera, budget)?);
            bar.inc(1);
        }
        bar.finish_and_clear();
        let machine = Machine::this();
        terminal::print(
            json,
            &json!({"machine": machine, "encoder": encoder.describe(), "rows": rows}),
            as_session_table(&machine, &encoder.describe(), &rows),
        );
        Ok(())
    }

    /// Returns the scenes that are given, or those that need no files.
    fn scenes(&self, size: Size) -> Result<Vec<Scene>> {
        let (colours, depths) = (&self.rgb, &self.depth);
        if colours.len() != depths.len() {
            return Err(Error::Usage(format!(
                "{} --rgb and {} --depth are given; every picture needs both",
                colours.len(),
                depths.len()
            )));
        }
        if colours.is_empty() {
            return Scene::made(size);
        }
        let options = self.depth_numbers.options(false)?;
        let pairs = colours.iter().zip(depths);
        pairs
            .map(|(rgb, depth)| Scene::read(rgb, depth, options, size))
            .collect()
    }

    /// Returns the requested methods, or those of all bundled networks.
    fn methods(&self, target: &Target, on_gpu: bool) -> Result<Vec<Method>> {
        if let Some(file) = &self.network {
            let network = networks::network(file, self.precision.map(PrecisionName::precision))?;
            return Ok(vec![Method::trained(network)]);
        }
        let mut methods: Vec<_> = (self.bundled().into_iter()).map(Method::trained).collect();
        if self.layers.is_none_or(|layers| layers == 0) {
            methods.push(Method::Sweep(Sweep::for_display(&target.display)));
        }
        // The network for measurements of GPUs, unless it is bundled.
        let random = match self.layers {
            Some(layers) => Some(layers).filter(|&layers| layers > 0),
            None => on_gpu.then_some(DEEPEST),
        };
        if let Some(layers) = random
            && (self.precision).is_none_or(|p| p.precision() == Precision::Float32)
            && methods.is_empty()
        {
            methods.push(Method::Network(bench::random::network(layers)?));
        }
        if methods.is_empty() {
            return Err(Error::Usage(
                "no int8 network of that many layers is bundled; `phasefront bench` without --layers shows which do"
                    .into(),
            ));
        }
        Ok(methods)
    }

    fn on_cpu(
        &self,
        methods: &[Method],
        sizes: &[Size],
        (target, encoder): (&Target, &Encoder),
        threads: Option<usize>,
        budget: Duration,
        json: bool,
    ) -> Result<()> {
        let machine = Machine::this();
        let threads = match threads {
            Some(threads) => vec![threads],
            None if machine.cores == 1 => vec![1],
            None => vec![1, machine.cores],
        };
        let mut cases = Vec::new();
        for method in methods {
            for &size in sizes {
                cases.extend(threads.iter().map(|&threads| Case {
                    method,
                    size,
                    threads,
                    encoder: &encoder.options,
                }));
            }
        }
        let bar = progress_bar(cases.len() as u64, "combinations");
        let mut rows = Vec::new();
        for case in &cases {
            rows.push(bench::measure(case, target, budget)?);
            bar.inc(1);
        }
        bar.finish_and_clear();
        if let Some(path) = &self.plot {
            plot::write_bars(path, &title(&machine, &encoder.describe(), &rows[0]), &bars(&rows))?;
        }
        terminal::print(
            json,
            &json!({"machine": machine, "encoder": encoder.describe(), "rows": rows}),
            as_table(&machine, &encoder.describe(), &rows),
        );
        Ok(())
    }

    /// Returns the bundled networks with the requested layers and precision.
    fn bundled(&self) -> Vec<Arc<Network>> {
        let precisions = [Precision::Float32, Precision::Int8];
        let wanted = |precision: &Precision| (self.precision).is_none_or(|asked| asked.precision() == *precision);
        let networks = phasefront_models::NETWORKS.iter().flat_map(|model| {
            let precisions = precisions.iter().filter(|p| wanted(p));
            precisions.filter_map(|precision| model.network(*precision))
        });
        let deep = |network: &Arc<Network>| self.layers.is_none_or(|n| n == network.layers());
        networks.filter(deep).collect()
    }

    /// Measures on a GPU, with each network in its own precision, and f32 networks in f16 too.
    fn on_gpu(
        &self,
        methods: &[Method],
        sizes: &[Size],
        (target, encoder): (&Target, &Encoder),
        options: &DeviceOptions,
        budget: Duration,
        json: bool,
    ) -> Result<()> {
        let device = Arc::new(Device::open(options)?);
        let fusions = match self.fusion {
            Some(FusionName::Layers) => vec![Fusion::Layers],
            Some(FusionName::Pairs) => vec![Fusion::Pairs],
            None => vec![Fusion::Layers, Fusion::Pairs],
        };
        let mut rows = Vec::new();
        for method in methods {
            let network = match method {
                Method::Network(network) | Method::Seeded(network) => Some(network),
                _ => None,
            };
            let floats = match network.map(|network| network.precision()) {
                Some("f32") if device.has_half() => vec![Float::F16, Float::F32],
                _ => vec![Float::F32],
            };
            // A sweep without a network has no layers.
            let fusions = match network {
                Some(_) => &fusions[..],
                None => &[Fusion::Layers],
            };
            for &size in sizes {
                for &float in &floats {
                    for &fusion in fusions {
                        let case = GpuCase {
                            method,
                            size,
                            encoder: &encoder.options,
                            chain: ChainOptions { float, fusion },
                        };
                        rows.push(bench::gpu::measure(&case, &device, target, budget)?);
                    }
                }
            }
        }
        gpu::keep_programs(&device);
        terminal::print(
            json,
            &json!({"machine": device.name(), "encoder": encoder.describe(), "rows": rows}),
            as_gpu_table(&device, &encoder.describe(), &rows),
        );
        Ok(())
    }
}

fn as_gpu_table(device: &Device, encoder: &str, rows: &[GpuRow]) -> String {
    let mut text = format!("{}; {encoder}\n\n", device.name());
    text += "| method | layers | numbers | kernels | size | input ms | method ms | propagate ms | encode ms | frame ms (least–most) | in flight ms | GMAC/s | % of peak | % of bandwidth | table % |\n";
    text += "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|";
    for row in rows {
        let stage = |name| row.stage_ms.get(name).copied().unwrap_or(f64::NAN);
        text += &format!(
            "\n| {} | {} | {} | {} | {}×{} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} ({:.2}–{:.2}) | {:.2} | {} | {} | {} | {} |",
            row.method,
            row.layers,
            row.precision,
            row.kernels,
            row.width,
            row.height,
            stage("input"),
            stage(row.method),
            stage("propagate"),
            stage("encode"),
            row.total_ms,
            row.spread_ms[0],
            row.spread_ms[1],
            row.flying_ms,
            figure(row.gmac_per_s, 0),
            figure(row.peak_percent, 0),
            figure(row.bandwidth_percent, 0),
            figure(row.table_percent, 1),
        );
    }
    text
}

fn as_table(machine: &Machine, encoder: &str, rows: &[Row]) -> String {
    let mut text = format!("{}, {} cores; {encoder}\n\n", machine.cpu, machine.cores);
    text += "| method | layers | precision | kernels | size | threads | method ms | propagate ms | encode ms | frame ms (least–most) | GMAC/s | % of peak | memory MB | table % |\n";
    text += "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|";
    for row in rows {
        let stage = |name| row.stage_ms.get(name).copied().unwrap_or(0.0);
        text += &format!(
            "\n| {} | {} | {} | {} | {}×{} | {} | {:.1} | {:.1} | {:.1} | {:.1} ({:.1}–{:.1}) | {} | {} | {} | {} |",
            row.method,
            row.layers,
            row.precision,
            row.kernels,
            row.width,
            row.height,
            row.threads,
            stage(row.method),
            stage("propagate"),
            stage("encode"),
            row.total_ms,
            row.spread_ms[0],
            row.spread_ms[1],
            figure(row.gmac_per_s, 0),
            figure(row.peak_percent, 0),
            figure(row.peak_memory_mb, 0),
            figure(row.table_percent, 1),
        );
    }
    text
}

fn as_session_table(machine: &Machine, encoder: &str, rows: &[SessionRow]) -> String {
    let mut text = format!(
        "{}, {} cores; {encoder}; medians, 95th percentiles in brackets\n\n",
        machine.cpu, machine.cores
    );
    text += "| scene | camera | method | layers | precision | size | threads | frames | start ms | first frame ms | colour ms | depth ms | method ms | propagate ms | encode ms | frame ms | memory MB |\n";
    text += "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|";
    for row in rows {
        let frames = &row.frames;
        let stage = |name| format!("{:.1} ({:.1})", frames.median_ms[name], frames.p95_ms[name]);
        text += &format!(
            "\n| {} | {} | {} | {} | {} | {}×{} | {} | {} | {:.0} | {:.1} | {} | {} | {} | {} | {} | {} | {} |",
            row.scene,
            match row.camera {
                Camera::Stands => "stands",
                Camera::Moves => "moves",
            },
            row.method,
            row.layers,
            row.precision,
            row.width,
            row.height,
            row.threads,
            frames.frames,
            row.start_ms,
            frames.first_ms,
            stage("colour"),
            stage("depth"),
            stage("method"),
            stage("propagate"),
            stage("encode"),
            stage("total"),
            figure(row.peak_memory_mb, 0),
        );
    }
    text
}

fn title(machine: &Machine, encoder: &str, row: &Row) -> String {
    format!(
        "{}, {} cores: ms a frame, offset {} mm, {encoder}",
        machine.cpu, machine.cores, row.offset_mm
    )
}

fn bars(rows: &[Row]) -> Vec<Bar> {
    let bar = |row: &Row| Bar {
        label: format!(
            "{} {}×{}, {} thr.",
            match row.layers {
                0 => row.method.to_owned(),
                layers => format!("{layers} layers {}", row.precision),
            },
            row.width,
            row.height,
            row.threads
        ),
        // All bars of one chart have the same names for their parts, whatever the method.
        parts: [
            ("hologram", row.method),
            ("propagate", "propagate"),
            ("encode", "encode"),
        ]
        .map(|(part, stage)| (part, row.stage_ms.get(stage).copied().unwrap_or(0.0)))
        .to_vec(),
    };
    rows.iter().map(bar).collect()
}
