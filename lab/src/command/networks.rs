//! `phasefront networks`: the names that --network takes.

use clap::Args;
use phasefront_lab::models::{self, Precision};
use phasefront_lab::{Error, Result};
use phasefront_models::{NETWORKS, PAIRS};
use serde_json::json;

/// List the networks that come along
#[derive(Args)]
pub(crate) struct Networks {}

impl Networks {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        let missing = || Error::Input("a network that comes along is not compiled in".into());
        let mut rows = Vec::new();
        for model in NETWORKS {
            let network = model.network(Precision::Int8).ok_or_else(missing)?;
            let (layers, input) = (network.layers(), network.input().to_string());
            rows.push((model.name, layers, input, "any offset".to_owned()));
        }
        for pair in PAIRS {
            let network = pair.networks(Precision::Int8).ok_or_else(missing)?.hologram;
            let offset = format!("{} mm, with its pre-filter", pair.offset_mm);
            rows.push((models::DEEP, network.layers(), network.input().to_string(), offset));
        }
        let values: Vec<_> = (rows.iter())
            .map(|(name, layers, input, offset)| {
                json!({"name": name, "layers": layers, "input": input, "offset": offset})
            })
            .collect();
        let mut text = format!("{:10} {:>6}  {:7} for modulators at", "name", "layers", "takes");
        for (name, layers, input, offset) in &rows {
            text += &format!("\n{name:10} {layers:6}  {input:7} {offset}");
        }
        text += "\nrgbd-8 and rgbd-15 are 8 and 15 for short. Each comes as int8 and f32 (--precision), for a pitch of 8 µm, 638, 520 and 450 nm.";
        super::print(json, &json!(values), text);
        Ok(())
    }
}
