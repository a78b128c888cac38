//! The reference for [`super::hologram`]: the point-based method as it is defined, per point and pixel, in f64, without
//! tables and with one ray at a time. It is slow.

use super::{Occlusion, radius_px, sub_hologram};
use crate::sm_lbm::{check_planes, plane_of_depth, plane_z_m};
use ndarray::Array3;
use num_complex::Complex64;
use phasefront::Display;
use phasefront::Size;
use phasefront_io::Result;
use phasefront_io::ldi::Ldi;

/// A point: its position, its plane and its colour.
type Point = ([i64; 2], usize, [f32; 3]);

/// Computes the hologram that [`super::hologram`] approximates.
///
/// # Errors
/// Returns an error if there are no planes.
pub fn hologram(ldi: &Ldi, display: &Display, planes: usize, occlusion: Occlusion) -> Result<Array3<Complex64>> {
    check_planes(planes)?;
    let Size { width, height } = ldi.size();
    let ldi = ldi.for_display(display);
    let mut points: Vec<Point> = Vec::new();
    let layers = match occlusion {
        Occlusion::Input => 1,
        _ => ldi.layers.len(),
    };
    for layer in &ldi.layers[..layers] {
        for ((y, x), d) in layer.depth.indexed_iter().filter(|(_, d)| !d.is_nan()) {
            let (place, plane) = ([y as i64, x as i64], plane_of_depth(*d, planes));
            if !points.iter().any(|p| (p.0, p.1) == (place, plane)) {
                points.push((place, plane, [0, 1, 2].map(|c| layer.rgb[(c, y, x)])));
            }
        }
    }
    let mut sum = Array3::from_elem((display.colours(), height, width), Complex64::ZERO);
    for point @ ([y, x], plane, rgb) in &points {
        let z_m = plane_z_m(*plane, planes, display);
        for (c, &lambda) in display.wavelengths_m().iter().enumerate() {
            let pattern = sub_hologram(z_m, lambda, display.pitch_m());
            let radius = radius_px(z_m, lambda, display.pitch_m()) as i64;
            for ((i, j), value) in pattern.indexed_iter() {
                let (dy, dx) = (i as i64 - radius, j as i64 - radius);
                let inside = (0..height as i64).contains(&(y + dy)) && (0..width as i64).contains(&(x + dx));
                let geometric = occlusion == Occlusion::Geometric;
                if inside && !(geometric && blocked(point, [dy, dx], &points, planes)) {
                    let pixel = (c, (y + dy) as usize, (x + dx) as usize);
                    sum[pixel] += value * f64::from(rgb[c]);
                }
            }
        }
    }
    Ok(sum)
}

/// Checks whether the ray from a point to the pixel of z = 0 at offset `to` meets another point on its way to the
/// front.
fn blocked((from, plane, _): &Point, to: [i64; 2], points: &[Point], planes: usize) -> bool {
    // Returns the z position in units of half a plane, positive toward the viewer. In these units all plane centres are
    // integers.
    let z = |plane: usize| planes as f64 - (2 * plane + 1) as f64;
    points.iter().any(|(place, nearer, _)| {
        nearer < plane
            && (0..2).all(|axis| {
                let beside = match to[axis] {
                    0 => 0.0,
                    to => to as f64 * (z(*nearer) - z(*plane)) / -z(*plane),
                };
                place[axis] == from[axis] + (beside + 0.5).floor() as i64
            })
    })
}
