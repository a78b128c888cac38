//! A plane of samples in a camera's memory, and how the picture in it must be turned to stand upright.

use crate::runtime::error::{Error, Result};

/// One plane of a camera image, as the platform's API hands it out; borrowed, never copied here.
#[derive(Debug, Clone, Copy, Default)]
pub struct Plane<'a> {
    /// The memory, from the first pixel of the first row on. What lies behind the last pixel may be missing.
    pub bytes: &'a [u8],
    /// Bytes from one row to the next.
    pub row_stride: usize,
    /// Bytes from one pixel to the next in a row.
    pub pixel_stride: usize,
}

impl<'a> Plane<'a> {
    /// A plane of rows `row_stride` bytes apart, pixels `pixel_stride` bytes apart.
    pub fn new(bytes: &'a [u8], row_stride: usize, pixel_stride: usize) -> Self {
        Plane {
            bytes,
            row_stride,
            pixel_stride,
        }
    }

    /// Checks that (`height`, `width`) pixels of `pixel_bytes` lie in it.
    pub fn check(&self, what: &str, width: usize, height: usize, pixel_bytes: usize) -> Result<()> {
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

/// How far a sensor's picture must be turned clockwise to stand upright.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Rotation {
    /// Not at all.
    #[default]
    Upright,
    /// A quarter turn.
    Clockwise90,
    /// Half a turn.
    Half,
    /// Three quarters.
    Clockwise270,
}

/// How a sensor's picture becomes the one that is shown: turned, then mirrored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Orientation {
    /// The turn.
    pub rotation: Rotation,
    /// Whether left and right are exchanged after the turn, as front cameras need.
    pub mirrored: bool,
}

/// Where the pixels of an upright picture lie in a plane's memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct View {
    /// The byte of the upright picture's first pixel.
    pub origin: usize,
    /// Bytes to the next pixel to the right.
    pub step_x: isize,
    /// Bytes to the next pixel below.
    pub step_y: isize,
}

impl View {
    /// The first byte of pixel (x, y).
    pub fn at(&self, x: usize, y: usize) -> usize {
        self.origin
            .wrapping_add_signed(self.step_x * x as isize)
            .wrapping_add_signed(self.step_y * y as isize)
    }
}

impl Orientation {
    /// The upright picture's (H, W) of a sensor's (`height`, `width`).
    pub fn upright_shape(self, height: usize, width: usize) -> (usize, usize) {
        match self.rotation {
            Rotation::Upright | Rotation::Half => (height, width),
            Rotation::Clockwise90 | Rotation::Clockwise270 => (width, height),
        }
    }

    /// Whether the upright picture runs against the sensor along x and along y.
    #[doc(hidden)]
    pub fn flips(self) -> (bool, bool) {
        let (x, y) = match self.rotation {
            Rotation::Upright => (false, false),
            Rotation::Clockwise90 => (true, false),
            Rotation::Half => (true, true),
            Rotation::Clockwise270 => (false, true),
        };
        (x != self.mirrored, y)
    }

    /// The sensor's pixel (x, y) that upright pixel (`x`, `y`) shows, for a sensor of (`height`, `width`).
    #[doc(hidden)]
    pub fn sensor_pixel(self, x: usize, y: usize, (height, width): (usize, usize)) -> (usize, usize) {
        let (_, upright_width) = self.upright_shape(height, width);
        let x = if self.mirrored { upright_width - 1 - x } else { x };
        match self.rotation {
            Rotation::Upright => (x, y),
            Rotation::Clockwise90 => (y, height - 1 - x),
            Rotation::Half => (width - 1 - x, height - 1 - y),
            Rotation::Clockwise270 => (width - 1 - y, x),
        }
    }

    /// The upright picture of `plane`, which holds a sensor's (`height`, `width`).
    #[doc(hidden)]
    pub fn view(self, plane: &Plane<'_>, (height, width): (usize, usize)) -> View {
        let at = |(x, y): (usize, usize)| (y * plane.row_stride + x * plane.pixel_stride) as isize;
        let (upright_height, upright_width) = self.upright_shape(height, width);
        let pixel = |x, y| at(self.sensor_pixel(x, y, (height, width)));
        let origin = pixel(0, 0);
        let step = |there: bool, x, y| if there { pixel(x, y) - origin } else { 0 };
        View {
            origin: origin as usize,
            step_x: step(upright_width > 1, 1, 0),
            step_y: step(upright_height > 1, 0, 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture 1 2 3 / 4 5 6 in every orientation, by the view's steps and by the sensor's pixels.
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
            let (height, width) = orientation.upright_shape(2, 3);
            let view = orientation.view(&plane, (2, 3));
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
            let refused = Plane::new(&bytes, row, pixel).check("colour", width, height, 4);
            assert!(refused.is_err_and(|e| e.to_string().contains(word)), "{word}");
        }
        // The last row ends with its last pixel; one row needs no stride.
        assert!(Plane::new(&bytes, 60, 4).check("colour", 10, 2, 4).is_ok());
        assert!(Plane::new(&bytes, 0, 4).check("colour", 25, 1, 4).is_ok());
    }
}
