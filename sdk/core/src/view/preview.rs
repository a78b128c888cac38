//! A small view of a hologram that is cheap enough for every frame: the image for an eye focused at z, as RGBA of a
//! screen's size. [`crate::view::refocus`] computes the view at full resolution.
//!
//! The light of `factor` × `factor` modulator pixels is averaged into one value. Like the aperture, this keeps the
//! middle of the Fourier plane and removes the checkerboard of double phase. The small field is then propagated.
//! Frequencies above 1/(2·`factor`) cycles per pixel are lost, so fine detail far from focus appears less blurred than
//! it should.

use crate::Size;
use crate::display::illumination::Illumination;
use crate::display::panel::PanelPlan;
use crate::display::response::Response;
use crate::display::target::Target;
use crate::frame::Axis;
use crate::optics::asm::Propagator;
use crate::optics::fft::ConvolveScratch;
use crate::optics::zernike::Aberration;
use crate::output::{Layout, rows};
use crate::parallel::prelude::*;
use crate::runtime::error::{Error, Result};
use crate::view::colours::ViewColours;
use num_complex::Complex32;
use phasefront_kernels::wide;

/// The largest number of pixels of an image.
pub const MOST_PIXELS: usize = 1 << 26;
/// The largest number of pixels along a side of an image.
const MOST_SIDE: usize = 1 << 14;

/// A plan for one hologram shape, z and screen size. It is immutable and can be shared between threads.
pub struct Preview {
    colours: usize,
    hologram: Size,
    small: Size,
    factor: usize,
    /// `None` if the hologram is already at z.
    propagators: Option<Vec<Propagator>>,
    /// The illumination and the modulator's size. The hologram is in the middle of the modulator.
    illumination: Option<(Illumination, Size)>,
    response: Response,
    panel: Option<PanelPlan>,
    screen: Size,
    x: Axis,
    y: Axis,
    view: ViewColours,
}

/// Checks that the size of a screen is small enough, before memory is allocated for the image.
///
/// # Errors
/// Returns an error if the image has more than [`MOST_PIXELS`] in all or more than 2¹⁴ pixels along a side.
fn check_screen(Size { width, height }: Size) -> Result<()> {
    if height.max(width) > MOST_SIDE || height * width > MOST_PIXELS {
        return Err(Error::Setting(format!(
            "a preview of {width}×{height} is too large; {MOST_SIDE} pixels a side and {MOST_PIXELS} in all are the most"
        )));
    }
    Ok(())
}

/// The working memory of a [`Preview`] for one call at a time.
pub struct PreviewScratch {
    field: Vec<Complex32>,
    /// The amplitudes of one colour of the field.
    amplitude: Vec<f32>,
    /// The amplitudes of all colours, with rows as wide as the screen.
    wide: Vec<f32>,
    propagation: Option<ConvolveScratch>,
}

impl Preview {
    /// Plans views at `z_m` of holograms of `size` for `target`, through the optics that it corrects, as images of
    /// the size `screen`.
    ///
    /// # Errors
    /// Returns an error if the hologram has fewer than 2 pixels along a side, the screen is empty or has more than
    /// [`MOST_PIXELS`], z is too far away, or a table is for another modulator.
    pub fn new(size: Size, target: &Target, z_m: f64, screen: Size) -> Result<Self> {
        let Size { width, height } = size;
        if height < 2 || width < 2 || screen.height == 0 || screen.width == 0 {
            return Err(Error::Setting(format!(
                "a preview of {screen} of a hologram of {size}: the screen's sides must be at least 1, the hologram's 2"
            )));
        }
        check_screen(screen)?;
        // An even factor weights both colours of the checkerboard equally.
        let ratio = (height as f64 / screen.height as f64).min(width as f64 / screen.width as f64);
        let factor = ((ratio / 2.0) as usize * 2).clamp(2, 8);
        let factor = factor.min(height.min(width) / 2 * 2);
        let small = Size {
            width: width / factor,
            height: height / factor,
        };
        target.check()?;
        let distance_m = z_m - target.display.offset_m();
        let aberration = target.correction.as_ref().map(Aberration::reversed);
        let illumination = target.illumination.clone();
        Ok(Preview {
            colours: target.display.colours(),
            hologram: size,
            small,
            factor,
            propagators: target.propagators(small, factor, distance_m, aberration.as_ref())?,
            illumination: illumination.map(|light| (light, target.modulator())),
            response: target.response.clone().centred(size)?,
            panel: PanelPlan::new(&target.panel, &target.display, size)?,
            screen,
            x: Axis::new(small.width, 0.0, small.width as f64, screen.width),
            y: Axis::new(small.height, 0.0, small.height as f64, screen.height),
            view: ViewColours::Amplitude,
        })
    }

    /// Sets how amplitudes become pixels. Without it, the amplitude is the value.
    pub fn with_view_colours(self, view: ViewColours) -> Self {
        Preview { view, ..self }
    }

    /// Returns how amplitudes become pixels.
    pub fn view_colours(&self) -> &ViewColours {
        &self.view
    }

    /// Returns the number of modulator pixels along each side whose light is averaged.
    pub fn factor(&self) -> usize {
        self.factor
    }

    /// Returns the size of the image.
    pub fn screen(&self) -> Size {
        self.screen
    }

    /// Returns the size of the field after averaging.
    pub fn small(&self) -> Size {
        self.small
    }

    /// Returns the plan that propagates each colour of the small field, or `None` if the hologram is already at z.
    pub fn propagators(&self) -> Option<&[Propagator]> {
        self.propagators.as_deref()
    }

    /// Returns the samples of the small field, along x and y, that each pixel of the image is the mean of.
    pub fn axes(&self) -> [&Axis; 2] {
        [&self.x, &self.y]
    }

    /// Returns the light of each level, exp(iφ), or `None` if it depends on the pixel.
    pub fn lights(&self) -> Option<[Complex32; 256]> {
        match &self.response {
            Response::PerPixel(_) => None,
            alike if self.panel.is_none() => Some(std::array::from_fn(|l| Complex32::cis(alike.phase(l as u8, 0)))),
            _ => None,
        }
    }

    /// Returns the weights of the sums of the light of `factor` × `factor` pixels, (C, h, w): their mean over the gain
    /// of the light that falls on them.
    pub fn weights(&self) -> Vec<f32> {
        let Size { width, height } = self.small;
        let mut weights =
            vec![Complex32::from(1.0 / (self.factor * self.factor) as f32); self.colours * height * width];
        for (row, weights) in weights.chunks_exact_mut(width).enumerate() {
            self.divide_by_light(row / height, row % height, weights);
        }
        weights.iter().map(|weight| weight.re).collect()
    }

    /// Returns working memory for one call at a time, sized for the current thread pool.
    pub fn scratch(&self) -> PreviewScratch {
        let size = self.small.height * self.small.width;
        PreviewScratch {
            field: vec![Complex32::ZERO; size],
            amplitude: vec![0.0; size],
            wide: vec![0.0; self.colours * self.small.height * self.screen.width],
            propagation: self.propagators.as_ref().map(|p| p[0].scratch()),
        }
    }

    /// Renders `levels`, (C, H, W), into `image`: its layout and its memory, whose rows begin so many bytes apart.
    /// `scale` is the amplitude that maps to full light. The view of one laser is grey.
    /// Allocates nothing.
    ///
    /// # Errors
    /// Returns an error if the layout is not Rgb, Rgba or Bgra, or the memory cannot hold the image.
    ///
    /// # Panics
    /// Panics if `levels` does not have the planned length.
    pub fn look(
        &self,
        levels: &[u8],
        scale: f32,
        (layout, bytes, row_stride): (Layout, &mut [u8], usize),
        scratch: &mut PreviewScratch,
    ) -> Result<()> {
        let Size { width, height } = self.hologram;
        let Size {
            width: small_width,
            height: small_height,
        } = self.small;
        assert_eq!(levels.len(), self.colours * height * width);
        if !layout.is_byte_for_each_colour() {
            return Err(Error::Setting(format!(
                "a preview has bytes Rgb, Rgba or Bgra, not {layout:?}"
            )));
        }
        let rows = rows(
            bytes,
            row_stride,
            (self.screen.height, layout.pixel_bytes() * self.screen.width),
        )?;
        let light = scale / (self.factor * self.factor) as f32;
        // If all pixels respond alike, each level has one phase.
        let shown: [Complex32; 256] = match &self.response {
            Response::PerPixel(_) => [Complex32::ZERO; 256],
            alike => std::array::from_fn(|l| Complex32::from_polar(light, alike.phase(l as u8, 0))),
        };
        let planes = levels.chunks_exact(height * width);
        let wide = (scratch.wide).chunks_exact_mut(small_height * self.screen.width);
        for (colour, (levels, wide)) in planes.zip(wide).enumerate() {
            (scratch.field.par_chunks_exact_mut(small_width))
                .zip(levels.par_chunks_exact(width * self.factor))
                .enumerate()
                .for_each(|(y, (sums, rows))| {
                    let first = (colour * height + y * self.factor) * width;
                    match (&self.response, &self.panel) {
                        (Response::PerPixel(_), _) | (_, Some(_)) => self.sum(rows, sums, |level, at| {
                            let added = (self.panel.as_ref()).map_or(0.0, |panel| panel.added(first + at));
                            Complex32::from_polar(light, self.response.phase(level, first + at) - added)
                        }),
                        _ => self.sum(rows, sums, |level, _| shown[usize::from(level)]),
                    }
                    self.divide_by_light(colour, y, sums);
                });
            if let (Some(plans), Some(scratch_wave)) = (&self.propagators, &mut scratch.propagation) {
                plans[colour].propagate(&mut scratch.field, scratch_wave);
            }
            (wide.par_chunks_exact_mut(self.screen.width))
                .zip(scratch.amplitude.par_chunks_exact_mut(small_width))
                .zip(scratch.field.par_chunks_exact(small_width))
                .for_each(|((wide, amplitude), field)| {
                    wide!(for (amplitude, value) in amplitude.iter_mut().zip(field) {
                        *amplitude = value.norm_sqr().sqrt();
                    });
                    self.x.apply(amplitude, 0, wide);
                });
        }
        self.draw(&scratch.wide, layout, rows);
        Ok(())
    }

    /// Sums the light of `factor` × `factor` pixels into each value, from `factor` rows of levels. `light` returns the
    /// light for a level at an index in the rows.
    fn sum(&self, rows: &[u8], sums: &mut [Complex32], light: impl Fn(u8, usize) -> Complex32) {
        let width = self.hologram.width;
        sums.fill(Complex32::ZERO);
        for (y, row) in rows.chunks_exact(width).enumerate() {
            for (x, (sum, pixels)) in (sums.iter_mut()).zip(row.chunks_exact(self.factor)).enumerate() {
                let first = y * width + x * self.factor;
                let lights = pixels.iter().enumerate();
                *sum += lights.map(|(i, l)| light(*l, first + i)).sum::<Complex32>();
            }
        }
    }

    /// Divides row `y` of the small field by the gain of the light that falls on it.
    fn divide_by_light(&self, colour: usize, y: usize, sums: &mut [Complex32]) {
        let Some((illumination, modulator)) = &self.illumination else {
            return;
        };
        let Size { width, height } = self.hologram;
        let middle = |at: usize, hologram: usize, modulator: usize| {
            at * self.factor + self.factor / 2 + modulator.saturating_sub(hologram) / 2
        };
        let all = Size {
            width: modulator.width.max(width),
            height: modulator.height.max(height),
        };
        let y = middle(y, height, modulator.height);
        for (x, sum) in sums.iter_mut().enumerate() {
            let x = middle(x, width, modulator.width);
            *sum /= illumination.gain(colour, y, x, all);
        }
    }

    /// Converts the planes of amplitudes, with rows as wide as the screen, to its pixels.
    fn draw<'a>(&self, wide: &[f32], layout: Layout, rows: impl IndexedParallelIterator<Item = &'a mut [u8]>) {
        /// The pixels that are converted at a time.
        const RUN: usize = 128;
        let (width, height) = (self.screen.width, self.small.height);
        rows.enumerate().for_each(|(y, pixels)| {
            for (run, pixels) in pixels.chunks_mut(RUN * layout.pixel_bytes()).enumerate() {
                let mut amplitudes = [[0.0; RUN]; 3];
                let mut bytes = [[0; RUN]; 3];
                let count = pixels.len() / layout.pixel_bytes();
                for (colour, amplitudes) in amplitudes[..self.colours].iter_mut().enumerate() {
                    let plane = &wide[colour * height * width..][..height * width];
                    for (row, weight) in self.y.taps(y) {
                        let row = &plane[row * width + run * RUN..][..count];
                        wide!(for (amplitude, value) in amplitudes.iter_mut().zip(row) {
                            *amplitude += weight * value;
                        });
                    }
                }
                self.view.rows(&amplitudes[..self.colours], &mut bytes);
                for (x, pixel) in pixels.chunks_exact_mut(layout.pixel_bytes()).enumerate() {
                    layout.write_pixel(0, |colour| bytes[colour][x].into(), pixel);
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::display::Display;
    use crate::display::levels::LevelsMut;
    use crate::encode::brightness::Brightness;
    use crate::encode::{EncoderOptions, Encoding};
    use crate::optics::aperture::Opening;
    use crate::pipeline::display_plan::DisplayPlan;
    use crate::view::refocus::{Refocus, phase_only_field};

    const SIZE: Size = Size { width: 128, height: 96 };

    /// Returns the levels of soft blobs of each colour at z = 1 mm.
    fn hologram(display: &Display, response: &Response) -> (Vec<u8>, f32) {
        let Size { width, height } = SIZE;
        let mut field: Vec<Complex32> = (0..3 * height * width)
            .map(|i| {
                let (c, y, x) = (i / (height * width), i / width % height, i % width);
                let square = (x as f32 - 40.0 - 20.0 * c as f32).powi(2) + (y as f32 - 48.0).powi(2);
                Complex32::new(0.1 + 0.8 * (-square / 400.0).exp(), 0.0)
            })
            .collect();
        // Propagates from the blobs to the midpoint and on to the modulator.
        let home = display.clone().with_offset_m(display.offset_m() - 1e-3).unwrap();
        let target = Target {
            response: response.clone(),
            ..home.into()
        };
        let options = EncoderOptions {
            brightness: Brightness::FrameMax,
            ..Encoding::DoublePhase.into()
        };
        let home = DisplayPlan::new(SIZE, &target, &options).unwrap();
        let mut scratch = home.scratch();
        home.propagate(&mut field, &mut scratch);
        let mut levels = vec![0; 3 * height * width];
        let modulation = home.modulate(None, &mut field, LevelsMut::Bytes(&mut levels), &mut scratch);
        (levels, modulation.scale)
    }

    /// Each pixel is the mean of the samples of the small field that its axes name, for screens of odd sizes and one
    /// laser, with gaps between rows.
    #[test]
    fn pixels_are_means_of_the_small_field() {
        for (toml, screen) in [("", (131, 7)), ("", (300, 129)), ("wavelengths_nm = [532]", (129, 50))] {
            let (width, height) = screen;
            let display = Display::from_toml(toml).unwrap();
            let colours = display.colours();
            let screen = Size { width, height };
            let preview = Preview::new(SIZE, &display.clone().into(), 0.0, screen).unwrap();
            let preview = preview.with_view_colours(ViewColours::new(crate::frame::RgbEncoding::Srgb, &display));
            let small = preview.small();
            let field: Vec<f32> = (0..colours * small.pixels())
                .map(|i| (i * 37 % 101) as f32 / 90.0)
                .collect();
            let mut wide = vec![0.0; colours * small.height * width];
            for (wide, row) in wide.chunks_exact_mut(width).zip(field.chunks_exact(small.width)) {
                preview.x.apply(row, 0, wide);
            }
            let stride = 3 * width + 5;
            let mut image = vec![9; stride * height];
            let into = rows(&mut image, stride, (height, 3 * width)).unwrap();
            preview.draw(&wide, Layout::Rgb, into);
            for (y, row) in image.chunks_exact(stride).enumerate() {
                for (x, pixel) in row[..3 * width].chunks_exact(3).enumerate() {
                    let mean = |colour: usize| -> f32 {
                        let sample = |(at, share): (usize, f32), y| {
                            share * field[(colour * small.height + y) * small.width + at]
                        };
                        let along_x =
                            |(y, share): (usize, f32)| share * preview.x.taps(x).map(|tap| sample(tap, y)).sum::<f32>();
                        preview.y.taps(y).map(along_x).sum()
                    };
                    let amplitudes: Vec<f32> = (0..colours).map(mean).collect();
                    let expected = preview.view.bytes(&amplitudes);
                    let near = pixel.iter().zip(expected).all(|(is, right)| is.abs_diff(right) <= 1);
                    assert!(near, "{toml} {screen} {x} {y}: {pixel:?}, {expected:?} is right");
                }
                assert_eq!(row[3 * width..], [9; 5]);
            }
        }
    }

    #[test]
    fn the_small_view_is_the_full_one_made_small() {
        let response = Response::linear(8).unwrap();
        let Size { width, height } = SIZE;
        for offset_m in [0.0, 3e-3] {
            let display = Display::default().with_offset_m(offset_m).unwrap();
            let (levels, scale) = hologram(&display, &response);
            let target = Target::from(&display);
            let mut shown = vec![Complex32::ZERO; levels.len()];
            phase_only_field(&levels, &response, scale, &mut shown);
            for z_m in [1e-3, -2e-3, offset_m] {
                let full = Refocus::new(SIZE, &display, &[z_m], Some(Opening::centred(1.0))).unwrap();
                let full = full.focal_stack(&shown, &[z_m]).unwrap().remove(0);
                for (screen, factor) in [(Size { width: 64, height: 48 }, 2), (Size { width: 32, height: 24 }, 4)] {
                    let plan = Preview::new(SIZE, &target, z_m, screen).unwrap();
                    assert_eq!(plan.factor(), factor);
                    let mut rgba = vec![0; 4 * screen.height * screen.width];
                    let image = (Layout::Rgba, &mut rgba[..], 4 * screen.width);
                    plan.look(&levels, scale, image, &mut plan.scratch()).unwrap();
                    let mut squares = 0.0;
                    for (i, pixel) in rgba.as_chunks::<4>().0.iter().enumerate() {
                        assert_eq!(pixel[3], 255);
                        let (y, x) = (i / screen.width * factor, i % screen.width * factor);
                        for (c, byte) in pixel[..3].iter().enumerate() {
                            let row = |dy| &full[(c * height + y + dy) * width + x..][..factor];
                            let sum: f32 = (0..factor).flat_map(row).map(|a| a.min(1.0)).sum();
                            let mean = sum / (factor * factor) as f32;
                            squares += (mean - f32::from(*byte) / 255.0).powi(2);
                        }
                    }
                    let error = (squares / (3 * screen.height * screen.width) as f32).sqrt();
                    assert!(error < 0.03, "offset {offset_m} z {z_m} {screen:?}: {error}");
                }
            }
        }
    }

    #[test]
    fn impossible_views_are_refused() {
        let target = Target::default();
        assert!(
            Preview::new(
                Size { width: 50, height: 1 },
                &target,
                0.0,
                Size { width: 10, height: 10 }
            )
            .is_err()
        );
        assert!(Preview::new(SIZE, &target, 0.0, Size { width: 10, height: 0 }).is_err());
        assert!(Preview::new(SIZE, &target, f64::NAN, Size { width: 10, height: 10 }).is_err());
        // A screen can be larger than the hologram.
        assert_eq!(
            Preview::new(
                Size { width: 7, height: 5 },
                &target,
                1e-3,
                Size {
                    width: 200,
                    height: 300
                }
            )
            .unwrap()
            .factor(),
            2
        );
    }
}
