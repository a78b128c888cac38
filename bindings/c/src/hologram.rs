//! Results: objects whose memory is read in place.

use crate::frame::encoding_number;
use crate::pointer::{Extensible, free, give, give_sized, object, pick, read};
use crate::status::{PfStatus, call};
use phasefront_ffi::{FrameTimes, Layout, OutputSize, Placement, RawHologram, RawMemory, RawPlanes};
use std::sync::Arc;

/// The hologram of one frame: modulator levels of its colours.
pub struct PfHologram(pub(crate) Arc<RawHologram>);

/// The time that each stage of a frame took, in milliseconds.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfFrameTimes {
    /// Rotating, converting and resizing the colour image.
    pub colour_ms: f64,
    /// Reading, aligning, temporally smoothing and refining the depth.
    pub depth_ms: f64,
    /// Computing the midpoint hologram from the frame.
    pub method_ms: f64,
    /// Propagating from the midpoint to the modulator.
    pub propagate_ms: f64,
    /// Encoding the field into levels.
    pub encode_ms: f64,
    /// The sum of all stages.
    pub total_ms: f64,
}

impl From<FrameTimes> for PfFrameTimes {
    fn from(times: FrameTimes) -> Self {
        PfFrameTimes {
            colour_ms: times.colour_ms,
            depth_ms: times.depth_ms,
            method_ms: times.method_ms,
            propagate_ms: times.propagate_ms,
            encode_ms: times.encode_ms,
            total_ms: times.total_ms,
        }
    }
}

/// The properties of a hologram.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfHologramInfo {
    /// The size of this struct, sizeof(PfHologramInfo). Set it before the call.
    pub size: usize,
    /// The timestamp of the frame.
    pub timestamp_ns: u64,
    /// The width in pixels.
    pub width: u32,
    /// The height in pixels.
    pub height: u32,
    /// The number of colours of the levels: 3, or 1 for a display with one laser.
    pub colours: u32,
    /// The quality level of the hologram; 0 is the best.
    pub quality_level: u32,
    /// The amplitude that maps to full light.
    pub scale: f32,
    /// The distance of the near end of the volume in metres; NaN for normalized depth.
    pub near_m: f32,
    /// The distance of the far end of the volume in metres; NaN for normalized depth.
    pub far_m: f32,
    /// The share of the depth sensor's pixels that had a usable reading.
    pub valid_depth: f32,
    /// The time that each stage took.
    pub times: PfFrameTimes,
    /// The meaning of the frame's colours, a PfRgbEncoding. Views are in sRGB unless these are amplitudes, as which
    /// views show them.
    pub rgb_encoding: u32,
}

// SAFETY: its first field is its size.
unsafe impl Extensible for PfHologramInfo {
    const NAME: &'static str = "PfHologramInfo";
}

/// The arrangement of the colours' levels in images for a modulator's driver.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfLayout {
    /// One image with bytes red, green, blue.
    Rgb = 0,
    /// One image with bytes red, green, blue, alpha 255.
    Rgba = 1,
    /// One image with bytes blue, green, red, alpha 255.
    Bgra = 2,
    /// One image for each colour in the order red, green, blue, with one byte for each pixel.
    Grey = 3,
    /// One image with 32-bit little-endian words: red in the lowest 10 bits, then green, then blue, alpha 3.
    Rgb10 = 4,
    /// One image for each colour in the order red, green, blue, with one 16-bit little-endian word for each pixel.
    Grey16 = 5,
}

pub(crate) const LAYOUTS: [Layout; 6] = [
    Layout::Rgb,
    Layout::Rgba,
    Layout::Bgra,
    Layout::Grey,
    Layout::Rgb10,
    Layout::Grey16,
];

/// The placement of a hologram on its modulator.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfPlacement {
    /// The arrangement of colours in images, a PfLayout.
    pub layout: u32,
    /// Whether the whole image is flipped left to right.
    pub flip_x: bool,
    /// Whether the whole image is flipped top to bottom.
    pub flip_y: bool,
    /// The hologram's shift to the right of the middle in pixels, before flips.
    pub shift_x: i32,
    /// The hologram's shift below the middle in pixels, before flips.
    pub shift_y: i32,
}

/// The images that a modulator's input takes of a hologram.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfOutputSize {
    /// The width of an image in pixels.
    pub width: u32,
    /// The height of an image in pixels.
    pub height: u32,
    /// The number of bytes of a pixel.
    pub pixel_bytes: u32,
    /// The number of images: one, or one for each colour.
    pub images: u32,
}

impl From<OutputSize> for PfOutputSize {
    fn from(size: OutputSize) -> Self {
        PfOutputSize {
            width: size.width as u32,
            height: size.height as u32,
            pixel_bytes: size.pixel_bytes as u32,
            images: size.images as u32,
        }
    }
}

/// The caller's memory for an image.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfMemory {
    /// The first byte.
    pub data: *mut u8,
    /// The number of bytes.
    pub length: usize,
    /// The number of bytes from one row to the next.
    pub row_stride: u32,
}

impl From<PfMemory> for RawMemory {
    fn from(memory: PfMemory) -> Self {
        RawMemory {
            address: memory.data as u64,
            length: memory.length as u64,
            row_stride: memory.row_stride as usize,
        }
    }
}

/// Numbers at each pixel of each colour of a hologram: amplitudes, or a field.
pub struct PfPlanes(Arc<RawPlanes>);

/// The memory and size of planes.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfPlanesInfo {
    /// The first number of the first plane. There are no gaps between rows, and the planes of the other colours follow.
    /// It is valid until pf_planes_free.
    pub data: *const f32,
    /// The number of numbers.
    pub length: usize,
    /// The width in pixels.
    pub width: u32,
    /// The height in pixels.
    pub height: u32,
    /// The number of planes: 3, or 1 for a display with one laser.
    pub colours: u32,
    /// The number of numbers of a pixel: 1 for an amplitude, 2 for a real and an imaginary part.
    pub numbers: u32,
}

/// Returns the properties of a hologram.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_hologram_info(hologram: *const PfHologram, info: *mut PfHologramInfo) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give_sized(info, "info", || {
            let known = read(hologram, "hologram")?.0.info();
            Ok(PfHologramInfo {
                size: size_of::<PfHologramInfo>(),
                timestamp_ns: known.timestamp_ns as u64,
                width: known.width as u32,
                height: known.height as u32,
                colours: known.colours as u32,
                quality_level: known.quality_level as u32,
                scale: known.scale,
                near_m: known.near_m.unwrap_or(f32::NAN),
                far_m: known.far_m.unwrap_or(f32::NAN),
                valid_depth: known.valid_depth,
                times: known.times.into(),
                rgb_encoding: encoding_number(known.encoding),
            })
        })
    })
}

/// Returns the address of the levels of one colour: 0 red, 1 green, 2 blue, or 0 for one laser. Each level is a byte;
/// there are no gaps between rows or between colours. The address is valid until pf_hologram_free.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_hologram_levels(
    hologram: *const PfHologram,
    colour: u32,
    levels: *mut *const u8,
    length: *mut usize,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        let hologram = &read(hologram, "hologram")?.0;
        let address = hologram.plane_address(colour as usize)?;
        give(levels, "levels", || {
            give(length, "length", || Ok(hologram.plane_len() as usize))?;
            Ok(address as usize as *const u8)
        })
    })
}

/// Returns the z in mm of the scene point at (x, y) of the picture, for example to focus where the user taps.
/// Coordinates run from 0 to 1 from the upper left corner.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_hologram_z_at(hologram: *const PfHologram, x: f64, y: f64, z_mm: *mut f64) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe { give(z_mm, "z_mm", || Ok(read(hologram, "hologram")?.0.z_at(x, y))) })
}

/// Writes the view of an eye focused at z, in sRGB, into memory: an image of width x height pixels in `layout`,
/// PF_LAYOUT_RGB, PF_LAYOUT_RGBA or PF_LAYOUT_BGRA.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_hologram_write_preview(
    hologram: *const PfHologram,
    z_mm: f64,
    width: u32,
    height: u32,
    layout: u32,
    memory: PfMemory,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        let layout = pick(&LAYOUTS, layout, "layout")?;
        let hologram = &read(hologram, "hologram")?.0;
        hologram.write_preview(z_mm, width as usize, height as usize, layout, memory.into())
    })
}

/// Creates the view of an eye focused at z at full resolution, as amplitudes where 1 is white. This transforms the
/// whole hologram; do not use it for every frame. A z too far away is refused.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_hologram_refocus(
    hologram: *const PfHologram,
    z_mm: f64,
    planes: *mut *mut PfPlanes,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(planes, "planes", || {
            Ok(object(PfPlanes(read(hologram, "hologram")?.0.refocus(z_mm)?)))
        })
    })
}

/// Creates the complex field that the levels produce behind the aperture at z, where 0 is the midpoint: the real and
/// the imaginary part of each pixel. The carrier is left out. This transforms the whole hologram; do not use it for
/// every frame. A z too far away is refused.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_hologram_field(
    hologram: *const PfHologram,
    z_mm: f64,
    planes: *mut *mut PfPlanes,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(planes, "planes", || {
            Ok(object(PfPlanes(read(hologram, "hologram")?.0.field(z_mm)?)))
        })
    })
}

/// Returns the memory and size of planes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_planes_info(planes: *const PfPlanes, info: *mut PfPlanesInfo) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(info, "info", || {
            let planes = &read(planes, "planes")?.0;
            let (width, height, colours) = (planes.width(), planes.height(), planes.colours());
            let numbers = planes.pixel_bytes() / size_of::<f32>();
            Ok(PfPlanesInfo {
                data: planes.plane_address(0)? as usize as *const f32,
                length: width * height * colours * numbers,
                width: width as u32,
                height: height as u32,
                colours: colours as u32,
                numbers: numbers as u32,
            })
        })
    })
}

/// Frees planes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_planes_free(planes: *mut PfPlanes) {
    // SAFETY: the rules of this border.
    unsafe { free(planes) };
}

/// Returns the size of the images of `layout`, a PfLayout, for the modulator.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_hologram_output_size(
    hologram: *const PfHologram,
    layout: u32,
    size: *mut PfOutputSize,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(size, "size", || {
            let layout = pick(&LAYOUTS, layout, "layout")?;
            Ok(read(hologram, "hologram")?.0.output_size(layout).into())
        })
    })
}

/// Writes image `number` of those that the modulator's driver takes into memory, at the modulator's resolution. Levels
/// with fewer bits than their place use its upper bits; `placement` positions the hologram.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_hologram_write_output(
    hologram: *const PfHologram,
    placement: *const PfPlacement,
    number: u32,
    memory: PfMemory,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        let placement = read(placement, "placement")?;
        let placement = Placement {
            layout: pick(&LAYOUTS, placement.layout, "layout")?,
            flip_x: placement.flip_x,
            flip_y: placement.flip_y,
            shift_x: placement.shift_x,
            shift_y: placement.shift_y,
        };
        let hologram = &read(hologram, "hologram")?.0;
        hologram.write_output(placement, number as usize, memory.into())
    })
}

/// Frees a hologram. Its memory returns to its session.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_hologram_free(hologram: *mut PfHologram) {
    // SAFETY: the rules of this border.
    unsafe { free(hologram) };
}
