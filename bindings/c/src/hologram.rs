//! Results: objects whose memory is read in place.

use crate::pointer::{free, give, object, pick, read};
use crate::status::{PfStatus, call};
use phasefront_ffi::{FrameTimes, Layout, Placement, RawHologram, RawImage, RawPlanes};
use std::sync::Arc;

/// The hologram of one frame: modulator levels of its colours.
pub struct PfHologram(pub(crate) Arc<RawHologram>);

/// How long each stage of a frame took, milliseconds.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfFrameTimes {
    /// Colour to amplitudes of the display's resolution.
    pub colour_ms: f64,
    /// Depth to normalized depth of the display's resolution.
    pub depth_ms: f64,
    /// The midpoint hologram.
    pub method_ms: f64,
    /// From the midpoint to the modulator.
    pub propagate_ms: f64,
    /// From the field to levels.
    pub encode_ms: f64,
    /// All together.
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

/// What is known of a hologram.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfHologramInfo {
    /// The frame's timestamp.
    pub timestamp_ns: u64,
    /// Pixels along x.
    pub width: u32,
    /// Pixels along y.
    pub height: u32,
    /// How many colours its levels have: 3, or 1 for a display of one laser.
    pub colours: u32,
    /// The quality level that it was made at, 0 the best.
    pub quality_level: u32,
    /// The amplitude that full light stands for.
    pub scale: f32,
    /// Metres at the near end of the volume; NaN for normalized depth.
    pub near_m: f32,
    /// Metres at the far end of the volume; NaN for normalized depth.
    pub far_m: f32,
    /// The share of the depth sensor's pixels that had a usable reading.
    pub valid_depth: f32,
    /// How long each stage took.
    pub times: PfFrameTimes,
}

/// How the levels of the colours lie in images for a modulator's driver.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PfLayout {
    /// One image, bytes red, green, blue.
    Rgb = 0,
    /// One image, bytes red, green, blue, alpha 255.
    Rgba = 1,
    /// One image, bytes blue, green, red, alpha 255.
    Bgra = 2,
    /// An image for each colour, one after another: red, green, blue; a byte a pixel.
    Grey = 3,
}

const LAYOUTS: [Layout; 4] = [Layout::Rgb, Layout::Rgba, Layout::Bgra, Layout::Grey];

/// How a hologram is put on its modulator.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfPlacement {
    /// How colours lie in images: a PfLayout.
    pub layout: u32,
    /// Whether left and right are exchanged, of the whole image.
    pub flip_x: bool,
    /// Whether top and bottom are exchanged, of the whole image.
    pub flip_y: bool,
    /// How many pixels to the right of the middle the hologram stands, before flips.
    pub shift_x: i32,
    /// How many pixels below the middle it stands, before flips.
    pub shift_y: i32,
}

/// An image, row by row without gaps.
pub struct PfImage(Arc<RawImage>);

/// What an image is.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfImageInfo {
    /// Its first byte. Valid until pf_image_free.
    pub data: *const u8,
    /// How many bytes lie there.
    pub length: usize,
    /// Pixels along x.
    pub width: u32,
    /// Pixels along y.
    pub height: u32,
    /// Bytes of a pixel.
    pub pixel_bytes: u32,
}

/// Numbers at each pixel of each colour of a hologram: amplitudes, or a field.
pub struct PfPlanes(Arc<RawPlanes>);

/// What planes are.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PfPlanesInfo {
    /// The first plane's first number, row by row without gaps; the planes of the other colours follow it. Valid until
    /// pf_planes_free.
    pub data: *const f32,
    /// How many numbers lie there.
    pub length: usize,
    /// Pixels along x.
    pub width: u32,
    /// Pixels along y.
    pub height: u32,
    /// How many planes there are: 3, or 1 of a display of one laser.
    pub colours: u32,
    /// Numbers of a pixel: 1, an amplitude, or 2, a real and an imaginary part.
    pub numbers: u32,
}

/// What is known of a hologram.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_hologram_info(hologram: *const PfHologram, info: *mut PfHologramInfo) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(info, "info", || {
            let known = read(hologram, "hologram")?.0.info()?;
            Ok(PfHologramInfo {
                timestamp_ns: known.timestamp_ns,
                width: known.width,
                height: known.height,
                colours: known.colours,
                quality_level: known.quality_level,
                scale: known.scale,
                near_m: known.near_m.unwrap_or(f32::NAN),
                far_m: known.far_m.unwrap_or(f32::NAN),
                valid_depth: known.valid_depth,
                times: known.times.into(),
            })
        })
    })
}

/// Where the levels of one colour lie, a byte each, row by row without gaps: 0 red, 1 green, 2 blue, or 0 of one laser.
/// The colours follow one another without gaps, too. Valid until pf_hologram_free.
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
        let address = hologram.plane_address(colour)?;
        give(levels, "levels", || {
            give(length, "length", || Ok(hologram.plane_len()? as usize))?;
            Ok(address as usize as *const u8)
        })
    })
}

/// z of what is seen at (x, y) of the picture, each 0 to 1 from its upper left corner, mm: where to focus when it is
/// tapped on.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_hologram_z_at(hologram: *const PfHologram, x: f64, y: f64, z_mm: *mut f64) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe { give(z_mm, "z_mm", || read(hologram, "hologram")?.0.z_at(x, y)) })
}

/// What an eye focused at z sees, 4 bytes a pixel: red, green, blue, 255.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_hologram_preview(
    hologram: *const PfHologram,
    z_mm: f64,
    width: u32,
    height: u32,
    image: *mut *mut PfImage,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(image, "image", || {
            let hologram = &read(hologram, "hologram")?.0;
            Ok(object(PfImage(hologram.preview(z_mm, width, height)?)))
        })
    })
}

/// What an eye focused at z sees of the whole hologram: amplitudes, of which 1 is white. It transforms all of it: not
/// for every frame. A z too far away is refused.
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

/// The complex field that the levels make behind the aperture at z, 0 the midpoint, without the carrier: real and
/// imaginary part of each pixel. It transforms all of the hologram: not for every frame. A z too far away is refused.
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

/// What planes are, and where they lie.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_planes_info(planes: *const PfPlanes, info: *mut PfPlanesInfo) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(info, "info", || {
            let planes = &read(planes, "planes")?.0;
            let (width, height, colours) = (planes.width()?, planes.height()?, planes.colours()?);
            let numbers = planes.pixel_bytes()? / size_of::<f32>() as u32;
            Ok(PfPlanesInfo {
                data: planes.plane_address(0)? as usize as *const f32,
                length: [width, height, colours, numbers].iter().map(|n| *n as usize).product(),
                width,
                height,
                colours,
                numbers,
            })
        })
    })
}

/// Ends planes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_planes_free(planes: *mut PfPlanes) {
    // SAFETY: the rules of this border.
    unsafe { free(planes) };
}

/// Image `number` of those that the modulator's driver takes, of the modulator's resolution: levels as they are, in the
/// upper bits of a byte, the hologram where `placement` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_hologram_output(
    hologram: *const PfHologram,
    placement: *const PfPlacement,
    number: u32,
    image: *mut *mut PfImage,
) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(image, "image", || {
            let placement = read(placement, "placement")?;
            let placement = Placement {
                layout: pick(&LAYOUTS, placement.layout, "layout")?,
                flip_x: placement.flip_x,
                flip_y: placement.flip_y,
                shift_x: placement.shift_x,
                shift_y: placement.shift_y,
            };
            let hologram = &read(hologram, "hologram")?.0;
            Ok(object(PfImage(hologram.output(placement, number)?)))
        })
    })
}

/// Ends a hologram; its memory goes back to its session.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_hologram_free(hologram: *mut PfHologram) {
    // SAFETY: the rules of this border.
    unsafe { free(hologram) };
}

/// What an image is, and where it lies.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_image_info(image: *const PfImage, info: *mut PfImageInfo) -> PfStatus {
    // SAFETY: the rules of this border.
    call(|| unsafe {
        give(info, "info", || {
            let image = &read(image, "image")?.0;
            Ok(PfImageInfo {
                data: image.address()? as usize as *const u8,
                length: image.byte_len()? as usize,
                width: image.width()?,
                height: image.height()?,
                pixel_bytes: image.pixel_bytes()?,
            })
        })
    })
}

/// Ends an image.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pf_image_free(image: *mut PfImage) {
    // SAFETY: the rules of this border.
    unsafe { free(image) };
}
