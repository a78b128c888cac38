//! What happens to lines of one pixel: resampling, filters, and colours that neighbours share.

use super::pattern::{HIGH, LOW, Part};
use super::shot::Seen;

/// The remaining contrast of one-pixel lines, and how much it differs from place to place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Contrast {
    pub(super) mean: f64,
    pub(super) spread: f64,
}

/// Returns the contrast of the lines of `part`, whose levels 64 and 192 arrive with the distance `whole`, or `None` if
/// too few lines are visible. The lines must be at their own places.
pub(super) fn contrast(seen: &Seen, part: Part, whole: f64) -> Option<Contrast> {
    let rows = matches!(part, Part::Rows | Part::ColourRows);
    let colour = matches!(part, Part::ColourColumns | Part::ColourRows);
    let length = if rows {
        seen.shot.size.height
    } else {
        seen.shot.size.width
    };
    let mut lines = vec![(0.0, 0.0); length];
    seen.each(part, |(y, x), _| {
        let (sum, count) = &mut lines[if rows { y } else { x }];
        let [red, green, _] = seen.shot.at(y, x).map(f64::from);
        *sum += if colour {
            (green - red) / 2.0
        } else {
            seen.shot.grey(y, x)
        };
        *count += 1.0;
    });
    let mut local: Vec<f64> = (lines.windows(2).enumerate())
        .filter(|(_, pair)| pair.iter().all(|(_, count)| *count > 0.0))
        .map(|(first, pair)| {
            let rise = (pair[1].0 / pair[1].1 - pair[0].0 / pair[0].1) / whole;
            if first.is_multiple_of(2) { rise } else { -rise }
        })
        .collect();
    if local.len() < 16 {
        return None;
    }
    let mean = local.iter().sum::<f64>() / local.len() as f64;
    local.sort_by(f64::total_cmp);
    let at = |part: f64| local[(part * (local.len() - 1) as f64) as usize];
    Some(Contrast {
        mean,
        spread: at(0.95) - at(0.05),
    })
}

/// The distance of the levels of fine lines.
pub(super) fn distance(curve: impl Fn(u8) -> f64) -> f64 {
    curve(HIGH) - curve(LOW)
}

/// The contrast of one-pixel lines, where they are at their own places.
pub(super) struct Lines {
    pub(super) columns: Option<Contrast>,
    pub(super) rows: Option<Contrast>,
    pub(super) colour_columns: Option<Contrast>,
    pub(super) colour_rows: Option<Contrast>,
}

/// What happened to one-pixel lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Change {
    Resampled,
    Blurred,
    Sharpened,
}

/// Returns what happened to lines of a contrast. Resampling changes it from place to place, a filter does not.
fn change(of: Option<Contrast>) -> Option<(Change, f64)> {
    let Contrast { mean, spread } = of?;
    let change = if spread > 0.06 {
        Change::Resampled
    } else if mean < 0.99 {
        Change::Blurred
    } else if mean > 1.01 {
        Change::Sharpened
    } else {
        return None;
    };
    Some((change, 100.0 * mean))
}

impl Lines {
    pub(super) fn faults(&self) -> Vec<String> {
        let (columns, rows) = (change(self.columns), change(self.rows));
        let mut faults = Vec::new();
        let resolution = "set the screen to the modulator's own resolution and 100 %";
        let filter = "take sharpness and picture improvement away in the driver and the converter";
        match (columns, rows) {
            (Some((Change::Sharpened, kept)), _) | (_, Some((Change::Sharpened, kept))) => faults.push(format!(
                "sharpening: lines of one pixel arrive with {kept:.0} % of their contrast; {filter}"
            )),
            (Some((x, kept_x)), Some((y, kept_y))) if x == y => {
                let name = match x {
                    Change::Resampled => "rows and columns resampled",
                    _ => "blur",
                };
                faults.push(format!(
                    "{name}: columns of one pixel keep {kept_x:.0} % of their contrast and rows {kept_y:.0} %; {resolution}"
                ));
            }
            _ => {
                for (change, line, blur) in [(columns, "columns", "horizontal blur"), (rows, "rows", "vertical blur")] {
                    match change {
                        None => {}
                        Some((Change::Resampled, kept)) => faults.push(format!(
                            "{line} resampled: {line} of one pixel keep {kept:.0} % of their contrast in the mean, and more in some places than in others; {resolution}"
                        )),
                        Some((_, kept)) => faults.push(format!(
                            "{blur}: {line} of one pixel keep {kept:.0} % of their contrast; {resolution}, and {filter}"
                        )),
                    }
                }
            }
        }
        faults
    }

    /// Returns the fault of a link that sends fewer colours than pixels, where lines of two colours lose what grey ones
    /// keep.
    pub(super) fn subsampled(&self) -> Option<String> {
        let lost = |grey: Option<Contrast>, colour: Option<Contrast>| matches!((grey, colour), (Some(grey), Some(colour)) if grey.mean > 0.2 && colour.mean < 0.75 * grey.mean);
        let form = match (
            lost(self.columns, self.colour_columns),
            lost(self.rows, self.colour_rows),
        ) {
            (true, true) => "4:2:0",
            (true, false) => "4:2:2",
            (false, true) => "4:4:0",
            (false, false) => return None,
        };
        Some(format!(
            "YCbCr {form}: neighbouring pixels share their colour; set the driver's output to RGB"
        ))
    }
}
