//! The balance of three lasers: what their readings say of the display's white, and what the picture's colours are
//! worth with and without it.

use phasefront::input::RgbEncoding;
use phasefront::target::Balance;
use phasefront::{Display, Error, Result};
use phasefront_core::display::primaries::{D65, inverse, times, white};
use phasefront_core::frame::LightPlan;
use phasefront_io::dice::Dice;
use phasefront_io::picture::difference::{ciede2000, lab};

/// The 24 patches of a ColorChecker in sRGB.
pub const CHECKER: [[u8; 3]; 24] = [
    [115, 82, 68],
    [194, 150, 130],
    [98, 122, 157],
    [87, 108, 67],
    [133, 128, 177],
    [103, 189, 170],
    [214, 126, 44],
    [80, 91, 166],
    [193, 90, 99],
    [94, 60, 108],
    [157, 188, 64],
    [224, 163, 46],
    [56, 61, 150],
    [70, 148, 73],
    [175, 54, 60],
    [231, 199, 31],
    [187, 86, 149],
    [8, 133, 161],
    [243, 243, 242],
    [200, 200, 200],
    [160, 160, 160],
    [122, 122, 121],
    [85, 85, 85],
    [52, 52, 52],
];

/// What a balance of three lasers means.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Meaning {
    /// The chromaticity x, y of all lasers at full light.
    pub white: [f64; 2],
    /// The difference of that white from D65 of the same luminance, in CIEDE2000.
    pub from_d65: f64,
    /// The share of each laser's light that D65 takes; the largest is 1.
    pub shares: [f64; 3],
    /// The luminance of that D65, relative to all lasers at full light.
    pub luminance: f64,
}

/// Returns what the balance of `display` means.
///
/// # Errors
/// Returns an error if the display has no three lasers that mix D65.
pub fn meaning(display: &Display) -> Result<Meaning> {
    let primaries = display.primaries().ok_or_else(|| {
        Error::Display("its lasers mix no white; three visible ones do, whose colours D65 lies between".into())
    })?;
    let [x, y, z] = times(&primaries, [1.0; 3]);
    let shares = inverse(&primaries).map_or([0.0; 3], |from_xyz| times(&from_xyz, white(D65)));
    Ok(Meaning {
        white: [x / (x + y + z), y / (x + y + z)],
        from_d65: ciede2000(lab([x / y, 1.0, z / y]), lab(white(D65))),
        shares,
        luminance: 1.0 / y,
    })
}

/// The result of a rehearsal.
#[derive(Debug, Clone, PartialEq)]
pub struct Rehearsal {
    /// The true powers of the simulated lasers.
    pub powers: [f64; 3],
    /// What the simulated power meter read.
    pub readings: [f64; 3],
    /// Mean and largest CIEDE2000 of a ColorChecker if nothing is known of the lasers.
    pub before: [f64; 2],
    /// The same with the readings.
    pub after: [f64; 2],
}

/// Simulates lasers of the wavelengths of `display` whose powers lie up to a factor of two beside those of D65, and a
/// power meter that errs by 2 %.
///
/// # Errors
/// Returns an error if the lasers mix no D65.
pub fn rehearse(display: &Display, seed: u64) -> Result<Rehearsal> {
    let mut dice = Dice::new(seed);
    let unknown = display.clone().with_balance(Balance::Unknown)?;
    let equal = display.clone().with_balance(Balance::Powers([1.0; 3]))?;
    let balanced = meaning(&equal)?.shares;
    let powers = balanced.map(|power| power * dice.log_range(0.5, 2.0));
    let readings = powers.map(|power| power * dice.range(0.98, 1.02));
    let truth = display.clone().with_balance(Balance::Powers(powers))?;
    let measured = display.clone().with_balance(Balance::Powers(readings))?;
    Ok(Rehearsal {
        powers,
        readings,
        before: errors(&unknown, &truth),
        after: errors(&measured, &truth),
    })
}

/// Returns the mean and the largest CIEDE2000 of a ColorChecker that was made for `known` and is displayed by `truth`,
/// relative to its own white patch's luminance, to which an eye adapts.
fn errors(known: &Display, truth: &Display) -> [f64; 2] {
    let (Some(plan), Some(lasers)) = (LightPlan::new(RgbEncoding::Srgb, known), truth.primaries()) else {
        return [f64::NAN; 2];
    };
    let seen = |rgb: [f64; 3]| {
        let mut amplitude = [0.0; 3];
        plan.convert(&rgb.map(|v| v as f32), &mut amplitude);
        times(&lasers, amplitude.map(|a| f64::from(a).powi(2)))
    };
    let most = seen([1.0; 3])[1];
    let all: Vec<f64> = (CHECKER.iter())
        .map(|patch| {
            let rgb = patch.map(|v| f64::from(v) / 255.0);
            let wanted = times(&RgbEncoding::Srgb.to_xyz(), rgb.map(|v| RgbEncoding::Srgb.light(v)));
            ciede2000(lab(seen(rgb).map(|v| v / most)), lab(wanted))
        })
        .collect();
    [
        all.iter().sum::<f64>() / all.len() as f64,
        all.iter().copied().fold(0.0, f64::max),
    ]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn balanced_lasers_lose_nothing_and_others_do() {
        let known = |toml: &str| meaning(&Display::from_toml(toml).unwrap());
        let right = known("powers = [1.0, 0.6912, 0.3981]").unwrap();
        assert!(right.from_d65 < 0.3 && right.luminance > 0.99, "{right:?}");
        let equal = known("powers = [1, 1, 1]").unwrap();
        assert!(equal.from_d65 > 10.0 && equal.luminance < 0.9, "{equal:?}");
        assert!(known("wavelengths_nm = [532]").is_err());
    }

    #[test]
    fn a_rehearsed_calibration_brings_the_colours_back() {
        for seed in 0..5 {
            let Rehearsal { before, after, .. } = rehearse(&Display::default(), seed).unwrap();
            assert!(
                before[0] > 3.0 * after[0] && after[0] < 1.0 && after[1] < 3.0,
                "{before:?} {after:?}"
            );
        }
    }
}
