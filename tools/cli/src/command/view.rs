//! `phasefront view`: makes one HTML file that shows holograms.

use crate::flags::frame::{shown_json, shown_text};
use crate::given;
use crate::make::{HologramRequest, Image, Judged, infos, judge};
use clap::{Args, Id};
use image::RgbImage;
use indicatif::ProgressBar;
use ndarray::Array2;
use phasefront::Display;
use phasefront::Size;
use phasefront_cli::viewer::{self, Depth, Phase, Scene};
use phasefront_command::flags::{DisplayFlags, check_used};
use phasefront_command::terminal::{self, progress_bar};
use phasefront_io::display::DisplayFile;
use phasefront_io::frame::ShownDepth;
use phasefront_io::hologram::{self, Hologram, HologramInfo};
use phasefront_io::{Error, Result, output};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Make one HTML file that shows holograms, without a server or a network
///
/// The holograms are files, or one is made of an image by the flags of `hologram`.
#[derive(Args)]
pub(crate) struct View {
    /// Holograms (.png, or .npy with its .json; with --display phase maps of other software), folders of `video`, or
    /// pages of this command, all joined in one page
    #[arg(value_name = "HOLOGRAM|DIR|PAGE", conflicts_with_all = making_flags())]
    inputs: Vec<PathBuf>,
    #[command(flatten)]
    request: HologramRequest,
    /// Number of views from the near end of the volume to the far end [default: 25; 5 for each frame of video]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(2..=200), help_heading = "Output")]
    views: Option<u8>,
    /// Number of frames of a video to show, evenly chosen [default: 24]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000), help_heading = "Output")]
    frames: Option<u16>,
    /// Title of the hologram on the page [default: its file's name]
    #[arg(long, value_name = "TEXT", help_heading = "Output")]
    title: Option<String>,
    /// Size limit of the page, MB; pictures are made smaller to fit, but those of joined pages stay as they are
    /// [default: 5, and the size of joined pages]
    #[arg(long, value_name = "MB", help_heading = "Output")]
    max_mb: Option<f64>,
    /// Output page
    #[arg(short, long, value_name = "OUT.html")]
    output: PathBuf,
}

/// Returns the flags that make a hologram. The display also goes with holograms that exist.
fn making_flags() -> impl Iterator<Item = Id> {
    let display = given::ids::<DisplayFlags>();
    given::ids::<HologramRequest>()
        .into_iter()
        .filter(move |id| !display.contains(id))
}

/// The default number of views of a still and of a frame of video.
const STILL_VIEWS: u8 = 25;
const FRAME_VIEWS: u8 = 5;
/// The default number of frames of a video.
const VIDEO_FRAMES: u16 = 24;
/// The default size limit of a page without joined pages, in MB.
const DEFAULT_MB: f64 = 5.0;
/// The bytes of a page besides its views: the page itself, phases and depths.
const BESIDE_VIEWS: usize = 400_000;
/// The number of views that are computed at a time.
const CHUNK: usize = 5;

/// The content of a scene.
struct Parts {
    title: String,
    /// The displayed views of each frame.
    shown: Vec<Vec<RgbImage>>,
    field: Vec<RgbImage>,
    phase: Option<Phase>,
    depth: Option<Array2<f32>>,
    z_m: Vec<f64>,
    size: Size,
    figures: Vec<(String, String)>,
}

impl View {
    pub(crate) fn run(mut self, json: bool) -> Result<()> {
        output::file(&self.output, &["html"])?;
        for path in &self.inputs {
            output::reading(path)?;
        }
        self.check_flags()?;
        let max_mb = self.max_mb.unwrap_or(DEFAULT_MB);
        let budget = max_mb * 1e6 / self.inputs.len().max(1) as f64;
        if !(budget.is_finite() && budget > BESIDE_VIEWS as f64) {
            return Err(Error::Usage(format!(
                "--max-mb {} is too little; a hologram\'s page needs {:.1} MB at least",
                max_mb,
                BESIDE_VIEWS as f64 / 1e6
            )));
        }
        let budget = budget as usize - BESIDE_VIEWS;
        let mut scenes = Vec::new();
        let mut depth = None;
        if self.inputs.is_empty() {
            let (parts, shown) = self.of_image()?;
            scenes.push(parts.scene(budget)?);
            depth = shown;
        }
        for path in &self.inputs {
            if output::has_extension(path, "html") {
                scenes.extend(viewer::read(path)?);
            } else if path.is_dir() {
                scenes.push(self.of_video(path)?.scene(budget)?);
            } else {
                scenes.push(self.of_hologram(path)?.scene(budget)?);
            }
        }
        let page = viewer::page(&scenes)?;
        let mb = page.len() as f64 / 1e6;
        if self.max_mb.is_some_and(|most| mb > most) {
            return Err(Error::Input(format!(
                "--max-mb {max_mb} is too little for the joined pages, whose pictures are kept: the page has {mb:.1} MB"
            )));
        }
        output::write_atomically(&self.output, |file| file.write_all(page.as_bytes()))?;
        let bytes = page.len();
        let views: usize = scenes.iter().map(|scene| scene.shown.len() + scene.field.len()).sum();
        terminal::print(
            json,
            &json!({
                "output": self.output.display().to_string(), "scenes": scenes.len(), "views": views, "bytes": bytes,
                "depth": shown_json(depth),
            }),
            format!(
                "{}: {views} views, {mb:.1} MB{}",
                terminal::name(&self.output),
                shown_text(depth)
            ),
        );
        Ok(())
    }

    /// Refuses flags that no input uses.
    fn check_flags(&self) -> Result<()> {
        let is_page = |path: &PathBuf| output::has_extension(path, "html");
        let made = self.inputs.is_empty() || !self.inputs.iter().all(is_page);
        let video = self.inputs.iter().any(|path| path.is_dir() && !is_page(path));
        check_used(&[
            (
                "--views",
                self.views.is_some(),
                made,
                "an image or a hologram; pages keep their views",
            ),
            (
                "--title",
                self.title.is_some(),
                made,
                "an image or a hologram; pages keep their titles",
            ),
            (
                "--display",
                self.request.hologram.display.is_given(),
                made,
                "an image or a hologram, not with pages alone",
            ),
            ("--frames", self.frames.is_some(), video, "a folder of `video`"),
        ])
    }

    fn z_m(&self, display: &Display, default: u8) -> Vec<f64> {
        let count = self.views.unwrap_or(default);
        let at = |i: u8| display.z_of_depth(f64::from(i) / f64::from(count - 1));
        (0..count).map(at).collect()
    }

    fn title(&self, path: &Path) -> String {
        let name = path.file_stem().unwrap_or(path.as_os_str());
        self.title
            .clone()
            .unwrap_or_else(|| name.to_string_lossy().into_owned())
    }

    /// Makes the hologram of the image that the flags give, with its field for comparison. Also returns the distances
    /// that the image's depth shows.
    fn of_image(&mut self) -> Result<(Parts, Option<ShownDepth>)> {
        let file = self.request.display()?;
        let (image, shown_depth) = self.request.image(&file)?;
        self.request.keeps_field = true;
        let made = self.request.make(&file, &image)?;
        let judged = judge(&file, &made, image.picture())?;
        let (levels, field) = infos(&file, &made);
        let z_m = self.z_m(&file.target.display, STILL_VIEWS);
        let bar = progress_bar(2 * z_m.len() as u64, "views");
        let mut figures = figures(
            &levels,
            Size {
                width: made.levels.dim().2,
                height: made.levels.dim().1,
            },
        );
        figures.retain(|(name, _)| name != "Encoder");
        figures.insert(
            0,
            ("Method".into(), format!("{}; {}", made.method, made.encoder.describe())),
        );
        figures.extend(judged_figures(&judged));
        figures.extend(shown_depth.map(|shown| ("Distances".into(), shown.to_string())));
        let title = self
            .request
            .image
            .source()
            .map_or("hologram".into(), |path| self.title(path));
        let phase = Some(Phase::new(made.levels.upper(file.target.display.bits()).view())?);
        let shown = made.hologram(levels);
        let field = match made.field {
            Some(values) => views(&Hologram::Complex(values, field), &file, &z_m, &bar)?,
            None => Vec::new(),
        };
        let parts = Parts {
            title,
            phase,
            depth: Some(match image {
                Image::Rgbd(frame) => frame.depth().to_owned(),
                Image::Layers(ldi) => ldi.layers[0].depth.mapv(|d| if d.is_nan() { 1.0 } else { d }),
            }),
            size: shown.size(),
            shown: vec![views(&shown, &file, &z_m, &bar)?],
            field,
            z_m,
            figures,
        };
        Ok((parts, shown_depth))
    }

    /// Returns the display that a hologram file was made for.
    fn display_of(&self, info: &HologramInfo) -> Result<DisplayFile> {
        match self.request.hologram.display.read_if_given_with_lens()? {
            Some(display) => Ok(display),
            None => info.display_file(),
        }
    }

    fn of_hologram(&self, path: &Path) -> Result<Parts> {
        let given = self.request.hologram.display.read_if_given_with_lens()?;
        let hologram = hologram::read_for(path, given.as_ref())?;
        let file = given.map_or_else(|| hologram.info().display_file(), Ok)?;
        let z_m = self.z_m(&hologram.info().display, STILL_VIEWS);
        let bar = progress_bar(z_m.len() as u64, "views");
        let phase = match &hologram {
            Hologram::Levels(levels, info) => Some(Phase::new(levels.upper(info.display.bits()).view())?),
            Hologram::Complex(..) => None,
        };
        let shown = views(&hologram, &file, &z_m, &bar).map_err(|e| Error::file(path, e))?;
        Ok(Parts {
            title: self.title(path),
            shown: vec![shown],
            field: Vec::new(),
            phase,
            depth: None,
            z_m,
            size: hologram.size(),
            figures: figures(hologram.info(), hologram.size()),
        })
    }

    /// Reads a folder that `video` wrote.
    fn of_video(&self, dir: &Path) -> Result<Parts> {
        let refuse = |e: &dyn std::fmt::Display| Error::file(dir, e);
        let mut all = Vec::new();
        for entry in std::fs::read_dir(dir).map_err(|e| refuse(&e))? {
            let path = entry.map_err(|e| refuse(&e))?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if name.starts_with("phase_") && output::has_extension(&path, "png") {
                all.push(path);
            }
        }
        all.sort();
        let count = all.len().min(self.frames.unwrap_or(VIDEO_FRAMES).into());
        let chosen: Vec<_> = (0..count).map(|i| &all[i * all.len() / count]).collect();
        let first = chosen.first().ok_or_else(|| {
            Error::file(
                dir,
                "holds no phase_000000.png, phase_000001.png …, as `phasefront video` writes them",
            )
        })?;
        let first = hologram::read_hologram(first)?;
        let Hologram::Levels(levels, info) = &first else {
            return Err(Error::file(dir, "holds no phases"));
        };
        let file = self.display_of(info)?;
        let z_m = self.z_m(&info.display, FRAME_VIEWS);
        let bar = progress_bar((count * z_m.len()) as u64, "views");
        let shown = (chosen.iter())
            .map(|path| {
                let hologram = hologram::read_hologram(path)?;
                if hologram.size() != first.size() {
                    return Err(Error::file(*path, "is of another size than the first frame"));
                }
                views(&hologram, &file, &z_m, &bar).map_err(|e| Error::file(*path, e))
            })
            .collect::<Result<Vec<_>>>()?;
        let mut figures = figures(info, first.size());
        figures.push(("Frames".into(), format!("{count} of {}", all.len())));
        Ok(Parts {
            title: self.title(dir),
            shown,
            field: Vec::new(),
            phase: Some(Phase::new(levels.upper(info.display.bits()).view())?),
            depth: None,
            z_m,
            size: first.size(),
            figures,
        })
    }
}

impl Parts {
    /// Makes the scene, with its views packed into `budget` bytes.
    fn scene(self, budget: usize) -> Result<Scene> {
        let last = (self.z_m.len() - 1) as f32;
        let depth = match &self.depth {
            Some(depth) => Depth::known(depth, |d| (d.clamp(0.0, 1.0) * last).round() as u8),
            None => Depth::from_focus(&self.shown),
        };
        let frames = self.shown.len();
        // Of one size, because the page shows them beside each other.
        let mut shown = viewer::pack(&[self.shown.concat(), self.field].concat(), budget)?;
        let field = shown.split_off(frames * self.z_m.len());
        Ok(Scene {
            title: self.title,
            width: self.size.width,
            height: self.size.height,
            z_mm: self.z_m.iter().map(|z| z * 1e3).collect(),
            frames,
            shown,
            field,
            phase: self.phase,
            depth,
            figures: self.figures,
        })
    }
}

/// Computes the views of `hologram` at `z_m`, no wider than a page shows them.
fn views(hologram: &Hologram, file: &DisplayFile, z_m: &[f64], bar: &ProgressBar) -> Result<Vec<RgbImage>> {
    let mut all = Vec::with_capacity(z_m.len());
    let colours = hologram.info().view_colours();
    for z_m in z_m.chunks(CHUNK) {
        let views = hologram.views_on(file, z_m)?;
        bar.inc(views.len() as u64);
        all.extend(views.iter().map(|view| viewer::picture(view.view(), &colours)));
    }
    Ok(all)
}

fn figures(info: &HologramInfo, Size { width, height }: Size) -> Vec<(String, String)> {
    let display = &info.display;
    let nm = display.wavelengths_m().iter().map(|m| format!("{:.0}", m * 1e9));
    let nm = nm.collect::<Vec<_>>().join(", ");
    let mut rows = vec![
        (
            "Hologram",
            format!("{width}×{height} pixels of {:.2} µm", display.pitch_m() * 1e6),
        ),
        ("Wavelengths", format!("{nm} nm")),
        ("Volume", format!("{:.2} mm deep", display.volume_depth_m() * 1e3)),
        (
            "Modulator",
            match info.is_in_focal_plane() {
                true => "in the front focal plane of a lens, the picture in the back one".into(),
                false => format!("{:+.2} mm from the middle of the volume", display.offset_m() * 1e3),
            },
        ),
    ];
    if let Some(encoder) = &info.encoder {
        rows.push(("Encoder", encoder.clone()));
    }
    if let Some(scale) = info.scale {
        rows.push(("Full light", format!("amplitude {scale:.3}")));
    }
    rows.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

fn judged_figures(judged: &Judged) -> Vec<(String, String)> {
    let near = |psnr: f64, ssim: f64| format!("{psnr:.2} dB, SSIM {ssim:.3}");
    let mut figures = match &judged.stack {
        Some(stack) => vec![
            (
                "Shown against the field, at the middle".into(),
                near(judged.psnr_db, judged.ssim),
            ),
            (
                "Shown against the field, over depths".into(),
                near(stack.psnr_db, stack.ssim),
            ),
        ],
        None => vec![(
            "Shown against the picture, in focus".into(),
            near(judged.psnr_db, judged.ssim),
        )],
    };
    let of = if judged.stack.is_some() { "field" } else { "picture" };
    figures.extend((judged.brightness).map(|shown| ("Brightness shown".into(), format!("{shown:.2} of the {of}\'s"))));
    figures
}
