//! The networks of `--network`: those that come along, by name, and those of files.

use crate::error::{Error, Result};
use crate::output;
use phasefront::Network;
use phasefront_models::NETWORKS;
pub use phasefront_models::Precision;
use std::path::Path;
use std::sync::Arc;

/// The name of the seeded network that comes along.
pub const SEEDED: &str = "seeded-6";

/// The name of the pairs that come along with a pre-filter, for the deep double phase method: the one for the offset is
/// meant.
pub const DEEP: &str = "ddpm-8";

/// The network called `name`, `8` and `15` being short for `rgbd-8` and `rgbd-15`, where one comes along; or of an ONNX
/// file, whose precision is its own.
///
/// # Errors
/// A name that is neither, or a file that is no hologram network.
pub fn network(name: &str, precision: Precision) -> Result<Arc<Network>> {
    let full = match name {
        "8" | "15" => format!("rgbd-{name}"),
        _ => name.to_owned(),
    };
    if let Some(network) = phasefront_models::network(&full, precision) {
        return Ok(network);
    }
    let path = Path::new(name);
    output::reading(path)?;
    let bytes = std::fs::read(path).map_err(|e| {
        let names: Vec<_> = NETWORKS.iter().map(|model| model.name).chain([DEEP]).collect();
        Error::file(
            path,
            format!(
                "is neither a file that can be read ({e}) nor a network that comes along ({})",
                names.join(", ")
            ),
        )
    })?;
    let network = Network::from_onnx(&bytes).map_err(|e| Error::file(path, e))?;
    Ok(Arc::new(network))
}
