//! Parts of a model, and how large a model may be.

use crate::scene::Texture;
use std::sync::Arc;

/// Most triangles that a model file may hold.
pub const MAX_MODEL_TRIANGLES: usize = 10_000_000;
/// Most bytes of a model file, its buffers and pictures not counted.
pub const MAX_MODEL_BYTES: u64 = 2 << 30;

/// A model's surface of one material, in the file's axes: x right, y up, z toward the viewer.
#[derive(Debug, Default)]
pub(super) struct Part {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// As many as positions, or none.
    pub(super) normals: Vec<[f32; 3]>,
    /// As many as positions, or none: then `texture` has one texel.
    pub(super) uv: Vec<[f32; 2]>,
    /// As many as positions, or none.
    pub(super) colour: Vec<[f32; 3]>,
    /// The picture; white where there is none.
    pub(super) texture: Option<Arc<Texture>>,
    /// Whether its back is seen as well.
    pub(super) two_sided: bool,
}

/// An error if a model of that many triangles is too large.
pub(super) fn check_count(triangles: usize) -> std::result::Result<(), String> {
    if triangles > MAX_MODEL_TRIANGLES {
        return Err(format!(
            "{triangles} triangles; a model may have {MAX_MODEL_TRIANGLES} at most"
        ));
    }
    Ok(())
}
