//! Measurement of the laser's amplitude over the modulator from a photograph of a diffuser in its place (Methods of the
//! paper). A median of 5×5 pixels removes dust, and the mean around each node removes speckle. An optional mixture of
//! Gaussian beams fits the result.

use crate::camera::marks::Registration;
use crate::camera::photograph::{Photograph, SATURATED_SHARE};
use crate::cholesky;
use ndarray::Array2;
use phasefront::Size;
use phasefront_io::{Error, Result};
use rayon::prelude::*;

/// The number of nodes of the map along the longer axis.
const NODES: usize = 49;
/// The half width of the median filter.
const HALF: usize = 2;
/// The maximum number of Gaussians of a mixture.
pub const MOST_GAUSSIANS: usize = 4;

/// Computes the amplitude at the nodes of a map, (Gh, Gw), for a modulator of `size`, from a photograph of
/// the diffuser that `registration` locates. The brightest node is 1.
///
/// # Errors
/// Returns an error if the photograph is saturated or dark.
pub fn map(photograph: &Photograph, registration: &Registration, Size { width, height }: Size) -> Result<Array2<f32>> {
    let share = photograph.saturated();
    if share > SATURATED_SHARE {
        return Err(Error::Input(format!(
            "{:.1} % of its pixels are saturated; shorten the exposure",
            share * 100.0
        )));
    }
    let clean = median(photograph);
    let dark = registration.surroundings(&clean, Size { width, height });
    let light = registration.resample(&clean, Size { width, height });
    let nodes = |n: usize| (NODES * n / height.max(width)).max(2);
    let (rows, columns) = (nodes(height), nodes(width));
    let step = |n: usize, nodes: usize| ((n - 1) as f64 / (nodes - 1) as f64).max(1.0);
    let (step_y, step_x) = (step(height, rows), step(width, columns));
    // The median, sampling and errors of the registration mix the dark surroundings into pixels at the border. Nodes
    // there use pixels a little further in and extrapolate their slope.
    let reach = ((HALF as f64 + 1.0) / registration.zoom + 0.5).ceil();
    let window = |node: usize, step: f64, n: usize| {
        let quarter = (n - 1) as f64 / 4.0;
        let (rim, half) = (reach.min(quarter), step.min(quarter));
        let at = node as f64 * step;
        Window::new(at, at.clamp(rim + half, (n - 1) as f64 - rim - half), half)
    };
    let mut map = Array2::zeros((rows, columns));
    for ((i, j), value) in map.indexed_iter_mut() {
        let (along_y, along_x) = (window(i, step_y, height), window(j, step_x, width));
        let mut sum = 0.0;
        for (y, wy) in &along_y.shares {
            for (x, wx) in &along_x.shares {
                let light = f64::from(light[(*y, *x)] - dark);
                // This evaluates the plane that best fits the window, at the node.
                sum += light * (wy[0] * wx[0] + wy[1] * wx[0] + wy[0] * wx[1]);
            }
        }
        *value = sum.max(0.0).sqrt() as f32;
    }
    let most = map.iter().copied().fold(0.0, f32::max);
    if most < 0.05 {
        return Err(Error::Input(
            "is dark: light the diffuser, and expose it to more than a hundredth of the sensor's range".into(),
        ));
    }
    Ok(map / most)
}

/// The pixels of an axis that a node uses, with their weights in the mean and in the slope term from the mean to the
/// node.
struct Window {
    shares: Vec<(usize, [f64; 2])>,
}

impl Window {
    /// Creates the window of pixels less than `half` from `centre` for a node `at`. Nearer pixels have more weight.
    fn new(at: f64, centre: f64, half: f64) -> Self {
        let pixels = (centre - half).ceil() as usize..=(centre + half).floor() as usize;
        // A pixel at distance `half` keeps a small weight, so that a single pixel has a nonzero weight.
        let weight = |x: usize| 1.01 - (x as f64 - centre).abs() / half;
        let all: f64 = pixels.clone().map(weight).sum();
        let mean = pixels.clone().map(|x| weight(x) * x as f64).sum::<f64>() / all;
        let spread: f64 = pixels.clone().map(|x| weight(x) * (x as f64 - mean).powi(2)).sum();
        let slope = if spread > 0.0 { (at - mean) / spread } else { 0.0 };
        let shares = pixels.map(|x| (x, [weight(x) / all, weight(x) * (x as f64 - mean) * slope]));
        Window {
            shares: shares.collect(),
        }
    }
}

/// Returns the median of 5×5 pixels, with the border pixels repeated outside.
fn median(photograph: &Photograph) -> Photograph {
    let (height, width) = (photograph.height, photograph.width);
    let mut out = photograph.clone();
    let rows = out.values.par_chunks_exact_mut(width).enumerate();
    rows.for_each(|(y, row)| {
        let mut near = [0; (2 * HALF + 1) * (2 * HALF + 1)];
        for (x, value) in row.iter_mut().enumerate() {
            for (i, v) in near.iter_mut().enumerate() {
                let at = |n: usize, d: usize, end: usize| (n + d).saturating_sub(HALF).min(end - 1);
                let (y, x) = (at(y, i / 5, height), at(x, i % 5, width));
                *v = photograph.values[y * width + x];
            }
            let middle = near.len() / 2;
            *value = *near.select_nth_unstable(middle).1;
        }
    });
    out
}

/// One beam: its intensity, its centre, and the three parameters of its inverse width, in nodes of a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gaussian([f64; 6]);

impl Gaussian {
    /// Computes I(x, y) = I₀·exp(−(p·dx² + 2q·dx·dy + r·dy²)).
    fn intensity(&self, x: f64, y: f64) -> f64 {
        let [height, cx, cy, p, q, r] = self.0;
        let (dx, dy) = (x - cx, y - cy);
        height * (-(p * dx * dx + 2.0 * q * dx * dy + r * dy * dy)).exp()
    }

    /// Computes the derivatives with respect to the six parameters.
    fn slopes(&self, x: f64, y: f64) -> [f64; 6] {
        let [height, cx, cy, p, q, r] = self.0;
        let (dx, dy) = (x - cx, y - cy);
        let value = self.intensity(x, y);
        [
            value / height,
            value * 2.0 * (p * dx + q * dy),
            value * 2.0 * (q * dx + r * dy),
            -value * dx * dx,
            -value * 2.0 * dx * dy,
            -value * dy * dy,
        ]
    }
}

/// Fits the intensity of `map`, amplitudes (Gh, Gw), with a least-squares sum of `count` Gaussian beams, by the
/// Levenberg–Marquardt method, adding one beam at a time. Returns the fitted amplitudes, the beams, and the RMS
/// residual of the intensity.
///
/// # Errors
/// Returns an error if `count` is zero or exceeds [`MOST_GAUSSIANS`].
pub fn mixture(map: &Array2<f32>, count: usize) -> Result<(Array2<f32>, Vec<Gaussian>, f64)> {
    if !(1..=MOST_GAUSSIANS).contains(&count) {
        return Err(Error::Input(format!(
            "{count} Gaussians; a mixture has 1 to {MOST_GAUSSIANS}"
        )));
    }
    let (rows, columns) = map.dim();
    let seen = map.mapv(|a| f64::from(a).powi(2));
    let mut beams: Vec<Gaussian> = Vec::new();
    let mut left = f64::INFINITY;
    for _ in 0..count {
        // The next beam begins where the most light remains. A fit of one beam to two also leaves negative residuals.
        let rest = Array2::from_shape_fn((rows, columns), |(y, x)| {
            let sum: f64 = beams.iter().map(|b| b.intensity(x as f64, y as f64)).sum();
            seen[(y, x)] - sum
        });
        let (at, most) = rest
            .indexed_iter()
            .max_by(|a, b| a.1.total_cmp(b.1))
            .map_or(((0, 0), 1.0), |(at, v)| (at, *v));
        let narrow = 4.0 / (columns.max(rows) as f64).powi(2);
        let wide = if beams.is_empty() { 1.0 } else { 8.0 };
        beams.push(Gaussian([
            most.max(1e-6),
            at.1 as f64,
            at.0 as f64,
            narrow * wide,
            0.0,
            narrow * wide,
        ]));
        left = descend(&mut beams, &seen);
    }
    let fitted = Array2::from_shape_fn((rows, columns), |(y, x)| {
        let sum: f64 = beams.iter().map(|b| b.intensity(x as f64, y as f64)).sum();
        sum.max(0.0).sqrt() as f32
    });
    Ok((fitted, beams, left))
}

/// Improves `beams` until convergence. Returns the RMS residual.
fn descend(beams: &mut Vec<Gaussian>, seen: &Array2<f64>) -> f64 {
    let n = 6 * beams.len();
    let cost = |beams: &[Gaussian]| -> f64 {
        let square = |((y, x), seen): ((usize, usize), &f64)| {
            let sum: f64 = beams.iter().map(|b| b.intensity(x as f64, y as f64)).sum();
            (seen - sum).powi(2)
        };
        seen.indexed_iter().map(square).sum()
    };
    let (mut now, mut damping) = (cost(beams), 1e-3);
    for _ in 0..200 {
        let mut gram = vec![vec![0.0; n]; n];
        let mut right = vec![0.0; n];
        for ((y, x), seen) in seen.indexed_iter() {
            let (x, y) = (x as f64, y as f64);
            let slopes: Vec<f64> = beams.iter().flat_map(|b| b.slopes(x, y)).collect();
            let residual = seen - beams.iter().map(|b| b.intensity(x, y)).sum::<f64>();
            for i in 0..n {
                right[i] += slopes[i] * residual;
                for j in 0..=i {
                    gram[i][j] += slopes[i] * slopes[j];
                }
            }
        }
        let before = now;
        for _ in 0..12 {
            let mut damped = gram.clone();
            for (i, row) in damped.iter_mut().enumerate() {
                row[i] *= 1.0 + damping;
            }
            let mut step = right.clone();
            cholesky::solve(&mut damped, &mut step, 1e-30);
            let tried: Vec<Gaussian> = (beams.iter().zip(step.chunks_exact(6)))
                .map(|(b, step)| Gaussian(std::array::from_fn(|i| b.0[i] + step[i])))
                .collect();
            let closes = (tried.iter()).all(|b| {
                let [height, _, _, p, q, r] = b.0;
                height > 0.0 && p > 0.0 && r > 0.0 && q * q < p * r
            });
            let then = cost(&tried);
            if then < now && closes {
                (*beams, now) = (tried, then);
                damping *= 0.3;
                break;
            }
            damping *= 4.0;
        }
        if before - now <= 1e-9 * before {
            break;
        }
    }
    (now / seen.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::camera::marks;
    use crate::camera::pattern::Pattern;
    use crate::simulated_display::SimulatedDisplay;
    use phasefront::Display;

    #[test]
    fn the_beam_comes_back_from_dust_and_noise() {
        let display = Display::from_toml("width = 176\nheight = 120").unwrap();
        let pattern = Pattern::new(Size {
            width: 176,
            height: 120,
        })
        .unwrap();
        let simulated = SimulatedDisplay::new(&display, 2.5, 3).unwrap();
        for colour in 0..3 {
            let marked = simulated.photograph(pattern.frame(0).view(), colour, 0.0, 0).unwrap();
            let registration = marks::register(&marked, &pattern).unwrap();
            let photograph = simulated.photograph_diffuser(colour, 1).unwrap();
            let measured = map(
                &photograph,
                &registration,
                Size {
                    width: 176,
                    height: 120,
                },
            )
            .unwrap();
            let (fitted, _, left) = mixture(&measured, 1).unwrap();
            assert!(left < 0.01, "{left}");
            let (rows, columns) = measured.dim();
            let truth = Array2::from_shape_fn((rows, columns), |(i, j)| {
                let y = i as f64 / (rows - 1) as f64 * 119.0;
                let x = j as f64 / (columns - 1) as f64 * 175.0;
                simulated.laser(colour, y, x)
            });
            // Maps have an arbitrary scale, so this uses the best common factor.
            let rms = |map: &Array2<f32>| {
                let dot = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
                    map.iter().zip(&truth).map(|(a, b)| f(f64::from(*a), *b)).sum()
                };
                let scale = dot(&|a, b| a * b) / dot(&|a, _| a * a);
                (dot(&|a, b| (a * scale - b).powi(2)) / dot(&|_, b| b * b)).sqrt()
            };
            let (of_map, of_fit) = (rms(&measured), rms(&fitted));
            assert!(of_map < 0.02 && of_fit < 0.01, "{colour}: {of_map} {of_fit}");
        }
    }

    #[test]
    fn two_beams_are_told_apart() {
        let two = [
            Gaussian([0.9, 12.0, 8.0, 0.004, 0.001, 0.006]),
            Gaussian([0.4, 30.0, 18.0, 0.01, 0.0, 0.008]),
        ];
        let map = Array2::from_shape_fn((28, 40), |(y, x)| {
            let sum: f64 = two.iter().map(|b| b.intensity(x as f64, y as f64)).sum();
            sum.sqrt() as f32
        });
        let (_, _, one) = mixture(&map, 1).unwrap();
        let (fitted, _, both) = mixture(&map, 2).unwrap();
        assert!(one > 0.02 && both < 1e-4, "{one} {both}");
        assert!(fitted.iter().zip(&map).all(|(a, b)| (a - b).abs() < 1e-2));
        assert!(mixture(&map, 0).is_err() && mixture(&map, 9).is_err());
    }

    #[test]
    fn the_median_takes_specks_away() {
        let mut p = Photograph {
            height: 9,
            width: 9,
            values: vec![500; 81],
            full: 65535,
        };
        for i in [30, 31, 39, 40, 80] {
            p.values[i] = 0;
        }
        assert_eq!(median(&p).values, vec![500; 81]);
    }
}
