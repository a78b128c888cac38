//! The instruction sets that have kernels, their detection on this processor, and the choice of a smaller one to
//! measure or test.

use std::sync::OnceLock;

/// An instruction set with its own kernels. Those of one architecture are in ascending order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Isa {
    /// Plain Rust, for every processor.
    Portable,
    /// x86-64 AVX2 with FMA.
    Avx2,
    /// x86-64 AVX-512 (F, BW), for f32 only.
    Avx512,
    /// x86-64 AVX-512 with VNNI, for integers only.
    Avx512Vnni,
    /// x86-64 AMX tiles with int8, in addition to AVX-512, for int8 only.
    Amx,
    /// ARM64 NEON, which every ARM64 processor has.
    Neon,
    /// ARM64 NEON with signed dot products, for int8 only.
    NeonDotprod,
    /// ARM64 NEON with mixed-sign dot products (i8mm), for int8 only.
    NeonI8mm,
    /// WebAssembly 128-bit vectors.
    Simd128,
}

/// The largest instruction set that this process uses.
static LIMIT: OnceLock<Isa> = OnceLock::new();

impl Isa {
    /// The environment variable that names the largest instruction set of a process, for tests.
    pub const VARIABLE: &str = "PHASEFRONT_KERNELS";

    /// Returns a short name for flags and reports.
    pub fn name(self) -> &'static str {
        match self {
            Isa::Portable => "portable",
            Isa::Avx2 => "avx2",
            Isa::Avx512 => "avx512",
            Isa::Avx512Vnni => "vnni",
            Isa::Amx => "amx",
            Isa::Neon => "neon",
            Isa::NeonDotprod => "dotprod",
            Isa::NeonI8mm => "i8mm",
            Isa::Simd128 => "simd128",
        }
    }

    /// Returns the instruction sets that this processor has, largest first. The last is always [`Isa::Portable`].
    pub fn available() -> Vec<Isa> {
        let mut found = Vec::new();
        #[cfg(target_arch = "x86_64")]
        {
            let avx512 = is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bw");
            let vnni = avx512 && is_x86_feature_detected!("avx512vnni");
            if vnni && crate::x86::amx::available() {
                found.push(Isa::Amx);
            }
            if vnni {
                found.push(Isa::Avx512Vnni);
            }
            if avx512 {
                found.push(Isa::Avx512);
            }
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                found.push(Isa::Avx2);
            }
        }
        #[cfg(target_arch = "aarch64")]
        {
            if std::arch::is_aarch64_feature_detected!("i8mm") {
                found.push(Isa::NeonI8mm);
            }
            if std::arch::is_aarch64_feature_detected!("dotprod") {
                found.push(Isa::NeonDotprod);
            }
            // NEON is part of every ARM64 processor.
            found.push(Isa::Neon);
        }
        if cfg!(all(target_arch = "wasm32", target_feature = "simd128")) {
            found.push(Isa::Simd128);
        }
        found.push(Isa::Portable);
        found
    }

    /// Returns the instruction set of this name.
    ///
    /// # Errors
    /// Returns one line with the names of [`Self::available`] if this processor has none of this name.
    pub fn named(name: &str) -> Result<Isa, String> {
        let available = Self::available();
        available.iter().copied().find(|isa| isa.name() == name).ok_or_else(|| {
            let names: Vec<_> = available.into_iter().map(Isa::name).collect();
            format!("no kernels '{name}'; this processor has {}", names.join(", "))
        })
    }

    /// Makes this process use no larger instruction set than this one, in all kernels and in [`wide!`](crate::wide).
    ///
    /// # Errors
    /// Returns an error if kernels were chosen before.
    pub fn limit(self) -> Result<(), String> {
        LIMIT
            .set(self)
            .map_err(|before| format!("the kernels are already limited to '{before}'"))
    }

    /// Returns the instruction set that [`Self::VARIABLE`] names, or `None` if it is not set.
    ///
    /// # Errors
    /// Returns one line if this processor has none of this name.
    pub fn of_variable() -> Result<Option<Isa>, String> {
        match std::env::var_os(Self::VARIABLE) {
            None => Ok(None),
            Some(name) => {
                (Self::named(&name.to_string_lossy()).map(Some)).map_err(|why| format!("{}: {why}", Self::VARIABLE))
            }
        }
    }

    /// Returns whether this process may use this instruction set, if the processor has it. Where [`Self::of_variable`]
    /// is an error, only [`Isa::Portable`] is allowed.
    pub(crate) fn is_allowed(self) -> bool {
        let limit = LIMIT.get_or_init(|| match Self::of_variable() {
            Ok(named) => named.unwrap_or(Self::available()[0]),
            Err(_) => Isa::Portable,
        });
        self <= *limit
    }

    /// Returns the int8 kernels to choose from, fastest first. The last is always [`Isa::Portable`].
    pub fn int8() -> Vec<Isa> {
        Self::of(|isa| isa != Isa::Avx512)
    }

    /// Returns the fastest int8 kernels here for hidden layers of `filters` filters. A half-empty AMX tile is slower
    /// than VNNI.
    pub fn int8_for(filters: usize) -> Isa {
        let found = Isa::int8();
        match (found[0], found.get(1)) {
            (Isa::Amx, Some(&next)) if filters <= 8 => next,
            (fastest, _) => fastest,
        }
    }

    /// Returns the f32 kernels to choose from, fastest first. The last is always [`Isa::Portable`].
    pub fn f32() -> Vec<Isa> {
        Self::of(|isa| matches!(isa, Isa::Avx512 | Isa::Avx2 | Isa::Neon | Isa::Simd128 | Isa::Portable))
    }

    /// Returns the kernels of [`fir`](crate::fir) to choose from, fastest first. The last is always [`Isa::Portable`].
    pub fn fir() -> Vec<Isa> {
        let has = |isa| {
            matches!(
                isa,
                Isa::Avx512Vnni | Isa::Avx2 | Isa::Neon | Isa::Simd128 | Isa::Portable
            )
        };
        Self::of(has)
    }

    fn of(has_kernels: impl Fn(Isa) -> bool) -> Vec<Isa> {
        let all = Self::available().into_iter();
        all.filter(|isa| isa.is_allowed() && has_kernels(*isa)).collect()
    }
}

impl std::fmt::Display for Isa {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
