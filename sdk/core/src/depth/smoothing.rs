//! Temporal smoothing of depth: readings that agree with the frame before are averaged with it, readings that do not
//! replace it at once, so that what moves leaves no trail.

use std::time::Duration;

/// Over this share of its distance a reading is another surface than the one before; of normalized depth, over this
/// much of the volume.
const TOLERANCE: f32 = 0.04;
/// Time in which the average goes 63 % of the way to a new reading.
const TIME_CONSTANT: Duration = Duration::from_millis(120);
/// A surface without a reading is believed in for this long.
const HOLD: Duration = Duration::from_millis(300);
/// How far a neighbour with a reading may be that speaks for a surface without, pixels.
const NEIGHBOURS: usize = 2;

/// Depth readings over time, at the sensor's resolution.
#[derive(Debug, Clone, Default)]
pub struct Smoother {
    /// NaN where nothing is known.
    known: Vec<f32>,
    /// How long ago each was read.
    age: Vec<Duration>,
}

impl Smoother {
    /// Forgets what it has seen.
    pub fn reset(&mut self) {
        self.known.clear();
    }

    /// Replaces `readings`, (H, `width`), NaN for none, by the smoothed ones; the last call was `elapsed` ago.
    /// `metric` says that readings are metres; if not, they are normalized depth. Another size begins anew. Gives how
    /// many readings there are now.
    pub fn smooth(&mut self, readings: &mut [f32], width: usize, elapsed: Duration, metric: bool) -> usize {
        if self.known.len() != readings.len() {
            self.known.clear();
            self.known.extend_from_slice(readings);
            self.age.clear();
            self.age.resize(readings.len(), Duration::ZERO);
            return readings.iter().filter(|v| !v.is_nan()).count();
        }
        let share = 1.0 - (-elapsed.as_secs_f32() / TIME_CONSTANT.as_secs_f32()).exp();
        let agree = |a: f32, b: f32| {
            let scale = if metric { b } else { 1.0 };
            (a - b).abs() <= TOLERANCE * scale
        };
        let height = readings.len() / width;
        let mut valid = 0;
        for y in 0..height {
            let near_y = y.saturating_sub(NEIGHBOURS)..(y + NEIGHBOURS + 1).min(height);
            for x in 0..width {
                let i = y * width + x;
                let (reading, known) = (readings[i], self.known[i]);
                let (value, age) = if !reading.is_nan() {
                    match agree(reading, known) {
                        true => (known + share * (reading - known), Duration::ZERO),
                        false => (reading, Duration::ZERO),
                    }
                } else {
                    let age = self.age[i].saturating_add(elapsed);
                    let near_x = x.saturating_sub(NEIGHBOURS)..(x + NEIGHBOURS + 1).min(width);
                    let spoken_for =
                        || (near_y.clone()).any(|y| near_x.clone().any(|x| agree(readings[y * width + x], known)));
                    match !known.is_nan() && age <= HOLD && spoken_for() {
                        true => (known, age),
                        false => (f32::NAN, age),
                    }
                };
                self.known[i] = value;
                self.age[i] = age;
                valid += usize::from(!value.is_nan());
            }
        }
        readings.copy_from_slice(&self.known);
        valid
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    const FRAME: Duration = Duration::from_millis(33);

    #[test]
    fn noise_on_what_stands_still_shrinks() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut smoother = Smoother::default();
        let (mut before, mut after) = (0.0f64, 0.0f64);
        for frame in 0..40 {
            let mut readings: Vec<f32> = (0..400).map(|_| 2.0 + random.random_range(-0.02..0.02)).collect();
            let raw = readings.clone();
            assert_eq!(smoother.smooth(&mut readings, 20, FRAME, true), 400);
            if frame > 10 {
                let square = |v: &[f32]| v.iter().map(|v| f64::from(v - 2.0).powi(2)).sum::<f64>();
                before += square(&raw);
                after += square(&readings);
            }
        }
        assert!(after < before / 5.0, "{before} {after}");
    }

    /// A near square moves over a far wall: wherever it is not, the wall is, in the very next frame.
    #[test]
    fn what_moves_leaves_no_trail() {
        let mut smoother = Smoother::default();
        for frame in 0..30 {
            let scene = |x: usize, y: usize| match (frame..frame + 6).contains(&x) && y > 4 {
                true => 1.0,
                false => 1.2,
            };
            let mut readings: Vec<f32> = (0..800).map(|i| scene(i % 40, i / 40)).collect();
            smoother.smooth(&mut readings, 40, FRAME, true);
            let wrong = (0..800).filter(|i| (readings[*i] - scene(i % 40, i / 40)).abs() > 1e-5);
            assert_eq!(wrong.count(), 0, "{frame}");
        }
    }

    #[test]
    fn a_missing_reading_is_held_where_its_surface_goes_on_and_not_for_long() {
        let mut smoother = Smoother::default();
        let mut readings = vec![2.0; 100];
        smoother.smooth(&mut readings, 10, FRAME, true);
        let mut held = 0;
        for _ in 0..20 {
            let mut readings = vec![2.0; 100];
            readings[55] = f32::NAN;
            held += usize::from(smoother.smooth(&mut readings, 10, FRAME, true) == 100);
        }
        assert_eq!(held, 9);
        // All around it another surface: nothing speaks for the old one.
        let mut readings = vec![2.0; 100];
        smoother.smooth(&mut readings, 10, FRAME, true);
        let mut readings = vec![3.0; 100];
        readings[55] = f32::NAN;
        assert_eq!(smoother.smooth(&mut readings, 10, FRAME, true), 99);
        assert!(readings[55].is_nan());
        // Another size begins anew.
        assert_eq!(smoother.smooth(&mut [5.0, f32::NAN], 2, FRAME, true), 1);
    }
}
