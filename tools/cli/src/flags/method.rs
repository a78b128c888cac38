//! The core's methods, with their names on the command line.

use crate::flags::encoder::{Encoder, EncoderFlags};
use clap::ValueEnum;
use phasefront::{Display, Method, Sweep};
use phasefront_command::flags::{PrecisionName, check_used};
use phasefront_command::networks;
use phasefront_io::Result;
use phasefront_models::{NATURAL, default_network};

/// A method for RGB-D images.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub(crate) enum CoreMethod {
    /// A trained network on the RGB-D image
    Network,
    /// The plane sweep on the RGB-D image: waves by short filters, for any display
    Sweep,
    /// A network where the edges of depth are soft, the plane sweep otherwise
    Auto,
}

/// The inputs of a method besides its name.
pub(crate) struct Parts<'a> {
    /// The value of --network.
    pub(crate) network: Option<&'a str>,
    /// The value of --precision.
    pub(crate) precision: Option<PrecisionName>,
    pub(crate) display: &'a Display,
    pub(crate) sweep: Sweep,
    pub(crate) encoder: &'a EncoderFlags,
}

impl CoreMethod {
    /// Returns the method that was asked for, or the default: a network if flags name one, otherwise [`Self::Auto`].
    pub(crate) fn or_default(asked: Option<Self>, network: Option<&str>, encoder: &EncoderFlags) -> Self {
        asked.unwrap_or(if network.is_some() || encoder.is_deep() {
            CoreMethod::Network
        } else {
            CoreMethod::Auto
        })
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            CoreMethod::Network => "network",
            CoreMethod::Sweep => "sweep",
            CoreMethod::Auto => "auto",
        }
    }

    /// Makes the method and the encoder of its fields.
    pub(crate) fn of(self, parts: &Parts<'_>) -> Result<(Method, Encoder)> {
        let Parts {
            network,
            precision,
            display,
            sweep,
            encoder,
        } = *parts;
        let trained = self != CoreMethod::Sweep;
        let with = "a --method with a network, not with sweep";
        check_used(&[
            ("--network", network.is_some(), trained, with),
            ("--precision", precision.is_some(), trained, with),
        ])?;
        let precision = precision.map(PrecisionName::precision);
        let focus = encoder.focus()?;
        let (method, encoder) = match self {
            CoreMethod::Network => {
                let (network, encoder) = encoder.with_network(network, precision, display)?;
                (Method::trained(network), encoder)
            }
            CoreMethod::Sweep => (Method::Sweep(sweep), encoder.read()?),
            CoreMethod::Auto if network.is_none() && matches!(focus.default_method(display)?, Method::Seeded(_)) => {
                let network = networks::network(NATURAL.name, precision)?;
                (Method::trained(network), encoder.read()?)
            }
            CoreMethod::Auto => {
                let method = match network.or(default_network(display).map(|_| "8")) {
                    Some(network) => Method::Auto(sweep, networks::network(network, precision)?),
                    None => {
                        let right = "--network FILE.onnx: the bundled networks are for another display";
                        check_used(&[("--precision", precision.is_some(), false, right)])?;
                        Method::Sweep(sweep)
                    }
                };
                (method, encoder.read()?)
            }
        };
        focus.check(&method)?;
        Ok((method, encoder))
    }
}
