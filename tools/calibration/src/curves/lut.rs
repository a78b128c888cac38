//! Computation of each pixel's phase curve from photographs of the 256 patterns, and of the compact per-pixel table
//! from the curves.
//!
//! # Memory
//! One photograph is in memory at a time. Its light on the modulator's pixels goes to a temporary file with 2 bytes per
//! pixel and pattern (1 GB for 1920×1080). The fits read rows of it, pattern by pattern. The curves take 48 bytes per
//! pixel.

use crate::camera::marks::{NoMarks, Registration};
use crate::camera::pattern::{PATTERNS, Pattern};
use crate::camera::photograph::{Photograph, SATURATED_SHARE};
use crate::curves::curve::{self, Basis, COEFFICIENTS, LEVELS};
use crate::curves::surface;
use ndarray::Array2;
use phasefront::Size;
use phasefront_core::display::response::per_pixel::PerPixel;
use phasefront_io::{Error, Result};
use rayon::prelude::*;
use std::f32::consts::TAU;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// The maximum number of the table's nodes along the longer axis, without the last node.
const NODES: usize = 60;
/// The number of phase intervals of the table.
const INTERVALS: usize = 32;
/// The number of rows that are fitted at a time.
const STRIP: usize = 8;
/// The maximum shift of a photograph relative to the first, in pixels of the modulator.
const MOST_SHIFT: f64 = 0.75;
/// A pixel whose light changes by less than this fraction of the median is unresponsive.
const LEAST_CONTRAST: f32 = 0.1;
/// The maximum residual of a usable fit, relative to the light's amplitude.
const MOST_RESIDUAL: f32 = 0.25;
/// The maximum fraction of unresponsive pixels.
pub const SILENT_SHARE: f64 = 0.01;

/// A problem with one photograph, with advice.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// The name of the colour.
    pub colour: &'static str,
    /// The pattern that the photograph should show.
    pub pattern: usize,
    /// The kind of problem.
    pub what: What,
}

/// The kind of a [`Problem`].
#[derive(Debug, Clone, PartialEq)]
pub enum What {
    /// No file has the expected name.
    Missing,
    /// The file cannot be read.
    Unreadable(String),
    /// The size of this photograph differs from that of the first.
    Size(Size, Size),
    /// The photograph is saturated. The value is the fraction of pixels at the sensor's limit.
    Saturated(f64),
    /// The marks were not found.
    NoMarks(NoMarks),
    /// The code is that of another pattern.
    Shows(u8),
    /// The code cannot be read.
    NoCode,
    /// The photograph is shifted by (x, y), in its pixels.
    Shifted([f64; 2]),
}

impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (colour, k) = (self.colour, self.pattern);
        write!(f, "{colour}/capture_{k:03}: {}", self.what.told(k))
    }
}

impl What {
    /// Describes the problem of a photograph of pattern `k`, with advice.
    pub fn told(&self, k: usize) -> String {
        match self {
            What::Missing => {
                format!("is missing; photograph pattern_{k:03}.png and name it capture_{k:03}.png or .tif")
            }
            What::Unreadable(why) => format!("{why}; photograph pattern_{k:03}.png again"),
            What::Size(size, first) => {
                format!("is {size}, others are {first}; photograph all with one setting of the camera")
            }
            What::Saturated(share) => format!(
                "{:.1} % of its pixels are saturated; shorten the exposure and photograph all patterns again",
                share * 100.0
            ),
            What::NoMarks(why @ NoMarks::Count(_)) => {
                format!("{why}; where the marks are not dark, write patterns with another --dark")
            }
            What::NoMarks(why) => why.to_string(),
            What::Shows(other) => {
                format!("shows pattern {other:03}; name the captures in the order of the patterns")
            }
            What::NoCode => format!(
                "its code cannot be read: blurred, too dark, or changed while it was taken; photograph pattern_{k:03}.png again"
            ),
            What::Shifted([x, y]) => format!(
                "is shifted by ({x:+.1}, {y:+.1}) pixels against the others; fix camera and display, and photograph all patterns again"
            ),
        }
    }
}

/// The reason why no curves were computed: the photographs or another error.
#[derive(Debug)]
pub enum Refusal {
    /// All photographs that cannot be used.
    Problems(Vec<Problem>),
    /// Another error.
    Other(Error),
}

impl From<Error> for Refusal {
    fn from(e: Error) -> Self {
        Refusal::Other(e)
    }
}

/// A function that returns the photograph of a pattern in one colour, from a file or a camera.
pub type Source<'a> = &'a dyn Fn(usize) -> std::result::Result<Photograph, What>;

/// Returns the file of the photograph of pattern `k` in `folder`: `capture_000.png`, `.tif` or `.tiff`.
pub fn capture_path(folder: &Path, k: usize) -> Option<PathBuf> {
    ["png", "tif", "tiff", "PNG", "TIF", "TIFF"]
        .iter()
        .map(|extension| folder.join(format!("capture_{k:03}.{extension}")))
        .find(|path| path.is_file())
}

/// Reads the photograph of pattern `k` in `colour` from `folder`.
///
/// # Errors
/// Returns an error if the file is missing or cannot be read.
pub fn read_capture(folder: &Path, colour: usize, k: usize) -> std::result::Result<Photograph, What> {
    let path = capture_path(folder, k).ok_or(What::Missing)?;
    Photograph::read(&path, colour).map_err(|e| match e {
        Error::File { reason, .. } => What::Unreadable(reason),
        other => What::Unreadable(other.to_string()),
    })
}

/// The light of each pixel in each pattern, stored on disk.
struct Stack {
    file: File,
    size: Size,
    folder: PathBuf,
}

impl Stack {
    fn new(folder: &Path, size: Size) -> Result<Self> {
        let file = tempfile::tempfile_in(folder)
            .map_err(|e| Error::file(folder, format!("cannot hold a temporary file: {e}")))?;
        Ok(Stack {
            file,
            size,
            folder: folder.to_owned(),
        })
    }

    fn refuse(&self, e: std::io::Error) -> Error {
        Error::file(&self.folder, format!("its temporary file: {e}"))
    }

    fn push(&mut self, light: &Array2<f32>) -> Result<()> {
        let bytes: Vec<u8> = (light.iter())
            .flat_map(|v| ((v * 65535.0).round() as u16).to_le_bytes())
            .collect();
        self.file.write_all(&bytes).map_err(|e| self.refuse(e))
    }

    /// Returns the light in all patterns for each pixel of `rows` rows, starting at row `y`.
    fn rows(&mut self, y: usize, rows: usize) -> Result<Vec<[f32; LEVELS]>> {
        let Size { width, height } = self.size;
        let mut bytes = vec![0; 2 * rows * width];
        let mut light = vec![[0.0; LEVELS]; rows * width];
        for k in 0..PATTERNS {
            let start = 2 * (k * height + y) * width;
            let read = (self.file.seek(SeekFrom::Start(start as u64))).and_then(|_| self.file.read_exact(&mut bytes));
            read.map_err(|e| self.refuse(e))?;
            for (pixel, pair) in light.iter_mut().zip(bytes.chunks_exact(2)) {
                pixel[k] = f32::from(u16::from_le_bytes([pair[0], pair[1]])) / 65535.0;
            }
        }
        Ok(light)
    }
}

/// The phase curves of one colour.
#[derive(Debug, Clone, PartialEq)]
pub struct Curves {
    /// The name of the colour.
    pub colour: &'static str,
    /// The coefficients of [`Basis`] for each pixel, (H, W). Pixels without a curve are NaN.
    pub coefficients: Array2<[f32; COEFFICIENTS]>,
    /// The residual of each fit, (H, W), relative to the light's amplitude. Pixels without a curve are NaN.
    pub residual: Array2<f32>,
    /// The unresponsive pixels, (y, x), caused by dust or defects. Their curves come from their neighbours.
    pub silent: Vec<(usize, usize)>,
    /// The fraction of pixels whose light passed no minimum, so that their range is about π or less.
    pub under_pi: f64,
    /// The number of photograph pixels per modulator pixel.
    pub zoom: f64,
    /// The light of a few pixels, (y, x), for plots.
    pub samples: Vec<((usize, usize), [f32; LEVELS])>,
    /// The light around the modulator, as a fraction of the sensor's range.
    pub dark: f32,
}

/// Computes the curves of one colour from the photographs that `source` returns. The temporary file is created in the
/// folder `spool`. `progress` receives the number of photographs and rows done, and their total.
///
/// # Errors
/// Returns an error that lists the unusable photographs, or an error if more than [`SILENT_SHARE`] of the pixels are
/// unresponsive.
pub fn measure(
    pattern: &Pattern,
    colour: &'static str,
    source: Source<'_>,
    spool: &Path,
    progress: &dyn Fn(usize, usize),
) -> std::result::Result<Curves, Refusal> {
    let height = pattern.size().height;
    let work = PATTERNS + height;
    let mut problems = Vec::new();
    let mut stack = Stack::new(spool, pattern.size())?;
    let (mut checks, mut dark) = (Checks::default(), None);
    for k in 0..PATTERNS {
        let mut add = |what| {
            problems.push(Problem {
                colour,
                pattern: k,
                what,
            });
        };
        match source(k) {
            Err(what) => add(what),
            Ok(photograph) => match checks.check(&photograph, pattern, k) {
                Err(what) => add(what),
                Ok(registration) => {
                    dark.get_or_insert_with(|| registration.surroundings(&photograph, pattern.size()));
                    if problems.is_empty() {
                        stack.push(&registration.resample(&photograph, pattern.size()))?;
                    }
                }
            },
        }
        progress(k + 1, work);
    }
    let (Some((_, registration)), Some(dark), true) = (checks.first, dark, problems.is_empty()) else {
        return Err(Refusal::Problems(problems));
    };
    let mut curves = fitted(pattern, colour, stack, dark, &|row| {
        progress(PATTERNS + row, work);
    })?;
    curves.zoom = registration.zoom;
    Ok(curves)
}

/// The checks of photographs against the first good one.
#[derive(Debug, Default)]
pub struct Checks {
    /// Its size, and where it shows the modulator.
    first: Option<(Size, Registration)>,
}

impl Checks {
    /// Checks a photograph of pattern `k`. Returns where the first good photograph shows the modulator.
    ///
    /// # Errors
    /// Returns the problem of a photograph that cannot be used.
    pub fn check(
        &mut self,
        photograph: &Photograph,
        pattern: &Pattern,
        k: usize,
    ) -> std::result::Result<Registration, What> {
        let size = Size {
            width: photograph.width,
            height: photograph.height,
        };
        if let Some((others, _)) = self.first
            && others != size
        {
            return Err(What::Size(size, others));
        }
        let share = photograph.saturated();
        if share > SATURATED_SHARE {
            return Err(What::Saturated(share));
        }
        let registration = Registration::find(photograph, pattern).map_err(What::NoMarks)?;
        match registration.code(photograph, pattern) {
            None => return Err(What::NoCode),
            Some(code) if usize::from(code) != k => return Err(What::Shows(code)),
            _ => {}
        }
        let (_, first) = self.first.get_or_insert((size, registration));
        let [x, y] = first.shift(&registration);
        if x.hypot(y) > MOST_SHIFT * first.zoom {
            return Err(What::Shifted([x, y]));
        }
        Ok(*first)
    }
}

/// The result for one pixel.
struct Pixel {
    coefficients: [f32; COEFFICIENTS],
    residual: f32,
    contrast: f32,
    passed_minimum: bool,
}

fn fitted(
    pattern: &Pattern,
    colour: &'static str,
    mut stack: Stack,
    dark: f32,
    progress: &dyn Fn(usize),
) -> Result<Curves> {
    let Size { width, height } = pattern.size();
    let basis = Basis::new();
    let none = [f32::NAN; COEFFICIENTS];
    let mut coefficients = Array2::from_elem((height, width), none);
    let mut residual = Array2::from_elem((height, width), f32::NAN);
    let mut contrast = Array2::from_elem((height, width), f32::NAN);
    let mut samples = Vec::new();
    let (mut measured, mut under_pi) = (0usize, 0usize);
    for top in (0..height).step_by(STRIP) {
        let rows = STRIP.min(height - top);
        let light = stack.rows(top, rows)?;
        let pixels: Vec<Option<Pixel>> = (light.par_iter().enumerate())
            .map(|(i, light)| {
                let (y, x) = (top + i / width, i % width);
                pattern.measures(y, x).then(|| {
                    let most = light.iter().copied().fold(0.0, f32::max);
                    let least = light.iter().copied().fold(f32::INFINITY, f32::min);
                    let fit = basis.fit(light, dark);
                    Pixel {
                        coefficients: fit.map_or(none, |fit| fit.coefficients),
                        residual: fit.map_or(f32::NAN, |fit| fit.residual),
                        contrast: most - least,
                        passed_minimum: fit.is_some_and(|fit| fit.passed_minimum),
                    }
                })
            })
            .collect();
        for (i, pixel) in pixels.iter().enumerate() {
            let at = (top + i / width, i % width);
            let Some(pixel) = pixel else { continue };
            measured += 1;
            under_pi += usize::from(!pixel.passed_minimum && !pixel.residual.is_nan());
            coefficients[at] = pixel.coefficients;
            residual[at] = pixel.residual;
            contrast[at] = pixel.contrast;
            // The samples are the centre and two points between it and the corners.
            let places = [
                (height / 2, width / 2),
                (height / 4, width * 3 / 4),
                (height * 3 / 4, width / 4),
            ];
            if places.contains(&at) {
                samples.push((at, light[i]));
            }
        }
        progress(top + rows);
    }
    let mut all: Vec<f32> = contrast.iter().copied().filter(|c| !c.is_nan()).collect();
    all.sort_by(f32::total_cmp);
    let median = all.get(all.len() / 2).copied().unwrap_or(0.0);
    let mut silent = Vec::new();
    for (at, contrast) in contrast.indexed_iter() {
        if contrast.is_nan() {
            continue;
        }
        // A comparison with NaN is false.
        let answers = *contrast >= LEAST_CONTRAST * median && residual[at] <= MOST_RESIDUAL;
        if !answers {
            silent.push(at);
            coefficients[at] = none;
        }
    }
    if silent.len() as f64 > SILENT_SHARE * measured as f64 {
        let (y, x) = silent[silent.len() / 2];
        return Err(Error::Input(format!(
            "{colour}: {} of {measured} pixels do not answer to their level, one of them ({x}, {y}); focus on the modulator, light all of it, turn its polarisation, and let the camera's tone curve be linear",
            silent.len()
        )));
    }
    Ok(Curves {
        colour,
        coefficients,
        residual,
        silent,
        under_pi: under_pi as f64 / measured.max(1) as f64,
        zoom: f64::NAN,
        samples,
        dark,
    })
}

impl Curves {
    /// Returns the size of the modulator.
    pub fn size(&self) -> Size {
        Size::from_shape(self.coefficients.dim())
    }

    /// Returns the curve of pixel (`x`, `y`), or `None` if it has none.
    pub fn curve(&self, basis: &Basis, y: usize, x: usize) -> Option<[f32; LEVELS]> {
        let coefficients = &self.coefficients[(y, x)];
        (!coefficients[0].is_nan()).then(|| basis.curve(coefficients))
    }

    /// Returns the phase of level 255, in units of 2π, for each pixel that has a curve.
    pub fn ranges(&self) -> Vec<f32> {
        let mut ranges: Vec<f32> = (self.coefficients.iter())
            .map(|c| c[COEFFICIENTS - 1] / TAU)
            .filter(|range| !range.is_nan())
            .collect();
        ranges.sort_by(f32::total_cmp);
        ranges
    }
}

/// Returns the spacing of the table's nodes, in pixels, for a modulator of `size`.
pub fn spacing(size: Size) -> usize {
    let Size { width, height } = size;
    height.max(width).div_ceil(NODES)
}

/// Computes the compact table from the curves of all colours. The nodes' curves lie on a smooth surface through
/// the pixels' curves ([`surface`]), which also suppresses the noise of single pixels and bridges marks and dust.
///
/// # Errors
/// Returns an error if the shapes differ or a colour has no curves.
///
/// # Panics
/// Panics if `curves` is empty.
pub fn compact(curves: &[Curves]) -> Result<PerPixel> {
    let size = curves[0].size();
    if curves.iter().any(|c| c.size() != size) {
        return Err(Error::Input("curves of modulators of different sizes".into()));
    }
    let spacing = spacing(size);
    let basis = Basis::new();
    let (mut levels, mut turns) = (Vec::new(), Vec::new());
    for curves in curves {
        let nodes = surface::fit(curves.coefficients.view(), spacing)
            .ok_or_else(|| Error::Input(format!("{}: no pixel has a curve", curves.colour)))?;
        for coefficients in &nodes {
            let mut highest = 0.0f32;
            // A curve could decrease where the surface is extrapolated beyond the pixels.
            let rising = coefficients.map(|c| {
                highest = highest.max(c);
                highest
            });
            let (values, turn) = knots(&basis.curve(&rising));
            levels.extend(values);
            turns.push(turn);
        }
    }
    Ok(PerPixel::new(size, spacing, INTERVALS, &levels, &turns)?)
}

/// Returns the levels at the knots' phases by a node's curve, and the phase above which 0 is nearer than the curve's
/// end.
fn knots(curve: &[f32; LEVELS]) -> ([f32; INTERVALS + 1], f32) {
    let values = std::array::from_fn(|k| curve::level_of(curve, k as f32 / INTERVALS as f32 * TAU));
    let last = curve[LEVELS - 1];
    (values, if last < TAU { 0.5 * (last + TAU) } else { TAU })
}

/// Phase errors over all pixels with a curve, in radians.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Errors {
    /// The RMS error of the factory's linear table.
    pub linear_rms: f64,
    /// The RMS error of the full table, caused by its steps of one level.
    pub full_rms: f64,
    /// The RMS error of the compact table.
    pub compact_rms: f64,
    /// The RMS difference between the compact table and the full one.
    pub between_rms: f64,
    /// The 99.9th percentile of the difference between the compact table and the full one.
    pub between_most: f64,
}

/// Computes the phase errors of the tables for the colour at `index` of the table, where its measured curves reach the
/// phase. It tests every fourth of 256 phase steps.
pub fn errors(curves: &Curves, index: usize, table: &PerPixel) -> Errors {
    let Size { width, height } = curves.size();
    let basis = Basis::new();
    let plane = index * height * width;
    let apart = |a: f32, b: f32| {
        let d = (a - b).rem_euclid(TAU);
        f64::from(d.min(TAU - d))
    };
    struct Sums {
        count: f64,
        squares: [f64; 4],
        // Counts of |between| in bins of a thousandth of a radian.
        histogram: Vec<u64>,
    }
    let none = || Sums {
        count: 0.0,
        squares: [0.0; 4],
        histogram: vec![0; 4000],
    };
    let sums = (0..height)
        .into_par_iter()
        .fold(none, |mut sums, y| {
            for x in 0..width {
                let Some(curve) = curves.curve(&basis, y, x) else {
                    continue;
                };
                let full = curve::inverse(&curve);
                for step in (0..LEVELS).step_by(4) {
                    let phase = step as f32 / LEVELS as f32 * TAU;
                    if phase > curve[LEVELS - 1] {
                        break;
                    }
                    let shown = |level: u8| curve[usize::from(level)];
                    let compact = shown(table.level(phase, plane + y * width + x));
                    let full = shown(full[step]);
                    let between = apart(compact, full);
                    let all = [
                        apart(shown(step as u8), phase),
                        apart(full, phase),
                        apart(compact, phase),
                        between,
                    ];
                    (sums.squares.iter_mut().zip(all)).for_each(|(s, e)| *s += e * e);
                    sums.count += 1.0;
                    sums.histogram[((between * 1e3) as usize).min(3999)] += 1;
                }
            }
            sums
        })
        .reduce(none, |mut a, b| {
            a.count += b.count;
            (a.squares.iter_mut().zip(b.squares)).for_each(|(a, b)| *a += b);
            (a.histogram.iter_mut().zip(b.histogram)).for_each(|(a, b)| *a += b);
            a
        });
    let rms = sums.squares.map(|s| (s / sums.count.max(1.0)).sqrt());
    let mut over = (sums.count * 1e-3) as u64;
    let most = (0..4000).rev().find(|bin| {
        let enough = sums.histogram[*bin] > over;
        over = over.saturating_sub(sums.histogram[*bin]);
        enough
    });
    Errors {
        linear_rms: rms[0],
        full_rms: rms[1],
        compact_rms: rms[2],
        between_rms: rms[3],
        between_most: most.map_or(0.0, |bin| (bin + 1) as f64 * 1e-3),
    }
}

/// Writes the full table of the colour at `index` of `table`, uint8 (H, W, 256), to `file` as .npy: the level of each
/// of 256 phase steps for each pixel. Pixels without a curve use the levels of `table`.
///
/// # Errors
/// Returns an error if writing fails.
pub fn write_full(curves: &Curves, index: usize, table: &PerPixel, file: &mut dyn Write) -> std::io::Result<()> {
    let Size { width, height } = curves.size();
    let mut header = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({height}, {width}, {LEVELS}), }}");
    // Magic, version and length take 10 bytes. The total length is a multiple of 64 and ends with a line break.
    let padding = (10 + header.len() + 1).next_multiple_of(64) - (10 + header.len() + 1);
    header.push_str(&" ".repeat(padding));
    header.push('\n');
    file.write_all(b"\x93NUMPY\x01\x00")?;
    file.write_all(&(header.len() as u16).to_le_bytes())?;
    file.write_all(header.as_bytes())?;
    let basis = Basis::new();
    let plane = index * height * width;
    for y in 0..height {
        let row: Vec<[u8; LEVELS]> = (0..width)
            .into_par_iter()
            .map(|x| match curves.curve(&basis, y, x) {
                Some(curve) => curve::inverse(&curve),
                None => std::array::from_fn(|step| {
                    let phase = step as f32 / LEVELS as f32 * TAU;
                    table.level(phase, plane + y * width + x)
                }),
            })
            .collect();
        file.write_all(row.as_flattened())?;
    }
    Ok(())
}
