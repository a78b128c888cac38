//! RGB-D frames as network input.

use super::Source;
use crate::Size;
use crate::frame::RgbdFrame;

/// Reads the planes of [`super::InputKind::Rgbd`]: red, green, blue and depth, each minus ½. The amplitude of one laser
/// is used for all three colours. For [`super::InputKind::RgbdXy`], the position in the frame follows.
impl Source for RgbdFrame {
    #[inline(always)]
    fn read(&self, plane: usize, row: usize, from: usize, into: &mut [f32]) {
        let Size { width, height } = self.size();
        let place = |at: usize, n: usize| (at as f32 + 0.5) / n as f32 - 0.5;
        let (rgb, depth) = self.values();
        let (values, plane) = match plane {
            4 => {
                let columns = into.iter_mut().enumerate();
                return columns.for_each(|(x, to)| *to = place(from + x, width));
            }
            5 => return into.fill(place(row, height)),
            3 => (depth, 0),
            colour => (rgb, colour % self.colours()),
        };
        let at = (plane * height + row) * width + from;
        for (to, from) in into.iter_mut().zip(&values[at..]) {
            *to = from - 0.5;
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::display::Display;
    use ndarray::{Array2, Array3};

    #[test]
    fn a_network_reads_rows_of_centred_planes() {
        let rgb = Array3::from_shape_fn((3, 2, 4), |(c, y, x)| (c * 8 + y * 4 + x) as f32 / 24.0);
        let depth = Array2::from_shape_fn((2, 4), |(y, x)| (y * 4 + x) as f32 / 8.0);
        // The same values in another memory order.
        let mut turned = Array3::zeros((4, 2, 3)).reversed_axes();
        turned.assign(&rgb);
        for rgb in [rgb, turned] {
            let frame = RgbdFrame::new(rgb, depth.clone()).unwrap();
            let mut row = [0.0; 2];
            frame.read(1, 1, 2, &mut row);
            assert_eq!(row, [14.0 / 24.0 - 0.5, 15.0 / 24.0 - 0.5]);
            frame.read(3, 1, 0, &mut row);
            assert_eq!(row, [0.0, 0.125]);
            frame.read(4, 1, 2, &mut row);
            assert_eq!(row, [0.125, 0.375]);
            frame.read(5, 1, 2, &mut row);
            assert_eq!(row, [0.25, 0.25]);
            let one = Display::from_toml("wavelengths_nm = [532]").unwrap();
            let grey = frame.for_display(&one);
            for plane in 0..3 {
                grey.read(plane, 1, 2, &mut row);
                assert_eq!(row, [grey.rgb()[(0, 1, 2)] - 0.5, grey.rgb()[(0, 1, 3)] - 0.5]);
            }
        }
    }
}
