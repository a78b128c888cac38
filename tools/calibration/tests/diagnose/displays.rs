//! Displays and pictures of the quick tests, which the diagnosis was tuned on.
#![allow(dead_code)] // Tests and the example `planted` take different displays.

use crate::plant::{Bench, Picture};
use ndarray::{Array2, Array3, stack};
use phasefront::Display;
use phasefront::Size;
use phasefront_calibration::learned::scenes;

fn clouds(size: Size, seed: u64) -> Picture {
    let planes = [0, 1, 2].map(|colour| scenes::field(size, seed + colour).mapv(|value| value.norm()));
    let views = planes.each_ref().map(|plane| plane.view());
    let amplitude: Array3<f32> = stack(ndarray::Axis(0), &views).unwrap();
    let Size { width, height } = size;
    let near = Array2::from_shape_fn((height, width), |(y, x)| {
        if (x * 3 / width + y * 2 / height) % 2 == 0 {
            0.2
        } else {
            0.8 * x as f32 / width as f32
        }
    });
    Picture { amplitude, near }
}

fn first(size: Size) -> Picture {
    clouds(size, 40)
}

fn second(size: Size) -> Picture {
    clouds(size, 77)
}

fn display(toml: &str) -> Display {
    Display::from_toml(toml).unwrap()
}

pub(crate) fn one_laser() -> Bench {
    Bench {
        name: "520 nm, 8 um, -10 mm",
        display: display("width = 160\nheight = 120\nwavelengths_nm = [520]\noffset_mm = -10"),
        z_m: 0.0,
        picture: first,
        zoom: 2.0,
        turn_deg: -2.0,
        askew: 0.015,
        bits: 12,
        full_well: 12_000.0,
        read_noise: 8.0,
        exposure: 0.65,
        seed: 11,
    }
}

pub(crate) fn three_lasers() -> Bench {
    Bench {
        name: "three lasers, 4.5 um, 4 mm",
        display: display(
            "width = 144\nheight = 128\npitch_um = 4.5\nvolume_depth_mm = 3\noffset_mm = 4\nwavelengths_nm = [638, 520, 450]",
        ),
        z_m: 0.0,
        picture: second,
        zoom: 2.4,
        turn_deg: 1.5,
        askew: 0.02,
        bits: 10,
        full_well: 10_000.0,
        read_noise: 10.0,
        exposure: 0.7,
        seed: 12,
    }
}

pub(crate) fn on_the_panel() -> Bench {
    Bench {
        name: "633 nm, 12 um, 0 mm",
        display: display("width = 144\nheight = 144\npitch_um = 12\nwavelengths_nm = [633]\noffset_mm = 0"),
        z_m: 1.5e-3,
        picture: second,
        zoom: 1.5,
        turn_deg: 4.0,
        askew: 0.01,
        bits: 8,
        full_well: 16_000.0,
        read_noise: 12.0,
        exposure: 0.75,
        seed: 13,
    }
}

/// A small display for quick tests.
pub(crate) fn small() -> Bench {
    Bench {
        name: "small",
        display: display("width = 112\nheight = 84\nwavelengths_nm = [520]\nvolume_depth_mm = 4\noffset_mm = -6"),
        zoom: 1.8,
        seed: 21,
        ..one_laser()
    }
}

/// A small display of three lasers.
pub(crate) fn small_of_three() -> Bench {
    Bench {
        name: "small, three lasers",
        display: display("width = 96\nheight = 80\nvolume_depth_mm = 3\noffset_mm = -4"),
        zoom: 1.8,
        seed: 22,
        ..three_lasers()
    }
}
