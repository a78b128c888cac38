//! Patterns that align a bench, by their far field.

use crate::folder;
use folder::Folder;
use num_complex::Complex64;
use phasefront_io::hologram::{self, Hologram, Levels};
use std::f64::consts::TAU;
use std::fs;

const W: usize = 64;
const H: usize = 48;

/// Returns the light of the first laser on a display of `lines`.
fn light(folder: &Folder, pattern: &[&str]) -> Vec<Complex64> {
    fs::write(
        folder.path("d.toml"),
        format!("width = {W}\nheight = {H}\nwavelengths_nm = [520]\n"),
    )
    .unwrap();
    folder.succeeds(&[&["pattern"], pattern, &["--display", "d.toml", "-o", "p.png"]].concat());
    let Hologram::Levels(Levels::Bytes(levels), _) = hologram::read_hologram(&folder.path("p.png")).unwrap() else {
        panic!("levels of 8 bits");
    };
    levels
        .iter()
        .map(|level| Complex64::cis(f64::from(*level) / 256.0 * TAU))
        .collect()
}

/// Returns the part of the light that travels by (v, u) cycles over the panel, down and right.
fn part(light: &[Complex64], v: f64, u: f64) -> f64 {
    let wave = |at: usize| Complex64::cis(-TAU * (v * (at / W) as f64 / H as f64 + u * (at % W) as f64 / W as f64));
    let sum: Complex64 = light.iter().enumerate().map(|(at, value)| value * wave(at)).sum();
    (sum.norm() / light.len() as f64).powi(2)
}

#[test]
fn patterns_send_light_where_they_say() {
    let folder = Folder::new();
    assert!(part(&light(&folder, &["flat"]), 0.0, 0.0) > 0.999);
    let right = light(&folder, &["grating", "--period", "16"]);
    assert!(part(&right, 0.0, 4.0) > 0.99, "right, by a cycle in 16 pixels");
    let left = light(&folder, &["grating", "--period", "-8"]);
    assert!(part(&left, 0.0, -8.0) > 0.99);
    let board = light(&folder, &["checkerboard"]);
    assert!(part(&board, 0.0, 0.0) < 1e-6 && part(&board, 24.0, 32.0) > 0.99);
    let vortex = light(&folder, &["vortex"]);
    assert!(part(&vortex, 0.0, 0.0) < 1e-3 && part(&vortex, 1.0, 0.0) > 0.05);
    // A lens of f focuses light toward the viewer: back-propagated spherical light of the paraxial form is flat.
    let lens = light(&folder, &["lens", "--focal-mm", "40"]);
    let squared = |at: usize| {
        let (y, x) = ((at / W) as f64 - 23.5, (at % W) as f64 - 31.5);
        (x * x + y * y) * 64e-12
    };
    let flat: Vec<_> = (lens.iter().enumerate())
        .map(|(at, value)| value * Complex64::cis(TAU * squared(at) / (2.0 * 520e-9 * 0.04)))
        .collect();
    assert!(part(&flat, 0.0, 0.0) > 0.99);
    let said = folder.succeeds(&[
        "pattern",
        "grating",
        "--period",
        "16",
        "--display",
        "d.toml",
        "-o",
        "p.png",
    ]);
    assert!(said.contains("turns light right by 4.06 mrad"), "{said}");
    for (pattern, word) in [
        (&["grating", "--period", "1.5"][..], "periods of 2 or more"),
        (&["lens", "--focal-mm", "1"], "lenses of 8 mm or more"),
    ] {
        let said = folder.fails(
            &[&["pattern"], pattern, &["--display", "d.toml", "-o", "p.png"]].concat(),
            2,
        );
        assert!(said.contains(word), "{said}");
    }
    let said = folder.succeeds(&["devices", "d.toml"]);
    for line in ["detail       8.0 um", "angle        1.86°", "reach        6 mm"] {
        assert!(said.contains(line), "{line}: {said}");
    }
}
