//! The metadata of a network of any form. `docs/own-networks.md` has the table.

use super::super::metadata::{TrainedDisplay, found, number, numbers, wrong};
use super::super::proto::Entry;
use crate::runtime::error::{Error, Result};
use num_complex::Complex32;

/// What a network takes and gives.
#[derive(Debug, Clone)]
pub(in super::super) struct Contract {
    /// The planes in the order of the input's channels: 0 to 2 red, green and blue, 3 depth.
    pub(super) planes: Vec<usize>,
    /// The values of darkness and of full light.
    pub(super) colour_range: [f32; 2],
    /// The values of the nearest and of the farthest depth.
    pub(super) depth_range: [f32; 2],
    pub(super) output: Output,
    /// The number that must divide both sides of the input.
    pub(super) multiple: usize,
    /// The number of colours in the output: 3 or 1.
    pub(super) colours: usize,
}

/// What the output planes are. All colours' first parts stand before all second parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Output {
    RealImaginary,
    /// Amplitudes and phases in radians.
    AmplitudePhase,
    /// Phases of the modulator in radians.
    Phase,
}

impl Output {
    const ALL: [Self; 3] = [Output::RealImaginary, Output::AmplitudePhase, Output::Phase];

    pub(super) fn name(self) -> &'static str {
        match self {
            Output::RealImaginary => "real-imaginary",
            Output::AmplitudePhase => "amplitude-phase",
            Output::Phase => "phase",
        }
    }

    /// Returns the number of planes for `colours`, and what they are.
    pub(super) fn needs(self, colours: usize) -> (usize, &'static str) {
        match self {
            Output::RealImaginary => (2 * colours, "the real part of each colour, then the imaginary parts"),
            Output::AmplitudePhase => (2 * colours, "the amplitude of each colour, then the phases"),
            Output::Phase => (colours, "the phase of each colour"),
        }
    }

    /// Writes a row of the field. `part` returns a row of the first or second planes.
    pub(super) fn write<'a>(self, part: impl Fn(usize) -> &'a [f32], field: &mut [Complex32]) {
        let first = part(0);
        match self {
            Output::Phase => {
                let values = field.iter_mut().zip(first);
                values.for_each(|(to, phase)| *to = Complex32::from_polar(1.0, *phase));
            }
            Output::RealImaginary => {
                let values = field.iter_mut().zip(first.iter().zip(part(1)));
                values.for_each(|(to, (re, im))| *to = Complex32::new(*re, *im));
            }
            Output::AmplitudePhase => {
                let values = field.iter_mut().zip(first.iter().zip(part(1)));
                values.for_each(|(to, (amplitude, phase))| *to = Complex32::from_polar(*amplitude, *phase));
            }
        }
    }
}

const OUTPUTS: &str = "'real-imaginary', 'amplitude-phase' or 'phase'";
const PLANES: &str = "'red,green,blue,depth' in the order of the input, or 'amplitude,depth' for one laser,";
/// The keys that a file needs, each with what is right.
const NEEDED: [(&str, &str); 5] = [
    ("planes", "red,green,blue,depth"),
    ("pitch_um", "8"),
    ("wavelengths_nm", "638,520,450"),
    ("volume_depth_mm", "6"),
    ("offset_mm", "0"),
];
/// The largest number that sides can be multiples of.
const MOST_MULTIPLE: usize = 1024;

/// Reads the metadata.
///
/// # Errors
/// Returns [`Error::Network`] with all keys that are missing, or with the value that is wrong and what is right.
pub(in super::super) fn read(metadata: &[Entry]) -> Result<(Contract, TrainedDisplay)> {
    let output = found(metadata, "output").unwrap_or_default();
    let output = (Output::ALL.into_iter().find(|known| known.name() == output))
        .ok_or_else(|| wrong("output", output, OUTPUTS))?;
    let missing: Vec<String> = (NEEDED.iter().filter(|(key, _)| found(metadata, key).is_none()))
        .map(|(key, example)| format!("'phasefront.{key}' (such as '{example}')"))
        .collect();
    if !missing.is_empty() {
        return Err(Error::Network(format!(
            "metadata is missing: {}; docs/own-networks.md has the keys",
            missing.join(", ")
        )));
    }
    let positive = |v: &f64| *v > 0.0;
    let lasers = found(metadata, "wavelengths_nm").map_or(0, |text| text.split(',').count());
    let wavelengths_m = match lasers {
        1 => [number(metadata, "wavelengths_nm", "'520' or '638,520,450' in nm", positive)?; 3],
        _ => numbers::<3>(metadata, "wavelengths_nm", "'520' or '638,520,450' in nm", positive)?,
    }
    .map(|nm| nm * 1e-9);
    let colours = if lasers == 1 { 1 } else { 3 };
    let display = TrainedDisplay {
        pitch_m: number(metadata, "pitch_um", "a number in µm such as '8.0'", positive)? * 1e-6,
        wavelengths_m,
        volume_depth_m: number(metadata, "volume_depth_mm", "a number in mm such as '6.0'", positive)? * 1e-3,
        offset_m: number(metadata, "offset_mm", "a number in mm such as '0'", |v| v.is_finite())? * 1e-3,
        corrected: false,
    };
    let multiple = match found(metadata, "multiple") {
        None => 1,
        Some(text) => (text.parse().ok())
            .filter(|n| (1..=MOST_MULTIPLE).contains(n))
            .ok_or_else(|| wrong("multiple", text, &format!("a whole number from 1 to {MOST_MULTIPLE}")))?,
    };
    let contract = Contract {
        planes: planes(metadata, colours)?,
        colour_range: range(metadata, "colour_range")?,
        depth_range: range(metadata, "depth_range")?,
        output,
        multiple,
        colours,
    };
    Ok((contract, display))
}

fn planes(metadata: &[Entry], colours: usize) -> Result<Vec<usize>> {
    let text = found(metadata, "planes").unwrap_or_default();
    let plane = |name: &str| match (name.trim(), colours) {
        ("red", 3) | ("amplitude", 1) => Some(0),
        ("green", 3) => Some(1),
        ("blue", 3) => Some(2),
        ("depth", _) => Some(3),
        _ => None,
    };
    let planes: Option<Vec<usize>> = text.split(',').map(plane).collect();
    let is_whole = |planes: &Vec<usize>| {
        let mut sorted = planes.clone();
        sorted.sort_unstable();
        sorted.dedup();
        sorted.len() == planes.len() && (0..colours).all(|colour| planes.contains(&colour))
    };
    planes.filter(is_whole).ok_or_else(|| wrong("planes", text, PLANES))
}

fn range(metadata: &[Entry], key: &str) -> Result<[f32; 2]> {
    if found(metadata, key).is_none() {
        return Ok([0.0, 1.0]);
    }
    let right = "two numbers, those of 0 and of 1, such as '-1,1',";
    numbers::<2>(metadata, key, right, |v| v.abs() <= 1e6).map(|pair| pair.map(|v| v as f32))
}
