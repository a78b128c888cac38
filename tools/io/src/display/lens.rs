//! The lens of a display file, in whose focal plane the picture lies.
//!
//! ```toml
//! plane = "fourier"
//! focal_mm = 200.0
//! ```

use crate::{Error, Result};
use phasefront::Target;
use phasefront_core::display::lens::Lens;
use phasefront_core::runtime::keys;
use serde::Deserialize;
use std::path::Path;

/// The key that says where the picture lies.
pub(crate) const PLANE: &str = "plane";

/// The names of these keys.
pub(crate) const KEYS: [&str; 2] = [PLANE, "focal_mm"];

#[derive(Deserialize)]
struct LensToml {
    plane: Option<String>,
    focal_mm: Option<f64>,
}

/// Removes the lens's keys from the `table` of the display file at `path`, and returns the focal length in metres.
pub(crate) fn take(path: &Path, table: &mut toml::Table) -> Result<Option<f64>> {
    let own: toml::Table = (KEYS.iter())
        .filter_map(|key| Some(((*key).to_owned(), table.remove(*key)?)))
        .collect();
    let LensToml { plane, focal_mm } = LensToml::deserialize(own).map_err(|e| Error::file(path, keys::message(&e)))?;
    match (plane.as_deref(), focal_mm) {
        (None, None) => Ok(None),
        (Some("fourier"), Some(mm)) => Ok(Some(mm / 1e3)),
        (Some("fourier"), None) => Err(Error::file(
            path,
            "plane = \"fourier\" needs focal_mm, the focal length of the lens",
        )),
        (Some(other), _) => Err(Error::file(
            path,
            format!(
                "plane is {other:?}; \"fourier\" is the focal plane of a lens, and without the key the picture lies about the modulator"
            ),
        )),
        (None, Some(_)) => Err(Error::file(
            path,
            "focal_mm goes with plane = \"fourier\"; a lens that the panel adds is lens_mm",
        )),
    }
}

/// Returns the lens of the focal length `focal_m` for `target`.
///
/// # Errors
/// Returns an error if the lens leaves no room for a picture, or if the file also has a key that such displays do not
/// take.
pub(crate) fn of(focal_m: f64, target: &Target, is_aberrated: bool) -> phasefront::Result<Lens> {
    let others = [
        ("offset_mm", target.display.offset_m() != 0.0),
        ("laser", target.illumination.is_some()),
        ("aberration", is_aberrated),
        ("model", target.model.is_some()),
        ("shift_px or scale", target.registration.moves()),
    ];
    if let Some((key, _)) = others.into_iter().find(|(_, there)| *there) {
        return Err(phasefront::Error::Display(format!(
            "plane = \"fourier\" does not go with {key}; leave it out"
        )));
    }
    Lens::new(focal_m, target.panel.carrier_rad, &target.display)
}
