//! Trust, then use: a small frame on the device beside the same on the CPU.

use super::chain::Numbers;
use super::device::Device;
use super::input::Frame;
use super::pipeline::{Job, Pipeline};
use super::{Error, Result};
use crate::frame::RgbdFrame;
use crate::slm::Response;
use ndarray::{Array2, Array3};
use num_complex::Complex32;
use std::sync::Arc;

/// Rows and columns of the frame: odd, and more than one tile of every program.
const SIZE: (usize, usize) = (37, 43);

/// Runs a small frame of `job` on `device` and on the CPU and compares their phases.
///
/// # Errors
/// [`Error::Wrong`] where they differ by more than the numbers' rounding, [`Error::Lost`] where no answer comes, and
/// what [`Pipeline::new`] refuses.
pub fn probe(device: &Arc<Device>, job: &Job) -> Result<()> {
    let (height, width) = SIZE;
    let job = Job {
        height,
        width,
        colour: super::Colour::Planar,
        depth: super::Depth::F32,
        ..job.clone()
    };
    let frame = frame()?;
    let cpu = crate::Pipeline::new(
        height,
        width,
        job.method.clone(),
        &job.display,
        job.encoding.clone(),
        job.scale,
        job.response.clone(),
    )?;
    let mut field = vec![Complex32::ZERO; 3 * height * width];
    let mut expected = vec![0; 3 * height * width];
    cpu.process(&frame, &mut field, &mut expected, &mut cpu.scratch())?;
    let mut gpu = Pipeline::new(device, &job)?;
    let mut levels = vec![0; 3 * height * width];
    // Twice: what one frame leaves behind must not reach the next.
    for _ in 0..2 {
        gpu.process(&Frame::of(&frame), &mut levels)?;
        let apart = apart(&levels, &expected, &job.response);
        let most = match Numbers::of(device, job.network()?.chain(), job.chain.float)? {
            Numbers::F16 => 0.1,
            _ => 0.01,
        };
        if apart > most {
            return Err(Error::Wrong(format!(
                "{}: phases of a small frame differ from the CPU's by {apart:.3} on average, {most} are right",
                gpu.describe()
            )));
        }
    }
    Ok(())
}

/// The mean of |exp(iφ) − exp(iφ')| of two frames' levels.
pub(super) fn apart(levels: &[u8], others: &[u8], response: &Response) -> f32 {
    let shown: [Complex32; 256] =
        std::array::from_fn(|l| Complex32::from_polar(1.0, response.phase(l as u8, 0)));
    let sum: f32 = levels
        .iter()
        .zip(others)
        .map(|(&a, &b)| (shown[usize::from(a)] - shown[usize::from(b)]).norm())
        .sum();
    sum / levels.len() as f32
}

/// Waves of several lengths in colour, steps and a ramp in depth.
fn frame() -> Result<RgbdFrame> {
    let (height, width) = SIZE;
    let rgb = Array3::from_shape_fn((3, height, width), |(c, y, x)| {
        let phase = (c + 1) as f32 * 0.13 * x as f32 + 0.21 * y as f32;
        0.5 + 0.45 * phase.sin()
    });
    let depth = Array2::from_shape_fn((height, width), |(y, x)| match y < height / 2 {
        true => (x / 9) as f32 / 5.0,
        false => x as f32 / width as f32,
    });
    Ok(RgbdFrame::new(rgb, depth)?)
}
