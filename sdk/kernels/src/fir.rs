//! Symmetric complex filters along one axis of a plane: half of a separable step of a wave.
//!
//! A plane is two runs of f32, real and imaginary. The arithmetic of every value is the same sequence of additions and
//! fused multiply-adds on every instruction set, so all give the same bits.
#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
mod portable;

use crate::Isa;

/// What a run is cut into: its length is a multiple of this.
pub const RUN: usize = 16;

/// A filter c with c₋ⱼ = cⱼ: `taps[0]` is the centre, `taps[j]` stands at both distances j. Real and imaginary part.
pub type Taps = [[f32; 2]];

/// One value of a register: what an instruction set must know to run the filter.
trait Lanes: Copy {
    const LANES: usize;
    fn splat(value: f32) -> Self;
    /// # Safety
    /// `LANES` values can be read.
    unsafe fn load(from: *const f32) -> Self;
    /// # Safety
    /// `LANES` values can be written.
    unsafe fn store(self, to: *mut f32);
    fn add(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    /// self + a·b, rounded once.
    fn plus(self, a: Self, b: Self) -> Self;
    /// self − a·b, rounded once.
    fn minus(self, a: Self, b: Self) -> Self;
}

/// What a kernel is given: pointers to the run's first centre and its first output, the distance of neighbours, and
/// the run's length.
#[derive(Clone, Copy)]
struct Run {
    source: [*const f32; 2],
    stride: usize,
    out: [*mut f32; 2],
    length: usize,
}

type Kernel = unsafe fn(&Taps, Run);

/// The filter's kernel for one instruction set.
#[derive(Clone, Copy)]
pub struct Fir {
    isa: Isa,
    kernel: Kernel,
}

impl Fir {
    /// The kernel for `isa`; None where this processor lacks it.
    pub fn new(isa: Isa) -> Option<Fir> {
        let kernel: Kernel = match isa {
            Isa::Portable => Some(portable::kernel as Kernel),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512 => avx512::kernel(),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 => avx2::kernel(),
            #[cfg(target_arch = "aarch64")]
            Isa::Neon => Some(neon::kernel as Kernel),
            _ => None,
        }?;
        Some(Fir { isa, kernel })
    }

    /// The fastest kernel of this processor.
    pub fn fastest() -> Fir {
        let portable = Fir {
            isa: Isa::Portable,
            kernel: portable::kernel,
        };
        Isa::f32()
            .into_iter()
            .find_map(Fir::new)
            .unwrap_or(portable)
    }

    /// The instruction set in use.
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// Filters a run: out\[x] = Σⱼ cⱼ·source\[centre + x + j·stride], |j| < `taps.len()`, for all x of `out`.
    ///
    /// # Panics
    /// If `out` is no whole number of [`RUN`]s, its parts differ in length, or the filter reaches beyond `source`.
    pub fn filter(
        &self,
        taps: &Taps,
        source: [&[f32]; 2],
        centre: usize,
        stride: usize,
        out: [&mut [f32]; 2],
    ) {
        let length = out[0].len();
        let reach = taps.len().saturating_sub(1) * stride;
        assert!(!taps.is_empty() && length.is_multiple_of(RUN) && out[1].len() == length);
        assert!(centre >= reach);
        assert!(
            source
                .iter()
                .all(|part| centre + length + reach <= part.len())
        );
        let [re, im] = out;
        let run = Run {
            source: source.map(|part| part[centre..].as_ptr()),
            stride,
            out: [re.as_mut_ptr(), im.as_mut_ptr()],
            length,
        };
        // SAFETY: the asserts above; `new` has found the instruction set.
        unsafe { (self.kernel)(taps, run) };
    }
}

/// The filter over a run, `REGISTERS` registers at a time.
///
/// No closures here: they would not inherit the caller's instruction set.
///
/// # Safety
/// As [`Run`] says; the caller has the instruction set of `V`.
#[inline(always)]
unsafe fn filter<V: Lanes, const REGISTERS: usize>(taps: &Taps, run: Run) {
    let mut x = 0;
    // SAFETY: x + the block's length stays within the run, and the run's neighbours are within the source.
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
/// As [`filter`], for `REGISTERS` registers from `x`.
#[inline(always)]
unsafe fn block<V: Lanes, const REGISTERS: usize>(taps: &Taps, run: Run, x: usize) {
    let zero = V::splat(0.0);
    let (mut re, mut im) = ([zero; REGISTERS], [zero; REGISTERS]);
    let (c, d) = (V::splat(taps[0][0]), V::splat(taps[0][1]));
    // SAFETY: the caller's.
    unsafe {
        let (source_re, source_im) = (run.source[0].add(x), run.source[1].add(x));
        for r in 0..REGISTERS {
            let a = V::load(source_re.add(r * V::LANES));
            let b = V::load(source_im.add(r * V::LANES));
            re[r] = a.mul(c).minus(b, d);
            im[r] = b.mul(c).plus(a, d);
        }
        let mut reach = 0;
        for tap in &taps[1..] {
            reach += run.stride;
            let (c, d) = (V::splat(tap[0]), V::splat(tap[1]));
            for r in 0..REGISTERS {
                let (at_re, at_im) = (source_re.add(r * V::LANES), source_im.add(r * V::LANES));
                let a = V::load(at_re.sub(reach)).add(V::load(at_re.add(reach)));
                let b = V::load(at_im.sub(reach)).add(V::load(at_im.add(reach)));
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
