//! The study of occlusion (Methods, 'Methods comparison for occlusion modeling', and Fig. 9). It views six pairs of
//! input and method on one scene from the front and from the rear, and measures the artefacts of each.
//!
//! Setting 6, waves on the complete scene, is the reference for every measure. The four artefacts are measured at the
//! front focus, where Fig. 9 marks them, in regions that follow from the scene. S denotes the surfaces in front of the
//! middle between the two focuses, and 'near' means within the reach of light between the focuses:
//!
//! 1. light of hidden points on S, away from the visible part of the rear;
//! 2. light of visible points on S, near the visible part of the rear;
//! 3. missing light beside S, near hidden points;
//! 4. the difference between rays and waves, in all three regions.

use ndarray::{Array2, Array3, Axis, Zip, s};
use num_complex::Complex32;
use phasefront::Display;
use phasefront::Size;
use phasefront_core::optics::asm;
use phasefront_core::optics::metrics::{self, Comparison};
use phasefront_core::view::refocus::Refocus;
use phasefront_exact::point_based::{self, Occlusion};
use phasefront_exact::sm_lbm::{self, plane_of_depth, plane_z_m};
use phasefront_io::ldi::{Ldi, LdiLayer};
use phasefront_io::{Error, Result};
use serde::Serialize;

/// The method that models occlusion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Method {
    /// The point-based method.
    Points(Occlusion),
    /// SM-LBM.
    Waves,
}

/// One of the six pairs of input and method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Setting {
    /// The name in the paper.
    pub name: &'static str,
    method: Method,
    /// Whether the input is the rasterized scene, which has only layer 0.
    rasterized: bool,
}

/// The settings of the paper, 1 to 6.
pub const SETTINGS: [Setting; 6] = [
    Setting {
        name: "no occlusion",
        method: Method::Points(Occlusion::None),
        rasterized: false,
    },
    Setting {
        name: "occlusion only from input",
        method: Method::Points(Occlusion::Input),
        rasterized: true,
    },
    Setting {
        name: "geometric (input + computation)",
        method: Method::Points(Occlusion::Geometric),
        rasterized: true,
    },
    Setting {
        name: "geometric (computation)",
        method: Method::Points(Occlusion::Geometric),
        rasterized: false,
    },
    Setting {
        name: "waves (input + computation)",
        method: Method::Waves,
        rasterized: true,
    },
    Setting {
        name: "waves (computation)",
        method: Method::Waves,
        rasterized: false,
    },
];

/// The amount of each artefact at the front focus. `None` if the scene has no region for it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Artefacts {
    /// Artefact 1: the root mean square amplitude error on front surfaces out of reach of the visible rear.
    pub leakage_from_occluded: Option<f64>,
    /// Artefact 2: the root mean square amplitude error on front surfaces within reach of the visible rear.
    pub leakage_from_visible: Option<f64>,
    /// Artefact 3: the missing share of the energy beside front surfaces, within reach of hidden points. Negative if
    /// there is too much energy.
    pub loss_from_occluded: Option<f64>,
    /// Artefact 4: the root mean square amplitude difference from waves on the same input. Only for ray casting.
    pub geometric_inaccuracy: Option<f64>,
}

/// The views of one setting and their quality.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The setting.
    pub setting: Setting,
    /// The amplitudes at the front focus, (3, H, W).
    pub front: Array3<f32>,
    /// The amplitudes at the rear focus, (3, H, W).
    pub rear: Array3<f32>,
    /// The comparison with setting 6 at the front focus.
    pub front_quality: Comparison,
    /// The comparison with setting 6 at the rear focus.
    pub rear_quality: Comparison,
    /// The artefacts at the front focus.
    pub artefacts: Artefacts,
}

/// The results of the six settings on one scene.
#[derive(Debug, Clone)]
pub struct Study {
    /// z of the front focus, in metres.
    pub front_z_m: f64,
    /// z of the rear focus, in metres.
    pub rear_z_m: f64,
    /// The outcomes of settings 1 to 6.
    pub outcomes: Vec<Outcome>,
}

/// Makes the paper's scene: four pairs of vertical bars at both ends of the volume. The front bar of each pair hides
/// the lower half of the rear one. The LDI has two layers of 320×256, which hold the complete scene.
pub fn two_bars() -> Ldi {
    const SIZE: Size = Size {
        width: 320,
        height: 256,
    };
    const FRONT_AMPLITUDE: f32 = 0.3;
    const REAR_AMPLITUDE: f32 = 0.6;
    let empty = || LdiLayer {
        rgb: Array3::zeros((3, SIZE.height, SIZE.width)),
        depth: Array2::from_elem(SIZE.shape(), f32::NAN),
    };
    let mut layers = vec![empty(), empty()];
    let mut bar = |layer: usize, y: std::ops::Range<usize>, amplitude: f32, depth: f32| {
        for left in (24..SIZE.width).step_by(80) {
            let columns = left..left + 32;
            let place = s![y.clone(), columns.clone()];
            layers[layer].depth.slice_mut(place).fill(depth);
            let place = s![.., y.clone(), columns];
            layers[layer].rgb.slice_mut(place).fill(amplitude);
        }
    };
    bar(0, 32..128, REAR_AMPLITUDE, 1.0);
    bar(0, 128..224, FRONT_AMPLITUDE, 0.0);
    bar(1, 128..224, REAR_AMPLITUDE, 1.0);
    Ldi { layers }
}

/// Runs the six settings on `ldi`, with its depths rounded to `planes` planes. One in twenty points lies in front of
/// the front focus, and one in twenty behind the rear focus. `progress` receives the number of finished settings.
///
/// # Errors
/// Returns an error if the scene has no points or a method fails.
pub fn study(ldi: &Ldi, display: &Display, planes: usize, progress: &dyn Fn(usize)) -> Result<Study> {
    let Size { width, height } = ldi.size();
    let rasterized = Ldi {
        layers: ldi.layers[..1].to_vec(),
    };
    let mut holograms: Vec<Array3<Complex32>> = Vec::with_capacity(SETTINGS.len());
    for setting in SETTINGS {
        let input = if setting.rasterized { &rasterized } else { ldi };
        holograms.push(match setting.method {
            Method::Points(occlusion) => point_based::hologram(input, display, planes, occlusion, &|_, _| {})?,
            Method::Waves => sm_lbm::hologram(input, display, planes, &|_, _| {})?,
        });
        progress(holograms.len());
    }
    let [front_z_m, rear_z_m] = focuses(ldi, display, planes)?;
    let midpoint = display.clone().with_offset_m(0.0)?;
    let focuses = [front_z_m, rear_z_m];
    let plan = Refocus::new(ldi.size(), &midpoint, &focuses, None)?;
    let mut views = Vec::with_capacity(SETTINGS.len());
    for hologram in &holograms {
        let values = hologram.as_slice().expect("standard layout");
        let stack = plan.focal_stack(values, &focuses)?;
        let [front, rear]: [Vec<f32>; 2] = stack.try_into().expect("a view a focus");
        let shaped = |view| Array3::from_shape_vec((3, height, width), view).expect("a view of the scene's shape");
        views.push([shaped(front), shaped(rear)]);
    }
    let regions = Regions::of(ldi, display, [front_z_m, rear_z_m]);
    let [truth_front, truth_rear] = &views[5];
    let mut outcomes = Vec::with_capacity(SETTINGS.len());
    for (setting, [front, rear]) in SETTINGS.into_iter().zip(&views) {
        let waves = &views[if setting.rasterized { 4 } else { 5 }][0];
        outcomes.push(Outcome {
            setting,
            front: front.clone(),
            rear: rear.clone(),
            front_quality: metrics::compare(front.view(), truth_front.view())?,
            rear_quality: metrics::compare(rear.view(), truth_rear.view())?,
            artefacts: Artefacts {
                leakage_from_occluded: rms(front, truth_front, &regions.over_hidden),
                leakage_from_visible: rms(front, truth_front, &regions.over_visible),
                loss_from_occluded: energy(truth_front, &regions.beside)
                    .zip(energy(front, &regions.beside))
                    .map(|(truth, ours)| 1.0 - ours / truth),
                geometric_inaccuracy: match setting.method {
                    Method::Points(Occlusion::Geometric) => rms(front, waves, &regions.all()),
                    _ => None,
                },
            },
        });
    }
    Ok(Study {
        front_z_m,
        rear_z_m,
        outcomes,
    })
}

/// Returns z of the planes at the 5th and the 95th percentile of all points, front first.
fn focuses(ldi: &Ldi, display: &Display, planes: usize) -> Result<[f64; 2]> {
    let mut depths: Vec<f32> = (ldi.layers.iter())
        .flat_map(|layer| layer.depth.iter().copied().filter(|d| !d.is_nan()))
        .collect();
    if depths.is_empty() {
        return Err(Error::Input(
            "the scene has no points; there is nothing to focus on".into(),
        ));
    }
    depths.sort_unstable_by(f32::total_cmp);
    let last = depths.len() - 1;
    Ok([last / 20, last - last / 20].map(|i| plane_z_m(plane_of_depth(depths[i], planes), planes, display)))
}

/// The regions in which the artefacts are measured.
struct Regions {
    /// Region 1: front surfaces through which only hidden points can shine.
    over_hidden: Array2<bool>,
    /// Region 2: front surfaces near the visible part of the rear.
    over_visible: Array2<bool>,
    /// Region 3: pixels beside front surfaces, near hidden points.
    beside: Array2<bool>,
}

impl Regions {
    fn of(ldi: &Ldi, display: &Display, [front_z_m, rear_z_m]: [f64; 2]) -> Self {
        let middle = (front_z_m + rear_z_m) / 2.0;
        let nearer = |d: f32| display.z_of_depth(d.into()) > middle;
        let front = ldi.layers[0].depth.mapv(|d| !d.is_nan() && nearer(d));
        let visible = ldi.layers[0].depth.mapv(|d| !d.is_nan() && !nearer(d));
        let mut hidden = Array2::from_elem(ldi.size().shape(), false);
        for layer in &ldi.layers[1..] {
            Zip::from(&mut hidden)
                .and(&layer.depth)
                .for_each(|hidden, d| *hidden |= !d.is_nan() && !nearer(*d));
        }
        let longest = display.longest_wavelength_m();
        let reach_m = asm::reach_m(front_z_m - rear_z_m, longest, display.pitch_m());
        let reach = (reach_m / display.pitch_m()).ceil() as usize;
        let (near_visible, near_hidden) = (widened(&visible, reach), widened(&hidden, reach));
        Regions {
            over_hidden: &(&front & &near_hidden) & &near_visible.mapv(|near| !near),
            over_visible: &front & &near_visible,
            beside: &front.mapv(|front| !front) & &near_hidden,
        }
    }

    /// Returns the union of the regions.
    fn all(&self) -> Array2<bool> {
        &(&self.over_hidden | &self.over_visible) | &self.beside
    }
}

/// Returns the pixels that have a pixel of `set` within `reach` rows and columns.
fn widened(set: &Array2<bool>, reach: usize) -> Array2<bool> {
    let mut out = set.clone();
    for axis in [1, 0] {
        for mut lane in out.lanes_mut(Axis(axis)) {
            let marked: Vec<bool> = lane.iter().copied().collect();
            let mut last = None;
            for i in 0..marked.len() + reach {
                if marked.get(i) == Some(&true) {
                    last = Some(i);
                }
                // At this point, all marked pixels within ±reach of pixel i − reach are known.
                if i >= reach {
                    lane[i - reach] = last.is_some_and(|last| last + 2 * reach >= i);
                }
            }
        }
    }
    out
}

/// Returns the values of all colours of `image` in `region`.
fn values<'a>(image: &'a Array3<f32>, region: &'a Array2<bool>) -> impl Iterator<Item = f64> + 'a {
    image.axis_iter(Axis(0)).flat_map(move |plane| {
        plane
            .into_iter()
            .zip(region)
            .filter(|(_, inside)| **inside)
            .map(|(v, _)| f64::from(*v))
    })
}

fn rms(a: &Array3<f32>, b: &Array3<f32>, region: &Array2<bool>) -> Option<f64> {
    let count = 3 * region.iter().filter(|inside| **inside).count();
    let squares = values(a, region).zip(values(b, region));
    let sum: f64 = squares.map(|(a, b)| (a - b).powi(2)).sum();
    (count > 0).then(|| (sum / count as f64).sqrt())
}

/// Returns the energy in a region, or `None` if it is empty.
fn energy(image: &Array3<f32>, region: &Array2<bool>) -> Option<f64> {
    let sum: f64 = values(image, region).map(|v| v * v).sum();
    (sum > 0.0).then_some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widening_is_a_square_around_each_pixel() {
        let mut set = Array2::from_elem((9, 13), false);
        for place in [(0, 0), (4, 6), (8, 12)] {
            set[place] = true;
        }
        for reach in [0, 1, 3, 20] {
            let expected = Array2::from_shape_fn(set.dim(), |(y, x)| {
                set.indexed_iter()
                    .any(|((sy, sx), marked)| *marked && y.abs_diff(sy) <= reach && x.abs_diff(sx) <= reach)
            });
            assert_eq!(widened(&set, reach), expected);
        }
    }

    #[test]
    fn the_front_bars_hide_the_lower_halves_of_the_rear_ones() {
        let ldi = Ldi::new(two_bars().layers).expect("a well-formed scene");
        let lower = ldi.layers[1].depth.mapv(|d| !d.is_nan());
        let front = ldi.layers[0].depth.mapv(|d| d == 0.0);
        let upper = ldi.layers[0].depth.mapv(|d| d == 1.0);
        assert_eq!(lower, front);
        let count = |set: &Array2<bool>| set.iter().filter(|inside| **inside).count();
        assert_eq!(count(&lower), count(&upper));
        assert_eq!(count(&lower), 4 * 32 * 96);
    }
}
