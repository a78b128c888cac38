//! Built-in networks, networks from files or bytes, and depth networks.

use crate::pointer::{bytes, free, give, object, pick, text};
use crate::status::{PfStatus, call};
use phasefront_ffi::{ColourScale, DepthNetwork, Network};
use std::ffi::c_char;
use std::sync::Arc;

/// A hologram network or a pre-filter. It is immutable and can be used by several sessions.
pub struct PfNetwork(pub(crate) Arc<Network>);

fn given(network: Arc<Network>) -> *mut PfNetwork {
    object(PfNetwork(network))
}

/// Creates the bundled int8 network of a name, such as "rgbd-8".
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_network_built_in(name: *const c_char, network: *mut *mut PfNetwork) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(network, "network", || {
            Ok(given(Network::built_in(text(name, "name")?)?))
        })
    })
}

/// Reads a network from the bytes of an ONNX file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_network_from_bytes(
    onnx: *const u8,
    length: usize,
    network: *mut *mut PfNetwork,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(network, "network", || {
            Ok(given(Network::from_bytes(bytes(onnx, length, "onnx")?)?))
        })
    })
}

/// Reads a network from an ONNX file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_network_from_file(path: *const c_char, network: *mut *mut PfNetwork) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(network, "network", || {
            Ok(given(Network::from_file(text(path, "path")?.to_owned())?))
        })
    })
}

/// Frees a network. Sessions and options that use it are not affected.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_network_free(network: *mut PfNetwork) {
    // SAFETY: the rules of this border.
    unsafe { free(network) };
}

/// The scaling that a depth network expects for colour values from 0 to 1.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfColourScale {
    /// Normalized by the mean and the spread of ImageNet, as in the training of MiDaS, DPT and Depth Anything.
    Imagenet = 0,
    /// From 0 to 1.
    Unit = 1,
    /// From -1 to 1.
    Signed = 2,
}

const COLOUR_SCALES: [ColourScale; 3] = [ColourScale::Imagenet, ColourScale::Unit, ColourScale::Signed];

/// A network that estimates relative inverse depth from colour alone. It is immutable and can be used by several
/// sessions.
pub struct PfDepthNetwork(pub(crate) Arc<DepthNetwork>);

/// Reads a depth network from the bytes of an ONNX file that holds its own weights. It takes one picture, (1, 3, H, W)
/// or (1, H, W, 3), with colours of the scale `colours`, a PfColourScale, and gives one plane: inverse depth, or
/// distance if `gives_distance`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_depth_network_from_bytes(
    onnx: *const u8,
    length: usize,
    colours: u32,
    gives_distance: bool,
    network: *mut *mut PfDepthNetwork,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(network, "network", || {
            let colours = pick(&COLOUR_SCALES, colours, "colours")?;
            let onnx = bytes(onnx, length, "onnx")?;
            let network = DepthNetwork::from_bytes(onnx, Some(colours), gives_distance)?;
            Ok(object(PfDepthNetwork(network)))
        })
    })
}

/// Frees a depth network. Sessions and options that use it are not affected.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_depth_network_free(network: *mut PfDepthNetwork) {
    // SAFETY: the rules of this border.
    unsafe { free(network) };
}
