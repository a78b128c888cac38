//! `phasefront refocus`: what an eye focused at z would see of a hologram file.

use clap::Args;
use image::codecs::gif::{GifEncoder, Repeat};
use image::{Delay, Frame, RgbImage};
use ndarray::Array3;
use phasefront_lab::{Error, Result, files};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Look at a hologram with the eye focused at z
#[derive(Args)]
pub(crate) struct Refocus {
    /// A hologram PNG, or a complex .npy with its .json
    hologram: PathBuf,
    /// Focus, mm from the middle of the volume, positive toward the viewer
    #[arg(
        long,
        value_name = "Z",
        allow_negative_numbers = true,
        required_unless_present = "stack",
        conflicts_with = "stack"
    )]
    z_mm: Option<f64>,
    /// That many views from the near end of the volume to the far one
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1000))]
    stack: Option<u32>,
    /// TOML file of a calibrated display, whose tables the hologram was made for
    #[arg(long, value_name = "FILE")]
    display: Option<PathBuf>,
    /// Write the stack as one moving GIF
    #[arg(long, requires = "stack")]
    gif: bool,
    /// A PNG for one z, a folder for a stack, a .gif with --gif
    #[arg(short, value_name = "OUT")]
    output: PathBuf,
}

impl Refocus {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        let hologram = files::read_hologram(&self.hologram)?;
        let z_mm: Vec<f64> = match (self.z_mm, self.stack) {
            (Some(z), _) => vec![z],
            (None, count) => {
                let count = count.unwrap_or(2);
                let depth_mm = hologram.info().display.volume_depth_m() * 1e3;
                let at = |i: u32| depth_mm * (0.5 - f64::from(i) / f64::from(count - 1));
                (0..count).map(at).collect()
            }
        };
        let z_m: Vec<f64> = z_mm.iter().map(|z| z / 1e3).collect();
        let views = match &self.display {
            None => hologram.views(&z_m),
            Some(path) => hologram.views_on(&files::read_display(path)?, &z_m),
        }
        .map_err(|e| Error::file(&self.hologram, e))?;
        let mut written = Vec::new();
        if self.gif {
            write_gif(&self.output, &views)?;
            written.push(self.output.clone());
        } else if self.stack.is_none() {
            files::write_amplitude(&self.output, views[0].view())?;
            written.push(self.output.clone());
        } else {
            std::fs::create_dir_all(&self.output)
                .map_err(|e| Error::file(&self.output, format!("cannot be made: {e}")))?;
            for (i, (view, z)) in views.iter().zip(&z_mm).enumerate() {
                let path = self.output.join(format!("view_{i:03}_{z:+.3}mm.png"));
                files::write_amplitude(&path, view.view())?;
                written.push(path);
            }
        }
        let names: Vec<_> = written.iter().map(|path| path.display().to_string()).collect();
        super::print(json, &json!({"z_mm": z_mm, "files": names}), names.join("\n"));
        Ok(())
    }
}

/// The views there and back again, ten a second.
fn write_gif(path: &Path, views: &[Array3<f32>]) -> Result<()> {
    files::write_atomically(path, |file| {
        let mut encoder = GifEncoder::new_with_speed(file, 10);
        let other = std::io::Error::other;
        encoder.set_repeat(Repeat::Infinite).map_err(other)?;
        let back = views.iter().skip(1).rev().skip(1);
        for view in views.iter().chain(back) {
            let (_, height, width) = view.dim();
            let image = RgbImage::from_raw(width as u32, height as u32, files::amplitude_bytes(view.view()))
                .expect("three bytes a pixel");
            let image = image::DynamicImage::ImageRgb8(image).into_rgba8();
            let delay = Delay::from_numer_denom_ms(100, 1);
            encoder
                .encode_frame(Frame::from_parts(image, 0, 0, delay))
                .map_err(other)?;
        }
        Ok(())
    })
}
