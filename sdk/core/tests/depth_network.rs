//! Tests depth networks that would exhaust memory, run forever, or make tract panic. Each is refused with one line.
#![allow(clippy::unwrap_used)]

use phasefront_core::Size;
use phasefront_core::depth_network::{ColourScale, DepthNetwork};
use prost::Message;
use std::path::Path;
use tract_onnx::pb::*;

const FLOAT: i32 = tensor_proto::DataType::Float as i32;
const INT64: i32 = tensor_proto::DataType::Int64 as i32;

fn value(name: &str, sides: &[i64]) -> ValueInfoProto {
    let dim = |n: &i64| tensor_shape_proto::Dimension {
        value: Some(tensor_shape_proto::dimension::Value::DimValue(*n)),
        ..Default::default()
    };
    ValueInfoProto {
        name: name.into(),
        r#type: Some(TypeProto {
            value: Some(type_proto::Value::TensorType(type_proto::Tensor {
                elem_type: FLOAT,
                shape: Some(TensorShapeProto {
                    dim: sides.iter().map(dim).collect(),
                }),
            })),
            ..Default::default()
        }),
        ..Default::default()
    }
}

fn node(op: &str, inputs: &[&str], output: &str, attribute: Vec<AttributeProto>) -> NodeProto {
    NodeProto {
        op_type: op.into(),
        name: format!("node of {output}"),
        input: inputs.iter().map(|name| (*name).into()).collect(),
        output: vec![output.into()],
        attribute,
        ..Default::default()
    }
}

fn ints(name: &str, ints: &[i64]) -> AttributeProto {
    AttributeProto {
        name: name.into(),
        r#type: attribute_proto::AttributeType::Ints as i32,
        ints: ints.into(),
        ..Default::default()
    }
}

fn int(name: &str, i: i64) -> AttributeProto {
    AttributeProto {
        name: name.into(),
        r#type: attribute_proto::AttributeType::Int as i32,
        i,
        ..Default::default()
    }
}

fn numbers(name: &str, dims: &[i64], values: &[i64]) -> TensorProto {
    TensorProto {
        name: name.into(),
        data_type: INT64,
        dims: dims.into(),
        int64_data: values.into(),
        ..Default::default()
    }
}

fn floats(name: &str, dims: &[i64], values: &[f32]) -> TensorProto {
    TensorProto {
        name: name.into(),
        data_type: FLOAT,
        dims: dims.into(),
        float_data: values.into(),
        ..Default::default()
    }
}

/// Encodes a network of these nodes that returns `output`. The nodes may read `picture`, (1, 3, 16, 24), and `seen`,
/// its mean over the colours.
fn file(output: &str, nodes: Vec<NodeProto>, initializer: Vec<TensorProto>) -> Vec<u8> {
    let see = node("Conv", &["picture", "weights"], "seen", vec![]);
    let weights = floats("weights", &[1, 3, 1, 1], &[0.5, 0.25, 0.25]);
    ModelProto {
        ir_version: 8,
        opset_import: vec![OperatorSetIdProto {
            version: 13,
            ..Default::default()
        }],
        graph: Some(GraphProto {
            name: "depth".into(),
            input: vec![value("picture", &[1, 3, 16, 24])],
            output: vec![value(output, &[1, 1, 16, 24])],
            node: [vec![see], nodes].concat(),
            initializer: [vec![weights], initializer].concat(),
            ..Default::default()
        }),
        ..Default::default()
    }
    .encode_to_vec()
}

fn run(path: &Path) -> phasefront_core::runtime::error::Result<(usize, usize)> {
    let mut network = DepthNetwork::open(path)?;
    network.colours = ColourScale::Unit;
    Ok(network
        .estimator(Size { width: 24, height: 16 })?
        .estimate(&[0.5; 3 * 16 * 24])?
        .dim())
}

/// Returns networks that make tract 0.23 panic.
fn broken() -> Vec<(&'static str, Vec<u8>)> {
    let of = |op: &str, attributes| file("out", vec![node(op, &["seen"], "out", attributes)], vec![]);
    let strided = node("Conv", &["picture", "weights"], "out", vec![ints("strides", &[0, 0])]);
    let concat = node("Concat", &["seen", "seen"], "out", vec![int("axis", 99)]);
    let slice = node("Slice", &["seen", "from", "to", "axes", "steps"], "out", vec![]);
    let slices = vec![
        numbers("from", &[1], &[0]),
        numbers("to", &[1], &[8]),
        numbers("axes", &[1], &[2]),
        numbers("steps", &[1], &[0]),
    ];
    let pad = node("Pad", &["seen", "pads"], "out", vec![]);
    let pads = numbers("pads", &[8], &[0, 0, -100, 0, 0, 0, 0, 0]);
    let mut nothing = ModelProto::decode(&*file("seen", vec![], vec![])).unwrap();
    nothing.graph.as_mut().unwrap().output.clear();
    vec![
        ("axis", file("out", vec![concat], vec![])),
        ("stride", file("out", vec![strided], vec![])),
        ("kernel", of("MaxPool", vec![ints("kernel_shape", &[0, 0])])),
        (
            "pool stride",
            of("MaxPool", vec![ints("kernel_shape", &[2, 2]), ints("strides", &[0, 0])]),
        ),
        ("slice", file("out", vec![slice], slices)),
        ("pad", file("out", vec![pad], vec![pads])),
        ("no such output", file("missing", vec![], vec![])),
        ("no output", nothing.encode_to_vec()),
        ("perm", of("Transpose", vec![ints("perm", &[9, 9, 9, 9])])),
        ("nothing", vec![]),
    ]
}

/// Returns networks that would need more memory or time than available.
fn huge() -> Vec<(&'static str, Vec<u8>)> {
    let large = [1i64, 1, 1 << 20, 1 << 20];
    let shape = || numbers("shape", &[4], &large);
    let with = |nodes: Vec<NodeProto>, more: Vec<TensorProto>| {
        let add = node("Add", &["seen", "big"], "out", vec![]);
        file("out", [nodes, vec![add]].concat(), more)
    };
    let filled = node("ConstantOfShape", &["shape"], "big", vec![]);
    let expanded = node("Expand", &["one", "shape"], "big", vec![]);
    let one = || floats("one", &[1, 1, 1, 1], &[1.0]);
    let range = node("Range", &["from", "to", "step"], "big", vec![]);
    let scalars = [("from", 0), ("to", 1 << 40), ("step", 1)].map(|(name, v)| numbers(name, &[], &[v]));
    let tile = node("Tile", &["one", "shape"], "big", vec![]);
    let tiled = node("Tile", &["seen", "shape"], "big", vec![]);
    let sized = node("Resize", &["seen", "", "", "shape"], "big", vec![]);
    let scaled = node("Resize", &["seen", "", "scales"], "big", vec![]);
    let scales = floats("scales", &[4], &[1.0, 1.0, 1e6, 1e6]);
    let column = vec![0.5f32; 1 << 16];
    let outer = node("Mul", &["column", "row"], "big", vec![]);
    let product = node("MatMul", &["column", "row"], "big", vec![]);
    let sides = || {
        vec![
            floats("column", &[1 << 16, 1], &column),
            floats("row", &[1, 1 << 16], &column),
        ]
    };
    // Each tensor is twice as large as the one before.
    let doubled: Vec<_> = (0..40)
        .map(|i| {
            let name = |i: usize| if i == 0 { "one".into() } else { format!("c{i}") };
            let from = name(i);
            node("Concat", &[&from, &from], &name(i + 1), vec![int("axis", 3)])
        })
        .chain([node("Identity", &["c40"], "big", vec![])])
        .collect();
    let padded = node("Pad", &["seen", "pads"], "big", vec![]);
    let pads = numbers("pads", &[8], &[0, 0, 0, 0, 0, 0, 1 << 20, 1 << 20]);
    let relus: Vec<_> = (0..20_000)
        .map(|i| {
            let from = if i == 0 { "seen".into() } else { format!("r{i}") };
            let to = if i == 19_999 {
                "out".into()
            } else {
                format!("r{}", i + 1)
            };
            node("Relu", &[&from], &to, vec![])
        })
        .collect();
    // The file is small but needs more than 2^44 multiplications.
    let half = numbers("shape", &[2], &[1 << 13, 1 << 13]);
    let square = node("ConstantOfShape", &["shape"], "square", vec![]);
    let add = node("Add", &["seen", "zero"], "a", vec![]);
    let multiplied: Vec<_> = (0..40)
        .map(|i| node("MatMul", &[&format!("m{i}"), "square"], &format!("m{}", i + 1), vec![]))
        .collect();
    let slow = [
        vec![
            square,
            add,
            node("ReduceMean", &["a"], "mean", vec![int("keepdims", 0)]),
        ],
        vec![node("Mul", &["square", "mean"], "m0", vec![])],
        multiplied,
        vec![node("Identity", &["m40"], "out", vec![])],
    ]
    .concat();
    vec![
        ("filled", with(vec![filled], vec![shape()])),
        ("expanded", with(vec![expanded], vec![shape(), one()])),
        ("range", with(vec![range], scalars.into())),
        ("tile", with(vec![tile], vec![shape(), one()])),
        ("tiled", with(vec![tiled], vec![shape()])),
        ("sized", with(vec![sized], vec![shape()])),
        ("scaled", with(vec![scaled], vec![scales])),
        ("outer", with(vec![outer], sides())),
        ("product", with(vec![product], sides())),
        ("doubled", with(doubled, vec![one()])),
        ("padded", with(vec![padded], vec![pads])),
        ("relus", file("out", relus, vec![])),
        ("slow", file("out", slow, vec![half, floats("zero", &[], &[0.0])])),
    ]
}

/// Returns the peak memory of this process, in bytes.
#[cfg(target_os = "linux")]
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    1024 * line.trim().trim_end_matches(" kB").parse::<u64>().unwrap()
}

#[test]
fn networks_that_cannot_be_run_are_refused_before_memory_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.onnx");
    std::fs::write(&whole, file("seen", vec![], vec![])).unwrap();
    assert_eq!(run(&whole).unwrap(), (16, 24));
    for (name, bytes) in broken().into_iter().chain(huge()) {
        let path = folder.path().join(format!("{name}.onnx"));
        std::fs::write(&path, bytes).unwrap();
        let why = run(&path).expect_err(name).to_string();
        assert!(
            why.starts_with("network: ") && !why.contains('\n') && why.len() < 800,
            "{name}: {why}"
        );
    }
    #[cfg(target_os = "linux")]
    assert!(peak() < 1 << 31, "{} bytes were held", peak());
}

#[test]
fn branches_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("n.onnx");
    let body = AttributeProto {
        name: "then_branch".into(),
        r#type: attribute_proto::AttributeType::Graph as i32,
        g: Some(GraphProto::default()),
        ..Default::default()
    };
    let branch = node("If", &["seen"], "out", vec![body]);
    std::fs::write(&path, file("out", vec![branch], vec![])).unwrap();
    let why = run(&path).unwrap_err().to_string();
    assert!(why.contains("branch") && why.contains("node of out"), "{why}");
}

/// Returns a tensor called `name` whose weights lie in another file, as `external` says.
fn elsewhere(name: &str, dims: &[i64], external: &[(&str, &str)]) -> TensorProto {
    let entry = |(key, value): &(&str, &str)| StringStringEntryProto {
        key: (*key).into(),
        value: (*value).into(),
    };
    TensorProto {
        name: name.into(),
        data_type: FLOAT,
        dims: dims.into(),
        data_location: Some(tensor_proto::DataLocation::External as i32),
        external_data: external.iter().map(entry).collect(),
        ..Default::default()
    }
}

/// The shape of a tensor, where it lies, and words of the refusal.
type Case<'a> = (&'a [i64], &'a [(&'a str, &'a str)], &'a str);

#[test]
fn weights_in_other_files_are_as_large_as_their_shapes_and_lie_beside() {
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().join("model");
    std::fs::create_dir(&inside).unwrap();
    let path = inside.join("n.onnx");
    std::fs::write(
        inside.join("weights.bin"),
        [0.5f32.to_le_bytes(), 0.25f32.to_le_bytes()].concat(),
    )
    .unwrap();
    std::fs::write(folder.path().join("outside.bin"), 0.5f32.to_le_bytes()).unwrap();
    #[cfg(unix)]
    for (to, name) in [
        ("weights.bin", "link.bin"),
        ("../outside.bin", "out.bin"),
        ("..", "up"),
        ("/dev/zero", "zero.bin"),
    ] {
        std::os::unix::fs::symlink(to, inside.join(name)).unwrap();
    }
    let try_one = |dims: &[i64], external: &[(&str, &str)]| {
        let add = node("Add", &["seen", "more"], "out", vec![]);
        std::fs::write(&path, file("out", vec![add], vec![elsewhere("more", dims, external)])).unwrap();
        run(&path)
    };
    let at = |location, offset, length| [("location", location), ("offset", offset), ("length", length)];
    assert_eq!(try_one(&[1], &at("weights.bin", "4", "4")).unwrap(), (16, 24));
    assert_eq!(try_one(&[1], &at("weights.bin", "4", "4")[..2]).unwrap(), (16, 24));
    #[cfg(unix)]
    assert_eq!(try_one(&[1], &at("./link.bin", "0", "4")).unwrap(), (16, 24));
    let cases: &[Case] = &[
        (&[1], &at("../outside.bin", "0", "4"), "in the folder of the network"),
        (&[1], &at("/dev/zero", "0", "4"), "in the folder of the network"),
        (&[1], &at("none.bin", "0", "4"), "none.bin"),
        (&[1], &at(".", "0", "4"), "not a regular file"),
        (&[1], &at("weights.bin", "0", "-4"), "length: invalid digit"),
        (&[1], &at("weights.bin", "-4", "4"), "offset: invalid digit"),
        (&[1], &at("weights.bin", "9", "4"), "the offset is 9"),
        (&[1], &at("weights.bin", "8", "4"), "would end at byte 12"),
        (
            &[1],
            &at("weights.bin", "8", "18446744073709551615"),
            "would end at byte 18446744073709551623",
        ),
        (
            &[1],
            &at("weights.bin", "18446744073709551616", "4"),
            "offset: number too large",
        ),
        (
            &[1],
            &[("location", "weights.bin")],
            "they have 8 bytes; their shape needs 4",
        ),
        (
            &[3],
            &at("weights.bin", "0", "8"),
            "they have 8 bytes; their shape needs 12",
        ),
        (&[-1], &at("weights.bin", "0", "8"), "no type or shape"),
        (&[1 << 62, 4], &at("weights.bin", "0", "8"), "no type or shape"),
    ];
    let links: &[Case] = &[
        (&[1], &at("out.bin", "0", "4"), "in the folder of the network"),
        (&[1], &at("up/outside.bin", "0", "4"), "in the folder of the network"),
        (&[1], &at("zero.bin", "0", "4"), "in the folder of the network"),
    ];
    for (dims, external, words) in cases.iter().chain(links.iter().filter(|_| cfg!(unix))) {
        let why = try_one(dims, external).unwrap_err().to_string();
        assert!(why.contains(words) && why.lines().count() == 1, "{external:?}: {why}");
    }
    let bytes = file(
        "seen",
        vec![],
        vec![elsewhere("more", &[1], &at("weights.bin", "0", "4"))],
    );
    let why = DepthNetwork::from_onnx(&bytes).unwrap_err().to_string();
    assert!(why.contains("must hold its weights itself"), "{why}");
}

/// Many tensors may share one sparse file, which takes no space on the disk.
#[test]
fn weights_in_other_files_are_bounded_together() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("n.onnx");
    let sparse = std::fs::File::create(folder.path().join("big.bin")).unwrap();
    sparse.set_len((1 << 30) + 4).unwrap();
    let weights = |count: usize, floats: i64, offset: &str| -> Vec<TensorProto> {
        let external = [("location", "big.bin"), ("offset", offset)];
        (0..count)
            .map(|i| elsewhere(&format!("more {i}"), &[floats], &external))
            .collect()
    };
    for (initializers, words) in [
        (weights(5, 1 << 28, "4"), "over 4294967296 bytes"),
        (weights(1, (1 << 28) + 1, "0"), "1073741824 are the most"),
    ] {
        std::fs::write(&path, file("seen", vec![], initializers)).unwrap();
        let why = run(&path).unwrap_err().to_string();
        assert!(why.contains(words), "{why}");
    }
    #[cfg(target_os = "linux")]
    assert!(peak() < 1 << 31, "{} bytes were held", peak());
}

#[test]
fn cut_and_damaged_networks_are_refused_or_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("n.onnx");
    let whole = file("seen", vec![], vec![]);
    let try_one = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        if let Err(why) = run(&path) {
            assert!(!why.to_string().contains('\n'), "{why}");
        }
    };
    for end in 0..whole.len() {
        try_one(&whole[..end]);
    }
    for at in 0..whole.len() {
        let mut damaged = whole.clone();
        damaged[at] ^= 1 << (at % 8);
        try_one(&damaged);
    }
}
