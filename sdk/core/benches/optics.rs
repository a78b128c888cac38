//! Benchmarks the stages after the network on a 960×540 frame with one thread: propagation, filters and encoders.
#![allow(clippy::unwrap_used, missing_docs)]

use divan::{Bencher, counter::ItemsCount};
use num_complex::Complex32;
use phasefront_core::Size;
use phasefront_core::display::target::Target;
use phasefront_core::encode::Encoder;
use phasefront_core::encode::Encoding;
use phasefront_core::optics::aperture::{Aperture, Opening};
use phasefront_core::optics::asm::{Padding, Propagator};
use phasefront_core::output::BitPlanes;
use phasefront_core::output::modulator::{ModulatorSpec, Packing};

const SIZE: Size = Size {
    width: 960,
    height: 540,
};

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1);
    pool.build().unwrap().install(divan::main);
}

/// Returns `planes` planes of a field with a curved phase.
fn field(planes: usize) -> Vec<Complex32> {
    (0..planes * SIZE.pixels())
        .map(|i| Complex32::from_polar(0.6 + 0.3 * (i as f32 * 0.01).sin(), i as f32 * 1e-4))
        .collect()
}

fn pixels(planes: usize) -> ItemsCount {
    ItemsCount::new(planes * SIZE.pixels())
}

#[divan::bench(args = [1.0, 6.0, 20.0])]
fn propagate_mm(bencher: Bencher<'_, '_>, mm: f64) {
    let plan = Propagator::new(SIZE, 8e-6, 638e-9, mm * 1e-3, Padding::Reach).unwrap();
    let (mut plane, mut scratch) = (field(1), plan.scratch());
    let run = || plan.propagate(&mut plane, &mut scratch);
    bencher.counter(pixels(1)).bench_local(run);
}

#[divan::bench]
fn aperture(bencher: Bencher<'_, '_>) {
    let plan = Aperture::new(SIZE, Opening::centred(1.0)).unwrap();
    let (mut plane, mut scratch) = (field(1), plan.scratch());
    let run = || plan.filter(&mut plane, &mut scratch);
    bencher.counter(pixels(1)).bench_local(run);
}

#[divan::bench]
fn remove_mean_phase(bencher: Bencher<'_, '_>) {
    let mut field = field(3);
    let run = || phasefront_core::method::mean_phase::remove_mean_phase(&mut field, 3);
    bencher.counter(pixels(3)).bench_local(run);
}

/// Packs 24 maps of 16 levels into a frame of 1920×1080 cells.
#[divan::bench(args = [1, 2])]
fn pack_24_maps(bencher: Bencher<'_, '_>, threads: usize) {
    let device = ModulatorSpec::shipped("ti-plm-p47").unwrap();
    let Packing::BitPlanes(cells) = &device.packing else {
        unreachable!("it has cells")
    };
    let plan = BitPlanes::new(cells, SIZE, device.flip_x, device.flip_y);
    let map = |n: usize| (0..SIZE.pixels()).map(|i| ((i * 7 + n) % 16) as u8).collect();
    let maps: Vec<Vec<u8>> = (0..24).map(map).collect();
    let maps: Vec<&[u8]> = maps.iter().map(Vec::as_slice).collect();
    let mut frame = vec![0; plan.frame_bytes()];
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let run = || pool.install(|| plan.pack(&maps, &mut frame, 6 * SIZE.width).unwrap());
    bencher.counter(pixels(24)).bench_local(run);
}

#[divan::bench(args = ["double", "anti-alias", "band-limit"])]
fn encode(bencher: Bencher<'_, '_>, name: &str) {
    let encoding = match name {
        "anti-alias" => Encoding::ANTI_ALIAS,
        "band-limit" => Encoding::BAND_LIMIT,
        _ => Encoding::DoublePhase,
    };
    let encoder = Encoder::new(SIZE, &Target::default(), &encoding.into()).unwrap();
    let (mut field, mut scratch) = (field(3), encoder.scratch());
    let mut levels = vec![0; field.len()];
    let run = || encoder.encode_levels(&mut field, Some(1.0), &mut levels, &mut scratch);
    bencher.counter(pixels(3)).bench_local(run);
}
