//! Levels with more bits than a byte, distributed over the red, green and blue bytes of one pixel.

use crate::runtime::error::{Error, Result};

/// The assignment of a level's bits to the bits of a pixel's red, green and blue bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Split {
    /// The level's bit for each bit of each byte, from the highest down, or [`NOTHING`] if it is always 0.
    bits: [[u8; 8]; 3],
    /// The number of bits of a level.
    count: u32,
}

const NOTHING: u8 = u8::MAX;

impl Split {
    /// Creates a split from the level's bits in red, green and blue, each listed from the byte's highest bit down. The
    /// remaining lower bits are 0.
    ///
    /// # Errors
    /// Returns an error if a byte has more than 8 bits, or if the bits are not 0, 1, 2, … up to at most 15, each once.
    pub fn new(bytes: [&[u8]; 3]) -> Result<Self> {
        let refuse = |what: String| Err(Error::Setting(format!("a level's bits in red, green and blue: {what}")));
        let mut bits = [[NOTHING; 8]; 3];
        for (places, byte) in bits.iter_mut().zip(bytes) {
            if byte.len() > 8 {
                return refuse(format!("{} in one byte, which has 8", byte.len()));
            }
            places[..byte.len()].copy_from_slice(byte);
        }
        let mut all = bytes.concat();
        all.sort_unstable();
        let count = all.len();
        if !(1..=16).contains(&count) || !all.iter().enumerate().all(|(n, bit)| n == usize::from(*bit)) {
            return refuse(format!("{all:?}; each from 0 to at most 15 must stand there once"));
        }
        Ok(Split {
            bits,
            count: count as u32,
        })
    }

    /// Returns the number of bits of a level.
    pub fn bits(&self) -> u32 {
        self.count
    }

    /// Returns the red, green and blue bytes of `level`.
    pub fn pixel(&self, level: u16) -> [u8; 3] {
        self.bits.map(|byte| {
            let set = |bit: u8| bit != NOTHING && (level >> bit) & 1 == 1;
            byte.iter().fold(0, |value, bit| value << 1 | u8::from(set(*bit)))
        })
    }

    /// Returns the level of a pixel. This is the inverse of [`Self::pixel`].
    pub fn level(&self, pixel: [u8; 3]) -> u16 {
        let mut level = 0;
        for (byte, value) in self.bits.iter().zip(pixel) {
            for (place, bit) in byte.iter().enumerate().filter(|(_, bit)| **bit != NOTHING) {
                level |= u16::from((value >> (7 - place)) & 1) << bit;
            }
        }
        level
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn golden_pixels() {
        // Santec, "10bit encoding format in RGB color": R7 R6 R5 G7 G6 G5 B7 B6 B5 B4.
        let santec = Split::new([&[9, 8, 7], &[6, 5, 4], &[3, 2, 1, 0]]).unwrap();
        assert_eq!(santec.pixel(0b10_1110_0110), [0b1010_0000, 0b1100_0000, 0b0110_0000]);
        assert_eq!(santec.pixel(1023), [0b1110_0000, 0b1110_0000, 0b1111_0000]);
        // Meadowlark: the 8 high bits in red, the 2 low bits in blue.
        let meadowlark = Split::new([&[9, 8, 7, 6, 5, 4, 3, 2], &[], &[1, 0]]).unwrap();
        assert_eq!(meadowlark.pixel(0b10_1110_0110), [0b1011_1001, 0, 0b1000_0000]);
        for split in [santec, meadowlark] {
            assert_eq!(split.bits(), 10);
            assert!((0..1024).all(|level| split.level(split.pixel(level)) == level));
        }
    }

    #[test]
    fn bits_that_are_no_level_are_refused() {
        let nine: &[u8] = &[8, 7, 6, 5, 4, 3, 2, 1, 0];
        let cases: [[&[u8]; 3]; 4] = [
            [nine, &[], &[]],
            [&[0, 1], &[1], &[]],
            [&[1, 2], &[], &[]],
            [&[], &[], &[]],
        ];
        for bytes in cases {
            assert!(Split::new(bytes).is_err(), "{bytes:?}");
        }
    }
}
