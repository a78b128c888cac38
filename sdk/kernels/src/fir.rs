//! Symmetric complex filters along one axis of a plane, in 16-bit fixed point: half of a separable propagation step of
//! a wave.
//!
//! A pixel of a wave is a real and an imaginary part of 15 bits, so that two pixels can be added in 16. Mirrored pixels
//! are added first and multiplied by their common tap. Products are summed exactly in 32 bits, and only the sum is
//! rounded and saturated. All instruction sets therefore give the same bits.
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

/// The least and the most that a filter returns for a part of a pixel.
pub const LEAST: i16 = -1 << 14;
/// See [`LEAST`].
pub const MOST: i16 = (1 << 14) - 1;

/// A wave at a pixel, in units that the caller chooses: the real part in the lower half, the imaginary part in the
/// upper. Both are from [`LEAST`] to [`MOST`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(transparent)]
pub struct Pixel(u32);

impl Pixel {
    /// Darkness.
    pub const ZERO: Pixel = Pixel::new(0, 0);

    /// Returns the pixel of two parts, of which the lower 16 bits count.
    #[inline(always)]
    pub const fn new(re: i32, im: i32) -> Self {
        Pixel((re & 0xffff) as u32 | (im as u32) << 16)
    }

    /// Returns the real part.
    #[inline(always)]
    pub const fn re(self) -> i32 {
        (self.0 << 16) as i32 >> 16
    }

    /// Returns the imaginary part.
    #[inline(always)]
    pub const fn im(self) -> i32 {
        self.0 as i32 >> 16
    }

    /// Returns this pixel with a share of it, in units of 2⁻¹⁵, replaced with the same share of `light`. The parts of
    /// both must differ by less than 2¹⁵.
    #[inline(always)]
    pub const fn blend(self, light: Pixel, share: i32) -> Pixel {
        const fn part(part: i32, light: i32, share: i32) -> i32 {
            part + ((share * (light - part) + (1 << 14)) >> 15)
        }
        Pixel::new(part(self.re(), light.re(), share), part(self.im(), light.im(), share))
    }
}

/// A filter c with c₋ⱼ = cⱼ, rounded to fixed point.
#[derive(Debug, Clone)]
pub struct Taps {
    /// The centre, then the taps at distances 1, 2 …
    taps: Vec<Tap>,
    /// The number of fractional bits of a tap.
    shift: u32,
}

/// The factors of a pixel's two parts in the real and in the imaginary part of a product by c + id: c and −d, d and c.
type Tap = [[i16; 2]; 2];

impl Taps {
    /// Rounds the taps at distances 1, 2 … of a filter whose gain at frequency 0 is 1. The centre absorbs the rounding,
    /// so the gain stays exactly 1.
    ///
    /// # Panics
    /// Panics if a part of a tap is 16384 or larger.
    pub fn new(sides: &[[f64; 2]]) -> Self {
        let rounded = (1..=15).rev().find_map(|shift| Self::rounded(sides, shift));
        rounded.expect("taps are smaller than 16384")
    }

    fn rounded(sides: &[[f64; 2]], shift: u32) -> Option<Self> {
        let one = 1 << shift;
        let round = |part: f64| (part * f64::from(one)).round() as i32;
        let sides: Vec<[i32; 2]> = sides.iter().map(|side| side.map(round)).collect();
        let sum = |part: usize| sides.iter().map(|side| side[part]).sum::<i32>();
        let centre = [one - 2 * sum(0), -2 * sum(1)];
        let fits = |part: i32| i16::try_from(part).ok().filter(|part| *part != i16::MIN);
        let tap = |[c, d]: [i32; 2]| {
            let (c, d) = (fits(c)?, fits(d)?);
            Some([[c, -d], [d, c]])
        };
        let taps: Option<_> = std::iter::once(centre).chain(sides).map(tap).collect();
        taps.map(|taps| Taps { taps, shift })
    }

    /// Returns the number of taps on each side of the centre.
    pub fn radius(&self) -> usize {
        self.taps.len() - 1
    }

    /// Returns the centre and the taps at distances 1, 2 …, as rounded.
    pub fn values(&self) -> Vec<[f32; 2]> {
        let unit = (1 << self.shift) as f32;
        let value = |[_, [d, c]]: &Tap| [f32::from(*c) / unit, f32::from(*d) / unit];
        self.taps.iter().map(value).collect()
    }
}

/// A register of pixels, with the operations that the filter needs.
///
/// # Safety
/// The caller of each operation must have detected the instruction set of the register.
trait Lanes: Copy {
    const LANES: usize;
    /// The sums of products for the pixels of a register.
    type Sums: Copy;
    /// # Safety
    /// The caller must ensure that `LANES` pixels can be read.
    unsafe fn load(from: *const Pixel) -> Self;
    /// # Safety
    /// The caller must ensure that `LANES` pixels can be written.
    unsafe fn store(self, to: *mut Pixel);
    /// Returns the sum.
    ///
    /// # Safety
    /// See [`Lanes`].
    unsafe fn add(self, other: Self) -> Self;
    /// Returns these pixels with a share of them replaced, as [`Fir::blend`].
    ///
    /// # Safety
    /// See [`Lanes`].
    unsafe fn blend(self, light: Self, share: Self) -> Self;
    /// Returns sums of `start`.
    ///
    /// # Safety
    /// See [`Lanes`].
    unsafe fn sums(start: i32) -> Self::Sums;
    /// Adds the products of these pixels and `tap`.
    ///
    /// # Safety
    /// See [`Lanes`].
    unsafe fn multiply(self, tap: &Tap, sums: Self::Sums) -> Self::Sums;
    /// Shifts sums to the right by `shift` bits, 1 to 15, and saturates them, to [`LEAST`] and [`MOST`]. A pixel of
    /// twice the size saturates to the whole range of 16 bits, which packing does without further instructions.
    ///
    /// # Safety
    /// See [`Lanes`].
    unsafe fn narrow(sums: Self::Sums, shift: u32) -> Self;
}

/// The arguments of a kernel. The pixels of the taps are in `slots` slots, `pitch` pixels apart: the centre's in slot
/// `centre`, those of tap j in the jth slots before and behind it. Slots wrap around. The centre of the second output,
/// if there is one, is in the slot behind the first's.
#[derive(Clone, Copy)]
struct Run<const ROWS: usize> {
    source: *const Pixel,
    pitch: usize,
    slots: usize,
    centre: usize,
    out: [*mut Pixel; ROWS],
    length: usize,
}

impl<const ROWS: usize> Run<ROWS> {
    #[inline(always)]
    fn before(&self, slot: usize) -> usize {
        if slot == 0 { self.slots - 1 } else { slot - 1 }
    }

    #[inline(always)]
    fn behind(&self, slot: usize) -> usize {
        if slot + 1 == self.slots { 0 } else { slot + 1 }
    }
}

/// The kernels for one row and for two, and that of [`Fir::blend`] for slices of equal length.
#[derive(Clone, Copy)]
struct Kernels {
    one: unsafe fn(&Taps, Run<1>),
    two: unsafe fn(&Taps, Run<2>),
    blend: unsafe fn(&mut [Pixel], &[Pixel], &[Pixel]),
}

/// The filter's kernel for one instruction set.
#[derive(Clone, Copy)]
pub struct Fir {
    isa: Isa,
    kernels: Kernels,
}

impl Fir {
    /// Returns the kernel for `isa`, or `None` if this processor lacks the instruction set.
    pub fn new(isa: Isa) -> Option<Fir> {
        let kernels = match isa {
            Isa::Portable => Some(portable::KERNELS),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512Vnni => avx512::kernels(),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 => avx2::kernels(),
            #[cfg(target_arch = "aarch64")]
            Isa::Neon => Some(neon::KERNELS),
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Isa::Simd128 => Some(simd128::KERNELS),
            _ => None,
        }?;
        Some(Fir { isa, kernels })
    }

    /// Returns the fastest kernel that this process may use.
    pub fn fastest() -> Fir {
        let portable = Fir {
            isa: Isa::Portable,
            kernels: portable::KERNELS,
        };
        Isa::fir().into_iter().find_map(Fir::new).unwrap_or(portable)
    }

    /// Returns the instruction set in use.
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// Filters along a row: out\[x] = c₀·row\[r + x] + Σⱼ cⱼ·(row\[r + x − j] + row\[r + x + j]), where r is the
    /// filter's radius.
    ///
    /// # Panics
    /// Panics if the length of `out` is not a multiple of [`RUN`], or if `row` has not r pixels more on each side.
    pub fn along(&self, taps: &Taps, row: &[Pixel], out: &mut [Pixel]) {
        let radius = taps.radius();
        assert!(out.len().is_multiple_of(RUN) && row.len() == out.len() + 2 * radius);
        let run = Run {
            source: row.as_ptr(),
            pitch: 1,
            slots: 2 * radius + 1,
            centre: radius,
            out: [out.as_mut_ptr()],
            length: out.len(),
        };
        // SAFETY: the assert above holds, and `new` has detected the instruction set.
        unsafe { (self.kernels.one)(taps, run) };
    }

    /// Filters along columns: out\[x] = c₀·ring\[centre]\[x] + Σⱼ cⱼ·(ring\[centre − j]\[x] + ring\[centre + j]\[x]).
    /// `ring` is 2r + 2 rows of `pitch` pixels, where r is the filter's radius, and its indices wrap around. The first
    /// output is column `from`.
    ///
    /// # Panics
    /// Panics if the length of `out` is not a multiple of [`RUN`], or a row does not exist or is too short.
    pub fn down(&self, taps: &Taps, ring: &[Pixel], pitch: usize, centre: usize, from: usize, out: &mut [Pixel]) {
        let run = run(taps, ring, pitch, centre, from, [out]);
        // SAFETY: the run is checked, and `new` has detected the instruction set.
        unsafe { (self.kernels.one)(taps, run) };
    }

    /// Filters as [`Fir::down`] for two rows, whose centres are `centre` and the next row. This is faster, because each
    /// row of the ring is read once for both.
    ///
    /// # Panics
    /// Panics if [`Fir::down`] would, or if the outputs differ in length.
    pub fn down_two(
        &self,
        taps: &Taps,
        ring: &[Pixel],
        pitch: usize,
        centre: usize,
        from: usize,
        out: [&mut [Pixel]; 2],
    ) {
        let run = run(taps, ring, pitch, centre, from, out);
        // SAFETY: the run is checked, and `new` has detected the instruction set.
        unsafe { (self.kernels.two)(taps, run) };
    }

    /// Replaces a share of each pixel of `field` with the same share of `light`, as [`Pixel::blend`] does. Both parts
    /// of a pixel of `share` are −s·2¹⁵, where s is the share, 0 to 1.
    ///
    /// # Panics
    /// Panics if the lengths differ or are not a multiple of [`RUN`].
    pub fn blend(&self, field: &mut [Pixel], light: &[Pixel], share: &[Pixel]) {
        assert!(field.len().is_multiple_of(RUN) && light.len() == field.len() && share.len() == field.len());
        // SAFETY: the assert above holds, and `new` has detected the instruction set.
        unsafe { (self.kernels.blend)(field, light, share) };
    }
}

/// Blends whole registers.
///
/// # Safety
/// The lengths must be equal and multiples of [`RUN`], and the caller must have detected the instruction set of `V`.
#[inline(always)]
unsafe fn blend<V: Lanes>(field: &mut [Pixel], light: &[Pixel], share: &[Pixel]) {
    for x in (0..field.len()).step_by(V::LANES) {
        // SAFETY: the lengths are equal, and whole registers divide them.
        unsafe {
            let at = field.as_mut_ptr().add(x);
            let [light, share] = [V::load(light.as_ptr().add(x)), V::load(share.as_ptr().add(x))];
            V::load(at).blend(light, share).store(at);
        }
    }
}

/// Checks a run along columns.
fn run<const ROWS: usize>(
    taps: &Taps,
    ring: &[Pixel],
    pitch: usize,
    centre: usize,
    from: usize,
    out: [&mut [Pixel]; ROWS],
) -> Run<ROWS> {
    let slots = 2 * taps.radius() + 2;
    let length = out[0].len();
    assert!(length.is_multiple_of(RUN) && out.iter().all(|out| out.len() == length));
    assert!(centre < slots && slots.checked_mul(pitch).is_some_and(|pixels| pixels <= ring.len()));
    assert!(from.checked_add(length).is_some_and(|end| end <= pitch));
    Run {
        source: ring[from..].as_ptr(),
        pitch,
        slots,
        centre,
        out: out.map(<[Pixel]>::as_mut_ptr),
        length,
    }
}

/// Filters a run, `REGISTERS` registers at a time.
///
/// It uses no closures, because they would not inherit the caller's instruction set.
///
/// # Safety
/// The caller must uphold the contract of [`Run`] and have detected the instruction set of `V`.
#[inline(always)]
unsafe fn one<V: Lanes, const REGISTERS: usize>(taps: &Taps, run: Run<1>) {
    let mut x = 0;
    // SAFETY: x + the block's length stays within the run.
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
/// The contract of [`one`], for `REGISTERS` registers from `x`.
#[inline(always)]
unsafe fn block<V: Lanes, const REGISTERS: usize>(taps: &Taps, run: Run<1>, x: usize) {
    // SAFETY: the caller upholds this function's contract, so all slots hold x + `REGISTERS` registers.
    unsafe {
        let source = run.source.add(x);
        let mut sums = [V::sums(1 << (taps.shift - 1)); REGISTERS];
        let centre = source.add(run.centre * run.pitch);
        for (r, sums) in sums.iter_mut().enumerate() {
            *sums = V::load(centre.add(r * V::LANES)).multiply(&taps.taps[0], *sums);
        }
        let (mut before, mut behind) = (run.centre, run.centre);
        for tap in &taps.taps[1..] {
            (before, behind) = (run.before(before), run.behind(behind));
            let pair = [source.add(before * run.pitch), source.add(behind * run.pitch)];
            for (r, sums) in sums.iter_mut().enumerate() {
                let mirrored = V::load(pair[0].add(r * V::LANES)).add(V::load(pair[1].add(r * V::LANES)));
                *sums = mirrored.multiply(tap, *sums);
            }
        }
        for (r, sums) in sums.into_iter().enumerate() {
            V::narrow(sums, taps.shift).store(run.out[0].add(x + r * V::LANES));
        }
    }
}

/// Filters two rows, `REGISTERS` registers of each at a time.
///
/// # Safety
/// The contract of [`one`].
#[inline(always)]
unsafe fn two<V: Lanes, const REGISTERS: usize>(taps: &Taps, run: Run<2>) {
    let mut x = 0;
    // SAFETY: x + the block's length stays within the run.
    unsafe {
        while x + REGISTERS * V::LANES <= run.length {
            block_of_two::<V, REGISTERS>(taps, run, x);
            x += REGISTERS * V::LANES;
        }
        while x < run.length {
            block_of_two::<V, 1>(taps, run, x);
            x += V::LANES;
        }
    }
}

/// The pixel before the first row's centre is also the pixel before the second row's for the next tap, and the pixel
/// behind the second row's centre the pixel behind the first row's for the next tap.
///
/// # Safety
/// The contract of [`one`], for `REGISTERS` registers from `x`.
#[inline(always)]
unsafe fn block_of_two<V: Lanes, const REGISTERS: usize>(taps: &Taps, run: Run<2>, x: usize) {
    // SAFETY: the caller upholds this function's contract, so all slots hold x + `REGISTERS` registers.
    unsafe {
        let source = run.source.add(x);
        let (mut before, mut behind) = (run.centre, run.behind(run.centre));
        let start = V::sums(1 << (taps.shift - 1));
        let mut sums = [[start; 2]; REGISTERS];
        let mut latest = [[V::load(source); 2]; REGISTERS];
        for (r, (sums, latest)) in sums.iter_mut().zip(&mut latest).enumerate() {
            let x = r * V::LANES;
            *latest = [
                V::load(source.add(before * run.pitch + x)),
                V::load(source.add(behind * run.pitch + x)),
            ];
            *sums = [
                latest[0].multiply(&taps.taps[0], start),
                latest[1].multiply(&taps.taps[0], start),
            ];
        }
        for tap in &taps.taps[1..] {
            (before, behind) = (run.before(before), run.behind(behind));
            let pair = [source.add(before * run.pitch), source.add(behind * run.pitch)];
            for (r, (sums, latest)) in sums.iter_mut().zip(&mut latest).enumerate() {
                let above = V::load(pair[0].add(r * V::LANES));
                let below = V::load(pair[1].add(r * V::LANES));
                sums[0] = above.add(latest[1]).multiply(tap, sums[0]);
                sums[1] = latest[0].add(below).multiply(tap, sums[1]);
                *latest = [above, below];
            }
        }
        for (r, sums) in sums.into_iter().enumerate() {
            for (out, sums) in run.out.into_iter().zip(sums) {
                V::narrow(sums, taps.shift).store(out.add(x + r * V::LANES));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns pixels whose parts are spread over the whole range, with many at its ends.
    fn noise(length: usize, seed: u32) -> Vec<Pixel> {
        let mut state = seed;
        let mut part = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            match state >> 29 {
                0 => i32::from(LEAST),
                1 => i32::from(MOST),
                _ => state as i32 >> 17,
            }
        };
        (0..length).map(|_| Pixel::new(part(), part())).collect()
    }

    /// Returns the filter of `radius` taps on each side and of ever smaller taps of alternating signs.
    fn taps(radius: usize, largest: f64) -> Taps {
        let side = |j: usize| largest * (-0.7f64).powi(j as i32);
        let sides: Vec<_> = (0..radius).map(|j| [side(j) * 0.6, -side(j)]).collect();
        Taps::new(&sides)
    }

    /// Filters one pixel by definition: the centre's pixel, then the mirrored pixels of each tap.
    fn filtered(taps: &Taps, centre: Pixel, mirrored: &[[Pixel; 2]]) -> Pixel {
        let saturated = |value: i64| value.clamp(LEAST.into(), MOST.into());
        let wide = |pixel: Pixel| [i64::from(pixel.re()), i64::from(pixel.im())];
        let mut sums = [1 << (taps.shift - 1); 2];
        let pixels = std::iter::once(wide(centre)).chain(mirrored.iter().map(|[a, b]| {
            let (a, b) = (wide(*a), wide(*b));
            [a[0] + b[0], a[1] + b[1]]
        }));
        for ([re, im], [c, d]) in pixels.zip(taps.values()) {
            let unit = (1i64 << taps.shift) as f32;
            let (c, d) = ((c * unit) as i64, (d * unit) as i64);
            sums = [sums[0] + c * re - d * im, sums[1] + d * re + c * im];
        }
        // Sums of 32 bits wrap around.
        let [re, im] = sums.map(|sum| saturated(i64::from(sum as i32) >> taps.shift) as i32);
        Pixel::new(re, im)
    }

    #[test]
    fn every_kernel_is_the_definition() {
        for isa in Isa::fir() {
            let fir = Fir::new(isa).expect("an available set has kernels");
            for (radius, length, largest) in [(1, 16, 0.1), (5, 96, 0.3), (17, 80, 0.2), (5, 176, 0.9), (40, 32, 0.1)] {
                let taps = taps(radius, largest);
                let row = noise(length + 2 * radius, 7);
                let mut out = vec![Pixel::ZERO; length];
                fir.along(&taps, &row, &mut out);
                for (x, out) in out.iter().enumerate() {
                    let mirrored: Vec<_> = (1..=radius)
                        .map(|j| [row[radius + x - j], row[radius + x + j]])
                        .collect();
                    assert_eq!(*out, filtered(&taps, row[radius + x], &mirrored), "{isa} {radius} {x}");
                }
                let (slots, pitch, from) = (2 * radius + 2, length + 3, 2);
                let ring = noise(slots * pitch, 11);
                for centre in [0, radius, slots - 1] {
                    let mut two = [out.clone(), out.clone()];
                    let rows = two.each_mut().map(|row| &mut row[..]);
                    fir.down_two(&taps, &ring, pitch, centre, from, rows);
                    fir.down(&taps, &ring, pitch, centre, from, &mut out);
                    assert!(two[0] == out, "{isa} {radius} {centre}");
                    fir.down(&taps, &ring, pitch, (centre + 1) % slots, from, &mut out);
                    assert!(two[1] == out, "{isa} {radius} {centre}");
                    for (x, out) in two[0].iter().enumerate() {
                        let at = |slot: usize| ring[slot % slots * pitch + from + x];
                        let mirrored: Vec<_> = (1..=radius).map(|j| [at(centre + slots - j), at(centre + j)]).collect();
                        assert_eq!(
                            *out,
                            filtered(&taps, at(centre), &mirrored),
                            "{isa} {radius} {centre} {x}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn every_kernel_blends_as_a_pixel_does() {
        let field = noise(96, 5);
        // Half of the range, so that no parts differ by 2¹⁵ or more.
        let light = noise(96, 3)
            .into_iter()
            .map(|pixel| Pixel::new(pixel.re() / 2, pixel.im() / 2));
        let light: Vec<_> = light.collect();
        let shares: Vec<i32> = (0..96)
            .map(|x| [0, 1, 16384, 32767, 32768, 341 * x][x as usize % 6])
            .collect();
        let expected = field.iter().zip(&light).zip(&shares);
        let expected: Vec<_> = expected
            .map(|((pixel, light), share)| pixel.blend(*light, *share))
            .collect();
        let share: Vec<_> = shares.iter().map(|share| Pixel::new(-share, -share)).collect();
        for isa in Isa::fir() {
            let mut blended = field.clone();
            Fir::new(isa)
                .expect("an available set has kernels")
                .blend(&mut blended, &light, &share);
            assert!(blended == expected, "{isa}");
        }
    }

    // WebAssembly ends at a panic.
    #[cfg(panic = "unwind")]
    #[test]
    fn runs_outside_the_ring_are_refused() {
        let taps = taps(1, 0.1);
        let ring = noise(4 * 16, 3);
        let filter = |pitch, centre, from| {
            std::panic::catch_unwind(|| Fir::fastest().down(&taps, &ring, pitch, centre, from, &mut [Pixel::ZERO; 16]))
        };
        assert!(filter(16, 0, 0).is_ok());
        // Four slots of a quarter of all numbers wrap around to 0.
        let quarter = 1 << (usize::BITS - 2);
        for (pitch, centre, from) in [(quarter, 0, 0), (16, 4, 0), (16, 0, 1), (17, 0, 0), (16, 0, usize::MAX)] {
            assert!(filter(pitch, centre, from).is_err(), "{pitch} {centre} {from}");
        }
    }

    #[test]
    fn a_flat_wave_stays_as_it_is() {
        let taps = taps(5, 0.21);
        let flat = [Pixel::new(8191, -1234); 26];
        let mut out = [Pixel::ZERO; 16];
        Fir::fastest().along(&taps, &flat, &mut out);
        assert_eq!(out, [flat[0]; 16]);
    }
}
