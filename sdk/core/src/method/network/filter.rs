//! A pre-filter network that processes a field in place. Input rows are read before the output of the row above is
//! written, so a second field is not needed.

use super::fused::{FusedChain, FusedScratch, tanh};
use super::{Engine, Head, InputKind};
use crate::Size;
use crate::runtime::cancel::Cancel;
use num_complex::Complex32;
use phasefront_kernels::{Band, OUTPUTS, Rows, Tiling, wide};

/// A network for fields, prepared for one size, from [`super::Network::filter_plan`]. It is immutable. Threads can
/// share one plan, each with its own scratch.
pub struct FilterPlan {
    pub(super) chain: FusedChain,
    pub(super) input: InputKind,
    pub(super) head: Head,
    /// The output that is the field of a display with one laser.
    pub(super) colour: Option<usize>,
    pub(super) size: Size,
    pub(super) engine: Engine,
}

/// The working memory of [`FilterPlan::filter`].
#[derive(Debug, Default)]
pub struct FilterScratch {
    fused: FusedScratch,
    /// The original rows around each border between bands: border by border, (C, 2·reach, W).
    borders: Vec<Complex32>,
}

impl FilterScratch {
    /// Makes runs stop early once `cancel` is requested.
    pub fn set_cancel(&mut self, cancel: &Cancel) {
        self.fused.cancel = cancel.clone();
    }
}

impl FilterPlan {
    /// Returns working memory for one run at a time. The first run fills it.
    pub fn scratch(&self) -> FilterScratch {
        FilterScratch::default()
    }

    /// Returns the engine that runs the network and the reason for the choice.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// Replaces `field`, (C, H, W), by the output of the network, on the current rayon pool. Allocates nothing after
    /// the first frame.
    ///
    /// # Panics
    /// Panics if `field` does not have C·H·W values.
    pub fn filter(&self, field: &mut [Complex32], scratch: &mut FilterScratch) {
        match self.colour {
            None => self.filter_of([0, 1, 2], field, scratch),
            Some(colour) => self.filter_of([colour], field, scratch),
        }
    }

    /// Filters with some colours of the output. The field's planes are the network's red, green and blue. A single
    /// plane is used for all three.
    fn filter_of<const C: usize>(&self, colours: [usize; C], field: &mut [Complex32], scratch: &mut FilterScratch) {
        let Size { width, height } = self.size;
        assert_eq!(field.len(), C * height * width, "values of the field");
        // Bands span the whole width because a neighbouring strip would overwrite a strip's halo.
        let tiling = Tiling {
            strip_columns: width,
            ..self.chain.tiling(self.size)
        };
        let reach = self.chain.layers();
        let borders = (height - 1) / tiling.band_rows;
        let kept = C * 2 * reach * width;
        scratch.borders.resize(borders * kept, Complex32::default());
        for (border, kept) in scratch.borders.chunks_exact_mut(kept).enumerate() {
            let row = (border + 1) * tiling.band_rows;
            let (from, to) = (row.saturating_sub(reach), (row + reach).min(height));
            let planes = field.chunks_exact(height * width);
            for (plane, kept) in planes.zip(kept.chunks_exact_mut(2 * reach * width)) {
                kept[(from + reach - row) * width..][..(to - from) * width]
                    .copy_from_slice(&plane[from * width..to * width]);
            }
        }
        let rows = InPlace {
            input: self.input,
            head: self.head,
            colours,
            tanh: self.chain.has_tanh(),
            cancel: &scratch.fused.cancel,
            borders: &scratch.borders,
            band_rows: tiling.band_rows,
            reach,
            width,
        };
        let mut planes = field.chunks_exact_mut(height * width);
        let planes: [_; C] = std::array::from_fn(|_| planes.next().unwrap_or_default());
        self.chain.run_rows(&rows, planes, self.size, tiling, &scratch.fused);
    }
}

struct InPlace<'a, const C: usize> {
    input: InputKind,
    head: Head,
    colours: [usize; C],
    tanh: bool,
    cancel: &'a Cancel,
    borders: &'a [Complex32],
    band_rows: usize,
    reach: usize,
    width: usize,
}

impl<const C: usize> Rows<C> for InPlace<'_, C> {
    type Value = Complex32;

    fn read(&self, row: usize, from: usize, band: &Band<'_, Complex32, C>, into: &mut [f32]) {
        let count = into.len() / self.input.channels();
        let (field, remainders) = into.split_at_mut(6 * count);
        let (re, im) = field.split_at_mut(3 * count);
        let parts = re.chunks_exact_mut(count).zip(im.chunks_exact_mut(count));
        for (plane, (re, im)) in parts.enumerate() {
            let plane = plane % C;
            let values = match self.kept_row(row, &band.rows()) {
                None => band.row(plane, row, from, count),
                Some((border, kept)) => {
                    let rows = (border * C + plane) * 2 * self.reach + kept;
                    &self.borders[rows * self.width + from..][..count]
                }
            };
            wide!({
                for ((re, im), value) in re.iter_mut().zip(im).zip(values) {
                    (*re, *im) = (value.re, value.im);
                }
            });
        }
        wide!({
            for (value, remainder) in field.iter_mut().zip(remainders) {
                (*value, *remainder) = InputKind::split(*value);
            }
        });
    }

    fn write(&self, row: usize, from: usize, mut values: [&mut [f32]; OUTPUTS], band: &mut Band<'_, Complex32, C>) {
        let field = band.rows_mut(row, from, values[0].len());
        wide!({
            if self.tanh {
                tanh(&mut values);
            }
            match self.head {
                Head::AmplitudePhase => Head::amplitude_phase(&self.colours, values.map(|run| &*run), field),
                Head::RealImaginary => {
                    for (&c, field) in self.colours.iter().zip(field) {
                        let parts = values[c].iter().zip(&*values[3 + c]);
                        for (value, (re, im)) in field.iter_mut().zip(parts) {
                            *value = Complex32::new(value.re + re, value.im + im);
                        }
                    }
                }
            }
        });
    }

    fn given_up(&self) -> bool {
        self.cancel.requested()
    }
}

impl<const C: usize> InPlace<'_, C> {
    /// Returns the border and the row there that hold `row`, if it is outside `band`.
    fn kept_row(&self, row: usize, band: &std::ops::Range<usize>) -> Option<(usize, usize)> {
        let border = match row {
            row if row < band.start => band.start / self.band_rows,
            row if row >= band.end => band.end / self.band_rows,
            _ => return None,
        };
        Some((border - 1, row + self.reach - border * self.band_rows))
    }
}
