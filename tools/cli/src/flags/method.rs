//! The flags that all commands which make holograms share, and the core's methods by name.

use crate::flags::encoder::{Encoder, EncoderFlags};
use clap::{Args, ValueEnum, ValueHint};
use phasefront::{Display, Method, Sweep};
use phasefront_command::flags::{DisplayFlags, PrecisionName, check_used};
use phasefront_command::networks;
use phasefront_io::{Error, Result};
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

/// The flags of every command that makes holograms of images: the network, the encoder and the display.
#[derive(Clone, Default, Args)]
#[command(next_help_heading = "Method")]
pub(crate) struct HologramFlags {
    /// A bundled network (`phasefront networks` lists them), or an ONNX file [default: 8]
    #[arg(long, value_name = "NAME|FILE", value_hint = ValueHint::FilePath, help_heading = "Method")]
    pub(crate) network: Option<String>,
    /// Number type of a bundled network [default: int8]
    #[arg(long, value_enum, help_heading = "Expert")]
    pub(crate) precision: Option<PrecisionName>,
    #[command(flatten)]
    pub(crate) encoder: EncoderFlags,
    #[command(flatten)]
    pub(crate) display: DisplayFlags,
}

impl CoreMethod {
    pub(crate) fn name(self) -> &'static str {
        match self {
            CoreMethod::Network => "network",
            CoreMethod::Sweep => "sweep",
            CoreMethod::Auto => "auto",
        }
    }
}

impl HologramFlags {
    /// Returns the method that was asked for, or the default: a network if flags name one, otherwise
    /// [`CoreMethod::Auto`].
    pub(crate) fn method(&self, asked: Option<CoreMethod>) -> CoreMethod {
        asked.unwrap_or(if self.network.is_some() || self.encoder.is_deep() {
            CoreMethod::Network
        } else {
            CoreMethod::Auto
        })
    }

    /// Refuses the flags of a network where the method is not `trained`.
    pub(crate) fn check_network(&self, trained: bool) -> Result<()> {
        let with = "--method network or auto";
        check_used(&[
            ("--network", self.network.is_some(), trained, with),
            ("--precision", self.precision.is_some(), trained, with),
        ])
    }

    /// Makes `method` for `display`, where `sweep` is its plane sweep, and the encoder of its fields.
    pub(crate) fn read(&self, method: CoreMethod, display: &Display, sweep: Sweep) -> Result<(Method, Encoder)> {
        let (network, encoder) = (self.network.as_deref(), &self.encoder);
        let trained = method != CoreMethod::Sweep;
        self.check_network(trained)?;
        let precision = self.precision.map(PrecisionName::precision);
        let focus = encoder.focus()?;
        let (method, encoder) = match method {
            CoreMethod::Network => {
                let (network, encoder) = encoder.with_network(network, precision, display)?;
                (Method::trained(network), encoder)
            }
            CoreMethod::Sweep => (Method::Sweep(sweep), encoder.read()?),
            CoreMethod::Auto if network.is_none() && matches!(focus.default_method(display)?, Method::Network(_)) => {
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
        focus.check(&method).map_err(Error::usage)?;
        Ok((method, encoder))
    }
}
