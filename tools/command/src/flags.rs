//! Flags that commands of both programs share.

use crate::networks::Precision;
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use phasefront::Size;
use phasefront::target::Balance;
use phasefront::{Display, Encoding, Network, Sweep};
use phasefront_io::display::{self, DisplayFile};
use phasefront_io::output::Holding;
use phasefront_io::{Error, Result};
use std::sync::{Arc, LazyLock};

/// The display that a hologram is for.
#[derive(Clone, Default, Args)]
#[command(next_help_heading = "Display")]
pub struct DisplayFlags {
    /// TOML file of the display, or the name of a modulator that `phasefront devices` lists [default: 1920×1080, 8 µm,
    /// 638/520/450 nm, 6 mm]
    #[arg(long, value_name = "FILE|NAME")]
    display: Option<String>,
    /// z of the hologram from the middle of the volume, mm, positive toward the viewer
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    offset_mm: Option<f64>,
}

impl DisplayFlags {
    /// Names the display's file at `path`.
    pub fn of_file(path: &std::path::Path) -> Self {
        DisplayFlags {
            display: Some(path.display().to_string()),
            offset_mm: None,
        }
    }

    /// Checks whether a display is given.
    pub fn is_given(&self) -> bool {
        self.display.is_some()
    }

    /// Returns the display's file or the modulator's name, if one is given.
    pub fn name(&self) -> Option<&str> {
        self.display.as_deref()
    }

    /// Reads the display for a command that shows a picture's own colours. Warns if the display is a modulator of the
    /// catalogue, which says nothing of the white of three lasers.
    ///
    /// # Errors
    /// Returns the errors of [`Self::read`].
    pub fn read_for_colours(&self) -> Result<DisplayFile> {
        without_lens(self.read_for_colours_with_lens()?)
    }

    /// Works like [`Self::read_for_colours`] for a command that also supports the focal plane of a lens.
    ///
    /// # Errors
    /// Returns the errors of [`Self::read_with_lens`].
    pub fn read_for_colours_with_lens(&self) -> Result<DisplayFile> {
        let file = self.read_with_lens()?;
        let display = &file.target.display;
        let modulator = self.name().filter(|name| display::display_path(name).is_none());
        let is_unknown = display.colours() == 3 && *display.balance() == Balance::Unknown;
        if let Some(name) = modulator.filter(|_| is_unknown) {
            let nm: Vec<_> = (display.wavelengths_m().iter())
                .map(|l| format!("{:.0}", l * 1e9))
                .collect();
            log::warn!(
                "{name} says nothing of your lasers: {} nm are taken, together as white as D65; wavelengths_nm and powers in a display's file give right colours, and `calibrate white` makes the line",
                nm.join(", ")
            );
        }
        Ok(file)
    }

    /// Reads the display for a command that supports only red, green and blue, and no offset.
    pub fn read_of_midpoint(&self) -> Result<DisplayFile> {
        self.read_without_offset()?;
        self.read_of_three()
    }

    /// Reads the display for a command that supports no offset.
    pub fn read_without_offset(&self) -> Result<DisplayFile> {
        check_used(&[(
            "--offset-mm",
            self.offset_mm.is_some(),
            false,
            "holograms at the modulator",
        )])?;
        self.read()
    }

    /// Reads the display for a command that supports only red, green and blue.
    pub fn read_of_three(&self) -> Result<DisplayFile> {
        let file = self.read()?;
        match file.target.display.colours() {
            3 => Ok(file),
            _ => Err(Error::Input(
                "this command is for displays of three lasers; --display has one".into(),
            )),
        }
    }

    /// Reads the display for a command that does not need one. Returns `None` if no display is given.
    pub fn read_if_given(&self) -> Result<Option<DisplayFile>> {
        self.read_if_given_with_lens()?.map(without_lens).transpose()
    }

    /// Works like [`Self::read_if_given`] for a command that also supports the focal plane of a lens.
    pub fn read_if_given_with_lens(&self) -> Result<Option<DisplayFile>> {
        match (&self.display, self.offset_mm) {
            (Some(_), _) => Ok(Some(self.read_with_lens()?)),
            (None, None) => Ok(None),
            (None, Some(_)) => Err(Error::Usage(
                "--offset-mm goes with --display; a hologram file says its own offset".into(),
            )),
        }
    }

    /// Reads the display, or takes the default one, and applies the given offset.
    ///
    /// # Errors
    /// Returns an error if the display cannot be read, the offset is too large, or the picture lies in the focal plane
    /// of a lens.
    pub fn read(&self) -> Result<DisplayFile> {
        without_lens(self.read_with_lens()?)
    }

    /// Works like [`Self::read`] for a command that also supports the focal plane of a lens.
    ///
    /// # Errors
    /// Returns an error if the display cannot be read or the offset is too large.
    pub fn read_with_lens(&self) -> Result<DisplayFile> {
        let mut file = match &self.display {
            Some(name) => display::find_display(name)?,
            None => Display::default().into(),
        };
        if let Some(mm) = self.offset_mm {
            if file.lens.is_some() {
                return Err(Error::Usage(
                    "--offset-mm is for pictures about the modulator, and this display's lies in the focal plane of a lens"
                        .into(),
                ));
            }
            file.target.display = file.target.display.with_offset_m(mm / 1e3).map_err(Error::usage)?;
            file.device.display = file.target.display.clone();
        }
        let lasers = file.device.lasers_turns.iter().flatten();
        let widest = file
            .device
            .levels_turns
            .iter()
            .chain(lasers)
            .filter_map(|turns| gap(turns));
        if let Some(gap) = widest.reduce(f64::max) {
            log::warn!(
                "the modulator's levels reach {:.2} of 2π; phases beyond become the nearest that they show, at most {:.2} rad away",
                1.0 - gap,
                gap * std::f64::consts::PI
            );
        }
        Ok(file)
    }
}

/// Refuses a display whose picture lies in the focal plane of a lens.
fn without_lens(file: DisplayFile) -> Result<DisplayFile> {
    match file.lens {
        None => Ok(file),
        Some(_) => Err(Error::Input(
            "the display's picture lies in the focal plane of a lens, plane = \"fourier\"; hologram, refocus, view, judge, pack, unpack, show, pattern and devices know it, this command does not"
                .into(),
        )),
    }
}

/// Returns the part of a turn that levels with these phases do not reach, if it is wider than 1.5 times the largest
/// step between levels.
fn gap(turns: &[f64]) -> Option<f64> {
    let widest = turns.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    let gap = 1.0 - turns.last()?;
    (gap > 1.5 * widest).then_some(gap)
}

/// The name of the encoding with a pre-filter.
const DEEP: &str = "deep";

/// The name of an encoder: one of the core's encoders, or [`Self::DEEP`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EncoderName(&'static str);

impl ValueEnum for EncoderName {
    fn value_variants<'a>() -> &'a [Self] {
        static NAMES: LazyLock<Vec<EncoderName>> = LazyLock::new(|| {
            let names = Encoding::BY_NAME.iter().map(|(name, ..)| *name);
            names.chain([DEEP]).map(EncoderName).collect()
        });
        &NAMES
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let what = match self.known() {
            Some((_, what, _)) => what,
            None => "Double phase after a pre-filter network (DDPM)",
        };
        Some(PossibleValue::new(self.0).help(what))
    }
}

impl EncoderName {
    /// The encoding with a pre-filter.
    pub const DEEP: Self = EncoderName(DEEP);
    /// The default encoding for fields without a trained pre-filter.
    pub const ANTI_ALIAS: Self = EncoderName("anti-alias");

    fn known(self) -> Option<&'static (&'static str, &'static str, Encoding)> {
        Encoding::BY_NAME.iter().find(|(name, ..)| *name == self.0)
    }

    /// Returns the encoding, with its `prefilter` if it has one.
    ///
    /// # Errors
    /// Returns an error if a pre-filter is given for an encoding without one, or none is given for an encoding that
    /// needs one.
    pub fn encoding(self, prefilter: Option<Arc<Network>>) -> Result<Encoding> {
        Ok(match (self.known(), prefilter) {
            (Some((.., encoding)), None) => encoding.clone(),
            (None, Some(network)) => Encoding::Deep(network),
            (None, None) => {
                return Err(Error::Usage("--encoder deep needs --prefilter".into()));
            }
            (Some((name, ..)), Some(_)) => {
                return Err(Error::Usage(format!(
                    "--prefilter goes with --encoder deep, not with {name}"
                )));
            }
        })
    }

    /// Returns the name on the command line.
    pub fn name(self) -> &'static str {
        self.0
    }
}

/// Refuses a flag that changes nothing. Each entry holds the flag's name, whether it is given, whether it is used, and
/// what it goes with.
pub fn check_used(flags: &[(&str, bool, bool, &str)]) -> Result<()> {
    match flags.iter().find(|(_, given, used, _)| *given && !*used) {
        None => Ok(()),
        Some((flag, .., with)) => Err(Error::Usage(format!(
            "{flag} goes with {with}; here it would change nothing, leave it out"
        ))),
    }
}

/// The flag that allows a command to replace existing output files.
#[derive(Default, Args)]
#[command(next_help_heading = "Output")]
pub struct OverwriteFlag {
    /// Replace files of an earlier run; without it, an output folder must be new or empty, and a calibration file must
    /// not exist
    #[arg(long)]
    overwrite: bool,
}

impl OverwriteFlag {
    /// Checks whether --overwrite is given.
    pub fn is_given(&self) -> bool {
        self.overwrite
    }

    /// Returns which files an output folder may hold.
    pub fn holding(&self) -> Holding<'static> {
        Holding::by_flag(self.overwrite)
    }
}

/// The largest number of pixels of a size.
const MOST_PIXELS: usize = 1 << 26;

/// Parses a width and height such as 1920x1080.
pub fn parse_size(text: &str) -> std::result::Result<Size, String> {
    let parsed = text.split_once(['x', '×']).and_then(|(width, height)| {
        Some(Size {
            width: width.parse().ok()?,
            height: height.parse().ok()?,
        })
    });
    match parsed {
        Some(size)
            if [size.width, size.height].iter().all(|side| (1..=16384).contains(side))
                && size.pixels() <= MOST_PIXELS =>
        {
            Ok(size)
        }
        _ => Err(format!(
            "a size is written WxH, as 1920x1080, each up to 16384 and {MOST_PIXELS} pixels in all"
        )),
    }
}

/// The number type of a network.
#[derive(Clone, Copy, Default, PartialEq, ValueEnum)]
pub enum PrecisionName {
    #[default]
    /// 8-bit integers, the fastest
    Int8,
    /// 32-bit floating point
    F32,
}

impl PrecisionName {
    /// Returns the precision with this name.
    pub fn precision(self) -> Precision {
        match self {
            PrecisionName::Int8 => Precision::Int8,
            PrecisionName::F32 => Precision::Float32,
        }
    }
}

/// Returns the sweep that suits `display`, with `planes` and `taps` if they are given.
pub fn sweep_for(display: &Display, planes: Option<usize>, taps: Option<usize>) -> Sweep {
    let default = match planes {
        Some(planes) => Sweep::of_planes(display, planes),
        None => Sweep::for_display(display),
    };
    Sweep {
        taps: taps.unwrap_or(default.taps),
        ..default
    }
}
