//! Random scenes like photographs: bright and dark ones, a background that fills the frame, textures whose power falls
//! as 1/f² with colours that vary together, objects and depth steps of all sizes, thin things and writing.
//!
//! Nothing here depends on the machine: chance comes from [`Dice`], sines and powers from `libm`.

use std::f64::consts::TAU;
use std::sync::Arc;

use super::dice::Dice;
use super::parts::{DEPTH_PER_PX, MARGIN, holes, pattern, settle, shape, stretch, turned};
use super::pattern::Pattern;
use super::shapes::{Light, Place, Shape, turn};
use super::{Mesh, Scene, Texture};

/// Most texels of a texture along a side. Larger surfaces show larger texels.
const MAX_TEXELS: f64 = 432.0;
/// Pieces of the background along a side.
const PIECES: usize = 32;
/// What red, green and blue gain where a colour is warmer, and where it is more purple.
const WARMER: [f64; 3] = [0.5, 0.0, -0.5];
const PURPLER: [f64; 3] = [0.25, -0.5, 0.25];

/// A random scene like a photograph for a frame of `height` x `width` pixels. Surfaces show pieces of `photographs`
/// where there are any. The same arguments give the same scene on every machine.
pub fn natural_scene(seed: u64, height: usize, width: usize, photographs: &[Texture]) -> Scene {
    let mut dice = Dice::new(seed);
    let ground = Ground::new(&mut dice);
    let mut maker = Maker::new(dice, height as f64, width as f64, ground, photographs);
    let mut meshes: Vec<Mesh> = (0..maker.dice.log_range(40.0, 300.0) as usize)
        .map(|_| maker.object())
        .collect();
    meshes.extend((0..maker.dice.pick(&[0, 0, 0, 1, 2, 3])).map(|_| maker.writing()));
    meshes.extend((0..maker.dice.pick(&[0, 0, 1, 2, 4, 8])).map(|_| maker.wire()));
    meshes.extend((0..maker.dice.pick(&[0, 0, 0, 1, 2])).map(|_| maker.branches()));
    meshes.push(maker.background());
    Scene { meshes }
}

/// How deep the background lies, on a grid over the frame.
struct Ground(Vec<f64>);

impl Ground {
    fn new(dice: &mut Dice) -> Self {
        let depth_at = Self::depths(dice);
        let along = |i: usize| i as f64 / PIECES as f64;
        let depths = (0..=PIECES).flat_map(|j| (0..=PIECES).map(move |i| (i, j)));
        Self(
            depths
                .map(|(i, j)| depth_at(along(i), along(j)).clamp(0.02, 1.0 - MARGIN))
                .collect(),
        )
    }

    /// The depth at (u, v), u from the left and v from below, both in [0, 1].
    fn depths(dice: &mut Dice) -> Box<dyn Fn(f64, f64) -> f64> {
        // A plane by its depth at the frame's middle and what it gains toward the edge in a direction.
        let plane = |dice: &mut Dice, middle: [f64; 2], slope: [f64; 2], angle: f64| {
            let (middle, slope) = (dice.range(middle[0], middle[1]), dice.range(slope[0], slope[1]));
            let (sin, cos) = libm::sincos(angle);
            move |u: f64, v: f64| middle + slope * (cos * (2.0 * u - 1.0) + sin * (2.0 * v - 1.0))
        };
        let any = TAU * dice.unit();
        match dice.weighted(&[0.3, 0.3, 0.2, 0.2]) {
            0 => Box::new(plane(dice, [0.5, 1.0], [0.0, 0.5], any)),
            1 => {
                // A floor that rises to a wall, the camera a little aslant.
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
                let relief = Pattern::noise((side, side), (cells, cells), 4, rough, dice);
                let (far, height) = (dice.range(0.7, 1.0), dice.range(0.1, 0.8));
                Box::new(move |u, v| {
                    let [i, j] = [u, v].map(|t| (t * PIECES as f64 + 0.5) as usize);
                    far - height * f64::from(relief.at(i, j))
                })
            }
        }
    }

    fn at(&self, u: f64, v: f64) -> f64 {
        let [i, j] = [u, v].map(|t| (t.clamp(0.0, 1.0) * PIECES as f64 + 0.5) as usize);
        self.0[j * (PIECES + 1) + i]
    }
}

/// One scene in the making: its frame, and what its surfaces have in common.
struct Maker<'a> {
    dice: Dice,
    height: f64,
    width: f64,
    ground: Ground,
    photographs: &'a [Texture],
    light: Light,
    /// About how bright surfaces are.
    exposure: f64,
    /// How far colours stand from grey.
    colourfulness: f64,
    /// How much of its own brightness a texture varies by.
    contrast: f64,
    /// Radii of the smallest and the largest objects, in pixels.
    radii: [f64; 2],
}

impl<'a> Maker<'a> {
    fn new(mut dice: Dice, height: f64, width: f64, ground: Ground, photographs: &'a [Texture]) -> Self {
        let [x, y, z] = dice.direction();
        let toward = z.abs() + 0.5;
        let length = (x * x + y * y + toward * toward).sqrt();
        let light = Light {
            direction: [x / length, y / length, toward / length],
            ambient: dice.range(0.4, 0.95),
        };
        let largest = height.min(width) * dice.log_range(0.12, 0.4);
        Self {
            height,
            width,
            ground,
            photographs,
            light,
            exposure: dice.range(0.2, 1.3),
            colourfulness: dice.pick(&[0.05, 0.15, 0.3, 0.5, 0.9]),
            contrast: dice.range(0.6, 2.0),
            radii: [dice.range(2.0, 6.0).min(largest), largest],
            dice,
        }
    }

    fn background(&mut self) -> Mesh {
        let size = [self.width, self.height].map(|v| v.clamp(1.0, MAX_TEXELS) as usize);
        let texture = self.texture((size[0], size[1]));
        let (ground, w, h) = (&self.ground, 1.02 * self.width, 1.02 * self.height);
        let sheet = Shape::grid(PIECES, PIECES, |u, v| {
            let z = (0.5 - ground.at(u, v)) / DEPTH_PER_PX;
            [w * (u - 0.5), h * (v - 0.5), z]
        });
        let place = self.place([1.0; 3], turn([0.0, 0.0, 1.0], 0.0), DEPTH_PER_PX, [0.5; 2]);
        sheet.place(&place, Arc::new(texture))
    }

    /// A thing in front of the background: by little or by much, or anywhere in the volume.
    fn object(&mut self) -> Mesh {
        let radius = self.radius();
        let (shape, flat) = shape(&mut self.dice, radius);
        let scale = stretch(&mut self.dice, radius, flat);
        let rotation = turned(&mut self.dice, flat);
        let size = texels(scale[0].max(scale[1]).max(scale[2]));
        let mut texture = self.texture(size);
        if self.dice.chance(if flat { 0.25 } else { 0.04 }) {
            texture = holes(&mut self.dice, size).cut(&texture);
        }
        let at = self.somewhere();
        let depth = self.before_the_ground(at);
        let deep = DEPTH_PER_PX * self.dice.log_range(0.5, 5.0);
        let mesh = shape.place(&self.place(scale, rotation, deep, at), Arc::new(texture));
        settle(mesh, depth)
    }

    /// A page, a sign: dark on bright or bright on dark, or with the letters alone.
    fn writing(&mut self) -> Mesh {
        let radius = self.radii[1] * self.dice.range(0.3, 1.0);
        let aspect = self.dice.log_range(0.4, 1.0);
        let scale = [radius, radius * aspect, 1.0];
        let size = texels(radius);
        // Strokes of a texel's width at least.
        let most = (size.1 / 12).max(2);
        let lines = self.dice.integer(1, most.min(14));
        let thickness = self.dice.range(0.08, 0.25) as f32;
        let strokes = Pattern::strokes(size, lines, thickness, &mut self.dice);
        let mut colours = [self.colour(), self.colour()];
        let (dark, bright) = (self.dice.range(0.0, 0.35) as f32, self.dice.range(0.8, 1.4) as f32);
        let inverse = self.dice.chance(0.4);
        for (colour, gain) in colours
            .iter_mut()
            .zip(if inverse { [dark, bright] } else { [bright, dark] })
        {
            *colour = colour.map(|v| (v * gain).min(1.0));
        }
        let [paper, ink] = colours;
        let middle = std::array::from_fn(|c| 0.5 * (paper[c] + ink[c]));
        let mut texture = strokes.texture([paper, middle, ink]);
        if self.dice.chance(0.2) {
            texture = strokes.cut(&texture);
        }
        let (sin, cos) = libm::sincos(TAU * self.dice.unit());
        let tilt = turn([cos, sin, 0.0], self.dice.range(0.0, 1.1));
        let at = self.somewhere();
        let depth = self.before_the_ground(at);
        let deep = DEPTH_PER_PX * self.dice.log_range(0.5, 5.0);
        let mesh = Shape::sheet().place(&self.place(scale, tilt, deep, at), Arc::new(texture));
        settle(mesh, depth)
    }

    /// A thread that hangs across a part of the frame, one to five pixels thick, one end deeper than the other.
    fn wire(&mut self) -> Mesh {
        let length = self.width.max(self.height) * self.dice.log_range(0.2, 1.4);
        let half = self.dice.log_range(0.5, 2.5);
        let sag = length * self.dice.range(0.0, 0.2);
        let angle = TAU * self.dice.unit();
        let at = self.somewhere();
        let from = self.before_the_ground(at);
        let drop = self.dice.range(-0.5, 0.5) * self.dice.unit();
        let thread = Shape::grid(24, 1, |u, v| {
            let hang = sag * (4.0 * u * (u - 1.0) + 0.5);
            [length * (u - 0.5), hang + half * (2.0 * v - 1.0), drop * (u - 0.5)]
        });
        self.thin(thread, turn([0.0, 0.0, 1.0], angle), at, from)
    }

    /// Twigs, grass, cracks: straight pieces that fork and grow thinner.
    fn branches(&mut self) -> Mesh {
        let side = self.width.min(self.height);
        let length = side * self.dice.log_range(0.08, 0.3);
        let half = self.dice.log_range(0.8, 4.0);
        let mut tips = vec![([0.0, 0.0, 0.0], TAU * self.dice.unit(), length, half)];
        let mut shape = Shape::default();
        let mut pieces = self.dice.integer(6, 60);
        while let Some((from, angle, length, half)) = tips.pop() {
            let (sin, cos) = libm::sincos(angle);
            let lean = self.dice.range(-0.03, 0.03);
            let to = [from[0] - sin * length, from[1] + cos * length, from[2] + lean];
            let middle = std::array::from_fn(|i| 0.5 * (from[i] + to[i]));
            let along = turn([0.0, 0.0, 1.0], angle);
            shape.append(&Shape::sheet().moved([half, 0.5 * length, 1.0], along, middle));
            for _ in 0..self.dice.integer(1, 3) {
                if pieces > 0 {
                    pieces -= 1;
                    let bent = angle + self.dice.range(-0.8, 0.8);
                    let shorter = length * self.dice.range(0.6, 0.95);
                    // Breadth first, so that no single twig takes all pieces.
                    tips.insert(0, (to, bent, shorter, (half * 0.8).max(0.5)));
                }
            }
        }
        let at = self.somewhere();
        let depth = self.before_the_ground(at);
        self.thin(shape, turn([0.0, 0.0, 1.0], 0.0), at, depth)
    }

    /// A shape of pixels across and up whose z is depth already.
    fn thin(&mut self, shape: Shape, rotation: [[f64; 3]; 3], at: [f64; 2], depth: f64) -> Mesh {
        let mut colour = self.colour();
        if self.dice.chance(0.5) {
            colour = colour.map(|v| 0.25 * v);
        }
        let texture = Arc::new(Texture::plain(colour));
        settle(shape.place(&self.place([1.0; 3], rotation, 1.0, at), texture), depth)
    }

    fn radius(&mut self) -> f64 {
        let t = libm::pow(self.dice.unit(), 1.1);
        self.radii[0] * libm::pow(self.radii[1] / self.radii[0], t)
    }

    /// A place in parts of the frame, from its left and top.
    fn somewhere(&mut self) -> [f64; 2] {
        [0; 2].map(|_| self.dice.range(-0.05, 1.05))
    }

    fn before_the_ground(&mut self, at: [f64; 2]) -> f64 {
        let ground = self.ground.at(at[0], 1.0 - at[1]);
        if self.dice.chance(0.5) {
            ground * (1.0 - self.dice.log_range(0.01, 1.0))
        } else {
            ground * self.dice.unit()
        }
    }

    fn place(&self, scale_px: [f64; 3], rotation: [[f64; 3]; 3], depth_per_px: f64, at: [f64; 2]) -> Place {
        Place {
            scale_px,
            rotation,
            depth_per_px,
            centre: [at[0] * self.width, at[1] * self.height, 0.0],
            light: Some(self.light),
        }
    }

    /// A piece of a photograph, or a texture of chance: of one natural surface, or of two in a pattern.
    fn texture(&mut self, size: (usize, usize)) -> Texture {
        if !self.photographs.is_empty() && self.dice.chance(0.7) {
            let index = self.dice.integer(0, self.photographs.len() - 1);
            return piece(&self.photographs[index], size, &mut self.dice);
        }
        let mut surface = self.surface(size);
        if self.dice.chance(0.35) {
            let other = self.surface(size);
            let pattern = pattern(&mut self.dice, size);
            for (index, (mine, its)) in surface.iter_mut().zip(other).enumerate() {
                let t = pattern.at(index % size.0, index / size.0);
                *mine = std::array::from_fn(|c| mine[c] + t * (its[c] - mine[c]));
            }
        }
        let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
        let texels = surface.into_iter().map(|[r, g, b]| [byte(r), byte(g), byte(b), 255]);
        Texture::sized(size.0, size.1, texels.collect())
    }

    /// The colours of one material: brightness, and less and smoother than it hue, vary about a mean as 1/f² noise.
    fn surface(&mut self, size: (usize, usize)) -> Vec<[f32; 3]> {
        let mean = self.colour();
        let dice = &mut self.dice;
        let noise = |dice: &mut Dice, roughness: f32| {
            let cells = dice.integer(1, 4);
            Pattern::noise(size, (cells, cells), 8, roughness, dice)
        };
        let rough = dice.range(0.6, 1.0) as f32;
        let brightness = noise(dice, rough);
        let [warmth, purple] = [0; 2].map(|_| noise(dice, 0.7 * rough));
        let contrast = (2.0 * self.contrast * dice.range(0.1, 1.0)) as f32;
        let tint = contrast * (self.colourfulness * dice.unit()) as f32;
        (0..size.0 * size.1)
            .map(|index| {
                let (x, y) = (index % size.0, index / size.0);
                let [l, a, b] = [&brightness, &warmth, &purple].map(|noise| noise.at(x, y) - 0.5);
                std::array::from_fn(|c| {
                    let hue = a * WARMER[c] as f32 + b * PURPLER[c] as f32;
                    mean[c] * (1.0 + contrast * l + tint * hue)
                })
            })
            .collect()
    }

    /// A colour of this scene, in [0, 1].
    fn colour(&mut self) -> [f32; 3] {
        let dice = &mut self.dice;
        let brightness = self.exposure * dice.log_range(0.3, 2.0);
        let [warmth, purple] = [0; 2].map(|_| self.colourfulness * dice.range(-1.0, 1.0));
        std::array::from_fn(|c| {
            let hue = 1.0 + warmth * WARMER[c] + purple * PURPLER[c];
            (brightness * hue).clamp(0.0, 1.0) as f32
        })
    }
}

/// The size of the texture of a thing whose largest radius is `radius` pixels: two texels a pixel, up to a limit.
fn texels(radius: f64) -> (usize, usize) {
    let size = 2 * radius.round().clamp(4.0, MAX_TEXELS / 4.0) as usize;
    (size, size)
}

/// A piece of `photograph` as a texture of `size`, each texel the mean of a square of it: somewhere in it, as coarse as
/// may be.
fn piece(photograph: &Texture, size: (usize, usize), dice: &mut Dice) -> Texture {
    let (width, height) = (photograph.width(), photograph.height());
    let largest = (width / size.0).min(height / size.1).max(1);
    let square = dice.integer(1, largest);
    let corner = |dice: &mut Dice, whole: usize, part: usize| dice.integer(0, whole.saturating_sub(part * square));
    let (left, top) = (corner(dice, width, size.0), corner(dice, height, size.1));
    let mean = |x: usize, y: usize| {
        let mut sum = [0u32; 3];
        for (j, i) in (0..square).flat_map(|j| (0..square).map(move |i| (j, i))) {
            let row = (top + y * square + j) % height;
            let texel = photograph.texels()[row * width + (left + x * square + i) % width];
            (0..3).for_each(|c| sum[c] += u32::from(texel[c]));
        }
        let count = (square * square) as u32;
        let [r, g, b] = sum.map(|sum| ((sum + count / 2) / count) as u8);
        [r, g, b, 255]
    };
    let texels = (0..size.0 * size.1).map(|index| mean(index % size.0, index / size.0));
    Texture::sized(size.0, size.1, texels.collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::random::tests::fingerprint;
    use super::super::render_ldi_reference;
    use super::*;
    use crate::ldi::Ldi;

    fn rendered(seed: u64, size: usize, photographs: &[Texture]) -> Ldi {
        let scene = natural_scene(seed, size, size, photographs);
        render_ldi_reference(&scene, size, size, 5).unwrap()
    }

    fn gradient(width: usize, height: usize) -> Texture {
        let texel = |i: usize| [(i % width) as u8, (i / width) as u8, 7, 255];
        Texture::new(width, height, (0..width * height).map(texel).collect()).unwrap()
    }

    /// These numbers are what any machine must get: data sets made in parts on several belong together.
    #[test]
    fn a_seed_is_one_scene_on_every_machine() {
        let photographs = [gradient(150, 90), gradient(20, 30)];
        let of = |seed, photographs: &[Texture]| format!("{:016x}", fingerprint(&rendered(seed, 96, photographs)));
        assert_eq!(
            [of(3, &[]), of(4, &[]), of(3, &photographs)],
            ["e48e8ddd55bf67de", "0bc8a2f21e96a15a", "fa42d97255cb3f1b"]
        );
    }

    #[test]
    fn scenes_render_at_any_size_and_fill_the_frame() {
        for (height, width) in [(1, 1), (3, 200), (61, 47), (40, 270)] {
            for seed in 0..8 {
                let scene = natural_scene(seed, height, width, &[gradient(9, 5)]);
                scene.check().unwrap();
                let inside = |mesh: &Mesh| mesh.positions.iter().all(|p| p[2].abs() <= 0.5);
                assert!(scene.meshes.iter().all(inside), "all lies in the volume");
                let ldi = render_ldi_reference(&scene, height, width, 5).unwrap();
                assert!(ldi.layers[0].depth.iter().all(|d| !d.is_nan()));
            }
        }
    }

    #[test]
    fn brightness_and_depth_are_spread_as_photographs_have_them() {
        let (mut means, mut deciles, mut steps) = (Vec::new(), [0.0f64; 10], [0usize; 4]);
        for seed in 0..60 {
            let ldi = rendered(seed, 192, &[]);
            let front = &ldi.layers[0];
            means.push(f64::from(front.rgb.mean().unwrap()));
            for &d in &front.depth {
                deciles[((d * 10.0) as usize).min(9)] += 0.1 / (60.0 * 19.2 * 192.0);
            }
            // Steps between neighbours beyond what slanted planes have, a decade of size each.
            for pair in front.depth.windows((1, 2)) {
                let step = (pair[(0, 1)] - pair[(0, 0)]).abs();
                let class = [0.01, 0.03, 0.1, 0.3].iter().rposition(|&least| step > least);
                class.into_iter().for_each(|class| steps[class] += 1);
            }
        }
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        assert!((0.4..0.5).contains(&mean), "mean amplitude {mean:.3}");
        let share = |is: &dyn Fn(f64) -> bool| means.iter().filter(|&&m| is(m)).count();
        assert!(share(&|m| m < 0.3) >= 6 && share(&|m| m > 0.6) >= 6, "{means:.2?}");
        assert!(deciles.iter().all(|d| (0.02..0.25).contains(d)), "{deciles:.3?}");
        assert!(steps.iter().all(|&count| count > 3000), "{steps:?}");
    }
}
