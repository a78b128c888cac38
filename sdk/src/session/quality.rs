//! Quality levels, and when a session changes between them.

use super::SessionOptions;
use phasefront_core::encode::EncoderOptions;
use phasefront_core::method::Method;
use phasefront_core::runtime::error::{Error, Result};
use std::time::Duration;

/// One quality: a method, a resolution, and how levels are made. A hologram smaller than the modulator is shown in its
/// middle.
#[derive(Debug, Clone)]
pub struct QualityLevel {
    /// What makes the midpoint hologram.
    pub method: Method,
    /// Height of the hologram, pixels.
    pub height: usize,
    /// Width of the hologram, pixels.
    pub width: usize,
    /// Where it is computed; None for where all of the session is.
    pub backend: Option<Backend>,
    /// How its field becomes levels; None for what the session has. So a quality level may have fewer steps of
    /// correction.
    pub encoder: Option<EncoderOptions>,
}

impl QualityLevel {
    /// How its field becomes levels in a session of `options`.
    pub(super) fn encoder<'a>(&'a self, options: &'a SessionOptions) -> &'a EncoderOptions {
        self.encoder.as_ref().unwrap_or(&options.encoder)
    }
}

/// Where frames are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Backend {
    /// On the CPU.
    #[default]
    Cpu,
    /// On the GPU, where this library was built for it (feature `gpu`), there is one, and it answers as the CPU does;
    /// else on the CPU. Levels over 8 bits, sweeps whose steps have over 21 taps, and methods chosen automatically are
    /// the CPU's. [`super::Statistics::backend`] says which it is, and why.
    Gpu,
}

/// Whether a session may change its quality.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quality {
    /// It changes the quality level: down where frames take longer than the target rate allows or the device is hot, up
    /// where there is room.
    #[default]
    Adaptive,
    /// It stays at this quality level.
    Fixed(usize),
}

impl Quality {
    /// # Errors
    /// A fixed level that is not among `quality_levels`.
    pub(super) fn check(self, quality_levels: usize) -> Result<()> {
        match self {
            Quality::Fixed(quality_level) if quality_level >= quality_levels => Err(Error::Setting(format!(
                "there is no quality level {quality_level} among {quality_levels}; the best is 0"
            ))),
            _ => Ok(()),
        }
    }
}

/// How hot the device is, as its system says (iOS' ProcessInfo.thermalState, Android's PowerManager).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Thermal {
    /// Not warm: nothing is limited.
    #[default]
    Nominal,
    /// Warm: frames may take 85 % of the time that the target rate allows.
    Fair,
    /// Hot: half of it.
    Serious,
    /// Too hot: the lowest quality level.
    Critical,
}

impl Thermal {
    /// The share of a frame's time that may be used.
    fn share(self) -> f64 {
        match self {
            Thermal::Nominal => 1.0,
            Thermal::Fair => 0.85,
            Thermal::Serious => 0.5,
            Thermal::Critical => 0.0,
        }
    }
}

/// Why a session changed its quality.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum QualityReason {
    /// Frames took longer than the target rate allows.
    TooSlow,
    /// There was room for more.
    Room,
    /// The device is hot.
    Thermal,
    /// The caller said so.
    Asked,
    /// The quality level that was to be taken cannot be planned: the session stays where it was, and does not try it
    /// again.
    Refused,
}

/// A change of the quality level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct QualityChange {
    /// The quality level before.
    pub(super) from: usize,
    /// The quality level now; the one before where the step was [`QualityReason::Refused`].
    pub(super) to: usize,
    /// Why.
    pub(super) reason: QualityReason,
}

/// Frames over their time before a step down.
const SLOW_FRAMES: u32 = 6;
/// Frames with room before a step up; doubled with each step up that had to be taken back.
const ROOMY_FRAMES: u32 = 60;
/// Frames with room that one without outweighs.
const TIGHT_FRAME: u32 = 20;
/// The most frames with room that a step up may need.
const MOST_ROOMY_FRAMES: u32 = 60 * 32;
/// A step up is tried where frames take less than this share of their time.
const ROOM: f64 = 0.7;

/// Decides on steps from what frames cost. Knows no clock and no frames.
#[derive(Debug)]
pub(super) struct LevelControl {
    /// Whether each quality level can be planned, as far as is known.
    quality_levels: Vec<bool>,
    quality_level: usize,
    slow: u32,
    roomy: u32,
    roomy_needed: u32,
    /// Frames since the last step up, while it may still have to be taken back.
    since_up: Option<u32>,
}

impl LevelControl {
    pub(super) fn new(quality_levels: usize, quality_level: usize) -> Self {
        LevelControl {
            quality_levels: vec![true; quality_levels],
            quality_level,
            slow: 0,
            roomy: 0,
            roomy_needed: ROOMY_FRAMES,
            since_up: None,
        }
    }

    pub(super) fn quality_level(&self) -> usize {
        self.quality_level
    }

    /// Hears that a frame took `cost` of the `period` that the target rate allows; says whether to step.
    pub(super) fn observe(
        &mut self,
        cost: Duration,
        period: Option<Duration>,
        thermal: Thermal,
        quality: Quality,
    ) -> Option<QualityChange> {
        if let Quality::Fixed(quality_level) = quality {
            return self.step(quality_level, QualityReason::Asked);
        }
        if thermal == Thermal::Critical {
            let lowest = self.quality_levels.iter().rposition(|plans| *plans);
            return self.step(lowest.unwrap_or(self.quality_level), QualityReason::Thermal);
        }
        let used = cost.as_secs_f64() / (period?.as_secs_f64() * thermal.share());
        self.slow = if used > 1.0 { self.slow + 1 } else { 0 };
        // A frame that took long for another reason does not undo all room before it.
        self.roomy = match used < ROOM {
            true => self.roomy + 1,
            false => self.roomy.saturating_sub(TIGHT_FRAME),
        };
        if let Some(frames) = &mut self.since_up {
            *frames += 1;
            if *frames > self.roomy_needed {
                // It held: the next step up is tried as readily as the first.
                self.since_up = None;
                self.roomy_needed = ROOMY_FRAMES;
            }
        }
        if self.slow >= SLOW_FRAMES
            && let Some(below) = (self.quality_level + 1..self.quality_levels.len())
                .find(|quality_level| self.quality_levels[*quality_level])
        {
            if self.since_up.take().is_some() {
                self.roomy_needed = (self.roomy_needed * 2).min(MOST_ROOMY_FRAMES);
            }
            let reason = match cost <= period? {
                true => QualityReason::Thermal,
                false => QualityReason::TooSlow,
            };
            return self.step(below, reason);
        }
        if self.roomy >= self.roomy_needed
            && let Some(above) = self.quality_levels[..self.quality_level]
                .iter()
                .rposition(|plans| *plans)
        {
            let change = self.step(above, QualityReason::Room);
            self.since_up = Some(0);
            return change;
        }
        None
    }

    /// Takes back a step to a quality level that cannot be planned, which is not tried again.
    pub(super) fn refuse(&mut self, QualityChange { from, to, .. }: QualityChange) -> QualityChange {
        self.quality_levels[to] = false;
        self.quality_level = from;
        self.since_up = None;
        QualityChange {
            from,
            to: from,
            reason: QualityReason::Refused,
        }
    }

    fn step(&mut self, to: usize, reason: QualityReason) -> Option<QualityChange> {
        let from = self.quality_level;
        if to == from || !self.quality_levels[to] {
            return None;
        }
        self.quality_level = to;
        self.slow = 0;
        self.roomy = 0;
        Some(QualityChange { from, to, reason })
    }
}

/// # Errors
/// No quality levels or too many, a fixed one that is not among them, or one with no pixels or more than the modulator
/// has.
pub(super) fn check(quality_levels: &[QualityLevel], quality: Quality, modulator: (usize, usize)) -> Result<()> {
    if quality_levels.is_empty() {
        return Err(Error::Setting(
            "there are no quality levels; at least one is needed".into(),
        ));
    }
    if quality_levels.len() > SessionOptions::MOST_QUALITY_LEVELS {
        return Err(Error::Setting(format!(
            "{} quality levels are too many; 1 to {} are right",
            quality_levels.len(),
            SessionOptions::MOST_QUALITY_LEVELS
        )));
    }
    quality.check(quality_levels.len())?;
    for (i, quality_level) in quality_levels.iter().enumerate() {
        let (height, width) = (quality_level.height, quality_level.width);
        if height == 0 || width == 0 || height > modulator.0 || width > modulator.1 {
            return Err(Error::Setting(format!(
                "quality level {i} is {width}×{height}; each side must be at least 1 and at most the modulator's {}×{}",
                modulator.1, modulator.0
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Duration = Duration::from_millis(33);

    /// Runs `frames` frames on a device whose quality levels cost these milliseconds; gives the steps and the frame of
    /// each.
    fn run(
        control: &mut LevelControl,
        costs_ms: &[u64],
        thermal: Thermal,
        frames: usize,
    ) -> Vec<(usize, QualityChange)> {
        (0..frames)
            .filter_map(|frame| {
                // Every 50th frame takes long for another reason.
                let extra = if frame % 50 == 49 { 40 } else { 0 };
                let cost = Duration::from_millis(costs_ms[control.quality_level()] + extra);
                let change = control.observe(cost, Some(PERIOD), thermal, Quality::Adaptive);
                change.map(|change| (frame, change))
            })
            .collect()
    }

    #[test]
    fn it_steps_down_soon_and_stays_where_frames_are_in_time() {
        let mut control = LevelControl::new(4, 0);
        let steps = run(&mut control, &[90, 60, 28, 12], Thermal::Nominal, 5000);
        let to: Vec<_> = steps.iter().map(|(_, c)| (c.from, c.to, c.reason)).collect();
        assert_eq!(to, [(0, 1, QualityReason::TooSlow), (1, 2, QualityReason::TooSlow)]);
        assert!(steps[1].0 < 20);
    }

    #[test]
    fn it_steps_up_where_there_is_room_and_tries_in_vain_ever_more_seldom() {
        let mut control = LevelControl::new(3, 2);
        let steps = run(&mut control, &[10, 10, 10], Thermal::Nominal, 500);
        assert_eq!(control.quality_level(), 0);
        assert!(steps.iter().all(|(_, c)| c.reason == QualityReason::Room));
        // Quality level 1 leaves room, quality level 0 is too slow: the classic seesaw.
        let mut control = LevelControl::new(2, 0);
        let steps = run(&mut control, &[40, 15], Thermal::Nominal, 20_000);
        assert!(steps.len() < 40, "{}", steps.len());
        let ups: Vec<usize> = (steps.iter())
            .filter(|(_, c)| c.to == 0)
            .map(|(frame, _)| *frame)
            .collect();
        assert!(ups[1] - ups[0] < 300 && ups[ups.len() - 1] - ups[ups.len() - 2] > 1000);
    }

    #[test]
    fn it_follows_heat() {
        let mut control = LevelControl::new(3, 0);
        let costs = [25, 15, 5];
        assert!(run(&mut control, &costs, Thermal::Nominal, 500).is_empty());
        let steps = run(&mut control, &costs, Thermal::Serious, 500);
        assert_eq!(control.quality_level(), 1);
        assert_eq!(steps[0].1.reason, QualityReason::Thermal);
        let steps = run(&mut control, &costs, Thermal::Critical, 500);
        assert_eq!((steps.len(), steps[0].0, control.quality_level()), (1, 0, 2));
        run(&mut control, &costs, Thermal::Nominal, 500);
        assert_eq!(control.quality_level(), 0);
    }

    #[test]
    fn a_quality_level_that_cannot_be_planned_is_stepped_over() {
        let mut control = LevelControl::new(3, 0);
        let steps = |control: &mut LevelControl, costs: &[u64]| run(control, costs, Thermal::Nominal, 500);
        let down = QualityChange {
            from: 0,
            to: 1,
            reason: QualityReason::TooSlow,
        };
        control.quality_level = 1;
        assert_eq!(control.refuse(down).to, 0);
        assert_eq!(control.quality_level(), 0);
        let slow = steps(&mut control, &[90, 0, 28]);
        assert_eq!((slow.len(), slow[0].1.to), (1, 2));
        assert_eq!(steps(&mut control, &[10, 0, 10])[0].1.to, 0);
        let asked = |control: &mut LevelControl, quality_level| {
            control.observe(PERIOD, Some(PERIOD), Thermal::Nominal, Quality::Fixed(quality_level))
        };
        assert_eq!(asked(&mut control, 1), None);
        assert_eq!(asked(&mut control, 2).map(|c| c.to), Some(2));
        // The lowest, too: heat takes the lowest that there is.
        let change = QualityChange { from: 0, to: 2, ..down };
        control.refuse(change);
        assert!(run(&mut control, &[90; 3], Thermal::Critical, 50).is_empty());
    }

    #[test]
    fn the_caller_may_forbid_and_choose() {
        let mut control = LevelControl::new(3, 0);
        let slow = Duration::from_secs(1);
        for _ in 0..100 {
            let fixed = control.observe(slow, Some(PERIOD), Thermal::Critical, Quality::Fixed(0));
            assert_eq!(fixed, None);
        }
        let asked = control.observe(slow, None, Thermal::Nominal, Quality::Fixed(2));
        assert_eq!(asked.map(|c| (c.to, c.reason)), Some((2, QualityReason::Asked)));
        // Without a target rate there is nothing to hold.
        for _ in 0..100 {
            assert_eq!(control.observe(slow, None, Thermal::Nominal, Quality::Adaptive), None);
        }
    }
}
