//! Looking at hologram files: the amplitudes that an eye focused at z would see.

use crate::error::Result;
use crate::files::{Hologram, HologramInfo};
use ndarray::Array3;
use num_complex::Complex32;
use phasefront::refocus::{Refocus, phase_only_field};

/// The radius of the Fourier aperture that phase-only holograms pass: the whole first order, as the paper has it.
pub const APERTURE_RADIUS: f64 = 1.0;

impl Hologram {
    /// (H, W).
    pub fn shape(&self) -> (usize, usize) {
        let (_, height, width) = match self {
            Hologram::PhaseOnly(levels, _) => levels.dim(),
            Hologram::Complex(field, _) => field.dim(),
        };
        (height, width)
    }

    /// What the file says of the hologram.
    pub fn info(&self) -> &HologramInfo {
        match self {
            Hologram::PhaseOnly(_, info) | Hologram::Complex(_, info) => info,
        }
    }

    /// The amplitudes at each of `z_m`, (3, H, W), against the middle of the volume, metres.
    ///
    /// # Errors
    /// A z too far to be propagated to, or a look-up table that is none.
    pub fn views(&self, z_m: &[f64]) -> Result<Vec<Array3<f32>>> {
        let (height, width) = self.shape();
        let info = self.info();
        let (field, aperture) = match self {
            Hologram::Complex(field, _) => (field.clone(), None),
            Hologram::PhaseOnly(levels, _) => {
                let mut field = Array3::from_elem((3, height, width), Complex32::ZERO);
                phase_only_field(
                    levels.as_slice().expect("standard layout"),
                    &info.response()?,
                    info.scale.unwrap_or(1.0),
                    field.as_slice_mut().expect("standard layout"),
                );
                (field, Some(APERTURE_RADIUS))
            }
        };
        let plan = Refocus::new(height, width, &info.display, z_m, aperture)?;
        let views = plan.focal_stack(field.as_slice().expect("standard layout"), z_m)?;
        Ok(views
            .into_iter()
            .map(|view| {
                Array3::from_shape_vec((3, height, width), view)
                    .expect("a view of the hologram's shape")
            })
            .collect())
    }
}
