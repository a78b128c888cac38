//! `phasefront calibrate white`: the balance of a display's lasers from readings of a meter.

use super::Told;
use clap::{ArgGroup, Args};
use phasefront::target::Balance;
use phasefront_calibration::white::{self, Meaning, Rehearsal};
use phasefront_command::flags::DisplayFlags;
use phasefront_io::{Error, Result};
use serde_json::json;

/// Balance three lasers: what a power meter or colorimeter reads of each becomes the display's white
///
/// Show full light, a white picture, and read each laser alone. The result is a line for the display's file, with which
/// pictures have their own colours on these lasers.
#[derive(Args)]
#[command(group = ArgGroup::new("reading").required(true))]
pub(crate) struct White {
    #[command(flatten)]
    display: DisplayFlags,
    /// Radiant powers of red, green and blue, in any unit
    #[arg(long, value_name = "R,G,B", value_parser = three, group = "reading")]
    powers: Option<[f64; 3]>,
    /// Chromaticity of the light of all lasers together
    #[arg(long, value_name = "X,Y", value_parser = two, group = "reading")]
    xy: Option<[f64; 2]>,
    /// X, Y and Z of red, of green and of blue, in any unit
    #[arg(long, value_name = "X,Y,Z", value_parser = three, num_args = 3, group = "reading")]
    primaries: Option<Vec<[f64; 3]>>,
    /// Simulate lasers of unknown powers and a power meter that errs by 2 %, with this seed
    #[arg(long, value_name = "SEED", group = "reading")]
    rehearse: Option<u64>,
}

fn numbers<const N: usize>(text: &str) -> std::result::Result<[f64; N], String> {
    let all: std::result::Result<Vec<f64>, _> = text.split(',').map(|number| number.trim().parse()).collect();
    let all = all.map_err(|e| format!("{text}: {e}"))?;
    all.try_into()
        .map_err(|_| format!("{text}: {N} numbers with commas between are needed"))
}

fn three(text: &str) -> std::result::Result<[f64; 3], String> {
    numbers(text)
}

fn two(text: &str) -> std::result::Result<[f64; 2], String> {
    numbers(text)
}

impl White {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        let display = self.display.read_of_three()?.target.display;
        if let Some(seed) = self.rehearse {
            told(&white::rehearse(&display, seed)?).print(json);
            return Ok(());
        }
        let (line, balance) = match (&self.powers, &self.xy, self.primaries.as_deref()) {
            (Some(powers), ..) => (format!("powers = {powers:?}"), Balance::Powers(*powers)),
            (_, Some(white), _) => (format!("white = {white:?}"), Balance::White(*white)),
            (_, _, Some(&[red, green, blue])) => {
                let rows = [red, green, blue];
                (format!("primaries = {rows:?}"), Balance::Primaries(rows))
            }
            _ => {
                return Err(Error::Usage(
                    "a reading is needed: --powers, --xy or --primaries".into(),
                ));
            }
        };
        let display = display.with_balance(balance)?;
        let Meaning {
            white: [x, y],
            from_d65,
            shares,
            luminance,
        } = white::meaning(&display)?;
        let [red, green, blue] = shares.map(|share| 100.0 * share);
        Told {
            value: json!({
                "toml": line, "white": [x, y], "ciede2000_from_d65": from_d65, "shares": shares, "luminance": luminance,
            }),
            table: format!(
                "All lasers together have the chromaticity {x:.4}, {y:.4}, {from_d65:.1} from D65 in CIEDE2000.\nD65 takes {red:.0} % of red, {green:.0} % of green and {blue:.0} % of blue: {:.0} % of their luminance.\nLasers turned down to these shares lose nothing. The display's file needs this line:\n",
                100.0 * luminance
            ),
            line,
        }
        .print(json);
        Ok(())
    }
}

fn told(rehearsal: &Rehearsal) -> Told {
    let Rehearsal {
        powers,
        readings,
        before,
        after,
    } = rehearsal;
    let three = |values: &[f64; 3]| values.map(|v| format!("{v:.3}")).join(", ");
    Told {
        value: json!({"powers": powers, "readings": readings, "before": before, "after": after}),
        table: format!("Powers {}, read as {}.\n", three(powers), three(readings)),
        line: format!(
            "CIEDE2000 of a ColorChecker: mean {:.1} and at most {:.1} before, {:.1} and {:.1} with the readings",
            before[0], before[1], after[0], after[1]
        ),
    }
}
