//! Layered depth images of random scenes.

use phasefront_lab::scene;
use std::path::Path;

/// Writes the scene of `seed`, with `width`×`height` pixels, into `folder`.
pub(crate) fn write(folder: &Path, seed: u64, (width, height): (usize, usize), layers: usize) {
    let scene = scene::random_scene(seed, height, width);
    let ldi = scene::render_ldi_reference(&scene, height, width, layers).unwrap();
    std::fs::create_dir_all(folder).unwrap();
    ldi.write(folder).unwrap();
}
