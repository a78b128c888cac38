//! Checks of complex fields that come from elsewhere.

use crate::Bounds;
use crate::Size;
use crate::display::target::Target;
use crate::runtime::error::{Error, Result};
use num_complex::Complex32;

/// The largest amplitudes that are encoded. Beyond them, squares of amplitudes leave the range of an f32.
const MOST: std::ops::RangeInclusive<f32> = 1e-6..=1e6;

/// Checks that `field`, (C, H, W), can be encoded for `target`.
///
/// # Errors
/// Returns an error if the field has another number of values, is larger than the modulator, or has values that are
/// NaN or infinite, and if its largest amplitude is 0 or not in 10⁻⁶..=10⁶.
pub fn check(field: &[Complex32], size: Size, target: &Target) -> Result<()> {
    let (colours, modulator) = (target.display.colours(), target.modulator());
    let Size { width, height } = size;
    if height > modulator.height || width > modulator.width {
        return Err(Error::Frame(format!(
            "a field of {size} does not fit the modulator of {modulator}; crop it, or name its display"
        )));
    }
    let needed = height.checked_mul(width).and_then(|plane| plane.checked_mul(colours));
    if needed != Some(field.len()) {
        return Err(Error::Frame(format!(
            "a field of {} values; ({colours}, {height}, {width}) has {}",
            field.len(),
            needed.unwrap_or(usize::MAX)
        )));
    }
    if let Some(at) = field.iter().position(|value| !value.is_finite()) {
        let (y, x) = (at % (height * width) / width, at % width);
        return Err(Error::Frame(format!(
            "the field is {} at plane {}, row {y}, column {x}; every value must be finite",
            field[at],
            at / (height * width)
        )));
    }
    let most = field
        .iter()
        .map(|value| value.norm())
        .fold(0.0, |most, v| v.at_least(most));
    match most {
        0.0 => Err(Error::Frame("the field is dark: all of its values are 0".into())),
        most if !MOST.contains(&most) => Err(Error::Frame(format!(
            "the largest amplitude of the field is {most:e}; scale the field so that it lies in {:e}..={:e}",
            MOST.start(),
            MOST.end()
        ))),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::display::Display;

    #[test]
    fn fields_that_cannot_be_encoded_are_named() {
        let target = Target::from(Display::from_toml("width = 5\nheight = 3").unwrap());
        let field = vec![Complex32::ONE; 3 * 2 * 5];
        check(&field, Size { width: 5, height: 2 }, &target).unwrap();
        let with = |value: Complex32| {
            let mut field = field.clone();
            field[2 * 10 + 7] = value;
            field
        };
        for (field, size, words) in [
            (
                field.clone(),
                Size { width: 6, height: 2 },
                "6×2 does not fit the modulator of 5×3",
            ),
            (
                field.clone(),
                Size { width: 4, height: 2 },
                "30 values; (3, 2, 4) has 24",
            ),
            (
                with(Complex32::new(f32::NAN, 0.0)),
                Size { width: 5, height: 2 },
                "plane 2, row 1, column 2",
            ),
            (
                with(Complex32::new(0.0, f32::INFINITY)),
                Size { width: 5, height: 2 },
                "must be finite",
            ),
            (
                with(Complex32::new(3e7, 0.0)),
                Size { width: 5, height: 2 },
                "amplitude of the field is 3e7",
            ),
            (vec![Complex32::ZERO; 30], Size { width: 5, height: 2 }, "dark"),
            (Vec::new(), Size { width: 5, height: 0 }, "dark"),
        ] {
            let said = check(&field, size, &target).unwrap_err().to_string();
            assert!(said.contains(words), "no {words:?} in {said}");
        }
    }
}
