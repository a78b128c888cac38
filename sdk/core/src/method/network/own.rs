//! A network of any form, by tract: an ONNX graph from planes of an RGB-D frame to a complex field or phases, as its
//! metadata declares them ([`contract`]).

pub(super) mod contract;

use super::graph::{self, flat, not_run, one_line};
use super::metadata::{Served, TrainedDisplay};
use super::proto::Graph;
use super::{InputKind, Source};
use crate::Size;
use crate::display::Display;
use crate::runtime::caught::caught;
use crate::runtime::error::{Error, Result};
use contract::{Contract, Output};
use num_complex::Complex32;
use std::sync::Arc;
use tract_onnx::prelude::*;
use tract_onnx::tract_hir::infer::Factoid;
use tract_onnx::tract_hir::internal::DimLike;

/// The numbers of halvings of a U-Net that [`OwnNetwork::missing_multiple`] tries.
const HALVINGS: std::ops::RangeInclusive<u32> = 1..=7;

/// A graph and what its metadata says of it.
pub(super) struct OwnNetwork {
    model: InferenceModel,
    contract: Contract,
    inputs: Vec<Input>,
    /// The number of convolutions.
    pub(super) layers: usize,
    /// The largest number of output channels of a convolution.
    pub(super) filters: usize,
}

/// One input of the graph, (1, C, H, W).
#[derive(Clone)]
struct Input {
    channels: usize,
    /// The rows and columns that the file fixes.
    fixed: [Option<usize>; 2],
    kind: DatumType,
}

impl OwnNetwork {
    /// Reads the graph of `file`.
    ///
    /// # Errors
    /// Returns [`Error::Network`] if tract does not read it, or if its inputs are not the planes of `contract`.
    pub(super) fn new(file: &[u8], graph: Option<&Graph>, contract: Contract) -> Result<Self> {
        let model = graph::read(file, None)?;
        let count = contract.planes.len();
        let inputs = flat(caught(|| {
            (0..model.inputs.len())
                .map(|i| input(&model, i, count))
                .collect::<std::result::Result<Vec<_>, _>>()
        }))?;
        let taken: usize = inputs.iter().map(|input| input.channels).sum();
        if taken != count {
            return Err(Error::Network(format!(
                "it takes {taken} planes, and metadata 'phasefront.planes' names {count}"
            )));
        }
        let convolutions = || {
            let nodes = graph.iter().flat_map(|graph| &graph.node);
            nodes.filter(|node| node.op_type.contains("Conv"))
        };
        let weights = graph.iter().flat_map(|graph| &graph.initializer);
        let filters = weights.filter_map(|tensor| {
            let of = convolutions().find(|node| node.input.get(1) == Some(&tensor.name))?;
            let side = usize::from(of.op_type == "ConvTranspose");
            usize::try_from(*tensor.dims.get(side)?).ok()
        });
        Ok(OwnNetwork {
            filters: filters.max().unwrap_or(0),
            layers: convolutions().count(),
            model,
            contract,
            inputs,
        })
    }

    /// Returns whether the output is the modulator's phase.
    pub(super) fn gives_phase(&self) -> bool {
        self.contract.output == Output::Phase
    }

    /// Returns the output that a network for one laser has.
    pub(super) fn only_colour(&self) -> Option<usize> {
        (self.contract.colours == 1).then_some(0)
    }

    /// Returns how a network for the display `trained` supports `display`: the same pitch and lasers, and a volume that
    /// is not deeper, whose depths are stretched.
    ///
    /// # Errors
    /// Returns [`Error::Network`] if the display differs, and for phases if the modulator is elsewhere.
    pub(super) fn serve(&self, trained: &TrainedDisplay, display: &Display) -> Result<Served> {
        trained.serve_own(self.contract.colours, self.gives_phase(), display)
    }

    /// Plans the graph for frames of `size`.
    ///
    /// # Errors
    /// Returns [`Error::Network`] if the file fixes another size, tract does not run the graph, or its output is not
    /// what the metadata declares.
    pub(super) fn plan(&self, size: Size) -> Result<OwnPlan> {
        let side = |side: usize| side.next_multiple_of(self.contract.multiple);
        let padded = Size {
            width: side(size.width),
            height: side(size.height),
        };
        let own = [padded.height, padded.width];
        for input in &self.inputs {
            let fits = input
                .fixed
                .iter()
                .zip(own)
                .all(|(fixed, own)| fixed.is_none_or(|n| n == own));
            if let (false, [height, width]) = (fits, input.fixed) {
                let say = |n: Option<usize>| n.map_or("any".into(), |n| n.to_string());
                return Err(Error::Network(format!(
                    "it takes frames of {}×{}, and this one has {padded}; export it with dynamic axes for any size",
                    say(width),
                    say(height)
                )));
            }
        }
        let (model, planes) = self.model_for(padded).map_err(|why| match self.missing_multiple() {
            Some(n) => Error::Network(format!(
                "it does not run frames of {size}, but those whose sides are multiples of {n}; add the metadata 'phasefront.multiple' with the value '{n}'"
            )),
            None => why,
        })?;
        let (needed, why) = self.contract.output.needs(self.contract.colours);
        if planes != needed {
            return Err(Error::Network(format!(
                "it gives {planes} planes, and metadata 'phasefront.output' {} needs {needed}: {why}",
                self.contract.output.name()
            )));
        }
        Ok(OwnPlan {
            model,
            contract: self.contract.clone(),
            inputs: self.inputs.clone(),
            size,
            padded,
        })
    }
}

impl OwnNetwork {
    /// Plans the graph for planes of `size`, and returns the number of planes that it gives.
    fn model_for(&self, size: Size) -> Result<(Arc<TypedRunnableModel>, usize)> {
        let facts = self.inputs.iter().map(|input| {
            let shape = [1, input.channels, size.height, size.width];
            InferenceFact::dt_shape(input.kind, shape)
        });
        let outputs = self.model.outputs.len();
        let model = graph::plan(self.model.clone(), facts.collect(), outputs)?;
        let planes = flat(caught(|| output_planes(&model, size)))?;
        Ok((model, planes))
    }

    /// Returns the power of two that sides must be multiples of, if the file does not say one and one helps. Odd
    /// multiples of it are tried, which no smaller number would do for.
    fn missing_multiple(&self) -> Option<usize> {
        let is_open = |input: &Input| input.fixed == [None; 2];
        if self.contract.multiple > 1 || !self.inputs.iter().all(is_open) {
            return None;
        }
        HALVINGS.map(|halvings| 1 << halvings).find(|n| {
            let odd = Size {
                width: 5 * n,
                height: 3 * n,
            };
            self.model_for(odd).is_ok()
        })
    }
}

/// Reads input `i` of `model`. An open number of channels is `count`.
fn input(model: &InferenceModel, i: usize, count: usize) -> std::result::Result<Input, String> {
    let fact = model.input_fact(i).map_err(|why| one_line(&why))?;
    let sides: Vec<Option<usize>> = (fact.shape.dims())
        .map(|dim| dim.concretize().and_then(|dim| dim.to_usize().ok()))
        .collect();
    let [batch, channels, rows, columns] = sides[..] else {
        return Err(format!("its input {i} has {} axes; (1, C, H, W) is right", sides.len()));
    };
    if batch.is_some_and(|n| n != 1) {
        return Err("it takes several frames at a time; (1, C, H, W) is right".into());
    }
    let kind = fact.datum_type.concretize().unwrap_or(DatumType::F32);
    if kind != DatumType::F32 && kind != DatumType::F16 {
        return Err(format!(
            "its input {i} is {kind:?}; floating point of 32 or 16 bits is right"
        ));
    }
    Ok(Input {
        channels: channels.unwrap_or(count),
        fixed: [rows, columns],
        kind,
    })
}

/// Returns the number of planes of `size` that all outputs of `model` have together.
fn output_planes(model: &TypedRunnableModel, size: Size) -> std::result::Result<usize, String> {
    let mut planes = 0;
    for i in 0..model.model().outputs.len() {
        let fact = model.model().output_fact(i).map_err(|why| one_line(&why))?;
        let shape = fact.shape.as_concrete().unwrap_or_default();
        match *shape {
            [1, channels, height, width] if height == size.height && width == size.width => planes += channels,
            _ => {
                return Err(format!(
                    "its output {i} is {shape:?} for frames of {size}; (1, C, {}, {}) is right, and metadata 'phasefront.multiple' names what the sides must be multiples of",
                    size.height, size.width
                ));
            }
        }
    }
    Ok(planes)
}

/// An [`OwnNetwork`] planned for frames of one size.
pub(super) struct OwnPlan {
    model: Arc<TypedRunnableModel>,
    contract: Contract,
    inputs: Vec<Input>,
    size: Size,
    /// The size with both sides continued to the multiple that the network takes.
    padded: Size,
}

impl OwnPlan {
    /// Returns whether the output is the modulator's phase.
    pub(super) fn gives_phase(&self) -> bool {
        self.contract.output == Output::Phase
    }

    /// Computes the field of some `colours`, (C, H, W), from the planes of `source`, which are those of
    /// [`InputKind::Rgbd`]. Runs on one thread.
    ///
    /// # Errors
    /// Returns [`Error::Network`] if the network does not run, or gives numbers that are not finite.
    pub(super) fn field<S: Source + ?Sized>(
        &self,
        source: &S,
        colours: &[usize],
        field: &mut [Complex32],
    ) -> Result<()> {
        let run = || -> TractResult<Vec<f32>> {
            let mut tensors = tvec!();
            let mut planes = self.contract.planes.as_slice();
            for input in &self.inputs {
                let (own, rest) = planes.split_at(input.channels);
                planes = rest;
                tensors.push(self.tensor(own, input.kind, source)?.into());
            }
            let mut values = Vec::new();
            for output in self.model.run(tensors)? {
                let output = output.cast_to::<f32>()?;
                values.extend(output.to_plain_array_view::<f32>()?.iter());
            }
            Ok(values)
        };
        let values = flat(caught(|| run().map_err(|why| not_run(&why))))?;
        if values.iter().any(|value| !value.is_finite()) {
            return Err(Error::Network(
                "gives numbers that are not finite; are 'phasefront.colour_range' and 'depth_range' those of its training?"
                    .into(),
            ));
        }
        let (area, count) = (self.padded.pixels(), self.contract.colours);
        let Size { width, height } = self.size;
        for (&colour, plane) in colours.iter().zip(field.chunks_exact_mut(width * height)) {
            for (y, row) in plane.chunks_exact_mut(width).enumerate() {
                let part = |of: usize| &values[(of * count + colour) * area + y * self.padded.width..][..width];
                self.contract.output.write(part, row);
            }
        }
        Ok(())
    }

    /// Returns `planes` of `source` as the network takes them. The last row and column are repeated beyond the frame.
    fn tensor<S: Source + ?Sized>(&self, planes: &[usize], kind: DatumType, source: &S) -> TractResult<Tensor> {
        let Size { width, height } = self.padded;
        let mut values = vec![0.0; planes.len() * width * height];
        for (&plane, into) in planes.iter().zip(values.chunks_exact_mut(width * height)) {
            let [from, to] = match InputKind::Rgbd.is_depth(plane) {
                true => self.contract.depth_range,
                false => self.contract.colour_range,
            };
            for (y, row) in into.chunks_exact_mut(width).enumerate() {
                let (inside, beyond) = row.split_at_mut(self.size.width);
                source.read(plane, y.min(self.size.height - 1), 0, inside);
                // The source's planes are minus a half.
                inside.iter_mut().for_each(|v| *v = from + (to - from) * (*v + 0.5));
                beyond.fill(inside[self.size.width - 1]);
            }
        }
        let tensor = Tensor::from_shape(&[1, planes.len(), height, width], &values)?;
        Ok(tensor.cast_to_dt(kind)?.into_owned())
    }
}
