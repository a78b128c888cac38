//! Computes the hologram's field of a captured frame on the GPU: the counterpart of [`phasefront_core::method`].

pub(crate) mod chain;
mod hidden;
mod sweep;

use super::device::Device;
use super::input::{Colour, Depth, Form, Frame, Packer, Source};
use super::numbers::Numbers;
use super::{GpuError, Result};
use chain::{ChainOptions, ChainPlan, End};
use phasefront_core::display::Display;
use phasefront_core::method::network::{InputKind, Network};
use phasefront_core::method::seeded::seed;
use phasefront_core::method::sweep::SweepPlan;
use phasefront_core::method::{Method, sweep_plan};
use std::sync::Arc;
use sweep::Sweeper;

/// A method for one frame size.
pub(super) struct MethodPlan {
    size: (usize, usize),
    /// Converts the frame to the input of the network or the sweep.
    packer: Packer,
    plan: Plan,
}

enum Plan {
    Network(Trained),
    Sweep(Sweeper),
    /// The sweep, the conversion of its field and the frame to the network's input, and the network.
    Seeded(Sweeper, Box<Packer>, Trained),
}

/// A network in its number format.
struct Trained {
    network: Arc<Network>,
    numbers: Numbers,
    depth_scale: f32,
    chain: ChainPlan,
}

impl Trained {
    /// Plans `network`, with its number format and stretched depth, on the output of `packer`.
    fn new(
        device: &Device,
        network: &Arc<Network>,
        (numbers, depth_scale): (Numbers, f32),
        size: (usize, usize),
        packer: &Packer,
        options: ChainOptions,
    ) -> Result<Self> {
        let (chain, fusion) = (network.chain(), options.fusion);
        let end = End::Field(network.head(), network.input());
        Ok(Trained {
            network: network.clone(),
            numbers,
            depth_scale,
            chain: ChainPlan::new(device, chain, numbers, size, &packer.input, end, fusion)?,
        })
    }
}

impl MethodPlan {
    /// Plans `method` for frames of `size` (height, width) in `formats`.
    pub(super) fn new(
        device: &Device,
        method: &Method,
        size: (usize, usize),
        display: &Display,
        formats: (Colour, Depth),
        options: ChainOptions,
    ) -> Result<Self> {
        let source = Source::Frame(formats.0, formats.1);
        let how = |network: &Network| {
            let numbers = Numbers::of(device, network.chain(), options.float)?;
            Ok::<_, GpuError>((numbers, network.depth_scale(display)?))
        };
        let swept = |plan: SweepPlan| {
            let packer = Packer::new(device, Form::Surfaces, size, source, None)?;
            let sweep = Sweeper::new(device, &plan, display, &packer.input.first)?;
            Ok::<_, GpuError>((packer, sweep))
        };
        let (height, width) = size;
        let (packer, plan) = match method {
            Method::Network(network) => {
                let how = how(network)?;
                let form = Form::Chain(network.chain(), how.0, how.1);
                let packer = Packer::new(device, form, size, source, None)?;
                let trained = Trained::new(device, network, how, size, &packer, options)?;
                (packer, Plan::Network(trained))
            }
            Method::Sweep(sweep) => {
                let (packer, sweep) = swept(sweep_plan(height, width, *sweep, display)?)?;
                (packer, Plan::Sweep(sweep))
            }
            Method::Seeded(network) if network.input() == InputKind::SeededColour => {
                return Err(GpuError::Refused(
                    "a network that takes the colours in turn runs on the CPU only".into(),
                ));
            }
            Method::Seeded(network) => {
                let sweep = seed(network, display);
                let plan = SweepPlan::new(height, width, display, sweep, 0.0)?;
                let (packer, sweep) = swept(plan)?;
                let how = how(network)?;
                let form = Form::Chain(network.chain(), how.0, how.1);
                let source = Source::Seeded(&packer.input.first, &sweep.field);
                let seeded = Packer::new(device, form, size, source, None)?;
                let trained = Trained::new(device, network, how, size, &seeded, options)?;
                (packer, Plan::Seeded(sweep, Box::new(seeded), trained))
            }
            Method::Auto(..) => {
                return Err(GpuError::Refused(
                    "the sharpness of depth, which chooses between sweep and network, is measured on the CPU only; one of them alone is right"
                        .into(),
                ));
            }
            _ => return Err(GpuError::Refused("this method runs on the CPU only".into())),
        };
        Ok(MethodPlan { size, packer, plan })
    }

    /// Plans the input stage again for frames in `formats`.
    pub(super) async fn expect(&mut self, device: &Device, formats: (Colour, Depth)) -> Result<()> {
        if self.packer.formats() == Some(formats) {
            return Ok(());
        }
        let form = match &self.plan {
            Plan::Network(trained) => Form::Chain(trained.network.chain(), trained.numbers, trained.depth_scale),
            Plan::Sweep(_) | Plan::Seeded(..) => Form::Surfaces,
        };
        let source = Source::Frame(formats.0, formats.1);
        let input = Some(self.packer.input.clone());
        self.packer = device
            .guarded_async(|| Packer::new(device, form, self.size, source, input))
            .await?;
        Ok(())
    }

    /// Uploads a frame. The upload is complete before the next submission starts.
    pub(super) fn upload(&self, device: &Device, frame: &Frame<'_>) -> Result<()> {
        self.packer.upload(device, frame)
    }

    /// Converts the uploaded frame to the method's input, up to depth that comes as readings.
    pub(super) fn read(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.packer.run(pass);
    }

    /// Adds depth that comes as readings.
    pub(super) fn condition(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.packer.condition(pass);
    }

    /// Computes the field from the converted input.
    pub(super) fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        match &self.plan {
            Plan::Network(trained) => trained.chain.run(pass),
            Plan::Sweep(sweep) => sweep.run(pass),
            Plan::Seeded(sweep, seeded, trained) => {
                sweep.run(pass);
                seeded.run(pass);
                trained.chain.run(pass);
            }
        }
    }

    /// Returns the field, (3, H, W) complex f32.
    pub(super) fn field(&self) -> &wgpu::Buffer {
        match &self.plan {
            Plan::Network(trained) | Plan::Seeded(_, _, trained) => &trained.chain.field,
            Plan::Sweep(sweep) => &sweep.field,
        }
    }

    /// Returns the sums of the field, three complex f32 for each workgroup, and the number of workgroups.
    pub(super) fn sums(&self) -> (&wgpu::Buffer, usize) {
        match &self.plan {
            Plan::Network(trained) | Plan::Seeded(_, _, trained) => (&trained.chain.partial, trained.chain.parts),
            Plan::Sweep(sweep) => (&sweep.partial, sweep.parts),
        }
    }

    /// Returns the hologram's position in metres from the midpoint toward the viewer.
    pub(super) fn z_m(&self) -> f64 {
        match &self.plan {
            Plan::Network(_) | Plan::Seeded(..) => 0.0,
            Plan::Sweep(sweep) => sweep.z_m,
        }
    }

    /// Returns the number format of the computation.
    pub(super) fn numbers(&self) -> Numbers {
        match &self.plan {
            Plan::Network(trained) | Plan::Seeded(_, _, trained) => trained.numbers,
            Plan::Sweep(_) => Numbers::F32,
        }
    }

    /// Describes the device's work per frame.
    pub(super) fn describe(&self) -> String {
        let swept = |sweep: &Sweeper| {
            let (planes, dispatches) = (sweep.together, sweep.dispatches());
            format!("the sweep, planes by {planes}, in {dispatches} dispatches")
        };
        let trained = |trained: &Trained| {
            let (fusion, dispatches) = (trained.chain.fusion, trained.chain.dispatches());
            format!("{fusion:?} in {dispatches} dispatches")
        };
        match &self.plan {
            Plan::Network(network) => trained(network),
            Plan::Sweep(sweep) => swept(sweep),
            Plan::Seeded(sweep, _, network) => format!("{}, {}", swept(sweep), trained(network)),
        }
    }

    /// Returns the bytes that the field's dispatches read and write in a frame, counting each value once.
    pub(super) fn bytes(&self) -> usize {
        match &self.plan {
            Plan::Network(trained) => trained.chain.bytes,
            Plan::Sweep(sweep) => sweep.bytes,
            Plan::Seeded(sweep, _, trained) => sweep.bytes + trained.chain.bytes,
        }
    }
}
