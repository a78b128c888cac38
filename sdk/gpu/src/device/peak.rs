//! Measures the peak performance of a device, the reference of the benchmark.

use crate::Result;
use crate::device::{Device, Dispatch};
use crate::numbers::Numbers;
use phasefront_core::runtime::clock::Instant;

/// The number of bytes to copy.
const COPIED: usize = 1 << 26;
/// The number of 16-byte words that each thread copies.
const COPIES_EACH: usize = 16;
/// The numbers of rounds, each of eight chains of four multiply-adds, and of workgroups of 256 threads.
const ROUNDS: usize = 1024;
const GROUPS: usize = 4096;

/// The peak performance of a device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// The multiply-adds per second in the number format of the network, with all operands in registers.
    pub mac_per_s: f64,
    /// The bytes read and written per second by a copy that exceeds every cache.
    pub bytes_per_s: f64,
}

pub(crate) fn measure(device: &Device, numbers: Numbers) -> Result<Peak> {
    device.guarded(|| {
        let [from, to] = [device.buffer("source", COPIED)?, device.buffer("copy", COPIED)?];
        let arguments = [(0, from.as_entire_binding()), (1, to.as_entire_binding())];
        let words = COPIED / 16 / 256 / COPIES_EACH;
        let header = format!("const EACH: u32 = {COPIES_EACH}u;\n");
        let copy = device
            .program("a copy", header.clone() + include_str!("peak.wgsl"), "copy")
            .on(device, &arguments, [words, 1, 1])?;
        // A lane holds four numbers, or four words of four numbers.
        let (lane, per_step) = match numbers {
            Numbers::F32 => (
                "fn lane(v: vec4u) -> vec4f { return vec4f(v) * 1e-9; }
                fn bits(v: vec4f) -> vec4u { return bitcast<vec4u>(v); }
                fn more(v: vec4f, x: vec4f) -> vec4f { return fma(v, x, x); }\n",
                4,
            ),
            Numbers::F16 => (
                "fn lane(v: vec4u) -> vec4<f16> { return vec4<f16>(vec4f(v) * 1e-9); }
                fn bits(v: vec4<f16>) -> vec4u { return bitcast<vec4u>(vec4f(v)); }
                fn more(v: vec4<f16>, x: vec4<f16>) -> vec4<f16> { return fma(v, x, x); }\n",
                4,
            ),
            Numbers::Int8 => (
                "fn lane(v: vec4u) -> vec4i { return vec4i(v); }
                fn bits(v: vec4i) -> vec4u { return vec4u(v); }
                fn more(v: vec4i, x: vec4i) -> vec4i {
                    let w = vec4u(x);
                    let u = vec4u(v);
                    return v + vec4i(
                        dot4I8Packed(u.x, w.x), dot4I8Packed(u.y, w.y),
                        dot4I8Packed(u.z, w.z), dot4I8Packed(u.w, w.w),
                    );
                }\n",
                16,
            ),
        };
        let enable = match numbers {
            Numbers::F16 => "enable f16;\n",
            _ => "",
        };
        let header = format!("{enable}const ROUNDS: u32 = {ROUNDS}u;\n{header}{lane}");
        let source = header + include_str!("peak.wgsl") + include_str!("peak_arithmetic.wgsl");
        // A software driver gets a few workgroups instead of thousands, because it is slow.
        let groups = if device.is_software() { 4 } else { GROUPS };
        let compute = device
            .program("arithmetic", source, "compute")
            .on(device, &arguments, [groups, 1, 1])?;
        let macs = groups * 256 * ROUNDS * 8 * per_step;
        Ok(Peak {
            mac_per_s: macs as f64 / seconds(device, &compute)?,
            bytes_per_s: 2.0 * COPIED as f64 / seconds(device, &copy)?,
        })
    })
}

/// Returns the shortest time of one dispatch. Each of several submissions runs several dispatches.
fn seconds(device: &Device, step: &Dispatch) -> Result<f64> {
    const TOGETHER: usize = 4;
    let mut best = f64::INFINITY;
    for _ in 0..4 {
        let mut encoder = device.inner.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        (0..TOGETHER).for_each(|_| step.run(&mut pass));
        drop(pass);
        let start = Instant::now();
        device.wait(&device.queue.submit([encoder.finish()]))?;
        best = best.min(start.elapsed().as_secs_f64() / TOGETHER as f64);
    }
    Ok(best)
}
