//! The input of double phase, computed row by row: the field with the dark threshold applied, blurred and divided by
//! the light.

use super::anti_alias::AntiAlias;
use super::dark_threshold::DarkThreshold;
use super::source::Plane;
use crate::Size;
use crate::display::illumination::Illumination;
use num_complex::Complex32;
use phasefront_kernels::wide;
use std::ops::Range;

/// Some columns of one plane of a field and the operations on them.
#[derive(Clone)]
pub(super) struct Start<'a> {
    /// The plane, (H, W).
    pub(super) plane: Plane<'a>,
    pub(super) size: Size,
    /// The columns that rows hold. All, if there is `light`.
    pub(super) columns: Range<usize>,
    /// 0 red, 1 green, 2 blue. 0 for one laser.
    pub(super) colour: usize,
    pub(super) dark_threshold: Option<DarkThreshold>,
    pub(super) blur: Option<&'a AntiAlias>,
    /// The light and the modulator's size.
    pub(super) light: Option<(&'a Illumination, Size)>,
}

/// The working memory for the rows of a part of a plane.
pub(super) struct StartScratch {
    /// A ring of the latest rows of a plane that is not in memory as values.
    read: Vec<Complex32>,
    /// A ring of rows that are blurred along themselves.
    ring: Vec<Complex32>,
    damped: Vec<Complex32>,
    /// The next row to blur along itself.
    next: usize,
}

impl StartScratch {
    /// Creates memory for rows of at most `width`. [`Start::source`] returns the latest row and `before` rows above it.
    pub(super) fn new(blur: Option<&AntiAlias>, before: usize, width: usize) -> Self {
        let kept = blur.map_or(0, |blur| 2 * blur.half() + 1);
        let read = before + 1 + blur.map_or(0, AntiAlias::half);
        StartScratch {
            read: vec![Complex32::ZERO; read * width],
            ring: vec![Complex32::ZERO; kept * width],
            damped: vec![Complex32::ZERO; width],
            next: 0,
        }
    }

    /// Prepares for rows starting at `first`.
    pub(super) fn begin(&mut self, start: &Start<'_>, first: usize) {
        self.next = first.saturating_sub(start.blur.map_or(0, AntiAlias::half));
    }
}

impl Start<'_> {
    /// Writes row `y` into `out`. Rows must be requested in order.
    pub(super) fn row(&self, y: usize, out: &mut [Complex32], scratch: &mut StartScratch) {
        let (width, height) = (out.len(), self.size.height);
        let StartScratch {
            read,
            ring,
            damped,
            next,
        } = scratch;
        let damped = &mut damped[..width];
        match (self.blur, self.dark_threshold) {
            (None, None) => out.copy_from_slice(self.read(y, read)),
            (None, Some(threshold)) => {
                let row = self.read(y, read);
                wide!(threshold.draw(row, out));
            }
            (Some(blur), threshold) => {
                let (half, kept) = (blur.half(), ring.len() / width);
                while *next <= (y + half).min(height - 1) {
                    let row = self.read(*next, read);
                    let to = &mut ring[*next % kept * width..][..width];
                    match threshold {
                        None => wide!(blur.blur_row(row, to)),
                        Some(threshold) => wide!({
                            threshold.draw(row, damped);
                            blur.blur_row(damped, to);
                        }),
                    }
                    *next += 1;
                }
                wide!(blur.blur_down(ring, y, height, out));
            }
        }
        if let Some((light, modulator)) = self.light {
            light.divide_row(out, self.colour * height + y, height, modulator);
        }
    }

    /// Returns row `y` of the plane, in `read` if it is not in memory as values.
    fn read<'a>(&'a self, y: usize, read: &'a mut [Complex32]) -> &'a [Complex32] {
        let (width, first) = (self.columns.len(), self.first(y));
        match self.plane {
            Plane::Field(values) => &values[first..][..width],
            Plane::Wave(wave) => {
                let kept = read.len() / width;
                let row = &mut read[y % kept * width..][..width];
                wave.write(first, row);
                row
            }
        }
    }

    /// Returns where row `y` begins in the plane.
    pub(super) fn first(&self, y: usize) -> usize {
        y * self.size.width + self.columns.start
    }

    /// Returns row `y` of the plane. It is the row of the latest call of [`Self::row`], or one of those before that the
    /// scratch was made for.
    pub(super) fn source<'a>(&'a self, y: usize, scratch: &'a StartScratch) -> &'a [Complex32] {
        let width = self.columns.len();
        match self.plane {
            Plane::Field(values) => &values[self.first(y)..][..width],
            Plane::Wave(_) => &scratch.read[y % (scratch.read.len() / width) * width..][..width],
        }
    }

    /// Writes the light that falls on row `y` into `row`.
    pub(super) fn light_row(&self, y: usize, row: &mut [f32]) {
        if let Some((light, modulator)) = self.light {
            let height = self.size.height;
            light.light_row(row, self.colour * height + y, height, modulator);
        }
    }
}
