//! Scenes of textured triangle meshes, and their rendering to layered depth images.
//!
//! * [`Scene`], [`Mesh`] and [`Texture`] describe a scene.
//! * [`random_scene`], [`natural_scene`] (photograph-like), [`varied_scene`], [`hard_scene`] and [`interior_scene`]
//!   make the scenes of data sets.
//! * [`read_model`] reads glTF, GLB and OBJ files.
//! * [`render_ldi_reference`] renders exactly on the CPU; [`DepthPeeler`] renders on a GPU.
//!
//! # Coordinates
//! The camera is orthographic, because the illumination is collimated. It looks along −z and has no position. A vertex
//! is `[x, y, z]`. x and y are in pixels from the frame's top-left corner, x right and y down, so the centre of pixel
//! (row, column) lies at (column + ½, row + ½). z is a fraction of the volume's depth, positive toward the viewer, from
//! +½ (nearest) to −½ (farthest). The normalized depth is d = ½ − z. A scene in these coordinates fits any display.

mod model;
pub mod pattern;
mod random;
mod render;
pub mod shapes;
mod texture;

use phasefront_io::{Error, Result};
use std::sync::Arc;

pub use model::{MAX_MODEL_BYTES, MAX_MODEL_TRIANGLES, read_model};
pub use random::{
    fingerprint, hard_scene, interior_scene, natural_scene, random_scene, read_photographs, varied_scene,
};
pub use render::{DepthPeeler, render_ldi_reference};
pub use texture::Texture;

/// The largest distance of a vertex from the frame's corner, in pixels.
pub const MAX_COORDINATE_PX: f32 = 1_048_576.0;

/// A scene: meshes in front of an empty background.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// The meshes. Of two surfaces at exactly the same depth, the earlier one in this list is visible.
    pub meshes: Vec<Mesh>,
}

/// A textured triangle mesh in the coordinates of the [module](self).
///
/// The front of a triangle is the side from which its corners run counter-clockwise. Back faces are invisible, because
/// an LDI records only front-facing surfaces.
#[derive(Debug, Clone)]
pub struct Mesh {
    /// The vertices.
    pub positions: Vec<[f32; 3]>,
    /// The triangles, as indices into `positions`.
    pub triangles: Vec<[u32; 3]>,
    /// The texture coordinates of each vertex: (0, 0) is the texture's top-left corner, (1, 1) its bottom-right corner.
    /// Outside [0, 1] the texture repeats.
    pub uv: Vec<[f32; 2]>,
    /// The RGB factors of the texture for each vertex, or empty for white. They contain the shading.
    pub colour: Vec<[f32; 3]>,
    /// The picture on the surface. Meshes may share it.
    pub texture: Arc<Texture>,
}

impl Scene {
    /// Checks that every mesh has valid indices, one uv and, if it has colours, one colour per vertex, and only finite
    /// numbers, with all vertices within [`MAX_COORDINATE_PX`].
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
