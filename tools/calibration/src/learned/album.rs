//! The photographs of holograms, checked when they come.

use super::gradient::{BORDER, Path};
use super::scenes::Scene;
use crate::camera::marks::Registration;
use crate::camera::pattern::Pattern;
use crate::camera::photograph::Photograph;
use ndarray::Array2;
use phasefront::Size;
use phasefront::Target;
use phasefront_core::display::model::ColourModel;

/// The share of saturated pixels above which a photograph cannot be used.
const SATURATED: f64 = 1e-3;
/// The contrast, standard deviation over mean, below which a photograph shows nothing.
const CONTRAST: f64 = 0.05;
/// The least correlation of a photograph's details with those of an ideal display.
const LIKENESS: f64 = 0.3;
/// The nodes of the ideal model.
const NODES: (usize, usize) = (2, 2);

/// Checks the photographs of one colour, in the order of their holograms.
pub struct Album<'a> {
    target: &'a Target,
    colour: usize,
    marks: Registration,
    size: Size,
    path: Option<(f64, Path)>,
    /// The phases of the hologram before.
    before: Option<Array2<f32>>,
}

impl<'a> Album<'a> {
    /// Begins with the photograph of the marks.
    ///
    /// # Errors
    /// Returns the reason why it cannot be used.
    pub fn new(target: &'a Target, colour: usize, marks: &Photograph) -> std::result::Result<Self, String> {
        unsaturated(marks)?;
        let pattern = Pattern::new(target.modulator()).map_err(|e| e.to_string())?;
        Ok(Album {
            target,
            colour,
            marks: Registration::find(marks, &pattern).map_err(|e| e.to_string())?,
            size: Size {
                width: marks.width,
                height: marks.height,
            },
            path: None,
            before: None,
        })
    }

    /// Returns where the modulator is in the photographs.
    pub fn registration(&self) -> Registration {
        self.marks
    }

    /// Checks the photograph of `scene`.
    ///
    /// # Errors
    /// Returns the reason why it cannot be used.
    pub fn check(&mut self, scene: &Scene, photograph: &Photograph) -> std::result::Result<(), String> {
        let size = Size {
            width: photograph.width,
            height: photograph.height,
        };
        if size != self.size {
            return Err(format!(
                "is {size}, the photograph of the marks is {}; both must be of one size",
                self.size
            ));
        }
        unsaturated(photograph)?;
        let light = self.marks.centres(photograph, self.target.modulator());
        let mean = f64::from(light.mean().unwrap_or_default());
        if f64::from(light.std(0.0)) < CONTRAST * mean || mean <= 0.0 {
            return Err("shows nothing; switch the laser on, open the shutter, and photograph it again".into());
        }
        if self.path.as_ref().is_none_or(|(z_m, _)| *z_m != scene.z_m) {
            let path = Path::new(self.target, self.colour, scene.z_m).map_err(|e| e.to_string())?;
            self.path = Some((scene.z_m, path));
        }
        let (_, path) = self.path.as_ref().expect("it is planned above");
        // What an ideal display shows of these phases.
        let alike = |phases: &Array2<f32>| {
            let phases = phases.as_slice().expect("standard layout");
            let ideal = path.expected(&ColourModel::ideal(NODES), NODES, phases, &light);
            likeness(&ideal.light, &light)
        };
        let likeness = alike(&scene.phases);
        if likeness >= LIKENESS {
            self.before = Some(scene.phases.clone());
            return Ok(());
        }
        Err(if self.before.as_ref().is_some_and(|before| alike(before) > LIKENESS) {
            "shows the hologram before it; wait until the modulator shows the next, and photograph it again".into()
        } else {
            format!(
                "does not show its hologram where the marks were (correlation {likeness:.2}, at least {LIKENESS} is needed); keep camera and focus in place, and photograph it again"
            )
        })
    }
}

/// Returns the correlation of the details of two pictures: of the differences of pixels that are two apart. The laser's
/// profile is no detail.
fn likeness(a: &Array2<f32>, b: &Array2<f32>) -> f64 {
    let (height, width) = a.dim();
    let [mut both, mut of_a, mut of_b] = [0.0f64; 3];
    for y in BORDER..height - BORDER {
        for x in BORDER..width - BORDER {
            for other in [(y, x + 2), (y + 2, x)] {
                let [da, db] = [a, b].map(|of| f64::from(of[other] - of[(y, x)]));
                both += da * db;
                of_a += da * da;
                of_b += db * db;
            }
        }
    }
    both / (of_a * of_b).max(f64::MIN_POSITIVE).sqrt()
}

fn unsaturated(photograph: &Photograph) -> std::result::Result<(), String> {
    match photograph.saturated() {
        share if share > SATURATED => Err(format!(
            "{:.1} % of the photograph is saturated; shorten the exposure",
            100.0 * share
        )),
        _ => Ok(()),
    }
}
