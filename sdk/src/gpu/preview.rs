//! What an eye focused at z would see of a modulator's levels, without leaving the GPU: for previews. The twin of
//! [`crate::refocus`].

use super::device::{Device, Dispatch};
use super::encode::Target;
use super::fft::{Convolution, Planes};
use super::{Error, Result};
use crate::display::Display;
use crate::slm::Response;
use crate::wave::asm::{Padding, Transfer, padded_shape};
use crate::wave::{aperture, aperture::Aperture};
use num_complex::Complex32;
use std::sync::Arc;

/// Columns of a workgroup.
const COLUMNS: usize = 64;

/// A plan for one shape, display and reach of z: all buffers and programs are made with it.
pub struct Preview {
    device: Arc<Device>,
    size: (usize, usize),
    display: Display,
    padded: (usize, usize),
    aperture_radius: f64,
    reach_m: f64,
    levels: wgpu::Buffer,
    shine: Dispatch,
    convolution: Convolution,
    see: Dispatch,
    picture: wgpu::Texture,
    amplitudes: wgpu::Buffer,
    /// The z that the convolution is for.
    z_m: Option<f64>,
}

impl Preview {
    /// Plans views of (`height`, `width`) levels on a modulator at `display.offset_m()`, from z up to `reach_m` away
    /// from it, through a Fourier aperture of `aperture_radius` (1: the whole first order).
    ///
    /// # Errors
    /// A table for each pixel, a reach or radius that [`crate::refocus::Refocus::new`] refuses, or what `device` cannot do.
    #[allow(clippy::too_many_arguments)]
    pub fn new(
        device: &Arc<Device>,
        height: usize,
        width: usize,
        display: &Display,
        response: &Response,
        reach_m: f64,
        aperture_radius: f64,
    ) -> Result<Self> {
        Aperture::new(1, 1, aperture_radius)?;
        if matches!(response, Response::PerPixel(_)) {
            return Err(Error::Refused(
                "what a table for each pixel shows is looked at on the CPU only".into(),
            ));
        }
        let longest = display.wavelengths_m().into_iter().fold(0.0, f64::max);
        let (pitch_m, padding) = (display.pitch_m(), Padding::Reach);
        let padded = padded_shape(height, width, pitch_m, longest, reach_m, padding)?;
        device.guarded(|| {
            let area = height * width;
            let frame = [width, height, area, 0].map(|n| n as u32);
            let frame = device.constants("frame", bytemuck::cast_slice(&frame))?;
            let shown: Vec<Complex32> = (0..=255)
                .map(|level| Complex32::from_polar(1.0, response.phase(level, 0)))
                .collect();
            let shown = device.table("phases", bytemuck::cast_slice(&shown))?;
            let levels = device.buffer("levels", 4 * area)?;
            let field = device.buffer("the field", 24 * area)?;
            let amplitudes = device.buffer("amplitudes", 16 * area)?;
            let picture = Target::new(device, (height, width))?.texture;
            let source = include_str!("preview.wgsl");
            let grid = [width.div_ceil(COLUMNS), height, 1];
            let shine = device.program("the light", source.into(), "shine").on(
                device,
                &[
                    (0, frame.buffer.as_entire_binding()),
                    (1, shown.buffer.as_entire_binding()),
                    (2, levels.as_entire_binding()),
                    (3, field.as_entire_binding()),
                ],
                grid,
            )?;
            let view = picture.create_view(&Default::default());
            let see = device.program("the eye", source.into(), "see").on(
                device,
                &[
                    (0, frame.buffer.as_entire_binding()),
                    (4, field.as_entire_binding()),
                    (5, wgpu::BindingResource::TextureView(&view)),
                    (6, amplitudes.as_entire_binding()),
                ],
                grid,
            )?;
            let quadrant = vec![Complex32::ZERO; (padded.0 / 2 + 1) * (padded.1 / 2 + 1)];
            let planes = Planes {
                field: &field,
                size: (height, width),
                padded,
                factors: &[&quadrant, &quadrant, &quadrant],
                turn: None,
            };
            Ok(Preview {
                device: device.clone(),
                size: (height, width),
                display: display.clone(),
                padded,
                aperture_radius,
                reach_m,
                levels,
                shine,
                convolution: Convolution::new(device, &planes)?,
                see,
                picture,
                amplitudes,
                z_m: None,
            })
        })
    }

    /// Looks at `levels`, (H, W) words as [`super::Pipeline::levels`] has them, from z = `z_m`. Full light is 1. Another z
    /// than the last one costs the CPU a transfer function.
    ///
    /// # Errors
    /// A z beyond the planned reach; [`Error::Lost`].
    pub fn look(&mut self, levels: &wgpu::Buffer, z_m: f64) -> Result<&wgpu::Texture> {
        let distance_m = z_m - self.display.offset_m();
        if distance_m.is_nan() || distance_m.abs() > self.reach_m * (1.0 + 1e-9) {
            return Err(crate::Error::Plan(format!(
                "z = {} mm is {} mm from the modulator; the plan reaches {} mm",
                z_m * 1e3,
                distance_m.abs() * 1e3,
                self.reach_m * 1e3
            ))
            .into());
        }
        if levels.size() < (4 * self.size.0 * self.size.1) as u64 {
            return Err(Error::Refused(format!(
                "{} bytes of levels are too few for {}×{}",
                levels.size(),
                self.size.1,
                self.size.0
            )));
        }
        let device = self.device.clone();
        device.guarded(|| {
            if self.z_m != Some(z_m) {
                self.convolution.set(&device, &self.transfers(distance_m));
                self.z_m = Some(z_m);
            }
            let mut encoder = device.inner.create_command_encoder(&Default::default());
            let bytes = (4 * self.size.0 * self.size.1) as u64;
            encoder.copy_buffer_to_buffer(levels, 0, &self.levels, 0, bytes);
            let mut pass = encoder.begin_compute_pass(&Default::default());
            self.shine.run(&mut pass);
            self.convolution.run(&mut pass);
            self.see.run(&mut pass);
            drop(pass);
            device.queue.submit([encoder.finish()]);
            Ok(())
        })?;
        Ok(&self.picture)
    }

    /// The amplitudes of the last look, (3, H, W), on the CPU.
    ///
    /// # Errors
    /// [`Error::Lost`].
    pub fn amplitudes(&self) -> Result<Vec<f32>> {
        let area = self.size.0 * self.size.1;
        let bytes = self.device.read(&self.amplitudes, 16 * area)?;
        let pixels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&bytes);
        Ok((0..3)
            .flat_map(|c| pixels.iter().map(move |pixel| pixel[c]))
            .collect())
    }

    fn transfers(&self, distance_m: f64) -> Vec<Complex32> {
        let pitch_m = self.display.pitch_m();
        let pass =
            |mu: f64, nu: f64| aperture::passes(mu * pitch_m, nu * pitch_m, self.aperture_radius);
        self.display
            .wavelengths_m()
            .into_iter()
            .flat_map(|wavelength_m| {
                let transfer = Transfer::new(self.padded, pitch_m, wavelength_m, distance_m, pass);
                transfer.factors().to_vec()
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::device::testing::device;
    use super::*;
    use crate::refocus::{Refocus, phase_only_field};

    #[test]
    fn an_eye_sees_what_it_sees_on_the_cpu() {
        let Some(device) = device() else { return };
        for (size, all_z_m) in [
            ((61, 47), &[3e-3, -3e-3, 2e-3][..]),
            ((384, 384), &[-2e-3][..]),
            ((540, 960), &[1e-3][..]),
        ] {
            check(&device, size, all_z_m);
        }
    }

    fn check(device: &Arc<Device>, (height, width): (usize, usize), all_z_m: &[f64]) {
        let display = Display::default().with_offset_m(2e-3).unwrap();
        let response = Response::lut(std::array::from_fn(|i| 255 - i as u8));
        let words: Vec<u32> = (0..height * width)
            .map(|i| (i as u32).wrapping_mul(0x9e37_79b9) >> 3)
            .collect();
        let levels = device.buffer("levels", 4 * height * width).unwrap();
        device
            .queue
            .write_buffer(&levels, 0, bytemuck::cast_slice(&words));
        let mut preview =
            Preview::new(device, height, width, &display, &response, 5e-3, 1.0).unwrap();
        let planes: Vec<u8> = (0..3)
            .flat_map(|c| words.iter().map(move |word| (word >> (8 * c)) as u8))
            .collect();
        let mut field = vec![Complex32::ZERO; planes.len()];
        phase_only_field(&planes, &response, 1.0, &mut field);
        for &z_m in all_z_m {
            preview.look(&levels, z_m).unwrap();
            let seen = preview.amplitudes().unwrap();
            let twin = Refocus::new(height, width, &display, &[-3e-3, 7e-3], Some(1.0)).unwrap();
            let expected = &twin.focal_stack(&field, &[z_m]).unwrap()[0];
            let worst = seen.iter().zip(expected).map(|(a, b)| (a - b).abs());
            assert!(worst.fold(0.0, f32::max) < 1e-4, "{height}×{width} {z_m}");
        }
        assert!(preview.look(&levels, 8e-3).is_err());
        assert!(preview.look(&levels, f64::NAN).is_err());
    }
}
