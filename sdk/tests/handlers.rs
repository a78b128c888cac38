//! Log and trace handlers run on the threads that compute, while the session's locks are held. A handler that calls the
//! session must not cause a deadlock. These tests use a trace collector, which is called in the same places.
#![allow(clippy::unwrap_used)]

mod camera;
#[path = "../../tests/counting.rs"]
mod counting;

use camera::{Scene, frame, options};
use counting::HELD;
use phasefront::Size;
use phasefront::input::DepthFormat;
use phasefront::output::Layout;
use phasefront::session::{Event, Quality, SessionHandle};
use phasefront::{Hologram, LiveSession, SessionOptions, VideoSession};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, OnceLock, mpsc};
use std::time::Duration;
use tracing::span::{Attributes, Id, Record};
use tracing::{Metadata, Subscriber};

const W: usize = 64;
const H: usize = 48;

type Handler = Arc<dyn Fn() + Send + Sync>;

/// The handler that is called when the named stage begins.
static HANDLER: Mutex<Option<(&str, Handler)>> = Mutex::new(None);

struct Collector;

impl Subscriber for Collector {
    fn enabled(&self, _: &Metadata<'_>) -> bool {
        true
    }

    fn new_span(&self, span: &Attributes<'_>) -> Id {
        let handler = HANDLER.lock().unwrap().clone();
        if let Some((stage, handler)) = handler
            && span.metadata().name() == stage
        {
            handler();
        }
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}
    fn record_follows_from(&self, _: &Id, _: &Id) {}
    fn event(&self, _: &tracing::Event<'_>) {}
    fn enter(&self, _: &Id) {}
    fn exit(&self, _: &Id) {}
}

/// Returns the result of `work`; a deadlock fails the test instead of blocking it.
fn in_time<T: Send + 'static>(what: &'static str, work: impl FnOnce() -> T + Send + 'static) -> T {
    let (sender, done) = mpsc::channel();
    std::thread::spawn(move || sender.send(work()));
    let Ok(done) = done.recv_timeout(Duration::from_secs(60)) else {
        panic!("{what}: somebody waits for ever");
    };
    *HANDLER.lock().unwrap() = None;
    done
}

fn handle(stage: &'static str, handler: impl Fn() + Send + Sync + 'static) {
    *HANDLER.lock().unwrap() = Some((stage, Arc::new(handler)));
}

/// Returns options with two quality levels, so that the second is planned during a frame.
fn two_levels() -> SessionOptions {
    let mut options = options(Size { width: W, height: H });
    options.quality_levels.push(options.quality_levels[0].clone());
    options.quality = Quality::Fixed(0);
    options
}

fn video() -> Arc<VideoSession> {
    Arc::new(VideoSession::new(two_levels()).unwrap())
}

fn process(session: &VideoSession, time: u64) -> phasefront::Result<Hologram> {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    session.process(&frame(time, &scene, &metres))
}

fn submit(session: &LiveSession, time: u64) {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    session.submit(&frame(time, &scene, &metres)).unwrap();
}

/// The handler closes the session that computes, on a thread of the pool and on the caller's thread.
fn closing_a_video() {
    for stage in ["method", "plan"] {
        let before = HELD.load(Ordering::Relaxed);
        let result = in_time("closing within process", move || {
            let session = video();
            process(&session, 1).unwrap();
            session.set_quality(Quality::Fixed(1)).unwrap();
            let closing = session.clone();
            handle(stage, move || closing.close());
            let result = process(&session, 2);
            *HANDLER.lock().unwrap() = None;
            let refused = process(&session, 3).unwrap_err().to_string();
            assert!(refused.contains("closed"), "{refused}");
            let s = session.statistics();
            assert_eq!((s.submitted, s.refused, s.pending), (3, 1, 0));
            (result.map(|_| ()), session)
        });
        // The frame was cancelled or had already finished.
        if let (Err(why), _) = &result {
            assert!(why.to_string().contains("given up"), "{why}");
        }
        // The memory is freed although the close did not wait. Threads end shortly after their pool.
        let held = || HELD.load(Ordering::Relaxed).saturating_sub(before);
        for _ in 0..100 {
            if held() < 64 << 10 {
                break;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        assert!(held() < 64 << 10, "{} bytes", held());
    }
}

/// Calls that would wait for a frame are refused, for this session and for another; calls that do not wait succeed.
fn calling_back() {
    for stage in ["method", "plan"] {
        let told = in_time("calling back within process", move || {
            let (this, other) = (video(), video());
            let view = Arc::new(process(&other, 1).unwrap());
            process(&this, 1).unwrap();
            this.set_quality(Quality::Fixed(1)).unwrap();
            let told = Arc::new(Mutex::new(Vec::new()));
            let (calling, telling) = (this.clone(), told.clone());
            handle(stage, move || {
                let mut rgba = [0; 4 * 8 * 8];
                let refusals = [
                    process(&calling, 9).map(|_| ()),
                    process(&other, 9).map(|_| ()),
                    calling.warm_up(),
                    view.write_preview(0.0, Size { width: 8, height: 8 }, Layout::Rgba, &mut rgba, 32),
                ];
                calling.set_quality(Quality::Fixed(0)).unwrap();
                calling.pause();
                calling.resume();
                assert_eq!(calling.statistics().submitted, 2);
                telling.lock().unwrap().extend(refusals);
            });
            process(&this, 2).unwrap();
            told
        });
        let told = std::mem::take(&mut *told.lock().unwrap());
        assert!(told.len() >= 4, "the handler was called");
        for refusal in told {
            let why = refusal.unwrap_err().to_string();
            assert!(why.contains("handler of logs"), "{why}");
        }
    }
}

/// The handler closes a live session, whose listener is told of the end.
fn closing_a_live_stream() {
    let told = in_time("closing a live stream", || {
        let (sender, events) = mpsc::channel();
        let slot = Arc::new(OnceLock::<Mutex<Option<SessionHandle>>>::new());
        let closing = slot.clone();
        let session = LiveSession::new(two_levels(), move |event| drop(sender.send(event))).unwrap();
        slot.get_or_init(|| Mutex::new(Some(session.handle().clone())));
        handle("method", move || {
            let session = closing.get().unwrap().lock().unwrap().take();
            if let Some(session) = session {
                session.close();
            }
        });
        submit(&session, 1);
        let first = events.recv().unwrap();
        let last = events.recv().unwrap();
        session.close();
        (first, last, events.try_recv().is_err())
    });
    assert!(
        matches!(told, (Event::Dropped { timestamp_ns: 1, .. }, Event::Closed, true)),
        "{told:?}"
    );
}

/// This is one test, because a process has only one collector.
#[test]
fn a_handler_of_logs_may_close_and_call_any_session() {
    tracing::subscriber::set_global_default(Collector).unwrap();
    // Allocate the parts that are created only once.
    process(&video(), 1).unwrap();
    closing_a_video();
    calling_back();
    closing_a_live_stream();
}
