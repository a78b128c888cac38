//! Networks, loaded from bytes or built in.

use crate::error::{Answer, error, object, of_core};
use phasefront::Network;
use phasefront::models::Precision::Int8;
use std::sync::Arc;
use wasm_bindgen::prelude::*;

/// A trained network.
#[wasm_bindgen]
pub struct RawNetwork {
    pub(crate) core: Arc<Network>,
}

#[wasm_bindgen]
impl RawNetwork {
    /// Loads a network from the bytes of an `.onnx` file.
    ///
    /// # Errors
    /// Throws an error of kind `network` if the file is not a hologram network or the kernels do not support it.
    #[wasm_bindgen(js_name = fromBytes)]
    pub fn from_bytes(onnx: &[u8]) -> Answer<RawNetwork> {
        let core = Network::from_onnx(onnx).map_err(of_core)?;
        Ok(RawNetwork { core: Arc::new(core) })
    }

    /// Returns the built-in int8 network called `name`.
    ///
    /// # Errors
    /// Throws an error of kind `network` for any other name.
    #[wasm_bindgen(js_name = builtIn)]
    pub fn built_in(name: &str) -> Answer<RawNetwork> {
        let core = phasefront::models::network(name, Int8).ok_or_else(|| {
            let names = phasefront::models::names().join(", ");
            error(
                "network",
                &format!(
                    "network: no '{name}' is built in ({names}); fetch one and give its bytes to Network.fromBytes"
                ),
            )
        })?;
        Ok(RawNetwork { core })
    }

    /// Returns the hologram network and the pre-filter of the pair for a modulator in the middle of the volume.
    ///
    /// # Errors
    /// Throws an error of kind `network` if no pair is built in.
    #[wasm_bindgen(js_name = builtInPair)]
    pub fn built_in_pair() -> Answer<Vec<RawNetwork>> {
        let pair = phasefront::models::PAIR.networks(Int8);
        let pair = pair.ok_or_else(|| error("network", "network: no pair is built in"))?;
        Ok(vec![
            RawNetwork { core: pair.hologram },
            RawNetwork { core: pair.prefilter },
        ])
    }

    /// Returns the properties: an object of the form `NetworkInfo`.
    pub fn info(&self) -> js_sys::Object {
        let display = self.core.display();
        object([
            ("layers", self.core.layers().into()),
            ("filters", self.core.filters().into()),
            ("precision", self.core.precision().to_string().into()),
            ("pitchUm", (display.pitch_m * 1e6).into()),
            ("volumeDepthMm", (display.volume_depth_m * 1e3).into()),
        ])
    }
}
