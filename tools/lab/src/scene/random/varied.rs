//! Random scenes of every kind: a few large objects, forty that overlap, or hundreds of small or thin ones, in front of
//! planes, slopes, curved surfaces or nothing, at any brightness, with textures of every spectrum.
//!
//! The scenes do not depend on the machine: random numbers come from [`Dice`], sines and powers from `libm`.

use crate::scene::random::ground::Ground;
use crate::scene::random::parts::{DEPTH_PER_PX, holes, light, settle, shape, stretch, turned};
use crate::scene::random::surface::Surfaces;
use crate::scene::random::thin;
use crate::scene::shapes::{Light, Place, Shape, star, turn};
use crate::scene::{Mesh, Scene, Texture};
use phasefront::Size;
use phasefront_io::dice::Dice;
use std::f64::consts::TAU;
use std::sync::Arc;

/// The most texels of a texture along a side. Larger surfaces show larger texels.
const MAX_TEXELS: f64 = 432.0;

/// Makes a random scene of any kind for a frame of `size`. Some surfaces show pieces of
/// `photographs` if there are any. The same arguments give the same scene on every machine.
pub fn varied_scene(seed: u64, size: Size, photographs: &[Texture]) -> Scene {
    let Size { width, height } = size;
    let mut maker = Maker::new(Dice::new(seed), height as f64, width as f64, photographs);
    let crowd = &CROWDS[maker.dice.weighted(&CROWDS.each_ref().map(|crowd| crowd.share))];
    maker.scene(crowd)
}

/// Makes a random scene of about forty overlapping, tilted objects in front of a background, whose textures range from
/// white noise to flat, with a mean amplitude of about one half. Nothing in it is dark or smooth enough to hide errors.
/// The same arguments give the same scene on every machine.
pub fn hard_scene(seed: u64, size: Size) -> Scene {
    let Size { width, height } = size;
    let mut maker = Maker::new(Dice::new(seed), height as f64, width as f64, &[]);
    maker.span = [0.0, 1.0];
    maker.ground = Some(Ground::varied(&mut maker.dice, maker.span));
    maker.light = None;
    maker.surfaces = Surfaces::hard();
    maker.scene(&CROWDS[FORTY])
}

/// Returns the `index`th of `count` equal parts of [0, 1].
fn part(index: usize, count: usize) -> [f64; 2] {
    [index, index + 1].map(|i| i as f64 / count as f64)
}

/// The number and the sizes of the objects in a scene.
struct Crowd {
    /// The share of scenes of this kind.
    share: f64,
    /// The smallest and largest number of objects.
    objects: [f64; 2],
    /// The smallest and largest radius of the objects, as fractions of the frame's shorter side.
    radii: [f64; 2],
    /// The share of objects that are flat sheets. The others are shapes of any kind.
    sheets: f64,
    /// The smallest and largest number of thin objects and specks.
    thin: [f64; 2],
}

/// The index of about forty overlapping objects in [`CROWDS`].
const FORTY: usize = 1;

static CROWDS: [Crowd; 5] = [
    // A few large objects.
    Crowd {
        share: 0.1,
        objects: [2.0, 10.0],
        radii: [0.15, 0.5],
        sheets: 0.3,
        thin: [0.5, 5.0],
    },
    // About forty overlapping objects, mostly tilted sheets.
    Crowd {
        share: 0.35,
        objects: [30.0, 60.0],
        radii: [0.08, 0.3],
        sheets: 0.6,
        thin: [0.5, 5.0],
    },
    // Hundreds of small objects.
    Crowd {
        share: 0.15,
        objects: [100.0, 400.0],
        radii: [0.008, 0.08],
        sheets: 0.3,
        thin: [0.5, 20.0],
    },
    // Hundreds of sticks, wires, leaves and specks around some objects.
    Crowd {
        share: 0.2,
        objects: [2.0, 30.0],
        radii: [0.05, 0.3],
        sheets: 0.3,
        thin: [80.0, 400.0],
    },
    // Objects of all sizes.
    Crowd {
        share: 0.2,
        objects: [40.0, 200.0],
        radii: [0.01, 0.35],
        sheets: 0.3,
        thin: [1.0, 40.0],
    },
];

/// A scene under construction: its frame, and the common properties of its surfaces.
struct Maker<'a> {
    dice: Dice,
    height: f64,
    width: f64,
    /// The nearest and the farthest depth of the scene, mostly the ends of the volume.
    span: [f64; 2],
    ground: Option<Ground>,
    /// The share of objects that lie close in front of the background.
    grounded: f64,
    light: Option<Light>,
    surfaces: Surfaces<'a>,
}

impl<'a> Maker<'a> {
    fn new(mut dice: Dice, height: f64, width: f64, photographs: &'a [Texture]) -> Self {
        let light = light(&mut dice, 0.5, [0.2, 0.95]);
        let narrow = dice.log_range(0.03, 0.6);
        let nearest = dice.range(0.0, 1.0 - narrow);
        let span = if dice.chance(0.12) {
            [nearest, nearest + narrow]
        } else {
            [0.0, 1.0]
        };
        Self {
            height,
            width,
            span,
            ground: dice.chance(0.85).then(|| Ground::varied(&mut dice, span)),
            grounded: dice.pick(&[0.0, 0.3, 0.6]),
            light: dice.chance(0.7).then_some(light),
            surfaces: Surfaces::new(&mut dice, photographs),
            dice,
        }
    }

    /// Makes the whole scene.
    fn scene(&mut self, crowd: &Crowd) -> Scene {
        let mut count = |range: [f64; 2]| self.dice.log_range(range[0], range[1]) as usize;
        let (objects, thin_things) = (count(crowd.objects), count(crowd.thin));
        let mut meshes: Vec<Mesh> = (0..objects).map(|i| self.object(crowd, part(i, objects))).collect();
        meshes.extend((0..thin_things).map(|i| self.thin_thing(part(i, thin_things))));
        meshes.extend(self.background());
        Scene { meshes }
    }

    fn background(&mut self) -> Option<Mesh> {
        let size = [self.width, self.height].map(|v| v.clamp(1.0, MAX_TEXELS) as usize);
        let texture = self.surfaces.texture(
            &mut self.dice,
            Size {
                width: size[0],
                height: size[1],
            },
        );
        let sheet = self.ground.as_ref()?.sheet(self.width, self.height);
        let place = self.place([1.0; 3], turn([0.0, 0.0, 1.0], 0.0), DEPTH_PER_PX, [0.5; 2]);
        Some(sheet.place(&place, Arc::new(texture)))
    }

    /// Makes an object of the crowd in a range of depths.
    fn object(&mut self, crowd: &Crowd, part: [f64; 2]) -> Mesh {
        let dice = &mut self.dice;
        let radius = (self.height.min(self.width) * dice.log_range(crowd.radii[0], crowd.radii[1])).max(1.0);
        let (shape, flat) = if dice.chance(crowd.sheets) {
            (Shape::sheet(), true)
        } else {
            shape(dice, radius)
        };
        let scale = stretch(dice, radius, flat);
        let rotation = turned(dice, flat);
        let deep = DEPTH_PER_PX * dice.log_range(0.3, 5.0);
        let size = texels(scale[0].max(scale[1]).max(scale[2]), dice);
        let mut texture = self.surfaces.texture(dice, size);
        if dice.chance(if flat { 0.2 } else { 0.04 }) {
            texture = holes(dice, size).cut(&texture);
        }
        let (at, depth) = self.somewhere(part);
        settle(
            shape.place(&self.place(scale, rotation, deep, at), Arc::new(texture)),
            depth,
        )
    }

    /// Makes a stick, a wire, a leaf, twigs or a speck in a range of depths.
    fn thin_thing(&mut self, part: [f64; 2]) -> Mesh {
        let side = self.width.min(self.height);
        let dice = &mut self.dice;
        let length = (side * dice.log_range(0.05, 1.2)).max(2.0);
        let half = dice.log_range(0.5, 3.0);
        let drop = dice.range(-0.5, 0.5) * dice.unit();
        let shape = match dice.weighted(&[1.0, 0.6, 0.8, 0.08, 0.6]) {
            0 => thin::stick(length, half, drop),
            1 => thin::wire(length, half, length * dice.range(0.0, 0.3), drop),
            2 => {
                let long = dice.log_range(2.0, 12.0);
                let leaf = Shape::polygon(&star(2, dice.range(0.3, 0.8)));
                leaf.moved(
                    [long, long * dice.range(0.3, 0.8), 1.0],
                    turn([0.0, 0.0, 1.0], 0.0),
                    [0.0; 3],
                )
            }
            3 => thin::branches(dice, 0.25 * length, half),
            _ => thin::stick(2.0 * half, half, 0.0),
        };
        let rotation = turn([0.0, 0.0, 1.0], TAU * dice.unit());
        let texture = if dice.chance(0.3) {
            self.surfaces.texture(dice, Size { width: 64, height: 8 })
        } else {
            // A gain of 4 makes some thin objects as bright as possible.
            let colour = self.surfaces.colour(dice);
            let gain = dice.pick(&[0.2, 1.0, 1.0, 4.0]);
            Texture::plain(colour.map(|v| (gain * v).min(1.0)))
        };
        let (at, depth) = self.somewhere(part);
        settle(
            shape.place(&self.place([1.0; 3], rotation, 1.0, at), Arc::new(texture)),
            depth,
        )
    }

    /// Returns a random position, as fractions of the frame from its left and top, and a depth there: close in front of
    /// the background, or in a range of the depths before it.
    fn somewhere(&mut self, [low, high]: [f64; 2]) -> ([f64; 2], f64) {
        let at = [0; 2].map(|_| self.dice.range(-0.05, 1.05));
        let [near, far] = self.span;
        let behind = self.ground.as_ref().map_or(far, |ground| ground.at(at[0], 1.0 - at[1]));
        let depth = if self.dice.chance(self.grounded) {
            behind - (behind - near).max(0.0) * self.dice.log_range(0.01, 1.0)
        } else {
            near + (behind - near).max(0.0) * self.dice.range(low, high)
        };
        (at, depth)
    }

    fn place(&self, scale_px: [f64; 3], rotation: [[f64; 3]; 3], depth_per_px: f64, at: [f64; 2]) -> Place {
        Place {
            scale_px,
            rotation,
            depth_per_px,
            centre: [at[0] * self.width, at[1] * self.height, 0.0],
            light: self.light,
        }
    }
}

/// Returns the size of the texture of an object whose largest radius is `radius` pixels: half to one and a half texels
/// per pixel.
fn texels(radius: f64, dice: &mut Dice) -> Size {
    let size = (2.0 * radius * dice.range(0.5, 1.5)).clamp(8.0, MAX_TEXELS) as usize;
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
        render_ldi_reference(
            &varied_scene(
                seed,
                Size {
                    width: size,
                    height: size,
                },
                photographs,
            ),
            Size {
                width: size,
                height: size,
            },
            5,
        )
        .unwrap()
    }

    fn gradient() -> Texture {
        let texel = |i: usize| [(i % 40) as u8, (i / 40) as u8, 7, 255];
        Texture::new(Size { width: 40, height: 20 }, (0..800).map(texel).collect()).unwrap()
    }

    /// Every machine must reproduce these numbers, because a data set may be made in parts on several machines.
    #[test]
    fn a_seed_is_one_scene_on_every_machine() {
        let of = |seed, photographs: &[Texture]| format!("{:016x}", fingerprint(&rendered(seed, 96, photographs)));
        assert_eq!(
            [of(3, &[]), of(4, &[]), of(3, &[gradient()])],
            ["b163412dae34d92e", "57165e4f336901a2", "c3dd147305e28641"]
        );
    }

    #[test]
    fn scenes_render_at_any_size() {
        for (height, width) in [(1, 1), (3, 200), (61, 47), (40, 270)] {
            for seed in 0..8 {
                let scene = varied_scene(seed, Size { width, height }, &[gradient()]);
                let inside = |mesh: &Mesh| mesh.positions.iter().all(|p| p[2].abs() <= 0.5);
                assert!(scene.meshes.iter().all(inside), "all lies in the volume");
                let ldi = render_ldi_reference(&scene, Size { width, height }, 5).unwrap();
                assert_eq!(ldi.size(), Size { width, height });
            }
        }
    }

    /// Returns the mean amplitude, and the power of neighbours' differences over the variance: 2 for white noise, 0 for
    /// a smooth image.
    fn brightness_and_roughness(ldi: &Ldi) -> (f64, f64) {
        let green = ldi.layers[0].rgb.mapv(f64::from);
        let green = green.index_axis(ndarray::Axis(0), 1);
        let step = |pair: ndarray::ArrayView2<f64>| (pair[(0, 1)] - pair[(0, 0)]) * (pair[(0, 1)] - pair[(0, 0)]);
        let steps = green.windows((1, 2)).into_iter().map(step).sum::<f64>();
        (
            f64::from(ldi.layers[0].rgb.mean().unwrap()),
            steps / green.len() as f64 / green.var(0.0).max(1e-9),
        )
    }

    #[test]
    fn scenes_are_of_all_brightness_spectra_numbers_and_depths() {
        let (mut means, mut rough, mut counts, mut deciles) = (Vec::new(), Vec::new(), Vec::new(), [0usize; 10]);
        for seed in 0..80 {
            counts.push(varied_scene(seed, Size { width: 96, height: 96 }, &[]).meshes.len());
            let ldi = rendered(seed, 96, &[]);
            let (mean, roughness) = brightness_and_roughness(&ldi);
            means.push(mean);
            rough.push(roughness);
            for &d in ldi.layers[0].depth.iter().filter(|d| !d.is_nan()) {
                deciles[((d * 10.0) as usize).min(9)] += 1;
            }
        }
        let share = |values: &[f64], is: &dyn Fn(f64) -> bool| values.iter().filter(|&&v| is(v)).count();
        assert!(
            share(&means, &|m| m < 0.15) >= 5 && share(&means, &|m| m > 0.6) >= 5,
            "{means:.2?}"
        );
        assert!(
            share(&rough, &|r| r < 0.3) >= 5 && share(&rough, &|r| r > 0.6) >= 5,
            "{rough:.2?}"
        );
        let counted = |low: usize, high: usize| counts.iter().filter(|&&n| (low..high).contains(&n)).count();
        assert!(
            counted(0, 20) >= 5 && counted(20, 80) >= 5 && counted(150, 1000) >= 5,
            "{counts:?}"
        );
        let all: usize = deciles.iter().sum();
        assert!(deciles.iter().all(|&n| n * 40 > all), "{deciles:?}");
    }

    #[test]
    fn hard_scenes_are_of_medium_brightness_and_full_of_edges() {
        let (mut means, mut rough) = (Vec::new(), Vec::new());
        for seed in 0..24 {
            let ldi = render_ldi_reference(
                &hard_scene(
                    seed,
                    Size {
                        width: 128,
                        height: 128,
                    },
                ),
                Size {
                    width: 128,
                    height: 128,
                },
                3,
            )
            .unwrap();
            let (mean, roughness) = brightness_and_roughness(&ldi);
            means.push(mean);
            rough.push(roughness);
            let depth = &ldi.layers[0].depth;
            let edges = depth
                .windows((1, 2))
                .into_iter()
                .filter(|pair| (pair[(0, 1)] - pair[(0, 0)]).abs() > 0.03);
            let edges = edges.count();
            assert!(edges > 128 * 2 && depth.iter().all(|d| !d.is_nan()), "{seed}: {edges}");
        }
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        assert!(
            (0.45..0.55).contains(&mean) && means.iter().all(|m| (0.3..0.7).contains(m)),
            "{means:.2?}"
        );
        assert!(rough.iter().all(|r| *r > 0.1), "{rough:.2?}");
    }
}
