//! Arrays in `.npy` files. Memory is allocated for the bytes present, not for the shape in the header, which may be
//! false.

use crate::input::decode::Plane;
use ndarray::{Array, Array2, Array3, ArrayD, ArrayView, Dimension};
use ndarray_npy::{ViewElement, ViewNpyError, ViewNpyExt};
use num_complex::{Complex32, Complex64};

/// The largest alignment of an element type.
const ALIGNMENT: usize = 16;

/// Reads the array of a whole `.npy` file.
///
/// # Errors
/// Returns an error if the type or the number of dimensions differs or if there are fewer or more bytes than the header
/// says.
pub fn read<T: ViewElement + Clone, D: Dimension>(file: &[u8]) -> Result<Array<T, D>, ViewNpyError> {
    // The values follow the header, whose length has 2 bytes in version 1 and 4 bytes in later versions.
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

/// Reads the complex field of a whole `.npy` file of complex64 or complex128, as (C, H, W). (H, W) is one colour.
///
/// # Errors
/// Returns an error if the type or the number of axes differs or if there are fewer or more bytes than the header says.
pub(crate) fn read_field(file: &[u8]) -> Result<Array3<Complex32>, String> {
    let double = || read(file).map(|array: ArrayD<Complex64>| array.mapv(|v| Complex32::new(v.re as f32, v.im as f32)));
    let array: ArrayD<Complex32> = match read(file) {
        Err(ViewNpyError::WrongDescriptor(_)) => double(),
        read => read,
    }
    .map_err(|e| match e {
        ViewNpyError::WrongDescriptor(kind) => {
            format!("holds {kind}; a field is complex: field.astype(numpy.complex64) makes it so")
        }
        e => format!("is not a whole complex64 or complex128 .npy: {e}"),
    })?;
    let shape = match *array.shape() {
        [height, width] => (1, height, width),
        [colours, height, width] => (colours, height, width),
        _ => {
            return Err(format!("has shape {:?}; a field is (H, W) or (C, H, W)", array.shape()));
        }
    };
    let array = array.as_standard_layout().into_owned().into_shape_with_order(shape);
    array.map_err(|e| e.to_string())
}

/// The requirement for the `.npy` of a depth map.
const WANTED: &str = "is not a whole .npy of shape (H, W), (H, W, 1) or (1, H, W) and float16, float32, float64 or whole numbers of 8 to 32 bits";

/// Reads the single plane of a whole `.npy` file of any supported number type. If there are more than two axes, those
/// of length 1 are dropped.
///
/// # Errors
/// Returns an error if the shape or type differs or if there are fewer or more bytes than the header says.
pub(crate) fn read_plane(file: &[u8]) -> Result<Plane, String> {
    plane(file).ok_or_else(|| WANTED.to_owned())
}

fn plane(file: &[u8]) -> Option<Plane> {
    let rest = file.strip_prefix(b"\x93NUMPY")?;
    let (version, rest) = rest.split_first_chunk::<2>()?;
    let (length, rest) = match version[0] {
        1 => {
            let (length, rest) = rest.split_first_chunk()?;
            (usize::from(u16::from_le_bytes(*length)), rest)
        }
        _ => {
            let (length, rest) = rest.split_first_chunk()?;
            (u32::from_le_bytes(*length) as usize, rest)
        }
    };
    let (header, values) = rest.split_at_checked(length)?;
    let header = std::str::from_utf8(header).ok()?;
    let after = |key: &str| {
        let (_, rest) = header.split_once(&format!("'{key}'"))?;
        Some(rest.trim_start().strip_prefix(':')?.trim_start())
    };
    let is_columns = after("fortran_order")?.starts_with("True");
    let (shape, _) = after("shape")?.strip_prefix('(')?.split_once(')')?;
    let sides = shape.split(',').map(str::trim).filter(|side| !side.is_empty());
    let sides: Vec<usize> = sides.map(|side| side.parse().ok()).collect::<Option<_>>()?;
    let (height, width) = match sides[..] {
        [height, width] | [height, width, 1] | [1, height, width] => (height, width),
        _ => return None,
    };
    let (kind, _) = after("descr")?.strip_prefix('\'')?.split_once('\'')?;
    let (values, most) = numbers(kind, values, height.checked_mul(width)?)?;
    let values = if is_columns {
        let columns = Array2::from_shape_vec((width, height), values).ok()?;
        columns.reversed_axes().as_standard_layout().into_owned()
    } else {
        Array2::from_shape_vec((height, width), values).ok()?
    };
    Some(Plane { values, most })
}

/// Converts `count` numbers of the NumPy type `kind`. For integers, also returns the largest value of the type.
fn numbers(kind: &str, bytes: &[u8], count: usize) -> Option<(Vec<f32>, Option<f32>)> {
    let (order, kind) = kind.split_at_checked(1)?;
    // `|` marks types of one byte and `=` the machine's own byte order.
    let is_big = match order {
        ">" => true,
        "=" => cfg!(target_endian = "big"),
        "<" | "|" => false,
        _ => return None,
    };
    macro_rules! of {
        ($type:ty, $number:expr) => {{
            let (values, rest) = bytes.as_chunks::<{ size_of::<$type>() }>();
            if values.len() != count || !rest.is_empty() {
                return None;
            }
            let value = |bytes: &[u8; size_of::<$type>()]| {
                $number(match is_big {
                    true => <$type>::from_be_bytes(*bytes),
                    false => <$type>::from_le_bytes(*bytes),
                })
            };
            values.iter().map(value).collect()
        }};
    }
    Some(match kind {
        "f2" => (of!(half::f16, f32::from), None),
        "f4" => (of!(f32, |v| v), None),
        "f8" => (of!(f64, |v| v as f32), None),
        "u1" => (of!(u8, f32::from), Some(f32::from(u8::MAX))),
        "u2" => (of!(u16, f32::from), Some(f32::from(u16::MAX))),
        "u4" => (of!(u32, |v| v as f32), Some(u32::MAX as f32)),
        "i1" => (of!(i8, f32::from), Some(f32::from(i8::MAX))),
        "i2" => (of!(i16, f32::from), Some(f32::from(i16::MAX))),
        "i4" => (of!(i32, |v| v as f32), Some(i32::MAX as f32)),
        _ => return None,
    })
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
        // Other programs write headers of any length.
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

    #[test]
    fn planes_of_every_type_order_and_shape_are_read() {
        let values = [0.0f32, 1.0, 2.0, 3.0, 4.0, 100.0];
        let le = |kind: &str| -> Vec<u8> {
            let bytes = |v: &f32| match kind {
                "f2" => half::f16::from_f32(*v).to_le_bytes().to_vec(),
                "f4" => v.to_le_bytes().to_vec(),
                "f8" => f64::from(*v).to_le_bytes().to_vec(),
                "u1" | "i1" => vec![*v as u8],
                "u2" | "i2" => (*v as u16).to_le_bytes().to_vec(),
                _ => (*v as u32).to_le_bytes().to_vec(),
            };
            values.iter().flat_map(bytes).collect()
        };
        let want = Array2::from_shape_vec((2, 3), values.to_vec()).unwrap();
        for kind in ["f2", "f4", "f8", "u1", "u2", "u4", "i1", "i2", "i4"] {
            let header = |order: &str, columns: &str, shape: &str| {
                format!("{{'descr': '{order}{kind}', 'fortran_order': {columns}, 'shape': {shape}, }}\n")
            };
            let size: usize = kind[1..].parse().unwrap();
            let be: Vec<u8> = le(kind).chunks(size).flat_map(|v| v.iter().rev().copied()).collect();
            for shape in ["(2, 3)", "(2, 3, 1)", "(1, 2, 3)"] {
                let little = file(&header("<", "False", shape), &le(kind));
                assert_eq!(read_plane(&little).unwrap().values, want, "{kind} {shape}");
                let big = file(&header(">", "False", shape), &be);
                assert_eq!(read_plane(&big).unwrap().values, want, "{kind} {shape}");
            }
            let columns = file(&header("<", "True", "(3, 2)"), &le(kind));
            assert_eq!(read_plane(&columns).unwrap().values, want.t(), "{kind}");
            assert_eq!(read_plane(&columns).unwrap().most.is_none(), kind.starts_with('f'));
            for shape in ["(6,)", "(2, 3, 2)", "(2, 4)", "(2, 2)", "(1, 2, 3, 1)", "(-2, 3)"] {
                assert!(
                    read_plane(&file(&header("<", "False", shape), &le(kind))).is_err(),
                    "{shape}"
                );
            }
            for end in 0..columns.len() {
                assert!(read_plane(&columns[..end]).is_err());
            }
        }
        assert!(
            read_plane(&file(
                "{'descr': '<c8', 'fortran_order': False, 'shape': (2, 3), }",
                &[0; 48]
            ))
            .is_err()
        );
    }
}
