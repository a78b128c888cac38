//! The trained networks bundled with Phasefront, for the display of the paper: 8 µm pixel pitch, 638/520/450 nm, a
//! volume of 6 mm. The card of each network, the `.md` next to its file, has its measurements.
//!
//! ```
//! use phasefront_core::display::Display;
//!
//! assert!(phasefront_models::default_network(&Display::default()).is_some());
//! ```
//!
//! The crate `phasefront` has this one as `phasefront::models`, by its feature `models`.

use phasefront_core::display::Display;
use phasefront_core::method::Method;
use phasefront_core::method::network::Network;
use phasefront_core::method::sweep::Sweep;
use std::sync::Arc;

/// The number format that a network computes in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// 8-bit integers, the fastest.
    #[default]
    Int8,
    /// 32-bit floating point. Requires the feature `float32`.
    Float32,
}

/// The compiled-in files of a network, by precision.
#[derive(Debug)]
struct Files {
    int8: &'static [u8],
    float32: Option<&'static [u8]>,
}

impl Files {
    fn read(&self, precision: Precision) -> Option<Arc<Network>> {
        let onnx = match precision {
            Precision::Int8 => Some(self.int8),
            Precision::Float32 => self.float32,
        };
        let network = Network::from_onnx(onnx?).expect("the tests read every file");
        Some(Arc::new(network))
    }
}

/// Embeds the files of the network `$name`.
macro_rules! files {
    ($name:literal) => {
        Files {
            int8: include_bytes!(concat!("../", $name, "-int8.onnx")),
            #[cfg(feature = "float32")]
            float32: Some(include_bytes!(concat!("../", $name, ".onnx"))),
            #[cfg(not(feature = "float32"))]
            float32: None,
        }
    };
}

/// A hologram network.
#[derive(Debug)]
pub struct Model {
    /// The name, which is also that of its card.
    pub name: &'static str,
    files: Files,
}

impl Model {
    /// Returns the network, or `None` if `precision` is not compiled in.
    pub fn network(&self, precision: Precision) -> Option<Arc<Network>> {
        self.files.read(precision)
    }
}

/// The hologram networks that need no pre-filter.
pub const NETWORKS: &[Model] = &[
    Model {
        name: "rgbd-8",
        files: files!("rgbd-8"),
    },
    Model {
        name: "rgbd-15",
        files: files!("rgbd-15"),
    },
];

/// The network for natural focus, whose displayed image is soft out of focus.
pub const NATURAL: &Model = &Model {
    name: "natural-8",
    files: files!("natural-8"),
};

/// Returns the names that [`network`] takes.
pub fn names() -> Vec<&'static str> {
    NETWORKS.iter().chain([NATURAL]).map(|model| model.name).collect()
}

/// Returns the network of [`NETWORKS`] or [`NATURAL`] called `name`, or `None` if it does not exist or `precision` is
/// not compiled in.
pub fn network(name: &str, precision: Precision) -> Option<Arc<Network>> {
    let model = NETWORKS.iter().chain([NATURAL]).find(|model| model.name == name)?;
    model.network(precision)
}

/// A hologram network and the pre-filter that was trained with it.
#[derive(Debug)]
pub struct Pair {
    /// The name, which is also that of its card.
    pub name: &'static str,
    hologram: Files,
    prefilter: Files,
}

/// The pair for the deep double phase method and a modulator in the middle of the volume.
pub const PAIR: &Pair = &Pair {
    name: "ddpm-8",
    hologram: files!("ddpm-8"),
    prefilter: files!("ddpm-8-prefilter"),
};

/// The two networks of a [`Pair`].
#[derive(Debug, Clone)]
pub struct DeepPair {
    /// The network that computes the midpoint hologram.
    pub hologram: Arc<Network>,
    /// The network that pre-filters it for encoding.
    pub prefilter: Arc<Network>,
}

impl Pair {
    /// Returns both networks, or `None` if `precision` is not compiled in.
    pub fn networks(&self, precision: Precision) -> Option<DeepPair> {
        Some(DeepPair {
            hologram: self.hologram.read(precision)?,
            prefilter: self.prefilter.read(precision)?,
        })
    }
}

/// Returns [`PAIR`], or `None` if it was not trained for `display` or `precision` is not compiled in.
pub fn pair_for(display: &Display, precision: Precision) -> Option<DeepPair> {
    let pair = PAIR.networks(precision)?;
    pair.prefilter.check_prefilter(display).is_ok().then_some(pair)
}

/// Returns the default network for `display` (8 layers, int8), or `None` if it was not trained for that display.
pub fn default_network(display: &Display) -> Option<Arc<Network>> {
    network("rgbd-8", Precision::Int8).filter(|network| network.check_display(display).is_ok())
}

/// Returns the default method for `display`: the automatic choice between the plane sweep and [`default_network`], or
/// the sweep alone if that network was not trained for the display.
pub fn default_method(display: &Display) -> Method {
    let sweep = Sweep::for_display(display);
    match default_network(display) {
        Some(network) => Method::Auto(sweep, network),
        None => Method::Sweep(sweep),
    }
}

/// Returns the network of natural focus for `display` ([`NATURAL`] in int8), or `None` if it was not trained for that
/// display.
pub fn natural_network(display: &Display) -> Option<Arc<Network>> {
    (NATURAL.network(Precision::Int8)).filter(|network| network.check_display(display).is_ok())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn precisions() -> Vec<Precision> {
        let float32 = cfg!(feature = "float32").then_some(Precision::Float32);
        [Precision::Int8].into_iter().chain(float32).collect()
    }

    #[test]
    fn every_file_is_a_network_for_the_papers_display() {
        for precision in precisions() {
            for model in NETWORKS.iter().chain([NATURAL]) {
                let network = model.network(precision).unwrap();
                network.check_display(&Display::default()).unwrap();
            }
            let pair = PAIR.networks(precision).unwrap();
            pair.prefilter.check_prefilter(&Display::default()).unwrap();
        }
    }

    #[test]
    fn a_display_gets_only_networks_that_were_trained_for_it() {
        for (display, trained, paired) in [
            ("offset_mm = 0", true, true),
            ("offset_mm = 3", true, false),
            ("pitch_um = 3.74", false, false),
        ] {
            let display = Display::from_toml(display).unwrap();
            assert_eq!(pair_for(&display, Precision::Int8).is_some(), paired);
            assert_eq!(default_network(&display).is_some(), trained);
            assert_eq!(natural_network(&display).is_some(), trained);
            let method = default_method(&display);
            assert_eq!(matches!(method, Method::Auto(..)), trained, "{method:?}");
            assert_eq!(matches!(method, Method::Sweep(_)), !trained, "{method:?}");
        }
    }
}
