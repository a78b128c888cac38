//! Programs: compilation, binding of arguments and dispatch.
#![allow(unsafe_code)]

use super::{Device, lock};
use crate::{GpuError, Result};

/// A compiled program.
#[derive(Clone)]
pub(crate) struct Program(wgpu::ComputePipeline);

impl Program {
    /// Binds `arguments` to the program for a grid of workgroups. Each argument has its binding number.
    pub(crate) fn on(
        &self,
        device: &Device,
        arguments: &[(u32, wgpu::BindingResource<'_>)],
        grid: [usize; 3],
    ) -> Result<Dispatch> {
        let most = device.limits.max_compute_workgroups_per_dimension as usize;
        if grid.iter().any(|&n| n > most) {
            return Err(GpuError::Refused(format!(
                "{grid:?} workgroups are too many for {}, which takes {most} a side; smaller frames are right",
                device.name()
            )));
        }
        let entries: Vec<_> = arguments
            .iter()
            .map(|(binding, resource)| wgpu::BindGroupEntry {
                binding: *binding,
                resource: resource.clone(),
            })
            .collect();
        Ok(Dispatch {
            pipeline: self.0.clone(),
            arguments: device.inner.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &self.0.get_bind_group_layout(0),
                entries: &entries,
            }),
            grid: grid.map(|n| n as u32),
        })
    }
}

/// A program with its arguments, which can run repeatedly.
pub(crate) struct Dispatch {
    pipeline: wgpu::ComputePipeline,
    arguments: wgpu::BindGroup,
    grid: [u32; 3],
}

impl Dispatch {
    pub(crate) fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        let [x, y, z] = self.grid;
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.arguments, &[]);
        pass.dispatch_workgroups(x, y, z);
    }
}

impl Device {
    /// Compiles `source`, a program of this crate, or returns the program compiled earlier from the same source.
    pub(crate) fn program(&self, what: &str, source: String, entry: &'static str) -> Program {
        let key = (entry, source);
        if let Some(known) = lock(&self.compiled).get(&key) {
            return known.clone();
        }
        let program = self.compile(what, &key.1, entry);
        lock(&self.compiled).insert(key, program.clone());
        program
    }

    fn compile(&self, what: &str, source: &str, entry: &str) -> Program {
        let descriptor = wgpu::ShaderModuleDescriptor {
            label: Some(what),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        };
        // SAFETY: only sources of this crate are compiled. Their loops have constant bounds, or bounds from tables of
        // this crate, and each index is clamped to its array where it is computed. The tests run every program on
        // frames of odd sizes.
        let module = unsafe {
            self.inner
                .create_shader_module_trusted(descriptor, wgpu::ShaderRuntimeChecks::unchecked())
        };
        let pipeline = self.inner.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(what),
            layout: None,
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions {
                // Every value is written before it is read.
                zero_initialize_workgroup_memory: false,
                ..Default::default()
            },
            cache: self.cache.as_ref(),
        });
        Program(pipeline)
    }

    /// Makes `forged` run instead of `source`, to simulate a driver that compiles wrongly.
    #[cfg(test)]
    pub(crate) fn forge(&self, entry: &'static str, source: &str, forged: &str) {
        let program = self.compile("forged", forged, entry);
        lock(&self.compiled).insert((entry, source.to_owned()), program);
    }
}
