//! An open GPU: its limits, its programs, its memory and its errors. This module does not depend on the stages.

#[cfg(target_arch = "wasm32")]
mod browser;
mod cache;
mod memory;
#[cfg(not(target_arch = "wasm32"))]
pub(crate) mod peak;

mod program;
#[cfg(test)]
pub(super) mod testing;
mod wait;

pub(crate) use memory::{Constants, copy_mapped};
pub(crate) use program::{Dispatch, Program};

use super::{GpuError, Result};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
#[cfg(not(target_arch = "wasm32"))]
use std::time::Duration;

/// The time after which a frame's device counts as hung. Drivers themselves give up after some seconds, and a browser
/// watches over them itself.
#[cfg(not(target_arch = "wasm32"))]
const PATIENCE: Duration = Duration::from_secs(10);
/// The same limit for software drivers, which are slow.
#[cfg(not(target_arch = "wasm32"))]
const SOFTWARE_PATIENCE: Duration = Duration::from_secs(300);

/// The GPU to open, and the programs that it compiled on an earlier run.
#[derive(Debug, Clone, Default)]
pub struct DeviceOptions {
    /// A part of the adapter's name, in any case. Without a name the fastest hardware GPU is opened. Software drivers
    /// are opened only by name, because they are slower than the CPU path.
    pub name: Option<String>,
    /// The output of [`Device::programs`] on an earlier run. Programs from another GPU or driver and damaged programs
    /// are ignored. The driver trusts the rest, so store them where only the app itself writes.
    pub programs: Option<Vec<u8>>,
}

/// The optional features of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Features {
    /// 16-bit floating point in programs and memory.
    pub(crate) half: bool,
    /// Time stamps around passes.
    pub(crate) timestamps: bool,
}

/// The upper bounds on the features, limits and memory that a device is opened with.
pub(crate) struct Allowed {
    pub(crate) features: wgpu::Features,
    /// Computes the limits from the adapter's.
    pub(crate) limits: fn(wgpu::Limits) -> wgpu::Limits,
    /// The usable percentage of the memory that the driver reports as free, if it reports it.
    pub(crate) memory_percent: Option<u8>,
}

impl Default for Allowed {
    fn default() -> Self {
        Allowed {
            features: wgpu::Features::all(),
            limits: |limits| limits,
            memory_percent: None,
        }
    }
}

/// An open GPU. It is immutable and threads can share it.
pub struct Device {
    pub(crate) inner: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    limits: wgpu::Limits,
    features: Features,
    cache: Option<wgpu::PipelineCache>,
    /// Why the programs of an earlier run were rejected.
    programs_refused: Option<&'static str>,
    /// The time after which a frame's device counts as hung.
    #[cfg(not(target_arch = "wasm32"))]
    patience: Duration,
    /// The programs by entry point and text. Identical layers, and frames of all sizes, share their programs.
    compiled: Mutex<HashMap<(&'static str, String), Program>>,
    lost: Arc<Mutex<Option<String>>>,
}

impl std::fmt::Debug for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.name())
    }
}

impl Device {
    /// Opens a GPU.
    ///
    /// # Errors
    /// Returns [`GpuError::None`] if there is no GPU, or none with that name (the message lists the GPUs that exist),
    /// and [`GpuError::Refused`] if the driver does not open it.
    pub async fn open_async(options: &DeviceOptions) -> Result<Self> {
        Self::open_with_async(options, &Allowed::default()).await
    }

    /// Opens a GPU as [`Device::open_async`] does, with at most the features, limits and memory of `allowed`.
    pub(crate) async fn open_with_async(options: &DeviceOptions, allowed: &Allowed) -> Result<Self> {
        let (adapter, name) = adapter(options.name.as_deref(), allowed.memory_percent).await?;
        let descriptor = wgpu::DeviceDescriptor {
            required_features: adapter.features() & Self::wanted() & allowed.features,
            required_limits: (allowed.limits)(adapter.limits()),
            ..Default::default()
        };
        let (device, queue) = (adapter.request_device(&descriptor).await)
            .map_err(|why| GpuError::Refused(format!("{name} cannot be opened: {}", reason(&why))))?;
        let mut device = Self::of(device, queue, options.programs.as_deref());
        device.info.name = name;
        Ok(device)
    }

    /// Returns the features that an app should enable, if its adapter has them, on a device for [`Device::of`].
    pub fn wanted() -> wgpu::Features {
        wgpu::Features::SHADER_F16 | wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::PIPELINE_CACHE
    }

    /// Wraps a device that an app opened, so that the app can display results on its own surface without a copy. The
    /// device should have its adapter's limits and the available features of [`Device::wanted`]. From then on this
    /// object receives the device's loss and its uncaptured errors. `programs` come from an earlier run, as in
    /// [`DeviceOptions`].
    pub fn of(device: wgpu::Device, queue: wgpu::Queue, programs: Option<&[u8]>) -> Self {
        let (info, limits, granted) = (device.adapter_info(), device.limits(), device.features());
        let lost = Arc::new(Mutex::new(None));
        let note = |lost: &Arc<Mutex<Option<String>>>, why: String| {
            lock(lost).get_or_insert(why);
        };
        let state = lost.clone();
        device.set_device_lost_callback(move |reason, why| {
            note(&state, format!("{} ({reason:?})", one_line(why)));
        });
        // Outside error scopes, only a device that is about to be lost should fail.
        let state = lost.clone();
        device.on_uncaptured_error(Arc::new(move |why: wgpu::Error| {
            note(&state, one_line(why));
        }));
        let (cache, programs_refused) = granted
            .contains(wgpu::Features::PIPELINE_CACHE)
            .then(|| cache::open(&device, &info, programs))
            .unzip();
        Device {
            #[cfg(not(target_arch = "wasm32"))]
            patience: match info.device_type {
                wgpu::DeviceType::Cpu => SOFTWARE_PATIENCE,
                _ => PATIENCE,
            },
            inner: device,
            queue,
            limits,
            features: Features {
                half: granted.contains(wgpu::Features::SHADER_F16),
                timestamps: granted.contains(wgpu::Features::TIMESTAMP_QUERY),
            },
            info,
            cache,
            programs_refused: programs_refused.flatten(),
            compiled: Mutex::default(),
            lost,
        }
    }

    /// Returns the GPU's name and graphics API.
    pub fn name(&self) -> String {
        format!("{} ({:?})", self.info.name, self.info.backend)
    }

    /// Checks whether the driver is a software driver.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Checks whether the device computes in 16-bit floating point.
    pub fn has_half(&self) -> bool {
        self.features.half
    }

    /// Returns the programs compiled so far, for the next run, or `None` if the platform caches them itself.
    pub fn programs(&self) -> Option<Vec<u8>> {
        let programs = self.cache.as_ref()?.get_data()?;
        Some(cache::seal(&programs, &self.info))
    }

    /// Returns why [`DeviceOptions::programs`] were rejected, if they were.
    pub fn programs_refused(&self) -> Option<&str> {
        self.programs_refused
    }

    /// Returns the wgpu device and queue, for an app that displays the results.
    pub fn wgpu(&self) -> (&wgpu::Device, &wgpu::Queue) {
        (&self.inner, &self.queue)
    }

    pub(crate) fn features(&self) -> Features {
        self.features
    }

    pub(crate) fn limits(&self) -> &wgpu::Limits {
        &self.limits
    }

    /// Returns [`GpuError::Lost`] with the reason if the device is lost.
    pub(crate) fn check(&self) -> Result<()> {
        match lock(&self.lost).as_ref() {
            Some(why) => Err(GpuError::Lost(why.clone())),
            None => Ok(()),
        }
    }

    /// Destroys the device. Work that runs on it is lost.
    pub(crate) fn give_up(&self, why: &str) {
        lock(&self.lost).get_or_insert_with(|| why.to_owned());
        self.inner.destroy();
    }

    /// Polls the device, because a loss is reported only then.
    fn ask(&self) -> Result<()> {
        if let Err(why) = self.inner.poll(wgpu::PollType::Poll) {
            self.give_up(&one_line(why));
        }
        self.check()
    }

    /// Runs `work` and returns the device's errors during it.
    pub(crate) async fn guarded_async<T>(&self, work: impl FnOnce() -> Result<T>) -> Result<T> {
        self.ask()?;
        let memory = self.inner.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let internal = self.inner.push_error_scope(wgpu::ErrorFilter::Internal);
        let validation = self.inner.push_error_scope(wgpu::ErrorFilter::Validation);
        let done = work();
        // Scopes are popped last in, first out.
        let [validation, internal, memory] = [validation, internal, memory].map(wgpu::ErrorScopeGuard::pop);
        let errors = [memory.await, internal.await, validation.await];
        self.check()?;
        // A resource that memory was too short for is invalid in later calls: report the cause before its consequences.
        let error = errors.into_iter().flatten().next();
        if error.is_some() {
            // The cause may be a loss that was not reported yet.
            self.ask()?;
        }
        match error {
            Some(wgpu::Error::OutOfMemory { source }) => Err(GpuError::OutOfMemory(one_line(source))),
            Some(why) => Err(GpuError::Refused(format!("{}: {}", self.name(), one_line(why)))),
            None => done,
        }
    }
}

/// What is missing if there is no adapter at all.
const NO_DRIVER: &str = if cfg!(target_arch = "wasm32") {
    "the browser gives no WebGPU adapter"
} else {
    "no driver of Vulkan, Metal or DirectX 12 answers"
};

/// Returns the adapter with that name, or the fastest hardware adapter, and its name.
async fn adapter(name: Option<&str>, memory_percent: Option<u8>) -> Result<(wgpu::Adapter, String)> {
    let mut wanted = wgpu::InstanceDescriptor::new_without_display_handle();
    wanted.memory_budget_thresholds.for_resource_creation = memory_percent;
    let instance = wgpu::Instance::new(wanted);
    let mut all = instance.enumerate_adapters(wgpu::Backends::all()).await;
    // A browser has one adapter.
    #[cfg(target_arch = "wasm32")]
    let called = browser::adapter_name().await;
    #[cfg(target_arch = "wasm32")]
    let called = |_: &wgpu::Adapter| called.clone();
    #[cfg(not(target_arch = "wasm32"))]
    let called = |adapter: &wgpu::Adapter| adapter.get_info().name;
    let rank = |adapter: &wgpu::Adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    };
    let computes = |adapter: &wgpu::Adapter| {
        let flags = adapter.get_downlevel_capabilities().flags;
        flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
    };
    all.retain(computes);
    all.sort_by_key(rank);
    let names = all.iter().map(called).collect::<Vec<_>>().join(", ");
    let wanted = |adapter: &wgpu::Adapter| match name {
        Some(name) => {
            let of = called(adapter).to_lowercase();
            of.contains(&name.to_lowercase())
        }
        None => rank(adapter) < 4,
    };
    let found = all.into_iter().find(wanted).ok_or_else(|| {
        GpuError::None(match (name, names.is_empty()) {
            (_, true) => NO_DRIVER.into(),
            (Some(name), _) => format!("none is called '{name}'; there is {names}"),
            (None, _) => {
                format!("only drivers in software answer ({names}); they are taken by name")
            }
        })
    })?;
    let name = called(&found);
    Ok((found, name))
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns why a device was refused. A browser appends the places in its program.
fn reason(why: &wgpu::RequestDeviceError) -> String {
    let said = why.to_string();
    if cfg!(target_arch = "wasm32") {
        let first = said.lines().next().unwrap_or_default();
        first.trim_start_matches("JsValue(").trim_end_matches(')').to_owned()
    } else {
        one_line(said)
    }
}

pub(crate) fn one_line(error: impl std::fmt::Display) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::testing::{opened, skip, software};
    use super::*;

    #[test]
    fn a_gpu_that_is_not_there_is_named() {
        let options = DeviceOptions {
            name: Some("no such card".into()),
            programs: None,
        };
        let refused = Device::open(&options).unwrap_err();
        assert!(matches!(&refused, GpuError::None(_)));
        assert!(!refused.to_string().contains('\n'), "{refused}");
    }

    #[test]
    fn what_a_device_does_not_take_is_an_error() {
        let little = Allowed {
            features: wgpu::Features::empty(),
            limits: |limits| wgpu::Limits {
                max_storage_buffer_binding_size: 1 << 20,
                ..limits
            },
            ..Default::default()
        };
        let device = opened(Device::open_with(&software(), &little));
        assert!(!device.has_half() && !device.features().timestamps);
        let refused = device.buffer("a frame", 1 << 21).unwrap_err();
        assert!(refused.to_string().contains("a frame of 2 MB"), "{refused}");
        // Driver errors are returned by `guarded`.
        let wrong = device.guarded(|| {
            device.program("nonsense", "fn main( {".into(), "main");
            Ok(())
        });
        assert!(matches!(wrong, Err(GpuError::Refused(_))), "{wrong:?}");
        // A lost device returns the reason from every call.
        device.give_up("pulled out");
        assert!(matches!(device.check(), Err(GpuError::Lost(why)) if why == "pulled out"));
        assert!(matches!(device.guarded(|| Ok(())), Err(GpuError::Lost(_))));
    }

    #[test]
    fn memory_that_is_not_there_is_an_error() {
        let little = Allowed {
            memory_percent: Some(1),
            ..Default::default()
        };
        // Software drivers ignore the memory budget.
        let hardware = Device::open_with(&DeviceOptions::default(), &little);
        let device = opened(hardware.or_else(|_| Device::open_with(&software(), &little)));
        let most = device.limits.max_storage_buffer_binding_size.min(1 << 28) as usize;
        let taken = device.guarded(|| {
            // This is more than a hundredth of any machine's memory.
            let all = (0..64).map(|_| device.buffer("a frame", most));
            all.collect::<Result<Vec<_>>>()
        });
        if taken.is_ok() {
            skip::or_fail("memory limits", format!("{device:?} gives more memory than there is"));
            return;
        }
        assert!(matches!(taken, Err(GpuError::OutOfMemory(_))), "{taken:?}");
        // The error is the same if the missing buffer is used.
        let used = device.guarded(|| {
            let all = (0..64)
                .map(|_| device.buffer("a frame", most))
                .collect::<Result<Vec<_>>>()?;
            let mut encoder = device.inner.create_command_encoder(&Default::default());
            all.iter().for_each(|buffer| encoder.clear_buffer(buffer, 0, None));
            device.queue.submit([encoder.finish()]);
            Ok(())
        });
        assert!(matches!(used, Err(GpuError::OutOfMemory(_))), "{used:?}");
        // A buffer that fits still works.
        let buffer = device.guarded(|| device.buffer("a frame", 64)).unwrap();
        assert_eq!(device.read(&buffer, 64).unwrap(), [0; 64]);
    }

    #[test]
    fn a_device_that_hangs_is_given_up() {
        let mut device = opened(Device::open(&software()));
        device.patience = Duration::from_millis(1);
        let source = "
            @group(0) @binding(0) var<storage, read_write> result: array<u32>;
            @compute @workgroup_size(64)
            fn long(@builtin(global_invocation_id) at: vec3u) {
                var v = at.x;
                for (var k = 0u; k < 2000000u; k++) { v = v * 1664525u + 1013904223u; }
                result[at.x % 4u] = v;
            }";
        let step = device.guarded(|| {
            let result = device.buffer("result", 16)?;
            let program = device.program("a long one", source.into(), "long");
            program.on(&device, &[(0, result.as_entire_binding())], [64, 1, 1])
        });
        let step = step.unwrap();
        let mut encoder = device.inner.create_command_encoder(&Default::default());
        step.run(&mut encoder.begin_compute_pass(&Default::default()));
        let waited = device.wait(&device.queue.submit([encoder.finish()]));
        assert!(matches!(waited, Err(GpuError::Lost(why)) if why == "no answer for 1ms"));
        assert!(device.check().is_err());
    }

    #[test]
    fn an_app_computes_on_its_own_device() {
        let (adapter, _) = opened(pollster::block_on(adapter(software().name.as_deref(), None)));
        let descriptor = wgpu::DeviceDescriptor {
            required_features: adapter.features() & Device::wanted(),
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let (inner, queue) = pollster::block_on(adapter.request_device(&descriptor)).unwrap();
        let device = Device::of(inner.clone(), queue, None);
        assert!(device.is_software());
        let buffer = device.guarded(|| device.buffer("a frame", 64)).unwrap();
        assert_eq!(device.read(&buffer, 64).unwrap(), [0; 64]);
        // The app destroys the device.
        inner.destroy();
        assert!(matches!(device.guarded(|| Ok(())), Err(GpuError::Lost(_))));
    }
}
