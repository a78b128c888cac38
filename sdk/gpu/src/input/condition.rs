//! Decides the depth of the display's pixels from conditioned readings: the counterpart of
//! [`phasefront_core::depth::condition::Conditioner::decide`].

use crate::Result;
use crate::device::{Device, Dispatch};
use phasefront_core::Size;
use phasefront_core::depth::condition::{ConditionedReadings, constants};
use phasefront_core::runtime::error::Error;

/// The stage for one number of readings and pixels. It remembers the choices of earlier frames.
pub(super) struct Conditioning {
    size: Size,
    out: Size,
    sizes: wgpu::Buffer,
    readings: wgpu::Buffer,
    places: wgpu::Buffer,
    steps: [Dispatch; 3],
}

impl Conditioning {
    /// Plans the stage for readings of `size`. It adds their depth to `picture`, the red, green, blue and depth
    /// of an image of the size `out`.
    pub(super) fn new(device: &Device, size: Size, out: Size, picture: &wgpu::Buffer) -> Result<Self> {
        let (cells, pixels) = (size.height * size.width, out.height * out.width);
        let header: String = constants()
            .iter()
            .map(|(name, value)| format!("const {name}: f32 = {value:?};\n"))
            .collect();
        let source = header + include_str!("condition.wgsl");
        let sizes = device.buffer("sizes", 24)?;
        let readings = device.buffer("readings", 4 * (cells + cells.div_ceil(4)))?;
        let places = device.buffer("places", 8 * (size.height + size.width + out.height + out.width))?;
        let colours = device.buffer("the colours of readings", 16 * cells)?;
        let choices = device.buffer("choices", 12 * pixels)?;
        let history = device.buffer("earlier choices", 8 * pixels)?;
        let all = [&sizes, &readings, &places, picture, &colours, &choices, &history];
        let step = |entry, used: &[u32], grid: [usize; 3]| {
            let arguments: Vec<_> = (used.iter())
                .map(|i| (*i, all[*i as usize].as_entire_binding()))
                .collect();
            let program = device.program("conditioning", source.clone(), entry);
            program.on(device, &arguments, grid)
        };
        let rows = |size: Size| [size.width.div_ceil(64), size.height, 1];
        let tiles = [out.width.div_ceil(8), out.height.div_ceil(8), 1];
        let steps = [
            step("sum", &[0, 1, 2, 3, 4], rows(size))?,
            step("choose", &[0, 1, 2, 3, 4, 5, 6], tiles)?,
            step("decide", &[0, 1, 2, 3, 5, 6], rows(out))?,
        ];
        Ok(Conditioning {
            size,
            out,
            sizes,
            readings,
            places,
            steps,
        })
    }

    /// Uploads the readings of a frame.
    pub(super) fn upload(&self, device: &Device, readings: &ConditionedReadings<'_>) -> Result<()> {
        if (readings.size(), readings.out()) != (self.size, self.out) {
            return Err(Error::Frame("depth comes in another form than was planned".into()).into());
        }
        let Size { width, height } = self.out;
        let (rows, columns) = self.size.shape();
        let flags = [readings.are_coarse(), readings.has_past()].map(u32::from);
        let sizes = [
            width as u32,
            height as u32,
            columns as u32,
            rows as u32,
            flags[0],
            flags[1],
        ];
        device.write(&self.sizes, 0, bytemuck::cast_slice(&sizes));
        device.write(&self.readings, 0, bytemuck::cast_slice(readings.depth()));
        let kinds: Vec<u8> = readings.kinds().collect();
        device.write(&self.readings, 4 * rows * columns, &kinds);
        let mut places: Vec<u32> = Vec::with_capacity(2 * (height + width + rows + columns));
        for axis in readings.axes() {
            places.extend(axis.cell);
            places.extend(axis.offset.iter().map(|offset| offset.to_bits()));
            places.extend(axis.pixels.iter().flat_map(|(first, end)| [first, end]));
        }
        device.write(&self.places, 0, bytemuck::cast_slice(&places));
        Ok(())
    }

    pub(super) fn run(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.steps.iter().for_each(|step| step.run(pass));
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::{Colour, ColourData, Depth, DepthData, Form, Frame, Packer, Source};
    use crate::device::Device;
    use crate::device::testing::{device, run};
    use phasefront_core::Size;
    use phasefront_core::depth::condition::{ConditionScratch, Conditioner};
    use phasefront_core::frame::Crop;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A video of two surfaces of different colours before a slope, with noise, holes and a shift. A part moves.
    struct Scene {
        cells: Size,
        out: Size,
        crop: Crop,
        random: ChaCha8Rng,
    }

    impl Scene {
        fn new(cells: Size, out: Size) -> Self {
            Scene {
                cells,
                out,
                crop: Crop::cover(cells, out),
                random: ChaCha8Rng::seed_from_u64((cells.height * out.width) as u64),
            }
        }

        /// Returns the depth and the colours of a frame.
        fn frame(&mut self, time: usize) -> (Vec<f32>, Vec<f32>) {
            let (cells, out, crop) = (self.cells, self.out, self.crop);
            let surface = |x: f64, y: f64| match (x - 0.4 - 0.04 * time as f64).powi(2) + (y - 0.5).powi(2) < 0.07 {
                true => 0,
                false if (0.72..0.78).contains(&x) || y > 0.85 => 1,
                false => 2,
            };
            let mut noise = |most: f32| self.random.random_range(-most..most);
            let depth = (0..cells.height * cells.width).map(|i| {
                // Readings mix what lies in them, a pixel or a reading beside the colour.
                let part = |k: usize| {
                    let beside = if cells == out { 1.0 } else { 0.4 };
                    let x = ((i % cells.width) as f64 + (k % 4) as f64 / 4.0 + beside) / cells.width as f64;
                    let y = ((i / cells.width) as f64 + (k / 4) as f64 / 4.0) / cells.height as f64;
                    [0.2, 0.45, 0.7 + 0.2 * y as f32][surface(x, y)]
                };
                let mean = (0..16).map(part).sum::<f32>() / 16.0;
                let is_hole =
                    noise(1.0) > 0.95 || i % cells.width > 4 * cells.width / 5 && i / cells.width < cells.height / 3;
                if is_hole { f32::NAN } else { mean + noise(0.02) }
            });
            let depth = depth.collect();
            let mut rgb = vec![0.0; 3 * out.height * out.width];
            for (i, value) in rgb.iter_mut().enumerate() {
                let (c, y, x) = (i / (out.height * out.width), i / out.width % out.height, i % out.width);
                let x = (crop.x + (x as f64 + 0.5) * crop.width / out.width as f64) / cells.width as f64;
                let y = (crop.y + (y as f64 + 0.5) * crop.height / out.height as f64) / cells.height as f64;
                let colour = [[0.9, 0.5, 0.1], [0.3, 0.6, 0.3], [0.2, 0.4, 0.6]][surface(x, y)];
                *value = (colour[c] + noise(0.05)).clamp(0.0, 1.0);
            }
            (depth, rgb)
        }
    }

    /// Returns the depth that the GPU decides and that of the CPU, for a frame that was found.
    fn both(
        device: &Device,
        packer: &Packer,
        plan: &Conditioner,
        rgb: &[f32],
        scratch: &mut ConditionScratch,
    ) -> (Vec<f32>, Vec<f32>) {
        let frame = Frame {
            colour: ColourData::Planar(rgb),
            depth: DepthData::Readings(plan.readings(scratch)),
        };
        packer.upload(device, &frame).unwrap();
        run(device, |pass| {
            packer.run(pass);
            packer.condition(pass);
        });
        let Size { width, height } = plan.size();
        let pixels = device.read(&packer.input.first, 16 * height * width).unwrap();
        let pixels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&pixels);
        let mut expected = vec![0.0; height * width];
        plan.decide(rgb, &mut expected, scratch);
        (pixels.iter().map(|pixel| pixel[3]).collect(), expected)
    }

    /// Checks coarse sensors, those of a few pixels a reading and full-size ones, in videos that are reset once. The
    /// third frame has no history.
    #[test]
    fn depth_is_that_of_the_cpu() {
        let device = device();
        let (mut kinds, mut is_shifted) = ([0; 4], false);
        for (cells, out) in [
            (
                Size { width: 27, height: 19 },
                Size {
                    width: 187,
                    height: 131,
                },
            ),
            (Size { width: 53, height: 41 }, Size { width: 107, height: 83 }),
            (Size { width: 80, height: 60 }, Size { width: 99, height: 77 }),
            (Size { width: 91, height: 67 }, Size { width: 91, height: 67 }),
            (Size { width: 101, height: 75 }, Size { width: 51, height: 37 }),
            (Size { width: 1, height: 1 }, Size { width: 3, height: 5 }),
            (Size { width: 9, height: 2 }, Size { width: 81, height: 70 }),
        ] {
            let mut scene = Scene::new(cells, out);
            let plan = Conditioner::new(cells, scene.crop, out, false).unwrap();
            let mut scratch = plan.scratch();
            let source = Source::Frame(Colour::Planar, Depth::Readings(cells));
            let packer = device
                .guarded(|| Packer::new(&device, Form::Surfaces, out, source, None))
                .unwrap();
            let (mut differ, mut others) = (0, 0);
            for time in 0..6usize {
                if time == 2 {
                    scratch.reset();
                }
                let (depth, rgb) = scene.frame(time.saturating_sub(3));
                // A sensor of a single reading may have none.
                if plan.find(&depth, &rgb, &mut scratch).is_err() {
                    continue;
                }
                let readings = plan.readings(&scratch);
                is_shifted |= cells == out && readings.axes()[0].cell[9] != 9;
                readings.kinds().for_each(|kind| kinds[usize::from(kind)] += 1);
                let (made, expected) = both(&device, &packer, &plan, &rgb, &mut scratch);
                let apart = made.iter().zip(&expected).map(|(a, b)| (a - b).abs());
                differ += apart.filter(|apart| apart.is_nan() || *apart > 1e-5).count();
                others += made.iter().zip(&expected).filter(|(a, b)| a != b).count();
            }
            let all = 6 * out.height * out.width;
            println!("{cells:?} {out:?}: {differ} of {all} apart, {others} with other bits");
            assert!(differ * 2000 <= all, "{cells:?} {out:?}: {differ} of {all}");
        }
        assert!(is_shifted && kinds.iter().all(|count| *count > 300), "{kinds:?}");
    }
}
