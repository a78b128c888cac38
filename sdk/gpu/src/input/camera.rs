//! Uploads camera images to the GPU in their memory layout.

use crate::Result;
use crate::device::{Constants, Device};
use phasefront_core::Size;
use phasefront_core::frame::{ColourFormat, ColourImage, ColourPlan, Orientation, Plane, yuv_constants};

/// The plan for reading a camera's images.
pub(super) struct Camera {
    plan: ColourPlan,
    /// The pixel layout and the colour conversion of the latest uploaded image.
    pub(super) constants: Constants,
    /// The weights of the samples of each pixel.
    pub(super) taps: Constants,
    /// The offset and the capacity of each plane in the colour buffer, in bytes.
    places: Vec<(usize, usize)>,
}

impl Camera {
    /// Plans images of a `sensor`'s size. Also returns their largest size in bytes and the constants of a
    /// program that reads them.
    pub(super) fn new(
        device: &Device,
        plan: ColourPlan,
        format: ColourFormat,
        sensor: Size,
    ) -> Result<(Self, usize, String)> {
        let Size { width, height } = sensor;
        let mut places = Vec::new();
        let mut bytes = 0;
        for (_, pixel_bytes, share) in format.layout() {
            let (rows, columns) = (height.div_ceil(*share), width.div_ceil(*share));
            // Cameras pad rows, and each sample of Android's chroma planes takes two bytes.
            let room = rows * (columns * pixel_bytes.max(&2) + 256).next_multiple_of(256);
            places.push((bytes, room));
            bytes += room;
        }
        let (levels, matrix) = match format {
            ColourFormat::Nv12(encoding) | ColourFormat::Yuv420(encoding) => yuv_constants(encoding),
            _ => ([0.0; 4], [0.0; 4]),
        };
        let mut all = [0u32; 20];
        for (to, value) in all[12..].iter_mut().zip(levels.into_iter().chain(matrix)) {
            *to = value.to_bits();
        }
        let constants = device.constants("the camera", bytemuck::cast_slice(&all))?;
        let (taps, table) = taps(&plan);
        let header = format!("const YUV: bool = {};\n", places.len() > 1) + &taps;
        let camera = Camera {
            plan,
            constants,
            taps: device.table("taps", bytemuck::cast_slice(&table))?,
            places,
        };
        Ok((camera, bytes, header))
    }

    pub(super) fn fits(&self, image: &ColourImage<'_>, orientation: Orientation) -> bool {
        self.plan.fits(image, orientation)
    }

    /// Uploads an image to the colour buffer.
    pub(super) fn upload(&self, device: &Device, to: &wgpu::Buffer, image: &ColourImage<'_>) -> Result<()> {
        let format = image.format();
        let Size { width, height } = image.size();
        let mut planes = image.planes().to_vec();
        let mut tight = Vec::new();
        for ((plane, (_, pixel_bytes, share)), (_, room)) in planes.iter_mut().zip(format.layout()).zip(&self.places) {
            let part = Size {
                width: width.div_ceil(*share),
                height: height.div_ceil(*share),
            };
            let last = (part.height - 1) * plane.row_stride + (part.width - 1) * plane.pixel_stride;
            plane.bytes = &plane.bytes[..last + pixel_bytes];
            if plane.bytes.len() > *room {
                tight.push(tightened(plane, part, *pixel_bytes));
            } else {
                tight.push(Vec::new());
            }
        }
        for (plane, (tight, ((_, pixel_bytes, share), _))) in planes
            .iter_mut()
            .zip(tight.iter().zip(format.layout().iter().zip(&self.places)))
        {
            if !tight.is_empty() {
                *plane = Plane::new(tight, width.div_ceil(*share) * pixel_bytes, *pixel_bytes);
            }
        }
        let image = ColourImage::new(format, image.size(), &planes)?;
        let mut words = [0i32; 12];
        for (c, (plane, view)) in self.plan.views(&image).into_iter().enumerate() {
            words[4 * c] = (self.places[plane].0 + view.origin) as i32;
            words[4 * c + 1] = view.step_x as i32;
            words[4 * c + 2] = view.step_y as i32;
        }
        device
            .queue
            .write_buffer(&self.constants.buffer, 0, bytemuck::cast_slice(&words));
        for (plane, (at, _)) in image.planes().iter().zip(&self.places) {
            device.write(to, *at, plane.bytes);
        }
        Ok(())
    }
}

/// Returns the table of taps and the WGSL constants with the offsets of each axis in it.
fn taps(plan: &ColourPlan) -> (String, Vec<u32>) {
    let (mut constants, mut table) = (String::new(), Vec::new());
    for (name, axis) in ["X", "Y", "OTHER_X", "OTHER_Y"].into_iter().zip(plan.axes()) {
        let (starts, weights, count) = axis.tables();
        let (other, side) = match name.strip_prefix("OTHER_") {
            Some(side) => ("OTHER_", side),
            None => ("", name),
        };
        constants += &format!(
            "const {other}AT_{side}: u32 = {}u;\nconst {other}COUNT_{side}: u32 = {count}u;\n",
            table.len()
        );
        table.extend_from_slice(starts);
        table.extend(weights.iter().map(|weight| weight.to_bits()));
    }
    (constants, table)
}

/// Copies a plane's pixels without gaps, for strides larger than cameras use.
fn tightened(plane: &Plane<'_>, size: Size, pixel_bytes: usize) -> Vec<u8> {
    let pixel = |i: usize| {
        let at = i / size.width * plane.row_stride + i % size.width * plane.pixel_stride;
        &plane.bytes[at..at + pixel_bytes]
    };
    (0..size.pixels()).flat_map(pixel).copied().collect()
}
