//! `phasefront compare`: measures PSNR and SSIM between the amplitudes of two images or holograms.

use clap::Args;
use ndarray::Array3;
use phasefront_command::terminal;
use phasefront_core::optics::metrics;
use phasefront_io::{Error, Result, hologram, picture};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Compare two images or holograms: PSNR and SSIM of their amplitudes, per colour and overall
#[derive(Args)]
pub(crate) struct Compare {
    /// An image, or a hologram that is viewed at --z-mm
    a: PathBuf,
    /// The image or hologram to compare it with
    b: PathBuf,
    /// Focus for holograms, mm from the middle of the volume, positive toward the viewer [default: 0]
    #[arg(long, value_name = "Z", allow_negative_numbers = true)]
    z_mm: Option<f64>,
}

impl Compare {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        if self.z_mm.is_some() && !hologram::is_hologram(&self.a)? && !hologram::is_hologram(&self.b)? {
            return Err(Error::Input(
                "--z-mm is the focus of holograms; these are two images, leave it out".into(),
            ));
        }
        let a = self.amplitude(&self.a)?;
        let b = self.amplitude(&self.b)?;
        let result = metrics::compare(a.view(), b.view()).map_err(|e| Error::file(&self.b, e))?;
        let mut text = String::from("        PSNR dB    SSIM");
        let colours = ["red", "green", "blue"];
        let each = result.psnr.iter().zip(&result.ssim);
        // With one laser, the overall figure is also that of its colour.
        for (colour, (psnr, ssim)) in colours.iter().zip(each).filter(|_| result.psnr.len() == colours.len()) {
            text += &format!("\n{colour:7} {psnr:7.2}  {ssim:6.4}");
        }
        text += &format!("\noverall {:7.2}  {:6.4}", result.psnr_overall, result.ssim_overall);
        terminal::print(json, &json!(result), text);
        Ok(())
    }

    fn amplitude(&self, path: &Path) -> Result<Array3<f32>> {
        if hologram::is_hologram(path)? {
            let hologram = hologram::read_hologram(path)?;
            let mut views = hologram
                .views(&[self.z_mm.unwrap_or(0.0) / 1e3])
                .map_err(|e| Error::file(path, e))?;
            return Ok(views.remove(0));
        }
        picture::read_rgb(path)
    }
}
