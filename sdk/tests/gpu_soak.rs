//! Runs a live session whose GPU is lost repeatedly. This is a separate program because it measures its process.
//! `PHASEFRONT_SOAK=10000 cargo test --release --workspace --test gpu_soak -- --nocapture` is the long run.
#![cfg(all(feature = "gpu", target_os = "linux"))]
#![allow(clippy::unwrap_used)]

mod camera;
mod on_gpu;

use camera::{Scene, frame, options};
use on_gpu::on_gpu;
use phasefront::Size;
use phasefront::input::DepthFormat;
use phasefront::session::Event;
use phasefront::{Error, LiveSession};
use std::sync::mpsc;

/// Every frame is answered, and memory does not grow with the losses.
#[test]
fn nothing_grows_where_devices_go() {
    // glibc keeps freed memory of ended threads for later threads, and each opening starts some. A single arena shows
    // the memory in use.
    if std::env::var_os("MALLOC_ARENA_MAX").is_none() {
        let mut again = std::process::Command::new(std::env::current_exe().unwrap());
        again.args(std::env::args_os().skip(1)).env("MALLOC_ARENA_MAX", "1");
        assert!(again.status().unwrap().success());
        return;
    }
    let options = on_gpu(options(Size { width: 32, height: 24 }));
    let frames: u64 = std::env::var("PHASEFRONT_SOAK").map_or(240, |n| n.parse().unwrap());
    let scene = Scene::new(Size { width: 32, height: 24 }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let held = || {
        let statm = std::fs::read_to_string("/proc/self/statm").unwrap();
        let pages: usize = statm.split(' ').nth(1).unwrap().parse().unwrap();
        let handles = std::fs::read_dir("/proc/self/fd").unwrap().count();
        (4096 * pages, handles)
    };
    let (sender, events) = mpsc::channel();
    let listener = move |event| sender.send(event).unwrap();
    let session = LiveSession::new(options, listener).unwrap();
    let (mut made, mut lost) = (0, 0);
    let mut run = |frames: std::ops::Range<u64>| {
        for i in frames {
            session.submit(&frame(i + 1, &scene, &metres)).unwrap();
            if let (true, Some(device)) = (i % 40 == 39, session.gpu()) {
                device.wgpu().0.destroy();
            }
            match events.recv().unwrap() {
                Event::Processed(_) => made += 1,
                Event::Failed {
                    error: Error::Lost(_), ..
                } => lost += 1,
                other => panic!("{other:?}"),
            }
        }
    };
    run(0..frames / 3);
    let before = held();
    run(frames / 3..frames);
    let after = held();
    println!("{frames} frames: {made} made, {lost} lost; {before:?}, then {after:?}");
    assert_eq!(made + lost, frames);
    assert!(session.statistics().backend.why.contains("opened again after"));
    assert!(
        after.0 < before.0 + (16 << 20) && after.1 <= before.1 + 4,
        "{before:?}, then {after:?}"
    );
}
