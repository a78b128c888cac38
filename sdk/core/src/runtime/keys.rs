//! The keys of display files, and messages that name the nearest known key for an unknown one.

use crate::runtime::error::{Error, Result};

/// The keys of a [`crate::display::Display`].
pub const DISPLAY: [&str; 11] = [
    "width",
    "height",
    "pitch_um",
    "wavelengths_nm",
    "volume_depth_mm",
    "offset_mm",
    "bits",
    "aperture_radius",
    "white",
    "powers",
    "primaries",
];

/// The keys that a [`crate::output::modulator::ModulatorSpec`] has in addition to [`DISPLAY`].
pub const DEVICE: [&str; 10] = [
    "device",
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
/// Returns an error that names the first unknown key and the nearest known keys.
pub fn check(table: &toml::Table, known: &[&str]) -> Result<()> {
    match table.keys().find(|key| !known.contains(&key.as_str())) {
        None => Ok(()),
        Some(key) => Err(Error::Display(unknown(key, known))),
    }
}

/// The names of types in messages of serde, and what TOML calls them.
const TYPES: [(&str, &str); 6] = [
    ("usize", "a whole number from 0"),
    ("u32", "a whole number from 0"),
    ("u8", "a whole number from 0"),
    ("f64", "a number"),
    ("a sequence", "a list"),
    ("a boolean", "true or false"),
];

/// Returns the message of a TOML error in one line, with the key that it is about if that is known. For an unknown key,
/// it names the nearest known keys instead of all.
pub fn message(error: &toml::de::Error) -> String {
    let message = error.message().trim().replace('\n', " ");
    let message = message.trim_start_matches("display: ");
    let of_type = |(kind, plain): (&str, &str)| {
        Some(format!(
            "{}expected {plain}",
            message.strip_suffix(&format!("expected {kind}"))?
        ))
    };
    let all = error.to_string();
    let key = all
        .lines()
        .find_map(|line| line.strip_prefix("in `")?.strip_suffix('`'));
    let of_key = |message: String| match key {
        Some(key) if !message.contains(key) => format!("{key}: {message}"),
        _ => message,
    };
    if let Some(message) = TYPES.into_iter().find_map(of_type) {
        return of_key(message);
    }
    let parts = message
        .strip_prefix("unknown field `")
        .and_then(|rest| rest.rsplit_once("`, expected "));
    match parts {
        None => of_key(message.to_owned()),
        // In "one of `a`, `b`", every second part is a key.
        Some((key, known)) => unknown(key, &known.split('`').skip(1).step_by(2).collect::<Vec<_>>()),
    }
}

/// Returns a message that `key` is not one of `known`, with the nearest known keys.
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

/// Returns the number of characters to insert, delete or replace to turn `a` into `b`, ignoring case; 1 if one contains
/// the other.
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
        // One of the last three at most.
        let balances = [
            "white = [0.31, 0.33]",
            "powers = [1, 1, 1]",
            "primaries = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]",
        ];
        let tables = balances.map(|toml| toml::Table::try_from(Display::from_toml(toml).unwrap()).unwrap());
        let form: BTreeSet<_> = tables
            .iter()
            .flat_map(|table| table.keys())
            .map(String::as_str)
            .collect();
        assert_eq!(form, BTreeSet::from(DISPLAY));
    }
}
