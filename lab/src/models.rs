//! The networks that come with the command, and those of files.

use crate::error::{Error, Result};
use phasefront::Network;
use std::path::Path;

/// A name that `--network` knows and the file in `models/` that it stands for.
const BUILT_IN: &[(&str, &[u8])] = &[("8", include_bytes!("../../models/rgbd-8.onnx"))];

/// The network called `name`: its number of layers, where one comes with the command, or an ONNX file.
///
/// # Errors
/// A name that is neither, or a file that is no hologram network.
pub fn network(name: &str) -> Result<Network> {
    if let Some((_, bytes)) = BUILT_IN.iter().find(|(built_in, _)| *built_in == name) {
        return Ok(Network::from_onnx(bytes)?);
    }
    let path = Path::new(name);
    let bytes = std::fs::read(path).map_err(|e| {
        let names: Vec<_> = BUILT_IN.iter().map(|(name, _)| *name).collect();
        Error::file(
            path,
            format!(
                "is neither a file that can be read ({e}) nor a network that comes along ({})",
                names.join(", ")
            ),
        )
    })?;
    Network::from_onnx(&bytes).map_err(|e| Error::file(path, e))
}
