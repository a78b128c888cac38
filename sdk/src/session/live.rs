//! The thread of a live session, which takes frames from the queue, processes them and reports to the listener. It does
//! not know how frames are processed.

use super::computing;
use super::drop_reason::DropReason;
use super::guarded::{guarded, lock};
use super::process_id::ProcessId;
use super::queue::{Queue, Ticket};
use super::sync::{Arc, Builder, Condvar, JoinHandle, Mutex, thread_local};
use phasefront_core::frame::Past;
use phasefront_core::runtime::cancel::Cancel;
use phasefront_core::runtime::caught::caught;
use phasefront_core::runtime::error::{Error, Result};
use std::cell::Cell;
use std::sync::PoisonError;

/// The work that a live session does on its frames.
pub(super) trait Work: Send + 'static {
    /// A frame in the session's own memory.
    type Frame: Send + 'static;
    /// The result of a frame.
    type Output;

    /// Processes `frame`, which follows another if there is a `past`.
    fn process(&mut self, frame: &Self::Frame, past: Option<Past>) -> Result<Self::Output>;

    /// Returns the scale of a result.
    fn scale(output: &Self::Output) -> f32;

    /// Restores a consistent state after a panic.
    fn recover(&mut self);

    /// Returns the handle that cancels a frame while it is processed.
    fn cancel(&self) -> Cancel;
}

/// A report to the listener of a [`Live`].
#[derive(Debug)]
pub(super) enum Report<O> {
    Done {
        timestamp_ns: u64,
        output: O,
    },
    Dropped {
        timestamp_ns: u64,
        reason: DropReason,
    },
    Failed {
        timestamp_ns: u64,
        error: Error,
    },
    /// The listener panicked while it handled the previous report.
    ListenerPanicked,
    /// The session is closed. Only a [`Report::ListenerPanicked`] for this report can follow.
    Closed,
}

struct Shared<F> {
    queue: Mutex<Queue<F>>,
    wake: Condvar,
    /// Memory for future frames; `None` after the session's end.
    spare: Mutex<Option<Vec<F>>>,
}

impl<F> Shared<F> {
    fn keep(&self, frame: Option<F>) {
        if let Some(spare) = &mut *lock(&self.spare)
            && spare.len() < KEPT
        {
            spare.extend(frame);
        }
    }
}

/// The maximum number of frames kept for their memory: with one camera, one is being copied, one waits and one is in
/// flight. A burst from many threads may briefly use more.
const KEPT: usize = 3;

thread_local! {
    /// Whether this is the thread of a live session, which calls its listener.
    static LISTENS: Cell<bool> = const { Cell::new(false) };
}

/// A running live session.
pub(super) struct Live<W: Work> {
    process: ProcessId,
    shared: Arc<Shared<W::Frame>>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

impl<W: Work> Live<W> {
    /// Starts the thread.
    ///
    /// # Errors
    /// Returns an error if the thread cannot be started.
    pub(super) fn start(
        work: W,
        period_ns: Option<u64>,
        listener: impl FnMut(Report<W::Output>) + Send + 'static,
    ) -> Result<Self> {
        let shared = Arc::new(Shared {
            queue: Mutex::new(Queue::new(period_ns, work.cancel())),
            wake: Condvar::new(),
            spare: Mutex::new(Some(Vec::new())),
        });
        let thread = Builder::new()
            .name("phasefront session".into())
            .spawn({
                let shared = shared.clone();
                move || run(&shared, work, listener)
            })
            .map_err(|e| Error::Threads(std::sync::Arc::new(e)))?;
        Ok(Live {
            process: ProcessId::current(),
            shared,
            thread: Mutex::new(Some(thread)),
        })
    }

    /// Submits a frame, which `fill` creates from the memory of an earlier frame, if available. Never waits for a frame
    /// to be processed. Returns the reason if the frame was dropped.
    ///
    /// # Errors
    /// Returns an error if the session is closed or the frame is not later than the last.
    pub(super) fn submit(
        &self,
        timestamp_ns: u64,
        fill: impl FnOnce(Option<W::Frame>) -> W::Frame,
    ) -> Result<Option<DropReason>> {
        /// Gives up an admitted frame if copying panics. The thread waits for every admitted frame at the end.
        struct Copying<'a, F>(&'a Shared<F>, Option<Ticket>);
        impl<F> Drop for Copying<'_, F> {
            fn drop(&mut self) {
                if let Some(ticket) = self.1.take() {
                    lock(&self.0.queue).give_up(ticket);
                    self.0.wake.notify_all();
                }
            }
        }
        let admitted = lock(&self.shared.queue).admit(timestamp_ns)?;
        let ticket = match admitted {
            Ok(ticket) => ticket,
            Err(reason) => {
                self.shared.wake.notify_all();
                return Ok(Some(reason));
            }
        };
        let mut copying = Copying(&self.shared, Some(ticket));
        let spare = lock(&self.shared.spare).as_mut().and_then(Vec::pop);
        let frame = fill(spare);
        if let Some(ticket) = copying.1.take() {
            let unneeded = lock(&self.shared.queue).put(ticket, frame);
            self.keep(unneeded);
        }
        Ok(None)
    }

    /// Applies `change` to the queue and wakes the thread. Keeps the memory of a frame that `change` returns.
    pub(super) fn change(&self, change: impl FnOnce(&mut Queue<W::Frame>) -> Option<W::Frame>) {
        let unneeded = change(&mut lock(&self.shared.queue));
        self.keep(unneeded);
    }

    /// Returns the result of `look` on the queue.
    pub(super) fn look<T>(&self, look: impl FnOnce(&Queue<W::Frame>) -> T) -> T {
        look(&lock(&self.shared.queue))
    }

    /// Drops all pending frames and ends the thread; when this returns, all events have been reported. It does not wait
    /// for that on the thread of any live session, this one's or another's: its own thread cannot end before this
    /// returns, and another listener may be waiting for this one. It does not wait on a thread that computes either,
    /// because the session's thread may be waiting for that thread.
    pub(super) fn close(&self) {
        if !self.process.is_current() {
            return;
        }
        self.change(Queue::close);
        if LISTENS.with(Cell::get) || computing::here() {
            return;
        }
        // The lock is held while joining, so that concurrent callers wait too.
        if let Some(thread) = lock(&self.thread).take() {
            // Panics of work and listener are caught inside.
            let _ = thread.join();
        }
    }

    fn keep(&self, frame: Option<W::Frame>) {
        self.shared.keep(frame);
        self.shared.wake.notify_all();
    }
}

impl<W: Work> Drop for Live<W> {
    fn drop(&mut self) {
        self.close();
    }
}

enum Next<F> {
    Drop(u64, DropReason),
    Frame(super::queue::Taken<F>),
    End,
}

fn run<W: Work>(shared: &Shared<W::Frame>, mut work: W, mut listener: impl FnMut(Report<W::Output>)) {
    LISTENS.with(|listens| listens.set(true));
    let mut tell = |report| {
        if caught(|| listener(report)).is_err() {
            let _ = caught(|| listener(Report::ListenerPanicked));
        }
    };
    loop {
        let mut queue = lock(&shared.queue);
        let next = loop {
            if let Some((timestamp_ns, reason)) = queue.next_drop() {
                break Next::Drop(timestamp_ns, reason);
            }
            if let Some(taken) = queue.take() {
                break Next::Frame(taken);
            }
            if queue.is_done() {
                break Next::End;
            }
            queue = (shared.wake.wait(queue)).unwrap_or_else(PoisonError::into_inner);
        };
        drop(queue);
        match next {
            Next::End => {
                // Free the memory before the last event.
                let _ = caught(|| drop(work));
                lock(&shared.spare).take();
                tell(Report::Closed);
                return;
            }
            Next::Drop(timestamp_ns, reason) => tell(Report::Dropped { timestamp_ns, reason }),
            Next::Frame(taken) => {
                let timestamp_ns = taken.timestamp_ns;
                let (result, panicked) = guarded(|| work.process(&taken.frame, taken.past));
                if panicked {
                    let _ = caught(|| work.recover());
                    lock(&shared.queue).gate.history.forget();
                }
                shared.keep(Some(taken.frame));
                if lock(&shared.queue).finish(result.as_ref().ok().map(W::scale)) {
                    tell(match result {
                        Ok(output) => Report::Done { timestamp_ns, output },
                        Err(error) => Report::Failed { timestamp_ns, error },
                    });
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::sync::mpsc;

    /// Work that yields a few times and sometimes fails or panics.
    struct Fake {
        random: ChaCha8Rng,
        broken: bool,
    }

    impl Work for Fake {
        type Frame = Vec<u64>;
        type Output = u64;

        fn scale(_: &u64) -> f32 {
            1.0
        }

        fn process(&mut self, frame: &Vec<u64>, _: Option<Past>) -> Result<u64> {
            assert!(!self.broken, "not recovered");
            for _ in 0..self.random.random_range(0..4) {
                std::thread::yield_now();
            }
            match self.random.random_range(0..20) {
                0 => Err(Error::Frame("bad".into())),
                1 => {
                    self.broken = true;
                    // This avoids the hook's message on stderr.
                    std::panic::resume_unwind(Box::new("worse"))
                }
                _ => Ok(frame[0]),
            }
        }

        fn recover(&mut self) {
            self.broken = false;
        }

        fn cancel(&self) -> Cancel {
            Cancel::default()
        }
    }

    /// Two cameras, one thread that resets and pauses, and a close at a random moment, on real threads.
    #[test]
    fn any_schedule_ends_with_every_frame_told() {
        for seed in 0..1500 {
            let told = Arc::new(AtomicU64::new(0));
            let panics = Arc::new(AtomicU64::new(0));
            let closed = Arc::new(AtomicU64::new(0));
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let fake = Fake {
                random: ChaCha8Rng::seed_from_u64(seed + 1),
                broken: false,
            };
            let listener = {
                let (told, panics, closed) = (told.clone(), panics.clone(), closed.clone());
                let mut random = ChaCha8Rng::seed_from_u64(seed + 2);
                move |report| match report {
                    Report::ListenerPanicked => {
                        panics.fetch_add(1, Ordering::Relaxed);
                    }
                    Report::Closed => closed.store(told.load(Ordering::Relaxed) + 1, Ordering::Relaxed),
                    report => {
                        told.fetch_add(1, Ordering::Relaxed);
                        if let Report::Done { timestamp_ns, output } = report {
                            assert_eq!(timestamp_ns, output);
                        }
                        if random.random_bool(0.05) {
                            std::panic::resume_unwind(Box::new("listener"));
                        }
                    }
                }
            };
            let live = Live::start(fake, None, listener).unwrap();
            let clock = AtomicU64::new(0);
            let frames = random.random_range(0..60);
            std::thread::scope(|scope| {
                for _ in 0..2 {
                    scope.spawn(|| {
                        for _ in 0..frames {
                            let now = clock.fetch_add(1, Ordering::Relaxed);
                            // A closed session or a late frame is refused.
                            let _ = live.submit(now, |spare: Option<Vec<u64>>| {
                                let mut frame = spare.unwrap_or_default();
                                frame.clear();
                                frame.push(now);
                                frame
                            });
                        }
                    });
                }
                for _ in 0..random.random_range(0..20) {
                    match random.random_range(0..4) {
                        0 => live.change(Queue::reset),
                        1 => live.change(Queue::pause),
                        2 => live.change(|queue| {
                            queue.resume();
                            None
                        }),
                        _ => std::thread::yield_now(),
                    }
                }
                if random.random_bool(0.5) {
                    live.close();
                }
            });
            live.close();
            let counts = live.look(|queue| queue.gate.counts);
            assert_eq!(counts.pending(), 0, "seed {seed}");
            assert_eq!(counts.submitted, 2 * frames);
            let known = counts.processed + counts.failed + counts.dropped.total();
            assert_eq!(told.load(Ordering::Relaxed), known, "seed {seed}");
            assert_eq!(
                closed.load(Ordering::Relaxed),
                known + 1,
                "seed {seed}: the end is told last"
            );
            assert!(panics.load(Ordering::Relaxed) <= known);
        }
    }

    #[test]
    fn a_panic_is_an_error_of_its_frame_and_the_next_works() {
        let fake = Fake {
            random: ChaCha8Rng::seed_from_u64(0),
            broken: false,
        };
        let (sender, reports) = mpsc::channel();
        let live = Live::start(fake, None, move |report| sender.send(report).unwrap()).unwrap();
        let (mut done, mut internal) = (0, 0);
        for timestamp in 0..400 {
            live.submit(timestamp, |_| vec![timestamp]).unwrap();
            match reports.recv().unwrap() {
                Report::Done { output, .. } => {
                    assert_eq!(output, timestamp);
                    done += 1;
                }
                Report::Failed {
                    timestamp_ns,
                    error: Error::Internal(message),
                } => {
                    assert_eq!((timestamp_ns, message.as_str()), (timestamp, "worse"));
                    internal += 1;
                }
                Report::Failed { error, .. } => assert!(matches!(error, Error::Frame(why) if why == "bad")),
                other => panic!("{other:?}"),
            }
        }
        assert!(done > 300 && internal > 5);
    }

    /// Two sessions have listeners that close each other's session.
    #[test]
    fn listeners_may_close_each_others_session() {
        let fake = || Fake {
            random: ChaCha8Rng::seed_from_u64(0),
            broken: false,
        };
        let both = Arc::new(std::sync::Barrier::new(2));
        let sessions: Arc<[std::sync::OnceLock<Live<Fake>>; 2]> = Arc::default();
        let (sender, closed) = mpsc::channel();
        for i in 0..2 {
            let (both, others, sender) = (both.clone(), sessions.clone(), sender.clone());
            let mut first = true;
            let listener = move |_| {
                if std::mem::take(&mut first) {
                    both.wait();
                    others[1 - i].wait().close();
                    sender.send(()).unwrap();
                }
            };
            let live = Live::start(fake(), None, listener).unwrap();
            live.submit(1, |_| vec![1]).unwrap();
            assert!(sessions[i].set(live).is_ok());
        }
        for _ in 0..2 {
            closed.recv_timeout(std::time::Duration::from_secs(60)).unwrap();
        }
    }

    /// A panic while copying leaves no frame that the thread would wait for.
    #[test]
    fn a_frame_that_cannot_be_copied_is_given_up() {
        let fake = Fake {
            random: ChaCha8Rng::seed_from_u64(0),
            broken: false,
        };
        let live = Live::start(fake, None, |_| {}).unwrap();
        let copied = caught(|| live.submit(1, |_| std::panic::resume_unwind(Box::new("no memory"))));
        assert_eq!(copied.err().as_deref(), Some("no memory"));
        live.close();
        assert_eq!(live.look(|queue| queue.gate.counts.dropped.total()), 1);
    }
}
