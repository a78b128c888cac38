//! `phasefront-lab study` computes the paper's Fig. 2a and 2b as a table, JSON and a plot. It also studies the
//! benefit of temporal smoothing of video, as a table and JSON, the plane sweep's ablation, and the sweep on slopes
//! and on other displays.

mod enlarged;
mod flicker;

use super::Lab;
use super::sensors::{self, Sensors};
use clap::error::ErrorKind;
use clap::{Args, CommandFactory, ValueEnum};
use phasefront::Sweep;
use phasefront_command::flags::{DisplayFlags, check_used};
use phasefront_command::terminal::{self, progress_bar};
use phasefront_io::Result;
use phasefront_io::output::{self, Holding};
use phasefront_io::picture;
use phasefront_io::picture::plot::{self, Panel};
use phasefront_lab::study::slopes;
use phasefront_lab::study::sweep_parts::{self, DisplayRow};
use phasefront_lab::study::{self, Row, Scenes};
use serde_json::json;
use std::path::PathBuf;

/// Study the number of layers or planes that a hologram needs, the benefit of the plane sweep's parts, the flicker of
/// video, and depth that was enlarged
#[derive(Args)]
pub(crate) struct Study {
    /// The study to run
    #[arg(value_enum)]
    what: What,
    /// Number of random scenes
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..))]
    scenes: u16,
    /// Height and width of a scene, pixels; those of flicker are 1024×768 [default: 384]
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u16).range(1..=4096))]
    size: Option<u16>,
    /// Planes of SM-LBM; in the study of planes, those of the finest hologram [default: 256; for planes 8192, for sweep
    /// and displays 200, for slopes 640]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    planes: Option<u32>,
    /// Layers of a layered depth image in the study of planes [default: 5]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=64))]
    ldi_layers: Option<u8>,
    /// Seed of the first scene, or of the first reading of --data; the others use the following seeds
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..1 << 48))]
    seed: u64,
    /// Folder of a data set whose scenes, from the first, the study of enlarged depth takes, and with --sensor that of
    /// flicker
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    #[arg(
        long,
        value_name = "NAME,…",
        value_delimiter = ',',
        requires = "data",
        value_parser = sensors::parse,
        help = format!("Simulated sensors that read the scenes of --data, separated by commas: {}", sensors::names())
    )]
    sensor: Vec<Sensors>,
    #[command(flatten)]
    display: DisplayFlags,
    /// Folder for the results: NAME.json, NAME.svg for layers, planes and sweep, and slopes.png
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

/// The number of planes of the truth in the studies of the sweep.
const SWEEP_PLANES: u32 = 200;
/// The number of planes of the truth in the study of slopes.
const SLOPE_PLANES: u32 = 640;

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum What {
    /// Layers of a layered depth image: 1 to 9 against 10 (Fig. 2a)
    Layers,
    /// Planes of the volume: 32, 128, 512 and 2048 against 8192 (Fig. 2b)
    Planes,
    /// The plane sweep's planes, taps, hidden layers, tiles and merged steps, one at a time, compared with exact waves
    Sweep,
    /// The plane sweep compared with exact waves on smooth slopes, with pictures of them in near and far focus
    Slopes,
    /// The plane sweep compared with exact waves on other displays
    Displays,
    /// How much the displayed image of a static scene changes from frame to frame, over 30 frames of each scene
    Flicker,
    /// What it is worth to read enlarged depth on the grid that it came from, on the scenes of --data
    Enlarged,
}

impl Study {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        self.check_flags()?;
        output::folder(&self.output, Holding::Anything)?;
        match self.what {
            What::Layers | What::Planes => {}
            What::Flicker => {
                return match &self.data {
                    Some(data) => self.flicker_of_sensors(data, json),
                    None => self.flicker(json),
                };
            }
            What::Enlarged => return self.enlarged(json),
            What::Sweep => return self.sweep(json),
            What::Slopes => return self.slopes(json),
            What::Displays => return self.displays(json),
        }
        let scenes = self.scenes()?;
        let of_layers = self.what == What::Layers;
        let planes = self.planes.unwrap_or(if of_layers { 256 } else { 8192 }) as usize;
        let ldi_layers = self.ldi_layers.unwrap_or(5).into();
        let work = match of_layers {
            true => study::layers_work(&scenes, planes),
            false => study::planes_work(&scenes, planes),
        };
        let bar = progress_bar(work as u64, "planes");
        let done = |planes: usize| bar.inc(planes as u64);
        let (name, rows) = match of_layers {
            true => ("layers", study::layers(&scenes, planes, &done)?),
            false => ("planes", study::planes(&scenes, ldi_layers, planes, &done)?),
        };
        bar.finish_and_clear();
        let finest = if of_layers { study::FINEST_LAYERS } else { planes };
        let result = json!({
            "study": name, "finest": finest, "planes": planes,
            "ldi_layers": if of_layers { study::FINEST_LAYERS } else { ldi_layers },
            "scenes": scenes.scenes, "size": scenes.size, "seed": scenes.seed, "display": scenes.display,
            "rows": rows,
        });
        self.write_json(name, &result)?;
        self.plot(name, finest, &rows)?;
        let mut text = format!(
            "{name:>7}  PSNR dB    SSIM   (against {finest}, mean of {} scenes)",
            scenes.scenes
        );
        for row in &rows {
            text += &format!("\n{:7}  {:7.2}  {:.4}", row.value, row.psnr, row.ssim);
        }
        terminal::print(json, &result, text);
        Ok(())
    }

    /// Returns an error for flags that the study does not use.
    fn check_flags(&self) -> Result<()> {
        let of_planes = self.what == What::Planes;
        let of_flicker = self.what == What::Flicker;
        let of_enlarged = self.what == What::Enlarged;
        if of_flicker && self.data.is_some() && self.sensor.is_empty() {
            // clap knows no flag that another one requires for one value of a third.
            let why = "the study of flicker takes --data with --sensor, which reads its scenes";
            Lab::command().error(ErrorKind::MissingRequiredArgument, why).exit();
        }
        check_used(&[
            (
                "--display",
                self.display.is_given(),
                self.what != What::Displays && self.data.is_none(),
                "studies of one display, `displays` and --data have displays of their own",
            ),
            (
                "--ldi-layers",
                self.ldi_layers.is_some(),
                of_planes,
                "the study of planes",
            ),
            (
                "--size",
                self.size.is_some(),
                !of_flicker && !of_enlarged,
                "studies other than of flicker and of enlarged depth",
            ),
            (
                "--planes",
                self.planes.is_some(),
                !of_flicker && !of_enlarged,
                "studies of exact waves",
            ),
            (
                "--data",
                self.data.is_some(),
                of_enlarged || of_flicker,
                "the studies of enlarged depth and of flicker",
            ),
            ("--sensor", !self.sensor.is_empty(), of_flicker, "the study of flicker"),
        ])
    }

    fn scenes(&self) -> Result<Scenes> {
        Ok(Scenes {
            scenes: self.scenes.into(),
            size: self.size.unwrap_or(384).into(),
            seed: self.seed,
            display: self.display.read_of_midpoint()?.target.display,
        })
    }

    fn sweep(&self, json: bool) -> Result<()> {
        let scenes = self.scenes()?;
        let planes = self.planes.unwrap_or(SWEEP_PLANES) as usize;
        let bar = progress_bar(sweep_parts::ablation_work(&scenes, planes) as u64, "holograms");
        let rows = sweep_parts::ablation(&scenes, planes, &|| bar.inc(1))?;
        bar.finish_and_clear();
        let result = json!({
            "study": "sweep", "planes": planes, "scenes": scenes.scenes, "size": scenes.size, "seed": scenes.seed,
            "display": scenes.display, "rows": rows,
        });
        self.write_json("sweep", &result)?;
        self.plot_sweep(&Sweep::for_display(&scenes.display), &rows)?;
        let mut text = format!(
            "{:8} {:48}  clean PSNR dB    SSIM   noisy PSNR dB    SSIM   refined PSNR dB    SSIM  ns a pixel   (mean of {} scenes)",
            "part", "setting", scenes.scenes
        );
        for row in &rows {
            let time = row.ns_per_pixel.map_or("–".into(), |ns| format!("{ns:.1}"));
            text += &format!(
                "\n{:8} {:48}  {:13.2}  {:.4}  {:14.2}  {:.4}  {:16.2}  {:.4}  {time:>10}",
                row.part,
                row.setting,
                row.clean.psnr,
                row.clean.ssim,
                row.noisy.psnr,
                row.noisy.ssim,
                row.refined.psnr,
                row.refined.ssim
            );
        }
        terminal::print(json, &result, text);
        Ok(())
    }

    fn plot_sweep(&self, default: &Sweep, rows: &[sweep_parts::Row]) -> Result<()> {
        type Figure = fn(&sweep_parts::Row) -> f64;
        let curve = |part: &str, here: usize, figure: Figure| {
            let mut points: Vec<_> = (rows.iter())
                .filter_map(|row| match row.part {
                    "default" => Some((here as i32, figure(row))),
                    other if other == part => Some((row.value as i32, figure(row))),
                    _ => None,
                })
                .collect();
            points.sort_unstable_by_key(|(x, _)| *x);
            points
        };
        let clean: Figure = |row| row.clean.psnr;
        let panel = |title, x, y, points| Panel { title, x, y, points };
        plot::write_svg(
            &self.output.join("sweep.svg"),
            &[
                panel(
                    "planes, clean depth",
                    "planes",
                    "PSNR (dB)",
                    curve("planes", default.planes, clean),
                ),
                panel(
                    "planes, refined phone depth",
                    "planes",
                    "PSNR (dB)",
                    curve("planes", default.planes, |row| row.refined.psnr),
                ),
                panel(
                    "taps, clean depth",
                    "taps",
                    "PSNR (dB)",
                    curve("taps", default.taps, clean),
                ),
                panel(
                    "hidden layers, clean depth",
                    "hidden layers",
                    "PSNR (dB)",
                    curve("hidden", default.hidden_layers, clean),
                ),
            ],
        )
    }

    fn slopes(&self, json: bool) -> Result<()> {
        let scenes = self.scenes()?;
        let planes = self.planes.unwrap_or(SLOPE_PLANES) as usize;
        let bar = progress_bar(slopes::work(&scenes.display) as u64, "holograms");
        let study = slopes::study(scenes.size, planes, &scenes.display, &|| bar.inc(1))?;
        bar.finish_and_clear();
        let result = json!({
            "study": "slopes", "planes": planes, "size": scenes.size, "display": scenes.display, "rows": study.rows,
        });
        self.write_json("slopes", &result)?;
        picture::write_amplitude(&self.output.join("slopes.png"), study.picture.view())?;
        let mut text = format!(
            "{:20} {:34}  midpoint dB    SSIM  near dB    SSIM   far dB    SSIM",
            "slope", "method"
        );
        for row in &study.rows {
            text += &format!(
                "\n{:20} {:34}  {:11.2}  {:.4}  {:7.2}  {:.4}  {:7.2}  {:.4}",
                row.slope,
                row.method,
                row.midpoint.psnr,
                row.midpoint.ssim,
                row.near.psnr,
                row.near.ssim,
                row.far.psnr,
                row.far.ssim
            );
        }
        terminal::print(json, &result, text);
        Ok(())
    }

    fn displays(&self, json: bool) -> Result<()> {
        let scenes = self.scenes()?;
        let planes = self.planes.unwrap_or(SWEEP_PLANES) as usize;
        let bar = progress_bar(sweep_parts::displays_work(&scenes) as u64, "holograms");
        let rows = sweep_parts::displays(&scenes, planes, &|| bar.inc(1))?;
        bar.finish_and_clear();
        let result = json!({
            "study": "displays", "planes": planes, "scenes": scenes.scenes, "size": scenes.size, "seed": scenes.seed,
            "rows": rows,
        });
        self.write_json("displays", &result)?;
        let mut text = format!(
            "{:34}  planes × taps  visible, exact  filled, exact  sweep PSNR dB / SSIM   (mean of {} scenes)",
            "display", scenes.scenes
        );
        for row in &rows {
            let DisplayRow {
                display, planes, taps, ..
            } = row;
            let name = if display.is_empty() { "default" } else { display };
            text += &format!(
                "\n{name:34}  {:>13}  {:14.2}  {:13.2}  {:13.2} / {:.4}",
                format!("{planes} × {taps}"),
                row.visible.psnr,
                row.filled.psnr,
                row.sweep.psnr,
                row.sweep.ssim
            );
        }
        terminal::print(json, &result, text);
        Ok(())
    }

    fn write_json(&self, name: &str, result: &serde_json::Value) -> Result<()> {
        output::make_folder(&self.output)?;
        output::write_atomically(&self.output.join(format!("{name}.json")), |file| {
            serde_json::to_writer_pretty(&mut *file, result)?;
            std::io::Write::write_all(file, b"\n")
        })
    }

    fn plot(&self, name: &str, finest: usize, rows: &[Row]) -> Result<()> {
        let of_layers = self.what == What::Layers;
        let (x, title) = match of_layers {
            true => ("layers", format!("LDI layers against {finest}")),
            false => ("bits of depth", format!("planes against {finest}")),
        };
        let x_of = |row: &Row| match of_layers {
            true => row.value as i32,
            false => row.value.ilog2() as i32,
        };
        // Scenes that equal the finest to the bit have no finite PSNR, so their mean is not finite either.
        let points = |figure: fn(&Row) -> f64| -> Vec<(i32, f64)> {
            (rows.iter().map(|row| (x_of(row), figure(row))))
                .filter(|(_, y)| y.is_finite())
                .collect()
        };
        let mut panels = vec![Panel {
            title: &title,
            x,
            y: "SSIM",
            points: points(|row| row.ssim),
        }];
        let psnr = points(|row| row.psnr);
        if !psnr.is_empty() {
            panels.push(Panel {
                title: &title,
                x,
                y: "PSNR (dB)",
                points: psnr,
            });
        }
        plot::write_svg(&self.output.join(format!("{name}.svg")), &panels)
    }
}
