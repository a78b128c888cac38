//! Runs plain loops in the widest vectors of the processor.
#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
use crate::Isa;

/// Computes an expression, compiled once for each instruction set with wider vectors than the target guarantees. Code
/// that is inlined into it is vectorised accordingly. Sums and products keep their order and are not fused, so the
/// result is bit-identical.
///
/// It is a macro, so that each instruction set gets its own copy: a closure with several callers would be compiled
/// once, for none of them. Everything that the expression calls must therefore be inlined too. A call of a function
/// that is not inlined and returns a slice even keeps the expression itself from being inlined; `tests/vectors` finds
/// that.
#[macro_export]
macro_rules! wide {
    ($work:expr) => {
        if $crate::has_avx512() {
            $crate::in_avx512(|| $work)
        } else if $crate::has_avx2() {
            $crate::in_avx2(|| $work)
        } else {
            $work
        }
    };
}

/// Checks whether [`in_avx512`] can be called.
#[inline]
pub fn has_avx512() -> bool {
    #[cfg(target_arch = "x86_64")]
    return Isa::Avx512.is_allowed()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl");
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// Checks whether [`in_avx2`] can be called.
#[inline]
pub fn has_avx2() -> bool {
    #[cfg(target_arch = "x86_64")]
    return Isa::Avx2.is_allowed() && is_x86_feature_detected!("avx2");
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// Calls `work`, inlined, with AVX-512 instructions. For [`wide`](crate::wide).
///
/// # Panics
/// Panics if [`has_avx512`] returns false.
#[inline]
pub fn in_avx512<R>(work: impl FnOnce() -> R) -> R {
    assert!(has_avx512(), "a processor with AVX-512");
    #[cfg(target_arch = "x86_64")]
    // SAFETY: the processor has the features.
    return unsafe { avx512(work) };
    #[cfg(not(target_arch = "x86_64"))]
    work()
}

/// Calls `work`, inlined, with AVX2 instructions. For [`wide`](crate::wide).
///
/// # Panics
/// Panics if [`has_avx2`] returns false.
#[inline]
pub fn in_avx2<R>(work: impl FnOnce() -> R) -> R {
    assert!(has_avx2(), "a processor with AVX2");
    #[cfg(target_arch = "x86_64")]
    // SAFETY: the processor has the feature.
    return unsafe { avx2(work) };
    #[cfg(not(target_arch = "x86_64"))]
    work()
}

#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn avx512<R>(work: impl FnOnce() -> R) -> R {
    work()
}

#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx2")]
fn avx2<R>(work: impl FnOnce() -> R) -> R {
    work()
}
