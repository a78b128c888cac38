//! Checks a device by comparing small frames with the CPU's.

use super::device::Device;
use super::input::{Colour, ColourData, Depth, DepthData, Frame};
use super::pipeline::{Deliver, GpuPipeline, Job};
use super::{GpuError, Result};
use ndarray::{Array2, Array3};
use num_complex::Complex32;
use phasefront_core::Size;
use phasefront_core::depth::condition::Conditioner;
use phasefront_core::display::response::Response;
use phasefront_core::display::target::Target;
use phasefront_core::encode::EncoderOptions;
use phasefront_core::frame::{Crop, RgbdFrame};
use phasefront_core::method::Method;
use phasefront_core::pipeline::Pipeline;
use std::sync::Arc;

/// The rows and columns of the frame: odd, and more than one tile of every program.
const SIZE: Size = Size { width: 43, height: 37 };
/// The rows and columns of the readings that become the depth of such a frame.
const READINGS: Size = Size { width: 11, height: 9 };
/// The most steps of natural focus. More run the same programs.
const FOCUS_STEPS: usize = 2;

/// Runs small frames of `job`, with depth of their size and with readings, on `device` and on the CPU and compares
/// their phases. Tries both methods of an automatic choice.
///
/// # Errors
/// Returns [`GpuError::Wrong`] if the phases differ by more than the rounding of the numbers, [`GpuError::Lost`] if the
/// device does not respond, and the errors of [`GpuPipeline::new_async`].
pub async fn probe_async(device: &Arc<Device>, job: &Job) -> Result<()> {
    let methods = match &job.method {
        Method::Auto(sweep, network) => vec![Method::Sweep(*sweep), Method::trained(network.clone())],
        method => vec![method.clone()],
    };
    for method in methods {
        compare_small(device, &Job { method, ..job.clone() }).await?;
    }
    Ok(())
}

async fn compare_small(device: &Arc<Device>, job: &Job) -> Result<()> {
    let job = Job {
        size: SIZE,
        target: Target {
            // A per-pixel table fits only one frame size.
            response: match &job.target.response {
                Response::PerPixel(_) => Response::Linear { bits: 8 },
                other => other.clone(),
            },
            ..job.target.clone()
        },
        encoder: EncoderOptions {
            focus_steps: job.encoder.focus_steps.min(FOCUS_STEPS),
            ..job.encoder.clone()
        },
        colour: Colour::Planar,
        depth: Depth::F32,
        ..job.clone()
    };
    // The GPU goes first, so that its errors are known before the CPU works.
    let mut gpu = GpuPipeline::new_async(device, &job).await?;
    let (mut frame, cpu) = (frame()?, job.on_cpu()?);
    // Two frames, because the state that one leaves must not affect the next.
    let twice = [Frame::of(&frame); 2];
    compare(&mut gpu, &twice, &on_cpu(&cpu, &frame)?, &job.target.response).await?;
    let rgb = frame.values().0.to_vec();
    let plan = Conditioner::new(READINGS, Crop::cover(READINGS, SIZE), SIZE, true)?;
    let mut scratch = plan.scratch();
    plan.find(&readings(), &rgb, &mut scratch)?;
    plan.decide(&rgb, frame.planes_mut().1, &mut scratch);
    gpu.expect_async(Colour::Planar, Depth::Readings(READINGS)).await?;
    let given = Frame {
        colour: ColourData::Planar(&rgb),
        depth: DepthData::Readings(plan.readings(&scratch)),
    };
    compare(&mut gpu, &[given], &on_cpu(&cpu, &frame)?, &job.target.response).await
}

/// Returns the CPU's levels.
fn on_cpu(cpu: &Pipeline, frame: &RgbdFrame) -> Result<Vec<u8>> {
    let mut levels = vec![0; 3 * SIZE.pixels()];
    cpu.process(frame, &mut levels, &mut cpu.scratch())?;
    Ok(levels)
}

/// Compares the phases of each of the frames with those of the `expected` levels.
async fn compare(gpu: &mut GpuPipeline, frames: &[Frame<'_>], expected: &[u8], response: &Response) -> Result<()> {
    let mut levels = vec![0; expected.len()];
    for frame in frames {
        let ticket = gpu.submit_async(None, frame, Deliver::Levels).await?;
        gpu.collect_async(ticket, &mut levels).await?;
        let apart = apart(&levels, expected, response);
        let most = if gpu.numbers() == "f16" { 0.1 } else { 0.01 };
        if apart > most {
            return Err(GpuError::Wrong(format!(
                "{}: phases of a small frame differ from the CPU's by {apart:.3} on average, {most} are right",
                gpu.describe()
            )));
        }
    }
    Ok(())
}

/// Returns the mean of |exp(iφ) − exp(iφ')| for the levels of two frames.
pub(super) fn apart(levels: &[u8], others: &[u8], response: &Response) -> f32 {
    let shown: [Complex32; 256] = std::array::from_fn(|l| Complex32::from_polar(1.0, response.phase(l as u8, 0)));
    let sum: f32 = levels
        .iter()
        .zip(others)
        .map(|(&a, &b)| (shown[usize::from(a)] - shown[usize::from(b)]).norm())
        .sum();
    sum / levels.len() as f32
}

/// Creates a frame with waves of several lengths in colour, and steps and a ramp in depth.
fn frame() -> Result<RgbdFrame> {
    let Size { width, height } = SIZE;
    let rgb = Array3::from_shape_fn((3, height, width), |(c, y, x)| {
        let phase = (c + 1) as f32 * 0.13 * x as f32 + 0.21 * y as f32;
        0.5 + 0.45 * phase.sin()
    });
    let depth = Array2::from_shape_fn((height, width), |(y, x)| {
        if y < height / 2 {
            (x / 9) as f32 / 5.0
        } else {
            x as f32 / width as f32
        }
    });
    Ok(RgbdFrame::new(rgb, depth)?)
}

/// Creates readings of two surfaces with mixed readings between them, and holes.
fn readings() -> Vec<f32> {
    let Size { width, height } = READINGS;
    let reading = |i: usize| match (i / width, i % width) {
        (2, 7) => f32::NAN,
        (_, x) if 2 * x < width => 0.1 + 0.01 * x as f32,
        (y, x) if 2 * x < width + 2 => 0.3 + 0.05 * y as f32,
        _ => 0.9,
    };
    (0..height * width).map(reading).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::device::DeviceOptions;
    use super::super::device::testing::{opened, software};
    use super::super::renderer::Renderer;
    use super::*;
    use crate::probe;
    use phasefront_core::display::Display;
    use phasefront_core::method::network::Network;
    use pollster::block_on;

    /// Checks that a driver that compiles one program wrongly is detected.
    #[test]
    fn a_device_that_answers_wrongly_is_not_used() {
        let network = Network::from_onnx(include_bytes!("../../../models/rgbd-8-int8.onnx"));
        let method = Method::Network(Arc::new(network.unwrap()));
        let job = Job::new(Size { width: 34, height: 21 }, method, Display::default());
        let source = include_str!("encode/mean_phase.wgsl");
        let forged = source.replace("turn[c] = select(", "turn[c] = vec2f(0, 1) + 0.0 * select(");
        assert_ne!(forged, source);
        let open = || Device::open(&software()).map(Arc::new);
        let device = opened(open());
        probe(&device, &job).unwrap();
        let device = open().unwrap();
        device.forge("find", source, &forged);
        let wrong = probe(&device, &job).unwrap_err();
        assert!(matches!(&wrong, GpuError::Wrong(why) if !why.contains('\n')), "{wrong}");
        let refused = block_on(Renderer::new(Some(device), DeviceOptions::default(), job));
        assert_eq!(refused.err().unwrap().to_string(), wrong.to_string());
    }
}
