//! Fingerprints that identify data.

/// A 64-bit FNV-1a hash, the same on every machine. It does not protect against deliberate collisions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fingerprint(u64);

impl Default for Fingerprint {
    fn default() -> Self {
        Fingerprint(0xcbf2_9ce4_8422_2325)
    }
}

impl Fingerprint {
    /// Computes the fingerprint of `bytes`.
    pub fn of(bytes: &[u8]) -> Self {
        let mut all = Self::default();
        all.bytes(bytes);
        all
    }

    /// Adds bytes to the fingerprint.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.0 = bytes.iter().fold(self.0, |hash, byte| {
            (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3)
        });
    }

    /// Adds numbers to the fingerprint, as 64 bits each, little-endian.
    pub fn numbers(&mut self, numbers: &[usize]) {
        for number in numbers {
            self.bytes(&(*number as u64).to_le_bytes());
        }
    }

    /// Returns the hash value.
    pub fn value(self) -> u64 {
        self.0
    }
}

impl std::fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}
