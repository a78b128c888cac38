//! The comparison of a hologram with its own wave, or with its picture in the focal plane of a lens.

use super::{HologramResult, infos, judge_in_focus};
use phasefront::RgbdFrame;
use phasefront_exact::truth;
use phasefront_io::display::DisplayFile;
use phasefront_io::{Result, hologram};
use serde::Serialize;

/// The quality of the displayed image, compared with the hologram's own wave or with its picture.
#[derive(Serialize)]
pub(crate) struct Judged {
    /// What the image is compared with.
    pub(crate) of: &'static str,
    pub(crate) psnr_db: f64,
    pub(crate) ssim: f64,
    /// The quality over a stack of depths. A picture is compared in focus alone.
    #[serde(flatten)]
    pub(crate) stack: Option<Stack>,
    /// The mean amplitude divided by that of what it is compared with, if the hologram says what amplitude its light
    /// stands for.
    pub(crate) brightness: Option<f64>,
}

/// The quality over a stack of depths.
#[derive(Serialize)]
pub(crate) struct Stack {
    #[serde(rename = "stack_psnr_db")]
    pub(crate) psnr_db: f64,
    #[serde(rename = "stack_ssim")]
    pub(crate) ssim: f64,
}

impl Judged {
    pub(crate) fn describe(&self) -> String {
        let stack = self.stack.as_ref().map_or(String::new(), |stack| {
            format!(", over the stack {:.2} dB, {:.3}", stack.psnr_db, stack.ssim)
        });
        format!(
            "; shown of {}: {:.2} dB, SSIM {:.3}{stack}",
            self.of, self.psnr_db, self.ssim
        )
    }
}

/// Compares the displayed image of `made` with its own wave, which it must keep, or in the focal plane of a lens with
/// the `picture` that it was made of.
pub(crate) fn judge(display: &DisplayFile, made: &HologramResult, picture: Option<&RgbdFrame>) -> Result<Judged> {
    let (levels, field) = infos(display, made);
    if let (Some(_), Some(picture)) = (&display.lens, picture) {
        return judge_in_focus(&made.hologram(levels), display, picture);
    }
    let wave = made.field.clone().expect("kept for this");
    let z_m = truth::judged_z_m(&display.target.display);
    let wave = hologram::Hologram::Complex(wave, field).views_on(display, &z_m)?;
    let shown = made.hologram(levels).views_on(display, &z_m)?;
    let figures = truth::judge(&shown, &wave, 0)?;
    Ok(Judged {
        of: "its own wave",
        psnr_db: figures.amplitude_psnr,
        ssim: figures.amplitude_ssim,
        stack: Some(Stack {
            psnr_db: figures.focal_psnr,
            ssim: figures.focal_ssim,
        }),
        brightness: Some(figures.brightness),
    })
}
