//! The colours of a display's lasers: what X, Y and Z each shows at full light, from its wavelength and the balance of
//! the three.

mod observer;

use crate::runtime::error::{Error, Result};

/// The chromaticity x, y of CIE standard illuminant D65, the white of sRGB, Display P3 and BT.2020.
pub const D65: [f64; 2] = [0.3127, 0.329];

/// A 3 × 3 matrix, row by row.
pub type Matrix = [[f64; 3]; 3];

/// How much light the three lasers give, relative to each other, when each shows its full amplitude.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Balance {
    /// Unknown. All three together are taken for D65.
    #[default]
    Unknown,
    /// All three together have this chromaticity x, y.
    White([f64; 2]),
    /// The radiant powers, on any scale, as a power meter reads them.
    Powers([f64; 3]),
    /// X, Y and Z of each laser, on any scale, as a colorimeter reads them.
    Primaries([[f64; 3]; 3]),
}

impl Balance {
    /// Checks that the numbers can be those of three lasers.
    pub(super) fn check(&self, lasers: usize) -> Result<()> {
        let refuse = |what: String| Err(Error::Display(what));
        if lasers != 3 && *self != Balance::Unknown {
            return refuse("white, powers and primaries are for three lasers; one laser needs none".into());
        }
        match self {
            Balance::Unknown => Ok(()),
            Balance::White([x, y]) if *x > 0.0 && *y > 0.0 && x + y < 1.0 => Ok(()),
            Balance::White([x, y]) => refuse(format!(
                "white is [{x}, {y}]; it is the chromaticity x, y of the light of all lasers, for example [0.3127, 0.329]"
            )),
            Balance::Powers(powers) if powers.iter().all(|p| p.is_finite() && *p > 0.0) => Ok(()),
            Balance::Powers([r, g, b]) => refuse(format!("powers is [{r}, {g}, {b}]; each must be above 0")),
            Balance::Primaries(rows) => {
                let positive = rows.iter().flatten().all(|v| v.is_finite() && *v >= 0.0);
                match inverse(rows) {
                    Some(_) if positive => Ok(()),
                    _ => refuse(
                        "primaries are X, Y, Z of red, of green and of blue; none may be negative, and no laser's colour a mixture of the others'"
                            .into(),
                    ),
                }
            }
        }
    }

    /// Returns X, Y and Z (rows) of red, green and blue (columns) at full light, scaled so that the brightest D65 that
    /// they mix has Y = 1. Returns `None` if they cannot mix it: a laser is invisible or two are alike.
    pub(super) fn primaries(&self, wavelengths_m: &[f64]) -> Option<Matrix> {
        let columns = match self {
            Balance::Primaries(rows) => transposed(rows),
            _ => {
                let &[red, green, blue] = wavelengths_m else {
                    return None;
                };
                let pure = transposed(&[observer::xyz(red)?, observer::xyz(green)?, observer::xyz(blue)?]);
                let powers = match self {
                    Balance::Powers(powers) => *powers,
                    Balance::White(xy) => mixture(&pure, white(*xy))?,
                    _ => mixture(&pure, white(D65))?,
                };
                pure.map(|row| std::array::from_fn(|laser| row[laser] * powers[laser]))
            }
        };
        let shares = mixture(&columns, white(D65))?;
        let most = shares.iter().copied().fold(0.0, f64::max);
        Some(columns.map(|row| row.map(|v| v * most)))
    }
}

/// Returns X, Y and Z of a white of chromaticity x, y with Y = 1.
pub fn white([x, y]: [f64; 2]) -> [f64; 3] {
    [x / y, 1.0, (1.0 - x - y) / y]
}

/// Returns how much of each of three primaries, the columns of `primaries`, makes `light`, or `None` if they cannot
/// make it of positive parts.
fn mixture(primaries: &Matrix, light: [f64; 3]) -> Option<[f64; 3]> {
    let parts = times(&inverse(primaries)?, light);
    parts
        .iter()
        .all(|part| part.is_finite() && *part > 0.0)
        .then_some(parts)
}

/// Multiplies a matrix and a vector.
pub fn times(matrix: &Matrix, vector: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row.iter().zip(vector).map(|(a, b)| a * b).sum())
}

/// Multiplies two matrices.
pub fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let columns = transposed(b);
    a.map(|row| columns.map(|column| row.iter().zip(column).map(|(a, b)| a * b).sum()))
}

/// Exchanges rows and columns.
pub fn transposed(m: &Matrix) -> Matrix {
    std::array::from_fn(|row| std::array::from_fn(|column| m[column][row]))
}

/// Inverts a matrix by its adjugate. Returns `None` if it is singular.
pub fn inverse(m: &Matrix) -> Option<Matrix> {
    let cross = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let adjugate = transposed(&[cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])]);
    let determinant: f64 = m[0].iter().zip(cross(m[1], m[2])).map(|(a, b)| a * b).sum();
    let size: f64 = m
        .iter()
        .map(|row| row.iter().map(|v| v * v).sum::<f64>().sqrt())
        .product();
    (determinant.abs() > 1e-9 * size).then(|| adjugate.map(|row| row.map(|v| v / determinant)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::display::Display;

    fn display(toml: &str) -> Display {
        Display::from_toml(toml).unwrap()
    }

    fn assert_near(a: [f64; 3], b: [f64; 3]) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 2e-3), "{a:?} {b:?}");
    }

    /// The powers for D65 come from the standard's table of 1 nm: 1 : 0.691 : 0.398.
    #[test]
    fn three_lasers_mix_d65() {
        let known = display("").primaries().unwrap();
        assert_near(times(&known, [1.0; 3]), white(D65));
        let balanced = display("powers = [1.0, 0.691, 0.398]").primaries().unwrap();
        assert_near(times(&balanced, [1.0; 3]), white(D65));
        let white_known = display("white = [0.3127, 0.329]").primaries().unwrap();
        assert_near(times(&white_known, [1.0; 3]), white(D65));
        // Lasers of equal power: red limits the brightest D65.
        let equal = display("powers = [5, 5, 5]").primaries().unwrap();
        let shares = times(&inverse(&equal).unwrap(), white(D65));
        assert_near(shares, [1.0, 0.691, 0.398]);
        // A colorimeter's readings of the same lasers say the same.
        let rows = transposed(&equal).map(|row| row.map(|v| v * 37.0));
        let toml = format!("primaries = {rows:?}");
        let measured = display(&toml).primaries().unwrap();
        assert_near(times(&inverse(&measured).unwrap(), white(D65)), shares);
    }

    #[test]
    fn lasers_that_mix_no_white_have_no_primaries() {
        for toml in [
            "wavelengths_nm = [532]",
            "wavelengths_nm = [532, 532, 532]",
            "wavelengths_nm = [1550, 532, 450]",
            "wavelengths_nm = [660, 638, 600]",
        ] {
            assert_eq!(display(toml).primaries(), None, "{toml}");
        }
    }

    #[test]
    fn impossible_balances_are_named() {
        for (toml, word) in [
            ("wavelengths_nm = [532]\nwhite = [0.3127, 0.329]", "one laser"),
            ("white = [0.7, 0.5]", "chromaticity"),
            ("powers = [1, 0, 1]", "above 0"),
            ("primaries = [[1, 1, 1], [1, 1, 1], [0, 0, 1]]", "mixture"),
            (
                "white = [0.3127, 0.329]\npowers = [1, 1, 1]",
                "one of white, powers and primaries",
            ),
        ] {
            let message = Display::from_toml(toml).unwrap_err().to_string();
            assert!(message.contains(word), "{toml}: {message}");
            assert!(!message.contains('\n'), "{message}");
        }
        for toml in ["white = [0.29, 0.31]", "powers = [12.0, 8.1, 6.0]"] {
            let display = display(toml);
            let again = toml::to_string(&display).unwrap();
            assert_eq!(self::display(&again), display);
        }
        assert!(!toml::to_string(&Display::default()).unwrap().contains("white"));
    }
}
