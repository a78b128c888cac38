//! A small network that estimates depth from colours, for the tests of several crates.

use prost::Message;
use tract_onnx::pb::*;

/// The weights of the small network.
pub(crate) const WEIGHTS: [f32; 3] = [-0.25, 0.0, 1.0];

/// Creates a depth network: one 1×1 convolution over the colours, for pictures of `sides`.
pub(crate) fn network(sides: Option<(i64, i64)>, interleaved: bool) -> Vec<u8> {
    let dim = |value: Option<i64>, name: &str| tensor_shape_proto::Dimension {
        value: Some(match value {
            Some(n) => tensor_shape_proto::dimension::Value::DimValue(n),
            None => tensor_shape_proto::dimension::Value::DimParam(name.into()),
        }),
        ..Default::default()
    };
    let value = |name: &str, axes: Vec<tensor_shape_proto::Dimension>| ValueInfoProto {
        name: name.into(),
        r#type: Some(TypeProto {
            value: Some(type_proto::Value::TensorType(type_proto::Tensor {
                elem_type: tensor_proto::DataType::Float as i32,
                shape: Some(TensorShapeProto { dim: axes }),
            })),
            ..Default::default()
        }),
        ..Default::default()
    };
    let (height, width) = (dim(sides.map(|s| s.0), "h"), dim(sides.map(|s| s.1), "w"));
    let (one, three) = (dim(Some(1), ""), dim(Some(3), ""));
    let mut nodes = Vec::new();
    let mut from = "picture";
    if interleaved {
        nodes.push(NodeProto {
            op_type: "Transpose".into(),
            name: "planes".into(),
            input: vec!["picture".into()],
            output: vec!["planes".into()],
            attribute: vec![AttributeProto {
                name: "perm".into(),
                r#type: attribute_proto::AttributeType::Ints as i32,
                ints: vec![0, 3, 1, 2],
                ..Default::default()
            }],
            ..Default::default()
        });
        from = "planes";
    }
    nodes.push(NodeProto {
        op_type: "Conv".into(),
        name: "see".into(),
        input: vec![from.into(), "weights".into()],
        output: vec!["seen".into()],
        ..Default::default()
    });
    let picture = if interleaved {
        vec![one.clone(), height.clone(), width.clone(), three]
    } else {
        vec![one.clone(), three, height.clone(), width.clone()]
    };
    ModelProto {
        ir_version: 8,
        opset_import: vec![OperatorSetIdProto {
            version: 13,
            ..Default::default()
        }],
        graph: Some(GraphProto {
            name: "depth".into(),
            input: vec![value("picture", picture)],
            output: vec![value("seen", vec![one.clone(), one, height, width])],
            node: nodes,
            initializer: vec![TensorProto {
                name: "weights".into(),
                data_type: tensor_proto::DataType::Float as i32,
                dims: vec![1, 3, 1, 1],
                float_data: WEIGHTS.to_vec(),
                ..Default::default()
            }],
            ..Default::default()
        }),
        ..Default::default()
    }
    .encode_to_vec()
}
