//! How likely a photograph is under a state of the display: the likelihood of its light under the forward model, whose
//! exposure, profile of the laser and stray light are fitted.

use super::scene::Scene;
use super::state::State;
use crate::camera::homography::Homography;
use crate::camera::photograph::Photograph;
use crate::cholesky;
use crate::learned::register;
use ndarray::Array2;
use phasefront::Size;
use phasefront_io::Result;

/// The number of blocks along an axis in which likelihoods are compared.
const BLOCKS: usize = 6;
/// The number of terms of a photograph's brightness: stray light, and a polynomial of the second order over the frame.
const TERMS: usize = 7;
/// A sample with more than this share of the largest value of a saturated photograph tells no light.
const FULL: f32 = 0.97;

/// A photograph of one laser's light, resampled to the pixels of the modulator.
pub(super) struct Sampled {
    pub light: Array2<f32>,
    /// Which values are no limit of the sensor.
    valid: Array2<bool>,
}

impl Sampled {
    /// Samples `photograph` within `corners`.
    pub(super) fn new(photograph: &Photograph, corners: [[f64; 2]; 4], size: Size) -> Result<Self> {
        let map = map_of(corners, size)?;
        let light = photograph.through(&map, zoom_of(corners, size), size);
        let limit = match photograph.saturated() > 0.0 {
            true => photograph
                .values
                .iter()
                .copied()
                .max()
                .map_or(2.0, |most| f32::from(most) / f32::from(photograph.full)),
            false => 2.0,
        };
        let valid = light.mapv(|value| value < FULL * limit);
        Ok(Sampled { light, valid })
    }
}

/// Returns the map from pixels of a window of `size` to a photograph in which its corners lie at `corners`.
pub(super) fn map_of(corners: [[f64; 2]; 4], Size { width, height }: Size) -> Result<Homography> {
    let (w, h) = (width as f64, height as f64);
    Homography::through([[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]], corners)
}

/// Returns the number of a photograph's pixels for each pixel of a window with `corners`.
pub(super) fn zoom_of([a, b, c, _]: [[f64; 2]; 4], Size { width, height }: Size) -> f64 {
    let length = |[x, y]: [f64; 2], [u, v]: [f64; 2]| (u - x).hypot(v - y);
    0.5 * (length(a, b) / width as f64 + length(a, c) / height as f64)
}

/// How a model's light fits a photograph of one laser.
#[derive(Debug, Clone)]
pub(super) struct LaserScore {
    /// The logarithm of the likelihood.
    pub likelihood: f64,
    /// The same for each block.
    pub blocks: Vec<f64>,
    /// The photograph's expected light.
    pub expected: Array2<f32>,
    /// The brightness that multiplies the model's light, at each pixel.
    pub gain: Array2<f32>,
    /// The share of the photograph's variance that the model explains.
    pub explained: f64,
}

/// The sums of a photograph's normal equations.
#[derive(Default)]
struct Moments {
    count: f64,
    seen: f64,
    square: f64,
    /// Σ m·uⁱ·vʲ and Σ m·s·uⁱ·vʲ of model m and photograph s, up to the second order, and Σ m²·uⁱ·vʲ up to the fourth.
    model: [[f64; 3]; 3],
    both: [[f64; 3]; 3],
    squares: [[f64; 5]; 5],
}

impl Moments {
    fn of(light: &Array2<f32>, sampled: &Sampled) -> Self {
        let (height, width) = light.dim();
        let mut all = Moments::default();
        for (y, ((model, seen), valid)) in (light.rows().into_iter())
            .zip(sampled.light.rows())
            .zip(sampled.valid.rows())
            .enumerate()
        {
            let (mut squares, mut models, mut both) = ([0.0; 5], [0.0; 3], [0.0; 3]);
            for (x, ((model, seen), valid)) in model.iter().zip(seen).zip(valid).enumerate() {
                let weight = f64::from(u8::from(*valid));
                let (m, s) = (f64::from(*model) * weight, f64::from(*seen) * weight);
                let u = place(x, width);
                let u2 = u * u;
                let m2 = m * m;
                all.count += weight;
                all.seen += s;
                all.square += s * s;
                squares = [
                    squares[0] + m2,
                    squares[1] + m2 * u,
                    squares[2] + m2 * u2,
                    squares[3] + m2 * u2 * u,
                    squares[4] + m2 * u2 * u2,
                ];
                models = [models[0] + m, models[1] + m * u, models[2] + m * u2];
                both = [both[0] + m * s, both[1] + m * s * u, both[2] + m * s * u2];
            }
            let v = place(y, height);
            add(&mut all.squares, squares, v);
            add(&mut all.model, models, v);
            add(&mut all.both, both, v);
        }
        all
    }

    /// Returns the stray light and the coefficients of the brightness, in the order of [`POWERS`].
    fn solve(&self) -> [f64; TERMS] {
        let mut normal = [[0.0; TERMS]; TERMS];
        let mut right = [0.0; TERMS];
        (normal[0][0], right[0]) = (self.count, self.seen);
        for (i, [a, b]) in POWERS.into_iter().enumerate() {
            normal[i + 1][0] = self.model[a][b];
            right[i + 1] = self.both[a][b];
            for (j, [c, d]) in POWERS.into_iter().take(i + 1).enumerate() {
                normal[i + 1][j + 1] = self.squares[a + c][b + d];
            }
        }
        let most = (0..TERMS).map(|i| normal[i][i]).fold(f64::MIN_POSITIVE, f64::max);
        cholesky::solve(&mut normal, &mut right, 1e-10 * most);
        right
    }
}

/// Adds the sums of a row at `v` to those of all rows.
fn add<const N: usize>(all: &mut [[f64; N]; N], row: [f64; N], v: f64) {
    for (all, value) in all.iter_mut().zip(row) {
        let mut power = 1.0;
        for all in all {
            *all += value * power;
            power *= v;
        }
    }
}

/// The powers of u and v in the terms of the brightness.
const POWERS: [[usize; 2]; TERMS - 1] = [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]];

/// Returns where pixel `at` of `n` lies between −1 and 1.
fn place(at: usize, n: usize) -> f64 {
    2.0 * at as f64 / n as f64 - 1.0
}

/// Fits the brightness of `light`, (H, W), to the photograph, and returns its likelihood. The standard deviation of
/// what is left is unknown too.
pub(super) fn score(light: &Array2<f32>, sampled: &Sampled) -> LaserScore {
    let (height, width) = light.dim();
    let moments = Moments::of(light, sampled);
    let [stray, one, by_u, by_v, by_uu, by_uv, by_vv] = moments.solve();
    let gain = Array2::from_shape_fn(light.dim(), |(y, x)| {
        let (u, v) = (place(x, width), place(y, height));
        (one + v * (by_v + v * by_vv) + u * (by_u + v * by_uv + u * by_uu)) as f32
    });
    let expected = &gain * light + stray as f32;
    let mut blocks = vec![[0.0; 2]; BLOCKS * BLOCKS];
    for (y, ((expected, seen), valid)) in (expected.rows().into_iter())
        .zip(sampled.light.rows())
        .zip(sampled.valid.rows())
        .enumerate()
    {
        for (x, ((expected, seen), valid)) in expected.iter().zip(seen).zip(valid).enumerate() {
            let missing = f64::from(seen - expected);
            let weight = f64::from(u8::from(*valid));
            let block = &mut blocks[y * BLOCKS / height * BLOCKS + x * BLOCKS / width];
            *block = [block[0] + weight, block[1] + weight * missing * missing];
        }
    }
    let left = blocks.iter().map(|block| block[1]).sum::<f64>();
    let count = moments.count.max(1.0);
    let variance = (left / count).max(1e-12);
    let blocks: Vec<f64> = (blocks.iter())
        .map(|[n, left]| -0.5 * (left / variance + n * variance.ln()))
        .collect();
    LaserScore {
        likelihood: blocks.iter().sum(),
        blocks,
        expected,
        gain,
        explained: 1.0 - left / f64::max(moments.square - moments.seen * moments.seen / count, 1e-12),
    }
}

/// Returns the photograph's light that is expected where `light` has one brightness everywhere, and the correlation of
/// the amplitudes.
pub(super) fn plain(light: &Array2<f32>, sampled: &Sampled) -> (Array2<f32>, f64) {
    let line = |change: &dyn Fn(f32) -> f64| -> [f64; 3] {
        let [mut n, mut a, mut b, mut aa, mut bb, mut ab] = [0.0; 6];
        let all = light.iter().zip(&sampled.light).zip(&sampled.valid);
        for ((model, seen), _) in all.filter(|(_, valid)| **valid) {
            let (x, y) = (change(*model), change(*seen));
            (n, a, b, aa, bb, ab) = (n + 1.0, a + x, b + y, aa + x * x, bb + y * y, ab + x * y);
        }
        let (of_x, of_y, both) = (n * aa - a * a, n * bb - b * b, n * ab - a * b);
        let slope = (both / of_x.max(f64::MIN_POSITIVE)).max(0.0);
        [
            (b - slope * a) / f64::max(n, 1.0),
            slope,
            both / (of_x * of_y).max(f64::MIN_POSITIVE).sqrt(),
        ]
    };
    let [stray, gain, _] = line(&f64::from);
    let [.., correlation] = line(&|value| f64::from(value.max(0.0)).sqrt());
    (light * gain as f32 + stray as f32, correlation)
}

/// How a state fits the photographs of all lasers.
#[derive(Debug, Clone)]
pub(super) struct Score {
    pub likelihood: f64,
    pub lasers: Vec<LaserScore>,
}

impl Score {
    fn of(lasers: Vec<LaserScore>) -> Self {
        Score {
            likelihood: lasers.iter().map(|laser| laser.likelihood).sum(),
            lasers,
        }
    }

    /// Returns the share of the photographs' variance that the model explains.
    pub(super) fn explained(&self) -> f64 {
        self.lasers.iter().map(|laser| laser.explained).sum::<f64>() / self.lasers.len() as f64
    }

    /// Compares two models by the mean difference of the likelihoods of blocks over its standard error (Vuong,
    /// Econometrica 57, 307, 1989). Positive if this one is nearer to the photographs. The blocks' own spread stands in
    /// for what neither model describes.
    pub(super) fn against(&self, other: &Self) -> f64 {
        let both = self.lasers.iter().zip(&other.lasers);
        let apart: Vec<f64> = both
            .flat_map(|(a, b)| a.blocks.iter().zip(&b.blocks).map(|(a, b)| a - b))
            .collect();
        let n = apart.len() as f64;
        let mean = apart.iter().sum::<f64>() / n;
        let variance = apart.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0);
        mean * n.sqrt() / variance.sqrt().max(1e-9)
    }
}

/// The photographs and the hologram's light where they are compared.
pub(super) struct Comparison<'a> {
    pub scene: Scene<'a>,
    pub photographs: &'a [Photograph],
}

impl Comparison<'_> {
    pub(super) fn lasers(&self) -> usize {
        self.photographs.len()
    }

    pub(super) fn sampled(&self, corners: [[f64; 2]; 4]) -> Result<Vec<Sampled>> {
        let size = self.scene.roi.size;
        self.photographs
            .iter()
            .map(|photo| Sampled::new(photo, corners, size))
            .collect()
    }

    /// Returns how `state` fits.
    pub(super) fn score(&self, state: &State) -> Result<Score> {
        Ok(self.score_of(state, &self.sampled(state.corners)?))
    }

    /// Returns how `state` fits photographs that are sampled already.
    pub(super) fn score_of(&self, state: &State, sampled: &[Sampled]) -> Score {
        let each = sampled.iter().enumerate();
        Score::of(
            each.map(|(laser, sampled)| score(&self.scene.light(state, laser), sampled))
                .collect(),
        )
    }

    /// Returns `corners` after `steps` steps of Gauss and Newton toward the place where the photographs fit `state`
    /// best.
    pub(super) fn placed(&self, state: &State, steps: usize) -> Result<[[f64; 2]; 4]> {
        let size @ Size { width, height } = self.scene.roi.size;
        let light: Vec<_> = (0..self.lasers()).map(|laser| self.scene.light(state, laser)).collect();
        let mut corners = state.corners;
        for _ in 0..steps {
            let sampled = self.sampled(corners)?;
            let (mut seen, mut expected) = (Array2::zeros((height, width)), Array2::zeros((height, width)));
            for (light, sampled) in light.iter().zip(&sampled) {
                let score = score(light, sampled);
                expected += &score.expected;
                // What is saturated moves nothing.
                let valid = |at: (usize, usize)| {
                    if sampled.valid[at] {
                        sampled.light[at]
                    } else {
                        score.expected[at]
                    }
                };
                seen += &Array2::from_shape_fn((height, width), valid);
            }
            let map = register::refined(&map_of(corners, size)?, &seen, &expected, 1)?;
            let (w, h) = (width as f64, height as f64);
            corners = [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]].map(|corner| map.map(corner));
        }
        Ok(corners)
    }
}
