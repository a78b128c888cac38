//! Judges holograms in the focal plane of a lens: by the picture, in focus.

use super::{Judge, Judged};
use crate::flags::encoder::FocusName;
use crate::flags::frame::{shown_json, shown_text};
use crate::make::{FOURIER, HologramRequest, judge_in_focus};
use phasefront::Size;
use phasefront_command::flags::{EncoderName, check_used};
use phasefront_command::terminal::{self, figure};
use phasefront_io::display::DisplayFile;
use phasefront_io::hologram;
use phasefront_io::{Error, Result};
use serde_json::json;

impl Judge {
    /// Compares the hologram of the image, and those of files, with the picture.
    pub(super) fn in_focal_plane(self, file: &DisplayFile, json: bool) -> Result<()> {
        let with = "pictures about the modulator; in the focal plane of a lens one method searches the phases";
        let encoder = self.encoder.as_slice() != [EncoderName::ANTI_ALIAS];
        check_used(&[
            ("--method", !self.method.is_empty(), false, with),
            ("--encoder", encoder, false, with),
            ("--focus natural", self.focus.contains(&FocusName::Natural), false, with),
            ("--margin", self.margin != 0, false, with),
            (
                "-o",
                self.output.is_some(),
                false,
                "pictures about the modulator; `view` makes a page",
            ),
        ])?;
        let mut request = HologramRequest {
            image: self.image,
            ..HologramRequest::default()
        };
        request.hologram.display = self.display;
        let (image, depth_shown) = request.image(file)?;
        let picture = image.picture().expect("layered images are refused with a lens");
        let mut all = vec![Judged::made(FOURIER, request.make(file, &image)?, file)];
        for path in &self.hologram {
            all.push(Judged::of_file(path, hologram::read_for(path, Some(file))?));
        }
        let (mut rows, mut text) = (
            Vec::new(),
            format!("{:8}  {:24}  PSNR dB   SSIM  brightness  search ms", "method", "file"),
        );
        for judged in &all {
            let figures = judge_in_focus(&judged.hologram, file, picture)
                .map_err(|e| Error::Input(format!("{}: {e}", judged.name())))?;
            let [search_ms, encode_ms] = judged.ms();
            rows.push(json!({
                "method": judged.method, "encoder": judged.encoder, "psnr_db": figures.psnr_db, "ssim": figures.ssim,
                "brightness": figures.brightness, "wave_ms": search_ms, "encode_ms": encode_ms,
            }));
            text += &format!(
                "\n{:8}  {:24}  {:7.2}  {:5.3}  {:>10}  {:>9}",
                judged.method,
                judged.encoder,
                figures.psnr_db,
                figures.ssim,
                figure(figures.brightness, 3),
                figure(search_ms, 1),
            );
        }
        text += "\nJudged by the picture, each pixel in focus.";
        let Size { width, height } = picture.size();
        let value = json!({
            "truth": "the picture, in focus", "width": width, "height": height, "depth": shown_json(depth_shown), "rows": rows,
        });
        terminal::print(json, &value, text + &shown_text(depth_shown));
        Ok(())
    }
}
