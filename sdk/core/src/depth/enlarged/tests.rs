#![allow(clippy::unwrap_used)]
use super::*;
use crate::depth::camera::CameraFrame;
use crate::depth::condition::Conditioner;
use crate::depth::image::{DepthFormat, DepthImage};
use crate::depth::stream::{DepthOptions, DepthStream};
use crate::frame::{ColourFormat, ColourImage, Crop, Plane};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SIZE: Size = Size {
    width: 240,
    height: 192,
};

/// Returns tilted ellipses before a sloping wall, in millimetres.
fn scene(size: Size, seed: u64) -> Array2<f32> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (w, h) = (size.width as f32, size.height as f32);
    let mut depth = Array2::from_shape_fn(size.shape(), |(y, x)| {
        3000.0 - 400.0 * x as f32 / w + 200.0 * y as f32 / h
    });
    for _ in 0..25 {
        let (x0, y0) = (random.random_range(0.0..w), random.random_range(0.0..h));
        let (a, b) = (random.random_range(0.04..0.2) * w, random.random_range(0.04..0.2) * h);
        let (near, slope) = (random.random_range(800.0..2500.0), random.random_range(-2.0..2.0));
        for ((y, x), d) in depth.indexed_iter_mut() {
            let (dx, dy) = (x as f32 - x0, y as f32 - y0);
            if (dx / a).powi(2) + (dy / b).powi(2) < 1.0 {
                *d = d.min(near + slope * (dx - dy));
            }
        }
    }
    depth
}

/// Enlarges `readings` to `size` as the documentation of image programs says, independently of [`Fit`].
fn enlarge(readings: &Array2<f32>, size: Size, by: Enlarging, a: f64) -> Array2<f32> {
    let (h, w) = readings.dim();
    let weight = |t: f64| {
        let t = t.abs();
        match by {
            Enlarging::Nearest => f64::from(u8::from((-0.5..0.5).contains(&t))),
            Enlarging::Bilinear => (1.0 - t).max(0.0),
            Enlarging::Bicubic if t < 1.0 => (a + 2.0) * t.powi(3) - (a + 3.0) * t * t + 1.0,
            Enlarging::Bicubic if t < 2.0 => a * (t.powi(3) - 5.0 * t * t + 8.0 * t - 4.0),
            Enlarging::Bicubic => 0.0,
        }
    };
    Array2::from_shape_fn(size.shape(), |(y, x)| {
        let place = |at: usize, pixels: usize, cells: usize| (at as f64 + 0.5) * cells as f64 / pixels as f64 - 0.5;
        let (py, px) = (place(y, size.height, h), place(x, size.width, w));
        if by == Enlarging::Nearest {
            return readings[((py + 0.5 + 1e-9) as usize, (px + 0.5 + 1e-9) as usize)];
        }
        let near = |place: f64| (place.floor() as isize - 1)..=(place.floor() as isize + 2);
        let mut sum = 0.0;
        for j in near(py) {
            for i in near(px) {
                let at = (j.clamp(0, h as isize - 1) as usize, i.clamp(0, w as isize - 1) as usize);
                sum += weight(py - j as f64) * weight(px - i as f64) * f64::from(readings[at]);
            }
        }
        sum as f32
    })
}

fn grid(factor: f64) -> Size {
    Size {
        width: (SIZE.width as f64 / factor).round() as usize,
        height: (SIZE.height as f64 / factor).round() as usize,
    }
}

const WAYS: [(Enlarging, f64); 4] = [
    (Enlarging::Nearest, 0.0),
    (Enlarging::Bilinear, 0.0),
    (Enlarging::Bicubic, -0.5),
    (Enlarging::Bicubic, -0.75),
];

/// By 2, the cubic map with a = −½ makes the pixels that the linear map makes of sharper readings.
fn is_ambiguous(factor: f64, a: f64) -> bool {
    factor == 2.0 && a == -0.5
}

#[test]
fn factor_and_way_are_found_and_the_readings_come_back() {
    for factor in [2.0, 3.0, 4.0, 6.0] {
        let readings = scene(grid(factor), 3);
        for (by, a) in WAYS {
            let found = find(enlarge(&readings, SIZE, by, a).view()).unwrap();
            if is_ambiguous(factor, a) {
                assert_eq!((found.factor, found.by), (factor, Enlarging::Bilinear));
                continue;
            }
            assert_eq!(
                (found.factor, found.by, found.grid),
                (factor, by, grid(factor)),
                "{by:?} {a}"
            );
            let back = found.readings(enlarge(&readings, SIZE, by, a).view());
            let apart = back
                .iter()
                .zip(&readings)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f32::max);
            assert!(apart < 1.0, "{factor} {by:?} {a}: {apart} mm");
        }
    }
}

#[test]
fn noise_and_rounding_hide_nothing() {
    let mut random = ChaCha8Rng::seed_from_u64(8);
    for factor in [2.0, 4.0] {
        let readings = scene(grid(factor), 4);
        for (by, a) in WAYS {
            let clean = enlarge(&readings, SIZE, by, a);
            let rounded = clean.mapv(|d| (d / 13.0).round());
            let noisy = clean.mapv(|d| d + random.random_range(-20.0..20.0f32));
            for (depth, what) in [(rounded, "8 bits"), (noisy, "noise")] {
                let found = find(depth.view()).map(|found| (found.factor, found.by));
                let by = if is_ambiguous(factor, a) {
                    Enlarging::Bilinear
                } else {
                    by
                };
                assert_eq!(found, Some((factor, by)), "{a} {what}");
            }
        }
    }
}

#[test]
fn holes_stay_holes_and_do_not_spread() {
    let mut readings = scene(grid(4.0), 5);
    for i in 0..8 {
        readings[(5 + 5 * i, 3 + 7 * i)] = f32::NAN;
    }
    let holes = readings.mapv(|d| d.is_nan());
    let depth = enlarge(&readings, SIZE, Enlarging::Nearest, 0.0);
    let found = find(depth.view()).unwrap();
    let back = found.readings(depth.view());
    assert_eq!(back.mapv(|d| d.is_nan()), holes);
    assert!(
        back.iter()
            .zip(&readings)
            .all(|(a, b)| b.is_nan() || (a - b).abs() < 0.5)
    );
    // Files may have 0 where there is no reading, and programs mix it with the readings beside it.
    let zeros = readings.mapv(|d| if d.is_nan() { 0.0 } else { d });
    let depth = enlarge(&zeros, SIZE, Enlarging::Bilinear, 0.0).mapv(f32::round);
    let back = find(depth.view()).unwrap().readings(depth.view());
    assert_eq!(back.mapv(|d| d == 0.0), holes);
}

#[test]
fn depth_of_full_resolution_is_none() {
    let soft = |depth: &Array2<f32>, reach: isize| {
        let (h, w) = depth.dim();
        Array2::from_shape_fn((h, w), |(y, x)| {
            let near = |at: usize, d: isize, n: usize| (at as isize + d).clamp(0, n as isize - 1) as usize;
            let places = (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dy, dx)));
            let sum: f32 = places.map(|(dy, dx)| depth[(near(y, dy, h), near(x, dx, w))]).sum();
            sum / ((2 * reach + 1) * (2 * reach + 1)) as f32
        })
    };
    let mut random = ChaCha8Rng::seed_from_u64(9);
    for seed in 20..32 {
        let clean = scene(SIZE, seed);
        let noisy = clean.mapv(|d| d + random.random_range(-20.0..20.0f32));
        let variants = [
            soft(&clean, 1),
            soft(&clean, 2),
            clean.mapv(|d| (d / 13.0).round()),
            noisy,
            clean,
        ];
        for (i, depth) in variants.iter().enumerate() {
            assert_eq!(find(depth.view()), None, "scene {seed}, variant {i}");
        }
    }
    // Boxes whose sides happen to lie on a grid are too few to tell.
    let boxes = Array2::from_shape_fn(SIZE.shape(), |(y, x)| match (y / 64, x / 80) {
        (1, 1) => 1000.0,
        (2, 0) => 1500.0,
        _ => 3000.0,
    });
    for depth in [
        boxes,
        Array2::from_elem(SIZE.shape(), 2.0),
        Array2::from_elem((5, 5), 1.0),
    ] {
        assert_eq!(find(depth.view()), None);
    }
    assert_eq!(find(Array2::from_elem(SIZE.shape(), f32::NAN).view()), None);
}

/// Read on its grid, enlarged depth conditions as the sensor's own readings do.
#[test]
fn what_was_enlarged_conditions_as_the_sensors_own_readings() {
    let factor = 4.0;
    let readings = scene(grid(factor), 6).mapv(|d| (d - 700.0) / 3000.0);
    let depth = enlarge(&readings, SIZE, Enlarging::Bilinear, 0.0);
    let found = find(depth.view()).unwrap();
    let rgb: Vec<f32> = (0..3).flat_map(|_| depth.iter().copied()).collect();
    let conditioned = |readings: &Array2<f32>| {
        let size = Size::from_shape(readings.dim());
        let plan = Conditioner::new(size, Crop::cover(size, size), SIZE, false).unwrap();
        let mut to = vec![0.0; SIZE.pixels()];
        let values: Vec<f32> = readings.iter().copied().collect();
        plan.condition(&values, &rgb, &mut to, &mut plan.scratch()).unwrap();
        to
    };
    let (a, b) = (conditioned(&readings), conditioned(&found.readings(depth.view())));
    let apart = a.iter().zip(&b).filter(|(a, b)| (*a - *b).abs() > 0.001).count();
    assert!(apart < SIZE.pixels() / 1000, "{apart} pixels differ");
}

/// A session's frames of enlarged depth have the depth that frames of the sensor's own readings have.
#[test]
fn a_stream_reads_enlarged_depth_on_its_grid() {
    let readings = scene(grid(4.0), 7).mapv(f32::round);
    let colours: Vec<u8> = (0..3 * SIZE.pixels()).map(|i| (i * 7 % 251) as u8).collect();
    let rgb: Vec<f32> = colours.iter().map(|v| f32::from(*v) / 255.0).collect();
    let mut stream = DepthStream::new(DepthOptions::default(), SIZE).unwrap();
    let mut conditioned = |depth: &Array2<f32>| {
        let size = Size::from_shape(depth.dim());
        let words: Vec<u8> = depth.iter().flat_map(|d| (*d as u16).to_le_bytes()).collect();
        let plane = Plane::new(&words, 2 * size.width, 2);
        let image = DepthImage::new(DepthFormat::MillimetresU16, size, plane).unwrap();
        let plane = Plane::new(&colours, 3 * SIZE.width, 3);
        let colour = ColourImage::new(ColourFormat::Rgb, SIZE, &[plane]).unwrap();
        let mut to = vec![0.0; SIZE.pixels()];
        let frame = CameraFrame::new(0, colour, image);
        let report = stream.next(&frame, None, &rgb, &mut to).unwrap();
        (report.enlarged.map(|found| (found.factor, found.by)), to)
    };
    let (nothing, own) = conditioned(&readings);
    assert_eq!(nothing, None);
    for by in [Enlarging::Nearest, Enlarging::Bilinear] {
        let (found, enlarged) = conditioned(&enlarge(&readings, SIZE, by, 0.0).mapv(f32::round));
        assert_eq!(found, Some((4.0, by)));
        let apart = own
            .iter()
            .zip(&enlarged)
            .filter(|(a, b)| (*a - *b).abs() > 0.005)
            .count();
        assert!(apart < SIZE.pixels() / 200, "{by:?}: {apart} pixels differ");
    }
    // The next frame, without a past, has its full resolution.
    let (nothing, _) = conditioned(&scene(SIZE, 8));
    assert_eq!(nothing, None);
}

/// What a program cut off, because a bicubic map swings beyond the numbers of a file, may hide the grid, but does not
/// spoil its readings.
#[test]
fn overshoots_that_were_cut_off_are_read_past() {
    let levels = |d: &f32| ((d - 900.0) / 1700.0 * 255.0).round().clamp(0.0, 255.0);
    let mut missed = 0;
    for factor in [3.0, 4.0, 6.0] {
        for seed in 10..14 {
            // The wall and the nearest discs lie at the ends of 8 bits.
            let readings = scene(grid(factor), seed).map(levels);
            for a in [-0.5, -0.75] {
                let depth = enlarge(&readings, SIZE, Enlarging::Bicubic, a).mapv(|d| d.round().clamp(0.0, 255.0));
                let found = find(depth.view());
                let Some(found) = found.filter(|found| found.by == Enlarging::Bicubic) else {
                    missed += 1;
                    continue;
                };
                assert_eq!(found.factor, factor, "{seed} {a}");
                let back = found.readings(depth.view());
                let apart = back.iter().zip(&readings).filter(|(a, b)| (*a - *b).abs() > 3.0);
                let share = apart.count() as f64 / readings.len() as f64;
                assert!(share < 0.01, "{factor} {seed} {a}: {share}");
            }
        }
    }
    assert!(missed <= 12, "{missed} of 24");
}

/// Masks, and depth of full resolution that lies at both ends of its numbers, are not taken for what was cut off.
#[test]
fn depth_at_the_ends_of_its_numbers_is_none() {
    for seed in 40..52 {
        let clean = scene(SIZE, seed);
        for (low, range) in [(900.0, 1700.0), (1500.0, 600.0), (1990.0, 20.0)] {
            let levels = clean.mapv(|d| ((d - low) / range * 255.0).round().clamp(0.0, 255.0));
            assert_eq!(find(levels.view()), None, "{seed} {low}");
        }
    }
}
