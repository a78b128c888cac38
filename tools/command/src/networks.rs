//! The networks of `--network`: bundled ones by name, and files.

use phasefront::Network;
use phasefront_core::runtime::file;
use phasefront_io::{Error, Result, output};
use phasefront_models::PAIR;
pub use phasefront_models::Precision;
use std::path::Path;
use std::sync::Arc;

/// The name of the bundled pair of a network and its pre-filter for the deep double phase method.
pub const DEEP: &str = PAIR.name;

/// The names of the networks that are not bundled, in the source tree's folder `models/unbundled`.
const FILES: [&str; 5] = ["ldi3-15", "rgbd-15-cylinder", "rgbd-15-wide", "rgbd-30", "seeded-8-80"];

/// Returns the full name for `name`, which may be short.
fn full_name(name: &str) -> String {
    match name {
        "8" | "15" => format!("rgbd-{name}"),
        _ => name.to_owned(),
    }
}

/// Checks whether `name` is the name of a bundled network and not of a file.
pub fn is_bundled(name: &str) -> bool {
    let full = full_name(name);
    phasefront_models::names().contains(&full.as_str())
}

/// Returns the bundled network called `name` in `precision` (int8 by default), or the network in an ONNX file, which
/// has its own precision. `8` and `15` are short for `rgbd-8` and `rgbd-15`.
///
/// # Errors
/// Returns an error if `name` is neither, if the file holds no hologram network, or if a precision is given for a file.
pub fn network(name: &str, precision: Option<Precision>) -> Result<Arc<Network>> {
    if let Some(network) = phasefront_models::network(&full_name(name), precision.unwrap_or_default()) {
        return Ok(network);
    }
    let path = Path::new(name);
    output::reading(path)?;
    let bytes = file::read(path, file::MOST_NETWORK).map_err(|e| unknown(path, name, &e))?;
    if precision.is_some() {
        return Err(Error::file(
            path,
            "a file has the numbers that it was written with; --precision is for bundled networks, leave it out",
        ));
    }
    let network = Network::from_onnx(&bytes).map_err(|e| Error::file(path, e))?;
    if network.chain().is_none() {
        log::warn!("{name}: tract runs this network, on one thread: a frame of 1920×1080 takes seconds to minutes");
    }
    Ok(Arc::new(network))
}

/// Makes the error for an unknown network, which lists the known ones.
fn unknown(path: &Path, name: &str, why: &std::io::Error) -> Error {
    let bundled = [phasefront_models::names(), vec![DEEP]].concat().join(", ");
    Error::file(
        path,
        if FILES.contains(&name) {
            format!(
                "is not bundled ({bundled} are), but a file of the source tree: --network models/unbundled/{name}.onnx"
            )
        } else {
            format!(
                "is neither a bundled network ({bundled}) nor a file that can be read ({why}); other networks are files, as models/unbundled/rgbd-30.onnx of the source tree: --network FILE.onnx"
            )
        },
    )
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_network_of_the_source_tree_is_bundled_or_known_as_a_file() {
        let cards = |folder: &str| -> BTreeSet<String> {
            let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models").join(folder);
            let paths = std::fs::read_dir(models).unwrap().map(|entry| entry.unwrap().path());
            let cards =
                paths.filter(|path| path.extension().is_some_and(|e| e == "md") && !path.ends_with("README.md"));
            cards
                .map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned())
                .collect()
        };
        let bundled = phasefront_models::names().into_iter().chain([DEEP]);
        assert_eq!(cards(""), bundled.map(str::to_owned).collect());
        assert_eq!(cards("unbundled"), FILES.map(str::to_owned).into());
    }
}
