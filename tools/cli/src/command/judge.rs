//! `phasefront judge`: compares methods and encoders on an image and a display.

use crate::flags::colours::ColourFlags;
use crate::flags::encoder::{EncoderFlags, FocusName};
use crate::flags::frame::{shown_json, shown_text};
use crate::flags::method::{CoreMethod, HologramFlags};
use crate::make::{HologramRequest, HologramResult, Image, ImageFlags, Method, infos};
use clap::Args;
use ndarray::Array3;
use num_complex::Complex32;
use phasefront::EncoderOptions;
use phasefront::Size;
use phasefront_cli::viewer::{self, Depth, Scene};
use phasefront_command::flags::{DisplayFlags, EncoderName, PrecisionName};
use phasefront_command::networks;
use phasefront_command::terminal::{self, progress_bar};
use phasefront_core::depth::sharpness;
use phasefront_core::view::colours::ViewColours;
use phasefront_exact::incoherent::{self, Natural, Pupil};
use phasefront_exact::truth::{self, Figures};
use phasefront_io::display::DisplayFile;
use phasefront_io::hologram::{Hologram, HologramInfo};
use phasefront_io::ldi::Ldi;
use phasefront_io::picture::difference;
use phasefront_io::{Error, Result, output};
use serde_json::json;
use std::path::PathBuf;
use std::time::Duration;

/// Compare methods and encoders on an image and a display: quality of the displayed image, and time
///
/// There are two references. The first is coherent: for a layered depth image its exact wave. An RGB-D image has no
/// exact wave. If its depth is clean, the reference is the exact wave of what is visible and of the hidden surfaces
/// that the sweep finds; otherwise it is the wave of the largest network. The answer names the reference. The second is
/// natural: what incoherent light, as in the world, shows of the same surfaces through the display's aperture.
#[derive(Args)]
#[command(mut_arg("ldi", |ldi| ldi.help("Folder of a layered depth image")))]
pub(crate) struct Judge {
    #[command(flatten)]
    image: ImageFlags,
    /// Methods [default: sweep, and network if one was trained for the display]
    #[arg(long, value_enum, value_delimiter = ',', help_heading = "Method")]
    method: Vec<CoreMethod>,
    /// Encoders, each as published, with the default correction, and with the correction for stills
    #[arg(long, value_enum, value_delimiter = ',', default_values = ["anti-alias"], help_heading = "Method")]
    encoder: Vec<EncoderName>,
    /// Focuses; natural adds a row of 30 steps for each method and encoder
    #[arg(long, value_enum, value_delimiter = ',', default_values = ["coherent"], help_heading = "Method")]
    focus: Vec<FocusName>,
    /// Number of planes of the exact wave
    #[arg(long, value_name = "N", default_value_t = 128, value_parser = clap::value_parser!(u16).range(1..), help_heading = "Expert")]
    planes: u16,
    /// Width of a border that does not count, in pixels; at an offset, light enters an image from outside
    #[arg(long, value_name = "PX", default_value_t = 0, help_heading = "Expert")]
    margin: usize,
    #[command(flatten)]
    display: DisplayFlags,
    /// Page that shows all results
    #[arg(short, long, value_name = "OUT.html")]
    output: Option<PathBuf>,
}

/// The number of views in a page.
const PAGE_VIEWS: usize = 9;
/// The bytes of all views in a page.
const PAGE_BYTES: usize = 4_000_000;
/// The midpoint steps that correct a still.
const STILL_STEPS: usize = 3;

/// A method with an encoder.
struct Combination {
    method: CoreMethod,
    encoder: EncoderFlags,
    /// The name of the network pair, if the encoder belongs to a pair.
    network: Option<&'static str>,
}

/// The result of a combination.
struct Row {
    method: &'static str,
    encoder: String,
    figures: Figures,
    natural: Natural,
    /// The mean CIEDE2000 of the view at the middle from that of the reference, unless pictures hold amplitudes.
    ciede2000: Option<f64>,
    wave: Duration,
    encode: Duration,
    made: HologramResult,
}

impl Judge {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        if let Some(path) = &self.output {
            output::file(path, &["html"])?;
        }
        let file = self.image.display(&self.display)?;
        let display = &file.target.display;
        let layers = self.image.ldi.as_deref().map(Ldi::read).transpose()?;
        let (frame, depth_shown) = match &layers {
            Some(ldi) => (truth::visible_frame(ldi, display)?, None),
            None => self.image.frame.read(display, self.display.is_given())?,
        };
        let Size { width, height } = frame.size();
        if 2 * self.margin >= height.min(width) {
            return Err(Error::Input(format!(
                "--margin {} leaves nothing of {width}×{height} pixels",
                self.margin
            )));
        }
        let (rgb, depth) = frame.values();
        let clean = sharpness::is_clean(rgb, depth, width);
        let surfaces = match &layers {
            Some(ldi) => ldi.clone(),
            None => truth::filled(&frame, display)?,
        };
        let image = Image::Rgbd(frame);
        let (truth, what) = self.truth(&file, &image, layers.as_ref(), clean)?;
        let z_m = truth::judged_z_m(display);
        let wanted = truth.views_on(&file, &z_m)?;
        let natural = incoherent::Judge::of(&surfaces, display, Pupil::of_aperture(display))?;
        let natural_z_m = incoherent::Judge::z_m(display);
        let combinations = self.combinations(display);
        let bar = progress_bar(combinations.len() as u64, "combinations");
        let mut rows = Vec::new();
        for combination in combinations {
            let made = self
                .request(
                    Method::Core(combination.method),
                    HologramFlags {
                        network: combination.network.map(str::to_owned),
                        encoder: combination.encoder,
                        ..HologramFlags::default()
                    },
                )
                .make(&file, &image)?;
            let (info, _) = infos(&file, &made);
            let hologram = made.hologram(info);
            let shown = hologram.views_on(&file, &z_m)?;
            let shown_naturally = hologram.views_on(&file, &natural_z_m)?;
            let times: Vec<Duration> = made.stages.iter().map(|(_, time)| *time).collect();
            rows.push(Row {
                method: if combination.network.is_some() {
                    "pair"
                } else {
                    combination.method.name()
                },
                encoder: made.encoder.describe(),
                figures: truth::judge(&shown, &wanted, self.margin)?,
                natural: natural.judge(&shown_naturally, self.margin)?,
                ciede2000: colour_difference(&shown[0], &wanted[0], &made.view_colours),
                wave: times[..times.len() - 1].iter().sum(),
                encode: times[times.len() - 1],
                made,
            });
            bar.inc(1);
        }
        bar.finish_and_clear();
        if let Some(path) = &self.output {
            write_page(path, &file, &truth, &what, &image, &rows)?;
        }
        let value = json!({
            "truth": what, "width": width, "height": height, "output": self.output.as_ref().map(|path| path.display().to_string()),
            "depth": shown_json(depth_shown), "rows": rows.iter().map(Row::json).collect::<Vec<_>>(),
        });
        terminal::print(json, &value, table(&rows, &what) + &shown_text(depth_shown));
        Ok(())
    }

    /// Makes the reference for all combinations: a field at the modulator, and its description.
    fn truth(
        &self,
        file: &DisplayFile,
        image: &Image,
        layers: Option<&Ldi>,
        clean: bool,
    ) -> Result<(Hologram, String)> {
        let display = &file.target.display;
        let best = "15";
        let trained = networks::network(best, Some(networks::Precision::Float32))?
            .check_display(display)
            .is_ok();
        let (made, what) = match (layers, image) {
            (Some(ldi), _) => {
                let what = format!("the exact wave of its {} layers: the truth", ldi.layers.len());
                (self.exact(file, ldi)?, what)
            }
            (None, Image::Rgbd(frame)) if clean || !trained => {
                let filled = truth::filled(frame, display)?;
                let what = "the exact wave of what is visible and of hidden surfaces as the sweep finds them, for there is no truth";
                (self.exact(file, &filled)?, what.to_owned())
            }
            _ => {
                let hologram = HologramFlags {
                    network: Some(best.into()),
                    precision: Some(PrecisionName::F32),
                    ..HologramFlags::default()
                };
                let mut request = self.request(Method::Core(CoreMethod::Network), hologram);
                request.keeps_field = true;
                let made = request.make(file, image)?;
                let what =
                    "the wave of the network of 15 layers, for depth is noisy or incomplete and there is no truth";
                (made, what.to_owned())
            }
        };
        let (_, mut info) = infos(file, &made);
        // The exact wave of an image is made of its layers, whose colours are the image's amplitudes.
        let colours = ViewColours::new(self.colours().viewed(), display);
        info.srgb_of_light = HologramInfo::light_rows(&colours, display.colours());
        let field: Array3<Complex32> = made.field.expect("kept for this");
        Ok((Hologram::Complex(field, info), what))
    }

    fn exact(&self, file: &DisplayFile, ldi: &Ldi) -> Result<HologramResult> {
        let mut request = self.request(Method::Layers, HologramFlags::default());
        request.planes = Some(self.planes.into());
        request.keeps_field = true;
        request.make(file, &Image::Layers(ldi.clone()))
    }

    /// Returns the meaning of the image's colours. Those of a layered depth image are amplitudes.
    fn colours(&self) -> ColourFlags {
        match self.image.ldi {
            Some(_) => ColourFlags::AMPLITUDE,
            None => self.image.frame.colours,
        }
    }

    /// Returns the request for a hologram of the image on the display.
    fn request(&self, method: Method, hologram: HologramFlags) -> HologramRequest {
        let mut request = HologramRequest {
            method: Some(method),
            hologram: HologramFlags {
                display: self.display.clone(),
                ..hologram
            },
            ..HologramRequest::default()
        };
        request.image.frame.colours = self.colours();
        request
    }

    fn combinations(&self, display: &phasefront::Display) -> Vec<Combination> {
        let trained = phasefront_models::default_network(display).is_some();
        let default = if trained {
            vec![CoreMethod::Sweep, CoreMethod::Network]
        } else {
            vec![CoreMethod::Sweep]
        };
        let methods = if self.method.is_empty() {
            default
        } else {
            self.method.clone()
        };
        let mut combinations = Vec::new();
        for &method in &methods {
            for &encoder in &self.encoder {
                let steps = EncoderOptions::default().local_steps;
                let corrections = [
                    (0.0, 0, 0),
                    (EncoderOptions::DARK_THRESHOLD, steps, 0),
                    (EncoderOptions::DARK_THRESHOLD, steps, STILL_STEPS),
                ];
                let mut flags = Vec::new();
                if self.focus.contains(&FocusName::Coherent) {
                    flags.extend(corrections.map(|(dark, local, last)| EncoderFlags::of(encoder, dark, local, last)));
                }
                if self.focus.contains(&FocusName::Natural) {
                    let default = EncoderFlags::of(encoder, EncoderOptions::DARK_THRESHOLD, steps, 0);
                    flags.push(default.with_focus(FocusName::Natural));
                }
                combinations.extend(flags.into_iter().map(|encoder| Combination {
                    method,
                    encoder,
                    network: None,
                }));
            }
        }
        let pair = phasefront_models::pair_for(display, networks::Precision::Int8).is_some();
        if pair && methods.contains(&CoreMethod::Network) && self.focus.contains(&FocusName::Coherent) {
            combinations.push(Combination {
                method: CoreMethod::Network,
                encoder: EncoderFlags::default(),
                network: Some(networks::DEEP),
            });
        }
        combinations
    }
}

impl Row {
    fn name(&self) -> String {
        format!("{}, {}", self.method, self.encoder)
    }

    fn json(&self) -> serde_json::Value {
        let ms = |time: Duration| (time.as_secs_f64() * 1e5).round() / 100.0;
        json!({
            "method": self.method, "encoder": self.encoder, "psnr_db": self.figures.amplitude_psnr,
            "ssim": self.figures.amplitude_ssim, "stack_psnr_db": self.figures.focal_psnr,
            "stack_ssim": self.figures.focal_ssim, "natural": self.natural, "ciede2000": self.ciede2000, "brightness": self.figures.brightness,
            "wave_ms": ms(self.wave), "encode_ms": ms(self.encode),
        })
    }
}

fn table(rows: &[Row], what: &str) -> String {
    let wide = rows
        .iter()
        .map(|row| row.encoder.chars().count())
        .max()
        .unwrap_or(0)
        .max(7);
    let mut text = format!(
        "{:8}  {:wide$}  PSNR dB   SSIM  stack PSNR dB  stack SSIM  natural dB  in focus  out of focus  natural SSIM  CIEDE2000  brightness  wave ms  encode ms",
        "method", "encoder"
    );
    for row in rows {
        let Figures {
            amplitude_psnr,
            amplitude_ssim,
            focal_psnr,
            focal_ssim,
            brightness,
            ..
        } = row.figures;
        text += &format!(
            "\n{:8}  {:wide$}  {amplitude_psnr:7.2}  {amplitude_ssim:5.3}  {focal_psnr:13.2}  {focal_ssim:10.3}  {:10.2}  {:>8}  {:>12}  {:12.3}  {:>9}  {brightness:10.3}  {:7.1}  {:9.1}",
            row.method,
            row.encoder,
            row.natural.psnr,
            figure(row.natural.in_focus_psnr),
            figure(row.natural.out_of_focus_psnr),
            row.natural.ssim,
            figure(row.ciede2000),
            1e3 * row.wave.as_secs_f64(),
            1e3 * row.encode.as_secs_f64(),
        );
    }
    text + &format!(
        "\nJudged by {what}; natural: by what incoherent light shows of these surfaces. Times are of one run, after no warm-up."
    )
}

/// Returns the mean CIEDE2000 of two views, (C, H, W), or `None` if views are amplitudes.
fn colour_difference(shown: &Array3<f32>, wanted: &Array3<f32>, colours: &ViewColours) -> Option<f64> {
    let light = |view: &Array3<f32>| difference::light_of_view(view.view(), colours);
    Some(difference::of_pictures(light(shown)?.view(), light(wanted)?.view()))
}

/// Writes a figure that there may not be.
fn figure(figure: Option<f64>) -> String {
    figure.map_or_else(|| "–".to_owned(), |figure| format!("{figure:.2}"))
}

/// Writes a page that shows the displayed images of each combination and the reference.
fn write_page(
    path: &std::path::Path,
    file: &DisplayFile,
    truth: &Hologram,
    what: &str,
    image: &Image,
    rows: &[Row],
) -> Result<()> {
    let last = (PAGE_VIEWS - 1) as f64;
    let z_m: Vec<f64> = (0..PAGE_VIEWS)
        .map(|i| file.target.display.z_of_depth(i as f64 / last))
        .collect();
    let budget = PAGE_BYTES / (rows.len() + 1);
    let Image::Rgbd(frame) = image else {
        return Err(Error::Input("a page needs an RGB-D image".into()));
    };
    let depth = Depth::known(&frame.depth().to_owned(), |d| (f64::from(d) * last).round() as u8);
    let scene = |title: String, hologram: &Hologram, figures: Vec<(String, String)>| -> Result<Scene> {
        let Size { width, height } = hologram.size();
        let views = hologram.views_on(file, &z_m)?;
        let colours = hologram.info().view_colours();
        let views: Vec<_> = (views.iter())
            .map(|view| viewer::picture(view.view(), &colours))
            .collect();
        Ok(Scene {
            title,
            width,
            height,
            z_mm: z_m.iter().map(|z| z * 1e3).collect(),
            frames: 1,
            shown: viewer::pack(&views, budget)?,
            field: Vec::new(),
            phase: None,
            depth: depth.clone(),
            figures,
        })
    };
    let mut scenes = vec![scene(format!("Judged by {what}"), truth, Vec::new())?];
    for row in rows {
        let Figures {
            amplitude_psnr,
            amplitude_ssim,
            brightness,
            ..
        } = row.figures;
        let figures = vec![
            (
                "At the middle".into(),
                format!("{amplitude_psnr:.2} dB, SSIM {amplitude_ssim:.3}"),
            ),
            (
                "Over depths".into(),
                format!("{:.2} dB, SSIM {:.3}", row.figures.focal_psnr, row.figures.focal_ssim),
            ),
            (
                "As incoherent light".into(),
                format!(
                    "{:.2} dB, in focus {}, out of focus {}, SSIM {:.3}",
                    row.natural.psnr,
                    figure(row.natural.in_focus_psnr),
                    figure(row.natural.out_of_focus_psnr),
                    row.natural.ssim
                ),
            ),
            ("Brightness".into(), format!("{brightness:.3} of what it is judged by")),
        ];
        let (info, _) = infos(file, &row.made);
        scenes.push(scene(row.name(), &row.made.hologram(info), figures)?);
    }
    viewer::write(path, &scenes).map(|_| ())
}
