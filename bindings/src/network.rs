//! Networks: from a file, from bytes, or built in.

use crate::error::{PhasefrontError, guard};
use phasefront_core::runtime::file;
use std::path::Path;
use std::sync::Arc;

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

/// The pair in int8 that is bundled for a modulator at `offset_mm` and the default display's pitch, colours and
/// volume.
///
/// # Errors
/// Another offset, or a library that was built without them.
#[uniffi::export]
pub fn built_in_pair(offset_mm: f64) -> Result<DeepPair, PhasefrontError> {
    guard(|| {
        let display = phasefront::Display::default().with_offset_m(offset_mm * 1e-3)?;
        let pair = built_in::pair(&display).ok_or_else(|| {
            PhasefrontError::Network(format!(
                "network: no pair for an offset of {offset_mm} mm is built in; {}, or take a network without a pre-filter",
                built_in::offsets()
            ))
        })?;
        Ok(pair)
    })
}

/// What is compiled in.
#[cfg(feature = "built-in-network")]
mod built_in {
    use super::{DeepPair, Network};
    use phasefront_models::Precision::Int8;
    use std::sync::Arc;

    pub(super) fn network(name: &str) -> Option<Arc<phasefront::Network>> {
        phasefront_models::network(name, Int8)
    }

    /// What networks are called.
    pub(super) fn names() -> String {
        let names: Vec<_> = phasefront_models::NETWORKS.iter().map(|model| model.name).collect();
        names.join(", ")
    }

    /// Which pairs there are.
    pub(super) fn offsets() -> String {
        let offsets = phasefront_models::PAIRS.iter().map(|pair| pair.offset_mm.to_string());
        format!("there are pairs for {} mm", offsets.collect::<Vec<_>>().join(", "))
    }

    pub(super) fn pair(display: &phasefront::Display) -> Option<DeepPair> {
        let pair = phasefront_models::pair_for(display, Int8)?;
        let of = |core| Arc::new(Network { core });
        Some(DeepPair {
            hologram: of(pair.hologram),
            prefilter: of(pair.prefilter),
        })
    }
}

/// Nothing.
#[cfg(not(feature = "built-in-network"))]
mod built_in {
    pub(super) fn network(_: &str) -> Option<std::sync::Arc<phasefront::Network>> {
        None
    }

    pub(super) fn names() -> &'static str {
        "none is"
    }

    pub(super) fn offsets() -> String {
        "the feature built-in-network has them".into()
    }

    pub(super) fn pair(_: &phasefront::Display) -> Option<super::DeepPair> {
        None
    }
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
            let onnx = file::read(Path::new(&path), file::MOST_NETWORK)
                .map_err(|e| PhasefrontError::File(format!("the network {path} cannot be read: {e}")))?;
            Self::from_bytes(&onnx)
        })
    }

    /// A network in int8 that is bundled, by `name`: that of 8 layers unless another is named. For the default
    /// display's pitch, colours and volume.
    ///
    /// # Errors
    /// A name that none has, or a library that was built without them.
    #[uniffi::constructor(default(name = "rgbd-8"))]
    pub fn built_in(name: &str) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| match built_in::network(name) {
            Some(core) => Ok(Arc::new(Network { core })),
            None => Err(PhasefrontError::Network(format!(
                "network: no '{name}' is built in ({}); load one from a file, or build with the feature built-in-network",
                built_in::names()
            ))),
        })
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
