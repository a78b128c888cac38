//! `phasefront study`: the paper's Fig. 2a and 2b, as a table, JSON and a plot.

use super::flags::{DisplayFlags, progress_bar};
use clap::{Args, ValueEnum};
use phasefront_lab::plot::{self, Panel};
use phasefront_lab::study::{self, Row, Scenes};
use phasefront_lab::{Error, Result, files};
use serde_json::json;
use std::path::PathBuf;

/// Study how many layers or planes a hologram needs: PSNR and SSIM against the finest
#[derive(Args)]
pub(crate) struct Study {
    /// What to study
    #[arg(value_enum)]
    what: What,
    /// Random scenes
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..))]
    scenes: u16,
    /// Height and width of a scene, pixels
    #[arg(long, value_name = "PX", default_value_t = 384, value_parser = clap::value_parser!(u16).range(1..=4096))]
    size: u16,
    /// Planes of SM-LBM; in the study of planes, of the finest [default: 256; for planes 8192]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    planes: Option<u32>,
    /// Layers of a layered depth image in the study of planes
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u8).range(1..=64))]
    ldi_layers: u8,
    /// Seed of the first scene; the others follow
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..1 << 48))]
    seed: u64,
    #[command(flatten)]
    display: DisplayFlags,
    /// Folder of what comes out: layers.json and layers.svg, or planes.json and planes.svg
    #[arg(short, value_name = "DIR")]
    output: PathBuf,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum What {
    /// Layers of a layered depth image: 1 to 9 against 10 (Fig. 2a)
    Layers,
    /// Planes of the volume: 32, 128, 512 and 2048 against 8192 (Fig. 2b)
    Planes,
}

impl Study {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        std::fs::create_dir_all(&self.output).map_err(|e| Error::file(&self.output, e))?;
        let scenes = Scenes {
            scenes: self.scenes.into(),
            size: self.size.into(),
            seed: self.seed,
            display: self.display.read()?.display,
        };
        let of_layers = self.what == What::Layers;
        let planes = self.planes.unwrap_or(if of_layers { 256 } else { 8192 }) as usize;
        let work = match self.what {
            What::Layers => study::layers_work(&scenes, planes),
            What::Planes => study::planes_work(&scenes, planes),
        };
        let bar = progress_bar(work as u64, "planes");
        let done = |planes: usize| bar.inc(planes as u64);
        let (name, rows) = match self.what {
            What::Layers => ("layers", study::layers(&scenes, planes, &done)?),
            What::Planes => (
                "planes",
                study::planes(&scenes, self.ldi_layers.into(), planes, &done)?,
            ),
        };
        bar.finish_and_clear();
        let finest = if of_layers {
            study::FINEST_LAYERS
        } else {
            planes
        };
        let result = json!({
            "study": name, "finest": finest, "planes": planes,
            "ldi_layers": if of_layers { study::FINEST_LAYERS } else { self.ldi_layers.into() },
            "scenes": scenes.scenes, "size": scenes.size, "seed": scenes.seed, "display": scenes.display,
            "rows": rows,
        });
        let path = self.output.join(format!("{name}.json"));
        files::write_atomically(&path, |file| {
            serde_json::to_writer_pretty(&mut *file, &result)?;
            std::io::Write::write_all(file, b"\n")
        })?;
        self.plot(name, finest, &rows)?;
        let mut text = format!(
            "{name:>7}  PSNR dB    SSIM   (against {finest}, mean of {} scenes)",
            scenes.scenes
        );
        for row in &rows {
            text += &format!("\n{:7}  {:7.2}  {:.4}", row.value, row.psnr, row.ssim);
        }
        super::print(json, &result, text);
        Ok(())
    }

    fn plot(&self, name: &str, finest: usize, rows: &[Row]) -> Result<()> {
        let (x, title) = match self.what {
            What::Layers => ("layers", format!("LDI layers against {finest}")),
            What::Planes => ("bits of depth", format!("planes against {finest}")),
        };
        let x_of = |row: &Row| match self.what {
            What::Layers => row.value as i32,
            What::Planes => row.value.ilog2() as i32,
        };
        // Scenes that equal the finest to the bit have no finite PSNR, and then nor has their mean.
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
