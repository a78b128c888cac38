//! Photograph-like random scenes. They are bright or dark, with a background that fills the frame, textures whose power
//! falls as 1/f² and whose colours vary together, objects and depth steps of all sizes, thin objects and writing.
//!
//! The scenes do not depend on the machine: random numbers come from [`Dice`], sines and powers from `libm`.

use crate::scene::pattern::Pattern;
use crate::scene::random::ground::Ground;
use crate::scene::random::parts::{DEPTH_PER_PX, holes, light, pattern, settle, shape, stretch, turned};
use crate::scene::random::photographs::piece;
use crate::scene::random::thin;
use crate::scene::shapes::{Light, Place, Shape, turn};
use crate::scene::{Mesh, Scene, Texture};
use phasefront::Size;
use phasefront_io::dice::Dice;
use std::f64::consts::TAU;
use std::sync::Arc;

/// The most texels of a texture along a side. Larger surfaces show larger texels.
const MAX_TEXELS: f64 = 432.0;
/// The change of red, green and blue in a warmer and in a more purple colour.
const WARMER: [f64; 3] = [0.5, 0.0, -0.5];
const PURPLER: [f64; 3] = [0.25, -0.5, 0.25];

/// Makes a random photograph-like scene for a frame of `size`. Surfaces show pieces of `photographs`
/// if there are any. The same arguments give the same scene on every machine.
pub fn natural_scene(seed: u64, size: Size, photographs: &[Texture]) -> Scene {
    let Size { width, height } = size;
    let mut dice = Dice::new(seed);
    let ground = Ground::natural(&mut dice);
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

/// A scene under construction: its frame, and the common properties of its surfaces.
struct Maker<'a> {
    dice: Dice,
    height: f64,
    width: f64,
    ground: Ground,
    photographs: &'a [Texture],
    light: Light,
    /// The typical brightness of surfaces.
    exposure: f64,
    /// The distance of colours from grey.
    colourfulness: f64,
    /// The variation of a texture as a fraction of its brightness.
    contrast: f64,
    /// The radii of the smallest and the largest objects, in pixels.
    radii: [f64; 2],
}

impl<'a> Maker<'a> {
    fn new(mut dice: Dice, height: f64, width: f64, ground: Ground, photographs: &'a [Texture]) -> Self {
        let light = light(&mut dice, 0.5, [0.4, 0.95]);
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
        let texture = self.texture(Size {
            width: size[0],
            height: size[1],
        });
        let sheet = self.ground.sheet(self.width, self.height);
        let place = self.place([1.0; 3], turn([0.0, 0.0, 1.0], 0.0), DEPTH_PER_PX, [0.5; 2]);
        sheet.place(&place, Arc::new(texture))
    }

    /// Makes an object in front of the background: close to it, far from it, or anywhere in the volume.
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

    /// Makes a page or a sign: dark on bright, bright on dark, or only the letters.
    fn writing(&mut self) -> Mesh {
        let radius = self.radii[1] * self.dice.range(0.3, 1.0);
        let aspect = self.dice.log_range(0.4, 1.0);
        let scale = [radius, radius * aspect, 1.0];
        let size = texels(radius);
        // Strokes are at least a texel wide.
        let most = (size.height / 12).max(2);
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

    /// Makes a thread that hangs across a part of the frame. It is one to five pixels thick, and one end is deeper than
    /// the other.
    fn wire(&mut self) -> Mesh {
        let length = self.width.max(self.height) * self.dice.log_range(0.2, 1.4);
        let half = self.dice.log_range(0.5, 2.5);
        let sag = length * self.dice.range(0.0, 0.2);
        let angle = TAU * self.dice.unit();
        let at = self.somewhere();
        let from = self.before_the_ground(at);
        let drop = self.dice.range(-0.5, 0.5) * self.dice.unit();
        self.thin(
            thin::wire(length, half, sag, drop),
            turn([0.0, 0.0, 1.0], angle),
            at,
            from,
        )
    }

    /// Makes twigs, grass or cracks: straight pieces that fork and become thinner.
    fn branches(&mut self) -> Mesh {
        let side = self.width.min(self.height);
        let length = side * self.dice.log_range(0.08, 0.3);
        let half = self.dice.log_range(0.8, 4.0);
        let shape = thin::branches(&mut self.dice, length, half);
        let at = self.somewhere();
        let depth = self.before_the_ground(at);
        self.thin(shape, turn([0.0, 0.0, 1.0], 0.0), at, depth)
    }

    /// Places a shape whose x and y are in pixels and whose z is already a depth.
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

    /// Returns a random position, as fractions of the frame from its left and top.
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

    /// Makes a piece of a photograph, or a random texture of one natural surface or of two in a pattern.
    fn texture(&mut self, size: Size) -> Texture {
        if !self.photographs.is_empty() && self.dice.chance(0.7) {
            let index = self.dice.integer(0, self.photographs.len() - 1);
            return piece(&self.photographs[index], size, &mut self.dice);
        }
        let mut surface = self.surface(size);
        if self.dice.chance(0.35) {
            let other = self.surface(size);
            let pattern = pattern(&mut self.dice, size);
            for (index, (mine, its)) in surface.iter_mut().zip(other).enumerate() {
                let t = pattern.at(index % size.width, index / size.width);
                *mine = std::array::from_fn(|c| mine[c] + t * (its[c] - mine[c]));
            }
        }
        let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
        let texels = surface.into_iter().map(|[r, g, b]| [byte(r), byte(g), byte(b), 255]);
        Texture::sized(size, texels.collect())
    }

    /// Makes the colours of one material. Brightness varies around a mean as 1/f² noise; hue varies less and more
    /// smoothly.
    fn surface(&mut self, size: Size) -> Vec<[f32; 3]> {
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
        (0..size.pixels())
            .map(|index| {
                let (x, y) = (index % size.width, index / size.width);
                let [l, a, b] = [&brightness, &warmth, &purple].map(|noise| noise.at(x, y) - 0.5);
                std::array::from_fn(|c| {
                    let hue = a * WARMER[c] as f32 + b * PURPLER[c] as f32;
                    mean[c] * (1.0 + contrast * l + tint * hue)
                })
            })
            .collect()
    }

    /// Returns a colour of this scene, in [0, 1].
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

/// Returns the size of the texture of an object whose largest radius is `radius` pixels: two texels per pixel, up to a
/// limit.
fn texels(radius: f64) -> Size {
    let size = 2 * radius.round().clamp(4.0, MAX_TEXELS / 4.0) as usize;
    Size {
        width: size,
        height: size,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::scene::random::objects::tests::fingerprint;
    use crate::scene::render_ldi_reference;
    use phasefront_io::ldi::Ldi;

    fn rendered(seed: u64, size: usize, photographs: &[Texture]) -> Ldi {
        let scene = natural_scene(
            seed,
            Size {
                width: size,
                height: size,
            },
            photographs,
        );
        render_ldi_reference(
            &scene,
            Size {
                width: size,
                height: size,
            },
            5,
        )
        .unwrap()
    }

    fn gradient(size: Size) -> Texture {
        let Size { width, height } = size;
        let texel = |i: usize| [(i % width) as u8, (i / width) as u8, 7, 255];
        Texture::new(size, (0..width * height).map(texel).collect()).unwrap()
    }

    /// Every machine must reproduce these numbers, because a data set may be made in parts on several machines.
    #[test]
    fn a_seed_is_one_scene_on_every_machine() {
        let photographs = [
            gradient(Size { width: 150, height: 90 }),
            gradient(Size { width: 20, height: 30 }),
        ];
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
                let scene = natural_scene(seed, Size { width, height }, &[gradient(Size { width: 9, height: 5 })]);
                scene.check().unwrap();
                let inside = |mesh: &Mesh| mesh.positions.iter().all(|p| p[2].abs() <= 0.5);
                assert!(scene.meshes.iter().all(inside), "all lies in the volume");
                let ldi = render_ldi_reference(&scene, Size { width, height }, 5).unwrap();
                assert!(ldi.layers[0].depth.iter().all(|d| !d.is_nan()));
            }
        }
    }

    #[test]
    #[ignore = "slow: 15 seconds of a core"]
    fn brightness_and_depth_are_spread_as_photographs_have_them() {
        let (mut means, mut deciles, mut steps) = (Vec::new(), [0.0f64; 10], [0usize; 4]);
        for seed in 0..60 {
            let ldi = rendered(seed, 192, &[]);
            let front = &ldi.layers[0];
            means.push(f64::from(front.rgb.mean().unwrap()));
            for &d in &front.depth {
                deciles[((d * 10.0) as usize).min(9)] += 0.1 / (60.0 * 19.2 * 192.0);
            }
            // Counts steps between neighbours that exceed those of slanted planes, by decade of size.
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
