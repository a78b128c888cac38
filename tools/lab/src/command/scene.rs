//! `phasefront-lab scene` renders a random scene, or a model from a file, as a layered depth image.

use clap::Args;
use phasefront::Size;
use phasefront_command::flags::{OverwriteFlag, parse_size};
use phasefront_command::terminal;
use phasefront_io::{Result, output};
use phasefront_lab::scene;
use phasefront_lab::scene::shapes::Light;
use serde_json::json;
use std::path::PathBuf;

/// Render a random scene, or a glTF, GLB or OBJ model, as a layered depth image
#[derive(Args)]
#[command(group = clap::ArgGroup::new("what").args(["model", "seed"]).required(true))]
pub(crate) struct Scene {
    /// Seed of a random scene; the same seed gives the same scene
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// A .gltf, .glb or .obj file, which is fitted to the frame and the volume
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Width and height, pixels
    #[arg(long, value_name = "WxH", default_value = "384x384", value_parser = parse_size)]
    size: Size,
    /// Layers: the number of hits kept along a line of sight
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u8).range(1..=64))]
    layers: u8,
    /// Render by depth peeling on the GPU instead of exactly on the CPU
    #[arg(long)]
    gpu: bool,
    /// Folder of the layered depth image: layer_0.png, depth_0.png, layer_1.png …
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    overwrite: OverwriteFlag,
}

/// The light on models, from the upper left and in front.
const LIGHT: Light = Light {
    direction: [-0.36, 0.48, 0.8],
    ambient: 0.35,
};

impl Scene {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        output::folder(&self.output, self.overwrite.holding())?;
        let layers = self.layers.into();
        let scene = match &self.model {
            Some(path) => scene::read_model(path, self.size, Some(LIGHT))?,
            None => scene::random_scene(self.seed.unwrap_or(0), self.size),
        };
        let ldi = match self.gpu {
            true => scene::DepthPeeler::new()?.render(&scene, self.size, layers)?,
            false => scene::render_ldi_reference(&scene, self.size, layers)?,
        };
        output::make_folder(&self.output)?;
        ldi.write(&self.output)?;
        let hits: Vec<usize> = (ldi.layers.iter())
            .map(|layer| layer.depth.iter().filter(|d| !d.is_nan()).count())
            .collect();
        terminal::print(
            json,
            &json!({"folder": self.output.display().to_string(), "meshes": scene.meshes.len(), "hits": hits}),
            format!(
                "{}: {} meshes, hits a layer {hits:?}",
                terminal::name(&self.output),
                scene.meshes.len()
            ),
        );
        Ok(())
    }
}
