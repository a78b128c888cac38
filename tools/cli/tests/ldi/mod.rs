//! Layered depth images of random scenes.

use phasefront::Size;
use phasefront_lab::scene;
use std::path::Path;

/// Writes the scene of `seed`, of `size`, into `folder`.
pub(crate) fn write(folder: &Path, seed: u64, size: Size, layers: usize) {
    let scene = scene::random_scene(seed, size);
    let ldi = scene::render_ldi_reference(&scene, size, layers).unwrap();
    std::fs::create_dir_all(folder).unwrap();
    ldi.write(folder).unwrap();
}
