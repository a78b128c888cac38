//! Alignment of depth with another camera: each reading is projected to its position in the other camera's image.

use crate::Size;
use crate::runtime::error::{Error, Result};

/// The pinhole model of a camera, in pixels of its image before the image is turned upright. The middle of the first
/// pixel is (0, 0).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    /// The focal length along x.
    pub fx: f64,
    /// The focal length along y.
    pub fy: f64,
    /// The x of the principal point.
    pub cx: f64,
    /// The y of the principal point.
    pub cy: f64,
}

/// The intrinsics and the relative pose of the depth camera and the colour camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cameras {
    /// The intrinsics of the colour camera.
    pub colour: Intrinsics,
    /// The intrinsics of the depth camera.
    pub depth: Intrinsics,
    /// The rotation from the depth camera to the colour camera, as rows of the matrix. A point p of the depth camera (x
    /// right, y down, z forward) is at `rotation`·p + `translation_m` of the colour camera.
    pub rotation: [[f64; 3]; 3],
    /// The translation, in metres.
    pub translation_m: [f64; 3],
}

impl Cameras {
    /// Creates cameras at the same position with the same orientation.
    pub fn concentric(colour: Intrinsics, depth: Intrinsics) -> Self {
        Cameras {
            colour,
            depth,
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            translation_m: [0.0; 3],
        }
    }

    /// Checks the intrinsics and the pose.
    ///
    /// # Errors
    /// Returns an error if a focal length is not positive or a number is not finite.
    pub fn check(&self) -> Result<()> {
        for (what, i) in [("colour", self.colour), ("depth", self.depth)] {
            if !(i.fx > 0.0 && i.fy > 0.0 && [i.fx, i.fy, i.cx, i.cy].iter().all(|v| v.is_finite())) {
                return Err(Error::Frame(format!(
                    "intrinsics of {what} are {i:?}; focal lengths must be above 0 and all numbers finite"
                )));
            }
        }
        let rigid = self.rotation.iter().flatten().chain(&self.translation_m);
        if rigid.into_iter().any(|v| !v.is_finite()) {
            return Err(Error::Frame(format!(
                "the pose between the cameras is {:?}, {:?} m; all numbers must be finite",
                self.rotation, self.translation_m
            )));
        }
        Ok(())
    }

    /// Projects `metres` and `confidence` of the depth camera, (h, w) with NaN for no reading, to the colour camera and
    /// writes them to `to` and `to_confidence`, (h, w).
    ///
    /// The output covers the whole colour image of `colour_size` at the resolution of the depth image. If
    /// several readings meet at a pixel, the nearest one is kept; a pixel without a reading is NaN. Returns the number
    /// of pixels with a reading. Does not allocate.
    ///
    /// # Panics
    /// Panics if a length is not h·w.
    pub(crate) fn reproject(
        &self,
        Size { width, height }: Size,
        colour_size: Size,
        (metres, confidence): (&[f32], &[f32]),
        (to, to_confidence): (&mut [f32], &mut [f32]),
    ) -> usize {
        assert!([metres.len(), confidence.len(), to.len(), to_confidence.len()] == [height * width; 4]);
        to.fill(f32::NAN);
        to_confidence.fill(0.0);
        let scale_x = width as f64 / colour_size.width as f64;
        let scale_y = height as f64 / colour_size.height as f64;
        let mut seen = 0;
        for (i, (&z, &sure)) in metres.iter().zip(confidence).enumerate() {
            if z.is_nan() {
                continue;
            }
            let (x, y, z) = ((i % width) as f64, (i / width) as f64, f64::from(z));
            let point = [
                (x - self.depth.cx) / self.depth.fx * z,
                (y - self.depth.cy) / self.depth.fy * z,
                z,
            ];
            let turned = |row: usize| {
                let [a, b, c] = self.rotation[row];
                a * point[0] + b * point[1] + c * point[2] + self.translation_m[row]
            };
            let distance = turned(2);
            if distance <= 0.0 {
                continue;
            }
            // The middle of pixel u of the colour image is at (u + ½)·scale − ½ in this grid.
            let u = self.colour.fx * turned(0) / distance + self.colour.cx;
            let v = self.colour.fy * turned(1) / distance + self.colour.cy;
            let (u, v) = ((u + 0.5) * scale_x - 0.5, (v + 0.5) * scale_y - 0.5);
            // A reading is a small patch. It fills both neighbours along each axis, because an enlarged image would
            // have gaps otherwise.
            for (u, v) in [
                (u.floor(), v.floor()),
                (u.ceil(), v.floor()),
                (u.floor(), v.ceil()),
                (u.ceil(), v.ceil()),
            ] {
                if u < 0.0 || v < 0.0 || u >= width as f64 || v >= height as f64 {
                    continue;
                }
                let at = v as usize * width + u as usize;
                seen += usize::from(to[at].is_nan());
                if to[at].is_nan() || (distance as f32) < to[at] {
                    to[at] = distance as f32;
                    to_confidence[at] = sure;
                }
            }
        }
        seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Intrinsics = Intrinsics {
        fx: 50.0,
        fy: 50.0,
        cx: 31.5,
        cy: 23.5,
    };

    #[test]
    fn the_same_camera_sees_the_same() {
        let metres: Vec<f32> = (0..64 * 48)
            .map(|i| {
                if i % 7 == 0 {
                    f32::NAN
                } else {
                    1.0 + (i % 64) as f32 / 64.0
                }
            })
            .collect();
        let sure: Vec<f32> = (0..64 * 48).map(|i| i as f32).collect();
        let (mut to, mut to_sure) = (vec![0.0; 64 * 48], vec![0.0; 64 * 48]);
        // The same image at twice the resolution.
        let colour = Intrinsics {
            fx: 100.0,
            fy: 100.0,
            cx: 63.5,
            cy: 47.5,
        };
        let sizes = [Size { width: 64, height: 48 }, Size { width: 128, height: 96 }];
        for (colour, size) in [CAMERA, colour].into_iter().zip(sizes) {
            let cameras = Cameras::concentric(colour, CAMERA);
            cameras.reproject(
                Size { width: 64, height: 48 },
                size,
                (&metres, &sure),
                (&mut to, &mut to_sure),
            );
            let kept = (metres.iter().zip(&to))
                .filter(|(a, b)| (**a - **b).abs() < 1e-5)
                .count();
            // Rounding may move a reading's patch by a pixel, but most patches stay alone.
            assert!(kept > 64 * 48 / 2, "{kept}");
        }
    }

    /// A wall at 2 m behind a square at 1 m, seen from 0.1 m to the right. The square moves left by f·t/z = 5 pixels,
    /// the wall by 2.5, and the part of the wall that the square hid is a hole.
    #[test]
    fn near_things_move_farther_and_leave_holes() {
        let square = |x: usize, y: usize| (24..40).contains(&x) && (16..32).contains(&y);
        let metres: Vec<f32> = (0..64 * 48)
            .map(|i| if square(i % 64, i / 64) { 1.0 } else { 2.0 })
            .collect();
        let sure = vec![1.0; 64 * 48];
        let (mut to, mut to_sure) = (vec![0.0; 64 * 48], vec![0.0; 64 * 48]);
        let cameras = Cameras {
            translation_m: [-0.1, 0.0, 0.0],
            ..Cameras::concentric(CAMERA, CAMERA)
        };
        let seen = cameras.reproject(
            Size { width: 64, height: 48 },
            Size { width: 64, height: 48 },
            (&metres, &sure),
            (&mut to, &mut to_sure),
        );
        let row = &to[24 * 64..25 * 64];
        assert!(row[20..34].iter().all(|z| (*z - 1.0).abs() < 1e-6), "{row:?}");
        assert!(row[36..37].iter().all(|z| z.is_nan()), "{row:?}");
        assert!(
            row[..18].iter().chain(&row[39..60]).all(|z| (*z - 2.0).abs() < 1e-6),
            "{row:?}"
        );
        assert_eq!(seen, to.iter().filter(|z| !z.is_nan()).count());
        assert!(to.iter().zip(&to_sure).all(|(z, s)| z.is_nan() == (*s == 0.0)));
    }

    #[test]
    fn impossible_cameras_are_named() {
        let bad = Intrinsics { fx: 0.0, ..CAMERA };
        let refused = Cameras::concentric(CAMERA, bad).check();
        assert!(refused.is_err_and(|e| e.to_string().contains("intrinsics of depth")));
        let mut cameras = Cameras::concentric(CAMERA, CAMERA);
        assert!(cameras.check().is_ok());
        cameras.translation_m[1] = f64::NAN;
        assert!(cameras.check().is_err_and(|e| e.to_string().contains("pose")));
    }
}
