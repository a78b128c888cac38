//! Finds hidden surfaces on the GPU: the bit-identical counterpart of [`phasefront_core::method::sweep::hidden`].

use crate::Result;
use crate::device::{Device, Dispatch};
use phasefront_core::Size;
use phasefront_core::method::sweep::hidden::JUMP;

/// The number of pixels in a line for which a thread finds the sources.
const PART: usize = 64;
/// The lines of a workgroup.
const LINES: usize = 64;

/// A search for one frame size, with one dispatch for each side.
pub(crate) struct Search {
    sides: [Dispatch; 4],
    /// (2, H, W): the pixels that hidden layers continue, as in
    /// [`phasefront_core::method::sweep::hidden::Hidden::find`].
    pub(crate) sources: wgpu::Buffer,
}

impl Search {
    /// Plans a search in the depth of `surfaces`, (H, W) of red, green, blue and depth, up to `reach` pixels away.
    pub(crate) fn new(
        device: &Device,
        surfaces: &wgpu::Buffer,
        Size { width, height }: Size,
        reach: usize,
    ) -> Result<Self> {
        let area = height * width;
        let sources = device.buffer("hidden surfaces", 8 * area)?;
        let (h, w) = (height as i32, width as i32);
        // The number of lines, the pixels of each, the start of the first, the strides from line to line and along a
        // line.
        let side = |first: bool, lines: usize, length: usize, origin: i32, line: i32, step: i32| {
            let counts = [lines, length, area, width].map(|n| n as u32);
            let places = [origin, line, step, 0];
            let walk = [bytemuck::cast_slice::<u32, u8>(&counts), bytemuck::cast_slice(&places)].concat();
            let walk = device.constants("a side", &walk)?;
            let header = format!(
                "const REACH: u32 = {reach}u;
                const PART: u32 = {PART}u;
                const JUMP: f32 = {JUMP};
                const FIRST: bool = {first};
                "
            );
            let source = header + include_str!("hidden.wgsl");
            let arguments = [
                (0, walk.buffer.as_entire_binding()),
                (1, surfaces.as_entire_binding()),
                (2, sources.as_entire_binding()),
            ];
            let grid = [lines.div_ceil(LINES), length.div_ceil(PART), 1];
            let program = device.program("hidden surfaces", source, "search");
            program.on(device, &arguments, grid)
        };
        let sides = [
            side(true, height, width, 0, w, 1)?,
            side(false, height, width, w - 1, w, -1)?,
            side(false, width, height, 0, 1, w)?,
            side(false, width, height, (h - 1) * w, 1, -w)?,
        ];
        Ok(Search { sides, sources })
    }

    pub(crate) fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.sides.iter().for_each(|side| side.run(pass));
    }

    /// Returns the number of dispatches per frame.
    pub(crate) fn dispatches(&self) -> usize {
        self.sides.len()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::device::testing::{device, run};
    use phasefront_core::method::sweep::hidden::{Hidden, NOTHING, reference};

    /// Creates depths with edges, some of them blurred, and with noise at every pixel.
    fn depths(Size { width, height }: Size) -> Vec<Vec<f32>> {
        let mut state = 1u32;
        let mut random = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let place = |i: usize| (i / width, i % width);
        let edges = |i: usize| {
            let (y, x) = place(i);
            match (x % 23, (x / 7 + y / 11) % 4) {
                (0, _) => 0.5,
                (_, part) => 0.1 + 0.21 * part as f32,
            }
        };
        vec![
            (0..height * width).map(edges).collect(),
            (0..height * width).map(|_| random()).collect(),
            // Jumps exactly at the threshold.
            (0..height * width).map(|i| 0.3 + JUMP * ((i * 7) % 5) as f32).collect(),
            vec![0.25; height * width],
        ]
    }

    #[test]
    fn sources_are_those_of_the_cpu() {
        let device = device();
        for (size, reach) in [
            (Size { width: 47, height: 61 }, 31),
            (Size { width: 150, height: 1 }, 9),
            (Size { width: 1, height: 150 }, 200),
            (Size { width: 200, height: 7 }, 1),
            (
                Size {
                    width: 384,
                    height: 384,
                },
                31,
            ),
            (Size { width: 1, height: 1 }, 5),
        ] {
            let area = size.height * size.width;
            for (case, depth) in depths(size).into_iter().enumerate() {
                let values: Vec<[f32; 4]> = depth.iter().map(|&d| [0.0, 0.0, 0.0, d]).collect();
                let surfaces = device.table("surfaces", bytemuck::cast_slice(&values)).unwrap();
                let search = device
                    .guarded(|| Search::new(&device, &surfaces.buffer, size, reach))
                    .unwrap();
                // Two runs, because the state that one frame leaves must not affect the next.
                run(&device, |pass| {
                    search.run(pass);
                    search.run(pass);
                });
                let found = device.read(&search.sources, 8 * area).unwrap();
                let found: Vec<u32> = bytemuck::pod_collect_to_vec(&found);
                let expected = match area {
                    0..10_000 => reference(&depth, size, reach),
                    _ => {
                        let plan = Hidden::new(size, reach);
                        let mut sources = vec![0; 2 * area];
                        plan.find(&depth, &mut sources, &mut plan.scratch());
                        sources
                    }
                };
                assert!(found == expected, "{size:?}, {reach}, depth {case}");
                let some = found.iter().any(|&source| source != NOTHING);
                assert!(some || case > 1 || area != 384 * 384);
            }
        }
    }
}
