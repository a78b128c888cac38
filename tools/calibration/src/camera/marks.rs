//! Detection of the modulator and the pattern in a photograph, using the marks and the code of
//! [`crate::camera::pattern`].
//!
//! The camera must be upright in front of the display, must not mirror the image, and must see the whole modulator,
//! which must fill at least 40 % of the photograph's width.

use crate::camera::homography::Homography;
use crate::camera::pattern::{CELLS, Pattern, decode};
use crate::camera::photograph::Photograph;
use ndarray::Array2;
use phasefront::Size;
use phasefront_io::Result;
use std::ops::Range;

/// A pixel of a dark square is darker than this fraction of the local light.
const DARKER: f32 = 0.55;
/// The minimum ratio of a frame's brightness to that of its dark square.
const FRAMED: f32 = 1.4;
/// A place on the modulator has nearby light of at least this fraction of the brightest light.
const LIT: f32 = 0.06;

/// The reason why no marks were found, and the expected photograph.
#[derive(Debug, Clone, PartialEq)]
pub enum NoMarks {
    /// The number of dark squares in bright frames, which is not four.
    Count(usize),
    /// The mark with the hole is here instead of at the top left.
    Turned(&'static str),
}

impl std::fmt::Display for NoMarks {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            NoMarks::Count(n) => write!(
                f,
                "shows {n} of the 4 corner marks; focus on the modulator, light it, have all of it in the picture"
            ),
            NoMarks::Turned(corner) => write!(
                f,
                "shows the mark with the hole at the {corner}; it must be at the top left: turn the picture, or mirror it"
            ),
        }
    }
}

/// The position of the modulator in photographs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Registration {
    /// The map from pixels of the modulator to pixels of the photograph.
    pub map: Homography,
    /// The centres of the marks in the photograph.
    pub marks: [[f64; 2]; 4],
    /// The number of photograph pixels per modulator pixel.
    pub zoom: f64,
}

impl Registration {
    /// Finds the marks of `pattern` in `photograph`.
    ///
    /// # Errors
    /// Returns an error if the marks are missing or not upright.
    pub fn find(photograph: &Photograph, pattern: &Pattern) -> std::result::Result<Self, NoMarks> {
        let marks = find_marks(photograph, pattern)?;
        let map = Homography::through(pattern.marks(), marks).map_err(|_| NoMarks::Count(4))?;
        let registration = Registration {
            map,
            marks,
            zoom: (marks[1][0] - marks[0][0]).hypot(marks[1][1] - marks[0][1])
                / (pattern.marks()[1][0] - pattern.marks()[0][0]),
        };
        // The hole is bright, and the centres of the other squares are dark.
        let quarter = pattern.square() as f64 / 4.0;
        let brightness = |[x, y]: [f64; 2]| registration.mean(photograph, x, y, quarter);
        let bright: [f32; 4] = pattern.marks().map(brightness);
        let ring = pattern.marks().map(|[x, y]| brightness([x, y - 3.0 * quarter]));
        let light = |i: usize| bright[i] / ring[i].max(f32::MIN_POSITIVE);
        let corners = ["top left", "top right", "bottom left", "bottom right"];
        let holed = (0..4).max_by(|a, b| light(*a).total_cmp(&light(*b)));
        match holed {
            Some(0) | None => Ok(registration),
            Some(i) => Err(NoMarks::Turned(corners[i])),
        }
    }

    /// Returns the mean offset of the four marks of `other` from these marks, in pixels of the photograph.
    pub fn shift(&self, other: &Self) -> [f64; 2] {
        let mean = |axis: usize| {
            let apart = (0..4).map(|i| other.marks[i][axis] - self.marks[i][axis]);
            apart.sum::<f64>() / 4.0
        };
        [mean(0), mean(1)]
    }

    /// Returns the mean of `photograph` over a square of the modulator that extends `half` pixels to each side of (`x`,
    /// `y`).
    fn mean(&self, photograph: &Photograph, x: f64, y: f64, half: f64) -> f32 {
        let n = (2.0 * half * self.zoom).ceil().clamp(2.0, 24.0) as usize;
        let at = |i: usize| half * ((2 * i + 1) as f64 / n as f64 - 1.0);
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..n {
                let [u, v] = self.map.map([x + at(i), y + at(j)]);
                sum += photograph.sample(u, v);
            }
        }
        sum / (n * n) as f32
    }

    /// Reads the pattern number from the code in `photograph`. Returns `None` if the code is unreadable.
    pub fn code(&self, photograph: &Photograph, pattern: &Pattern) -> Option<u8> {
        let half = pattern.cell() as f64 / 4.0;
        let (cells, between) = pattern.code();
        let light = |[x, y]: [f64; 2]| self.mean(photograph, x, y, half);
        let bright = between.map(light);
        let dark = light(cells[0]) / (0.5 * (bright[0] + bright[1]));
        let is_dark: [bool; CELLS] = std::array::from_fn(|i| {
            let part = light(cells[i]) / (0.5 * (bright[i] + bright[i + 1]));
            part < 0.5 * (1.0 + dark)
        });
        decode(is_dark)
    }

    /// Resamples `photograph` to the modulator's pixels, (H, W). Each value is the mean over a pixel, as a fraction of
    /// the sensor's range.
    pub fn resample(&self, photograph: &Photograph, Size { width, height }: Size) -> Array2<f32> {
        photograph.through(&self.map, self.zoom, Size { width, height })
    }

    /// Returns the light of `photograph` at the middle of each pixel of the modulator, (H, W), as a fraction of the
    /// sensor's range.
    pub fn centres(&self, photograph: &Photograph, Size { width, height }: Size) -> Array2<f32> {
        let scale = 1.0 / f32::from(photograph.full);
        Array2::from_shape_fn((height, width), |(y, x)| {
            let [u, v] = self.map.map([x as f64 + 0.5, y as f64 + 0.5]);
            photograph.sample(u, v) * scale
        })
    }

    /// Returns the median of the light around the modulator, as a fraction of the sensor's range. This is the ambient
    /// light.
    pub fn surroundings(&self, photograph: &Photograph, Size { width, height }: Size) -> f32 {
        let (h, w) = (height as f64, width as f64);
        let out = 0.03 * h.min(w);
        let mut values = Vec::new();
        for i in 0..=100 {
            let t = f64::from(i) / 100.0;
            for point in [[t * w, -out], [t * w, h + out], [-out, t * h], [w + out, t * h]] {
                let [u, v] = self.map.map(point);
                let inside =
                    (0.0..photograph.width as f64).contains(&u) && (0.0..photograph.height as f64).contains(&v);
                if inside {
                    values.push(photograph.sample(u, v) / f32::from(photograph.full));
                }
            }
        }
        values.sort_by(f32::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    }
}

/// A connected dark region: its bounding box with inclusive ends, and its number of pixels.
struct Spot {
    x: [usize; 2],
    y: [usize; 2],
    area: usize,
}

/// Returns the centres of the four marks' dark squares with subpixel accuracy.
fn find_marks(photograph: &Photograph, pattern: &Pattern) -> std::result::Result<[[f64; 2]; 4], NoMarks> {
    let widest = photograph.width as f64 / pattern.size().width as f64;
    let side = widest * pattern.square() as f64;
    let factor = ((side / 14.0) as usize).max(1);
    let (height, width, small) = photograph.shrunk(factor);
    if height < 16 || width < 16 {
        return Err(NoMarks::Count(0));
    }
    let small = blurred(&small, Size { width, height });
    let side = side / factor as f64;
    let most = local_maxima(&small, Size { width, height }, (1.5 * side).ceil() as usize);
    let mut sorted = small.clone();
    sorted.sort_by(f32::total_cmp);
    let (floor, top) = (sorted[sorted.len() / 200], sorted[sorted.len() * 199 / 200]);
    let lit = floor + LIT * (top - floor);
    let is_dark: Vec<bool> = (small.iter().zip(&most))
        .map(|(v, most)| *most < lit || v - floor < DARKER * (most - floor))
        .collect();
    let spots: Vec<_> = spots(&is_dark, Size { width, height })
        .into_iter()
        .filter(|spot| {
            let (w, h) = ((spot.x[1] + 1 - spot.x[0]) as f64, (spot.y[1] + 1 - spot.y[0]) as f64);
            let inside = spot.x[0] > 0 && spot.y[0] > 0 && spot.x[1] + 1 < width && spot.y[1] + 1 < height;
            inside
                && is_framed(spot, &small, width, floor)
                && (0.3 * side..1.4 * side).contains(&w.max(h))
                && w.min(h) > 0.6 * w.max(h)
                && spot.area as f64 > 0.5 * w * h
        })
        .collect();
    if spots.len() < 4 {
        return Err(NoMarks::Count(spots.len()));
    }
    let corner = |right: f64, down: f64| {
        let along = |s: &Spot| right * (s.x[0] + s.x[1]) as f64 + down * (s.y[0] + s.y[1]) as f64;
        spots
            .iter()
            .max_by(|a, b| along(a).total_cmp(&along(b)))
            .expect("four spots")
    };
    let marks = [
        corner(-1.0, -1.0),
        corner(1.0, -1.0),
        corner(-1.0, 1.0),
        corner(1.0, 1.0),
    ];
    let distinct = (0..4).filter(|i| !marks[..*i].iter().any(|m| std::ptr::eq(*m, marks[*i])));
    let distinct = distinct.count();
    if distinct < 4 {
        return Err(NoMarks::Count(distinct));
    }
    let areas = marks.map(|s| (s.x[1] + 1 - s.x[0]) * (s.y[1] + 1 - s.y[0]));
    let (least, largest) = areas.iter().fold((usize::MAX, 0), |(l, m), a| (l.min(*a), m.max(*a)));
    if largest > 3 * least {
        return Err(NoMarks::Count(areas.iter().filter(|a| 3 * **a >= largest).count()));
    }
    Ok(marks.map(|spot| centre(photograph, spot, factor)))
}

/// Checks whether a spot has a bright frame. Beyond each of its sides, a band of a quarter of its size must have a mean
/// that is much brighter than half of the spot's pixels. Single pixels are not reliable, because the frame is grainy
/// and a hole is bright.
fn is_framed(spot: &Spot, small: &[f32], width: usize, floor: f32) -> bool {
    let height = small.len() / width;
    let ([left, right], [top, bottom]) = (spot.x, spot.y);
    let values = |y: Range<usize>, x: Range<usize>| -> Vec<f32> {
        (y.flat_map(|y| &small[y * width..][x.clone()]).copied()).collect()
    };
    let mean = |y: Range<usize>, x: Range<usize>| -> f32 {
        let values = values(y, x);
        values.iter().sum::<f32>() / values.len() as f32 - floor
    };
    let (x, y) = (left..right + 1, top..bottom + 1);
    let (wide, tall) = (x.len().div_ceil(4), y.len().div_ceil(4));
    if left < wide || top < tall || right + wide >= width || bottom + tall >= height {
        return false;
    }
    let mut within = values(y.clone(), x.clone());
    within.sort_by(f32::total_cmp);
    let within = within[within.len() / 2] - floor;
    [
        mean(y.clone(), left - wide..left),
        mean(y, right + 1..right + 1 + wide),
        mean(top - tall..top, x.clone()),
        mean(bottom + 1..bottom + 1 + tall, x),
    ]
    .into_iter()
    .all(|beyond| beyond > FRAMED * within)
}

/// Returns the centre of a dark square in the full photograph, weighted by the darkness of its pixels.
fn centre(photograph: &Photograph, spot: &Spot, factor: usize) -> [f64; 2] {
    let grown = |[from, to]: [usize; 2], end: usize| {
        let (from, to) = (from * factor, (to + 1) * factor);
        let more = (to - from) / 4;
        (from.saturating_sub(more), (to + more).min(end))
    };
    let (x0, x1) = grown(spot.x, photograph.width);
    let (y0, y1) = grown(spot.y, photograph.height);
    let mut values: Vec<u16> = (y0..y1)
        .flat_map(|y| &photograph.values[y * photograph.width..][x0..x1])
        .copied()
        .collect();
    values.sort_unstable();
    let part = |percent: usize| f64::from(values[values.len() * percent / 100]);
    let (dark, bright) = (part(10), part(85));
    let (mut sum, mut sum_x, mut sum_y) = (0.0, 0.0, 0.0);
    for y in y0..y1 {
        for x in x0..x1 {
            let value = f64::from(photograph.values[y * photograph.width + x]);
            let darkness = (bright - value) / (bright - dark).max(1.0) - 0.3;
            let weight = darkness.clamp(0.0, 0.4);
            sum += weight;
            sum_x += weight * (x as f64 + 0.5);
            sum_y += weight * (y as f64 + 0.5);
        }
    }
    let sum = f64::max(sum, f64::MIN_POSITIVE);
    [sum_x / sum, sum_y / sum]
}

/// Returns the mean over 3×3 pixels, with the border pixels repeated outside.
fn blurred(plane: &[f32], size: Size) -> Vec<f32> {
    let Size { width, height } = size;
    let mut out = vec![0.0; plane.len()];
    for y in 0..height {
        for x in 0..width {
            let mut sum = 0.0;
            for v in [y.saturating_sub(1), y, (y + 1).min(height - 1)] {
                for u in [x.saturating_sub(1), x, (x + 1).min(width - 1)] {
                    sum += plane[v * width + u];
                }
            }
            out[y * width + x] = sum / 9.0;
        }
    }
    out
}

/// Returns the largest value within `radius` along both axes.
fn local_maxima(plane: &[f32], size: Size, radius: usize) -> Vec<f32> {
    let Size { width, height } = size;
    let along = |from: &[f32], length: usize, step: usize, start: usize, to: &mut [f32]| {
        for i in 0..length {
            let near = i.saturating_sub(radius)..(i + radius + 1).min(length);
            to[start + i * step] = near.map(|j| from[start + j * step]).fold(f32::NEG_INFINITY, f32::max);
        }
    };
    let mut rows = vec![0.0; plane.len()];
    (0..height).for_each(|y| along(plane, width, 1, y * width, &mut rows));
    let mut out = vec![0.0; plane.len()];
    (0..width).for_each(|x| along(&rows, height, width, x, &mut out));
    out
}

/// Returns the connected regions of `is_dark`, with four neighbours per pixel.
fn spots(is_dark: &[bool], size: Size) -> Vec<Spot> {
    let Size { width, height } = size;
    let mut seen = vec![false; is_dark.len()];
    let mut spots = Vec::new();
    let mut open = Vec::new();
    for start in 0..is_dark.len() {
        if !is_dark[start] || seen[start] {
            continue;
        }
        seen[start] = true;
        open.push(start);
        let mut spot = Spot {
            x: [usize::MAX, 0],
            y: [usize::MAX, 0],
            area: 0,
        };
        while let Some(at) = open.pop() {
            let (y, x) = (at / width, at % width);
            spot.x = [spot.x[0].min(x), spot.x[1].max(x)];
            spot.y = [spot.y[0].min(y), spot.y[1].max(y)];
            spot.area += 1;
            let mut visit = |there: usize| {
                if is_dark[there] && !seen[there] {
                    seen[there] = true;
                    open.push(there);
                }
            };
            if x > 0 {
                visit(at - 1);
            }
            if x + 1 < width {
                visit(at + 1);
            }
            if y > 0 {
                visit(at - width);
            }
            if y + 1 < height {
                visit(at + width);
            }
        }
        spots.push(spot);
    }
    spots
}

/// Calls [`Registration::find`] and converts its error.
///
/// # Errors
/// Returns an error if the marks are missing or not upright.
pub fn register(photograph: &Photograph, pattern: &Pattern) -> Result<Registration> {
    Registration::find(photograph, pattern).map_err(|e| phasefront_io::Error::Input(format!("the photograph {e}")))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::simulated_display::SimulatedDisplay;
    use phasefront::Display;

    fn displays() -> Vec<(SimulatedDisplay, Pattern)> {
        [
            ("width = 144\nheight = 96", 2.0),
            ("width = 320\nheight = 180", 3.3),
            ("width = 320\nheight = 180", 2.5),
            ("width = 144\nheight = 64", 1.6),
        ]
        .into_iter()
        .enumerate()
        .map(|(seed, (size, zoom))| {
            let display = Display::from_toml(size).unwrap();
            let pattern = Pattern::new(display.size()).unwrap();
            (SimulatedDisplay::new(&display, zoom, seed as u64).unwrap(), pattern)
        })
        .collect()
    }

    /// Tests dark and bright patterns in all three colours. Patterns in which red is darkest are the hardest.
    #[test]
    #[ignore = "slow: 12 seconds of a core"]
    fn marks_are_found_to_a_part_of_a_pixel_and_codes_are_read() {
        for (display, pattern) in displays() {
            let Size { width: w, height: h } = pattern.size();
            let (w, h) = (w as f64, h as f64);
            let panel = [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]];
            let truth = Homography::through(panel, display.camera().corners).unwrap();
            for k in (0..=255).step_by(17).chain(104..110) {
                for colour in 0..3 {
                    let photo = display
                        .photograph(pattern.frame(k).view(), colour, 0.0, k.into())
                        .unwrap();
                    let found = Registration::find(&photo, &pattern).unwrap();
                    for (mark, at) in pattern.marks().into_iter().zip(found.marks) {
                        let [x, y] = truth.map(mark);
                        let apart = (x - at[0]).hypot(y - at[1]);
                        assert!(apart < 0.4 * found.zoom, "{k} {colour}: {apart}");
                    }
                    assert_eq!(found.code(&photo, &pattern), Some(k));
                }
            }
        }
    }

    #[test]
    fn turned_and_empty_pictures_are_told() {
        let (display, pattern) = displays().remove(0);
        let mut photo = display.photograph(pattern.frame(0).view(), 1, 0.0, 0).unwrap();
        photo.values.reverse();
        let told = Registration::find(&photo, &pattern).unwrap_err();
        assert_eq!(told, NoMarks::Turned("bottom right"));
        photo.values.fill(900);
        let told = Registration::find(&photo, &pattern).unwrap_err();
        assert!(told.to_string().contains("of the 4 corner marks"), "{told}");
    }
}
