//! GPU memory and its transfer to the CPU.

use super::{Device, one_line};
use crate::{GpuError, Result};
use phasefront_core::Size;
use wgpu::util::{BufferInitDescriptor, DeviceExt};

/// Constants of a program and their address space.
pub(crate) struct Constants {
    pub(crate) buffer: wgpu::Buffer,
    uniform: bool,
}

impl Constants {
    /// Returns the address space in WGSL.
    pub(crate) fn space(&self) -> &'static str {
        if self.uniform { "uniform" } else { "storage, read" }
    }
}

impl Device {
    /// Allocates a zeroed buffer of `bytes` for programs and copies.
    pub(crate) fn buffer(&self, what: &str, bytes: usize) -> Result<wgpu::Buffer> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let most = self
            .limits
            .max_storage_buffer_binding_size
            .min(self.limits.max_buffer_size);
        if bytes as u64 > most {
            return Err(GpuError::Refused(format!(
                "{what} of {} MB is too large for {}, which takes {} MB; smaller frames are right",
                bytes >> 20,
                self.name(),
                most >> 20
            )));
        }
        Ok(self.inner.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            // A binding holds at least one whole value.
            size: (bytes.max(16) as u64).next_multiple_of(16),
            usage,
            mapped_at_creation: false,
        }))
    }

    /// Creates a texture of 8-bit RGBA for copies, for programs that read it, and for `usage`.
    pub(crate) fn picture(
        &self,
        what: &str,
        Size { width, height }: Size,
        usage: wgpu::TextureUsages,
    ) -> Result<wgpu::Texture> {
        let most = self.limits.max_texture_dimension_2d as usize;
        if height.max(width) > most {
            return Err(GpuError::Refused(format!(
                "a picture of {width}×{height} is too large for {}, which takes {most} a side",
                self.name()
            )));
        }
        Ok(self.inner.create_texture(&wgpu::TextureDescriptor {
            label: Some(what),
            size: wgpu::Extent3d {
                width: width as u32,
                height: height as u32,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage: usage | wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        }))
    }

    /// Creates a buffer that the CPU can read.
    pub(crate) fn readable(&self, what: &str, bytes: usize) -> wgpu::Buffer {
        self.inner.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size: (bytes as u64).next_multiple_of(16),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// Creates constants, in uniform memory if they fit, because every GPU reads it fastest.
    pub(crate) fn constants(&self, what: &str, contents: &[u8]) -> Result<Constants> {
        let uniform = contents.len() as u64 <= self.limits.max_uniform_buffer_binding_size;
        if !uniform && contents.len() as u64 > self.limits.max_storage_buffer_binding_size {
            return Err(GpuError::Refused(format!("{what} do not fit {}", self.name())));
        }
        let usage = if uniform {
            wgpu::BufferUsages::UNIFORM
        } else {
            wgpu::BufferUsages::STORAGE
        };
        let buffer = self.inner.create_buffer_init(&BufferInitDescriptor {
            label: Some(what),
            contents,
            usage: usage | wgpu::BufferUsages::COPY_DST,
        });
        Ok(Constants { buffer, uniform })
    }

    /// Creates constants that each thread reads at a different index.
    pub(crate) fn table(&self, what: &str, contents: &[u8]) -> Result<Constants> {
        let buffer = self.buffer(what, contents.len())?;
        self.queue.write_buffer(&buffer, 0, contents);
        Ok(Constants { buffer, uniform: false })
    }

    /// Copies `bytes` to the offset `at` of `to`, a multiple of 4. Copies are in whole words; the last word is padded
    /// with zeros.
    pub(crate) fn write(&self, to: &wgpu::Buffer, at: usize, bytes: &[u8]) {
        let (words, rest) = bytes.split_at(bytes.len() / 4 * 4);
        self.queue.write_buffer(to, at as u64, words);
        if !rest.is_empty() {
            let mut word = [0; 4];
            word[..rest.len()].copy_from_slice(rest);
            self.queue.write_buffer(to, (at + words.len()) as u64, &word);
        }
    }

    /// Reads `buffer` back after the submitted work is done. For inspecting data between stages.
    pub(crate) async fn read_async(&self, buffer: &wgpu::Buffer, bytes: usize) -> Result<Vec<u8>> {
        let target = self.readable("read back", bytes);
        let mut encoder = self.inner.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &target, 0, target.size());
        let submission = self.queue.submit([encoder.finish()]);
        let mut all = vec![0; bytes];
        self.map(&target, &submission).await?;
        copy_mapped(&target, &mut all)?;
        Ok(all)
    }
}

/// Copies the first bytes of a mapped buffer.
pub(crate) fn copy_mapped(buffer: &wgpu::Buffer, into: &mut [u8]) -> Result<()> {
    let view = buffer
        .get_mapped_range(..)
        .map_err(|why| GpuError::Lost(one_line(why)))?;
    into.copy_from_slice(&view[..into.len()]);
    Ok(())
}
