//! Parts of a model, and the limits of a model's size.

use crate::scene::Texture;
use std::sync::Arc;

/// The most triangles of a model file.
pub const MAX_MODEL_TRIANGLES: usize = 10_000_000;
/// The most bytes of a model file, without its buffers and pictures.
pub const MAX_MODEL_BYTES: u64 = 2 << 30;

/// A model's surface of one material, in the file's axes: x right, y up, z toward the viewer.
#[derive(Debug, Default)]
pub(super) struct Part {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// One normal per position, or empty.
    pub(super) normals: Vec<[f32; 3]>,
    /// Texture coordinates, one per position, or empty: then `texture` has one texel.
    pub(super) uv: Vec<[f32; 2]>,
    /// One colour per position, or empty.
    pub(super) colour: Vec<[f32; 3]>,
    /// The picture, or `None` for white.
    pub(super) texture: Option<Arc<Texture>>,
    /// Whether the back is visible too.
    pub(super) two_sided: bool,
}

/// Returns an error if a model has too many triangles.
pub(super) fn check_count(triangles: usize) -> std::result::Result<(), String> {
    if triangles > MAX_MODEL_TRIANGLES {
        return Err(format!(
            "{triangles} triangles; a model may have {MAX_MODEL_TRIANGLES} at most"
        ));
    }
    Ok(())
}
