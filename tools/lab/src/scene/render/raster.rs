//! The renderer on the CPU. It finds every front-facing hit of every pixel and keeps the first N.
//!
//! Coverage is decided in integers, with vertices rounded to 1/256 pixel and the top-left rule for edges. A triangle
//! therefore covers the same pixels on every machine, and neighbouring triangles neither share nor miss a pixel.

use crate::scene::texture::ALPHA_CUT;
use crate::scene::{Mesh, Scene};
use ndarray::{Array2, Array3};
use phasefront::Size;
use phasefront_io::ldi::{Ldi, LdiLayer};
use phasefront_io::{Error, Result};

/// The number of steps per pixel to which vertices are rounded.
const SUBPIXEL: i64 = 256;
/// The most pixels times layers of one rendering, at 16 bytes each.
const MAX_HITS: usize = 1 << 29;

/// One surface on a pixel's line of sight.
#[derive(Clone, Copy)]
struct Hit {
    depth: f32,
    rgb: [f32; 3],
}

/// Renders the first `layers` front-facing hits of every pixel of a frame of `size`, front first.
///
/// A pixel has a hit if its centre lies in a front-facing triangle, at a depth in [0, 1], and the texture's alpha there
/// is at least one half. The colour is the texture's (bilinear) times the vertex colour, clamped to [0, 1]. Hits of
/// exactly the same depth count once, for the triangle that comes first in the scene, as in depth peeling (Algorithm
/// 1).
///
/// Returns an error if the frame or `layers` is zero or too large, or if the scene fails [`Scene::check`].
pub fn render_ldi_reference(scene: &Scene, size: Size, layers: usize) -> Result<Ldi> {
    let Size { width, height } = size;
    scene.check()?;
    check_size(size, layers)?;
    let nothing = Hit {
        depth: f32::INFINITY,
        rgb: [0.0; 3],
    };
    let mut frame = Frame {
        height,
        width,
        layers,
        hits: vec![nothing; height * width * layers],
    };
    for mesh in &scene.meshes {
        for &triangle in &mesh.triangles {
            frame.draw(mesh, triangle);
        }
    }
    Ldi::new(frame.into_layers())
}

/// Returns an error if a rendering of this size is empty or too large.
pub(super) fn check_size(size: Size, layers: usize) -> Result<()> {
    let Size { width, height } = size;
    let count = height.checked_mul(width).and_then(|pixels| pixels.checked_mul(layers));
    if !count.is_some_and(|count| (1..=MAX_HITS).contains(&count)) {
        return Err(Error::Input(format!(
            "cannot render {layers} layers of {width}x{height} pixels: at least one of each, and {MAX_HITS} pixels in all at most"
        )));
    }
    Ok(())
}

/// The hits found so far: `layers` per pixel, in order of increasing depth.
struct Frame {
    height: usize,
    width: usize,
    layers: usize,
    hits: Vec<Hit>,
}

impl Frame {
    fn draw(&mut self, mesh: &Mesh, [a, b, c]: [u32; 3]) {
        let fixed = |index: u32| {
            let [x, y, _] = mesh.positions[index as usize];
            [x, y].map(|v| (f64::from(v) * SUBPIXEL as f64).round() as i64)
        };
        // With y down, a front face has negative area. In the reverse order its edge functions are positive inside.
        let corners = [a, c, b];
        let p = corners.map(fixed);
        let area = edge(p[0], p[1], p[2]);
        if area <= 0 {
            return;
        }
        let values = |value: &dyn Fn(usize) -> f32| corners.map(|index| f64::from(value(index as usize)));
        let depths = values(&|index| 0.5 - mesh.positions[index][2]);
        let [nearest, farthest] =
            [f64::min, f64::max].map(|end: fn(f64, f64) -> f64| end(end(depths[0], depths[1]), depths[2]));
        let uvs = [0, 1].map(|i| values(&|index| mesh.uv[index][i]));
        let tints = [0, 1, 2].map(|i| values(&|index| mesh.colour.get(index).map_or(1.0, |colour| colour[i])));
        let included = [(p[1], p[2]), (p[2], p[0]), (p[0], p[1])].map(|(from, to)| i64::from(!is_top_left(from, to)));

        let span = |axis: usize, size: usize| {
            let low = p.iter().map(|p| p[axis]).min().unwrap_or(0);
            let high = p.iter().map(|p| p[axis]).max().unwrap_or(0);
            // The centre of pixel i is at i + ½, so the range runs from the first to the last centre within [low,
            // high].
            let first = (low - SUBPIXEL / 2 + SUBPIXEL - 1).div_euclid(SUBPIXEL).max(0);
            let last = (high - SUBPIXEL / 2).div_euclid(SUBPIXEL).min(size as i64 - 1);
            first..last + 1
        };
        for y in span(1, self.height) {
            let mut entered = false;
            for x in span(0, self.width) {
                let centre = [x, y].map(|v| v * SUBPIXEL + SUBPIXEL / 2);
                let weights = [
                    edge(p[1], p[2], centre),
                    edge(p[2], p[0], centre),
                    edge(p[0], p[1], centre),
                ];
                if (0..3).any(|i| weights[i] < included[i]) {
                    if entered {
                        break;
                    }
                    continue;
                }
                entered = true;
                let [b, c] = [1, 2].map(|i| weights[i] as f64 / area as f64);
                let at_centre = |v: [f64; 3]| v[0] + b * (v[1] - v[0]) + c * (v[2] - v[0]);
                // Rounding must not move a point beyond its corners.
                let depth = at_centre(depths).clamp(nearest, farthest) as f32;
                let first = (y as usize * self.width + x as usize) * self.layers;
                let hits = &mut self.hits[first..first + self.layers];
                if !(0.0..=1.0).contains(&depth) {
                    continue;
                }
                let place = hits.partition_point(|hit| hit.depth < depth);
                if place == hits.len() || hits[place].depth == depth {
                    continue;
                }
                let uv = uvs.map(|v| at_centre(v) as f32);
                let texel = mesh.texture.sample(uv);
                if texel[3] < ALPHA_CUT {
                    continue;
                }
                let rgb = std::array::from_fn(|i| (texel[i] * at_centre(tints[i]) as f32).clamp(0.0, 1.0));
                hits[place..].rotate_right(1);
                hits[place] = Hit { depth, rgb };
            }
        }
    }

    fn into_layers(self) -> Vec<LdiLayer> {
        let shape = (self.height, self.width);
        let empty = || LdiLayer {
            rgb: Array3::zeros((3, shape.0, shape.1)),
            depth: Array2::from_elem(shape, f32::NAN),
        };
        let mut layers: Vec<_> = (0..self.layers).map(|_| empty()).collect();
        for (pixel, hits) in self.hits.chunks_exact(self.layers).enumerate() {
            let (y, x) = (pixel / self.width, pixel % self.width);
            let found = hits.iter().take_while(|hit| hit.depth.is_finite());
            for (layer, hit) in layers.iter_mut().zip(found) {
                layer.depth[[y, x]] = hit.depth;
                for (c, &value) in hit.rgb.iter().enumerate() {
                    layer.rgb[[c, y, x]] = value;
                }
            }
        }
        layers
    }
}

/// Returns twice the area of the triangle (a, b, c), positive if it is clockwise as seen (y runs down).
fn edge(a: [i64; 2], b: [i64; 2], c: [i64; 2]) -> i64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Checks whether points exactly on the edge belong to its clockwise triangle. They do on left edges and on horizontal
/// top edges.
fn is_top_left(from: [i64; 2], to: [i64; 2]) -> bool {
    to[1] < from[1] || (to[1] == from[1] && to[0] > from[0])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use std::sync::Arc;

    use super::*;
    use crate::scene::{Texture, random_scene};

    /// Makes a mesh of one colour.
    fn plain(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>, rgb: [f32; 3]) -> Mesh {
        let uv = vec![[0.5; 2]; positions.len()];
        Mesh {
            positions,
            triangles,
            uv,
            colour: Vec::new(),
            texture: Arc::new(Texture::plain(rgb)),
        }
    }

    /// Makes a rectangle facing the viewer whose depth d is linear from left to right.
    fn wall(x: [f32; 2], y: [f32; 2], d: [f32; 2], rgb: [f32; 3]) -> Mesh {
        let corner = |i: usize, j: usize| [x[i], y[j], 0.5 - d[i]];
        plain(
            vec![corner(0, 1), corner(1, 1), corner(1, 0), corner(0, 0)],
            vec![[0, 1, 2], [0, 2, 3]],
            rgb,
        )
    }

    const RED: [f32; 3] = [1.0, 0.0, 0.0];
    const GREEN: [f32; 3] = [0.0, 1.0, 0.0];
    const BLUE: [f32; 3] = [0.0, 0.0, 1.0];

    fn render(meshes: Vec<Mesh>, layers: usize) -> Ldi {
        render_ldi_reference(&Scene { meshes }, Size { width: 9, height: 6 }, layers).unwrap()
    }

    fn colour(ldi: &Ldi, layer: usize, y: usize, x: usize) -> [f32; 3] {
        [0, 1, 2].map(|c| ldi.layers[layer].rgb[[c, y, x]])
    }

    #[test]
    fn hits_come_front_first_and_the_first_n_are_kept() {
        let walls = [(0.7, RED), (0.2, GREEN), (0.5, BLUE)];
        let meshes: Vec<_> = walls
            .iter()
            .map(|&(d, rgb)| wall([0., 9.], [0., 6.], [d, d], rgb))
            .collect();
        let ldi = render(meshes.clone(), 4);
        for (layer, (d, rgb)) in [(0.2, GREEN), (0.5, BLUE), (0.7, RED)].into_iter().enumerate() {
            assert_eq!(colour(&ldi, layer, 3, 4), rgb);
            assert!((ldi.layers[layer].depth[[3, 4]] - d).abs() < 1e-6);
        }
        assert!(ldi.layers[3].depth.iter().all(|d| d.is_nan()));
        let two = render(meshes, 2);
        assert_eq!(two.layers, ldi.layers[..2]);
    }

    #[test]
    fn pixels_are_covered_where_their_centre_is_and_depth_is_linear() {
        // Centres lie at 2.5 … 5.5 across; 1.5 is on the left edge (in) and 6.5 on the right edge (out). The same holds
        // down.
        let ldi = render(vec![wall([1.5, 6.5], [0.5, 3.5], [0.0, 1.0], RED)], 1);
        for ((y, x), &d) in ldi.layers[0].depth.indexed_iter() {
            if (1..6).contains(&x) && y < 3 {
                assert!((d - (x as f32 - 1.0) / 5.0).abs() < 1e-6, "{y} {x} {d}");
            } else {
                assert!(d.is_nan(), "{y} {x} {d}");
            }
        }
    }

    #[test]
    fn backs_and_what_lies_outside_the_volume_are_not_seen() {
        let mut back = wall([0., 9.], [0., 6.], [0.5, 0.5], RED);
        back.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        // The surface is in the volume from the centre of the fourth pixel, d = 0.1, to that of the eighth, d = 0.9.
        let slanted = wall([0., 9.], [0., 6.], [-0.6, 1.2], GREEN);
        let ldi = render(vec![back, slanted], 2);
        for ((_, x), &d) in ldi.layers[0].depth.indexed_iter() {
            assert_eq!(d.is_nan(), !(3..8).contains(&x), "{x} {d}");
        }
        assert!(ldi.layers[1].depth.iter().all(|d| d.is_nan()));
    }

    #[test]
    fn equal_depths_count_once_for_the_first() {
        let meshes = [RED, GREEN].map(|rgb| wall([0., 9.], [0., 6.], [0.5, 0.5], rgb));
        let ldi = render(meshes.to_vec(), 2);
        assert_eq!(colour(&ldi, 0, 2, 2), RED);
        assert!(ldi.layers[1].depth.iter().all(|d| d.is_nan()));
    }

    #[test]
    fn texture_times_colour_is_seen_and_holes_are_seen_through() {
        let texels = vec![[200, 100, 0, 255], [200, 100, 0, 0]];
        let mut front = wall([0., 8.], [0., 6.], [0.1, 0.1], RED);
        front.texture = Arc::new(Texture::new(Size { width: 2, height: 1 }, texels).unwrap());
        front.uv = vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
        front.colour = vec![[0.5, 2.0, 1.0]; 4];
        // 200 / 255 times 2 exceeds one.
        front.colour[3] = [0.5, 3.0, 1.0];
        let ldi = render(vec![front, wall([0., 9.], [0., 6.], [0.9, 0.9], BLUE)], 2);
        assert_eq!(colour(&ldi, 1, 5, 2), BLUE);
        assert_eq!(colour(&ldi, 0, 5, 6), BLUE);
        let seen = colour(&ldi, 0, 5, 2);
        assert!((seen[0] - 100.0 / 255.0).abs() < 1e-6 && seen[2] == 0.0, "{seen:?}");
        assert!(ldi.layers[0].rgb.iter().all(|v| (0.0..=1.0).contains(v)));
    }

    /// Checks that a sheet of slanted triangles covers each pixel once: no gap along shared edges, no pixel twice.
    #[test]
    fn shared_edges_leave_no_gap_and_no_double() {
        let n = 13;
        let mut positions = Vec::new();
        for j in 0..=n {
            for i in 0..=n {
                let inner = |k: usize| (1..n).contains(&k);
                let push = |k: usize, by: usize| {
                    if inner(k) {
                        ((i * 7 + j * by) % 11) as f32 * 0.11
                    } else {
                        0.0
                    }
                };
                let place = [i as f32 * 3.0 + push(i, 5), j as f32 * 2.0 + push(j, 3)];
                positions.push([place[0], place[1], ((i * 5 + j * 3) % 7) as f32 * 0.1 - 0.3]);
            }
        }
        let at = |i: usize, j: usize| (j * (n + 1) + i) as u32;
        let mut triangles = Vec::new();
        for j in 0..n {
            for i in 0..n {
                triangles.push([at(i, j), at(i, j + 1), at(i + 1, j + 1)]);
                triangles.push([at(i, j), at(i + 1, j + 1), at(i + 1, j)]);
            }
        }
        let scene = Scene {
            meshes: vec![plain(positions, triangles, RED)],
        };
        let ldi = render_ldi_reference(
            &scene,
            Size {
                width: 3 * n,
                height: 2 * n,
            },
            2,
        )
        .unwrap();
        assert!(ldi.layers[0].depth.iter().all(|d| !d.is_nan()));
        assert!(ldi.layers[1].depth.iter().all(|d| d.is_nan()));
    }

    /// Returns every hit, depth and colour, on the line of sight through (x, y), in floating point. It also returns
    /// whether the pixel is so near an edge that the rounding of vertices matters.
    fn cast(scene: &Scene, x: f64, y: f64) -> (Vec<(f64, [f64; 3])>, bool) {
        let (mut hits, mut doubtful) = (Vec::new(), false);
        for mesh in &scene.meshes {
            for t in &mesh.triangles {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize].map(f64::from));
                let turn = |a: [f64; 3], b: [f64; 3]| (b[0] - a[0]) * (a[1] - y) - (b[1] - a[1]) * (a[0] - x);
                // The area is positive for counter-clockwise corners as seen, with y down.
                let area = (c[0] - a[0]) * (b[1] - a[1]) - (b[0] - a[0]) * (c[1] - a[1]);
                let w = [turn(b, c), turn(c, a), turn(a, b)];
                let near =
                    |p: [f64; 3], q: [f64; 3], w: f64| w.abs() < 0.006 * (q[0] - p[0]).hypot(q[1] - p[1]).max(1e-3);
                let bounds = |k: usize| (a[k].min(b[k]).min(c[k]) - 0.01, a[k].max(b[k]).max(c[k]) + 0.01);
                let (left, right) = bounds(0);
                let (top, bottom) = bounds(1);
                let close = (left..right).contains(&x) && (top..bottom).contains(&y);
                if close && (near(b, c, w[0]) || near(c, a, w[1]) || near(a, b, w[2]) || area.abs() < 0.01) {
                    doubtful = true;
                }
                if area > 0.0 && w.iter().all(|&w| w >= 0.0) {
                    let w = w.map(|w| w / area);
                    let d = 0.5 - (w[0] * a[2] + w[1] * b[2] + w[2] * c[2]);
                    let mix = |v: [f32; 3]| (0..3).map(|k| w[k] * f64::from(v[k])).sum::<f64>();
                    let uv = [0, 1].map(|i| mix(t.map(|v| mesh.uv[v as usize][i])) as f32);
                    let texel = mesh.texture.sample(uv);
                    // Rounding of vertices moves the border of a hole and the depth of a slope.
                    let slope = [a, b, c].iter().map(|p| (0.5 - p[2] - d).abs()).fold(0.0, f64::max) / area.sqrt();
                    doubtful |= (texel[3] - ALPHA_CUT).abs() < 0.1 || slope > 0.05;
                    if texel[3] >= ALPHA_CUT {
                        let tint = |i: usize| {
                            if mesh.colour.is_empty() {
                                1.0
                            } else {
                                mix(t.map(|v| mesh.colour[v as usize][i]))
                            }
                        };
                        hits.push((d, std::array::from_fn(|i| f64::from(texel[i]) * tint(i))));
                    }
                }
            }
        }
        hits.sort_by(|a, b| a.0.total_cmp(&b.0));
        doubtful |= hits.windows(2).any(|pair| pair[1].0 - pair[0].0 < 1e-3);
        (hits, doubtful)
    }

    #[test]
    fn random_scenes_agree_with_casting_rays_at_triangles() {
        let (height, width, layers) = (61, 47, 4);
        let (mut sure, mut second) = (0, 0);
        for seed in 0..6 {
            let scene = random_scene(seed, Size { width, height });
            let ldi = render_ldi_reference(&scene, Size { width, height }, layers).unwrap();
            for y in 0..height {
                for x in 0..width {
                    let (hits, doubtful) = cast(&scene, x as f64 + 0.5, y as f64 + 0.5);
                    if doubtful {
                        continue;
                    }
                    sure += 1;
                    second += usize::from(hits.len() > 1);
                    for (index, layer) in ldi.layers.iter().enumerate() {
                        let d = f64::from(layer.depth[[y, x]]);
                        let Some((expected, rgb)) = hits.get(index) else {
                            assert!(d.is_nan(), "seed {seed} ({y}, {x}): a hit at {d} too many");
                            continue;
                        };
                        assert!(
                            (d - expected).abs() < 2e-3,
                            "seed {seed} ({y}, {x}): {d} for {expected}"
                        );
                        let seen = colour(&ldi, index, y, x);
                        let worst = (0..3).map(|i| (f64::from(seen[i]) - rgb[i]).abs()).fold(0.0, f64::max);
                        assert!(worst < 0.05, "seed {seed} ({y}, {x}): {seen:?} for {rgb:?}");
                    }
                }
            }
        }
        assert!(sure > 3 * height * width && second > 1000, "{sure} {second}");
    }

    #[test]
    fn bad_requests_are_refused() {
        let scene = Scene {
            meshes: vec![wall([0., 1.], [0., 1.], [0., 1.], RED)],
        };
        for (height, width, layers) in [
            (0, 4, 1),
            (4, 0, 1),
            (4, 4, 0),
            (1 << 20, 1 << 20, 1),
            (usize::MAX, 2, 2),
        ] {
            assert!(render_ldi_reference(&scene, Size { width, height }, layers).is_err());
        }
        let refused = |change: &dyn Fn(&mut Mesh), reason: &str| {
            let mut scene = scene.clone();
            change(&mut scene.meshes[0]);
            let message = render_ldi_reference(&scene, Size { width: 4, height: 4 }, 1)
                .unwrap_err()
                .to_string();
            assert!(message.contains("mesh 0") && message.contains(reason), "{message}");
        };
        refused(&|mesh| mesh.triangles[1][2] = 4, "vertex 4");
        refused(&|mesh| mesh.positions[0][1] = f32::NAN, "not finite");
        refused(&|mesh| mesh.positions[0][2] = f32::INFINITY, "not finite");
        refused(&|mesh| mesh.positions[0][0] = 2e6, "farther than");
        refused(&|mesh| mesh.uv.truncate(3), "3 texture coordinates for 4");
        refused(&|mesh| mesh.uv[0][0] = f32::NAN, "not finite");
        refused(&|mesh| mesh.colour.push([1.0; 3]), "1 colours for 4");
    }
}
