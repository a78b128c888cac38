//! Compares the fast conversion of each colour format with a naive one: random strides, odd sizes, every orientation,
//! crops in both directions.
use crate::camera;
use phasefront::Size;

use camera::{Noise, colour_formats};
use phasefront::Display;
use phasefront::input::{Orientation, RgbEncoding, Rotation};
use phasefront_core::frame::{ColourPlan, LightPlan, reference};
use rand::{RngExt, SeedableRng};

fn orientations() -> impl Iterator<Item = Orientation> {
    [
        Rotation::Upright,
        Rotation::Clockwise90,
        Rotation::Half,
        Rotation::Clockwise270,
    ]
    .into_iter()
    .flat_map(|rotation| [false, true].map(|mirrored| Orientation { rotation, mirrored }))
}

#[test]
fn every_format_converts_as_the_definition_says() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    for format in colour_formats() {
        for orientation in orientations() {
            for round in 0..6 {
                let mut any_size = || Size {
                    height: random.random_range(1..24),
                    width: random.random_range(1..24),
                };
                let size = any_size();
                let out = match round {
                    0 => orientation.upright_size(size),
                    _ => any_size(),
                };
                let noise = Noise::new(round, format, size, random.random_range(0..4));
                let image = noise.image().unwrap();
                let naive = reference::convert(&image, orientation, out);
                for threads in [1, 3] {
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                    let fast = pool.install(|| {
                        let plan = ColourPlan::new(&image, orientation, out).unwrap();
                        let mut rgb = vec![9.0; 3 * out.height * out.width];
                        plan.convert(&image, &mut rgb, &mut plan.scratch()).unwrap();
                        rgb
                    });
                    let worst = (naive.iter().zip(&fast))
                        .map(|(a, b)| (a - b).abs())
                        .fold(0.0, f32::max);
                    assert!(worst < 1e-5, "{format:?} {orientation:?} {size} to {out}: {worst}");
                }
            }
        }
    }
}

#[test]
fn a_plan_refuses_an_image_of_another_size_or_format() {
    let formats = colour_formats();
    let noise = Noise::new(0, formats[0], Size { width: 10, height: 8 }, 0);
    let image = noise.image().unwrap();
    let plan = ColourPlan::new(&image, Orientation::default(), Size { width: 5, height: 4 }).unwrap();
    let mut rgb = vec![0.0; 60];
    for (format, shape) in [(formats[0], (8, 9)), (formats[1], (8, 10)), (formats[3], (8, 10))] {
        let other = Noise::new(0, format, Size::from_shape(shape), 0);
        let refused = plan.convert(&other.image().unwrap(), &mut rgb, &mut plan.scratch());
        assert!(
            refused
                .unwrap_err()
                .to_string()
                .contains("this plan takes Rgba of 10×8")
        );
    }
    // The plan does not depend on the strides.
    let wide = Noise::new(0, formats[0], Size { width: 10, height: 8 }, 5);
    assert!(
        plan.convert(&wide.image().unwrap(), &mut rgb, &mut plan.scratch())
            .is_ok()
    );
    assert!(ColourPlan::new(&image, Orientation::default(), Size { width: 5, height: 0 }).is_err());
}

#[test]
fn every_encoding_converts_as_the_definition_says() {
    let display = Display::default();
    let (size, out) = (Size { width: 23, height: 17 }, Size { width: 13, height: 19 });
    for format in colour_formats() {
        let noise = Noise::new(3, format, size, 1);
        for encoding in RgbEncoding::ALL {
            let image = noise.image().unwrap().with_encoding(encoding);
            let naive = reference::convert(&image, Orientation::default(), out);
            let plan = ColourPlan::new(&image, Orientation::default(), out).unwrap();
            let plan = plan.with_light(LightPlan::new(encoding, &display));
            let mut fast = vec![9.0; 3 * out.pixels()];
            plan.convert(&image, &mut fast, &mut plan.scratch()).unwrap();
            let area = out.pixels();
            for i in 0..area {
                let rgb = [0, 1, 2].map(|c| f64::from(naive[c * area + i]));
                let right = match encoding {
                    RgbEncoding::Amplitude => rgb.to_vec(),
                    _ => reference::amplitudes(rgb, encoding, &display),
                };
                for (c, right) in right.into_iter().enumerate() {
                    let apart = (f64::from(fast[c * area + i]) - right).abs();
                    // Near black a small difference of the value is a larger one of its root.
                    assert!(apart < 5e-3, "{format:?} {encoding:?} {rgb:?}: {apart}");
                }
            }
        }
    }
}
