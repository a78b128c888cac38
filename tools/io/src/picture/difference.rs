//! The difference of colours as eyes see it.

use ndarray::{Array3, ArrayView3, Axis, s};
use phasefront_core::display::primaries::{D65, times, white};
use phasefront_core::frame::RgbEncoding;
use phasefront_core::view::colours::ViewColours;

/// The side of the squares over which [`of_pictures`] takes the mean of light, in pixels. Eyes that look at a whole
/// display resolve no pixels, and speckle has no colour at that distance.
pub const SQUARE: usize = 8;

/// Converts X, Y and Z, relative to D65 of Y = 1, to CIE L*, a* and b*.
pub fn lab(xyz: [f64; 3]) -> [f64; 3] {
    let to = white(D65);
    let f = |t: f64| {
        if t > 216.0 / 24389.0 {
            t.cbrt()
        } else {
            (24389.0 / 27.0 * t + 16.0) / 116.0
        }
    };
    let [x, y, z] = [0, 1, 2].map(|i| f(xyz[i].max(0.0) / to[i]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Returns the colour difference CIEDE2000 of two colours in L*, a* and b* (CIE 142-2001; Sharma, Wu and Dalal, 2005).
pub fn ciede2000(a: [f64; 3], b: [f64; 3]) -> f64 {
    let chroma = |c: [f64; 3]| c[1].hypot(c[2]);
    let high = |c: f64| (c.powi(7) / (c.powi(7) + 25f64.powi(7))).sqrt();
    let stretch = 1.0 + 0.5 * (1.0 - high((chroma(a) + chroma(b)) / 2.0));
    let polar = |c: [f64; 3]| {
        let x = stretch * c[1];
        (x.hypot(c[2]), c[2].atan2(x).to_degrees().rem_euclid(360.0))
    };
    let ((c1, h1), (c2, h2)) = (polar(a), polar(b));
    let grey = c1 * c2 == 0.0;
    let turn = match h2 - h1 {
        _ if grey => 0.0,
        turn if turn > 180.0 => turn - 360.0,
        turn if turn < -180.0 => turn + 360.0,
        turn => turn,
    };
    let hue = match h1 + h2 {
        sum if grey => sum,
        sum if (h1 - h2).abs() <= 180.0 => sum / 2.0,
        sum if sum < 360.0 => sum / 2.0 + 180.0,
        sum => sum / 2.0 - 180.0,
    };
    let (lightness, chroma) = ((a[0] + b[0]) / 2.0, (c1 + c2) / 2.0);
    let cos = |degrees: f64| degrees.to_radians().cos();
    let t = 1.0 - 0.17 * cos(hue - 30.0) + 0.24 * cos(2.0 * hue) + 0.32 * cos(3.0 * hue + 6.0)
        - 0.2 * cos(4.0 * hue - 63.0);
    let offset = (lightness - 50.0).powi(2);
    let l = (b[0] - a[0]) / (1.0 + 0.015 * offset / (20.0 + offset).sqrt());
    let c = (c2 - c1) / (1.0 + 0.045 * chroma);
    let h = 2.0 * (c1 * c2).sqrt() * (turn / 2.0).to_radians().sin() / (1.0 + 0.015 * chroma * t);
    let angle = 60.0 * (-((hue - 275.0) / 25.0).powi(2)).exp();
    let rotation = -2.0 * high(chroma) * angle.to_radians().sin();
    (l * l + c * c + h * h + rotation * c * h).sqrt()
}

/// Returns the light of a view, the displayed amplitudes (C, H, W), in linear sRGB, (3, H, W), or `None` if views are
/// amplitudes.
pub fn light_of_view(amplitude: ArrayView3<'_, f32>, colours: &ViewColours) -> Option<Array3<f32>> {
    let matrix = colours.matrix()?;
    let (_, height, width) = amplitude.dim();
    let mut light = Array3::zeros((3, height, width));
    for (row, mut plane) in matrix.iter().zip(light.outer_iter_mut()) {
        for (part, laser) in row.iter().zip(amplitude.outer_iter()) {
            plane.zip_mut_with(&laser, |light, a| *light += part * a * a);
        }
    }
    Some(light)
}

/// Returns the mean CIEDE2000 of two pictures of one size in linear sRGB, (3, H, W): of the mean light of squares of
/// [`SQUARE`] pixels. Squares that the border cuts count as they are.
pub fn of_pictures(a: ArrayView3<'_, f32>, b: ArrayView3<'_, f32>) -> f64 {
    let to_xyz = RgbEncoding::Srgb.to_xyz();
    let (_, height, width) = a.dim();
    let seen = |picture: &ArrayView3<'_, f32>, y: usize, x: usize| {
        let square = picture.slice(s![.., y..(y + SQUARE).min(height), x..(x + SQUARE).min(width)]);
        let mean = |c: usize| {
            let plane = square.index_axis(Axis(0), c);
            plane.iter().map(|v| f64::from(*v)).sum::<f64>() / plane.len() as f64
        };
        lab(times(&to_xyz, [mean(0), mean(1), mean(2)]))
    };
    let (mut sum, mut count) = (0.0, 0);
    for y in (0..height).step_by(SQUARE) {
        for x in (0..width).step_by(SQUARE) {
            sum += ciede2000(seen(&a, y, x), seen(&b, y, x));
            count += 1;
        }
    }
    sum / f64::from(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The test data of Sharma, Wu and Dalal (2005), Table 1: two colours in L*, a* and b*, and their difference.
    #[rustfmt::skip]
    const PUBLISHED: [[f64; 7]; 34] = [
        [50.0, 2.6772, -79.7751, 50.0, 0.0, -82.7485, 2.0425],
        [50.0, 3.1571, -77.2803, 50.0, 0.0, -82.7485, 2.8615],
        [50.0, 2.8361, -74.02, 50.0, 0.0, -82.7485, 3.4412],
        [50.0, -1.3802, -84.2814, 50.0, 0.0, -82.7485, 1.0],
        [50.0, -1.1848, -84.8006, 50.0, 0.0, -82.7485, 1.0],
        [50.0, -0.9009, -85.5211, 50.0, 0.0, -82.7485, 1.0],
        [50.0, 0.0, 0.0, 50.0, -1.0, 2.0, 2.3669],
        [50.0, -1.0, 2.0, 50.0, 0.0, 0.0, 2.3669],
        [50.0, 2.49, -0.001, 50.0, -2.49, 0.0009, 7.1792],
        [50.0, 2.49, -0.001, 50.0, -2.49, 0.001, 7.1792],
        [50.0, 2.49, -0.001, 50.0, -2.49, 0.0011, 7.2195],
        [50.0, 2.49, -0.001, 50.0, -2.49, 0.0012, 7.2195],
        [50.0, -0.001, 2.49, 50.0, 0.0009, -2.49, 4.8045],
        [50.0, -0.001, 2.49, 50.0, 0.001, -2.49, 4.8045],
        [50.0, -0.001, 2.49, 50.0, 0.0011, -2.49, 4.7461],
        [50.0, 2.5, 0.0, 50.0, 0.0, -2.5, 4.3065],
        [50.0, 2.5, 0.0, 73.0, 25.0, -18.0, 27.1492],
        [50.0, 2.5, 0.0, 61.0, -5.0, 29.0, 22.8977],
        [50.0, 2.5, 0.0, 56.0, -27.0, -3.0, 31.903],
        [50.0, 2.5, 0.0, 58.0, 24.0, 15.0, 19.4535],
        [50.0, 2.5, 0.0, 50.0, 3.1736, 0.5854, 1.0],
        [50.0, 2.5, 0.0, 50.0, 3.2972, 0.0, 1.0],
        [50.0, 2.5, 0.0, 50.0, 1.8634, 0.5757, 1.0],
        [50.0, 2.5, 0.0, 50.0, 3.2592, 0.335, 1.0],
        [60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644],
        [63.0109, -31.0961, -5.8663, 62.8187, -29.7946, -4.0864, 1.263],
        [61.2901, 3.7196, -5.3901, 61.4292, 2.248, -4.962, 1.8731],
        [35.0831, -44.1164, 3.7933, 35.0232, -40.0716, 1.5901, 1.8645],
        [22.7233, 20.0904, -46.694, 23.0331, 14.973, -42.5619, 2.0373],
        [36.4612, 47.858, 18.3852, 36.2715, 50.5065, 21.2231, 1.4146],
        [90.8027, -2.0831, 1.441, 91.1528, -1.6435, 0.0447, 1.4441],
        [90.9257, -0.5406, -0.9208, 88.6381, -0.8985, -0.7239, 1.5381],
        [6.7747, -0.2908, -2.4247, 5.8714, -0.0985, -2.2286, 0.6377],
        [2.0776, 0.0795, -1.135, 0.9033, -0.0636, -0.5514, 0.9082],
    ];

    #[test]
    fn ciede2000_is_as_published() {
        for [l1, a1, b1, l2, a2, b2, right] in PUBLISHED {
            let (a, b) = ([l1, a1, b1], [l2, a2, b2]);
            assert!(
                (ciede2000(a, b) - right).abs() < 1e-4,
                "{a:?} {b:?}: {}",
                ciede2000(a, b)
            );
            assert!((ciede2000(b, a) - right).abs() < 1e-4, "{b:?} {a:?}");
        }
    }

    /// CIE L*, a* and b* of sRGB's red, green and blue, as published for D65.
    #[test]
    fn primaries_have_their_known_coordinates() {
        let to_xyz = RgbEncoding::Srgb.to_xyz();
        for (rgb, right) in [
            ([1.0, 0.0, 0.0], [53.24, 80.09, 67.20]),
            ([0.0, 1.0, 0.0], [87.73, -86.18, 83.18]),
            ([0.0, 0.0, 1.0], [32.30, 79.19, -107.86]),
            ([1.0, 1.0, 1.0], [100.0, 0.0, 0.0]),
        ] {
            let found = lab(times(&to_xyz, rgb));
            assert!(
                found.iter().zip(right).all(|(a, b)| (a - b).abs() < 0.05),
                "{rgb:?}: {found:?}"
            );
        }
    }

    #[test]
    fn speckle_has_no_colour_and_a_tint_has() {
        let grey = Array3::from_elem((3, 12, 20), 0.25f32);
        let speckled = Array3::from_shape_fn((3, 12, 20), |(_, y, x)| 0.5 * ((x + y) % 2) as f32);
        assert!(of_pictures(grey.view(), speckled.view()) < 0.01);
        let mut tinted = grey.clone();
        tinted.index_axis_mut(Axis(0), 0).fill(0.3);
        assert!(of_pictures(grey.view(), tinted.view()) > 4.0);
    }
}
