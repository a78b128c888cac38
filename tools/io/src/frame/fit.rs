//! Placement of a picture on a modulator of another size: contained, covering, or pixel for pixel.

use crate::Result;
use image::imageops::{self, FilterType};
use image::{Rgb, Rgb32FImage};
use ndarray::{Array2, Array3, ArrayView3, s};
use phasefront::RgbdFrame;
use phasefront::Size;
use phasefront_core::frame::Crop;

/// How a picture is placed on a modulator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fit {
    /// The whole picture as large as possible, centred on black.
    Contain,
    /// The largest part of the picture that fills the modulator.
    Cover,
    /// Pixel for pixel and centred. A smaller picture is surrounded by black and a larger one is cropped.
    Centre,
}

/// The mapping of a picture's pixels to a modulator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// The visible part of the picture, in its pixels.
    crop: Crop,
    /// The size of that part on the modulator.
    inner: Size,
    /// The top left corner of that part on the modulator, (row, column).
    at: (usize, usize),
    /// The size of the output.
    out: Size,
}

impl Placement {
    /// Creates a placement that leaves the picture unchanged.
    pub fn as_is(picture: Size) -> Self {
        Placement {
            crop: Crop::cover(picture, picture),
            inner: picture,
            at: (0, 0),
            out: picture,
        }
    }

    /// Places a picture of the size `picture` on a modulator of the size `modulator`.
    pub fn new(picture: Size, modulator: Size, fit: Fit) -> Self {
        let whole = Crop::cover(picture, picture);
        let (w, h) = (picture.width as f64, picture.height as f64);
        let (crop, inner) = match fit {
            Fit::Cover => (Crop::cover(picture, modulator), modulator),
            Fit::Contain => {
                let scale = (modulator.height as f64 / h).min(modulator.width as f64 / w);
                let side = |n: f64, most: usize| ((n * scale).round() as usize).clamp(1, most);
                let inner = Size {
                    width: side(w, modulator.width),
                    height: side(h, modulator.height),
                };
                (whole, inner)
            }
            Fit::Centre => {
                let inner = Size {
                    width: picture.width.min(modulator.width),
                    height: picture.height.min(modulator.height),
                };
                let crop = Crop {
                    x: ((picture.width - inner.width) / 2) as f64,
                    y: ((picture.height - inner.height) / 2) as f64,
                    width: inner.width as f64,
                    height: inner.height as f64,
                };
                (crop, inner)
            }
        };
        Placement {
            crop,
            inner,
            at: (
                (modulator.height - inner.height) / 2,
                (modulator.width - inner.width) / 2,
            ),
            out: modulator,
        }
    }

    /// Returns the size of the picture's part on the modulator.
    pub fn inner(&self) -> Size {
        self.inner
    }

    /// Returns the part of a depth image of the size `depth` that corresponds to the visible part of a picture of the
    /// size `picture`, with the same field of view.
    pub fn depth_crop(&self, depth: Size, picture: Size) -> Crop {
        (self.crop).scaled(
            depth.width as f64 / picture.width as f64,
            depth.height as f64 / picture.height as f64,
        )
    }

    /// Resamples the visible part of `rgb`, (3, H, W), to its size on the modulator. Shrinking averages pixels.
    pub fn colour(&self, rgb: ArrayView3<'_, f32>) -> Array3<f32> {
        let (_, height, width) = rgb.dim();
        if *self == Self::as_is(Size { width, height }) {
            return rgb.to_owned();
        }
        let [x, y, w, h] = [self.crop.x, self.crop.y, self.crop.width, self.crop.height].map(|v| v.round() as u32);
        let part = Rgb32FImage::from_fn(w, h, |i, j| {
            let (row, column) = ((y + j) as usize, (x + i) as usize);
            Rgb([0, 1, 2].map(|c| rgb[(c, row.min(height - 1), column.min(width - 1))]))
        });
        let Size { width, height } = self.inner;
        let sized = if (w as usize, h as usize) == (width, height) {
            part
        } else {
            imageops::resize(&part, width as u32, height as u32, FilterType::Triangle)
        };
        Array3::from_shape_fn((3, height, width), |(c, y, x)| {
            sized.get_pixel(x as u32, y as u32).0[c].clamp(0.0, 1.0)
        })
    }

    /// Creates the frame of the modulator's size. Both `rgb`, (3, h, w), and `depth`, (h, w), have the shape of
    /// [`Self::inner`]. Black surrounds `rgb`, and the depth of the nearest pixel surrounds `depth`.
    ///
    /// # Errors
    /// Returns an error if a value is not valid in a frame.
    pub fn frame(&self, rgb: Array3<f32>, depth: Array2<f32>) -> Result<RgbdFrame> {
        if self.inner == self.out {
            return Ok(RgbdFrame::new(rgb, depth)?);
        }
        let ((top, left), Size { width, height }) = (self.at, self.inner);
        let mut wide = Array3::zeros((3, self.out.height, self.out.width));
        wide.slice_mut(s![.., top..top + height, left..left + width])
            .assign(&rgb);
        let deep = Array2::from_shape_fn(self.out.shape(), |(y, x)| {
            let row = y.clamp(top, top + height - 1) - top;
            let column = x.clamp(left, left + width - 1) - left;
            depth[(row, column)]
        });
        Ok(RgbdFrame::new(wide, deep)?)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn picture(size: Size) -> (Array3<f32>, Array2<f32>) {
        let Size { width, height } = size;
        let rgb = Array3::from_shape_fn((3, height, width), |(c, y, x)| (c + y + x) as f32 / 100.0);
        let depth = Array2::from_shape_fn((height, width), |(y, x)| (y * width + x) as f32 / 1000.0);
        (rgb, depth)
    }

    /// Returns the nearest samples of the visible part of `depth`, which has the picture's shape.
    fn sampled(placement: &Placement, depth: &Array2<f32>) -> Array2<f32> {
        let size = Size::from_shape(depth.dim());
        let crop = placement.depth_crop(size, size);
        let Size { width, height } = placement.inner();
        Array2::from_shape_fn((height, width), |(y, x)| {
            let row = crop.y + (y as f64 + 0.5) * crop.height / height as f64;
            let column = crop.x + (x as f64 + 0.5) * crop.width / width as f64;
            depth[(row as usize, column as usize)]
        })
    }

    fn placed(size: Size, modulator: Size, fit: Fit) -> RgbdFrame {
        let (rgb, depth) = picture(size);
        let placement = Placement::new(size, modulator, fit);
        let frame = placement
            .frame(placement.colour(rgb.view()), sampled(&placement, &depth))
            .unwrap();
        assert_eq!(frame.size(), modulator);
        frame
    }

    #[test]
    fn a_picture_pixel_for_pixel_lies_in_the_middle_or_is_cut() {
        let (rgb, depth) = picture(Size { width: 6, height: 4 });
        let frame = placed(Size { width: 6, height: 4 }, Size { width: 8, height: 8 }, Fit::Centre);
        assert_eq!(frame.rgb().slice(s![.., 2..6, 1..7]), rgb);
        assert_eq!(frame.depth().slice(s![2..6, 1..7]), depth);
        assert_eq!(frame.rgb()[(0, 1, 3)], 0.0);
        assert_eq!(frame.depth()[(0, 0)], depth[(0, 0)]);
        assert_eq!(frame.depth()[(7, 7)], depth[(3, 5)]);
        let cut = placed(Size { width: 6, height: 4 }, Size { width: 2, height: 2 }, Fit::Centre);
        assert_eq!(cut.rgb(), rgb.slice(s![.., 1..3, 2..4]));
        assert_eq!(cut.depth(), depth.slice(s![1..3, 2..4]));
    }

    #[test]
    fn a_picture_is_shown_whole_or_fills_the_modulator() {
        let whole = placed(
            Size { width: 6, height: 4 },
            Size { width: 12, height: 16 },
            Fit::Contain,
        );
        assert!(whole.rgb().slice(s![.., ..4, ..]).iter().all(|v| *v == 0.0));
        assert!(whole.rgb().slice(s![1.., 4..12, ..]).iter().all(|v| *v > 0.0));
        let full = placed(Size { width: 6, height: 4 }, Size { width: 8, height: 8 }, Fit::Cover);
        assert!(full.rgb().slice(s![1.., .., ..]).iter().all(|v| *v > 0.0));
        // The middle four of six columns are visible, each twice.
        let (_, depth) = picture(Size { width: 6, height: 4 });
        assert_eq!(full.depth()[(0, 0)], depth[(0, 1)]);
        assert_eq!(full.depth()[(7, 7)], depth[(3, 4)]);
    }

    #[test]
    fn a_picture_as_it_is_stays() {
        let (rgb, depth) = picture(Size { width: 7, height: 5 });
        let placement = Placement::as_is(Size { width: 7, height: 5 });
        let frame = placement
            .frame(placement.colour(rgb.view()), sampled(&placement, &depth))
            .unwrap();
        assert_eq!((frame.rgb(), frame.depth()), (rgb.view(), depth.view()));
    }
}
