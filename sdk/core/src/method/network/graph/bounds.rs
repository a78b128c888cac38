//! Bounds on the memory and time that tract may spend on a graph, checked in advance, because a file of a few
//! bytes may name a tensor of any size.

use crate::method::network::bounds;
use std::path::{Component, Path};
use tract_onnx::pb::{ModelProto, TensorProto, tensor_proto};
use tract_onnx::prelude::*;
use tract_onnx::tract_core::internal::Cost;
use tract_onnx::tract_hir::infer::{Factoid, InferenceOp};

/// The largest number of nodes in a network. Large public networks have one to three thousand. The time that tract
/// takes to prepare nodes grows with the square of their number, to minutes at this bound.
const MOST_NODES: usize = 1 << 12;
/// The largest size of one tensor in bytes.
const MOST_TENSOR: u64 = 1 << 30;
/// The largest size in bytes of all tensors that are needed at one time.
const MOST_LIVE: u64 = 1 << 32;
/// The largest size in bytes of a node's constant inputs if tract learns the size of its output only by computing it.
const MOST_UNKNOWN: u64 = 1 << 16;
/// The largest number of products that are summed for one frame: some minutes of work.
const MOST_PRODUCTS: u64 = 1 << 44;
/// The largest number of passes over the sizes. Earlier nodes rarely need information from later ones, and then one
/// more pass is enough.
const MOST_PASSES: usize = 8;

/// Decodes the messages of `file`, if there are not too many, and checks that its external weights lie in the folder of
/// `path` and are as large as their shapes say.
///
/// # Errors
/// Returns an error if there are too many parts or nodes, if there are branches or loops, or if external weights are
/// missing, elsewhere, or too large.
pub(super) fn messages(file: &[u8], path: Option<&Path>) -> std::result::Result<ModelProto, String> {
    bounds::check_parts(file).map_err(|why| why.to_string())?;
    let proto: ModelProto = prost_message(file)?;
    let graph = proto.graph.as_ref().ok_or("is no ONNX file: it holds no graph")?;
    if graph.node.len() > MOST_NODES {
        return Err(format!("has {} nodes; {MOST_NODES} are the most", graph.node.len()));
    }
    for node in &graph.node {
        if node.attribute.iter().any(|a| a.g.is_some() || !a.graphs.is_empty()) {
            return Err(format!(
                "holds a branch or a loop, node '{}' ({}); export it without, for a fixed size",
                node.name, node.op_type
            ));
        }
    }
    let attributes = graph.node.iter().flat_map(|node| &node.attribute);
    let tensors = attributes.flat_map(|a| a.t.iter().chain(&a.tensors));
    let mut total = 0;
    for tensor in graph.initializer.iter().chain(tensors) {
        total += external_bytes(tensor, path)?;
        if total > MOST_LIVE {
            return Err(format!("its weights have over {MOST_LIVE} bytes"));
        }
    }
    Ok(proto)
}

/// Returns the number of bytes of `tensor` that lie in another file.
fn external_bytes(tensor: &TensorProto, path: Option<&Path>) -> std::result::Result<u64, String> {
    let said = |key: &str| tensor.external_data.iter().find(|entry| entry.key == key);
    let Some(location) = said("location").map(|entry| entry.value.as_str()) else {
        return Ok(0);
    };
    let Some(path) = path else {
        return Err(format!(
            "its weights are in {location}; a network from memory must hold its weights itself"
        ));
    };
    let refuse = |why: &dyn std::fmt::Display| format!("its weights {} are in {location}: {why}", tensor.name);
    let there = length_of(path, location).map_err(|why| refuse(&why))?;
    let number = |key: &str| match said(key).map(|entry| entry.value.parse::<u64>()) {
        None => Ok(None),
        Some(Ok(number)) => Ok(Some(number)),
        Some(Err(e)) => Err(refuse(&format_args!("{key}: {e}"))),
    };
    let offset = number("offset")?.unwrap_or(0);
    let rest = (there.checked_sub(offset))
        .ok_or_else(|| refuse(&format_args!("it has {there} bytes, and the offset is {offset}")))?;
    let length = number("length")?.unwrap_or(rest);
    if length > rest {
        return Err(refuse(&format_args!(
            "it has {there} bytes; the weights would end at byte {}",
            u128::from(offset) + u128::from(length)
        )));
    }
    let needed = bytes_of(tensor).ok_or_else(|| refuse(&"they have no type or shape that is read"))?;
    if length != needed {
        return Err(refuse(&format_args!(
            "they have {length} bytes; their shape needs {needed}"
        )));
    }
    if length > MOST_TENSOR {
        return Err(refuse(&format_args!(
            "they have {length} bytes; {MOST_TENSOR} are the most"
        )));
    }
    Ok(length)
}

/// Returns the length of the file at `location`, which must lie in the folder of the network at `path`, links included.
fn length_of(path: &Path, location: &str) -> std::result::Result<u64, String> {
    let is_below = |c: Component<'_>| matches!(c, Component::Normal(_) | Component::CurDir);
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder
        .unwrap_or(Path::new("."))
        .canonicalize()
        .map_err(|e| e.to_string())?;
    let real = folder.join(location).canonicalize().map_err(|e| e.to_string())?;
    if !Path::new(location).components().all(is_below) || !real.starts_with(&folder) {
        return Err("it must lie in the folder of the network".into());
    }
    let about = real.metadata().map_err(|e| e.to_string())?;
    if !about.is_file() {
        return Err("it is not a regular file".into());
    }
    Ok(about.len())
}

/// Returns the number of bytes that the shape and type of `tensor` need.
fn bytes_of(tensor: &TensorProto) -> Option<u64> {
    let kind = tensor_proto::DataType::try_from(tensor.data_type).ok()?;
    let size = DatumType::try_from(kind).ok()?.size_of() as u64;
    let mut sides = tensor.dims.iter();
    sides.try_fold(size, |bytes, side| bytes.checked_mul(u64::try_from(*side).ok()?))
}

fn prost_message(file: &[u8]) -> std::result::Result<ModelProto, String> {
    let decoded = tract_onnx::onnx().proto_model_for_read(&mut &*file);
    decoded.map_err(|why| format!("is no ONNX file that tract reads: {}", super::one_line(&why)))
}

/// Infers the model's tensors like tract's own analysis, but checks each size before making a constant of that size.
///
/// # Errors
/// Returns an error if a tensor is too large or tract refuses the model.
pub(super) fn analyse(model: &mut InferenceModel) -> TractResult<()> {
    for node in model.nodes() {
        for output in &node.outputs {
            check(&node.name, &output.fact)?;
        }
    }
    let mut order = model.eval_order()?;
    // tract also analyses nodes that no output needs.
    order.extend((0..model.nodes().len()).filter({
        let needed: std::collections::HashSet<usize> = order.iter().copied().collect();
        move |node| !needed.contains(node)
    }));
    for _ in 0..MOST_PASSES {
        let mut is_known = true;
        for &node in &order {
            is_known &= !analyse_node(model, node)?;
        }
        if is_known {
            break;
        }
    }
    Ok(())
}

/// Analyses one node and returns whether this gave new information.
fn analyse_node(model: &mut InferenceModel, id: usize) -> TractResult<bool> {
    let node = model.node(id);
    let name = format!("{} ({})", node.name, node.op.name());
    let observed = node.op.observe_outlets(model, node)?;
    let facts = |outlets: &[OutletId]| -> TractResult<TVec<InferenceFact>> {
        outlets.iter().map(|o| model.outlet_fact(*o).cloned()).collect()
    };
    let places: Vec<OutletId> = (0..node.outputs.len()).map(|slot| OutletId::new(id, slot)).collect();
    let (inputs, outputs, seen) = (facts(&node.inputs)?, facts(&places)?, facts(&observed)?);
    let from = node.inputs.clone();

    // First infer only sizes, on a copy. Then let tract infer everything, which computes constants.
    let mut op: Box<dyn InferenceOp> = node.op.clone();
    let (known_inputs, sizes, _) =
        op.infer_facts(inputs.iter().collect(), outputs.iter().collect(), seen.iter().collect())?;
    let mut is_size_known = true;
    for fact in known_inputs.iter().chain(&sizes) {
        is_size_known &= check(&name, fact)?.is_some();
    }
    let given: Option<Vec<u64>> = known_inputs
        .iter()
        .map(|fact| {
            fact.value
                .concretize()
                .map(|value| (value.volume() * value.datum_type().size_of()) as u64)
        })
        .collect();
    if let Some(given) = given
        && !is_size_known
        && given.iter().sum::<u64>() > MOST_UNKNOWN
    {
        bail(format!("node {name} makes a constant of unknown size"))?;
    }
    let (inputs, outputs, seen) =
        model
            .node_mut(id)
            .op
            .infer(inputs.iter().collect(), outputs.iter().collect(), seen.iter().collect())?;
    let learned = (from.iter().zip(inputs))
        .chain(places.iter().zip(outputs))
        .chain(observed.iter().zip(seen));
    let mut is_new = false;
    for (outlet, fact) in learned {
        let before = model.outlet_fact(*outlet)?;
        let unified = fact.unify(before)?;
        if unified != *before {
            check(&name, &unified)?;
            model.set_outlet_fact(*outlet, unified)?;
            is_new = true;
        }
    }
    Ok(is_new)
}

/// Checks the size of a tensor and returns it in bytes, or returns `None` if it is not known yet.
fn check(node: &str, fact: &InferenceFact) -> TractResult<Option<u64>> {
    let mut bytes = fact.datum_type.concretize().map_or(8, |kind| kind.size_of()) as u64;
    let mut is_known = !fact.shape.is_open();
    for dim in fact.shape.dims() {
        match dim.concretize().map(|dim| dim.to_i64()) {
            Some(Ok(side)) => match u64::try_from(side) {
                Ok(side) => bytes = bytes.saturating_mul(side),
                Err(_) => bail(format!("node {node} has a tensor with a side of {side}"))?,
            },
            _ => is_known = false,
        }
    }
    if is_known && bytes > MOST_TENSOR {
        too_large(node, bytes)?;
    }
    Ok(is_known.then_some(bytes))
}

fn too_large(node: &str, bytes: u64) -> TractResult<()> {
    bail(format!(
        "node {node} has a tensor of {bytes} bytes; {MOST_TENSOR} are the most"
    ))
}

fn bail(why: String) -> TractResult<()> {
    Err(TractError::msg(why))
}

/// Checks the sizes of all tensors of `model`, the memory that is needed at one time, and the number of products.
///
/// # Errors
/// Returns an error if a bound is exceeded or a size depends on the values of the input.
pub(super) fn check_sizes(model: &TypedModel) -> TractResult<()> {
    let order = model.eval_order()?;
    let mut last = vec![0; model.nodes().len()];
    for (time, &id) in order.iter().enumerate() {
        last[id] = time;
        for input in &model.node(id).inputs {
            last[input.node] = time;
        }
    }
    let bytes_of = |id: usize| -> TractResult<u64> {
        let node = model.node(id);
        let mut sum = 0;
        for output in &node.outputs {
            let name = format!("{} ({})", node.name, node.op.name());
            let Ok(bytes) = output.fact.mem_size().to_i64() else {
                bail(format!("the size of node {name} depends on the values of its input"))?;
                continue;
            };
            let bytes = u64::try_from(bytes).unwrap_or(u64::MAX);
            if bytes > MOST_TENSOR {
                too_large(&name, bytes)?;
            }
            sum += bytes;
        }
        Ok(sum)
    };
    let mut ends = vec![Vec::new(); order.len()];
    let (mut live, mut products) = (0u64, 0u64);
    for (time, &id) in order.iter().enumerate() {
        let bytes = bytes_of(id)?;
        live += bytes;
        ends[last[id]].push(bytes);
        if live > MOST_LIVE {
            bail(format!("it needs over {MOST_LIVE} bytes at one time"))?;
        }
        live -= ends[time].iter().sum::<u64>();
        let node = model.node(id);
        let facts = model.node_input_facts(id)?;
        for (cost, count) in node.op.cost(&facts)? {
            if matches!(cost, Cost::FMA(_) | Cost::Div(_)) {
                let count = count.to_i64().ok().and_then(|count| u64::try_from(count).ok());
                products = products.saturating_add(count.unwrap_or(u64::MAX));
            }
        }
        if products > MOST_PRODUCTS {
            bail(format!("it sums over {MOST_PRODUCTS} products for one frame"))?;
        }
    }
    Ok(())
}
