//! Runs a live session under load and faults: every frame is reported exactly once, and memory, threads and handles do
//! not grow. `PHASEFRONT_SOAK=100000 cargo test --release --workspace --test soak -- --nocapture` is the long run.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used)]

mod camera;
#[path = "../../tests/counting.rs"]
mod counting;

use camera::{Scene, depth, frame, options};
use counting::HELD;
use phasefront::Size;
use phasefront::input::{CameraFrame, DepthFormat};
use phasefront::session::{Event, Quality, QualityLevel, Thermal};
use phasefront::{Error, LiveSession, SessionOptions, Sweep};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use tracing::span::{Attributes, Id, Record};
use tracing::{Event as TracedEvent, Metadata, Subscriber};

const W: usize = 32;
const H: usize = 24;

/// The resources of the process: allocated bytes, threads, open files.
#[derive(Debug, Clone, Copy)]
struct Held {
    bytes: usize,
    threads: usize,
    handles: usize,
}

impl Held {
    fn now() -> Self {
        let entries = |folder| std::fs::read_dir(folder).unwrap().count();
        Held {
            bytes: HELD.load(Ordering::Relaxed),
            threads: entries("/proc/self/task"),
            handles: entries("/proc/self/fd"),
        }
    }
}

/// The events that the listener received.
#[derive(Default)]
struct Heard {
    made: AtomicU64,
    dropped: AtomicU64,
    failed: AtomicU64,
    /// Failed frames whose work panicked.
    panicked: AtomicU64,
}

/// Panics in the middle of a frame: at the start of every 499th stage, on the threads that compute.
struct Panicking(AtomicU64);

impl Subscriber for Panicking {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        ["colour", "depth", "method", "propagate", "encode"].contains(&metadata.name())
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        if self.0.fetch_add(1, Ordering::Relaxed) % 499 == 498 {
            // This avoids the hook's message on stderr.
            std::panic::resume_unwind(Box::new("the work"));
        }
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}
    fn record_follows_from(&self, _: &Id, _: &Id) {}
    fn event(&self, _: &TracedEvent<'_>) {}
    fn enter(&self, _: &Id) {}
    fn exit(&self, _: &Id) {}
}

/// Returns options with a network and a sweep as quality levels, so that both are used.
fn quality_levels() -> SessionOptions {
    let mut options = options(Size { width: W, height: H });
    let sweep = Sweep::for_display(&options.target.display);
    options.quality_levels.push(QualityLevel {
        method: phasefront::Method::Sweep(sweep),
        size: Size {
            width: W / 2,
            height: H / 2,
        },
        backend: None,
        encoder: None,
    });
    options.target_rate_hz = Some(1000.0);
    options.threads = NonZeroUsize::new(2);
    options
}

/// Submits one frame or a fault; returns the clock after it.
fn submit(session: &LiveSession, random: &mut ChaCha8Rng, scenes: &[(Scene, Vec<u8>)], now: u64) -> u64 {
    let (scene, metres) = &scenes[random.random_range(0..scenes.len())];
    let later = now + random.random_range(1..3_000_000);
    let submitted = match random.random_range(0..100) {
        // The depth has no readings, so the frame fails.
        0 => {
            let nothing = vec![0; metres.len()];
            let nothing = depth(&nothing, DepthFormat::MetresF32, Size { width: W, height: H });
            session.submit(&CameraFrame::new(later, scene.colour(), nothing))
        }
        // The clock runs backwards.
        1 => session.submit(&frame(now / 2, scene, metres)),
        2 => {
            session.set_thermal([Thermal::Nominal, Thermal::Critical][random.random_range(0..2)]);
            session.submit(&frame(later, scene, metres))
        }
        3 => {
            let quality = [Quality::Fixed(0), Quality::Fixed(1), Quality::Adaptive];
            session.set_quality(quality[random.random_range(0..3)]).unwrap();
            session.submit(&frame(later, scene, metres))
        }
        4 => {
            session.pause();
            let told = session.submit(&frame(later, scene, metres));
            session.resume();
            told
        }
        5 if random.random_bool(0.1) => {
            session.reset();
            return 0;
        }
        // The camera is slow.
        6 => {
            std::thread::sleep(Duration::from_millis(1));
            session.submit(&frame(later, scene, metres))
        }
        _ => session.submit(&frame(later, scene, metres)),
    };
    match submitted {
        Ok(_) => later,
        Err(_) => now,
    }
}

/// Runs `frames` frames with faults through one session and compares its statistics with the reported events.
fn run(frames: u64, seed: u64) -> Heard {
    let random = &mut ChaCha8Rng::seed_from_u64(seed);
    let scenes: Vec<_> = (0..4)
        .map(|i| {
            let scene = Scene::new(Size { width: W, height: H }, 5 * i);
            let metres = scene.depth_bytes(DepthFormat::MetresF32);
            (scene, metres)
        })
        .collect();
    let heard = Arc::new(Heard::default());
    let listener = {
        let heard = heard.clone();
        let mut random = ChaCha8Rng::seed_from_u64(seed + 1);
        let mut kept = Vec::new();
        move |event| {
            match event {
                Event::Processed(hologram) => {
                    heard.made.fetch_add(1, Ordering::Relaxed);
                    // An app keeps some holograms and drops them in random order.
                    kept.push(hologram);
                    if kept.len() > 6 {
                        kept.swap_remove(random.random_range(0..6));
                    }
                }
                Event::Dropped { .. } => _ = heard.dropped.fetch_add(1, Ordering::Relaxed),
                Event::Failed { error, .. } => {
                    heard.failed.fetch_add(1, Ordering::Relaxed);
                    if let Error::Internal(why) = error {
                        assert_eq!(why, "the work");
                        heard.panicked.fetch_add(1, Ordering::Relaxed);
                    }
                }
                _ => {}
            }
            if random.random_bool(0.02) {
                // This avoids the hook's message on stderr.
                std::panic::resume_unwind(Box::new("the listener"));
            }
        }
    };
    let session = LiveSession::new(quality_levels(), listener).unwrap();
    let mut now = 1;
    for sent in 0..frames {
        now = submit(&session, random, &scenes, now);
        // The camera sometimes waits for its frames, so that some are processed.
        while sent % 4 == 0 && session.statistics().pending > 0 {
            std::thread::yield_now();
        }
    }
    let held = HELD.load(Ordering::Relaxed);
    // The largest plan has 4.8 MB. A frame's levels and depth have 4 kB, so 4000 kept frames would have 16 MB.
    assert!(held < 8 << 20, "after {frames} frames {held} bytes");
    session.close();
    let s = session.statistics();
    assert_eq!(s.submitted, s.processed + s.failed + s.refused + s.dropped.total());
    let told = [&heard.made, &heard.dropped, &heard.failed].map(|count| count.load(Ordering::Relaxed));
    assert_eq!(told, [s.processed, s.dropped.total(), s.failed]);
    assert!(s.listener_panics > 0 && s.refused > 0, "no fault was met: {s:?}");
    drop(session);
    Arc::into_inner(heard).unwrap_or_default()
}

#[test]
fn nothing_grows_and_nothing_is_lost_under_load_and_faults() {
    let frames: u64 = std::env::var("PHASEFRONT_SOAK").map_or(4000, |n| n.parse().unwrap());
    tracing::subscriber::set_global_default(Panicking(AtomicU64::new(0))).unwrap();
    // Two short runs first create everything that is created only once.
    (0..2).for_each(|seed| _ = run(1000, seed));
    let before = Held::now();
    let heard = run(frames, 2);
    // A short run may drop all of its few frames without depth.
    let [failed, panicked] = [&heard.failed, &heard.panicked].map(|count| count.load(Ordering::Relaxed));
    assert!(
        failed > panicked && panicked > 0,
        "{failed} failed, {panicked} of them by panics"
    );
    let mut after = Held::now();
    // Threads end shortly after their pool.
    for _ in 0..100 {
        if after.threads <= before.threads {
            break;
        }
        std::thread::sleep(Duration::from_millis(50));
        after = Held::now();
    }
    println!(
        "{frames} frames: {:?} made, {:?} dropped, {failed} failed, {panicked} of them by panics; {before:?}, then {after:?}",
        heard.made, heard.dropped
    );
    assert!(
        after.threads <= before.threads && after.handles <= before.handles,
        "{before:?}, then {after:?}"
    );
    assert!(after.bytes < before.bytes + (64 << 10), "{before:?}, then {after:?}");
}
