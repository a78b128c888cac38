//! The ladder of qualities, and when a session steps on it.

use super::{MOST_QUALITY_LEVELS, SessionOptions};
use crate::encode::EncoderOptions;
use crate::error::{Error, Result};
use crate::method::Method;
use std::time::Duration;

/// One quality: a method, a resolution, and how levels are made. A hologram smaller than the modulator is shown in its
/// middle.
#[derive(Debug, Clone)]
pub struct Rung {
    /// What makes the midpoint hologram.
    pub method: Method,
    /// Height of the hologram, pixels.
    pub height: usize,
    /// Width of the hologram, pixels.
    pub width: usize,
    /// Where it is computed; None for where all of the session is.
    pub backend: Option<Backend>,
    /// How its field becomes levels; None for what the session has. So a rung may have fewer steps of correction.
    pub encoder: Option<EncoderOptions>,
}

impl Rung {
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
    /// else on the CPU. Levels over 8 bits, sweeps whose steps have over 21 taps, and methods chosen by sharpness are
    /// the CPU's. [`super::Statistics::backend`] says which it is, and why.
    Gpu,
}

/// Whether a session may change its quality.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quality {
    /// It steps on the ladder: down where frames take longer than the target rate allows or the device is hot, up where
    /// there is room.
    #[default]
    Adaptive,
    /// It stays on this rung.
    Fixed(usize),
}

impl Quality {
    /// # Errors
    /// A fixed rung that is not on a ladder of `rungs`.
    pub(super) fn check(self, rungs: usize) -> Result<()> {
        match self {
            Quality::Fixed(rung) if rung >= rungs => Err(Error::Plan(format!(
                "there is no rung {rung} on a ladder of {rungs}; the best is 0"
            ))),
            _ => Ok(()),
        }
    }
}

/// How hot the device is, as its system says (iOS' ProcessInfo.thermalState, Android's PowerManager).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Thermal {
    /// Nothing to heed.
    #[default]
    Nominal,
    /// Warm: frames may take 85 % of the time that the target rate allows.
    Fair,
    /// Hot: half of it.
    Serious,
    /// Too hot: the lowest rung.
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
    /// The rung that was to be taken cannot be planned: the session stays where it was, and does not try it again.
    Refused,
}

/// A step on the ladder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QualityChange {
    /// The rung before.
    pub from: usize,
    /// The rung now; the one before where the step was [`QualityReason::Refused`].
    pub to: usize,
    /// Why.
    pub reason: QualityReason,
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
pub(super) struct Ladder {
    /// Whether each rung can be planned, as far as is known.
    rungs: Vec<bool>,
    rung: usize,
    slow: u32,
    roomy: u32,
    roomy_needed: u32,
    /// Frames since the last step up, while it may still have to be taken back.
    since_up: Option<u32>,
}

impl Ladder {
    pub(super) fn new(rungs: usize, rung: usize) -> Self {
        Ladder {
            rungs: vec![true; rungs],
            rung,
            slow: 0,
            roomy: 0,
            roomy_needed: ROOMY_FRAMES,
            since_up: None,
        }
    }

    pub(super) fn rung(&self) -> usize {
        self.rung
    }

    /// Hears that a frame took `cost` of the `period` that the target rate allows; says whether to step.
    pub(super) fn observe(
        &mut self,
        cost: Duration,
        period: Option<Duration>,
        thermal: Thermal,
        quality: Quality,
    ) -> Option<QualityChange> {
        if let Quality::Fixed(rung) = quality {
            return self.step(rung, QualityReason::Asked);
        }
        if thermal == Thermal::Critical {
            let lowest = self.rungs.iter().rposition(|plans| *plans);
            return self.step(lowest.unwrap_or(self.rung), QualityReason::Thermal);
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
            && let Some(below) = (self.rung + 1..self.rungs.len()).find(|rung| self.rungs[*rung])
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
            && let Some(above) = self.rungs[..self.rung].iter().rposition(|plans| *plans)
        {
            let change = self.step(above, QualityReason::Room);
            self.since_up = Some(0);
            return change;
        }
        None
    }

    /// Takes back a step to a rung that cannot be planned, which is not tried again.
    pub(super) fn refuse(&mut self, QualityChange { from, to, .. }: QualityChange) -> QualityChange {
        self.rungs[to] = false;
        self.rung = from;
        self.since_up = None;
        QualityChange {
            from,
            to: from,
            reason: QualityReason::Refused,
        }
    }

    fn step(&mut self, to: usize, reason: QualityReason) -> Option<QualityChange> {
        let from = self.rung;
        if to == from || !self.rungs[to] {
            return None;
        }
        self.rung = to;
        self.slow = 0;
        self.roomy = 0;
        Some(QualityChange { from, to, reason })
    }
}

/// # Errors
/// No quality levels or too many, a fixed one that is not among them, or one with no pixels or more than the modulator
/// has.
pub(super) fn check(ladder: &[Rung], quality: Quality, modulator: (usize, usize)) -> Result<()> {
    if ladder.is_empty() {
        return Err(Error::Plan(
            "the ladder of qualities is empty; at least one rung is needed".into(),
        ));
    }
    if ladder.len() > MOST_QUALITY_LEVELS {
        return Err(Error::Plan(format!(
            "{} quality levels are too many; 1 to {MOST_QUALITY_LEVELS} are right",
            ladder.len()
        )));
    }
    quality.check(ladder.len())?;
    for (i, rung) in ladder.iter().enumerate() {
        let (height, width) = (rung.height, rung.width);
        if height == 0 || width == 0 || height > modulator.0 || width > modulator.1 {
            return Err(Error::Plan(format!(
                "rung {i} is {width}×{height}; each side must be at least 1 and at most the modulator's {}×{}",
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

    /// Runs `frames` frames on a device whose rungs cost these milliseconds; gives the steps and the frame of each.
    fn run(ladder: &mut Ladder, costs_ms: &[u64], thermal: Thermal, frames: usize) -> Vec<(usize, QualityChange)> {
        (0..frames)
            .filter_map(|frame| {
                // Every 50th frame takes long for another reason.
                let extra = if frame % 50 == 49 { 40 } else { 0 };
                let cost = Duration::from_millis(costs_ms[ladder.rung()] + extra);
                let change = ladder.observe(cost, Some(PERIOD), thermal, Quality::Adaptive);
                change.map(|change| (frame, change))
            })
            .collect()
    }

    #[test]
    fn it_steps_down_soon_and_stays_where_frames_are_in_time() {
        let mut ladder = Ladder::new(4, 0);
        let steps = run(&mut ladder, &[90, 60, 28, 12], Thermal::Nominal, 5000);
        let to: Vec<_> = steps.iter().map(|(_, c)| (c.from, c.to, c.reason)).collect();
        assert_eq!(to, [(0, 1, QualityReason::TooSlow), (1, 2, QualityReason::TooSlow)]);
        assert!(steps[1].0 < 20);
    }

    #[test]
    fn it_steps_up_where_there_is_room_and_tries_in_vain_ever_more_seldom() {
        let mut ladder = Ladder::new(3, 2);
        let steps = run(&mut ladder, &[10, 10, 10], Thermal::Nominal, 500);
        assert_eq!(ladder.rung(), 0);
        assert!(steps.iter().all(|(_, c)| c.reason == QualityReason::Room));
        // Rung 1 leaves room, rung 0 is too slow: the classic seesaw.
        let mut ladder = Ladder::new(2, 0);
        let steps = run(&mut ladder, &[40, 15], Thermal::Nominal, 20_000);
        assert!(steps.len() < 40, "{}", steps.len());
        let ups: Vec<usize> = (steps.iter())
            .filter(|(_, c)| c.to == 0)
            .map(|(frame, _)| *frame)
            .collect();
        assert!(ups[1] - ups[0] < 300 && ups[ups.len() - 1] - ups[ups.len() - 2] > 1000);
    }

    #[test]
    fn it_heeds_heat() {
        let mut ladder = Ladder::new(3, 0);
        let costs = [25, 15, 5];
        assert!(run(&mut ladder, &costs, Thermal::Nominal, 500).is_empty());
        let steps = run(&mut ladder, &costs, Thermal::Serious, 500);
        assert_eq!(ladder.rung(), 1);
        assert_eq!(steps[0].1.reason, QualityReason::Thermal);
        let steps = run(&mut ladder, &costs, Thermal::Critical, 500);
        assert_eq!((steps.len(), steps[0].0, ladder.rung()), (1, 0, 2));
        run(&mut ladder, &costs, Thermal::Nominal, 500);
        assert_eq!(ladder.rung(), 0);
    }

    #[test]
    fn a_rung_that_cannot_be_planned_is_stepped_over() {
        let mut ladder = Ladder::new(3, 0);
        let steps = |ladder: &mut Ladder, costs: &[u64]| run(ladder, costs, Thermal::Nominal, 500);
        let down = QualityChange {
            from: 0,
            to: 1,
            reason: QualityReason::TooSlow,
        };
        ladder.rung = 1;
        assert_eq!(ladder.refuse(down).to, 0);
        assert_eq!(ladder.rung(), 0);
        let slow = steps(&mut ladder, &[90, 0, 28]);
        assert_eq!((slow.len(), slow[0].1.to), (1, 2));
        assert_eq!(steps(&mut ladder, &[10, 0, 10])[0].1.to, 0);
        let asked =
            |ladder: &mut Ladder, rung| ladder.observe(PERIOD, Some(PERIOD), Thermal::Nominal, Quality::Fixed(rung));
        assert_eq!(asked(&mut ladder, 1), None);
        assert_eq!(asked(&mut ladder, 2).map(|c| c.to), Some(2));
        // The lowest, too: heat takes the lowest that there is.
        let change = QualityChange { from: 0, to: 2, ..down };
        ladder.refuse(change);
        assert!(run(&mut ladder, &[90; 3], Thermal::Critical, 50).is_empty());
    }

    #[test]
    fn the_caller_may_forbid_and_choose() {
        let mut ladder = Ladder::new(3, 0);
        let slow = Duration::from_secs(1);
        for _ in 0..100 {
            let fixed = ladder.observe(slow, Some(PERIOD), Thermal::Critical, Quality::Fixed(0));
            assert_eq!(fixed, None);
        }
        let asked = ladder.observe(slow, None, Thermal::Nominal, Quality::Fixed(2));
        assert_eq!(asked.map(|c| (c.to, c.reason)), Some((2, QualityReason::Asked)));
        // Without a target rate there is nothing to hold.
        for _ in 0..100 {
            assert_eq!(ladder.observe(slow, None, Thermal::Nominal, Quality::Adaptive), None);
        }
    }
}
