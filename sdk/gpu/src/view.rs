//! Renders what an eye sees of levels that stayed on the GPU: the counterpart of [`phasefront_core::view::preview`].

use super::device::{Constants, Device, Dispatch, Program};
use super::fft::{Convolution, Planes};
use super::pipeline::GpuLevels;
use super::{GpuError, Result};
use phasefront_core::Size;
use phasefront_core::view::colours::ViewColours;
use phasefront_core::view::preview::Preview;
use std::collections::HashMap;
use std::sync::Arc;

/// The columns of a workgroup.
const COLUMNS: usize = 64;

/// The programs and memory for views of one shape on screens of one size, at any z.
pub struct GpuView {
    device: Arc<Device>,
    /// The sizes of the hologram and of the screen.
    sizes: [Size; 2],
    small: Size,
    colours: ViewColours,
    /// (3, h, w) complex f32.
    field: wgpu::Buffer,
    sum: Program,
    lights: Constants,
    weights: Constants,
    /// The propagation of the small field by padded size. Neighbouring distances share it.
    propagations: HashMap<Size, Convolution>,
    scale: Constants,
    draw: Dispatch,
    image: wgpu::Texture,
}

impl GpuView {
    /// Plans views on the GPU of `levels` as `preview` has them on the CPU.
    ///
    /// # Errors
    /// Returns [`GpuError::Refused`] or [`GpuError::OutOfMemory`] if the device cannot have them, and if each pixel of
    /// the modulator responds differently.
    pub async fn new(levels: &GpuLevels, preview: &Preview) -> Result<Self> {
        let device = &levels.device;
        device.guarded_async(|| Self::build(device, levels.size, preview)).await
    }

    fn build(device: &Arc<Device>, size: Size, preview: &Preview) -> Result<Self> {
        let Some(lights) = preview.lights() else {
            return Err(GpuError::Refused(
                "a view of a modulator whose pixels respond differently, which is the CPU's".into(),
            ));
        };
        let (small, screen) = (preview.small(), preview.screen());
        let area = small.pixels();
        let [x, y] = preview.axes();
        let mut taps = Vec::new();
        let mut counts = [(0, 0); 2];
        for (axis, place) in [x, y].into_iter().zip(&mut counts) {
            let (starts, weights, count) = axis.tables();
            *place = (taps.len(), count);
            taps.extend_from_slice(starts);
            taps.extend(weights.iter().map(|weight| weight.to_bits()));
        }
        let matrix = preview.view_colours().matrix();
        let rows = matrix.unwrap_or_default();
        let columns: Vec<_> = (0..9).map(|i| format!("{:?}", rows[i % 3][i / 3])).collect();
        let header = format!(
            "const FACTOR: u32 = {}u;
            const WIDTH: u32 = {}u;
            const PLANE: u32 = {area}u;
            const SCREEN_WIDTH: u32 = {}u;
            const SCREEN_HEIGHT: u32 = {}u;
            const COUNT_X: u32 = {}u;
            const AT_Y: u32 = {}u;
            const COUNT_Y: u32 = {}u;
            const LIGHT: bool = {};
            const TO_SRGB: mat3x3f = mat3x3f({});
            ",
            preview.factor(),
            small.width,
            screen.width,
            screen.height,
            counts[0].1,
            counts[1].0,
            counts[1].1,
            matrix.is_some(),
            columns.join(", "),
        );
        let source = header + include_str!("view.wgsl");
        let field = device.buffer("a view's field", 3 * area * 8)?;
        let taps = device.table("a view's taps", bytemuck::cast_slice(&taps))?;
        let scale = device.constants("a view's scale", bytemuck::cast_slice(&[0.0f32; 4]))?;
        let image = device.picture("a view", screen, wgpu::TextureUsages::STORAGE_BINDING)?;
        let arguments = [
            (4, field.as_entire_binding()),
            (5, taps.buffer.as_entire_binding()),
            (6, scale.buffer.as_entire_binding()),
            (
                7,
                wgpu::BindingResource::TextureView(&image.create_view(&Default::default())),
            ),
        ];
        let draw = device.program("drawing a view", source.clone(), "draw");
        let draw = draw.on(device, &arguments, [screen.width.div_ceil(COLUMNS), screen.height, 1])?;
        Ok(GpuView {
            device: device.clone(),
            sizes: [size, screen],
            small,
            colours: *preview.view_colours(),
            field,
            sum: device.program("a view's light", source, "sum"),
            lights: device.table("levels' light", bytemuck::cast_slice(&lights))?,
            weights: device.table("weights of light", bytemuck::cast_slice(&preview.weights()))?,
            propagations: HashMap::new(),
            scale,
            draw,
            image,
        })
    }

    /// Checks whether this plan is for `levels` and the screen and the colours of `preview`, on the same device.
    pub fn fits(&self, levels: &GpuLevels, preview: &Preview) -> bool {
        Arc::ptr_eq(&self.device, &levels.device)
            && self.sizes == [levels.size, preview.screen()]
            && self.colours == *preview.view_colours()
    }

    /// Returns the device and the texture of the latest view, 8-bit RGBA of the screen's size.
    pub fn texture(&self) -> (&Arc<Device>, &wgpu::Texture) {
        (&self.device, &self.image)
    }

    /// Draws the view of `levels` at the z of `preview`, with amplitude `scale` as full light.
    ///
    /// # Errors
    /// Returns an error if the device cannot propagate that far, or [`GpuError::Lost`].
    ///
    /// # Panics
    /// Panics if [`Self::fits`] is false.
    pub async fn draw(&mut self, levels: &GpuLevels, preview: &Preview, scale: f32) -> Result<()> {
        assert!(self.fits(levels, preview));
        let device = self.device.clone();
        let draw = || {
            let commands = self.commands(&levels.texture, preview, scale)?;
            device.queue.submit([commands]);
            Ok(())
        };
        device.guarded_async(draw).await
    }

    fn commands(&mut self, levels: &wgpu::Texture, preview: &Preview, scale: f32) -> Result<wgpu::CommandBuffer> {
        let device = &self.device;
        let view = levels.create_view(&Default::default());
        let arguments = [
            (0, wgpu::BindingResource::TextureView(&view)),
            (1, self.lights.buffer.as_entire_binding()),
            (2, self.weights.buffer.as_entire_binding()),
            (3, self.field.as_entire_binding()),
        ];
        let Size { width, height } = self.small;
        let sum = self.sum.on(device, &arguments, [width.div_ceil(COLUMNS), height, 1])?;
        let scale = [scale; 4];
        device
            .queue
            .write_buffer(&self.scale.buffer, 0, bytemuck::cast_slice(&scale));
        let propagation = match preview.propagators() {
            None => None,
            Some(plans) => {
                let padded = plans[0].padded_size();
                let factors: Vec<_> = plans.iter().map(|plan| plan.transfer().factors()).collect();
                let planes = Planes {
                    field: &self.field,
                    size: self.small,
                    padded,
                    factors: &factors,
                    turn: None,
                };
                let propagation = match self.propagations.remove(&padded) {
                    Some(propagation) => {
                        propagation.set_filter(device, &factors);
                        propagation
                    }
                    None => Convolution::new(device, &planes)?,
                };
                Some(&*self.propagations.entry(padded).or_insert(propagation))
            }
        };
        let mut encoder = device.inner.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        sum.run(&mut pass);
        if let Some(propagation) = propagation {
            propagation.run(&mut pass);
        }
        self.draw.run(&mut pass);
        drop(pass);
        Ok(encoder.finish())
    }
}
