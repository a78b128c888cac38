//! Symmetric complex filters along one axis of a plane: half of a separable propagation step of a wave.
//!
//! A plane is two runs of f32, real and imaginary. Every value is computed by the same sequence of additions and fused
//! multiply-adds on every instruction set, so all give the same bits, except WebAssembly, which cannot fuse.
#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
mod portable;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod simd128;

use crate::Isa;

/// The divisor of the length of every run.
pub const RUN: usize = 16;

/// A filter c with c₋ⱼ = cⱼ: `taps[0]` is the centre and `taps[j]` applies at both distances j. Each tap is a real and
/// an imaginary part.
pub type Taps = [[f32; 2]];

/// A register of an instruction set, with the operations that the filter needs.
trait Lanes: Copy {
    const LANES: usize;
    fn splat(value: f32) -> Self;
    /// # Safety
    /// The caller must ensure that `LANES` values can be read.
    unsafe fn load(from: *const f32) -> Self;
    /// # Safety
    /// The caller must ensure that `LANES` values can be written.
    unsafe fn store(self, to: *mut f32);
    fn add(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    /// Returns self + a·b, rounded once if the instruction set can.
    fn plus(self, a: Self, b: Self) -> Self;
    /// Returns self − a·b, rounded once if the instruction set can.
    fn minus(self, a: Self, b: Self) -> Self;
}

/// The arguments of a kernel: the source, the places of the taps, the run's first output and its length.
#[derive(Clone, Copy)]
struct Run<'a> {
    source: [*const f32; 2],
    places: &'a [[usize; 2]],
    out: [*mut f32; 2],
    length: usize,
}

type Kernel = unsafe fn(&Taps, Run<'_>);

/// The filter's kernel for one instruction set.
#[derive(Clone, Copy)]
pub struct Fir {
    isa: Isa,
    kernel: Kernel,
}

impl Fir {
    /// Returns the kernel for `isa`, or `None` if this processor lacks the instruction set.
    pub fn new(isa: Isa) -> Option<Fir> {
        let kernel: Kernel = match isa {
            Isa::Portable => Some(portable::kernel as Kernel),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512 => avx512::kernel(),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 => avx2::kernel(),
            #[cfg(target_arch = "aarch64")]
            Isa::Neon => Some(neon::kernel as Kernel),
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Isa::Simd128 => Some(simd128::kernel as Kernel),
            _ => None,
        }?;
        Some(Fir { isa, kernel })
    }

    /// Returns the fastest kernel of this processor.
    pub fn fastest() -> Fir {
        let portable = Fir {
            isa: Isa::Portable,
            kernel: portable::kernel,
        };
        Isa::f32().into_iter().find_map(Fir::new).unwrap_or(portable)
    }

    /// Returns the instruction set in use.
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// Filters a run: out\[x] = c₀·source\[places\[0]\[0] + x] + Σⱼ cⱼ·(source\[places\[j]\[0] + x] +
    /// source\[places\[j]\[1] + x]) for all x of `out`. Along a row the places of tap j are j before and j after the
    /// centre. Along a column they are wherever those rows are stored.
    ///
    /// # Panics
    /// Panics if the length of `out` is not a multiple of [`RUN`], its parts differ in length, or a place is outside
    /// `source`.
    pub fn filter(&self, taps: &Taps, source: [&[f32]; 2], places: &[[usize; 2]], out: [&mut [f32]; 2]) {
        let length = out[0].len();
        assert!(!taps.is_empty() && taps.len() == places.len());
        assert!(length.is_multiple_of(RUN) && out[1].len() == length);
        let last = places.as_flattened().iter().fold(0, |last, at| last.max(*at)) + length;
        assert!(last <= source[0].len() && last <= source[1].len());
        let [re, im] = out;
        let run = Run {
            source: source.map(<[f32]>::as_ptr),
            places,
            out: [re.as_mut_ptr(), im.as_mut_ptr()],
            length,
        };
        // SAFETY: the asserts above hold, and `new` has detected the instruction set.
        unsafe { (self.kernel)(taps, run) };
    }
}

/// Filters a run, `REGISTERS` registers at a time.
///
/// It uses no closures, because they would not inherit the caller's instruction set.
///
/// # Safety
/// The caller must uphold the contract of [`Run`] and have detected the instruction set of `V`.
#[inline(always)]
unsafe fn filter<V: Lanes, const REGISTERS: usize>(taps: &Taps, run: Run<'_>) {
    let mut x = 0;
    // SAFETY: x + the block's length stays within the run, and the run's places are within the source.
    unsafe {
        while x + REGISTERS * V::LANES <= run.length {
            block::<V, REGISTERS>(taps, run, x);
            x += REGISTERS * V::LANES;
        }
        while x < run.length {
            block::<V, 1>(taps, run, x);
            x += V::LANES;
        }
    }
}

/// # Safety
/// The contract of [`filter`], for `REGISTERS` registers from `x`.
#[inline(always)]
unsafe fn block<V: Lanes, const REGISTERS: usize>(taps: &Taps, run: Run<'_>, x: usize) {
    let zero = V::splat(0.0);
    let (mut re, mut im) = ([zero; REGISTERS], [zero; REGISTERS]);
    let (c, d) = (V::splat(taps[0][0]), V::splat(taps[0][1]));
    let centre = run.places[0][0] + x;
    // SAFETY: the caller upholds this function's contract.
    unsafe {
        for r in 0..REGISTERS {
            let a = V::load(run.source[0].add(centre + r * V::LANES));
            let b = V::load(run.source[1].add(centre + r * V::LANES));
            re[r] = a.mul(c).minus(b, d);
            im[r] = b.mul(c).plus(a, d);
        }
        for (tap, place) in taps[1..].iter().zip(&run.places[1..]) {
            let (c, d) = (V::splat(tap[0]), V::splat(tap[1]));
            let (before, behind) = (place[0] + x, place[1] + x);
            for r in 0..REGISTERS {
                let (before, behind) = (before + r * V::LANES, behind + r * V::LANES);
                let a = V::load(run.source[0].add(before)).add(V::load(run.source[0].add(behind)));
                let b = V::load(run.source[1].add(before)).add(V::load(run.source[1].add(behind)));
                re[r] = re[r].plus(a, c).minus(b, d);
                im[r] = im[r].plus(b, c).plus(a, d);
            }
        }
        for r in 0..REGISTERS {
            re[r].store(run.out[0].add(x + r * V::LANES));
            im[r].store(run.out[1].add(x + r * V::LANES));
        }
    }
}
