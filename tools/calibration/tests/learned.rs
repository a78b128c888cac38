//! Learns a model of a simulated display whose faults it does not know in form.
#![allow(clippy::unwrap_used)]

use phasefront::Size;
use phasefront::{Display, Target};
use phasefront_calibration::camera::pattern::Pattern;
use phasefront_calibration::camera::photograph::Photograph;
use phasefront_calibration::learned::album::Album;
use phasefront_calibration::learned::fit;
use phasefront_calibration::learned::scenes;
use phasefront_calibration::rehearse::learned::{judge, learn, photographs};
use phasefront_calibration::simulated_display::SimulatedDisplay;
use phasefront_core::display::model::{ColourModel, Model};

/// Returns a display with faults, calibrated but for them.
fn faulty() -> (SimulatedDisplay, Target) {
    let display = Display::from_toml("width = 144\nheight = 72\nwavelengths_nm = [532]").unwrap();
    let simulated = SimulatedDisplay::new(&display, 2.5, 3).unwrap().with_faults();
    let target = Target {
        response: simulated.response().unwrap(),
        ..display.into()
    };
    (simulated, target)
}

#[test]
#[ignore = "slow: 10 seconds of a core"]
fn a_learned_model_improves_what_is_displayed() {
    let (simulated, target) = faulty();
    let without = judge(&simulated, &target, 0).unwrap();
    let nodes = fit::nodes(target.modulator());
    let ideal = Target {
        model: Some(Model::new(nodes, vec![ColourModel::ideal(nodes)]).unwrap().into()),
        ..target.clone()
    };
    let centred = judge(&simulated, &ideal, 0).unwrap();
    let samples = photographs(&simulated, &target, 0, 12).unwrap();
    let (_, learned) = learn(&simulated, &target, &samples).unwrap();
    assert!(learned.misfit[1] < 0.5 * learned.misfit[0], "{learned:?}");
    for (learned, without) in learned.psnr_db.iter().zip(without) {
        assert!(*learned > without + 3.0, "{learned} {without}");
    }
    // The steps gain from what was learned, not only from phases in the middle of the range.
    assert!(learned.psnr_db[2] > centred[2] + 1.0, "{centred:?}");
}

#[test]
fn bad_photographs_of_holograms_are_named() {
    let (simulated, target) = faulty();
    let pattern = Pattern::new(Size { width: 144, height: 72 }).unwrap();
    let marks = scenes::marks(&target, 0, &pattern, 0.0).unwrap();
    let seen = simulated.photograph(marks.levels.view(), 0, 0.0, 0).unwrap();
    let mut album = Album::new(&target, 0, &seen).unwrap();
    let scene = |i| scenes::scene(&target, 0, i, 8).unwrap();
    let shoot = |i| {
        simulated
            .photograph(scene(i).levels.view(), 0, scene(i).z_m, 1 + i as u64)
            .unwrap()
    };
    for i in 0..8 {
        album.check(&scene(i), &shoot(i)).unwrap();
    }
    let good = shoot(5);
    let moved = |by: usize| Photograph {
        values: [
            &good.values[by * (1 + good.width)..],
            &good.values[..by * (1 + good.width)],
        ]
        .concat(),
        ..good.clone()
    };
    let bright = |value: &u16| (u32::from(*value) * 20).min(65520) as u16;
    album.check(&scene(4), &shoot(4)).unwrap();
    for (photo, words) in [
        (shoot(4), "the hologram before"),
        (moved(12), "where the marks were"),
        (moved(60), "where the marks were"),
        (
            Photograph {
                values: good.values.iter().map(bright).collect(),
                ..good.clone()
            },
            "saturated",
        ),
        (
            Photograph {
                values: vec![700; good.values.len()],
                ..good.clone()
            },
            "shows nothing",
        ),
        (
            Photograph {
                height: good.height - 1,
                values: good.values[good.width..].to_vec(),
                ..good.clone()
            },
            "of one size",
        ),
    ] {
        let said = album.check(&scene(5), &photo).unwrap_err();
        assert!(said.contains(words) && !said.contains('\n'), "{said}");
    }
    album.check(&scene(5), &good).unwrap();
    let dark = Photograph {
        values: vec![0; seen.values.len()],
        ..seen
    };
    assert!(Album::new(&target, 0, &dark).is_err_and(|e| e.contains("corner marks")));
}
