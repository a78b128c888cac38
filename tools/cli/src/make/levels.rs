//! Memory for the levels of a modulator: bytes, and words for over 8 bits.

use ndarray::Array3;
use num_complex::Complex32;
use phasefront_core::method::network::Engine;
use phasefront_core::pipeline::display_plan::Modulation;

/// The memory that levels are written to.
pub(super) enum Out<'a> {
    Bytes(&'a mut [u8]),
    /// Memory for phases, and the words.
    Words(&'a mut [f32], &'a mut [u16]),
}

/// Makes levels of `display` for (H, W) pixels by calling `modulate`: bytes, and words if they have over 8 bits.
pub(super) fn levels_by(
    display: &phasefront::Display,
    (height, width): (usize, usize),
    modulate: impl FnOnce(Out<'_>) -> Modulation,
) -> (Array3<u8>, Option<Array3<u16>>, Modulation) {
    let shape = (display.colours(), height, width);
    let mut levels = Array3::zeros(shape);
    if display.bits() <= 8 {
        let modulation = modulate(Out::Bytes(levels.as_slice_mut().expect("standard layout")));
        return (levels, None, modulation);
    }
    let mut words = Array3::zeros(shape);
    let values = words.as_slice_mut().expect("standard layout");
    let modulation = modulate(Out::Words(&mut vec![0.0; values.len()], values));
    let upper = words.mapv(|word: u16| (word >> (display.bits() - 8)) as u8);
    (upper, Some(words), modulation)
}

/// Makes a stack of `shape` from `values`.
pub(super) fn stack(values: Vec<Complex32>, shape: (usize, usize, usize)) -> Array3<Complex32> {
    Array3::from_shape_vec(shape, values).expect("a stack of the frame's shape")
}

/// Describes the engine of a network and why it was chosen.
pub(super) fn described(engine: &Engine) -> String {
    format!("{} ({})", engine.name, engine.why)
}
