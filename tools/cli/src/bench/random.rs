//! Networks with random weights, for numbers of layers that no bundled network has. The cost of a network does not
//! depend on its weights. The networks are written as ONNX and read like all others.

use phasefront::Network;
use phasefront_io::Result;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// The filters of each hidden layer, as in the paper.
const FILTERS: usize = 24;
/// The planes of an RGB-D frame, and of a field.
const INPUTS: usize = 4;
const OUTPUTS: usize = 6;

/// Makes an f32 network of `layers` layers for RGB-D frames and the paper's display.
///
/// # Errors
/// Returns an error if there are fewer layers than a chain has.
pub fn network(layers: usize) -> Result<Arc<Network>> {
    Ok(Arc::new(Network::from_onnx(&onnx(layers))?))
}

/// A message of Protocol Buffers: fields of numbers and of bytes, one after another.
#[derive(Default)]
struct Message(Vec<u8>);

impl Message {
    fn varint(mut self, mut value: u64) -> Self {
        while value >= 128 {
            self.0.push(value as u8 | 128);
            value >>= 7;
        }
        self.0.push(value as u8);
        self
    }

    fn number(self, field: u64, value: u64) -> Self {
        self.varint(field << 3).varint(value)
    }

    fn bytes(self, field: u64, value: &[u8]) -> Self {
        let mut message = self.varint(field << 3 | 2).varint(value.len() as u64);
        message.0.extend_from_slice(value);
        message
    }

    fn text(self, field: u64, value: &str) -> Self {
        self.bytes(field, value.as_bytes())
    }
}

fn node(kind: &str, reads: &[&str], writes: &str, attributes: &[(&str, &[u64])]) -> Vec<u8> {
    let mut message = Message::default();
    for name in reads {
        message = message.text(1, name);
    }
    message = message.text(2, writes).text(4, kind);
    for (name, values) in attributes {
        let attribute = Message::default().text(1, name);
        // The type is INT for one value, else INTS.
        let attribute = match values {
            [value] => attribute.number(3, *value).number(20, 2),
            values => (values.iter())
                .fold(attribute, |message, value| message.number(8, *value))
                .number(20, 7),
        };
        message = message.bytes(5, &attribute.0);
    }
    message.0
}

fn tensor(name: &str, shape: &[usize], values: impl Iterator<Item = f32>) -> Vec<u8> {
    let raw: Vec<u8> = values.flat_map(f32::to_le_bytes).collect();
    let message = (shape.iter()).fold(Message::default(), |m, n| m.number(1, *n as u64));
    // data_type 1 is f32.
    message.number(2, 1).text(8, name).bytes(9, &raw).0
}

/// Describes an input or output of a graph: (1, `planes`, height, width), where the last two may have any size.
fn planes(name: &str, planes: usize) -> Vec<u8> {
    let sized = |n: usize| Message::default().number(1, n as u64).0;
    let named = |name: &str| Message::default().text(2, name).0;
    let shape = [sized(1), sized(planes), named("height"), named("width")];
    let shape = (shape.iter()).fold(Message::default(), |m, dimension| m.bytes(1, dimension));
    let of = Message::default().number(1, 1).bytes(2, &shape.0);
    let kind = Message::default().bytes(1, &of.0);
    Message::default().text(1, name).bytes(2, &kind.0).0
}

/// Writes the chain of [`phasefront_core::method::network::chain`] as ONNX.
fn onnx(layers: usize) -> Vec<u8> {
    let mut random = ChaCha8Rng::seed_from_u64(layers as u64);
    let mut graph = Message::default().text(2, "chain");
    let mut read: Vec<String> = Vec::new();
    let mut at = "rgbd".to_owned();
    for i in 0..layers {
        let last = i + 1 == layers;
        if i >= 3 && i % 2 == 1 {
            let sum = format!("sum{i}");
            graph = graph.bytes(1, &node("Add", &[&at, &read[i - 2]], &sum, &[]));
            at = sum;
        }
        read.push(at.clone());
        if last {
            graph = graph.bytes(1, &node("Concat", &[&at, "rgbd"], "joined", &[("axis", &[1])]));
            at = "joined".into();
        }
        let inputs = match (i, last) {
            (0, _) => INPUTS,
            (_, true) => FILTERS + INPUTS,
            _ => FILTERS,
        };
        let outputs = if last { OUTPUTS } else { FILTERS };
        let (kernel, bias) = (format!("w{i}"), format!("b{i}"));
        // This spread keeps values from vanishing or growing along the chain.
        let spread = (3.0 / (9 * inputs) as f32).sqrt();
        let mut weights = |n: usize| {
            (0..n)
                .map(|_| random.random_range(-spread..spread))
                .collect::<Vec<f32>>()
        };
        let shape = [outputs, inputs, 3, 3];
        let values = weights(outputs * inputs * 9).into_iter();
        graph = graph.bytes(5, &tensor(&kernel, &shape, values));
        let values = weights(outputs).into_iter();
        graph = graph.bytes(5, &tensor(&bias, &[outputs], values));
        let out = if last { "field".to_owned() } else { format!("conv{i}") };
        let attributes: [(&str, &[u64]); 2] = [("kernel_shape", &[3, 3]), ("pads", &[1, 1, 1, 1])];
        graph = graph.bytes(1, &node("Conv", &[&at, &kernel, &bias], &out, &attributes));
        at = out;
        if !last {
            let relu = format!("relu{i}");
            graph = graph.bytes(1, &node("Relu", &[&at], &relu, &[]));
            at = relu;
        }
    }
    graph = graph
        .bytes(11, &planes("rgbd", INPUTS))
        .bytes(12, &planes("field", OUTPUTS));
    let operators = Message::default().text(1, "").number(2, 17);
    let mut model = Message::default()
        .number(1, 8)
        .bytes(7, &graph.0)
        .bytes(8, &operators.0);
    for (key, value) in [
        ("input", "rgbd"),
        ("head", "real-imaginary"),
        ("pitch_um", "8.0"),
        ("wavelengths_nm", "638,520,450"),
        ("volume_depth_mm", "6.0"),
        ("offset_mm", "0"),
    ] {
        let entry = Message::default().text(1, &format!("phasefront.{key}")).text(2, value);
        model = model.bytes(14, &entry.0);
    }
    model.0
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use phasefront::Size;

    #[test]
    fn any_number_of_layers_is_a_chain_that_the_kernels_run() {
        for layers in [2, 5, 8, 30] {
            let network = network(layers).unwrap();
            assert_eq!((network.layers(), network.filters()), (layers, FILTERS));
            let plan = network.plan(Size { width: 14, height: 9 }).unwrap();
            assert!(plan.engine().isa.is_some(), "{:?}", plan.engine());
            let input: Vec<f32> = (0..4 * 9 * 14).map(|i| (i % 7) as f32 / 6.0 - 0.5).collect();
            let mut output = vec![0.0; 6 * 9 * 14];
            plan.run(&input, &mut output, &mut plan.scratch()).unwrap();
            let most = output.iter().fold(0.0f32, |most, v| most.max(v.abs()));
            assert!((1e-3..1e4).contains(&most), "{layers}: {most}");
        }
        assert!(network(1).is_err());
    }
}
