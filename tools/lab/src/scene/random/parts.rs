//! The parts of random scenes of every kind: random shapes, poses and patterns.

use crate::scene::Mesh;
use crate::scene::pattern::Pattern;
use crate::scene::shapes::{Light, Shape, quaternion, star, turn};
use phasefront::Size;
use phasefront_io::dice::Dice;
use std::f64::consts::TAU;

/// The fraction of the volume's depth for a length of one pixel without stretching: 8 µm of 6 mm.
pub(super) const DEPTH_PER_PX: f64 = 8e-6 / 6e-3;
/// The most texels of an object's texture along a side. Larger objects show larger texels.
pub(super) const MAX_TEXELS: f64 = 144.0;
/// The fraction of the volume that stays empty at either end.
pub(super) const MARGIN: f64 = 0.004;

/// Makes light from the viewer's side: `front` is added to its direction toward the viewer. The ambient part lies
/// between `least` and `most`.
pub(super) fn light(dice: &mut Dice, front: f64, [least, most]: [f64; 2]) -> Light {
    let [x, y, z] = dice.direction();
    let toward = z.abs() + front;
    let length = (x * x + y * y + toward * toward).sqrt();
    Light {
        direction: [x / length, y / length, toward / length],
        ambient: dice.range(least, most),
    }
}

/// Makes a random shape, and tells whether it is a sheet. `radius`, in pixels, sets its detail.
pub(super) fn shape(dice: &mut Dice, radius: f64) -> (Shape, bool) {
    let detail = (radius.sqrt() * 3.0).clamp(6.0, 32.0) as usize;
    match dice.weighted(&[1.6, 1.2, 0.8, 1.0, 0.8, 0.9, 1.6, 1.0, 0.7, 0.5, 0.6]) {
        0 => (Shape::cuboid(), false),
        1 => (Shape::ball(detail, |_| 1.0), false),
        2 => (Shape::torus(detail, dice.range(0.12, 0.45)), false),
        3 => {
            let waves = [0; 3].map(|_| (dice.direction(), dice.range(1.5, 6.0), dice.range(0.05, 0.22)));
            let bumpy = move |p: [f64; 3]| {
                let bump = |(d, rate, height): ([f64; 3], f64, f64)| {
                    height * libm::sin(rate * (p[0] * d[0] + p[1] * d[1] + p[2] * d[2]) + 7.0 * d[0])
                };
                0.8 + waves.into_iter().map(bump).sum::<f64>()
            };
            (Shape::ball(detail, bumpy), false)
        }
        4 => (Shape::cylinder(detail, dice.pick(&[1.0, 1.0, 0.5, 0.0])), false),
        5 => {
            let points = dice.integer(2, 9);
            let thickness = dice.range(0.05, 0.5);
            let outline = star(points, dice.range(0.3, 1.0));
            (
                Shape::prism(&outline).moved([1.0, 1.0, thickness], turn([0.0, 0.0, 1.0], 0.0), [0.0; 3]),
                false,
            )
        }
        6 => (Shape::sheet(), true),
        7 => {
            let points = dice.integer(2, 9);
            (Shape::polygon(&star(points, dice.range(0.3, 1.0))), true)
        }
        8 => {
            // A wavy sheet.
            let (along, across) = (dice.range(0.5, 2.0), dice.range(0.0, 1.0));
            let height = dice.range(0.05, 0.35);
            let wave = |u: f64, v: f64| {
                [
                    2.0 * u - 1.0,
                    2.0 * v - 1.0,
                    height * libm::sin(TAU * (along * u + across * v)),
                ]
            };
            (Shape::grid(detail, detail, wave), true)
        }
        9 => {
            let (turns, lobes) = dice.pick(&[(2.0, 3.0), (3.0, 2.0), (2.0, 5.0), (1.0, 6.0)]);
            let wide = dice.range(0.2, 0.4);
            let curve = |t: f64| {
                let (sin_a, cos_a) = libm::sincos(TAU * turns * t);
                let (sin_b, cos_b) = libm::sincos(TAU * lobes * t);
                let r = 1.0 - wide + wide * cos_b;
                [r * cos_a, r * sin_a, wide * sin_b]
            };
            (Shape::loop_tube(3 * detail, dice.range(0.05, 0.14), curve), false)
        }
        _ => {
            // A swarm of leaves, confetti or gravel.
            let leaf = Shape::polygon(&star(dice.integer(2, 4), dice.range(0.4, 1.0)));
            let mut swarm = Shape::default();
            for _ in 0..dice.integer(6, 24) {
                let size = dice.range(0.08, 0.3);
                let (sin, cos) = libm::sincos(TAU * dice.unit());
                let tilt = turn([cos, sin, 0.0], dice.range(0.0, 1.2));
                let [x, y, z] = dice.direction();
                swarm.append(&leaf.clone().moved([size; 3], tilt, [x, y, z]));
            }
            (swarm, true)
        }
    }
}

/// Returns a random rotation. A sheet tilts by at most 80 degrees, so its face stays visible.
pub(super) fn turned(dice: &mut Dice, flat: bool) -> [[f64; 3]; 3] {
    if flat {
        let (sin, cos) = libm::sincos(TAU * dice.unit());
        let tilt = dice.range(0.0, 1.4);
        multiply(turn([cos, sin, 0.0], tilt), turn([0.0, 0.0, 1.0], TAU * dice.unit()))
    } else {
        let [x, y, z] = dice.direction();
        let (sin, cos) = libm::sincos(TAU * 0.5 * dice.unit());
        quaternion([cos, sin * x, sin * y, sin * z])
    }
}

/// Returns an object's half sizes in pixels, for bars, plates and lumps.
pub(super) fn stretch(dice: &mut Dice, radius: f64, flat: bool) -> [f64; 3] {
    let thinnest = (1.0 / radius).min(1.0);
    match dice.weighted(&[1.0, 1.0, 0.5]) {
        0 => [radius; 3],
        1 => [0; 3].map(|_| radius * dice.range(0.35, 1.0)),
        // A rod or a slat: thin, and longer than the radius of the other shapes.
        _ => {
            let thin = dice.log_range(0.04, 0.25).max(thinnest);
            let other = if flat { 1.0 } else { thin };
            [radius * thin, 1.6 * radius, radius * other]
        }
    }
}

/// Moves the mesh along z, and flattens it if needed, so that it lies inside the volume around `depth`. At the ends of
/// the volume, its nearest or farthest point touches them.
pub(super) fn settle(mut mesh: Mesh, depth: f64) -> Mesh {
    let heights = || mesh.positions.iter().map(|p| f64::from(p[2]));
    let (low, high) = heights().fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(z), high.max(z)));
    let room = 1.0 - 2.0 * MARGIN;
    let press = (0.9 * room / (high - low).max(1e-9)).min(1.0);
    let half = 0.5 * press * (high - low);
    let middle = 0.5 - (MARGIN + half + depth * (room - 2.0 * half));
    for p in &mut mesh.positions {
        p[2] = (middle + press * (f64::from(p[2]) - 0.5 * (low + high))) as f32;
    }
    mesh
}

fn multiply(a: [[f64; 3]; 3], b: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Makes a pattern of any kind.
pub(super) fn pattern(dice: &mut Dice, size: Size) -> Pattern {
    // Features are at least 3 texels wide.
    let finest = (size.width.min(size.height) as f64 / 6.0).max(1.0);
    let repeats = |dice: &mut Dice| dice.log_range(1.0, finest.min(16.0)) as usize;
    match dice.weighted(&[4.0, 1.5, 0.8, 0.8, 0.8, 0.8, 0.8, 0.6, 0.6]) {
        0 => {
            let cells = repeats(dice);
            let stretch = dice.pick(&[1, 1, 1, 4]);
            Pattern::noise(size, (cells, cells * stretch), 6, dice.range(0.35, 0.85) as f32, dice)
        }
        1 => {
            let waves = (
                repeats(dice) as i32,
                if dice.chance(0.5) { 0 } else { repeats(dice) as i32 },
            );
            let waves = if dice.chance(0.5) { (waves.1, -waves.0) } else { waves };
            let bend = dice.pick(&[0.0, 0.0, 0.5, 2.0]) as f32;
            let softness = dice.range(0.1, 1.0) as f32;
            Pattern::stripes(size, waves, bend, softness, dice)
        }
        2 => Pattern::checks(size, (2 * repeats(dice), 2 * repeats(dice))),
        3 => {
            let (bricks, courses) = (repeats(dice), 2 * repeats(dice));
            Pattern::bricks(size, bricks, courses, dice.range(0.06, 0.25) as f32, dice)
        }
        4 => {
            let count = repeats(dice);
            Pattern::spots(size, count, dice.range(0.15, 0.45) as f32, dice)
        }
        5 => {
            let count = repeats(dice);
            Pattern::cells(size, count, dice.range(0.0, 0.2) as f32, dice)
        }
        6 => {
            let count = repeats(dice) as f32;
            let bend = dice.pick(&[0.0, 0.6, 2.0]) as f32;
            Pattern::rings(size, count, bend, dice.range(0.1, 1.0) as f32, dice)
        }
        7 => Pattern::gradient(size, (dice.integer(0, 1) as i32, 1)),
        _ => {
            let lines = repeats(dice).max(2);
            Pattern::strokes(size, lines, dice.range(0.08, 0.25) as f32, dice)
        }
    }
}

/// Makes the holes of a sheet: lattices, sieves, writing, tatters.
pub(super) fn holes(dice: &mut Dice, size: Size) -> Pattern {
    let count = dice.integer(2, (size.width.min(size.height) / 8).clamp(2, 8));
    match dice.integer(0, 4) {
        0 => Pattern::stripes(size, (count as i32, 0), 0.0, 0.2, dice),
        1 => {
            let bars = dice.range(0.15, 0.4) as f32;
            let inside = |x: usize, n: usize| ((x as f32 + 0.5) / n as f32 * count as f32).fract() < bars;
            Pattern::from_fn(size, |x, y| {
                f32::from(u8::from(inside(x, size.width) || inside(y, size.height)))
            })
        }
        2 => Pattern::spots(size, count, dice.range(0.2, 0.45) as f32, dice),
        3 => Pattern::strokes(size, count.min(4), dice.range(0.1, 0.25) as f32, dice),
        _ => Pattern::noise(size, (count, count), 3, 0.5, dice),
    }
}
