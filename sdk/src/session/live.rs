//! The thread of a live session: takes frames from the queue, processes them, tells the listener. What processing is,
//! is not known here.

use super::event::DropReason;
use super::queue::{Queue, Ticket};
use crate::error::{Error, Result};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{JoinHandle, ThreadId};

/// What a live session does with its frames.
pub(super) trait Work: Send + 'static {
    /// A frame in the session's own memory.
    type Frame: Send + 'static;
    /// What it becomes.
    type Output;

    /// Makes `frame` into what it becomes; `fresh` says that it has no past.
    fn process(&mut self, frame: &Self::Frame, fresh: bool) -> Result<Self::Output>;

    /// Makes good what a panic may have left half done.
    fn recover(&mut self);
}

/// What the listener of a [`Live`] hears.
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
    /// The listener itself panicked at the report before.
    ListenerPanicked,
}

struct Shared<F> {
    queue: Mutex<Queue<F>>,
    wake: Condvar,
    /// Memory for frames to come.
    spare: Mutex<Vec<F>>,
}

/// Locks also after a panic: what is behind these locks is whole between any two statements.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What a panic said.
pub(super) fn panic_message(payload: &(dyn std::any::Any + Send)) -> String {
    (payload.downcast_ref::<&str>().map(|s| (*s).to_owned()))
        .or_else(|| payload.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "a panic".into())
        .replace('\n', " ")
}

/// `process`, with a panic made an error.
pub(super) fn guarded<O>(process: impl FnOnce() -> Result<O>) -> (Result<O>, bool) {
    match catch_unwind(AssertUnwindSafe(process)) {
        Ok(result) => (result, false),
        Err(payload) => (Err(Error::Internal(panic_message(&*payload))), true),
    }
}

/// A running live session.
pub(super) struct Live<W: Work> {
    shared: Arc<Shared<W::Frame>>,
    thread: Mutex<Option<JoinHandle<()>>>,
    id: ThreadId,
}

impl<W: Work> Live<W> {
    /// Starts the thread.
    ///
    /// # Errors
    /// A thread that cannot be started.
    pub(super) fn start(
        work: W,
        period_ns: Option<u64>,
        listener: impl FnMut(Report<W::Output>) + Send + 'static,
    ) -> Result<Self> {
        let shared = Arc::new(Shared {
            queue: Mutex::new(Queue::new(period_ns)),
            wake: Condvar::new(),
            spare: Mutex::new(Vec::new()),
        });
        let thread = std::thread::Builder::new()
            .name("phasefront session".into())
            .spawn({
                let shared = shared.clone();
                move || run(&shared, work, listener)
            })
            .map_err(|e| Error::Session(format!("its thread cannot be started: {e}")))?;
        Ok(Live {
            shared,
            id: thread.thread().id(),
            thread: Mutex::new(Some(thread)),
        })
    }

    /// Lets a frame in: `fill` makes it, from memory of an earlier one where there is some. Never waits for a frame to
    /// be processed. Gives why it was dropped, if it was.
    ///
    /// # Errors
    /// A closed session, or a frame that is not later than the last.
    pub(super) fn submit(
        &self,
        timestamp_ns: u64,
        fill: impl FnOnce(Option<W::Frame>) -> W::Frame,
    ) -> Result<Option<DropReason>> {
        /// An admitted frame is put or, should copying panic, given up: the thread waits for each at the end.
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
        let spare = lock(&self.shared.spare).pop();
        let frame = fill(spare);
        if let Some(ticket) = copying.1.take() {
            let unneeded = lock(&self.shared.queue).put(ticket, frame);
            self.keep(unneeded);
        }
        Ok(None)
    }

    /// What `change` does to the queue; the thread hears of it. A frame that it gives back is kept for its memory.
    pub(super) fn change(&self, change: impl FnOnce(&mut Queue<W::Frame>) -> Option<W::Frame>) {
        let unneeded = change(&mut lock(&self.shared.queue));
        self.keep(unneeded);
    }

    /// What `look` sees of the queue.
    pub(super) fn look<T>(&self, look: impl FnOnce(&Queue<W::Frame>) -> T) -> T {
        look(&lock(&self.shared.queue))
    }

    /// Drops what is on its way and ends the thread; when it is back, all events have been told. Called by the
    /// listener, it cannot wait for that and does not.
    pub(super) fn close(&self) {
        self.change(Queue::close);
        if std::thread::current().id() == self.id {
            return;
        }
        // Held while joining, so that whoever closes too waits as well.
        if let Some(thread) = lock(&self.thread).take() {
            // Panics of work and listener are caught inside.
            let _ = thread.join();
        }
    }

    fn keep(&self, frame: Option<W::Frame>) {
        lock(&self.shared.spare).extend(frame);
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

fn run<W: Work>(
    shared: &Shared<W::Frame>,
    mut work: W,
    mut listener: impl FnMut(Report<W::Output>),
) {
    let mut tell = |report| {
        let told = catch_unwind(AssertUnwindSafe(|| listener(report)));
        if told.is_err() {
            let _ = catch_unwind(AssertUnwindSafe(|| listener(Report::ListenerPanicked)));
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
            Next::End => return,
            Next::Drop(timestamp_ns, reason) => tell(Report::Dropped {
                timestamp_ns,
                reason,
            }),
            Next::Frame(taken) => {
                let timestamp_ns = taken.timestamp_ns;
                let (result, panicked) = guarded(|| work.process(&taken.frame, taken.fresh));
                if panicked {
                    work.recover();
                }
                lock(&shared.spare).push(taken.frame);
                if lock(&shared.queue).finish(result.is_err()) {
                    tell(match result {
                        Ok(output) => Report::Done {
                            timestamp_ns,
                            output,
                        },
                        Err(error) => Report::Failed {
                            timestamp_ns,
                            error,
                        },
                    });
                }
            }
        }
    }
}
