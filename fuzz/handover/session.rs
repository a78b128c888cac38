//! The session's source files with shuttle's threads and locks, and the situations that are tested.

mod sync {
    pub(super) use shuttle::sync::{Arc, Condvar, Mutex, MutexGuard};
    pub(super) use shuttle::thread::{Builder, JoinHandle};
    pub(super) use shuttle::thread_local;
}
#[path = "../../sdk/src/session/computing.rs"]
mod computing;
#[path = "../../sdk/src/session/drop_reason.rs"]
mod drop_reason;
#[path = "../../sdk/src/session/guarded.rs"]
mod guarded;
#[path = "../../sdk/src/session/history.rs"]
mod history;
#[path = "../../sdk/src/session/live.rs"]
mod live;
#[path = "../../sdk/src/session/process_id.rs"]
mod process_id;
#[path = "../../sdk/src/session/queue.rs"]
mod queue;
#[path = "../../sdk/src/session/statistics.rs"]
mod statistics;

use live::{Live, Report, Work};
use phasefront::{Error, Result};
use phasefront_core::frame::Past;
use queue::Queue;
use shuttle::rand::{Rng, thread_rng};
use shuttle::sync::atomic::{AtomicU64, Ordering};
use shuttle::sync::{Arc, Mutex};
use shuttle::thread;
use std::panic::resume_unwind;

/// Work that lets other threads run and sometimes fails or panics.
struct Fake {
    broken: bool,
}

impl Work for Fake {
    type Frame = u64;
    type Output = u64;

    fn scale(_: &u64) -> f32 {
        1.0
    }

    fn process(&mut self, frame: &u64, _: Option<Past>) -> Result<u64> {
        assert!(!self.broken, "not recovered");
        thread::yield_now();
        match thread_rng().gen_range(0..8) {
            0 => Err(Error::Frame("bad".into())),
            1 => {
                self.broken = true;
                resume_unwind(Box::new("worse"))
            }
            _ => Ok(*frame),
        }
    }

    fn recover(&mut self) {
        self.broken = false;
    }

    fn cancel(&self) -> phasefront_core::runtime::cancel::Cancel {
        phasefront_core::runtime::cancel::Cancel::default()
    }
}

/// Runs two cameras, a thread that resets, pauses and closes, and a listener that sometimes panics.
fn cameras_and_a_hand() {
    let told = Arc::new(AtomicU64::new(0));
    let closed = Arc::new(AtomicU64::new(0));
    let (heard, end) = (told.clone(), closed.clone());
    let listener = move |report| {
        match report {
            Report::ListenerPanicked => return,
            Report::Closed => return end.store(heard.load(Ordering::SeqCst) + 1, Ordering::SeqCst),
            _ => heard.fetch_add(1, Ordering::SeqCst),
        };
        if thread_rng().gen_range(0..10) == 0 {
            resume_unwind(Box::new("listener"));
        }
    };
    let live = Arc::new(Live::start(Fake { broken: false }, None, listener).expect("a thread"));
    let clock = Arc::new(AtomicU64::new(0));
    let camera = || {
        let (live, clock) = (live.clone(), clock.clone());
        thread::spawn(move || {
            for _ in 0..4 {
                let now = clock.fetch_add(1, Ordering::SeqCst);
                // A closed session or a late frame is refused.
                let _ = live.submit(now, |_| now);
            }
        })
    };
    let cameras = [camera(), camera()];
    for _ in 0..thread_rng().gen_range(0..4) {
        match thread_rng().gen_range(0..3) {
            0 => live.change(Queue::reset),
            1 => live.change(Queue::pause),
            _ => live.change(|queue| {
                queue.resume();
                None
            }),
        }
    }
    if thread_rng().gen_range(0..2) == 0 {
        live.close();
    }
    for camera in cameras {
        camera.join().expect("a camera that ends");
    }
    live.close();
    let counts = live.look(|queue| queue.gate.counts);
    assert_eq!((counts.pending(), counts.submitted), (0, 8));
    let known = counts.processed + counts.failed + counts.dropped.total();
    assert_eq!(told.load(Ordering::SeqCst), known);
    assert_eq!(closed.load(Ordering::SeqCst), known + 1, "the end is told last");
}

/// Runs two sessions whose listeners close each other.
fn each_closes_the_other() {
    type Sessions = [Mutex<Option<Arc<Live<Fake>>>>; 2];
    let sessions: Arc<Sessions> = Arc::new([Mutex::new(None), Mutex::new(None)]);
    for i in 0..2 {
        let others = sessions.clone();
        let listener = move |_| {
            let other = others[1 - i].lock().expect("a lock").clone();
            if let Some(other) = other {
                other.close();
            }
        };
        let live = Live::start(Fake { broken: false }, None, listener).expect("a thread");
        *sessions[i].lock().expect("a lock") = Some(Arc::new(live));
    }
    let [first, second] = [0, 1].map(|i| sessions[i].lock().expect("a lock").clone().expect("a session"));
    let other = thread::spawn(move || {
        let _ = second.submit(1, |_| 1);
        second.close();
    });
    let _ = first.submit(1, |_| 1);
    first.close();
    other.join().expect("a camera that ends");
    // The sessions hold references to each other.
    sessions
        .iter()
        .for_each(|session| drop(session.lock().expect("a lock").take()));
}

/// Runs `schedules` schedules of each situation, half of them uniformly random.
pub(crate) fn check(schedules: usize) {
    for situation in [cameras_and_a_hand, each_closes_the_other] {
        shuttle::check_random(situation, schedules / 2);
        // These schedules switch threads rarely.
        shuttle::check_pct(situation, schedules / 2, 3);
    }
}
