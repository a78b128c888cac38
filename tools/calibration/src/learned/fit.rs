//! Fits a learned model to photographs of holograms, by Adam (Kingma and Ba, 2015) on the misfit of the light.
//!
//! The exposure of each photograph is free, because lasers drift. The place of the modulator in each photograph is
//! refined while the model becomes better, because marks show it to a fraction of a pixel only.

use super::gradient::{BORDER, Path};
use super::register;
use super::scenes::Scene;
use crate::camera::marks::Registration;
use crate::camera::photograph::Photograph;
use ndarray::Array2;
use phasefront::Size;
use phasefront::Target;
use phasefront_core::display::model::{CURVE, ColourModel};
use phasefront_io::dice::Dice;
use phasefront_io::{Error, Result};
use rayon::prelude::*;

/// The number of steps, and of photographs in each.
const STEPS: usize = 400;
const BATCH: usize = 8;
/// The number of steps between two refinements of the registration.
const REGISTER: usize = 20;
/// The largest change of a value in a step: of the curve and the maps, and of the crosstalk.
const RATE: f32 = 0.02;
const CROSSTALK_RATE: f32 = 0.004;
/// The least slope of the phase curve.
const LEAST_SLOPE: f32 = 0.05;
/// The decay of Adam's means.
const MEANS: [f32; 2] = [0.9, 0.99];
/// The number of pixels between two nodes of the maps over the modulator, and their largest number along an axis.
const SPACING: usize = 8;
const MOST_NODES: usize = 32;

/// A hologram and its photograph.
#[derive(Debug, Clone)]
pub struct Sample {
    /// The hologram.
    pub scene: Scene,
    /// What the camera saw.
    pub photograph: Photograph,
    /// Where the modulator is in it.
    pub registration: Registration,
}

/// The model of one colour and what it explains.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// The model.
    pub model: ColourModel,
    /// The RMS difference between the light of the model and of the photographs, relative to the RMS light of the
    /// photographs: of an ideal display with the same calibration, and of the model.
    pub misfit: [f64; 2],
}

/// Returns the number of rows and columns of nodes for a modulator of a size.
pub fn nodes(Size { width, height }: Size) -> (usize, usize) {
    let nodes = |pixels: usize| (pixels / SPACING + 1).clamp(2, MOST_NODES);
    (nodes(height), nodes(width))
}

/// Fits the model of `colour` to `samples`. `target` is the calibration without a model. `progress` receives the number
/// of steps done and their total.
///
/// # Errors
/// Returns an error if there is no photograph, a path cannot be planned, or the fit ends in a phase curve that falls.
pub fn fit(target: &Target, colour: usize, samples: &[Sample], progress: &dyn Fn(usize, usize)) -> Result<Fitted> {
    let mut all = Fit::new(target, colour, samples)?;
    let ideal = ColourModel::ideal(all.nodes);
    let mut values = ideal.values();
    let mut means = [vec![0.0; values.len()], vec![0.0; values.len()]];
    let mut dice = Dice::new(0x004c_4541_524e);
    let mut before = 0.0;
    for step in 0..STEPS {
        progress(step, STEPS);
        let model = ColourModel::from_values(&values);
        if step % REGISTER == 0 {
            all.register(&model)?;
            if step == 0 {
                before = all.misfit(&ideal);
            }
        }
        let slopes = all.slopes(&model, &mut dice);
        let decay = 0.5 + 0.5 * (std::f32::consts::PI * step as f32 / STEPS as f32).cos();
        let correction = MEANS.map(|mean| 1.0 - mean.powi(step as i32 + 1));
        for (i, (value, slope)) in values.iter_mut().zip(slopes).enumerate() {
            means[0][i] = MEANS[0] * means[0][i] + (1.0 - MEANS[0]) * slope;
            means[1][i] = MEANS[1] * means[1][i] + (1.0 - MEANS[1]) * slope * slope;
            let [mean, square] = [means[0][i] / correction[0], means[1][i] / correction[1]];
            let rate = if (CURVE..CURVE + 9).contains(&i) {
                CROSSTALK_RATE
            } else {
                RATE
            };
            *value -= rate * decay * mean / (square.sqrt() + 1e-12);
        }
        let others: f32 = (0..9).filter(|i| *i != 4).map(|i| values[CURVE + i]).sum();
        values[CURVE + 4] = 1.0 - others;
        keep_rising(&mut values[..CURVE]);
    }
    let model = ColourModel::from_values(&values);
    let after = all.misfit(&model);
    if after.is_nan() || after >= before {
        return Err(Error::Input(format!(
            "the model explains the photographs no better ({after:.3}) than the calibration alone ({before:.3}); check that they show the holograms of this display, in focus"
        )));
    }
    Ok(Fitted {
        model,
        misfit: [before, after],
    })
}

/// Bounds the errors of a phase curve such that the curve rises everywhere, from its middle outward. Where a table
/// gives all phases out of reach the same level, the best curve would be flat.
fn keep_rising(curve: &mut [f32]) {
    let most = (1.0 - LEAST_SLOPE) * std::f32::consts::TAU / (CURVE - 1) as f32;
    for k in CURVE / 2..CURVE - 1 {
        curve[k + 1] = curve[k + 1].max(curve[k] - most);
    }
    for k in (0..CURVE / 2).rev() {
        curve[k] = curve[k].min(curve[k + 1] + most);
    }
}

/// The photographs of a fit, at the pixels of the modulator.
struct Fit<'a> {
    nodes: (usize, usize),
    paths: Vec<(f64, Path)>,
    samples: &'a [Sample],
    registrations: Vec<Registration>,
    lights: Vec<Array2<f32>>,
}

impl<'a> Fit<'a> {
    fn new(target: &Target, colour: usize, samples: &'a [Sample]) -> Result<Self> {
        if samples.is_empty() {
            return Err(Error::Input("a model needs photographs; there are none".into()));
        }
        let mut paths: Vec<(f64, Path)> = Vec::new();
        for sample in samples {
            let z_m = sample.scene.z_m;
            if !paths.iter().any(|(other, _)| *other == z_m) {
                paths.push((z_m, Path::new(target, colour, z_m)?));
            }
        }
        let size = target.modulator();
        let light = |sample: &Sample| sample.registration.centres(&sample.photograph, size);
        Ok(Fit {
            nodes: nodes(size),
            paths,
            samples,
            registrations: samples.iter().map(|sample| sample.registration).collect(),
            lights: samples.iter().map(light).collect(),
        })
    }

    fn path(&self, index: usize) -> &Path {
        let z_m = self.samples[index].scene.z_m;
        let found = self.paths.iter().find(|(other, _)| *other == z_m);
        &found.expect("a path for each z").1
    }

    fn phases(&self, index: usize) -> &[f32] {
        self.samples[index].scene.phases.as_slice().expect("standard layout")
    }

    /// Refines where the modulator is in each photograph by what `model` expects.
    fn register(&mut self, model: &ColourModel) -> Result<()> {
        let one = |index: usize| -> Result<(Registration, Array2<f32>)> {
            let light = &self.lights[index];
            let expected = self.path(index).expected(model, self.nodes, self.phases(index), light);
            let old = self.registrations[index];
            let map = register::refined(&old.map, light, &expected.light, BORDER)?;
            let new = Registration { map, ..old };
            let light = new.centres(&self.samples[index].photograph, Size::from_shape(light.dim()));
            Ok((new, light))
        };
        let all: Result<Vec<_>> = (0..self.samples.len()).into_par_iter().map(one).collect();
        (self.registrations, self.lights) = all?.into_iter().unzip();
        Ok(())
    }

    /// Returns the RMS misfit over all photographs.
    fn misfit(&self, model: &ColourModel) -> f64 {
        let one = |index: usize| {
            let expected = (self.path(index)).expected(model, self.nodes, self.phases(index), &self.lights[index]);
            expected.misfit
        };
        let all: Vec<f64> = (0..self.samples.len()).into_par_iter().map(one).collect();
        (all.iter().sum::<f64>() / all.len() as f64).sqrt()
    }

    /// Returns the mean gradient over some photographs, with the sum of the crosstalk kept.
    fn slopes(&self, model: &ColourModel, dice: &mut Dice) -> Vec<f32> {
        let count = self.samples.len();
        let mut batch: Vec<usize> = (0..count).collect();
        for i in 0..BATCH.min(count) {
            batch.swap(i, dice.integer(i, count - 1));
        }
        batch.truncate(BATCH);
        let one = |index: &usize| {
            self.path(*index)
                .gradient(model, self.nodes, self.phases(*index), &self.lights[*index])
                .1
        };
        let all: Vec<Vec<f32>> = batch.par_iter().map(one).collect();
        let mut sum = vec![0.0; all[0].len()];
        for slopes in &all {
            (sum.iter_mut().zip(slopes)).for_each(|(sum, slope)| *sum += slope / batch.len() as f32);
        }
        let own = std::mem::take(&mut sum[CURVE + 4]);
        (0..9).filter(|i| *i != 4).for_each(|i| sum[CURVE + i] -= own);
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_that_falls_is_kept_rising_and_another_stays() {
        let mut falls: [f32; CURVE] = std::array::from_fn(|k| if k < 3 { 2.0 } else { -0.6 * k as f32 });
        keep_rising(&mut falls);
        let colour = ColourModel {
            curve: falls,
            ..ColourModel::ideal((2, 2))
        };
        for k in 0..160 {
            let phase = (k as f32 + 0.5) / 160.0 * std::f32::consts::TAU;
            assert!(colour.response(phase).1 > 0.04, "{k}");
        }
        let rises: [f32; CURVE] = std::array::from_fn(|k| 0.2 * (k as f32 * 0.7).sin());
        let mut same = rises;
        keep_rising(&mut same);
        assert_eq!(same, rises);
    }
}
