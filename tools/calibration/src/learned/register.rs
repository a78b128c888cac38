//! The place of the modulator in a photograph of a hologram, refined by what a model says that the hologram shows.

use crate::camera::homography::Homography;
use crate::cholesky;
use ndarray::Array2;
use phasefront_io::Result;

/// Returns `map`, from pixels of the modulator to those of a photograph, moved such that `light`, the photograph at the
/// middle of each pixel, fits `expected`. One step of Gauss and Newton moves the four corners. `border` pixels are left
/// out.
///
/// # Errors
/// Returns an error if three of the corners then lie on one line.
pub(crate) fn refined(
    map: &Homography,
    light: &Array2<f32>,
    expected: &Array2<f32>,
    border: usize,
) -> Result<Homography> {
    let (height, width) = light.dim();
    let mut normal = vec![vec![0.0; 8]; 8];
    let mut right = [0.0; 8];
    for y in border.max(1)..height - border.max(1) {
        for x in border.max(1)..width - border.max(1) {
            let slope = |before: f32, after: f32| f64::from(after - before) / 2.0;
            let along_x = slope(expected[(y, x - 1)], expected[(y, x + 1)]);
            let along_y = slope(expected[(y - 1, x)], expected[(y + 1, x)]);
            let missing = f64::from(light[(y, x)] - expected[(y, x)]);
            let (u, v) = ((x as f64 + 0.5) / width as f64, (y as f64 + 0.5) / height as f64);
            let corners = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
            let row: [f64; 8] = std::array::from_fn(|i| corners[i / 2] * if i % 2 == 0 { along_x } else { along_y });
            for i in 0..8 {
                right[i] += row[i] * missing;
                for j in 0..=i {
                    normal[i][j] += row[i] * row[j];
                }
            }
        }
    }
    let most = (0..8).map(|i| normal[i][i]).fold(0.0, f64::max);
    cholesky::solve(&mut normal, &mut right, 1e-9 * most.max(f64::MIN_POSITIVE));
    let (w, h) = (width as f64, height as f64);
    let corners = [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]];
    // The photograph shows at each corner what the model expects `right` pixels further. A far step is no registration.
    let moved = |i: usize| map.map([0, 1].map(|axis| corners[i][axis] - right[2 * i + axis].clamp(-1.0, 1.0)));
    Homography::through(corners, std::array::from_fn(moved))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_moved_picture_is_found() {
        let picture =
            |x: f64, y: f64| (0.5 + 0.2 * (0.31 * x + 0.1 * y).sin() + 0.2 * (0.27 * y - 0.07 * x).cos()) as f32;
        let (height, width) = (40, 60);
        let corners = [[0.0, 0.0], [60.0, 0.0], [0.0, 40.0], [60.0, 40.0]];
        let truth = [[0.3, -0.2], [60.4, 0.1], [-0.2, 40.3], [60.1, 39.8]];
        let back = Homography::through(truth, corners).unwrap();
        let at = |map: &Homography| {
            Array2::from_shape_fn((height, width), |(y, x)| {
                // The photograph at `map`(x, y) shows the modulator's pixel `back`(`map`(x, y)).
                let [x, y] = back.map(map.map([x as f64 + 0.5, y as f64 + 0.5]));
                picture(x, y)
            })
        };
        let expected = Array2::from_shape_fn((height, width), |(y, x)| picture(x as f64 + 0.5, y as f64 + 0.5));
        let mut map = Homography::through(corners, corners).unwrap();
        for _ in 0..4 {
            map = refined(&map, &at(&map), &expected, 2).unwrap();
        }
        for (corner, truth) in corners.into_iter().zip(truth) {
            let [x, y] = map.map(corner);
            assert!(
                (x - truth[0]).abs() < 0.02 && (y - truth[1]).abs() < 0.02,
                "{x} {y} {truth:?}"
            );
        }
    }
}
