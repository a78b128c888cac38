//! The keys of a display's file, and messages about keys that are none: the nearest known key is named.

use crate::runtime::error::{Error, Result};

/// The keys of a [`crate::display::Display`].
pub const DISPLAY: [&str; 8] = [
    "width",
    "height",
    "pitch_um",
    "wavelengths_nm",
    "volume_depth_mm",
    "offset_mm",
    "bits",
    "aperture_radius",
];

/// The keys of a [`crate::output::modulator::ModulatorSpec`] beside [`DISPLAY`].
pub const DEVICE: [&str; 9] = [
    "name",
    "packing",
    "flip_x",
    "flip_y",
    "levels_turns",
    "range_turns",
    "rate_hz",
    "sources",
    "unconfirmed",
];

/// Checks that every key of `table` is one of `known`.
///
/// # Errors
/// The first that is not, with the nearest that is.
pub fn check(table: &toml::Table, known: &[&str]) -> Result<()> {
    match table.keys().find(|key| !known.contains(&key.as_str())) {
        None => Ok(()),
        Some(key) => Err(Error::Display(unknown(key, known))),
    }
}

/// What an error of the TOML reader says, in one line; for an unknown key the nearest known one instead of all.
pub fn message(error: &toml::de::Error) -> String {
    let message = error.message().trim().replace('\n', " ");
    let message = message.trim_start_matches("display: ");
    let parts = message
        .strip_prefix("unknown field `")
        .and_then(|rest| rest.rsplit_once("`, expected "));
    match parts {
        None => message.to_owned(),
        // Of "one of `a`, `b`" every second part is a key.
        Some((key, known)) => unknown(key, &known.split('`').skip(1).step_by(2).collect::<Vec<_>>()),
    }
}

/// That `key` is none of `known`, and which it could be.
fn unknown(key: &str, known: &[&str]) -> String {
    let mut nearest: Vec<_> = known.iter().map(|other| (distance(key, other), *other)).collect();
    nearest.sort();
    match nearest[..] {
        [(away, other), ..] if away <= 1 + key.chars().count() / 3 => {
            format!("unknown key `{key}`; did you mean `{other}`?")
        }
        [] => format!("unknown key `{key}`; there is none here"),
        _ => {
            let three: Vec<_> = nearest.iter().take(3).map(|(_, other)| format!("`{other}`")).collect();
            format!("unknown key `{key}`; the nearest known keys are {}", three.join(", "))
        }
    }
}

/// Characters that must be put in, left out or changed to make `b` of `a`; 1 where one of them holds the other.
fn distance(a: &str, b: &str) -> usize {
    let [a, b] = [a, b].map(str::to_lowercase);
    if a.len().min(b.len()) >= 3 && (a.contains(&b) || b.contains(&a)) {
        return usize::from(a != b);
    }
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().enumerate() {
        let mut before = std::mem::replace(&mut row[0], i + 1);
        for (j, to) in b.iter().enumerate() {
            let changed = before + usize::from(from != *to);
            before = row[j + 1];
            row[j + 1] = changed.min(before + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::display::Display;
    use std::collections::BTreeSet;

    #[test]
    fn a_wrong_key_is_named_with_the_nearest_right_one() {
        for (wrong, right) in [
            ("pitch_mm", "pitch_um"),
            ("pitch", "pitch_um"),
            ("Width", "width"),
            ("wavelength_nm", "wavelengths_nm"),
            ("depth_mm", "volume_depth_mm"),
            ("widht", "width"),
            ("range_turn", "range_turns"),
        ] {
            let message = unknown(wrong, &[&DISPLAY[..], &DEVICE].concat());
            assert_eq!(message, format!("unknown key `{wrong}`; did you mean `{right}`?"));
        }
        let far = unknown("manufacturer", &DISPLAY);
        assert!(far.contains("manufacturer") && far.matches('`').count() == 8, "{far}");
    }

    #[test]
    fn the_keys_are_those_of_the_form() {
        let table = toml::Table::try_from(Display::default()).unwrap();
        let form: BTreeSet<_> = table.keys().map(String::as_str).collect();
        assert_eq!(form, BTreeSet::from(DISPLAY));
    }
}
