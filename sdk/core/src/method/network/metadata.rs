//! The `phasefront.*` metadata of a network file: the input, the output and the display.

use super::Head;
use super::proto::Entry;
use crate::display::Display;
use crate::method::sweep::MAX_PLANES;
use crate::runtime::error::Error;
use crate::runtime::error::Result;

/// The kind of a network's input planes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InputKind {
    /// "rgbd": red, green, blue and normalized depth, each minus 0.5.
    Rgbd,
    /// "rgbdxy": the planes of [`InputKind::Rgbd`], then the position in the frame, x and y, from −½ at the outer edge
    /// of the first pixel to ½ at that of the last. For aberrations that vary over the frame.
    RgbdXy,
    /// "ldi2" to "ldi9": 2 to 9 layers, front first, each with the planes of [`InputKind::Rgbd`].
    Ldi {
        /// The number of layers.
        layers: usize,
    },
    /// "seeded": the planes of [`InputKind::Rgbd`], then the plane sweep's field of the frame; see `seeded.rs`.
    Seeded,
    /// "field": the real (3) and imaginary (3) parts of a field's colours, for a pre-filter network.
    Field,
    /// "blurred-field": the planes of [`InputKind::Field`], of a field that AA-DPM's blur was applied to. The remaining
    /// correction is small, and so are its rounding errors. Dark pixels, where the modulator's light cancels, are
    /// sensitive to them.
    BlurredField,
    /// "split-blurred-field": the planes of [`InputKind::BlurredField`] in two parts, for networks whose input is
    /// rounded to 8 bits: the six planes in steps of [`InputKind::SPLIT_STEP`], then their remainders times
    /// [`InputKind::REMAINDER_GAIN`].
    SplitBlurredField,
}

impl InputKind {
    /// The step to which the first part of a split field is rounded.
    pub const SPLIT_STEP: f32 = 1.0 / 64.0;
    /// The factor of the remainders of a split field.
    pub const REMAINDER_GAIN: f32 = 16.0;

    /// Splits a value of a field into two parts with `value = first + second / REMAINDER_GAIN`.
    #[inline(always)]
    pub fn split(value: f32) -> (f32, f32) {
        let first = (value / Self::SPLIT_STEP).round_ties_even() * Self::SPLIT_STEP;
        (first, Self::REMAINDER_GAIN * (value - first))
    }

    /// Returns the number of input planes.
    pub fn channels(self) -> usize {
        match self {
            InputKind::Rgbd => 4,
            InputKind::RgbdXy => 6,
            InputKind::Ldi { layers } => 4 * layers,
            InputKind::Seeded => 10,
            InputKind::Field | InputKind::BlurredField => 6,
            InputKind::SplitBlurredField => 12,
        }
    }

    /// Returns whether `plane` holds depth.
    pub(super) fn is_depth(self, plane: usize) -> bool {
        match self {
            InputKind::Rgbd | InputKind::RgbdXy | InputKind::Seeded => plane == 3,
            InputKind::Ldi { .. } => plane % 4 == 3,
            InputKind::Field | InputKind::BlurredField | InputKind::SplitBlurredField => false,
        }
    }

    /// Returns whether a network with this input is a pre-filter.
    pub fn is_field(self) -> bool {
        self == InputKind::Field || self.is_blurred()
    }

    /// Returns whether the input is a field that AA-DPM's blur was applied to.
    pub fn is_blurred(self) -> bool {
        matches!(self, InputKind::BlurredField | InputKind::SplitBlurredField)
    }

    fn from_name(name: &str) -> Option<InputKind> {
        match name.as_bytes() {
            b"rgbd" => Some(InputKind::Rgbd),
            b"rgbdxy" => Some(InputKind::RgbdXy),
            b"seeded" => Some(InputKind::Seeded),
            b"field" => Some(InputKind::Field),
            b"blurred-field" => Some(InputKind::BlurredField),
            b"split-blurred-field" => Some(InputKind::SplitBlurredField),
            [b'l', b'd', b'i', n @ b'2'..=b'9'] => Some(InputKind::Ldi {
                layers: usize::from(n - b'0'),
            }),
            _ => None,
        }
    }
}

impl std::fmt::Display for InputKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            InputKind::Rgbd => f.write_str("rgbd"),
            InputKind::RgbdXy => f.write_str("rgbdxy"),
            InputKind::Ldi { layers } => write!(f, "ldi{layers}"),
            InputKind::Seeded => f.write_str("seeded"),
            InputKind::Field => f.write_str("field"),
            InputKind::BlurredField => f.write_str("blurred-field"),
            InputKind::SplitBlurredField => f.write_str("split-blurred-field"),
        }
    }
}

/// The permitted values of `phasefront.input`.
const INPUTS: &str = "'rgbd', 'rgbdxy', 'seeded', 'ldi2' to 'ldi9', 'field', 'blurred-field' or 'split-blurred-field'";

/// The largest difference between the modulator's offset and the one that a pre-filter was trained for, scaled to the
/// trained display. Over it, light spreads by less than a tenth of a pixel of 8 µm.
const OFFSET_TOLERANCE_M: f64 = 20e-6;
/// The relative tolerance by which λ·V/p² may exceed the trained value.
const RANGE_TOLERANCE: f64 = 0.02;
/// The relative tolerance between a colour's own λ·V/p² and the mean over the colours. It corresponds to 35 dB from the
/// exact hologram, which is more than networks reach.
const COLOUR_TOLERANCE: f64 = 0.05;

/// The display that a network was trained for.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainedDisplay {
    /// The pixel pitch of the modulator, in metres.
    pub pitch_m: f64,
    /// The wavelengths of red, green and blue, in metres.
    pub wavelengths_m: [f64; 3],
    /// The depth of the volume, in metres.
    pub volume_depth_m: f64,
    /// The distance of the hologram plane from the volume's middle, in metres. 0 for a midpoint hologram.
    pub offset_m: f64,
    /// Whether the holograms correct an aberration of the display's optics, which limits them to this display.
    pub corrected: bool,
}

/// The parameters with which a network supports a display.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Served {
    /// The factor that stretches depths about the middle of the volume.
    pub(super) scale: f64,
    /// The colour whose output is the field of a display with one laser: 0 red, 1 green, 2 blue.
    pub(super) colour: Option<usize>,
}

impl TrainedDisplay {
    /// Returns the factor s that stretches depths d of frames for `display` about the middle of the volume, d' = ½ +
    /// s·(d − ½), so that a network for this display computes their hologram: s = (λ·V/p²) / (λ·V/p²)trained, mean over
    /// the colours.
    ///
    /// To paraxial order, a midpoint hologram without its carrier depends on λ·z/p² alone, so a frame for a display
    /// with another pitch, volume or laser equals a frame for this display with stretched depth. One laser uses the
    /// output of one colour: the nearest whose trained depths cover the display's range.
    ///
    /// # Errors
    /// Returns an error if the display has a larger λ·V/p², whose depths were not trained, if the factors of its lasers
    /// differ by more than 5 %, or if the network corrects the aberration of another display.
    pub(super) fn serve(&self, display: &Display) -> Result<Served> {
        let trained = self.pitch_m.powi(2) / self.volume_depth_m;
        let given = display.volume_depth_m() / display.pitch_m().powi(2);
        let of_colour = |(trained_m, given_m): (f64, &f64)| given_m / trained_m * given * trained;
        let lasers = self
            .wavelengths_m
            .into_iter()
            .zip(display.wavelengths_m().iter().cycle());
        let mut each: Vec<f64> = lasers.map(of_colour).collect();
        let colour = (display.colours() == 1).then(|| nearest(&self.wavelengths_m, display.wavelengths_m()[0], &each));
        if let Some(colour) = colour {
            each = vec![each[colour]];
        }
        let scale = each.iter().sum::<f64>() / each.len() as f64;
        let same = |trained: f64, given: f64| (trained - given).abs() <= RANGE_TOLERANCE * trained;
        if self.corrected && !(same(self.pitch_m, display.pitch_m()) && each.iter().all(|own| same(1.0, *own))) {
            return Err(Error::Network(format!(
                "it corrects the optics of one display, of {:.3} µm and {:.3} mm, and serves no other; train one for this display",
                self.pitch_m * 1e6,
                self.volume_depth_m * 1e3
            )));
        }
        if each.iter().any(|own| (own - scale).abs() > COLOUR_TOLERANCE * scale) {
            let nm = |all: &[f64]| (all.iter().map(|m| format!("{:.0}", m * 1e9)).collect::<Vec<_>>()).join(", ");
            return Err(Error::Network(format!(
                "it was trained for wavelengths of {} nm, the display has {}; train one for this display, or use a method without a network",
                nm(&self.wavelengths_m),
                nm(display.wavelengths_m())
            )));
        }
        if scale > 1.0 + RANGE_TOLERANCE {
            return Err(Error::Network(format!(
                "it was trained for depths of {:.3} mm at a pitch of {:.3} µm, the display's {:.3} mm at {:.3} µm need {scale:.2} times the range; train one for this display, or use a method without a network",
                self.volume_depth_m * 1e3,
                self.pitch_m * 1e6,
                display.volume_depth_m() * 1e3,
                display.pitch_m() * 1e6
            )));
        }
        Ok(Served { scale, colour })
    }

    /// Returns how a network of any form for this display serves `display`, which must have its pitch and its lasers,
    /// one where `colours` is 1, and a volume that is not deeper. A network of three colours serves one laser of them.
    ///
    /// # Errors
    /// Returns an error that names what differs, and if a network that `gives_phase` is for another offset.
    #[cfg(feature = "tract")]
    pub(super) fn serve_own(&self, colours: usize, gives_phase: bool, display: &Display) -> Result<Served> {
        let refuse = |what: &str, trained: String, given: String| {
            Err(Error::Network(format!(
                "it was trained for {what} of {trained}, the display has {given}; a --display or a network of the same is right"
            )))
        };
        let close = |trained: f64, given: f64| (trained - given).abs() <= RANGE_TOLERANCE * trained;
        let [um, mm] = [1e6, 1e3].map(|unit| move |m: f64| format!("{:.3}", m * unit));
        if !close(self.pitch_m, display.pitch_m()) {
            return refuse("a pitch in µm", um(self.pitch_m), um(display.pitch_m()));
        }
        let given = display.wavelengths_m();
        let trained = &self.wavelengths_m[..colours];
        let colour = match given {
            [one] => trained.iter().position(|m| close(*m, *one)),
            _ => None,
        };
        let all = trained.len() == given.len() && trained.iter().zip(given).all(|(a, b)| close(*a, *b));
        if !all && colour.is_none() {
            let nm = |all: &[f64]| (all.iter().map(|m| format!("{:.0}", m * 1e9)).collect::<Vec<_>>()).join(", ");
            return refuse("wavelengths in nm", nm(trained), nm(given));
        }
        let scale = display.volume_depth_m() / self.volume_depth_m;
        if scale > 1.0 + RANGE_TOLERANCE {
            return refuse("depths in mm", mm(self.volume_depth_m), mm(display.volume_depth_m()));
        }
        if gives_phase && (self.offset_m - display.offset_m()).abs() > OFFSET_TOLERANCE_M {
            return refuse("an offset in mm", mm(self.offset_m), mm(display.offset_m()));
        }
        Ok(Served { scale, colour })
    }

    /// Checks that a pre-filter for this display also suits `display`, for which λ·offset/p² must be the same.
    ///
    /// # Errors
    /// Returns the same errors as [`Self::serve`], and an error if the offset differs by more than 20 µm at the trained
    /// pitch.
    pub(super) fn check_offset(&self, display: &Display) -> Result<()> {
        let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
        let trained_m = match self.serve(display)?.colour {
            Some(colour) => self.wavelengths_m[colour],
            None => mean(&self.wavelengths_m),
        };
        let finer = (self.pitch_m / display.pitch_m()).powi(2);
        let longer = mean(display.wavelengths_m()) / trained_m;
        let (trained, given) = (self.offset_m, display.offset_m());
        if (trained - given * finer * longer).abs() > OFFSET_TOLERANCE_M {
            return Err(Error::Network(format!(
                "the pre-filter was trained for an offset of {:.3} mm on this display, which has {:.3} mm; take one for this offset, or another encoder",
                trained / (finer * longer) * 1e3,
                given * 1e3
            )));
        }
        Ok(())
    }
}

/// Returns the colour whose wavelength is nearest to `given_m` among those whose factor in `each` stays within the
/// trained depths. If there is none, returns the colour with the smallest factor.
fn nearest(trained_m: &[f64; 3], given_m: f64, each: &[f64]) -> usize {
    let apart = |colour: &usize| (trained_m[*colour] / given_m).ln().abs();
    let within = (0..3).filter(|colour| each[*colour] <= 1.0 + RANGE_TOLERANCE);
    let least = (0..3).min_by(|a, b| each[*a].total_cmp(&each[*b]));
    let nearest = within.min_by(|a, b| apart(a).total_cmp(&apart(b)));
    nearest.or(least).unwrap_or(0)
}

/// The metadata of a network file.
pub(super) struct Description {
    pub(super) input: InputKind,
    pub(super) head: Head,
    pub(super) display: TrainedDisplay,
    /// The number of sweep planes of a seeded network, if the file gives it.
    pub(super) seed_planes: Option<usize>,
}

/// Returns whether the metadata declares a network of any form, which tract runs.
pub(super) fn is_own(metadata: &[Entry]) -> bool {
    found(metadata, "output").is_some()
}

/// Reads all required and optional metadata.
pub(super) fn read(metadata: &[Entry]) -> Result<Description> {
    let input = text(metadata, "input", INPUTS)?;
    let input = InputKind::from_name(input).ok_or_else(|| wrong("input", input, INPUTS))?;
    let heads = "'amplitude-phase' or 'real-imaginary'";
    let head = text(metadata, "head", heads)?;
    let head = [Head::AmplitudePhase, Head::RealImaginary]
        .into_iter()
        .find(|known| known.name() == head)
        .ok_or_else(|| wrong("head", head, heads))?;
    let positive = |v: &f64| *v > 0.0;
    let wavelengths = numbers(
        metadata,
        "wavelengths_nm",
        "three numbers in nm such as '638,520,450'",
        positive,
    )?;
    let display = TrainedDisplay {
        pitch_m: number(metadata, "pitch_um", "a number in µm such as '8.0'", positive)? * 1e-6,
        wavelengths_m: wavelengths.map(|nm: f64| nm * 1e-9),
        volume_depth_m: number(metadata, "volume_depth_mm", "a number in mm such as '6.0'", positive)? * 1e-3,
        offset_m: number(metadata, "offset_mm", "a number in mm such as '0'", |v| v.is_finite())? * 1e-3,
        corrected: found(metadata, "corrected") == Some("true"),
    };
    let seed_planes = match found(metadata, "seed_planes") {
        Some(planes) if input == InputKind::Seeded => {
            let right = format!("a number from 1 to {MAX_PLANES}");
            let known = (planes.parse().ok()).filter(|n| (1..=MAX_PLANES).contains(n));
            Some(known.ok_or_else(|| wrong("seed_planes", planes, &right))?)
        }
        _ => None,
    };
    Ok(Description {
        input,
        head,
        display,
        seed_planes,
    })
}

pub(super) fn found<'a>(metadata: &'a [Entry], key: &str) -> Option<&'a str> {
    metadata
        .iter()
        .find(|entry| entry.key.strip_prefix("phasefront.") == Some(key))
        .map(|entry| entry.value.trim())
}

fn text<'a>(metadata: &'a [Entry], key: &str, right: &str) -> Result<&'a str> {
    found(metadata, key)
        .ok_or_else(|| Error::Network(format!("metadata 'phasefront.{key}' is missing; {right} is right")))
}

pub(super) fn number(metadata: &[Entry], key: &str, right: &str, valid: impl Fn(&f64) -> bool) -> Result<f64> {
    numbers::<1>(metadata, key, right, valid).map(|[one]| one)
}

pub(super) fn numbers<const N: usize>(
    metadata: &[Entry],
    key: &str,
    right: &str,
    valid: impl Fn(&f64) -> bool,
) -> Result<[f64; N]> {
    let value = text(metadata, key, right)?;
    let parsed: Option<Vec<f64>> = value.split(',').map(|n| n.trim().parse().ok()).collect();
    parsed
        .filter(|all| all.iter().all(|v| v.is_finite() && valid(v)))
        .and_then(|all| all.try_into().ok())
        .ok_or_else(|| wrong(key, value, right))
}

pub(super) fn wrong(key: &str, value: &str, right: &str) -> Error {
    Error::Network(format!("metadata 'phasefront.{key}' is '{value}'; {right} is right"))
}
