//! The levels of a hologram in memory: bytes, or words for a display of more than 8 bits.

/// A hologram's levels, (C, H, W).
#[derive(Debug, Clone, Copy)]
pub enum Levels<'a> {
    /// Levels of up to 8 bits, as the planned response produces them.
    Bytes(&'a [u8]),
    /// Levels of 9 or 10 bits.
    Words(&'a [u16]),
}

/// The memory that a hologram's levels, (C, H, W), are written to.
#[derive(Debug)]
pub enum LevelsMut<'a> {
    /// Memory for the levels that the response produces. For a display of more than 8 bits these are the upper 8 bits.
    Bytes(&'a mut [u8]),
    /// Memory for all bits of the levels of a display of more than 8 bits.
    Words(&'a mut [u16]),
}
