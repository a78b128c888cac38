//! The filters before double phase: the aperture of BL-DPM, the blur of AA-DPM, the network of DDPM.

use super::EncoderJob;
use super::blur::Blur;
use crate::device::{Constants, Device, Dispatch};
use crate::fft::{Convolution, Planes, quadrant};
use crate::input::{Form, Packer, Source};
use crate::method::chain::{ChainPlan, End, chain_of};
use crate::numbers::Numbers;
use crate::{GpuError, Result};
use phasefront_core::encode::Encoding;
use phasefront_core::encode::anti_alias::AntiAlias;
use phasefront_core::encode::band_limit::BandLimit;
use phasefront_core::encode::deep;
use phasefront_core::method::network::Network;

/// The most taps on one side for which the blur is part of the double-phase dispatch.
const FUSED_HALF: usize = 2;

/// The filter of an encoding.
pub(super) enum Filter {
    None,
    Blur([Dispatch; 2]),
    Aperture(Convolution),
    Network(Box<Prefilter>),
}

/// A filtered field, and the operations that the double-phase dispatch still has to apply.
pub(super) struct Filtered<'a> {
    pub(super) field: wgpu::Buffer,
    /// The factors that its colours are still multiplied by.
    pub(super) turn: Option<&'a wgpu::Buffer>,
    /// A blur to apply: the centre tap and the taps on one side.
    pub(super) taps: Vec<f32>,
    /// Whether the original field is overwritten or `field` is another buffer.
    pub(super) replaces: bool,
}

impl Filter {
    pub(super) fn new<'a>(device: &Device, job: &EncoderJob<'a>, frame: &Constants) -> Result<(Self, Filtered<'a>)> {
        let size = job.size;
        let mut rest = Filtered {
            field: job.field.clone(),
            turn: job.turn,
            taps: vec![1.0],
            replaces: false,
        };
        let filter = match &job.options.encoding {
            Encoding::DoublePhase => Filter::None,
            Encoding::AntiAlias { sigma, width } => {
                let blur = AntiAlias::new(*sigma, *width)?;
                if blur.taps().len() - 1 <= FUSED_HALF {
                    rest.taps = blur.taps().to_vec();
                    Filter::None
                } else {
                    if job.options.dark_threshold > 0.0 {
                        return Err(GpuError::Refused(format!(
                            "a blur over {width} pixels with a dark threshold; up to {} pixels, a threshold of 0, or the CPU are right",
                            2 * FUSED_HALF + 1
                        )));
                    }
                    rest.replaces = true;
                    let blur = Blur {
                        device,
                        frame,
                        taps: blur.taps(),
                        size,
                    };
                    Filter::Blur(blur.steps(job.field, rest.turn.take())?)
                }
            }
            Encoding::BandLimit { k } => {
                rest.replaces = true;
                let limit = BandLimit::new(size, *k)?;
                let kept = quadrant(size, |kx, ky| f32::from(u8::from(limit.keeps(kx, ky))));
                let planes = Planes {
                    field: job.field,
                    size,
                    padded: size,
                    factors: &[&kept],
                    turn: rest.turn.take(),
                };
                Filter::Aperture(Convolution::new(device, &planes)?)
            }
            Encoding::Deep(network) => {
                let made = Prefilter::new(device, network, job, frame)?;
                rest.replaces = true;
                rest.field = made.chain.field.clone();
                Filter::Network(Box::new(made))
            }
            _ => return Err(GpuError::Refused("this encoding runs on the CPU only".into())),
        };
        Ok((filter, rest))
    }

    pub(super) fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        match self {
            Filter::None => {}
            Filter::Blur(steps) => steps.iter().for_each(|step| step.run(pass)),
            Filter::Aperture(convolution) => convolution.run(pass),
            Filter::Network(prefilter) => prefilter.run(pass),
        }
    }
}

/// The network of DDPM on a field.
pub(super) struct Prefilter {
    /// The blur before the network, if the network requires it.
    blur: Option<[Dispatch; 2]>,
    packer: Packer,
    chain: ChainPlan,
}

impl Prefilter {
    fn new(device: &Device, network: &Network, job: &EncoderJob<'_>, frame: &Constants) -> Result<Self> {
        let (size, kind) = (job.size, network.input());
        if !kind.is_field() {
            let why = format!("a pre-filter takes 'field', this network '{kind}'");
            return Err(phasefront_core::runtime::error::Error::Network(why).into());
        }
        let blur = if kind.is_blurred() {
            let blur = deep::blur()?;
            let blur = Blur {
                device,
                frame,
                taps: blur.taps(),
                size,
            };
            Some(blur.steps(job.field, None)?)
        } else {
            None
        };
        let (chain, head) = chain_of(network)?;
        let numbers = Numbers::of(device, chain, job.chain.float)?;
        let (form, source) = (Form::Chain(chain, numbers, 1.0), Source::Field(job.field, kind));
        let packer = Packer::new(device, form, size, source, None)?;
        let end = End::Field(head, kind);
        let (input, fusion) = (&packer.input, job.chain.fusion);
        let chain = ChainPlan::new(device, chain, numbers, size, input, end, fusion)?;
        Ok(Prefilter { blur, packer, chain })
    }

    fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.blur.iter().flatten().for_each(|step| step.run(pass));
        self.packer.run(pass);
        self.chain.run(pass);
    }
}
