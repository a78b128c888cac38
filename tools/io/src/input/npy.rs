//! Arrays in `.npy` files of any supported number type.
//!
//! The header of a file may say anything. Its shape is compared with the bytes that are there before memory is
//! allocated for the values, and its text is read in one pass, without nesting.

use crate::input::decode::{self, MOST_PIXELS, Numbers, Plane};
use crate::input::{self, MOST_ARRAY};
use crate::{Error, Result};
use half::f16;
use ndarray::{Array, Array3, ArrayD, Dimension};
use num_complex::{Complex, Complex32, Complex64};
use phasefront::Size;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

type Said<T> = std::result::Result<T, String>;

/// The maximum length of a header, in bytes. NumPy writes up to 10,000.
const MOST_HEADER: usize = 1 << 16;
/// The maximum number of axes, as in NumPy.
const MOST_AXES: usize = 64;
/// The bytes that are read at one time.
const BUFFER: usize = 1 << 16;

/// A type of number, with its name in NumPy without the byte order.
pub trait Number: Copy {
    /// The name, such as `f4`.
    const NAME: &'static str;

    /// Returns the number in `bytes`, of which there are as many as the type has.
    fn of_bytes(bytes: &[u8], is_big_endian: bool) -> Self;
}

macro_rules! number {
    ($($type:ty: $name:literal),*) => {$(
        impl Number for $type {
            const NAME: &'static str = $name;

            fn of_bytes(bytes: &[u8], is_big_endian: bool) -> Self {
                let bytes = bytes.try_into().expect("as many bytes as the type has");
                if is_big_endian {
                    <$type>::from_be_bytes(bytes)
                } else {
                    <$type>::from_le_bytes(bytes)
                }
            }
        }
    )*};
}

number!(u8: "u1", u16: "u2", u32: "u4", u64: "u8", i8: "i1", i16: "i2", i32: "i4", i64: "i8", f16: "f2", f32: "f4", f64: "f8");

macro_rules! complex {
    ($($part:ty: $name:literal),*) => {$(
        impl Number for Complex<$part> {
            const NAME: &'static str = $name;

            fn of_bytes(bytes: &[u8], is_big_endian: bool) -> Self {
                let (re, im) = bytes.split_at(size_of::<$part>());
                Complex::new(<$part>::of_bytes(re, is_big_endian), <$part>::of_bytes(im, is_big_endian))
            }
        }
    )*};
}

complex!(f32: "c8", f64: "c16");

/// The array of a `.npy` file whose values are not read yet.
pub struct Npy<R> {
    header: Header,
    from: R,
}

/// The contents of a header.
#[derive(Debug, PartialEq)]
struct Header {
    /// The number type as in the file, such as `<f4`.
    descr: String,
    is_column_major: bool,
    shape: Vec<usize>,
}

/// Opens the `.npy` file at `path`.
///
/// # Errors
/// Returns an error if the file cannot be read, or if its header does not fit its length.
pub fn open(path: &Path) -> Result<Npy<BufReader<File>>> {
    let file = input::open(path, MOST_ARRAY)?;
    let length = file.get_ref().metadata().map_err(|e| Error::file(path, e))?.len();
    Npy::new(file, length).map_err(|why| Error::file(path, why))
}

/// Reads the array of a whole `.npy` file.
///
/// # Errors
/// Returns an error if the type or the number of axes differs, or if there are fewer or more bytes than the header
/// says.
pub fn read<T: Number, D: Dimension>(file: &[u8]) -> Said<Array<T, D>> {
    Npy::new(file, file.len() as u64)?.array()
}

impl<R: Read> Npy<R> {
    /// Reads the header of the file `from`, which has `length` bytes.
    ///
    /// # Errors
    /// Returns an error if it is no header, or if the file has fewer or more bytes than the header says.
    pub fn new(mut from: R, length: u64) -> Said<Self> {
        const MAGIC: &[u8] = b"\x93NUMPY";
        let cut = |e: std::io::Error| format!("is not a whole .npy: {e}");
        let mut head = [0; 8];
        from.read_exact(&mut head).map_err(cut)?;
        if !head.starts_with(MAGIC) {
            return Err("is not a whole .npy: it does not begin as one".into());
        }
        // The length of the header has 2 bytes in version 1 and 4 bytes in later versions.
        let mut said = [0; 4];
        let bytes = if head[6] == 1 { 2 } else { 4 };
        from.read_exact(&mut said[..bytes]).map_err(cut)?;
        let said = u32::from_le_bytes(said) as usize;
        if said > MOST_HEADER {
            return Err(format!(
                "is not a whole .npy: its header has {said} bytes; {MOST_HEADER} are the most"
            ));
        }
        let mut text = vec![0; said];
        from.read_exact(&mut text).map_err(cut)?;
        let header = std::str::from_utf8(&text).ok().and_then(Header::parse);
        let header =
            header.ok_or("is not a whole .npy: its header is no dictionary of descr, fortran_order and shape")?;
        let values = length.saturating_sub((head.len() + bytes + said) as u64);
        header.check(values)?;
        Ok(Npy { header, from })
    }

    /// Returns the shape.
    pub(crate) fn shape(&self) -> &[usize] {
        &self.header.shape
    }

    /// Returns the name of the number type, without the byte order.
    fn kind(&self) -> &str {
        &self.header.descr[1..]
    }

    /// Reads the values.
    ///
    /// # Errors
    /// Returns an error if the type or the number of axes differs, or if the file ends early.
    pub fn array<T: Number, D: Dimension>(self) -> Said<Array<T, D>> {
        self.converted(|value: T| value)
    }

    /// Reads the values, each converted by `to`.
    fn converted<T: Number, U: Clone, D: Dimension>(mut self, to: impl Fn(T) -> U) -> Said<Array<U, D>> {
        let Header {
            descr,
            is_column_major,
            mut shape,
        } = self.header;
        let order = descr.as_bytes()[0];
        if descr[1..] != *T::NAME {
            return Err(format!("holds numbers of the type {descr}; {} is needed", T::NAME));
        }
        let is_big_endian = order == b'>' || order == b'=' && cfg!(target_endian = "big");
        let count: usize = shape.iter().product();
        let mut values = Vec::with_capacity(count);
        let mut buffer = vec![0; BUFFER.min(count * size_of::<T>())];
        while values.len() < count {
            let bytes = buffer.len().min((count - values.len()) * size_of::<T>());
            let read = &mut buffer[..bytes];
            (self.from.read_exact(read)).map_err(|e| format!("is not a whole .npy: {e}"))?;
            values.extend(
                read.chunks_exact(size_of::<T>())
                    .map(|bytes| to(T::of_bytes(bytes, is_big_endian))),
            );
        }
        if is_column_major {
            shape.reverse();
        }
        let array = Array::from_shape_vec(shape, values).map_err(|e| e.to_string())?;
        let array = if is_column_major { array.reversed_axes() } else { array };
        let shape = array.shape().to_owned();
        let array = array.into_dimensionality::<D>();
        let array = array.map_err(|_| format!("has shape {shape:?}; {} axes are needed", D::NDIM.unwrap_or(0)))?;
        Ok(if array.is_standard_layout() {
            array
        } else {
            array.as_standard_layout().into_owned()
        })
    }
}

impl Header {
    /// Parses the text of a header, a dictionary of three entries.
    fn parse(text: &str) -> Option<Self> {
        let mut rest = text.trim().strip_prefix('{')?.trim_start();
        let (mut descr, mut is_column_major, mut shape) = (None, None, None);
        while let Some((key, after)) = quoted(rest) {
            let value = after.trim_start().strip_prefix(':')?.trim_start();
            rest = match key {
                "descr" => {
                    let (name, after) = quoted(value)?;
                    descr = Some(name.to_owned());
                    after
                }
                "fortran_order" => {
                    let word = |word: &str| value.strip_prefix(word);
                    is_column_major = Some(word("True").is_some());
                    word("True").or_else(|| word("False"))?
                }
                "shape" => {
                    let (sides, after) = value.strip_prefix('(')?.split_once(')')?;
                    let sides = sides.trim().trim_end_matches(',').split(',').map(str::trim);
                    let sides: Option<Vec<usize>> = sides.take(MOST_AXES + 1).map(|side| side.parse().ok()).collect();
                    shape = Some(sides.filter(|sides| sides.len() <= MOST_AXES)?);
                    after
                }
                _ => return None,
            };
            rest = rest.trim_start();
            rest = rest.strip_prefix(',').unwrap_or(rest).trim_start();
        }
        (rest == "}").then_some(Header {
            descr: descr?,
            is_column_major: is_column_major?,
            shape: shape?,
        })
    }

    /// Checks that the values take `bytes` bytes.
    fn check(&self, bytes: u64) -> Said<()> {
        let Header { descr, shape, .. } = self;
        let mut kind = descr.chars();
        // `|` marks types of one byte, and `=` the machine's own byte order.
        let is_known = kind.next().is_some_and(|order| "<>=|".contains(order))
            && kind.next().is_some_and(|letter| "uifc".contains(letter));
        let size = descr.get(2..).and_then(|size| size.parse().ok());
        let Some(size) = size.filter(|size| is_known && (1u64..=16).contains(size)) else {
            return Err(format!(
                "holds {descr:?}, which is no type of number that is read: whole numbers, floating point or complex"
            ));
        };
        let said = shape
            .iter()
            .try_fold(size, |bytes, side| bytes.checked_mul(*side as u64));
        match said {
            Some(0) => Err(format!("has shape {shape:?}, which holds no value")),
            Some(said) if said == bytes => Ok(()),
            _ => Err(format!(
                "is not a whole .npy: its header says {shape:?} of {descr}, and {bytes} bytes follow"
            )),
        }
    }
}

/// Returns the text between the quotation marks at the beginning of `text`, and what follows.
fn quoted(text: &str) -> Option<(&str, &str)> {
    let mark = text.chars().next().filter(|mark| "'\"".contains(*mark))?;
    text[1..].split_once(mark)
}

/// Returns the shape (C, H, W) of planes; (H, W) is one colour.
fn planes(shape: &[usize]) -> Said<(usize, usize, usize)> {
    let shape @ (_, height, width) = match *shape {
        [height, width] => (1, height, width),
        [colours, height, width] => (colours, height, width),
        _ => return Err(format!("has shape {shape:?}; a field is (H, W) or (C, H, W)")),
    };
    decode::check(Size { width, height }, MOST_PIXELS)?;
    Ok(shape)
}

/// A phase map, (C, H, W).
pub(crate) enum Map {
    /// Levels of a modulator.
    Levels(Array3<u16>),
    /// Phases in radians.
    Radians(Array3<f32>),
    /// Complex values.
    Field(Array3<Complex32>),
}

/// Reads a phase map: whole numbers are levels, real ones phases in radians. (H, W) is one colour.
///
/// # Errors
/// Returns an error if the type or the number of axes differs, if the planes have too many pixels, or if the file ends
/// early.
pub(crate) fn read_map<R: Read>(npy: Npy<R>) -> Said<Map> {
    let shape = planes(npy.shape())?;
    let whole = |level: i64| u16::try_from(level).unwrap_or(u16::MAX);
    let levels: Said<ArrayD<u16>> = match npy.kind() {
        u8::NAME => npy.converted(|v: u8| v.into()),
        u16::NAME => npy.array(),
        i16::NAME => npy.converted(|v: i16| whole(v.into())),
        i32::NAME => npy.converted(|v: i32| whole(v.into())),
        i64::NAME => npy.converted(whole),
        f32::NAME | f64::NAME | f16::NAME => {
            let phases: ArrayD<f32> = match npy.kind() {
                f32::NAME => npy.array(),
                f64::NAME => npy.converted(|v: f64| v as f32),
                _ => npy.converted(|v: f16| v.to_f32()),
            }?;
            return (phases.into_shape_with_order(shape).map(Map::Radians)).map_err(|e| e.to_string());
        }
        _ => return read_field(npy).map(Map::Field),
    };
    (levels?.into_shape_with_order(shape).map(Map::Levels)).map_err(|e| e.to_string())
}

/// Reads a complex field, complex64 or complex128, as (C, H, W). (H, W) is one colour.
///
/// # Errors
/// Returns an error if the type or the number of axes differs, if the planes have too many pixels, or if the file ends
/// early.
pub(crate) fn read_field<R: Read>(npy: Npy<R>) -> Said<Array3<Complex32>> {
    let shape = planes(npy.shape())?;
    let field: ArrayD<Complex32> = match npy.kind() {
        Complex32::NAME => npy.array(),
        Complex64::NAME => npy.converted(|v: Complex64| Complex32::new(v.re as f32, v.im as f32)),
        _ => {
            return Err(format!(
                "holds numbers of the type {}; a field is complex. Phases in radians are no field: `phasefront pack`, `refocus` and `show` take them as they are with --display. Amplitudes become a field by field.astype(numpy.complex64)",
                npy.header.descr
            ));
        }
    }?;
    (field.into_shape_with_order(shape)).map_err(|e| e.to_string())
}

/// Reads the single plane of an array. If there are more than two axes, those of length 1 are dropped.
///
/// # Errors
/// Returns an error if the shape or type differs, if the plane has too many pixels, or if the file ends early.
pub(crate) fn read_plane<R: Read>(npy: Npy<R>) -> Said<Plane> {
    let shape @ (height, width) = match *npy.shape() {
        [height, width] | [height, width, 1] | [1, height, width] => (height, width),
        [1, 1, height, width] | [1, height, width, 1] => (height, width),
        _ => {
            return Err(format!(
                "has shape {:?}; a depth map is (H, W), (H, W, 1), (1, H, W), (1, H, W, 1) or (1, 1, H, W)",
                npy.shape()
            ));
        }
    };
    decode::check(Size { width, height }, MOST_PIXELS)?;
    let (values, numbers) = numbers(npy)?;
    let values = values.into_shape_with_order(shape).map_err(|e| e.to_string())?;
    Ok(Plane { values, numbers })
}

/// Reads numbers as f32, and returns their type.
fn numbers<R: Read>(npy: Npy<R>) -> Said<(ArrayD<f32>, Numbers)> {
    macro_rules! whole {
        ($type:ty) => {{
            let most = <$type>::MAX as f32;
            (npy.converted(|v: $type| v as f32)?, Numbers::Integers { most })
        }};
    }
    Ok(match npy.kind() {
        "f2" => (npy.converted(f16::to_f32)?, Numbers::Halves),
        "f4" => (npy.array()?, Numbers::Floats),
        "f8" => (npy.converted(|v: f64| v as f32)?, Numbers::Floats),
        "u1" => whole!(u8),
        "u2" => whole!(u16),
        "u4" => whole!(u32),
        "u8" => whole!(u64),
        "i1" => whole!(i8),
        "i2" => whole!(i16),
        "i4" => whole!(i32),
        "i8" => whole!(i64),
        _ => {
            return Err(format!(
                "holds numbers of the type {}; a depth map has float16, float32, float64 or whole numbers of 8 to 64 bits: depth.astype(numpy.float32) makes it so",
                npy.header.descr
            ));
        }
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use ndarray::{Array2, Ix2, Ix3};
    use ndarray_npy::WriteNpyExt;

    fn plane(file: &[u8]) -> Said<Plane> {
        read_plane(Npy::new(file, file.len() as u64)?)
    }

    fn file(header: &str, values: &[u8]) -> Vec<u8> {
        let mut file = b"\x93NUMPY\x01\x00".to_vec();
        file.extend((header.len() as u16).to_le_bytes());
        file.extend(header.as_bytes());
        file.extend(values);
        file
    }

    #[test]
    fn what_numpy_and_other_programs_write_is_read() {
        let want = Array2::from_shape_fn((3, 5), |(y, x)| (y * 5 + x) as f64);
        let mut bytes = Vec::new();
        want.write_npy(&mut bytes).unwrap();
        assert_eq!(read::<f64, Ix2>(&bytes).unwrap(), want);
        let mut bytes = Vec::new();
        want.t().write_npy(&mut bytes).unwrap();
        assert_eq!(read::<f64, Ix2>(&bytes).unwrap(), want.t());
        let values: Vec<u8> = [1.5f32, -2.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        for header in [
            "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2), }",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2), }     \n",
            "{\"shape\":(1,2),\"fortran_order\":False,\"descr\":\"<f4\"}",
        ] {
            let got = read::<f32, Ix2>(&file(header, &values)).unwrap();
            assert_eq!(got.into_raw_vec_and_offset().0, [1.5, -2.0]);
        }
        // A large array is read in several parts.
        let want = Array2::from_shape_fn((300, 500), |(y, x)| (y * 500 + x) as u32);
        let mut bytes = Vec::new();
        want.write_npy(&mut bytes).unwrap();
        assert_eq!(read::<u32, Ix2>(&bytes).unwrap(), want);
    }

    /// A header that nests takes no time, and none panics, whatever shape it says.
    #[test]
    fn headers_that_no_array_has_are_refused_at_once() {
        let (open, close) = ("{1:".repeat(2000), "}".repeat(2000));
        let tuples = format!("{}1{}", "(".repeat(2000), ")".repeat(2000));
        for (descr, shape) in [
            (format!("{open}1{close}"), "(1, 1)".to_owned()),
            (tuples.clone(), "(1, 1)".to_owned()),
            ("'<f4'".to_owned(), tuples),
            ("[('x', '<f4'), ('y', '<f4')]".to_owned(), "(1,)".to_owned()),
            ("'<f4'".to_owned(), format!("({})", "1, ".repeat(100))),
            ("'<f4'".to_owned(), "(3, 0, 4000000000000000000)".to_owned()),
            ("'<f4'".to_owned(), "(4000000000000000000, 0, 3)".to_owned()),
            ("'<f4'".to_owned(), "(0,)".to_owned()),
            ("'<f4'".to_owned(), "(4294967296, 4294967296, 2)".to_owned()),
            ("'<f4'".to_owned(), "(18446744073709551616, 1)".to_owned()),
            ("'<f4'".to_owned(), "(-1, -1)".to_owned()),
            ("'<f4'".to_owned(), "(1, 1".to_owned()),
            ("''".to_owned(), "(1, 1)".to_owned()),
            ("'é4'".to_owned(), "(1, 1)".to_owned()),
            ("'<f99999999999999999999'".to_owned(), "(1, 1)".to_owned()),
            ("'|O'".to_owned(), "(1, 1)".to_owned()),
            ("'<U1'".to_owned(), "(1, 1)".to_owned()),
        ] {
            let header = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}");
            let bytes = file(&header, &[0; 4]);
            assert!(Npy::new(&bytes[..], bytes.len() as u64).is_err(), "{header}");
        }
        let mut long = file("{}", &[]);
        long[6] = 2;
        long[8..].copy_from_slice(&u32::MAX.to_le_bytes());
        long.extend([0xFF; 16]);
        assert!(Npy::new(&long[..], long.len() as u64).is_err_and(|why| why.contains("its header has")));
    }

    #[test]
    fn a_field_is_complex_and_has_two_or_three_axes() {
        let field = |kind: &str, shape: &str, bytes: usize| {
            let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}");
            let file = file(&header, &vec![0; bytes]);
            read_field(Npy::new(&file[..], file.len() as u64)?).map(|field| field.dim())
        };
        assert_eq!(field("<c8", "(2, 3)", 48), Ok((1, 2, 3)));
        assert_eq!(field(">c16", "(3, 1, 2)", 96), Ok((3, 1, 2)));
        assert!(field("<f8", "(2, 3)", 48).is_err_and(|why| why.contains("numpy.complex64")));
        assert!(field("<c8", "(1, 1, 2, 3)", 48).is_err_and(|why| why.contains("[1, 1, 2, 3]")));
        assert!(field("<c8", "(2, 3)", 40).is_err_and(|why| why.contains("40 bytes follow")));
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
                "u4" | "i4" => (*v as u32).to_le_bytes().to_vec(),
                _ => (*v as u64).to_le_bytes().to_vec(),
            };
            values.iter().flat_map(bytes).collect()
        };
        let want = Array2::from_shape_vec((2, 3), values.to_vec()).unwrap();
        for kind in ["f2", "f4", "f8", "u1", "u2", "u4", "u8", "i1", "i2", "i4", "i8"] {
            let header = |order: &str, columns: &str, shape: &str| {
                format!("{{'descr': '{order}{kind}', 'fortran_order': {columns}, 'shape': {shape}, }}\n")
            };
            let size: usize = kind[1..].parse().unwrap();
            let be: Vec<u8> = le(kind).chunks(size).flat_map(|v| v.iter().rev().copied()).collect();
            for shape in ["(2, 3)", "(2, 3, 1)", "(1, 2, 3)", "(1, 1, 2, 3)", "(1, 2, 3, 1)"] {
                let little = file(&header("<", "False", shape), &le(kind));
                assert_eq!(plane(&little).unwrap().values, want, "{kind} {shape}");
                let big = file(&header(">", "False", shape), &be);
                assert_eq!(plane(&big).unwrap().values, want, "{kind} {shape}");
            }
            let columns = file(&header("<", "True", "(3, 2)"), &le(kind));
            assert_eq!(plane(&columns).unwrap().values, want.t(), "{kind}");
            let is_integer = matches!(plane(&columns).unwrap().numbers, Numbers::Integers { .. });
            assert_eq!(is_integer, !kind.starts_with('f'));
            for shape in ["(6,)", "(2, 3, 2)", "(2, 4)", "(2, 2)", "(1, 1, 1, 2, 3)", "(-2, 3)"] {
                assert!(
                    plane(&file(&header("<", "False", shape), &le(kind))).is_err(),
                    "{shape}"
                );
            }
            for end in 0..columns.len() {
                assert!(plane(&columns[..end]).is_err());
            }
        }
        assert!(
            plane(&file(
                "{'descr': '<c8', 'fortran_order': False, 'shape': (2, 3), }",
                &[0; 48]
            ))
            .is_err()
        );
    }
}
