//! Displays, cameras and pictures that the diagnosis was not tuned on.

use crate::plant::{Bench, Picture, soft};
use ndarray::{Array2, Array3};
use phasefront::Display;
use phasefront::Size;

/// A part of the sample photograph, with its depth.
fn photograph(size: Size, left: f64, top: f64, share: f64) -> Picture {
    let samples = concat!(env!("CARGO_MANIFEST_DIR"), "/../../samples");
    let colour = image::open(format!("{samples}/scene_rgb.jpg")).unwrap().into_rgb8();
    let depth = image::open(format!("{samples}/scene_depth.png")).unwrap().into_luma16();
    let Size { width, height } = size;
    let step = share * f64::from(colour.width()) / width as f64;
    let place = |y: usize, x: usize| {
        let u = left * f64::from(colour.width()) + x as f64 * step;
        let v = top * f64::from(colour.height()) + y as f64 * step;
        (u as u32 % colour.width(), v as u32 % colour.height())
    };
    Picture {
        amplitude: Array3::from_shape_fn((3, height, width), |(c, y, x)| {
            let (u, v) = place(y, x);
            (f32::from(colour.get_pixel(u, v).0[c]) / 255.0).powf(1.1)
        }),
        near: Array2::from_shape_fn((height, width), |(y, x)| {
            let (u, v) = place(y, x);
            1.0 - f32::from(depth.get_pixel(u, v).0[0]) / 65535.0
        }),
    }
}

fn street(size: Size) -> Picture {
    photograph(size, 0.22, 0.2, 0.5)
}

fn corner(size: Size) -> Picture {
    photograph(size, 0.05, 0.1, 0.8)
}

/// A test chart: a star, rings, bars and wedges of grey, each at its own depth.
fn chart(size: Size) -> Picture {
    let Size { width, height } = size;
    let (w, h) = (width as f64, height as f64);
    let value = |y: usize, x: usize| -> ([f64; 3], f64) {
        let (x, y) = (x as f64, y as f64);
        let star = (x - 0.3 * w, y - 0.4 * h);
        let radius = star.0.hypot(star.1);
        if radius < 0.26 * h {
            let spoke = 0.5 + 0.5 * (star.1.atan2(star.0) * 14.0).sin().signum() * soft(3.0 - radius / 4.0).max(0.0);
            return ([spoke, 0.9 * spoke, 0.6 * spoke], 0.9);
        }
        let ring = ((x - 0.72 * w).hypot(y - 0.62 * h)) / 5.0;
        if ring < 0.05 * h {
            let lit = 0.15 + 0.8 * soft((ring % 2.0 - 1.0).abs() * 6.0 - 3.0);
            return ([0.5 * lit, lit, 0.9 * lit], 0.5);
        }
        if y < 0.12 * h {
            let bar = if ((x / (2.0 + 8.0 * x / w)) as usize).is_multiple_of(2) {
                0.85
            } else {
                0.1
            };
            return ([bar, 0.4 * bar, 0.7 * bar], 0.1);
        }
        if x > 0.86 * w && y < 0.45 * h {
            let step = ((y / h * 16.0).floor() / 8.0).min(1.0);
            return ([step; 3], 0.3);
        }
        ([0.2 + 0.3 * x / w, 0.25, 0.2 + 0.3 * y / h], 0.3)
    };
    Picture {
        amplitude: Array3::from_shape_fn((3, height, width), |(c, y, x)| value(y, x).0[c] as f32),
        near: Array2::from_shape_fn((height, width), |(y, x)| value(y, x).1 as f32),
    }
}

/// Blobs and slabs on a dark ground, dimmer to the right.
fn blobs(size: Size) -> Picture {
    let Size { width, height } = size;
    let (w, h) = (width as f64, height as f64);
    let all = [
        (0.2, 0.3, 0.16, [0.9, 0.5, 0.2], 0.9),
        (0.42, 0.7, 0.2, [0.3, 0.8, 0.9], 0.7),
        (0.7, 0.25, 0.13, [0.8, 0.8, 0.3], 0.4),
        (0.82, 0.72, 0.18, [0.6, 0.3, 0.8], 0.1),
        (0.55, 0.45, 0.07, [0.9, 0.9, 0.9], 1.0),
    ];
    let value = |y: usize, x: usize| -> ([f64; 3], f64) {
        let (x, y) = (x as f64, y as f64);
        for (u, v, r, colour, near) in all {
            let inside = soft((x - u * w).hypot(y - v * h) - r * h);
            if inside > 0.5 {
                let shade = 0.6 + 0.4 * ((x + 2.0 * y) / 9.0 * r).sin();
                return (colour.map(|part| part * shade), near);
            }
        }
        let slab = if ((y / h * 5.0) as usize).is_multiple_of(2) && x < 0.9 * w {
            0.25
        } else {
            0.04
        };
        ([slab; 3], 0.2)
    };
    Picture {
        amplitude: Array3::from_shape_fn((3, height, width), |(c, y, x)| value(y, x).0[c] as f32),
        near: Array2::from_shape_fn((height, width), |(y, x)| value(y, x).1 as f32),
    }
}

fn display(toml: &str) -> Display {
    Display::from_toml(toml).unwrap()
}

pub(crate) fn benches() -> Vec<Bench> {
    vec![
        Bench {
            name: "532 nm, 6.4 um, -8 mm",
            display: display(
                "width = 160\nheight = 120\npitch_um = 6.4\nwavelengths_nm = [532]\nvolume_depth_mm = 4\noffset_mm = -8",
            ),
            z_m: 0.0,
            picture: street,
            zoom: 2.2,
            turn_deg: 3.1,
            askew: 0.02,
            bits: 10,
            full_well: 9000.0,
            read_noise: 9.0,
            exposure: 0.7,
            seed: 9001,
        },
        Bench {
            name: "three lasers, 3.74 um, 3 mm",
            display: display(
                "width = 128\nheight = 128\npitch_um = 3.74\nwavelengths_nm = [660, 515, 457]\nvolume_depth_mm = 2\noffset_mm = 3",
            ),
            z_m: 0.3e-3,
            picture: chart,
            zoom: 1.6,
            turn_deg: -2.4,
            askew: 0.015,
            bits: 12,
            full_well: 14_000.0,
            read_noise: 7.0,
            exposure: 0.6,
            seed: 9002,
        },
        Bench {
            name: "633 nm, 10 um, -18 mm",
            display: display(
                "width = 176\nheight = 112\npitch_um = 10\nwavelengths_nm = [633]\nvolume_depth_mm = 8\noffset_mm = -18",
            ),
            z_m: -1e-3,
            picture: blobs,
            zoom: 1.3,
            turn_deg: 0.8,
            askew: 0.03,
            bits: 8,
            full_well: 20_000.0,
            read_noise: 15.0,
            exposure: 0.8,
            seed: 9003,
        },
        Bench {
            name: "three lasers, 8 um, 0 mm",
            display: display(
                "width = 128\nheight = 96\npitch_um = 8\nwavelengths_nm = [620, 530, 460]\nvolume_depth_mm = 5\noffset_mm = 0",
            ),
            z_m: 1.4e-3,
            picture: corner,
            zoom: 2.8,
            turn_deg: -4.5,
            askew: 0.01,
            bits: 12,
            full_well: 6000.0,
            read_noise: 4.0,
            exposure: 0.65,
            seed: 9004,
        },
    ]
}
