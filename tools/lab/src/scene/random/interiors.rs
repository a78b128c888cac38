//! Random rooms in perspective: walls, floor and ceiling, and furniture in front of them, all made of blocks. Depth is
//! continuous over large parts of the frame, thin parts stand close to surfaces, and textures become finer with
//! distance.
//!
//! The bundled networks were trained before these scenes existed, so the scenes show how networks do on a kind of scene
//! that they do not know. The scenes do not depend on the machine: random numbers come from [`Dice`], sines and powers
//! from `libm`.

use crate::scene::pattern::Pattern;
use crate::scene::random::parts::{DEPTH_PER_PX, MARGIN, light};
use crate::scene::shapes::{Light, Place, Shape, turn};
use crate::scene::{Mesh, Scene, Texture};
use phasefront::Size;
use phasefront_io::dice::Dice;
use std::sync::Arc;

/// The number of pieces of a wall along each side. Textures are linear in a piece, so more pieces follow the
/// perspective better.
const WALL_PIECES: usize = 16;
/// The number of pieces of a block's face along each side.
const BLOCK_PIECES: usize = 3;
/// The half size of a room's front over the size of the frame, which it exceeds a little.
const HALF: f64 = 0.52;

/// Makes a random room for a frame of `size`. The same arguments give the same scene on every
/// machine.
pub fn interior_scene(seed: u64, size: Size) -> Scene {
    let Size { width, height } = size;
    let mut dice = Dice::new(seed);
    let view = View::new(&mut dice, height as f64, width as f64);
    let mut maker = Maker {
        light: light(&mut dice, 0.3, [0.3, 0.8]),
        exposure: dice.range(0.5, 1.6),
        colourfulness: dice.range(0.05, 0.7),
        dice,
        view,
        meshes: Vec::new(),
    };
    maker.walls();
    maker.window();
    for _ in 0..maker.dice.integer(2, 7) {
        match maker.dice.weighted(&[1.0, 1.0, 1.0, 0.7, 0.7]) {
            0 => maker.table(),
            1 => maker.shelf(),
            2 => maker.cupboard(),
            3 => maker.lamp(),
            _ => maker.boxes(),
        }
    }
    Scene { meshes: maker.meshes }
}

/// The perspective view of a room. A point of the room has the coordinates [u, h, w], each in [0, 1]: from the left to
/// the right wall, from the floor to the ceiling, and from the front to the back wall.
struct View {
    /// The half size of the room's front in pixels.
    front: [f64; 2],
    /// The vanishing point, in pixels from the frame's middle, y up.
    vanishing: [f64; 2],
    /// The distance of the back wall over that of the front.
    ratio: f64,
    /// The depths of the front and of the back wall.
    depth: [f64; 2],
}

impl View {
    fn new(dice: &mut Dice, height: f64, width: f64) -> Self {
        let front = [HALF * width, HALF * height];
        Self {
            front,
            vanishing: front.map(|half| half * dice.range(-0.5, 0.5)),
            ratio: dice.log_range(1.5, 5.0),
            depth: [dice.range(MARGIN, 0.4), dice.range(0.7, 1.0 - MARGIN)],
        }
    }

    /// Projects a point of the room: x and y in pixels from the frame's middle, y up, and z in pixels toward the
    /// viewer. Depth is linear in the reciprocal of distance, so planes of the room are planes of the volume.
    fn at(&self, [u, h, w]: [f64; 3]) -> [f64; 3] {
        let distance = 1.0 + (self.ratio - 1.0) * w;
        let far = (1.0 - 1.0 / distance) / (1.0 - 1.0 / self.ratio);
        let [x, y] = [0, 1].map(|k| {
            let wall = self.front[k] * (2.0 * [u, h][k] - 1.0);
            self.vanishing[k] + (wall - self.vanishing[k]) / distance
        });
        let depth = self.depth[0] + (self.depth[1] - self.depth[0]) * far;
        [x, y, (0.5 - depth) / DEPTH_PER_PX]
    }
}

/// What a surface is made of, which chooses its pattern.
#[derive(Clone, Copy)]
enum Material {
    Wallpaper,
    Tiles,
    Plaster,
    Wood,
    Print,
    Cloth,
}

/// A scene under construction.
struct Maker {
    dice: Dice,
    view: View,
    light: Light,
    /// The typical brightness of surfaces.
    exposure: f64,
    /// The distance of colours from grey.
    colourfulness: f64,
    meshes: Vec<Mesh>,
}

impl Maker {
    /// Adds the back wall, the side walls, the floor and the ceiling.
    fn walls(&mut self) {
        let [paper, tiles, plaster] =
            [Material::Wallpaper, Material::Tiles, Material::Plaster].map(|kind| self.texture(kind, 192));
        let n = WALL_PIECES;
        self.face(n, |a, b| [a, b, 1.0], &paper);
        self.face(n, |a, b| [0.0, b, a], &paper);
        self.face(n, |a, b| [1.0, b, 1.0 - a], &paper);
        self.face(n, |a, b| [a, 0.0, b], &tiles);
        self.face(n, |a, b| [a, 1.0, 1.0 - b], &plaster);
    }

    /// Adds a bright window in the back wall, mostly behind thin slats.
    fn window(&mut self) {
        if self.dice.chance(0.3) {
            return;
        }
        let [left, low] = [self.dice.range(0.05, 0.5), self.dice.range(0.3, 0.5)];
        let [right, high] = [left + self.dice.range(0.2, 0.45), low + self.dice.range(0.2, 0.45)];
        let sky = Arc::new(Pattern::gradient(Size { width: 8, height: 64 }, (0, 1)).texture([
            [0.6, 0.75, 0.9],
            [0.8, 0.9, 1.0],
            [1.0; 3],
        ]));
        self.block([left, right], [low, high], [0.985, 0.99], &sky);
        let paint = Arc::new(Texture::plain(self.colour()));
        let slats = self.dice.pick(&[0, 4, 10, 20]);
        for k in 0..slats {
            let bottom = low + (high - low) * k as f64 / f64::from(slats);
            let half = 0.5 * (high - low) / f64::from(slats);
            self.block([left, right], [bottom, bottom + half], [0.95, 0.96], &paint);
        }
    }

    /// Adds a table with four legs, and some things on it.
    fn table(&mut self) {
        let wood = self.texture(Material::Wood, 96);
        let (u, w) = (self.span(0.2, 0.5), self.span(0.15, 0.4));
        let top = self.dice.range(0.2, 0.4);
        self.block(u, [top - 0.025, top], w, &wood);
        let leg = 0.02;
        for [left, front] in [
            [u[0], w[0]],
            [u[1] - leg, w[0]],
            [u[0], w[1] - leg],
            [u[1] - leg, w[1] - leg],
        ] {
            self.block([left, left + leg], [0.0, top - 0.025], [front, front + leg], &wood);
        }
        for _ in 0..self.dice.integer(0, 8) {
            let [left, front] = [self.dice.range(u[0], u[1]), self.dice.range(w[0], w[1])];
            let (size, tall) = (self.dice.range(0.01, 0.06), self.dice.range(0.01, 0.15));
            let thing = self.any_texture(48);
            self.block([left, left + size], [top, top + tall], [front, front + size], &thing);
        }
    }

    /// Adds a shelf of boards with books, in front of the back wall.
    fn shelf(&mut self) {
        let wood = self.texture(Material::Wood, 96);
        let u = self.span(0.2, 0.6);
        let front = self.dice.range(0.8, 0.93);
        let boards = self.dice.integer(2, 6);
        let high = self.dice.range(0.5, 0.9);
        let step = high / boards as f64;
        for k in 0..=boards {
            let bottom = step * k as f64;
            self.block(u, [bottom, bottom + 0.015], [front, 0.97], &wood);
            let mut left = u[0];
            while k < boards && left < u[1] - 0.045 {
                let wide = self.dice.range(0.012, 0.045);
                let tall = step * self.dice.range(0.45, 0.85);
                let inward = self.dice.range(0.0, 0.02);
                let book = self.any_texture(32);
                let stands = bottom + 0.015;
                self.block(
                    [left, left + wide],
                    [stands, stands + tall],
                    [front + inward, 0.97],
                    &book,
                );
                left += wide + if self.dice.chance(0.1) { 0.05 } else { 0.003 };
            }
        }
    }

    /// Adds a large closed block on the floor.
    fn cupboard(&mut self) {
        let texture = self.any_texture(128);
        let (u, w) = (self.span(0.15, 0.4), self.span(0.1, 0.3));
        let high = self.dice.range(0.15, 0.75);
        self.block(u, [0.0, high], w, &texture);
    }

    /// Adds a lamp that hangs from the ceiling on a thin rod.
    fn lamp(&mut self) {
        let (u, w) = (self.span(0.05, 0.15), self.span(0.05, 0.15));
        let low = self.dice.range(0.5, 0.85);
        let [u0, w0] = [u, w].map(|[a, b]| 0.5 * (a + b));
        let black = Arc::new(Texture::plain([0.05; 3]));
        self.block([u0, u0 + 0.006], [low, 1.0], [w0, w0 + 0.006], &black);
        let shade = Arc::new(Texture::plain([1.0, 0.95, self.dice.range(0.6, 0.9) as f32]));
        self.block(u, [low, low + 0.07], w, &shade);
    }

    /// Adds small blocks on the floor, some on top of each other.
    fn boxes(&mut self) {
        for _ in 0..self.dice.integer(3, 12) {
            let (u, w) = (self.span(0.03, 0.12), self.span(0.03, 0.12));
            let mut bottom = 0.0;
            for _ in 0..self.dice.integer(1, 3) {
                let top = bottom + self.dice.range(0.03, 0.12);
                let texture = self.any_texture(64);
                self.block(u, [bottom, top], w, &texture);
                bottom = top;
            }
        }
    }

    /// Returns a random part of [0, 1] of a length between `shortest` and `longest`.
    fn span(&mut self, shortest: f64, longest: f64) -> [f64; 2] {
        let length = self.dice.range(shortest, longest);
        let start = self.dice.range(0.02, 0.98 - length);
        [start, start + length]
    }

    /// Adds a block: its front, its top and bottom, and its sides. Those that face away are invisible.
    fn block(&mut self, [l, r]: [f64; 2], [low, high]: [f64; 2], [near, far]: [f64; 2], texture: &Arc<Texture>) {
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        let n = BLOCK_PIECES;
        self.face(n, |a, b| [mix(l, r, a), mix(low, high, b), near], texture);
        self.face(n, |a, b| [mix(l, r, a), high, mix(near, far, b)], texture);
        self.face(n, |a, b| [mix(l, r, a), low, mix(far, near, b)], texture);
        self.face(n, |a, b| [l, mix(low, high, b), mix(far, near, a)], texture);
        self.face(n, |a, b| [r, mix(low, high, b), mix(near, far, a)], texture);
    }

    /// Adds the surface of the points `point(a, b)` of the room, a from left to right and b from below as seen from its
    /// visible side.
    fn face(&mut self, pieces: usize, point: impl Fn(f64, f64) -> [f64; 3], texture: &Arc<Texture>) {
        let [width, height] = self.view.front.map(|half| half / HALF);
        let place = Place {
            scale_px: [1.0; 3],
            rotation: turn([0.0, 0.0, 1.0], 0.0),
            depth_per_px: DEPTH_PER_PX,
            centre: [0.5 * width, 0.5 * height, 0.0],
            light: Some(self.light),
        };
        let shape = Shape::grid(pieces, pieces, |a, b| self.view.at(point(a, b)));
        self.meshes.push(shape.place(&place, Arc::clone(texture)));
    }

    /// Makes a texture of any kind.
    fn any_texture(&mut self, side: usize) -> Arc<Texture> {
        use Material::{Cloth, Plaster, Print, Tiles, Wallpaper, Wood};
        let all = [Wallpaper, Tiles, Plaster, Wood, Print, Cloth];
        let material = all[self.dice.integer(0, all.len() - 1)];
        self.texture(material, side)
    }

    /// Makes a texture of `side` x `side` texels in two colours of this room.
    fn texture(&mut self, material: Material, side: usize) -> Arc<Texture> {
        let size = Size {
            width: side,
            height: side,
        };
        let dice = &mut self.dice;
        let fine = side / 4;
        let pattern = match material {
            Material::Wallpaper => {
                let stripes = dice.integer(2, fine.min(24));
                let spots = Pattern::spots(size, dice.integer(2, fine.min(16)), 0.3, dice);
                Pattern::stripes(size, (stripes as i32, 0), 0.0, 0.5, dice).mixed(&spots, dice.unit() as f32)
            }
            Material::Tiles => {
                let tiles = 2 * dice.integer(1, fine.min(10));
                let stone = Pattern::noise(size, (4, 4), 5, 0.7, dice);
                Pattern::checks(size, (tiles, tiles)).mixed(&stone, dice.range(0.1, 0.7) as f32)
            }
            Material::Plaster => Pattern::noise(size, (fine.min(24), fine.min(24)), 3, 0.8, dice),
            Material::Wood => {
                let grain = Pattern::noise(size, (2, fine.min(16)), 4, 0.7, dice);
                Pattern::rings(size, dice.range(2.0, 9.0) as f32, 2.0, 0.8, dice).mixed(&grain, 0.5)
            }
            Material::Print => Pattern::strokes(size, dice.integer(1, (side / 8).min(12)), 0.2, dice),
            Material::Cloth => Pattern::slanted_checks(size, dice.log_range(1.5, fine as f64), dice.range(0.0, 0.8)),
        };
        let [dark, bright] = [self.colour(), self.colour()];
        let middle = std::array::from_fn(|c| 0.5 * (dark[c] + bright[c]));
        Arc::new(pattern.texture([dark, middle, bright]))
    }

    /// Returns a colour of this room, in [0, 1].
    fn colour(&mut self) -> [f32; 3] {
        let brightness = self.exposure * self.dice.log_range(0.25, 1.6);
        let hues = [0; 3].map(|_| 1.0 + self.colourfulness * self.dice.range(-1.0, 1.0));
        hues.map(|hue| (brightness * hue).clamp(0.0, 1.0) as f32)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::scene::random::objects::tests::fingerprint;
    use crate::scene::render_ldi_reference;

    /// Every machine must reproduce these numbers, because a data set may be made in parts on several machines.
    #[test]
    fn a_seed_is_one_scene_on_every_machine() {
        let of = |seed| {
            let ldi = render_ldi_reference(
                &interior_scene(seed, Size { width: 96, height: 96 }),
                Size { width: 96, height: 96 },
                5,
            )
            .unwrap();
            format!("{:016x}", fingerprint(&ldi))
        };
        assert_eq!([of(3), of(4)], ["e35d03b1462c6b75", "0aa52a2c2f5072db"]);
    }

    #[test]
    fn interiors_of_any_size_lie_in_the_volume() {
        for (height, width) in [(1, 1), (3, 200), (61, 47), (40, 270)] {
            for seed in 0..8 {
                let scene = interior_scene(seed, Size { width, height });
                let inside = |mesh: &Mesh| mesh.positions.iter().all(|p| p[2].abs() <= 0.5);
                assert!(scene.meshes.iter().all(inside), "{seed}: a part is outside the volume");
                render_ldi_reference(&scene, Size { width, height }, 5).unwrap();
            }
        }
    }

    #[test]
    fn walls_fill_the_frame_and_furniture_hides_them() {
        let (mut nearest, mut farthest, mut hidden) = (1.0f32, 0.0f32, 0);
        for seed in 0..16 {
            let ldi = render_ldi_reference(
                &interior_scene(
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
            let depth = &ldi.layers[0].depth;
            assert!(depth.iter().all(|d| !d.is_nan()), "{seed}: a hole");
            nearest = depth.iter().copied().fold(nearest, f32::min);
            farthest = depth.iter().copied().fold(farthest, f32::max);
            hidden += ldi.layers[1].depth.iter().filter(|d| !d.is_nan()).count();
        }
        assert!(nearest < 0.1 && farthest > 0.9, "{nearest}, {farthest}");
        assert!(hidden > 16 * 128 * 128 / 20, "{hidden} hidden points");
    }
}
