//! One RGB-D frame through all stages: network, offset, phase encoding, levels, with the time of
//! each. Many frames are a session's work.

use crate::display::Display;
use crate::encode::{Encoding, Scale};
use crate::error::{Error, Result};
use crate::frame::RgbdFrame;
use crate::modulator::{Modulation, Modulator, ModulatorScratch, remove_mean_phase};
use crate::network::{Head, InputKind, Network, NetworkPlan, NetworkScratch};
use crate::slm::Response;
use num_complex::Complex32;
use std::time::{Duration, Instant};

/// How far a display may lie from what a network was trained for, relative.
const DISPLAY_TOLERANCE: f64 = 0.02;

/// A plan for one network, frame shape and display. Immutable; shared between threads.
pub struct Pipeline {
    shape: (usize, usize),
    network: NetworkPlan,
    head: Head,
    modulator: Modulator,
}

/// Working memory of a [`Pipeline`] for one frame at a time.
pub struct PipelineScratch {
    input: Vec<f32>,
    output: Vec<f32>,
    network: NetworkScratch,
    modulator: ModulatorScratch,
}

/// How long each stage of a frame took.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageTimes {
    /// The network, its input and head included.
    pub network: Duration,
    /// From the midpoint to the modulator.
    pub propagate: Duration,
    /// From the field to levels.
    pub encode: Duration,
}

impl StageTimes {
    /// All stages together.
    pub fn total(&self) -> Duration {
        self.network + self.propagate + self.encode
    }
}

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameReport {
    /// The amplitude that full light stands for.
    pub scale: f32,
    /// How long it took.
    pub times: StageTimes,
}

impl Pipeline {
    /// Plans (`height`, `width`) frames through `network` to `display`, whose response is `response`.
    ///
    /// # Errors
    /// A network for layered input or for another display, or what [`Modulator::new`] refuses.
    pub fn new(
        height: usize,
        width: usize,
        network: &Network,
        display: &Display,
        encoding: Encoding,
        scale: Scale,
        response: Response,
    ) -> Result<Self> {
        if network.input() != InputKind::Rgbd {
            return Err(Error::Network(format!(
                "it takes {} planes of a layered depth image; a network for RGB-D frames is needed",
                network.input().channels()
            )));
        }
        check_display(network, display)?;
        Ok(Pipeline {
            shape: (height, width),
            network: network.plan(height, width)?,
            head: network.head(),
            modulator: Modulator::new(height, width, display, encoding, scale, response)?,
        })
    }

    /// (H, W).
    pub fn shape(&self) -> (usize, usize) {
        self.shape
    }

    /// The network's plan: which path runs it, and why.
    pub fn network(&self) -> &NetworkPlan {
        &self.network
    }

    /// Working memory for one frame at a time.
    pub fn scratch(&self) -> PipelineScratch {
        let size = self.shape.0 * self.shape.1;
        let (inputs, outputs) = self.network.channels();
        PipelineScratch {
            input: vec![0.0; inputs * size],
            output: vec![0.0; outputs * size],
            network: self.network.scratch(),
            modulator: self.modulator.scratch(),
        }
    }

    /// The field at the modulator, into `field`, (3, H, W): network, mean phase taken out, offset. Gives
    /// the times of the network and of the offset.
    ///
    /// # Errors
    /// A frame of another shape.
    pub fn field(
        &self,
        frame: &RgbdFrame,
        field: &mut [Complex32],
        scratch: &mut PipelineScratch,
    ) -> Result<(Duration, Duration)> {
        if frame.shape() != self.shape {
            return Err(Error::Frame(format!(
                "the frame is {}×{}; this plan takes {}×{}",
                frame.shape().1,
                frame.shape().0,
                self.shape.1,
                self.shape.0
            )));
        }
        let start = Instant::now();
        frame.network_input(&mut scratch.input);
        self.network
            .run(&scratch.input, &mut scratch.output, &mut scratch.network)?;
        self.head.field(&scratch.output, &scratch.input, field)?;
        remove_mean_phase(field);
        let predicted = Instant::now();
        self.modulator.propagate(field, &mut scratch.modulator);
        Ok((predicted - start, predicted.elapsed()))
    }

    /// Encodes a field at the modulator, (3, H, W), into `levels`, as [`Modulator::modulate`].
    ///
    /// # Panics
    /// If `field` or `levels` has not 3·H·W values.
    pub fn modulate(
        &self,
        field: &mut [Complex32],
        levels: &mut [u8],
        scratch: &mut PipelineScratch,
    ) -> Modulation {
        self.modulator
            .modulate(field, levels, &mut scratch.modulator)
    }

    /// One frame: its field into `field` and its levels into `levels`, both (3, H, W). `field` is left as
    /// the encoder's filter made it.
    ///
    /// # Errors
    /// A frame of another shape.
    ///
    /// # Panics
    /// If `levels` has not 3·H·W values.
    pub fn process(
        &self,
        frame: &RgbdFrame,
        field: &mut [Complex32],
        levels: &mut [u8],
        scratch: &mut PipelineScratch,
    ) -> Result<FrameReport> {
        let (network, propagate) = self.field(frame, field, scratch)?;
        let modulation = self.modulate(field, levels, scratch);
        Ok(FrameReport {
            scale: modulation.scale,
            times: StageTimes {
                network,
                propagate,
                encode: modulation.encode,
            },
        })
    }
}

/// Checks that `network` was trained for a display like `display`: on another it gives wrong depths.
///
/// # Errors
/// A pitch, wavelength or volume that differs by over 2 %.
pub fn check_display(network: &Network, display: &Display) -> Result<()> {
    let trained = network.display();
    let pairs = [
        ("pitch", "µm", 1e6, trained.pitch_m, display.pitch_m()),
        (
            "volume depth",
            "mm",
            1e3,
            trained.volume_depth_m,
            display.volume_depth_m(),
        ),
    ];
    let colours = trained
        .wavelengths_m
        .into_iter()
        .zip(display.wavelengths_m())
        .map(|(trained, given)| ("wavelength", "nm", 1e9, trained, given));
    for (what, unit, scale, trained, given) in pairs.into_iter().chain(colours) {
        if (trained - given).abs() > DISPLAY_TOLERANCE * trained {
            return Err(Error::Network(format!(
                "it was trained for a {what} of {:.3} {unit}, the display has {:.3}; train one for this display, or use a method without a network",
                trained * scale,
                given * scale
            )));
        }
    }
    Ok(())
}
