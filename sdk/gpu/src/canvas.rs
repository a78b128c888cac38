//! Draws textures to the canvases of a browser's page, without a copy to the CPU.

use super::device::{Device, one_line};
use super::{GpuError, Result};
use js_sys::Reflect;
use phasefront_core::Size;
use std::cell::RefCell;
use std::sync::Arc;
use wasm_bindgen::{JsCast, JsValue};
use wgpu::web_sys::{HtmlCanvasElement, OffscreenCanvas};
use wgpu::{CurrentSurfaceTexture, SurfaceTarget};

/// The number of canvases that stay ready. A page that draws to more of them in turn makes them ready again each time.
const READY: usize = 8;

/// A canvas that is ready for the textures of a device.
struct Canvas {
    element: JsValue,
    surface: wgpu::Surface<'static>,
    device: wgpu::Device,
    /// The size of the canvas.
    size: Size,
}

thread_local! {
    /// The latest canvas is the last.
    static CANVASES: RefCell<Vec<Canvas>> = const { RefCell::new(Vec::new()) };
}

/// Copies `texture`, 8-bit RGBA, to the middle of `canvas`, an `HTMLCanvasElement` or an `OffscreenCanvas`, which
/// becomes `size`, at least that of the texture. `around`, pixels of that size, is what surrounds it. The
/// browser shows it at the end of the task.
///
/// # Errors
/// Returns [`GpuError::Refused`] if it is no canvas or a canvas with a context of another kind, and [`GpuError::Lost`].
pub async fn paint(
    (device, texture): (&Arc<Device>, &wgpu::Texture),
    size: Size,
    around: Option<&[u8]>,
    canvas: &JsValue,
) -> Result<()> {
    let copy = || {
        CANVASES.with_borrow_mut(|canvases| {
            let is = |ready: &Canvas| ready.element == *canvas;
            let mut ready = match canvases.iter().position(is) {
                Some(at) => canvases.remove(at),
                None => Canvas::new(device, canvas)?,
            };
            if canvases.len() == READY {
                canvases.remove(0);
            }
            let copied = ready.copy(device, texture, size, around);
            canvases.push(ready);
            copied
        })
    };
    device.guarded_async(copy).await
}

impl Canvas {
    fn new(device: &Device, element: &JsValue) -> Result<Self> {
        let target = if let Some(canvas) = element.dyn_ref::<OffscreenCanvas>() {
            SurfaceTarget::OffscreenCanvas(canvas.clone())
        } else if let Some(canvas) = element.dyn_ref::<HtmlCanvasElement>() {
            SurfaceTarget::Canvas(canvas.clone())
        } else {
            return Err(GpuError::Refused(
                "it draws to an HTMLCanvasElement or an OffscreenCanvas alone".into(),
            ));
        };
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let surface = instance.create_surface(target).map_err(|why| {
            GpuError::Refused(format!(
                "a canvas that has a context of another kind; a new canvas is right ({})",
                one_line(why)
            ))
        })?;
        Ok(Canvas {
            element: element.clone(),
            surface,
            device: device.inner.clone(),
            size: Size { width: 0, height: 0 },
        })
    }

    fn copy(&mut self, device: &Device, texture: &wgpu::Texture, size: Size, around: Option<&[u8]>) -> Result<()> {
        // A page may have given the canvas another size since.
        let side = |name: &str| {
            Reflect::get(&self.element, &name.into())
                .ok()
                .and_then(|side| side.as_f64())
        };
        let fits = [("height", size.height), ("width", size.width)]
            .iter()
            .all(|(name, n)| side(name) == Some(*n as f64));
        if !fits || self.size != size || self.device != device.inner {
            let configuration = wgpu::SurfaceConfiguration {
                usage: wgpu::TextureUsages::COPY_DST,
                format: wgpu::TextureFormat::Rgba8Unorm,
                color_space: wgpu::SurfaceColorSpace::Auto,
                width: size.width as u32,
                height: size.height as u32,
                present_mode: wgpu::PresentMode::Fifo,
                desired_maximum_frame_latency: 2,
                alpha_mode: wgpu::CompositeAlphaMode::Opaque,
                view_formats: Vec::new(),
            };
            self.surface.configure(&device.inner, &configuration);
            (self.size, self.device) = (size, device.inner.clone());
        }
        let (CurrentSurfaceTexture::Success(to) | CurrentSurfaceTexture::Suboptimal(to)) =
            self.surface.get_current_texture()
        else {
            self.size = Size { width: 0, height: 0 };
            return Err(GpuError::Refused("the browser gives no texture for the canvas".into()));
        };
        if let Some(around) = around {
            let layout = wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(4 * size.width as u32),
                rows_per_image: None,
            };
            let all = to.texture.size();
            device
                .queue
                .write_texture(to.texture.as_image_copy(), around, layout, all);
        }
        let mut encoder = device.inner.create_command_encoder(&Default::default());
        let mut place = to.texture.as_image_copy();
        place.origin.x = (size.width as u32 - texture.width()) / 2;
        place.origin.y = (size.height as u32 - texture.height()) / 2;
        encoder.copy_texture_to_texture(texture.as_image_copy(), place, texture.size());
        device.queue.submit([encoder.finish()]);
        device.queue.present(to);
        Ok(())
    }
}
