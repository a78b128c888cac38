//! Conversion of camera images to amplitudes at the display's resolution. Images are turned upright, cropped, resized
//! and converted in one pass. Tests compare the results with [`super::reference`].

use super::colour::{ColourFormat, ColourImage, YuvEncoding, YuvMatrix, check_size};
use super::light::LightPlan;
use super::plane::View;
use super::plane::{Orientation, Plane};
use super::resample::{Axis, Crop};
use crate::Bounds;
use crate::Size;
use crate::parallel::{self, prelude::*};
use crate::runtime::error::{Error, Result};
use phasefront_kernels::wide;

/// The number of bands of rows for each thread. More than one lets other threads take over the work of a delayed
/// thread.
const BANDS_PER_THREAD: usize = 4;

/// A plan for one image format and size, orientation and output shape. It is immutable and can be shared between
/// threads.
pub struct ColourPlan {
    format: ColourFormat,
    sensor: Size,
    orientation: Orientation,
    out: Size,
    luma: Axes,
    /// The axes of subsampled chroma, or `None` if all channels have full resolution.
    chroma: Option<Axes>,
    light: Option<LightPlan>,
}

struct Axes {
    x: Axis,
    y: Axis,
}

/// The working memory of a [`ColourPlan`] for one call at a time.
pub struct ColourScratch {
    rows: Vec<f32>,
    bands: usize,
}

/// The location of one channel (its plane and its byte in a pixel) and its resampling.
struct Channel<'a> {
    plane: Plane<'a>,
    byte: usize,
    axes: &'a Axes,
    sensor: Size,
}

impl ColourPlan {
    /// Plans the conversion of images like `image`, turned by `orientation`, to amplitudes of `size`, of the part
    /// [`Crop::cover`].
    ///
    /// # Errors
    /// Returns an error if the output is empty.
    pub fn new(image: &ColourImage<'_>, orientation: Orientation, size: Size) -> Result<Self> {
        Self::for_format(image.format(), image.size(), orientation, size)
    }

    /// Plans the conversion of images with this `format` and the size `sensor`, like [`ColourPlan::new`].
    ///
    /// # Errors
    /// Returns an error if the image is empty or too large, or the output is empty.
    pub fn for_format(format: ColourFormat, sensor: Size, orientation: Orientation, size: Size) -> Result<Self> {
        let Size { width, height } = size;
        check_size("colour", sensor)?;
        if height == 0 || width == 0 {
            return Err(Error::Setting(format!(
                "a frame of {size} is empty; each side must be at least 1"
            )));
        }
        let upright = orientation.upright_size(sensor);
        let crop = Crop::cover(upright, size);
        let chroma = format.layout().get(1).map(|(_, _, share)| {
            let half = |n: usize| n.div_ceil(*share);
            // If a side is odd, the last chroma sample extends beyond the image, at its far end or, if flipped, at its
            // near end.
            let from = |from: f64, side: usize, flipped: bool| {
                from / 2.0
                    + if flipped {
                        half(side) as f64 - side as f64 / 2.0
                    } else {
                        0.0
                    }
            };
            let flips = orientation.flips();
            let x = from(crop.x, upright.width, flips.0);
            let y = from(crop.y, upright.height, flips.1);
            Axes {
                x: Axis::new(half(upright.width), x, crop.width / 2.0, width),
                y: Axis::new(half(upright.height), y, crop.height / 2.0, height),
            }
        });
        Ok(ColourPlan {
            format,
            sensor,
            orientation,
            out: size,
            luma: Axes {
                x: Axis::new(upright.width, crop.x, crop.width, width),
                y: Axis::new(upright.height, crop.y, crop.height, height),
            },
            chroma,
            light: None,
        })
    }

    /// Returns this plan with colours converted to amplitudes by `light`, which is of three lasers. Without it, the
    /// plan gives the encoded colours; those of [`super::RgbEncoding::Amplitude`] are the amplitudes.
    pub fn with_light(self, light: Option<LightPlan>) -> Self {
        ColourPlan { light, ..self }
    }

    /// Returns whether the plan fits images like `image` turned by `orientation`. Strides may differ.
    pub fn fits(&self, image: &ColourImage<'_>, orientation: Orientation) -> bool {
        (self.format, self.sensor, self.orientation) == (image.format(), image.size(), orientation)
    }

    /// Returns the size of the amplitudes.
    pub fn size(&self) -> Size {
        self.out
    }

    /// Returns the resampling along x and y of the first channel, then of the other two channels.
    pub fn axes(&self) -> [&Axis; 4] {
        let chroma = self.chroma.as_ref().unwrap_or(&self.luma);
        [&self.luma.x, &self.luma.y, &chroma.x, &chroma.y]
    }

    /// Returns for each channel of `image` its plane and the location of the upright image's bytes in it.
    pub fn views(&self, image: &ColourImage<'_>) -> [(usize, View); 3] {
        let planes = match self.format {
            ColourFormat::Rgba | ColourFormat::Bgra | ColourFormat::Rgb => [0; 3],
            ColourFormat::Nv12(_) => [0, 1, 1],
            ColourFormat::Yuv420(_) => [0, 1, 2],
        };
        let channels = self.channels(image);
        std::array::from_fn(|c| {
            let channel = &channels[c];
            let view = self.orientation.view(&channel.plane, channel.sensor);
            let origin = view.origin + channel.byte;
            (planes[c], View { origin, ..view })
        })
    }

    /// Allocates working memory for one call at a time, sized for the current thread pool.
    pub fn scratch(&self) -> ColourScratch {
        let bands = match parallel::current_num_threads() {
            1 => 1,
            threads => (threads * BANDS_PER_THREAD).min(self.out.height),
        };
        ColourScratch {
            rows: vec![0.0; bands * self.luma.x.needed().len().max(self.chroma_row())],
            bands,
        }
    }

    fn chroma_row(&self) -> usize {
        self.chroma.as_ref().map_or(0, |axes| axes.x.needed().len())
    }

    /// Converts `image` to amplitudes in `rgb`, (3, H, W) in \[0, 1], on the current thread pool. Does not allocate.
    ///
    /// # Errors
    /// Returns an error if the plan does not fit the image.
    ///
    /// # Panics
    /// Panics if `rgb` does not have 3·H·W values.
    pub fn convert(&self, image: &ColourImage<'_>, rgb: &mut [f32], scratch: &mut ColourScratch) -> Result<()> {
        if !self.fits(image, self.orientation) {
            return Err(Error::Frame(format!(
                "the image is {:?} of {}×{}; this plan takes {:?} of {}×{}",
                image.format(),
                image.size().width,
                image.size().height,
                self.format,
                self.sensor.width,
                self.sensor.height
            )));
        }
        let Size { width, height } = self.out;
        assert_eq!(rgb.len(), 3 * height * width);
        let channels = self.channels(image);
        let band = height.div_ceil(scratch.bands);
        let piece = scratch.rows.len() / scratch.bands;
        let (red, others) = rgb.split_at_mut(height * width);
        let (green, blue) = others.split_at_mut(height * width);
        (red.par_chunks_mut(band * width))
            .zip(green.par_chunks_mut(band * width))
            .zip(blue.par_chunks_mut(band * width))
            .zip(scratch.rows.par_chunks_mut(piece))
            .enumerate()
            .for_each(|(part, (((red, green), blue), row))| {
                let rows = (red.chunks_exact_mut(width))
                    .zip(green.chunks_exact_mut(width))
                    .zip(blue.chunks_exact_mut(width));
                for (y, ((red, green), blue)) in rows.enumerate() {
                    let y = part * band + y;
                    let mut out = [&mut *red, &mut *green, &mut *blue];
                    for (channel, out) in channels.iter().zip(&mut out) {
                        channel.row(y, self.orientation, row, out);
                    }
                    let [red, green, blue] = out;
                    to_rgb(self.format, [&mut *red, &mut *green, &mut *blue]);
                    if let Some(light) = &self.light {
                        light.convert_rows([red, green, blue]);
                    }
                }
            });
        Ok(())
    }

    /// Returns the channels red, green, blue or Y, U, V of `image`.
    fn channels<'a>(&'a self, image: &ColourImage<'a>) -> [Channel<'a>; 3] {
        let bytes = match self.format {
            ColourFormat::Rgba | ColourFormat::Rgb => [(0, 0), (0, 1), (0, 2)],
            ColourFormat::Bgra => [(0, 2), (0, 1), (0, 0)],
            ColourFormat::Nv12(_) => [(0, 0), (1, 0), (1, 1)],
            ColourFormat::Yuv420(_) => [(0, 0), (1, 0), (2, 0)],
        };
        bytes.map(|(plane, byte)| match (&self.chroma, plane) {
            (Some(axes), 1..) => Channel {
                plane: image.planes()[plane],
                byte,
                axes,
                sensor: Size {
                    width: self.sensor.width.div_ceil(2),
                    height: self.sensor.height.div_ceil(2),
                },
            },
            _ => Channel {
                plane: image.planes()[plane],
                byte,
                axes: &self.luma,
                sensor: self.sensor,
            },
        })
    }
}

impl Channel<'_> {
    /// Resamples output row `y` of the channel to `out`, 0..=255. `row` is working memory.
    fn row(&self, y: usize, orientation: Orientation, row: &mut [f32], out: &mut [f32]) {
        let view = orientation.view(&self.plane, self.sensor);
        let needed = self.axes.x.needed();
        let is_kept = self.axes.x.is_kept();
        let sums = if is_kept { &mut *out } else { &mut row[..needed.len()] };
        sums.fill(0.0);
        for (source, weight) in self.axes.y.taps(y) {
            if weight > 0.0 {
                let first = view.at(needed.start, source) + self.byte;
                wide!(add_samples(self.plane.bytes, first, view.step_x, weight, sums));
            }
        }
        if !is_kept {
            self.axes.x.apply(row, needed.start, out);
        }
    }
}

/// Adds `weight` times the bytes from `first` on, `step` apart, to `sum`.
#[inline(always)]
fn add_samples(bytes: &[u8], first: usize, step: isize, weight: f32, sum: &mut [f32]) {
    #[inline(always)]
    fn apart<const N: usize>(bytes: &[u8], weight: f32, sum: &mut [f32]) {
        let (last, sum) = match sum.split_last_mut() {
            Some(split) => split,
            None => return,
        };
        let (pixels, rest) = bytes.as_chunks::<N>();
        for (sum, pixel) in sum.iter_mut().zip(pixels) {
            *sum += weight * f32::from(pixel[0]);
        }
        // The memory may end after the last sample.
        let end = if sum.len() < pixels.len() {
            pixels[sum.len()][0]
        } else {
            rest[0]
        };
        *last += weight * f32::from(end);
    }
    match step {
        1 => apart::<1>(&bytes[first..], weight, sum),
        2 => apart::<2>(&bytes[first..], weight, sum),
        3 => apart::<3>(&bytes[first..], weight, sum),
        4 => apart::<4>(&bytes[first..], weight, sum),
        _ => {
            let mut at = first;
            for sum in sum {
                *sum += weight * f32::from(bytes[at]);
                at = at.wrapping_add_signed(step);
            }
        }
    }
}

/// Computes the amplitudes for one laser, (H, W), from the luminance of `rgb`, (3, H, W): √(Σ w·a²) with the weights of
/// Rec. 709, because light is the square of the amplitude. Does not allocate.
///
/// # Panics
/// Panics if `rgb` does not have three times as many values as `amplitude`.
pub fn luminance(rgb: &[f32], amplitude: &mut [f32]) {
    const WEIGHTS: [f32; 3] = [0.2126, 0.7152, 0.0722];
    const PART: usize = 1 << 14;
    let size = amplitude.len();
    assert_eq!(rgb.len(), 3 * size);
    amplitude
        .par_chunks_mut(PART)
        .enumerate()
        .for_each(|(part, amplitude)| {
            let plane = |c: usize| &rgb[c * size + part * PART..][..amplitude.len()];
            let (red, green, blue) = (plane(0), plane(1), plane(2));
            wide!({
                for (((to, r), g), b) in amplitude.iter_mut().zip(red).zip(green).zip(blue) {
                    let light = WEIGHTS[0] * r * r + WEIGHTS[1] * g * g + WEIGHTS[2] * b * b;
                    *to = light.sqrt().at_most(1.0);
                }
            });
        });
}

/// Returns the offsets and factors that scale luma to 0..=1 and chroma to −½..=½, and the matrix coefficients red-V,
/// green-U, green-V and blue-U.
pub fn yuv_constants(encoding: YuvEncoding) -> ([f32; 4], [f32; 4]) {
    let (kr, kb) = match encoding.matrix {
        YuvMatrix::Bt601 => (0.299f32, 0.114f32),
        YuvMatrix::Bt709 => (0.2126, 0.0722),
        YuvMatrix::Bt2020 => (0.2627, 0.0593),
    };
    let kg = 1.0 - kr - kb;
    let levels = if encoding.video_range {
        [16.0, 1.0 / 219.0, 128.0, 1.0 / 224.0]
    } else {
        [0.0, 1.0 / 255.0, 128.0, 1.0 / 255.0]
    };
    (
        levels,
        [
            2.0 * (1.0 - kr),
            -2.0 * kb * (1.0 - kb) / kg,
            -2.0 * kr * (1.0 - kr) / kg,
            2.0 * (1.0 - kb),
        ],
    )
}

/// Converts rows of red, green, blue or Y, U, V in 0..=255 to red, green and blue in \[0, 1].
fn to_rgb(format: ColourFormat, [first, second, third]: [&mut [f32]; 3]) {
    match format {
        ColourFormat::Rgba | ColourFormat::Bgra | ColourFormat::Rgb => {
            for row in [first, second, third] {
                for value in row {
                    *value = (*value * (1.0 / 255.0)).clamp(0.0, 1.0);
                }
            }
        }
        ColourFormat::Nv12(encoding) | ColourFormat::Yuv420(encoding) => {
            let (levels, [red_v, green_u, green_v, blue_u]) = yuv_constants(encoding);
            let [black, luma, grey, chroma] = levels;
            for ((a, b), c) in first.iter_mut().zip(second).zip(third) {
                let y = (*a - black) * luma;
                let u = (*b - grey) * chroma;
                let v = (*c - grey) * chroma;
                *a = (y + red_v * v).clamp(0.0, 1.0);
                *b = (y + green_u * u + green_v * v).clamp(0.0, 1.0);
                *c = (y + blue_u * u).clamp(0.0, 1.0);
            }
        }
    }
}
