//! The ladder of qualities, and when a session steps on it.

use crate::error::{Error, Result};
use crate::method::Method;
use crate::network::Network;
use std::sync::Arc;
use std::time::Duration;

/// What makes the midpoint hologram, held by the session. See [`Method`].
#[derive(Clone)]
#[non_exhaustive]
pub enum SessionMethod {
    /// A trained network for RGB-D frames.
    Network(Arc<Network>),
}

impl SessionMethod {
    /// The same, borrowed.
    pub fn method(&self) -> Method<'_> {
        match self {
            SessionMethod::Network(network) => Method::Network(network),
        }
    }
}

/// One quality: a method and a resolution. A hologram smaller than the modulator is shown in its middle.
#[derive(Clone)]
pub struct Rung {
    /// What makes the midpoint hologram.
    pub method: SessionMethod,
    /// Height of the hologram, pixels.
    pub height: usize,
    /// Width of the hologram, pixels.
    pub width: usize,
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
}

/// A step on the ladder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QualityChange {
    /// The rung before.
    pub from: usize,
    /// The rung now.
    pub to: usize,
    /// Why.
    pub reason: QualityReason,
}

/// Frames over their time before a step down.
const SLOW_FRAMES: u32 = 6;
/// Frames with room before a step up; doubled with each step up that had to be taken back.
const ROOMY_FRAMES: u32 = 60;
/// The most frames with room that a step up may need.
const MOST_ROOMY_FRAMES: u32 = 60 * 32;
/// A step up is tried where frames take less than this share of their time.
const ROOM: f64 = 0.7;

/// Decides on steps from what frames cost. Knows no clock and no frames.
#[derive(Debug)]
pub(super) struct Ladder {
    rungs: usize,
    rung: usize,
    slow: u32,
    roomy: u32,
    roomy_needed: u32,
    /// Frames since the last step up, while it may still have to be taken back.
    since_up: Option<u32>,
    /// The least share of the time that each rung's frames took, where it is known.
    known: Vec<Option<f64>>,
}

impl Ladder {
    pub(super) fn new(rungs: usize, rung: usize) -> Self {
        Ladder {
            rungs,
            rung,
            slow: 0,
            roomy: 0,
            roomy_needed: ROOMY_FRAMES,
            since_up: None,
            known: vec![None; rungs],
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
            return self.step(self.rungs - 1, QualityReason::Thermal);
        }
        let used = cost.as_secs_f64() / (period?.as_secs_f64() * thermal.share());
        let known = &mut self.known[self.rung];
        // The cost of a rung drifts with the device's temperature; what was measured long ago fades.
        *known = Some(known.map_or(used, |known| known + 0.1 * (used - known)));
        self.slow = if used > 1.0 { self.slow + 1 } else { 0 };
        self.roomy = if used < ROOM { self.roomy + 1 } else { 0 };
        if let Some(frames) = &mut self.since_up {
            *frames += 1;
            if *frames > self.roomy_needed {
                // It held: the next step up is tried as readily as the first.
                self.since_up = None;
                self.roomy_needed = ROOMY_FRAMES;
            }
        }
        if self.slow >= SLOW_FRAMES && self.rung + 1 < self.rungs {
            if self.since_up.take().is_some() {
                self.roomy_needed = (self.roomy_needed * 2).min(MOST_ROOMY_FRAMES);
            }
            let reason = match cost <= period? {
                true => QualityReason::Thermal,
                false => QualityReason::TooSlow,
            };
            return self.step(self.rung + 1, reason);
        }
        if self.roomy >= self.roomy_needed && self.rung > 0 {
            let change = self.step(self.rung - 1, QualityReason::Room);
            self.since_up = Some(0);
            return change;
        }
        None
    }

    fn step(&mut self, to: usize, reason: QualityReason) -> Option<QualityChange> {
        let from = self.rung;
        if to == from {
            return None;
        }
        self.rung = to;
        self.slow = 0;
        self.roomy = 0;
        Some(QualityChange { from, to, reason })
    }
}

/// # Errors
/// An empty ladder, a fixed rung that is not on it, or a rung with no pixels or more than the modulator has.
pub(super) fn check(ladder: &[Rung], quality: Quality, modulator: (usize, usize)) -> Result<()> {
    if ladder.is_empty() {
        return Err(Error::Plan(
            "the ladder of qualities is empty; at least one rung is needed".into(),
        ));
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
