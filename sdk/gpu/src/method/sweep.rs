//! Runs the plane sweep on the GPU, several planes per dispatch: the counterpart of [`phasefront_core::method::sweep`],
//! with the same filters.
//!
//! Input and output stay on the device: red, green, blue and depth of each pixel in, the hologram's field out. Every
//! step runs separately on the whole frame and a black border. The CPU saves work with tiles and merged steps; this
//! version only skips tiles that contain neither light nor points yet.

use crate::device::{Device, Dispatch};
use crate::method::chain::time;
use crate::method::hidden::Search;
use crate::{GpuError, Result};
use phasefront_core::Size;
use phasefront_core::display::Display;
use phasefront_core::method::sweep::{self, MARGIN, SweepPlan};

/// The columns and rows of a tile with its halo. Its complex f32 fit the workgroup memory of every GPU, 16 KiB.
const TILE: (usize, usize) = (48, 40);
/// The rows of a thread in sweep.wgsl.
const EACH: usize = 8;
/// The columns of a workgroup of the other programs.
const COLUMNS: usize = 64;
const HOME_ROWS: usize = 4;

/// A sweep for one frame size, ready to run.
pub(crate) struct Sweeper {
    /// `None` without hidden layers.
    search: Option<Search>,
    /// The dispatch that finds the planes of each pixel's points, then the dispatches of all planes.
    steps: Vec<Dispatch>,
    home: [Dispatch; 2],
    /// The number of planes per dispatch.
    pub(crate) together: usize,
    /// The field's position in metres from the midpoint toward the viewer.
    pub(crate) z_m: f64,
    /// (3, H, W) complex f32.
    pub(crate) field: wgpu::Buffer,
    /// The sums of the field: three complex f32 for each of `parts` workgroups.
    pub(crate) partial: wgpu::Buffer,
    pub(crate) parts: usize,
    /// The bytes that the dispatches read and write, counting each value once.
    pub(crate) bytes: usize,
}

impl Sweeper {
    /// Plans the sweep of `plan`, made for `display`, on a frame's `surfaces`: (H, W) of red, green, blue and depth,
    /// f32. It writes to new memory.
    pub(crate) fn new(device: &Device, plan: &SweepPlan, display: &Display, surfaces: &wgpu::Buffer) -> Result<Self> {
        let field = device.buffer("the field", 24 * plan.size().pixels())?;
        Self::into_field(device, plan, display, surfaces, field)
    }

    /// Plans the sweep as [`Self::new`] does. It writes to `field`, (3, H, W) complex f32.
    pub(crate) fn into_field(
        device: &Device,
        plan: &SweepPlan,
        display: &Display,
        surfaces: &wgpu::Buffer,
        field: wgpu::Buffer,
    ) -> Result<Self> {
        Self::planned(device, plan, display, (surfaces, field), device.measures())
    }

    /// Plans the sweep with the number of planes per dispatch that is measured to be faster, or the most that fit.
    fn planned(
        device: &Device,
        plan: &SweepPlan,
        display: &Display,
        (surfaces, field): (&wgpu::Buffer, wgpu::Buffer),
        measured: bool,
    ) -> Result<Self> {
        let radius = plan.sweep().taps / 2;
        let most = most_together(radius).ok_or_else(|| {
            GpuError::Refused(format!(
                "steps of {} taps do not fit the workgroup memory that every GPU has; {} taps at most, or more planes with fewer, are right",
                plan.sweep().taps,
                2 * MOST_RADIUS + 1
            ))
        })?;
        let search = match plan.sweep().hidden_layers {
            0 => None,
            _ => {
                let reach = sweep::hidden_reach(display);
                Some(Search::new(device, surfaces, plan.size(), reach)?)
            }
        };
        let Size { width, height } = plan.size();
        let area = height * width;
        let border = border(plan, display)?;
        let tiles = (width.div_ceil(COLUMNS), height.div_ceil(HOME_ROWS));
        let maker = Maker {
            device,
            plan,
            surfaces,
            // Without hidden layers the sources are not read.
            sources: search.as_ref().map_or(surfaces, |search| &search.sources),
            points: &device.buffer("points", 4 * area)?,
            border,
            padded: Size {
                width: width + 2 * border,
                height: height + 2 * border,
            },
        };
        let swept = 24 * maker.padded.height * maker.padded.width;
        let fields = [
            device.buffer("the swept field", swept)?,
            device.buffer("the swept field", swept)?,
        ];
        let (steps, together) = match measured && most > 1 {
            true => maker.faster(most, &fields)?,
            false => (maker.steps(most, &fields)?, most),
        };
        let crossings = plan.sweep().planes.div_ceil(together);
        let (last, other) = (&fields[crossings % 2], &fields[(crossings + 1) % 2]);
        let partial = device.buffer("sums", 24 * tiles.0 * tiles.1)?;
        let home = maker.home([last, other, &field], &partial)?;
        let searched = match search {
            // Each side reads depth. The sources are counted once.
            Some(_) => (4 * 16 + 8) * area,
            None => 0,
        };
        let half_home = 24 * maker.padded.height * width;
        Ok(Sweeper {
            search,
            home,
            together,
            z_m: plan.z_m(),
            field,
            partial,
            parts: tiles.0 * tiles.1,
            bytes: searched + (16 + 4) * area + crossings * (2 * swept + 4 * area) + swept + 2 * half_home + 24 * area,
            steps,
        })
    }

    pub(crate) fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        if let Some(search) = &self.search {
            search.run(pass);
        }
        let way = self.steps.iter().chain(&self.home);
        way.for_each(|step| step.run(pass));
    }

    /// Returns the number of dispatches per frame.
    pub(crate) fn dispatches(&self) -> usize {
        self.search.as_ref().map_or(0, Search::dispatches) + self.steps.len() + self.home.len()
    }
}

/// The state that the dispatches of a sweep share while they are planned.
struct Maker<'a> {
    device: &'a Device,
    plan: &'a SweepPlan,
    surfaces: &'a wgpu::Buffer,
    sources: &'a wgpu::Buffer,
    points: &'a wgpu::Buffer,
    border: usize,
    /// The size with the border.
    padded: Size,
}

impl Maker<'_> {
    fn header(&self) -> String {
        let sweep = self.plan.sweep();
        format!(
            "const COUNT: u32 = {}u;\nconst HIDDEN: u32 = {}u;\nconst BETWEEN: bool = {};\nconst MEET: f32 = {};\n",
            sweep.planes,
            sweep.hidden_layers,
            sweep.between_planes,
            sweep::MEET
        ) + include_str!("sweep_shares.wgsl")
    }

    /// Plans the dispatch that finds the planes of each pixel's points.
    fn points(&self) -> Result<Dispatch> {
        let Size { width, height } = self.plan.size();
        let frame = [width, height, height * width, 0].map(|n| n as u32);
        let frame = (self.device).constants("frame", bytemuck::cast_slice(&frame))?;
        let source = self.header() + include_str!("sweep_points.wgsl");
        let arguments = [
            (0, frame.buffer.as_entire_binding()),
            (1, self.surfaces.as_entire_binding()),
            (2, self.sources.as_entire_binding()),
            (3, self.points.as_entire_binding()),
        ];
        let program = self.device.program("points", source, "find");
        program.on(self.device, &arguments, [width.div_ceil(COLUMNS), height, 1])
    }

    /// Returns the faster of one plane and `most` planes per dispatch. The test frame is lit everywhere from its last
    /// plane on: it has white rows there, at least one in each tile.
    fn faster(&self, most: usize, fields: &[wgpu::Buffer; 2]) -> Result<(Vec<Dispatch>, usize)> {
        let Size { width, height } = self.plan.size();
        let row = vec![[1.0f32; 4]; width];
        for y in (0..height).step_by(TILE.1 / 2) {
            let at = (16 * y * width) as u64;
            (self.device.queue).write_buffer(self.surfaces, at, bytemuck::cast_slice(&row));
        }
        let (single, several) = (self.steps(1, fields)?, self.steps(most, fields)?);
        Ok(match time(self.device, &single)? < time(self.device, &several)? {
            true => (single, 1),
            false => (several, most),
        })
    }

    /// Plans the points of each pixel, then all planes, `together` per dispatch, alternating between the two fields. If
    /// the count is not a multiple, the first dispatch starts behind the last plane.
    fn steps(&self, together: usize, fields: &[wgpu::Buffer; 2]) -> Result<Vec<Dispatch>> {
        let (device, sweep) = (self.device, self.plan.sweep());
        let radius = sweep.taps / 2;
        let taps = (self.plan.filters().iter()).map(|f| &f.step[..]);
        let taps = device.constants("steps", &packed(taps, radius))?;
        let (columns, rows) = TILE;
        let source = self.header()
            + &format!(
                "const RADIUS: u32 = {radius}u;
                const PLANES: u32 = {together}u;
                const COLUMNS: u32 = {columns}u;
                const ROWS: u32 = {rows}u;
                const EACH: u32 = {EACH}u;
                "
            )
            + include_str!("sweep.wgsl");
        let program = device.program("planes", source, "cross_planes");
        let halo = 2 * radius * together;
        let Size {
            width: wide,
            height: high,
        } = self.padded;
        let grid = [wide.div_ceil(columns - halo), high.div_ceil(rows - halo), 3];
        let count = sweep.planes.div_ceil(together);
        let Size { width, height } = self.plan.size();
        let crossings = (0..count).map(|step| {
            let first = (count - step) * together - 1;
            let frame = [width, height, self.border, first].map(|n| n as u32);
            let frame = device.constants("frame", bytemuck::cast_slice(&frame))?;
            let arguments = [
                (0, frame.buffer.as_entire_binding()),
                (1, taps.buffer.as_entire_binding()),
                (2, self.surfaces.as_entire_binding()),
                (3, self.sources.as_entire_binding()),
                (4, self.points.as_entire_binding()),
                (5, fields[step % 2].as_entire_binding()),
                (6, fields[(step + 1) % 2].as_entire_binding()),
            ];
            program.on(device, &arguments, grid)
        });
        std::iter::once(self.points()).chain(crossings).collect()
    }

    /// Plans the propagation to the hologram: rows from the first of `fields` to the second, columns from the second to
    /// the third, with sums to `partial`.
    fn home(&self, fields: [&wgpu::Buffer; 3], partial: &wgpu::Buffer) -> Result<[Dispatch; 2]> {
        let device = self.device;
        let filters = self.plan.filters();
        let lengths = filters.iter().map(|f| f.home.len());
        let radius = lengths.max().unwrap_or(1) - 1;
        let taps = filters.iter().map(|f| &f.home[..]);
        let taps = device.constants("the way home", &packed(taps, radius))?;
        let Size { width, height } = self.plan.size();
        let Size {
            width: wide,
            height: high,
        } = self.padded;
        let go = |down: bool, written: usize, read: usize, from, to: &wgpu::Buffer| {
            let tiles = [width.div_ceil(COLUMNS), written.div_ceil(HOME_ROWS), 3];
            let way = [width, written, read, high, self.border, tiles[0], 0, 0];
            let way = way.map(|n| n as u32);
            let way = device.constants("the way home", bytemuck::cast_slice(&way))?;
            let header = format!("const RADIUS: u32 = {radius}u;\nconst DOWN: bool = {down};\n");
            let source = header + include_str!("sweep_home.wgsl");
            let arguments = [
                (0, way.buffer.as_entire_binding()),
                (1, taps.buffer.as_entire_binding()),
                (2, wgpu::Buffer::as_entire_binding(from)),
                (3, to.as_entire_binding()),
                (4, partial.as_entire_binding()),
            ];
            let program = device.program("the way home", source, "go_home");
            program.on(device, &arguments, tiles)
        };
        Ok([
            go(false, high, wide, fields[0], fields[1])?,
            go(true, height, width, fields[1], fields[2])?,
        ])
    }
}

/// The longest radius of a step that leaves enough of a tile.
const MOST_RADIUS: usize = TILE.1 / 4;

/// Returns the most planes per dispatch. Each adds a halo and saves a read and a write of the field. At least a quarter
/// of the tile must remain; returns `None` if one plane leaves less.
fn most_together(radius: usize) -> Option<usize> {
    let left = |planes: usize| {
        let halo = 2 * radius * planes;
        TILE.0.saturating_sub(halo) * TILE.1.saturating_sub(halo)
    };
    (1..).take_while(|&planes| 4 * left(planes) >= TILE.0 * TILE.1).last()
}

/// Returns the width in pixels of the black border around the frame. Light outside the frame at plane k can come only
/// from as far as it spreads from the last plane, and matters only if it returns on the way to plane 0 and the
/// hologram.
fn border(plan: &SweepPlan, display: &Display) -> Result<usize> {
    let sweep = plan.sweep();
    let optics = sweep::optics(display, &sweep, plan.z_m())?;
    let most = |colour: &sweep::Optics| {
        let left = |k: usize| colour.reach((sweep.planes - 1 - k) as f64 * colour.step_m);
        let back = |k: usize| colour.reach(colour.home_m.abs() + k as f64 * colour.step_m);
        (0..sweep.planes).map(|k| left(k).min(back(k))).max()
    };
    let widest = optics.iter().filter_map(most).max();
    Ok(widest.unwrap_or(0) + MARGIN)
}

/// Packs the filters of three colours up to `radius` for the programs: four f32 per tap, of which two are unused.
fn packed<'a>(colours: impl Iterator<Item = &'a [[f32; 2]]>, radius: usize) -> Vec<u8> {
    let all: Vec<[f32; 4]> = colours
        .flat_map(|taps| {
            (0..=radius).map(move |j| {
                let [re, im] = taps.get(j).copied().unwrap_or_default();
                [re, im, 0.0, 0.0]
            })
        })
        .collect();
    bytemuck::cast_slice(&all).to_vec()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::device::testing::{apart, device, read, run};
    use ndarray::{Array2, Array3};
    use num_complex::Complex32;
    use phasefront_core::frame::RgbdFrame;
    use phasefront_core::method::sweep::{Sweep, reference};

    /// Returns a display with a small volume, so that the direct reference needs only a small border.
    fn small() -> Display {
        Display::from_toml("volume_depth_mm = 1.5").unwrap()
    }

    fn sweep() -> Sweep {
        Sweep {
            planes: 9,
            taps: 9,
            hidden_layers: 2,
            between_planes: true,
            tile: 16,
        }
    }

    /// Creates a frame with fine colour detail and the depth that `depth` returns.
    fn frame(Size { width, height }: Size, depth: fn(usize, usize) -> f32) -> RgbdFrame {
        let rgb = Array3::from_shape_fn((3, height, width), |(c, y, x)| {
            ((c * 5 + y * 3 + x * x + y * x) % 11) as f32 / 10.0
        });
        let depth = Array2::from_shape_fn((height, width), |(y, x)| depth(y, x));
        RgbdFrame::new(rgb, depth).unwrap()
    }

    /// Returns depths with sharp edges, one of them slanted, some exactly on the bounds between planes.
    fn scene(y: usize, x: usize) -> f32 {
        match (y / 13 + 2 * (x / 17)) % 5 {
            0 => 0.1,
            1 => 0.35 + 0.004 * (y % 60) as f32,
            2 => 0.6,
            3 => 0.7,
            _ => 0.93,
        }
    }

    /// Returns a different depth for each pixel.
    fn noise(y: usize, x: usize) -> f32 {
        let mixed = (y as u32 * 7919 + x as u32 * 104_729).wrapping_mul(2_654_435_761);
        (mixed >> 8) as f32 / (1 << 24) as f32
    }

    fn on_gpu(frame: &RgbdFrame, plan: &SweepPlan, display: &Display, measured: bool) -> Vec<Complex32> {
        let device = device();
        let Size { width, height } = frame.size();
        let (rgb, depth) = (frame.rgb(), frame.depth());
        let values: Vec<[f32; 4]> = depth
            .indexed_iter()
            .map(|((y, x), &d)| [rgb[(0, y, x)], rgb[(1, y, x)], rgb[(2, y, x)], d])
            .collect();
        let surfaces = device.buffer("surfaces", 16 * values.len()).unwrap();
        let sweeper = device
            .guarded(|| {
                let field = device.buffer("the field", 24 * height * width)?;
                Sweeper::planned(&device, plan, display, (&surfaces, field), measured)
            })
            .unwrap();
        (device.queue).write_buffer(&surfaces, 0, bytemuck::cast_slice(&values));
        // Two runs, because the state that one frame leaves must not affect the next.
        run(&device, |pass| {
            sweeper.run(pass);
            sweeper.run(pass);
        });
        let field = read(&device, &sweeper.field, 3 * height * width);
        let sums = read(&device, &sweeper.partial, 3 * sweeper.parts);
        for (c, plane) in field.chunks_exact(height * width).enumerate() {
            let sum: Complex32 = sums.iter().skip(c).step_by(3).sum();
            let expected: Complex32 = plane.iter().sum();
            let most = 1e-4 * plane.iter().map(|v| v.norm()).sum::<f32>();
            assert!((sum - expected).norm() <= most, "{sum} {expected}");
        }
        field
    }

    /// Compares the sweep with its definition.
    #[test]
    #[ignore = "slow: 12 seconds of a core in software"]
    fn the_sweep_is_its_oracle() {
        let depths: [fn(usize, usize) -> f32; 6] = [
            scene,
            noise,
            |_, _| 0.0,
            |_, _| 1.0,
            |_, _| 0.5,
            |y, x| ((y + x) % 2) as f32,
        ];
        let sweeps = [
            sweep(),
            Sweep {
                hidden_layers: 1,
                ..sweep()
            },
            Sweep {
                hidden_layers: 0,
                ..sweep()
            },
            Sweep {
                between_planes: false,
                ..sweep()
            },
            Sweep {
                taps: 13,
                planes: 7,
                ..sweep()
            },
            Sweep { planes: 1, ..sweep() },
            Sweep {
                taps: 5,
                planes: 24,
                ..sweep()
            },
        ];
        let mut cases = Vec::new();
        cases.extend(depths.map(|depth| (Size { width: 38, height: 34 }, depth, sweep(), 0.0)));
        cases.extend(sweeps.map(|sweep| (Size { width: 29, height: 41 }, depths[0], sweep, 0.0)));
        cases.push((Size { width: 31, height: 29 }, depths[1], sweep(), -1e-3));
        for size in [
            Size { width: 47, height: 61 },
            Size { width: 7, height: 50 },
            Size { width: 50, height: 7 },
            Size { width: 29, height: 1 },
            Size { width: 1, height: 30 },
            Size { width: 1, height: 1 },
        ] {
            cases.push((size, depths[0], sweep(), 2e-3));
        }
        for (case, (size, depth, sweep, z_m)) in cases.into_iter().enumerate() {
            let frame = frame(size, depth);
            let plan = SweepPlan::new(size, &small(), sweep, z_m).unwrap();
            let field = on_gpu(&frame, &plan, &small(), case % 2 == 1);
            let expected = reference::field(&frame, &small(), sweep, z_m).unwrap();
            let worst = apart(&field, &expected);
            println!("{size:?} {sweep:?} {z_m}: {worst}");
            assert!(worst < 1e-4, "{size:?} {sweep:?} {z_m}: {worst}");
        }
    }

    /// Compares the sweep with the CPU's, which is rounded to 16 bits.
    fn agrees_with_the_cpu(size: Size, depth: fn(usize, usize) -> f32, display: &Display, z_m: f64) {
        let frame = frame(size, depth);
        let sweep = Sweep::for_display(display);
        let plan = SweepPlan::new(size, display, sweep, z_m).unwrap();
        let field = on_gpu(&frame, &plan, display, false);
        let mut expected = vec![Complex32::ZERO; field.len()];
        plan.field(&frame, &mut expected, &mut plan.scratch()).unwrap();
        let worst = apart(&field, &expected);
        println!("{size:?} {sweep:?} {z_m}: {worst}");
        assert!(worst < 4e-3, "{size:?} {sweep:?} {z_m}: {worst}");
    }

    /// At the default volume and on other displays.
    #[test]
    #[ignore = "slow: 20 seconds of a core in software"]
    fn whole_frames_are_those_of_the_cpu() {
        let default = Display::default();
        let fine = Display::from_toml("pitch_um = 3.74\nvolume_depth_mm = 2").unwrap();
        for (size, depth, display, z_m) in [
            (
                Size { width: 47, height: 61 },
                scene as fn(usize, usize) -> f32,
                &default,
                0.0,
            ),
            (Size { width: 47, height: 61 }, noise, &default, 0.0),
            (Size { width: 7, height: 90 }, scene, &default, 0.0),
            (Size { width: 47, height: 61 }, scene, &default, 3e-3),
            (Size { width: 47, height: 61 }, scene, &default, -3e-3),
            (Size { width: 47, height: 61 }, scene, &fine, 0.0),
        ] {
            agrees_with_the_cpu(size, depth, display, z_m);
        }
    }

    #[test]
    #[ignore = "slow: 12 seconds of a core in software"]
    fn large_frames_are_those_of_the_cpu() {
        let size = Size {
            width: 384,
            height: 384,
        };
        agrees_with_the_cpu(size, scene, &Display::default(), 0.0);
    }

    #[test]
    fn steps_that_do_not_fit_are_refused() {
        assert_eq!(most_together(2), Some(5));
        assert_eq!(most_together(5), Some(2));
        assert_eq!(most_together(MOST_RADIUS), Some(1));
        assert_eq!(most_together(MOST_RADIUS + 1), None);
        let device = device();
        let wide = Sweep {
            taps: 2 * MOST_RADIUS + 3,
            ..sweep()
        };
        let plan = SweepPlan::new(Size { width: 9, height: 9 }, &small(), wide, 0.0).unwrap();
        let surfaces = device.buffer("surfaces", 16 * 81).unwrap();
        let refused = device.guarded(|| Sweeper::new(&device, &plan, &small(), &surfaces));
        assert!(refused.err().unwrap().to_string().contains("23 taps"));
    }
}
