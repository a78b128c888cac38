//! The instruction sets that have kernels, and their detection on this processor.

/// An instruction set with its own kernels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Isa {
    /// Plain Rust, for every processor.
    Portable,
    /// x86-64 AVX2 with FMA.
    Avx2,
    /// x86-64 AVX-512 (F, BW), for f32 only.
    Avx512,
    /// x86-64 AVX-512 with VNNI, for int8 only.
    Avx512Vnni,
    /// x86-64 AMX tiles with int8, in addition to AVX-512, for int8 only.
    Amx,
    /// ARM64 NEON, for f32 only.
    Neon,
    /// ARM64 NEON with signed dot products, for int8 only.
    NeonDotprod,
    /// ARM64 NEON with mixed-sign dot products (i8mm), for int8 only.
    NeonI8mm,
    /// WebAssembly 128-bit vectors.
    Simd128,
}

impl Isa {
    /// Returns a short name for reports.
    pub fn name(self) -> &'static str {
        match self {
            Isa::Portable => "portable",
            Isa::Avx2 => "avx2",
            Isa::Avx512 => "avx512",
            Isa::Avx512Vnni => "avx512-vnni",
            Isa::Amx => "amx-int8",
            Isa::Neon => "neon",
            Isa::NeonDotprod => "neon-dotprod",
            Isa::NeonI8mm => "neon-i8mm",
            Isa::Simd128 => "simd128",
        }
    }

    /// Returns the int8 kernels that this processor runs, fastest first. The last is always [`Isa::Portable`].
    pub fn int8() -> Vec<Isa> {
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
        }
        if cfg!(all(target_arch = "wasm32", target_feature = "simd128")) {
            found.push(Isa::Simd128);
        }
        found.push(Isa::Portable);
        found
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

    /// Returns the f32 kernels that this processor runs, fastest first. The last is always [`Isa::Portable`].
    pub fn f32() -> Vec<Isa> {
        let mut found = Vec::new();
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bw") {
                found.push(Isa::Avx512);
            }
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                found.push(Isa::Avx2);
            }
        }
        // NEON is part of every ARM64 processor.
        if cfg!(target_arch = "aarch64") {
            found.push(Isa::Neon);
        }
        if cfg!(all(target_arch = "wasm32", target_feature = "simd128")) {
            found.push(Isa::Simd128);
        }
        found.push(Isa::Portable);
        found
    }
}

impl std::fmt::Display for Isa {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
