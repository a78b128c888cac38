//! Tests the occlusion study on the paper's scene: the order of its settings, and each artefact where Fig. 9 marks it.
use ndarray::Array2;
use phasefront::Display;
use phasefront_io::ldi::{Ldi, LdiLayer};
use phasefront_lab::study::occlusion::{Outcome, SETTINGS, study, two_bars};

#[test]
fn the_artefacts_are_where_the_paper_sees_them() {
    let study = study(&two_bars(), &Display::default(), 256, &|_| {}).unwrap();
    assert!(study.front_z_m > 2.9e-3 && study.rear_z_m < -2.9e-3);
    let of = |measure: &dyn Fn(&Outcome) -> Option<f64>| -> [Option<f64>; 6] {
        let values: Vec<_> = study.outcomes.iter().map(measure).collect();
        values.try_into().unwrap()
    };
    let present = |values: [Option<f64>; 6]| values.map(|v| v.unwrap());

    // Setting 6 is the reference. Of the others, waves are best and no occlusion is worst.
    let psnr: Vec<f64> = (study.outcomes.iter()).map(|o| o.front_quality.psnr_overall).collect();
    assert_eq!(psnr[5], f64::INFINITY);
    let best = psnr[..5].iter().copied().fold(0.0, f64::max);
    let worst = psnr.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(worst, psnr[0], "{psnr:?}");
    assert!(best == psnr[3] || best == psnr[4], "{psnr:?}");

    // 1: light of the hidden halves shines through the front bars unless it is blocked.
    let occluded = present(of(&|o| o.artefacts.leakage_from_occluded));
    for setting in [1, 2, 3, 4, 5] {
        assert!(occluded[0] > 4.0 * occluded[setting], "{occluded:?}");
    }
    // 2: light of the visible halves covers the front bars unless a computation stops it.
    let visible = present(of(&|o| o.artefacts.leakage_from_visible));
    for (leaking, stopped) in [(0, 3), (0, 5), (1, 2), (1, 4)] {
        assert!(visible[leaking] > 2.0 * visible[stopped], "{visible:?}");
    }
    // 3: light of the hidden halves is missing beside the front bars if the input lacks it.
    let loss = present(of(&|o| o.artefacts.loss_from_occluded));
    for lossy in [1, 2, 4] {
        for complete in [0, 3, 5] {
            assert!(loss[lossy] > 0.15 && loss[lossy] > 1.5 * loss[complete], "{loss:?}");
        }
    }
    // 4: rays are not waves. This artefact is absent without ray casting.
    let rays = of(&|o| o.artefacts.geometric_inaccuracy);
    for (i, value) in rays.into_iter().enumerate() {
        match SETTINGS[i].name.starts_with("geometric") {
            true => assert!(value.unwrap() > 0.01, "{rays:?}"),
            false => assert_eq!(value, None),
        }
    }
}

#[test]
fn a_scene_with_nothing_hidden_has_no_place_for_leaks() {
    let flat = Ldi::new(vec![LdiLayer {
        rgb: ndarray::Array3::from_elem((3, 40, 40), 0.5),
        depth: Array2::from_elem((40, 40), 0.3),
    }])
    .unwrap();
    let one = study(&flat, &Display::default(), 16, &|_| {}).unwrap();
    assert_eq!(one.outcomes[4].front, one.outcomes[5].front);
    for outcome in &one.outcomes {
        let found = outcome.artefacts;
        assert_eq!(found.leakage_from_occluded, None);
        assert_eq!(found.loss_from_occluded, None);
    }
    let mut nothing = flat;
    nothing.layers[0].depth.fill(f32::NAN);
    let e = study(&nothing, &Display::default(), 16, &|_| {}).unwrap_err();
    assert!(e.to_string().contains("no points"), "{e}");
}
