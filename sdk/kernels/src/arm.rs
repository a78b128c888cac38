//! Kernels for ARM64, one file for each instruction set.

pub(crate) mod neon;
pub(crate) mod neon_dotprod;
pub(crate) mod neon_i8mm;
pub(crate) mod winograd;
