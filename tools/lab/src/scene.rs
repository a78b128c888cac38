//! Scenes of textured triangle meshes, and their rendering to layered depth images.
//!
//! * [`Scene`], [`Mesh`] and [`Texture`] describe what is there.
//! * [`random_scene`], [`natural_scene`] (like photographs) and [`varied_scene`] make the scenes of data sets.
//! * [`read_model`] reads glTF, GLB and OBJ files.
//! * [`render_ldi_reference`] renders on the CPU, exactly; [`DepthPeeler`] the same on a GPU.
//!
//! # Coordinates
//! The camera is orthographic, as the illumination is collimated: it looks along −z and has no position. A vertex
//! is `[x, y, z]`: x and y in pixels from the frame's top-left corner, x right and y down, so that the centre of
//! pixel (row, column) lies at (column + ½, row + ½); z in parts of the volume's depth, toward the viewer, from
//! +½ (nearest) to −½ (farthest). Normalized depth is d = ½ − z. A scene so described fits any display.

mod model;
pub mod pattern;
mod random;
mod render;
pub mod shapes;
mod texture;

use phasefront_io::{Error, Result};
use std::sync::Arc;

pub use model::{MAX_MODEL_BYTES, MAX_MODEL_TRIANGLES, read_model};
pub use random::{fingerprint, natural_scene, random_scene, read_photographs, varied_scene};
pub use render::{DepthPeeler, render_ldi_reference};
pub use texture::Texture;

/// Farthest from the frame's corner that a vertex may lie, in pixels.
pub const MAX_COORDINATE_PX: f32 = 1_048_576.0;

/// What there is to see: meshes in front of nothing.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// The meshes. Of two surfaces at exactly the same depth the one that comes first here is seen.
    pub meshes: Vec<Mesh>,
}

/// A textured triangle mesh in the coordinates of the [module](self).
///
/// A triangle's front is where its corners turn counter-clockwise as the viewer sees them. Back faces are not seen:
/// an LDI records front-facing surfaces only.
#[derive(Debug, Clone)]
pub struct Mesh {
    /// Vertices.
    pub positions: Vec<[f32; 3]>,
    /// Indices into `positions`, three a triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Texture coordinates, one a vertex: (0, 0) is the texture's top-left corner, (1, 1) its bottom-right one.
    /// Beyond [0, 1] the texture repeats.
    pub uv: Vec<[f32; 2]>,
    /// RGB factors of the texture, one a vertex, or none at all for white. Shading is written here.
    pub colour: Vec<[f32; 3]>,
    /// The picture on the surface; meshes may share it.
    pub texture: Arc<Texture>,
}

impl Scene {
    /// Checks every mesh: indices in range, one uv and, if any, one colour a vertex, all numbers finite, vertices
    /// within [`MAX_COORDINATE_PX`].
    pub fn check(&self) -> Result<()> {
        for (index, mesh) in self.meshes.iter().enumerate() {
            mesh.check()
                .map_err(|reason| Error::Input(format!("mesh {index} of the scene: {reason}")))?;
        }
        Ok(())
    }
}

impl Mesh {
    fn check(&self) -> std::result::Result<(), String> {
        let count = self.positions.len();
        if self.uv.len() != count {
            return Err(format!("{} texture coordinates for {count} vertices", self.uv.len()));
        }
        if !self.colour.is_empty() && self.colour.len() != count {
            return Err(format!("{} colours for {count} vertices", self.colour.len()));
        }
        if let Some(index) = self.triangles.iter().flatten().find(|&&index| index as usize >= count) {
            return Err(format!("a triangle names vertex {index}, but there are {count}"));
        }
        for p in &self.positions {
            let inside = p[0].abs() <= MAX_COORDINATE_PX && p[1].abs() <= MAX_COORDINATE_PX && p[2].is_finite();
            if !inside {
                return Err(format!(
                    "vertex {p:?} is not finite or farther than {MAX_COORDINATE_PX} px from the frame"
                ));
            }
        }
        if self
            .uv
            .iter()
            .flatten()
            .chain(self.colour.iter().flatten())
            .any(|value| !value.is_finite())
        {
            return Err("a texture coordinate or colour is not finite".into());
        }
        Ok(())
    }
}
