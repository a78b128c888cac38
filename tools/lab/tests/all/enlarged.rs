//! Tests what the core finds of enlarged depth on the generators' scenes: nothing in depth of full resolution, and
//! factor and way in what the image crate enlarged.
use ndarray::Array2;
use phasefront::Size;
use phasefront_core::depth::enlarged::{Enlarging, find};
use phasefront_exact::truth::visible_depth;
use phasefront_lab::scene::{self, Scene};
use phasefront_lab::study::enlarged::{Spoiled, enlarge};

const SIZE: Size = Size {
    width: 240,
    height: 240,
};

type Kind = (&'static str, fn(u64) -> Scene);

const KINDS: [Kind; 5] = [
    ("objects", |seed| scene::random_scene(seed, SIZE)),
    ("photographs", |seed| scene::natural_scene(seed, SIZE, &[])),
    ("varied", |seed| scene::varied_scene(seed, SIZE, &[])),
    ("hard", |seed| scene::hard_scene(seed, SIZE)),
    ("interiors", |seed| scene::interior_scene(seed, SIZE)),
];

fn depth((_, scene): &Kind, seed: u64) -> Array2<f32> {
    let ldi = scene::render_ldi_reference(&scene(seed), SIZE, 1).unwrap();
    visible_depth(&ldi)
}

/// Counts the scenes of each kind, from seed 950 on, whose full resolution is taken for enlarged.
fn wrong_detections(scenes: u64) -> Vec<String> {
    let mut wrong = Vec::new();
    for kind in &KINDS {
        for seed in 950..950 + scenes {
            let clean = depth(kind, seed);
            for spoiled in Spoiled::ALL {
                if let Some(found) = find(spoiled.spoil(&clean, seed).unwrap().view()) {
                    wrong.push(format!("{} {seed} {spoiled:?}: {found}", kind.0));
                }
            }
        }
    }
    wrong
}

#[test]
fn depth_of_full_resolution_is_not_taken_for_enlarged() {
    assert_eq!(wrong_detections(1), Vec::<String>::new());
}

#[test]
#[ignore = "slow: two hundred scenes"]
fn depth_of_two_hundred_scenes_is_not_taken_for_enlarged() {
    assert_eq!(wrong_detections(40), Vec::<String>::new());
}

#[test]
#[ignore = "slow: 10 seconds of a core"]
fn factor_and_way_of_enlarged_scenes_are_found() {
    let ways = [Enlarging::Nearest, Enlarging::Bilinear, Enlarging::Bicubic];
    for kind in &KINDS {
        // Where a program cuts off bicubic overshoots, no map fits.
        let truth = depth(kind, 950).mapv(|d| 0.15 + 0.7 * d);
        for factor in [2.0, 3.0, 5.0, 7.5, 8.0] {
            for by in ways {
                let large = enlarge(&truth, factor, by);
                let found = find(large.view()).map(|found| (found.factor, found.by));
                // By 2, Catmull and Rom's bicubic cannot be told from the linear map of sharper readings.
                let by = if factor == 2.0 && by == Enlarging::Bicubic {
                    Enlarging::Bilinear
                } else {
                    by
                };
                assert_eq!(found, Some((factor, by)), "{}", kind.0);
            }
        }
    }
}
