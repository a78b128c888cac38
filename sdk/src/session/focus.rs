//! How what is out of focus looks, and the method for it where none is named.

use phasefront_core::display::Display;
use phasefront_core::method::Method;
use phasefront_core::runtime::error::{Error, Result};

/// How what is out of focus looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Focus {
    /// As a laser shows it, with halos and rings.
    #[default]
    Coherent,
    /// Soft, as in the world.
    Natural {
        /// The number of steps that follow the method, 0 to 1000, each of two transforms for each plane and colour. 30
        /// bring most of the gain in stills. Without steps, as live frames need it, a network for natural focus
        /// computes.
        steps: usize,
    },
}

impl Focus {
    /// Returns the number of steps, for [`EncoderOptions::focus_steps`](crate::EncoderOptions::focus_steps).
    pub fn steps(self) -> usize {
        match self {
            Focus::Coherent => 0,
            Focus::Natural { steps } => steps,
        }
    }

    /// Returns this focus with `steps`, as a quality level asks for it; `None` keeps the number.
    ///
    /// # Errors
    /// Returns an error for steps of coherent focus.
    pub fn with_steps(self, steps: Option<usize>) -> Result<Self> {
        match (self, steps) {
            (focus, None) | (focus @ Focus::Coherent, Some(0)) => Ok(focus),
            (Focus::Natural { .. }, Some(steps)) => Ok(Focus::Natural { steps }),
            (Focus::Coherent, Some(steps)) => Err(Error::Setting(format!(
                "a quality level has {steps} steps of natural focus, and the session's focus is coherent; set that to natural"
            ))),
        }
    }

    /// Checks whether `method` can make this focus: without steps, natural focus is what a network was trained for.
    ///
    /// # Errors
    /// Returns an error for the plane sweep and the automatic choice with natural focus without steps.
    pub fn check(self, method: &Method) -> Result<()> {
        match (self, method) {
            (Focus::Natural { steps: 0 }, Method::Sweep(_) | Method::Auto(..)) => Err(Error::Setting(
                "natural focus without steps is what a network was trained for, and the method is none: leave the method out for the bundled network, or give steps, 30 for stills".into(),
            )),
            _ => Ok(()),
        }
    }

    /// Returns the default method for `display`: for natural focus the bundled network that was trained for it, with
    /// steps or without, and else that of [`phasefront_models::default_method`].
    ///
    /// # Errors
    /// Returns an error for natural focus without steps if the bundled network was not trained for `display`.
    #[cfg(feature = "models")]
    pub fn default_method(self, display: &Display) -> Result<Method> {
        let natural = match self {
            Focus::Coherent => None,
            Focus::Natural { .. } => phasefront_models::natural_network(display),
        };
        match (natural, self) {
            (Some(network), _) => Ok(Method::trained(network)),
            (None, Focus::Natural { steps: 0 }) => Err(no_network()),
            (None, _) => Ok(phasefront_models::default_method(display)),
        }
    }

    /// Returns the default method for `display`, the plane sweep.
    ///
    /// # Errors
    /// Returns an error for natural focus without steps.
    #[cfg(not(feature = "models"))]
    pub fn default_method(self, display: &Display) -> Result<Method> {
        use phasefront_core::method::sweep::Sweep;
        match self {
            Focus::Natural { steps: 0 } => Err(no_network()),
            _ => Ok(Method::Sweep(Sweep::for_display(display))),
        }
    }
}

fn no_network() -> Error {
    Error::Setting(
        "natural focus without steps needs a network that was trained for the display, and none is bundled; give a network as the method, or steps: 30 suit stills".into(),
    )
}
