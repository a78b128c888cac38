//! Checks holograms of complex fields that come from elsewhere.

use num_complex::Complex32;
use phasefront::Size;
use phasefront::output::{Layout, Output, Placement};
use phasefront::{Display, EncoderOptions, Error, Hologram, Target};
use phasefront_core::display::levels::LevelsMut;
use phasefront_core::pipeline::display_plan::DisplayPlan;

const W: usize = 75;
const H: usize = 46;

fn target(more: &str) -> Target {
    let text = format!("width = {W}\nheight = {H}\noffset_mm = 2.5\n{more}");
    Target::from(Display::from_toml(&text).unwrap())
}

/// Returns a smooth field, (C, H, W).
fn smooth(colours: usize) -> Vec<Complex32> {
    let value = |i: usize| {
        let (y, x) = (i % (W * H) / W, i % W);
        let amplitude = 0.7 + 0.2 * (x as f32 / 8.0).sin() * (y as f32 / 6.0).cos();
        Complex32::from_polar(amplitude, 0.05 * x as f32 + 0.03 * (i / (W * H)) as f32)
    };
    (0..colours * W * H).map(value).collect()
}

/// The levels are those of the core's plan.
#[test]
fn a_field_is_propagated_and_encoded() {
    for (more, colours) in [("", 3), ("wavelengths_nm = [532]\nbits = 6", 1)] {
        let (target, field, options) = (target(more), smooth(colours), EncoderOptions::default());
        let hologram = Hologram::of_field(&field, Size { width: W, height: H }, 1e-3, &target, &options).unwrap();
        let plan = DisplayPlan::from_z(Size { width: W, height: H }, 1e-3, &target, &options).unwrap();
        let (mut scratch, mut values, mut levels) = (plan.scratch(), field.clone(), vec![0; field.len()]);
        plan.propagate(&mut values, &mut scratch);
        let modulation = plan.modulate(None, &mut values, LevelsMut::Bytes(&mut levels), &mut scratch);
        assert_eq!(hologram.levels(), levels);
        assert_eq!((hologram.scale(), hologram.words()), (modulation.scale, None));
        assert_eq!(
            (hologram.size(), hologram.colours()),
            (Size { width: W, height: H }, colours)
        );
        assert_eq!(hologram.z_at(0.5, 0.5), 0.0);
        assert_eq!((hologram.timestamp_ns(), hologram.valid_depth()), (None, None));
    }
}

/// The view at the field's z shows the field, away from the border.
#[test]
fn what_is_displayed_is_the_field() {
    let (target, field) = (target(""), smooth(3));
    let hologram = Hologram::of_field(
        &field,
        Size { width: W, height: H },
        1e-3,
        &target,
        &EncoderOptions::default(),
    )
    .unwrap();
    let seen = hologram.field(1e-3).unwrap();
    let (mut apart, mut all) = (0.0, 0.0);
    for (i, (seen, wanted)) in seen.iter().zip(&field).enumerate() {
        if (12..H - 12).contains(&(i % (W * H) / W)) && (12..W - 12).contains(&(i % W)) {
            apart += (seen - wanted).norm_sqr();
            all += wanted.norm_sqr();
        }
    }
    let error_db = 10.0 * (apart / all).log10();
    assert!(error_db < -20.0, "{error_db}");
}

#[test]
fn ten_bits_have_words_and_go_to_the_modulator() {
    let target = target("wavelengths_nm = [532]\nbits = 10");
    let hologram = Hologram::of_field(
        &smooth(1),
        Size { width: W, height: H },
        0.0,
        &target,
        &EncoderOptions::default(),
    )
    .unwrap();
    let words = hologram.words().unwrap();
    assert!(
        words
            .iter()
            .zip(hologram.levels())
            .all(|(word, level)| word >> 2 == u16::from(*level))
    );
    let plan = Output::new(
        &target,
        Size { width: W, height: H },
        Placement::centred(Layout::Grey16),
    )
    .unwrap();
    let mut frame = vec![0; plan.image_bytes()];
    plan.write(hologram.output_levels(), 0, &mut frame, plan.row_bytes())
        .unwrap();
    let mut back = vec![0; words.len()];
    plan.read(&frame, 0, &mut back).unwrap();
    assert_eq!(back, words);
}

#[test]
fn fields_that_cannot_be_are_refused() {
    let (target, options) = (target(""), EncoderOptions::default());
    let refused = |field: &[Complex32], shape, z_m| match Hologram::of_field(field, shape, z_m, &target, &options) {
        Err(e) => e,
        Ok(_) => panic!("made"),
    };
    let field = smooth(3);
    assert!(matches!(
        refused(&field[1..], Size { width: W, height: H }, 0.0),
        Error::Frame(_)
    ));
    assert!(matches!(
        refused(&field, Size { width: H, height: W }, 0.0),
        Error::Frame(_)
    ));
    assert!(
        refused(&field, Size { width: W, height: H }, 1e3)
            .to_string()
            .contains("distance")
    );
    assert!(
        refused(&field, Size { width: W, height: H }, f64::NAN)
            .to_string()
            .contains("NaN")
    );
}
