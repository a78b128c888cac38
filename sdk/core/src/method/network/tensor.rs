//! Constant tensors of an ONNX file. They are checked once: the number of values matches the shape, and real values are
//! finite.

use super::proto::{Tensor, data_type};

/// A constant and its values. For types that a chain does not use, only the name is kept, for error messages.
#[derive(Debug)]
pub(super) struct Constant {
    name: String,
    shape: Vec<usize>,
    values: Values,
}

#[derive(Debug)]
enum Values {
    F32(Vec<f32>),
    U8(Vec<u8>),
    I8(Vec<i8>),
    I32(Vec<i32>),
    Other(&'static str),
}

impl Constant {
    pub(super) fn new(tensor: &Tensor) -> Result<Constant, String> {
        let name = tensor.name.clone();
        if !tensor.external_data.is_empty() || tensor.data_location == Some(1) {
            return Err(format!(
                "tensor '{name}' lies in another file; store the weights inside the model"
            ));
        }
        let shape: Option<Vec<usize>> = tensor.dims.iter().map(|&d| usize::try_from(d).ok()).collect();
        let shape = shape.ok_or_else(|| format!("tensor '{name}' has a negative dimension"))?;
        let raw = &tensor.raw_data[..];
        let values = match tensor.data_type {
            data_type::FLOAT if raw.is_empty() => Values::F32(tensor.float_data.clone()),
            data_type::FLOAT => Values::F32(words(raw).map(f32::from_le_bytes).collect()),
            data_type::INT32 if raw.is_empty() => Values::I32(tensor.int32_data.clone()),
            data_type::INT32 => Values::I32(words(raw).map(i32::from_le_bytes).collect()),
            data_type::UINT8 if raw.is_empty() => Values::U8(tensor.int32_data.iter().map(|&v| v as u8).collect()),
            data_type::UINT8 => Values::U8(raw.to_vec()),
            data_type::INT8 if raw.is_empty() => Values::I8(tensor.int32_data.iter().map(|&v| v as i8).collect()),
            data_type::INT8 => Values::I8(raw.iter().map(|&v| v as i8).collect()),
            other => Values::Other(data_type::name(other)),
        };
        let count = match &values {
            Values::F32(v) => Some(v.len()),
            Values::U8(v) => Some(v.len()),
            Values::I8(v) => Some(v.len()),
            Values::I32(v) => Some(v.len()),
            Values::Other(_) => None,
        };
        let expected = shape.iter().try_fold(1usize, |n, &d| n.checked_mul(d));
        if count.is_some() && count != expected {
            return Err(format!(
                "tensor '{name}' has shape {shape:?} but {} values",
                count.unwrap_or(0)
            ));
        }
        if let Values::F32(v) = &values
            && let Some(bad) = v.iter().find(|v| !v.is_finite())
        {
            return Err(format!("tensor '{name}' holds {bad}; every value must be finite"));
        }
        Ok(Constant { name, shape, values })
    }

    pub(super) fn shape(&self) -> &[usize] {
        &self.shape
    }

    pub(super) fn f32s(&self) -> Result<&[f32], String> {
        if let Values::F32(v) = &self.values {
            Ok(v)
        } else {
            Err(self.wrong_type("f32"))
        }
    }

    pub(super) fn u8s(&self) -> Result<&[u8], String> {
        if let Values::U8(v) = &self.values {
            Ok(v)
        } else {
            Err(self.wrong_type("u8"))
        }
    }

    pub(super) fn i8s(&self) -> Result<&[i8], String> {
        if let Values::I8(v) = &self.values {
            Ok(v)
        } else {
            Err(self.wrong_type("i8"))
        }
    }

    pub(super) fn i32s(&self) -> Result<&[i32], String> {
        if let Values::I32(v) = &self.values {
            Ok(v)
        } else {
            Err(self.wrong_type("i32"))
        }
    }

    /// Returns whether all values are integer zeros.
    pub(super) fn is_zero(&self) -> bool {
        match &self.values {
            Values::U8(v) => v.iter().all(|&v| v == 0),
            Values::I8(v) => v.iter().all(|&v| v == 0),
            Values::I32(v) => v.iter().all(|&v| v == 0),
            Values::F32(_) | Values::Other(_) => false,
        }
    }

    fn wrong_type(&self, right: &str) -> String {
        let is = match self.values {
            Values::F32(_) => "f32",
            Values::U8(_) => "u8",
            Values::I8(_) => "i8",
            Values::I32(_) => "i32",
            Values::Other(name) => name,
        };
        format!("tensor '{}' is {is}; {right} is right", self.name)
    }
}

fn words(raw: &[u8]) -> impl Iterator<Item = [u8; 4]> + '_ {
    raw.as_chunks::<4>().0.iter().copied()
}
