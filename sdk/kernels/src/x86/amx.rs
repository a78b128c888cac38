//! The int8 kernels for AMX. A tile instruction multiplies 16 filters by 16 pixels, with 64 products each.
//!
//! The groups of four channels have the layout of the second operand: a tile is 16 "lines" of 16 pixels, and a line is
//! one group at one tap. Lines of the three rows are evenly spaced in memory whatever slot a row is in, so a tile of 16
//! lines is loaded directly from the rows, once for each column tap, with the weights packed for each of the three
//! rotations of the ring. The lines of a column tap that do not fill a tile are gathered into a small panel. Sums are
//! then requantised with AVX-512 while the tiles compute the next block.
//!
//! The code uses inline assembly because the intrinsics of the tile instructions are not stable.
#![allow(unsafe_code)]

use crate::OUTPUTS;
use crate::int8::{GROUP, Kernels, LayerKernels, Packed, RowKernels, Taps};
use crate::wavefront::{BLOCK, Geometry, Slots};
use crate::x86::avx2::{quantise_row, rescale_row};
use crate::x86::avx512_vnni::{self, check_rows, requantise};
use std::arch::asm;
use std::arch::x86_64::*;
use std::cell::RefCell;
use std::sync::OnceLock;

/// The lines of a tile, and the pixels of a line.
pub(crate) const TILE: usize = 16;
/// The number of filters computed together: a tile of 16 and one of 8.
const FILTERS: usize = 24;
/// The words of weights for one step: 16 words for each filter.
const STEP_WORDS: usize = FILTERS * TILE;
/// The most lines that a panel gathers: those left over from three column taps, in whole tiles.
const PANEL: usize = 48;

/// Returns the kernels if the processor and the system support them.
pub(crate) fn kernels() -> Option<Kernels> {
    available().then_some(Kernels {
        layers: LayerKernels::Rows(RowKernels {
            pack,
            hidden_row,
            last_row,
            offset: 0,
        }),
        quantise_row,
        rescale_row,
    })
}

/// Checks whether the processor has AMX int8 and the system lets this process use it.
pub(crate) fn available() -> bool {
    static AVAILABLE: OnceLock<bool> = OnceLock::new();
    *AVAILABLE.get_or_init(|| avx512_vnni::available() && has_tiles() && permitted())
}

fn has_tiles() -> bool {
    // AMX-TILE and AMX-INT8 are bits 24 and 25 of EDX in leaf 7.
    if __cpuid(0).eax < 7 || __cpuid_count(7, 0).edx >> 24 & 3 != 3 {
        return false;
    }
    // Tile configuration and data are bits 17 and 18 of XCR0. AVX-512, detected before, implies XGETBV.
    let (low, _high): (u32, u32);
    // SAFETY: XGETBV of register 0 only reads. AVX-512 in use implies OSXSAVE.
    unsafe {
        asm!("xgetbv", in("ecx") 0, out("eax") low, out("edx") _high, options(nomem, nostack));
    }
    low >> 17 & 3 == 3
}

/// Asks Linux for permission to use the tile data state. On other systems AMX is not used.
#[cfg(target_os = "linux")]
fn permitted() -> bool {
    const ARCH_PRCTL: i64 = 158;
    const ARCH_REQ_XCOMP_PERM: i64 = 0x1023;
    const TILE_DATA: i64 = 18;
    let mut result = ARCH_PRCTL;
    // SAFETY: the system call reads its two numbers and accesses no memory of this process.
    unsafe {
        asm!("syscall", inlateout("rax") result, in("rdi") ARCH_REQ_XCOMP_PERM, in("rsi") TILE_DATA,
            lateout("rcx") _, lateout("r11") _, options(nostack));
    }
    result == 0
}

#[cfg(not(target_os = "linux"))]
fn permitted() -> bool {
    false
}

/// The division of the lines of a layer's 3·`groups` groups and three column taps into tiles.
struct Steps {
    /// The number of whole tiles loaded directly from the rows, for each column tap.
    direct: usize,
    /// The number of lines of each column tap that the panel gathers.
    left: usize,
    /// The number of tiles of the panel.
    panels: usize,
}

impl Steps {
    fn new(groups: usize) -> Steps {
        let lines = 3 * groups;
        let left = lines % TILE;
        Steps {
            direct: lines / TILE,
            left,
            panels: (3 * left).div_ceil(TILE),
        }
    }

    fn count(&self) -> usize {
        3 * self.direct + self.panels
    }

    /// Returns the (line, column tap) of each line of each step, in order, or `None` where a panel's tile is not full.
    fn lines(&self) -> Vec<Option<(usize, usize)>> {
        let direct = (0..3).flat_map(|kx| (0..self.direct * TILE).map(move |line| Some((line, kx))));
        let first = self.direct * TILE;
        let panel = (0..3).flat_map(|kx| (first..first + self.left).map(move |line| Some((line, kx))));
        let mut lines: Vec<_> = direct.chain(panel).collect();
        lines.resize(self.count() * TILE, None);
        lines
    }
}

/// Packs words of four weights as `[24 filters][turn][step][filter][line]`. Filters beyond the layer's have weight 0. A
/// group of 16 filters never uses the second tile, and a group of 8 never uses the first.
fn pack(taps: &Taps<'_>) -> Vec<i32> {
    let groups = taps.groups();
    let lines = Steps::new(groups).lines();
    let mut words = Vec::new();
    for first in (0..taps.outputs()).step_by(FILTERS) {
        for turn in 0..3 {
            for step in lines.chunks_exact(TILE) {
                for filter in first..first + FILTERS {
                    words.extend(step.iter().map(|line| match line {
                        Some((line, kx)) => {
                            // Slot 0 holds row `ky` with turn + ky ≡ 0 (mod 3).
                            let ky = (line / groups + 3 - turn) % 3;
                            i32::from_le_bytes(taps.group(filter, line % groups, ky, *kx).map(|w| w as u8))
                        }
                        None => 0,
                    }));
                }
            }
        }
    }
    words
}

/// The shapes of the tiles: 0 and 1 are sums of 16 filters, 2 and 3 of 8; 4 and 5 are their weights; 6 and 7 are
/// pixels.
#[repr(C, align(64))]
pub(crate) struct TileConfig {
    palette: u8,
    start_row: u8,
    reserved: [u8; 14],
    bytes_a_row: [u16; 16],
    rows: [u8; 16],
}

pub(crate) static CONFIG: TileConfig = TileConfig {
    palette: 1,
    start_row: 0,
    reserved: [0; 14],
    bytes_a_row: [64, 64, 64, 64, 64, 64, 64, 64, 0, 0, 0, 0, 0, 0, 0, 0],
    rows: [16, 16, 8, 8, 16, 8, 16, 16, 0, 0, 0, 0, 0, 0, 0, 0],
};

/// The sums of 24 filters at two lines of pixels.
#[repr(C, align(64))]
struct Sums([[[i32; TILE]; FILTERS]; 2]);

/// The lines gathered for the tiles that are not loaded directly, for two lines of pixels.
#[repr(C, align(64))]
struct Panel([[[u8; TILE * GROUP]; PANEL]; 2]);

/// A layer's biases as a tile of initial sums.
#[repr(C, align(64))]
struct Biases([[i32; TILE]; FILTERS]);

/// The working memory for a row. Each thread keeps its own, because clearing it would take longer than some rows.
struct Work {
    biases: Biases,
    panels: [Panel; 2],
    sums: [Sums; 3],
}

thread_local! {
    static WORK: RefCell<Work> = const {
        RefCell::new(Work {
            biases: Biases([[0; TILE]; FILTERS]),
            panels: [const { Panel([[[0; TILE * GROUP]; PANEL]; 2]) }; 2],
            sums: [const { Sums([[[0; TILE]; FILTERS]; 2]) }; 3],
        })
    };
}

/// Calls `done(x, sums)` for every 32 pixels of `from..to`, with the sums of filters `first..first + 24`.
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn each_block(
    layer: &Packed,
    window: Slots<'_, u8>,
    first: usize,
    span: (usize, usize),
    geometry: Geometry,
    done: impl FnMut(usize, &Sums),
) {
    WORK.with_borrow_mut(|work| {
        for (line, bias) in work.biases.0.iter_mut().zip(&layer.bias[first..]) {
            *line = [*bias; TILE];
        }
        each_block_in(work, layer, window, first, span, geometry, done);
    });
}

#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn each_block_in(
    Work { biases, panels, sums }: &mut Work,
    layer: &Packed,
    window: Slots<'_, u8>,
    first: usize,
    (from, to): (usize, usize),
    geometry: Geometry,
    mut done: impl FnMut(usize, &Sums),
) {
    let steps = Steps::new(layer.groups);
    let stride = geometry.stride();
    let rows = window.rows();
    check_rows(&rows, layer.groups, geometry);
    assert!(window.slots.len() == 3 * layer.groups * stride && to.next_multiple_of(2 * TILE) <= geometry.padded);
    let turn_words = steps.count() * STEP_WORDS;
    let weights = &layer.weights[(first / FILTERS * 3 + window.first) * turn_words..][..turn_words];
    let filters = (layer.outputs.next_multiple_of(8) - first).min(FILTERS);
    let wide = filters >= 16;
    let narrow = !filters.is_multiple_of(16);
    // A tile cannot be loaded from stores that are still pending, so panels are gathered one block ahead and sums are
    // converted to values one block later.
    let blocks = (to - from).div_ceil(2 * TILE);
    let block_x = |block: usize| from + block * 2 * TILE;
    // SAFETY: `kernels` has checked the processor and the system. Every line read starts at most one pixel before the
    // block and ends at most 17 after it, within a group's margins. Weights and biases have the shapes of the tiles.
    // The tiles belong to this thread between configuration and release, and `done` does not use them.
    unsafe {
        let pixels = window.slots.as_ptr().add(geometry.start() - GROUP);
        let gather = |panel: &mut Panel, block: usize| {
            let left = pixels.add(steps.direct * TILE * stride + block_x(block) * GROUP);
            for (half, panel) in panel.0.iter_mut().enumerate() {
                for kx in 0..3 {
                    for line in 0..steps.left {
                        let from = left.add(line * stride + (kx + half * TILE) * GROUP);
                        let to = panel[kx * steps.left + line].as_mut_ptr();
                        _mm512_store_si512(to.cast(), _mm512_loadu_si512(from.cast()));
                    }
                }
            }
        };
        asm!("ldtilecfg [{}]", in(reg) &raw const CONFIG, options(nostack, readonly));
        gather(&mut panels[0], 0);
        for block in 0..blocks {
            let pixels = pixels.add(block_x(block) * GROUP);
            let mut weight = weights.as_ptr();
            start(biases, wide, narrow);
            for kx in 0..3 {
                for tile in 0..steps.direct {
                    let line = pixels.add(tile * TILE * stride + kx * GROUP);
                    step(weight, [line, line.add(TILE * GROUP)], stride, wide, narrow);
                    weight = weight.add(STEP_WORDS);
                }
            }
            for tile in 0..steps.panels {
                let lines = [0, 1].map(|half| panels[block % 2].0[half][tile * TILE].as_ptr());
                step(weight, lines, TILE * GROUP, wide, narrow);
                weight = weight.add(STEP_WORDS);
            }
            if block + 1 < blocks {
                gather(&mut panels[(block + 1) % 2], block + 1);
            }
            if block >= 2 {
                done(block_x(block - 2), &sums[(block - 2) % 3]);
            }
            finish(&mut sums[block % 3], wide, narrow);
        }
        asm!("tilerelease", options(nostack, nomem));
    }
    for block in blocks.saturating_sub(2)..blocks {
        done(block_x(block), &sums[block % 3]);
    }
}

/// Loads the biases as the initial sums.
///
/// # Safety
/// The tiles must be configured.
#[inline(always)]
unsafe fn start(biases: &Biases, wide: bool, narrow: bool) {
    let (first, second) = (biases.0.as_ptr(), biases.0[if wide { TILE } else { 0 }..].as_ptr());
    // SAFETY: the biases hold 16 and 8 lines of 64 bytes.
    unsafe {
        if wide {
            asm!("tileloadd tmm0, [{b} + {s}]", "tileloadd tmm1, [{b} + {s}]",
                b = in(reg) first, s = in(reg) 64usize, options(nostack, readonly));
        }
        if narrow {
            asm!("tileloadd tmm2, [{b} + {s}]", "tileloadd tmm3, [{b} + {s}]",
                b = in(reg) second, s = in(reg) 64usize, options(nostack, readonly));
        }
    }
}

/// Adds one tile of lines, for two lines of pixels, times its weights.
///
/// # Safety
/// The tiles must be configured. `weights` must point to 24 lines of 64 bytes, and each of `lines` to 16 lines that are
/// `stride` bytes apart.
#[inline(always)]
unsafe fn step(weights: *const i32, lines: [*const u8; 2], stride: usize, wide: bool, narrow: bool) {
    // SAFETY: the caller upholds this function's contract.
    unsafe {
        asm!("tileloadd tmm6, [{a} + {s}]", "tileloadd tmm7, [{b} + {s}]",
            a = in(reg) lines[0], b = in(reg) lines[1], s = in(reg) stride, options(nostack, readonly));
        if wide {
            asm!("tileloadd tmm4, [{w} + {s}]", "tdpbsud tmm0, tmm4, tmm6", "tdpbsud tmm1, tmm4, tmm7",
                w = in(reg) weights, s = in(reg) 64usize, options(nostack, readonly));
        }
        if narrow {
            let weights = weights.add(if wide { TILE * TILE } else { 0 });
            asm!("tileloadd tmm5, [{w} + {s}]", "tdpbsud tmm2, tmm5, tmm6", "tdpbsud tmm3, tmm5, tmm7",
                w = in(reg) weights, s = in(reg) 64usize, options(nostack, readonly));
        }
    }
}

/// Stores the sums.
///
/// # Safety
/// The tiles must be configured.
#[inline(always)]
unsafe fn finish(sums: &mut Sums, wide: bool, narrow: bool) {
    let [first, second] = &mut sums.0;
    let after = if wide { TILE } else { 0 };
    // SAFETY: `sums` holds the lines of the tiles' shapes.
    unsafe {
        if wide {
            asm!("tilestored [{a} + {s}], tmm0", "tilestored [{b} + {s}], tmm1",
                a = in(reg) first.as_mut_ptr(), b = in(reg) second.as_mut_ptr(), s = in(reg) 64usize,
                options(nostack));
        }
        if narrow {
            asm!("tilestored [{a} + {s}], tmm2", "tilestored [{b} + {s}], tmm3",
                a = in(reg) first[after..].as_mut_ptr(), b = in(reg) second[after..].as_mut_ptr(),
                s = in(reg) 64usize, options(nostack));
        }
    }
}

fn hidden_row(layer: &Packed, window: Slots<'_, u8>, skip: Option<&[u8]>, out: &mut [u8], geometry: Geometry) {
    for first in (0..layer.outputs).step_by(FILTERS) {
        // SAFETY: `kernels` has detected the features.
        unsafe { hidden_filters(layer, first, window, skip, out, geometry) };
    }
}

#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn hidden_filters(
    layer: &Packed,
    first: usize,
    window: Slots<'_, u8>,
    skip: Option<&[u8]>,
    out: &mut [u8],
    geometry: Geometry,
) {
    let size = (layer.outputs - first).min(FILTERS);
    each_block(layer, window, first, (0, geometry.width), geometry, |x, sums| {
        for g in 0..size / GROUP {
            for (half, sums) in sums.0.iter().enumerate() {
                let group = (first / GROUP + g) * geometry.stride();
                let at = group + geometry.start() + (x + half * TILE) * GROUP;
                // SAFETY: a line of sums is 64 bytes long.
                let four = std::array::from_fn(|k| unsafe { _mm512_load_si512(sums[g * GROUP + k].as_ptr().cast()) });
                requantise(layer, first + g * GROUP, four, skip, out, at);
            }
        }
    });
}

fn last_row(layer: &Packed, window: Slots<'_, u8>, out: [&mut [f32]; OUTPUTS], from: usize, geometry: Geometry) {
    // SAFETY: `kernels` has detected the features.
    unsafe { last_filters(layer, window, out, from, geometry) }
}

#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn last_filters(
    layer: &Packed,
    window: Slots<'_, u8>,
    mut out: [&mut [f32]; OUTPUTS],
    from: usize,
    geometry: Geometry,
) {
    let to = from + out[0].len();
    let multiplier = &layer.multiplier[..OUTPUTS];
    each_block(layer, window, 0, (from / BLOCK * BLOCK, to), geometry, |block, sums| {
        for (half, sums) in sums.0.iter().enumerate() {
            let x = block + half * TILE;
            let (start, end) = (x.max(from), (x + TILE).min(to));
            if start >= end {
                continue;
            }
            for ((out, sums), multiplier) in out.iter_mut().zip(sums).zip(multiplier) {
                let mut values = [0.0; TILE];
                // SAFETY: this function enables the features, and there are 16 sums and 16 values.
                unsafe {
                    let sums = _mm512_cvtepi32_ps(_mm512_load_si512(sums.as_ptr().cast()));
                    let scaled = _mm512_mul_ps(sums, _mm512_set1_ps(*multiplier));
                    _mm512_storeu_ps(values.as_mut_ptr(), scaled);
                }
                out[start - from..end - from].copy_from_slice(&values[start - x..end - x]);
            }
        }
    });
}
