//! The flags for the encoder that turns a field into phases.

use clap::{Args, ValueEnum, ValueHint};
use phasefront::session::Focus;
use phasefront::{Display, EncoderOptions, Encoding, Network};
use phasefront_command::flags::{EncoderName, check_used};
use phasefront_command::networks::{self, Precision};
use phasefront_io::{Error, Result};
use std::sync::Arc;

/// The encoder that turns a field into phases.
#[derive(Clone, Default, Args)]
#[command(next_help_heading = "Expert")]
pub(crate) struct EncoderFlags {
    /// Encoder that turns the field into phases [default: anti-alias; deep with --network ddpm-8]
    #[arg(long, value_enum, help_heading = "Method")]
    encoder: Option<EncoderName>,
    /// ONNX file of the pre-filter of --encoder deep, trained for the offset [default: that of --network ddpm-8]
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    prefilter: Option<String>,
    /// Fraction of full light, 0 to 1, below which phases are drawn to 0 to reduce speckle in dark areas [default: 0.4;
    /// 0 with --encoder deep]
    #[arg(long, value_name = "D")]
    dark_threshold: Option<f32>,
    /// Steps that bring the displayed image closer to the wanted field, 0 to 8 [default: 1; 0 with --encoder deep]
    #[arg(long, value_name = "N")]
    local_steps: Option<usize>,
    /// Further steps of correction at the midpoint, for stills; 1 brings most of the gain at the midpoint, 10 all of it
    #[arg(long, value_name = "N", default_value_t = 0)]
    midpoint_steps: usize,
    /// How what is out of focus looks [default: coherent]
    #[arg(long, value_enum, help_heading = "Method")]
    focus: Option<FocusName>,
    /// Steps of --focus natural, 0 to 1000, each of two transforms a plane, colour and map; with 0 the network
    /// natural-8 alone computes, as live frames need it [default: 30]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=1000))]
    focus_steps: Option<u16>,
}

/// How what is out of focus looks.
#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
pub(crate) enum FocusName {
    /// As a laser shows it, with halos and rings
    Coherent,
    /// Soft, as in the world: by steps on each frame, or by a network
    Natural,
}

/// The default number of steps of natural focus.
const FOCUS_STEPS: usize = 30;

/// The options of an encoder, and its name.
#[derive(Clone)]
pub(crate) struct Encoder {
    pub(crate) options: EncoderOptions,
    pub name: &'static str,
}

impl Encoder {
    /// Returns the encoder that shows phases as they are.
    pub(crate) fn of_phases() -> Self {
        Encoder {
            options: Encoding::Phase.into(),
            name: "phase",
        }
    }

    pub(crate) fn describe(&self) -> String {
        if matches!(self.options.encoding, Encoding::Phase) {
            return self.name.to_owned();
        }
        let EncoderOptions {
            dark_threshold,
            local_steps,
            midpoint_steps,
            focus_steps,
            ..
        } = &self.options;
        let last = match (midpoint_steps, focus_steps) {
            (0, 0) => String::new(),
            (0, steps) => format!(", natural focus, {steps} steps"),
            (steps, _) => format!(", midpoint steps {steps}"),
        };
        format!("{}, dark {dark_threshold}, local steps {local_steps}{last}", self.name)
    }
}

impl EncoderFlags {
    pub(crate) fn of(encoder: EncoderName, dark_threshold: f32, local_steps: usize, midpoint_steps: usize) -> Self {
        EncoderFlags {
            encoder: Some(encoder),
            prefilter: None,
            dark_threshold: Some(dark_threshold),
            local_steps: Some(local_steps),
            midpoint_steps,
            focus: None,
            focus_steps: None,
        }
    }

    /// Returns these flags for `focus`, with the default number of steps.
    pub(crate) fn with_focus(self, focus: FocusName) -> Self {
        EncoderFlags {
            focus: Some(focus),
            ..self
        }
    }

    /// Checks whether --focus natural is given.
    pub(crate) fn is_natural(&self) -> bool {
        self.focus == Some(FocusName::Natural)
    }

    /// Returns how what is out of focus looks.
    pub(crate) fn focus(&self) -> Result<Focus> {
        check_used(&[(
            "--focus-steps",
            self.focus_steps.is_some(),
            self.is_natural(),
            "--focus natural",
        )])?;
        Ok(match self.is_natural() {
            true => Focus::Natural {
                steps: self.focus_steps.map_or(FOCUS_STEPS, usize::from),
            },
            false => Focus::Coherent,
        })
    }

    /// Refuses --focus natural where there is no RGB-D image.
    pub(crate) fn check_focus(&self, is_of_rgbd: bool) -> Result<()> {
        let with = "--method network, sweep or auto on an RGB-D image, whose depth it needs";
        check_used(&[("--focus natural", self.is_natural(), is_of_rgbd, with)])
    }

    /// Makes the encoder for fields that are not made by the network of a pair.
    pub(crate) fn read(&self) -> Result<Encoder> {
        let prefilter = match &self.prefilter {
            Some(file) => Some(networks::network(file, None)?),
            None => None,
        };
        let default = if prefilter.is_some() {
            EncoderName::DEEP
        } else {
            EncoderName::ANTI_ALIAS
        };
        let name = self.encoder.unwrap_or(default);
        self.encoder(name.encoding(prefilter)?, name)
    }

    fn encoder(&self, encoding: Encoding, name: EncoderName) -> Result<Encoder> {
        let default = EncoderOptions::from(encoding);
        let options = EncoderOptions {
            dark_threshold: self.dark_threshold.unwrap_or(default.dark_threshold),
            local_steps: self.local_steps.unwrap_or(default.local_steps),
            midpoint_steps: self.midpoint_steps,
            focus_steps: self.focus()?.steps(),
            ..default
        };
        options.check().map_err(Error::usage)?;
        Ok(Encoder {
            options,
            name: name.name(),
        })
    }

    /// Makes the encoder for a network that gives the modulator's phases, which are shown as they are.
    fn phases(&self) -> Result<Encoder> {
        self.unused("a network that gives a wave; this one gives the modulator's phases")?;
        Ok(Encoder::of_phases())
    }

    /// Refuses all of these flags. They go `with` something else.
    pub(crate) fn unused(&self, with: &str) -> Result<()> {
        check_used(&[
            ("--encoder", self.encoder.is_some(), false, with),
            ("--prefilter", self.prefilter.is_some(), false, with),
            ("--dark-threshold", self.dark_threshold.is_some(), false, with),
            ("--local-steps", self.local_steps.is_some(), false, with),
            ("--midpoint-steps", self.midpoint_steps > 0, false, with),
            ("--focus natural", self.is_natural(), false, with),
        ])
    }

    /// Checks whether --encoder deep is given.
    pub(crate) fn is_deep(&self) -> bool {
        self.encoder == Some(EncoderName::DEEP)
    }

    /// Returns the network called `network` and its encoder. The bundled pair for `display` is used if its name or
    /// --encoder deep is given; otherwise the default is the network of 8 layers.
    pub(crate) fn with_network(
        &self,
        network: Option<&str>,
        precision: Option<Precision>,
        display: &Display,
    ) -> Result<(Arc<Network>, Encoder)> {
        let by_name = network == Some(networks::DEEP);
        let deep = self.is_deep() || (by_name && self.encoder.is_none());
        if deep && self.prefilter.is_none() && (by_name || network.is_none()) {
            let Some(pair) = phasefront_models::pair_for(display, precision.unwrap_or_default()) else {
                return Err(Error::Usage(
                    "the bundled networks for the deep encoder are for an offset of 0 mm and the default display; train a pair for this one, or take --network 8 --encoder anti-alias, which displays more".into(),
                ));
            };
            let encoder = self.encoder(Encoding::Deep(pair.prefilter), EncoderName::DEEP)?;
            return Ok((pair.hologram, encoder));
        }
        if by_name {
            return Err(Error::Usage(format!(
                "--network {} brings its own --encoder, deep, and --prefilter; leave them out",
                networks::DEEP
            )));
        }
        let network = networks::network(network.unwrap_or("8"), precision)?;
        let encoder = if network.gives_phase() {
            self.phases()?
        } else {
            self.read()?
        };
        Ok((network, encoder))
    }
}
