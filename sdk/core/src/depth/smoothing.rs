//! Temporal smoothing of depth. Readings that agree with the previous frame are averaged with it, and other readings
//! replace it at once, so that moving objects leave no trail.

use std::time::Duration;

/// The largest difference between readings of one surface, as a share of the distance or, for normalized depth, of the
/// volume.
const TOLERANCE: f32 = 0.04;
/// The time in which the average moves 63 % of the way to a new reading.
const TIME_CONSTANT: Duration = Duration::from_millis(120);
/// The time for which a surface without a reading is kept.
const HOLD: Duration = Duration::from_millis(300);
/// The largest distance, in pixels, of a neighbour whose reading confirms a surface without a reading.
const NEIGHBOURS: usize = 2;

/// Smooths depth readings over time, at the sensor's resolution.
#[derive(Debug, Clone, Default)]
pub struct Smoother {
    /// The smoothed readings, NaN for unknown pixels.
    known: Vec<f32>,
    /// The time since each pixel was read.
    age: Vec<Duration>,
}

impl Smoother {
    /// Clears the history.
    pub fn reset(&mut self) {
        self.known.clear();
    }

    /// Replaces `readings`, (H, `width`), NaN for none, by smoothed ones and returns the number of readings. `elapsed`
    /// is the time since the previous call. Readings are in metres if `metric`, else normalized depth. A different size
    /// clears the history.
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

    /// A near square moves in front of a far wall. The wall must reappear in the next frame wherever the square has
    /// left.
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
        // All neighbours are of another surface, so none confirms the old one.
        let mut readings = vec![2.0; 100];
        smoother.smooth(&mut readings, 10, FRAME, true);
        let mut readings = vec![3.0; 100];
        readings[55] = f32::NAN;
        assert_eq!(smoother.smooth(&mut readings, 10, FRAME, true), 99);
        assert!(readings[55].is_nan());
        // A different size clears the history.
        assert_eq!(smoother.smooth(&mut [5.0, f32::NAN], 2, FRAME, true), 1);
    }
}
