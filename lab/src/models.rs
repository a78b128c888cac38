//! The networks that come with the command, and those of files.

use crate::error::{Error, Result};
use phasefront::Network;
use std::path::Path;
use std::sync::Arc;

/// A network of `models/` that the command holds.
#[derive(Debug)]
pub struct Built {
    /// Its name for `--network`.
    pub name: &'static str,
    /// Convolution layers.
    pub layers: usize,
    /// Whether it is the quantized one.
    pub int8: bool,
    onnx: &'static [u8],
}

/// The name of the seeded network that comes along.
pub const SEEDED: &str = "seeded-6";

/// What comes along.
pub const BUILT_IN: &[Built] = &[
    Built {
        name: "8",
        layers: 8,
        int8: false,
        onnx: include_bytes!("../../models/rgbd-8.onnx"),
    },
    Built {
        name: "8",
        layers: 8,
        int8: true,
        onnx: include_bytes!("../../models/rgbd-8-int8.onnx"),
    },
    Built {
        name: "15",
        layers: 15,
        int8: false,
        onnx: include_bytes!("../../models/rgbd-15.onnx"),
    },
    Built {
        name: "15",
        layers: 15,
        int8: true,
        onnx: include_bytes!("../../models/rgbd-15-int8.onnx"),
    },
    Built {
        name: SEEDED,
        layers: 6,
        int8: false,
        onnx: include_bytes!("../../models/seeded-6.onnx"),
    },
    Built {
        name: SEEDED,
        layers: 6,
        int8: true,
        onnx: include_bytes!("../../models/seeded-6-int8.onnx"),
    },
];

/// Reads a network that comes along.
///
/// # Errors
/// Never, for the files in `models/` are tested.
pub fn built_in(built: &Built) -> Result<Arc<Network>> {
    Ok(Arc::new(Network::from_onnx(built.onnx)?))
}

/// The network called `name`, where one comes along in that precision, or of an ONNX file, whose precision is its own.
///
/// # Errors
/// A name that is neither, or a file that is no hologram network.
pub fn network(name: &str, int8: bool) -> Result<Arc<Network>> {
    let named = |built: &&Built| built.name == name && built.int8 == int8;
    if let Some(built) = BUILT_IN.iter().find(named) {
        return built_in(built);
    }
    let path = Path::new(name);
    let bytes = std::fs::read(path).map_err(|e| {
        let mut names: Vec<_> = BUILT_IN.iter().map(|built| built.name).collect();
        names.dedup();
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
