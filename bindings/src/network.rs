//! Networks from files or bytes, and built-in networks.

use crate::error::{PhasefrontError, guard};
#[cfg(not(feature = "tract"))]
use crate::no_depth_network::{ColourScale, DepthNetwork as CoreDepthNetwork};
#[cfg(feature = "tract")]
use phasefront::input::{ColourScale, DepthNetwork as CoreDepthNetwork};
use phasefront_core::runtime::file;
use std::path::Path;
use std::sync::Arc;

/// A hologram network. It is immutable and can be used by several sessions.
#[derive(Debug, uniffi::Object)]
#[uniffi(name = "HologramNetwork")]
pub struct Network {
    pub(crate) core: Arc<phasefront::Network>,
}

/// The scaling that a depth network expects for colour values from 0 to 1.
#[uniffi::remote(Enum)]
pub enum ColourScale {
    /// Normalized by the mean and the spread of ImageNet, as in the training of MiDaS, DPT and Depth Anything.
    Imagenet,
    /// From 0 to 1.
    Unit,
    /// From -1 to 1.
    Signed,
}

/// A network that estimates relative inverse depth from colour alone, for frames without depth. It is immutable and can
/// be used by several sessions.
#[derive(Debug, uniffi::Object)]
pub struct DepthNetwork {
    #[cfg_attr(not(feature = "tract"), expect(dead_code, reason = "no depth network can be made"))]
    pub(crate) core: Arc<CoreDepthNetwork>,
}

#[uniffi::export]
impl DepthNetwork {
    /// Reads the bytes of an ONNX file that holds its own weights. It takes one picture, (1, 3, H, W) or (1, H, W, 3),
    /// with colours of the scale `colours`, and gives one plane: inverse depth, or distance if `gives_distance`.
    ///
    /// # Errors
    /// Returns an error if the library does not read the file, and if it was built without tract.
    #[uniffi::constructor(default(colours = None, gives_distance = false))]
    pub fn from_bytes(
        onnx: &[u8],
        colours: Option<ColourScale>,
        gives_distance: bool,
    ) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let mut core = CoreDepthNetwork::from_onnx(onnx)?;
            core.colours = colours.unwrap_or_default();
            core.gives_distance = gives_distance;
            Ok(Arc::new(DepthNetwork { core: Arc::new(core) }))
        })
    }
}

/// The properties of a network and of the display that it was trained for.
#[derive(Debug, Clone, PartialEq, uniffi::Record)]
pub struct NetworkInfo {
    /// The number of convolutions.
    pub layers: usize,
    /// The number of filters of each hidden layer.
    pub filters: usize,
    /// The number format of the layers: `f32` or `int8`, or `own` for a network of another form, which runs in the
    /// formats that its file names.
    pub precision: String,
    /// The distance between neighbouring pixels, in µm.
    pub pitch_um: f64,
    /// The depth of the volume, in mm.
    pub volume_depth_mm: f64,
}

/// A hologram network and the pre-filter that was trained with it, for the deep double phase method.
#[derive(Debug, Clone, uniffi::Record)]
pub struct DeepPair {
    /// The hologram network.
    pub hologram: Arc<Network>,
    /// The pre-filter.
    pub prefilter: Arc<Network>,
}

/// Returns the bundled int8 pair for a modulator in the middle of the volume and the default display's pitch, colours
/// and volume. A network without a pre-filter displays more, at any offset.
///
/// # Errors
/// Returns an error if the library was built without networks.
#[uniffi::export]
pub fn built_in_pair() -> Result<DeepPair, PhasefrontError> {
    guard(|| {
        built_in::pair().ok_or_else(|| {
            PhasefrontError::Network("network: no pair is built in; the feature built-in-network has one".into())
        })
    })
}

/// The networks that are compiled in.
#[cfg(feature = "built-in-network")]
mod built_in {
    use super::{DeepPair, Network};
    use phasefront::models::Precision::Int8;
    use std::sync::Arc;

    pub(super) fn network(name: &str) -> Option<Arc<phasefront::Network>> {
        phasefront::models::network(name, Int8)
    }

    /// Returns the names of the networks.
    pub(super) fn names() -> String {
        phasefront::models::names().join(", ")
    }

    pub(super) fn pair() -> Option<DeepPair> {
        let pair = phasefront::models::PAIR.networks(Int8)?;
        let of = |core| Arc::new(Network { core });
        Some(DeepPair {
            hologram: of(pair.hologram),
            prefilter: of(pair.prefilter),
        })
    }
}

/// Stands in for the networks of a library that was built without them.
#[cfg(not(feature = "built-in-network"))]
mod built_in {
    pub(super) fn network(_: &str) -> Option<std::sync::Arc<phasefront::Network>> {
        None
    }

    pub(super) fn names() -> &'static str {
        "none is"
    }

    pub(super) fn pair() -> Option<super::DeepPair> {
        None
    }
}

#[uniffi::export(name = "HologramNetwork")]
impl Network {
    /// Reads a network from the bytes of an ONNX file.
    ///
    /// # Errors
    /// Returns an error that says what is wrong and what would be right if the bytes are not a hologram network.
    #[uniffi::constructor]
    pub fn from_bytes(onnx: &[u8]) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            Ok(Arc::new(Network {
                core: Arc::new(phasefront::Network::from_onnx(onnx)?),
            }))
        })
    }

    /// Reads a network from an ONNX file.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, and the errors of [`Self::from_bytes`].
    #[uniffi::constructor]
    pub fn from_file(path: String) -> Result<Arc<Self>, PhasefrontError> {
        guard(|| {
            let onnx = file::read(Path::new(&path), file::MOST_NETWORK)
                .map_err(|e| PhasefrontError::File(format!("the network {path} cannot be read: {e}")))?;
            Self::from_bytes(&onnx)
        })
    }

    /// Returns the bundled int8 network called `name`, by default the one with 8 layers. It is for the default
    /// display's pitch, colours and volume.
    ///
    /// # Errors
    /// Returns an error if there is no such network, and if the library was built without networks.
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

    /// Returns the properties of the network.
    pub fn info(&self) -> NetworkInfo {
        let display = self.core.display();
        NetworkInfo {
            layers: self.core.layers(),
            filters: self.core.filters(),
            precision: self.core.precision().to_string(),
            pitch_um: display.pitch_m * 1e6,
            volume_depth_mm: display.volume_depth_m * 1e3,
        }
    }
}
