//! Solids and sheets as triangle meshes, and their placement in a scene.
//!
//! A [`Shape`] has its own axes: x right, y **up**, z toward the viewer (right-handed). It is centred at the origin and
//! extends one unit in each direction unless stated otherwise. [`Shape::place`] turns it into a [`Mesh`].

use std::f64::consts::TAU;
use std::sync::Arc;

use crate::scene::{Mesh, Texture};

/// A mesh around the origin, with outward normals.
#[derive(Debug, Clone, Default)]
pub struct Shape {
    positions: Vec<[f64; 3]>,
    normals: Vec<[f64; 3]>,
    uv: Vec<[f64; 2]>,
    triangles: Vec<[u32; 3]>,
}

/// The position, rotation and light of a shape.
#[derive(Debug, Clone)]
pub struct Place {
    /// The size along the shape's own axes, before rotation, in pixels.
    pub scale_px: [f64; 3],
    /// The rotation, as a matrix of rows.
    pub rotation: [[f64; 3]; 3],
    /// The depth, as a fraction of the volume, for a length of one pixel along z.
    pub depth_per_px: f64,
    /// The position of the origin: x and y in pixels from the frame's top-left corner, z in [−½, ½].
    pub centre: [f64; 3],
    /// The light for Lambert's shading, or `None` for no shading.
    pub light: Option<Light>,
}

/// A distant light and ambient light.
#[derive(Debug, Clone, Copy)]
pub struct Light {
    /// The direction toward the light, of length one: x right, y up, z toward the viewer.
    pub direction: [f64; 3],
    /// The brightness in the shade, in [0, 1]. Lambert's cosine gives the rest.
    pub ambient: f64,
}

impl Light {
    /// Returns the brightness, in [0, 1], of a surface with this normal.
    pub fn on(&self, normal: [f64; 3]) -> f64 {
        let cosine: f64 = (0..3).map(|i| normal[i] * self.direction[i]).sum();
        self.ambient + (1.0 - self.ambient) * cosine.max(0.0)
    }
}

impl Shape {
    /// Makes a flat square that faces the viewer. It has no back.
    pub fn sheet() -> Self {
        Self::grid(1, 1, |u, v| [2.0 * u - 1.0, 2.0 * v - 1.0, 0.0])
    }

    /// Makes a sheet of pieces, `across` x `down`, with points `point(u, v)`, u and v in [0, 1]. It is visible from the
    /// side on which u runs right and v runs up. The texture's top is at v = 1.
    pub fn grid(across: usize, down: usize, point: impl Fn(f64, f64) -> [f64; 3]) -> Self {
        let mut shape = Self::default();
        for j in 0..=down {
            for i in 0..=across {
                let (u, v) = (i as f64 / across as f64, j as f64 / down as f64);
                shape.positions.push(point(u, v));
                shape.uv.push([u, 1.0 - v]);
            }
        }
        let at = |i: usize, j: usize| (j * (across + 1) + i) as u32;
        for j in 0..down {
            for i in 0..across {
                shape.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                shape.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        shape.normals = vec![[0.0; 3]; shape.positions.len()];
        for &[a, b, c] in &shape.triangles {
            let [pa, pb, pc] = [a, b, c].map(|index| shape.positions[index as usize]);
            let normal = cross(sub(pb, pa), sub(pc, pa));
            for index in [a, b, c] {
                let sum = &mut shape.normals[index as usize];
                *sum = add(*sum, normal);
            }
        }
        // Where the sheet closes on itself, the two edges share their normals.
        let mut share = |a: u32, b: u32| {
            let (a, b) = (a as usize, b as usize);
            if length(sub(shape.positions[a], shape.positions[b])) < 1e-9 {
                let sum = add(shape.normals[a], shape.normals[b]);
                (shape.normals[a], shape.normals[b]) = (sum, sum);
            }
        };
        (0..=down).for_each(|j| share(at(0, j), at(across, j)));
        (0..=across).for_each(|i| share(at(i, 0), at(i, down)));
        shape.normals.iter_mut().for_each(|normal| *normal = unit(*normal));
        shape
    }

    /// Fills a closed outline, facing the viewer. The outline must be counter-clockwise and completely visible from the
    /// origin.
    pub fn polygon(outline: &[[f64; 2]]) -> Self {
        let mut shape = Self::default();
        shape.cap(outline, 1.0, 0.0);
        shape
    }

    /// Makes a solid of the outline from z = −1 to z = 1, with front, back and sides.
    pub fn prism(outline: &[[f64; 2]]) -> Self {
        let mut shape = Self::default();
        shape.cap(outline, 1.0, 1.0);
        shape.cap(outline, -1.0, -1.0);
        for (index, &a) in outline.iter().enumerate() {
            let b = outline[(index + 1) % outline.len()];
            let normal = unit([b[1] - a[1], a[0] - b[0], 0.0]);
            let [u0, u1] = [index, index + 1].map(|i| i as f64 / outline.len() as f64);
            let corners = [
                (a, -1.0, [u0, 1.0]),
                (b, -1.0, [u1, 1.0]),
                (b, 1.0, [u1, 0.0]),
                (a, 1.0, [u0, 0.0]),
            ];
            let first = shape.positions.len() as u32;
            for (p, z, uv) in corners {
                shape.vertex([p[0], p[1], z], normal, uv);
            }
            // Seen from outside, a and b at the back join b and a in front.
            shape
                .triangles
                .extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
        shape
    }

    /// Makes a cuboid from −1 to 1 along each axis. Every face shows the whole texture.
    pub fn cuboid() -> Self {
        let mut shape = Self::default();
        let faces = [
            ([1., 0., 0.], [0., 1., 0.]),
            ([0., 0., -1.], [0., 1., 0.]),
            ([-1., 0., 0.], [0., 1., 0.]),
        ];
        let lids = [
            ([0., 0., 1.], [0., 1., 0.]),
            ([1., 0., 0.], [0., 0., -1.]),
            ([1., 0., 0.], [0., 0., 1.]),
        ];
        for (right, up) in faces.into_iter().chain(lids) {
            let normal = cross(right, up);
            let first = shape.positions.len() as u32;
            for [i, j] in [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]] {
                let place = std::array::from_fn(|k| i * right[k] + j * up[k] + normal[k]);
                shape.vertex(place, normal, [(i + 1.0) / 2.0, (1.0 - j) / 2.0]);
            }
            shape
                .triangles
                .extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
        shape
    }

    /// Makes a sphere of `detail` pieces around, with the radius `radius(direction)`.
    pub fn ball(detail: usize, radius: impl Fn([f64; 3]) -> f64) -> Self {
        Self::grid(detail, (detail / 2).max(2), |u, v| {
            let (sin_u, cos_u) = libm::sincos(TAU * u);
            let (sin_v, cos_v) = libm::sincos(TAU * 0.5 * v);
            let direction = [sin_u * sin_v, -cos_v, cos_u * sin_v];
            let r = radius(direction);
            direction.map(|c| c * r)
        })
    }

    /// Makes a ring around the z axis with an outer radius of one and a tube of radius `tube`.
    pub fn torus(detail: usize, tube: f64) -> Self {
        Self::grid(detail, (detail / 2).max(3), |u, v| {
            let (sin_u, cos_u) = libm::sincos(TAU * u);
            let (sin_v, cos_v) = libm::sincos(TAU * v);
            let r = 1.0 - tube + tube * cos_v;
            [r * cos_u, r * sin_u, tube * sin_v]
        })
    }

    /// Makes a cylinder along y. The radius of its top is `top` times that of its bottom: 1 gives a rod, 0 a cone.
    pub fn cylinder(detail: usize, top: f64) -> Self {
        let ring = |r: f64| {
            let turn = move |i: usize| libm::sincos(TAU * i as f64 / detail as f64);
            (0..detail)
                .map(turn)
                .map(|(sin, cos)| [r * cos, r * sin])
                .collect::<Vec<_>>()
        };
        let mut shape = Self::grid(detail, 1, |u, v| {
            let (sin, cos) = libm::sincos(TAU * u);
            let r = 1.0 + (top - 1.0) * v;
            [r * sin, 2.0 * v - 1.0, r * cos]
        });
        let mut lids = Self::default();
        if top > 0.0 {
            lids.cap(&ring(top), 1.0, 1.0);
        }
        lids.cap(&ring(1.0), -1.0, -1.0);
        // The caps face along z, but the cylinder runs along y.
        let stand = |[x, y, z]: [f64; 3]| [x, z, -y];
        lids.positions.iter_mut().for_each(|p| *p = stand(*p));
        lids.normals.iter_mut().for_each(|n| *n = stand(*n));
        shape.append(&lids);
        shape
    }

    /// Makes a tube of radius `tube` along the closed curve `curve(t)`, t in [0, 1).
    pub fn loop_tube(detail: usize, tube: f64, curve: impl Fn(f64) -> [f64; 3]) -> Self {
        Self::grid(detail, 8, |u, v| {
            let (before, here, after) = (curve(u - 1e-3), curve(u), curve(u + 1e-3));
            let along = unit(sub(after, before));
            let side = unit(cross(along, [0.0, 0.0, 1.0]));
            let up = cross(side, along);
            let (sin, cos) = libm::sincos(TAU * v);
            std::array::from_fn(|i| here[i] + tube * (cos * side[i] + sin * up[i]))
        })
    }

    /// Adds the triangles of the other shape.
    pub fn append(&mut self, other: &Self) {
        let first = self.positions.len() as u32;
        self.positions.extend(&other.positions);
        self.normals.extend(&other.normals);
        self.uv.extend(&other.uv);
        self.triangles
            .extend(other.triangles.iter().map(|t| t.map(|index| index + first)));
    }

    /// Returns the shape scaled, rotated and shifted within its own axes.
    pub fn moved(mut self, scale: [f64; 3], rotation: [[f64; 3]; 3], shift: [f64; 3]) -> Self {
        for p in &mut self.positions {
            *p = add(rotate(&rotation, scaled(*p, scale)), shift);
        }
        let inverse = scale.map(|s| 1.0 / s);
        for n in &mut self.normals {
            *n = unit(rotate(&rotation, scaled(*n, inverse)));
        }
        self
    }

    /// Returns the shape as a mesh of the scene. Shading uses the shape before its depth is scaled.
    pub fn place(&self, place: &Place, texture: Arc<Texture>) -> Mesh {
        let inverse = place.scale_px.map(|s| 1.0 / s);
        let position = |p: &[f64; 3]| {
            let [x, y, z] = rotate(&place.rotation, scaled(*p, place.scale_px));
            let [cx, cy, cz] = place.centre;
            [cx + x, cy - y, cz + place.depth_per_px * z].map(|v| v as f32)
        };
        let colour = |light: Light| {
            let shade = move |n: &[f64; 3]| [light.on(unit(rotate(&place.rotation, scaled(*n, inverse)))) as f32; 3];
            self.normals.iter().map(shade).collect()
        };
        Mesh {
            positions: self.positions.iter().map(position).collect(),
            triangles: self.triangles.clone(),
            uv: self.uv.iter().map(|uv| uv.map(|v| v as f32)).collect(),
            colour: place.light.map(colour).unwrap_or_default(),
            texture,
        }
    }

    fn vertex(&mut self, position: [f64; 3], normal: [f64; 3], uv: [f64; 2]) {
        self.positions.push(position);
        self.normals.push(normal);
        self.uv.push(uv);
    }

    /// Fills the outline at height z, facing +z (`side` 1) or −z (`side` −1).
    fn cap(&mut self, outline: &[[f64; 2]], side: f64, z: f64) {
        let middle = self.positions.len() as u32;
        let count = outline.len() as u32;
        for p in std::iter::once(&[0.0, 0.0]).chain(outline) {
            self.vertex(
                [p[0], p[1], z],
                [0.0, 0.0, side],
                [(p[0] + 1.0) / 2.0, (1.0 - p[1]) / 2.0],
            );
        }
        for index in 0..count {
            let (a, b) = (middle + 1 + index, middle + 1 + (index + 1) % count);
            self.triangles
                .push(if side > 0.0 { [middle, a, b] } else { [middle, b, a] });
        }
    }
}

/// Returns the outline of a star in the unit circle, with its inner corners at radius `inner`. An `inner` of one gives
/// a regular polygon of `2 * points` corners, and cos(π / points) gives one of `points` corners.
pub fn star(points: usize, inner: f64) -> Vec<[f64; 2]> {
    (0..2 * points)
        .map(|i| {
            let (sin, cos) = libm::sincos(TAU * i as f64 / (2 * points) as f64);
            let r = if i % 2 == 0 { 1.0 } else { inner };
            [r * cos, r * sin]
        })
        .collect()
}

/// Returns the rotation of a unit quaternion [w, x, y, z].
pub fn quaternion([w, x, y, z]: [f64; 4]) -> [[f64; 3]; 3] {
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}

/// Returns the rotation by `angle` about `axis`, of length one. The angle is in radians, counter-clockwise as seen from
/// the tip of the axis.
pub fn turn(axis: [f64; 3], angle: f64) -> [[f64; 3]; 3] {
    let (sin, cos) = libm::sincos(angle / 2.0);
    quaternion([cos, sin * axis[0], sin * axis[1], sin * axis[2]])
}

fn rotate(rotation: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| rotation[i][0] * v[0] + rotation[i][1] * v[1] + rotation[i][2] * v[2])
}

fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] + b[i])
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn scaled(a: [f64; 3], scale: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] * scale[i])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn length(a: [f64; 3]) -> f64 {
    (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt()
}

/// Scales the vector to length one. A vector of length zero becomes the direction toward the viewer.
fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = length(a);
    if length > 1e-12 {
        a.map(|v| v / length)
    } else {
        [0.0, 0.0, 1.0]
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::scene::{Scene, render_ldi_reference};
    use phasefront::Size;

    fn solids() -> Vec<(&'static str, Shape, f64)> {
        let knot = |t: f64| {
            let (sin, cos) = libm::sincos(TAU * t);
            [0.8 * cos, 0.8 * sin, 0.0]
        };
        let hexagon = star(6, 0.75f64.sqrt());
        // The expected volumes are those of the smooth solids.
        vec![
            ("cuboid", Shape::cuboid(), 8.0),
            ("ball", Shape::ball(64, |_| 1.0), 4.0 / 3.0 * TAU / 2.0),
            ("torus", Shape::torus(64, 0.25), TAU / 2.0 * 0.25 * 0.25 * TAU * 0.75),
            ("rod", Shape::cylinder(64, 1.0), TAU),
            ("cone", Shape::cylinder(64, 0.0), TAU / 3.0),
            ("prism", Shape::prism(&hexagon), 2.0 * 1.5 * 3f64.sqrt()),
            ("tube", Shape::loop_tube(64, 0.2, knot), TAU / 2.0 * 0.04 * TAU * 0.8),
        ]
    }

    #[test]
    fn solids_are_closed_and_turned_outward() {
        for (name, shape, volume) in solids() {
            let corner = |t: &[u32; 3], i: usize| shape.positions[t[i] as usize];
            let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            let sum: f64 = shape
                .triangles
                .iter()
                .map(|t| dot(corner(t, 0), cross(corner(t, 1), corner(t, 2))) / 6.0)
                .sum();
            // An eight-sided tube has a tenth less volume than a round one.
            assert!((sum / volume - 1.0).abs() < 0.11, "{name}: volume {sum} for {volume}");
            // The area vectors of a closed surface add up to zero.
            let area = shape.triangles.iter().fold([0.0; 3], |sum, t| {
                add(
                    sum,
                    cross(sub(corner(t, 1), corner(t, 0)), sub(corner(t, 2), corner(t, 0))),
                )
            });
            assert!(length(area) < 1e-9, "{name}: {area:?}");
            for t in &shape.triangles {
                let face = cross(sub(corner(t, 1), corner(t, 0)), sub(corner(t, 2), corner(t, 0)));
                for &index in t {
                    assert!(
                        dot(face, shape.normals[index as usize]) >= -1e-12,
                        "{name}: a normal points inward"
                    );
                }
            }
        }
    }

    #[test]
    fn a_shape_stands_where_it_is_placed() {
        let place = Place {
            scale_px: [8.0, 4.0, 100.0],
            rotation: turn([0.0, 0.0, 1.0], TAU / 4.0),
            depth_per_px: 0.002,
            centre: [20.0, 10.0, 0.1],
            light: Some(Light {
                direction: [0.0, 0.0, 1.0],
                ambient: 0.25,
            }),
        };
        let mesh = Shape::cuboid().place(&place, Arc::new(Texture::plain([1.0; 3])));
        let ldi = render_ldi_reference(&Scene { meshes: vec![mesh] }, Size { width: 40, height: 20 }, 2).unwrap();
        for ((y, x), &d) in ldi.layers[0].depth.indexed_iter() {
            // After a quarter turn, the box extends 4 pixels to either side and 8 up and down. Its front is 100 px
            // nearer than its middle.
            if (16..24).contains(&x) && (2..18).contains(&y) {
                assert!((d - (0.5 - 0.1 - 0.2)).abs() < 1e-6);
                assert_eq!(ldi.layers[0].rgb[[0, y, x]], 1.0, "lit full in the face");
            } else {
                assert!(d.is_nan());
            }
        }
        assert!(ldi.layers[1].depth.iter().all(|d| d.is_nan()));
    }

    #[test]
    fn pictures_stand_upright_on_sheets() {
        let texels = vec![
            [255, 0, 0, 255],
            [0, 255, 0, 255],
            [0, 0, 255, 255],
            [255, 255, 255, 255],
        ];
        let texture = Arc::new(Texture::new(Size { width: 2, height: 2 }, texels).unwrap());
        let place = Place {
            scale_px: [8.0; 3],
            rotation: turn([0.0, 0.0, 1.0], 0.0),
            depth_per_px: 0.0,
            centre: [8.0, 8.0, 0.0],
            light: None,
        };
        for shape in [
            Shape::sheet(),
            Shape::polygon(&[[1., -1.], [1., 1.], [-1., 1.], [-1., -1.]]),
            Shape::cuboid(),
        ] {
            let scene = Scene {
                meshes: vec![shape.place(&place, texture.clone())],
            };
            let ldi = render_ldi_reference(&scene, Size { width: 16, height: 16 }, 1).unwrap();
            let seen = |y: usize, x: usize| [0, 1, 2].map(|c| ldi.layers[0].rgb[[c, y, x]].round());
            assert_eq!([seen(4, 4), seen(4, 12)], [[1., 0., 0.], [0., 1., 0.]]);
            assert_eq!([seen(12, 4), seen(12, 12)], [[0., 0., 1.], [1., 1., 1.]]);
        }
    }
}
