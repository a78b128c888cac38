//! Tests the simulated sensors: their resolution, noise, holes and confidence, and the depth that sessions make of
//! them.
use clap::ValueEnum;
use ndarray::{Array2, Array3};
use phasefront_lab::sensor::coarse::{Coarse, Sampling};
use phasefront_lab::sensor::{FAR_M, NEAR_M, Reading, Sensor, kinect, lidar, stereo};

const SIZE: usize = 256;
const NEAR: f32 = 0.2;
const FAR: f32 = 0.8;

/// A square in front of a wall.
fn square() -> Array2<f32> {
    Array2::from_shape_fn((SIZE, SIZE), |(y, x)| if is_inside(y, x) { NEAR } else { FAR })
}

fn is_inside(y: usize, x: usize) -> bool {
    (96..160).contains(&y) && (96..160).contains(&x)
}

fn colours() -> Array3<f32> {
    Array3::from_shape_fn((3, SIZE, SIZE), |(c, y, x)| match is_inside(y, x) {
        true => [0.9, 0.6, 0.2][c],
        false => [0.1, 0.3, 0.4][c],
    })
}

fn flat(d: f32) -> Array2<f32> {
    Array2::from_elem((SIZE, SIZE), d)
}

/// Returns the mean and the standard deviation of the readings.
fn moments(reading: &Reading) -> (f64, f64) {
    let values: Vec<f64> = reading
        .depth
        .iter()
        .filter(|d| !d.is_nan())
        .map(|d| f64::from(*d))
        .collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let square = values.iter().map(|d| (d - mean) * (d - mean)).sum::<f64>();
    (mean, (square / values.len() as f64).sqrt())
}

/// Returns (x, y) of the readings, in fractions of the frame, for which `is` holds.
fn places(reading: &Reading, is: impl Fn(f32) -> bool) -> Vec<(f64, f64)> {
    let (h, w) = reading.depth.dim();
    let found = reading.depth.indexed_iter().filter(|(_, d)| is(**d));
    found
        .map(|((y, x), _)| ((x as f64 + 0.5) / w as f64, (y as f64 + 0.5) / h as f64))
        .collect()
}

#[test]
fn a_seed_is_one_reading_of_the_sensors_size() {
    for sensor in Sensor::value_variants() {
        let (side, confident) = match sensor {
            Sensor::CoarseBilinear | Sensor::CoarseNearest => (64, false),
            Sensor::HalfBilinear => (128, false),
            Sensor::Noise | Sensor::Stereo => (256, false),
            Sensor::Lidar => (64, true),
            Sensor::Arcore => (40, false),
            Sensor::Kinect => (160, false),
            Sensor::Monocular => (112, false),
        };
        let read = |seed| sensor.read(square().view(), seed);
        let reading = read(3);
        assert_eq!(reading.depth.dim(), (side, side), "{sensor:?}");
        assert_eq!(reading.confidence.is_some(), confident, "{sensor:?}");
        let bits = |reading: &Reading| reading.depth.mapv(f32::to_bits);
        assert_eq!(bits(&reading), bits(&read(3)), "{sensor:?}");
        assert_ne!(bits(&reading), bits(&read(4)), "{sensor:?}");
        assert!(sensor.read(Array2::from_elem((3, 7), 0.4).view(), 1).depth.len() <= 21);
    }
}

/// The noise of a flat surface is the stated one. Relative to the volume: a distance's error over the range of
/// distances.
#[test]
fn noise_has_the_stated_level() {
    let range = FAR_M - NEAR_M;
    let metres = |d: f32| NEAR_M + d * range;
    for d in [0.1f32, 0.9] {
        let of_kinect = kinect::STEP * metres(d) * metres(d) / range;
        for (sensor, least, most) in [
            (Sensor::CoarseBilinear, 0.005, 0.005),
            (Sensor::CoarseNearest, 0.01, 0.01),
            (Sensor::HalfBilinear, 0.003, 0.003),
            (Sensor::Noise, 0.005, 0.005),
            (
                Sensor::Lidar,
                lidar::NOISE * metres(d) / range,
                lidar::NOISE * metres(d) / range,
            ),
            // The smoothing divides white noise of deviation 1 by 2√π.
            (
                Sensor::Arcore,
                0.01 * metres(d).powi(2) / range / 3.545,
                0.01 * metres(d).powi(2) / range / 3.545,
            ),
            // Rounding adds to half a step of noise.
            (Sensor::Kinect, 0.5 * of_kinect, 0.65 * of_kinect),
        ] {
            let (mean, deviation) = moments(&sensor.read(flat(d).view(), 7));
            assert!((mean - f64::from(d)).abs() < 2e-3, "{sensor:?} {mean}");
            let [least, most] = [0.85 * least, 1.15 * most].map(f64::from);
            assert!(
                (least..most).contains(&deviation),
                "{sensor:?} at {d}: {deviation} not in {least}..{most}"
            );
        }
    }
    let noise = |d| moments(&Sensor::Stereo.read(flat(d).view(), 7)).1;
    assert!(noise(0.9) > 4.0 * noise(0.1), "{} {}", noise(0.9), noise(0.1));
}

#[test]
fn depth_is_shifted_and_mixed_as_stated() {
    let read = |ratio, sampling, shift| {
        let sensor = Coarse {
            ratio,
            sampling,
            shift,
            noise: 0.0,
            holes: false,
        };
        sensor.read(square().view(), 1).depth
    };
    let shifted = read(1.0, Sampling::Nearest, [1, -3]);
    assert!(
        shifted
            .indexed_iter()
            .all(|((y, x), d)| (*d == NEAR) == (x > 0 && is_inside(y + 3, x - 1)))
    );
    let (mean, nearest) = (read(4.0, Sampling::Mean, [2, 2]), read(4.0, Sampling::Nearest, [2, 2]));
    assert!((mean[(30, 24)] - 0.5).abs() < 1e-6 && (mean[(30, 25)] - NEAR).abs() < 1e-6);
    assert!(nearest.iter().all(|d| [NEAR, FAR].contains(d)));
}

/// Shadows lie to the left of near surfaces, and are as wide as the difference of disparities.
#[test]
fn stereo_and_kinect_have_shadows_on_one_side() {
    for (sensor, baseline_m, degrees) in [(Sensor::Stereo, 0.05, 87.0f64), (Sensor::Kinect, 0.075, 57.0)] {
        let holes = places(&sensor.read(square().view(), 1), f32::is_nan);
        let row = |low: f64, high: f64| {
            let found = holes
                .iter()
                .filter(|(x, y)| (0.45..0.55).contains(y) && (low..high).contains(x));
            found.count() as f64 / holes.iter().filter(|(_, y)| (0.45..0.55).contains(y)).count() as f64
        };
        let inverse = |d: f32| 1.0 / f64::from(NEAR_M + d * (FAR_M - NEAR_M));
        let focal = 0.5 / (0.5 * degrees.to_radians()).tan();
        let width = baseline_m * focal * (inverse(NEAR) - inverse(FAR));
        // The square's left edge is at 0.375.
        let shadow = holes
            .iter()
            .filter(|(x, y)| (0.375 - width..0.36).contains(x) && (0.45..0.55).contains(y));
        let (side, rows) = if sensor == Sensor::Stereo {
            (256.0, 26)
        } else {
            (160.0, 16)
        };
        let expected = (width - 0.015) * side * f64::from(rows);
        assert!(shadow.count() as f64 > 0.7 * expected, "{sensor:?}: {holes:?}");
        // The Kinect also loses readings at the other edges.
        assert!(
            row(0.3, 0.4) > 3.0 * row(0.6, 0.7),
            "{sensor:?}: {} {}",
            row(0.3, 0.4),
            row(0.6, 0.7)
        );
    }
    // Near surfaces are too wide.
    let reading = Sensor::Stereo.read(square().view(), 1);
    let above = reading.depth[(96 - stereo::FATTENING_PX, 128)];
    assert!((above - NEAR).abs() < 0.02 && reading.depth[(92, 128)] > 0.7);
}

#[test]
fn the_lidar_is_not_confident_at_edges() {
    // Readings cover two surfaces, because the edges do not lie between readings.
    let shifted = Array2::from_shape_fn((SIZE, SIZE), |(y, x)| if is_inside(y + 2, x + 2) { NEAR } else { FAR });
    let reading = Sensor::Lidar.read(shifted.view(), 1);
    let confidence = reading.confidence.unwrap();
    assert_eq!(
        [(30, 23), (30, 22), (30, 21), (30, 30)].map(|at| confidence[at]),
        [0, 1, 2, 2]
    );
    assert!(reading.depth.iter().all(|d| !d.is_nan()));
}

#[test]
fn arcore_and_networks_have_soft_edges() {
    for (sensor, scale) in [(Sensor::Arcore, 1.0), (Sensor::Monocular, f32::NAN)] {
        let reading = sensor.read(square().view(), 1);
        let side = reading.depth.dim().0;
        let row = reading.depth.row(side / 2);
        let (near, far) = (row[side / 2], row[side / 8]);
        let between = (0..side / 2).filter(|x| {
            let t = (row[*x] - near) / (far - near);
            (0.15..0.85).contains(&t)
        });
        assert!(between.count() >= 2, "{sensor:?}: {row}");
        assert_eq!(reading.relative, scale.is_nan());
    }
}

#[test]
fn sessions_make_depth_of_every_reading() {
    for sensor in Sensor::value_variants() {
        let depth = sensor.read(square().view(), 2).session_depth(&colours()).unwrap();
        assert_eq!(depth.dim(), (SIZE, SIZE));
        let wrong = depth
            .iter()
            .zip(&square())
            .filter(|(a, b)| (**a - **b).abs() > 0.1)
            .count();
        // Relative depth is stretched to the whole range, so only its order is known.
        if *sensor == Sensor::Monocular {
            assert!(
                depth[(128, 128)] + 0.5 < depth[(30, 30)],
                "{} {}",
                depth[(128, 128)],
                depth[(30, 30)]
            );
        } else {
            assert!(wrong < SIZE * SIZE / 20, "{sensor:?}: {wrong}");
        }
    }
}
