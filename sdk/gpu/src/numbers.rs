//! The number formats of a network on a GPU.

use super::{Device, GpuError, Result};
use phasefront_core::method::network::Precision;
use phasefront_core::method::network::chain::Chain;

/// The channels of a group: programs read and write four channels at a time.
pub(super) const GROUP: usize = 4;

/// The number format of an f32 chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Float {
    /// 16 bits if the GPU supports them, else 32.
    #[default]
    Fastest,
    /// 16 bits for activations and weights, and both widths in sums. The error is up to 2 % of the largest value,
    /// typically 0.3 %.
    F16,
    /// 32 bits.
    F32,
}

/// The number format of a planned chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Numbers {
    F32,
    F16,
    Int8,
}

impl Numbers {
    /// Returns the number format of a chain on `device`.
    pub(super) fn of(device: &Device, chain: &Chain, float: Float) -> Result<Numbers> {
        if chain.halved && !chain.inputs.is_multiple_of(GROUP) {
            return Err(GpuError::Refused(format!(
                "{} input channels at half the resolution; fours are right, the CPU takes others",
                chain.inputs
            )));
        }
        Ok(match (chain.precision, float) {
            (Precision::Int8, _) => Numbers::Int8,
            (_, Float::F32) => Numbers::F32,
            (_, Float::Fastest) if !device.features().half => Numbers::F32,
            (_, Float::F16) if !device.features().half => {
                return Err(GpuError::Refused(format!(
                    "{} has no 16-bit floating point (shader-f16); f32 is right",
                    device.name()
                )));
            }
            _ => Numbers::F16,
        })
    }

    /// Returns the name for reports.
    pub(super) fn name(self) -> &'static str {
        match self {
            Numbers::F32 => "f32",
            Numbers::F16 => "f16",
            Numbers::Int8 => "int8",
        }
    }

    /// Returns the bytes of one group at a pixel.
    pub(super) fn value_bytes(self) -> usize {
        match self {
            Numbers::F32 => 16,
            Numbers::F16 => 8,
            Numbers::Int8 => 4,
        }
    }

    /// Returns the WGSL type of one group at a pixel.
    pub(super) fn value(self) -> &'static str {
        match self {
            Numbers::F32 => "vec4<f32>",
            Numbers::F16 => "vec4<f16>",
            Numbers::Int8 => "u32",
        }
    }
}
