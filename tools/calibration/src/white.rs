//! The balance of three lasers: what their readings say of the display's white, and what the picture's colours are
//! worth with and without it.

use phasefront::input::RgbEncoding;
use phasefront::target::Balance;
use phasefront::{Display, Error, Result};
use phasefront_core::display::primaries::{D65, inverse, times, white};
use phasefront_core::frame::LightPlan;
use phasefront_io::dice::Dice;

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

/// Converts X, Y and Z, relative to D65 of Y = 1, to CIE L*, a* and b*.
pub fn lab(xyz: [f64; 3]) -> [f64; 3] {
    let to = white(D65);
    let f = |t: f64| {
        if t > 216.0 / 24389.0 {
            t.cbrt()
        } else {
            (24389.0 / 27.0 * t + 16.0) / 116.0
        }
    };
    let [x, y, z] = [0, 1, 2].map(|i| f(xyz[i].max(0.0) / to[i]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Returns the colour difference CIEDE2000 of two colours in L*, a* and b* (CIE 142-2001; Sharma, Wu and Dalal, 2005).
pub fn ciede2000(a: [f64; 3], b: [f64; 3]) -> f64 {
    let chroma = |c: [f64; 3]| c[1].hypot(c[2]);
    let high = |c: f64| (c.powi(7) / (c.powi(7) + 25f64.powi(7))).sqrt();
    let stretch = 1.0 + 0.5 * (1.0 - high((chroma(a) + chroma(b)) / 2.0));
    let polar = |c: [f64; 3]| {
        let x = stretch * c[1];
        (x.hypot(c[2]), c[2].atan2(x).to_degrees().rem_euclid(360.0))
    };
    let ((c1, h1), (c2, h2)) = (polar(a), polar(b));
    let grey = c1 * c2 == 0.0;
    let turn = match h2 - h1 {
        _ if grey => 0.0,
        turn if turn > 180.0 => turn - 360.0,
        turn if turn < -180.0 => turn + 360.0,
        turn => turn,
    };
    let hue = match h1 + h2 {
        sum if grey => sum,
        sum if (h1 - h2).abs() <= 180.0 => sum / 2.0,
        sum if sum < 360.0 => sum / 2.0 + 180.0,
        sum => sum / 2.0 - 180.0,
    };
    let (lightness, chroma) = ((a[0] + b[0]) / 2.0, (c1 + c2) / 2.0);
    let cos = |degrees: f64| degrees.to_radians().cos();
    let t = 1.0 - 0.17 * cos(hue - 30.0) + 0.24 * cos(2.0 * hue) + 0.32 * cos(3.0 * hue + 6.0)
        - 0.2 * cos(4.0 * hue - 63.0);
    let offset = (lightness - 50.0).powi(2);
    let l = (b[0] - a[0]) / (1.0 + 0.015 * offset / (20.0 + offset).sqrt());
    let c = (c2 - c1) / (1.0 + 0.045 * chroma);
    let h = 2.0 * (c1 * c2).sqrt() * (turn / 2.0).to_radians().sin() / (1.0 + 0.015 * chroma * t);
    let angle = 60.0 * (-((hue - 275.0) / 25.0).powi(2)).exp();
    let rotation = -2.0 * high(chroma) * angle.to_radians().sin();
    (l * l + c * c + h * h + rotation * c * h).sqrt()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Test data of Sharma, Wu and Dalal.
    #[test]
    fn ciede2000_is_as_published() {
        for (a, b, right) in [
            ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
            ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
            ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
            ([60.2574, -34.0099, 36.2677], [60.4626, -34.1751, 39.4387], 1.2644),
            ([22.7233, 20.0904, -46.694], [23.0331, 14.973, -42.5619], 2.0373),
            ([2.0776, 0.0795, -1.135], [0.9033, -0.0636, -0.5514], 0.9082),
        ] {
            assert!((ciede2000(a, b) - right).abs() < 1e-4, "{a:?} {b:?}");
            assert!((ciede2000(b, a) - right).abs() < 1e-4, "{b:?} {a:?}");
        }
    }

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
