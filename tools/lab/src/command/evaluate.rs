//! `phasefront-lab evaluate` computes the paper's Table 2 on a data set.

use super::sensors::{self, Sensors};
use clap::{Args, ValueEnum};
use phasefront::target::Response;
use phasefront::{Display, EncoderOptions, Sweep, Target};
use phasefront_command::flags::{EncoderName, OverwriteFlag, PrecisionName, check_used, sweep_for};
use phasefront_command::networks;
use phasefront_command::terminal::{self, progress_bar};
use phasefront_core::method::sweep::MAX_HIDDEN_LAYERS;
use phasefront_core::optics::aperture::Opening;
use phasefront_io::{Error, Result, output};
use phasefront_lab::dataset::Manifest;
use phasefront_lab::evaluate::{self, Judged, Method, Row, Sample, Shown};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Evaluate methods and networks on a data set: amplitude PSNR and SSIM, at the midpoint and over focal stacks;
/// colours, as CIEDE2000 of the light of squares of 8 pixels at the midpoint; brightness relative to the truth; and the
/// share of the modulator's light that passes the aperture
///
/// A focal stack consists of a scene's 15 most frequent depths and 5 random ones.
#[derive(Args)]
pub(crate) struct Evaluate {
    /// Folder of the data set, as made by `phasefront-lab dataset`
    data: PathBuf,
    /// Methods to evaluate, separated by commas
    #[arg(
        long,
        value_enum,
        value_name = "NAME,…",
        value_delimiter = ',',
        required_unless_present_any = ["network", "pair"]
    )]
    method: Vec<MethodName>,
    /// Networks to evaluate, separated by commas: a bundled network or an ONNX file
    #[arg(long, value_name = "8|15|FILE,…", value_delimiter = ',')]
    network: Vec<String>,
    /// Precision of the bundled networks [default: int8]
    #[arg(long, value_enum)]
    precision: Option<PrecisionName>,
    /// Evaluate the bundled pair of networks for the offset as well; its pre-filter replaces each --encoder, so its
    /// rows are named deep
    #[arg(long)]
    pair: bool,
    /// Encoders to evaluate as well, separated by commas; the complex field is always evaluated
    #[arg(long, value_enum, value_name = "NAME,…", value_delimiter = ',')]
    encoder: Vec<EncoderName>,
    /// Dark thresholds to evaluate with each encoder: the share of full light below which phases are drawn to 0
    #[arg(long, value_name = "D,…", value_delimiter = ',', default_values_t = [EncoderOptions::DARK_THRESHOLD], requires = "encoder")]
    dark_threshold: Vec<f32>,
    /// Numbers of local correction steps to evaluate with each encoder
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_values_t = [1], requires = "encoder")]
    local_steps: Vec<usize>,
    /// Numbers of midpoint steps to evaluate with each encoder
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_values_t = [0], requires = "encoder")]
    midpoint_steps: Vec<usize>,
    /// Numbers of steps of natural focus to evaluate with each encoder, without midpoint steps
    #[arg(long, value_name = "N,…", value_delimiter = ',', requires = "encoder")]
    focus_steps: Vec<usize>,
    /// Also evaluate the ceiling of every encoder: the end of a gradient descent with this number of steps from the
    /// last of these settings, which takes some seconds per scene
    #[arg(long, value_name = "N", requires = "encoder")]
    ceiling: Option<usize>,
    /// z of encoded holograms relative to the middle of the volume, mm, positive toward the viewer
    #[arg(long, value_name = "X", default_value_t = 0.0, allow_negative_numbers = true)]
    offset_mm: f64,
    /// Bits of the modulator for encoded holograms
    #[arg(long, value_name = "N", default_value_t = 8, requires = "encoder")]
    bits: u32,
    /// Radius of the viewing aperture [default: the display's, which holograms are made for]
    #[arg(long, value_name = "R", requires = "encoder")]
    look_radius: Option<f64>,
    /// Distance of the viewing aperture's centre from the optical axis, as a fraction of its radius
    #[arg(
        long,
        value_name = "S",
        default_value_t = 0.0,
        allow_negative_numbers = true,
        requires = "encoder"
    )]
    look_shift: f64,
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', value_parser = sensors::parse, help = format!("Simulated sensors whose depth methods receive as well, treated as in sessions, separated by commas: {}", sensors::names()))]
    sensor: Vec<Sensors>,
    /// Split of the data set
    #[arg(long, value_enum, default_value_t = Split::Test)]
    split: Split,
    /// Number of scenes to evaluate, from the start of the split
    #[arg(long, value_name = "N")]
    scenes: Option<usize>,
    /// Planes of SM-LBM [default: the data set's] and of the sweep [default: suits the display]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    planes: Option<u32>,
    /// Taps of the sweep's filter [default: suits the planes and the display]
    #[arg(long, value_name = "N")]
    taps: Option<usize>,
    /// Hidden layers of the sweep [default: 2]
    #[arg(long, value_name = "N")]
    hidden_layers: Option<usize>,
    /// Pixels along each side of the sweep's tiles [default: 256]
    #[arg(long, value_name = "N")]
    tile: Option<usize>,
    /// Seed of the random depths in the focal stacks
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..1 << 32))]
    seed: u64,
    /// Pixels at each scene's border that do not count; the reach of light is λ/2p of the offset: 30 pixels for 6 mm
    #[arg(long, value_name = "PX", default_value_t = 0)]
    margin: usize,
    /// Folder for pictures of the worst scenes: input, result, truth, and 4 times the difference
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// Number of pictures per table row
    #[arg(long, value_name = "N", default_value_t = 3, requires = "pictures")]
    worst: usize,
    #[command(flatten)]
    overwrite: OverwriteFlag,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum MethodName {
    /// The visible image as the field, with phase 0
    Rgb,
    /// SM-LBM of the visible layer
    Visible,
    /// SM-LBM of the visible layer and the hidden surfaces that the sweep adds
    Filled,
    /// The plane sweep of the visible layer
    Sweep,
    /// The plane sweep if the depth is clean, otherwise the bundled network of 8 layers
    Auto,
    /// SM-LBM of all layers
    Layers,
    /// A sub-hologram for each visible point (Maimone et al.)
    Points,
}

#[derive(Clone, Copy, ValueEnum)]
enum Split {
    Train,
    Validation,
    Test,
    /// All three
    All,
}

impl Evaluate {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        if let Some(folder) = &self.pictures {
            output::folder(folder, self.overwrite.holding())?;
        }
        let manifest = Manifest::read(&self.data)?;
        let (split, [start, end]) = match self.split {
            Split::Train => ("train", manifest.splits.train),
            Split::Validation => ("validation", manifest.splits.validation),
            Split::Test => ("test", manifest.splits.test),
            Split::All => ("all", [0, manifest.scenes]),
        };
        let scenes: Vec<usize> = (start..end).take(self.scenes.unwrap_or(usize::MAX)).collect();
        self.check_flags()?;
        let methods = self.methods(&manifest)?;
        let shown = self.shown(&manifest.display)?;
        let bar = progress_bar(scenes.len() as u64, "scenes");
        let sample = Sample {
            scenes,
            seed: self.seed,
            sensors: Sensors::all(&self.sensor),
            margin: self.margin,
        };
        let rows = evaluate::evaluate(&manifest, &self.data, &sample, &methods, &shown, &|| bar.inc(1))?;
        let scenes = sample.scenes;
        bar.finish_and_clear();
        if let Some(dir) = &self.pictures {
            output::make_folder(dir)?;
            let ways = methods.iter().flat_map(|method| {
                evaluate::ways(method, &shown)
                    .into_iter()
                    .map(move |shown| (method, shown))
            });
            for (row, (method, shown)) in rows.iter().zip(ways) {
                for (rank, index) in row.worst(self.worst).into_iter().enumerate() {
                    let name = format!(
                        "{}-{}-worst-{}-scene-{index:06}.png",
                        file_stem(&row.method),
                        row.shown.replace(", ", "-").replace(' ', "-"),
                        rank + 1
                    );
                    evaluate::write_picture(&dir.join(name), &manifest, &self.data, index, method, &shown)?;
                }
            }
        }
        let value = json!({
            "data": self.data, "split": split, "scenes": scenes.len(), "size": manifest.size,
            "planes": self.planes.map_or(manifest.planes, |n| n as usize), "seed": self.seed,
            "offset_mm": self.offset_mm, "bits": self.bits, "margin": self.margin,
            "look_radius": self.look_radius, "look_shift": self.look_shift,
            "natural": "what incoherent light shows of the whole scene through the same aperture, at six depths of focus",
            "focal_stack": {
                "bins": evaluate::DEPTH_BINS, "frequent": evaluate::FREQUENT_DEPTHS, "random": evaluate::RANDOM_DEPTHS,
            },
            "rows": rows,
        });
        terminal::print(json, &value, table(&rows, scenes.len(), split));
        Ok(())
    }

    /// Returns an error for flags that none of the methods uses.
    fn check_flags(&self) -> Result<()> {
        let has = |wanted: &[MethodName]| self.method.iter().any(|method| wanted.contains(method));
        let sweep = has(&[MethodName::Sweep, MethodName::Auto]);
        let planes = self.method.iter().any(|method| *method != MethodName::Rgb);
        let networks =
            self.pair || has(&[MethodName::Auto]) || self.network.iter().any(|name| networks::is_bundled(name));
        let cases = [
            (
                "--precision",
                self.precision.is_some(),
                networks,
                "a bundled --network, --pair or --method auto",
            ),
            ("--planes", self.planes.is_some(), planes, "a --method of waves"),
            ("--taps", self.taps.is_some(), sweep, "--method sweep or auto"),
            (
                "--hidden-layers",
                self.hidden_layers.is_some(),
                sweep,
                "--method sweep or auto",
            ),
            ("--tile", self.tile.is_some(), sweep, "--method sweep or auto"),
        ];
        check_used(&cases)
    }

    fn shown(&self, display: &Display) -> Result<Vec<Shown>> {
        let target = Target {
            response: Response::linear(self.bits)?,
            ..display.clone().with_offset_m(self.offset_mm / 1e3)?.into()
        };
        let radius = self.look_radius.unwrap_or(display.aperture_radius());
        let through = Some(Opening {
            radius,
            shift: self.look_shift * radius,
        });
        let mut shown = vec![Shown::complex()];
        for encoder in &self.encoder {
            let encoding = encoder.encoding(None).map_err(|_| {
                Error::Usage(format!(
                    "--encoder {} needs the network that its pre-filter was trained with: --pair judges the bundled ones, `python -m phasefront_training evaluate-encoding` others",
                    encoder.name()
                ))
            })?;
            for &dark_threshold in &self.dark_threshold {
                for &local_steps in &self.local_steps {
                    let steps = (self.midpoint_steps.iter().map(|midpoint| (*midpoint, 0)))
                        .chain(self.focus_steps.iter().map(|focus| (0, *focus)));
                    shown.extend(steps.map(|(midpoint_steps, focus_steps)| {
                        let options = EncoderOptions {
                            dark_threshold,
                            local_steps,
                            midpoint_steps,
                            focus_steps,
                            ..encoding.clone().into()
                        };
                        Shown {
                            through,
                            ..Shown::encoded(encoder.name(), target.clone(), options)
                        }
                    }));
                }
            }
        }
        if let (Some(steps), Some(last)) = (self.ceiling, shown.last()) {
            shown.push(Shown {
                name: format!("ceiling, {steps} steps"),
                ceiling: steps,
                ..last.clone()
            });
        }
        Ok(shown)
    }

    fn sweep(&self, display: &Display) -> Sweep {
        Sweep {
            hidden_layers: self.hidden_layers.unwrap_or(MAX_HIDDEN_LAYERS),
            tile: self.tile.unwrap_or(Sweep::TILE),
            ..sweep_for(display, self.planes.map(|n| n as usize), self.taps)
        }
    }

    fn methods<'a>(&self, manifest: &'a Manifest) -> Result<Vec<Method<'a>>> {
        let planes = self.planes.map_or(manifest.planes, |n| n as usize);
        let display = &manifest.display;
        let mut methods: Vec<_> = (self.method.iter())
            .map(|name| {
                Ok(match name {
                    MethodName::Rgb => Method::rgb(display),
                    MethodName::Visible => Method::visible(display, planes),
                    MethodName::Filled => Method::filled(display, planes),
                    MethodName::Sweep => Method::sweep(manifest.size, display, self.sweep(display))?,
                    MethodName::Auto => {
                        let network = networks::network("8", self.precision.map(PrecisionName::precision))?;
                        Method::auto(manifest.size, display, self.sweep(display), network)?
                    }
                    MethodName::Layers => Method::layers(display, planes),
                    MethodName::Points => Method::points(display, planes),
                })
            })
            .collect::<Result<_>>()?;
        for name in &self.network {
            let precision = self.precision.filter(|_| networks::is_bundled(name));
            let network = networks::network(name, precision.map(PrecisionName::precision))?;
            let label = format!("network {}", file_stem(name));
            let method = Method::network(label, &network, manifest.size, &manifest.display);
            methods.push(method.map_err(|e| Error::file(name, e))?);
        }
        if self.pair {
            let target = display.clone().with_offset_m(self.offset_mm / 1e3)?;
            let pair = phasefront_models::pair_for(&target, self.precision.unwrap_or_default().precision())
                .ok_or_else(|| {
                    Error::Input(format!(
                        "no pair of networks is bundled for an offset of {} mm and this display",
                        self.offset_mm
                    ))
                })?;
            methods.push(Method::pair(
                "pair",
                &pair.hologram,
                pair.prefilter,
                manifest.size,
                &target,
            )?);
        }
        Ok(methods)
    }
}

/// Returns a name that a file may have: the last part of a path without the extension and without blanks.
fn file_stem(name: &str) -> String {
    let stem = Path::new(name).file_stem().unwrap_or_default();
    stem.to_string_lossy().replace(' ', "-")
}

fn table(rows: &[Row], scenes: usize, split: &str) -> String {
    let widest = |least: usize, name: &dyn Fn(&Row) -> String| {
        rows.iter().map(|row| name(row).chars().count()).fold(least, usize::max)
    };
    let depth = |row: &Row| row.sensor.map_or_else(|| "true".to_owned(), sensors::name_of);
    let (method, shown) = (
        widest(6, &|row| row.method.clone()),
        widest(10, &|row| row.shown.clone()),
    );
    let depths = widest(5, &depth);
    let mut text = format!(
        "{:depths$}  wrong  {:method$}  {:shown$}  PSNR dB    SSIM  focal PSNR dB  focal SSIM  natural dB  in focus  out of focus  natural SSIM  CIEDE2000  brightness  light  worst PSNR dB (scene)   ({scenes} scenes of {split})",
        "depth", "method", "shown"
    );
    for row in rows {
        let worst = row.worst(1)[0];
        let least = row
            .scenes
            .iter()
            .map(|(_, f)| f.coherent.amplitude_psnr)
            .fold(f64::INFINITY, f64::min);
        let Judged {
            coherent,
            natural,
            ciede2000,
        } = row.mean;
        let db = |psnr: Option<f64>| psnr.map_or_else(|| "–".to_owned(), |psnr| format!("{psnr:.2}"));
        text += &format!(
            "\n{:depths$}  {:4.1}%  {:method$}  {:shown$}  {:7.2}  {:.4}  {:13.2}  {:10.4}  {:10.2}  {:>8}  {:>12}  {:12.4}  {ciede2000:9.2}  {:10.3}  {:.3}  {least:13.2} ({worst})",
            depth(row),
            100.0 * row.wrong_depth,
            row.method,
            row.shown,
            coherent.amplitude_psnr,
            coherent.amplitude_ssim,
            coherent.focal_psnr,
            coherent.focal_ssim,
            natural.psnr,
            db(natural.in_focus_psnr),
            db(natural.out_of_focus_psnr),
            natural.ssim,
            coherent.brightness,
            coherent.light,
        );
    }
    text
}
