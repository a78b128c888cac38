//! `phasefront scene`: a random scene as a layered depth image.

use super::flags::parse_size;
use clap::Args;
use phasefront_lab::{Result, scene};
use serde_json::json;
use std::path::PathBuf;

/// Make a random scene and render it as a layered depth image
#[derive(Args)]
pub(crate) struct Scene {
    /// The same seed gives the same scene
    #[arg(long, value_name = "N")]
    seed: u64,
    /// Width and height, pixels
    #[arg(long, value_name = "WxH", default_value = "384x384", value_parser = parse_size)]
    size: (usize, usize),
    /// Layers: hits kept along a line of sight
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u8).range(1..=64))]
    layers: u8,
    /// Folder of the layered depth image: layer_0.png, depth_0.png, layer_1.png …
    #[arg(short, value_name = "DIR")]
    output: PathBuf,
}

impl Scene {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        let (width, height) = self.size;
        let scene = scene::random_scene(self.seed, height, width);
        let ldi = scene::render_ldi_reference(&scene, height, width, self.layers.into())?;
        ldi.write(&self.output)?;
        let hits: Vec<usize> = (ldi.layers.iter())
            .map(|layer| layer.depth.iter().filter(|d| !d.is_nan()).count())
            .collect();
        super::print(
            json,
            &json!({"folder": self.output, "meshes": scene.meshes.len(), "hits": hits}),
            format!(
                "{}: {} meshes, hits a layer {hits:?}",
                self.output.display(),
                scene.meshes.len()
            ),
        );
        Ok(())
    }
}
