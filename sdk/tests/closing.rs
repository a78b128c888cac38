//! Checks that a closed session keeps its statistics but no memory of frames.
#![allow(clippy::unwrap_used)]

mod camera;
#[path = "../../tests/counting.rs"]
mod counting;

use camera::{Scene, frame, options};
use counting::HELD;
use phasefront::Size;
use phasefront::input::DepthFormat;
use phasefront::session::Event;
use phasefront::{LiveSession, VideoSession};
use std::sync::atomic::Ordering;
use std::sync::mpsc;

const W: usize = 160;
const H: usize = 120;
/// A bound far below one camera frame, which has 150 kB.
const LITTLE: usize = 64 << 10;

/// Returns the allocated bytes beyond `before`. Waits, because threads of a pool end shortly after it.
fn more_than(before: usize) -> usize {
    let now = || HELD.load(Ordering::Relaxed).saturating_sub(before);
    for _ in 0..100 {
        if now() < LITTLE {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    now()
}

/// This is one test, because the allocations of another would be counted.
#[test]
fn a_closed_session_gives_its_memory_back_before_it_is_dropped() {
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let frame = |t| frame(t, &scene, &metres);
    let still = || {
        let session = VideoSession::new(options(Size { width: W, height: H })).unwrap();
        (1..4).for_each(|t| drop(session.process(&frame(t)).unwrap()));
        session
    };
    let live = || {
        let (sender, events) = mpsc::channel();
        let listener = move |event| drop(sender.send(event));
        let session = LiveSession::new(options(Size { width: W, height: H }), listener).unwrap();
        // Submit bursts, so that frames wait while one is computed.
        for t in 1..30 {
            session.submit(&frame(t)).unwrap();
        }
        while !matches!(events.recv().unwrap(), Event::Processed(hologram) if hologram.timestamp_ns() == Some(29)) {}
        session
    };
    // Allocate the parts that are created only once.
    drop((still(), live()));
    let before = HELD.load(Ordering::Relaxed);
    let (still, live) = (still(), live());
    let open = HELD.load(Ordering::Relaxed) - before;
    assert!(open > 1 << 20, "{open} bytes of two open sessions");
    still.close();
    live.close();
    let kept = more_than(before);
    assert!(kept < LITTLE, "{kept} bytes are kept of {open}");
    assert!(still.statistics().processed > 0 && live.statistics().processed > 0);
}
