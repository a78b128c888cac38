//! Kernels for x86-64, one file for each instruction set.

pub(crate) mod amx;
pub(crate) mod avx2;
pub(crate) mod avx512;
pub(crate) mod avx512_vnni;
mod winograd;
