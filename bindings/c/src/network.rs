//! Built-in networks, and networks from files or bytes.

use crate::pointer::{bytes, free, give, object, text};
use crate::status::{PfStatus, call};
use phasefront_ffi::Network;
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
