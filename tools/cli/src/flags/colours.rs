//! The flag for the meaning of a picture's colours.

use clap::{Args, ValueEnum};
use phasefront::input::RgbEncoding;
use phasefront_command::flags::DisplayFlags;
use phasefront_io::Result;
use phasefront_io::display::DisplayFile;

/// The meaning of the colours of pictures and films.
#[derive(Clone, Copy, Default, Args)]
#[command(next_help_heading = "Input")]
pub(crate) struct ColourFlags {
    /// Meaning of the red, green and blue of pictures and films
    #[arg(long, value_enum, value_name = "NAME", default_value_t)]
    rgb_encoding: EncodingName,
}

#[derive(Clone, Copy, Default, PartialEq, ValueEnum)]
enum EncodingName {
    /// What the file says of its colours by a profile or tags, else sRGB
    #[default]
    Auto,
    /// sRGB, and BT.709 video
    Srgb,
    /// Display P3, as phones take photographs
    DisplayP3,
    /// BT.2020 with hybrid log-gamma
    Bt2020Hlg,
    /// BT.2020 with perceptual quantization
    Bt2020Pq,
    /// Amplitudes of the lasers, as in the paper and its data sets
    Amplitude,
}

impl ColourFlags {
    /// Colours that are amplitudes, as those of layered depth images.
    pub(crate) const AMPLITUDE: ColourFlags = ColourFlags {
        rgb_encoding: EncodingName::Amplitude,
    };

    /// Returns the encoding that is asked for, or `None` if files say it.
    pub(crate) fn asked(self) -> Option<RgbEncoding> {
        match self.rgb_encoding {
            EncodingName::Auto => None,
            EncodingName::Srgb => Some(RgbEncoding::Srgb),
            EncodingName::DisplayP3 => Some(RgbEncoding::DisplayP3),
            EncodingName::Bt2020Hlg => Some(RgbEncoding::Bt2020Hlg),
            EncodingName::Bt2020Pq => Some(RgbEncoding::Bt2020Pq),
            EncodingName::Amplitude => Some(RgbEncoding::Amplitude),
        }
    }

    /// Reads the display on which pictures of these colours are shown.
    pub(crate) fn display(self, flags: &DisplayFlags) -> Result<DisplayFile> {
        match self.rgb_encoding {
            EncodingName::Amplitude => flags.read(),
            _ => flags.read_for_colours(),
        }
    }

    /// Works like [`Self::display`] for a command that also supports the focal plane of a lens.
    pub(crate) fn display_with_lens(self, flags: &DisplayFlags) -> Result<DisplayFile> {
        match self.rgb_encoding {
            EncodingName::Amplitude => flags.read_with_lens(),
            _ => flags.read_for_colours_with_lens(),
        }
    }

    /// Returns an encoding whose views are those of the pictures: light in sRGB, or amplitudes.
    pub(crate) fn viewed(self) -> RgbEncoding {
        self.asked().unwrap_or(RgbEncoding::Srgb)
    }
}
