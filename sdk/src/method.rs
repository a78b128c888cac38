//! How the midpoint hologram of an RGB-D frame is made. What then becomes of it is the modulator's.

use crate::display::Display;
use crate::error::{Error, Result};
use crate::frame::RgbdFrame;
use crate::network::{Engine, InputKind, Network, NetworkPlan, NetworkScratch};
use num_complex::Complex32;

/// How far a display may lie from what a network was trained for, relative.
const DISPLAY_TOLERANCE: f64 = 0.02;

/// What makes the midpoint hologram.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub enum Method<'a> {
    /// A trained network for RGB-D frames.
    Network(&'a Network),
}

/// A plan of a [`Method`] for one frame shape. Immutable; shared between threads.
pub struct MethodPlan {
    shape: (usize, usize),
    network: NetworkPlan,
}

/// Working memory of a [`MethodPlan`] for one frame at a time.
pub struct MethodScratch {
    network: NetworkScratch,
}

impl MethodPlan {
    /// Plans `method` for (`height`, `width`) frames and the volume of `display`.
    ///
    /// # Errors
    /// A network for layered input or for another display, or one that cannot be planned for this shape.
    pub fn new(height: usize, width: usize, method: Method, display: &Display) -> Result<Self> {
        let Method::Network(network) = method;
        if network.input() != InputKind::Rgbd {
            return Err(Error::Network(format!(
                "it takes {} planes of a layered depth image; a network for RGB-D frames is needed",
                network.input().channels()
            )));
        }
        check_display(network, display)?;
        Ok(MethodPlan {
            shape: (height, width),
            network: network.plan(height, width)?,
        })
    }

    /// (H, W).
    pub fn shape(&self) -> (usize, usize) {
        self.shape
    }

    /// What runs the network, and why; None for a method without one.
    pub fn engine(&self) -> Option<&Engine> {
        Some(self.network.engine())
    }

    /// Working memory for one frame at a time.
    pub fn scratch(&self) -> MethodScratch {
        MethodScratch {
            network: self.network.scratch(),
        }
    }

    /// The midpoint hologram of `frame`, carrier-free, at z = 0, into `field`, (3, H, W).
    ///
    /// # Errors
    /// A frame of another shape, or a `field` that has not 3·H·W values.
    pub fn field(
        &self,
        frame: &RgbdFrame,
        field: &mut [Complex32],
        scratch: &mut MethodScratch,
    ) -> Result<()> {
        if frame.shape() != self.shape {
            return Err(Error::Frame(format!(
                "the frame is {}×{}; this plan takes {}×{}",
                frame.shape().1,
                frame.shape().0,
                self.shape.1,
                self.shape.0
            )));
        }
        self.network.field(frame, field, &mut scratch.network)
    }
}

/// Checks that `network` was trained for a display like `display`: on another it gives wrong depths.
///
/// # Errors
/// A pitch, wavelength or volume that differs by over 2 %.
pub fn check_display(network: &Network, display: &Display) -> Result<()> {
    let trained = network.display();
    let pairs = [
        ("pitch", "µm", 1e6, trained.pitch_m, display.pitch_m()),
        (
            "volume depth",
            "mm",
            1e3,
            trained.volume_depth_m,
            display.volume_depth_m(),
        ),
    ];
    let colours = trained
        .wavelengths_m
        .into_iter()
        .zip(display.wavelengths_m())
        .map(|(trained, given)| ("wavelength", "nm", 1e9, trained, given));
    for (what, unit, scale, trained, given) in pairs.into_iter().chain(colours) {
        if (trained - given).abs() > DISPLAY_TOLERANCE * trained {
            return Err(Error::Network(format!(
                "it was trained for a {what} of {:.3} {unit}, the display has {:.3}; train one for this display, or use a method without a network",
                trained * scale,
                given * scale
            )));
        }
    }
    Ok(())
}
