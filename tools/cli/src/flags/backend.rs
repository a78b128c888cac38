//! The flags for the device that makes frames.

use clap::{Args, ValueEnum};
use phasefront_cli::gpu;
use phasefront_gpu::DeviceOptions;
use phasefront_io::{Error, Result};

/// The device that makes frames.
#[derive(Default, Args)]
#[command(next_help_heading = "Method")]
pub(crate) struct BackendFlags {
    /// Device that makes frames
    #[arg(long, value_enum, default_value_t = BackendName::Cpu)]
    backend: BackendName,
    /// Part of the GPU's name [default: the fastest; drivers in software are taken by name only]
    #[arg(long, value_name = "NAME", help_heading = "Expert")]
    gpu: Option<String>,
}

#[derive(Clone, Copy, Default, PartialEq, ValueEnum)]
enum BackendName {
    /// The CPU
    #[default]
    Cpu,
    /// The GPU, by Vulkan, Metal or DirectX 12
    Gpu,
}

impl BackendFlags {
    /// Returns the options of the GPU, if one is requested.
    pub(crate) fn device(&self) -> Result<Option<DeviceOptions>> {
        match (self.backend, &self.gpu) {
            (BackendName::Gpu, name) => Ok(Some(gpu::options(name.as_deref()))),
            (BackendName::Cpu, None) => Ok(None),
            (BackendName::Cpu, Some(_)) => Err(Error::Usage("--gpu needs --backend gpu".into())),
        }
    }
}
