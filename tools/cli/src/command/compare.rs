//! `phasefront compare`: measures the difference of two images or holograms by PSNR, SSIM and CIEDE2000.

use clap::Args;
use ndarray::Array3;
use phasefront_command::terminal;
use phasefront_core::optics::metrics;
use phasefront_core::view::colours::{ViewColours, encoded as encoded_srgb};
use phasefront_io::picture::colours::{self, Colours};
use phasefront_io::picture::difference;
use phasefront_io::{Error, Result, hologram};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Compare two images or holograms: PSNR and SSIM, per colour and overall, and CIEDE2000
///
/// Of two holograms, PSNR and SSIM are those of the displayed amplitudes, of two images, those of their values, in sRGB
/// if their encodings differ. An image and a hologram are compared in sRGB, unless the hologram was made of amplitudes:
/// then the image's values are taken for amplitudes too. CIEDE2000 is the mean difference of colours as eyes see them,
/// for the mean light of squares of 8 pixels.
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
            return Err(Error::Usage(
                "--z-mm is the focus of holograms; these are two images, leave it out".into(),
            ));
        }
        let (a, b) = (self.seen(&self.a)?, self.seen(&self.b)?);
        let (values_a, values_b) = values(&a, &b);
        let result = metrics::compare(values_a.view(), values_b.view()).map_err(|e| Error::file(&self.b, e))?;
        let light = a.linear_srgb().zip(b.linear_srgb());
        let ciede2000 = light.map(|(a, b)| difference::of_pictures(a.view(), b.view()));
        let mut text = String::from("        PSNR dB    SSIM");
        let colours = ["red", "green", "blue"];
        let each = result.psnr.iter().zip(&result.ssim);
        // With one laser, the overall figure is also that of its colour.
        for (colour, (psnr, ssim)) in colours.iter().zip(each).filter(|_| result.psnr.len() == colours.len()) {
            text += &format!("\n{colour:7} {psnr:7.2}  {ssim:6.4}");
        }
        text += &format!("\noverall {:7.2}  {:6.4}", result.psnr_overall, result.ssim_overall);
        let mut value = json!(result);
        value["ciede2000"] = json!(ciede2000);
        if let Some(ciede2000) = ciede2000 {
            text += &format!("\nCIEDE2000 {ciede2000:5.2}");
        }
        terminal::print(json, &value, text);
        Ok(())
    }

    fn seen(&self, path: &Path) -> Result<Seen> {
        if hologram::is_hologram(path)? {
            let hologram = hologram::read_hologram(path)?;
            let mut views = hologram
                .views(&[self.z_mm.unwrap_or(0.0) / 1e3])
                .map_err(|e| Error::file(path, e))?;
            return Ok(Seen::View(views.remove(0), hologram.info().view_colours()));
        }
        let (colours, _) = colours::read(path, None)?;
        Ok(Seen::Picture(colours))
    }
}

/// What is seen of an image or a hologram.
enum Seen {
    Picture(Colours),
    /// The displayed amplitudes, (C, H, W), and how they become a picture.
    View(Array3<f32>, ViewColours),
}

impl Seen {
    /// Returns the light in linear sRGB, (3, H, W), if it is known.
    fn linear_srgb(&self) -> Option<Array3<f32>> {
        match self {
            Seen::Picture(picture) => picture.linear_srgb(),
            // The grey light of one laser has no picture's colours.
            Seen::View(amplitude, _) if amplitude.dim().0 == 1 => None,
            Seen::View(amplitude, colours) => difference::light_of_view(amplitude.view(), colours),
        }
    }

    /// Returns the values of an image, and the amplitudes of a view.
    fn stored(&self) -> Array3<f32> {
        match self {
            Seen::Picture(picture) => picture.rgb.clone(),
            Seen::View(amplitude, _) => amplitude.clone(),
        }
    }
}

/// Returns the values by which `a` and `b` are compared.
fn values(a: &Seen, b: &Seen) -> (Array3<f32>, Array3<f32>) {
    let alike = match (a, b) {
        (Seen::Picture(a), Seen::Picture(b)) => a.encoding == b.encoding,
        (Seen::View(..), Seen::View(..)) => true,
        _ => false,
    };
    match (a.linear_srgb(), b.linear_srgb()) {
        (Some(a), Some(b)) if !alike => {
            let encoded = |light: Array3<f32>| light.mapv_into(|v| encoded_srgb(v.clamp(0.0, 1.0)));
            (encoded(a), encoded(b))
        }
        _ => (a.stored(), b.stored()),
    }
}
