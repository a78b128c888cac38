//! Causes planted on simulated displays, and those that a diagnosis finds.
#![allow(clippy::unwrap_used)]

mod displays;
mod plant;

use phasefront_calibration::diagnosis::{Shown, diagnose};
use phasefront_core::display::levels::Levels;
use phasefront_io::dice::Dice;
use plant::{Bench, Plant, diagnosed, names, taken};

/// Checks that the causes found are those planted.
fn finds(bench: &Bench, plants: &[Plant]) {
    let mut wanted: Vec<_> = plants.iter().map(Plant::name).collect();
    wanted.sort_unstable();
    let diagnosis = diagnosed(bench, plants, 1);
    let mut found = names(&diagnosis);
    found.sort_unstable();
    assert_eq!(found, wanted, "{plants:?}: {diagnosis:?}");
}

/// Returns the evidence of the only cause.
fn evidence(bench: &Bench, plant: Plant) -> String {
    let diagnosis = diagnosed(bench, &[plant], 1).unwrap();
    assert_eq!(diagnosis.findings.len(), 1, "{diagnosis:?}");
    diagnosis.findings[0].evidence.clone()
}

#[test]
fn light_that_is_not_modulated_is_found_with_its_share() {
    let bench = displays::small();
    finds(&bench, &[]);
    let said = evidence(&bench, Plant::ZeroOrder(0.1));
    let share: f64 = said.split(' ').next().unwrap().parse().unwrap();
    assert!((8.0..12.0).contains(&share), "{said}");
}

#[test]
fn ghost_images_are_found_where_they_lie() {
    let ghost = Plant::Ghost {
        share: 0.12,
        shift_px: [9.0, -6.0],
        path_m: 0.0,
    };
    let said = evidence(&displays::small(), ghost);
    assert!(said.contains("pixels to the right") && said.ends_with(" up"), "{said}");
}

#[test]
fn conjugate_images_and_wrong_distances_are_found() {
    let bench = displays::small();
    finds(&bench, &[Plant::Conjugate(0.12)]);
    let said = evidence(&bench, Plant::Distance(4.0));
    let mm: f64 = said.split(' ').nth(4).unwrap().parse().unwrap();
    let planted_mm = 4e3 * plant::depth_of_focus(&bench.display);
    assert!(
        (mm - planted_mm).abs() < 0.15 * planted_mm,
        "{said}, planted {planted_mm}"
    );
}

#[test]
fn wrong_curves_are_found() {
    let bench = displays::small();
    let said = evidence(&bench, Plant::Range(0.75));
    let range: f64 = said.split(' ').nth(2).unwrap().parse().unwrap();
    assert!((range - 0.75).abs() < 0.03, "{said}");
    finds(&bench, &[Plant::Inverted]);
}

#[test]
fn turned_pictures_and_saturation_are_found_together() {
    let bench = displays::small();
    finds(&bench, &[Plant::MirrorX, Plant::Saturated(2.0)]);
    finds(&bench, &[Plant::Rotated180, Plant::ZeroOrder(0.12)]);
}

#[test]
#[ignore = "slow: 12 seconds of a core"]
fn wrong_orders_of_colours_are_found() {
    let bench = displays::small_of_three();
    finds(&bench, &[]);
    finds(&bench, &[Plant::Order([2, 1, 0])]);
}

#[test]
fn photographs_of_something_else_are_refused() {
    let bench = displays::small();
    let mut taken = taken(&bench, &[], 1);
    let photo = &mut taken.photographs[0];
    let mut dice = Dice::new(3);
    photo
        .values
        .iter_mut()
        .for_each(|value| *value = 20_000 + dice.integer(0, 4000) as u16);
    let shown = Shown {
        levels: Levels::Bytes(taken.levels.as_slice().unwrap()),
        size: bench.display.size(),
        target: &taken.target,
        z_m: 0.0,
    };
    let error = diagnose(&shown, &taken.photographs).unwrap_err().to_string();
    assert!(error.contains("does not show the hologram"), "{error}");
    taken.photographs[0].values.fill(300);
    let error = diagnose(&shown, &taken.photographs).unwrap_err().to_string();
    assert!(error.contains("too dark"), "{error}");
}
