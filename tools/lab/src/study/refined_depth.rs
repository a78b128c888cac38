//! Measures the benefit of depth refinement. It renders scenes, simulates a depth sensor, and compares the holograms of
//! refined depth and of plainly enlarged depth with the truth.

use crate::scene;
use ndarray::{Array2, Array3, ArrayView2};
use num_complex::Complex32;
use phasefront::{Display, Method, RgbdFrame};
use phasefront_core::depth::fill_nearest;
use phasefront_core::depth::refine::Refiner;
use phasefront_core::frame::Crop;
use phasefront_core::method::MethodPlan;
use phasefront_exact::sm_lbm;
use phasefront_io::dice::Dice;
use phasefront_io::ldi::Ldi;
use phasefront_io::{Error, Result, metrics};
use serde::Serialize;

/// The shape, (H, W), of the depth sensor, which is ARKit's.
pub const SENSOR: (usize, usize) = (192, 256);
/// The number of display pixels along each side of a sensor pixel.
pub const RATIO: usize = 4;

/// The faults of a simulated depth sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SensorFaults {
    /// The name in tables.
    pub name: &'static str,
    /// The standard deviation of the noise of each reading, as a fraction of the volume's depth.
    pub noise: f32,
    /// The shift of depth from colour, right and down, in display pixels.
    pub shift: usize,
    /// Whether readings are missing: 40 % of those at edges, and those in blobs.
    pub holes: bool,
}

/// The faults in the study: only the sensor's resolution, with each fault, and with all faults.
pub const SENSOR_FAULTS: [SensorFaults; 5] = [
    SensorFaults {
        name: "256×192",
        noise: 0.0,
        shift: 0,
        holes: false,
    },
    SensorFaults {
        name: "+ noise",
        noise: 0.005,
        shift: 0,
        holes: false,
    },
    SensorFaults {
        name: "+ holes",
        noise: 0.0,
        shift: 0,
        holes: true,
    },
    SensorFaults {
        name: "+ shift",
        noise: 0.0,
        shift: 3,
        holes: false,
    },
    SensorFaults {
        name: "all",
        noise: 0.005,
        shift: 3,
        holes: true,
    },
];

/// The depth difference, as a fraction of the volume, above which two readings belong to different surfaces.
const EDGE: f32 = 0.1;
/// The share of readings at edges that are missing.
const EDGE_HOLES: f64 = 0.4;
/// The number of readings per missing blob, and the radius of a blob in readings.
const READINGS_A_BLOB: usize = 4096;
const BLOB_RADIUS: f64 = 7.0;

/// Simulates a reading of `depth`, (4h, 4w), by a sensor of (h, w). Missing readings are NaN.
pub fn simulate_sensor(depth: ArrayView2<'_, f32>, how: &SensorFaults, seed: u64) -> Array2<f32> {
    let (height, width) = depth.dim();
    let (h, w) = (height / RATIO, width / RATIO);
    let mut dice = Dice::new(seed);
    let mut readings = Array2::from_shape_fn((h, w), |(y, x)| {
        let mut sum = 0.0;
        for dy in 0..RATIO {
            for dx in 0..RATIO {
                let y = (y * RATIO + dy).saturating_sub(how.shift);
                let x = (x * RATIO + dx).saturating_sub(how.shift);
                sum += depth[(y, x)];
            }
        }
        sum / (RATIO * RATIO) as f32
    });
    let clean = readings.clone();
    for value in &mut readings {
        *value = (*value + how.noise * normal(&mut dice)).clamp(0.0, 1.0);
    }
    if how.holes {
        for y in 0..h {
            for x in 0..w {
                let rows = y.saturating_sub(1)..(y + 2).min(h);
                let around = rows.flat_map(|y| (x.saturating_sub(1)..(x + 2).min(w)).map(move |x| (y, x)));
                let (least, most) =
                    around.fold((f32::MAX, f32::MIN), |(a, b), at| (a.min(clean[at]), b.max(clean[at])));
                if most - least > EDGE && dice.chance(EDGE_HOLES) {
                    readings[(y, x)] = f32::NAN;
                }
            }
        }
        for _ in 0..(h * w).div_ceil(READINGS_A_BLOB) {
            let (y0, x0) = (dice.range(0.0, h as f64), dice.range(0.0, w as f64));
            for ((y, x), value) in readings.indexed_iter_mut() {
                if (y as f64 - y0).hypot(x as f64 - x0) < BLOB_RADIUS {
                    *value = f32::NAN;
                }
            }
        }
    }
    readings
}

/// Returns an approximately normal number of deviation 1: the sum of twelve uniform numbers.
fn normal(dice: &mut Dice) -> f32 {
    (0..12).map(|_| dice.unit()).sum::<f64>() as f32 - 6.0
}

/// Fills holes with the nearest reading, then enlarges bilinearly.
pub fn enlarge(readings: &Array2<f32>) -> Result<Array2<f32>> {
    let mut filled = readings.clone();
    fill_nearest(&mut filled)?;
    let (h, w) = filled.dim();
    let place = |o: usize, n: usize| {
        let at = ((o as f32 + 0.5) / RATIO as f32 - 0.5).clamp(0.0, (n - 1) as f32);
        (at as usize, (at as usize + 1).min(n - 1), at.fract())
    };
    Ok(Array2::from_shape_fn((h * RATIO, w * RATIO), |(y, x)| {
        let ((y0, y1, dy), (x0, x1, dx)) = (place(y, h), place(x, w));
        let across = |y: usize| filled[(y, x0)] * (1.0 - dx) + filled[(y, x1)] * dx;
        across(y0) * (1.0 - dy) + across(y1) * dy
    }))
}

/// Refines the readings with the core along the edges of `rgb`, (3, 4h, 4w).
pub fn refine(readings: &Array2<f32>, rgb: &Array3<f32>) -> Result<Array2<f32>> {
    let (_, height, width) = rgb.dim();
    let shape = readings.dim();
    let plan = Refiner::new(shape, Crop::cover(shape, (height, width)), (height, width))?;
    let confidence = readings.mapv(|d| if d.is_nan() { 0.0 } else { 1.0 });
    let mut refined = Array2::zeros((height, width));
    plan.refine(
        readings.as_slice().expect("standard layout"),
        confidence.as_slice().expect("standard layout"),
        rgb.as_slice().expect("standard layout"),
        refined.as_slice_mut().expect("standard layout"),
        &mut plan.scratch(),
    )?;
    Ok(refined)
}

/// The quality of holograms of one kind of depth compared with the truth, as means over the scenes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The method that made the hologram.
    pub method: String,
    /// The name of the sensor's faults, or "none" for the rendered depth.
    pub faults: &'static str,
    /// "rendered", "bilinear" or "refined".
    pub depth: &'static str,
    /// The PSNR of the midpoint hologram's amplitude, in dB.
    pub psnr: f64,
    /// The SSIM of the midpoint hologram's amplitude.
    pub ssim: f64,
    /// The share of pixels whose depth differs by more than 0.05 of the volume.
    pub wrong_depth: f64,
}

/// Runs the study on `scenes` random scenes, starting from `seed`. `done` is called after each hologram, [`work`] times
/// in total.
///
/// # Errors
/// Returns an error if there are no scenes or a method fails.
pub fn study(
    scenes: usize,
    seed: u64,
    planes: usize,
    display: &Display,
    methods: &[(String, Method)],
    done: &dyn Fn(),
) -> Result<Vec<Row>> {
    if scenes == 0 {
        return Err(Error::Input("a study needs at least one scene".into()));
    }
    let shape = (SENSOR.0 * RATIO, SENSOR.1 * RATIO);
    let plans = (methods.iter())
        .map(|(name, method)| Ok((name, MethodPlan::new(shape.0, shape.1, method.clone(), display)?)))
        .collect::<Result<Vec<_>>>()?;
    let mut rows: Vec<Row> = Vec::new();
    for scene in 0..scenes as u64 {
        let seed = seed + scene;
        let random = scene::random_scene(seed, shape.0, shape.1);
        let ldi = scene::render_ldi_reference(&random, shape.0, shape.1, 5)?.quantized();
        let truth = sm_lbm::hologram(&ldi, display, planes, &|_, _| {})?.mapv(|v| v.norm());
        done();
        let (rgb, rendered) = front(&ldi);
        let mut kinds = vec![("none", "rendered", rendered.clone())];
        for how in &SENSOR_FAULTS {
            let readings = simulate_sensor(rendered.view(), how, seed);
            kinds.push((how.name, "bilinear", enlarge(&readings)?));
            kinds.push((how.name, "refined", refine(&readings, &rgb)?));
        }
        let mut of_scene = Vec::new();
        for (name, plan) in &plans {
            let mut scratch = plan.scratch();
            let mut field = Array3::<Complex32>::zeros((3, shape.0, shape.1));
            for (faults, kind, depth) in &kinds {
                let frame = RgbdFrame::new(rgb.clone(), depth.clone())?;
                let values = field.as_slice_mut().expect("standard layout");
                plan.field(&frame, values, &mut scratch)?;
                let alike = metrics::compare(field.mapv(|v| v.norm()).view(), truth.view())?;
                let wrong = (depth.iter().zip(&rendered)).filter(|(a, b)| (**a - **b).abs() > 0.05);
                of_scene.push(Row {
                    method: (*name).clone(),
                    faults,
                    depth: kind,
                    psnr: alike.psnr_overall / scenes as f64,
                    ssim: alike.ssim_overall / scenes as f64,
                    wrong_depth: wrong.count() as f64 / (depth.len() * scenes) as f64,
                });
                done();
            }
        }
        match rows.is_empty() {
            true => rows = of_scene,
            false => {
                for (sum, row) in rows.iter_mut().zip(of_scene) {
                    sum.psnr += row.psnr;
                    sum.ssim += row.ssim;
                    sum.wrong_depth += row.wrong_depth;
                }
            }
        }
    }
    Ok(rows)
}

/// Returns the number of holograms of [`study`].
pub fn work(scenes: usize, methods: usize) -> usize {
    scenes * (1 + methods * (1 + 2 * SENSOR_FAULTS.len()))
}

/// Returns colour and depth of the visible layer. Pixels without a surface are black and farthest.
pub(crate) fn front(ldi: &Ldi) -> (Array3<f32>, Array2<f32>) {
    let layer = &ldi.layers[0];
    let seen = |y: usize, x: usize| !layer.depth[(y, x)].is_nan();
    let rgb = Array3::from_shape_fn(layer.rgb.dim(), |(c, y, x)| match seen(y, x) {
        true => layer.rgb[(c, y, x)],
        false => 0.0,
    });
    (rgb, layer.depth.mapv(|d| if d.is_nan() { 1.0 } else { d }))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn steps() -> (Array2<f32>, Array3<f32>) {
        let (h, w) = (40 * RATIO, 50 * RATIO);
        let disc = |y: usize, x: usize| (y as f32 - 80.0).hypot(x as f32 - 90.0) < 45.0;
        let depth = Array2::from_shape_fn((h, w), |(y, x)| if disc(y, x) { 0.3 } else { 0.7 });
        let rgb = Array3::from_shape_fn((3, h, w), |(c, y, x)| match disc(y, x) {
            true => [0.9, 0.6, 0.2][c],
            false => [0.1, 0.3, 0.4][c],
        });
        (depth, rgb)
    }

    #[test]
    fn each_fault_is_what_it_says() {
        let (depth, _) = steps();
        let plain = simulate_sensor(depth.view(), &SENSOR_FAULTS[0], 1);
        assert!((plain[(5, 5)] - 0.7).abs() < 1e-6);
        assert!((plain[(20, 22)] - 0.3).abs() < 1e-6);
        let noisy = simulate_sensor(depth.view(), &SENSOR_FAULTS[1], 1);
        let spread = (noisy.iter().zip(&plain)).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
        assert!(((spread / 2000.0).sqrt() - 0.005).abs() < 5e-4);
        let holes = simulate_sensor(depth.view(), &SENSOR_FAULTS[2], 1);
        let missing = holes.iter().filter(|d| d.is_nan()).count();
        assert!((80..400).contains(&missing), "{missing}");
        let shifted = simulate_sensor(depth.view(), &SENSOR_FAULTS[3], 1);
        // The reading farther right sees the disc's left edge, at pixel 45.
        assert!(shifted[(20, 11)] > plain[(20, 11)]);
        assert_eq!(simulate_sensor(depth.view(), &SENSOR_FAULTS[4], 2).len(), 2000);
    }

    #[test]
    fn refined_depth_is_nearer_to_the_truth_than_enlarged_depth() {
        let (depth, rgb) = steps();
        for how in &SENSOR_FAULTS {
            let readings = simulate_sensor(depth.view(), how, 3);
            let wrong = |made: Array2<f32>| {
                made.iter()
                    .zip(&depth)
                    .filter(|(a, b)| (**a - **b).abs() > 0.05)
                    .count()
            };
            let (plain, refined) = (
                wrong(enlarge(&readings).unwrap()),
                wrong(refine(&readings, &rgb).unwrap()),
            );
            assert!(refined * 3 < plain, "{}: {plain} {refined}", how.name);
        }
    }
}
