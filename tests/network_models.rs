//! Builds ONNX files of residual chains with random weights, in the form that a training package exports.
#![allow(clippy::unwrap_used, dead_code, unreachable_pub)]

use phasefront_core::Size;
use prost::Message;
use rand::{RngExt, SeedableRng};
use tract_onnx::pb::*;

/// The parameters of a model to build.
#[derive(Clone)]
pub struct Model {
    pub layers: usize,
    pub filters: usize,
    pub inputs: usize,
    pub int8: bool,
    pub tanh: bool,
    pub seed: u64,
    /// For int8: whether to round the ReLU before a sum, the sum before the concatenation, and the concatenated input
    /// separately.
    pub inner_roundings: bool,
    pub head: &'static str,
    pub input: &'static str,
    pub offset_mm: &'static str,
    pub seed_planes: Option<usize>,
    /// Whether the chain works at half the resolution.
    pub halved: bool,
}

impl Model {
    pub fn new(layers: usize, filters: usize) -> Model {
        Model {
            layers,
            filters,
            inputs: 4,
            int8: false,
            tanh: false,
            seed: 1,
            inner_roundings: true,
            head: "real-imaginary",
            input: "rgbd",
            offset_mm: "0",
            seed_planes: None,
            halved: false,
        }
    }

    pub fn halved(self) -> Model {
        Model { halved: true, ..self }
    }

    pub fn int8(layers: usize, filters: usize) -> Model {
        Model {
            int8: true,
            ..Model::new(layers, filters)
        }
    }

    /// Returns a pre-filter for an offset.
    pub fn prefilter(offset_mm: &'static str) -> Model {
        Model {
            inputs: 6,
            input: "field",
            offset_mm,
            ..Model::new(8, 8)
        }
    }

    pub fn bytes(&self) -> Vec<u8> {
        self.proto().encode_to_vec()
    }

    #[expect(clippy::too_many_lines, reason = "one graph, node after node")]
    pub fn proto(&self) -> ModelProto {
        let mut b = Builder {
            rng: rand_chacha::ChaCha8Rng::seed_from_u64(self.seed),
            graph: GraphProto::default(),
        };
        b.graph.name = "chain".into();
        b.graph.input.push(planes("rgbd", self.inputs as i64));
        b.graph.output.push(planes("field", 6));
        let given = if self.halved { "squares_out" } else { "rgbd" };
        if self.halved {
            let squares = b.node("SpaceToDepth", "squares", &["rgbd"], given);
            squares.attribute.push(int("blocksize", 2));
        }
        let pixels = if self.halved { 4 } else { 1 };
        let rounded_input = self.round(&mut b, given, 1.0 / 254.0, 127);
        let mut current = rounded_input.clone();
        let (mut inputs, mut outputs): (Vec<String>, Vec<String>) = (vec![], vec![]);
        let mut scale = 1.0 / 254.0;
        for i in 0..self.layers {
            let last = i == self.layers - 1;
            let skip = i >= 3 && i % 2 == 1;
            if i > 0 {
                let mut relu = outputs[i - 1].clone();
                scale = 0.011;
                if (skip || last) && self.inner_roundings {
                    relu = self.round(&mut b, &relu, scale, 0);
                }
                if skip {
                    let sum = format!("sum{i}");
                    b.node("Add", &format!("add{i}"), &[&relu, &inputs[i - 2]], &sum);
                    relu = sum;
                    scale = 0.013;
                }
                if last {
                    if skip && self.inner_roundings {
                        relu = self.round(&mut b, &relu, scale, 0);
                    }
                    let original = if self.inner_roundings {
                        &rounded_input[..]
                    } else {
                        given
                    };
                    b.node("Concat", "concat", &[&relu, original], "joined")
                        .attribute
                        .push(int("axis", 1));
                    relu = "joined".into();
                    scale = 0.017;
                    current = self.round(&mut b, &relu, scale, 31);
                } else {
                    current = self.round(&mut b, &relu, scale, 0);
                }
            }
            inputs.push(current.clone());
            let reads = if i == 0 {
                pixels * self.inputs
            } else {
                self.filters + if last { pixels * self.inputs } else { 0 }
            };
            let writes = if last { pixels * 6 } else { self.filters };
            self.weights(&mut b, i, reads, writes, scale);
            let end = if last && !self.tanh && !self.halved {
                "field".to_string()
            } else {
                format!("conv{i}_out")
            };
            let conv = b.node(
                "Conv",
                &format!("conv{i}"),
                &[&current, &format!("w{i}"), &format!("b{i}")],
                &end,
            );
            conv.attribute = vec![
                ints("dilations", &[1, 1]),
                int("group", 1),
                ints("kernel_shape", &[3, 3]),
                ints("pads", &[1, 1, 1, 1]),
                ints("strides", &[1, 1]),
            ];
            if last {
                self.end(&mut b, end);
            } else {
                b.node("Relu", &format!("relu{i}"), &[&end], &format!("relu{i}_out"));
                outputs.push(format!("relu{i}_out"));
            }
        }
        let seed_planes = self.seed_planes.map(|n| n.to_string());
        let mut metadata = vec![
            ("input", self.input),
            ("head", self.head),
            ("pitch_um", "8.0"),
            ("wavelengths_nm", "638,520,450"),
            ("volume_depth_mm", "6.0"),
            ("offset_mm", self.offset_mm),
        ];
        metadata.extend(seed_planes.as_deref().map(|n| ("seed_planes", n)));
        ModelProto {
            ir_version: 8,
            opset_import: vec![OperatorSetIdProto {
                domain: String::new(),
                version: 17,
            }],
            graph: Some(b.graph),
            metadata_props: metadata
                .iter()
                .map(|(k, v)| StringStringEntryProto {
                    key: format!("phasefront.{k}"),
                    value: v.to_string(),
                })
                .collect(),
            ..Default::default()
        }
    }

    /// Adds the nodes that follow the last convolution.
    fn end(&self, b: &mut Builder, mut end: String) {
        if self.halved {
            let to = if self.tanh { "pixels_out" } else { "field" };
            let pixels = b.node("DepthToSpace", "pixels", &[&end], to);
            pixels.attribute.push(int("blocksize", 2));
            end = to.into();
        }
        if self.tanh {
            b.node("Tanh", "tanh", &[&end], "field");
        }
    }

    fn round(&self, b: &mut Builder, x: &str, scale: f32, zero_point: u8) -> String {
        if !self.int8 {
            return x.to_string();
        }
        let (s, z) = (format!("{x}_scale"), format!("{x}_zero"));
        b.f32s(&s, &[], &[scale]);
        b.bytes(&z, &[], 2, vec![zero_point]);
        b.node("QuantizeLinear", &format!("{x}/q"), &[x, &s, &z], &format!("{x}_q"));
        b.node(
            "DequantizeLinear",
            &format!("{x}/dq"),
            &[&format!("{x}_q"), &s, &z],
            &format!("{x}_dq"),
        );
        format!("{x}_dq")
    }

    fn weights(&self, b: &mut Builder, i: usize, reads: usize, writes: usize, input_scale: f32) {
        let spread = (6.0 / (9.0 * reads as f32)).sqrt() * if i > 1 && i.is_multiple_of(2) { 0.7 } else { 1.0 };
        let count = reads * writes * 9;
        let (w, bias) = (format!("w{i}"), format!("b{i}"));
        let shape = [writes as i64, reads as i64, 3, 3];
        if !self.int8 {
            let kernel: Vec<f32> = (0..count).map(|_| b.rng.random_range(-spread..spread)).collect();
            b.f32s(&w, &shape, &kernel);
            let values: Vec<f32> = (0..writes).map(|_| b.rng.random_range(-0.1..0.1)).collect();
            b.f32s(&bias, &[writes as i64], &values);
            return;
        }
        let kernel: Vec<u8> = (0..count).map(|_| b.rng.random_range(-127i8..=127) as u8).collect();
        let scales: Vec<f32> = (0..writes)
            .map(|_| spread / 127.0 * b.rng.random_range(0.7f32..1.0))
            .collect();
        let bias_scales: Vec<f32> = scales.iter().map(|s| s * input_scale).collect();
        let values: Vec<u8> = bias_scales
            .iter()
            .flat_map(|s| ((b.rng.random_range(-0.1f32..0.1) / s).round() as i32).to_le_bytes())
            .collect();
        for (name, shape, kind, data, scales) in [
            (&w, &shape[..], 3, kernel, &scales),
            (&bias, &shape[..1], 6, values, &bias_scales),
        ] {
            b.bytes(&format!("{name}_q"), shape, kind, data);
            b.f32s(&format!("{name}_scale"), &[writes as i64], scales);
            b.bytes(
                &format!("{name}_zero"),
                &[writes as i64],
                kind,
                vec![0; writes * if kind == 6 { 4 } else { 1 }],
            );
            let inputs = [format!("{name}_q"), format!("{name}_scale"), format!("{name}_zero")];
            let inputs = [&inputs[0][..], &inputs[1], &inputs[2]];
            b.node("DequantizeLinear", &format!("{name}/dq"), &inputs, name)
                .attribute
                .push(int("axis", 0));
        }
    }
}

struct Builder {
    rng: rand_chacha::ChaCha8Rng,
    graph: GraphProto,
}

impl Builder {
    fn node(&mut self, op: &str, name: &str, inputs: &[&str], output: &str) -> &mut NodeProto {
        self.graph.node.push(NodeProto {
            op_type: op.into(),
            name: name.into(),
            input: inputs.iter().map(|s| s.to_string()).collect(),
            output: vec![output.into()],
            ..Default::default()
        });
        self.graph.node.last_mut().unwrap()
    }

    fn f32s(&mut self, name: &str, shape: &[i64], values: &[f32]) {
        let raw = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.bytes(name, shape, 1, raw);
    }

    fn bytes(&mut self, name: &str, shape: &[i64], data_type: i32, raw_data: Vec<u8>) {
        self.graph.initializer.push(TensorProto {
            name: name.into(),
            dims: shape.to_vec(),
            data_type,
            raw_data,
            ..Default::default()
        });
    }
}

pub fn int(name: &str, i: i64) -> AttributeProto {
    AttributeProto {
        name: name.into(),
        r#type: 2,
        i,
        ..Default::default()
    }
}

pub fn ints(name: &str, values: &[i64]) -> AttributeProto {
    AttributeProto {
        name: name.into(),
        r#type: 7,
        ints: values.to_vec(),
        ..Default::default()
    }
}

fn planes(name: &str, channels: i64) -> ValueInfoProto {
    use tensor_shape_proto::{Dimension, dimension::Value};
    let dim = |value| Dimension {
        denotation: String::new(),
        value: Some(value),
    };
    let dims = vec![
        dim(Value::DimValue(1)),
        dim(Value::DimValue(channels)),
        dim(Value::DimParam("height".into())),
        dim(Value::DimParam("width".into())),
    ];
    let tensor = type_proto::Tensor {
        elem_type: 1,
        shape: Some(TensorShapeProto { dim: dims }),
    };
    ValueInfoProto {
        name: name.into(),
        r#type: Some(TypeProto {
            denotation: String::new(),
            value: Some(type_proto::Value::TensorType(tensor)),
        }),
        ..Default::default()
    }
}

/// Returns a frame of random RGB-D minus 0.5.
pub fn frame(channels: usize, size: Size, seed: u64) -> Vec<f32> {
    let Size { width, height } = size;
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    (0..channels * height * width)
        .map(|_| rng.random_range(-0.5f32..0.5))
        .collect()
}
