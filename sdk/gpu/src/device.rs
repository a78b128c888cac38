//! A GPU that was opened: its limits, its programs, its memory, and what it has against us as errors.
//!
//! Nothing here knows what is computed.

mod cache;
mod memory;
pub(crate) mod peak;

mod program;
#[cfg(test)]
pub(super) mod testing;

pub(crate) use memory::{Constants, copy_mapped};
pub(crate) use program::{Dispatch, Program};

use super::{GpuError, Result};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// How long a frame may take before a device counts as hung: drivers themselves give up after some seconds.
const PATIENCE: Duration = Duration::from_secs(10);
/// The same for drivers in software, which take their time.
const SOFTWARE_PATIENCE: Duration = Duration::from_secs(300);

/// Which GPU is wanted, and what is known of it from before.
#[derive(Debug, Clone, Default)]
pub struct DeviceOptions {
    /// A part of the adapter's name, in any case; without one the fastest that is hardware is taken. Drivers in
    /// software are taken by name only: they are slower than the CPU path.
    pub name: Option<String>,
    /// What [`Device::programs`] gave on an earlier run. What another GPU or driver compiled, or what was damaged
    /// since, is ignored. A driver trusts the rest: keep it where only the app itself writes.
    pub programs: Option<Vec<u8>>,
}

/// What a device offers beyond what every one has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Features {
    /// 16-bit floating point in programs and memory.
    pub(crate) half: bool,
    /// Time stamps around passes.
    pub(crate) timestamps: bool,
}

/// What a device is opened with at most.
pub(crate) struct Allowed {
    pub(crate) features: wgpu::Features,
    /// From the adapter's limits.
    pub(crate) limits: fn(wgpu::Limits) -> wgpu::Limits,
    /// Of the memory that the driver says is free, where it says so.
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

/// An open GPU. Immutable; threads share it.
pub struct Device {
    pub(crate) inner: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    limits: wgpu::Limits,
    features: Features,
    cache: Option<wgpu::PipelineCache>,
    /// Why the programs of an earlier run were not taken.
    programs_refused: Option<&'static str>,
    /// How long a frame may take before the device counts as hung.
    patience: Duration,
    /// By entry and text: layers that are alike, and frames of all sizes, share their programs.
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
    /// [`GpuError::None`] where there is none, or none of that name, with those that there are;
    /// [`GpuError::Refused`] where the driver does not open it.
    #[doc(hidden)]
    pub fn open(options: &DeviceOptions) -> Result<Self> {
        Self::open_with(options, &Allowed::default())
    }

    /// [`Device::open`] with no more than `allowed`.
    pub(crate) fn open_with(options: &DeviceOptions, allowed: &Allowed) -> Result<Self> {
        let adapter = adapter(options.name.as_deref(), allowed.memory_percent)?;
        let info = adapter.get_info();
        let descriptor = wgpu::DeviceDescriptor {
            required_features: adapter.features() & Self::wanted() & allowed.features,
            required_limits: (allowed.limits)(adapter.limits()),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|why| GpuError::Refused(format!("{} cannot be opened: {}", info.name, one_line(why))))?;
        Ok(Self::of(device, queue, options.programs.as_deref()))
    }

    /// The features that an app's own device should have for [`Device::of`], as far as its adapter has them.
    pub fn wanted() -> wgpu::Features {
        wgpu::Features::SHADER_F16 | wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::PIPELINE_CACHE
    }

    /// A device that an app opened, so that it shows on its own surface what is computed, without a copy: best with the
    /// limits of its adapter, and with what it has of [`Device::wanted`]. Its loss and its uncaptured errors are told
    /// here from then on. `programs` are those of an earlier run, as in [`DeviceOptions`].
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
        // Outside of error scopes nothing is expected to fail but on a device that is about to be lost.
        let state = lost.clone();
        device.on_uncaptured_error(Arc::new(move |why: wgpu::Error| {
            note(&state, one_line(why));
        }));
        let (cache, programs_refused) = granted
            .contains(wgpu::Features::PIPELINE_CACHE)
            .then(|| cache::open(&device, &info, programs))
            .unzip();
        Device {
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

    /// The GPU's name and the interface it is spoken to by.
    pub fn name(&self) -> String {
        format!("{} ({:?})", self.info.name, self.info.backend)
    }

    /// Whether it is a driver in software.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Whether it computes in 16-bit floating point.
    pub fn has_half(&self) -> bool {
        self.features.half
    }

    /// The programs compiled so far, to be kept for the next run; none where the platform keeps them itself.
    pub fn programs(&self) -> Option<Vec<u8>> {
        let programs = self.cache.as_ref()?.get_data()?;
        Some(cache::seal(&programs, &self.info))
    }

    /// Why [`DeviceOptions::programs`] were not taken, if they were not.
    pub fn programs_refused(&self) -> Option<&str> {
        self.programs_refused
    }

    /// The device and the queue themselves, for an app that shows what is computed.
    pub fn wgpu(&self) -> (&wgpu::Device, &wgpu::Queue) {
        (&self.inner, &self.queue)
    }

    pub(crate) fn features(&self) -> Features {
        self.features
    }

    pub(crate) fn limits(&self) -> &wgpu::Limits {
        &self.limits
    }

    /// Why the device is of no use any more, if so.
    pub(crate) fn check(&self) -> Result<()> {
        match lock(&self.lost).as_ref() {
            Some(why) => Err(GpuError::Lost(why.clone())),
            None => Ok(()),
        }
    }

    /// Gives the device up; what runs on it is lost.
    pub(crate) fn give_up(&self, why: &str) {
        lock(&self.lost).get_or_insert_with(|| why.to_owned());
        self.inner.destroy();
    }

    /// Waits for what was submitted up to `submission`.
    pub(crate) fn wait(&self, submission: &wgpu::SubmissionIndex) -> Result<()> {
        self.check()?;
        let waited = self.inner.poll(wgpu::PollType::Wait {
            submission_index: Some(submission.clone()),
            timeout: Some(self.patience),
        });
        match waited {
            Ok(_) => {}
            Err(wgpu::PollError::Timeout) => {
                self.give_up(&format!("no answer for {:?}", self.patience));
            }
            Err(why) => self.give_up(&one_line(why)),
        }
        self.check()
    }

    /// Asks the device, which says only then that it was lost since.
    fn ask(&self) -> Result<()> {
        if let Err(why) = self.inner.poll(wgpu::PollType::Poll) {
            self.give_up(&one_line(why));
        }
        self.check()
    }

    /// Does `work` and gives what the device has against it as an error.
    pub(crate) fn guarded<T>(&self, work: impl FnOnce() -> Result<T>) -> Result<T> {
        self.ask()?;
        let memory = self.inner.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let internal = self.inner.push_error_scope(wgpu::ErrorFilter::Internal);
        let validation = self.inner.push_error_scope(wgpu::ErrorFilter::Validation);
        let done = work();
        // Scopes are popped last in, first out.
        let errors = [validation, internal, memory].map(|scope| pollster::block_on(scope.pop()));
        self.check()?;
        // What there was no memory for is invalid wherever it is used next: the cause comes before its consequences.
        let error = errors.into_iter().rev().flatten().next();
        if error.is_some() {
            // It may be a loss that was not told yet.
            self.ask()?;
        }
        match error {
            Some(wgpu::Error::OutOfMemory { source }) => Err(GpuError::OutOfMemory(one_line(source))),
            Some(why) => Err(GpuError::Refused(format!("{}: {}", self.name(), one_line(why)))),
            None => done,
        }
    }
}

/// The adapter of that name, or the fastest that is hardware.
fn adapter(name: Option<&str>, memory_percent: Option<u8>) -> Result<wgpu::Adapter> {
    let mut wanted = wgpu::InstanceDescriptor::new_without_display_handle();
    wanted.memory_budget_thresholds.for_resource_creation = memory_percent;
    let instance = wgpu::Instance::new(wanted);
    let mut all = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
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
    let names = all
        .iter()
        .map(|adapter| adapter.get_info().name)
        .collect::<Vec<_>>()
        .join(", ");
    let wanted = |adapter: &wgpu::Adapter| match name {
        Some(name) => {
            let of = adapter.get_info().name.to_lowercase();
            of.contains(&name.to_lowercase())
        }
        None => rank(adapter) < 4,
    };
    all.into_iter().find(wanted).ok_or_else(|| {
        GpuError::None(match (name, names.is_empty()) {
            (_, true) => "no driver of Vulkan, Metal or DirectX 12 answers".into(),
            (Some(name), _) => format!("none is called '{name}'; there is {names}"),
            (None, _) => {
                format!("only drivers in software answer ({names}); they are taken by name")
            }
        })
    })
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
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
        // What goes wrong in the driver comes back from where it is guarded.
        let wrong = device.guarded(|| {
            device.program("nonsense", "fn main( {".into(), "main");
            Ok(())
        });
        assert!(matches!(wrong, Err(GpuError::Refused(_))), "{wrong:?}");
        // A lost device says so, and why, to all that comes.
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
        // Drivers in software do not respect what memory there is.
        let hardware = Device::open_with(&DeviceOptions::default(), &little);
        let device = opened(hardware.or_else(|_| Device::open_with(&software(), &little)));
        let most = device.limits.max_storage_buffer_binding_size.min(1 << 28) as usize;
        let taken = device.guarded(|| {
            // More than a hundredth of any machine's memory.
            let all = (0..64).map(|_| device.buffer("a frame", most));
            all.collect::<Result<Vec<_>>>()
        });
        if taken.is_ok() {
            skip::or_fail("memory limits", format!("{device:?} gives more memory than there is"));
            return;
        }
        assert!(matches!(taken, Err(GpuError::OutOfMemory(_))), "{taken:?}");
        // Also where what was not given is used.
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
        // What does fit still works.
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
        let adapter = opened(adapter(software().name.as_deref(), None));
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
        // The app takes it away.
        inner.destroy();
        assert!(matches!(device.guarded(|| Ok(())), Err(GpuError::Lost(_))));
    }
}
