//! Quality levels and the rules for changing between them.

use phasefront_core::Size;
use phasefront_core::encode::EncoderOptions;
use phasefront_core::method::Method;
use phasefront_core::runtime::error::{Error, Result};
use std::time::Duration;

/// A quality level: a method, a resolution and an encoder. A hologram smaller than the modulator is displayed in its
/// centre.
#[derive(Debug, Clone)]
pub struct QualityLevel {
    /// The method that computes the midpoint hologram.
    pub method: Method,
    /// The size of the hologram.
    pub size: Size,
    /// The backend; `None` for the session's backend.
    pub backend: Option<Backend>,
    /// The conversion of the field to levels; `None` for the session's encoder. For example, a lower quality level can
    /// use fewer correction steps.
    pub encoder: Option<EncoderOptions>,
}

impl QualityLevel {
    /// The maximum number of quality levels. Each is planned once when the session is created.
    pub(super) const MOST: usize = 16;

    /// Returns the encoder of this quality level in a session whose encoder is `default`.
    pub(super) fn encoder<'a>(&'a self, default: &'a EncoderOptions) -> &'a EncoderOptions {
        self.encoder.as_ref().unwrap_or(default)
    }
}

/// The backend that computes frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Backend {
    /// Computes on the CPU.
    #[default]
    Cpu,
    /// Computes on the GPU if the library was built with the feature `gpu`, a GPU exists and its results agree with the
    /// CPU's; otherwise on the CPU. The CPU also computes levels over 8 bits and sweeps whose steps have over 21 taps.
    /// [`super::Statistics::backend`] reports the backend in use and the reason.
    Gpu,
}

/// Determines whether a session may change its quality level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quality {
    /// The session lowers the quality level if frames take longer than the target rate allows or the device is hot, and
    /// raises it if there is time left.
    #[default]
    Adaptive,
    /// The session stays at this quality level.
    Fixed(usize),
}

impl Quality {
    /// # Errors
    /// Returns an error for a fixed level that is not among `quality_levels`.
    pub(super) fn check(self, quality_levels: usize) -> Result<()> {
        match self {
            Quality::Fixed(quality_level) if quality_level >= quality_levels => Err(Error::Setting(format!(
                "there is no quality level {quality_level} among {quality_levels}; the best is 0"
            ))),
            _ => Ok(()),
        }
    }
}

/// The thermal state of the device as reported by its system (ProcessInfo.thermalState on iOS, PowerManager on
/// Android).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Thermal {
    /// The device is not warm; nothing is limited.
    #[default]
    Nominal,
    /// The device is warm; frames may take 85 % of the time that the target rate allows.
    Fair,
    /// The device is hot; frames may take 50 % of that time.
    Serious,
    /// The device is too hot; the session uses the lowest quality level.
    Critical,
}

impl Thermal {
    /// Returns the share of a frame's time that may be used.
    fn share(self) -> f64 {
        match self {
            Thermal::Nominal => 1.0,
            Thermal::Fair => 0.85,
            Thermal::Serious => 0.5,
            Thermal::Critical => 0.0,
        }
    }
}

/// The reason why a session changed its quality level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum QualityReason {
    /// Frames took longer than the target rate allows.
    TooSlow,
    /// There was time for a higher quality.
    Room,
    /// The device is hot.
    Thermal,
    /// The caller requested the change.
    Asked,
    /// The new quality level cannot be planned. The session stays at its level and does not try the new one again.
    Refused,
}

/// A change of the quality level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct QualityChange {
    /// The previous quality level.
    pub(super) from: usize,
    /// The new quality level; the previous one if the reason is [`QualityReason::Refused`].
    pub(super) to: usize,
    /// The reason.
    pub(super) reason: QualityReason,
}

/// The number of consecutive slow frames before a step down.
const SLOW_FRAMES: u32 = 6;
/// The number of frames with time left before a step up; doubled after each step up that had to be undone.
const ROOMY_FRAMES: u32 = 60;
/// The number of frames with time left that a single frame without time left cancels.
const TIGHT_FRAME: u32 = 20;
/// The maximum number of frames with time left that a step up may need.
const MOST_ROOMY_FRAMES: u32 = 60 * 32;
/// A step up is tried if frames take less than this share of their time.
const ROOM: f64 = 0.7;

/// Decides on quality changes from the times of frames. Uses no clock and no frames itself.
#[derive(Debug)]
pub(super) struct LevelControl {
    /// Whether each quality level can be planned, as far as is known.
    quality_levels: Vec<bool>,
    quality_level: usize,
    slow: u32,
    roomy: u32,
    roomy_needed: u32,
    /// The number of frames since the last step up, while that step may still be undone.
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

    /// Records that a frame took `cost` of the `period` that the target rate allows, and returns a change of the
    /// quality level, if one is due.
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
        // A single slow frame with another cause must not reset the count.
        self.roomy = if used < ROOM {
            self.roomy + 1
        } else {
            self.roomy.saturating_sub(TIGHT_FRAME)
        };
        if let Some(frames) = &mut self.since_up {
            *frames += 1;
            if *frames > self.roomy_needed {
                // The step up succeeded, so the next one needs no more frames than the first.
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
            let reason = if cost <= period? {
                QualityReason::Thermal
            } else {
                QualityReason::TooSlow
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

    /// Undoes a step to a quality level that cannot be planned, and excludes that level from now on.
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
/// Returns an error if there are no quality levels or too many, if a fixed one is not among them, or if one has no
/// pixels or is larger than the modulator.
pub(super) fn check(quality_levels: &[QualityLevel], quality: Quality, modulator: Size) -> Result<()> {
    if quality_levels.is_empty() {
        return Err(Error::Setting(
            "there are no quality levels; at least one is needed".into(),
        ));
    }
    if quality_levels.len() > QualityLevel::MOST {
        return Err(Error::Setting(format!(
            "{} quality levels are too many; 1 to {} are right",
            quality_levels.len(),
            QualityLevel::MOST
        )));
    }
    quality.check(quality_levels.len())?;
    for (i, quality_level) in quality_levels.iter().enumerate() {
        let size = quality_level.size;
        let fits = (1..=modulator.width).contains(&size.width) && (1..=modulator.height).contains(&size.height);
        if !fits {
            return Err(Error::Setting(format!(
                "quality level {i} is {size}; each side must be at least 1 and at most the modulator's {modulator}"
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Duration = Duration::from_millis(33);

    /// Runs `frames` frames on a device whose quality levels take `costs_ms`; returns the steps and the frame of each.
    fn run(
        control: &mut LevelControl,
        costs_ms: &[u64],
        thermal: Thermal,
        frames: usize,
    ) -> Vec<(usize, QualityChange)> {
        (0..frames)
            .filter_map(|frame| {
                // Every 50th frame is slow for another reason.
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
        // Quality level 1 leaves time, quality level 0 is too slow: the classic oscillation.
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
        // If the lowest level is refused too, heat selects the lowest level that can be planned.
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
        // Without a target rate the session does not adapt to frame times.
        for _ in 0..100 {
            assert_eq!(control.observe(slow, None, Thermal::Nominal, Quality::Adaptive), None);
        }
    }
}
