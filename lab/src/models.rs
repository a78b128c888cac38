//! The networks that come with the command, and those of files.

use crate::error::{Error, Result};
use phasefront::encode::deep;
use phasefront::{Display, Network};
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

/// The name of the networks that come along with a pre-filter, for the deep double phase method.
pub const DEEP: &str = "ddpm-8";

/// A hologram network and the pre-filter that was trained with it, for modulators at one offset; each in float32, then
/// in int8.
#[derive(Debug)]
pub struct Pair {
    /// From the midpoint hologram to the modulator, mm.
    pub offset_mm: f64,
    hologram: [&'static [u8]; 2],
    prefilter: [&'static [u8]; 2],
}

/// A pair by the name of its files.
macro_rules! pair {
    ($offset_mm:literal, $name:literal) => {
        Pair {
            offset_mm: $offset_mm,
            hologram: [
                include_bytes!(concat!("../../models/", $name, ".onnx")),
                include_bytes!(concat!("../../models/", $name, "-int8.onnx")),
            ],
            prefilter: [
                include_bytes!(concat!("../../models/", $name, "-prefilter.onnx")),
                include_bytes!(concat!("../../models/", $name, "-prefilter-int8.onnx")),
            ],
        }
    };
}

/// The pairs that come along.
pub const PAIRS: &[Pair] = &[
    pair!(0.0, "ddpm-8"),
    pair!(6.0, "ddpm-8-6mm"),
    pair!(12.0, "ddpm-8-12mm"),
];

impl Pair {
    /// (hologram network, pre-filter).
    ///
    /// # Errors
    /// Never, for the files in `models/` are tested.
    pub fn read(&self, int8: bool) -> Result<(Arc<Network>, Arc<Network>)> {
        let read = |files: [&[u8]; 2]| Network::from_onnx(files[usize::from(int8)]).map(Arc::new);
        Ok((read(self.hologram)?, read(self.prefilter)?))
    }
}

/// The hologram network and the pre-filter that come along for `display`, if any do.
///
/// # Errors
/// As [`Pair::read`].
pub fn pair_for(display: &Display, int8: bool) -> Result<Option<(Arc<Network>, Arc<Network>)>> {
    for pair in PAIRS {
        let (hologram, prefilter) = pair.read(int8)?;
        if deep::check(&prefilter, display).is_ok() {
            return Ok(Some((hologram, prefilter)));
        }
    }
    Ok(None)
}

/// What comes along by itself.
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
