#![allow(clippy::unwrap_used)]
use super::*;
use crate::Size;
use ndarray::{Array2, Array3};
use rand::{RngExt, SeedableRng};

struct Case {
    depth: Array2<f32>,
    rgb: Array3<f32>,
    crop: Crop,
}

impl Case {
    /// Creates a case without a crop. The sides of `rgb` have the same proportion as those of `depth`.
    fn whole(depth: Array2<f32>, rgb: Array3<f32>) -> Self {
        let size = Size::from_shape(depth.dim());
        let crop = Crop::cover(size, size);
        Case { depth, rgb, crop }
    }

    /// Creates two surfaces of different colours, with noise, holes and a shift, at different resolutions of depth and
    /// colour. The near surface of every second case is too wide.
    fn random(seed: u64) -> Self {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut side = || random.random_range(1..60usize);
        let mut size = || Size::from_shape((side(), side()));
        let (cells, out) = (size(), size());
        let crop = Crop::cover(cells, out);
        let mut noise = |most: f32| random.random_range(-most..most);
        let front = |x: f64, y: f64| (x - 0.4).powi(2) + (y - 0.5).powi(2) < 0.07;
        let growth = (seed % 2) as f64;
        let depth = Array2::from_shape_fn(cells.shape(), |(y, x)| {
            let place = |k: f64| {
                (
                    (x as f64 + 0.9 + k) / cells.width as f64,
                    (y as f64 + 0.5) / cells.height as f64,
                )
            };
            let (x, y) = place(0.0);
            let is_front = [-growth, 0.0, growth].into_iter().any(|dx| {
                let below = growth / cells.height as f64;
                [-below, 0.0, below].into_iter().any(|dy| front(place(dx).0, y + dy))
            });
            let surface = if is_front { 0.2 } else { 0.7 + 0.2 * y as f32 };
            match noise(1.0) {
                n if n > 0.95 => f32::NAN,
                _ if x > 0.7 && y < 0.5 => f32::NAN,
                n => surface + 0.02 * n,
            }
        });
        let rgb = Array3::from_shape_fn((3, out.height, out.width), |(c, y, x)| {
            let x = (crop.x + (x as f64 + 0.5) * crop.width / out.width as f64) / cells.width as f64;
            let y = (crop.y + (y as f64 + 0.5) * crop.height / out.height as f64) / cells.height as f64;
            let colour = if front(x, y) { [0.9, 0.5, 0.1] } else { [0.2, 0.4, 0.6] };
            (colour[c] + 0.03 * noise(1.0)).clamp(0.0, 1.0)
        });
        Case { depth, rgb, crop }
    }

    /// Creates a disc of radius 50 in front of a wall, 200×200, with depth from a sensor that is `ratio` times coarser
    /// and lies (`dy`, `dx`) pixels beside the colour.
    fn disc(ratio: usize, (dy, dx): (isize, isize)) -> Self {
        let disc = |y: isize, x: isize| (y - 100).pow(2) + (x - 90).pow(2) < 2500;
        let rgb = Array3::from_shape_fn((3, 200, 200), |(c, y, x)| match disc(y as isize, x as isize) {
            true => [0.9, 0.6, 0.2][c],
            false => [0.1, 0.3, 0.4][c],
        });
        let depth = Array2::from_shape_fn((200 / ratio, 200 / ratio), |(y, x)| {
            let pixels = (0..ratio * ratio).map(|k| (y * ratio + k / ratio, x * ratio + k % ratio));
            let hits = pixels.filter(|(y, x)| disc(*y as isize - dy, *x as isize - dx));
            0.7 - 0.4 * hits.count() as f32 / (ratio * ratio) as f32
        });
        Case::whole(depth, rgb)
    }

    /// Returns the share of pixels of [`Self::disc`] whose depth in `conditioned` is wrong by more than 0.05.
    fn wrong(&self, conditioned: &[f32]) -> f64 {
        let is_front = |i: usize| self.rgb[(0, i / 200, i % 200)] > 0.5;
        let truth = |i: usize| if is_front(i) { 0.3 } else { 0.7 };
        let wrong = conditioned
            .iter()
            .enumerate()
            .filter(|(i, d)| (**d - truth(*i)).abs() > 0.05);
        wrong.count() as f64 / conditioned.len() as f64
    }

    /// Returns [`Self::wrong`] of the frame alone.
    fn wrong_alone(&self) -> f64 {
        self.wrong(&self.condition(false).unwrap())
    }

    /// Conditions `frames` of this shape one after the other with one memory.
    fn in_video(&self, frames: &[&Case]) -> Vec<Vec<f32>> {
        let (_, height, width) = self.rgb.dim();
        let plan = Conditioner::new(
            Size::from_shape(self.depth.dim()),
            self.crop,
            Size { width, height },
            false,
        )
        .unwrap();
        let mut scratch = plan.scratch();
        let condition = |frame: &&Case| {
            let mut to = vec![0.0; height * width];
            let (depth, rgb) = (frame.depth.as_slice().unwrap(), frame.rgb.as_slice().unwrap());
            plan.condition(depth, rgb, &mut to, &mut scratch).unwrap();
            to
        };
        frames.iter().map(condition).collect()
    }

    fn condition(&self, aligned: bool) -> Result<Vec<f32>> {
        let (_, height, width) = self.rgb.dim();
        let plan = Conditioner::new(
            Size::from_shape(self.depth.dim()),
            self.crop,
            Size { width, height },
            aligned,
        )?;
        let mut to = vec![9.0; height * width];
        plan.condition(
            self.depth.as_slice().unwrap(),
            self.rgb.as_slice().unwrap(),
            &mut to,
            &mut plan.scratch(),
        )?;
        assert!(to.iter().all(|d| (0.0..=1.0).contains(d)));
        Ok(to)
    }
}

#[test]
fn the_fast_form_does_as_the_definition_says() {
    let (mut all, mut differ, mut shifted, mut grown) = (0, 0, 0, 0);
    for seed in 0..150 {
        let case = Case::random(seed);
        if case.depth.iter().all(|d| d.is_nan()) {
            assert!(case.condition(false).is_err());
            continue;
        }
        let misfit = reference::misfit(case.depth.view(), case.crop, case.rgb.view());
        shifted += usize::from(misfit.shift != (0.0, 0.0));
        grown += usize::from(misfit.growth > 0);
        let naive = reference::condition(case.depth.view(), case.crop, case.rgb.view(), misfit);
        let fast = case.condition(false).unwrap();
        let count = naive
            .iter()
            .zip(&fast)
            .filter(|(a, b)| (**a - **b).abs() > 2e-4)
            .count();
        all += fast.len();
        differ += count;
    }
    // Rounding may decide between two surfaces, or two shifts, that are equally likely.
    assert!(all > 30_000 && differ * 400 < all, "{differ} of {all}");
    assert!(shifted > 20 && grown > 5, "{shifted} {grown}");
}

#[test]
fn threads_make_no_difference() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| [Case::random(12), Case::disc(4, (2, 2))].map(|case| case.condition(false).unwrap()))
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn edges_follow_the_colour_whatever_the_shift() {
    for (ratio, shift) in [
        (4, (0, 0)),
        (4, (2, 2)),
        (4, (1, -3)),
        (5, (-4, 2)),
        (2, (0, 1)),
        (1, (3, 1)),
    ] {
        let case = Case::disc(ratio, shift);
        let wrong = case.wrong_alone();
        assert!(wrong < 0.005, "{ratio} {shift:?}: {wrong}");
    }
}

/// Stereo matching makes near surfaces too wide, and hides what is behind their left edge.
#[test]
fn surfaces_that_are_too_wide_become_narrower() {
    for (growth, shift) in [(1, 0), (2, 0), (3, 0), (2, 2)] {
        let mut case = Case::disc(1, (shift, -shift));
        let truth = case.depth.clone();
        let near = |i: usize, k: isize| i.saturating_add_signed(k).min(199);
        case.depth = Array2::from_shape_fn((200, 200), |(y, x)| {
            let around = (-growth..=growth).flat_map(|dy| (-growth..=growth).map(move |dx| (dy, dx)));
            let grown = around
                .map(|(dy, dx)| truth[(near(y, dy), near(x, dx))])
                .fold(1.0, f32::min);
            let is_hidden = grown > 0.5 && (0..6).any(|k| truth[(y, near(x, k + growth))] < 0.5);
            if is_hidden { f32::NAN } else { grown }
        });
        let misfit = reference::misfit(case.depth.view(), case.crop, case.rgb.view());
        let shift = shift as f64;
        assert_eq!((misfit.shift, misfit.growth), ((shift, -shift), growth as usize));
        assert!(case.wrong_alone() < 0.002, "{growth}: {}", case.wrong_alone());
    }
}

/// A sensor whose readings at edges are those of a place beside them, as structured light has them.
#[test]
fn contradicted_readings_take_the_depth_of_their_colour() {
    let mut case = Case::disc(2, (0, 0));
    let truth = case.depth.mapv(|d| if d < 0.5 { 0.3 } else { 0.7 });
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    case.depth = Array2::from_shape_fn((100, 100), |(y, x)| {
        let mut beside = |i: usize| (i + random.random_range(0..3)).saturating_sub(1).min(99);
        truth[(beside(y), beside(x))]
    });
    let before = case.depth.indexed_iter().filter(|(at, d)| **d != truth[*at]).count();
    assert!(
        before > 80 && case.wrong_alone() < 0.002,
        "{before} {}",
        case.wrong_alone()
    );
}

#[test]
fn weak_evidence_shifts_nothing() {
    let shape = (40, 50);
    let step = Array2::from_shape_fn(shape, |(_, x)| if x < 20 { 0.2 } else { 0.8 });
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let mut noisy = |least: f32, most: f32| random.random_range(least..most);
    let black = Array3::zeros((3, 160, 200));
    let grey = Array3::from_elem((3, 160, 200), 0.5);
    let flat = Array2::from_elem(shape, 0.4);
    let texture = Array3::from_shape_fn((3, 160, 200), |_| noisy(0.0, 1.0));
    let rough = Array2::from_shape_fn(shape, |_| 0.5 + noisy(-0.02, 0.02));
    for (depth, rgb) in [(&step, &black), (&step, &grey), (&flat, &texture), (&rough, &texture)] {
        let case = Case::whole(depth.clone(), rgb.clone());
        assert_eq!(case.condition(false).unwrap(), case.condition(true).unwrap());
        assert_eq!(
            reference::misfit(depth.view(), case.crop, rgb.view()),
            Misfit::default()
        );
    }
}

#[test]
fn a_shift_beyond_the_range_leaves_surfaces_whole() {
    let conditioned = Case::disc(4, (0, 40)).condition(false).unwrap();
    let between = conditioned.iter().filter(|d| (0.35..0.65).contains(*d)).count();
    assert!(between * 200 < conditioned.len(), "{between}");
}

#[test]
fn frames_share_their_evidence_until_a_reset() {
    let (case, other) = (Case::disc(4, (2, 2)), Case::disc(4, (0, 0)));
    let plan = Conditioner::new(
        Size { width: 50, height: 50 },
        case.crop,
        Size {
            width: 200,
            height: 200,
        },
        false,
    )
    .unwrap();
    let mut scratch = plan.scratch();
    let run = |case: &Case, scratch: &mut ConditionScratch| {
        let mut to = vec![0.0; 200 * 200];
        let rgb = case.rgb.as_slice().unwrap();
        plan.condition(case.depth.as_slice().unwrap(), rgb, &mut to, scratch)
            .unwrap();
        to
    };
    for _ in 0..5 {
        assert_eq!(run(&case, &mut scratch), case.condition(false).unwrap());
    }
    assert_ne!(run(&other, &mut scratch), other.condition(false).unwrap());
    scratch.reset();
    assert_eq!(run(&other, &mut scratch), other.condition(false).unwrap());
}

/// In each frame the same discs lie in front of a wall, half of them beside their colour. The first frame has too few
/// edges to tell, and as many edges again tell no more.
#[test]
fn evidence_that_adds_up_moves_no_edge_of_a_standing_picture() {
    let disc =
        |(y, x): (isize, isize), centre: isize, radius: isize| (y - 100).pow(2) + (x - centre).pow(2) < radius * radius;
    let is_front = |(y, x), shift| disc((y, x), 60, 20) || disc((y, x - shift), 140, 26);
    let rgb = Array3::from_shape_fn((3, 200, 200), |(c, y, x)| match is_front((y as isize, x as isize), 0) {
        true => [0.9, 0.6, 0.2][c],
        false => [0.1, 0.3, 0.4][c],
    });
    let depth = Array2::from_shape_fn((50, 50), |(y, x)| {
        match is_front((4 * y as isize + 2, 4 * x as isize + 2), 2) {
            true => 0.64,
            false => 0.7,
        }
    });
    let case = Case::whole(depth, rgb);
    let alone = case.condition(false).unwrap();
    assert!(case.in_video(&[&case; 9]).iter().all(|frame| *frame == alone));
}

#[test]
fn a_sensor_that_is_moved_is_followed() {
    let (before, after) = (Case::disc(4, (2, 2)), Case::disc(4, (0, -1)));
    let mut frames = vec![&before; 20];
    frames.extend([&after; 13]);
    let seen = before.in_video(&frames);
    assert!(before.wrong(&seen[19]) < 0.005, "{}", before.wrong(&seen[19]));
    assert!(after.wrong(&seen[32]) < 0.005, "{}", after.wrong(&seen[32]));
}

/// Pixels of a scene that stands still seldom change their surface, although the readings are noisy.
#[test]
fn surfaces_stay_where_nothing_moves() {
    let case = Case::disc(4, (0, 0));
    let plan = Conditioner::new(
        Size { width: 50, height: 50 },
        case.crop,
        Size {
            width: 200,
            height: 200,
        },
        true,
    )
    .unwrap();
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    // Only its place tells the surface of a pixel.
    let rgb = vec![0.5; 3 * 200 * 200];
    let mut scratch = plan.scratch();
    let (mut alone, mut video) = (vec![], vec![]);
    for _ in 0..6 {
        let depth: Vec<f32> = (case.depth.iter())
            .map(|d| d + random.random_range(-0.03..0.03))
            .collect();
        for (seen, scratch) in [(&mut alone, &mut plan.scratch()), (&mut video, &mut scratch)] {
            let mut to = vec![0.0; 200 * 200];
            plan.condition(&depth, &rgb, &mut to, scratch).unwrap();
            seen.push(to);
        }
    }
    let flips = |seen: &[Vec<f32>]| {
        let pairs = seen.windows(2).map(|pair| pair[0].iter().zip(&pair[1]));
        pairs.flatten().filter(|(a, b)| (**a - **b).abs() > 0.05).count()
    };
    assert_eq!(alone[0], video[0]);
    let (alone, video) = (flips(&alone), flips(&video));
    assert!(alone > 100 && 4 * video < alone, "{alone} {video}");
}

/// A disc that moves is where it is now, and the wall appears where it was.
#[test]
fn what_moves_leaves_no_trail() {
    let first = Case::disc(4, (0, 0));
    let plan = Conditioner::new(
        Size { width: 50, height: 50 },
        first.crop,
        Size {
            width: 200,
            height: 200,
        },
        true,
    )
    .unwrap();
    let mut scratch = plan.scratch();
    for step in 0..5 {
        let mut case = Case::disc(4, (0, 0));
        let moved = |x: usize| (x + 8 * step).min(199);
        case.rgb = Array3::from_shape_fn((3, 200, 200), |(c, y, x)| first.rgb[(c, y, moved(x))]);
        case.depth = Array2::from_shape_fn((50, 50), |(y, x)| first.depth[(y, (x + 2 * step).min(49))]);
        let mut to = vec![0.0; 200 * 200];
        let (depth, rgb) = (case.depth.as_slice().unwrap(), case.rgb.as_slice().unwrap());
        plan.condition(depth, rgb, &mut to, &mut scratch).unwrap();
        let alone = case.condition(true).unwrap();
        let trail = to.iter().zip(&alone).filter(|(a, b)| (**a - **b).abs() > 0.03).count();
        assert_eq!(trail, 0, "{step}");
    }
}

#[test]
fn holes_take_the_surface_of_their_colour() {
    let (h, w) = (24, 32);
    let is_front = |x: usize| x < 16;
    // There are no readings around the edge, and the hole on the far right is larger than any neighbourhood.
    let depth = Array2::from_shape_fn((h, w), |(_, x)| match x {
        12..20 | 25.. => f32::NAN,
        x if is_front(x) => 0.1,
        _ => 0.9,
    });
    let rgb = Array3::from_shape_fn((3, h, w), |(_, _, x)| if is_front(x) { 0.8 } else { 0.3 });
    for (i, d) in Case::whole(depth, rgb).condition(false).unwrap().iter().enumerate() {
        let expected = if is_front(i % w) { 0.1 } else { 0.9 };
        assert!((d - expected).abs() < 1e-5, "{} {d}", i % w);
    }
}

#[test]
fn clean_depth_of_the_displays_size_is_left_alone() {
    let mut case = Case::disc(1, (0, 0));
    case.depth
        .indexed_iter_mut()
        .for_each(|((y, x), d)| *d += 0.001 * (x as f32 / 3.0 + y as f32 / 7.0).sin());
    assert_eq!(case.condition(false).unwrap(), case.depth.as_slice().unwrap());
    // Noise is removed.
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let truth = case.depth.clone();
    case.depth
        .iter_mut()
        .for_each(|d| *d += random.random_range(-0.01..0.01));
    let rms = |depth: &[f32]| {
        let squares = depth.iter().zip(&truth).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
        (squares / truth.len() as f32).sqrt()
    };
    let (before, after) = (
        rms(case.depth.as_slice().unwrap()),
        rms(&case.condition(false).unwrap()),
    );
    assert!(after < 0.4 * before, "{before} {after}");
}

/// A floor at a grazing angle stays a plane, and the steps of a sensor's numbers become smooth.
#[test]
fn slopes_stay_slopes() {
    let slope = |y: usize| 0.1 + 0.02 * y as f32;
    let rgb = Array3::from_elem((3, 160, 160), 0.5);
    let floor = Case::whole(Array2::from_shape_fn((40, 40), |(y, _)| slope(y)), rgb.clone());
    let conditioned = floor.condition(false).unwrap();
    for y in 16..144 {
        let expected = slope(0) + 0.02 * ((y as f32 + 0.5) / 4.0 - 0.5);
        assert!((conditioned[y * 160 + 80] - expected).abs() < 1e-4, "{y}");
    }
    let steps = Case::whole(
        Array2::from_shape_fn((40, 40), |(y, _)| 0.1 + 0.012 * (y / 3) as f32),
        rgb,
    );
    let conditioned = steps.condition(false).unwrap();
    let change = |y: usize| conditioned[(y + 1) * 160 + 80] - conditioned[y * 160 + 80];
    let most = (16..144).map(change).fold(0.0, f32::max);
    assert!((16..144).all(|y| change(y) >= 0.0) && most < 0.0025, "{most}");
}

/// A resampler leaves two mixed readings at an edge.
#[test]
fn a_ramp_of_two_mixed_readings_becomes_an_edge() {
    for turned in [false, true] {
        let place = |y: usize, x: usize| if turned { y } else { x };
        let depth = Array2::from_shape_fn((30, 30), |(y, x)| match place(y, x) {
            ..14 => 0.2,
            14 => 0.35,
            15 => 0.65,
            _ => 0.8,
        });
        let is_front = |y: usize, x: usize| place(y, x) < 60;
        let rgb = Array3::from_shape_fn((3, 120, 120), |(_, y, x)| if is_front(y, x) { 0.9 } else { 0.2 });
        let case = Case::whole(depth, rgb);
        for (i, d) in case.condition(false).unwrap().iter().enumerate() {
            let expected = if is_front(i / 120, i % 120) { 0.2 } else { 0.8 };
            assert!((d - expected).abs() < 0.03, "{turned} {} {} {d}", i / 120, i % 120);
        }
    }
}

#[test]
fn a_thin_bar_stays() {
    let (h, w) = (30, 40);
    let depth = Array2::from_shape_fn((h, w), |(_, x)| if x == 20 { 0.2 } else { 0.8 });
    let rgb = Array3::from_shape_fn((3, 4 * h, 4 * w), |(_, _, x)| if x / 4 == 20 { 0.9 } else { 0.2 });
    let conditioned = Case::whole(depth, rgb).condition(false).unwrap();
    for (i, d) in conditioned.iter().enumerate() {
        let expected = if i % (4 * w) / 4 == 20 { 0.2 } else { 0.8 };
        assert!((d - expected).abs() < 0.01, "{} {d}", i % (4 * w));
    }
}

#[test]
fn unusual_frames_give_depth() {
    let texture = Array3::from_shape_fn((3, 12, 20), |(c, y, x)| ((c + 3 * y + 7 * x) % 10) as f32 / 10.0);
    // One value.
    let flat = Case::whole(Array2::from_elem((6, 10), 0.4), texture.clone());
    assert!(flat.condition(false).unwrap().iter().all(|d| (d - 0.4).abs() < 1e-6));
    // Twice as wide as the colour.
    let wide = Array2::from_shape_fn((24, 40), |(_, x)| if x < 20 { 0.2 } else { 0.7 });
    let conditioned = Case::whole(wide, texture.clone()).condition(true).unwrap();
    assert!((conditioned[5 * 20 + 2] - 0.2).abs() < 1e-5 && (conditioned[5 * 20 + 17] - 0.7).abs() < 1e-5);
    // Of twice the width in proportion to its height: the display sees the middle half.
    let long = Array2::from_shape_fn((12, 40), |(_, x)| [0.1, 0.3, 0.6, 0.9][x / 10]);
    let crop = Crop::cover(Size { width: 40, height: 12 }, Size { width: 20, height: 12 });
    let middle = Case {
        depth: long,
        rgb: texture.clone(),
        crop,
    };
    let conditioned = middle.condition(true).unwrap();
    assert!((conditioned[5 * 20 + 2] - 0.3).abs() < 1e-5 && (conditioned[5 * 20 + 17] - 0.6).abs() < 1e-5);
    // A single reading.
    let mut one = Array2::from_elem((6, 10), f32::NAN);
    one[(2, 3)] = 0.6;
    assert!(
        Case::whole(one, texture.clone())
            .condition(false)
            .unwrap()
            .iter()
            .all(|d| (d - 0.6).abs() < 1e-6)
    );
    // None.
    let none = Case::whole(Array2::from_elem((6, 10), f32::NAN), texture).condition(false);
    assert!(none.unwrap_err().to_string().contains("no reading at all"));
}

#[test]
fn impossible_shapes_are_refused() {
    let crop = Crop::cover(Size { width: 1, height: 1 }, Size { width: 1, height: 1 });
    assert!(Conditioner::new(Size { width: 4, height: 0 }, crop, Size { width: 4, height: 4 }, true).is_err());
    assert!(
        Conditioner::new(
            Size { width: 4, height: 4 },
            crop,
            Size {
                width: 1 << 17,
                height: 4
            },
            true
        )
        .is_err()
    );
}
