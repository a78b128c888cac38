//! `phasefront hologram`: an RGB-D image or a layered depth image to a phase-only hologram.

use super::flags::{BackendFlags, DisplayFlags, Encoder, EncoderFlags, check_used, progress_bar};
use super::frame::{FrameFlags, Picture};
use super::method::{CoreMethod, Parts};
use super::request::{Before, Request};
use super::stills;
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use ndarray::Array3;
use num_complex::Complex32;
use phasefront::unstable::depth::sharpness;
use phasefront::unstable::gpu::{Device, DeviceOptions, Frame, GpuPipeline, Job, probe};
use phasefront::unstable::modulator::{Modulation, Modulator};
use phasefront::unstable::network::{Engine, InputKind};
use phasefront::{Brightness, EncoderOptions, Encoding, Pipeline, RgbdFrame, Sweep};
use phasefront_lab::calibrate::table::AberrationFile;
use phasefront_lab::corrected::{self, Correction};
use phasefront_lab::files::{self, DisplayFile, HologramInfo};
use phasefront_lab::ldi::{Ldi, LdiLayer};
use phasefront_lab::models::Precision;
use phasefront_lab::point_based::{self, Occlusion};
use phasefront_lab::{Error, Result, evaluate, gpu, models, output, packed, sm_lbm};
use phasefront_models::default_network;
use serde::Serialize;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

/// Make a phase-only hologram of an RGB-D image or a layered depth image
#[derive(Args)]
pub(crate) struct Hologram {
    #[command(flatten)]
    making: Making,
    /// Write the complex field at the modulator there too, with a .json beside it
    #[arg(long, value_name = "FILE.npy")]
    complex: Option<PathBuf>,
    /// Say how near to its own wave is what the hologram shows: at the midpoint, and over a stack of depths
    #[arg(long)]
    judge: bool,
    /// Write what the modulator's input takes there too: one PNG, or FRAME-red.png, FRAME-green.png and FRAME-blue.png
    #[arg(long, value_name = "FRAME.png")]
    packed: Option<PathBuf>,
    /// The hologram: a PNG of modulator levels; for folders of pictures the folder of their holograms, NAME.png for
    /// each picture NAME
    #[arg(short, value_name = "OUT.png|DIR")]
    output: PathBuf,
    /// For folders of pictures: keep the holograms that an earlier run with the same flags made
    #[arg(long, conflicts_with = "overwrite")]
    resume: bool,
    /// For folders of pictures: replace holograms that are there
    #[arg(long)]
    overwrite: bool,
}

/// What a hologram is made of, and how.
#[derive(Args)]
pub(crate) struct Making {
    #[command(flatten)]
    frame: FrameFlags,
    /// Folder of a layered depth image, for --method layers and points, and for a --network that takes layers
    #[arg(long, value_name = "DIR", conflicts_with_all = FrameFlags::NAMES)]
    ldi: Option<PathBuf>,
    /// How the midpoint hologram is made [default: auto; network with --network or --encoder deep, layers with --ldi
    /// and no --network]
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// A bundled network (`phasefront networks` lists them), or an ONNX file [default: 8]
    #[arg(long, value_name = "NAME|FILE")]
    network: Option<String>,
    /// Numbers that a bundled network computes in [default: int8]
    #[arg(long, value_enum)]
    precision: Option<PrecisionName>,
    /// Planes of --method layers and points [default: 256] and sweep [default: what suits the display]
    #[arg(long, value_name = "N")]
    planes: Option<usize>,
    /// Taps of the filter from plane to plane, for --method sweep [default: what suits planes and display]
    #[arg(long, value_name = "N")]
    taps: Option<usize>,
    /// What keeps light from where it should not go, for --method points [default: geometric]
    #[arg(long, value_enum)]
    occlusion: Option<OcclusionName>,
    #[command(flatten)]
    encoder: EncoderFlags,
    /// The amplitude that full light stands for [default: the largest of the image]
    #[arg(long, value_name = "A")]
    scale: Option<f32>,
    #[command(flatten)]
    backend: BackendFlags,
    #[command(flatten)]
    display: DisplayFlags,
    /// Whether the field is asked for too.
    #[arg(skip)]
    pub(crate) keeps_field: bool,
}

#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Method {
    Core(CoreMethod),
    Layers,
    Points,
}

impl ValueEnum for Method {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: LazyLock<Vec<Method>> = LazyLock::new(|| {
            let core = CoreMethod::value_variants().iter().map(|method| Method::Core(*method));
            core.chain([Method::Layers, Method::Points]).collect()
        });
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        match self {
            Method::Core(method) => method.to_possible_value(),
            Method::Layers => Some(PossibleValue::new("layers").help("Silhouette-mask layers: exact waves, slow")),
            Method::Points => Some(PossibleValue::new("points").help("A sub-hologram for each point (Maimone et al.)")),
        }
    }
}

#[derive(Clone, Copy, Default, ValueEnum)]
enum OcclusionName {
    /// Nothing: every point of every layer lights its whole sub-hologram
    None,
    /// The image: only points of the front layer shine
    Input,
    /// Rays: every point shines where no nearer surface is in the way
    #[default]
    Geometric,
}

impl OcclusionName {
    fn occlusion(self) -> Occlusion {
        match self {
            OcclusionName::None => Occlusion::None,
            OcclusionName::Input => Occlusion::Input,
            OcclusionName::Geometric => Occlusion::Geometric,
        }
    }
}

/// The numbers of a network.
#[derive(Clone, Copy, Default, PartialEq, ValueEnum)]
pub(crate) enum PrecisionName {
    #[default]
    /// Whole numbers of 8 bits: the fastest
    Int8,
    /// Floating point
    F32,
}

impl PrecisionName {
    pub(crate) fn precision(self) -> Precision {
        match self {
            PrecisionName::Int8 => Precision::Int8,
            PrecisionName::F32 => Precision::Float32,
        }
    }
}

/// Planes of the methods of exact waves.
const DEFAULT_PLANES: usize = 256;

/// The sweep that suits `display`, with these planes and taps where given.
pub(super) fn sweep_for(display: &phasefront::Display, planes: Option<usize>, taps: Option<usize>) -> Sweep {
    let usual = match planes {
        Some(planes) => Sweep::of_planes(display, planes),
        None => Sweep::for_display(display),
    };
    Sweep {
        taps: taps.unwrap_or(usual.taps),
        ..usual
    }
}

/// A field at the modulator, its levels, and how long each stage took.
pub(crate) struct Made {
    pub(crate) method: &'static str,
    pub(crate) field: Option<Array3<Complex32>>,
    pub(crate) levels: Array3<u8>,
    /// Of over 8 bits, of which `levels` are then the upper ones.
    pub(crate) words: Option<Array3<u16>>,
    pub(crate) encoder: Encoder,
    scale: f32,
    /// The last is the encoder's.
    pub(crate) stages: Vec<(&'static str, Duration)>,
    engine: Option<String>,
}

impl Made {
    /// The levels with all their bits.
    pub(crate) fn hologram(&self, info: HologramInfo) -> files::Hologram {
        match &self.words {
            Some(words) => files::Hologram::Words(words.clone(), info),
            None => files::Hologram::PhaseOnly(self.levels.clone(), info),
        }
    }
}

impl Hologram {
    pub(crate) fn run(mut self, json: bool) -> Result<()> {
        if let Some(pictures) = self.making.pictures()? {
            return self.stills(json, pictures);
        }
        if self.resume || self.overwrite {
            return Err(Error::Input(
                "--resume and --overwrite go with folders of pictures, as --rgb DIR --depth DIR; a file is replaced"
                    .into(),
            ));
        }
        output::file(&self.output, &["png"])?;
        if let Some(path) = &self.complex {
            files::declare_complex(path)?;
        }
        let display = self.making.display()?;
        if let Some(path) = &self.packed {
            packed::declare(path, &display)?;
        }
        self.making.keeps_field = self.complex.is_some() || self.judge;
        let made = self.making.make(&display, &self.making.image(&display)?)?;
        self.write(&display, &made)?;
        let judged = self.judge.then(|| judge(&display, &made)).transpose()?;
        self.report(json, &made, judged.as_ref());
        Ok(())
    }

    fn stills(self, json: bool, pictures: Vec<Picture>) -> Result<()> {
        let one = [
            (self.complex.is_some(), "--complex"),
            (self.packed.is_some(), "--packed"),
            (self.judge, "--judge"),
        ];
        if let Some((_, flag)) = one.iter().find(|(is_given, _)| *is_given) {
            return Err(Error::Input(format!(
                "{flag} goes with one picture, not with a folder of them"
            )));
        }
        let before = Before::of_flags(self.resume, self.overwrite);
        stills::run(self.making, pictures, &self.output, before, json)
    }

    fn write(&self, display: &DisplayFile, made: &Made) -> Result<()> {
        let (levels, field) = infos(display, made);
        if let (Some(path), Some(values)) = (&self.complex, &made.field) {
            if matches!(made.encoder.options.encoding, Encoding::Deep(_)) {
                log::warn!(
                    "{}: a field of --encoder deep is what its pre-filter was trained to take, not the wave that is shown; for that one take another --network",
                    path.display()
                );
            }
            files::write_complex(path, values.view(), &field)?;
        }
        let hologram = made.hologram(levels);
        if let Some(path) = &self.packed {
            packed::write(path, &packed::pack(&hologram, display)?)?;
        }
        files::write_hologram(&self.output, &hologram)
    }

    fn report(&self, json: bool, made: &Made, judged: Option<&Judged>) {
        let ms = |time: &Duration| (time.as_secs_f64() * 1e5).round() / 100.0;
        let stages: serde_json::Map<_, _> = (made.stages.iter())
            .map(|(stage, time)| ((*stage).to_owned(), json!(ms(time))))
            .collect();
        let total: Duration = made.stages.iter().map(|(_, time)| *time).sum();
        let (_, height, width) = made.levels.dim();
        let list: Vec<_> = (made.stages.iter())
            .map(|(stage, time)| format!("{stage} {:.1} ms", ms(time)))
            .collect();
        super::print(
            json,
            &json!({
                "output": self.output.display().to_string(), "complex": self.complex, "width": width, "height": height,
                "method": made.method, "encoder": made.encoder.name, "dark_threshold": made.encoder.options.dark_threshold,
                "local_steps": made.encoder.options.local_steps, "scale": made.scale, "engine": made.engine,
                "stage_ms": stages, "total_ms": ms(&total), "shown": judged,
            }),
            format!(
                "{}: {width}×{height} by {}; {}: {}{}",
                super::name(&self.output),
                made.method,
                made.encoder.describe(),
                list.join(", "),
                judged.map_or(String::new(), Judged::describe)
            ),
        );
    }
}

/// What a hologram is made of.
pub(crate) enum Image {
    /// An RGB-D image.
    Rgbd(RgbdFrame),
    /// A layered depth image.
    Layers(Ldi),
}

impl Making {
    /// The names of the flags besides those of [`FrameFlags`] and the display, for what takes their place.
    pub(crate) const NAMES: [&str; 15] = [
        "ldi",
        "method",
        "network",
        "precision",
        "planes",
        "taps",
        "occlusion",
        "encoder",
        "prefilter",
        "dark_threshold",
        "local_steps",
        "midpoint_steps",
        "scale",
        "backend",
        "gpu",
    ];

    /// Of images that are read already, for `display`.
    pub(crate) fn of(display: DisplayFlags) -> Self {
        Making {
            frame: FrameFlags::default(),
            ldi: None,
            method: None,
            network: None,
            precision: None,
            planes: None,
            taps: None,
            occlusion: None,
            encoder: EncoderFlags::default(),
            scale: None,
            backend: BackendFlags::default(),
            display,
            keeps_field: false,
        }
    }

    /// The same image another way.
    pub(crate) fn way(&mut self, method: Method, network: Option<String>, encoder: EncoderFlags) {
        (self.method, self.network, self.encoder) = (Some(method), network, encoder);
        (self.planes, self.precision) = (None, None);
    }

    /// With so many planes.
    pub(crate) fn with_planes(&mut self, planes: usize) {
        self.planes = Some(planes);
    }

    /// By a network in floating point.
    pub(crate) fn in_float32(&mut self) {
        self.precision = Some(PrecisionName::F32);
    }

    pub(crate) fn display(&self) -> Result<DisplayFile> {
        self.display.read()
    }

    /// Notes all but which picture it is of.
    pub(crate) fn record(&self, display: &phasefront::Display, request: &mut Request) -> Result<()> {
        let Making {
            frame,
            ldi: _, // It is one picture.
            method,
            network,
            precision,
            planes,
            taps,
            occlusion,
            encoder,
            scale,
            backend,
            display: flags,
            keeps_field: _,
        } = self;
        frame.record(request)?;
        request.choice("--method", method.as_ref());
        request.name_or_file("--network", network.as_deref())?;
        request.choice("--precision", Some(&precision.unwrap_or_default()));
        request.set("--planes", *planes);
        request.set("--taps", *taps);
        request.choice("--occlusion", Some(&occlusion.unwrap_or_default()));
        encoder.record(request)?;
        request.set("--scale", *scale);
        backend.record(request);
        flags.record(display, request)
    }

    /// The pictures of folders, where folders are given.
    fn pictures(&self) -> Result<Option<Vec<Picture>>> {
        self.frame.pictures()
    }

    /// The folders that pictures are from.
    pub(crate) fn folders(&self) -> impl Iterator<Item = &Path> {
        self.frame.folders()
    }

    /// Turns to one picture of a folder.
    pub(crate) fn take(&mut self, picture: &Picture) {
        self.frame.take(picture);
    }

    pub(crate) fn is_for_a_display(&self) -> bool {
        self.display.is_given()
    }

    pub(crate) fn display_if_given(&self) -> Result<Option<DisplayFile>> {
        self.display.read_if_given()
    }

    /// The file that the image is from.
    pub(crate) fn source(&self) -> Option<&Path> {
        self.ldi.as_deref().or(self.frame.source())
    }

    /// What the flags ask for.
    fn method(&self) -> Method {
        self.method.unwrap_or(match (&self.ldi, &self.network) {
            (Some(_), None) => Method::Layers,
            (None, None) if !self.encoder.is_deep() => Method::Core(CoreMethod::Auto),
            _ => Method::Core(CoreMethod::Network),
        })
    }

    /// Refuses flags that the method does not take.
    fn check_flags(&self) -> Result<()> {
        use CoreMethod::{Auto, Network, Sweep};
        let method = self.method();
        let any = |of: &[CoreMethod]| matches!(method, Method::Core(core) if of.contains(&core));
        let (sweeps, trained) = (any(&[Sweep, Auto]), any(&[Network, Auto]));
        let planes = sweeps || matches!(method, Method::Layers | Method::Points);
        let network = "--method network or auto";
        check_used(&[
            ("--network", self.network.is_some(), trained, network),
            ("--precision", self.precision.is_some(), trained, network),
            (
                "--planes",
                self.planes.is_some(),
                planes,
                "--method sweep, auto, layers or points",
            ),
            ("--taps", self.taps.is_some(), sweeps, "--method sweep or auto"),
            (
                "--occlusion",
                self.occlusion.is_some(),
                method == Method::Points,
                "--method points",
            ),
        ])
    }

    /// The image for `display`.
    pub(crate) fn image(&self, display: &DisplayFile) -> Result<Image> {
        self.check_flags()?;
        if let (Some(Method::Core(method)), Some(_)) = (self.method, &self.ldi)
            && method != CoreMethod::Network
        {
            return Err(Error::Input(
                "--method sweep and auto take --rgb and --depth; for a layered depth image use --method layers or points, or a --network for layers"
                    .into(),
            ));
        }
        match &self.ldi {
            Some(dir) => Ok(Image::Layers(
                Ldi::read(dir)?.for_display(&display.target.display).into_owned(),
            )),
            None => Ok(Image::Rgbd(
                self.frame.read(&display.target.display, self.display.is_given())?,
            )),
        }
    }

    pub(crate) fn make(&self, display: &DisplayFile, image: &Image) -> Result<Made> {
        let method = self.method();
        let device = self.backend.device()?;
        if device.is_some()
            && (matches!(method, Method::Layers | Method::Points) || self.keeps_field || self.ldi.is_some())
        {
            return Err(Error::Input(
                "--backend gpu runs --method network, sweep and auto on RGB-D, without --complex and --judge; the rest is the CPU's"
                    .into(),
            ));
        }
        match (method, image) {
            (Method::Core(method), Image::Rgbd(frame)) => {
                let chosen = match method {
                    CoreMethod::Auto => self.by_sharpness(frame, &display.target.display)?,
                    method => method,
                };
                // Where depth is sharp, auto leaves its network alone.
                let trained = method == chosen || chosen == CoreMethod::Network;
                let method = chosen;
                let (core, encoder) = method.of(&Parts {
                    network: self.network.as_deref().filter(|_| trained),
                    precision: self.precision.filter(|_| trained),
                    display: &display.target.display,
                    sweep: sweep_for(&display.target.display, self.planes, self.taps),
                    encoder: &self.encoder,
                })?;
                self.by_core(method.name(), core, frame, display, encoder, device.as_ref())
            }
            (method, Image::Rgbd(frame)) => {
                let ldi = Ldi::new(vec![LdiLayer::from(frame)])?;
                self.by_layers(method, &ldi, display, self.encoder.read()?)
            }
            (method, Image::Layers(ldi)) => self.by_layers(method, ldi, display, self.encoder.read()?),
        }
    }

    /// What suits the frame: the sweep where depth is sharp, or no network is for the display.
    fn by_sharpness(&self, frame: &RgbdFrame, display: &phasefront::Display) -> Result<CoreMethod> {
        let trained = self.network.is_some() || default_network(display).is_some();
        Ok(match trained && !sharpness::measure(frame).is_sharp() {
            true => CoreMethod::Network,
            false => CoreMethod::Sweep,
        })
    }

    /// The methods of the core, on the RGB-D image; their `stage` is called as they are.
    fn by_core(
        &self,
        stage: &'static str,
        method: phasefront::Method,
        frame: &RgbdFrame,
        display: &DisplayFile,
        encoder: Encoder,
        device: Option<&DeviceOptions>,
    ) -> Result<Made> {
        match device {
            Some(options) => self.on_gpu(stage, method, frame, display, encoder, options),
            None => self.on_cpu(stage, method, frame, display, encoder),
        }
    }

    fn on_cpu(
        &self,
        stage: &'static str,
        method: phasefront::Method,
        frame: &RgbdFrame,
        display: &DisplayFile,
        encoder: Encoder,
    ) -> Result<Made> {
        let (height, width) = frame.shape();
        let target = display.corrected()?;
        let options = self.encoder_options(&encoder.options);
        let pipeline = Pipeline::new((height, width), method, &target, &options)?;
        let mut scratch = pipeline.scratch();
        let mut field = Array3::from_elem((pipeline.colours(), height, width), Complex32::ZERO);
        let shape = field.dim();
        let values = field.as_slice_mut().expect("standard layout");
        let (predict, propagate) = pipeline.field(frame, values, &mut scratch)?;
        // The encoder filters the field that it is given, so a copy is kept where it is asked for.
        let kept = self.keeps_field.then(|| values.to_vec());
        let (levels, words, modulation) = levels_by(&target.display, (height, width), |out| match out {
            Out::Bytes(bytes) => pipeline.modulate(values, bytes, &mut scratch),
            Out::Words(phases, words) => pipeline.modulate_words(values, phases, words, &mut scratch),
        });
        let engine = pipeline.method().engine();
        Ok(Made {
            method: stage,
            field: kept.map(|values| stack(values, shape)),
            levels,
            words,
            encoder,
            scale: modulation.scale,
            stages: vec![
                (stage, predict),
                ("propagate", propagate),
                ("encode", modulation.encode),
            ],
            engine: engine.map(described),
        })
    }

    /// On a GPU that was tried out before.
    fn on_gpu(
        &self,
        stage: &'static str,
        method: phasefront::Method,
        frame: &RgbdFrame,
        display: &DisplayFile,
        encoder: Encoder,
        options: &DeviceOptions,
    ) -> Result<Made> {
        if display.target.display.bits() > 8 {
            return Err(Error::Input(
                "--backend gpu makes levels of up to 8 bits; those of over 8 are the CPU's".into(),
            ));
        }
        let (height, width) = frame.shape();
        let mut job = Job::new((height, width), method, display.corrected()?);
        job.encoder = self.encoder_options(&encoder.options);
        let device = Arc::new(Device::open(options)?);
        probe(&device, &job)?;
        let mut pipeline = GpuPipeline::new(&device, &job)?;
        let mut levels = Array3::zeros((3, height, width));
        let bytes = levels.as_slice_mut().expect("standard layout");
        let report = pipeline.process(&Frame::of(frame), bytes)?;
        gpu::keep_programs(&device);
        let times = report.times.unwrap_or_default();
        Ok(Made {
            method: stage,
            field: None,
            levels,
            words: None,
            encoder,
            scale: report.scale,
            stages: vec![
                ("input", times.input),
                (stage, times.method),
                ("propagate", times.propagate),
                ("encode", times.encode),
            ],
            engine: Some(pipeline.describe()),
        })
    }

    /// The methods for layered depth images.
    fn by_layers(&self, method: Method, ldi: &Ldi, file: &DisplayFile, encoder: Encoder) -> Result<Made> {
        let (height, width) = ldi.shape();
        // A correction that is one for all depths is part of the offset; others are SM-LBM's work.
        let (target, varying) = match (method, file.corrected()) {
            (_, Ok(target)) => (target, None),
            (Method::Layers, Err(_)) => (file.target.clone(), file.aberration.as_ref()),
            (_, Err(e)) => return Err(e),
        };
        let display = &target.display;
        let options = self.encoder_options(&encoder.options);
        let modulator = Modulator::new((height, width), &target, &options)?;
        let mut scratch = modulator.scratch();
        let planes = self.planes.unwrap_or(DEFAULT_PLANES);
        let start = Instant::now();
        let bar = progress_bar(0, "");
        let progress = |done: usize, total: usize| {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
        };
        let mut engine = None;
        let (stage, mut field) = match method {
            Method::Core(_) => {
                let plan = self.network_for_layers(display)?.plan_for(height, width, display)?;
                let mut field = Array3::zeros((display.colours(), height, width));
                let values = field.as_slice_mut().expect("standard layout");
                plan.field(ldi, values, &mut plan.scratch())?;
                engine = Some(described(plan.engine()));
                ("network", field)
            }
            Method::Points => {
                bar.set_message("rows");
                let occlusion = self.occlusion.unwrap_or_default().occlusion();
                let field = point_based::hologram(ldi, display, planes, occlusion, &progress)?;
                ("points", field)
            }
            _ => {
                bar.set_message("planes");
                let shape = ldi.shape();
                let field = match varying {
                    None => sm_lbm::hologram(ldi, display, planes, &progress)?,
                    Some(AberrationFile::Uniform(all)) => {
                        let correction = Correction::of_aberrations(all, shape, planes, display)?;
                        corrected::hologram(ldi, display, planes, &correction, &progress)?
                    }
                    Some(AberrationFile::Spatial(all)) => {
                        corrected::spatial::hologram(ldi, display, planes, all, &progress)?
                    }
                };
                ("layers", field)
            }
        };
        bar.finish_and_clear();
        let waved = Instant::now();
        let shape = field.dim();
        let values = field.as_slice_mut().expect("standard layout");
        modulator.propagate(values, &mut scratch);
        let propagate = waved.elapsed();
        let kept = self.keeps_field.then(|| values.to_vec());
        let (levels, words, modulation) = levels_by(display, (height, width), |out| match out {
            Out::Bytes(bytes) => modulator.modulate(values, bytes, &mut scratch),
            Out::Words(phases, words) => modulator.modulate_words(values, phases, words, &mut scratch),
        });
        Ok(Made {
            method: stage,
            field: kept.map(|values| stack(values, shape)),
            levels,
            words,
            encoder,
            scale: modulation.scale,
            stages: vec![
                (stage, waved - start),
                ("propagate", propagate),
                ("encode", modulation.encode),
            ],
            engine,
        })
    }

    /// The network of --network, which must take layers and be for `display`.
    fn network_for_layers(&self, display: &phasefront::Display) -> Result<Arc<phasefront::Network>> {
        let name = self.network.as_deref().ok_or_else(|| {
            Error::Input("--method network with --ldi needs a --network for layered depth images".into())
        })?;
        let network = models::network(name, self.precision.map(PrecisionName::precision))?;
        if !matches!(network.input(), InputKind::Ldi { .. }) {
            return Err(Error::Input(format!(
                "--network {name} takes '{}'; for a layered depth image one for 'ldi2' to 'ldi9' is needed",
                network.input()
            )));
        }
        network.check_display(display)?;
        Ok(network)
    }

    fn encoder_options(&self, usual: &EncoderOptions) -> EncoderOptions {
        EncoderOptions {
            brightness: self.scale.map_or(Brightness::FrameMax, Brightness::Fixed),
            ..usual.clone()
        }
    }
}

/// What files of the levels and of the field say.
pub(crate) fn infos(display: &DisplayFile, made: &Made) -> (HologramInfo, HologramInfo) {
    let levels = HologramInfo {
        calibrated: display.calibrated(true),
        display: display.target.display.clone(),
        encoder: Some(made.encoder.name.into()),
        scale: Some(made.scale),
        lut: display.lut.map(Vec::from),
        levels_turns: display.target.panel.levels_turns.clone(),
    };
    let field = HologramInfo {
        encoder: None,
        scale: None,
        lut: None,
        levels_turns: None,
        calibrated: display.calibrated(false),
        ..levels.clone()
    };
    (levels, field)
}

/// How near what a hologram shows is to its own wave.
#[derive(Serialize)]
pub(crate) struct Judged {
    pub(crate) psnr_db: f64,
    pub(crate) ssim: f64,
    pub(crate) stack_psnr_db: f64,
    pub(crate) stack_ssim: f64,
    /// Mean amplitude over the wave's.
    pub(crate) brightness: f64,
}

impl Judged {
    fn describe(&self) -> String {
        format!(
            "; shown of its own wave: {:.2} dB, SSIM {:.3}, over the stack {:.2} dB, {:.3}",
            self.psnr_db, self.ssim, self.stack_psnr_db, self.stack_ssim
        )
    }
}

pub(crate) fn judge(display: &DisplayFile, made: &Made) -> Result<Judged> {
    let (levels, field) = infos(display, made);
    let wave = made.field.clone().expect("kept for this");
    let z_m = evaluate::judged_z_m(&display.target.display);
    let wave = files::Hologram::Complex(wave, field).views_on(display, &z_m)?;
    let shown = made.hologram(levels).views_on(display, &z_m)?;
    let figures = evaluate::judge(&shown, &wave, 0)?;
    Ok(Judged {
        psnr_db: figures.amplitude_psnr,
        ssim: figures.amplitude_ssim,
        stack_psnr_db: figures.focal_psnr,
        stack_ssim: figures.focal_ssim,
        brightness: figures.brightness,
    })
}

fn described(engine: &Engine) -> String {
    format!("{} ({})", engine.name, engine.why)
}

/// Where levels are put.
enum Out<'a> {
    Bytes(&'a mut [u8]),
    /// With memory for phases.
    Words(&'a mut [f32], &'a mut [u16]),
}

/// Levels of the bits of `display` for (H, W) pixels, which `modulate` makes: bytes, and words where there are over 8.
fn levels_by(
    display: &phasefront::Display,
    (height, width): (usize, usize),
    modulate: impl FnOnce(Out<'_>) -> Modulation,
) -> (Array3<u8>, Option<Array3<u16>>, Modulation) {
    let shape = (display.colours(), height, width);
    let mut levels = Array3::zeros(shape);
    if display.bits() <= 8 {
        let modulation = modulate(Out::Bytes(levels.as_slice_mut().expect("standard layout")));
        return (levels, None, modulation);
    }
    let mut words = Array3::zeros(shape);
    let values = words.as_slice_mut().expect("standard layout");
    let modulation = modulate(Out::Words(&mut vec![0.0; values.len()], values));
    let upper = words.mapv(|word: u16| (word >> (display.bits() - 8)) as u8);
    (upper, Some(words), modulation)
}

fn stack(values: Vec<Complex32>, shape: (usize, usize, usize)) -> Array3<Complex32> {
    Array3::from_shape_vec(shape, values).expect("a stack of the frame's shape")
}
