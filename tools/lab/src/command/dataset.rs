//! `phasefront-lab dataset` makes LDI and hologram pairs. It can resume and can run in shards.

use super::sensors::{self, Sensors};
use clap::{Args, ValueEnum};
use phasefront_command::flags::DisplayFlags;
use phasefront_command::terminal::{self, progress_bar};
use phasefront_io::output::{self, Holding};
use phasefront_io::{Error, Result};
use phasefront_lab::dataset::{self, Look, Manifest};
use phasefront_lab::scene;
use serde_json::json;
use std::path::PathBuf;

/// Make a data set: random scenes as layered depth images and their holograms
///
/// If the folder already holds part of the data set, the command resumes. If the display's file names an aberration,
/// the holograms correct it.
#[derive(Args)]
pub(crate) struct Dataset {
    /// Pairs to make; of each 40, one is for validation and one for tests
    #[arg(long, value_name = "N")]
    scenes: usize,
    /// Height and width of a scene, pixels
    #[arg(long, value_name = "PX", default_value_t = 384)]
    size: usize,
    /// Number of SM-LBM planes
    #[arg(long, value_name = "N", default_value_t = 1000)]
    planes: usize,
    /// Number of layers of a layered depth image
    #[arg(long, value_name = "N", default_value_t = 5)]
    ldi_layers: usize,
    /// Seed; the same seed gives the same data set. 800 to 899 are for validation and 900 to 999 for tests: train on
    /// other seeds
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// Look of the scenes
    #[arg(long, value_enum, default_value_t = Like::Objects)]
    scenes_like: Like,
    /// Folder of pictures (.jpg, .png) for the surfaces of photograph-like and varied scenes; the manifest records
    /// their fingerprint
    #[arg(long, value_name = "DIR")]
    textures: Option<PathBuf>,
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', value_parser = sensors::parse, help = format!("Simulated sensors whose depth pairs hold as well, treated as in sessions, separated by commas: {}", sensors::names()))]
    sensor: Vec<Sensors>,
    /// Make every nth pair only, starting from the ith of 0..n
    #[arg(long, value_name = "I/N", value_parser = parse_shard)]
    shard: Option<(usize, usize)>,
    #[command(flatten)]
    display: DisplayFlags,
    /// Folder of the data set
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Like {
    /// Many objects, mostly without a background; dark
    Objects,
    /// Bright and dark scenes that fill the frame, with textures, depth steps and thin objects like photographs
    Photographs,
    /// Scenes of every kind: any brightness, textures from white noise to flat, a few objects to hundreds of thin ones
    Varied,
    /// About forty overlapping, tilted objects with textures from white noise to flat, of medium brightness
    Hard,
    /// Furnished interiors in perspective, of any brightness
    Interiors,
}

fn parse_shard(text: &str) -> std::result::Result<(usize, usize), String> {
    let parsed = text
        .split_once('/')
        .and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    match parsed {
        Some((i, n)) if i < n => Ok((i, n)),
        _ => Err("a shard is written i/n with i from 0 to n − 1, as 0/4".into()),
    }
}

impl Dataset {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        output::folder(&self.output, Holding::RunOf("manifest.json"))?;
        let file = self.display.read()?;
        let display = file.target.display;
        if display.offset_m() != 0.0 {
            return Err(Error::Input(
                "a data set holds midpoint holograms; the display's offset must be 0".into(),
            ));
        }
        let textures = match &self.textures {
            Some(_) if matches!(self.scenes_like, Like::Objects | Like::Hard | Like::Interiors) => {
                return Err(Error::Usage(
                    "--textures is for --scenes-like photographs and varied".into(),
                ));
            }
            Some(folder) => scene::read_photographs(folder)?,
            None => Vec::new(),
        };
        let look = match self.scenes_like {
            Like::Objects => Look::Objects,
            Like::Photographs => Look::photographs(&textures),
            Like::Varied => Look::varied(&textures),
            Like::Hard => Look::Hard,
            Like::Interiors => Look::Interiors,
        };
        let manifest = Manifest::new(self.scenes, self.size, self.planes, self.ldi_layers, self.seed, display)?
            .looking(look)
            .correcting(file.aberration.as_ref())
            .sensed_by(Sensors::all(&self.sensor));
        let shard = self.shard.unwrap_or((0, 1));
        let mine = self.scenes.saturating_sub(shard.0).div_ceil(shard.1);
        let bar = progress_bar(mine as u64, "pairs");
        dataset::make(&manifest, &textures, &self.output, shard, &|| bar.inc(1))?;
        bar.finish_and_clear();
        terminal::print(
            json,
            &json!({"folder": self.output.display().to_string(), "pairs": mine, "scenes": self.scenes}),
            format!("{}: {mine} pairs", terminal::name(&self.output)),
        );
        Ok(())
    }
}
