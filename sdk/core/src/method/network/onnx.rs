//! Reads an ONNX file as a [`Chain`], or reports why it holds no chain.
//!
//! The graph is read as exported: weights and scales are taken before any engine folds them. Each node, in the file's
//! order, must be one step of the chain. The first node that is not stops the reading with an error that gives its name
//! and the expected value.

use super::chain::{Chain, InputQuantisation, Layer, Precision, Quantisation, Weights};
use super::proto::{Graph, Node, ValueInfo, data_type};
use super::tensor::Constant;
use crate::runtime::error::Error;
use crate::runtime::error::Result;
use std::collections::HashMap;

/// The largest number of layers, and of channels in one layer, of a hologram network.
const MAX_LAYERS: usize = 256;
const MAX_CHANNELS: usize = 1024;

/// The result of a step of the chain, before any rounding.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Step {
    /// The graph's input, if layers read it as squares of pixels.
    Frame,
    Input,
    Convolution(usize),
    Relu(usize),
    /// The sum read by the given layer.
    Sum(usize),
    /// The last layer's input.
    Concat,
    /// The last layer's output with its squares rearranged as pixels.
    Pixels,
    Tanh,
}

impl std::fmt::Display for Step {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Step::Frame => write!(f, "the graph's input before SpaceToDepth"),
            Step::Input => write!(f, "the network's input"),
            Step::Convolution(i) => write!(f, "layer {i}'s convolution"),
            Step::Relu(i) => write!(f, "layer {i}'s output"),
            Step::Sum(i) => write!(f, "the sum for layer {i}"),
            Step::Concat => write!(f, "the concatenation"),
            Step::Pixels => write!(f, "the last layer's pixels"),
            Step::Tanh => write!(f, "the tanh"),
        }
    }
}

/// A tensor of the graph, as interpreted by the reader.
#[derive(Debug, Clone)]
enum Value<'a> {
    /// A step's values, rounded (QuantizeLinear then DequantizeLinear) or not.
    Activation {
        step: Step,
        rounding: Option<Quantisation>,
    },
    /// u8 values between QuantizeLinear and DequantizeLinear.
    Quantised {
        step: Step,
        quantisation: Quantisation,
    },
    Constant(&'a Constant),
    /// An integer constant after DequantizeLinear, with one scale or one for each output channel.
    Dequantised {
        constant: &'a Constant,
        scale: &'a [f32],
    },
}

/// Reads `graph` as a residual chain.
pub(super) fn chain(graph: &Graph) -> Result<Chain> {
    let constants = constants(graph)?;
    let mut reader = Reader::new(graph, &constants)?;
    for node in &graph.node {
        reader
            .read(node)
            .map_err(|why| Error::Network(format!("{}: {why}", describe(node))))?;
    }
    reader.finish(graph)
}

/// Returns the description of a node for messages.
fn describe(node: &Node) -> String {
    let name = if node.name.is_empty() {
        node.output.first().map_or("", String::as_str)
    } else {
        &node.name
    };
    format!("node '{name}' ({})", node.op_type)
}

/// Returns initializers and Constant nodes by name.
fn constants(graph: &Graph) -> Result<HashMap<&str, Constant>> {
    let mut all = HashMap::new();
    for tensor in &graph.initializer {
        all.insert(tensor.name.as_str(), Constant::new(tensor).map_err(Error::Network)?);
    }
    for node in graph.node.iter().filter(|node| node.op_type == "Constant") {
        let tensor = node
            .attribute
            .iter()
            .find(|a| a.name == "value")
            .and_then(|a| a.t.as_ref());
        if let (Some(tensor), Some(output)) = (tensor, node.output.first()) {
            let constant = Constant::new(tensor).map_err(|why| Error::Network(format!("{}: {why}", describe(node))))?;
            all.insert(output, constant);
        }
    }
    Ok(all)
}

type Read<T> = std::result::Result<T, String>;

struct Reader<'a> {
    values: HashMap<&'a str, Value<'a>>,
    inputs: usize,
    /// Whether layers read squares of two by two pixels.
    halved: bool,
    layer_count: usize,
    layers: Vec<Layer>,
    /// The roundings of the concatenation's features and of its network input.
    concat: Option<[Option<Quantisation>; 2]>,
    /// The rounding of the ReLU in each sum, by the layer that reads the sum.
    relu_in_sum: HashMap<usize, Option<Quantisation>>,
}

impl<'a> Reader<'a> {
    fn new(graph: &'a Graph, constants: &'a HashMap<&str, Constant>) -> Result<Self> {
        let layer_count = graph.node.iter().filter(|node| node.op_type == "Conv").count();
        if !(2..=MAX_LAYERS).contains(&layer_count) {
            return Err(Error::Network(format!(
                "{layer_count} convolutions; a hologram network has 2 to {MAX_LAYERS} in a chain"
            )));
        }
        let inputs: Vec<_> = graph
            .input
            .iter()
            .filter(|i| !constants.contains_key(i.name.as_str()))
            .collect();
        let [input] = inputs[..] else {
            return Err(Error::Network(format!(
                "{} inputs; a hologram network has one, (1, C, H, W)",
                inputs.len()
            )));
        };
        let halved = graph.node.iter().any(|node| node.op_type == "SpaceToDepth");
        let mut values: HashMap<_, _> = constants.iter().map(|(&name, c)| (name, Value::Constant(c))).collect();
        values.insert(
            &input.name,
            Value::Activation {
                step: if halved { Step::Frame } else { Step::Input },
                rounding: None,
            },
        );
        let inputs = input_channels(input)?;
        Ok(Reader {
            values,
            inputs,
            halved,
            layer_count,
            layers: Vec::new(),
            concat: None,
            relu_in_sum: HashMap::new(),
        })
    }

    fn last(&self) -> usize {
        self.layer_count - 1
    }

    /// Returns the number of channels of the network's input as layers read it.
    fn read_channels(&self) -> usize {
        self.inputs * if self.halved { 4 } else { 1 }
    }

    /// Returns the graph's last step before any tanh.
    fn end(&self) -> Step {
        if self.halved {
            Step::Pixels
        } else {
            Step::Convolution(self.last())
        }
    }

    /// Returns the input of layer `i` without the concatenation.
    fn features(&self, i: usize) -> Step {
        if Chain::has_skip(i) {
            Step::Sum(i)
        } else {
            Step::Relu(i.saturating_sub(1))
        }
    }

    fn read(&mut self, node: &'a Node) -> Read<()> {
        if !matches!(node.domain.as_str(), "" | "ai.onnx") {
            return Err(format!(
                "domain '{}' is unknown; only standard ONNX operators serve",
                node.domain
            ));
        }
        let value = match node.op_type.as_str() {
            "Constant" => {
                let known = node.output.iter().all(|name| self.values.contains_key(name.as_str()));
                return if known {
                    Ok(())
                } else {
                    Err("holds no tensor in its attribute 'value'".into())
                };
            }
            "Identity" => self.input(node, 0)?.clone(),
            "QuantizeLinear" => self.quantize(node)?,
            "DequantizeLinear" => self.dequantize(node)?,
            "Conv" => self.convolution(node)?,
            "Relu" => self.relu(node)?,
            "Add" => self.sum(node)?,
            "Concat" => self.concatenation(node)?,
            "SpaceToDepth" | "DepthToSpace" => self.squares(node)?,
            "Tanh" => self.tanh(node)?,
            "BatchNormalization" => {
                return Err("fold batch normalisation into the convolution before export".into());
            }
            _ => {
                return Err(
                    "not an operator of the residual chain (Conv, Relu, Add, Concat, Tanh, SpaceToDepth, \
                            DepthToSpace, QuantizeLinear, DequantizeLinear)"
                        .into(),
                );
            }
        };
        let [output] = &node.output[..] else {
            return Err(format!("has {} outputs; one is right", node.output.len()));
        };
        self.values.insert(output, value);
        Ok(())
    }

    fn input(&self, node: &Node, k: usize) -> Read<&Value<'a>> {
        let name = node.input.get(k).ok_or_else(|| format!("has no input {k}"))?;
        self.values
            .get(name.as_str())
            .ok_or_else(|| format!("reads '{name}', which no earlier node writes"))
    }

    fn activation(&self, node: &Node, k: usize) -> Read<(Step, Option<Quantisation>)> {
        match self.input(node, k)? {
            Value::Activation { step, rounding } => Ok((*step, *rounding)),
            _ => Err(format!("input '{}' is not an activation in f32", node.input[k])),
        }
    }

    fn constant(&self, node: &Node, k: usize) -> Read<&'a Constant> {
        match self.input(node, k)? {
            Value::Constant(constant) => Ok(constant),
            _ => Err(format!("input '{}' must be a constant", node.input[k])),
        }
    }

    /// Returns the scales of a Quantize- or DequantizeLinear, each finite and positive.
    fn scales(&self, node: &Node) -> Read<&'a [f32]> {
        let scale = self.constant(node, 1)?.f32s()?;
        if scale.len() > MAX_CHANNELS {
            return Err(format!(
                "{} scales; {MAX_CHANNELS} are the most, one a channel",
                scale.len()
            ));
        }
        match scale.iter().find(|s| !s.is_normal() || **s < 0.0) {
            Some(bad) => Err(format!(
                "scale '{}' holds {bad}; every scale must be finite and positive",
                node.input[1]
            )),
            None => Ok(scale),
        }
    }

    /// Returns scale and zero point of an activation's u8 values.
    fn activation_quantisation(&self, node: &Node) -> Read<Quantisation> {
        let &[scale] = self.scales(node)? else {
            return Err("activations are quantised per tensor: one scale".into());
        };
        let zero_point = match node.input.get(2).filter(|name| !name.is_empty()) {
            Some(_) => self
                .constant(node, 2)?
                .u8s()
                .map_err(|_| "activations are u8: a u8 zero point is right")?,
            None => &[0],
        };
        match zero_point {
            &[zero_point] => Ok(Quantisation { scale, zero_point }),
            _ => Err("activations are quantised per tensor: one zero point".into()),
        }
    }

    fn quantize(&self, node: &Node) -> Read<Value<'a>> {
        let (step, rounding) = self.activation(node, 0)?;
        if rounding.is_some() {
            return Err(format!("rounds {step} a second time; once is right"));
        }
        if step == Step::Frame {
            return Err("rounds the graph's input before SpaceToDepth; after it is right".into());
        }
        if matches!(step, Step::Convolution(_) | Step::Pixels | Step::Tanh) {
            return Err(format!(
                "rounds {step}; a hidden layer is rounded after its ReLU and the output stays f32"
            ));
        }
        let quantisation = self.activation_quantisation(node)?;
        // An input of the last concatenation may be rounded like the whole, which can be negative in its other part.
        let concatenated = step == self.features(self.last());
        if matches!(step, Step::Relu(_) | Step::Sum(_)) && quantisation.zero_point != 0 && !concatenated {
            return Err(format!(
                "zero point {}; {step} is never negative: 0 is right",
                quantisation.zero_point
            ));
        }
        Ok(Value::Quantised { step, quantisation })
    }

    fn dequantize(&self, node: &Node) -> Read<Value<'a>> {
        match *self.input(node, 0)? {
            Value::Quantised { step, quantisation } => {
                if self.activation_quantisation(node)? != quantisation {
                    return Err("scale and zero point differ from its QuantizeLinear's".into());
                }
                Ok(Value::Activation {
                    step,
                    rounding: Some(quantisation),
                })
            }
            Value::Constant(constant) => {
                if let Some(name) = node.input.get(2).filter(|name| !name.is_empty())
                    && !self.constant(node, 2)?.is_zero()
                {
                    return Err(format!(
                        "zero point '{name}': weights and biases are symmetric, 0 is right"
                    ));
                }
                let scale = self.scales(node)?;
                // The axis has no meaning for a single scale. For several it must be the output channel's.
                if scale.len() > 1 && int_attribute(node, "axis").unwrap_or(1) != 0 && constant.shape().len() > 1 {
                    return Err("weights are quantised per output channel: axis 0 is right".into());
                }
                Ok(Value::Dequantised { constant, scale })
            }
            _ => Err(format!("input '{}' is not quantised", node.input[0])),
        }
    }

    fn convolution(&mut self, node: &Node) -> Read<Value<'a>> {
        let i = self.layers.len();
        check_convolution(node)?;
        let (step, rounding) = self.activation(node, 0)?;
        let expected = match i {
            0 => Step::Input,
            _ if i == self.last() => Step::Concat,
            _ if Chain::has_skip(i) => Step::Sum(i),
            _ => Step::Relu(i - 1),
        };
        if step != expected {
            return Err(match expected {
                Step::Sum(_) => format!(
                    "layer {i} reads {step}: the skip is missing, input[{i}] = output[{}] + input[{}] is right",
                    i - 1,
                    i - 2
                ),
                Step::Concat => {
                    format!("the last layer reads {step}: the features concatenated with the network's input are right")
                }
                _ => format!("layer {i} reads {step}; {expected} is right"),
            });
        }
        let inputs = match i {
            0 => self.read_channels(),
            _ if i == self.last() => self.layers[0].outputs + self.read_channels(),
            _ => self.layers[0].outputs,
        };
        let weights = self.weights(node, inputs, rounding)?;
        let outputs = match &weights {
            Weights::F32 { bias, .. } => bias.len(),
            Weights::Int8 { bias, .. } => bias.len(),
        };
        if i > 0 && i < self.last() && outputs != self.layers[0].outputs {
            return Err(format!(
                "{outputs} filters; all hidden layers have {} here",
                self.layers[0].outputs
            ));
        }
        if let Some(first) = self.layers.first()
            && matches!(first.weights, Weights::F32 { .. }) != matches!(weights, Weights::F32 { .. })
        {
            return Err("mixes f32 and int8 layers; one precision throughout is right".into());
        }
        let mut quantisation = InputQuantisation {
            input: rounding,
            ..Default::default()
        };
        if matches!(weights, Weights::Int8 { .. }) {
            self.int8_roundings(i, &mut quantisation)?;
            check_multipliers(&weights, &quantisation)?;
        } else if rounding.is_some() || self.layers.iter().any(|l| l.quantisation.input.is_some()) {
            return Err("reads rounded activations with f32 weights; quantise both or neither".into());
        }
        self.layers.push(Layer {
            name: node.name.clone(),
            inputs,
            outputs,
            weights,
            quantisation,
        });
        Ok(Value::Activation {
            step: Step::Convolution(i),
            rounding: None,
        })
    }

    /// Fills in the roundings before the input's own. If no rounding follows a concatenation, sets the input's rounding
    /// from its parts.
    fn int8_roundings(&mut self, i: usize, quantisation: &mut InputQuantisation) -> Read<()> {
        if Chain::has_skip(i) {
            quantisation.relu = self.relu_in_sum.get(&i).copied().flatten();
        }
        if i == self.last()
            && let Some([features, network_input]) = self.concat
        {
            let whole = match quantisation.input {
                Some(whole) => whole,
                // If the whole is not rounded, both parts must have the same rounding.
                None => features.filter(|_| features == network_input).ok_or(
                    "the concatenation's parts have different scales: round it as a whole \
                                (QuantizeLinear, DequantizeLinear)",
                )?,
            };
            // A part with the same rounding as the whole is rounded only once.
            let before = |part: Option<Quantisation>| part.filter(|part| *part != whole);
            let (features, network_input) = (before(features), before(network_input));
            if let Some(features) = features
                && features.zero_point != 0
            {
                return Err(format!(
                    "the concatenated features have the zero point {}; they are never negative: 0, or the \
                     concatenation's own scale and zero point, are right",
                    features.zero_point
                ));
            }
            if network_input.is_some() && network_input != self.layers[0].quantisation.input {
                return Err(
                    "the concatenated network input must be rounded as for the first layer, as the concatenation is, \
                     or not at all"
                        .into(),
                );
            }
            quantisation.input = Some(whole);
            if Chain::has_skip(i) {
                quantisation.sum = features
            } else {
                quantisation.relu = features
            }
            self.concat = Some([features, network_input]);
        }
        Ok(())
    }

    fn weights(&self, node: &Node, inputs: usize, rounding: Option<Quantisation>) -> Read<Weights> {
        let (weights, weight_scale) = match self.input(node, 1)? {
            Value::Constant(constant) => (*constant, None),
            Value::Dequantised { constant, scale } => (*constant, Some(scale)),
            _ => return Err("its weights must be constant".into()),
        };
        let outputs = match weights.shape() {
            &[o, c, 3, 3] if c == inputs && (1..=MAX_CHANNELS).contains(&o) => o,
            &[o, c, 3, 3] if c == inputs => {
                return Err(format!("{o} filters; 1 to {MAX_CHANNELS} is right"));
            }
            shape => {
                return Err(format!(
                    "weights of shape {shape:?}; (filters, {inputs}, 3, 3) is right"
                ));
            }
        };
        let bias = match node.input.get(2) {
            Some(_) => Some(self.input(node, 2)?),
            None => None,
        };
        let wrong_bias = || format!("its bias must be a constant of {outputs} values, as precise as the weights");
        let Some(weight_scale) = weight_scale else {
            let bias = match bias {
                Some(Value::Constant(constant)) => constant.f32s()?.to_vec(),
                Some(_) => return Err(wrong_bias()),
                None => vec![0.0; outputs],
            };
            if bias.len() != outputs {
                return Err(wrong_bias());
            }
            return Ok(Weights::F32 {
                kernel: weights.f32s()?.to_vec(),
                bias,
            });
        };
        let scale = spread(weight_scale, outputs).ok_or_else(|| {
            format!(
                "{} weight scales for {outputs} filters; one each is right",
                weight_scale.len()
            )
        })?;
        let input = rounding.or_else(|| self.concat.and_then(|[features, _]| features));
        let input_scale = input
            .ok_or("int8 weights need a rounded input: QuantizeLinear and DequantizeLinear before it")?
            .scale;
        let bias = match bias {
            Some(bias) => int8_bias(bias, input_scale, &scale)?.ok_or_else(wrong_bias)?,
            None => vec![0; outputs],
        };
        if bias.len() != outputs {
            return Err(wrong_bias());
        }
        Ok(Weights::Int8 {
            kernel: weights.i8s()?.to_vec(),
            scale,
            bias,
        })
    }

    fn relu(&self, node: &Node) -> Read<Value<'a>> {
        match self.activation(node, 0)? {
            (Step::Convolution(i), None) if i < self.last() => Ok(Value::Activation {
                step: Step::Relu(i),
                rounding: None,
            }),
            (step, _) => Err(format!("follows {step}; ReLU follows each convolution but the last")),
        }
    }

    fn sum(&mut self, node: &Node) -> Read<Value<'a>> {
        let i = self.layers.len();
        let right = || {
            if Chain::has_skip(i) {
                format!("input[{i}] = output[{}] + input[{}] is right", i - 1, i - 2)
            } else {
                format!("layer {i} has no skip; only odd layers from 3 on have one")
            }
        };
        let (a, b) = (self.activation(node, 0)?, self.activation(node, 1)?);
        if !Chain::has_skip(i) {
            return Err(format!("adds {} and {}; {}", a.0, b.0, right()));
        }
        let skip = if i - 2 == 1 { Step::Relu(0) } else { Step::Sum(i - 2) };
        let (relu, skip_rounding) = match (a.0, b.0) {
            (x, y) if x == Step::Relu(i - 1) && y == skip => (a.1, b.1),
            (x, y) if y == Step::Relu(i - 1) && x == skip => (b.1, a.1),
            _ => return Err(format!("adds {} and {}; {}", a.0, b.0, right())),
        };
        if skip_rounding != self.layers[i - 2].quantisation.input {
            return Err(format!(
                "the skip must read input[{}] as layer {} does, after its DequantizeLinear",
                i - 2,
                i - 2
            ));
        }
        self.relu_in_sum.insert(i, relu);
        Ok(Value::Activation {
            step: Step::Sum(i),
            rounding: None,
        })
    }

    fn concatenation(&mut self, node: &Node) -> Read<Value<'a>> {
        let i = self.layers.len();
        let features = self.features(i);
        if i != self.last() || i == 0 {
            return Err(format!(
                "stands before layer {i}; only the last layer, {}, has a concatenation",
                self.last()
            ));
        }
        if !matches!(int_attribute(node, "axis"), Some(1 | -3)) || node.input.len() != 2 {
            return Err("joins two inputs along axis 1, the channels".into());
        }
        let (a, b) = (self.activation(node, 0)?, self.activation(node, 1)?);
        if a.0 != features || b.0 != Step::Input {
            return Err(format!(
                "joins {} and {}; {features} and the network's input, in this order, are right",
                a.0, b.0
            ));
        }
        self.concat = Some([a.1, b.1]);
        Ok(Value::Activation {
            step: Step::Concat,
            rounding: None,
        })
    }

    /// Reads the rearrangement of pixels as squares at the beginning, or back at the end.
    fn squares(&self, node: &Node) -> Read<Value<'a>> {
        if int_attribute(node, "blocksize") != Some(2) {
            return Err("blocksize 2 is right".into());
        }
        if let Some(mode) = node.attribute.iter().find(|a| a.name == "mode" && a.s != b"DCR") {
            let mode = String::from_utf8_lossy(&mode.s).into_owned();
            return Err(format!("mode '{mode}'; DCR is right"));
        }
        let (from, to) = match node.op_type.as_str() {
            "SpaceToDepth" => (Step::Frame, Step::Input),
            _ => (Step::Convolution(self.last()), Step::Pixels),
        };
        match self.activation(node, 0)? {
            (Step::Convolution(i), None) if !self.layers[i].outputs.is_multiple_of(4) => Err(format!(
                "reads {} channels; four for each channel of the output are right",
                self.layers[i].outputs
            )),
            (step, None) if step == from => Ok(Value::Activation {
                step: to,
                rounding: None,
            }),
            (step, _) => Err(format!(
                "follows {step}; it follows {from} in a chain of half the resolution"
            )),
        }
    }

    fn tanh(&self, node: &Node) -> Read<Value<'a>> {
        match self.activation(node, 0)? {
            (step, None) if step == self.end() => Ok(Value::Activation {
                step: Step::Tanh,
                rounding: None,
            }),
            (step, _) => Err(format!("follows {step}; tanh may follow the last convolution alone")),
        }
    }

    fn finish(self, graph: &Graph) -> Result<Chain> {
        let [output] = &graph.output[..] else {
            return Err(Error::Network(format!(
                "{} outputs; a hologram network has one",
                graph.output.len()
            )));
        };
        let tanh = match self.values.get(output.name.as_str()) {
            Some(Value::Activation {
                step: Step::Tanh,
                rounding: None,
            }) => true,
            Some(Value::Activation { step, rounding: None }) if *step == self.end() => false,
            _ => {
                return Err(Error::Network(format!(
                    "output '{}' is not the last layer's; {} or its tanh is right",
                    output.name,
                    self.end()
                )));
            }
        };
        let precision = match self.layers[0].weights {
            Weights::F32 { .. } => Precision::F32,
            Weights::Int8 { .. } => Precision::Int8,
        };
        let concat_rounded_input = matches!(self.concat, Some([_, Some(_)]));
        Ok(Chain {
            inputs: self.inputs,
            halved: self.halved,
            layers: self.layers,
            tanh,
            concat_rounded_input,
            precision,
        })
    }
}

/// Returns the channel count of the graph's input, `(1, C, H, W)` in f32.
fn input_channels(input: &ValueInfo) -> Result<usize> {
    let wrong = |what: String| Error::Network(format!("input '{}' {what}; f32 (1, C, H, W) is right", input.name));
    let Some(tensor) = input.r#type.as_ref().and_then(|t| t.tensor.as_ref()) else {
        return Err(wrong("is no tensor".into()));
    };
    if tensor.elem_type != data_type::FLOAT {
        return Err(wrong("is not f32".into()));
    }
    let dims = tensor.shape.as_ref().map_or(&[][..], |shape| &shape.dim[..]);
    let [batch, channels, ..] = dims else {
        return Err(wrong(format!("has {} dimensions", dims.len())));
    };
    if dims.len() != 4 {
        return Err(wrong(format!("has {} dimensions", dims.len())));
    }
    if batch.value.is_some_and(|n| n != 1) {
        return Err(wrong("has a batch that is not 1".into()));
    }
    match channels.value {
        Some(c) if (1..=MAX_CHANNELS as i64).contains(&c) => Ok(c as usize),
        Some(c) => Err(wrong(format!("has {c} channels, not 1 to {MAX_CHANNELS}"))),
        _ => Err(wrong("states no channel count".into())),
    }
}

/// Checks a convolution's attributes: 3×3, stride 1, dilation 1, one group, padding 1 on each side.
fn check_convolution(node: &Node) -> Read<()> {
    for attribute in &node.attribute {
        let ints = &attribute.ints[..];
        let right = match attribute.name.as_str() {
            "kernel_shape" if ints != [3, 3] => "[3, 3]",
            "strides" if ints != [1, 1] => "[1, 1]",
            "dilations" if ints != [1, 1] => "[1, 1]",
            "pads" if ints != [1, 1, 1, 1] => "[1, 1, 1, 1]",
            "group" if attribute.i != 1 => {
                return Err(format!("group {}; 1 is right", attribute.i));
            }
            "auto_pad" if !matches!(&attribute.s[..], b"NOTSET" | b"SAME_UPPER" | b"SAME_LOWER") => {
                return Err(format!(
                    "auto_pad {}; pads of 1 are right",
                    String::from_utf8_lossy(&attribute.s)
                ));
            }
            _ => continue,
        };
        return Err(format!("{} {ints:?}; {right} is right", attribute.name));
    }
    let same = node
        .attribute
        .iter()
        .any(|a| a.name == "auto_pad" && a.s.starts_with(b"SAME"));
    if !same && !node.attribute.iter().any(|a| a.name == "pads") {
        return Err("no padding; pads [1, 1, 1, 1] are right".into());
    }
    Ok(())
}

/// Checks that every accumulator fits 32 bits and every step size an f32.
fn check_multipliers(weights: &Weights, quantisation: &InputQuantisation) -> Read<()> {
    let (Weights::Int8 { kernel, scale, bias }, Some(input)) = (weights, quantisation.input) else {
        return Ok(());
    };
    let per_filter = kernel.len() / scale.len();
    for (o, (&s, &b)) in scale.iter().zip(bias).enumerate() {
        let step = input.scale * s;
        if !step.is_normal() {
            return Err(format!(
                "input scale × weight scale of filter {o} is {step}; a normal f32 is right"
            ));
        }
        let reach: i64 = kernel[o * per_filter..][..per_filter]
            .iter()
            .map(|&w| 255 * i64::from(w).abs())
            .sum();
        if reach + i64::from(b).abs() > i64::from(i32::MAX) {
            return Err(format!("filter {o} overflows 32 bits: its bias is {b}"));
        }
    }
    Ok(())
}

/// Returns a bias in steps of the accumulator, input scale × weight scale, or `None` if the value is not a bias.
fn int8_bias(bias: &Value<'_>, input_scale: f32, scale: &[f32]) -> Read<Option<Vec<i32>>> {
    match bias {
        Value::Dequantised {
            constant,
            scale: bias_scale,
        } => {
            let right = spread(bias_scale, scale.len()).is_some_and(|bias_scale| {
                bias_scale
                    .iter()
                    .zip(scale)
                    .all(|(b, w)| (b / (input_scale * w) - 1.0).abs() < 1e-3)
            });
            if !right {
                return Err("the bias scale must be input scale × weight scale".into());
            }
            Ok(Some(constant.i32s()?.to_vec()))
        }
        Value::Constant(constant) => {
            let rounded = |(b, w): (&f32, &f32)| {
                let step = f64::from(input_scale) * f64::from(*w);
                (f64::from(*b) / step).round_ties_even() as i32
            };
            Ok(Some(constant.f32s()?.iter().zip(scale).map(rounded).collect()))
        }
        _ => Ok(None),
    }
}

fn spread(scale: &[f32], outputs: usize) -> Option<Vec<f32>> {
    match scale {
        &[one] => Some(vec![one; outputs]),
        many => (many.len() == outputs).then(|| many.to_vec()),
    }
}

fn int_attribute(node: &Node, name: &str) -> Option<i64> {
    node.attribute.iter().find(|a| a.name == name).map(|a| a.i)
}
