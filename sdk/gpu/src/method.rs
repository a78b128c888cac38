//! Computes the hologram's field of a captured frame on the GPU: the counterpart of [`phasefront_core::method`].

pub(crate) mod chain;
mod hidden;
mod softness;
mod sweep;

use super::device::Device;
use super::input::{ChainInput, Colour, Depth, Form, Frame, Packer, Source};
use super::numbers::Numbers;
use super::{GpuError, Result};
use chain::{ChainOptions, ChainPlan, End, chain_of};
use phasefront_core::Size;
use phasefront_core::depth::softness::is_soft;
use phasefront_core::display::Display;
use phasefront_core::frame::Past;
use phasefront_core::method::network::{InputKind, Network};
use phasefront_core::method::seeded::seed;
use phasefront_core::method::sweep::SweepPlan;
use phasefront_core::method::{Method, sweep_plan};
use softness::Softness;
use std::sync::Arc;
use sweep::Sweeper;

/// A method for one frame size.
pub(super) struct MethodPlan {
    size: Size,
    /// Whether a network's input, too, is made from the frame's surfaces.
    keeps_surfaces: bool,
    /// Converts the frame to the input of the network or the sweep.
    packer: Packer,
    plan: Plan,
}

enum Plan {
    Network(Trained),
    Sweep(Sweeper),
    /// The sweep, the conversion of its field and the frame to the network's input, and the network.
    Seeded(Sweeper, Box<Packer>, Trained),
    Auto(Box<Auto>),
}

/// The network and the sweep, which write to the same field.
struct Auto {
    softness: Softness,
    /// Whether the depth of the frame, or of the previous one until [`MethodPlan::choose`], is soft.
    is_soft: Option<bool>,
    sweep: Sweeper,
    /// The sweep that seeds the network, if it needs one.
    seed: Option<Sweeper>,
    /// Converts the frame's surfaces to the network's input.
    packer: Packer,
    trained: Trained,
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
        size: Size,
        packer: &Packer,
        options: ChainOptions,
    ) -> Result<Self> {
        let (chain, head) = chain_of(network)?;
        let (end, fusion) = (End::Field(head, network.input()), options.fusion);
        Ok(Trained {
            network: network.clone(),
            numbers,
            depth_scale,
            chain: ChainPlan::new(device, chain, numbers, size, &packer.input, end, fusion)?,
        })
    }
}

impl Trained {
    fn sums(&self) -> (&wgpu::Buffer, usize) {
        (&self.chain.partial, self.chain.parts)
    }
}

/// Plans the input stage, which with `keeps_surfaces` also writes the frame's surfaces.
fn packer(
    device: &Device,
    form: Form<'_>,
    size: Size,
    source: Source<'_>,
    input: Option<ChainInput>,
    keeps_surfaces: bool,
) -> Result<Packer> {
    if keeps_surfaces {
        Packer::by_surfaces(device, form, size, source, input)
    } else {
        Packer::new(device, form, size, source, input)
    }
}

impl MethodPlan {
    /// Plans `method` for frames of `size` in `formats`. With `keeps_surfaces`, every method has [`Self::surfaces`].
    pub(super) fn new(
        device: &Device,
        method: &Method,
        size: Size,
        display: &Display,
        formats: (Colour, Depth),
        options: ChainOptions,
        keeps_surfaces: bool,
    ) -> Result<Self> {
        let source = Source::Frame(formats.0, formats.1);
        let how = |network: &Network| {
            let numbers = Numbers::of(device, chain_of(network)?.0, options.float)?;
            Ok::<_, GpuError>((numbers, network.depth_scale(display)?))
        };
        let swept = |plan: SweepPlan| {
            let packer = Packer::new(device, Form::Surfaces, size, source, None)?;
            let sweep = Sweeper::new(device, &plan, display, &packer.input.first)?;
            Ok::<_, GpuError>((packer, sweep))
        };
        let (packer, plan) = match method {
            Method::Network(network) => {
                let how = how(network)?;
                let form = Form::Chain(chain_of(network)?.0, how.0, how.1);
                let packer = packer(device, form, size, source, None, keeps_surfaces)?;
                let trained = Trained::new(device, network, how, size, &packer, options)?;
                (packer, Plan::Network(trained))
            }
            Method::Sweep(sweep) => {
                let (packer, sweep) = swept(sweep_plan(size, *sweep, display)?)?;
                (packer, Plan::Sweep(sweep))
            }
            Method::Seeded(network) => {
                let sweep = seed(network, display);
                let plan = SweepPlan::new(size, display, sweep, 0.0)?;
                let (packer, sweep) = swept(plan)?;
                let how = how(network)?;
                let form = Form::Chain(chain_of(network)?.0, how.0, how.1);
                let source = Source::Seeded(&packer.input.first, &sweep.field);
                let seeded = Packer::new(device, form, size, source, None)?;
                let trained = Trained::new(device, network, how, size, &seeded, options)?;
                (packer, Plan::Seeded(sweep, Box::new(seeded), trained))
            }
            Method::Auto(sweep, network) => {
                let packer = Packer::new(device, Form::Surfaces, size, source, None)?;
                let surfaces = &packer.input.first;
                let at_midpoint = |sweep| SweepPlan::new(size, display, sweep, 0.0);
                let seed = match network.input() {
                    InputKind::Seeded => {
                        let plan = at_midpoint(seed(network, display))?;
                        Some(Sweeper::new(device, &plan, display, surfaces)?)
                    }
                    _ => None,
                };
                let source = match &seed {
                    Some(seed) => Source::Seeded(surfaces, &seed.field),
                    None => Source::Surfaces(surfaces),
                };
                let how = how(network)?;
                let form = Form::Chain(chain_of(network)?.0, how.0, how.1);
                let input = Packer::new(device, form, size, source, None)?;
                let trained = Trained::new(device, network, how, size, &input, options)?;
                let field = trained.chain.field.clone();
                let auto = Auto {
                    softness: Softness::new(device, surfaces, size)?,
                    is_soft: None,
                    sweep: Sweeper::into_field(device, &at_midpoint(*sweep)?, display, surfaces, field)?,
                    seed,
                    packer: input,
                    trained,
                };
                (packer, Plan::Auto(Box::new(auto)))
            }
            _ => return Err(GpuError::Refused("this method runs on the CPU only".into())),
        };
        Ok(MethodPlan {
            size,
            keeps_surfaces,
            packer,
            plan,
        })
    }

    /// Plans the input stage again for frames in `formats`.
    pub(super) async fn expect(&mut self, device: &Device, formats: (Colour, Depth)) -> Result<()> {
        if self.packer.formats() == Some(formats) {
            return Ok(());
        }
        let form = match &self.plan {
            Plan::Network(trained) => Form::Chain(chain_of(&trained.network)?.0, trained.numbers, trained.depth_scale),
            Plan::Sweep(_) | Plan::Seeded(..) | Plan::Auto(_) => Form::Surfaces,
        };
        let source = Source::Frame(formats.0, formats.1);
        let input = Some(self.packer.input.clone());
        let (size, keeps_surfaces) = (self.size, self.keeps_surfaces);
        self.packer = device
            .guarded_async(|| packer(device, form, size, source, input, keeps_surfaces))
            .await?;
        Ok(())
    }

    /// Returns the surfaces of a frame after [`Self::condition`], (H, W) of red, green, blue and depth, if the plan
    /// has them.
    pub(super) fn surfaces(&self) -> Option<&wgpu::Buffer> {
        self.packer.surfaces()
    }

    /// Uploads a frame. The upload is complete before the next submission starts.
    pub(super) fn upload(&self, device: &Device, frame: &Frame<'_>) -> Result<()> {
        self.packer.upload(device, frame)
    }

    /// Converts the uploaded frame to the method's input, up to depth that comes as readings.
    pub(super) fn read(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.packer.run(pass);
    }

    /// Adds depth that comes as readings, and measures the depth if the method depends on it.
    pub(super) fn condition(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.packer.condition(pass);
        if let Plan::Auto(auto) = &self.plan {
            auto.softness.run(pass);
        }
    }

    /// Returns the measure of the depth, if the method depends on it. [`Self::choose`] must then be called before
    /// [`Self::run`].
    pub(super) fn softness(&self) -> Option<&Softness> {
        match &self.plan {
            Plan::Auto(auto) => Some(&auto.softness),
            _ => None,
        }
    }

    /// Chooses the method for a frame whose depth was measured by `submission`, as
    /// [`phasefront_core::method::MethodPlan`] does.
    pub(super) async fn choose(
        &mut self,
        device: &Device,
        past: Option<Past>,
        submission: &wgpu::SubmissionIndex,
    ) -> Result<()> {
        if let Plan::Auto(auto) = &mut self.plan {
            let share = auto.softness.sharp_edges(device, submission).await?;
            auto.is_soft = Some(is_soft(share, auto.is_soft.filter(|_| past.is_some())));
        }
        Ok(())
    }

    /// Returns whether the plane sweep alone makes the frame, without a network.
    pub(super) fn is_swept(&self) -> bool {
        match &self.plan {
            Plan::Network(_) | Plan::Seeded(..) => false,
            Plan::Sweep(_) => true,
            Plan::Auto(auto) => auto.is_soft != Some(true),
        }
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
            Plan::Auto(auto) if auto.is_soft == Some(true) => {
                if let Some(seed) = &auto.seed {
                    seed.run(pass);
                }
                auto.packer.run(pass);
                auto.trained.chain.run(pass);
            }
            Plan::Auto(auto) => auto.sweep.run(pass),
        }
    }

    /// Returns the field, (3, H, W) complex f32.
    pub(super) fn field(&self) -> &wgpu::Buffer {
        match &self.plan {
            Plan::Network(trained) | Plan::Seeded(_, _, trained) => &trained.chain.field,
            Plan::Sweep(sweep) => &sweep.field,
            Plan::Auto(auto) => &auto.trained.chain.field,
        }
    }

    /// Returns the sums of the field that the network writes and of the one that the sweep writes, as far as the method
    /// has them: three complex f32 for each workgroup, and the number of workgroups.
    pub(super) fn sums(&self) -> [Option<(&wgpu::Buffer, usize)>; 2] {
        match &self.plan {
            Plan::Network(network) | Plan::Seeded(_, _, network) => [Some(network.sums()), None],
            Plan::Sweep(sweep) => [None, Some((&sweep.partial, sweep.parts))],
            Plan::Auto(auto) => [Some(auto.trained.sums()), Some((&auto.sweep.partial, auto.sweep.parts))],
        }
    }

    /// Returns the hologram's position in metres from the midpoint toward the viewer.
    pub(super) fn z_m(&self) -> f64 {
        match &self.plan {
            Plan::Network(_) | Plan::Seeded(..) | Plan::Auto(_) => 0.0,
            Plan::Sweep(sweep) => sweep.z_m,
        }
    }

    /// Returns the number format of the computation.
    pub(super) fn numbers(&self) -> Numbers {
        match &self.plan {
            Plan::Network(trained) | Plan::Seeded(_, _, trained) => trained.numbers,
            Plan::Sweep(_) => Numbers::F32,
            Plan::Auto(auto) => auto.trained.numbers,
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
            Plan::Auto(auto) => format!("{}, or {}", trained(&auto.trained), swept(&auto.sweep)),
        }
    }

    /// Returns the bytes that the field's dispatches read and write in a frame, counting each value once.
    pub(super) fn bytes(&self) -> usize {
        match &self.plan {
            Plan::Network(trained) => trained.chain.bytes,
            Plan::Sweep(sweep) => sweep.bytes,
            Plan::Seeded(sweep, _, trained) => sweep.bytes + trained.chain.bytes,
            Plan::Auto(auto) if self.is_swept() => auto.sweep.bytes,
            Plan::Auto(auto) => auto.seed.as_ref().map_or(0, |seed| seed.bytes) + auto.trained.chain.bytes,
        }
    }
}
