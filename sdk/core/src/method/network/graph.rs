//! Any ONNX graph on tract: read and planned within bounds, with every failure as one line.

mod bounds;

use crate::runtime::caught::caught;
use crate::runtime::error::{Error, Result};
use std::path::Path;
use std::sync::Arc;
use tract_onnx::prelude::*;

/// Reads an ONNX file. `path` is where it lies if its weights may lie in other files of the same folder.
///
/// # Errors
/// Returns [`Error::Network`] if tract does not read the file, or if it has too many parts.
pub(crate) fn read(file: impl AsRef<[u8]>, path: Option<&Path>) -> Result<InferenceModel> {
    // tract panics on files that it does not expect.
    flat(caught(|| {
        let proto = bounds::messages(file.as_ref(), path)?;
        // The messages hold copies of the weights.
        drop(file);
        let folder = path.and_then(Path::parent).and_then(Path::to_str);
        let parsed = (tract_onnx::onnx().parse(&proto, folder))
            .map_err(|why| format!("is no ONNX file that tract reads: {}", one_line(&why)))?;
        match parsed.unresolved_inputs.first() {
            Some(name) => Err(format!("reads {name}, which no node gives")),
            None => Ok(parsed.model),
        }
    }))
}

/// Plans `model` for `inputs`. The plan gives the first `outputs` outputs.
///
/// # Errors
/// Returns [`Error::Network`] if tract does not run the graph, or if it would take too much memory or time.
pub(crate) fn plan(
    mut model: InferenceModel,
    inputs: Vec<InferenceFact>,
    outputs: usize,
) -> Result<Arc<TypedRunnableModel>> {
    let planned = || -> TractResult<_> {
        let outlets = model.output_outlets()?;
        let outputs = outlets
            .get(..outputs)
            .ok_or_else(|| TractError::msg("it has no output"))?
            .to_vec();
        for (input, fact) in inputs.into_iter().enumerate() {
            model = model.with_input_fact(input, fact)?;
        }
        model = model.with_output_outlets(&outputs)?;
        bounds::analyse(&mut model)?;
        let model = model.into_typed()?;
        bounds::check_sizes(&model)?;
        let model = model.into_optimized()?;
        bounds::check_sizes(&model)?;
        model.into_runnable()
    };
    flat(caught(|| planned().map_err(|why| not_run(&why))))
}

/// Returns a caught result, or what went wrong as an [`Error::Network`].
pub(crate) fn flat<T>(caught: std::result::Result<std::result::Result<T, String>, String>) -> Result<T> {
    caught
        .unwrap_or_else(|panic| Err(format!("tract does not run it: it fails with: {panic}")))
        .map_err(Error::Network)
}

pub(crate) fn not_run(why: &TractError) -> String {
    format!("tract does not run it: {}", one_line(why))
}

pub(crate) fn one_line(why: &TractError) -> String {
    format!("{why:#}").split_whitespace().collect::<Vec<_>>().join(" ")
}
