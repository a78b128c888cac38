//! The calls that block until a native GPU has answered: only here does this crate block on its futures. In a browser
//! these calls do not exist.

use crate::device::{Device, DeviceOptions};
use crate::input::{Colour, Depth, Frame};
use crate::pipeline::{Deliver, GpuPipeline, GpuReport, Job, Ticket};
use crate::{ChainOptions, GpuNetworkPlan, Past, Result, probe_async};
use phasefront_core::Size;
use phasefront_core::method::network::Network;
use pollster::block_on;
use std::sync::Arc;

/// Runs a small frame of `job` on `device` and on the CPU and compares their phases.
///
/// # Errors
/// Returns the errors of [`probe_async`].
pub fn probe(device: &Arc<Device>, job: &Job) -> Result<()> {
    block_on(probe_async(device, job))
}

impl Device {
    /// Opens a GPU.
    ///
    /// # Errors
    /// Returns the errors of [`Device::open_async`].
    pub fn open(options: &DeviceOptions) -> Result<Self> {
        block_on(Self::open_async(options))
    }

    /// Opens a GPU as [`Device::open`] does, with at most the features, limits and memory of `allowed`.
    #[cfg(test)]
    pub(crate) fn open_with(options: &DeviceOptions, allowed: &crate::device::Allowed) -> Result<Self> {
        block_on(Self::open_with_async(options, allowed))
    }

    /// Runs `work` and returns the device's errors during it.
    pub(crate) fn guarded<T>(&self, work: impl FnOnce() -> Result<T>) -> Result<T> {
        block_on(self.guarded_async(work))
    }

    /// Reads `buffer` back after the submitted work is done.
    #[cfg(test)]
    pub(crate) fn read(&self, buffer: &wgpu::Buffer, bytes: usize) -> Result<Vec<u8>> {
        block_on(self.read_async(buffer, bytes))
    }
}

impl GpuNetworkPlan {
    /// Prepares `network` for frames of `size`.
    ///
    /// # Errors
    /// Returns the errors of [`GpuNetworkPlan::new_async`].
    pub fn new(device: &Arc<Device>, network: &Network, size: Size, options: ChainOptions) -> Result<Self> {
        block_on(Self::new_async(device, network, size, options))
    }

    /// Runs the network on one frame, as [`GpuNetworkPlan::run_async`] does.
    ///
    /// # Errors
    /// Returns the errors of [`GpuNetworkPlan::run_async`].
    pub fn run(&self, input: &[f32], output: &mut [f32]) -> Result<()> {
        block_on(self.run_async(input, output))
    }
}

impl GpuPipeline {
    /// Plans `job` on `device`. It does not check the device's results: see [`probe`].
    ///
    /// # Errors
    /// Returns the errors of [`GpuPipeline::new_async`].
    pub fn new(device: &Arc<Device>, job: &Job) -> Result<Self> {
        block_on(Self::new_async(device, job))
    }

    /// Plans the input stage again for frames in these formats. The other stages and the frames in flight stay.
    ///
    /// # Errors
    /// Returns the errors of [`GpuPipeline::expect_async`].
    pub fn expect(&mut self, colour: Colour, depth: Depth) -> Result<()> {
        block_on(self.expect_async(colour, depth))
    }

    /// Submits a frame. At most [`crate::FLIGHTS`] may be in flight.
    ///
    /// # Errors
    /// Returns the errors of [`GpuPipeline::submit_async`].
    pub fn submit(&mut self, frame: &Frame<'_>, deliver: Deliver) -> Result<Ticket> {
        self.submit_after(None, frame, deliver)
    }

    /// Submits a frame whose smoothed brightness starts from the scale in `past`.
    ///
    /// # Errors
    /// Returns the errors of [`GpuPipeline::submit`].
    pub fn submit_after(&mut self, past: Option<Past>, frame: &Frame<'_>, deliver: Deliver) -> Result<Ticket> {
        block_on(self.submit_async(past, frame, deliver))
    }

    /// Waits for a frame and copies its levels, (3, H, W).
    ///
    /// # Errors
    /// Returns the errors of [`GpuPipeline::collect_async`].
    ///
    /// # Panics
    /// Panics if `levels` does not have 3·H·W values.
    pub fn collect(&mut self, ticket: Ticket, levels: &mut [u8]) -> Result<GpuReport> {
        block_on(self.collect_async(ticket, levels))
    }

    /// Waits for a frame that stays on the GPU and frees its slot.
    ///
    /// # Errors
    /// Returns the errors of [`GpuPipeline::finish_async`].
    pub fn finish(&mut self, ticket: Ticket) -> Result<GpuReport> {
        block_on(self.finish_async(ticket))
    }

    /// Submits a frame and collects it, as [`GpuPipeline::submit`] and [`GpuPipeline::collect`] do.
    ///
    /// # Errors
    /// Returns the errors of both.
    ///
    /// # Panics
    /// Panics if `levels` does not have 3·H·W values.
    pub fn process(&mut self, frame: &Frame<'_>, levels: &mut [u8]) -> Result<GpuReport> {
        let ticket = self.submit(frame, Deliver::Levels)?;
        self.collect(ticket, levels)
    }
}
