//! What a session keeps of its frames for the next: the time and the scale of the last one.

use phasefront_core::frame::Past;
use std::time::Duration;

/// The longest gap between frames after which the past still counts.
const LONGEST_GAP: Duration = Duration::from_secs(1);

/// The past of a sequence of frames.
#[derive(Debug, Default)]
pub(super) struct History {
    /// The timestamp and the scale of the last hologram.
    last: Option<(u64, f32)>,
}

impl History {
    /// Returns the past of a frame at `timestamp_ns`, if it has one that counts.
    pub(super) fn past(&self, timestamp_ns: u64) -> Option<Past> {
        let (last_ns, scale) = self.last?;
        let elapsed = Duration::from_nanos(timestamp_ns.checked_sub(last_ns)?);
        (elapsed <= LONGEST_GAP).then_some(Past { scale, elapsed })
    }

    /// Adds the hologram of a frame.
    pub(super) fn add(&mut self, timestamp_ns: u64, scale: f32) {
        self.last = Some((timestamp_ns, scale));
    }

    /// Forgets all frames.
    pub(super) fn forget(&mut self) {
        self.last = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_past_counts_for_a_second_and_until_it_is_forgotten() {
        let mut history = History::default();
        assert_eq!(history.past(5), None);
        history.add(1_000, 0.5);
        let after = |elapsed| Past {
            scale: 0.5,
            elapsed: Duration::from_nanos(elapsed),
        };
        assert_eq!(history.past(1_033), Some(after(33)));
        assert_eq!(history.past(1_000_001_000), Some(after(1_000_000_000)));
        assert_eq!((history.past(1_000_001_001), history.past(999)), (None, None));
        history.forget();
        assert_eq!(history.past(1_033), None);
    }
}
