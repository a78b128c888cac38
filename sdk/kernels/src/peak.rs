//! Measures the peak multiply-accumulate rate of an instruction set, on registers only. Benchmarks compare kernels with
//! it in the same run on the same threads.
#![allow(unsafe_code)]

use crate::Isa;
use crate::parallel;
#[cfg(target_arch = "aarch64")]
use std::arch::aarch64::*;
use std::arch::asm;
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;
use std::hint::black_box;
use std::time::{Duration, Instant};

/// The number of rounds between two readings of the clock.
const ROUNDS: u64 = 10_000;

/// A function that runs rounds of multiply-accumulates in registers and returns their number.
type Burn = fn(u64) -> u64;

// Tiles take one product of 16 bits for four multiply-accumulates, so each lane of their steps counts as four.

/// Defines a [`Burn`] with `$sums` registers, initially `$zero`, and `$features`. Each `$step` does `$lanes`
/// multiply-accumulates.
macro_rules! burn {
    ($name:ident, $features:literal, $register:ident $text:literal, $sums:literal x $lanes:literal, $zero:expr,
        |$sum:ident, $x:ident| $step:expr) => {
        fn $name(rounds: u64) -> u64 {
            #[target_feature(enable = $features)]
            fn run(rounds: u64) {
                let $x = black_box($zero);
                let mut sums = [$x; $sums];
                for _ in 0..rounds {
                    for sum in &mut sums {
                        let $sum = *sum;
                        *sum = $step;
                    }
                    // SAFETY: the assembly is empty. It hides a register's value from the compiler, so that the rounds
                    // are not folded.
                    unsafe {
                        asm!($text, inout($register) sums[0], options(nomem, nostack, preserves_flags));
                    }
                }
                black_box(sums);
            }
            // SAFETY: the caller has detected the features.
            unsafe { run(rounds) };
            rounds * $sums * $lanes
        }
    };
}

#[cfg(target_arch = "x86_64")]
burn!(avx2_int8, "avx2", ymm_reg "/* {0} */", 12 x 64, _mm256_setzero_si256(),
    |sum, x| _mm256_add_epi32(sum, _mm256_madd_epi16(sum, x)));
#[cfg(target_arch = "x86_64")]
burn!(avx2_f32, "avx2,fma", ymm_reg "/* {0} */", 12 x 8, _mm256_setzero_ps(), |sum, x| _mm256_fmadd_ps(x, x, sum));
#[cfg(target_arch = "x86_64")]
burn!(avx512, "avx512f", zmm_reg "/* {0} */", 24 x 16, _mm512_setzero_ps(), |sum, x| _mm512_fmadd_ps(x, x, sum));
#[cfg(target_arch = "x86_64")]
burn!(avx512_vnni, "avx512f,avx512bw,avx512vnni", zmm_reg "/* {0} */", 24 x 64, _mm512_setzero_si512(),
    |sum, x| _mm512_dpbusd_epi32(sum, x, x));
#[cfg(target_arch = "aarch64")]
burn!(neon, "neon", vreg "/* {0:v} */", 24 x 4, vdupq_n_f32(0.0), |sum, x| vfmaq_f32(sum, x, x));
#[cfg(target_arch = "aarch64")]
burn!(neon_int8, "neon", vreg "/* {0:v} */", 24 x 16, vdupq_n_s32(0),
    |sum, x| vmlal_high_s16(sum, vreinterpretq_s16_s32(x), vreinterpretq_s16_s32(x)));
#[cfg(target_arch = "aarch64")]
burn!(neon_dotprod, "neon,dotprod", vreg "/* {0:v} */", 24 x 16, vdupq_n_s32(0),
    |sum, x| crate::arm::neon_dotprod::dot::<0>(sum, vreinterpretq_s8_s32(x), vreinterpretq_s8_s32(x)));
#[cfg(target_arch = "aarch64")]
burn!(neon_i8mm, "neon,i8mm", vreg "/* {0:v} */", 24 x 16, vdupq_n_s32(0),
    |sum, x| crate::arm::neon_i8mm::dot::<0>(sum, vreinterpretq_u8_s32(x), vreinterpretq_s8_s32(x)));

#[cfg(target_arch = "x86_64")]
fn amx(rounds: u64) -> u64 {
    use crate::x86::amx::{CONFIG, TILE};
    // SAFETY: the caller has detected AMX. The tiles belong to this thread until they are released.
    unsafe {
        asm!("ldtilecfg [{}]", "tilezero tmm0", "tilezero tmm1", "tilezero tmm4", "tilezero tmm6", "tilezero tmm7",
            in(reg) &raw const CONFIG, options(nostack, readonly));
        for _ in 0..rounds {
            asm!(
                "tdpbsud tmm0, tmm4, tmm6",
                "tdpbsud tmm1, tmm4, tmm7",
                options(nostack, nomem)
            );
        }
        asm!("tilerelease", options(nostack, nomem));
    }
    rounds * 2 * (TILE * TILE * TILE * crate::int8::GROUP) as u64
}

/// Returns the multiply-accumulates per second of all threads of the current rayon pool together, with the int8
/// instructions of `isa`. Returns `None` if this processor lacks them, for plain Rust, and on WebAssembly.
pub fn int8_peak(isa: Isa, duration: Duration) -> Option<f64> {
    let burn: Burn = match isa {
        #[cfg(target_arch = "x86_64")]
        Isa::Amx => amx,
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512Vnni => avx512_vnni,
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => avx2_int8,
        #[cfg(target_arch = "aarch64")]
        Isa::Neon => neon_int8,
        #[cfg(target_arch = "aarch64")]
        Isa::NeonDotprod => neon_dotprod,
        #[cfg(target_arch = "aarch64")]
        Isa::NeonI8mm => neon_i8mm,
        _ => return None,
    };
    Isa::int8().contains(&isa).then(|| rate(burn, duration))
}

/// Returns the multiply-accumulates per second with the f32 instructions of `isa`, as [`int8_peak`] does.
pub fn f32_peak(isa: Isa, duration: Duration) -> Option<f64> {
    let burn: Burn = match isa {
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => avx512,
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => avx2_f32,
        #[cfg(target_arch = "aarch64")]
        Isa::Neon => neon,
        _ => return None,
    };
    Isa::f32().contains(&isa).then(|| rate(burn, duration))
}

/// Returns the sum of the threads' median rates. The median ignores interrupted rounds and the highest clock rates, as
/// the median of frame times does.
fn rate(burn: Burn, duration: Duration) -> f64 {
    let rates = parallel::broadcast(|_| {
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
