//! Seeded networks: the plane sweep's field, corrected by a small network that sees it beside the frame.
//!
//! The sweep is nearly exact on clean depth, and wrong at edges of noisy or incomplete depth; the network has
//! learned on both how far to trust it. Its input is RGB-D, each value minus ½, and behind it the seed u: ½(Re u − ½)
//! of the three colours, then ½ Im u, so that one range of 8 bits holds all. Its head adds the output to u.

use crate::display::Display;
use crate::frame::RgbdFrame;
use crate::method::network::{Engine, Network, NetworkPlan, NetworkScratch, Source};
use crate::method::sweep::{Sweep, SweepPlan, SweepScratch};
use crate::runtime::cancel::Cancel;
use crate::runtime::error::Result;
use num_complex::Complex32;

/// The sweep whose field `network` was trained to correct: of as many planes as its file says, or else what suits
/// `display`.
pub fn seed(network: &Network, display: &Display) -> Sweep {
    match network.seed_planes() {
        Some(planes) => Sweep::of_planes(display, planes),
        None => Sweep::for_display(display),
    }
}

/// A plan of a seeded network for one frame shape and display. Immutable; shared between threads.
pub struct SeededPlan {
    colours: usize,
    sweep: SweepPlan,
    network: NetworkPlan,
}

/// Working memory of a [`SeededPlan`] for one frame at a time.
pub struct SeededScratch {
    /// (C, H, W).
    seed: Vec<Complex32>,
    sweep: SweepScratch,
    network: NetworkScratch,
}

impl SeededScratch {
    /// Has frames end where `cancel` is requested.
    pub fn set_cancel(&mut self, cancel: &Cancel) {
        self.sweep.set_cancel(cancel);
        self.network.set_cancel(cancel);
    }
}

impl SeededPlan {
    /// Plans `network`, whose input is [`crate::method::network::InputKind::Seeded`], for (`height`, `width`) frames,
    /// on the field of its [`seed`] at the midpoint.
    ///
    /// # Errors
    /// A network or a sweep that cannot be planned.
    pub fn new(height: usize, width: usize, network: &Network, display: &Display) -> Result<Self> {
        let sweep = seed(network, display);
        Ok(SeededPlan {
            colours: display.colours(),
            sweep: SweepPlan::new(height, width, display, sweep, 0.0)?,
            network: network.plan_for(height, width, display)?,
        })
    }

    /// What runs the network, and why.
    pub fn engine(&self) -> &Engine {
        self.network.engine()
    }

    /// Working memory for one frame at a time, for the current thread pool.
    pub fn scratch(&self) -> SeededScratch {
        let (height, width) = self.sweep.shape();
        SeededScratch {
            seed: vec![Complex32::ZERO; self.colours * height * width],
            sweep: self.sweep.scratch(),
            network: self.network.scratch(),
        }
    }

    /// The midpoint hologram of `frame`, carrier-free, into `field`, (C, H, W). After the first frame nothing is
    /// allocated.
    ///
    /// # Errors
    /// A frame of another shape or of other colours, or a `field` that has not C·H·W values.
    pub fn field(&self, frame: &RgbdFrame, field: &mut [Complex32], scratch: &mut SeededScratch) -> Result<()> {
        self.sweep.field(frame, &mut scratch.seed, &mut scratch.sweep)?;
        let seeded = SeededFrame {
            frame,
            seed: &scratch.seed,
        };
        self.network.field(&seeded, field, &mut scratch.network)
    }
}

/// A frame and its seed, (C, H, W), as a seeded network reads them.
pub struct SeededFrame<'a> {
    /// The frame.
    pub frame: &'a RgbdFrame,
    /// The sweep's field of it.
    pub seed: &'a [Complex32],
}

/// Planes of RGB-D.
const RGBD: usize = 4;

impl Source for SeededFrame<'_> {
    fn read(&self, plane: usize, row: usize, from: usize, into: &mut [f32]) {
        let Some(part) = plane.checked_sub(RGBD) else {
            return self.frame.read(plane, row, from, into);
        };
        let (height, width) = self.frame.shape();
        let at = ((part % 3 % self.frame.colours()) * height + row) * width + from;
        let values = into.iter_mut().zip(&self.seed[at..]);
        match part / 3 {
            0 => values.for_each(|(to, u)| *to = 0.5 * (u.re - 0.5)),
            _ => values.for_each(|(to, u)| *to = 0.5 * u.im),
        }
    }
}
