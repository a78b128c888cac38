//! Flags that several commands share.

use super::request::Request;
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use phasefront::unstable::depth::DepthUnit;
use phasefront::unstable::gpu::DeviceOptions;
use phasefront::{Display, EncoderOptions, Encoding, Network};
use phasefront_lab::files::{self, DisplayFile};
use phasefront_lab::models::Precision;
use phasefront_lab::output::Holding;
use phasefront_lab::rgbd::DepthOptions;
use phasefront_lab::{Error, Result, gpu, models};
use std::path::Path;
use std::sync::{Arc, LazyLock};

/// The display that a hologram is for.
#[derive(Clone, Args)]
pub(crate) struct DisplayFlags {
    /// TOML file of the display, or a modulator's name as `phasefront devices` lists them [default: 1920×1080, 8 µm,
    /// 638/520/450 nm, 6 mm]
    #[arg(long, value_name = "FILE|NAME")]
    display: Option<String>,
    /// z of the hologram against the middle of the volume, mm, positive toward the viewer
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    offset_mm: Option<f64>,
}

impl DisplayFlags {
    /// Whether a display is asked for.
    pub(crate) fn is_given(&self) -> bool {
        self.display.is_some()
    }

    /// Notes the display, which [`Self::read`] gives.
    pub(crate) fn record(&self, display: &Display, request: &mut Request) -> Result<()> {
        let DisplayFlags {
            display: name,
            offset_mm: _, // It is part of `display`.
        } = self;
        request.display(name.as_deref(), display)
    }

    /// Of a command that knows red, green and blue alone, and no offset.
    pub(crate) fn read_of_midpoint(&self) -> Result<DisplayFile> {
        check_used(&[(
            "--offset-mm",
            self.offset_mm.is_some(),
            false,
            "holograms at the modulator",
        )])?;
        self.read_of_three()
    }

    /// Of a command that knows red, green and blue alone.
    pub(crate) fn read_of_three(&self) -> Result<DisplayFile> {
        let file = self.read()?;
        match file.target.display.colours() {
            3 => Ok(file),
            _ => Err(Error::Input(
                "this command is for displays of three lasers; --display has one".into(),
            )),
        }
    }

    /// Of a command that needs none.
    pub(crate) fn read_if_given(&self) -> Result<Option<DisplayFile>> {
        match (&self.display, self.offset_mm) {
            (Some(_), _) => Ok(Some(self.read()?)),
            (None, None) => Ok(None),
            (None, Some(_)) => Err(Error::Input(
                "--offset-mm goes with --display; a hologram file says its own offset".into(),
            )),
        }
    }

    pub(crate) fn read(&self) -> Result<DisplayFile> {
        let mut file = match &self.display {
            Some(name) => files::find_display(name)?,
            None => phasefront::Display::default().into(),
        };
        if let Some(mm) = self.offset_mm {
            file.target.display = file.target.display.with_offset_m(mm / 1e3)?;
            file.device.display = file.target.display.clone();
        }
        if let Some(turns) = &file.target.panel.levels_turns
            && let Some(gap) = gap(turns)
        {
            log::warn!(
                "the modulator's levels reach {:.2} of 2π; phases beyond become the nearest that they show, at most {:.2} rad away",
                1.0 - gap,
                gap * std::f64::consts::PI
            );
        }
        Ok(file)
    }
}

/// The part of a turn that levels of these phases do not reach, where it is wider than what they leave out elsewhere.
fn gap(turns: &[f64]) -> Option<f64> {
    let widest = turns.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    let gap = 1.0 - turns.last()?;
    (gap > 1.5 * widest).then_some(gap)
}

/// How the field becomes phases.
#[derive(Default, Args)]
pub(crate) struct EncoderFlags {
    /// How the field becomes phases [default: anti-alias; deep with --network ddpm-8]
    #[arg(long, value_enum)]
    encoder: Option<EncoderName>,
    /// ONNX file of the pre-filter of --encoder deep, trained for the offset [default: the one of --network ddpm-8]
    #[arg(long, value_name = "FILE")]
    prefilter: Option<String>,
    /// Share of full light, 0 to 1, below which phases are drawn to 0, against speckle in the dark [default: 0.4; 0
    /// with --encoder deep]
    #[arg(long, value_name = "D")]
    dark_threshold: Option<f32>,
    /// Steps that draw what is shown toward the field that is wanted, 0 to 8 [default: 1; 0 with --encoder deep]
    #[arg(long, value_name = "N")]
    local_steps: Option<usize>,
    /// Steps of correction at the midpoint after them, for stills; 1 brings most at the midpoint, 10 all
    #[arg(long, value_name = "N", default_value_t = 0)]
    midpoint_steps: usize,
}

/// How a field becomes phases, and what it is called.
#[derive(Clone)]
pub(crate) struct Encoder {
    pub(crate) options: EncoderOptions,
    pub(crate) name: &'static str,
}

impl Encoder {
    pub(crate) fn describe(&self) -> String {
        let EncoderOptions {
            dark_threshold,
            local_steps,
            midpoint_steps,
            ..
        } = &self.options;
        let last = match midpoint_steps {
            0 => String::new(),
            steps => format!(", midpoint steps {steps}"),
        };
        format!("{}, dark {dark_threshold}, local steps {local_steps}{last}", self.name)
    }
}

impl EncoderFlags {
    pub(crate) fn of(encoder: EncoderName, dark_threshold: f32, local_steps: usize, midpoint_steps: usize) -> Self {
        EncoderFlags {
            encoder: Some(encoder),
            prefilter: None,
            dark_threshold: Some(dark_threshold),
            local_steps: Some(local_steps),
            midpoint_steps,
        }
    }

    pub(crate) fn record(&self, request: &mut Request) -> Result<()> {
        let EncoderFlags {
            encoder,
            prefilter,
            dark_threshold,
            local_steps,
            midpoint_steps,
        } = self;
        request.choice("--encoder", encoder.as_ref());
        request.file("--prefilter", prefilter.as_ref().map(Path::new))?;
        request.set("--dark-threshold", *dark_threshold);
        request.set("--local-steps", *local_steps);
        request.set("--midpoint-steps", Some(*midpoint_steps));
        Ok(())
    }

    /// For fields that no network of a pair makes.
    pub(crate) fn read(&self) -> Result<Encoder> {
        let prefilter = match &self.prefilter {
            Some(file) => Some(models::network(file, None)?),
            None => None,
        };
        let usual = if prefilter.is_some() { DEEP } else { "anti-alias" };
        let name = self.encoder.unwrap_or(EncoderName(usual));
        Ok(self.encoder(name.encoding(prefilter)?, name))
    }

    fn encoder(&self, encoding: Encoding, name: EncoderName) -> Encoder {
        let usual = EncoderOptions::from(encoding);
        Encoder {
            options: EncoderOptions {
                dark_threshold: self.dark_threshold.unwrap_or(usual.dark_threshold),
                local_steps: self.local_steps.unwrap_or(usual.local_steps),
                midpoint_steps: self.midpoint_steps,
                ..usual
            },
            name: name.name(),
        }
    }

    /// Whether the pre-filter is asked for by name.
    pub(crate) fn is_deep(&self) -> bool {
        matches!(self.encoder, Some(EncoderName(DEEP)))
    }

    /// The network called `network`, and the encoder that belongs to it or is asked for: the bundled pair for
    /// `display` by its name or for --encoder deep, else 8 layers.
    pub(crate) fn with_network(
        &self,
        network: Option<&str>,
        precision: Option<Precision>,
        display: &Display,
    ) -> Result<(Arc<Network>, Encoder)> {
        let by_name = network == Some(models::DEEP);
        let deep = self.is_deep() || (by_name && self.encoder.is_none());
        if deep && self.prefilter.is_none() && (by_name || network.is_none()) {
            let Some(pair) = phasefront_models::pair_for(display, precision.unwrap_or_default()) else {
                let offsets = phasefront_models::PAIRS.iter().map(|pair| pair.offset_mm.to_string());
                return Err(Error::Input(format!(
                    "networks for the deep encoder are bundled for offsets of {} mm and the default display; train a pair for this one, or take --network 8 --encoder anti-alias",
                    offsets.collect::<Vec<_>>().join(", ")
                )));
            };
            let encoder = self.encoder(Encoding::Deep(pair.prefilter), EncoderName(DEEP));
            return Ok((pair.hologram, encoder));
        }
        if by_name {
            return Err(Error::Input(format!(
                "--network {} brings its own --encoder, deep, and --prefilter; leave them out",
                models::DEEP
            )));
        }
        Ok((models::network(network.unwrap_or("8"), precision)?, self.read()?))
    }
}

/// What the encoding with a pre-filter is called.
const DEEP: &str = "deep";

/// The name of an encoder: one of the core's, or [`DEEP`].
#[derive(Clone, Copy)]
pub(crate) struct EncoderName(&'static str);

impl ValueEnum for EncoderName {
    fn value_variants<'a>() -> &'a [Self] {
        static NAMES: LazyLock<Vec<EncoderName>> = LazyLock::new(|| {
            let names = Encoding::BY_NAME.iter().map(|(name, ..)| *name);
            names.chain([DEEP]).map(EncoderName).collect()
        });
        &NAMES
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let what = match self.known() {
            Some((_, what, _)) => what,
            None => "Double phase after a pre-filter network (DDPM)",
        };
        Some(PossibleValue::new(self.0).help(what))
    }
}

impl EncoderName {
    fn known(self) -> Option<&'static (&'static str, &'static str, Encoding)> {
        Encoding::BY_NAME.iter().find(|(name, ..)| *name == self.0)
    }

    pub(crate) fn encoding(self, prefilter: Option<Arc<Network>>) -> Result<Encoding> {
        Ok(match (self.known(), prefilter) {
            (Some((.., encoding)), None) => encoding.clone(),
            (None, Some(network)) => Encoding::Deep(network),
            (None, None) => {
                return Err(Error::Input("--encoder deep needs --prefilter".into()));
            }
            (Some((name, ..)), Some(_)) => {
                return Err(Error::Input(format!(
                    "--prefilter goes with --encoder deep, not with {name}"
                )));
            }
        })
    }

    pub(crate) fn name(self) -> &'static str {
        self.0
    }
}

/// What the numbers of a depth image mean, and which are shown where.
#[derive(Default, Args)]
pub(crate) struct DepthFlags {
    /// What the depth's numbers mean; 0 and NaN are no reading, but for normalized depth [default: normalized]
    #[arg(long, value_enum)]
    depth_unit: Option<UnitName>,
    /// Units in a metre, for --depth-unit raw
    #[arg(long, value_name = "N", required_if_eq("depth_unit", "raw"))]
    depth_scale: Option<f64>,
    /// Metres shown nearest, whatever the unit of the depth's numbers [default: the 1st percentile]
    #[arg(long, value_name = "M")]
    near: Option<f32>,
    /// Metres shown farthest, whatever the unit of the depth's numbers [default: the 99th percentile]
    #[arg(long, value_name = "M")]
    far: Option<f32>,
}

#[derive(Clone, Copy, Default, PartialEq, ValueEnum)]
enum UnitName {
    #[default]
    /// 0 nearest to the largest number farthest
    Normalized,
    /// Metres
    M,
    /// Millimetres
    Mm,
    /// Inverse metres
    Disparity,
    /// --depth-scale units a metre
    Raw,
}

impl DepthFlags {
    pub(crate) fn record(&self, request: &mut Request) {
        let DepthFlags {
            depth_unit,
            depth_scale,
            near,
            far,
        } = self;
        request.choice("--depth-unit", Some(&depth_unit.unwrap_or_default()));
        request.set("--depth-scale", *depth_scale);
        request.set("--near", *near);
        request.set("--far", *far);
    }

    /// --near and --far of video, metres.
    pub(crate) fn range(&self) -> Result<Option<(f32, f32)>> {
        match (self.near, self.far) {
            (None, None) => Ok(None),
            (Some(near), Some(far)) => Ok(Some((near, far))),
            _ => Err(Error::Input("video needs both --near and --far, or neither".into())),
        }
    }

    pub(crate) fn options(&self) -> Result<DepthOptions> {
        let unit = self.depth_unit.unwrap_or_default();
        check_used(&[(
            "--depth-scale",
            self.depth_scale.is_some(),
            unit == UnitName::Raw,
            "--depth-unit raw",
        )])?;
        let unit = match unit {
            UnitName::Normalized => DepthUnit::Normalized,
            UnitName::M => DepthUnit::Metres,
            UnitName::Mm => DepthUnit::Millimetres,
            UnitName::Disparity => DepthUnit::Disparity,
            UnitName::Raw => DepthUnit::Raw {
                units_per_m: self.depth_scale.unwrap_or(f64::NAN),
            },
        };
        Ok(DepthOptions {
            unit,
            near_m: self.near,
            far_m: self.far,
        })
    }
}

/// Where frames are made.
#[derive(Default, Args)]
pub(crate) struct BackendFlags {
    /// Where frames are made
    #[arg(long, value_enum, default_value_t = BackendName::Cpu)]
    backend: BackendName,
    /// A part of the GPU's name [default: the fastest; drivers in software are taken by name only]
    #[arg(long, value_name = "NAME")]
    gpu: Option<String>,
}

#[derive(Clone, Copy, Default, PartialEq, ValueEnum)]
enum BackendName {
    /// The processor
    #[default]
    Cpu,
    /// The graphics processor, by Vulkan, Metal or DirectX 12
    Gpu,
}

impl BackendFlags {
    pub(crate) fn record(&self, request: &mut Request) {
        let BackendFlags { backend, gpu } = self;
        request.choice("--backend", Some(backend));
        request.set("--gpu", gpu.as_ref());
    }

    /// Which GPU, if one is wanted.
    pub(crate) fn device(&self) -> Result<Option<DeviceOptions>> {
        match (self.backend, &self.gpu) {
            (BackendName::Gpu, name) => Ok(Some(gpu::options(name.as_deref()))),
            (BackendName::Cpu, None) => Ok(None),
            (BackendName::Cpu, Some(_)) => Err(Error::Input("--gpu needs --backend gpu".into())),
        }
    }
}

/// Refuses a flag that changes nothing: of each its name, whether it is given, whether it is used, and what it goes
/// with.
pub(crate) fn check_used(flags: &[(&str, bool, bool, &str)]) -> Result<()> {
    match flags.iter().find(|(_, given, used, _)| *given && !*used) {
        None => Ok(()),
        Some((flag, .., with)) => Err(Error::Input(format!(
            "{flag} goes with {with}; here it would change nothing, leave it out"
        ))),
    }
}

/// What becomes of files that an output's place holds already.
#[derive(Default, Args)]
pub(crate) struct OverwriteFlag {
    /// Replace what an earlier run made; without it an output folder must be new or empty, a calibration's file absent
    #[arg(long)]
    overwrite: bool,
}

impl OverwriteFlag {
    pub(crate) fn is_given(&self) -> bool {
        self.overwrite
    }

    /// What an output folder may hold.
    pub(crate) fn holding(&self) -> Holding<'static> {
        Holding::by_flag(self.overwrite)
    }
}

/// Width and height as 1920x1080.
pub(crate) fn parse_size(text: &str) -> std::result::Result<(usize, usize), String> {
    let parsed = text
        .split_once(['x', '×'])
        .and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    match parsed {
        Some((w, h)) if (1..=16384).contains(&w) && (1..=16384).contains(&h) => Ok((w, h)),
        _ => Err("a size is written WxH, as 1920x1080, each up to 16384".into()),
    }
}

/// A count on stderr of what has no known end.
pub(crate) fn progress_count(what: &str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {pos} {elapsed}, {per_sec}").expect("a well-formed template");
    ProgressBar::no_length().with_style(style).with_message(what.to_owned())
}

/// A progress bar on stderr, with the time left, where stderr is a terminal.
pub(crate) fn progress_bar(total: u64, what: &str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {elapsed} {eta} left")
        .expect("a well-formed template");
    ProgressBar::new(total).with_style(style).with_message(what.to_owned())
}
