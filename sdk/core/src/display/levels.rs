//! The levels of a hologram in memory: bytes, or words for a display of more than 8 bits.

use crate::parallel::prelude::*;
use phasefront_kernels::wide;

/// The number of levels that a thread converts at a time.
const PART: usize = 1 << 14;

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

/// Writes the upper 8 bits of `words`, levels of `bits` bits, 8 to 16, to `bytes`. Does not allocate.
///
/// # Panics
/// Panics if the lengths differ.
#[doc(hidden)]
pub fn upper_bytes(words: &[u16], bits: u32, bytes: &mut [u8]) {
    assert_eq!(words.len(), bytes.len());
    let parts = bytes.par_chunks_mut(PART).zip(words.par_chunks(PART));
    parts.for_each(|(bytes, words)| {
        wide!(for (byte, word) in bytes.iter_mut().zip(words) {
            *byte = (word >> (bits - 8)) as u8;
        });
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn upper_bytes_are_those_of_each_word() {
        for bits in [8, 10, 16] {
            let words: Vec<u16> = (0..PART + 5).map(|i| (i * 37 % (1 << bits)) as u16).collect();
            let mut bytes = vec![0; words.len()];
            upper_bytes(&words, bits, &mut bytes);
            let expected = words.iter().map(|word| u32::from(*word) * 256 / (1 << bits));
            assert!(bytes.iter().map(|byte| u32::from(*byte)).eq(expected), "{bits}");
        }
    }
}
