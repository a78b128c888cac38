//! Light in the focal plane of a lens, against sums in f64.
use num_complex::{Complex32, Complex64};
use phasefront_core::display::Display;
use phasefront_core::display::lens::{Lens, LensPlan};
use phasefront_core::optics::zoom::Zoom;
use std::f64::consts::PI;

#[test]
fn lines_are_those_of_the_sum_for_any_length_and_spacing() {
    for (length, spacing) in [(1, 0.3), (2, 0.5), (17, 1.0 / 17.0), (64, 0.0071), (45, 0.019)] {
        let value = |n: usize| Complex64::new((n * 7 % 11) as f64 - 5.0, (n * 5 % 13) as f64 - 6.0);
        let at = |n: usize| n as f64 - (length as f64 - 1.0) / 2.0;
        let zoom = Zoom::new(length, spacing);
        let mut work = zoom.work();
        for sign in [-1.0, 1.0] {
            let mut line: Vec<Complex32> = (0..length)
                .map(|n| Complex32::new(value(n).re as f32, value(n).im as f32))
                .collect();
            match sign < 0.0 {
                true => zoom.transform(&mut line, &mut work),
                false => zoom.adjoint(&mut line, &mut work),
            }
            for (m, found) in line.iter().enumerate() {
                let turn = |n: usize| Complex64::cis(sign * 2.0 * PI * spacing * at(n) * at(m));
                let want: Complex64 = (0..length).map(|n| value(n) * turn(n)).sum();
                let apart = Complex64::new(found.re.into(), found.im.into()) - want;
                assert!(apart.norm() < 2e-4 * length as f64, "{length} {spacing} {m}: {apart}");
            }
        }
    }
}

fn value(n: usize) -> Complex32 {
    Complex32::from_polar(1.0, (n * n % 97) as f32 * 0.4)
}

/// Follows a line of light by two Fresnel integrals: to a lens one focal length away, and z beyond its focal plane.
#[test]
fn light_behind_the_focal_plane_is_that_of_two_fresnel_integrals() {
    let (pixels, pitch_m, wavelength_m, focal_m) = (256, 8e-6, 520e-9, 0.1);
    let display = Display::from_toml("width = 256\nheight = 1\npitch_um = 8\nwavelengths_nm = [520]").unwrap();
    let lens = Lens::new(focal_m, [0.0; 2], &display).unwrap();
    let plan = LensPlan::new(&lens, &display, 0);
    let place = |at: usize, step_m: f64, count: usize| (at as f64 - (count as f64 - 1.0) / 2.0) * step_m;
    let way = |from_m: f64, to_m: f64, distance_m: f64| {
        Complex64::cis(PI * (to_m - from_m).powi(2) / (wavelength_m * distance_m))
    };
    // 24 mm of the lens in steps that follow the phases.
    let (count, step_m) = (12_000, 2e-6);
    let light: Vec<Complex64> = (0..pixels)
        .map(|n| Complex64::new(value(n).re.into(), value(n).im.into()))
        .collect();
    let at_lens: Vec<Complex64> = (0..count)
        .map(|at| {
            let x_m = place(at, step_m, count);
            let sum: Complex64 = (light.iter().enumerate())
                .map(|(n, value)| value * way(place(n, pitch_m, pixels), x_m, focal_m))
                .sum();
            sum * Complex64::cis(-PI * x_m * x_m / (wavelength_m * focal_m))
        })
        .collect();
    for z_m in [0.0, 6e-3, -6e-3] {
        let mut plane: Vec<Complex32> = (0..pixels).map(value).collect();
        plan.to_picture(&mut plane, z_m);
        // Without the light's decrease towards the edges, which is that of the square pixels.
        let sinc = |m: usize| {
            let in_field = place(m, lens.pixel_m(), pixels) * pitch_m / (wavelength_m * focal_m);
            if in_field == 0.0 {
                1.0
            } else {
                (PI * in_field).sin() / (PI * in_field)
            }
        };
        let seen = |m: usize| f64::from(plane[m].norm()) / sinc(m);
        let places: Vec<usize> = (40..216).step_by(7).collect();
        let model = |m: usize| {
            let to_m = place(m, lens.pixel_m(), pixels);
            let sum: Complex64 = (at_lens.iter().enumerate())
                .map(|(at, value)| value * way(place(at, step_m, count), to_m, focal_m + z_m))
                .sum();
            sum.norm()
        };
        let pairs: Vec<(f64, f64)> = places.iter().map(|m| (seen(*m), model(*m))).collect();
        let scale = pairs.iter().map(|(a, b)| a * b).sum::<f64>() / pairs.iter().map(|(_, b)| b * b).sum::<f64>();
        let most = pairs.iter().map(|(a, _)| *a).fold(0.0, f64::max);
        for (seen, model) in &pairs {
            assert!(
                (seen - scale * model).abs() < 0.04 * most,
                "{z_m}: {seen} {}",
                scale * model
            );
        }
    }
}

#[test]
fn the_way_back_is_the_adjoint_and_light_is_kept() {
    let display = Display::from_toml("width = 30\nheight = 22\nwavelengths_nm = [638, 520, 450]").unwrap();
    let lens = Lens::new(0.2, Lens::default_carrier_rad(&display), &display).unwrap();
    for colour in 0..3 {
        let plan = LensPlan::new(&lens, &display, colour);
        let a: Vec<Complex32> = (0..660).map(value).collect();
        let b: Vec<Complex32> = (0..660).map(|n| value(3 * n + 1) * (n % 7) as f32).collect();
        let inner =
            |a: &[Complex32], b: &[Complex32]| -> Complex32 { a.iter().zip(b).map(|(a, b)| a.conj() * b).sum() };
        let (mut seen, mut back) = (a.clone(), b.clone());
        plan.to_picture(&mut seen, 2e-3);
        plan.to_modulator(&mut back, 2e-3);
        let apart = inner(&seen, &b) - inner(&a, &back);
        assert!(apart.norm() < 1e-3 * inner(&seen, &b).norm().max(1.0), "{apart}");
        let light = |plane: &[Complex32]| plane.iter().map(|value| value.norm_sqr()).sum::<f32>();
        // All light of the field is that of the panel, and the picture holds a part of it.
        assert!(light(&seen) < light(&a), "{colour}");
    }
}

#[test]
fn the_picture_is_the_largest_that_the_field_holds_beside_the_zero_order() {
    let display = Display::default();
    let field_m = 450e-9 * 0.2 / 8e-6;
    let beside = Lens::new(0.2, Lens::default_carrier_rad(&display), &display).unwrap();
    assert!((beside.centre_m()[1] + field_m / 4.0).abs() < 1e-9 && beside.centre_m()[0] == 0.0);
    assert!((beside.pixel_m() - 0.9 * field_m / 2.0 / 1080.0).abs() < 1e-12);
    // The picture ends before the zero order.
    assert!(beside.centre_m()[1] + 540.0 * beside.pixel_m() < 0.0);
    let across = Lens::new(0.2, [0.0; 2], &display).unwrap();
    assert!((across.pixel_m() - 0.9 * field_m / 1920.0).abs() < 1e-12);
    for (focal_m, carrier, word) in [
        (0.0, [0.0; 2], "focal_mm"),
        (f64::NAN, [0.0; 2], "focal_mm"),
        (0.2, [0.0281, 0.0], "leaves no room"),
    ] {
        let said = Lens::new(focal_m, carrier, &display).unwrap_err().to_string();
        assert!(said.contains(word), "{said}");
    }
}
