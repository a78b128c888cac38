//! How the levels of a capture's ramps differ from those of the pattern.

use super::pattern::{Part, STEPS};
use super::shot::Seen;
use serde::Serialize;

/// The range in which grey levels 0 to 255 arrive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Range {
    /// 0 to 255, unchanged.
    Full,
    /// 16 to 235: full levels on a limited link.
    Limited,
    /// 16 to 235 arrive as 0 to 255 and the levels beyond are lost: full levels were taken for limited ones.
    Expanded,
    /// Another range.
    Other,
}

impl Range {
    /// Returns the arriving level of `step`.
    fn arrives(self, step: f64) -> f64 {
        match self {
            Range::Limited => 16.0 + step * 219.0 / 255.0,
            Range::Expanded => ((step - 16.0) * 255.0 / 219.0).clamp(0.0, 255.0),
            Range::Full | Range::Other => step,
        }
    }
}

/// How often each level arrives, for each step of a ramp and each channel.
pub(super) struct Ramp(Vec<[u32; 256]>);

impl Ramp {
    pub(super) fn of(seen: &Seen, colour: usize) -> Self {
        let mut counts = vec![[0; 256]; 3 * STEPS];
        seen.each(Part::Ramp(colour), |(y, x), (_, u)| {
            let step = usize::from(seen.layout.step(u));
            for (c, level) in seen.shot.at(y, x).into_iter().enumerate() {
                counts[3 * step + c][usize::from(level)] += 1;
            }
        });
        Ramp(counts)
    }

    fn counts(&self, step: usize, c: usize) -> (&[u32; 256], f64) {
        let counts = &self.0[3 * step + c];
        (counts, f64::from(counts.iter().sum::<u32>()))
    }

    /// Returns the mean level of a step, or `None` if the step is not visible.
    fn mean(&self, step: usize, c: usize) -> Option<f64> {
        let (counts, all) = self.counts(step, c);
        let sum: f64 = (counts.iter().enumerate())
            .map(|(level, n)| level as f64 * f64::from(*n))
            .sum();
        (all > 0.0).then(|| sum / all)
    }

    /// Returns the level of each step that half of the pixels reach, which a cover of less than half does not change.
    fn medians(&self, c: usize) -> [Option<f64>; STEPS] {
        std::array::from_fn(|step| {
            let (counts, all) = self.counts(step, c);
            let mut sum = 0.0;
            let median = counts.iter().position(|n| {
                sum += f64::from(*n);
                2.0 * sum >= all && sum > 0.0
            });
            median.map(|level| level as f64)
        })
    }

    /// Returns the mean level of each step; those of hidden steps lie on a line between their visible neighbours.
    pub(super) fn means(&self, c: usize) -> Vec<f64> {
        let visible: Vec<_> = (0..STEPS)
            .filter_map(|step| Some((step, self.mean(step, c)?)))
            .collect();
        let mean = |step: usize| {
            let after = visible.partition_point(|(at, _)| *at < step);
            match (visible.get(after), after.checked_sub(1).map(|before| visible[before])) {
                (Some(&(at, level)), _) if at == step => level,
                (Some(&(to, above)), Some((from, below))) => {
                    below + (above - below) * (step - from) as f64 / (to - from) as f64
                }
                (Some(&(_, level)), None) | (None, Some((_, level))) => level,
                (None, None) => 0.0,
            }
        };
        (0..STEPS).map(mean).collect()
    }

    /// Returns the standard deviation of pixels that should be equal, and how many pixels a step has.
    pub(super) fn noise(&self) -> (f64, f64) {
        let (mut squares, mut pixels, mut steps) = (0.0, 0.0, 0.0);
        for (step, c) in (32..224).flat_map(|step| (0..3).map(move |c| (step, c))) {
            let Some(mean) = self.mean(step, c) else { continue };
            let (counts, all) = self.counts(step, c);
            let about = |(level, n): (usize, &u32)| (level as f64 - mean).powi(2) * f64::from(*n);
            squares += counts.iter().enumerate().map(about).sum::<f64>();
            pixels += all;
            steps += 1.0;
        }
        (
            f64::sqrt(squares / f64::max(pixels, 1.0)),
            pixels / f64::max(steps, 1.0),
        )
    }

    /// Returns the number of bits in which levels arrive, at most 8.
    pub(super) fn bits(&self) -> u32 {
        self.bits_of_values().min(self.bits_of_steps())
    }

    /// Counts the different levels that arrive. A dithered link has few of them too.
    fn bits_of_values(&self) -> u32 {
        let arrives = |level: &usize| self.0.iter().any(|counts| counts[*level] > 0);
        let levels: Vec<_> = (0..256).filter(arrives).collect();
        let (Some(first), Some(last)) = (levels.first(), levels.last()) else {
            return 8;
        };
        // A steep tone curve leaves out a few levels.
        if levels.len() as f64 > 0.6 * (last - first + 1) as f64 {
            return 8;
        }
        (levels.len() as f64).log2().round() as u32
    }

    /// Finds steps that rise only every 2, 4, 8 or 16 levels, also under noise.
    fn bits_of_steps(&self) -> u32 {
        let grey = |step: usize| Some((0..3).map(|c| self.mean(step, c)).sum::<Option<f64>>()? / 3.0);
        let rises: Vec<_> = (1..STEPS)
            .filter_map(|step| Some((step, grey(step)? - grey(step - 1)?)))
            .collect();
        let rise: f64 = rises.iter().map(|(_, rise)| rise).sum();
        let share = |every: usize, first: usize| {
            let at = rises.iter().filter(|(step, _)| step % every == first);
            at.map(|(_, rise)| rise).sum::<f64>() / rise
        };
        let coarse = |bits: &u32| {
            let every = 1 << (8 - bits);
            (0..every).any(|first| share(every, first) > 0.8)
        };
        if rise < 16.0 {
            8
        } else {
            (4..8).find(coarse).unwrap_or(8)
        }
    }
}

/// Returns the level in which each grey level arrives, from the ramps of grey and of the single colours: where one of
/// them is covered, the other one is nearer to the level that was sent.
pub(super) fn first_curve(ramps: &[Ramp; 4]) -> Vec<f64> {
    let medians: [_; 3] = std::array::from_fn(|c| [ramps[0].medians(c), ramps[1 + c].medians(c)]);
    let nearest = |step: usize, of: &[[Option<f64>; STEPS]; 2]| {
        let seen = of.iter().filter_map(|medians| medians[step]);
        let apart = |level: &f64| (level - step as f64).abs();
        seen.min_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap_or(step as f64)
    };
    (0..STEPS)
        .map(|step| medians.iter().map(|of| nearest(step, of)).sum::<f64>() / 3.0)
        .collect()
}

/// Returns the mean and the largest distance between the two values of each pair.
fn errors(values: impl Iterator<Item = (f64, f64)>) -> [f64; 2] {
    let (mut sum, mut most, mut count) = (0.0f64, 0.0f64, 0.0f64);
    for (value, want) in values {
        sum += (value - want).abs();
        most = most.max((value - want).abs());
        count += 1.0;
    }
    [sum / count.max(1.0), most]
}

/// Returns the range that the grey ramp fits to `tolerance` levels in the mean, and the mean and the largest error.
pub(super) fn range(ramp: &Ramp, tolerance: f64) -> (Range, [f64; 2]) {
    let with = |range: Range| {
        let steps = (0..STEPS).flat_map(|step| (0..3).map(move |c| (step, c)));
        errors(steps.filter_map(|(step, c)| Some((ramp.mean(step, c)?, range.arrives(step as f64)))))
    };
    let candidates = [Range::Full, Range::Limited, Range::Expanded].map(|range| (range, with(range)));
    let best = candidates
        .into_iter()
        .fold((Range::Other, [f64::INFINITY; 2]), |best, of| {
            if of.1[0] < best.1[0] { of } else { best }
        });
    if best.1[0] <= tolerance {
        best
    } else {
        (Range::Other, with(Range::Full))
    }
}

/// Returns the mean and the largest error of the ramps of red, green and blue, where each channel is expected to arrive
/// as in the grey ramp.
pub(super) fn colour_error(ramps: &[Ramp; 4]) -> [f64; 2] {
    let curves: [Vec<f64>; 3] = std::array::from_fn(|c| ramps[0].means(c));
    let curves = &curves;
    let values = (1..4).flat_map(|colour| {
        (0..STEPS).flat_map(move |step| {
            (0..3).filter_map(move |c| {
                let sent = if c + 1 == colour { step } else { 0 };
                ramps[0].mean(sent, c)?;
                Some((ramps[colour].mean(step, c)?, curves[c][sent]))
            })
        })
    });
    errors(values)
}

/// How exactly the levels of ramps are known.
pub(super) struct Levels {
    pub(super) bits: u32,
    /// The mean error that noise explains.
    pub(super) tolerance: f64,
    /// Whether the ramps were resampled, which mixes their steps.
    pub(super) resampled: bool,
    pub(super) coloured: bool,
}

impl Levels {
    /// Returns the mean error up to which a range explains the grey levels: that of rounding.
    pub(super) fn of_range(&self) -> f64 {
        if self.bits < 8 || self.resampled {
            self.tolerance + f64::from(1 << (8 - self.bits.min(8))).max(2.0)
        } else {
            self.tolerance + 0.65
        }
    }

    pub(super) fn faults(
        &self,
        range: Range,
        grey_error: [f64; 2],
        colour_error: [f64; 2],
        ycbcr: bool,
    ) -> Vec<String> {
        let mut faults = Vec::new();
        if self.bits < 8 {
            faults.push(format!(
                "{} bits: levels arrive in steps of {}; set the screen or the driver to 8 bits a colour",
                self.bits,
                1 << (8 - self.bits)
            ));
        }
        match range {
            Range::Full => {}
            Range::Limited => {
                faults.push("limited range: levels 0 to 255 arrive as 16 to 235; set the driver's output to full range".into());
            }
            Range::Expanded => faults.push(
                "full range taken for limited: levels under 16 and over 235 are lost; set the driver's output to full range"
                    .into(),
            ),
            Range::Other => faults.push(format!(
                "tone curve: grey levels are off by {:.1} on average, {:.0} at most; take gamma, night light and colour profiles away",
                grey_error[0], grey_error[1]
            )),
        }
        let rounding = if self.resampled || self.bits < 8 { 12.0 } else { 0.0 };
        if self.coloured && !ycbcr && colour_error[0] > self.tolerance + rounding {
            faults.push(format!(
                "YCbCr or a colour profile: levels of pure colours are off by {:.1} on average, {:.0} at most; set the driver's output to RGB",
                colour_error[0], colour_error[1]
            ));
        }
        faults
    }
}
