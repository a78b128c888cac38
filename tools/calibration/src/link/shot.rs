//! A captured picture of the pattern: its pixels, and where each pixel of the pattern lies in it.

use super::pattern::{Layout, Part};
use phasefront::Size;
use phasefront_io::hologram::packed::{Image, Kind};

/// The pixels of a capture.
#[derive(Debug, Clone)]
pub(super) struct Shot {
    pub(super) size: Size,
    rgb: Vec<[u8; 3]>,
}

impl From<&Image> for Shot {
    fn from(image: &Image) -> Self {
        let rgb = match image.kind {
            Kind::Rgb => image.bytes.as_chunks::<3>().0.to_vec(),
            Kind::Grey => image.bytes.iter().map(|grey| [*grey; 3]).collect(),
            // The high byte of each 16-bit value.
            Kind::Grey16 => image.bytes.iter().step_by(2).map(|grey| [*grey; 3]).collect(),
        };
        Shot { size: image.size, rgb }
    }
}

/// A way to turn or mirror a picture: first rows and columns are exchanged, then each axis may run the other way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Turn {
    pub(super) exchanged: bool,
    pub(super) flip_x: bool,
    pub(super) flip_y: bool,
}

impl Shot {
    pub(super) fn at(&self, y: usize, x: usize) -> [u8; 3] {
        self.rgb[y * self.size.width + x]
    }

    /// Returns the mean of red, green and blue.
    pub(super) fn grey(&self, y: usize, x: usize) -> f64 {
        self.at(y, x).iter().map(|value| f64::from(*value)).sum::<f64>() / 3.0
    }

    /// Returns the picture that becomes this one by `turn`.
    pub(super) fn turned_back(&self, turn: Turn) -> Shot {
        let Size { width, height } = self.size;
        let size = if turn.exchanged {
            Size {
                width: height,
                height: width,
            }
        } else {
            self.size
        };
        let places = (0..size.height).flat_map(|y| (0..size.width).map(move |x| (y, x)));
        let rgb = places.map(|(y, x)| {
            let (y, x) = if turn.exchanged { (x, y) } else { (y, x) };
            let x = if turn.flip_x { width - 1 - x } else { x };
            let y = if turn.flip_y { height - 1 - y } else { y };
            self.at(y, x)
        });
        Shot {
            size,
            rgb: rgb.collect(),
        }
    }

    /// Returns the picture whose channel c is channel `order[c]` of this one.
    pub(super) fn reordered(mut self, order: [usize; 3]) -> Shot {
        self.rgb.iter_mut().for_each(|rgb| *rgb = order.map(|c| rgb[c]));
        self
    }
}

/// The place of a pattern along one axis of a capture: the pattern's place u lies at middle + zoom·(u − middle of the
/// pattern) + shift, in pixels of the capture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Axis {
    /// The length of the capture and of the pattern.
    pub(super) seen: usize,
    pub(super) sent: usize,
    /// Pixels of the capture for each pixel of the pattern.
    pub(super) zoom: f64,
    pub(super) shift: f64,
}

impl Axis {
    pub(super) fn fitted(seen: usize, sent: usize) -> Self {
        Axis {
            seen,
            sent,
            zoom: seen as f64 / sent as f64,
            shift: 0.0,
        }
    }

    /// Returns the place in the pattern of the middle of pixel `at` of the capture; it may lie outside the pattern.
    pub(super) fn place(&self, at: usize) -> f64 {
        (at as f64 + 0.5 - self.seen as f64 / 2.0 - self.shift) / self.zoom + self.sent as f64 / 2.0
    }

    /// Returns the pixel of the pattern at pixel `at` of the capture.
    pub(super) fn pixel(&self, at: usize) -> Option<usize> {
        let place = self.place(at);
        (place >= 0.0 && place < self.sent as f64).then_some(place as usize)
    }

    /// Returns the enlargement against a capture that the pattern fills.
    pub(super) fn enlargement(&self) -> f64 {
        self.zoom * self.sent as f64 / self.seen as f64
    }

    /// Returns whether every pixel arrives at its own place, to a quarter of a pixel.
    pub(super) fn is_exact(&self) -> bool {
        self.seen == self.sent && self.shift.abs() + (self.zoom - 1.0).abs() * self.sent as f64 / 2.0 < 0.25
    }
}

/// A rectangle that hides the pattern, in pixels of the capture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Cover {
    pub(super) x: usize,
    pub(super) y: usize,
    pub(super) size: Size,
}

impl Cover {
    fn hides(&self, y: usize, x: usize) -> bool {
        (self.y..self.y + self.size.height).contains(&y) && (self.x..self.x + self.size.width).contains(&x)
    }
}

/// An upright capture, the place of the pattern in it, and what hides the pattern.
#[derive(Debug)]
pub(super) struct Seen<'a> {
    pub(super) shot: &'a Shot,
    pub(super) layout: Layout,
    pub(super) x: Axis,
    pub(super) y: Axis,
    pub(super) cover: Option<Cover>,
}

impl Seen<'_> {
    /// Calls `f` with the place (y, x) in the capture and in the pattern of each pixel of `part`, except for a margin
    /// of 3 pixels of the pattern and what is hidden.
    pub(super) fn each(&self, part: Part, mut f: impl FnMut((usize, usize), (usize, usize))) {
        const MARGIN: usize = 3;
        let (rows, columns) = self.layout.area(part);
        let inner = |range: &std::ops::Range<usize>| range.start + MARGIN..range.end.saturating_sub(MARGIN);
        let (rows, columns) = (inner(&rows), inner(&columns));
        let across: Vec<_> = (0..self.shot.size.width)
            .filter_map(|x| Some((x, self.x.pixel(x).filter(|u| columns.contains(u))?)))
            .collect();
        for y in 0..self.shot.size.height {
            let Some(v) = self.y.pixel(y).filter(|v| rows.contains(v)) else {
                continue;
            };
            for &(x, u) in &across {
                if self.cover.is_none_or(|cover| !cover.hides(y, x)) {
                    f((y, x), (v, u));
                }
            }
        }
    }
}
