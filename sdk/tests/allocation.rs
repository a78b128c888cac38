//! The hot calls of plans allocate nothing. One test only, so that nobody else allocates meanwhile.
#![allow(unsafe_code, clippy::unwrap_used)]

mod network_models;

use network_models::Model;
use num_complex::Complex32;
use phasefront::encode::{Encoding, Scale};
use phasefront::slm::Response;
use phasefront::wave::aperture::Aperture;
use phasefront::wave::asm::{Padding, Propagator};
use phasefront::{Display, Modulator, Network};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: hands every call to the system's allocator unchanged; counting has no effect on it.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's contract is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's contract is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The fewest allocations of some calls: the first may grow the pool's queues, and a busy machine at any time.
fn count(mut call: impl FnMut()) -> usize {
    let counts = (0..8).map(|_| {
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        call();
        ALLOCATIONS.load(Ordering::Relaxed) - before
    });
    counts.min().unwrap()
}

#[test]
fn hot_calls_allocate_nothing() {
    let (h, w) = (61, 47);
    let mut plane = vec![Complex32::new(0.5, 0.1); h * w];
    let mut field = vec![Complex32::new(0.5, 0.1); 3 * h * w];
    let mut levels = vec![0; 3 * h * w];
    let display = Display::default().with_offset_m(6e-3).unwrap();
    let prefilter = Network::from_onnx(&Model::prefilter("6").bytes()).unwrap();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let plan = Propagator::new(h, w, 8e-6, 520e-9, 3e-3, Padding::Reach).unwrap();
            let mut scratch = plan.scratch();
            assert_eq!(count(|| plan.propagate(&mut plane, &mut scratch)), 0);
            let plan = Aperture::new(h, w, 1.0).unwrap();
            let mut scratch = plan.scratch();
            assert_eq!(count(|| plan.filter(&mut plane, &mut scratch)), 0);
            for encoding in [
                Encoding::DoublePhase,
                Encoding::ANTI_ALIAS,
                Encoding::BAND_LIMIT,
                Encoding::Deep(&prefilter),
            ] {
                let response = Response::linear(8).unwrap();
                let plan = Modulator::new(h, w, &display, encoding, Scale::Max, response).unwrap();
                let mut scratch = plan.scratch();
                let frame = || {
                    plan.propagate(&mut field, &mut scratch);
                    plan.modulate(&mut field, &mut levels, &mut scratch);
                };
                assert_eq!(count(frame), 0, "{encoding:?}");
            }
        });
    }
}
