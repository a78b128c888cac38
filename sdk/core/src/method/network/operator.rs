//! The fused chain as one operator of a tract graph.

use super::fused::{FusedChain, FusedScratch};
use crate::Size;
use crate::runtime::error::Error;
use crate::runtime::error::Result;
use std::sync::Arc;
use tract_onnx::prelude::*;
use tract_onnx::tract_core::internal::*;

/// Returns a graph of one operator, from `name`, (1, `channels`, H, W), to the network's output. Height and width are
/// symbols.
pub(super) fn model(name: &str, chain: FusedChain, channels: usize) -> Result<TypedModel> {
    let build = || -> TractResult<TypedModel> {
        let mut model = TypedModel::default();
        let (height, width) = (model.symbols.sym("H"), model.symbols.sym("W"));
        let shape = [1.to_dim(), channels.to_dim(), height.to_dim(), width.to_dim()];
        let input = model.add_source(name, f32::fact(shape))?;
        let operator = FusedOperator {
            chain: Shared(Arc::new(chain)),
        };
        let output = model.wire_node("chain", operator, &[input])?;
        model.select_output_outlets(&output)?;
        model.into_optimized()
    };
    build().map_err(|why| Error::Network(super::graph::one_line(&why)))
}

/// A shared chain that is compared by identity: two packed chains are the same operator if they are the same memory.
#[derive(Clone)]
struct Shared(Arc<FusedChain>);

impl std::fmt::Debug for Shared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "chain on {}", self.0.isa())
    }
}

impl PartialEq for Shared {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Eq for Shared {}

impl std::hash::Hash for Shared {
    fn hash<H: std::hash::Hasher>(&self, state: &mut H) {
        Arc::as_ptr(&self.0).hash(state);
    }
}

#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct FusedOperator {
    chain: Shared,
}

impl Op for FusedOperator {
    fn name(&self) -> StaticName {
        "HologramChain".into()
    }

    op_as_typed_op!();
}

impl EvalOp for FusedOperator {
    op_out_of_plan!();

    fn eval(&self, _context: &EvalContext, inputs: TVec<TValue>) -> TractResult<TVec<TValue>> {
        let input = args_1!(inputs);
        let &[_, _, height, width] = input.shape() else {
            bail!("the chain reads (1, C, H, W), not {:?}", input.shape());
        };
        let shape = [1, phasefront_kernels::OUTPUTS, height, width];
        let mut output = Tensor::zero::<f32>(&shape)?;
        let planes = input.to_plain_array_view::<f32>()?;
        let planes = planes.as_slice().context("the chain reads planes row by row")?;
        let mut view = output.to_plain_array_view_mut::<f32>()?;
        let written = view.as_slice_mut().context("the chain writes planes row by row")?;
        self.chain
            .0
            .run(planes, written, Size { width, height }, &FusedScratch::default());
        Ok(tvec!(output.into_tvalue()))
    }
}

impl TypedOp for FusedOperator {
    fn output_facts(&self, inputs: &[&TypedFact]) -> TractResult<TVec<TypedFact>> {
        let mut shape = inputs[0].shape.clone();
        shape.set(1, phasefront_kernels::OUTPUTS.to_dim());
        Ok(tvec!(f32::fact(shape)))
    }

    as_op!();
}
