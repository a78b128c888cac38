//! A learned model of a simulated display with faults that it does not know in form, judged by holograms that the fit
//! never saw.

use crate::camera::marks::Registration;
use crate::camera::pattern::Pattern;
use crate::learned::fit::{self, Sample};
use crate::learned::scenes;
use crate::simulated_display::SimulatedDisplay;
use ndarray::{Array2, Array3, Axis};
use num_complex::Complex32;
use phasefront::Size;
use phasefront::{Brightness, EncoderOptions, Encoding, Target};
use phasefront_core::display::levels::LevelsMut;
use phasefront_core::display::model::Model;
use phasefront_core::optics::asm::{Padding, Propagator};
use phasefront_core::pipeline::display_plan::DisplayPlan;
use phasefront_io::{Error, Result};
use serde::Serialize;

/// The numbers of midpoint steps of the unseen holograms, and the z in metres at which they are viewed.
pub const JUDGED: [(usize, f64); 5] = [(0, 0.0), (3, 0.0), (10, 0.0), (30, 0.0), (10, 2e-3)];
/// The number of unseen holograms.
const UNSEEN: usize = 4;
/// The seed of the first of them, above those of all photographs.
const UNSEEN_SEED: u64 = 1 << 32;
/// The border that is left out of the PSNR, in pixels.
const BORDER: usize = 8;

/// What a model of some photographs is worth, for one colour.
#[derive(Debug, Clone, Serialize)]
pub struct Learned {
    /// The number of photographs.
    pub photographs: usize,
    /// The RMS misfit of the light of the photographs, relative to their RMS light: calibrated without the model, and
    /// with it.
    pub misfit: [f64; 2],
    /// The PSNR of the displayed amplitudes for each of [`JUDGED`], in dB.
    pub psnr_db: Vec<f64>,
}

/// Photographs the marks and `count` scenes of `target`, its calibration without a model, in `colour`.
///
/// # Errors
/// Returns an error if the marks are not found or the path to a plane cannot be planned.
pub fn photographs(simulated: &SimulatedDisplay, target: &Target, colour: usize, count: usize) -> Result<Vec<Sample>> {
    let pattern = Pattern::new(target.modulator())?;
    let shot = |index: usize| (1 << 23) + index as u64;
    let marks = scenes::marks(target, colour, &pattern, 0.0)?;
    let seen = simulated.photograph(marks.levels.view(), colour, 0.0, shot(0))?;
    let registration = Registration::find(&seen, &pattern).map_err(|e| Error::Input(e.to_string()))?;
    let sample = |index: usize| {
        let scene = scenes::scene(target, colour, index, count)?;
        let photograph = simulated.photograph(scene.levels.view(), colour, scene.z_m, shot(index + 1))?;
        Ok(Sample {
            scene,
            photograph,
            registration,
        })
    };
    (0..count).map(sample).collect()
}

/// Returns `target` with a model fitted to `samples` in all colours, which must be one, and what it is worth.
///
/// # Errors
/// Returns the errors of [`fit::fit`].
pub fn learn(simulated: &SimulatedDisplay, target: &Target, samples: &[Sample]) -> Result<(Target, Learned)> {
    let fitted = fit::fit(target, 0, samples, &|_, _| ())?;
    let model = Model::new(fit::nodes(target.modulator()), vec![fitted.model])?;
    let target = Target {
        model: Some(model.into()),
        ..target.clone()
    };
    let learned = Learned {
        photographs: samples.len(),
        misfit: fitted.misfit,
        psnr_db: judge(simulated, &target, 0)?,
    };
    Ok((target, learned))
}

/// Returns the mean PSNR of what `simulated` displays of unseen holograms for `target`, for each of [`JUDGED`].
///
/// # Errors
/// Returns an error if the path to a plane cannot be planned.
pub fn judge(simulated: &SimulatedDisplay, target: &Target, colour: usize) -> Result<Vec<f64>> {
    let one = |(steps, z_m): (usize, f64)| -> Result<f64> {
        let all: Result<Vec<f64>> = (0..UNSEEN as u64)
            .map(|i| {
                let field = scenes::field(target.modulator(), UNSEEN_SEED + i);
                psnr(simulated, target, colour, &field, steps, z_m)
            })
            .collect();
        let all = all?;
        Ok(all.iter().sum::<f64>() / all.len() as f64)
    };
    JUDGED.into_iter().map(one).collect()
}

/// Returns the PSNR of the displayed amplitude of `field` at `z_m`, with the gain that suits it best.
fn psnr(
    simulated: &SimulatedDisplay,
    target: &Target,
    colour: usize,
    field: &Array2<Complex32>,
    steps: usize,
    z_m: f64,
) -> Result<f64> {
    let size @ Size { width, height } = Size::from_shape(field.dim());
    let options = EncoderOptions {
        brightness: Brightness::Fixed(1.0),
        midpoint_steps: steps,
        ..Encoding::ANTI_ALIAS.into()
    };
    let plan = DisplayPlan::new(size, target, &options)?;
    let colours = target.display.colours();
    let mut stack: Vec<_> = (0..colours).flat_map(|_| field.iter().copied()).collect();
    let mut levels = Array3::zeros((colours, height, width));
    let mut scratch = plan.scratch();
    plan.propagate(&mut stack, &mut scratch);
    let bytes = LevelsMut::Bytes(levels.as_slice_mut().expect("standard layout"));
    plan.modulate(None, &mut stack, bytes, &mut scratch);
    let shown = simulated.intensity(levels.index_axis(Axis(0), colour), colour, z_m)?;
    let mut wanted = field.clone();
    let (pitch_m, wavelength_m) = (target.display.pitch_m(), target.display.wavelengths_m()[colour]);
    let way = Propagator::new(Size { width, height }, pitch_m, wavelength_m, z_m, Padding::Reach)?;
    way.propagate(wanted.as_slice_mut().expect("standard layout"), &mut way.scratch());
    let inside = (BORDER..height - BORDER).flat_map(|y| (BORDER..width - BORDER).map(move |x| (y, x)));
    let pairs: Vec<(f64, f64)> = inside
        .map(|(y, x)| {
            (
                f64::from(shown[(2 * y, 2 * x)]).sqrt(),
                f64::from(wanted[(y, x)].norm()),
            )
        })
        .collect();
    let (both, own) = pairs
        .iter()
        .fold((0.0, 0.0), |(both, own), (s, w)| (both + s * w, own + s * s));
    let gain = both / f64::max(own, f64::MIN_POSITIVE);
    let square = pairs.iter().map(|(s, w)| (gain * s - w).powi(2)).sum::<f64>() / pairs.len() as f64;
    Ok(-10.0 * square.log10())
}
