//! Tests the seeds of a small data set: refined depths beside the given ones, and the sweep's fields for all.
use ndarray::{Array2, Array3, Array4, Axis, concatenate, s};
use ndarray_npy::{read_npy, write_npy};
use num_complex::Complex32;
use phasefront::Size;
use phasefront::{Display, RgbdFrame, Sweep};
use phasefront_core::method::sweep::SweepPlan;
use phasefront_exact::truth;
use phasefront_lab::dataset::{self, Manifest};
use phasefront_lab::seeds;

const SIZE: usize = 128;
const SCENE: usize = 79;

#[test]
fn seeds_are_the_sweeps_fields_on_given_and_refined_depth() {
    let (data, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let manifest = Manifest::new(80, SIZE, 10, 3, 4, Display::default()).unwrap();
    dataset::make(&manifest, &[], data.path(), (SCENE, 80), &|| {}).unwrap();
    let pair = dataset::read_pair(&manifest, data.path(), SCENE).unwrap();
    let clean = pair.ldi.layers[0].depth.mapv(|d| {
        let d = if d.is_nan() { 1.0 } else { d };
        (d * 65535.0).round() as u16
    });
    let given = ndarray::stack![Axis(0), clean, clean.mapv(|d| d / 2)];
    let file = |name: &str| folder.path().join(format!("{name}_{SCENE:06}.npy"));
    write_npy(file("depth"), &given).unwrap();

    let sweep = Sweep {
        planes: 8,
        ..Sweep::for_display(&manifest.display)
    };
    let make = |refined| seeds::make(&manifest, data.path(), folder.path(), sweep, refined, &|| {});
    make(2).unwrap();

    let refined: Array3<u16> = read_npy(file("refined")).unwrap();
    assert_eq!(refined.dim(), (2, SIZE, SIZE));
    assert_ne!(refined.slice(s![0, .., ..]), refined.slice(s![1, .., ..]));
    for depth in refined.outer_iter() {
        let near = depth.iter().zip(&clean).filter(|(a, b)| a.abs_diff(**b) < 3277);
        let near = near.count();
        assert!(near > SIZE * SIZE * 3 / 4, "{near}");
    }

    let fields: Array4<i16> = read_npy(file("seed")).unwrap();
    let plan = SweepPlan::new(
        Size {
            width: SIZE,
            height: SIZE,
        },
        &manifest.display,
        sweep,
        0.0,
    )
    .unwrap();
    let colour = truth::visible_rgb(&pair.ldi);
    let depths = concatenate![Axis(0), given, refined];
    assert_eq!(fields.dim(), (4, 6, SIZE, SIZE));
    for (depth, stored) in depths.outer_iter().zip(fields.outer_iter()) {
        let depth: Array2<f32> = depth.mapv(|d| f32::from(d) / 65535.0);
        let frame = RgbdFrame::new(colour.clone(), depth).unwrap();
        let mut field = Array3::from_elem((3, SIZE, SIZE), Complex32::ZERO);
        plan.field(&frame, field.as_slice_mut().unwrap(), &mut plan.scratch())
            .unwrap();
        for ((c, y, x), value) in field.indexed_iter() {
            for (c, part) in [(c, value.re), (c + 3, value.im)] {
                let found = f32::from(stored[(c, y, x)]) / seeds::SCALE;
                assert!((found - part).abs() <= 0.51 / seeds::SCALE, "{found} {part}");
            }
        }
    }

    let error = make(1).unwrap_err().to_string();
    assert!(error.contains("refined depths"), "{error}");
}
