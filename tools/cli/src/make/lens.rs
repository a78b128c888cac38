//! Holograms whose picture lies in the focal plane of a lens.

use super::{HologramRequest, HologramResult, Judged};
use crate::flags::encoder::Encoder;
use ndarray::Array3;
use phasefront::{RgbdFrame, Size};
use phasefront_command::flags::check_used;
use phasefront_core::display::lens::Lens;
use phasefront_core::encode::focal_plane;
use phasefront_core::optics::metrics;
use phasefront_core::view::colours::ViewColours;
use phasefront_io::display::DisplayFile;
use phasefront_io::hologram::{Hologram, levels_of_phases};
use phasefront_io::{Error, Result};
use std::time::Instant;

/// The name of the method.
pub(crate) const FOURIER: &str = "fourier";

/// The number of planes at which pictures are compared.
const JUDGED_PLANES: usize = 32;

impl HologramRequest {
    /// Makes the hologram of `frame` for the focal plane of `lens`.
    pub(super) fn in_focal_plane(&self, lens: &Lens, frame: &RgbdFrame, file: &DisplayFile) -> Result<HologramResult> {
        self.check_in_focal_plane()?;
        let start = Instant::now();
        let display = &file.target.display;
        let made = focal_plane::phases(frame, display, lens, self.scale)?;
        let wave = start.elapsed();
        let Size { width, height } = frame.size();
        let phases = Array3::from_shape_vec((display.colours(), height, width), made.phases);
        let start = Instant::now();
        let levels = levels_of_phases(phases.expect("a phase for each pixel"), file)?;
        Ok(HologramResult {
            method: FOURIER,
            field: None,
            levels,
            encoder: Encoder::of_phases(),
            scale: made.scale,
            stages: vec![(FOURIER, wave), ("encode", start.elapsed())],
            engine: None,
            view_colours: ViewColours::Amplitude,
        })
    }

    /// Refuses what the focal plane of a lens does not take.
    fn check_in_focal_plane(&self) -> Result<()> {
        let with = "pictures about the modulator; in the focal plane of a lens one method searches the phases";
        self.hologram.encoder.unused(with)?;
        check_used(&[
            ("--method", self.method.is_some(), false, with),
            ("--network", self.hologram.network.is_some(), false, with),
            ("--precision", self.hologram.precision.is_some(), false, with),
            ("--planes", self.planes.is_some(), false, with),
            ("--taps", self.taps.is_some(), false, with),
            ("--occlusion", self.occlusion.is_some(), false, with),
            ("--backend gpu", self.backend.device()?.is_some(), false, with),
        ])
    }
}

/// Returns the amplitudes, (C, H, W), that `hologram` shows of each pixel of `frame` at its z.
fn seen_in_focus(hologram: &Hologram, file: &DisplayFile, frame: &RgbdFrame) -> Result<Array3<f32>> {
    let (_, depth) = frame.values();
    let planes = focal_plane::cut(depth, JUDGED_PLANES, &file.target.display);
    let width = frame.size().width;
    let mut seen = Array3::zeros(frame.rgb().dim());
    for (plane, z_m) in planes.z_m {
        let view = &hologram.views_on(file, &[z_m])?[0];
        for ((colour, y, x), value) in seen.indexed_iter_mut() {
            if planes.of_pixel[y * width + x] == plane {
                *value = view[(colour, y, x)];
            }
        }
    }
    Ok(seen)
}

/// Compares what `hologram` shows in focus with the picture of `frame`. A phase map of other software does not say what
/// amplitude its light stands for, and takes the one that brings it nearest to the picture.
pub(crate) fn judge_in_focus(hologram: &Hologram, file: &DisplayFile, frame: &RgbdFrame) -> Result<Judged> {
    if hologram.size() != frame.size() {
        return Err(Error::Input(format!(
            "the hologram is {}, the image {}; both must be of one size",
            hologram.size(),
            frame.size()
        )));
    }
    let mut seen = seen_in_focus(hologram, file, frame)?;
    let says_scale = hologram.info().encoder.is_some();
    let brightness = says_scale.then(|| f64::from(seen.sum() / frame.rgb().sum()));
    if !says_scale {
        let both: f64 = seen.iter().zip(frame.rgb()).map(|(a, b)| f64::from(a * b)).sum();
        let light: f64 = seen.iter().map(|a| f64::from(a * a)).sum();
        seen *= (both / light) as f32;
    }
    let figures = metrics::compare(seen.view(), frame.rgb())?;
    Ok(Judged {
        of: "the picture",
        psnr_db: figures.psnr_overall,
        ssim: figures.ssim_overall,
        stack: None,
        brightness,
    })
}
