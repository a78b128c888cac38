//! The background that fills the frame of a random scene: planes, ground planes, corners, reliefs, curved and stepped
//! surfaces.

use crate::scene::pattern::Pattern;
use crate::scene::random::parts::{DEPTH_PER_PX, MARGIN};
use crate::scene::shapes::Shape;
use phasefront::Size;
use phasefront_io::dice::Dice;
use std::f64::consts::TAU;

/// The number of pieces of the background along a side.
const PIECES: usize = 32;

/// The depth of the background on a grid over the frame.
pub(super) struct Ground(Vec<f64>);

impl Ground {
    /// Makes a photograph-like background: a wall, a ground plane, a corner or a relief.
    pub(super) fn natural(dice: &mut Dice) -> Self {
        Self::of(Self::like_photographs(dice), [0.0, 1.0])
    }

    /// Makes a surface of any kind, with its depths scaled into `span`: those of [`natural`](Self::natural), slopes
    /// through the whole volume, curved surfaces and terraces.
    pub(super) fn varied(dice: &mut Dice, span: [f64; 2]) -> Self {
        let depth_at = match dice.weighted(&[0.4, 0.2, 0.3, 0.1]) {
            0 => Self::like_photographs(dice),
            1 => Self::slope(dice),
            2 => Self::curved(dice),
            _ => Self::terraces(dice),
        };
        Self::of(depth_at, span)
    }

    fn of(depth_at: impl Fn(f64, f64) -> f64, [near, far]: [f64; 2]) -> Self {
        let along = |i: usize| i as f64 / PIECES as f64;
        let depths = (0..=PIECES).flat_map(|j| (0..=PIECES).map(move |i| (i, j)));
        Self(
            depths
                .map(|(i, j)| (near + (far - near) * depth_at(along(i), along(j))).clamp(0.02, 1.0 - MARGIN))
                .collect(),
        )
    }

    /// Makes the depth at (u, v), u from the left and v from below, both in [0, 1].
    fn like_photographs(dice: &mut Dice) -> Box<dyn Fn(f64, f64) -> f64> {
        // A plane, by its depth at the frame's middle and the depth that it gains toward the edge in a direction.
        let plane = |dice: &mut Dice, middle: [f64; 2], slope: [f64; 2], angle: f64| {
            let (middle, slope) = (dice.range(middle[0], middle[1]), dice.range(slope[0], slope[1]));
            let (sin, cos) = libm::sincos(angle);
            move |u: f64, v: f64| middle + slope * (cos * (2.0 * u - 1.0) + sin * (2.0 * v - 1.0))
        };
        let any = TAU * dice.unit();
        match dice.weighted(&[0.3, 0.3, 0.2, 0.2]) {
            0 => Box::new(plane(dice, [0.5, 1.0], [0.0, 0.5], any)),
            1 => {
                // A ground plane that rises to a wall, seen by a slightly tilted camera.
                let (sin, cos) = libm::sincos(dice.range(-0.35, 0.35));
                let (near, far) = (dice.range(0.0, 0.4), dice.range(0.6, 1.05));
                let (horizon, bend) = (dice.range(0.25, 0.8), dice.log_range(0.6, 1.8));
                let wall = plane(dice, [0.0, 0.0], [0.0, 0.1], any);
                Box::new(move |u, v| {
                    let up = 0.5 + cos * (v - 0.5) + sin * (u - 0.5);
                    let t = (up / horizon).clamp(0.0, 1.0);
                    near + (far + wall(u, v) - near) * libm::pow(t, bend)
                })
            }
            2 => {
                // Walls that meet in a corner, or the corner of a block.
                let third = TAU / 3.0;
                let walls = [0.0, 1.0, 2.0].map(|k| {
                    let turned = any + third * (k + dice.range(-0.25, 0.25));
                    plane(dice, [0.55, 1.0], [0.1, 0.7], turned)
                });
                let block = dice.chance(0.3);
                Box::new(move |u, v| {
                    let [a, b, c] = [&walls[0], &walls[1], &walls[2]].map(|wall| wall(u, v));
                    if block { a.max(b).max(c) - 0.25 } else { a.min(b).min(c) }
                })
            }
            _ => {
                let cells = dice.integer(1, 5);
                let rough = dice.range(0.3, 0.7) as f32;
                let side = PIECES + 1;
                let relief = Pattern::noise(
                    Size {
                        width: side,
                        height: side,
                    },
                    (cells, cells),
                    4,
                    rough,
                    dice,
                );
                let (far, height) = (dice.range(0.7, 1.0), dice.range(0.1, 0.8));
                Box::new(move |u, v| {
                    let [i, j] = [u, v].map(|t| (t * PIECES as f64 + 0.5) as usize);
                    far - height * f64::from(relief.at(i, j))
                })
            }
        }
    }

    /// Makes a plane that runs through much of the volume, in any direction.
    fn slope(dice: &mut Dice) -> Box<dyn Fn(f64, f64) -> f64> {
        let (sin, cos) = libm::sincos(TAU * dice.unit());
        let (near, far) = (dice.range(0.0, 0.4), dice.range(0.6, 1.0));
        let reach = sin.abs() + cos.abs();
        Box::new(move |u, v| {
            let t = 0.5 + 0.5 * (cos * (2.0 * u - 1.0) + sin * (2.0 * v - 1.0)) / reach;
            near + (far - near) * t
        })
    }

    /// Makes a bowl, a dome, a pipe, a saddle or waves.
    fn curved(dice: &mut Dice) -> Box<dyn Fn(f64, f64) -> f64> {
        let (sin, cos) = libm::sincos(TAU * dice.unit());
        let [x0, y0] = [0; 2].map(|_| dice.range(-0.5, 0.5));
        let (middle, height) = (dice.range(0.4, 0.9), dice.range(0.2, 1.0));
        let height = if dice.chance(0.5) { height } else { -height };
        // The curvature along the two axes of the surface.
        let bends = dice.pick(&[[1.0, 1.0], [1.0, 0.0], [1.0, -1.0], [1.0, 0.3]]);
        let waves = dice.chance(0.35).then(|| dice.log_range(0.7, 5.0));
        Box::new(move |u, v| {
            let (x, y) = (2.0 * u - 1.0 - x0, 2.0 * v - 1.0 - y0);
            let (x, y) = (cos * x + sin * y, cos * y - sin * x);
            let bent = match waves {
                Some(count) => 0.5 * libm::sin(TAU * count * x * 0.5) * libm::cos(TAU * count * y * 0.5 * bends[1]),
                None => 0.5 * (bends[0] * x * x + bends[1] * y * y),
            };
            middle + height * bent
        })
    }

    /// Divides a slope into steps of equal height.
    fn terraces(dice: &mut Dice) -> Box<dyn Fn(f64, f64) -> f64> {
        let slope = Self::slope(dice);
        let steps = dice.log_range(2.0, 10.0).floor();
        Box::new(move |u, v| ((slope(u, v) * steps).floor() + 0.5) / steps)
    }

    /// Returns the depth behind a point, u from the left and v from below.
    pub(super) fn at(&self, u: f64, v: f64) -> f64 {
        let [i, j] = [u, v].map(|t| (t.clamp(0.0, 1.0) * PIECES as f64 + 0.5) as usize);
        self.0[j * (PIECES + 1) + i]
    }

    /// Returns the surface, a little larger than a frame of this size in pixels. Lengths along z are in pixels.
    pub(super) fn sheet(&self, width: f64, height: f64) -> Shape {
        let (w, h) = (1.02 * width, 1.02 * height);
        Shape::grid(PIECES, PIECES, |u, v| {
            let z = (0.5 - self.at(u, v)) / DEPTH_PER_PX;
            [w * (u - 0.5), h * (v - 0.5), z]
        })
    }
}
