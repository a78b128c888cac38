//! Networks: from a file, from bytes, or built in.

use crate::error::{PhasefrontError, guard};
use phasefront::encode::deep;
use std::sync::Arc;

/// The network that is built in where the feature `built-in-network` is on.
#[cfg(feature = "built-in-network")]
const BUILT_IN: Option<&[u8]> = Some(include_bytes!("../../models/rgbd-8-int8.onnx"));
#[cfg(not(feature = "built-in-network"))]
const BUILT_IN: Option<&[u8]> = None;

/// The pairs that are built in with it: hologram network and pre-filter, which says what offset it is for.
#[cfg(feature = "built-in-network")]
const PAIRS: &[(&[u8], &[u8])] = &[
    (
        include_bytes!("../../models/ddpm-8-int8.onnx"),
        include_bytes!("../../models/ddpm-8-prefilter-int8.onnx"),
    ),
    (
        include_bytes!("../../models/ddpm-8-6mm-int8.onnx"),
        include_bytes!("../../models/ddpm-8-6mm-prefilter-int8.onnx"),
    ),
    (
        include_bytes!("../../models/ddpm-8-12mm-int8.onnx"),
        include_bytes!("../../models/ddpm-8-12mm-prefilter-int8.onnx"),
    ),
];
#[cfg(not(feature = "built-in-network"))]
const PAIRS: &[(&[u8], &[u8])] = &[];

/// A hologram network. Immutable; one serves many sessions.
#[derive(Debug, uniffi::Object)]
pub struct Network {
    pub(crate) core: Arc<phasefront::Network>,
}

/// What a network is, and the display that it was trained for.
#[derive(Debug, Clone, PartialEq, uniffi::Record)]
pub struct NetworkInfo {
    /// How many convolutions.
    pub layers: u32,
    /// Filters of each hidden layer.
    pub filters: u32,
    /// The numbers that its layers compute in.
    pub precision: String,
    /// Distance between neighbouring pixels, µm.
    pub pitch_um: f64,
    /// Depth of the volume, mm.
    pub volume_depth_mm: f64,
}

/// A hologram network and the pre-filter that was trained with it, for the deep double phase method.
#[derive(Debug, Clone, uniffi::Record)]
pub struct DeepPair {
    /// Makes the hologram.
    pub hologram: Arc<Network>,
    /// Prepares it for its encoding.
    pub prefilter: Arc<Network>,
}

/// The pair of 8 layers in int8 that comes along for a modulator at `offset_mm`, 0, 6 or 12, and for the default display's
/// pitch, colours and volume.
///
/// # Errors
/// Another offset, or a library that was built without them.
#[uniffi::export]
pub fn built_in_pair(offset_mm: f64) -> Result<DeepPair, PhasefrontError> {
    let display = phasefront::Display::default().with_offset_m(offset_mm * 1e-3)?;
    for (hologram, prefilter) in PAIRS {
        let prefilter = Network::from_bytes(prefilter)?;
        if deep::check(&prefilter.core, &display).is_ok() {
            let hologram = Network::from_bytes(hologram)?;
            return Ok(DeepPair {
                hologram,
                prefilter,
            });
        }
    }
    Err(PhasefrontError::Network(format!(
        "network: no pair for an offset of {offset_mm} mm is built in; there are pairs for 0, 6 and 12 where the feature built-in-network is on, or take a network without a pre-filter"
    )))
}

#[uniffi::export]
impl Network {
    /// Reads an ONNX file's bytes.
    ///
    /// # Errors
    /// What is not a hologram network, with what is not so and what would be right.
    #[uniffi::constructor]
    pub fn from_bytes(onnx: &[u8]) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            Ok(Arc::new(Network {
                core: Arc::new(phasefront::Network::from_onnx(onnx)?),
            }))
        })
    }

    /// Reads an ONNX file.
    ///
    /// # Errors
    /// A file that cannot be read; as [`Self::from_bytes`].
    #[uniffi::constructor]
    pub fn from_file(path: String) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let onnx = std::fs::read(&path).map_err(|e| {
                PhasefrontError::File(format!("the network {path} cannot be read: {e}"))
            })?;
            Self::from_bytes(&onnx)
        })
    }

    /// The network of 8 layers in int8 that comes along, for the default display's pitch, colours and volume.
    ///
    /// # Errors
    /// A library that was built without it.
    #[uniffi::constructor]
    pub fn built_in() -> Result<Arc<Self>, PhasefrontError> {
        match BUILT_IN {
            Some(onnx) => Self::from_bytes(onnx),
            None => Err(PhasefrontError::Network(
                "network: none is built in; load one from a file, or build with the feature built-in-network"
                    .into(),
            )),
        }
    }

    /// What it is.
    pub fn info(&self) -> Result<NetworkInfo, PhasefrontError> {
        guard(|| {
            let display = self.core.display();
            Ok(NetworkInfo {
                layers: self.core.layers() as u32,
                filters: self.core.filters() as u32,
                precision: self.core.precision().to_string(),
                pitch_um: display.pitch_m * 1e6,
                volume_depth_mm: display.volume_depth_m * 1e3,
            })
        })
    }
}
