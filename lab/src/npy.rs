//! Arrays of `.npy` files. A header may say anything: memory is taken for the bytes that are there, not for the shape
//! that it names.

use ndarray::{Array, ArrayView, Dimension};
use ndarray_npy::{ViewElement, ViewNpyError, ViewNpyExt};

/// What every element that is read is aligned to.
const ALIGNMENT: usize = 16;

/// The array that a whole `.npy` holds.
///
/// # Errors
/// Another type or number of dimensions, or bytes that are fewer or more than the header says.
pub(crate) fn read<T: ViewElement + Clone, D: Dimension>(file: &[u8]) -> Result<Array<T, D>, ViewNpyError> {
    // The values begin behind the header, whose length has 2 bytes in version 1 and 4 in those after it.
    let values = match file {
        [_, _, _, _, _, _, 1, _, a, b, ..] => 10 + usize::from(u16::from_le_bytes([*a, *b])),
        [_, _, _, _, _, _, _, _, a, b, c, d, ..] => (u32::from_le_bytes([*a, *b, *c, *d]) as usize).saturating_add(12),
        _ => 0,
    };
    let is_aligned = |file: &[u8]| (file.as_ptr() as usize).wrapping_add(values).is_multiple_of(ALIGNMENT);
    if is_aligned(file) {
        return view(file);
    }
    let mut moved = Vec::with_capacity(file.len() + ALIGNMENT);
    while !is_aligned(&moved[moved.len()..]) {
        moved.push(0);
    }
    let start = moved.len();
    moved.extend_from_slice(file);
    view(&moved[start..])
}

fn view<T: ViewElement + Clone, D: Dimension>(file: &[u8]) -> Result<Array<T, D>, ViewNpyError> {
    ArrayView::<T, D>::view_npy(file).map(|view| view.to_owned())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use ndarray::{Array2, Ix2, Ix3};
    use ndarray_npy::WriteNpyExt;
    use num_complex::Complex32;

    fn file(header: &str, values: &[u8]) -> Vec<u8> {
        let mut file = b"\x93NUMPY\x01\x00".to_vec();
        file.extend((header.len() as u16).to_le_bytes());
        file.extend(header.as_bytes());
        file.extend(values);
        file
    }

    #[test]
    fn what_was_written_is_read_wherever_it_lies_in_memory() {
        let want = Array2::from_shape_fn((3, 5), |(y, x)| (y * 5 + x) as f64);
        let mut bytes = Vec::new();
        want.write_npy(&mut bytes).unwrap();
        for shift in 0..ALIGNMENT {
            let memory = [vec![0; shift], bytes.clone()].concat();
            assert_eq!(read::<f64, Ix2>(&memory[shift..]).unwrap(), want);
        }
        // Headers of any length, as other programs write them.
        for spaces in 0..9 {
            let header = format!(
                "{{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2), }}{}\n",
                " ".repeat(spaces)
            );
            let values: Vec<u8> = [1.5f32, -2.0].iter().flat_map(|v| v.to_le_bytes()).collect();
            let got = read::<f32, Ix2>(&file(&header, &values)).unwrap();
            assert_eq!(got.into_raw_vec_and_offset().0, [1.5, -2.0]);
        }
    }

    #[test]
    fn a_header_that_promises_more_than_there_is_is_refused() {
        let header = |kind: &str, shape: &str| {
            file(
                &format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n"),
                &[0; 8],
            )
        };
        assert!(read::<f32, Ix2>(&header("<f4", "(1000000, 1000000)")).is_err());
        assert!(read::<f32, Ix2>(&header("<f4", "(9223372036854775807, 9223372036854775807)")).is_err());
        assert!(read::<Complex32, Ix3>(&header("<c8", "(3, 100000, 100000)")).is_err());
        assert!(read::<u8, Ix2>(&header("|u1", "(2, 2)")).is_err());
        for end in 0..80 {
            let whole = header("<f4", "(1, 2)");
            assert!(read::<f32, Ix2>(&whole[..end.min(whole.len() - 1)]).is_err());
        }
    }
}
