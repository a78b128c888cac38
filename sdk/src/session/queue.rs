//! Decides which frame is next: one is in flight, the newest waits, and the others are dropped with a reason. This is a
//! state machine without threads. [`super::live`] runs it, and its tests run random orders of events.

use super::drop_reason::DropReason;
use super::history::History;
use super::statistics::Counts;
use phasefront_core::frame::Past;
use phasefront_core::runtime::cancel::Cancel;
use phasefront_core::runtime::error::{Error, Result};
use std::collections::VecDeque;

/// The check that each frame must pass first: the session is open and the frame is later than the last.
#[derive(Debug, Default)]
pub(super) struct Gate {
    pub(super) counts: Counts,
    pub(super) closed: bool,
    pub(super) paused: bool,
    /// Whether frames form a sequence, so that their timestamps must increase.
    in_order: bool,
    pub(super) history: History,
    last_ns: Option<u64>,
    /// Cancels the frame that is being computed.
    cancel: Cancel,
}

impl Gate {
    pub(super) fn new(in_order: bool, cancel: Cancel) -> Self {
        Gate {
            in_order,
            cancel,
            ..Gate::default()
        }
    }

    /// Counts a frame. Refuses it if the session is closed or the frame is late in a sequence.
    pub(super) fn admit(&mut self, timestamp_ns: u64) -> Result<()> {
        self.counts.submitted += 1;
        let refusal = match self.last_ns {
            _ if self.closed => Some(closed()),
            Some(last_ns) if self.in_order && timestamp_ns <= last_ns => Some(Error::Timestamp {
                given_ns: timestamp_ns,
                last_ns,
            }),
            _ => None,
        };
        if let Some(refusal) = refusal {
            self.counts.refused += 1;
            return Err(refusal);
        }
        self.last_ns = Some(timestamp_ns);
        Ok(())
    }

    /// Begins a frame; returns its past, if it has one.
    pub(super) fn begin(&mut self, timestamp_ns: u64) -> Option<Past> {
        self.cancel.clear();
        self.history.past(timestamp_ns).filter(|_| self.in_order)
    }

    /// Forgets the past and cancels the frame that is being computed.
    pub(super) fn reset(&mut self) {
        self.last_ns = None;
        self.history.forget();
        self.cancel.request();
    }

    /// Refuses all further frames and cancels the frame that is being computed.
    pub(super) fn close(&mut self) {
        self.closed = true;
        self.cancel.request();
    }
}

pub(super) fn closed() -> Error {
    Error::Session("it is closed; make a new one".into())
}

/// A frame's permission to enter the queue, held while the frame is copied.
#[derive(Debug)]
#[must_use]
pub(super) struct Ticket {
    timestamp_ns: u64,
    epoch: u64,
}

struct Waiting<F> {
    timestamp_ns: u64,
    epoch: u64,
    frame: F,
}

/// A frame to process.
pub(super) struct Taken<F> {
    pub(super) timestamp_ns: u64,
    pub(super) past: Option<Past>,
    pub(super) frame: F,
}

/// The queue of a live session.
pub(super) struct Queue<F> {
    pub(super) gate: Gate,
    waiting: Option<Waiting<F>>,
    /// The timestamp and epoch of the frame that is being processed.
    in_flight: Option<(u64, u64)>,
    /// The timestamp of the last frame that was taken in this epoch.
    taken_ns: Option<u64>,
    /// The number of frames that were admitted and not yet put.
    copying: usize,
    /// The number of resets so far.
    epoch: u64,
    /// The time between frames at the target rate, in nanoseconds.
    period_ns: Option<u64>,
    /// The time at which the next frame is due at the target rate.
    due_ns: Option<u64>,
    dropped: VecDeque<(u64, DropReason)>,
}

impl<F> Queue<F> {
    /// Creates an open queue that admits at most one frame per `period_ns`.
    pub(super) fn new(period_ns: Option<u64>, cancel: Cancel) -> Self {
        Queue {
            gate: Gate::new(true, cancel),
            waiting: None,
            in_flight: None,
            taken_ns: None,
            copying: 0,
            epoch: 0,
            period_ns,
            due_ns: None,
            dropped: VecDeque::new(),
        }
    }

    /// Admits a frame or drops it.
    ///
    /// # Errors
    /// Returns an error if the session is closed or the frame is not later than the last.
    pub(super) fn admit(&mut self, timestamp_ns: u64) -> Result<std::result::Result<Ticket, DropReason>> {
        self.gate.admit(timestamp_ns)?;
        if self.gate.paused {
            return Ok(Err(self.drop(timestamp_ns, DropReason::Paused)));
        }
        if let Some(period) = self.period_ns {
            // Cameras' clocks jitter, so up to an eighth of a period too soon is still on time.
            if let Some(due) = self.due_ns
                && timestamp_ns.saturating_add(period / 8) < due
            {
                return Ok(Err(self.drop(timestamp_ns, DropReason::AboveTargetRate)));
            }
            // Frames that are on time keep the beat, so that 30 frames per second become 20 and not 15.
            let beat = self
                .due_ns
                .map_or(timestamp_ns, |due| due.max(timestamp_ns.saturating_sub(period)));
            self.due_ns = Some(beat.saturating_add(period));
        }
        self.copying += 1;
        Ok(Ok(Ticket {
            timestamp_ns,
            epoch: self.epoch,
        }))
    }

    /// Puts an admitted frame into the queue, unless the session was closed, reset or paused in the meantime or a newer
    /// frame overtook it. Returns a frame that is no longer needed.
    pub(super) fn put(&mut self, ticket: Ticket, frame: F) -> Option<F> {
        self.copying -= 1;
        let Ticket { timestamp_ns, epoch } = ticket;
        let stopped = match () {
            _ if self.gate.closed => Some(DropReason::Closed),
            _ if epoch != self.epoch => Some(DropReason::Reset),
            _ if self.gate.paused => Some(DropReason::Paused),
            _ => None,
        };
        if let Some(reason) = stopped {
            self.drop(timestamp_ns, reason);
            return Some(frame);
        }
        // A newer frame that was copied at the same time may have overtaken this one.
        let newest = (self.waiting.as_ref().map(|w| w.timestamp_ns)).max(self.taken_ns);
        if newest.is_some_and(|newest| newest > timestamp_ns) {
            self.drop(timestamp_ns, DropReason::Superseded);
            return Some(frame);
        }
        let before = self.waiting.replace(Waiting {
            timestamp_ns,
            epoch,
            frame,
        })?;
        self.drop(before.timestamp_ns, DropReason::Superseded);
        Some(before.frame)
    }

    /// Ends the admission of a frame that could not be created.
    pub(super) fn give_up(&mut self, ticket: Ticket) {
        self.copying -= 1;
        let Ticket { timestamp_ns, .. } = ticket;
        self.drop(timestamp_ns, DropReason::Superseded);
    }

    /// Takes the waiting frame and marks it as in flight.
    pub(super) fn take(&mut self) -> Option<Taken<F>> {
        debug_assert!(self.in_flight.is_none());
        let waiting = self.waiting.take()?;
        self.in_flight = Some((waiting.timestamp_ns, waiting.epoch));
        self.taken_ns = Some(waiting.timestamp_ns);
        Some(Taken {
            timestamp_ns: waiting.timestamp_ns,
            past: self.gate.begin(waiting.timestamp_ns),
            frame: waiting.frame,
        })
    }

    /// Ends the frame in flight, whose hologram has `scale`; `None` if it failed. Returns whether to report its result
    /// or its error; otherwise its drop is reported.
    pub(super) fn finish(&mut self, scale: Option<f32>) -> bool {
        let Some((timestamp_ns, epoch)) = self.in_flight.take() else {
            return false;
        };
        match scale {
            _ if self.gate.closed => self.drop(timestamp_ns, DropReason::Closed),
            _ if epoch != self.epoch => self.drop(timestamp_ns, DropReason::Reset),
            None => {
                self.gate.counts.failed += 1;
                return true;
            }
            Some(scale) => {
                self.gate.history.add(timestamp_ns, scale);
                self.gate.counts.processed += 1;
                return true;
            }
        };
        false
    }

    /// Drops all pending frames and forgets the past. Returns a frame that is no longer needed.
    pub(super) fn reset(&mut self) -> Option<F> {
        self.epoch += 1;
        self.due_ns = None;
        self.taken_ns = None;
        self.gate.reset();
        self.drop_waiting(DropReason::Reset)
    }

    /// Drops the waiting frame and all frames until [`Self::resume`]. Returns a frame that is no longer needed.
    pub(super) fn pause(&mut self) -> Option<F> {
        self.gate.paused = true;
        self.drop_waiting(DropReason::Paused)
    }

    /// Admits frames again.
    pub(super) fn resume(&mut self) {
        self.gate.paused = false;
    }

    /// Drops all pending frames and refuses further frames. Returns a frame that is no longer needed.
    pub(super) fn close(&mut self) -> Option<F> {
        self.gate.close();
        self.drop_waiting(DropReason::Closed)
    }

    /// Returns the next drop that has not been reported yet.
    pub(super) fn next_drop(&mut self) -> Option<(u64, DropReason)> {
        self.dropped.pop_front()
    }

    /// Checks whether the queue is closed and has nothing left to report.
    pub(super) fn is_done(&self) -> bool {
        self.gate.closed && self.copying == 0 && self.in_flight.is_none() && self.dropped.is_empty()
    }

    fn drop_waiting(&mut self, reason: DropReason) -> Option<F> {
        let waiting = self.waiting.take()?;
        self.drop(waiting.timestamp_ns, reason);
        Some(waiting.frame)
    }

    fn drop(&mut self, timestamp_ns: u64, reason: DropReason) -> DropReason {
        self.gate.counts.dropped.count(reason);
        self.dropped.push_back((timestamp_ns, reason));
        reason
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::collections::BTreeMap;
    use std::time::Duration;

    /// A queue under random events, with the invariants that must hold at each moment.
    struct Run {
        random: ChaCha8Rng,
        queue: Queue<u64>,
        clock: u64,
        tickets: Vec<Ticket>,
        flying: Option<(u64, u64)>,
        /// The reported outcome of each admitted frame, which is reported exactly once. Timestamps restart with each
        /// epoch.
        told: BTreeMap<(u64, u64), Option<DropReason>>,
        admitted: Vec<(u64, u64)>,
        drops: Vec<(u64, DropReason)>,
        epoch: u64,
        refused: u64,
        processed: u64,
        failed: u64,
        last_taken: u64,
        /// The epoch and the timestamp of the last hologram.
        made: Option<(u64, u64)>,
    }

    impl Run {
        fn new(seed: u64) -> Self {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let period = random.random_bool(0.3).then_some(20);
            Run {
                random,
                queue: Queue::new(period, Cancel::default()),
                clock: 0,
                tickets: Vec::new(),
                flying: None,
                told: BTreeMap::new(),
                admitted: Vec::new(),
                drops: Vec::new(),
                epoch: 0,
                refused: 0,
                processed: 0,
                failed: 0,
                last_taken: 0,
                made: None,
            }
        }

        fn step(&mut self) {
            match self.random.random_range(0..100) {
                0..35 => self.admit(),
                35..55 => self.put(),
                55..75 => self.take(),
                75..90 => self.finish(),
                90..93 => {
                    self.queue.reset();
                    self.epoch += 1;
                    (self.clock, self.last_taken) = (0, 0);
                }
                93..96 => {
                    self.queue.pause();
                    assert!(self.queue.waiting.is_none());
                }
                96..99 => self.queue.resume(),
                _ => self.drain(),
            }
        }

        fn admit(&mut self) {
            let late = self.clock > 0 && self.random.random_bool(0.1);
            let timestamp = if late {
                self.random.random_range(0..=self.clock)
            } else {
                self.clock + self.random.random_range(1..30)
            };
            match self.queue.admit(timestamp) {
                Err(_) => {
                    assert!(late || self.queue.gate.closed);
                    self.refused += 1;
                    return;
                }
                Ok(Ok(ticket)) => self.tickets.push(ticket),
                Ok(Err(reason)) => assert!(matches!(reason, DropReason::Paused | DropReason::AboveTargetRate)),
            }
            assert!(!late);
            self.clock = timestamp;
            self.admitted.push((self.epoch, timestamp));
        }

        fn put(&mut self) {
            if !self.tickets.is_empty() {
                let at = self.random.random_range(0..self.tickets.len());
                let ticket = self.tickets.swap_remove(at);
                let timestamp = ticket.timestamp_ns;
                let before = self.queue.waiting.as_ref().map(|w| w.timestamp_ns);
                if self.random.random_bool(0.02) {
                    self.queue.give_up(ticket);
                } else {
                    self.queue.put(ticket, timestamp);
                }
                // The waiting frame is never replaced by an older one.
                let after = self.queue.waiting.as_ref().map(|w| w.timestamp_ns);
                assert!(before.is_none() || after >= before);
            }
        }

        fn take(&mut self) {
            if self.flying.is_none()
                && let Some(taken) = self.queue.take()
            {
                assert_eq!(taken.frame, taken.timestamp_ns);
                assert!(!self.queue.gate.paused && !self.queue.gate.closed);
                assert!(taken.timestamp_ns > self.last_taken, "in order");
                self.last_taken = taken.timestamp_ns;
                // The past is the last hologram since a reset.
                let before = self.made.filter(|(epoch, _)| *epoch == self.epoch);
                let elapsed = before.map(|(_, made)| Duration::from_nanos(taken.timestamp_ns - made));
                assert_eq!(taken.past.map(|past| past.elapsed), elapsed);
                self.flying = Some((self.epoch, taken.timestamp_ns));
            }
        }

        fn finish(&mut self) {
            if let Some((epoch, timestamp)) = self.flying.take() {
                let failed = self.random.random_bool(0.2);
                let told = self.queue.finish((!failed).then_some(1.0));
                // A result from before a reset or close is never reported.
                assert_eq!(told, epoch == self.epoch && !self.queue.gate.closed);
                if told {
                    let before = self.told.insert((epoch, timestamp), None);
                    assert!(before.is_none());
                    if failed {
                        self.failed += 1;
                    } else {
                        self.processed += 1;
                        self.made = Some((epoch, timestamp));
                    }
                }
            }
        }

        fn drain(&mut self) {
            while let Some(drop) = self.queue.next_drop() {
                self.drops.push(drop);
            }
        }

        /// Closes the queue, ends all pending frames and checks the counts.
        fn end(mut self) {
            self.queue.close();
            assert!(self.queue.admit(self.clock + 1).is_err());
            self.refused += 1;
            while !self.tickets.is_empty() {
                assert!(!self.queue.is_done());
                self.put();
            }
            assert!(self.queue.take().is_none());
            self.finish();
            self.drain();
            assert!(self.queue.is_done());
            let counts = self.queue.gate.counts;
            assert_eq!(counts.pending(), 0);
            assert_eq!(
                (counts.refused, counts.processed, counts.failed),
                (self.refused, self.processed, self.failed)
            );
            assert_eq!(counts.dropped.total(), self.drops.len() as u64);
            // Every admitted frame is reported exactly once: done, failed or dropped, by its timestamp.
            let mut told: Vec<u64> = (self.told.keys().map(|(_, timestamp)| *timestamp))
                .chain(self.drops.iter().map(|(timestamp, _)| *timestamp))
                .collect();
            let mut admitted: Vec<u64> = self.admitted.iter().map(|(_, t)| *t).collect();
            told.sort_unstable();
            admitted.sort_unstable();
            assert_eq!(told, admitted);
        }
    }

    /// Runs 5000 random orders of submitting, copying, processing, resetting, pausing and closing.
    #[test]
    fn every_frame_is_told_once_whatever_happens() {
        for seed in 0..5000 {
            let mut run = Run::new(seed);
            for _ in 0..run.random.random_range(1..200) {
                run.step();
            }
            run.end();
        }
    }

    #[test]
    fn the_target_rate_is_kept_by_timestamps() {
        // The camera gives 30 frames per second with a jitter of a millisecond.
        for (target, least, most) in [
            (30.0, 300, 300),
            (20.0, 195, 205),
            (15.0, 148, 152),
            (10.0, 98, 102),
            (60.0, 300, 300),
        ] {
            let mut queue = Queue::new(Some((1e9 / target) as u64), Cancel::default());
            let mut random = ChaCha8Rng::seed_from_u64(4);
            let mut kept = 0;
            for frame in 0..300u64 {
                let timestamp = 1 + frame * 33_333_333 + random.random_range(0..2_000_000);
                if let Ok(ticket) = queue.admit(timestamp).unwrap() {
                    queue.put(ticket, ());
                    kept += 1;
                }
            }
            assert!((least..=most).contains(&kept), "{target}: {kept}");
            assert_eq!(queue.gate.counts.dropped.above_target_rate, 300 - kept);
            // After a gap the next frame is on time at once.
            assert!(queue.admit(100_000_000_000).unwrap().is_ok());
        }
    }
}
