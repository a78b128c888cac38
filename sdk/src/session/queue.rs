//! Which frame is next: one in flight, the newest waiting, the others dropped with a reason. A state machine without
//! threads; [`super::live`] runs it, and its tests run it through every order of events.

use super::event::DropReason;
use super::statistics::Counts;
use crate::error::{Error, Result};
use std::collections::VecDeque;

/// What each call must pass first: open, and later than the last frame.
#[derive(Debug, Default)]
pub(super) struct Gate {
    pub(super) counts: Counts,
    pub(super) closed: bool,
    pub(super) paused: bool,
    /// Whether the next frame has no past.
    pub(super) fresh: bool,
    last_ns: Option<u64>,
}

impl Gate {
    pub(super) fn new() -> Self {
        Gate {
            fresh: true,
            ..Gate::default()
        }
    }

    /// Counts a frame, and refuses it where the session is closed or, `in_order`, the frame is late.
    pub(super) fn admit(&mut self, timestamp_ns: u64, in_order: bool) -> Result<()> {
        self.counts.submitted += 1;
        let refusal = match self.last_ns {
            _ if self.closed => Some(closed()),
            Some(last_ns) if in_order && timestamp_ns <= last_ns => Some(Error::Timestamp {
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

    /// Forgets the past.
    pub(super) fn reset(&mut self) {
        self.last_ns = None;
        self.fresh = true;
    }
}

pub(super) fn closed() -> Error {
    Error::Session("it is closed; make a new one".into())
}

/// A frame's leave to enter the queue, while it is being copied.
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
    /// Whether it has no past.
    pub(super) fresh: bool,
    pub(super) frame: F,
}

/// The queue of a live session.
pub(super) struct Queue<F> {
    pub(super) gate: Gate,
    waiting: Option<Waiting<F>>,
    /// Timestamp and epoch of the frame that is being processed.
    in_flight: Option<(u64, u64)>,
    /// Frames admitted and not yet put.
    copying: usize,
    /// How often the session was reset.
    epoch: u64,
    /// Nanoseconds between frames at the target rate.
    period_ns: Option<u64>,
    /// When the next frame is due at the target rate.
    due_ns: Option<u64>,
    dropped: VecDeque<(u64, DropReason)>,
}

impl<F> Queue<F> {
    /// An open queue that lets frames in no more often than every `period_ns`.
    pub(super) fn new(period_ns: Option<u64>) -> Self {
        Queue {
            gate: Gate::new(),
            waiting: None,
            in_flight: None,
            copying: 0,
            epoch: 0,
            period_ns,
            due_ns: None,
            dropped: VecDeque::new(),
        }
    }

    /// Lets a frame in or drops it.
    ///
    /// # Errors
    /// A closed session, or a frame that is not later than the last.
    pub(super) fn admit(
        &mut self,
        timestamp_ns: u64,
    ) -> Result<std::result::Result<Ticket, DropReason>> {
        self.gate.admit(timestamp_ns, true)?;
        if self.gate.paused {
            return Ok(Err(self.drop(timestamp_ns, DropReason::Paused)));
        }
        if let Some(period) = self.period_ns {
            // A camera's clock jitters: an eighth of a period too soon is in time.
            if let Some(due) = self.due_ns
                && timestamp_ns.saturating_add(period / 8) < due
            {
                return Ok(Err(self.drop(timestamp_ns, DropReason::AboveTargetRate)));
            }
            // Frames that are in time keep the beat, so that 30 a second become 20 and not 15.
            let beat = self.due_ns.map_or(timestamp_ns, |due| {
                due.max(timestamp_ns.saturating_sub(period))
            });
            self.due_ns = Some(beat.saturating_add(period));
        }
        self.copying += 1;
        Ok(Ok(Ticket {
            timestamp_ns,
            epoch: self.epoch,
        }))
    }

    /// Puts an admitted frame; it waits, unless something happened meanwhile. Gives back a frame that is not needed.
    pub(super) fn put(&mut self, ticket: Ticket, frame: F) -> Option<F> {
        self.copying -= 1;
        let Ticket {
            timestamp_ns,
            epoch,
        } = ticket;
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
        // Of frames that were copied at the same time the newest stays, also against one that overtook it.
        let newest = (self.waiting.as_ref().map(|w| w.timestamp_ns))
            .max(self.in_flight.filter(|f| f.1 == epoch).map(|f| f.0));
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

    /// Ends an admission whose frame could not be made.
    pub(super) fn give_up(&mut self, ticket: Ticket) {
        self.copying -= 1;
        let Ticket { timestamp_ns, .. } = ticket;
        self.drop(timestamp_ns, DropReason::Superseded);
    }

    /// Takes the waiting frame into flight.
    pub(super) fn take(&mut self) -> Option<Taken<F>> {
        debug_assert!(self.in_flight.is_none());
        let waiting = self.waiting.take()?;
        self.in_flight = Some((waiting.timestamp_ns, waiting.epoch));
        Some(Taken {
            timestamp_ns: waiting.timestamp_ns,
            fresh: std::mem::take(&mut self.gate.fresh),
            frame: waiting.frame,
        })
    }

    /// Ends the frame in flight; says whether its result, or its error where it `failed`, is to be told. If not, its
    /// drop is.
    pub(super) fn finish(&mut self, failed: bool) -> bool {
        let Some((timestamp_ns, epoch)) = self.in_flight.take() else {
            return false;
        };
        match () {
            _ if self.gate.closed => self.drop(timestamp_ns, DropReason::Closed),
            _ if epoch != self.epoch => self.drop(timestamp_ns, DropReason::Reset),
            _ if failed => {
                self.gate.counts.failed += 1;
                return true;
            }
            _ => {
                self.gate.counts.processed += 1;
                return true;
            }
        };
        false
    }

    /// Drops what is on its way, and forgets the past. Gives back a frame that is not needed.
    pub(super) fn reset(&mut self) -> Option<F> {
        self.epoch += 1;
        self.due_ns = None;
        self.gate.reset();
        self.drop_waiting(DropReason::Reset)
    }

    /// Drops the waiting frame and all that come until [`Self::resume`]. Gives back a frame that is not needed.
    pub(super) fn pause(&mut self) -> Option<F> {
        self.gate.paused = true;
        self.drop_waiting(DropReason::Paused)
    }

    /// Lets frames in again.
    pub(super) fn resume(&mut self) {
        self.gate.paused = false;
    }

    /// Drops what is on its way and lets nothing in any more. Gives back a frame that is not needed.
    pub(super) fn close(&mut self) -> Option<F> {
        self.gate.closed = true;
        self.drop_waiting(DropReason::Closed)
    }

    /// A drop that has not been told yet.
    pub(super) fn next_drop(&mut self) -> Option<(u64, DropReason)> {
        self.dropped.pop_front()
    }

    /// Whether nothing will come any more.
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
