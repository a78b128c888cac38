//! The link from computer to modulator: a pattern that shows how cable, driver and converter change pixels, and its
//! reading from a captured image. Limited range, YCbCr, scaled pixels and tone curves all ruin phase.
//!
//! The pattern has six bands of equal height. From top to bottom, they are ramps of grey, red, green and blue with 256
//! steps from left to right, then one-pixel columns of black and white, then one-pixel columns of red and green.

use phasefront::Size;
use phasefront_io::hologram::packed::{Image, Kind};
use serde::Serialize;

const BANDS: usize = 6;
const STEPS: usize = 256;

/// The effects of a link on pixels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reading {
    /// The width and height of the capture, then of the pattern, if they differ.
    pub size: Option<[usize; 4]>,
    /// The range of the arriving grey levels.
    pub range: Range,
    /// The mean and the largest error of grey levels, after correcting for the range.
    pub grey_error: [f64; 2],
    /// The mean and the largest error of the red, green and blue ramps in all three channels, after correcting for the
    /// range.
    pub colour_error: [f64; 2],
    /// The contrast of one-pixel columns of black and white; 1 if it is complete.
    pub fine_grey: f64,
    /// The contrast of one-pixel columns of red and green.
    pub fine_colour: f64,
    /// The faults, each with a remedy; empty if every pixel arrives unchanged.
    pub faults: Vec<String>,
}

/// The range in which grey levels 0 to 255 arrive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Range {
    /// 0 to 255, unchanged.
    Full,
    /// 16 to 235: full levels on a limited link.
    Limited,
    /// 16 to 235 arrive as 0 to 255 and the levels beyond are lost: full levels were taken for limited ones.
    Expanded,
    /// Another range.
    Other,
}

/// Makes the pattern of a size.
pub fn pattern(Size { width, height }: Size) -> Image {
    let mut bytes = Vec::with_capacity(3 * height * width);
    for y in 0..height {
        for x in 0..width {
            bytes.extend(pixel((y, x), Size { width, height }));
        }
    }
    Image {
        size: Size { width, height },
        bytes,
        kind: Kind::Rgb,
    }
}

fn pixel((y, x): (usize, usize), Size { width, height }: Size) -> [u8; 3] {
    let step = (x * STEPS / width) as u8;
    match y * BANDS / height {
        0 => [step; 3],
        1 => [step, 0, 0],
        2 => [0, step, 0],
        3 => [0, 0, step],
        4 => [if x % 2 == 0 { 0 } else { 255 }; 3],
        _ if x % 2 == 0 => [255, 0, 0],
        _ => [0, 255, 0],
    }
}

/// Reads a capture of the pattern of the size `sent`. A capture of another size is read and reported as scaled.
pub fn read(capture: &Image, sent: Size) -> Reading {
    let seen = Seen { capture };
    let ramps: [Vec<[f64; 3]>; 4] = std::array::from_fn(|band| seen.ramp(band));
    let grey: Vec<f64> = ramps[0].iter().map(|rgb| rgb.iter().sum::<f64>() / 3.0).collect();
    let (range, grey_error) = range(&grey);
    let colour_error = colour_error(&ramps, range);
    let (fine_grey, fine_colour) = seen.fine(range);
    let scaled = (capture.size != sent).then_some([capture.size.width, capture.size.height, sent.width, sent.height]);
    let mut reading = Reading {
        size: scaled,
        range,
        grey_error,
        colour_error,
        fine_grey,
        fine_colour,
        faults: Vec::new(),
    };
    reading.faults = reading.faults();
    reading
}

impl Reading {
    fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        if let Some([width, height, sent_width, sent_height]) = self.size {
            faults.push(format!(
                "scaled: {width}×{height} arrive of {sent_width}×{sent_height}; set the screen to the modulator's own resolution"
            ));
        } else if self.fine_grey < 0.9 {
            faults.push(format!(
                "scaled or sharpened: columns of one pixel keep {:.0} % of their contrast; set the screen to the modulator's own resolution and 100 %",
                100.0 * self.fine_grey
            ));
        }
        match self.range {
            Range::Full => {}
            Range::Limited => {
                faults.push("limited range: levels 0 to 255 arrive as 16 to 235; set the driver's output to full range".into());
            }
            Range::Expanded => faults.push(
                "full range taken for limited: levels under 16 and over 235 are lost; set the driver's output to full range"
                    .into(),
            ),
            Range::Other => faults.push(format!(
                "a tone curve: grey levels are off by {:.1} on average, {:.0} at most; take gamma, night light and colour profiles away",
                self.grey_error[0], self.grey_error[1]
            )),
        }
        let colour_lost = self.fine_colour < 0.75 * self.fine_grey;
        if colour_lost {
            faults.push(format!(
                "YCbCr with fewer colours than pixels: red and green columns of one pixel keep {:.0} % of their contrast; set the driver's output to RGB",
                100.0 * self.fine_colour
            ));
        } else if self.range != Range::Other && self.colour_error[1] > self.grey_error[1] + 1.5 {
            faults.push(format!(
                "YCbCr or a colour profile: levels of pure colours are off by up to {:.0}; set the driver's output to RGB",
                self.colour_error[1]
            ));
        }
        if faults.is_empty() && self.grey_error[1].max(self.colour_error[1]) >= 0.5 {
            faults.push(format!(
                "levels are off by up to {:.1}: dithering, compression or noise of the capture",
                self.grey_error[1].max(self.colour_error[1])
            ));
        }
        faults
    }
}

/// A capture, addressed by places in the pattern.
struct Seen<'a> {
    capture: &'a Image,
}

impl Seen<'_> {
    fn rgb(&self, y: usize, x: usize) -> [f64; 3] {
        let at = y * self.capture.size.width + x;
        match self.capture.kind {
            Kind::Rgb => std::array::from_fn(|c| f64::from(self.capture.bytes[3 * at + c])),
            Kind::Grey => [f64::from(self.capture.bytes[at]); 3],
            Kind::Grey16 => {
                let word = u16::from_be_bytes([self.capture.bytes[2 * at], self.capture.bytes[2 * at + 1]]);
                [f64::from(word) / 257.0; 3]
            }
        }
    }

    /// Returns the rows in the middle of a band, away from its neighbours.
    fn rows(&self, band: usize) -> std::ops::Range<usize> {
        let height = self.capture.size.height;
        let (first, last) = (band * height / BANDS, (band + 1) * height / BANDS);
        let margin = (last - first) / 4;
        first + margin..(last - margin).max(first + margin + 1).min(height)
    }

    /// Returns the mean colour of each step of a ramp, from the step's middle column.
    fn ramp(&self, band: usize) -> Vec<[f64; 3]> {
        let width = self.capture.size.width;
        (0..STEPS)
            .map(|step| {
                let x = ((2 * step + 1) * width / (2 * STEPS)).min(width - 1);
                let rows = self.rows(band);
                let count = rows.len() as f64;
                let sum = rows.fold([0.0; 3], |sum: [f64; 3], y| {
                    let rgb = self.rgb(y, x);
                    std::array::from_fn(|c| sum[c] + rgb[c])
                });
                sum.map(|sum| sum / count)
            })
            .collect()
    }

    /// Returns the remaining contrast of one-pixel columns: of black and white, and of red and green.
    fn fine(&self, range: Range) -> (f64, f64) {
        let whole = if range == Range::Limited { 219.0 } else { 255.0 };
        let contrast = |band: usize, value: fn([f64; 3]) -> f64| {
            let (mut sum, mut count) = (0.0, 0.0);
            for y in self.rows(band) {
                for x in (0..self.capture.size.width.saturating_sub(1)).step_by(2) {
                    sum += value(self.rgb(y, x + 1)) - value(self.rgb(y, x));
                    count += 1.0;
                }
            }
            if count > 0.0 { sum / count / whole } else { 0.0 }
        };
        let grey = contrast(4, |rgb| rgb.iter().sum::<f64>() / 3.0);
        let colour = contrast(5, |[red, green, _]| (green - red) / 2.0);
        (grey.abs(), colour.abs())
    }
}

/// Returns the arriving level of `step` on a link of `range`.
fn arrives(range: Range, step: f64) -> f64 {
    match range {
        Range::Limited => 16.0 + step * 219.0 / 255.0,
        Range::Expanded => ((step - 16.0) * 255.0 / 219.0).clamp(0.0, 255.0),
        Range::Full | Range::Other => step,
    }
}

/// Returns the mean and the largest distance between the two values of each pair.
fn errors(values: impl Iterator<Item = (f64, f64)>) -> [f64; 2] {
    let (mut sum, mut most, mut count) = (0.0f64, 0.0f64, 0.0f64);
    for (value, want) in values {
        sum += (value - want).abs();
        most = most.max((value - want).abs());
        count += 1.0;
    }
    [sum / count.max(1.0), most]
}

fn range(grey: &[f64]) -> (Range, [f64; 2]) {
    let with = |range| {
        errors(
            grey.iter()
                .enumerate()
                .map(|(step, value)| (*value, arrives(range, step as f64))),
        )
    };
    let candidates = [Range::Full, Range::Limited, Range::Expanded].map(|range| (range, with(range)));
    let best = candidates
        .into_iter()
        .fold((Range::Other, [f64::INFINITY; 2]), |best, of| {
            if of.1[0] < best.1[0] { of } else { best }
        });
    // Rounding on a link stays below this error; a tone curve exceeds it.
    if best.1[0] <= 2.0 {
        best
    } else {
        (Range::Other, with(Range::Full))
    }
}

fn colour_error(ramps: &[Vec<[f64; 3]>; 4], range: Range) -> [f64; 2] {
    let values = (1..4).flat_map(|band| {
        ramps[band].iter().enumerate().flat_map(move |(step, rgb)| {
            (0..3).map(move |c| {
                let sent = if c + 1 == band { step as f64 } else { 0.0 };
                (rgb[c], arrives(range, sent))
            })
        })
    });
    errors(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size { width: 640, height: 96 };

    /// Makes the pattern as it arrives through `link`.
    fn through(link: impl Fn([f64; 3]) -> [f64; 3]) -> Image {
        let mut image = pattern(SIZE);
        for pixel in image.bytes.as_chunks_mut::<3>().0 {
            *pixel = link(pixel.map(f64::from)).map(|v| v.round().clamp(0.0, 255.0) as u8);
        }
        image
    }

    /// Converts RGB to full-range BT.709 YCbCr.
    fn to_ycbcr([r, g, b]: [f64; 3]) -> [f64; 3] {
        let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
        [y, (b - y) / 1.8556 + 128.0, (r - y) / 1.5748 + 128.0]
    }

    fn from_ycbcr([y, cb, cr]: [f64; 3]) -> [f64; 3] {
        let (cb, cr) = (cb - 128.0, cr - 128.0);
        [y + 1.5748 * cr, y - 0.1873 * cb - 0.4681 * cr, y + 1.8556 * cb]
    }

    /// Makes the pattern as it arrives in 8-bit YCbCr whose colours are shared by two pixels (4:2:2), or not (4:4:4).
    fn ycbcr(pixels: usize) -> Image {
        let mut image = pattern(SIZE);
        for run in image.bytes.chunks_exact_mut(3 * pixels) {
            let all: Vec<[f64; 3]> = run
                .as_chunks::<3>()
                .0
                .iter()
                .map(|p| to_ycbcr(p.map(f64::from)))
                .collect();
            let mean = |c: usize| (all.iter().map(|v| v[c]).sum::<f64>() / pixels as f64).round();
            for (pixel, ycbcr) in run.as_chunks_mut::<3>().0.iter_mut().zip(&all) {
                let rgb = from_ycbcr([ycbcr[0].round(), mean(1), mean(2)]);
                *pixel = rgb.map(|v| v.round().clamp(0.0, 255.0) as u8);
            }
        }
        image
    }

    fn faults(capture: &Image) -> String {
        read(capture, SIZE).faults.join("; ")
    }

    #[test]
    fn a_link_that_changes_nothing_has_no_fault() {
        let reading = read(&pattern(SIZE), SIZE);
        assert_eq!(reading.range, Range::Full);
        assert_eq!(reading.faults, Vec::<String>::new());
        assert!(reading.fine_grey == 1.0 && reading.fine_colour == 1.0);
        assert!(reading.grey_error[1] == 0.0 && reading.colour_error[1] == 0.0);
    }

    /// Checks both faults: a source that sends limited levels, and a screen that expects them.
    #[test]
    fn limited_range_is_found_both_ways() {
        let squeezed = through(|p| p.map(|v| 16.0 + v * 219.0 / 255.0));
        let reading = read(&squeezed, SIZE);
        assert_eq!(reading.range, Range::Limited);
        assert!(
            reading.faults.len() == 1 && reading.faults[0].starts_with("limited range:"),
            "{:?}",
            reading.faults
        );
        let clipped = through(|p| p.map(|v| (v - 16.0) * 255.0 / 219.0));
        let reading = read(&clipped, SIZE);
        assert_eq!(reading.range, Range::Expanded);
        assert!(
            reading.faults.len() == 1 && reading.faults[0].starts_with("full range taken for limited:"),
            "{:?}",
            reading.faults
        );
    }

    #[test]
    fn ycbcr_is_found_with_and_without_subsampling() {
        let found = faults(&ycbcr(2));
        assert!(found.contains("fewer colours") && !found.contains("scaled"), "{found}");
        let found = faults(&ycbcr(1));
        assert!(found.contains("off by") && !found.contains("fewer colours"), "{found}");
    }

    #[test]
    fn scaled_pixels_are_found() {
        let whole = pattern(SIZE);
        // A capture of another size.
        let larger = pattern(Size {
            width: SIZE.width + 64,
            height: SIZE.height,
        });
        assert!(faults(&larger).contains("704×96 arrive of 640×96"));
        // Scaled to 90 % and back on the way, as by a screen that is not at its own resolution.
        let mut blurred = whole.clone();
        let width = SIZE.width;
        let at = |row: &[u8], x: f64, c: usize| {
            let (left, part) = (x.floor() as usize, x.fract());
            let value = |x: usize| f64::from(row[3 * x.min(width - 1) + c]);
            value(left) * (1.0 - part) + value(left + 1) * part
        };
        let small = width * 9 / 10;
        for row in blurred.bytes.chunks_exact_mut(3 * width) {
            let once: Vec<u8> = (0..3 * small)
                .map(|i| at(row, (i / 3) as f64 / 0.9, i % 3).round() as u8)
                .collect();
            let once: Vec<u8> = once
                .iter()
                .copied()
                .chain(std::iter::repeat_n(0, 3 * (width - small)))
                .collect();
            for (i, value) in row.iter_mut().enumerate() {
                *value = at(&once, ((i / 3) as f64 * 0.9).min(small as f64 - 1.0), i % 3).round() as u8;
            }
        }
        assert!(faults(&blurred).contains("one pixel keep"), "{}", faults(&blurred));
    }

    #[test]
    fn tone_curves_are_found() {
        let bent = through(|p| p.map(|v| 255.0 * (v / 255.0).powf(1.2)));
        assert!(faults(&bent).contains("tone curve"), "{}", faults(&bent));
    }
}
