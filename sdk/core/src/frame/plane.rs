//! Planes of samples in a camera's memory, and the orientation of the image in them.

use crate::Size;
use crate::runtime::error::{Error, Result};

/// One plane of a camera image, as the platform's API provides it. It is borrowed, not copied.
#[derive(Debug, Clone, Copy, Default)]
pub struct Plane<'a> {
    /// The memory, starting at the first pixel of the first row. It may end after the last pixel.
    pub bytes: &'a [u8],
    /// The number of bytes from one row to the next.
    pub row_stride: usize,
    /// The number of bytes from one pixel to the next in a row.
    pub pixel_stride: usize,
}

impl<'a> Plane<'a> {
    /// Creates a plane with rows `row_stride` bytes apart and pixels `pixel_stride` bytes apart.
    pub fn new(bytes: &'a [u8], row_stride: usize, pixel_stride: usize) -> Self {
        Plane {
            bytes,
            row_stride,
            pixel_stride,
        }
    }

    /// Checks that the plane holds an image of `size`, pixels of `pixel_bytes` bytes.
    pub fn check(&self, what: &str, size: Size, pixel_bytes: usize) -> Result<()> {
        let Size { width, height } = size;
        if self.pixel_stride < pixel_bytes {
            return Err(Error::Frame(format!(
                "{what}: a pixel stride of {} bytes is too small; a pixel has {pixel_bytes}",
                self.pixel_stride
            )));
        }
        let row = (width - 1)
            .saturating_mul(self.pixel_stride)
            .saturating_add(pixel_bytes);
        if self.row_stride < row && height > 1 {
            return Err(Error::Frame(format!(
                "{what}: a row stride of {} bytes is too small; {width} pixels of {} bytes need {row}",
                self.row_stride, self.pixel_stride
            )));
        }
        let need = (height - 1).saturating_mul(self.row_stride).saturating_add(row);
        if self.bytes.len() < need {
            return Err(Error::Frame(format!(
                "{what}: {} bytes are too few; {width}×{height} pixels with a row stride of {} need {need}",
                self.bytes.len(),
                self.row_stride
            )));
        }
        Ok(())
    }
}

/// The clockwise rotation that turns a sensor's image upright.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Rotation {
    /// No rotation.
    #[default]
    Upright,
    /// A quarter turn.
    Clockwise90,
    /// Half a turn.
    Half,
    /// Three quarters of a turn.
    Clockwise270,
}

/// The transformation from a sensor's image to the upright image: a rotation, then mirroring.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Orientation {
    /// The rotation.
    pub rotation: Rotation,
    /// Whether left and right are exchanged after the rotation, as front cameras need.
    pub mirrored: bool,
}

/// The location of an upright image's pixels in a plane's memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct View {
    /// The byte offset of the upright image's first pixel.
    pub origin: usize,
    /// The number of bytes to the next pixel on the right.
    pub step_x: isize,
    /// The number of bytes to the next pixel below.
    pub step_y: isize,
}

impl View {
    /// Returns the offset of the first byte of pixel (x, y).
    pub fn at(&self, x: usize, y: usize) -> usize {
        self.origin
            .wrapping_add_signed(self.step_x * x as isize)
            .wrapping_add_signed(self.step_y * y as isize)
    }
}

impl Orientation {
    /// Returns the size of the upright image of a sensor's image of `size`.
    pub fn upright_size(self, size: Size) -> Size {
        match self.rotation {
            Rotation::Upright | Rotation::Half => size,
            Rotation::Clockwise90 | Rotation::Clockwise270 => Size {
                width: size.height,
                height: size.width,
            },
        }
    }

    /// Returns whether the upright image runs opposite to the sensor along x and along y.
    pub(crate) fn flips(self) -> (bool, bool) {
        let (x, y) = match self.rotation {
            Rotation::Upright => (false, false),
            Rotation::Clockwise90 => (true, false),
            Rotation::Half => (true, true),
            Rotation::Clockwise270 => (false, true),
        };
        (x != self.mirrored, y)
    }

    /// Returns the sensor pixel (x, y) at upright pixel (`x`, `y`), for a sensor's image of that size.
    pub(crate) fn sensor_pixel(self, x: usize, y: usize, size: Size) -> (usize, usize) {
        let Size { width, height } = size;
        let upright_width = self.upright_size(size).width;
        let x = if self.mirrored { upright_width - 1 - x } else { x };
        match self.rotation {
            Rotation::Upright => (x, y),
            Rotation::Clockwise90 => (y, height - 1 - x),
            Rotation::Half => (width - 1 - x, height - 1 - y),
            Rotation::Clockwise270 => (width - 1 - y, x),
        }
    }

    /// Returns the view of the upright image in `plane`, which holds a sensor's image of that size.
    pub(crate) fn view(self, plane: &Plane<'_>, size: Size) -> View {
        let at = |(x, y): (usize, usize)| (y * plane.row_stride + x * plane.pixel_stride) as isize;
        let upright = self.upright_size(size);
        let pixel = |x, y| at(self.sensor_pixel(x, y, size));
        let origin = pixel(0, 0);
        let step = |there: bool, x, y| if there { pixel(x, y) - origin } else { 0 };
        View {
            origin: origin as usize,
            step_x: step(upright.width > 1, 1, 0),
            step_y: step(upright.height > 1, 0, 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks the image 1 2 3 / 4 5 6 in several orientations, by the view's steps and the sensor's pixels.
    #[test]
    fn pictures_stand_upright() {
        let bytes = [1, 0, 2, 0, 3, 0, 9, 4, 0, 5, 0, 6];
        let plane = Plane::new(&bytes, 7, 2);
        for (rotation, mirrored, upright) in [
            (Rotation::Upright, false, vec![1, 2, 3, 4, 5, 6]),
            (Rotation::Upright, true, vec![3, 2, 1, 6, 5, 4]),
            (Rotation::Clockwise90, false, vec![4, 1, 5, 2, 6, 3]),
            (Rotation::Clockwise90, true, vec![1, 4, 2, 5, 3, 6]),
            (Rotation::Half, false, vec![6, 5, 4, 3, 2, 1]),
            (Rotation::Clockwise270, false, vec![3, 6, 2, 5, 1, 4]),
            (Rotation::Clockwise270, true, vec![6, 3, 5, 2, 4, 1]),
        ] {
            let orientation = Orientation { rotation, mirrored };
            let size = Size { width: 3, height: 2 };
            let Size { width, height } = orientation.upright_size(size);
            let view = orientation.view(&plane, size);
            for (i, value) in upright.iter().enumerate() {
                let (x, y) = (i % width, i / width);
                assert!(y < height);
                assert_eq!(bytes[view.at(x, y)], *value, "{orientation:?} {x} {y}");
            }
        }
    }

    #[test]
    fn planes_that_hold_too_little_are_named() {
        let bytes = [0; 100];
        for (row, pixel, width, height, word) in [
            (40, 3, 10, 2, "pixel stride of 3"),
            (39, 4, 10, 2, "row stride of 39"),
            (40, 4, 10, 3, "100 bytes are too few"),
            (usize::MAX / 2, 4, 10, 9, "too few"),
        ] {
            let refused = Plane::new(&bytes, row, pixel).check("colour", Size { width, height }, 4);
            assert!(refused.is_err_and(|e| e.to_string().contains(word)), "{word}");
        }
        // The last row ends with its last pixel, and a single row needs no stride.
        assert!(
            Plane::new(&bytes, 60, 4)
                .check("colour", Size { width: 10, height: 2 }, 4)
                .is_ok()
        );
        assert!(
            Plane::new(&bytes, 0, 4)
                .check("colour", Size { width: 25, height: 1 }, 4)
                .is_ok()
        );
    }
}
