//! The random scenes that data sets are made of: many objects of random shape, texture, scale and tilt, with the
//! depths that are seen spread evenly over the volume, so that every depth and every kind of edge is learnt.
//!
//! Nothing here depends on the machine: chance comes from [`Dice`], sines and powers from `libm`.

use std::f64::consts::TAU;
use std::sync::Arc;

use super::dice::Dice;
use super::pattern::Pattern;
use super::shapes::{Light, Place, Shape, quaternion, star, turn};
use super::{Mesh, Scene, Texture};

/// Parts of the volume's depth that a length of one pixel takes where nothing is stretched: 8 µm of 6 mm.
const DEPTH_PER_PX: f64 = 8e-6 / 6e-3;
/// Most texels of an object's texture along a side. Larger objects show larger texels.
const MAX_TEXELS: f64 = 144.0;
/// How much of the volume stays empty at either end.
const MARGIN: f64 = 0.004;

/// A random scene for a frame of `height` x `width` pixels. The same arguments give the same scene on every machine.
pub fn random_scene(seed: u64, height: usize, width: usize) -> Scene {
    let mut maker = Maker::new(Dice::new(seed), height as f64, width as f64);
    let background = maker.background();
    let count = maker.dice.log_range(40.0, 120.0) as usize;
    // One depth in each of `count` equal parts, in random order: each scene spans the volume.
    let mut depths: Vec<f64> = (0..count)
        .map(|i| (i as f64 + maker.dice.unit()) / count as f64)
        .collect();
    for i in (1..count).rev() {
        depths.swap(i, maker.dice.integer(0, i));
    }
    let mut meshes: Vec<Mesh> = depths
        .into_iter()
        .map(|depth| maker.object(libm::pow(depth, 1.2)))
        .collect();
    meshes.extend(background);
    Scene { meshes }
}

/// One scene in the making: its frame, and what its objects have in common.
struct Maker {
    dice: Dice,
    height: f64,
    width: f64,
    light: Option<Light>,
    palette: Palette,
    /// Radii of the smallest and the largest objects, in pixels.
    radii: [f64; 2],
    /// Above one, small objects are more frequent than an even spread of log radius has them.
    smallness: f64,
}

/// The colours of one scene: hues about a centre, ranges of saturation and brightness.
struct Palette {
    hue: f64,
    hue_spread: f64,
    saturation: [f64; 2],
    brightness: [f64; 2],
}

impl Maker {
    fn new(mut dice: Dice, height: f64, width: f64) -> Self {
        let side = height.min(width);
        let light = dice.chance(0.85).then(|| {
            let [x, y, z] = dice.direction();
            let length = (x * x + y * y + (z.abs() + 0.4) * (z.abs() + 0.4)).sqrt();
            Light {
                direction: [x / length, y / length, (z.abs() + 0.4) / length],
                ambient: dice.range(0.15, 0.7),
            }
        });
        let palette = Palette {
            hue: dice.unit(),
            hue_spread: dice.pick(&[0.08, 0.25, 0.5, 0.5]),
            saturation: dice.pick(&[[0.0, 0.15], [0.0, 0.6], [0.2, 1.0], [0.6, 1.0]]),
            brightness: dice.pick(&[[0.05, 0.7], [0.1, 1.0], [0.3, 1.0], [0.6, 1.0]]),
        };
        let largest = side * dice.log_range(0.13, 0.28);
        let radii = [dice.range(1.5, 4.0).min(largest), largest];
        let smallness = dice.range(0.6, 1.3);
        Self {
            dice,
            height,
            width,
            light,
            palette,
            radii,
            smallness,
        }
    }

    /// What stands behind all else, if anything.
    fn background(&mut self) -> Option<Mesh> {
        let dice = &mut self.dice;
        let style = dice.weighted(&[0.4, 0.3, 0.15, 0.15]);
        if style == 0 {
            return None;
        }
        // Depths at the middle and how they change to the frame's edges.
        let (middle, slope, bumps) = match style {
            1 => (dice.range(0.62, 1.0), dice.range(0.02, 0.35), 0.0),
            2 => (dice.range(0.5, 0.7), dice.range(0.3, 0.5), 0.0),
            _ => (
                dice.range(0.55, 0.9),
                dice.range(0.0, 0.2),
                dice.range(0.1, 0.5),
            ),
        };
        let (sin, cos) = libm::sincos(TAU * dice.unit());
        let pieces = if bumps > 0.0 { 24 } else { 1 };
        let cells = dice.integer(2, 5);
        let relief = Pattern::noise((pieces + 1, pieces + 1), (cells, cells), 2, 0.4, dice);
        // A texel a pixel, up to a limit, on a sheet a little larger than the frame.
        let size = [self.width, self.height].map(|v| v.min(3.0 * MAX_TEXELS) as usize);
        let texture = self.texture((size[0].max(1), size[1].max(1)), &[0.5, 1.0, 1.0]);
        // The tilt is steepest where it spans as much depth across the frame as `slope` says, whatever its direction.
        let reach = sin.abs() + cos.abs();
        let depth_at = |u: f64, v: f64| {
            let tilt = slope * (cos * (2.0 * u - 1.0) + sin * (2.0 * v - 1.0)) / reach;
            let (i, j) = (
                (u * pieces as f64 + 0.5) as usize,
                (v * pieces as f64 + 0.5) as usize,
            );
            (middle + tilt + bumps * (f64::from(relief.at(i, j)) - 0.5)).clamp(0.01, 1.0 - MARGIN)
        };
        let sheet = Shape::grid(pieces, pieces, |u, v| {
            let (w, h) = (1.02 * self.width, 1.02 * self.height);
            [
                w * (u - 0.5),
                h * (v - 0.5),
                (0.5 - depth_at(u, v)) / DEPTH_PER_PX,
            ]
        });
        Some(sheet.place(
            &self.place([1.0; 3], turn([0.0, 0.0, 1.0], 0.0), 1.0, [0.5, 0.5, 0.0]),
            Arc::new(texture),
        ))
    }

    /// One object about the depth `depth` in [0, 1].
    fn object(&mut self, depth: f64) -> Mesh {
        let t = libm::pow(self.dice.unit(), self.smallness);
        let radius = self.radii[0] * libm::pow(self.radii[1] / self.radii[0], t);
        let (shape, flat) = self.shape(radius);
        let dice = &mut self.dice;
        let scale = stretch(dice, radius, flat);
        let rotation = if flat {
            // Sheets show their faces: tilted by 80 degrees at most.
            let (sin, cos) = libm::sincos(TAU * dice.unit());
            let tilt = dice.range(0.0, 1.4);
            multiply(
                turn([cos, sin, 0.0], tilt),
                turn([0.0, 0.0, 1.0], TAU * dice.unit()),
            )
        } else {
            let [x, y, z] = dice.direction();
            let (sin, cos) = libm::sincos(TAU * 0.5 * dice.unit());
            quaternion([cos, sin * x, sin * y, sin * z])
        };
        // Objects as deep as they are wide up to several times as deep; never deeper than most of the volume.
        let deep = dice.log_range(0.5, 5.0);
        let size = scale[0]
            .max(scale[1])
            .max(scale[2])
            .round()
            .clamp(4.0, MAX_TEXELS / 2.0) as usize
            * 2;
        let mut texture = self.texture(
            (size, size),
            &[0.0, 0.15, 0.5, 0.5, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
        );
        if self.dice.chance(if flat { 0.35 } else { 0.06 }) {
            texture = self.holes((size, size)).cut(&texture);
        }
        let dice = &mut self.dice;
        let at = [dice.range(-0.05, 1.05), dice.range(-0.05, 1.05), 0.0];
        let mesh = shape.place(&self.place(scale, rotation, deep, at), Arc::new(texture));
        settle(mesh, depth)
    }

    /// A shape, and whether it is a sheet. `radius` in pixels decides how finely it is made.
    fn shape(&mut self, radius: f64) -> (Shape, bool) {
        let dice = &mut self.dice;
        let detail = (radius.sqrt() * 3.0).clamp(6.0, 32.0) as usize;
        match dice.weighted(&[1.6, 1.2, 0.8, 1.0, 0.8, 0.9, 1.6, 1.0, 0.7, 0.5, 0.6]) {
            0 => (Shape::cuboid(), false),
            1 => (Shape::ball(detail, |_| 1.0), false),
            2 => (Shape::torus(detail, dice.range(0.12, 0.45)), false),
            3 => (bumpy(dice, detail), false),
            4 => (
                Shape::cylinder(detail, dice.pick(&[1.0, 1.0, 0.5, 0.0])),
                false,
            ),
            5 => {
                let points = dice.integer(2, 9);
                let thickness = dice.range(0.05, 0.5);
                let outline = star(points, dice.range(0.3, 1.0));
                (
                    Shape::prism(&outline).moved(
                        [1.0, 1.0, thickness],
                        turn([0.0, 0.0, 1.0], 0.0),
                        [0.0; 3],
                    ),
                    false,
                )
            }
            6 => (Shape::sheet(), true),
            7 => {
                let points = dice.integer(2, 9);
                (Shape::polygon(&star(points, dice.range(0.3, 1.0))), true)
            }
            8 => {
                // A sheet that waves.
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
            9 => (knot(dice, detail), false),
            _ => (swarm(dice), true),
        }
    }

    /// `at`: x and y in parts of the frame, z as it is.
    fn place(&self, scale_px: [f64; 3], rotation: [[f64; 3]; 3], deep: f64, at: [f64; 3]) -> Place {
        Place {
            scale_px,
            rotation,
            depth_per_px: deep * DEPTH_PER_PX,
            centre: [at[0] * self.width, at[1] * self.height, at[2]],
            light: self.light,
        }
    }

    /// A texture whose contrast is one of `contrasts`, of the largest that its colours have; 0 is a plain surface.
    fn texture(&mut self, size: (usize, usize), contrasts: &[f32]) -> Texture {
        let ramp = [0; 3].map(|_| self.palette.colour(&mut self.dice));
        let contrast = self.dice.pick(contrasts);
        let ramp = ramp.map(|colour| {
            std::array::from_fn(|c| ramp[1][c] + (colour[c] - ramp[1][c]) * contrast)
        });
        let pattern = self.pattern(size);
        let dice = &mut self.dice;
        if dice.chance(0.5) {
            let grain = Pattern::noise(size, (size.0 / 4, size.1 / 4), 2, 0.7, dice);
            return pattern
                .mixed(&grain, dice.range(0.05, 0.3) as f32)
                .texture(ramp);
        }
        pattern.texture(ramp)
    }

    fn pattern(&mut self, size: (usize, usize)) -> Pattern {
        let dice = &mut self.dice;
        // Features of 3 texels at least.
        let finest = (size.0.min(size.1) as f64 / 6.0).max(1.0);
        let repeats = |dice: &mut Dice| dice.log_range(1.0, finest.min(16.0)) as usize;
        match dice.weighted(&[4.0, 1.5, 0.8, 0.8, 0.8, 0.8, 0.8, 0.6, 0.6]) {
            0 => {
                let cells = repeats(dice);
                let stretch = dice.pick(&[1, 1, 1, 4]);
                Pattern::noise(
                    size,
                    (cells, cells * stretch),
                    6,
                    dice.range(0.35, 0.85) as f32,
                    dice,
                )
            }
            1 => {
                let waves = (
                    repeats(dice) as i32,
                    if dice.chance(0.5) {
                        0
                    } else {
                        repeats(dice) as i32
                    },
                );
                let waves = if dice.chance(0.5) {
                    (waves.1, -waves.0)
                } else {
                    waves
                };
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

    /// Where a sheet has holes: lattices, sieves, writing, tatters.
    fn holes(&mut self, size: (usize, usize)) -> Pattern {
        let dice = &mut self.dice;
        let count = dice.integer(2, (size.0.min(size.1) / 8).clamp(2, 8));
        match dice.integer(0, 4) {
            0 => Pattern::stripes(size, (count as i32, 0), 0.0, 0.2, dice),
            1 => {
                let bars = dice.range(0.15, 0.4) as f32;
                let inside = |x: usize, n: usize| {
                    ((x as f32 + 0.5) / n as f32 * count as f32).fract() < bars
                };
                Pattern::from_fn(size, |x, y| {
                    f32::from(u8::from(inside(x, size.0) || inside(y, size.1)))
                })
            }
            2 => Pattern::spots(size, count, dice.range(0.2, 0.45) as f32, dice),
            3 => Pattern::strokes(size, count.min(4), dice.range(0.1, 0.25) as f32, dice),
            _ => Pattern::noise(size, (count, count), 3, 0.5, dice),
        }
    }
}

impl Palette {
    fn colour(&self, dice: &mut Dice) -> [f32; 3] {
        let hue = self.hue + self.hue_spread * dice.range(-1.0, 1.0);
        let saturation = dice.range(self.saturation[0], self.saturation[1]);
        let brightness = dice.range(self.brightness[0], self.brightness[1]);
        // Hue on the hexagon of full colours, red at 0, green at ⅓, blue at ⅔.
        [0.0, 2.0 / 3.0, 1.0 / 3.0].map(|offset| {
            let t = hue + offset;
            let pure = ((6.0 * (t - t.floor()) - 3.0).abs() - 1.0).clamp(0.0, 1.0);
            (brightness * (1.0 - saturation * (1.0 - pure))) as f32
        })
    }
}

/// An object's half sizes in pixels: bars, plates and lumps.
fn stretch(dice: &mut Dice, radius: f64, flat: bool) -> [f64; 3] {
    let thinnest = (1.0 / radius).min(1.0);
    match dice.weighted(&[1.0, 1.0, 0.5]) {
        0 => [radius; 3],
        1 => [0; 3].map(|_| radius * dice.range(0.35, 1.0)),
        // A rod, a slat: longer than the rest is large.
        _ => {
            let thin = dice.log_range(0.04, 0.25).max(thinnest);
            let other = if flat { 1.0 } else { thin };
            [radius * thin, 1.6 * radius, radius * other]
        }
    }
}

/// The mesh moved along z, and pressed flatter if need be, so that it lies inside the volume about `depth`: at the
/// ends of the volume its nearest or farthest point touches them.
fn settle(mut mesh: Mesh, depth: f64) -> Mesh {
    let heights = || mesh.positions.iter().map(|p| f64::from(p[2]));
    let (low, high) = heights().fold((f64::MAX, f64::MIN), |(low, high), z| {
        (low.min(z), high.max(z))
    });
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

/// A ball with waves on it.
fn bumpy(dice: &mut Dice, detail: usize) -> Shape {
    let waves = [0; 3].map(|_| {
        (
            dice.direction(),
            dice.range(1.5, 6.0),
            dice.range(0.05, 0.22),
        )
    });
    let bumpy = move |p: [f64; 3]| {
        let bump = |(d, rate, height): ([f64; 3], f64, f64)| {
            height * libm::sin(rate * (p[0] * d[0] + p[1] * d[1] + p[2] * d[2]) + 7.0 * d[0])
        };
        0.8 + waves.into_iter().map(bump).sum::<f64>()
    };
    Shape::ball(detail, bumpy)
}

/// A tube along a torus knot.
fn knot(dice: &mut Dice, detail: usize) -> Shape {
    let (turns, lobes) = dice.pick(&[(2.0, 3.0), (3.0, 2.0), (2.0, 5.0), (1.0, 6.0)]);
    let wide = dice.range(0.2, 0.4);
    let curve = |t: f64| {
        let (sin_a, cos_a) = libm::sincos(TAU * turns * t);
        let (sin_b, cos_b) = libm::sincos(TAU * lobes * t);
        let r = 1.0 - wide + wide * cos_b;
        [r * cos_a, r * sin_a, wide * sin_b]
    };
    Shape::loop_tube(3 * detail, dice.range(0.05, 0.14), curve)
}

/// Leaves, confetti, gravel.
fn swarm(dice: &mut Dice) -> Shape {
    let leaf = Shape::polygon(&star(dice.integer(2, 4), dice.range(0.4, 1.0)));
    let mut swarm = Shape::default();
    for _ in 0..dice.integer(6, 24) {
        let size = dice.range(0.08, 0.3);
        let (sin, cos) = libm::sincos(TAU * dice.unit());
        let tilt = turn([cos, sin, 0.0], dice.range(0.0, 1.2));
        let [x, y, z] = dice.direction();
        swarm.append(&leaf.clone().moved([size; 3], tilt, [x, y, z]));
    }
    swarm
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::render_ldi_reference;
    use super::*;
    use crate::ldi::Ldi;

    fn rendered(seed: u64, height: usize, width: usize) -> Ldi {
        render_ldi_reference(&random_scene(seed, height, width), height, width, 5).unwrap()
    }

    /// FNV-1a over what the LDI's PNGs hold.
    fn fingerprint(ldi: &Ldi) -> u64 {
        let codes = ldi.quantized().layers.into_iter().flat_map(|layer| {
            let colours = layer.rgb.into_iter().map(|v| (v * 255.0).round() as u32);
            let depths = layer.depth.into_iter().map(|d| {
                if d.is_nan() {
                    u32::MAX
                } else {
                    (d * 65535.0).round() as u32
                }
            });
            colours.chain(depths).collect::<Vec<_>>()
        });
        codes.fold(0xcbf2_9ce4_8422_2325, |hash, code| {
            (hash ^ u64::from(code)).wrapping_mul(0x100_0000_01b3)
        })
    }

    /// These numbers are what any machine must get: data sets made in parts on several belong together.
    #[test]
    fn a_seed_is_one_scene_on_every_machine() {
        assert_eq!(
            [3, 4].map(|seed| format!("{:016x}", fingerprint(&rendered(seed, 96, 80)))),
            ["8b01907bb1bc3895", "575e04e964b74391"]
        );
    }

    #[test]
    fn scenes_render_at_any_size() {
        for (height, width) in [(1, 1), (3, 200), (61, 47), (40, 270)] {
            for seed in 0..8 {
                let scene = random_scene(seed, height, width);
                scene.check().unwrap();
                for mesh in &scene.meshes {
                    assert!(
                        mesh.positions.iter().all(|p| p[2].abs() <= 0.5),
                        "all of a scene lies in the volume"
                    );
                }
                assert_eq!(rendered(seed, height, width).shape(), (height, width));
            }
        }
    }

    #[test]
    fn what_is_seen_is_spread_over_the_volume() {
        let mut deciles = [0.0f64; 10];
        let mut layers = [0; 5];
        for seed in 0..50 {
            let ldi = rendered(seed, 384, 384);
            for &d in ldi.layers[0].depth.iter().filter(|d| !d.is_nan()) {
                deciles[((d * 10.0) as usize).min(9)] += 1.0;
            }
            for (count, layer) in layers.iter_mut().zip(&ldi.layers) {
                *count += layer.depth.iter().filter(|d| !d.is_nan()).count();
            }
        }
        let total: f64 = deciles.iter().sum();
        let shares = deciles.map(|count| count / total);
        assert!(
            shares.iter().all(|share| (0.05..=0.16).contains(share)),
            "{shares:.3?}"
        );
        // The paper: valid pixels become few with each layer; the fifth still has some.
        assert!(
            layers
                .windows(2)
                .all(|pair| pair[1] * 2 < pair[0] * 3 && pair[1] < pair[0]),
            "{layers:?}"
        );
        assert!(layers[4] > 0, "{layers:?}");
    }
}
