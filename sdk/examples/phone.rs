//! What a phone needs of the SDK behind one C function: a network from memory, a frame to levels. Built as a library to
//! measure its size, see `tools/lab/library_size.py`; bindings for apps are another crate's.
#![allow(unsafe_code)]

use ndarray::{Array2, Array3};
use phasefront::{EncoderOptions, Error, Method, Network, Pipeline, RgbdFrame, Size, Target};

/// The size of a frame in pixels, for C.
#[repr(C)]
pub struct FrameSize {
    width: usize,
    height: usize,
}

/// Makes `levels`, (3, H, W), of a frame of `size`, by the network of an ONNX file; 0 if that went well.
///
/// # Safety
/// `onnx` holds `length` bytes, `rgb` three planes of the frame's size, `depth` one, and `levels` has room for three.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn phasefront_levels(
    onnx: *const u8,
    length: usize,
    size: FrameSize,
    rgb: *const f32,
    depth: *const f32,
    levels: *mut u8,
) -> i32 {
    let size = Size {
        width: size.width,
        height: size.height,
    };
    let area = size.pixels();
    // SAFETY: the caller's promise.
    let (onnx, rgb, depth, levels) = unsafe {
        (
            std::slice::from_raw_parts(onnx, length),
            std::slice::from_raw_parts(rgb, 3 * area),
            std::slice::from_raw_parts(depth, area),
            std::slice::from_raw_parts_mut(levels, 3 * area),
        )
    };
    match make(onnx, size, rgb, depth, levels) {
        Ok(()) => 0,
        Err(_) => 1,
    }
}

fn make(onnx: &[u8], size: Size, rgb: &[f32], depth: &[f32], levels: &mut [u8]) -> phasefront::Result<()> {
    let (height, width) = size.shape();
    let wrong = |e: ndarray::ShapeError| Error::Frame(e.to_string());
    let rgb = Array3::from_shape_vec((3, height, width), rgb.to_vec()).map_err(wrong)?;
    let depth = Array2::from_shape_vec((height, width), depth.to_vec()).map_err(wrong)?;
    let frame = RgbdFrame::new(rgb, depth)?;
    let network = Network::from_onnx(onnx)?;
    let method = Method::trained(network.into());
    let options = EncoderOptions::default();
    let pipeline = Pipeline::new(size, method, &Target::default(), &options)?;
    pipeline.process(&frame, levels, &mut pipeline.scratch())?;
    Ok(())
}
