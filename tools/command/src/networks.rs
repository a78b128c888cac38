//! The networks of `--network`: the bundled ones, by name, and those of files.

use phasefront::Network;
use phasefront_core::runtime::file;
use phasefront_io::{Error, Result, output};
use phasefront_models::NETWORKS;
pub use phasefront_models::Precision;
use std::path::Path;
use std::sync::Arc;

/// The name of the bundled pairs of a network and its pre-filter, for the deep double phase method: the one for the
/// offset is meant.
pub const DEEP: &str = "ddpm-8";

/// The networks that are files of the source tree's `models`, not bundled, by name.
const FILES: [&str; 8] = [
    "ddpm-8-12mm",
    "ddpm-8-6mm",
    "half-8",
    "ldi3-15",
    "rgbd-15-cylinder",
    "rgbd-15-wide",
    "rgbd-30",
    "seeded-8-80",
];

/// The full name that `name` is or is short for.
fn full_name(name: &str) -> String {
    match name {
        "8" | "15" => format!("rgbd-{name}"),
        _ => name.to_owned(),
    }
}

/// Whether `name` is a bundled network's rather than a file's.
pub fn is_bundled(name: &str) -> bool {
    let full = full_name(name);
    NETWORKS.iter().any(|model| model.name == full)
}

/// The bundled network called `name`, `8` and `15` being short for `rgbd-8` and `rgbd-15`, in `precision`, by default
/// int8; or that of an ONNX file, whose precision is its own.
///
/// # Errors
/// A name that is neither, a file that is no hologram network, or a precision for a file.
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
    Ok(Arc::new(network))
}

/// That `name` is no network, and which there are.
fn unknown(path: &Path, name: &str, why: &std::io::Error) -> Error {
    let bundled: Vec<_> = NETWORKS.iter().map(|model| model.name).chain([DEEP]).collect();
    let bundled = bundled.join(", ");
    Error::file(
        path,
        match FILES.contains(&name) {
            true => {
                format!("is not bundled ({bundled} are), but a file of the source tree: --network models/{name}.onnx")
            }
            false => format!(
                "is neither a bundled network ({bundled}) nor a file that can be read ({why}); other networks are files, as models/rgbd-30.onnx of the source tree: --network FILE.onnx"
            ),
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
        let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
        let names = std::fs::read_dir(models).unwrap().filter_map(|entry| {
            let path = entry.unwrap().path();
            let is_card = path.extension().is_some_and(|e| e == "md");
            is_card.then(|| path.file_stem().unwrap().to_str().unwrap().to_owned())
        });
        let bundled = NETWORKS.iter().map(|model| model.name).chain([DEEP]);
        let known: BTreeSet<_> = bundled.chain(FILES).map(str::to_owned).collect();
        assert_eq!(names.collect::<BTreeSet<_>>(), known);
    }
}
