//! Networks of any form, on tract: their planes, ranges, sizes and outputs, and where they are refused.
use ndarray::{Array2, Array3};
use num_complex::Complex32;
use phasefront_core::Size;
use phasefront_core::display::Display;
use phasefront_core::display::target::Target;
use phasefront_core::encode::EncoderOptions;
use phasefront_core::frame::RgbdFrame;
use phasefront_core::method::network::Network;
use phasefront_core::method::sweep::Sweep;
use phasefront_core::method::{Method, MethodPlan};
use phasefront_core::pipeline::Pipeline;
use prost::Message;
use std::sync::Arc;
use tract_onnx::pb::*;

const SIZE: Size = Size { width: 7, height: 5 };

fn planes_of(name: &str, channels: i64) -> ValueInfoProto {
    use tensor_shape_proto::{Dimension, dimension::Value};
    let dim = |value| Dimension {
        value: Some(value),
        ..Dimension::default()
    };
    let open = |name: &str| dim(Value::DimParam(name.into()));
    ValueInfoProto {
        name: name.into(),
        r#type: Some(TypeProto {
            value: Some(type_proto::Value::TensorType(type_proto::Tensor {
                elem_type: tensor_proto::DataType::Float as i32,
                shape: Some(TensorShapeProto {
                    dim: vec![
                        dim(Value::DimValue(1)),
                        dim(Value::DimValue(channels)),
                        open("h"),
                        open("w"),
                    ],
                }),
            })),
            ..TypeProto::default()
        }),
        ..ValueInfoProto::default()
    }
}

fn kernel(name: &str, dims: [i64; 4], values: Vec<f32>) -> TensorProto {
    TensorProto {
        name: name.into(),
        data_type: tensor_proto::DataType::Float as i32,
        dims: dims.to_vec(),
        float_data: values,
        ..TensorProto::default()
    }
}

fn node(op_type: &str, input: &[&str], output: &str) -> NodeProto {
    NodeProto {
        op_type: op_type.into(),
        name: op_type.to_lowercase(),
        input: input.iter().map(|name| (*name).into()).collect(),
        output: vec![output.into()],
        ..NodeProto::default()
    }
}

/// Returns a 1×1 convolution from the planes of `weights`' columns to those of its rows, with `metadata`.
fn file(weights: &[&[f32]], metadata: &[(&str, &str)]) -> Vec<u8> {
    let (outputs, inputs) = (weights.len() as i64, weights[0].len() as i64);
    let kernels = vec![kernel("kernel", [outputs, inputs, 1, 1], weights.concat())];
    let nodes = vec![node("Conv", &["frame", "kernel"], "wave")];
    graph(nodes, kernels, [inputs, outputs], metadata)
}

/// Returns a U-Net that makes planes four times smaller and larger again, for frames whose sides are multiples of 4.
fn u_net(metadata: &[(&str, &str)]) -> Vec<u8> {
    let by_four = |mut node: NodeProto| {
        for name in ["kernel_shape", "strides"] {
            node.attribute.push(AttributeProto {
                name: name.into(),
                r#type: attribute_proto::AttributeType::Ints as i32,
                ints: vec![4, 4],
                ..AttributeProto::default()
            });
        }
        node
    };
    let nodes = vec![
        by_four(node("AveragePool", &["frame"], "small")),
        by_four(node("ConvTranspose", &["small", "up"], "large")),
        node("Conv", &["frame", "beside"], "skip"),
        node("Add", &["large", "skip"], "wave"),
    ];
    let kernels = vec![
        kernel("up", [4, 6, 4, 4], vec![0.01; 384]),
        kernel("beside", [6, 4, 1, 1], vec![0.2; 24]),
    ];
    graph(nodes, kernels, [4, 6], metadata)
}

fn graph(
    node: Vec<NodeProto>,
    initializer: Vec<TensorProto>,
    [inputs, outputs]: [i64; 2],
    metadata: &[(&str, &str)],
) -> Vec<u8> {
    let base = [
        ("pitch_um", "8"),
        ("wavelengths_nm", "638,520,450"),
        ("volume_depth_mm", "6"),
        ("offset_mm", "0"),
    ];
    let given = |key: &str| metadata.iter().any(|(own, _)| *own == key);
    let rest = base.into_iter().filter(|(key, _)| !given(key));
    let entries = metadata.iter().copied().chain(rest);
    ModelProto {
        ir_version: 8,
        opset_import: vec![OperatorSetIdProto {
            version: 13,
            ..OperatorSetIdProto::default()
        }],
        metadata_props: entries
            .map(|(key, value)| StringStringEntryProto {
                key: format!("phasefront.{key}"),
                value: value.into(),
            })
            .collect(),
        graph: Some(GraphProto {
            name: "own".into(),
            input: vec![planes_of("frame", inputs)],
            output: vec![planes_of("wave", outputs)],
            node,
            initializer,
            ..GraphProto::default()
        }),
        ..ModelProto::default()
    }
    .encode_to_vec()
}

fn network(weights: &[&[f32]], metadata: &[(&str, &str)]) -> Arc<Network> {
    Arc::new(Network::from_onnx(&file(weights, metadata)).unwrap())
}

fn frame(colours: usize) -> RgbdFrame {
    let Size { width, height } = SIZE;
    let rgb = Array3::from_shape_fn((colours, height, width), |(c, y, x)| {
        (1 + c + 3 * y + 5 * x) as f32 / 64.0
    });
    let depth = Array2::from_shape_fn((height, width), |(y, x)| (y * width + x) as f32 / 35.0);
    RgbdFrame::new(rgb, depth).unwrap()
}

fn field(network: &Arc<Network>, frame: &RgbdFrame, display: &Display) -> Vec<Complex32> {
    let plan = MethodPlan::new(SIZE, Method::trained(network.clone()), display).unwrap();
    let mut field = vec![Complex32::ZERO; display.colours() * SIZE.pixels()];
    plan.field(frame, &mut field, &mut plan.scratch()).unwrap();
    field
}

#[test]
fn planes_ranges_and_outputs_are_those_of_the_metadata() {
    let frame = frame(3);
    // The planes' order is depth, blue, green, red. The real parts are red, green and blue, the imaginary ones depth.
    let weights: [&[f32]; 6] = [
        &[0.0, 0.0, 0.0, 1.0],
        &[0.0, 0.0, 1.0, 0.0],
        &[0.0, 1.0, 0.0, 0.0],
        &[1.0, 0.0, 0.0, 0.0],
        &[2.0, 0.0, 0.0, 0.0],
        &[3.0, 0.0, 0.0, 0.0],
    ];
    for (output, multiple) in [("real-imaginary", "1"), ("amplitude-phase", "8")] {
        let metadata = [
            ("output", output),
            ("planes", "depth,blue,green,red"),
            ("colour_range", "-1,3"),
            ("depth_range", "1,-0.5"),
            ("multiple", multiple),
        ];
        let field = field(&network(&weights, &metadata), &frame, &Display::default());
        for ((c, y, x), colour) in frame.rgb().indexed_iter() {
            let first = -1.0 + 4.0 * colour;
            let second = (c + 1) as f32 * (1.0 - 1.5 * frame.depth()[(y, x)]);
            let expected = match output {
                "real-imaginary" => Complex32::new(first, second),
                _ => Complex32::from_polar(first, second),
            };
            let made = field[(c * SIZE.height + y) * SIZE.width + x];
            assert!(
                (made - expected).norm() < 1e-5,
                "{output} {c} {y} {x}: {made} against {expected}"
            );
        }
    }
}

#[test]
fn phases_of_one_laser_become_its_levels() {
    let display = Display::from_toml("wavelengths_nm = [520]\noffset_mm = 1.5\nvolume_depth_mm = 3").unwrap();
    let metadata = [
        ("output", "phase"),
        ("planes", "amplitude,depth"),
        ("wavelengths_nm", "520"),
        ("offset_mm", "1.5"),
    ];
    let network = network(&[&[2.0, 3.0]], &metadata);
    let frame = frame(1);
    let target = Target::from(display);
    let pipeline = Pipeline::new(SIZE, Method::trained(network), &target, &EncoderOptions::default()).unwrap();
    let levels = pipeline.levels(&frame).unwrap();
    for ((_, y, x), colour) in frame.rgb().indexed_iter() {
        // The display's volume is half as deep as that of the training.
        let phase = 2.0 * colour + 3.0 * (0.5 + 0.5 * (frame.depth()[(y, x)] - 0.5));
        let turns = phase / std::f32::consts::TAU;
        let apart = f32::from(levels[y * SIZE.width + x]) / 256.0 - turns;
        assert!((apart - apart.round()).abs() < 0.501 / 256.0, "{y} {x}: {apart}");
    }
}

#[test]
fn a_network_says_where_its_wave_is_and_serves_one_of_its_lasers() {
    let weights: [&[f32]; 6] = [
        &[1.0, 0.0, 0.0],
        &[0.0, 2.0, 0.0],
        &[0.0; 3],
        &[0.0; 3],
        &[0.0; 3],
        &[0.0; 3],
    ];
    let metadata = [
        ("output", "real-imaginary"),
        ("planes", "red,green,blue"),
        ("offset_mm", "2.5"),
    ];
    let network = network(&weights, &metadata);
    let display = Display::from_toml("wavelengths_nm = [520]").unwrap();
    let plan = MethodPlan::new(SIZE, Method::trained(network.clone()), &display).unwrap();
    assert!((plan.z_m() - 2.5e-3).abs() < 1e-12);
    let frame = frame(1);
    for (made, colour) in field(&network, &frame, &display).iter().zip(frame.rgb()) {
        assert!((made - Complex32::from(2.0 * colour)).norm() < 1e-6);
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let weights: [&[f32]; 6] = [&[1.0; 4]; 6];
    let metadata = [("output", "real-imaginary"), ("planes", "red,green,blue,depth")];
    let network = network(&weights, &metadata);
    let refused = |method: Method, display: &str| {
        let display = Display::from_toml(display).unwrap();
        let why = MethodPlan::new(SIZE, method, &display).err().unwrap().to_string();
        assert!(!why.contains('\n'), "{why}");
        why
    };
    for (display, words) in [
        ("pitch_um = 6.4", "pitch in µm of 8.000, the display has 6.400"),
        ("volume_depth_mm = 7", "depths in mm of 6.000, the display has 7.000"),
        (
            "wavelengths_nm = [638, 532, 450]",
            "638, 520, 450, the display has 638, 532, 450",
        ),
        ("wavelengths_nm = [532]", "638, 520, 450, the display has 532"),
    ] {
        let why = refused(Method::trained(network.clone()), display);
        assert!(why.contains(words), "no {words:?} in {why}");
    }
    let sweep = Sweep::for_display(&Display::default());
    let why = refused(Method::Auto(sweep, network.clone()), "");
    assert!(why.contains("the network alone"), "{why}");
    assert!(network.filter_plan(SIZE).is_err() && network.tract_model().is_err());
    for (weights, metadata, words) in [
        (&weights[..5], vec![metadata[0], metadata[1]], "5 planes"),
        (
            &weights[..],
            vec![metadata[0], ("planes", "red,green,blue")],
            "4 planes",
        ),
        (
            &weights[..],
            vec![metadata[0], ("planes", "red,red,blue,depth")],
            "red,red,blue,depth",
        ),
        (&weights[..], vec![metadata[0]], "'phasefront.planes'"),
        (&weights[..], vec![metadata[1], ("output", "waves")], "'waves'"),
        (
            &weights[..],
            vec![metadata[0], metadata[1], ("depth_range", "near")],
            "'near'",
        ),
    ] {
        let why = Network::from_onnx(&file(weights, &metadata))
            .and_then(|network| network.plan(SIZE).map(|_| ()))
            .unwrap_err()
            .to_string();
        assert!(why.contains(words) && !why.contains('\n'), "no {words:?} in {why}");
    }
}

#[test]
fn a_u_net_that_does_not_say_its_multiple_is_told_the_key() {
    let metadata = [("output", "real-imaginary"), ("planes", "red,green,blue,depth")];
    let network = Network::from_onnx(&u_net(&metadata)).unwrap();
    let why = network.plan(SIZE).err().unwrap().to_string();
    let right = "multiples of 4; add the metadata 'phasefront.multiple' with the value '4'";
    assert!(why.contains(right) && !why.contains('\n'), "{why}");
    let said = [&metadata[..], &[("multiple", "4")]].concat();
    Network::from_onnx(&u_net(&said)).unwrap().plan(SIZE).unwrap();
    let wrong = [&metadata[..], &[("multiple", "2")]].concat();
    let why = Network::from_onnx(&u_net(&wrong))
        .unwrap()
        .plan(Size { width: 6, height: 10 });
    let why = why.err().unwrap().to_string();
    assert!(!why.contains('\n'), "{why}");
}

/// Checks the file that tests of the bindings and of the GPU read. With `PHASEFRONT_BLESS`, writes it.
#[test]
fn the_own_network_of_other_tests_is_this_one() {
    let part = |row: usize| -> [f32; 4] {
        std::array::from_fn(|at| if at == row % 3 { 0.5 + row as f32 * 0.1 } else { 0.05 })
    };
    let rows: Vec<[f32; 4]> = (0..6).map(part).collect();
    let rows: Vec<&[f32]> = rows.iter().map(|row| &row[..]).collect();
    let made = file(
        &rows,
        &[("output", "real-imaginary"), ("planes", "red,green,blue,depth")],
    );
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../bindings/tests/own-network.onnx");
    if std::env::var_os("PHASEFRONT_BLESS").is_some() {
        std::fs::write(path, &made).unwrap();
    }
    assert!(std::fs::read(path).unwrap() == made, "{path}");
}
