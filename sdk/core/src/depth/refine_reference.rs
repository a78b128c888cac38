//! The definition of the refinement of depth, which [`super::refine`] describes. It computes each pixel separately.
//! Tests compare [`super::refine`] with it.

use super::refine::{
    CLEAN_COLOUR_SIGMA, CLEAN_REACH, CLEAN_SIGMA, FILL_PASSES, LEAST_CLOSENESS, TOLERANCE, UP_COLOUR_SIGMA, UP_SIGMA,
};
use crate::frame::Crop;
use ndarray::{Array2, ArrayView2, ArrayView3};

/// Refines the part `crop` of `depth`, (h, w), with the confidences `confidence`, (h, w), along the edges of `rgb`, (3,
/// H, W), and returns (H, W). `depth` has NaN for no reading and at least one reading.
pub fn refine(
    depth: ArrayView2<'_, f32>,
    confidence: ArrayView2<'_, f32>,
    crop: Crop,
    rgb: ArrayView3<'_, f32>,
) -> Array2<f32> {
    let (_, out_height, out_width) = rgb.dim();
    let (height, width) = depth.dim();
    let rows = Axis {
        from: crop.y,
        length: crop.height,
        readings: height,
        pixels: out_height,
    };
    let columns = Axis {
        from: crop.x,
        length: crop.width,
        readings: width,
        pixels: out_width,
    };
    let guide = guide(rgb, &rows, &columns);
    let depth = depth.to_owned();
    let sure = |y, x| f64::from(confidence[(y, x)]);
    let mut cleaned = Array2::from_shape_fn((height, width), |at| clean(&depth, &sure, &guide, at));
    for _ in 0..FILL_PASSES {
        let before = cleaned.clone();
        for (at, value) in cleaned.indexed_iter_mut() {
            if value.is_nan() {
                *value = clean(&before, &|_, _| 1.0, &guide, at);
            }
        }
    }
    super::fill_nearest(&mut cleaned).expect("there is a reading");
    Array2::from_shape_fn((out_height, out_width), |(y, x)| {
        let (cell_y, cell_x) = (rows.reading(y), columns.reading(x));
        let around = |row: isize, column: isize| {
            let y = (cell_y as isize + row).clamp(0, height as isize - 1) as usize;
            let x = (cell_x as isize + column).clamp(0, width as isize - 1) as usize;
            (f64::from(cleaned[(y, x)]), guide[(y, x)])
        };
        let off = [
            (rows.place(y) - cell_y as f64).clamp(-0.5, 0.5),
            (columns.place(x) - cell_x as f64).clamp(-0.5, 0.5),
        ];
        enlarged(&around, off, [0, 1, 2].map(|c| f64::from(rgb[(c, y, x)])))
    })
}

/// The readings along one side of the display: `length` readings, starting at `from`, for `pixels` display pixels.
struct Axis {
    from: f64,
    length: f64,
    readings: usize,
    pixels: usize,
}

impl Axis {
    /// Returns the position of a display pixel, in readings.
    fn place(&self, pixel: usize) -> f64 {
        self.from + (pixel as f64 + 0.5) * self.length / self.pixels as f64 - 0.5
    }

    fn reading(&self, pixel: usize) -> usize {
        let last = self.readings as f64 - 1.0;
        self.place(pixel).round().clamp(0.0, last) as usize
    }

    /// Returns the display pixels in a reading. If there are none, returns the first pixel after it, or the last of
    /// all.
    fn pixels(&self, reading: usize) -> Vec<usize> {
        let of: Vec<usize> = (0..self.pixels)
            .filter(|pixel| self.reading(*pixel) == reading)
            .collect();
        if !of.is_empty() {
            return of;
        }
        let behind = (0..self.pixels).find(|pixel| self.reading(*pixel) > reading);
        vec![behind.unwrap_or(self.pixels - 1)]
    }
}

/// Computes the mean colour of each reading.
fn guide(rgb: ArrayView3<'_, f32>, rows: &Axis, columns: &Axis) -> Array2<[f64; 3]> {
    Array2::from_shape_fn((rows.readings, columns.readings), |(y, x)| {
        let (rows, columns) = (rows.pixels(y), columns.pixels(x));
        [0, 1, 2].map(|c| {
            let sum: f64 = (rows.iter())
                .flat_map(|y| columns.iter().map(|x| f64::from(rgb[(c, *y, *x)])))
                .sum();
            sum / (rows.len() * columns.len()) as f64
        })
    })
}

/// Returns the depth of a reading from its neighbours, or NaN if none of them is valid.
fn clean(
    from: &Array2<f32>,
    confidence: &dyn Fn(usize, usize) -> f64,
    guide: &Array2<[f64; 3]>,
    (y, x): (usize, usize),
) -> f32 {
    let (height, width) = from.dim();
    let reach = CLEAN_REACH as isize;
    let mut votes = Vec::new();
    for dy in -reach..=reach {
        for dx in -reach..=reach {
            let (y2, x2) = (y.wrapping_add_signed(dy), x.wrapping_add_signed(dx));
            if y2 < height && x2 < width && !from[(y2, x2)].is_nan() {
                let near = gauss((dy * dy + dx * dx) as f64, CLEAN_SIGMA) * confidence(y2, x2);
                let alike = gauss(apart(guide[(y, x)], guide[(y2, x2)]), CLEAN_COLOUR_SIGMA);
                votes.push((f64::from(from[(y2, x2)]), near, alike.max(LEAST_CLOSENESS.into())));
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
}

/// Returns the depth of a display pixel of `colour` at the offset `off`, (y, x), from its reading. `around` returns the
/// depth and the colour of the neighbouring readings.
fn enlarged(around: &dyn Fn(isize, isize) -> (f64, [f64; 3]), [dy, dx]: [f64; 2], colour: [f64; 3]) -> f32 {
    let mut votes = Vec::new();
    for row in -1..=1 {
        for column in -1..=1 {
            let (depth, guide) = around(row, column);
            let square = (column as f64 - dx).powi(2) + (row as f64 - dy).powi(2);
            let alike = gauss(apart(guide, colour), UP_COLOUR_SIGMA);
            votes.push((depth, gauss(square, UP_SIGMA), alike.max(LEAST_CLOSENESS.into())));
        }
    }
    if !one_surface(&votes) {
        return surface(votes);
    }
    // Interpolates between the four readings around the pixel.
    let (row, column) = (dy.signum() as isize, dx.signum() as isize);
    let (dy, dx) = (dy.abs(), dx.abs());
    let sum = around(0, 0).0 * (1.0 - dy) * (1.0 - dx)
        + around(row, 0).0 * dy * (1.0 - dx)
        + around(0, column).0 * (1.0 - dy) * dx
        + around(row, column).0 * dy * dx;
    sum as f32
}

fn gauss(square: f64, sigma: f32) -> f64 {
    (-square / (2.0 * f64::from(sigma).powi(2))).exp()
}

fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

/// Returns whether all votes, each a depth and two weights, lie within the tolerance of each other.
fn one_surface(votes: &[(f64, f64, f64)]) -> bool {
    let least = votes.iter().map(|v| v.0).fold(f64::INFINITY, f64::min);
    let most = votes.iter().map(|v| v.0).fold(f64::NEG_INFINITY, f64::max);
    // The differences are in f32, as in the fast implementation.
    most as f32 - least as f32 <= TOLERANCE
}

fn mean(votes: impl Iterator<Item = (f64, f64)>) -> f32 {
    let (sum, weights) = votes.fold((0.0, 0.0), |(s, n), (v, w)| (s + v * w, n + w));
    (sum / weights) as f32
}

/// Returns the mean of the votes that agree with their weighted median.
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
