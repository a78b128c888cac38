//! Reads models from files as scenes. This module holds the steps that glTF and OBJ share; `gltf_file` and `obj_file`
//! read the formats.

mod beside;
mod gltf_file;
mod obj_file;
mod part;

pub use part::{MAX_MODEL_BYTES, MAX_MODEL_TRIANGLES};
use phasefront::Size;

use crate::scene::model::part::Part;
use crate::scene::shapes::Light;
use crate::scene::{Mesh, Scene, Texture};
use phasefront_io::{Error, Result, output};
use std::path::Path;
use std::sync::Arc;

/// The fraction of the frame's height or width that a model fills, whichever it reaches first.
const FILL: f64 = 0.9;
/// The fraction of the volume's depth that a model fills.
const DEPTH_FILL: f64 = 0.96;

/// Reads a model from a `.gltf`, `.glb` or `.obj` file as a scene for a frame of `size`. The model
/// is upright, seen along its −z axis, in the middle of the frame and as large as fits. Its depth is stretched or
/// compressed to the volume. With a light, the vertex colours contain Lambert's shading.
///
/// The visible colour is the base colour (glTF) or the diffuse colour (OBJ). A surface without texture coordinates
/// loses its texture. If a picture that an OBJ's material names is missing, the surface is white and a warning is
/// logged. Textures repeat, whatever the file says. Lines, points and animations are ignored.
///
/// The error names the file. Reading fails if the file does not exist, is not a model of its format, has no triangles,
/// has numbers that are not finite, has no height and width, exceeds [`MAX_MODEL_TRIANGLES`] or [`MAX_MODEL_BYTES`], or
/// names a picture that cannot be read.
pub fn read_model(path: &Path, size: Size, light: Option<Light>) -> Result<Scene> {
    let Size { width, height } = size;
    output::reading(path)?;
    let fail = |reason: String| Error::file(path, reason);
    let about = std::fs::metadata(path).map_err(|e| fail(e.to_string()))?;
    if !about.is_file() {
        return Err(fail("is no regular file".into()));
    }
    let size = about.len();
    if size > MAX_MODEL_BYTES {
        return Err(fail(format!(
            "{size} bytes; a model may have {MAX_MODEL_BYTES} at most"
        )));
    }
    let extension = path
        .extension()
        .and_then(|e| e.to_str())
        .unwrap_or_default()
        .to_ascii_lowercase();
    let parts = match extension.as_str() {
        "gltf" | "glb" => gltf_file::read(path),
        "obj" => obj_file::read(path),
        _ => Err("not a model file by its name; .gltf, .glb and .obj are read".into()),
    };
    let parts = parts.map_err(fail)?;
    let frame = Frame::around(&parts, Size { width, height }).map_err(fail)?;
    let scene = Scene {
        meshes: parts.into_iter().flat_map(|part| sides(part, &frame, light)).collect(),
    };
    scene.check().map_err(|e| fail(e.to_string()))?;
    Ok(scene)
}

/// The conversion from a model's coordinates to the scene's.
struct Frame {
    middle: [f64; 3],
    /// Pixels per unit along x and y; fractions of the volume per unit along z.
    scale: [f64; 3],
    /// The middle of the frame, in pixels.
    at: [f64; 2],
}

impl Frame {
    fn around(parts: &[Part], size: Size) -> std::result::Result<Self, String> {
        let Size { width, height } = size;
        let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
        // Only vertices of triangles are visible.
        let corners = parts
            .iter()
            .flat_map(|part| part.triangles.iter().flatten().map(|&i| part.positions[i as usize]));
        for p in corners {
            if !p.iter().all(|v| v.is_finite()) {
                return Err(format!("vertex {p:?} is not finite"));
            }
            for i in 0..3 {
                (low[i], high[i]) = (low[i].min(f64::from(p[i])), high[i].max(f64::from(p[i])));
            }
        }
        if low[0] > high[0] {
            return Err("no triangles to see".into());
        }
        let extent: [f64; 3] = std::array::from_fn(|i| high[i] - low[i]);
        let fit = |size: usize, extent: f64| {
            if extent > 0.0 {
                FILL * size as f64 / extent
            } else {
                f64::INFINITY
            }
        };
        let scale = fit(width, extent[0]).min(fit(height, extent[1]));
        if !scale.is_finite() || scale <= 0.0 {
            return Err(format!(
                "a model of {} by {} units, seen from the front, has no size",
                extent[0], extent[1]
            ));
        }
        let deep = if extent[2] > 0.0 { DEPTH_FILL / extent[2] } else { 0.0 };
        let at = [width as f64 / 2.0, height as f64 / 2.0];
        Ok(Self {
            middle: std::array::from_fn(|i| (low[i] + high[i]) / 2.0),
            scale: [scale, -scale, deep],
            at,
        })
    }

    fn place(&self, p: [f32; 3]) -> [f32; 3] {
        let moved: [f64; 3] = std::array::from_fn(|i| (f64::from(p[i]) - self.middle[i]) * self.scale[i]);
        [moved[0] + self.at[0], moved[1] + self.at[1], moved[2]].map(|v| v as f32)
    }
}

/// Makes the meshes of the part's front and, if it is two-sided, of its back.
fn sides(part: Part, frame: &Frame, light: Option<Light>) -> Vec<Mesh> {
    let normals = if part.normals.is_empty() {
        smooth_normals(&part)
    } else {
        part.normals
    };
    let count = part.positions.len();
    let colour = |side: f64| -> Vec<[f32; 3]> {
        let Some(light) = light else {
            return part.colour.clone();
        };
        let shade = |n: &[f32; 3]| light.on(unit(n.map(|v| side * f64::from(v)))) as f32;
        let base = |index: usize| part.colour.get(index).copied().unwrap_or([1.0; 3]);
        normals
            .iter()
            .enumerate()
            .map(|(index, n)| base(index).map(|v| v * shade(n)))
            .collect()
    };
    let front = Mesh {
        positions: part.positions.iter().map(|&p| frame.place(p)).collect(),
        colour: colour(1.0),
        triangles: part.triangles,
        uv: if part.uv.is_empty() {
            vec![[0.5; 2]; count]
        } else {
            part.uv
        },
        texture: part.texture.unwrap_or_else(|| Arc::new(Texture::plain([1.0; 3]))),
    };
    let back = part.two_sided.then(|| Mesh {
        triangles: front.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(),
        colour: colour(-1.0),
        ..front.clone()
    });
    std::iter::once(front).chain(back).collect()
}

/// Returns, for each vertex, the mean of its triangles' normals, weighted by area.
fn smooth_normals(part: &Part) -> Vec<[f32; 3]> {
    let mut sums = vec![[0.0f32; 3]; part.positions.len()];
    for t in &part.triangles {
        let [a, b, c] = t.map(|index| part.positions[index as usize]);
        let (u, v): ([f32; 3], [f32; 3]) = (
            std::array::from_fn(|i| b[i] - a[i]),
            std::array::from_fn(|i| c[i] - a[i]),
        );
        let normal = [
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
        ];
        for &index in t {
            (0..3).for_each(|i| sums[index as usize][i] += normal[i]);
        }
    }
    sums
}

/// Scales the vector to length one. Returns zeros if its length is zero or not finite.
fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    if length > 0.0 && length.is_finite() {
        v.map(|v| v / length)
    } else {
        [0.0; 3]
    }
}
