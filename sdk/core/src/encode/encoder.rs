//! Plans that turn fields into phases or levels. Filters that need the whole field run first; the remaining work is one
//! pass over memory, row by row.

use super::Encoding;
use super::anti_alias::AntiAlias;
use super::dark_threshold::DarkThreshold;
use super::encoding::{Prefilter, PrefilterScratch};
use super::local::{LocalFilter, LocalScratch, REACH, Wanted};
use super::source::Source;
use super::start::{Start, StartScratch};
use super::{EncoderOptions, double_phase};
use crate::Bounds;
use crate::Size;
use crate::display::illumination::Illumination;
use crate::display::response::Response;
use crate::display::target::Target;
use crate::method::standing::Changed;
use crate::method::wave::Wave;
use crate::parallel::{self, prelude::*};
use crate::runtime::cancel::Cancel;
use crate::runtime::error::{Error, Result};
use num_complex::Complex32;
use std::ops::Range;

/// The number of rows of a piece whose changed columns are found together.
const PIECE: usize = 64;

/// A plan for one shape, target and encoding. It is immutable and can be shared between threads.
pub struct Encoder {
    colours: usize,
    height: usize,
    width: usize,
    prefilter: Prefilter,
    /// Whether the field's own phase is displayed.
    is_phase: bool,
    dark_threshold: f32,
    local: Option<Local>,
    /// The illumination and the modulator's size. The hologram is in the middle of the modulator.
    illumination: Option<(Illumination, Size)>,
    response: Response,
}

struct Local {
    filter: LocalFilter,
    steps: usize,
}

/// The working memory of an [`Encoder`] for one call at a time.
pub struct EncoderScratch {
    prefilter: Option<PrefilterScratch>,
    /// The field before a whole-field filter, used by the correction.
    wanted: Vec<Complex32>,
    /// Working memory for each part of a plane that a thread processes.
    parts: Vec<PartScratch>,
    /// The largest |u|² of each row.
    most: Vec<f32>,
    cancel: Cancel,
}

impl EncoderScratch {
    /// Makes the computation stop early once `cancel` is requested.
    pub fn set_cancel(&mut self, cancel: &Cancel) {
        if let Some(prefilter) = &mut self.prefilter {
            prefilter.set_cancel(cancel);
        }
        self.cancel = cancel.clone();
    }
}

struct PartScratch {
    start: StartScratch,
    local: Option<LocalScratch>,
    row: Vec<Complex32>,
}

/// The operations that are applied to a field row by row.
#[derive(Clone, Copy)]
struct Work<'a> {
    dark_threshold: Option<DarkThreshold>,
    /// The local correction and the reciprocal of the scale.
    local: Option<(&'a Local, f32)>,
}

/// A processed row before its conversion to phases.
enum Row<'a> {
    /// Values to encode by double phase.
    Field(&'a [Complex32]),
    /// Corrected values, whose own phase is displayed.
    Corrected(&'a [Complex32]),
}

impl Row<'_> {
    /// Returns the `count` values from `from` on.
    fn part(self, from: usize, count: usize) -> Self {
        match self {
            Row::Field(values) => Row::Field(&values[from..][..count]),
            Row::Corrected(values) => Row::Corrected(&values[from..][..count]),
        }
    }
}

impl Encoder {
    /// Plans the encoding of fields of `size` at the modulator of `target`. After filtering, a field is
    /// divided by the light that falls on the modulator.
    ///
    /// # Errors
    /// Returns an error if a plane is empty, a parameter is out of its range, a network is not a pre-filter, or a table
    /// is for another modulator.
    pub fn new(size: Size, target: &Target, options: &EncoderOptions) -> Result<Self> {
        let Size { width, height } = size;
        if height == 0 || width == 0 {
            return Err(Error::Setting(format!(
                "a plane of {width}×{height} is empty; each side must be at least 1"
            )));
        }
        target.check()?;
        options.check()?;
        let prefilter = Prefilter::new(size, &options.encoding, &target.display)?;
        let illumination = target.illumination.clone();
        Ok(Encoder {
            colours: target.display.colours(),
            height,
            width,
            prefilter,
            is_phase: matches!(options.encoding, Encoding::Phase),
            dark_threshold: options.dark_threshold,
            local: (options.local_steps > 0).then(|| Local {
                filter: LocalFilter::of_aperture(target.display.aperture_radius()),
                steps: options.local_steps,
            }),
            illumination: illumination.map(|light| (light, target.modulator())),
            response: target.response.clone().centred(size)?,
        })
    }

    /// Returns working memory for one call at a time, sized for the current thread pool.
    pub fn scratch(&self) -> EncoderScratch {
        let prefilter = self.prefilter.scratch();
        let wanted = match (&prefilter, &self.local) {
            (Some(_), Some(_)) => vec![Complex32::ZERO; self.colours * self.height * self.width],
            _ => Vec::new(),
        };
        let part = || PartScratch {
            start: StartScratch::new(self.prefilter.blur(), self.correction_reach(), self.width),
            local: self
                .local
                .as_ref()
                .map(|local| LocalScratch::new(local.steps, self.width)),
            row: vec![Complex32::ZERO; self.width],
        };
        EncoderScratch {
            prefilter,
            wanted,
            parts: (0..2 * parallel::current_num_threads()).map(|_| part()).collect(),
            most: vec![0.0; self.colours * self.height],
            cancel: Cancel::default(),
        }
    }

    /// Encodes `field`, a stack (C, H, W), into `phase`, (C, H, W) in \[0, 2π). Returns the amplitude that maps to full
    /// light: `scale`, or the largest amplitude of the filtered field. Afterwards the contents of `field` are
    /// unspecified. Allocates nothing.
    ///
    /// # Panics
    /// Panics if `field` or `phase` does not have C·H·W values.
    pub fn encode(
        &self,
        field: &mut [Complex32],
        scale: Option<f32>,
        phase: &mut [f32],
        scratch: &mut EncoderScratch,
    ) -> f32 {
        self.filter(field, scratch);
        let source = Source::Field(field);
        let scale = scale.unwrap_or_else(|| self.most(source, scratch));
        self.rows(
            source,
            self.work(scale),
            None,
            phase,
            scratch,
            |first, shown, phases| match shown {
                Row::Field(values) if !self.is_phase => {
                    double_phase::encode_row(values, first / self.width % self.height, scale, phases)
                }
                Row::Field(values) | Row::Corrected(values) => double_phase::phase_row(values, phases),
            },
        );
        scale
    }

    /// Encodes like [`Self::encode`], directly to the target's levels.
    ///
    /// # Panics
    /// Panics if `field` or `levels` does not have C·H·W values.
    pub fn encode_levels(
        &self,
        field: &mut [Complex32],
        scale: Option<f32>,
        levels: &mut [u8],
        scratch: &mut EncoderScratch,
    ) -> f32 {
        self.filter(field, scratch);
        let source = Source::Field(field);
        let scale = scale.unwrap_or_else(|| self.most(source, scratch));
        self.levels_of(source, scale, None, levels, scratch);
        scale
    }

    /// Returns whether [`Self::encode_wave`] works, that is, no filter needs the whole field.
    pub(crate) fn takes_waves(&self) -> bool {
        !self.is_phase && !self.prefilter.is_of_whole_field()
    }

    /// Encodes `wave` like [`Self::encode_levels`]. If `changed` is given, only the pixels that differ are computed,
    /// and `levels` hold those of the wave before at the same scale and turns.
    ///
    /// # Panics
    /// Panics if the wave does not have C·H·W values, or if this encoder takes no waves.
    pub(crate) fn encode_wave(
        &self,
        wave: Wave<'_>,
        scale: f32,
        changed: Option<Changed<'_>>,
        levels: &mut [u8],
        scratch: &mut EncoderScratch,
    ) {
        assert!(self.takes_waves());
        self.levels_of(Source::Wave(wave), scale, changed, levels, scratch);
    }

    fn levels_of(
        &self,
        source: Source<'_>,
        scale: f32,
        changed: Option<Changed<'_>>,
        levels: &mut [u8],
        scratch: &mut EncoderScratch,
    ) {
        let work = self.work(scale);
        self.rows(source, work, changed, levels, scratch, |first, shown, levels| {
            let y = first / self.width % self.height;
            match shown {
                Row::Field(values) if !self.is_phase => {
                    double_phase::encode_row_levels(values, y, scale, &self.response, first, levels);
                }
                Row::Field(values) | Row::Corrected(values) => {
                    double_phase::phase_row_levels(values, &self.response, first, levels);
                }
            }
        });
    }

    /// Writes the target's levels of `phases`, (C, H, W) in \[0, 2π).
    ///
    /// # Panics
    /// Panics if `phases` or `levels` does not have C·H·W values.
    pub fn levels(&self, phases: &[f32], levels: &mut [u8]) {
        assert!(phases.len() == self.colours * self.height * self.width && levels.len() == phases.len());
        let rows = phases
            .par_chunks_exact(self.width)
            .zip(levels.par_chunks_exact_mut(self.width));
        rows.enumerate()
            .for_each(|(row, (phases, levels))| self.response.levels(phases, row * self.width, levels));
    }

    /// Returns how many rows above and below a row the steps of the local correction read.
    fn correction_reach(&self) -> usize {
        self.local.as_ref().map_or(0, |local| REACH * local.steps)
    }

    /// Returns how many rows and columns on each side of a pixel its phase depends on.
    fn reach(&self) -> usize {
        self.correction_reach() + self.prefilter.blur().map_or(0, AntiAlias::half)
    }

    fn work(&self, scale: f32) -> Work<'_> {
        // Darkness needs no correction.
        let local = self.local.as_ref().filter(|_| scale > 0.0);
        Work {
            dark_threshold: DarkThreshold::new(self.dark_threshold, scale),
            local: local.map(|local| (local, 1.0 / scale)),
        }
    }

    /// Applies the filters that need the whole field.
    fn filter(&self, field: &mut [Complex32], scratch: &mut EncoderScratch) {
        assert_eq!(field.len(), self.colours * self.height * self.width);
        if !scratch.wanted.is_empty() {
            scratch.wanted.copy_from_slice(field);
        }
        if let Some(scratch) = &mut scratch.prefilter {
            self.prefilter.filter(field, scratch);
        }
    }

    /// Returns the largest amplitude of the filtered field.
    pub(crate) fn most(&self, source: Source<'_>, scratch: &mut EncoderScratch) -> f32 {
        let mut most = std::mem::take(&mut scratch.most);
        let nothing = Work {
            dark_threshold: None,
            local: None,
        };
        self.rows(source, nothing, None, &mut most, scratch, |_, row, most| {
            if let Row::Field(values) = row {
                most[0] = double_phase::max_norm_sqr(values);
            }
        });
        let scale = most.iter().copied().fold(0.0, |most, v| v.at_least(most)).sqrt();
        scratch.most = most;
        scale
    }

    /// Returns the smallest rectangle of `rows` that holds what `changed` affects, from an even column on.
    fn needed(&self, rows: Range<usize>, changed: Option<Changed<'_>>) -> Option<[Range<usize>; 2]> {
        let all = 0..self.width;
        let Some(changed) = changed else {
            return Some([rows, all]);
        };
        let [rows, columns] = changed.affected([&rows, &all], self.reach())?;
        // Only whole rows are divided by light.
        let columns = if self.illumination.is_some() { all } else { columns };
        Some([rows, columns.start / 2 * 2..columns.end])
    }

    /// Returns the columns to read for `columns`, from an even one on.
    fn read_for(&self, columns: &Range<usize>) -> Range<usize> {
        let reach = self.reach();
        columns.start.saturating_sub(reach) / 2 * 2..(columns.end + reach).min(self.width)
    }

    /// Processes each row of `source`, or the part of each row that `changed` affects. Calls `then` with the index in
    /// the stack at which the part begins, in an even column, with the part, and with its values in `out`. `out` has a
    /// value for each pixel or, without `changed`, for each row.
    fn rows<T: Send>(
        &self,
        source: Source<'_>,
        work: Work<'_>,
        changed: Option<Changed<'_>>,
        out: &mut [T],
        scratch: &mut EncoderScratch,
        then: impl Fn(usize, Row<'_>, &mut [T]) + Sync,
    ) {
        let (height, width) = (self.height, self.width);
        let per_row = out.len() / (self.colours * height);
        assert!(out.len() == self.colours * height * per_row && (per_row == 1 || per_row == width));
        let EncoderScratch {
            wanted, parts, cancel, ..
        } = scratch;
        assert_eq!(source.len(), self.colours * height * width);
        let band = height.div_ceil(parts.len());
        let piece = if changed.is_some() { PIECE } else { band };
        for (colour, out) in out.chunks_exact_mut(height * per_row).enumerate() {
            if cancel.requested() {
                return;
            }
            let whole = Start {
                plane: source.plane(colour, height * width),
                size: Size { width, height },
                columns: 0..width,
                colour,
                dark_threshold: work.dark_threshold,
                blur: self.prefilter.blur(),
                light: (self.illumination.as_ref()).map(|(light, modulator)| (light, *modulator)),
            };
            let wanted = (!wanted.is_empty()).then(|| &wanted[colour * height * width..][..height * width]);
            out.par_chunks_mut(band * per_row)
                .zip(&mut *parts)
                .enumerate()
                .for_each(|(part, (out, scratch))| {
                    let (first, end) = (part * band, part * band + out.len() / per_row);
                    for top in (first..end).step_by(piece) {
                        let Some([rows, columns]) = self.needed(top..(top + piece).min(end), changed) else {
                            continue;
                        };
                        let start = Start {
                            columns: self.read_for(&columns),
                            ..whole.clone()
                        };
                        let before = columns.start - start.columns.start;
                        let mut then = |y: usize, row: Row<'_>| {
                            let at = if per_row == width { columns.start } else { 0 };
                            then(
                                (colour * height + y) * width + columns.start,
                                row.part(before, columns.len()),
                                &mut out[(y - first) * per_row + at..][..columns.len().min(per_row)],
                            );
                        };
                        match (work.local, &mut scratch.local) {
                            (Some((local, per_scale)), Some(of_local)) => {
                                let wanted = Wanted {
                                    plane: wanted,
                                    per_scale,
                                };
                                let then = |y: usize, row: &[Complex32]| then(y, Row::Corrected(row));
                                let filter = &local.filter;
                                filter.correct(rows, &start, wanted, &mut scratch.start, of_local, then);
                            }
                            _ => {
                                let row = &mut scratch.row[..start.columns.len()];
                                scratch.start.begin(&start, rows.start);
                                for y in rows {
                                    start.row(y, row, &mut scratch.start);
                                    then(y, Row::Field(row));
                                }
                            }
                        }
                    }
                });
        }
    }
}
