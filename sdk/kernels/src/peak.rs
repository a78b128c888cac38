//! The multiply-accumulates that an instruction set does here at its best: registers alone, no memory. What a kernel is
//! measured against, in the same run, on the same threads.

use crate::Isa;
use std::time::{Duration, Instant};

/// Rounds between looks at the clock.
const ROUNDS: u64 = 10_000;

/// Runs rounds of multiply-accumulates in registers and yields how many it did.
pub(crate) type Burn = fn(u64) -> u64;

/// Multiply-accumulates a second of all threads of the current rayon pool together, with the int8 instructions of
/// `isa`; `None` where it has none here, or none of its own (portable).
pub fn int8_peak(isa: Isa, duration: Duration) -> Option<f64> {
    let burn: Burn = match isa {
        #[cfg(target_arch = "x86_64")]
        Isa::Amx => crate::amx::burn,
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512Vnni => crate::avx512_vnni::burn,
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => crate::avx2::int8_burn,
        #[cfg(target_arch = "aarch64")]
        Isa::NeonDotprod => crate::neon_dotprod::burn,
        #[cfg(target_arch = "aarch64")]
        Isa::NeonI8mm => crate::neon_i8mm::burn,
        #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
        Isa::Simd128 => crate::simd128::int8_burn,
        _ => return None,
    };
    Isa::int8().contains(&isa).then(|| rate(burn, duration))
}

/// The same with the f32 instructions of `isa`.
pub fn f32_peak(isa: Isa, duration: Duration) -> Option<f64> {
    let burn: Burn = match isa {
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => crate::avx512::burn,
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => crate::avx2::f32_burn,
        #[cfg(target_arch = "aarch64")]
        Isa::Neon => crate::neon::burn,
        #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
        Isa::Simd128 => crate::simd128::f32_burn,
        _ => return None,
    };
    Isa::f32().contains(&isa).then(|| rate(burn, duration))
}

/// The sum of the threads' median rates: like the frames beside it, neither a round that the system interrupted nor the
/// clock's best moment.
fn rate(burn: Burn, duration: Duration) -> f64 {
    let rates = rayon::broadcast(|_| {
        let start = Instant::now();
        let mut rates = Vec::new();
        while rates.is_empty() || start.elapsed() < duration {
            let round = Instant::now();
            let done = burn(ROUNDS);
            rates.push(done as f64 / round.elapsed().as_secs_f64());
        }
        let middle = rates.len() / 2;
        *rates.select_nth_unstable_by(middle, f64::total_cmp).1
    });
    rates.into_iter().sum()
}
