//! The random scenes for data sets: many objects of random shape, texture, scale and tilt. Their visible depths are
//! spread evenly over the volume, so networks learn every depth and every kind of edge.
//!
//! The scenes do not depend on the machine: random numbers come from [`Dice`], sines and powers from `libm`.

use crate::scene::pattern::Pattern;
use crate::scene::random::parts::{
    DEPTH_PER_PX, MARGIN, MAX_TEXELS, holes, light, pattern, settle, shape, stretch, turned,
};
use crate::scene::shapes::{Light, Place, Shape, turn};
use crate::scene::{Mesh, Scene, Texture};
use phasefront::Size;
use phasefront_io::dice::Dice;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Makes a random scene for a frame of `size`. The same arguments give the same scene on every
/// machine.
pub fn random_scene(seed: u64, size: Size) -> Scene {
    let Size { width, height } = size;
    let mut maker = Maker::new(Dice::new(seed), height as f64, width as f64);
    let background = maker.background();
    let count = maker.dice.log_range(40.0, 120.0) as usize;
    // One depth in each of `count` equal parts, in random order, so that each scene spans the volume.
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

/// A scene under construction: its frame, and the common properties of its objects.
struct Maker {
    dice: Dice,
    height: f64,
    width: f64,
    light: Option<Light>,
    palette: Palette,
    /// The radii of the smallest and the largest objects, in pixels.
    radii: [f64; 2],
    /// Above one, small objects are more frequent than in a uniform distribution of log radius.
    smallness: f64,
}

/// The colours of one scene: hues around a centre, and ranges of saturation and brightness.
struct Palette {
    hue: f64,
    hue_spread: f64,
    saturation: [f64; 2],
    brightness: [f64; 2],
}

impl Maker {
    fn new(mut dice: Dice, height: f64, width: f64) -> Self {
        let side = height.min(width);
        let light = dice.chance(0.85).then(|| light(&mut dice, 0.4, [0.15, 0.7]));
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

    /// Makes the background, if the scene has one.
    fn background(&mut self) -> Option<Mesh> {
        let dice = &mut self.dice;
        let style = dice.weighted(&[0.4, 0.3, 0.15, 0.15]);
        if style == 0 {
            return None;
        }
        // The depth at the middle, its change toward the frame's edges, and the height of bumps.
        let (middle, slope, bumps) = match style {
            1 => (dice.range(0.62, 1.0), dice.range(0.02, 0.35), 0.0),
            2 => (dice.range(0.5, 0.7), dice.range(0.3, 0.5), 0.0),
            _ => (dice.range(0.55, 0.9), dice.range(0.0, 0.2), dice.range(0.1, 0.5)),
        };
        let (sin, cos) = libm::sincos(TAU * dice.unit());
        let pieces = if bumps > 0.0 { 24 } else { 1 };
        let cells = dice.integer(2, 5);
        let relief = Pattern::noise(
            Size {
                width: pieces + 1,
                height: pieces + 1,
            },
            (cells, cells),
            2,
            0.4,
            dice,
        );
        // One texel per pixel, up to a limit, on a sheet a little larger than the frame.
        let size = [self.width, self.height].map(|v| v.min(3.0 * MAX_TEXELS) as usize);
        let texture = self.texture(
            Size {
                width: size[0].max(1),
                height: size[1].max(1),
            },
            &[0.5, 1.0, 1.0],
        );
        // The division by `reach` makes the steepest tilt span the depth `slope` across the frame in every direction.
        let reach = sin.abs() + cos.abs();
        let depth_at = |u: f64, v: f64| {
            let tilt = slope * (cos * (2.0 * u - 1.0) + sin * (2.0 * v - 1.0)) / reach;
            let (i, j) = ((u * pieces as f64 + 0.5) as usize, (v * pieces as f64 + 0.5) as usize);
            (middle + tilt + bumps * (f64::from(relief.at(i, j)) - 0.5)).clamp(0.01, 1.0 - MARGIN)
        };
        let sheet = Shape::grid(pieces, pieces, |u, v| {
            let (w, h) = (1.02 * self.width, 1.02 * self.height);
            [w * (u - 0.5), h * (v - 0.5), (0.5 - depth_at(u, v)) / DEPTH_PER_PX]
        });
        Some(sheet.place(
            &self.place([1.0; 3], turn([0.0, 0.0, 1.0], 0.0), 1.0, [0.5, 0.5, 0.0]),
            Arc::new(texture),
        ))
    }

    /// Makes one object around the depth `depth` in [0, 1].
    fn object(&mut self, depth: f64) -> Mesh {
        let t = libm::pow(self.dice.unit(), self.smallness);
        let radius = self.radii[0] * libm::pow(self.radii[1] / self.radii[0], t);
        let (shape, flat) = shape(&mut self.dice, radius);
        let dice = &mut self.dice;
        let scale = stretch(dice, radius, flat);
        let rotation = turned(dice, flat);
        // Objects are from half as deep as wide to several times as deep, but never deeper than most of the volume.
        let deep = dice.log_range(0.5, 5.0);
        let size = scale[0]
            .max(scale[1])
            .max(scale[2])
            .round()
            .clamp(4.0, MAX_TEXELS / 2.0) as usize
            * 2;
        let mut texture = self.texture(
            Size {
                width: size,
                height: size,
            },
            &[0.0, 0.15, 0.5, 0.5, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
        );
        if self.dice.chance(if flat { 0.35 } else { 0.06 }) {
            texture = holes(
                &mut self.dice,
                Size {
                    width: size,
                    height: size,
                },
            )
            .cut(&texture);
        }
        let dice = &mut self.dice;
        let at = [dice.range(-0.05, 1.05), dice.range(-0.05, 1.05), 0.0];
        let mesh = shape.place(&self.place(scale, rotation, deep, at), Arc::new(texture));
        settle(mesh, depth)
    }

    /// Returns the placement at `at`: x and y as fractions of the frame, z unchanged.
    fn place(&self, scale_px: [f64; 3], rotation: [[f64; 3]; 3], deep: f64, at: [f64; 3]) -> Place {
        Place {
            scale_px,
            rotation,
            depth_per_px: deep * DEPTH_PER_PX,
            centre: [at[0] * self.width, at[1] * self.height, at[2]],
            light: self.light,
        }
    }

    /// Makes a texture with one of the `contrasts`, each a fraction of the largest contrast of its colours. 0 gives a
    /// plain surface.
    fn texture(&mut self, size: Size, contrasts: &[f32]) -> Texture {
        let ramp = [0; 3].map(|_| self.palette.colour(&mut self.dice));
        let contrast = self.dice.pick(contrasts);
        let ramp = ramp.map(|colour| std::array::from_fn(|c| ramp[1][c] + (colour[c] - ramp[1][c]) * contrast));
        let pattern = pattern(&mut self.dice, size);
        let dice = &mut self.dice;
        if dice.chance(0.5) {
            let grain = Pattern::noise(size, (size.width / 4, size.height / 4), 2, 0.7, dice);
            return pattern.mixed(&grain, dice.range(0.05, 0.3) as f32).texture(ramp);
        }
        pattern.texture(ramp)
    }
}

impl Palette {
    fn colour(&self, dice: &mut Dice) -> [f32; 3] {
        let hue = self.hue + self.hue_spread * dice.range(-1.0, 1.0);
        let saturation = dice.range(self.saturation[0], self.saturation[1]);
        let brightness = dice.range(self.brightness[0], self.brightness[1]);
        // Hue on the hexagon of full colours, with red at 0, green at ⅓ and blue at ⅔.
        [0.0, 2.0 / 3.0, 1.0 / 3.0].map(|offset| {
            let t = hue + offset;
            let pure = ((6.0 * (t - t.floor()) - 3.0).abs() - 1.0).clamp(0.0, 1.0);
            (brightness * (1.0 - saturation * (1.0 - pure))) as f32
        })
    }
}

#[cfg(test)]
pub(super) mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::scene::render_ldi_reference;
    use phasefront_io::ldi::Ldi;

    fn rendered(seed: u64, size: Size) -> Ldi {
        let Size { width, height } = size;
        render_ldi_reference(&random_scene(seed, size), Size { width, height }, 5).unwrap()
    }

    /// Computes FNV-1a over the contents of the LDI's PNGs.
    pub(in crate::scene) fn fingerprint(ldi: &Ldi) -> u64 {
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

    /// Every machine must reproduce these numbers, because a data set may be made in parts on several machines.
    #[test]
    fn a_seed_is_one_scene_on_every_machine() {
        assert_eq!(
            [3, 4].map(|seed| format!("{:016x}", fingerprint(&rendered(seed, Size { width: 80, height: 96 })))),
            ["8b01907bb1bc3895", "575e04e964b74391"]
        );
    }

    #[test]
    fn scenes_render_at_any_size() {
        for (height, width) in [(1, 1), (3, 200), (61, 47), (40, 270)] {
            for seed in 0..8 {
                let scene = random_scene(seed, Size { width, height });
                scene.check().unwrap();
                for mesh in &scene.meshes {
                    assert!(
                        mesh.positions.iter().all(|p| p[2].abs() <= 0.5),
                        "all of a scene lies in the volume"
                    );
                }
                assert_eq!(rendered(seed, Size { width, height }).size(), Size { width, height });
            }
        }
    }

    #[test]
    #[ignore = "slow: 8 seconds of a core"]
    fn what_is_seen_is_spread_over_the_volume() {
        let mut deciles = [0.0f64; 10];
        let mut layers = [0; 5];
        for seed in 0..50 {
            let ldi = rendered(
                seed,
                Size {
                    width: 384,
                    height: 384,
                },
            );
            for &d in ldi.layers[0].depth.iter().filter(|d| !d.is_nan()) {
                deciles[((d * 10.0) as usize).min(9)] += 1.0;
            }
            for (count, layer) in layers.iter_mut().zip(&ldi.layers) {
                *count += layer.depth.iter().filter(|d| !d.is_nan()).count();
            }
        }
        let total: f64 = deciles.iter().sum();
        let shares = deciles.map(|count| count / total);
        assert!(shares.iter().all(|share| (0.05..=0.16).contains(share)), "{shares:.3?}");
        // As in the paper, valid pixels become few with each layer, but the fifth layer still has some.
        assert!(
            layers
                .windows(2)
                .all(|pair| pair[1] * 2 < pair[0] * 3 && pair[1] < pair[0]),
            "{layers:?}"
        );
        assert!(layers[4] > 0, "{layers:?}");
    }
}
