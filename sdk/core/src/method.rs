//! Methods that compute the hologram of an RGB-D frame. Later stages prepare it for the modulator.

pub mod mean_phase;
pub mod network;
pub mod seeded;
pub(crate) mod standing;
pub mod sweep;
pub(crate) mod wave;

use crate::Size;
use crate::depth::softness;
use crate::display::Display;
use crate::frame::{Past, RgbdFrame};
use crate::method::mean_phase::{MeanPhase, remove_mean_phase};
use crate::method::network::{Engine, InputKind, Network, NetworkPlan, NetworkScratch};
use crate::method::seeded::{SeededPlan, SeededScratch};
use crate::method::standing::{Changed, Standing};
use crate::method::sweep::{Sweep, SweepPlan, SweepScratch};
use crate::method::wave::{Pixels, Wave};
use crate::runtime::cancel::Cancel;
use crate::runtime::error::{Error, Result};
use num_complex::Complex32;
use phasefront_kernels::Isa;
use std::sync::Arc;

/// A method that computes holograms.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Method {
    /// A trained network for RGB-D frames.
    Network(Arc<Network>),
    /// The plane sweep, for any display.
    Sweep(Sweep),
    /// The plane sweep, corrected by a network that was trained on it.
    Seeded(Arc<Network>),
    /// Chooses the method for each frame by its depth ([`softness`]): the trained network where most edges are soft,
    /// the plane sweep otherwise.
    Auto(Sweep, Arc<Network>),
}

impl Method {
    /// Returns the method that fits the input of a trained network.
    pub fn trained(network: Arc<Network>) -> Self {
        match network.input() {
            InputKind::Seeded => Method::Seeded(network),
            _ => Method::Network(network),
        }
    }

    /// Checks whether the method suits `display`.
    ///
    /// # Errors
    /// Returns [`Error::Network`] if the network takes other planes than the method gives it, or was not trained for
    /// such a display.
    pub fn check(&self, display: &Display) -> Result<()> {
        let (network, input) = match self {
            Method::Sweep(_) => return Ok(()),
            Method::Network(network) if network.input() == InputKind::RgbdXy => (network, InputKind::RgbdXy),
            Method::Network(network) => (network, InputKind::Rgbd),
            Method::Seeded(network) => (network, InputKind::Seeded),
            Method::Auto(_, network) if network.chain().is_none() => {
                return Err(Error::Network(
                    "it has a form of its own, which the automatic choice does not take; the network alone is right"
                        .into(),
                ));
            }
            Method::Auto(_, network) => {
                return Method::trained(network.clone()).check(display);
            }
        };
        check_input(network, input)?;
        network.check_display(display)
    }
}

/// Plans `sweep` for frames of `size`. The sweep ends at the display if that is close enough, otherwise at
/// the midpoint.
pub fn sweep_plan(size: Size, sweep: Sweep, display: &Display) -> Result<SweepPlan> {
    let offset_m = display.offset_m();
    let z_m = if sweep::reaches(display, offset_m) {
        offset_m
    } else {
        0.0
    };
    SweepPlan::new(size, display, sweep, z_m)
}

/// A plan of a [`Method`] for one frame shape. It is immutable and can be shared between threads.
pub struct MethodPlan {
    size: Size,
    colours: usize,
    /// The number of planes of a sweep for the display.
    planes: usize,
    plan: Plan,
}

enum Plan {
    Network(Box<NetworkPlan>),
    Sweep(Box<SweepPlan>),
    Seeded(Box<SeededPlan>),
    Auto(Box<SweepPlan>, Box<Plan>),
}

/// The working memory of a [`MethodPlan`] for one frame at a time.
pub struct MethodScratch {
    of_plan: Scratch,
    /// What stands still, if it keeps its wave.
    standing: Option<Box<Standing>>,
}

enum Scratch {
    Network {
        network: NetworkScratch,
        /// The field of the shown frame, (C, H, W). Empty if nothing is kept.
        kept: Vec<Complex32>,
    },
    Sweep(SweepScratch),
    Seeded(SeededScratch),
    Auto {
        sweep: SweepScratch,
        trained: Box<Scratch>,
        /// Whether the depth of the previous frame was soft.
        was_soft: Option<bool>,
    },
}

/// The plan that makes a frame, and its memory.
enum Chosen<'a, 'b> {
    Network(&'a NetworkPlan, &'b mut NetworkScratch, &'b mut Vec<Complex32>),
    Sweep(&'a SweepPlan, &'b mut SweepScratch),
    Seeded(&'a SeededPlan, &'b mut SeededScratch),
}

impl Plan {
    fn engine(&self) -> Option<&Engine> {
        match self {
            Plan::Network(plan) => Some(plan.engine()),
            Plan::Seeded(plan) => Some(plan.engine()),
            Plan::Auto(_, trained) => trained.engine(),
            Plan::Sweep(_) => None,
        }
    }

    fn scratch(&self) -> Scratch {
        match self {
            Plan::Network(plan) => Scratch::Network {
                network: plan.scratch(),
                kept: Vec::new(),
            },
            Plan::Sweep(plan) => Scratch::Sweep(plan.scratch()),
            Plan::Seeded(plan) => Scratch::Seeded(plan.scratch()),
            Plan::Auto(sweep, trained) => Scratch::Auto {
                sweep: sweep.scratch(),
                trained: Box::new(trained.scratch()),
                was_soft: None,
            },
        }
    }

    /// Lets a network keep a field of `values`. One on tract cannot.
    fn keep(&self, values: usize, scratch: &mut Scratch) {
        match (self, scratch) {
            (Plan::Network(plan), Scratch::Network { kept, .. }) if plan.reach().is_some() => {
                kept.resize(values, Complex32::ZERO);
            }
            (Plan::Auto(_, trained), Scratch::Auto { trained: scratch, .. }) => trained.keep(values, scratch),
            _ => {}
        }
    }

    fn chosen<'a, 'b>(&'a self, scratch: &'b mut Scratch) -> Chosen<'a, 'b> {
        let is_swept = scratch.is_swept();
        match (self, scratch) {
            (Plan::Network(plan), Scratch::Network { network, kept }) => Chosen::Network(plan, network, kept),
            (Plan::Seeded(plan), Scratch::Seeded(scratch)) => Chosen::Seeded(plan, scratch),
            (Plan::Sweep(plan), Scratch::Sweep(scratch)) => Chosen::Sweep(plan, scratch),
            (Plan::Auto(plan, _), Scratch::Auto { sweep, .. }) if is_swept => Chosen::Sweep(plan, sweep),
            (Plan::Auto(_, plan), Scratch::Auto { trained, .. }) => plan.chosen(trained),
            _ => panic!("the scratch is another plan's"),
        }
    }
}

impl Scratch {
    fn is_swept(&self) -> bool {
        match self {
            Scratch::Network { .. } | Scratch::Seeded(_) => false,
            Scratch::Sweep(_) => true,
            Scratch::Auto { was_soft, .. } => *was_soft != Some(true),
        }
    }

    fn makes_waves(&self) -> bool {
        match self {
            Scratch::Network { kept, .. } => !kept.is_empty(),
            Scratch::Sweep(_) => true,
            Scratch::Seeded(_) => false,
            Scratch::Auto { trained, .. } => self.is_swept() || trained.makes_waves(),
        }
    }

    fn set_cancel(&mut self, cancel: &Cancel) {
        match self {
            Scratch::Network { network, .. } => network.set_cancel(cancel),
            Scratch::Sweep(scratch) => scratch.set_cancel(cancel),
            Scratch::Seeded(scratch) => scratch.set_cancel(cancel),
            Scratch::Auto { sweep, trained, .. } => {
                sweep.set_cancel(cancel);
                trained.set_cancel(cancel);
            }
        }
    }
}

impl MethodScratch {
    /// Returns whether the plane sweep alone made the last frame, without a network.
    pub(crate) fn is_swept(&self) -> bool {
        self.of_plan.is_swept()
    }

    /// Returns whether [`MethodPlan::wave_as_chosen`] works for the chosen frame: the plane sweep makes it, or a
    /// network that keeps what stands still.
    pub(crate) fn makes_waves(&self) -> bool {
        self.of_plan.makes_waves()
    }

    /// Makes the computation stop early once `cancel` is requested.
    pub fn set_cancel(&mut self, cancel: &Cancel) {
        self.of_plan.set_cancel(cancel);
    }
}

impl MethodPlan {
    /// Plans `method` for frames of `size` and the volume of `display`.
    ///
    /// # Errors
    /// Returns an error if a network is for layered input or for another display, or if the method cannot be planned
    /// for this size.
    pub fn new(size: Size, method: Method, display: &Display) -> Result<Self> {
        method.check(display)?;
        let planes = match &method {
            Method::Sweep(sweep) | Method::Auto(sweep, _) => sweep.planes,
            Method::Network(_) | Method::Seeded(_) => Sweep::for_display(display).planes,
        };
        let plan = match method {
            Method::Network(network) => Plan::Network(Box::new(network.plan_for(size, display)?)),
            Method::Seeded(network) => {
                let plan = SeededPlan::new(size, &network, display)?;
                Plan::Seeded(Box::new(plan))
            }
            Method::Sweep(sweep) => Plan::Sweep(Box::new(sweep_plan(size, sweep, display)?)),
            Method::Auto(sweep, network) => {
                // Both methods end at the midpoint, as the network does.
                let sweep = SweepPlan::new(size, display, sweep, 0.0)?;
                let trained = MethodPlan::new(size, Method::trained(network), display)?;
                Plan::Auto(Box::new(sweep), Box::new(trained.plan))
            }
        };
        Ok(MethodPlan {
            size,
            colours: display.colours(),
            planes,
            plan,
        })
    }

    /// Returns the size of a frame.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Returns the position of the hologram in metres from the midpoint toward the viewer. A sweep continues to the
    /// display if that is close enough, a network of any form where its file says; all other methods end at the
    /// midpoint.
    pub fn z_m(&self) -> f64 {
        match &self.plan {
            Plan::Network(plan) => plan.z_m(),
            Plan::Seeded(_) | Plan::Auto(..) => 0.0,
            Plan::Sweep(plan) => plan.z_m(),
        }
    }

    /// Returns whether the method gives the modulator's phase, which is shown as it is ([`Encoding::Phase`]).
    ///
    /// [`Encoding::Phase`]: crate::encode::Encoding::Phase
    pub(crate) fn gives_phase(&self) -> bool {
        matches!(&self.plan, Plan::Network(plan) if plan.gives_phase())
    }

    /// Returns the engine that runs the network and why it was chosen. Returns `None` for a method without a network.
    pub fn engine(&self) -> Option<&Engine> {
        self.plan.engine()
    }

    /// Returns the instruction set of the plane sweep. Returns `None` for a method without one.
    pub fn swept_on(&self) -> Option<Isa> {
        match &self.plan {
            Plan::Network(_) => None,
            Plan::Sweep(plan) | Plan::Auto(plan, _) => Some(plan.isa()),
            Plan::Seeded(plan) => Some(plan.swept_on()),
        }
    }

    /// Returns working memory for one frame at a time.
    pub fn scratch(&self) -> MethodScratch {
        MethodScratch {
            of_plan: self.plan.scratch(),
            standing: None,
        }
    }

    /// Writes the hologram of `frame`, without the carrier, at [`MethodPlan::z_m`] into `field`, (C, H, W).
    ///
    /// # Errors
    /// Returns an error if the frame has another shape or other colours, or if `field` does not have C·H·W values.
    ///
    /// # Panics
    /// Panics if `scratch` belongs to another plan.
    pub fn field(&self, frame: &RgbdFrame, field: &mut [Complex32], scratch: &mut MethodScratch) -> Result<()> {
        self.choose(None, frame, scratch)?;
        self.field_as_chosen(None, frame, MeanPhase::Kept, field, scratch)
    }

    /// Lets what stands still in a video keep its wave. Seeded networks and those on tract compute all of each frame.
    pub(crate) fn keep_standing(&self, scratch: &mut MethodScratch) {
        self.plan.keep(self.colours * self.size.pixels(), &mut scratch.of_plan);
        scratch.standing = Some(Box::new(Standing::new(self.colours, self.size, self.planes)));
    }

    /// Chooses the method of `frame` where the depth decides ([`Method::Auto`]). The `past` of a frame in a video keeps
    /// the choice from switching back and forth. Afterwards [`MethodScratch::is_swept`] tells the choice.
    ///
    /// # Errors
    /// Returns an error if the frame has another shape or other colours.
    pub(crate) fn choose(&self, past: Option<Past>, frame: &RgbdFrame, scratch: &mut MethodScratch) -> Result<()> {
        frame.check(self.size, self.colours)?;
        let MethodScratch { of_plan, standing } = scratch;
        if let Scratch::Auto { was_soft, .. } = of_plan {
            let was = was_soft.filter(|_| past.is_some());
            let is_soft = softness::is_soft(softness::sharp_edges(frame), was);
            if let (Some(standing), true) = (standing, was_soft.replace(is_soft) != Some(is_soft)) {
                standing.forget();
            }
        }
        Ok(())
    }

    /// Works like [`Self::field`] after [`Self::choose`], for a frame that follows another if there is a `past`. It can
    /// remove the mean phase of each colour.
    pub(crate) fn field_as_chosen(
        &self,
        past: Option<Past>,
        frame: &RgbdFrame,
        mean_phase: MeanPhase,
        field: &mut [Complex32],
        scratch: &mut MethodScratch,
    ) -> Result<()> {
        if scratch.makes_waves() {
            self.wave_as_chosen(past, frame, mean_phase, scratch)?.write(field);
            return Ok(());
        }
        match self.plan.chosen(&mut scratch.of_plan) {
            Chosen::Network(plan, scratch, _) => plan.field(frame, field, scratch)?,
            Chosen::Sweep(plan, scratch) => plan.field(frame, field, scratch)?,
            Chosen::Seeded(plan, scratch) => plan.field(frame, field, scratch)?,
        }
        if mean_phase == MeanPhase::Removed {
            remove_mean_phase(field, self.colours);
        }
        Ok(())
    }

    /// Returns the wave of `frame` after [`Self::choose`], like [`Self::field_as_chosen`]. What stands still keeps its
    /// wave after [`Self::keep_standing`]. The wave of a frame that is given up is unspecified.
    ///
    /// # Panics
    /// Panics if the choice makes no wave ([`MethodScratch::makes_waves`]).
    pub(crate) fn wave_as_chosen<'a>(
        &self,
        past: Option<Past>,
        frame: &RgbdFrame,
        mean_phase: MeanPhase,
        scratch: &'a mut MethodScratch,
    ) -> Result<Wave<'a>> {
        let MethodScratch { of_plan, standing } = scratch;
        let (mut shown, mut changes) = (frame, None);
        if let Some(standing) = standing {
            standing.show(frame, past.is_some());
            (shown, changes) = (&standing.frame, Some(&standing.changes));
        }
        // The sweep also knows which hidden surfaces have changed.
        let (is_whole, pixels, of_surfaces, reach) = match self.plan.chosen(of_plan) {
            Chosen::Sweep(plan, scratch) => {
                let is_whole = plan.sweep_where(changes, shown, scratch)?;
                (is_whole, scratch.wave(), Some(scratch.changes()), plan.reach())
            }
            Chosen::Network(plan, scratch, kept) => {
                let is_whole = plan.field_where(changes, shown, kept, scratch)?;
                (is_whole, Pixels::Float(kept), None, plan.reach().unwrap_or_default())
            }
            Chosen::Seeded(..) => panic!("a seeded network makes no wave"),
        };
        let size = self.size.pixels();
        let mut turns = [Complex32::ONE; 3];
        let is_turned = is_whole && mean_phase == MeanPhase::Removed;
        let mut changed = None;
        match standing {
            Some(standing) => {
                standing.finish(is_whole);
                if is_turned {
                    turns = standing.turns(of_surfaces, reach, |colour, differs, sums| {
                        pixels.turn_where(colour, size, differs, sums)
                    });
                }
                changed = Some(Changed {
                    changes: of_surfaces.unwrap_or(&standing.changes),
                    reach,
                    number: standing.number(),
                });
            }
            None if is_turned => {
                let turns = turns[..self.colours].iter_mut().enumerate();
                turns.for_each(|(colour, turn)| *turn = pixels.turn_of(colour, size));
            }
            None => {}
        }
        Ok(Wave {
            pixels,
            size: self.size,
            turns,
            changed,
            is_whole,
        })
    }
}

/// Checks that `network` takes `input`.
fn check_input(network: &Network, input: InputKind) -> Result<()> {
    if network.input() != input {
        return Err(Error::Network(format!(
            "its input is '{}'; this method needs a network for '{input}'",
            network.input()
        )));
    }
    Ok(())
}
