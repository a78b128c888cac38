//! Filters a field by several filters, one after another, and sums what comes back through their adjoints. The
//! filters share the transforms of the field's rows, three buffers of spectra, and one table for a filter and its
//! adjoint. A run takes every filter or, in turn, every nth.

use super::{Lines, Shared, Stage, is_even, roots, spectra_size};
use crate::Result;
use crate::device::{Device, Dispatch};
use num_complex::Complex32;
use phasefront_core::Size;

/// The input and the output of [`Paths`].
pub(crate) struct PathsJob<'a> {
    /// (3, H, W).
    pub(crate) field: &'a wgpu::Buffer,
    /// (3, H, W): the field at the end of a path, and in the end the sum.
    pub(crate) view: &'a wgpu::Buffer,
    pub(crate) size: Size,
    pub(crate) padded: Size,
}

/// Several filters of three planes, ready to run.
pub(crate) struct Paths {
    rows: Dispatch,
    ways: Vec<Way>,
    turns: usize,
    to_view: Dispatch,
    of_view: Dispatch,
    sum_to_view: Dispatch,
}

/// The columns of one filter.
struct Way {
    there: Dispatch,
    /// Through the adjoint, added to the sum.
    back: Dispatch,
}

impl Paths {
    /// Plans paths with these `factors`, one filter for each colour, each as in [`super::Planes`]. A run takes every
    /// path number `turns`.
    pub(crate) fn new(
        device: &Device,
        job: &PathsJob<'_>,
        factors: impl IntoIterator<Item = [Vec<Complex32>; 3]>,
        turns: usize,
    ) -> Result<Self> {
        let PathsJob {
            field,
            view,
            size,
            padded,
        } = *job;
        let spectra = spectra_size(size, padded);
        let room = |what| device.buffer(what, 24 * spectra.pixels());
        let (of_field, of_view, sum) = (
            room("spectra")?,
            room("spectra of a view")?,
            room("the sum of spectra")?,
        );
        let row_roots = roots(device, padded.width)?.buffer;
        let column_roots = roots(device, padded.height)?.buffer;
        let across = |buffer| Lines::rows(buffer, spectra);
        let down = |buffer| Lines::columns(buffer, spectra);
        let mut ways: Vec<Way> = Vec::new();
        for factors in factors {
            let one = factors[0].len();
            let [_, column, _] = Stage::of(padded, is_even(one, padded), false);
            let there = Stage {
                in_place: false,
                ..column
            };
            let back = Stage {
                conjugate: true,
                add: ways.len() >= turns,
                ..there
            };
            let table = device.table("a path", bytemuck::cast_slice(&factors.concat()))?;
            let shared = Shared {
                device,
                filter: &table.buffer,
                filter_plane: one,
                turn: &row_roots,
            };
            let lines = |from, to| (down(from), down(to));
            ways.push(Way {
                there: shared.step("columns there", there, &column_roots, lines(&of_field, &of_view))?,
                back: shared.step("columns back", back, &column_roots, lines(&of_view, &sum))?,
            });
        }
        let [row, _, back] = Stage::of(padded, true, false);
        let shared = Shared {
            device,
            // Rows are not filtered; any buffer serves.
            filter: &row_roots,
            filter_plane: 0,
            turn: &row_roots,
        };
        let frame = |buffer| Lines::rows(buffer, size);
        Ok(Paths {
            rows: shared.step("rows", row, &row_roots, (frame(field), across(&of_field)))?,
            ways,
            turns,
            to_view: shared.step("rows to the view", back, &row_roots, (across(&of_view), frame(view)))?,
            of_view: shared.step("rows of the view", row, &row_roots, (frame(view), across(&of_view)))?,
            sum_to_view: shared.step("rows of the sum", back, &row_roots, (across(&sum), frame(view)))?,
        })
    }

    /// Runs the paths of `turn` on the field: writes its view at the end of each path, lets `change` change the view,
    /// and sends it back. In the end the view is the sum of what came back.
    pub(crate) fn run(
        &self,
        turn: usize,
        pass: &mut wgpu::ComputePass<'_>,
        mut change: impl FnMut(&mut wgpu::ComputePass<'_>, usize),
    ) {
        self.rows.run(pass);
        for (path, way) in self.ways.iter().enumerate().skip(turn).step_by(self.turns) {
            way.there.run(pass);
            self.to_view.run(pass);
            change(pass, path);
            self.of_view.run(pass);
            way.back.run(pass);
        }
        self.sum_to_view.run(pass);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::device::testing::{apart, device, field, read, run, upload};
    use phasefront_core::optics::asm::{Padding, Propagator};
    use phasefront_core::optics::zernike::Aberration;

    const PITCH_M: f64 = 8e-6;
    const WAVELENGTHS_M: [f64; 3] = [638e-9, 520e-9, 450e-9];
    /// They need equal padding.
    const DISTANCES_M: [f64; 3] = [2e-3, -2e-3, 2e-3];
    /// Changes a view in a way that does not commute with filters.
    const FLATTEN: &str = "
        @group(0) @binding(0) var<storage, read_write> view: array<vec2f>;
        @compute @workgroup_size(64)
        fn flatten(@builtin(global_invocation_id) at: vec3u) {
            if (at.x < arrayLength(&view)) { view[at.x].y *= 0.25; }
        }";

    fn propagators(size: Size, distance_m: f64, aberration: Option<&Aberration>) -> Vec<Propagator> {
        let plans = match aberration {
            None => Propagator::for_colours(size, PITCH_M, &WAVELENGTHS_M, distance_m, Padding::Reach),
            Some(of) => Propagator::for_colours_corrected(size, PITCH_M, &WAVELENGTHS_M, distance_m, of, PITCH_M),
        };
        plans.unwrap()
    }

    /// Compares the sum of what comes back. The adjoint of a propagation is that over the opposite distance.
    #[test]
    fn what_comes_back_is_that_of_the_cpu() {
        let device = device();
        let lens = Aberration::new([[0.3, 0.0, 1.5, 0.0, 0.2]; 3]).unwrap();
        for (size, aberration, turns) in [
            (Size { width: 47, height: 61 }, None, 1),
            (Size { width: 66, height: 40 }, None, 2),
            (Size { width: 30, height: 22 }, Some(&lens), 2),
            (Size { width: 1, height: 1 }, None, 1),
        ] {
            let reversed = aberration.map(Aberration::reversed);
            let there = DISTANCES_M.map(|distance_m| propagators(size, distance_m, aberration));
            let back = DISTANCES_M.map(|distance_m| propagators(size, -distance_m, reversed.as_ref()));
            let given = field(size.pixels());
            let (of, view) = (upload(&device, &given), upload(&device, &given));
            let job = PathsJob {
                field: &of,
                view: &view,
                size,
                padded: there[0][0].padded_size(),
            };
            let factors = (there.iter()).map(|plans| std::array::from_fn(|c| plans[c].transfer().factors().to_vec()));
            let flatten = device.program("a view", FLATTEN.into(), "flatten");
            let made = device.guarded(|| {
                let grid = [given.len().div_ceil(64), 1, 1];
                let flatten = flatten.on(&device, &[(0, view.as_entire_binding())], grid)?;
                Ok((Paths::new(&device, &job, factors, turns)?, flatten))
            });
            let (paths, flatten) = made.unwrap();
            // The sum of one run must not add to the next one's.
            let in_turn = |turn: usize| run(&device, |pass| paths.run(turn, pass, |pass, _| flatten.run(pass)));
            (0..turns).for_each(in_turn);
            for turn in 0..turns {
                in_turn(turn);
                let mut expected = vec![Complex32::ZERO; given.len()];
                for (there, back) in there.iter().zip(&back).skip(turn).step_by(turns) {
                    for (c, sum) in expected.chunks_exact_mut(size.pixels()).enumerate() {
                        let mut plane = given[c * size.pixels()..][..size.pixels()].to_vec();
                        there[c].propagate(&mut plane, &mut there[c].scratch());
                        plane.iter_mut().for_each(|value| value.im *= 0.25);
                        back[c].propagate(&mut plane, &mut back[c].scratch());
                        sum.iter_mut().zip(plane).for_each(|(sum, value)| *sum += value);
                    }
                }
                let worst = apart(&read(&device, &view, expected.len()), &expected);
                assert!(worst < 1e-4, "{size:?} {} {turn}: {worst}", aberration.is_some());
            }
        }
    }
}
