//! `phasefront networks`: lists the names that --network takes.

use clap::Args;
use phasefront_command::networks::Precision;
use phasefront_command::terminal;
use phasefront_io::{Error, Result};
use phasefront_models::{NATURAL, NETWORKS, PAIR};
use serde_json::json;

/// List the bundled networks
#[derive(Args)]
pub(crate) struct Networks {}

impl Networks {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        let missing = || Error::Input("a bundled network is not compiled in".into());
        let mut rows = Vec::new();
        for model in NETWORKS {
            let network = model.network(Precision::Int8).ok_or_else(missing)?;
            let (layers, input) = (network.layers(), network.input().to_string());
            rows.push((model.name, layers, input, "any offset".to_owned()));
        }
        let network = NATURAL.network(Precision::Int8).ok_or_else(missing)?;
        let natural = "any offset, for natural focus".to_owned();
        rows.push((NATURAL.name, network.layers(), network.input().to_string(), natural));
        let network = PAIR.networks(Precision::Int8).ok_or_else(missing)?.hologram;
        let offset = "0 mm, with its pre-filter".to_owned();
        rows.push((PAIR.name, network.layers(), network.input().to_string(), offset));
        let values: Vec<_> = (rows.iter())
            .map(|(name, layers, input, offset)| {
                json!({"name": name, "layers": layers, "input": input, "offset": offset})
            })
            .collect();
        let mut text = format!("{:10} {:>6}  {:7} for modulators at", "name", "layers", "takes");
        for (name, layers, input, offset) in &rows {
            text += &format!("\n{name:10} {layers:6}  {input:7} {offset}");
        }
        text += "\n8 and 15 are short for rgbd-8 and rgbd-15. Each comes as int8 and f32 (--precision), for a pitch of 8 µm, 638, 520 and 450 nm.";
        text += "\nOther networks are files: --network FILE.onnx; the source tree has some in models/unbundled/.";
        terminal::print(json, &json!(values), text);
        Ok(())
    }
}
