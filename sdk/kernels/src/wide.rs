//! Plain loops in the widest vectors that the processor has.
#![allow(unsafe_code)]

/// Computes an expression, compiled once for each instruction set with wider vectors than the target is known to have:
/// what is inlined into it is vectorised so. Sums and products keep their order and are not fused: the bits are the
/// same.
///
/// A macro, so that each instruction set has a copy of its own: one closure that several call would be compiled once,
/// for none of them. So whatever the expression calls must be inlined too.
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

/// Whether [`in_avx512`] can be called.
#[inline]
pub fn has_avx512() -> bool {
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl");
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// Whether [`in_avx2`] can be called.
#[inline]
pub fn has_avx2() -> bool {
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx2");
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// Calls `work`, inlined, with the instructions of AVX-512; for [`wide`](crate::wide).
///
/// # Panics
/// Where [`has_avx512`] says no.
#[inline]
pub fn in_avx512<R>(work: impl FnOnce() -> R) -> R {
    assert!(has_avx512(), "a processor with AVX-512");
    #[cfg(target_arch = "x86_64")]
    // SAFETY: the processor has the features.
    return unsafe { avx512(work) };
    #[cfg(not(target_arch = "x86_64"))]
    work()
}

/// Calls `work`, inlined, with the instructions of AVX2; for [`wide`](crate::wide).
///
/// # Panics
/// Where [`has_avx2`] says no.
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
