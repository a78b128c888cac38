//! The chain in 32-bit floating point and the packing of its weights for the kernels.
//!
//! A row is one run of pixels for each channel. In the last layer's rows the network's input follows the features. A
//! hidden layer returns `max(sum + bias, 0)`, plus the skip's value if there is one. Instruction sets differ in whether
//! they fuse products into sums, so they agree to rounding and not bit for bit.

use crate::Size;
use crate::rows::Rows;
use crate::wavefront::{self, Chain, Geometry, LastRows, Scratch, Slots, SlotsMut, SourceRow, Tiling};
use crate::{Isa, OUTPUTS};

/// One layer.
#[derive(Debug, Clone, PartialEq)]
pub struct F32Layer {
    /// The input channels, including the concatenated ones of the last layer.
    pub inputs: usize,
    /// The number of filters.
    pub outputs: usize,
    /// `(outputs, inputs, 3, 3)`.
    pub kernel: Vec<f32>,
    /// One bias per filter.
    pub bias: Vec<f32>,
}

impl F32Layer {
    /// Returns the part of a last layer that computes the outputs of one pixel of each place.
    fn of_pixel(&self, pixel: usize) -> F32Layer {
        let weights = OUTPUTS * self.inputs * 9;
        F32Layer {
            inputs: self.inputs,
            outputs: OUTPUTS,
            kernel: self.kernel[pixel * weights..][..weights].to_vec(),
            bias: self.bias[pixel * OUTPUTS..][..OUTPUTS].to_vec(),
        }
    }
}

/// A layer in the layout of the kernels.
pub(crate) struct Packed {
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
    pub(crate) bias: Vec<f32>,
    /// `[filters by the kernels' sizes][ky][channel][kx][filter]`.
    pub(crate) weights: Vec<f32>,
}

/// The kernels of an instruction set.
#[derive(Clone, Copy)]
#[allow(clippy::type_complexity)]
pub(crate) struct Kernels {
    /// Returns the number of filters computed together, given the number of filters left.
    pub(crate) size: fn(usize) -> usize,
    /// Computes a row of a hidden layer: layer, three rows, the skip's row, the row of features to write.
    pub(crate) hidden_row: fn(&Packed, &[&[f32]; 3], Option<&[f32]>, &mut [f32], Geometry),
    /// Computes a row of the last layer: layer, three rows, the output planes' rows, the first pixel to compute.
    pub(crate) last_row: fn(&Packed, &[&[f32]; 3], [&mut [f32]; OUTPUTS], usize, Geometry),
}

fn kernels(isa: Isa) -> Option<Kernels> {
    match isa {
        Isa::Portable => Some(crate::portable::F32),
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => crate::x86::avx512::kernels(),
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => crate::x86::avx2::f32_kernels(),
        #[cfg(target_arch = "aarch64")]
        Isa::Neon => Some(crate::arm::neon::KERNELS),
        #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
        Isa::Simd128 => Some(crate::wasm::simd128::F32),
        _ => None,
    }
}

/// An f32 chain packed for one instruction set. It is immutable and threads can share it.
pub struct F32Chain {
    isa: Isa,
    kernels: Kernels,
    /// The pixels along each side of a place.
    side: usize,
    /// All layers but the last.
    layers: Vec<Packed>,
    /// The last layer for each pixel of a place.
    last: Vec<Packed>,
}

impl F32Chain {
    /// Packs a chain.
    ///
    /// # Errors
    /// Returns an error if the kernels cannot run the chain: the shapes form no chain, the filters are not in eights,
    /// or this processor lacks the instruction set.
    pub fn new(layers: &[F32Layer], isa: Isa) -> Result<F32Chain, String> {
        let kernels = kernels(isa)
            .filter(|_| Isa::f32().contains(&isa))
            .ok_or_else(|| format!("this processor has no f32 kernels '{isa}'"))?;
        let side = crate::check_shapes(layers.iter().map(|l| (l.inputs, l.outputs)))?;
        for layer in layers {
            if layer.kernel.len() != layer.outputs * layer.inputs * 9 || layer.bias.len() != layer.outputs {
                return Err(format!("weights or biases do not fit {} filters", layer.outputs));
            }
        }
        let pack = |layer: &F32Layer| {
            let mut weights = Vec::with_capacity(layer.kernel.len());
            let mut first = 0;
            while first < layer.outputs {
                let size = (kernels.size)(layer.outputs - first);
                for ky in 0..3 {
                    for channel in 0..layer.inputs {
                        for kx in 0..3 {
                            weights.extend(
                                (first..first + size)
                                    .map(|filter| layer.kernel[((filter * layer.inputs + channel) * 3 + ky) * 3 + kx]),
                            );
                        }
                    }
                }
                first += size;
            }
            Packed {
                inputs: layer.inputs,
                outputs: layer.outputs,
                bias: layer.bias.clone(),
                weights,
            }
        };
        let [hidden @ .., last] = layers else {
            return Err("a chain has two layers at least".into());
        };
        Ok(F32Chain {
            isa,
            kernels,
            side,
            layers: hidden.iter().map(pack).collect(),
            last: (0..side * side).map(|pixel| pack(&last.of_pixel(pixel))).collect(),
        })
    }

    /// Returns the instruction set in use.
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// Returns the number of layers.
    pub fn layers(&self) -> usize {
        self.layers.len() + 1
    }

    /// Returns the tiling for a frame size and the current rayon pool.
    pub fn tiling(&self, size: Size) -> Tiling {
        wavefront::tiling_for(self, size)
    }

    /// Runs the chain on the current rayon pool. `input` is planar `(C, H, W)` and `output` is `(6, H, W)`.
    ///
    /// # Panics
    /// Panics if a length does not match the size.
    pub fn run(&self, input: &[f32], output: &mut [f32], size: Size, tiling: Tiling, scratch: &Scratch<f32>) {
        let area = size.height * size.width;
        let inputs = self.inputs() / (self.side * self.side);
        assert_eq!(input.len(), inputs * area, "planes of the input");
        assert_eq!(output.len(), OUTPUTS * area, "planes of the output");
        let mut planes = output.chunks_exact_mut(area.max(1));
        let planes = std::array::from_fn(|_| planes.next().unwrap_or_default());
        let rows = wavefront::Planar { input, size };
        self.run_rows(&rows, planes, size, tiling, scratch);
    }

    /// Runs the chain with input and output that need not be planes in memory: reads the input from `rows` and writes
    /// the output through them to `planes`, each (H, W).
    ///
    /// # Panics
    /// Panics if a length does not match the size, or if `rows` panics.
    pub fn run_rows<R: Rows<PLANES>, const PLANES: usize>(
        &self,
        rows: &R,
        planes: [&mut [R::Value]; PLANES],
        size: Size,
        tiling: Tiling,
        scratch: &Scratch<f32>,
    ) {
        wavefront::run(self, rows, planes, size, tiling, scratch);
    }
}

impl Chain for F32Chain {
    type Element = f32;
    const GROUP: usize = 1;

    fn layers(&self) -> usize {
        self.layers.len() + 1
    }

    fn step(&self) -> usize {
        1
    }

    fn cache(&self) -> usize {
        // Half of a core's second-level cache: strips of the full width took a third longer.
        1 << 20
    }

    fn side(&self) -> usize {
        self.side
    }

    fn inputs(&self) -> usize {
        self.layers[0].inputs
    }

    fn groups(&self, i: usize) -> usize {
        self.layers.get(i).unwrap_or(&self.last[0]).inputs
    }

    fn zero(&self, _i: usize) -> f32 {
        0.0
    }

    fn input_row(&self, source: SourceRow<'_>, out: &mut [f32], geometry: Geometry) {
        copy_rows(source, out, geometry);
    }

    fn concatenated_row(&self, source: SourceRow<'_>, out: &mut [f32], geometry: Geometry) {
        copy_rows(source, &mut out[self.layers[0].outputs * geometry.stride()..], geometry);
    }

    fn hidden_rows(
        &self,
        i: usize,
        rows: Slots<'_, f32>,
        skip: Option<Slots<'_, f32>>,
        mut out: SlotsMut<'_, f32>,
        geometry: Geometry,
    ) {
        let skip = skip.map(|skip| skip.rows::<1>()[0]);
        (self.kernels.hidden_row)(&self.layers[i], &rows.rows(), skip, out.row_mut(0), geometry);
    }

    fn last_rows(&self, pixel: usize, rows: Slots<'_, f32>, mut out: LastRows<'_>, from: usize, geometry: Geometry) {
        (self.kernels.last_row)(&self.last[pixel], &rows.rows(), out.planes(0), from, geometry);
    }
}

fn copy_rows(source: SourceRow<'_>, out: &mut [f32], geometry: Geometry) {
    for (c, out) in out.chunks_exact_mut(geometry.stride()).enumerate() {
        out[geometry.start()..][..geometry.width].copy_from_slice(source.channel(c, geometry.width));
    }
}
