//! The comparison of a hologram with its own wave.

use super::{HologramResult, infos};
use phasefront_exact::truth;
use phasefront_io::display::DisplayFile;
use phasefront_io::{Result, hologram};
use serde::Serialize;

/// The quality of the displayed image, compared with the hologram's own wave.
#[derive(Serialize)]
pub(crate) struct Judged {
    pub(crate) psnr_db: f64,
    pub(crate) ssim: f64,
    pub(crate) stack_psnr_db: f64,
    pub(crate) stack_ssim: f64,
    /// The mean amplitude divided by the wave's.
    pub(crate) brightness: f64,
}

impl Judged {
    pub(crate) fn describe(&self) -> String {
        format!(
            "; shown of its own wave: {:.2} dB, SSIM {:.3}, over the stack {:.2} dB, {:.3}",
            self.psnr_db, self.ssim, self.stack_psnr_db, self.stack_ssim
        )
    }
}

/// Compares the displayed image of `made` with its own wave. `made` must keep its field.
pub(crate) fn judge(display: &DisplayFile, made: &HologramResult) -> Result<Judged> {
    let (levels, field) = infos(display, made);
    let wave = made.field.clone().expect("kept for this");
    let z_m = truth::judged_z_m(&display.target.display);
    let wave = hologram::Hologram::Complex(wave, field).views_on(display, &z_m)?;
    let shown = made.hologram(levels).views_on(display, &z_m)?;
    let figures = truth::judge(&shown, &wave, 0)?;
    Ok(Judged {
        psnr_db: figures.amplitude_psnr,
        ssim: figures.amplitude_ssim,
        stack_psnr_db: figures.focal_psnr,
        stack_ssim: figures.focal_ssim,
        brightness: figures.brightness,
    })
}
