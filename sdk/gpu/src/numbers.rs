//! The numbers that a network is computed in on a GPU.

use super::{Device, GpuError, Result};
use phasefront_core::method::network::Precision;
use phasefront_core::method::network::chain::Chain;

/// Channels of a group: a program reads and writes channels in fours.
pub(super) const GROUP: usize = 4;

/// The numbers that an f32 chain is computed in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Float {
    /// 16 bits where the GPU has them, else 32.
    #[default]
    Fastest,
    /// 16 bits for activations and weights, sums in both: to 2 % of the largest value, typically 0.3 %.
    F16,
    /// 32 bits.
    F32,
}

/// The numbers of a planned chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Numbers {
    F32,
    F16,
    Int8,
}

impl Numbers {
    /// What a chain is computed in on `device`.
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

    /// Its name in reports.
    pub(super) fn name(self) -> &'static str {
        match self {
            Numbers::F32 => "f32",
            Numbers::F16 => "f16",
            Numbers::Int8 => "int8",
        }
    }

    /// Bytes of a group's value at a pixel.
    pub(super) fn value_bytes(self) -> usize {
        match self {
            Numbers::F32 => 16,
            Numbers::F16 => 8,
            Numbers::Int8 => 4,
        }
    }

    /// How programs call a group's value at a pixel.
    pub(super) fn value(self) -> &'static str {
        match self {
            Numbers::F32 => "vec4<f32>",
            Numbers::F16 => "vec4<f16>",
            Numbers::Int8 => "u32",
        }
    }
}
