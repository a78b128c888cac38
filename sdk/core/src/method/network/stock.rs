//! A chain on stock tract: the unmodified ONNX graph, in f32.

use super::graph::one_line;
use crate::runtime::error::Error;
use crate::runtime::error::Result;
use std::sync::Arc;
use tract_onnx::prelude::*;

/// The graph optimised for one frame size.
pub(super) struct StockPlan {
    model: Arc<TypedRunnableModel>,
    shape: [usize; 4],
}

impl StockPlan {
    pub(super) fn new(file: &[u8], shape: [usize; 4]) -> Result<StockPlan> {
        let model = || -> TractResult<_> {
            tract_onnx::onnx()
                .model_for_proto_model(&prost::Message::decode(file)?)?
                .with_input_fact(0, f32::fact(shape).into())?
                .into_optimized()?
                .into_runnable()
        };
        let model = model().map_err(|why| Error::Network(one_line(&why)))?;
        Ok(StockPlan { model, shape })
    }

    pub(super) fn run(&self, input: &[f32], output: &mut [f32]) -> Result<()> {
        let mut run = || -> TractResult<()> {
            let input = Tensor::from_shape(&self.shape, input)?;
            let result = self.model.run(tvec!(input.into()))?;
            let view = result[0].to_plain_array_view::<f32>()?;
            if view.len() != output.len() {
                return Err(TractError::msg(format!("the output has shape {:?}", view.shape())));
            }
            output.iter_mut().zip(view.iter()).for_each(|(to, from)| *to = *from);
            Ok(())
        };
        run().map_err(|why| Error::Network(one_line(&why)))
    }
}
