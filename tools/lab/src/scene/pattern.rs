//! Procedural pictures for surfaces. A [`Pattern`] has one value per texel, and a ramp of colours turns it into a
//! [`Texture`]. Most patterns repeat without a seam; the documentation of the others says so.

use crate::scene::Texture;
use phasefront::Size;
use phasefront_io::dice::Dice;

/// One value in [0, 1] per texel, row by row.
#[derive(Debug, Clone)]
pub struct Pattern {
    size: Size,
    values: Vec<f32>,
}

impl Pattern {
    /// Makes the pattern whose texel at (x, y), in texels, is `value(x, y)`, clamped to [0, 1]. Neither size may be
    /// zero.
    pub fn from_fn(size: Size, mut value: impl FnMut(usize, usize) -> f32) -> Self {
        let Size { width, height } = size;
        let mut values = Vec::with_capacity(width * height);
        for y in 0..height {
            values.extend((0..width).map(|x| value(x, y).clamp(0.0, 1.0)));
        }
        Self { size, values }
    }

    /// Returns the value at column `x` and row `y`.
    pub fn at(&self, x: usize, y: usize) -> f32 {
        self.values[y * self.size.width + x]
    }

    /// Makes value noise of several octaves, stretched to [0, 1]. The first octave has `cells` lattice cells across and
    /// down. Each further octave has twice as many, with a weight of `roughness` times the weight before.
    pub fn noise(size: Size, cells: (usize, usize), octaves: u32, roughness: f32, dice: &mut Dice) -> Self {
        let Size { width, height } = size;
        let mut values = vec![0.0f32; width * height];
        let mut weight = 1.0;
        let mut blended = Vec::new();
        for octave in 0..octaves {
            let count = |cells: usize, size: usize| (cells << octave).clamp(1, size);
            let (across, down) = (count(cells.0, width), count(cells.1, height));
            let lattice: Vec<f32> = (0..across * down).map(|_| dice.unit() as f32).collect();
            let columns: Vec<_> = (0..width).map(|x| lattice_place(x, width, across)).collect();
            for y in 0..height {
                let (top, bottom, t) = lattice_place(y, height, down);
                blended.clear();
                blended.extend((0..across).map(|i| {
                    let (a, b) = (lattice[top * across + i], lattice[bottom * across + i]);
                    a + (b - a) * t
                }));
                for (value, &(left, right, t)) in values[y * width..][..width].iter_mut().zip(&columns) {
                    *value += weight * (blended[left] + (blended[right] - blended[left]) * t);
                }
            }
            weight *= roughness;
            if across == width && down == height {
                break;
            }
        }
        let (low, high) = values
            .iter()
            .fold((f32::MAX, f32::MIN), |(low, high), &v| (low.min(v), high.max(v)));
        let span = (high - low).max(1e-6);
        values.iter_mut().for_each(|v| *v = (*v - low) / span);
        Self { size, values }
    }

    /// Makes `waves` stripes across and down, bent by noise of amplitude `bend` stripes. `softness` in (0, 1] is the
    /// fraction of a stripe that its edge takes.
    pub fn stripes(size: Size, waves: (i32, i32), bend: f32, softness: f32, dice: &mut Dice) -> Self {
        let noise = (bend > 0.0).then(|| Self::noise(size, (3, 3), 3, 0.5, dice));
        Self::from_fn(size, |x, y| {
            let (u, v) = (
                (x as f32 + 0.5) / size.width as f32,
                (y as f32 + 0.5) / size.height as f32,
            );
            let bent = noise.as_ref().map_or(0.0, |noise| bend * noise.at(x, y));
            wave(u * waves.0 as f32 + v * waves.1 as f32 + bent, softness)
        })
    }

    /// Makes a checkerboard of `fields` across and down. Even numbers repeat without a seam.
    pub fn checks(size: Size, fields: (usize, usize)) -> Self {
        Self::from_fn(size, |x, y| {
            ((x * fields.0 / size.width + y * fields.1 / size.height) % 2) as f32
        })
    }

    /// Makes stripes of any `period`, in texels, whose waves run at `angle` (radians) to the rows. `softness` is as in
    /// [`stripes`](Self::stripes). The pattern repeats with a seam.
    pub fn slanted_stripes(size: Size, period: f64, angle: f64, softness: f32) -> Self {
        let (sin, cos) = libm::sincos(angle);
        Self::from_fn(size, |x, y| {
            wave(((cos * x as f64 + sin * y as f64) / period) as f32, softness)
        })
    }

    /// Makes a checkerboard whose fields are `side` texels wide and turned by `angle`, in radians. The pattern repeats
    /// with a seam.
    pub fn slanted_checks(size: Size, side: f64, angle: f64) -> Self {
        let (sin, cos) = libm::sincos(angle);
        Self::from_fn(size, |x, y| {
            let (x, y) = (x as f64 + 0.5, y as f64 + 0.5);
            let field = ((cos * x + sin * y) / side).floor() + ((cos * y - sin * x) / side).floor();
            (field.rem_euclid(2.0)) as f32
        })
    }

    /// Draws `count` points of value 1 on 0 at random positions, with a radius of `radius` texels.
    pub fn points(size: Size, count: usize, radius: f32, dice: &mut Dice) -> Self {
        let mut pattern = Self::from_fn(size, |_, _| 0.0);
        for _ in 0..count {
            let at = [size.width, size.height].map(|n| dice.range(0.0, n as f64) as f32);
            pattern.stroke(at, at, radius);
        }
        pattern
    }

    /// Makes a wall: `courses` rows of `bricks`, with every second row shifted by half a brick. Each brick has its own
    /// tone in [0.35, 1]. Joints have value 0 and a width of `joint` times a course.
    pub fn bricks(size: Size, bricks: usize, courses: usize, joint: f32, dice: &mut Dice) -> Self {
        let tones: Vec<f32> = (0..bricks * courses).map(|_| dice.range(0.35, 1.0) as f32).collect();
        // Makes joints as wide across as down.
        let aspect = (size.width as f32 / bricks as f32) / (size.height as f32 / courses as f32);
        Self::from_fn(size, |x, y| {
            let v = (y as f32 + 0.5) / size.height as f32 * courses as f32;
            let row = (v as usize).min(courses - 1);
            let u = (x as f32 + 0.5) / size.width as f32 * bricks as f32 + 0.5 * (row % 2) as f32;
            let (in_u, in_v) = (u.fract(), v.fract());
            if in_v < joint || in_u * aspect < joint {
                0.0
            } else {
                tones[row * bricks + u as usize % bricks]
            }
        })
    }

    /// Makes discs of value 1 on 0 on a jittered grid of `count` per side. The mean radius is `radius` times a grid
    /// cell, and single radii differ from it by up to half.
    pub fn spots(size: Size, count: usize, radius: f32, dice: &mut Dice) -> Self {
        let points = jittered(dice, count);
        let radii: Vec<f32> = points.iter().map(|_| radius * dice.range(0.5, 1.5) as f32).collect();
        // The width of a texel in cells. The discs' edges are one texel soft.
        let soft = count as f32 / size.width.min(size.height) as f32;
        Self::from_fn(size, |x, y| {
            let mut value = 0.0f32;
            around(size, count, x, y, &points, |index, distance| {
                value = value.max((radii[index] - distance) / soft + 0.5);
            });
            value
        })
    }

    /// Makes cells around the points of a jittered grid of `count` per side. Each cell has its own tone, and borders
    /// have value 0.
    pub fn cells(size: Size, count: usize, border: f32, dice: &mut Dice) -> Self {
        let points = jittered(dice, count);
        let tones: Vec<f32> = points.iter().map(|_| dice.range(0.2, 1.0) as f32).collect();
        Self::from_fn(size, |x, y| {
            let (mut first, mut second, mut tone) = (f32::MAX, f32::MAX, 0.0);
            around(size, count, x, y, &points, |index, distance| {
                if distance < first {
                    (second, first, tone) = (first, distance, tones[index]);
                } else if distance < second {
                    second = distance;
                }
            });
            if second - first < border { 0.0 } else { tone }
        })
    }

    /// Makes rings around the middle, `count` of them to the edge, bent by noise of amplitude `bend` rings, like wood
    /// or targets.
    pub fn rings(size: Size, count: f32, bend: f32, softness: f32, dice: &mut Dice) -> Self {
        let noise = (bend > 0.0).then(|| Self::noise(size, (3, 3), 3, 0.5, dice));
        Self::from_fn(size, |x, y| {
            let u = 2.0 * (x as f32 + 0.5) / size.width as f32 - 1.0;
            let v = 2.0 * (y as f32 + 0.5) / size.height as f32 - 1.0;
            let bent = noise.as_ref().map_or(0.0, |noise| bend * noise.at(x, y));
            wave((u * u + v * v).sqrt() * count + bent, softness)
        })
    }

    /// Makes a linear gradient from 1 to 0 and back, `turns` (across, down) times.
    pub fn gradient(size: Size, turns: (i32, i32)) -> Self {
        Self::from_fn(size, |x, y| {
            let t = (x as f32 + 0.5) / size.width as f32 * turns.0 as f32
                + (y as f32 + 0.5) / size.height as f32 * turns.1 as f32;
            (2.0 * (t - t.floor()) - 1.0).abs()
        })
    }

    /// Makes lines of writing in no language: glyphs of a few straight strokes, value 1 on 0. There are `lines` rows,
    /// and strokes are `thickness` times a line wide. The pattern repeats with a seam.
    pub fn strokes(size: Size, lines: usize, thickness: f32, dice: &mut Dice) -> Self {
        let mut pattern = Self::from_fn(size, |_, _| 0.0);
        let line = size.height as f32 / lines as f32;
        let (glyph_height, pen) = (0.62 * line, (0.5 * thickness * line).max(0.4));
        for row in 0..lines {
            let top = (row as f32 + 0.19) * line;
            let mut left = 0.3 * line;
            while left + 0.5 * line < size.width as f32 {
                let glyph_width = dice.range(0.3, 0.6) as f32 * line;
                // Strokes join points of a grid of 3 by 3. Each stroke starts at the end of the one before.
                let mut from = (dice.integer(0, 2), dice.integer(0, 2));
                for _ in 0..dice.integer(2, 4) {
                    let to = ((from.0 + dice.integer(0, 2)) % 3, (from.1 + dice.integer(1, 2)) % 3);
                    let place = |(i, j): (usize, usize)| {
                        [left + i as f32 * 0.5 * glyph_width, top + j as f32 * 0.5 * glyph_height]
                    };
                    pattern.stroke(place(from), place(to), pen);
                    from = to;
                }
                left += glyph_width + line * if dice.chance(0.2) { 0.6 } else { 0.22 };
            }
        }
        pattern
    }

    /// Draws a straight stroke of value 1 between two points, in texels from the top-left corner, with half width
    /// `pen`.
    pub fn stroke(&mut self, from: [f32; 2], to: [f32; 2], pen: f32) {
        let along = [to[0] - from[0], to[1] - from[1]];
        let square = (along[0] * along[0] + along[1] * along[1]).max(1e-6);
        let span = |axis: usize, size: usize| {
            let low = (from[axis].min(to[axis]) - pen - 1.0).max(0.0) as usize;
            let high = (from[axis].max(to[axis]) + pen + 1.0).clamp(0.0, size as f32) as usize;
            low..high
        };
        for y in span(1, self.size.height) {
            for x in span(0, self.size.width) {
                let p = [x as f32 + 0.5 - from[0], y as f32 + 0.5 - from[1]];
                let t = ((p[0] * along[0] + p[1] * along[1]) / square).clamp(0.0, 1.0);
                let (dx, dy) = (p[0] - t * along[0], p[1] - t * along[1]);
                let value = &mut self.values[y * self.size.width + x];
                *value = value.max((pen - (dx * dx + dy * dy).sqrt() + 0.5).clamp(0.0, 1.0));
            }
        }
    }

    /// Returns the pattern with each value moved toward that of `other` by `amount`. A smaller `other` repeats.
    pub fn mixed(&self, other: &Self, amount: f32) -> Self {
        Self::from_fn(self.size, |x, y| {
            let value = self.at(x, y);
            value + (other.at(x % other.size.width, y % other.size.height) - value) * amount
        })
    }

    /// Makes a texture whose colour, RGB in [0, 1], is `ramp[0]` at value 0, `ramp[1]` at one half and `ramp[2]` at 1.
    pub fn texture(&self, ramp: [[f32; 3]; 3]) -> Texture {
        let texel = |&value: &f32| {
            let upper = value >= 0.5;
            let (from, to) = if upper { (ramp[1], ramp[2]) } else { (ramp[0], ramp[1]) };
            let t = 2.0 * value - f32::from(u8::from(upper));
            let [r, g, b] = std::array::from_fn(|c| ((from[c] + (to[c] - from[c]) * t) * 255.0 + 0.5) as u8);
            [r, g, b, 255]
        };
        Texture::sized(self.size, self.values.iter().map(texel).collect())
    }

    /// Returns `texture` with holes where the value is below one half. A smaller pattern repeats.
    pub fn cut(&self, texture: &Texture) -> Texture {
        let mut texels = texture.texels().to_vec();
        for (index, texel) in texels.iter_mut().enumerate() {
            let (x, y) = (index % texture.width(), index / texture.width());
            texel[3] = (self.at(x % self.size.width, y % self.size.height) * 255.0 + 0.5) as u8;
        }
        Texture::sized(
            Size {
                width: texture.width(),
                height: texture.height(),
            },
            texels,
        )
    }
}

/// Returns the lattice points beside texel `x` of `size` on a repeating lattice of `count`, and the smoothed position
/// between them.
fn lattice_place(x: usize, size: usize, count: usize) -> (usize, usize, f32) {
    let position = (x as f32 + 0.5) * count as f32 / size as f32;
    let below = position as usize;
    (below % count, (below + 1) % count, smooth(position - below as f32))
}

/// Rises smoothly from 0 to 1, with slope zero at both ends.
fn smooth(t: f32) -> f32 {
    t * t * (3.0 - 2.0 * t)
}

/// Returns a wave of period 1 between 0 and 1. `softness` is the fraction of half a period that its edge takes.
fn wave(t: f32, softness: f32) -> f32 {
    let triangle = (2.0 * (t - t.floor()) - 1.0).abs();
    smooth(((triangle - 0.5) / softness + 0.5).clamp(0.0, 1.0))
}

/// Returns one random point in each cell of a repeating grid of `count` per side, in cells.
fn jittered(dice: &mut Dice, count: usize) -> Vec<[f32; 2]> {
    (0..count * count)
        .map(|_| [0; 2].map(|_| dice.range(0.1, 0.9) as f32))
        .collect()
}

/// Calls `visit(index, distance in cells)` for the points of the texel's own grid cell and of the eight around it.
fn around(size: Size, count: usize, x: usize, y: usize, points: &[[f32; 2]], mut visit: impl FnMut(usize, f32)) {
    let u = (x as f32 + 0.5) / size.width as f32 * count as f32;
    let v = (y as f32 + 0.5) / size.height as f32 * count as f32;
    let (i, j) = (u as usize, v as usize);
    for dj in 0..3 {
        for di in 0..3 {
            let index = (j + dj + count - 1) % count * count + (i + di + count - 1) % count;
            let dx = (i + di) as f32 - 1.0 + points[index][0] - u;
            let dy = (j + dj) as f32 - 1.0 + points[index][1] - v;
            visit(index, (dx * dx + dy * dy).sqrt());
        }
    }
}
