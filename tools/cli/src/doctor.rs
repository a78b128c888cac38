//! A report of what a machine offers, and a self-test. The self-test computes small frames with the default code and
//! compares them with the oracles and the portable kernels.

use ndarray::{Array2, Array3};
use num_complex::{Complex32, Complex64};
use phasefront::Size;
use phasefront::{Display, EncoderOptions, Method, Network, Pipeline, RgbdFrame, Sweep, Target};
use phasefront_core::method::network::{Isa, reference};
use phasefront_core::method::sweep;
use phasefront_core::method::sweep::SweepPlan;
use phasefront_core::optics::asm::{self, Padding, Propagator};
use phasefront_core::optics::metrics;
use phasefront_core::optics::reference::propagate;
use phasefront_gpu::{Device, Job, probe};
use phasefront_io::hologram::{Hologram, HologramInfo, Levels};
use phasefront_io::{Error, Result};
use phasefront_models::{Precision, network};
use serde::Serialize;
use std::sync::Arc;

/// The hardware and system of a machine.
#[derive(Debug, Clone, Serialize)]
pub struct Machine {
    /// The operating system and its version, as far as the system reports them.
    pub system: String,
    /// The processor's name, or its architecture if the name is unknown.
    pub cpu: String,
    /// The number of cores that this process may use.
    pub cores: usize,
    /// The machine's memory in MiB, if the system reports it.
    pub memory_mib: Option<u64>,
    /// The memory limit of this process in MiB, if it is less than the machine's memory.
    pub memory_limit_mib: Option<u64>,
    /// The kernels for int8 networks that the processor runs, fastest first.
    pub int8_kernels: Vec<&'static str>,
    /// The kernels for f32 networks that the processor runs, fastest first.
    pub f32_kernels: Vec<&'static str>,
    /// The GPUs that drivers report.
    pub gpus: Vec<Gpu>,
}

/// A GPU that a driver reports.
#[derive(Debug, Clone, Serialize)]
pub struct Gpu {
    /// The GPU's name.
    pub name: String,
    /// The graphics API: Vulkan, Metal or Dx12.
    pub backend: String,
    /// The driver and its version, as far as the driver reports them.
    pub driver: String,
    /// Whether the driver runs in software. The command uses it only if a flag names it.
    pub software: bool,
}

impl Machine {
    /// Describes this machine.
    pub fn this() -> Self {
        let names = |isas: Vec<Isa>| isas.into_iter().map(Isa::name).collect();
        let crate::bench::Machine { cpu, cores, .. } = crate::bench::Machine::this();
        let memory_mib = memory_mib();
        Machine {
            system: system(),
            cpu,
            cores,
            memory_mib,
            memory_limit_mib: memory_limit_mib().filter(|limit| memory_mib.is_none_or(|all| *limit < all)),
            int8_kernels: names(Isa::int8()),
            f32_kernels: names(Isa::f32()),
            gpus: gpus(),
        }
    }
}

fn first_line(path: &str) -> Option<String> {
    let text = std::fs::read_to_string(path).ok()?;
    Some(text.lines().next()?.trim().to_owned())
}

fn system() -> String {
    let release = std::fs::read_to_string("/etc/os-release").unwrap_or_default();
    let name = (release.lines()).find_map(|line| line.strip_prefix("PRETTY_NAME="));
    let name = name.map_or(std::env::consts::OS, |name| name.trim_matches('"'));
    let kernel =
        first_line("/proc/sys/kernel/osrelease").map_or(String::new(), |version| format!(", kernel {version}"));
    format!("{name}{kernel}, {}", std::env::consts::ARCH)
}

fn memory_mib() -> Option<u64> {
    let info = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = info.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? >> 10)
}

/// Returns the memory limit of this process's control group, version 1 or 2.
fn memory_limit_mib() -> Option<u64> {
    let files = [
        "/sys/fs/cgroup/memory.max",
        "/sys/fs/cgroup/memory/memory.limit_in_bytes",
    ];
    let bytes = files.iter().find_map(|path| first_line(path)?.parse::<u64>().ok())?;
    Some(bytes >> 20)
}

fn gpus() -> Vec<Gpu> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let gpu = |adapter: wgpu::Adapter| {
        let info = adapter.get_info();
        Gpu {
            name: info.name,
            backend: format!("{:?}", info.backend),
            driver: [info.driver, info.driver_info].join(" ").trim().to_owned(),
            software: info.device_type == wgpu::DeviceType::Cpu,
        }
    };
    adapters.into_iter().map(gpu).collect()
}

/// The result of one part of the self-test.
#[derive(Debug, Clone, Serialize)]
pub struct Check {
    /// The name of the tested part.
    pub name: &'static str,
    /// Whether the part passed, or `None` if it could not be tested.
    pub passed: Option<bool>,
    /// The result, and the expected one.
    pub says: String,
}

impl Check {
    fn new(name: &'static str, passed: bool, says: String) -> Self {
        Check {
            name,
            passed: Some(passed),
            says,
        }
    }
}

/// The size of the test frames: odd, and larger than a strip of any kernel.
const SIZE: Size = Size { width: 67, height: 45 };

/// Tests the CPU's results.
///
/// # Errors
/// Returns an error if the network is not bundled or a test cannot be planned.
pub fn self_test() -> Result<Vec<Check>> {
    Ok(vec![int8()?, f32()?, sweep()?, propagation()?, frame()?])
}

/// Compares a small default frame on the GPU that `open` selects with the CPU's.
pub fn test_gpu(open: &phasefront_gpu::DeviceOptions) -> Check {
    let compare = || {
        let device = Arc::new(Device::open(open)?);
        let network = coming_along(Precision::Int8).map_err(phasefront_gpu::GpuError::Core)?;
        probe(&device, &Job::new(SIZE, Method::Network(network), Display::default()))?;
        Ok(device.name())
    };
    match compare() {
        Ok(name) => Check::new("gpu", true, format!("{name} gives the CPU's phases")),
        Err(phasefront_gpu::GpuError::None(why)) => Check {
            name: "gpu",
            passed: None,
            says: why,
        },
        Err(why) => Check::new("gpu", false, why.to_string()),
    }
}

/// Combines the results of the checks.
///
/// # Errors
/// Returns an error that names the failed checks.
pub fn verdict(checks: &[Check]) -> Result<()> {
    let failed = checks.iter().filter(|check| check.passed == Some(false));
    let failed: Vec<_> = failed.map(|check| check.name).collect();
    if failed.is_empty() {
        Ok(())
    } else {
        Err(Error::Input(format!(
            "the self-test failed: {}; please report it with the lines above",
            failed.join(", ")
        )))
    }
}

fn coming_along(precision: Precision) -> phasefront::Result<Arc<Network>> {
    let missing = || phasefront::Error::Network("rgbd-8 is not compiled in".into());
    network("rgbd-8", precision).ok_or_else(missing)
}

/// Runs the network on one instruction set.
fn run_on(network: &Network, isa: Isa, input: &[f32]) -> Result<Vec<f32>> {
    let plan = network.plan_on(isa, SIZE)?;
    let mut output = vec![0.0; 6 * SIZE.pixels()];
    plan.run(input, &mut output, &mut plan.scratch())?;
    Ok(output)
}

/// Makes waves of several lengths around 0, as networks expect.
fn waves() -> Vec<f32> {
    let Size { width, height } = SIZE;
    (0..4 * height * width)
        .map(|i| {
            let (plane, y, x) = (i / (height * width), i / width % height, i % width);
            0.45 * ((plane + 1) as f32 * 0.13 * x as f32 + 0.21 * y as f32).sin()
        })
        .collect()
}

fn int8() -> Result<Check> {
    let (network, input) = (coming_along(Precision::Int8)?, waves());
    let portable = run_on(&network, Isa::Portable, &input)?;
    let mut differ = Vec::new();
    for isa in Isa::int8() {
        let same = run_on(&network, isa, &input)? == portable;
        differ.extend((!same).then_some(isa.name()));
    }
    let says = if differ.is_empty() {
        let names: Vec<_> = Isa::int8().into_iter().map(Isa::name).collect();
        format!("{}: one and the same bits", names.join(", "))
    } else {
        format!("{} give other bits than the portable kernel", differ.join(", "))
    };
    Ok(Check::new("int8 network", differ.is_empty(), says))
}

fn f32() -> Result<Check> {
    let (network, input) = (coming_along(Precision::Float32)?, waves());
    let chain = network.chain().expect("a bundled network is a chain");
    let naive = reference::run(chain, &input, SIZE);
    let mut worst = 0.0f32;
    for isa in Isa::f32() {
        let output = run_on(&network, isa, &input)?;
        worst = output.iter().zip(&naive).map(|(a, b)| (a - b).abs()).fold(worst, worse);
    }
    Ok(apart("f32 network", worst, 1e-4))
}

/// Returns the larger value, where NaN is the largest.
fn worse(a: f32, b: f32) -> f32 {
    if b.is_nan() { f32::INFINITY } else { a.max(b) }
}

/// Makes a check of the largest difference `worst` between a fast path and its oracle.
fn apart(name: &'static str, worst: f32, most: f32) -> Check {
    let says = format!("at most {worst:.1e} from the naive sums; {most:.0e} is right");
    Check::new(name, worst <= most, says)
}

fn picture() -> Result<RgbdFrame> {
    let Size { width, height } = SIZE;
    let rgb = Array3::from_shape_fn((3, height, width), |(c, y, x)| {
        0.5 + 0.4 * ((c + 1) as f32 * 0.11 * x as f32 + 0.17 * y as f32).sin()
    });
    let near = |y: usize, x: usize| (12..32).contains(&y) && (20..45).contains(&x);
    let depth = Array2::from_shape_fn((height, width), |(y, x)| if near(y, x) { 0.3 } else { 0.7 });
    Ok(RgbdFrame::new(rgb, depth)?)
}

fn sweep() -> Result<Check> {
    let (frame, display) = (picture()?, Display::default());
    let sweep = Sweep::of_planes(&display, 8);
    let plan = SweepPlan::new(SIZE, &display, sweep, 0.0)?;
    let mut field = vec![Complex32::ZERO; 3 * SIZE.pixels()];
    plan.field(&frame, &mut field, &mut plan.scratch())?;
    let naive = sweep::reference::field(&frame, &display, sweep, 0.0)?;
    let worst = field.iter().zip(&naive).map(|(a, b)| (a - b).norm()).fold(0.0, worse);
    Ok(apart("plane sweep", worst, 1e-3))
}

fn propagation() -> Result<Check> {
    let (Size { width, height }, display) = (SIZE, Display::default());
    let (pitch, z_m, lambdas) = (display.pitch_m(), 2e-3, display.wavelengths_m());
    let frame = picture()?;
    let plans = Propagator::for_colours(Size { width, height }, pitch, lambdas, z_m, Padding::Reach)?;
    let mut worst = 0.0f32;
    for (colour, plan) in plans.iter().enumerate() {
        let light = frame.rgb().index_axis_move(ndarray::Axis(0), colour).to_owned();
        let mut plane: Vec<Complex32> = light.iter().map(|&value| value.into()).collect();
        plan.propagate(&mut plane, &mut plan.scratch());
        let wide = light.mapv(|value| Complex64::from(f64::from(value)));
        let naive = propagate(&wide, pitch, lambdas[colour], z_m, plan.padded_size());
        let carrier = asm::carrier(z_m, lambdas[colour]);
        let apart = plane.iter().zip(&naive).map(|(fast, naive)| {
            let naive = Complex32::new(naive.re as f32, naive.im as f32);
            (fast * carrier - naive).norm()
        });
        worst = apart.fold(worst, worse);
    }
    Ok(apart("propagation", worst, 1e-3))
}

/// The PSNR in dB that the displayed image of the default frame must reach against its picture.
const SHOWN_DB: f64 = 20.0;

/// Makes a hologram of a picture at one depth with the default pipeline, and compares the displayed image with the
/// picture.
fn frame() -> Result<Check> {
    let (Size { width, height }, target) = (SIZE, Target::from(Display::default()));
    let rgb = picture()?.rgb().to_owned();
    let frame = RgbdFrame::new(rgb.clone(), Array2::from_elem(SIZE.shape(), 0.5))?;
    let method = Method::Network(coming_along(Precision::Int8)?);
    let pipeline = Pipeline::new(SIZE, method, &target, &EncoderOptions::default())?;
    let mut levels = Array3::zeros((3, height, width));
    let bytes = levels.as_slice_mut().expect("standard layout");
    let report = pipeline.process(&frame, bytes, &mut pipeline.scratch())?;
    let info = HologramInfo {
        scale: Some(report.scale),
        ..HologramInfo::new(target.display)
    };
    let seen = Hologram::Levels(Levels::Bytes(levels), info).views(&[0.0])?;
    let shown_db = metrics::compare(seen[0].view(), rgb.view())?.psnr_overall;
    let says = format!("what a hologram shows is {shown_db:.1} dB from its picture; {SHOWN_DB} are right");
    Ok(Check::new("whole frame", shown_db >= SHOWN_DB, says))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn what_failed_is_named_and_what_could_not_be_tested_is_no_failure() {
        let skipped = Check {
            name: "gpu",
            passed: None,
            says: "there is none".into(),
        };
        let passed = apart("sweep", 1e-5, 1e-3);
        assert!(verdict(&[passed.clone(), skipped.clone()]).is_ok());
        let broken = [f32::NAN, 2e-3].map(|value| apart("network", [value].into_iter().fold(0.0, worse), 1e-3));
        for broken in broken {
            let said = verdict(&[passed.clone(), broken, skipped.clone()])
                .unwrap_err()
                .to_string();
            assert!(said.contains("failed: network;") && !said.contains("sweep"), "{said}");
        }
    }
}
