//! Seeded networks. A small network corrects the plane sweep's field and reads it together with the frame.
//!
//! The sweep is nearly exact for clean depth, but wrong at edges of noisy or incomplete depth. The network was trained
//! on both and has learned how far to trust the sweep. Its input is RGB-D, each value minus ½, followed by the seed u:
//! ½(Re u − ½) of the three colours, then ½ Im u, so that all values share one 8-bit range. Its head adds the output to
//! u.

use crate::Size;
use crate::display::Display;
use crate::frame::RgbdFrame;
use crate::method::network::{Engine, Network, NetworkPlan, NetworkScratch, Source};
use crate::method::sweep::{Sweep, SweepPlan, SweepScratch};
use crate::runtime::cancel::Cancel;
use crate::runtime::error::Result;
use num_complex::Complex32;
use phasefront_kernels::Isa;

/// Returns the sweep that `network` was trained to correct. The number of planes is the one in the network's file, or
/// the default for `display`.
pub fn seed(network: &Network, display: &Display) -> Sweep {
    match network.seed_planes() {
        Some(planes) => Sweep::of_planes(display, planes),
        None => Sweep::for_display(display),
    }
}

/// A plan of a seeded network for one frame shape and display. It is immutable and can be shared between threads.
pub struct SeededPlan {
    colours: usize,
    sweep: SweepPlan,
    network: NetworkPlan,
}

/// The working memory of a [`SeededPlan`] for one frame at a time.
pub struct SeededScratch {
    /// The sweep's field, (C, H, W).
    seed: Vec<Complex32>,
    sweep: SweepScratch,
    network: NetworkScratch,
}

impl SeededScratch {
    /// Makes the computation stop early once `cancel` is requested.
    pub fn set_cancel(&mut self, cancel: &Cancel) {
        self.sweep.set_cancel(cancel);
        self.network.set_cancel(cancel);
    }
}

impl SeededPlan {
    /// Plans `network`, whose input is [`crate::method::network::InputKind::Seeded`], for frames of `size`, on the
    /// field of its [`seed`] at the midpoint.
    ///
    /// # Errors
    /// Returns an error if the network or the sweep cannot be planned.
    pub fn new(size: Size, network: &Network, display: &Display) -> Result<Self> {
        let sweep = seed(network, display);
        Ok(SeededPlan {
            colours: display.colours(),
            sweep: SweepPlan::new(size, display, sweep, 0.0)?,
            network: network.plan_for(size, display)?,
        })
    }

    /// Returns the engine that runs the network and the reason for the choice.
    pub fn engine(&self) -> &Engine {
        self.network.engine()
    }

    /// Returns the instruction set of the sweep.
    pub fn swept_on(&self) -> Isa {
        self.sweep.isa()
    }

    /// Returns working memory for one frame at a time, sized for the current thread pool.
    pub fn scratch(&self) -> SeededScratch {
        let Size { width, height } = self.sweep.size();
        SeededScratch {
            seed: vec![Complex32::ZERO; self.colours * height * width],
            sweep: self.sweep.scratch(),
            network: self.network.scratch(),
        }
    }

    /// Writes the midpoint hologram of `frame`, without the carrier, into `field`, (C, H, W). Allocates nothing after
    /// the first frame.
    ///
    /// # Errors
    /// Returns an error if the frame has another shape or other colours, or if `field` does not have C·H·W values.
    pub fn field(&self, frame: &RgbdFrame, field: &mut [Complex32], scratch: &mut SeededScratch) -> Result<()> {
        self.sweep.field(frame, &mut scratch.seed, &mut scratch.sweep)?;
        let seeded = SeededFrame {
            frame,
            seed: &scratch.seed,
        };
        self.network.field(&seeded, field, &mut scratch.network)
    }
}

/// A frame and its seed, (C, H, W), as the input of a seeded network.
pub struct SeededFrame<'a> {
    /// The frame.
    pub frame: &'a RgbdFrame,
    /// The sweep's field of the frame.
    pub seed: &'a [Complex32],
}

/// The number of RGB-D planes.
const RGBD: usize = 4;

impl Source for SeededFrame<'_> {
    fn read(&self, plane: usize, row: usize, from: usize, into: &mut [f32]) {
        let Some(part) = plane.checked_sub(RGBD) else {
            return self.frame.read(plane, row, from, into);
        };
        let Size { width, height } = self.frame.size();
        let at = ((part % 3 % self.frame.colours()) * height + row) * width + from;
        let values = into.iter_mut().zip(&self.seed[at..]);
        match part / 3 {
            0 => values.for_each(|(to, u)| *to = 0.5 * (u.re - 0.5)),
            _ => values.for_each(|(to, u)| *to = 0.5 * u.im),
        }
    }
}
