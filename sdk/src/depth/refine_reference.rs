//! The refinement of depth, naively: every pixel by itself, from its definition. The oracle of [`super::refine`], where
//! the definition stands in words.

use super::refine::{
    CLEAN_COLOUR_SIGMA, CLEAN_REACH, CLEAN_SIGMA, FILL_PASSES, LEAST_CLOSENESS, TOLERANCE,
    UP_COLOUR_SIGMA, UP_SIGMA,
};
use crate::frame::Crop;
use ndarray::{Array2, ArrayView2, ArrayView3};

/// `depth`, (h, w) with NaN for no reading and at least one reading, of `confidence`, (h, w), of which `crop` is shown,
/// refined along the edges of `rgb`, (3, H, W): (H, W).
pub fn refine(
    depth: ArrayView2<'_, f32>,
    confidence: ArrayView2<'_, f32>,
    crop: Crop,
    rgb: ArrayView3<'_, f32>,
) -> Array2<f32> {
    let (height, width) = depth.dim();
    let (_, out_height, out_width) = rgb.dim();
    // Display pixel o of an axis lies at this place, in readings.
    let place = |o: usize, from: f64, length: f64, out: usize| {
        from + (o as f64 + 0.5) * length / out as f64 - 0.5
    };
    let cell = |place: f64, cells: usize| place.round().clamp(0.0, cells as f64 - 1.0) as usize;
    let place_x = |x| place(x, crop.x, crop.width, out_width);
    let place_y = |y| place(y, crop.y, crop.height, out_height);
    // The display pixels of a reading; where it has none, the first behind it or the last of all.
    let pixels = |reading: usize, cells: usize, out: usize, place: &dyn Fn(usize) -> f64| {
        let of: Vec<usize> = (0..out)
            .filter(|o| cell(place(*o), cells) == reading)
            .collect();
        match of.is_empty() {
            true => vec![
                (0..out)
                    .find(|o| cell(place(*o), cells) > reading)
                    .unwrap_or(out - 1),
            ],
            false => of,
        }
    };
    let guide = Array2::from_shape_fn((height, width), |(y, x)| {
        let (rows, columns) = (
            pixels(y, height, out_height, &place_y),
            pixels(x, width, out_width, &place_x),
        );
        [0, 1, 2].map(|c| {
            let sum: f64 = (rows.iter())
                .flat_map(|y| columns.iter().map(|x| f64::from(rgb[(c, *y, *x)])))
                .sum();
            sum / (rows.len() * columns.len()) as f64
        })
    });
    let clean = |from: &Array2<f32>,
                 confidence: &dyn Fn(usize, usize) -> f64,
                 y: usize,
                 x: usize| {
        let reach = CLEAN_REACH as isize;
        let mut votes = Vec::new();
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let (y2, x2) = (y.wrapping_add_signed(dy), x.wrapping_add_signed(dx));
                if y2 < height && x2 < width && !from[(y2, x2)].is_nan() {
                    let near = gauss((dy * dy + dx * dx) as f64, CLEAN_SIGMA) * confidence(y2, x2);
                    let alike = gauss(apart(guide[(y, x)], guide[(y2, x2)]), CLEAN_COLOUR_SIGMA);
                    votes.push((
                        f64::from(from[(y2, x2)]),
                        near,
                        alike.max(LEAST_CLOSENESS.into()),
                    ));
                }
            }
        }
        match votes.is_empty() {
            true => f32::NAN,
            false => match one_surface(&votes) {
                true => mean(votes.iter().map(|(d, near, _)| (*d, *near))),
                false => surface(votes),
            },
        }
    };
    let depth = depth.to_owned();
    let sure = |y, x| f64::from(confidence[(y, x)]);
    let mut cleaned = Array2::from_shape_fn((height, width), |(y, x)| clean(&depth, &sure, y, x));
    for _ in 0..FILL_PASSES {
        let before = cleaned.clone();
        for ((y, x), value) in cleaned.indexed_iter_mut() {
            if value.is_nan() {
                *value = clean(&before, &|_, _| 1.0, y, x);
            }
        }
    }
    super::fill_nearest(&mut cleaned).expect("there is a reading");
    Array2::from_shape_fn((out_height, out_width), |(y, x)| {
        let (cell_y, cell_x) = (cell(place_y(y), height), cell(place_x(x), width));
        let dy = (place_y(y) - cell_y as f64).clamp(-0.5, 0.5);
        let dx = (place_x(x) - cell_x as f64).clamp(-0.5, 0.5);
        let colour = [0, 1, 2].map(|c| f64::from(rgb[(c, y, x)]));
        let around = |row: isize, column: isize| {
            let y = (cell_y as isize + row).clamp(0, height as isize - 1) as usize;
            let x = (cell_x as isize + column).clamp(0, width as isize - 1) as usize;
            (f64::from(cleaned[(y, x)]), guide[(y, x)])
        };
        let mut votes = Vec::new();
        for row in -1..=1 {
            for column in -1..=1 {
                let (depth, guide) = around(row, column);
                let square = (column as f64 - dx).powi(2) + (row as f64 - dy).powi(2);
                let alike = gauss(apart(guide, colour), UP_COLOUR_SIGMA);
                votes.push((
                    depth,
                    gauss(square, UP_SIGMA),
                    alike.max(LEAST_CLOSENESS.into()),
                ));
            }
        }
        if !one_surface(&votes) {
            return surface(votes);
        }
        // Between the four readings around.
        let (row, column) = (dy.signum() as isize, dx.signum() as isize);
        let (dy, dx) = (dy.abs(), dx.abs());
        let sum = around(0, 0).0 * (1.0 - dy) * (1.0 - dx)
            + around(row, 0).0 * dy * (1.0 - dx)
            + around(0, column).0 * (1.0 - dy) * dx
            + around(row, column).0 * dy * dx;
        sum as f32
    })
}

fn gauss(square: f64, sigma: f32) -> f64 {
    (-square / (2.0 * f64::from(sigma).powi(2))).exp()
}

fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

/// Whether all votes, of a depth and two weights, are within the tolerance of each other.
fn one_surface(votes: &[(f64, f64, f64)]) -> bool {
    let least = votes.iter().map(|v| v.0).fold(f64::INFINITY, f64::min);
    let most = votes.iter().map(|v| v.0).fold(f64::NEG_INFINITY, f64::max);
    // Differences of f32 values, as the fast form has them.
    most as f32 - least as f32 <= TOLERANCE
}

fn mean(votes: impl Iterator<Item = (f64, f64)>) -> f32 {
    let (sum, weights) = votes.fold((0.0, 0.0), |(s, n), (v, w)| (s + v * w, n + w));
    (sum / weights) as f32
}

/// The mean of the votes that agree with their weighted median.
fn surface(mut votes: Vec<(f64, f64, f64)>) -> f32 {
    votes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half: f64 = votes.iter().map(|v| v.1 * v.2).sum::<f64>() / 2.0;
    let mut sum = 0.0;
    let median = (votes.iter())
        .find(|v| {
            sum += v.1 * v.2;
            sum >= half
        })
        .map_or(f64::NAN, |v| v.0);
    let agree = |v: &&(f64, f64, f64)| (v.0 as f32 - median as f32).abs() <= TOLERANCE;
    mean(votes.iter().filter(agree).map(|v| (v.0, v.1 * v.2)))
}
