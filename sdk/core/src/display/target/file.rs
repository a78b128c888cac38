//! The calibration file, which stores a target in one file for an app. `phasefront calibrate pack` writes it from the
//! results of a calibration.
//!
//! The file contains `PFCALIB1`, the length of a TOML text as u32, the text, the lasers' gains as f32, (C, Gh, Gw), the
//! flatness maps as u16, (1 or 3, H, W), the bytes of the learned model, and those of the per-pixel table. All numbers
//! are little-endian.

use super::Target;
use crate::display::Display;
use crate::display::illumination::Illumination;
use crate::display::model::Model;
use crate::display::panel::{Flatness, Panel};
use crate::display::registration::Registration;
use crate::display::response::Response;
use crate::display::response::per_pixel::PerPixel;
use crate::optics::zernike::{Aberration, Coefficients};
use crate::runtime::error::{Error, Result};
use crate::runtime::keys;
use ndarray::ArrayView3;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

const MAGIC: &[u8; 8] = b"PFCALIB1";
/// The largest number of nodes of a laser map along an axis.
const MOST_NODES: usize = 65536;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    lut: Option<Vec<u8>>,
    /// The number of bytes of the per-pixel table.
    #[serde(default)]
    per_pixel: usize,
    /// The number of bytes of the learned model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    model: Option<usize>,
    /// The grid of the laser map, Gh and Gw.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    laser: Option<[usize; 2]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    correction: Option<Vec<Coefficients>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    carrier_rad: Option<[f64; 2]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    lens_m: Option<f64>,
    /// The number of flatness maps: none, one for all colours, or one for each.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    flatness: Option<usize>,
    /// The phases of the levels. They define the response if the file has no other response.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    levels_turns: Option<Vec<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    shift_px: Option<Vec<[f64; 2]>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    scale: Option<Vec<f64>>,
    display: Display,
}

fn refuse(what: impl std::fmt::Display) -> Error {
    Error::Setting(format!("calibration file: {what}"))
}

/// Returns the response of a file with `header` and the bytes of a per-pixel `table`.
fn response(header: &Header, table: &[u8]) -> Result<Response> {
    match (&header.lut, table) {
        (None, []) => match &header.levels_turns {
            None => Ok(Target::from(&header.display).response),
            Some(turns) => Response::of_turns(turns),
        },
        (Some(levels), []) => {
            let levels = levels.as_slice().try_into().map_err(|_| {
                refuse(format!(
                    "holds {} levels of a look-up table; there are 256",
                    levels.len()
                ))
            })?;
            Ok(Response::lut(levels))
        }
        (None, table) => Ok(Response::PerPixel(Arc::new(PerPixel::from_bytes(table)?))),
        (Some(_), _) => Err(refuse("holds both a table and one for each pixel")),
    }
}

impl Target {
    /// Reads a target from the bytes of a file.
    ///
    /// # Errors
    /// Returns an error if the bytes are not a valid calibration file or are incomplete, a value is invalid, or a table
    /// is for another display.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let short = || refuse("is cut short");
        let rest = bytes
            .strip_prefix(MAGIC.as_slice())
            .ok_or_else(|| refuse("does not begin with PFCALIB1; `phasefront calibrate pack` writes one"))?;
        let (length, rest) = rest.split_first_chunk().ok_or_else(short)?;
        let length = u32::from_le_bytes(*length) as usize;
        let (text, rest) = rest.split_at_checked(length).ok_or_else(short)?;
        let text = std::str::from_utf8(text).map_err(refuse)?;
        let header: Header = toml::from_str(text).map_err(|e| refuse(keys::message(&e)))?;
        let [rows, columns] = header.laser.unwrap_or_default();
        if rows > MOST_NODES || columns > MOST_NODES {
            return Err(refuse(format!("holds a laser's map of {columns}×{rows}")));
        }
        let maps = header.flatness.unwrap_or_default();
        if maps > 3 {
            return Err(refuse(format!("holds {maps} flatness maps; there are at most 3")));
        }
        let colours = header.display.colours();
        let (laser, rest) = (rest.split_at_checked(4 * colours * rows * columns)).ok_or_else(short)?;
        let modulator = header.display.size();
        let values = maps * modulator.height * modulator.width;
        let (flatness, rest) = rest.split_at_checked(2 * values).ok_or_else(short)?;
        let (model, table) = (rest.split_at_checked(header.model.unwrap_or_default())).ok_or_else(short)?;
        if table.len() != header.per_pixel {
            return Err(refuse(format!(
                "holds {} bytes of a table, its header says {}",
                table.len(),
                header.per_pixel
            )));
        }
        let illumination = match header.laser {
            None => None,
            Some(_) => {
                let amplitude: Vec<f32> = (laser.chunks_exact(4))
                    .map(|b| 1.0 / f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                    .collect();
                let amplitude = ArrayView3::from_shape((colours, rows, columns), &amplitude).map_err(refuse)?;
                Some(Illumination::new(amplitude)?)
            }
        };
        let response = response(&header, table)?;
        let target = Target {
            display: header.display,
            response,
            illumination,
            correction: header.correction.map(Aberration::new).transpose()?,
            panel: Panel {
                carrier_rad: header.carrier_rad.unwrap_or_default(),
                lens_m: header.lens_m,
                flatness: match flatness.as_chunks().0 {
                    [] => None,
                    maps => Some(Flatness::new(
                        modulator,
                        maps.iter().map(|b| u16::from_le_bytes(*b)).collect(),
                    )?),
                },
                levels_turns: header.levels_turns,
            },
            registration: Registration {
                shift_px: header.shift_px.unwrap_or_default(),
                scale: header.scale.unwrap_or_default(),
            },
            model: match header.model {
                None => None,
                Some(_) => Some(Model::from_bytes(model).map_err(refuse)?.into()),
            },
        };
        target.check().map_err(refuse)?;
        Ok(target)
    }

    /// Returns the bytes of the file.
    ///
    /// # Errors
    /// Returns an error if the target is invalid, as [`Self::from_bytes`] would.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        self.check()?;
        let Panel {
            carrier_rad,
            lens_m,
            flatness,
            levels_turns,
        } = &self.panel;
        let of_levels = levels_turns.as_deref().map(Response::of_turns).transpose()?;
        let (lut, table) = match &self.response {
            Response::Linear { .. } => (None, vec![]),
            response if of_levels.as_ref() == Some(response) => (None, vec![]),
            Response::Lut { level, .. } => (Some(level.to_vec()), vec![]),
            Response::PerPixel(table) => (None, table.to_bytes()),
        };
        let model = self.model.as_ref().map(|model| model.to_bytes());
        let header = Header {
            lut,
            per_pixel: table.len(),
            model: model.as_ref().map(Vec::len),
            laser: (self.illumination.as_ref()).map(|light| [light.nodes().0, light.nodes().1]),
            correction: (self.correction.as_ref()).map(|correction| correction.coefficients().to_vec()),
            carrier_rad: Some(*carrier_rad).filter(|rad| *rad != [0.0; 2]),
            lens_m: *lens_m,
            flatness: flatness
                .as_ref()
                .map(|flatness| flatness.maps().len() / (flatness.size().height * flatness.size().width)),
            levels_turns: levels_turns.clone(),
            shift_px: Some(self.registration.shift_px.clone()).filter(|shift| !shift.is_empty()),
            scale: Some(self.registration.scale.clone()).filter(|scale| !scale.is_empty()),
            display: self.display.clone(),
        };
        let text = toml::to_string(&header).map_err(refuse)?;
        let mut bytes = MAGIC.to_vec();
        bytes.extend((text.len() as u32).to_le_bytes());
        bytes.extend(text.as_bytes());
        let gains = self.illumination.iter().flat_map(Illumination::gains);
        bytes.extend(gains.flat_map(|gain| gain.to_le_bytes()));
        let maps = flatness.iter().flat_map(|flatness| flatness.maps());
        bytes.extend(maps.flat_map(|turns| turns.to_le_bytes()));
        bytes.extend(model.into_iter().flatten());
        bytes.extend(table);
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::Size;
    use crate::display::model::ColourModel;
    use crate::display::response::per_pixel::nodes;
    use ndarray::Array3;

    fn calibration() -> Target {
        calibration_of("[638, 520, 450]")
    }

    fn calibration_of(wavelengths_nm: &str) -> Target {
        let text = format!("width = 40\nheight = 24\noffset_mm = 3.5\nwavelengths_nm = {wavelengths_nm}");
        let display = Display::from_toml(&text).unwrap();
        let colours = display.colours();
        let (rows, columns) = nodes(Size { width: 40, height: 24 }, 16);
        let levels: Vec<f32> = (0..colours * rows * columns)
            .flat_map(|node| (0..=4).map(move |k| (node % 7) as f32 + 50.0 * k as f32))
            .collect();
        let turns = vec![6.0; colours * rows * columns];
        let table = PerPixel::new(Size { width: 40, height: 24 }, 16, 4, &levels, &turns).unwrap();
        let amplitude = Array3::from_shape_fn((colours, 2, 5), |(c, y, x)| 1.0 - 0.03 * (c + y * x) as f32);
        Target {
            display,
            response: Response::PerPixel(Arc::new(table)),
            illumination: Some(Illumination::new(amplitude.view()).unwrap()),
            correction: Some(Aberration::new(vec![[0.1, -2.0, 0.0, 0.25, 1e-9]; colours]).unwrap()),
            panel: Panel {
                carrier_rad: [0.01, -0.002],
                lens_m: Some(0.5),
                flatness: Some(
                    Flatness::new(Size { width: 40, height: 24 }, (0..960).map(|i| 64 * i).collect()).unwrap(),
                ),
                levels_turns: None,
            },
            registration: Registration {
                shift_px: [[0.5, 0.0], [0.0, 0.0], [-1.0, 2.25]][..colours].into(),
                scale: [1.001, 1.0, 0.998][..colours].into(),
            },
            model: None,
        }
    }

    #[test]
    fn what_is_written_is_read() {
        for wavelengths_nm in ["[638, 520, 450]", "[532]"] {
            is_read(&calibration_of(wavelengths_nm));
        }
    }

    fn is_read(want: &Target) {
        let bytes = want.to_bytes().unwrap();
        let got = Target::from_bytes(&bytes).unwrap();
        assert_eq!(got.display, want.display);
        assert_eq!(got.response, want.response);
        assert_eq!(got.correction, want.correction);
        assert_eq!(got.panel, want.panel);
        assert_eq!(got.registration, want.registration);
        let gains = |of: &Target| of.illumination.as_ref().unwrap().gains().to_vec();
        assert_eq!(gains(&got).len(), 10 * want.display.colours());
        for (got, want) in gains(&got).iter().zip(gains(want)) {
            assert!((got / want - 1.0).abs() < 1e-6);
        }
        for response in [
            Response::lut(std::array::from_fn(|i| 255 - i as u8)),
            Response::linear(8).unwrap(),
        ] {
            let plain = Target {
                response: response.clone(),
                illumination: None,
                correction: None,
                ..want.clone()
            };
            let got = Target::from_bytes(&plain.to_bytes().unwrap()).unwrap();
            assert_eq!(got.response, response);
            assert!(got.illumination.is_none() && got.correction.is_none());
        }
        // A learned model comes before the table.
        let nodes = (2, 3);
        let models = vec![ColourModel::ideal(nodes); want.display.colours()];
        let modelled = Target {
            model: Some(Model::new(nodes, models).unwrap().into()),
            panel: Panel::default(),
            ..want.clone()
        };
        let got = Target::from_bytes(&modelled.to_bytes().unwrap()).unwrap();
        assert_eq!(
            (got.model, got.response),
            (modelled.model.clone(), modelled.response.clone())
        );
        let with_lens = Target {
            panel: want.panel.clone(),
            ..modelled
        };
        let error = with_lens.to_bytes().unwrap_err().to_string();
        assert!(error.contains("without carrier, lens"), "{error}");
        // The response follows from the phases of the levels.
        let turns = [0.0, 0.1, 0.4, 0.8];
        let of_levels = Target {
            response: Response::of_turns(&turns).unwrap(),
            panel: Panel {
                levels_turns: Some(turns.into()),
                ..Panel::default()
            },
            ..Target::from(&want.display)
        };
        let got = Target::from_bytes(&of_levels.to_bytes().unwrap()).unwrap();
        assert_eq!((got.response, got.panel), (of_levels.response, of_levels.panel));
    }

    #[test]
    fn damaged_files_are_refused() {
        let bytes = calibration().to_bytes().unwrap();
        for length in 0..bytes.len() {
            assert!(Target::from_bytes(&bytes[..length]).is_err(), "{length}");
        }
        let mut long = bytes.clone();
        long.push(0);
        assert!(Target::from_bytes(&long).is_err());
        // A header that declares a laser map larger than any memory.
        let text = "laser = [60000, 60000]\n[display]\n";
        let mut huge = MAGIC.to_vec();
        huge.extend((text.len() as u32).to_le_bytes());
        huge.extend(text.as_bytes());
        let error = Target::from_bytes(&huge).unwrap_err().to_string();
        assert!(error.contains("cut short"), "{error}");
        let one = Display::from_toml("width = 40\nheight = 24\nwavelengths_nm = [532]").unwrap();
        for (word, other) in [
            ("the per-pixel table has 3 colours, the display 1", calibration()),
            (
                "the laser's map has 3 colours, the display 1",
                Target {
                    response: Response::Linear { bits: 8 },
                    ..calibration()
                },
            ),
        ] {
            let other = Target {
                display: one.clone(),
                ..other
            };
            let error = other.to_bytes().unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
        let other = Target {
            display: Display::default(),
            ..calibration()
        };
        let error = other.to_bytes().unwrap_err().to_string();
        assert!(error.contains("40×24"), "{error}");
        // A file whose display was changed by hand is refused too.
        let plain = Target {
            panel: Panel::default(),
            ..calibration()
        };
        let bytes = plain.to_bytes().unwrap();
        let at = bytes.windows(10).position(|part| part == b"width = 40").unwrap();
        let mut changed = bytes.clone();
        changed[at..at + 10].copy_from_slice(b"width = 48");
        let error = Target::from_bytes(&changed).unwrap_err().to_string();
        assert!(error.contains("40×24"), "{error}");
    }
}
