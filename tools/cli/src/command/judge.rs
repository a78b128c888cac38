//! `phasefront judge`: compares methods, encoders and holograms of files on an image and a display.

mod focal_plane;

use crate::flags::colours::ColourFlags;
use crate::flags::encoder::{EncoderFlags, FocusName};
use crate::flags::frame::{shown_json, shown_text};
use crate::flags::method::{CoreMethod, HologramFlags};
use crate::make::{HologramRequest, HologramResult, Image, ImageFlags, Method, infos};
use clap::{Args, ValueHint};
use ndarray::Array3;
use num_complex::Complex32;
use phasefront::{EncoderOptions, RgbdFrame, Size};
use phasefront_cli::viewer::{self, Depth, Scene};
use phasefront_command::flags::{DisplayFlags, EncoderName, PrecisionName};
use phasefront_command::networks;
use phasefront_command::terminal::{self, figure, progress_bar};
use phasefront_core::depth::sharpness;
use phasefront_core::view::colours::ViewColours;
use phasefront_exact::incoherent::{self, Natural, Pupil};
use phasefront_exact::truth::{self, Figures};
use phasefront_io::display::DisplayFile;
use phasefront_io::hologram::{self, Hologram, HologramInfo};
use phasefront_io::ldi::Ldi;
use phasefront_io::picture::difference;
use phasefront_io::{Error, Result, output};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Compare methods, encoders and holograms of files on an image and a display: quality of the displayed image, and time
///
/// There are two references. The first is coherent: for a layered depth image its exact wave. An RGB-D image has no
/// exact wave. If its depth is clean, the reference is the exact wave of what is visible and of the hidden surfaces
/// that the sweep finds; otherwise it is the wave of the largest network. The answer names the reference. The second is
/// natural: what incoherent light, as in the world, shows of the same surfaces through the display's aperture. In the
/// focal plane of a lens the reference is the picture, in focus.
#[derive(Args)]
#[command(mut_arg("ldi", |ldi| ldi.help("Folder of a layered depth image")))]
pub(crate) struct Judge {
    #[command(flatten)]
    image: ImageFlags,
    /// A hologram of this image to judge too: a PNG of levels, or a phase map of other software, as `refocus` takes
    /// them; repeat the flag for several
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, help_heading = "Input")]
    hologram: Vec<PathBuf>,
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

/// A hologram of a combination, or of a file.
struct Judged {
    method: &'static str,
    /// The encoder, or the file's name.
    encoder: String,
    /// The times of the wave and of the encoder, if it was made here.
    times: Option<[Duration; 2]>,
    hologram: Hologram,
}

/// What holograms are compared with.
struct References<'a> {
    file: &'a DisplayFile,
    z_m: Vec<f64>,
    /// The views of the wave at `z_m`.
    wanted: Vec<Array3<f32>>,
    colours: ViewColours,
    natural: incoherent::Judge,
    margin: usize,
}

/// The result of a hologram.
struct Row {
    judged: Judged,
    figures: Figures,
    natural: Natural,
    /// The mean CIEDE2000 of the view at the middle from that of the reference, unless pictures hold amplitudes.
    ciede2000: Option<f64>,
    /// The mean amplitude over that of the reference, if the hologram says what amplitude its light stands for.
    brightness: Option<f64>,
}

impl Judge {
    pub(crate) fn run(mut self, json: bool) -> Result<()> {
        if let Some(path) = &self.output {
            output::file(path, &["html"])?;
        }
        let file = self.image.display(&self.display)?;
        if file.lens.is_some() {
            return self.in_focal_plane(&file, json);
        }
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
        let references = References {
            wanted: truth.views_on(&file, &z_m)?,
            z_m,
            colours: ViewColours::new(self.colours().viewed(), display),
            natural: incoherent::Judge::of(&surfaces, display, Pupil::of_aperture(display))?,
            file: &file,
            margin: self.margin,
        };
        let of_files = (self.hologram.iter())
            .map(|path| given(path, &references, Size { width, height }))
            .collect::<Result<Vec<_>>>()?;
        let combinations = self.combinations(display);
        let bar = progress_bar((combinations.len() + of_files.len()) as u64, "holograms");
        let mut rows = Vec::new();
        for combination in combinations {
            rows.push(references.row(self.made(combination, &file, &image)?)?);
            bar.inc(1);
        }
        for judged in of_files {
            rows.push(references.row(judged)?);
            bar.inc(1);
        }
        bar.finish_and_clear();
        if let Some(path) = &self.output {
            let frame = image.picture().expect("an RGB-D image");
            write_page(path, &references, (&truth, &what), frame, &rows)?;
        }
        let value = json!({
            "truth": what, "width": width, "height": height, "output": self.output.as_ref().map(|path| path.display().to_string()),
            "depth": shown_json(depth_shown), "rows": rows.iter().map(Row::json).collect::<Vec<_>>(),
        });
        terminal::print(json, &value, table(&rows, &what) + &shown_text(depth_shown));
        Ok(())
    }

    /// Makes the hologram of `combination`.
    fn made(&self, combination: Combination, file: &DisplayFile, image: &Image) -> Result<Judged> {
        let method = match combination.network {
            Some(_) => "pair",
            None => combination.method.name(),
        };
        let flags = HologramFlags {
            network: combination.network.map(str::to_owned),
            encoder: combination.encoder,
            ..HologramFlags::default()
        };
        let made = self
            .request(Method::Core(combination.method), flags)
            .make(file, image)?;
        Ok(Judged::made(method, made, file))
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

/// Reads a hologram of an image of `size` from `path`. A phase map of other software does not say what amplitude its
/// light stands for: it takes the one that brings its views nearest to those of the wave.
fn given(path: &Path, references: &References<'_>, size: Size) -> Result<Judged> {
    let refuse = |e: Error| Error::file(path, e);
    let mut hologram = hologram::read_for(path, Some(references.file))?;
    if hologram.size() != size {
        return Err(Error::file(
            path,
            format!(
                "is {}, the image {size}; both must be of one size, and --fit brings the image to the modulator's",
                hologram.size()
            ),
        ));
    }
    if hologram.info().encoder.is_none() {
        let views = hologram.views_on(references.file, &references.z_m).map_err(refuse)?;
        let pairs = || views.iter().flatten().zip(references.wanted.iter().flatten());
        let of_both: f64 = pairs().map(|(seen, wanted)| f64::from(seen * wanted)).sum();
        let of_seen: f64 = pairs().map(|(seen, _)| f64::from(seen * seen)).sum();
        if let Hologram::Levels(_, info) = &mut hologram {
            info.scale = Some((of_both / of_seen) as f32);
            info.srgb_of_light = HologramInfo::light_rows(&references.colours, info.display.colours());
        }
    }
    Ok(Judged::of_file(path, hologram))
}

impl Judged {
    /// Returns the hologram that `method` made.
    fn made(method: &'static str, made: HologramResult, file: &DisplayFile) -> Self {
        let times: Vec<Duration> = made.stages.iter().map(|(_, time)| *time).collect();
        let (info, _) = infos(file, &made);
        Judged {
            method,
            encoder: made.encoder.describe(),
            times: Some([times[..times.len() - 1].iter().sum(), times[times.len() - 1]]),
            hologram: made.hologram(info),
        }
    }

    /// Returns the hologram of the file at `path`.
    fn of_file(path: &Path, hologram: Hologram) -> Self {
        let name = path.file_name().unwrap_or(path.as_os_str());
        Judged {
            method: "file",
            encoder: name.to_string_lossy().into_owned(),
            times: None,
            hologram,
        }
    }

    fn name(&self) -> String {
        format!("{}, {}", self.method, self.encoder)
    }

    /// Returns the times in milliseconds.
    fn ms(&self) -> [Option<f64>; 2] {
        let ms = |time: Duration| (time.as_secs_f64() * 1e5).round() / 100.0;
        match self.times {
            Some(times) => times.map(|time| Some(ms(time))),
            None => [None; 2],
        }
    }
}

impl References<'_> {
    /// Compares a hologram with the references.
    fn row(&self, judged: Judged) -> Result<Row> {
        let shown = judged.hologram.views_on(self.file, &self.z_m)?;
        let shown_naturally =
            (judged.hologram).views_on(self.file, &incoherent::Judge::z_m(&self.file.target.display))?;
        let figures = truth::judge(&shown, &self.wanted, self.margin)?;
        Ok(Row {
            natural: self.natural.judge(&shown_naturally, self.margin)?,
            ciede2000: colour_difference(&shown[0], &self.wanted[0], &self.colours),
            brightness: judged.hologram.info().encoder.is_some().then_some(figures.brightness),
            figures,
            judged,
        })
    }
}

impl Row {
    /// Returns the names and values that a page shows.
    fn page_figures(&self) -> Vec<(String, String)> {
        let Figures {
            amplitude_psnr,
            amplitude_ssim,
            focal_psnr,
            focal_ssim,
            ..
        } = self.figures;
        let natural = &self.natural;
        let mut figures = vec![
            (
                "At the middle".into(),
                format!("{amplitude_psnr:.2} dB, SSIM {amplitude_ssim:.3}"),
            ),
            (
                "Over depths".into(),
                format!("{focal_psnr:.2} dB, SSIM {focal_ssim:.3}"),
            ),
            (
                "As incoherent light".into(),
                format!(
                    "{:.2} dB, in focus {}, out of focus {}, SSIM {:.3}",
                    natural.psnr,
                    figure(natural.in_focus_psnr, 2),
                    figure(natural.out_of_focus_psnr, 2),
                    natural.ssim
                ),
            ),
        ];
        figures.extend(
            self.brightness
                .map(|brightness| ("Brightness".into(), format!("{brightness:.3} of that of the reference"))),
        );
        figures
    }

    fn json(&self) -> serde_json::Value {
        let [wave_ms, encode_ms] = self.judged.ms();
        json!({
            "method": self.judged.method, "encoder": self.judged.encoder, "psnr_db": self.figures.amplitude_psnr,
            "ssim": self.figures.amplitude_ssim, "stack_psnr_db": self.figures.focal_psnr,
            "stack_ssim": self.figures.focal_ssim, "natural": self.natural, "ciede2000": self.ciede2000, "brightness": self.brightness,
            "wave_ms": wave_ms, "encode_ms": encode_ms,
        })
    }
}

fn table(rows: &[Row], what: &str) -> String {
    let wide = rows
        .iter()
        .map(|row| row.judged.encoder.chars().count())
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
            ..
        } = row.figures;
        let [wave_ms, encode_ms] = row.judged.ms().map(|ms| figure(ms, 1));
        text += &format!(
            "\n{:8}  {:wide$}  {amplitude_psnr:7.2}  {amplitude_ssim:5.3}  {focal_psnr:13.2}  {focal_ssim:10.3}  {:10.2}  {:>8}  {:>12}  {:12.3}  {:>9}  {:>10}  {:>7}  {:>9}",
            row.judged.method,
            row.judged.encoder,
            row.natural.psnr,
            figure(row.natural.in_focus_psnr, 2),
            figure(row.natural.out_of_focus_psnr, 2),
            row.natural.ssim,
            figure(row.ciede2000, 2),
            figure(row.brightness, 3),
            wave_ms,
            encode_ms,
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

/// Writes a page that shows the displayed images of each combination and both references: the wave `truth`, and what
/// incoherent light shows.
fn write_page(
    path: &Path,
    references: &References<'_>,
    (truth, what): (&Hologram, &str),
    frame: &RgbdFrame,
    rows: &[Row],
) -> Result<()> {
    let file = references.file;
    let last = (PAGE_VIEWS - 1) as f64;
    let z_m: Vec<f64> = (0..PAGE_VIEWS)
        .map(|i| file.target.display.z_of_depth(i as f64 / last))
        .collect();
    let budget = PAGE_BYTES / (rows.len() + 2);
    let depth = frame.depth().to_owned();
    let nearest_view = Depth::known(&depth, |d| (f64::from(d) * last).round() as u8);
    let Size { width, height } = frame.size();
    let scene = |title: String, z_m: &[f64], views: &[Array3<f32>], colours: &ViewColours, depth: Depth| {
        let views: Vec<_> = (views.iter())
            .map(|view| viewer::picture(view.view(), colours))
            .collect();
        Ok::<_, Error>(Scene {
            title,
            width,
            height,
            z_mm: z_m.iter().map(|z| z * 1e3).collect(),
            frames: 1,
            shown: viewer::pack(&views, budget)?,
            field: Vec::new(),
            phase: None,
            depth,
            figures: Vec::new(),
        })
    };
    let of_hologram = |title: String, hologram: &Hologram| {
        let views = hologram.views_on(file, &z_m)?;
        let colours = hologram.info().view_colours();
        scene(title, &z_m, &views, &colours, nearest_view.clone())
    };
    let (z_of_light_m, views_of_light) = references.natural.shown();
    let count = z_of_light_m.len();
    let nearest_of_light = Depth::known(&depth, |d| {
        ((f64::from(d) * count as f64) as usize).min(count - 1) as u8
    });
    let title = "Judged by what incoherent light shows".to_owned();
    let mut scenes = vec![
        of_hologram(format!("Judged by {what}"), truth)?,
        scene(
            title,
            z_of_light_m,
            views_of_light,
            &references.colours,
            nearest_of_light,
        )?,
    ];
    for row in rows {
        let mut shown = of_hologram(row.judged.name(), &row.judged.hologram)?;
        shown.figures = row.page_figures();
        scenes.push(shown);
    }
    viewer::write(path, &scenes).map(|_| ())
}
