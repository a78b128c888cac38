//! The link from computer to modulator: a pattern that shows how cable, driver and converter change pixels, and its
//! reading from a captured image. Each change of pixels ruins phase, and most of them look right to the eye.

mod geometry;
mod levels;
mod lines;
mod pattern;
mod place;
mod shot;

pub use levels::Range;
use levels::{Levels, Ramp};
use lines::{Contrast, Lines, contrast};
pub use pattern::pattern;
use pattern::{Layout, Part};
use phasefront::Size;
use phasefront_io::hologram::packed::Image;
use serde::Serialize;
use shot::{Seen, Shot};

/// The effects of a link on pixels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reading {
    /// The width and height of the capture, then of the pattern, if they differ.
    pub size: Option<[usize; 4]>,
    /// The enlargement along x and y; 1 if pixels keep their size.
    pub zoom: [f64; 2],
    /// How far the picture moves right and down, in pixels.
    pub shift_px: [f64; 2],
    /// The left and upper edge, width and height of what hides the pattern, in pixels of the capture.
    pub covered: Option<[usize; 4]>,
    /// The range of the arriving grey levels.
    pub range: Range,
    /// The number of bits in which levels arrive.
    pub bits: u32,
    /// The standard deviation of pixels that should be equal, in levels.
    pub noise: f64,
    /// The mean and the largest error of grey levels, after correcting for the range.
    pub grey_error: [f64; 2],
    /// The mean and the largest error of the red, green and blue ramps in all three channels, against the grey ramp.
    pub colour_error: [f64; 2],
    /// The contrast of one-pixel columns; 1 if it is complete, over 1 if they are sharpened. `None` if columns are not
    /// at their places.
    pub columns: Option<f64>,
    /// The contrast of one-pixel rows.
    pub rows: Option<f64>,
    /// The contrast of one-pixel columns of two colours.
    pub colour_columns: Option<f64>,
    /// The contrast of one-pixel rows of two colours.
    pub colour_rows: Option<f64>,
    /// The faults, each with a remedy after its name and a colon; empty if every pixel arrives unchanged.
    pub faults: Vec<String>,
}

/// Reads a capture of the pattern of the size `sent`. Returns `None` if the capture does not show the pattern.
pub fn read(capture: &Image, sent: Size) -> Option<Reading> {
    let layout = Layout { size: sent };
    let shot = Shot::from(capture);
    let turn = geometry::turn(&shot, layout)?;
    let upright = shot.turned_back(turn);
    let (x, y) = geometry::place(&upright, layout)?;
    let order = geometry::order(&Seen {
        shot: &upright,
        layout,
        x,
        y,
        cover: None,
    });
    let upright = upright.reordered(order.unwrap_or([0, 1, 2]));
    let mut seen = Seen {
        shot: &upright,
        layout,
        x,
        y,
        cover: None,
    };
    let curve = levels::first_curve(&std::array::from_fn(|colour| Ramp::of(&seen, colour)));
    seen.cover = geometry::cover(&seen, |level| curve[usize::from(level)]);
    let mut faults: Vec<String> = place::turn_fault(turn)
        .into_iter()
        .chain(place::order_fault(order))
        .collect();
    let mut reading = measured(&seen, order.is_some(), &mut faults);
    if turn.exchanged && reading.size.is_some() {
        reading.size = Some([shot.size.width, shot.size.height, sent.width, sent.height]);
    }
    reading.faults = faults;
    Some(reading)
}

/// Returns the mean of the curves of three channels.
fn mean_of(curves: &[Vec<f64>; 3]) -> Vec<f64> {
    (0..curves[0].len())
        .map(|step| curves.iter().map(|curve| curve[step]).sum::<f64>() / 3.0)
        .collect()
}

/// Measures an upright capture whose colours are in order, and adds its faults.
fn measured(seen: &Seen, coloured: bool, faults: &mut Vec<String>) -> Reading {
    let ramps: [Ramp; 4] = std::array::from_fn(|colour| Ramp::of(seen, colour));
    let curve = mean_of(&[0, 1, 2].map(|c| ramps[0].means(c)));
    let whole = lines::distance(|level| curve[usize::from(level)]);
    let (exact_x, exact_y) = (seen.x.is_exact(), seen.y.is_exact());
    let fine = |part: Part, exact: bool| exact.then(|| contrast(seen, part, whole)).flatten();
    let lines = Lines {
        columns: fine(Part::Columns, exact_x),
        rows: fine(Part::Rows, exact_y),
        colour_columns: fine(Part::ColourColumns, exact_x),
        colour_rows: fine(Part::ColourRows, exact_y),
    };
    let (noise, pixels) = ramps[0].noise();
    let levels = Levels {
        bits: ramps[0].bits(),
        // The mean distance of two means of `pixels` values, and what a resampled ramp adds.
        tolerance: 0.1 + 1.6 * noise * f64::sqrt(2.0 / f64::max(pixels, 1.0)),
        resampled: !(exact_x && exact_y),
        coloured,
    };
    let (range, grey_error) = levels::range(&ramps[0], levels.of_range());
    let colour_error = levels::colour_error(&ramps);
    faults.extend(place::axis_faults(&seen.x, &seen.y));
    faults.extend(seen.cover.map(|cover| place::cover_fault(cover, seen.shot.size)));
    faults.extend(lines.faults());
    let ycbcr = lines.subsampled().filter(|_| coloured);
    faults.extend(levels.faults(range, grey_error, colour_error, ycbcr.is_some()));
    faults.extend(ycbcr);
    if faults.is_empty() && grey_error[0] > levels.tolerance {
        faults.push(format!(
            "levels changed: grey levels are off by {:.1} on average, {:.0} at most; take colour profiles and dithering away",
            grey_error[0], grey_error[1]
        ));
    }
    let (from, to) = (seen.shot.size, seen.layout.size);
    let mean = |contrast: Option<Contrast>| contrast.map(|contrast| contrast.mean);
    Reading {
        size: (from != to).then_some([from.width, from.height, to.width, to.height]),
        zoom: [seen.x.enlargement(), seen.y.enlargement()],
        shift_px: [seen.x.shift, seen.y.shift],
        covered: (seen.cover).map(|cover| [cover.x, cover.y, cover.size.width, cover.size.height]),
        range,
        bits: levels.bits,
        noise,
        grey_error,
        colour_error,
        columns: mean(lines.columns),
        rows: mean(lines.rows),
        colour_columns: mean(lines.colour_columns),
        colour_rows: mean(lines.colour_rows),
        faults: Vec::new(),
    }
}

#[cfg(test)]
mod tests;
