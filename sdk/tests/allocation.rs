//! Checks that a frame of a session allocates nothing of an image's size. There is only one test so that no other test
//! allocates meanwhile.
#![allow(clippy::unwrap_used)]

mod camera;
#[path = "../../tests/counting.rs"]
mod counting;

use camera::{Scene, depth, options};
use counting::ALLOCATED;
use phasefront::Size;
use phasefront::input::{CameraFrame, DepthFormat};
use phasefront::output::{Layout, Output, Placement};
use phasefront::session::Event;
use phasefront::{Hologram, LiveSession, Method, SessionOptions, Sweep, VideoSession};
use std::sync::atomic::Ordering;
use std::sync::mpsc::channel;

const W: usize = 320;
const H: usize = 240;

/// Prints the bytes that `call` allocates, on all threads, and checks that they are fewer than those of the smallest
/// image, the levels of one colour. The first calls may grow memory that later ones use again.
fn count(what: &str, mut call: impl FnMut()) {
    for _ in 0..3 {
        call();
    }
    let counted = (0..5).map(|_| {
        let before = ALLOCATED.load(Ordering::Relaxed);
        call();
        ALLOCATED.load(Ordering::Relaxed) - before
    });
    let least = counted.min().unwrap();
    println!("{what}: {least} bytes");
    assert!(least < H * W, "{what} allocates {least} bytes");
}

fn of(name: &str, options: &SessionOptions) {
    let (scene, sensor) = (
        Scene::new(Size { width: W, height: H }, W / 3),
        Scene::new(
            Size {
                width: W / 4,
                height: H / 4,
            },
            W / 12,
        ),
    );
    let fine = scene.depth_bytes(DepthFormat::NormalizedU8);
    let coarse = sensor.depth_bytes(DepthFormat::MetresF32);
    let depths = [
        (
            "normalized depth",
            depth(&fine, DepthFormat::NormalizedU8, Size { width: W, height: H }),
        ),
        (
            "a sensor's depth",
            depth(
                &coarse,
                DepthFormat::MetresF32,
                Size {
                    width: W / 4,
                    height: H / 4,
                },
            ),
        ),
    ];
    for (kind, depth) in depths {
        let session = VideoSession::new(options.clone()).unwrap();
        let mut time = 0;
        let mut process = || {
            time += 33_000_000;
            let frame = CameraFrame::new(time, scene.colour(), depth);
            session.process(&frame).unwrap()
        };
        count(&format!("{name}, {kind}: process"), || drop(process()));
        views(name, &process());
        let (sender, made) = channel();
        let live = LiveSession::new(options.clone(), move |event| {
            if let Event::Processed(hologram) = event {
                sender.send(hologram.timestamp_ns()).unwrap();
            }
        });
        let live = live.unwrap();
        count(&format!("{name}, {kind}: submit, until it is a hologram"), || {
            time += 33_000_000;
            let frame = CameraFrame::new(time, scene.colour(), depth);
            live.submit(&frame).unwrap();
            assert_eq!(made.recv(), Ok(Some(time)));
        });
    }
}

/// Writes images of a hologram into memory that is kept.
fn views(name: &str, hologram: &Hologram) {
    let mut pixels = vec![0; 4 * H * W];
    count(&format!("{name}: write_preview"), || {
        hologram
            .write_preview(0.0, Size { width: W, height: H }, Layout::Rgba, &mut pixels, 4 * W)
            .unwrap();
    });
    count(&format!("{name}: an output"), || {
        let plan = Output::new(
            hologram.target(),
            Size { width: W, height: H },
            Placement::centred(Layout::Rgba),
        )
        .unwrap();
        plan.write(hologram.output_levels(), 0, &mut pixels, 4 * W).unwrap();
    });
}

#[test]
fn a_frame_allocates_no_image() {
    let before = ALLOCATED.load(Ordering::Relaxed);
    drop(std::hint::black_box(vec![1_u8; H * W]));
    assert!(
        ALLOCATED.load(Ordering::Relaxed) - before >= H * W,
        "allocations are counted"
    );
    let mut options = options(Size { width: W, height: H });
    of("a network", &options);
    options.quality_levels[0].method = Method::Sweep(Sweep::for_display(&options.target.display));
    of("the sweep", &options);
}
