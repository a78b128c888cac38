//! `phasefront-lab occlusion` runs the six settings of the occlusion study, Fig. 9, and writes pictures and measures.

use clap::Args;
use ndarray::{Array3, s};
use phasefront_command::flags::DisplayFlags;
use phasefront_command::terminal::{self, progress_bar};
use phasefront_io::ldi::Ldi;
use phasefront_io::output::{self, Holding};
use phasefront_io::{Result, picture};
use phasefront_lab::study::occlusion::{self, SETTINGS, Study};
use serde_json::json;
use std::path::PathBuf;

/// The width of the white gap between the views of the comparison, in pixels.
const GAP: usize = 4;

/// Compare six ways to model occlusion: pictures at the front and rear focus, and measures
///
/// The settings are: 1 no occlusion; 2 occlusion only from the input; 3 rays on the input; 4 rays on the complete
/// scene; 5 waves on the input; 6 waves on the complete scene, which is the reference.
#[derive(Args)]
pub(crate) struct Occlusion {
    /// Folder of a layered depth image [default: the paper's two bars, whose LDI is written too]
    #[arg(long, value_name = "DIR")]
    ldi: Option<PathBuf>,
    /// Number of planes that depths are rounded to
    #[arg(long, value_name = "N", default_value_t = 256)]
    planes: usize,
    #[command(flatten)]
    display: DisplayFlags,
    /// Folder for comparison.png (settings 1 to 6 from left to right, front focus above rear focus) and
    /// each view as setting_1_front.png …
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

impl Occlusion {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        output::folder(&self.output, Holding::Anything)?;
        let display = self.display.read_of_midpoint()?.target.display;
        let ldi = match &self.ldi {
            Some(dir) => Ldi::read(dir)?,
            None => occlusion::two_bars(),
        };
        let bar = progress_bar(SETTINGS.len() as u64, "settings");
        let study = occlusion::study(&ldi, &display, self.planes, &|done| {
            bar.set_position(done as u64);
        })?;
        bar.finish_and_clear();
        output::make_folder(&self.output)?;
        if self.ldi.is_none() {
            ldi.write(&self.output.join("two_bars"))?;
        }
        for (i, outcome) in study.outcomes.iter().enumerate() {
            for (focus, view) in [("front", &outcome.front), ("rear", &outcome.rear)] {
                let name = format!("setting_{}_{focus}.png", i + 1);
                picture::write_amplitude(&self.output.join(name), view.view())?;
            }
        }
        let picture = self.output.join("comparison.png");
        picture::write_amplitude(&picture, comparison(&study).view())?;
        let settings: Vec<_> = (study.outcomes.iter())
            .map(|outcome| {
                json!({
                    "name": outcome.setting.name,
                    "front": outcome.front_quality,
                    "rear": outcome.rear_quality,
                    "artefacts": outcome.artefacts,
                })
            })
            .collect();
        terminal::print(
            json,
            &json!({
                "picture": picture, "front_z_mm": study.front_z_m * 1e3, "rear_z_mm": study.rear_z_m * 1e3,
                "settings": settings,
            }),
            format!("{}\n{}", table(&study), terminal::name(&picture)),
        );
        Ok(())
    }
}

/// Puts the views side by side, with the front focus above the rear focus.
fn comparison(study: &Study) -> Array3<f32> {
    let (_, height, width) = study.outcomes[0].front.dim();
    let count = study.outcomes.len();
    let shape = (3, 2 * height + GAP, count * (width + GAP) - GAP);
    let mut picture = Array3::from_elem(shape, 1.0);
    for (i, outcome) in study.outcomes.iter().enumerate() {
        let left = i * (width + GAP);
        for (top, view) in [(0, &outcome.front), (height + GAP, &outcome.rear)] {
            let place = s![.., top..top + height, left..left + width];
            picture.slice_mut(place).assign(view);
        }
    }
    picture
}

fn table(study: &Study) -> String {
    let mut text = format!(
        "front focus {:+.3} mm, rear focus {:+.3} mm; against setting 6\n\
         {:35}{:^15}  {:^15}  {:>8} {:>8} {:>8} {:>9}\n\
         {:35}{:>7} {:>7}  {:>7} {:>7}  {:>8} {:>8} {:>8} {:>9}",
        study.front_z_m * 1e3,
        study.rear_z_m * 1e3,
        "",
        "front focus",
        "rear focus",
        "leak of",
        "leak of",
        "loss of",
        "rays not",
        "setting",
        "PSNR dB",
        "SSIM",
        "PSNR dB",
        "SSIM",
        "occluded",
        "visible",
        "occluded",
        "waves",
    );
    let or_dash = |value: Option<f64>| value.map_or("–".into(), |v| format!("{v:.4}"));
    for (i, outcome) in study.outcomes.iter().enumerate() {
        let (front, rear, found) = (&outcome.front_quality, &outcome.rear_quality, outcome.artefacts);
        text += &format!(
            "\n{} {:33}{:7.2} {:7.4}  {:7.2} {:7.4}  {:>8} {:>8} {:>8} {:>9}",
            i + 1,
            outcome.setting.name,
            front.psnr_overall,
            front.ssim_overall,
            rear.psnr_overall,
            rear.ssim_overall,
            or_dash(found.leakage_from_occluded),
            or_dash(found.leakage_from_visible),
            or_dash(found.loss_from_occluded),
            or_dash(found.geometric_inaccuracy),
        );
    }
    text
}
